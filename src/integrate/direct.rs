//! Direct light with mirror reflection and refraction, and what other integrators have in common with it.
//!
//! Source: Whitted, "An improved illumination model for shaded display", Communications of the ACM
//! 23(6), 1980; what each material and light does is said in [`scene`](crate::scene).

use std::slice::from_mut;

use super::branches::Later;
use super::camera::Samples8;
use super::hits::{Shaded, Vertex8};
use super::lamps::Lamps;
use super::record::{RayCounts, RayKind, Record};
use super::shadows::Shadows;
use super::wave::{Branch, WAVE, Wave, Whose};
use crate::accel::{PACKETS, Tile, Tree, Walk};
use crate::lanes::{Float8, LANES, Mask8, Vec3x8, bits, float8};
use crate::plan::{LeftOut, Plan, Skip};
use crate::scene::{Integrator, RenderSettings};
use crate::shade::{Backdrop8, LightTable, MaterialTable};

/// All that is needed to find the radiance along rays.
#[derive(Debug)]
pub struct Direct<'s> {
    pub(super) plan: &'s Plan<'s>,
    pub(super) tree: &'s Tree,
    pub(super) materials: MaterialTable,
    pub(super) lights: LightTable,
    backdrop: Backdrop8<'s>,
    pub(super) ambient: Option<Vec3x8>,
    pub(super) lamps: &'s Lamps<'s>,
    pub(super) settings: RenderSettings,
    /// Some light has primitives that nothing can put in its shadow.
    pub(super) frees: bool,
}

/// Radiance and alpha of samples, by packet.
#[derive(Debug, Default)]
pub struct Samples {
    /// Linear Rec. 709.
    pub radiance: Vec<Vec3x8>,
    /// 1 where a surface or the backdrop is seen.
    pub alpha: Vec<Float8>,
}

/// Room for work, and its counts: one a thread.
#[derive(Debug)]
pub struct Room {
    /// Tests done.
    pub walk: Walk,
    /// Rays traced.
    pub rays: RayCounts,
    /// Work left out.
    pub left_out: LeftOut,
    /// The rays that are traced next: the caller sets the packets of camera rays.
    pub wave: Box<Wave>,
    /// What became of the samples since [`Room::begin`].
    pub samples: Samples,
    /// What numbers the samples since then draw, by packet, where [`Direct::draws`] any.
    pub seeds: Vec<Samples8>,
    /// Later rays.
    tiles: Vec<Tile>,
    /// Light that waits.
    pub(super) shadows: Shadows,
    /// Rays that look for lights.
    scratch: Box<Tile>,
    shaded: Vec<Shaded>,
    vertices: Vec<Vertex8>,
    later: Later,
}

/// Where the light on a wave goes, and what that takes.
pub(super) struct Sink<'a, R: Record> {
    /// Along the rays of the wave.
    pub radiance: &'a mut [Vec3x8; PACKETS],
    pub seeds: &'a [Samples8],
    pub shadows: &'a mut Shadows,
    pub scratch: &'a mut Tile,
    pub walk: &'a mut Walk,
    pub left_out: &'a mut LeftOut,
    pub record: &'a mut R,
}

impl Default for Room {
    fn default() -> Self {
        Room {
            walk: Walk::default(),
            rays: RayCounts::default(),
            left_out: LeftOut::default(),
            wave: Box::new(Wave::empty()),
            samples: Samples::default(),
            seeds: Vec::new(),
            tiles: Vec::new(),
            shadows: Shadows::default(),
            scratch: Box::new(Tile::empty()),
            shaded: vec![Shaded::NOTHING; PACKETS],
            vertices: vec![Vertex8::default(); PACKETS],
            later: Later::default(),
        }
    }
}

impl Room {
    /// Begins with new samples.
    pub fn begin(&mut self) {
        self.samples.radiance.clear();
        self.samples.alpha.clear();
        self.seeds.clear();
    }

    /// The wave for the next 64 camera rays.
    pub fn camera_wave(&mut self, common: Option<[f32; 3]>) -> &mut Wave {
        let first = self.samples.radiance.len();
        self.samples.radiance.resize(first + PACKETS, Vec3x8::ZERO);
        self.samples.alpha.resize(first + PACKETS, Float8::ZERO);
        self.wave.begin(first * LANES, common);
        &mut self.wave
    }
}

impl<'s> Direct<'s> {
    /// Makes tables of the plan's materials and lights.
    pub fn new(plan: &'s Plan<'s>, tree: &'s Tree, lamps: &'s Lamps<'s>, settings: RenderSettings) -> Self {
        let ambient = plan.scene.ambient.as_vec3().to_array();
        let is_needed = ambient != [0.0; 3] || !plan.skips.allows(Skip::Shading);
        Direct {
            plan,
            tree,
            materials: MaterialTable::new(plan.scene),
            lights: LightTable::new(plan),
            backdrop: Backdrop8::new(&plan.scene.background.backdrop),
            ambient: is_needed.then(|| Vec3x8::splat(ambient)),
            lamps,
            settings,
            frees: plan.unshadowed.iter().any(Option::is_some),
        }
    }

