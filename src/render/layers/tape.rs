//! From the engine's tiles to the layers of a block.

use super::LayerPlan;
use super::near::Near;
use super::sums::{LayerWork, Place, Sums};
use crate::accel::{Counts, PACKETS};
use crate::film::Window;
use crate::integrate::{RayCounts, RayKind, Record, Samples8, Seen, Silent, Summed, Taken};
use crate::lanes::{Float8, LANES, Mask8, Ray, Vec3x8};
use crate::plan::Owner;
use crate::reference;
use crate::render::{Frame, shutter};
use crate::scene::Aov;
use crate::shade::attributes;
use crate::shapes::{Ray64, RowRef};

/// Listens to the engine while it renders a block.
pub(in crate::render) struct LayerTape<'a, 's> {
    /// By moment; one where the shutter is open for no time.
    frames: &'a [Frame<'s>],
    plan: &'a LayerPlan<'s>,
    /// What depth is counted along; `None`: along each ray.
    axis: Option<[f32; 3]>,
    sums: Sums,
    tile: Box<Met>,
}

/// What the camera rays of a tile met.
struct Met {
    hit: [u32; PACKETS],
    normal: [Vec3x8; PACKETS],
    albedo: [Vec3x8; PACKETS],
    t: [Float8; PACKETS],
    depth: [Float8; PACKETS],
    rows: [Float8; PACKETS],
    owners: [[Owner; LANES]; PACKETS],
    materials: [[u32; LANES]; PACKETS],
}

impl Met {
    /// What a lane saw.
    #[inline(always)]
    fn near(&self, p: usize, i: usize, distance: f64, sample: u32) -> Near {
        if self.hit[p] >> i & 1 == 0 {
            return Near { distance, sample, ..Near::NONE };
        }
        Near {
            distance,
            t: self.t[p].as_array()[i],
            depth: self.depth[p].as_array()[i],
            row: RowRef::from_lane(self.rows[p].as_array()[i]),
            primitive: self.owners[p][i].primitive,
            material: self.materials[p][i],
            sample,
        }
    }
}

impl<'a, 's> LayerTape<'a, 's> {
    pub fn new(frames: &'a [Frame<'s>], plan: &'a LayerPlan<'s>, pixels: usize) -> Self {
        let zero = [Vec3x8::ZERO; PACKETS];
        let tile = Met {
            hit: [0; PACKETS],
            normal: zero,
            albedo: zero,
            t: [Float8::ZERO; PACKETS],
            depth: [Float8::ZERO; PACKETS],
            rows: [Float8::ZERO; PACKETS],
            owners: [[Owner::default(); LANES]; PACKETS],
            materials: [[0; LANES]; PACKETS],
        };
        let axis = frames[0].axis.map(|axis| axis.as_vec3().to_array());
        LayerTape { frames, plan, axis, sums: Sums::new(plan, pixels, frames[0].spp), tile: Box::new(tile) }
    }

    /// What comes next is seen at this moment.
    pub fn at(&mut self, moment: usize) {
        self.axis = self.frames[moment].axis.map(|axis| axis.as_vec3().to_array());
    }

    /// The layers of the block that was rendered.
    pub fn finish(self, block: Window) -> LayerWork {
        let LayerTape { frames, plan, sums, .. } = self;
        let frame = |near: &Near| &frames[shutter::moment(near.sample, frames.len(), frames[0].spp)];
        sums.finish(plan, |pixel, near| place(frame(near), block.pixel(pixel), near))
    }

    /// Of the samples of a packet the nearest to the centre of each pixel, the first of equals.
    fn add_near(&mut self, p: usize, count: usize, taken: &Taken) {
        let (pixels, distances) = (&taken.pixels[p], &taken.distances[p]);
        let mut i = 0;
        while i < count {
            let pixel = pixels[i];
            let near = &mut self.sums.near[pixel as usize];
            let (mut best, mut distance) = (LANES, near.distance);
            while i < count && pixels[i] == pixel {
                if distances[i] < distance {
                    (best, distance) = (i, distances[i]);
                }
                i += 1;
            }
            if best < LANES {
                *near = self.tile.near(p, best, distance, taken.samples[p].index[best]);
            }
        }
    }

    fn add_radiance(&mut self, summed: &Summed) {
        for (p, pixels) in summed.pixels.iter().enumerate() {
            let radiance = summed.samples.radiance[p].to_arrays();
            for (radiance, pixel) in radiance.iter().zip(pixels).take(summed.count - p * LANES) {
                self.sums.add_radiance(*pixel as usize, *radiance);
            }
        }
    }

    fn add_to_mattes(&mut self, p: usize, pixels: &[u32; LANES]) {
        for i in (0..LANES).filter(|i| self.tile.hit[p] >> i & 1 == 1) {
            let (owner, material) = (self.tile.owners[p][i], self.tile.materials[p][i]);
            self.sums.add_to_mattes(self.plan, pixels[i] as usize, owner.primitive, material);
        }
    }

    /// Spreads what some samples cost over their pixels.
    fn add_cost(&mut self, (count, pixels): (usize, &[[u32; LANES]]), tests: &Counts, rays: &RayCounts) {
        if !self.plan.layers.has(Aov::Cost) || count == 0 {
            return;
        }
        let share = 1.0 / count as f64;
        let all = |counts: &[u64]| counts.iter().sum::<u64>() as f64 * share;
        let (boxes, lanes) = (tests.boxes as f64 * share, all(&rays.packets) * LANES as f64);
        let cost = [boxes, all(&tests.kinds), all(&rays.rays), lanes];
        for pixel in pixels.iter().flatten().take(count) {
            let sum = &mut self.sums.cost[*pixel as usize];
            *sum = std::array::from_fn(|k| sum[k] + cost[k]);
        }
    }
}

