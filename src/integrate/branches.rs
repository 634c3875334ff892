//! The rays that go on from hits.

use super::direct::Direct;
use super::hits::{Shaded, Vertex8};
use super::wave::{Branch, Wave};
use crate::lanes::{Vec3x8, bits};
use crate::plan::Skip;

/// Rays to be traced later: reflected, refracted, scattered.
pub(super) type Later = [Vec<Branch>; 3];

impl Direct<'_> {
    /// Adds the rays that go on from hits.
    pub(super) fn branches(&self, wave: &Wave, shaded: &[Shaded], vertices: &[Vertex8], later: &mut Later) {
        let prune = self.plan.skips.allows(Skip::Bounces);
        let hits = |(p, vertex): (usize, &Vertex8)| bits(vertex.lanes).map(move |i| (p, i));
        for (p, i) in vertices.iter().enumerate().flat_map(hits) {
            let (vertex, shaded) = (&vertices[p], &shaded[p]);
            let color = Vec3x8::lane(&shaded.bsdf.color, i).map(f64::from).into();
            let (point, facing) = (vertex.point(i), vertex.facing(i, wave.exact[p].lane(i).1));
            let ways = self.materials.onward(vertex.materials[i]).ways(color, &facing);
            let (weight, path) = (wave.weight(p, i), wave.path(p, i).wrapping_mul(2));
            for (list, way) in [ways.0, ways.1].into_iter().enumerate() {
                let Some((dir, share)) = way else { continue };
                let share = share.as_vec3().to_array();
                let weight: [f32; 3] = std::array::from_fn(|k| share[k] * weight[k]);
                if prune && weight == [0.0; 3] {
                    continue;
                }
                let origin = shaded.leave(dir.dot(facing.n_g) > 0.0, shaded.error).lane(i);
                let path = path + list as u32;
                let (slot, density) = (wave.slot(p, i) as u32, f32::INFINITY);
                later[list].push(Branch { origin, exact: (point, dir), weight, density, slot, path });
            }
        }
    }
}
