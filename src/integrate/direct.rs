//! Direct light with mirror reflection and refraction.
//!
//! Source: Whitted, "An improved illumination model for shaded display", Communications of the ACM
//! 23(6), 1980; what each material and light does is said in [`scene`](crate::scene).

use super::hits::Shaded;
use super::record::{RayCounts, RayKind, Record};
use super::wave::{Branch, Wave, lanes};
use crate::accel::{PACKETS, Tile, Tree, Walk};
use crate::lanes::{Float8, LANES, Mask8, Vec3x8, float8};
use crate::plan::Plan;
use crate::shade::{Backdrop8, LightTable, MaterialTable};
use crate::shapes::RowRef;

/// All that is needed to find the radiance along rays.
#[derive(Debug)]
pub struct Direct<'s> {
    pub(super) plan: &'s Plan<'s>,
    pub(super) tree: &'s Tree,
    pub(super) materials: MaterialTable,
    pub(super) lights: LightTable,
    backdrop: Backdrop8<'s>,
    ambient: Vec3x8,
    max_depth: u32,
    /// Leaves out rays that cannot change the picture.
    pub(super) skip: bool,
}

/// Radiance and alpha of the samples of one tile.
#[derive(Debug, Clone)]
pub struct Samples {
    /// Linear Rec. 709 by packet.
    pub radiance: [Vec3x8; PACKETS],
    /// 1 where a surface or the backdrop is seen.
    pub alpha: [Float8; PACKETS],
}

/// Room for work, and its counts: one a thread.
#[derive(Debug, Default)]
pub struct Room {
    /// Tests done.
    pub walk: Walk,
    /// Rays traced.
    pub rays: RayCounts,
    /// Tiles that are done with; boxed, since they go from hand to hand and are large.
    #[allow(clippy::vec_box)] // or each would be copied in and out
    pub(super) tiles: Vec<Box<Tile>>,
    /// Hits that are being shaded.
    shaded: Vec<Shaded>,
}

impl Room {
    /// A tile whose packets are to be set.
    pub fn tile(&mut self, common: Option<[f32; 3]>) -> Box<Tile> {
        let mut tile = self.tiles.pop().unwrap_or_else(|| Box::new(Tile::empty()));
        tile.renew(common);
        tile
    }
}

/// Where the work on one tile goes.
pub(super) struct Sink<'a, R: Record> {
    pub samples: &'a mut Samples,
    pub room: &'a mut Room,
    pub record: &'a mut R,
}

/// Up to 64 rays that are traced later.
struct Later {
    branches: Vec<Branch>,
    kind: RayKind,
    depth: u32,
}

impl<'s> Direct<'s> {
    /// Makes tables of the plan's materials and lights.
    pub fn new(plan: &'s Plan<'s>, tree: &'s Tree, max_depth: u32, skip: bool) -> Self {
        Direct {
            plan,
            tree,
            materials: MaterialTable::new(plan.scene),
            lights: LightTable::new(plan),
            backdrop: Backdrop8::new(&plan.scene.background.backdrop),
            ambient: Vec3x8::splat(plan.scene.ambient.as_vec3().to_array()),
            max_depth,
            skip,
        }
    }

    /// Whether rays go on from some material, so that rays are to be given in f64 as well.
    pub fn scatters(&self) -> bool {
        self.plan.scatters
    }

    /// Radiance along camera rays, which where [`Direct::scatters`] keep what they were before they were
    /// rounded. What goes on from them waits on a list, not on the stack: chains may be long.
    pub fn radiance<R: Record>(&self, wave: Wave, room: &mut Room, record: &mut R) -> Samples {
        let mut samples = Samples { radiance: [Vec3x8::ZERO; PACKETS], alpha: [Float8::ZERO; PACKETS] };
        let mut sink = Sink { samples: &mut samples, room, record };
        let mut waiting = Vec::new();
        self.trace(wave, &mut sink, &mut waiting);
        while let Some(Later { branches, kind, depth }) = waiting.pop() {
            let tile = sink.room.tile(None);
            self.trace(Wave::of_branches(tile, &branches, kind, depth), &mut sink, &mut waiting);
        }
        samples
    }

