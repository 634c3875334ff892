//! Layers beside the colour, from what the beauty's own camera rays meet.
//!
//! | file | what it says |
//! |---|---|
//! | `sums` | a block's layers in the making, sample by sample, and as channels |
//! | `filtered` | normals and albedos, and their means |
//! | `near` | the sample nearest to a pixel's centre, and the variance of a mean |
//! | `matte` | ids and their coverage |
//! | `tape` | how the engine's tiles get there |

mod filtered;
mod matte;
mod near;
mod sums;
mod tape;

use std::collections::{BTreeMap, BTreeSet};
use std::mem::take;

use glam::DVec3;
use rayon::prelude::*;

pub(super) use self::near::Near;
pub(super) use self::sums::{LayerWork, Place, Sums};
pub(super) use self::tape::LayerTape;

use super::adaptive::Effort;
use super::{Renderer, shutter};
use crate::film::{Channel, Cryptomatte, Picture, SampleKind, Samples, Window};
use crate::scene::{Aov, Camera, Layers, Objects, Scene, carried};

/// The depth of a miss: finite, so that filters do not spread infinity.
pub(super) const MISS_DEPTH: f32 = 1e10;

/// The margin of a miss, and the most that one is: finite as well.
pub(super) const MOST_MARGIN: f64 = 1e10;

/// Pixels of a picture that no ray was sent through, as if each had met nothing and nothing were behind.
pub(super) fn missed(hollow: &Picture, window: Window) -> Picture {
    let channel = |channel: &Channel| {
        let mut samples = channel.samples.kind().zeros(window.area());
        let miss = match channel.layer() {
            "depth" => MISS_DEPTH,
            "margin" => MOST_MARGIN as f32,
            _ => 0.0,
        };
        if let (true, Samples::Float(samples)) = (miss > 0.0, &mut samples) {
            samples.fill(miss);
        }
        Channel { name: channel.name.clone(), samples }
    };
    let channels = hollow.channels.iter().map(channel).collect();
    Picture { channels, ..Picture::new(hollow.display, window) }
}

/// Keys that each Cryptomatte shows.
pub(super) type Seen = [BTreeSet<u32>; Aov::CRYPTOMATTES.len()];

/// What the layers of one frame need to know of its scene.
#[derive(Debug)]
pub(super) struct LayerPlan<'s> {
    pub layers: Layers,
    scene: &'s Scene,
    camera: &'s Camera,
    display: (u32, u32),
    /// Scene and camera at the next frame.
    next: Option<(&'s Scene, &'s Camera)>,
    /// The scene while the shutter is open, where that is for some time.
    moments: &'s [Scene],
    spp: u32,
    pub objects: Objects,
    /// Bits of the ids of each Cryptomatte that is asked for, by key.
    ids: [Vec<u32>; Aov::CRYPTOMATTES.len()],
}

impl<'s> LayerPlan<'s> {
    pub fn new(renderer: &Renderer<'s>, layers: Layers) -> Self {
        let Renderer { scene, camera, moments, .. } = *renderer;
        let spp = renderer.image.spp;
        let objects = Objects::new(scene, layers.instances);
        let display = (renderer.image.width, renderer.image.height);
        // The same camera: by its name, or the first one.
        let next = renderer.next.and_then(|next| Some((next, next.camera(camera.name.as_deref())?)));
        let mut plan =
            LayerPlan { layers, scene, camera, display, next, moments, spp, objects, ids: Default::default() };
        plan.ids = Aov::CRYPTOMATTES.map(|aov| match layers.has(aov) {
            true => {
                let keys = plan.keys(aov) + scene.lights.len() as u32;
                (0..keys).into_par_iter().map(|key| Cryptomatte::id(&plan.name(aov, key))).collect()
            }
            false => Vec::new(),
        });
        plan
    }

