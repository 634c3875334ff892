//! `[image]`, `[render]`, cameras, `[background]`, `[ambient]`.

use glam::DVec3;

use super::Reader;
use super::names::Names;
use super::table::Table;
use super::values::{choice, color, direction, file, flag, number, point, text, whole};
use crate::scene::fit;
use crate::scene::frames::OpenCamera;
use crate::scene::rules::{self, Rule};
use crate::scene::{
    Backdrop, Background, Camera, Filter, FilterKind, ImageSettings, ImageTexture, Integrator, Layers, Lens, Part,
    RenderSettings, TextureFilter, Wrap,
};

/// Most pixels along one side.
const MOST_PIXELS_A_SIDE: u64 = 65_536;
/// Most pixels of a picture.
const MOST_PIXELS: u64 = 1 << 30;
/// Most samples of one pixel.
const MOST_SAMPLES: u64 = 1 << 20;
/// Longest chain of rays: without a bound two mirrors would exhaust the stack.
const DEEPEST: u64 = 1000;

const FILTERS: &[(&str, FilterKind)] =
    &[("gaussian", FilterKind::Gaussian), ("box", FilterKind::Box), ("blackman-harris", FilterKind::BlackmanHarris)];

const INTEGRATORS: &[(&str, Integrator)] =
    &[("direct", Integrator::Direct), ("ao", Integrator::Ao), ("path", Integrator::Path)];

#[derive(Clone, Copy)]
enum LensKind {
    Pinhole,
    Orthographic,
    ThinLens,
    Panoramic,
}

const LENSES: &[(&str, LensKind)] = &[
    ("pinhole", LensKind::Pinhole),
    ("orthographic", LensKind::Orthographic),
    ("thin-lens", LensKind::ThinLens),
    ("panoramic", LensKind::Panoramic),
];

impl<'a> Reader<'a, '_> {
    /// Reads all tables that are there once.
    pub fn read_settings(&mut self) {
        if let Some(table) = self.single("image") {
            self.scene.layers = layers(&table).unwrap_or_default();
            self.scene.image = image(table);
        }
        self.claim(Some(Part::Image));
        if let Some(render) = self.single("render").and_then(render) {
            self.scene.render = render;
        }
        self.claim(Some(Part::Render));
        self.read_cameras();
        if let Some(table) = self.single("background") {
            self.scene.background = self.background(table).unwrap_or_default();
        }
        self.claim(Some(Part::Background));
        if let Some(table) = self.single("ambient") {
            self.scene.ambient = table.or("color", DVec3::ZERO, color).unwrap_or_default();
            table.finish();
        }
        self.claim(Some(Part::Ambient));
    }

    fn read_cameras(&mut self) {
        let lone = self.single("camera");
        let several = self.tables("cameras", "camera");
        if let (Some(lone), Some(first)) = (&lone, several.first()) {
            let rule = "a scene has one [camera] or several [[cameras]], not both";
            first.context.fail_with_help(
                &first.span,
                rule,
                format!("[camera] is at {}", lone.context.place(&lone.span)),
            );
        }
        let mut names = Names::new("camera");
        if let Some(found) = lone.and_then(|table| camera(table, None)) {
            self.add_camera(found);
        }
        for table in several {
            let name = table.need("name", |item| {
                let name = text(item)?;
                names.give(&name, table.context, &item.span)?;
                Some(name)
            });
            if let Some(found) = camera(table, name) {
                self.add_camera(found);
            }
        }
    }

    fn add_camera(&mut self, (camera, Placing { framed, orbit }): (Camera, Placing)) {
        let index = self.scene.cameras.len();
        self.scene.cameras.push(camera);
        if framed || orbit.is_some() {
            self.cameras.push(OpenCamera { index, framed, orbit });
        }
        self.claim(Some(Part::Camera(index)));
    }

    fn background(&mut self, table: Table<'a>) -> Option<Background> {
        let flat = table.maybe("color", color);
        let (top, bottom) = (table.maybe("top", color), table.maybe("bottom", color));
        let picture = table.maybe("image", |item| Some((file(item)?, item.clone())));
        let scale = table.maybe("scale", number(Rule::COLOR));
        let rotation = table.maybe("rotation", number(Rule::FINITE));
        let transparent = table.or("transparent", false, flag);
        let light = table.maybe("light", flag);
        let lonely = if picture.as_ref().is_some_and(Option::is_none) { picture_only(&table) } else { None };
        let choices = (flat?, top?, bottom?, picture?, lonely);
        let backdrop = match choices {
            (_, _, _, None, Some(key)) => {
                table.exclusive(format!("background {key} needs an \"image\" that it applies to"), &[key])
            }
            (None, None, None, None, None) => Some(Backdrop::default()),
            (Some(color), None, None, None, None) => Some(Backdrop::Color(color)),
            (None, Some(top), Some(bottom), None, None) => Some(Backdrop::Gradient { top, bottom }),
            (None, None, None, Some((named, item)), _) => self.picture(&item, &named, None).map(|picture| {
                let image = ImageTexture {
                    file: named.path,
                    wrap: Wrap::default(),
                    filter: TextureFilter::default(),
                    color_space: picture.color_space,
                    width: picture.width,
                    height: picture.height,
                    texels: picture.texels,
                };
                let (scale, rotation) = (scale.flatten().unwrap_or(1.0), rotation.flatten().unwrap_or(0.0));
                Backdrop::Image { image: Box::new(image), scale, rotation }
            }),
            (None, Some(_), None, None, None) => table.missing("\"bottom\" as well as \"top\""),
            (None, None, Some(_), None, None) => table.missing("\"top\" as well as \"bottom\""),
            _ => {
                let rule = "background is one of \"color\", \"top\" and \"bottom\", or \"image\"".to_owned();
                table.exclusive(rule, &["color", "top", "bottom", "image"])
            }
        };
        table.finish();
        Some(Background { backdrop: backdrop?, transparent: transparent?, light: light?.unwrap_or(true) })
    }
}