    fn trace<R: Record>(&self, mut wave: Wave, sink: &mut Sink<R>, waiting: &mut Vec<Later>) {
        let live: [u32; PACKETS] = std::array::from_fn(|p| wave.tile.packets[p].live().bits());
        let redecided = sink.room.walk.counts.redecided;
        self.tree.closest_tiles(std::slice::from_mut(&mut wave.tile), &mut sink.room.walk);
        sink.room.rays.redecided[wave.kind as usize] += sink.room.walk.counts.redecided - redecided;
        let mut shaded = std::mem::take(&mut sink.room.shaded);
        for (p, live) in live.into_iter().enumerate().filter(|(_, live)| *live != 0) {
            let hit = lanes(live).filter(|i| wave.tile.hit(p, *i) != RowRef::MISS).map(|i| 1 << i).sum::<u32>();
            sink.room.rays.rays[wave.kind as usize] += u64::from(live.count_ones());
            sink.room.rays.hits[wave.kind as usize] += u64::from(hit.count_ones());
            if R::ON {
                self.tell(&wave, p, live, sink.record);
            }
            self.add_background(&wave, p, live & !hit, sink.samples);
            if hit != 0 {
                shaded.push(self.shade(&wave, p, hit, sink.record));
            }
        }
        self.add_ambient(&wave, &shaded, sink.samples);
        for light in self.lights.iter().enumerate() {
            self.add_light(light, &wave, &shaded, sink);
        }
        if wave.depth < self.max_depth && self.plan.scatters {
            let (reflected, refracted) = self.branches(&wave, &shaded);
            // The last one in is the first one out.
            for (kind, branches) in [(RayKind::Refraction, refracted), (RayKind::Reflection, reflected)] {
                if !branches.is_empty() {
                    waiting.push(Later { branches, kind, depth: wave.depth + 1 });
                }
            }
        }
        shaded.clear();
        sink.room.shaded = shaded;
        sink.room.tiles.push(wave.tile);
    }

    fn tell<R: Record>(&self, wave: &Wave, p: usize, live: u32, record: &mut R) {
        let t = wave.tile.packets[p].t_max.to_array();
        for i in lanes(live) {
            let row = wave.tile.hit(p, i);
            let met = row.kind().map(|kind| self.tree.stores().owner(kind, row.row()).primitive);
            record.ray(wave.kind, wave.ray(p, i, f32::INFINITY), met, t[i], wave.slot(p, i), wave.paths[p][i]);
        }
    }

    fn add_background(&self, wave: &Wave, p: usize, miss: u32, samples: &mut Samples) {
        let camera = wave.kind == RayKind::Camera;
        let transparent = camera && self.plan.scene.background.transparent;
        if camera {
            let opaque = if transparent { !miss } else { !0 };
            samples.alpha[p] = Mask8::from_bits(opaque & 0xff).select(float8(1.0), Float8::ZERO);
        }
        if miss != 0 && !transparent {
            let radiance = self.backdrop.radiance(wave.tile.packets[p].dir, miss);
            samples.add(wave, p, radiance.scale(wave.weight[p]), miss);
        }
    }

    fn add_ambient(&self, wave: &Wave, shaded: &[Shaded], samples: &mut Samples) {
        for shaded in shaded {
            let p = shaded.packet;
            let albedo = shaded.bsdf.color * shaded.bsdf.diffuse;
            samples.add(wave, p, albedo.scale(self.ambient).scale(wave.weight[p]), shaded.hit);
        }
    }
}

impl Samples {
    /// Adds radiance to the samples of some lanes.
    #[inline(always)]
    pub(super) fn add(&mut self, wave: &Wave, p: usize, radiance: Vec3x8, mask: u32) {
        if wave.slots.is_none() {
            let radiance = Vec3x8::select(Mask8::from_bits(mask), radiance, Vec3x8::ZERO);
            self.radiance[p] = self.radiance[p] + radiance;
            return;
        }
        let values = radiance.to_arrays();
        for i in lanes(mask) {
            let slot = wave.slot(p, i);
            let sums = &mut self.radiance[slot / LANES];
            sums.x.as_mut_array()[slot % LANES] += values[i][0];
            sums.y.as_mut_array()[slot % LANES] += values[i][1];
            sums.z.as_mut_array()[slot % LANES] += values[i][2];
        }
    }
}