    /// Whether rays are to be given in f64 as well, since rays may go on from what they meet.
    pub fn goes_on(&self) -> bool {
        self.is_path() || self.plan.scatters || !self.plan.skips.allows(Skip::Bounces)
    }

    /// Whether samples draw numbers for light.
    pub fn draws(&self) -> bool {
        let looks_around = self.settings.ambient_occlusion && self.ambient.is_some();
        self.settings.integrator != Integrator::Direct || looks_around || self.lamps.draws()
    }

    #[inline(always)]
    pub(super) fn is_path(&self) -> bool {
        self.settings.integrator == Integrator::Path
    }

    /// Traces the camera rays of the wave, which where [`Direct::goes_on`] keep what they were before they were
    /// rounded; without `sees` it is known that they meet no primitive. What goes on from them waits for
    /// [`Direct::finish`].
    pub fn trace_camera<R: Record>(&self, sees: bool, room: &mut Room, record: &mut R) {
        let (kind, count) = (RayKind::Camera as usize, room.wave.count());
        if sees {
            let redecided = room.walk.counts.redecided;
            self.tree.closest_tiles(from_mut(&mut room.wave.tile), &mut room.walk);
            room.rays.rays[kind] += count;
            room.rays.redecided[kind] += room.walk.counts.redecided - redecided;
        } else {
            room.left_out[Skip::Background] += count;
        }
        self.light(room, record);
    }

    /// Radiance and alpha of camera rays that meet no primitive, where they are all the same.
    pub fn blank(&self) -> Option<[f32; 4]> {
        if self.lamps.are_seen() {
            return None;
        }
        match (self.plan.scene.background.transparent, &self.backdrop) {
            (true, _) => Some([0.0; 4]),
            (false, Backdrop8::Color(color)) => {
                let [r, g, b] = color.lane(0);
                Some([r, g, b, 1.0])
            }
            (false, Backdrop8::Gradient(..) | Backdrop8::Image(..)) => None,
        }
    }

    /// Traces all that still waits since [`Room::begin`]: then the samples are complete.
    pub fn finish<R: Record>(&self, room: &mut Room, record: &mut R) {
        if self.goes_on() {
            self.trace_later(room, record);
        }
        self.settle(room, record);
    }

    /// Traces what goes on from the camera rays since [`Room::begin`], depth by depth, so that few of the tiles are
    /// not full. All rays of a sample keep their order, whatever other samples are there: so sums do as well.
    fn trace_later<R: Record>(&self, room: &mut Room, record: &mut R) {
        for depth in 2..=self.settings.max_depth {
            let later = std::mem::take(&mut room.later);
            let kinds = [RayKind::Reflection, RayKind::Refraction, RayKind::Bounce];
            for (kind, branches) in kinds.into_iter().zip(later) {
                self.find_later(&branches, kind, room);
                let mut tiles = std::mem::take(&mut room.tiles);
                for (branches, tile) in branches.chunks(WAVE).zip(&mut tiles) {
                    room.wave.fill(tile, branches, kind, depth);
                    self.light(room, record);
                }
                room.tiles = tiles;
            }
            if room.later.iter().all(Vec::is_empty) {
                break;
            }
        }
        room.later.iter_mut().for_each(Vec::clear);
    }

    /// Finds what later rays meet, all together.
    fn find_later(&self, branches: &[Branch], kind: RayKind, room: &mut Room) {
        room.tiles.resize_with(branches.len().div_ceil(WAVE), Tile::empty);
        for (branches, tile) in branches.chunks(WAVE).zip(&mut room.tiles) {
            Branch::set_tile(branches, tile);
        }
        let redecided = room.walk.counts.redecided;
        self.tree.closest_tiles(&mut room.tiles, &mut room.walk);
        room.rays.rays[kind as usize] += branches.len() as u64;
        room.rays.redecided[kind as usize] += room.walk.counts.redecided - redecided;
    }

