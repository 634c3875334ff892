//! From the engine's tiles to the layers of a block.

use super::LayerPlan;
use super::near::{Near, Nearest};
use super::sums::{LayerWork, Place, Places, Sums};
use crate::accel::PACKETS;
use crate::film::Window;
use crate::integrate::{Lit, RayKind, Record, Samples8, Seen, Silent, Spent, Summed, Taken};
use crate::lanes::{Float8, LANES, Mask8, Ray, Vec3x8, bits, first_least};
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
    /// Whether all packets are of one pixel each, and hold the same samples in any block.
    whole: bool,
    /// Whether each pixel has a single sample.
    single: bool,
    tile: [Packet; PACKETS],
}

/// The samples of a packet of the tile that is traced.
#[derive(Debug, Clone, Copy, Default)]
struct Packet {
    pixels: [u32; LANES],
    index: [u32; LANES],
    /// Lanes that are the nearest to the centres of their pixels.
    nearest: u32,
    /// Where all lanes are the only samples of 4 x 2 pixels, the place of those below the first.
    below: Option<usize>,
}

impl Packet {
    fn lanes_of(&self, pixel: u32) -> u32 {
        (0..LANES).fold(0, |lanes, i| lanes | u32::from(self.pixels[i] == pixel) << i)
    }
}

/// All lanes of a packet.
const ALL: u32 = (1 << LANES) - 1;

/// A sample of a later packet is nearer to the centre of a pixel than those of the packets before.
fn forget(packets: &mut [Packet], pixel: u32) {
    // The samples of a pixel follow each other.
    for packet in packets.iter_mut().rev().take_while(|packet| packet.pixels[LANES - 1] == pixel) {
        packet.nearest &= !packet.lanes_of(pixel);
    }
}

