//! A job as words of the command line: what a file says of how to render it again.
//!
//! Only what is another than the scene says has a word. Words that change no bit (threads, what is left out), those that
//! only choose pixels (crops, tiles, shards) and what the file itself shows (how it is stored) are not among them, so the
//! parts of a picture say what the whole picture says.

use super::{Job, View};
use crate::render::{Engine, Renderer};
use crate::scene::particles::{Bonds, Coloring, Look, Radius, Style};
use crate::scene::{Aov, Integrator, Layers, RenderSettings, Scene};

impl Job {
    /// The words of `octray render` that make this picture of its scene, quoted as a shell reads them; empty where the
    /// scene says it all. A camera that is the job's own has no words.
    pub fn words(&self, renderer: &Renderer) -> String {
        let (scene, mut words) = (renderer.scene(), Vec::new());
        if let View::Named(name) = &self.view {
            put(&mut words, "--camera", name);
        }
        let layers = self.settings.layers.layers(scene).unwrap_or(scene.layers);
        of_layers(scene.layers, layers, &mut words);
        of_settings(scene, renderer.settings(), &mut words);
        let spp = renderer.image().spp;
        put_given(&mut words, "--spp", (scene.image.as_ref().is_none_or(|image| image.spp != spp)).then_some(spp));
        // Packets and single rays give the same bits.
        put_given(&mut words, "--engine", (self.settings.engine == Engine::Reference).then_some("reference"));
        put_if(&mut words, "--no-certify", self.settings.uncertified);
        put_given(&mut words, "--background", self.settings.transparent.then_some("transparent"));
        of_look(&self.look, &mut words);
        // Names hold no zero bytes, and nothing else cannot be quoted.
        shlex::try_join(words.iter().map(String::as_str)).unwrap_or_default()
    }
}

fn put(words: &mut Vec<String>, name: &str, value: impl ToString) {
    words.extend([name.to_owned(), value.to_string()]);
}

fn put_given<T: ToString>(words: &mut Vec<String>, name: &str, value: Option<T>) {
    if let Some(value) = value {
        put(words, name, value);
    }
}

fn put_if(words: &mut Vec<String>, name: &str, given: bool) {
    if given {
        words.push(name.to_owned());
    }
}

fn of_layers(scenes: Layers, layers: Layers, words: &mut Vec<String>) {
    let names: Vec<&str> = layers.iter().filter(|aov| *aov != Aov::Cost).map(Aov::name).collect();
    if !names.is_empty() && layers.iter().ne(scenes.iter()) {
        put(words, "--aov", names.join(","));
    }
    put_if(words, "--cost", layers.has(Aov::Cost) && !scenes.has(Aov::Cost));
    put_given(words, "--crypto-ranks", (layers.ranks != scenes.ranks).then_some(layers.ranks));
    let instances = if layers.instances { "each" } else { "grouped" };
    put_given(words, "--instances", (layers.instances != scenes.instances).then_some(instances));
}

fn of_settings(scene: &Scene, settings: &RenderSettings, words: &mut Vec<String>) {
    let scenes = &scene.render;
    let RenderSettings { integrator, max_depth, seed, noise, shutter, .. } = settings;
    let name = match integrator {
        Integrator::Direct => "direct",
        Integrator::Ao => "ao",
        Integrator::Path => "path",
    };
    put_given(words, "--integrator", (*integrator != scenes.integrator).then_some(name));
    put_given(words, "--max-depth", (*max_depth != scenes.max_depth).then_some(max_depth));
    put_given(words, "--seed", (*seed != scenes.seed).then_some(seed));
    put_given(words, "--noise", noise.filter(|_| *noise != scenes.noise));
    put_given(words, "--shutter", (*shutter != scenes.shutter).then_some(shutter));
}

/// What the command line can say of atoms.
fn of_look(look: &Look, words: &mut Vec<String>) {
    let style = look.style.map(|style| match style {
        Style::Spheres => "spheres",
        Style::BallAndStick => "ball-and-stick",
        Style::Licorice => "licorice",
    });
    put_given(words, "--style", style);
    match &look.radius {
        Radius::Auto => {}
        Radius::VanDerWaals => put(words, "--radius", "van-der-waals"),
        Radius::Covalent => put(words, "--radius", "covalent"),
        Radius::Same(radius) => put(words, "--radius", radius),
        Radius::Column(name) => put(words, "--radius", name),
    }
    if let Coloring::Column { name, range: None, .. } = &look.color {
        put(words, "--color-by", name);
    }
    match look.bonds {
        Bonds::Auto => {}
        Bonds::File => put(words, "--bonds", "file"),
        Bonds::Distance => put(words, "--bonds", "distance"),
        Bonds::None => put(words, "--bonds", "none"),
        Bonds::Within(distance) => put(words, "--bonds", distance),
    }
    if look.replicate != [1; 3] {
        put(words, "--replicate", look.replicate.map(|count| count.to_string()).join(","));
    }
}
