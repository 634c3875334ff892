//! What the materials in use, the lights and the clouds of a scene ask for.

use super::reach;
use super::skips::{Skip, Skips};
use crate::scene::{Model, Object, Scene, Shape, Source};

/// Features of a scene, as far as something shows them.
#[derive(Debug)]
pub struct Needs {
    /// Some cloud has colours.
    pub colored: bool,
    /// Some polygon has normals.
    pub smooth: bool,
    /// Rays go on from some material in use.
    pub scatters: bool,
    /// Some material in use has a highlight.
    pub shines: bool,
    /// By texture: whether a material in use has it.
    pub textures: Vec<bool>,
    /// By light: whether it can give anything.
    pub lights: Vec<bool>,
}

impl Needs {
    /// Looks through a scene.
    pub fn of(scene: &Scene) -> Self {
        let used = scene.used_materials();
        let models = || used.iter().map(|index| &scene.materials[*index].model);
        let lit = models().any(Model::is_lit);
        Needs {
            colored: scene.clouds.iter().any(|cloud| cloud.colors.is_some()),
            smooth: scene.objects.iter().any(has_normals),
            scatters: models().any(Model::scatters),
            shines: models().any(|model| matches!(model, Model::Phong { ks, .. } if *ks > 0.0)),
            textures: scene.used_textures(),
            lights: scene.lights.iter().map(|light| lit && reaches(&light.source, scene)).collect(),
        }
    }

    /// What of all this may be left out.
    pub fn decide(&self, scene: &Scene, skips: &mut Skips) {
        let dark = self.lights.iter().filter(|needed| !**needed).count();
        let why = match scene.lights.iter().any(|light| reaches(&light.source, scene)) {
            true if !self.lights.contains(&true) => "nothing in the scene takes light directly",
            _ => "they have no power, or nothing lies where they shine",
        };
        skips.decide(Skip::Lights, dark as u64, (dark > 0).then(|| why.to_owned()));
        let why = "lights behind a surface or out of range give nothing, in shadow or not";
        skips.decide(Skip::Shadows, 0, self.lights.contains(&true).then(|| why.to_owned()));
        let why = "no material in use reflects or transmits";
        skips.decide(Skip::Bounces, 0, (!self.scatters).then(|| why.to_owned()));
        self.decide_shading(skips);
    }

    fn decide_shading(&self, skips: &mut Skips) {
        let unused = self.textures.iter().filter(|used| !**used).count();
        let why = "no primitive shows them, so that only their sizes were read";
        skips.decide(Skip::Textures, unused as u64, (unused > 0).then(|| why.to_owned()));
        let attributes = [
            (self.textures.contains(&true), "texture coordinates"),
            (self.colored, "colours of clouds"),
            (self.smooth, "interpolated normals"),
            (self.shines, "highlights"),
            (self.scatters, "hits in f64"),
        ];
        let missing: Vec<&str> = attributes.iter().filter(|(needed, _)| !needed).map(|(_, name)| *name).collect();
        let why = || format!("no material in use asks for {}", missing.join(", "));
        skips.decide(Skip::Shading, 0, (!missing.is_empty()).then(why));
    }
}

fn reaches(source: &Source, scene: &Scene) -> bool {
    !source.is_dark() && reach::meets_anything(source, scene)
}

fn has_normals(object: &Object) -> bool {
    matches!(&object.shape, Shape::Polygon(polygon) if !polygon.normals.is_empty())
}