/// A key that means nothing without a picture.
fn picture_only(table: &Table<'_>) -> Option<&'static str> {
    ["scale", "rotation", "light"].into_iter().find(|key| table.has(key))
}

fn image(table: Table<'_>) -> Option<ImageSettings> {
    let width = table.need("width", whole(1, MOST_PIXELS_A_SIDE));
    let height = table.need("height", whole(1, MOST_PIXELS_A_SIDE));
    let spp = table.or("spp", 16, whole(1, MOST_SAMPLES));
    let kind = table.or("filter", FilterKind::Gaussian, choice(FILTERS));
    let radius = if kind == Some(FilterKind::Box) { 0.5 } else { 1.5 };
    let radius = table.or("filter_radius", radius, number(Rule::FILTER_RADIUS));
    if let (Some(width), Some(height)) = (width, height)
        && width * height > MOST_PIXELS
    {
        let item = table.item("height")?;
        item.context.fail(&item.span, "image must have at most 2^30 pixels", format!("{width} x {height}"));
    }
    table.finish();
    let filter = Filter { kind: kind?, radius: radius? };
    Some(ImageSettings { width: width? as u32, height: height? as u32, spp: spp? as u32, filter })
}

/// The keys of `[image]` that say which layers there are beside the colour.
fn layers(table: &Table<'_>) -> Option<Layers> {
    let named = table.or("aovs", Layers::default(), |item| {
        let Some(mut elements) = item.elements() else {
            return item.wrong("must be a list of names");
        };
        elements.try_fold(Layers::default(), |layers, element| {
            let found = layers.with_named(&text(&element)?);
            found.map_err(|unknown| element.context.fail(&element.span, unknown.to_string(), "")).ok()
        })
    });
    let ranks = table.or("crypto_ranks", 6, |item| {
        let ranks = whole(2, u64::from(Layers::MOST_RANKS))(item)?;
        if ranks % 2 == 1 {
            item.context.fail(&item.span, "crypto_ranks must be even: two share a layer", ranks.to_string());
            return None;
        }
        Some(ranks)
    });
    let instances = table.or("instances", false, choice(&[("grouped", false), ("each", true)]));
    let mut layers = named?;
    (layers.ranks, layers.instances) = (ranks? as u8, instances?);
    Some(layers)
}

fn render(table: Table<'_>) -> Option<RenderSettings> {
    let integrator = table.or("integrator", Integrator::Direct, choice(INTEGRATORS));
    let ao_distance = table.or("ao_distance", f64::INFINITY, number(Rule::LENGTH));
    let ambient_occlusion = table.or("ambient_occlusion", false, flag);
    let shutter = table.or("shutter", 0.0, number(Rule::SHARE));
    let max_depth = table.or("max_depth", 5, whole(1, DEEPEST));
    let seed = table.or("seed", 0, whole(0, u64::MAX));
    let noise = table.maybe("noise", number(Rule::POSITIVE));
    table.finish();
    Some(RenderSettings {
        integrator: integrator?,
        max_depth: max_depth? as u32,
        seed: seed?,
        noise: noise?,
        ao_distance: ao_distance?,
        ambient_occlusion: ambient_occlusion?,
        shutter: shutter?,
    })
}

/// What is left to do for a camera when all of the scene is known.
struct Placing {
    framed: bool,
    orbit: Option<f64>,
}

fn camera(mut table: Table<'_>, name: Option<String>) -> Option<(Camera, Placing)> {
    let kind = table.kind(LENSES, &[])?;
    let lens = match kind {
        LensKind::Pinhole => table.need("vfov", number(Rule::VFOV)).map(|vfov| Lens::Pinhole { vfov }),
        LensKind::Orthographic => {
            table.need("height", number(Rule::LENGTH)).map(|height| Lens::Orthographic { height })
        }
        LensKind::ThinLens => {
            let vfov = table.need("vfov", number(Rule::VFOV));
            let (aperture, focus) =
                (table.need("aperture", number(Rule::LENGTH)), table.need("focus", number(Rule::LENGTH)));
            (|| Some(Lens::ThinLens { vfov: vfov?, aperture: aperture?, focus: focus? }))()
        }
        LensKind::Panoramic => Some(Lens::Panoramic),
    };
    let up = table.or("up", DVec3::Y, direction);
    let orbit = table.maybe("orbit", number(Rule::FINITE));
    // Neither eye nor target: the camera is placed so that it sees everything.
    let framed = !table.has("eye") && !table.has("target");
    let (eye, target) = match framed {
        true => (up.map(fit::direction), Some(DVec3::ZERO)),
        false => (table.need("eye", point), table.need("target", point)),
    };
    let camera = (|| Some(Camera { name, eye: eye?, target: target?, up: up?, lens: lens? }))();
    let camera = camera.and_then(|camera| match rules::camera(&camera) {
        Ok(()) => Some((camera, Placing { framed, orbit: orbit? })),
        Err(broken) => table.broken(broken),
    });
    table.finish();
    camera
}
