//! Layers beside the colour, from what the beauty's own camera rays meet.
//!
//! | file | what it says |
//! |---|---|
//! | `sums` | a block's layers in the making, sample by sample, and as channels |
//! | `near` | the sample nearest to a pixel's centre, and the variance of a mean |
//! | `matte` | ids and their coverage |
//! | `tape` | how the engine's tiles get there |

mod matte;
mod near;
mod sums;
mod tape;

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use rayon::prelude::*;

pub(super) use self::near::Near;
pub(super) use self::sums::{LayerWork, Place, Sums};
pub(super) use self::tape::LayerTape;

use super::{Renderer, shutter};
use crate::film::{Channel, Cryptomatte, Picture, Samples, Window};
use crate::scene::{Aov, Camera, Layers, Objects, Scene, carried};

/// The depth of a miss: finite, so that filters do not spread infinity.
pub(super) const MISS_DEPTH: f32 = 1e10;

/// The margin of a miss, and the most that one is: finite as well.
pub(super) const MOST_MARGIN: f64 = 1e10;

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

/// How the samples of a channel are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Half,
    Float,
    Uint,
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
            true => (0..plan.keys(aov)).into_par_iter().map(|key| Cryptomatte::id(&plan.name(aov, key))).collect(),
            false => Vec::new(),
        });
        plan
    }

    /// Pixels that a point of a primitive moves to the next frame, right and up.
    fn motion(&self, near: &Near, point: DVec3) -> [f32; 2] {
        let primitive = near.primitive;
        let seen = self.moments.get(shutter::moment(near.sample, self.moments.len().max(1), self.spp));
        // From where it was when the sample saw it.
        let point = seen.map_or(point, |seen| carried(seen, self.scene, primitive as usize, point));
        let way = || {
            let (next, camera) = self.next?;
            let before = self.camera.project(self.display, point)?;
            let after = carried(self.scene, next, primitive as usize, point);
            Some(self.camera.motion(self.display, before, camera.project(self.display, after)?))
        };
        way().unwrap_or_default().as_vec2().to_array()
    }

    /// How many names a Cryptomatte may hold.
    fn keys(&self, aov: Aov) -> u32 {
        match aov {
            Aov::CryptoMaterial => self.scene.materials.len() as u32,
            Aov::CryptoGroup => self.scene.groups.len() as u32 + 1,
            _ => self.objects.count(),
        }
    }

    /// The name behind a key of a Cryptomatte.
    fn name(&self, aov: Aov, key: u32) -> String {
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

    /// Channels in the order of their samples in a block.
    fn channels(&self) -> Vec<(String, Kind)> {
        let some = |layer: &str, suffixes: &str, kind| -> Vec<(String, Kind)> {
            suffixes.chars().map(|suffix| (format!("{layer}.{suffix}"), kind)).collect()
        };
        let named = |names: &[&str], kind| names.iter().map(|name| ((*name).to_owned(), kind)).collect();
        let of = |aov: Aov| match aov {
            Aov::Depth => some("depth", "Z", Kind::Float),
            Aov::Position => some("P", "XYZ", Kind::Float),
            Aov::Normal => some("N", "XYZ", Kind::Half),
            Aov::Albedo => some("albedo", "RGB", Kind::Half),
            Aov::Uv => some("uv", "UV", Kind::Float),
            Aov::Motion => some("forward", "uv", Kind::Float),
            Aov::Ids => named(&["id.object", "id.material"], Kind::Uint),
            Aov::Samples => some("samples", "Y", Kind::Float),
            Aov::Variance => some("variance", "RGB", Kind::Float),
            Aov::Margin => some("margin", "Y", Kind::Float),
            Aov::Cost => named(&["cost.box", "cost.prim", "cost.lanes"], Kind::Float),
            Aov::CryptoObject | Aov::CryptoMaterial | Aov::CryptoGroup => {
                let layers = 0..self.layers.ranks / 2;
                layers.flat_map(|layer| some(&format!("{}{layer:02}", aov.name()), "RGBA", Kind::Float)).collect()
            }
        };
        self.layers.iter().flat_map(of).collect()
    }

    /// Puts the layers of all blocks into a picture.
    pub fn add_to<'a>(&self, works: impl Iterator<Item = (Window, &'a LayerWork)>, picture: &mut Picture) {
        let works: Vec<_> = works.collect();
        let window = picture.window;
        let channel = |(index, (name, kind)): (usize, (String, Kind))| {
            let floats = || fill(window, &works, |work| work.channels[index].floats());
            let samples = match kind {
                Kind::Half => Samples::Half(floats()),
                Kind::Float => Samples::Float(floats()),
                Kind::Uint => Samples::Uint(fill(window, &works, |work| match &work.channels[index] {
                    Samples::Uint(ids) => Some(ids.as_slice()),
                    Samples::Half(_) | Samples::Float(_) => None,
                })),
            };
            Channel { name, samples }
        };
        let channels: Vec<_> = self.channels().into_iter().enumerate().collect();
        picture.channels = channels.into_par_iter().map(channel).collect();
        picture.cryptomattes = self.cryptomattes(&works);
        if self.layers.has(Aov::Cost) {
            // Blocks were rendered whole, and may have seen what lies beyond the picture.
            let present = picture.cryptomattes.iter().map(|matte| matte.present(&picture.channels));
            picture.cryptomattes = present.collect();
        }
    }

    fn cryptomattes(&self, works: &[(Window, &LayerWork)]) -> Vec<Cryptomatte> {
        let asked = Aov::CRYPTOMATTES.into_iter().enumerate().filter(|(_, aov)| self.layers.has(*aov));
        let matte = |(index, aov): (usize, Aov)| {
            let seen: BTreeSet<u32> = works.iter().flat_map(|(_, work)| &work.seen[index]).copied().collect();
            let entry = |key: u32| (self.name(aov, key), self.ids[index][key as usize]);
            Cryptomatte { name: aov.name().to_owned(), manifest: seen.into_iter().map(entry).collect() }
        };
        asked.map(matte).collect()
    }

    /// Names of the numbers in the id channels of a picture, 0 left out.
    pub fn names(&self, picture: &Picture) -> IdNames {
        let numbers = |name: &str| -> BTreeSet<u32> {
            match picture.channel(name).map(|channel| &channel.samples) {
                // Neighbours mostly see the same.
                Some(Samples::Uint(ids)) => {
                    ids.chunk_by(|a, b| a == b).map(|same| same[0]).filter(|id| *id > 0).collect()
                }
                _ => BTreeSet::new(),
            }
        };
        let named = |channel: &str, aov: Aov| {
            numbers(channel).into_iter().map(|number| (number, self.name(aov, number - 1))).collect()
        };
        IdNames { object: named("id.object", Aov::CryptoObject), material: named("id.material", Aov::CryptoMaterial) }
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

/// One channel of a window from those of its blocks.
fn fill<'a, T: Copy + Default + 'a>(
    window: Window,
    works: &[(Window, &'a LayerWork)],
    samples: impl Fn(&'a LayerWork) -> Option<&'a [T]>,
) -> Vec<T> {
    let mut all = vec![T::default(); window.area()];
    for (block, work) in works {
        for (row, y) in samples(work).into_iter().flat_map(|part| part.chunks(block.width())).zip(block.y0..) {
            if let Some(start) = window.index(block.x0, y) {
                all[start..start + row.len()].copy_from_slice(row);
            }
        }
    }
    all
}