    /// Pixels that a point of a primitive moves to the next frame, right and up.
    fn motion(&self, near: &Near, point: DVec3) -> [f32; 2] {
        let primitive = near.primitive;
        let seen = self.moments.get(shutter::moment(near.sample, self.moments.len().max(1), self.spp));
        // Lights stay where they are.
        let carried = |from: &Scene, to: &Scene, point: DVec3| match near.is_light() {
            true => point,
            false => carried(from, to, primitive as usize, point),
        };
        // From where it was when the sample saw it.
        let point = seen.map_or(point, |seen| carried(seen, self.scene, point));
        let way = || {
            let (next, camera) = self.next?;
            let before = self.camera.project(self.display, point)?;
            let after = carried(self.scene, next, point);
            Some(self.camera.motion(self.display, before, camera.project(self.display, after)?))
        };
        way().unwrap_or_default().as_vec2().to_array()
    }

    /// How many names a Cryptomatte may hold, lights left out.
    fn keys(&self, aov: Aov) -> u32 {
        match aov {
            Aov::CryptoMaterial => self.scene.materials.len() as u32,
            Aov::CryptoGroup => self.scene.groups.len() as u32 + 1,
            _ => self.objects.count(),
        }
    }

    /// The key of a light: behind those of objects and of materials, in no group.
    pub fn light_key(&self, aov: Aov, light: usize) -> u32 {
        if aov == Aov::CryptoGroup { 0 } else { self.keys(aov) + light as u32 }
    }

    /// The name behind a key of a Cryptomatte.
    fn name(&self, aov: Aov, key: u32) -> String {
        if let Some(light) = key.checked_sub(self.keys(aov)) {
            let name = self.scene.lights.get(light as usize).and_then(|light| light.name.clone());
            return name.unwrap_or_else(|| format!("light {light}"));
        }
        match aov {
            Aov::CryptoMaterial => self.scene.materials[key as usize].name.clone(),
            Aov::CryptoGroup => match key.checked_sub(1) {
                Some(group) => self.scene.groups[group as usize].clone(),
                None => "default".to_owned(),
            },
            _ => self.objects.name(self.scene, key),
        }
    }

    /// The key of what is seen.
    pub fn key(&self, aov: Aov, primitive: u32, material: u32) -> u32 {
        match aov {
            Aov::CryptoMaterial => material,
            Aov::CryptoGroup => self.objects.group(self.scene, primitive),
            _ => self.objects.of(primitive),
        }
    }

    /// Puts the channels into a picture, as long as its colour and all 0, and Cryptomattes that show nothing yet.
    pub fn open(&self, picture: &mut Picture) {
        let length = picture.pixels.len();
        let blank = |(name, kind): (String, SampleKind)| Channel { name, samples: kind.zeros(length) };
        picture.channels = channels(self.layers).into_iter().map(blank).collect();
        let mattes = Aov::CRYPTOMATTES.into_iter().filter(|aov| self.layers.has(*aov));
        let empty = |aov: Aov| Cryptomatte { name: aov.name().to_owned(), manifest: BTreeMap::new() };
        picture.cryptomattes = mattes.map(empty).collect();
    }

    /// Puts what a noise level took in the place of what is known of its first samples alone.
    pub fn tell_effort(&self, effort: &Effort, work: &mut LayerWork) {
        let mut channels = &mut work.channels[..];
        for aov in self.layers.iter() {
            let (own, rest) = take(&mut channels).split_at_mut(channels_of(self.layers, aov).len());
            for (part, samples) in own.iter_mut().enumerate() {
                match aov {
                    Aov::Samples => {
                        *samples = Samples::Float(effort.samples.iter().map(|samples| *samples as f32).collect())
                    }
                    Aov::Variance => {
                        *samples = Samples::Float(effort.variance.iter().map(|variance| variance[part]).collect());
                    }
                    _ => {}
                }
            }
            channels = rest;
        }
    }

