//! The rays that go on from hits.

use glam::DVec3;

use super::direct::Direct;
use super::hits::{Exact, Shaded};
use super::wave::{Branch, Wave, lanes};
use crate::lanes::Vec3x8;

impl Direct<'_> {
    /// The rays that go on: reflected, refracted.
    pub(super) fn branches(&self, wave: &Wave, shaded: &[Shaded]) -> (Vec<Branch>, Vec<Branch>) {
        let (mut reflected, mut refracted) = (Vec::new(), Vec::new());
        for shaded in shaded {
            let (p, Some(exact)) = (shaded.packet, &shaded.exact) else { continue };
            let origins = [shaded.leave(false, shaded.error), shaded.leave(true, shaded.error)].map(Vec3x8::to_arrays);
            let (colors, weights) = (shaded.bsdf.color.to_arrays(), wave.weight[p].to_arrays());
            for i in lanes(shaded.hit) {
                let color = DVec3::from_array(colors[i].map(f64::from));
                let Exact { point, facing, material } = &exact[i];
                let (mirrored, through) = self.materials.onward(*material).ways(color, facing);
                let path = wave.paths[p][i].wrapping_mul(2);
                for (list, way, path) in [(&mut reflected, mirrored, path), (&mut refracted, through, path + 1)] {
                    let Some((dir, share)) = way else { continue };
                    let share = share.as_vec3().to_array();
                    let weight: [f32; 3] = std::array::from_fn(|k| share[k] * weights[i][k]);
                    if self.skip && weight == [0.0; 3] {
                        continue;
                    }
                    let origin = origins[usize::from(dir.dot(facing.n_g) > 0.0)][i];
                    let slot = wave.slot(p, i) as u8;
                    list.push(Branch { origin, exact: (*point, dir), weight, slot, path });
                }
            }
        }
        (reflected, refracted)
    }
}