impl Record for LayerTape<'_, '_> {
    const ON: bool = Silent::ON;
    fn tile(&mut self, _: usize, _: &mut dyn Iterator<Item = (i32, i32, u32)>) {}
    fn ray(&mut self, _: RayKind, _: Ray, _: Option<u32>, _: f32, _: usize, _: u32) {}
    fn shadow(&mut self, _: usize, _: Ray, _: bool, _: usize, _: u32) {}
    fn lit(&mut self, _: usize, _: usize, _: u32) {}
    fn seen(&mut self, _: usize, _: usize, _: u32) {}
    fn texture(&mut self, _: usize, _: i64, _: usize, _: u32) {}

    const SURFACES: bool = true;

    fn passes_blanks(&self) -> bool {
        // In all others a miss is what was there before.
        !self.plan.layers.has_any(&[Aov::Cost, Aov::Variance])
    }

    fn surface(&mut self, seen: &Seen) {
        let (p, tile) = (seen.packet, &mut self.tile);
        let dir = seen.rays.dir;
        tile.hit[p] = seen.hit;
        let hit = Mask8::from_bits(seen.hit);
        tile.normal[p] = Vec3x8::select(hit, seen.normal, Vec3x8::ZERO);
        tile.albedo[p] = Vec3x8::select(hit, seen.bsdf.reflectance(), Vec3x8::ZERO);
        (tile.t[p], tile.rows[p]) = (seen.rays.t_max, seen.rows);
        tile.depth[p] = seen.rays.t_max
            * match self.axis {
                Some(axis) => dir.dot(Vec3x8::splat(axis)),
                None => dir.length(),
            };
        (tile.owners[p], tile.materials[p]) = (*seen.owners, *seen.materials);
    }

    fn taken(&mut self, taken: &Taken) {
        for p in 0..taken.count.div_ceil(LANES) {
            let (count, pixels) = (LANES.min(taken.count - p * LANES), &taken.pixels[p]);
            if self.tile.hit[p] != 0 && !self.sums.normal.is_empty() {
                self.sums.normal.add8(&self.tile.normal[p], pixels);
            }
            if self.tile.hit[p] != 0 && !self.sums.albedo.is_empty() {
                self.sums.albedo.add8(&self.tile.albedo[p], pixels);
            }
            if !self.sums.near.is_empty() {
                self.add_near(p, count, taken);
            }
            if self.sums.want_mattes() {
                self.add_to_mattes(p, pixels);
            }
        }
        self.add_cost((taken.count, taken.pixels), &taken.tests, &taken.rays);
        self.tile.hit = [0; PACKETS];
    }

    fn summed(&mut self, summed: &Summed) {
        if self.sums.want_variance() {
            self.add_radiance(summed);
        }
        self.add_cost((summed.count, summed.pixels), &summed.tests, &summed.rays);
    }
}

/// What the nearest sample of a pixel sees, in f64 from its ray before that was rounded.
fn place(frame: &Frame, (x, y): (i32, i32), near: &Near) -> Place {
    let mut samples = Samples8::default();
    samples.set(0, (x, y), frame.rays.pattern(x, y), near.sample);
    let (origin, dir) = frame.rays.exact(&samples).lane(0);
    let ray = Ray64 { origin, dir, t_min: 0.0, t_max: f64::INFINITY };
    let stores = frame.tree.stores();
    let found = stores.refine(near.row, &ray, f64::from(near.t));
    let point = found.map_or(origin + dir * f64::from(near.t), |found| found.point);
    let owner = Owner { primitive: near.primitive, material: near.material };
    let uv = attributes::uv(&frame.plan, stores, near.row, owner, point);
    let line = reference::Ray { origin, dir, t_min: ray.t_min, t_max: ray.t_max };
    let margin = frame.judge.as_ref().and_then(|judge| judge.margin(&line, near.primitive as usize, f64::from(near.t)));
    Place { point: point + frame.plan.origin, uv, margin: margin.unwrap_or(0.0) }
}