    /// What is seen in a picture, by the keys that its blocks told of, beside what it knows already.
    pub fn add_cryptomattes(&self, seen: &Seen, picture: &mut Picture) {
        let before = take(&mut picture.cryptomattes);
        let asked =
            Aov::CRYPTOMATTES.into_iter().zip(&self.ids).zip(seen).filter(|((aov, _), _)| self.layers.has(*aov));
        for ((aov, ids), seen) in asked {
            let entry = |key: &u32| (self.name(aov, *key), ids[*key as usize]);
            let earlier =
                before.iter().filter(|matte| matte.name == aov.name()).flat_map(|matte| matte.manifest.clone());
            let manifest = earlier.chain(seen.iter().map(entry)).collect();
            picture.cryptomattes.push(Cryptomatte { name: aov.name().to_owned(), manifest });
        }
        if self.layers.has(Aov::Cost) {
            // Blocks were rendered whole, and may have seen what lies beyond the picture.
            let present = picture.cryptomattes.iter().map(|matte| matte.present(&picture.channels));
            picture.cryptomattes = present.collect();
        }
    }

    /// Names of the numbers in the id channels.
    pub fn names(&self, numbers: Numbers) -> IdNames {
        let named = |numbers: BTreeSet<u32>, aov: Aov| {
            numbers.into_iter().map(|number| (number, self.name(aov, number - 1))).collect()
        };
        let [object, material] = numbers.0;
        IdNames { object: named(object, Aov::CryptoObject), material: named(material, Aov::CryptoMaterial) }
    }
}

/// Numbers in the id channels, 0 left out: of objects and of materials.
#[derive(Debug, Clone, Default)]
pub(super) struct Numbers([BTreeSet<u32>; 2]);

impl Numbers {
    /// Those of a picture.
    pub fn of(picture: &Picture) -> Self {
        let numbers = |name: &str| match picture.channel(name).map(|channel| &channel.samples) {
            // Neighbours mostly see the same.
            Some(Samples::Uint(ids)) => ids.chunk_by(|a, b| a == b).map(|same| same[0]).filter(|id| *id > 0).collect(),
            _ => BTreeSet::new(),
        };
        Numbers(["id.object", "id.material"].map(numbers))
    }

    /// Adds those of other rows.
    pub fn add(&mut self, more: Numbers) {
        self.0.iter_mut().zip(more.0).for_each(|(all, mut more)| all.append(&mut more));
    }
}

/// How many channels some layers have.
pub(super) fn channel_count(layers: Layers) -> usize {
    channels(layers).len()
}

/// Channels in the order of their samples in a block.
fn channels(layers: Layers) -> Vec<(String, SampleKind)> {
    layers.iter().flat_map(|aov| channels_of(layers, aov)).collect()
}

fn channels_of(layers: Layers, aov: Aov) -> Vec<(String, SampleKind)> {
    let some = |layer: &str, suffixes: &str, kind| -> Vec<(String, SampleKind)> {
        suffixes.chars().map(|suffix| (format!("{layer}.{suffix}"), kind)).collect()
    };
    let named = |names: &[&str], kind| names.iter().map(|name| ((*name).to_owned(), kind)).collect();
    match aov {
        Aov::Depth => some("depth", "Z", SampleKind::Float),
        Aov::Position => some("P", "XYZ", SampleKind::Float),
        Aov::Normal => some("N", "XYZ", SampleKind::Half),
        Aov::Albedo => some("albedo", "RGB", SampleKind::Half),
        Aov::Uv => some("uv", "UV", SampleKind::Float),
        Aov::Motion => some("forward", "uv", SampleKind::Float),
        Aov::Ids => named(&["id.object", "id.material"], SampleKind::Uint),
        Aov::Samples => some("samples", "Y", SampleKind::Float),
        Aov::Variance => some("variance", "RGB", SampleKind::Float),
        Aov::Margin => some("margin", "Y", SampleKind::Float),
        Aov::Cost => named(&["cost.box", "cost.prim", "cost.lanes"], SampleKind::Float),
        Aov::CryptoObject | Aov::CryptoMaterial | Aov::CryptoGroup => {
            let parts = 0..layers.ranks / 2;
            parts.flat_map(|part| some(&format!("{}{part:02}", aov.name()), "RGBA", SampleKind::Float)).collect()
        }
    }
}

/// What the numbers in the id channels of a picture stand for.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct IdNames {
    /// Objects, by number.
    pub object: BTreeMap<u32, String>,
    /// Materials, by number.
    pub material: BTreeMap<u32, String>,
}