    /// Shades what the rays of the wave met.
    fn light<R: Record>(&self, room: &mut Room, record: &mut R) {
        let Room { walk, rays, left_out, wave, samples, seeds, shadows, scratch, shaded, vertices, later, .. } = room;
        let kind = wave.kind as usize;
        let live: [u32; PACKETS] = std::array::from_fn(|p| wave.tile.packets[p].live().bits());
        let wave = &**wave;
        let mut radiance = [Vec3x8::ZERO; PACKETS];
        let mut seen = 0;
        vertices.iter_mut().for_each(|vertex| vertex.lanes = 0);
        let taken = {
            let (shadows, scratch, walk) = (&mut *shadows, &mut **scratch, &mut *walk);
            let (left_out, record) = (&mut *left_out, &mut *record);
            let sink = &mut Sink { radiance: &mut radiance, seeds, shadows, scratch, walk, left_out, record };
            self.meet_lamps(wave, &live, sink)
        };
        for (p, live) in live.into_iter().enumerate().filter(|(_, live)| *live != 0) {
            let hit = live & wave.tile.met(p).bits();
            rays.hits[kind] += u64::from(hit.count_ones());
            rays.packets[kind] += 1;
            if R::ON {
                self.tell(wave, p, live, record);
            }
            self.add_background(wave, p, live & !hit & !taken[p], &mut radiance[p], samples);
            let hit = hit & !taken[p];
            if hit != 0 {
                seen |= 1 << p;
                self.shade(wave, (p, hit), &mut shaded[p], &mut vertices[p], record);
                self.add_ambient(wave, &shaded[p], &mut radiance[p]);
            }
        }
        let sink = &mut Sink { radiance: &mut radiance, seeds, shadows, scratch, walk, left_out, record };
        match self.settings.integrator {
            Integrator::Ao => self.add_openness(wave, (shaded, seen), sink),
            Integrator::Direct | Integrator::Path => {
                for light in self.lights.iter() {
                    self.add_light(light, wave, (shaded, seen), sink);
                }
                self.add_lamps(wave, (shaded, seen), sink);
                self.add_open_ambient(wave, (shaded, seen), sink);
            }
        }
        if wave.depth < self.settings.max_depth && self.goes_on() {
            match self.settings.integrator {
                Integrator::Path => self.take_ways(wave, shaded, vertices, seeds, later),
                Integrator::Direct | Integrator::Ao => self.branches(wave, shaded, vertices, later),
            }
        }
        shadows.end_wave(wave, live, radiance);
        self.settle_many(room, record);
    }

    fn tell<R: Record>(&self, wave: &Wave, p: usize, live: u32, record: &mut R) {
        let t = wave.tile.packets[p].t_max.to_array();
        for i in bits(live) {
            let row = wave.tile.hit(p, i);
            let met = row.kind().map(|kind| self.tree.stores().owner(kind, row.row()).primitive);
            record.ray(wave.kind, wave.ray(p, i, f32::INFINITY), met, t[i], wave.slot(p, i), wave.path(p, i));
        }
    }

    #[inline(always)]
    fn add_background(&self, wave: &Wave, p: usize, miss: u32, radiance: &mut Vec3x8, samples: &mut Samples) {
        let camera = wave.kind == RayKind::Camera;
        let transparent = camera && self.plan.scene.background.transparent;
        if camera {
            let opaque = if transparent { !miss } else { !0 };
            let alpha = Mask8::from_bits(opaque & 0xff).select(float8(1.0), Float8::ZERO);
            samples.alpha[wave.slot(p, 0) / LANES] = alpha;
        }
        if miss != 0 && !transparent {
            let mut seen = self.backdrop.radiance(wave.tile.packets[p].dir, miss);
            if wave.kind == RayKind::Bounce {
                seen = self.weigh_background(wave, p, miss, seen);
            }
            let seen = wave.weighted(p, seen);
            *radiance = Vec3x8::select(Mask8::from_bits(miss), *radiance + seen, *radiance);
        }
    }

    #[inline(always)]
    fn add_ambient(&self, wave: &Wave, shaded: &Shaded, radiance: &mut Vec3x8) {
        let is_open = self.settings.integrator != Integrator::Ao && !self.settings.ambient_occlusion;
        if let Some(ambient) = self.ambient.filter(|_| is_open) {
            let albedo = shaded.bsdf.color * shaded.bsdf.diffuse;
            let seen = wave.weighted(shaded.packet, albedo.scale(ambient));
            *radiance = Vec3x8::select(Mask8::from_bits(shaded.hit), *radiance + seen, *radiance);
        }
    }
}

impl Samples {
    /// Adds what was found along the rays of a wave; camera rays are the first of their samples.
    pub(super) fn add(&mut self, whose: &Whose, live: &[u32; PACKETS], radiance: &[Vec3x8; PACKETS]) {
        if let Some(first) = whose.first {
            let first = first / LANES;
            self.radiance[first..first + PACKETS].copy_from_slice(radiance);
            return;
        }
        for (p, live) in live.iter().enumerate().filter(|(_, live)| **live != 0) {
            let values = radiance[p].to_arrays();
            for i in bits(*live) {
                let slot = whose.slot(p, i);
                let sums = &mut self.radiance[slot / LANES];
                sums.x.as_mut_array()[slot % LANES] += values[i][0];
                sums.y.as_mut_array()[slot % LANES] += values[i][1];
                sums.z.as_mut_array()[slot % LANES] += values[i][2];
            }
        }
    }
}