impl<'a, 's> LayerTape<'a, 's> {
    pub fn new(frames: &'a [Frame<'s>], plan: &'a LayerPlan<'s>, block: Window) -> Self {
        let axis = frames[0].axis.map(|axis| axis.as_vec3().to_array());
        // To a noise level a pixel takes what it needs.
        let spp = frames[0].noise.is_none().then_some(frames[0].spp);
        let whole = frames.len() == 1 && spp.is_some_and(|spp| (spp as usize).is_multiple_of(LANES));
        let sums = Sums::new(plan, block.area(), spp);
        LayerTape { frames, plan, axis, sums, whole, single: spp == Some(1), tile: Default::default() }
    }

    /// What comes next is seen at this moment.
    pub fn at(&mut self, moment: usize) {
        self.axis = self.frames[moment].axis.map(|axis| axis.as_vec3().to_array());
    }

    /// How many samples each pixel had, where that was not known before.
    pub fn took(&mut self, samples: &[u32]) {
        self.sums.took(samples);
    }

    /// The layers of the block that was rendered.
    pub fn finish(self, block: Window) -> LayerWork {
        let LayerTape { frames, plan, sums, .. } = self;
        let frame = |near: &Near| &frames[shutter::moment(near.sample, frames.len(), frames[0].spp)];
        sums.finish(plan, |pixel, near| place(frame(near), block.pixel(pixel), near))
    }

    /// The samples of a tile whose packets are of one pixel each: those of a pixel follow each other.
    fn take_whole(&mut self, taken: &Taken) {
        let (nearest, tile) = (self.sums.nearest(), &mut self.tile);
        let packets = taken.count / LANES;
        for (p, packet) in tile.iter_mut().enumerate().take(packets) {
            let (pixels, index) = (taken.pixels[p], taken.samples[p].index);
            *packet = Packet { pixels, index, nearest: 0, below: None };
        }
        let mut p = 0;
        while nearest.chooses() && p < packets {
            let (pixel, mut best) = (tile[p].pixels[0], p);
            let (mut lane, mut distance) = first_least(&taken.distances[p]);
            p += 1;
            while p < packets && tile[p].pixels[0] == pixel {
                let next = first_least(&taken.distances[p]);
                if next.1 < distance {
                    (best, (lane, distance)) = (p, next);
                }
                p += 1;
            }
            tile[best].nearest = nearest.choose_if(pixel as usize, (lane, distance));
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
}

/// How far hits are along the view axis, or along their rays.
#[inline(always)]
fn depth(axis: Option<[f32; 3]>, t: Float8, dir: Vec3x8) -> Float8 {
    t * axis.map_or_else(|| dir.length(), |axis| dir.dot(Vec3x8::splat(axis)))
}

/// Adds what those of a packet's samples see that are the nearest of their pixels.
#[inline(always)]
fn add_nearest(plan: &LayerPlan, all: &mut Nearest, packet: &Packet, (nearest, depth): (u32, Float8), seen: &Seen) {
    let (t, rows, objects) = (seen.rays.t_max.to_array(), seen.rows.to_array(), &plan.objects);
    let near = |i: usize| Near {
        t: t[i],
        row: RowRef::from_lane(rows[i]),
        primitive: seen.owners[i].primitive,
        material: seen.materials[i],
        sample: packet.index[i],
    };
    if nearest.is_power_of_two() {
        let i = nearest.trailing_zeros() as usize;
        all.see(packet.pixels[i] as usize, near(i), depth.to_array()[i], objects.of(seen.owners[i].primitive));
    } else {
        let places = Places { pixels: &packet.pixels, lanes: nearest, whole: false, below: packet.below };
        let mut primitives = [0; LANES];
        (0..LANES).for_each(|i| primitives[i] = seen.owners[i].primitive);
        all.see8(&places, depth, [objects.of_all(primitives), *seen.materials], near);
    }
}

#[inline(never)]
fn add_to_mattes(plan: &LayerPlan, sums: &mut Sums, packet: &Packet, seen: &Seen) {
    for i in bits(seen.hit) {
        sums.add_to_mattes(plan, packet.pixels[i] as usize, seen.owners[i].primitive, seen.materials[i]);
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

    fn counts_tiles(&self) -> bool {
        self.plan.layers.has(Aov::Cost)
    }

    fn taken(&mut self, taken: &Taken) {
        if self.whole {
            return self.take_whole(taken);
        }
        let packets = taken.samples.iter().zip(taken.pixels).zip(taken.distances);
        for (p, ((samples, pixels), distances)) in packets.enumerate() {
            let count = LANES.min(taken.count - p * LANES);
            let nearest = self.sums.nearest().choose(pixels, distances, count);
            let (before, rest) = self.tile.split_at_mut(p);
            let below = (self.single && taken.squares >> p & 1 == 1).then(|| pixels[LANES / 2] as usize);
            rest[0] = Packet { pixels: *pixels, index: samples.index, nearest, below };
            let goes_on = before.last().is_some_and(|packet| packet.pixels[LANES - 1] == pixels[0]);
            if goes_on && nearest & rest[0].lanes_of(pixels[0]) != 0 {
                forget(before, pixels[0]);
            }
        }
    }

    #[inline(always)]
    fn surface(&mut self, seen: &Seen) {
        let LayerTape { tile, sums, plan, axis, whole, .. } = self;
        let packet = &tile[seen.packet];
        let places = Places { pixels: &packet.pixels, lanes: seen.hit, whole: *whole, below: packet.below };
        if sums.filtered.is_asked() {
            let (mut normal, mut albedo) = (seen.normal, seen.bsdf.reflectance());
            if seen.hit != ALL {
                let hit = Mask8::from_bits(seen.hit);
                [normal, albedo] = [normal, albedo].map(|value| Vec3x8::select(hit, value, Vec3x8::ZERO));
            }
            sums.filtered.add8(&normal, &albedo, &places);
        }
        let nearest = packet.nearest & seen.hit;
        if nearest != 0 {
            let depth = depth(*axis, seen.rays.t_max, seen.rays.dir);
            add_nearest(plan, sums.nearest(), packet, (nearest, depth), seen);
        }
        if sums.want_mattes() {
            add_to_mattes(plan, sums, packet, seen);
        }
    }

    fn lamps(&mut self, lit: &Lit) {
        let packet = self.tile[lit.packet];
        let (t, dir) = (lit.rays.t_max, lit.rays.dir);
        let (depth, t) = (depth(self.axis, t, dir).to_array(), t.to_array());
        for (i, light) in lit.lights.iter().enumerate().filter_map(|(i, light)| Some((i, (*light)?))) {
            let near = || Near::light(t[i], self.plan.light_key(Aov::CryptoMaterial, light), packet.index[i]);
            let nearest = (packet.nearest >> i & 1 == 1).then(|| (near(), depth[i]));
            self.sums.add_light(self.plan, packet.pixels[i] as usize, light, nearest);
        }
        // What surfaces are told of later is not to set these pixels.
        self.tile[lit.packet].below = None;
    }

    fn summed(&mut self, summed: &Summed) {
        if self.sums.want_variance() {
            self.add_radiance(summed);
        }
    }

    /// Spreads what some samples cost over their pixels.
    fn spent(&mut self, spent: &Spent) {
        let (tests, rays, share) = (&spent.tests, &spent.rays, 1.0 / spent.count as f64);
        let all = |counts: &[u64]| counts.iter().sum::<u64>() as f64 * share;
        let (boxes, lanes) = (tests.boxes as f64 * share, all(&rays.packets) * LANES as f64);
        let cost = [boxes, all(&tests.kinds), all(&rays.rays), lanes];
        for pixel in spent.pixels.iter().flatten().take(spent.count) {
            let sum = &mut self.sums.cost[*pixel as usize];
            *sum = std::array::from_fn(|k| sum[k] + cost[k]);
        }
    }
}

/// What the nearest sample of a pixel sees, in f64 from its ray before that was rounded.
fn place(frame: &Frame, (x, y): (i32, i32), near: &Near) -> Place {
    let mut samples = Samples8::default();
    samples.set(0, (x, y), frame.rays.pattern(x, y), near.sample);
    let (origin, dir) = frame.rays.exact(&samples).lane(0);
    let ray = Ray64 { origin, dir, t_min: 0.0, t_max: f64::INFINITY };
    if near.is_light() {
        return Place { point: origin + dir * f64::from(near.t) + frame.plan.origin, ..Place::NONE };
    }
    let stores = frame.tree.stores();
    let found = stores.refine(near.row, &ray, f64::from(near.t));
    let point = found.map_or(origin + dir * f64::from(near.t), |found| found.point);
    let owner = Owner { primitive: near.primitive, material: near.material };
    let uv = attributes::uv(&frame.plan, stores, near.row, owner, point);
    let line = reference::Ray { origin, dir, t_min: ray.t_min, t_max: ray.t_max };
    let margin = frame.judge.as_ref().and_then(|judge| judge.margin(&line, near.primitive as usize, f64::from(near.t)));
    Place { point: point + frame.plan.origin, uv, margin: margin.unwrap_or(0.0) }
}
