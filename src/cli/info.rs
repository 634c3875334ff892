//! `octray info`: what a scene holds and what it takes. All of it is gathered as JSON once; the page for people
//! is made of that.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use octray::plan::{InvalidScene, Kind, LeftOut};
use octray::render::RenderError;
use octray::scene::{
    Backdrop, Falloff, Filter, FilterKind, Frames, Integrator, Lens, Light, Material, Model, SCHEMA, Scene, Source,
    Texture, TextureKind, Visible,
};
use octray::shapes::{Part, Store, Visit};
use octray::{Renderer, Tracer, scene};
use serde_json::{Map, Value, json};

use super::Run;
use super::exit::{Exit, Failure};
use super::scene_file::{self, Moment};
use super::system;

const EXAMPLES: &str = "\
Examples:
  octray info fig5.toml
  octray info fig5.toml --json | jq .materials     the indices that hits speak of
  octray info --schema > octray.schema.json        for editors that complete and check TOML";

/// Arguments of `octray info`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct Args {
    /// Scene file (.toml, .nff, .nff.gz), or atoms (.xyz, .lammpstrj, .data, .pdb, .sdf, ... or with .gz)
    #[arg(required_unless_present = "schema")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    moment: Moment,
    /// Print it as JSON
    #[arg(long)]
    json: bool,
    /// Print the JSON Schema of scene files
    #[arg(long, conflicts_with_all = ["scene", "json"])]
    schema: bool,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    let Some(path) = &args.scene else {
        run.console.print(SCHEMA)?;
        return Ok(Exit::Done);
    };
    let loaded = args.moment.load(path, None, run)?;
    scene_file::need_memory(&loaded.scene, 0, "the tree of this scene")?;
    let mut info = info(path, &loaded.scene, loaded.seconds).map_err(RenderError::from)?;
    // A later frame that is broken is not what was asked for, but worth a word.
    let frames = Frames::new(path).count().unwrap_or_else(|errors| {
        run.console.warn(&errors.to_string());
        None
    });
    info["frames"] = json!(frames);
    if args.json {
        run.console.print_json(&info)?
    } else {
        run.console.print(&page(&info))?
    }
    Ok(Exit::Done)
}

fn info(path: &Path, scene: &Scene, load_seconds: f64) -> Result<Value, InvalidScene> {
    let building = Instant::now();
    let eye = scene.cameras.first().map_or(DVec3::ZERO, |camera| camera.eye);
    let tracer = Tracer::relative_to(scene, eye)?;
    let build_seconds = building.elapsed().as_secs_f64();
    let list = |items: Vec<Value>| Value::Array(items);
    Ok(json!({
        "schema": 1,
        "octray": env!("CARGO_PKG_VERSION"),
        "scene": path.display().to_string(),
        "frames": null,
        "primitives": primitives(scene),
        "bounds": bounds(&tracer),
        "materials": list(scene.materials.iter().enumerate().map(|entry| material(scene, entry)).collect()),
        "textures": list(scene.textures.iter().map(texture).collect()),
        "lights": list(scene.lights.iter().enumerate().map(light).collect()),
        "cameras": list(scene.cameras.iter().map(camera).collect()),
        "groups": scene.groups,
        "background": background(scene),
        "ambient": scene.ambient.to_array(),
        "image": scene.image.as_ref().map(image),
        "render": render(scene),
        "warnings": scene.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
        "skipped": skipped(scene, &tracer),
        "seconds": { "load": load_seconds, "build": build_seconds },
        "memory": {
            "peak_bytes": system::peak_bytes(),
            "column_bytes": tracer.tree().stores().column_bytes(),
            "tree_bytes": tracer.tree().bytes(),
        },
    }))
}

/// What a render leaves out, or, without a camera or a size, what queries do.
fn skipped(scene: &Scene, tracer: &Tracer) -> Value {
    let render = Renderer::new(scene).map(|renderer| renderer.plan().skips);
    json!(render.as_ref().unwrap_or(&tracer.plan().skips).report(&LeftOut::default()))
}

/// How many there are, in all and of each kind that there is.
fn primitives(scene: &Scene) -> Value {
    let mut counts = Map::from_iter([("total".to_owned(), json!(scene.primitive_count()))]);
    let mut add = |kind: &str, more: usize| {
        let before = counts.get(kind).and_then(Value::as_u64).unwrap_or(0);
        counts.insert(kind.to_owned(), json!(before + more as u64));
    };
    scene.objects.iter().for_each(|object| add(object.shape.kind(), 1));
    for cloud in scene.clouds.iter().filter(|cloud| !cloud.is_empty()) {
        add(cloud.primitive(0).shape.kind(), cloud.len());
    }
    Value::Object(counts)
}

/// Corners of the box around everything but planes; null where there is nothing else.
fn bounds(tracer: &Tracer) -> Value {
    let stores = tracer.tree().stores();
    let finite = Kind::ALL.into_iter().filter(|kind| *kind != Kind::Plane);
    let all = finite.filter_map(|kind| stores.visit(kind, BoundsOf)).reduce(join);
    let origin = tracer.plan().origin;
    json!(all.map(|(min, max)| json!({ "min": (min + origin).to_array(), "max": (max + origin).to_array() })))
}

struct BoundsOf;

impl Visit for BoundsOf {
    type Output = Option<(DVec3, DVec3)>;
    fn visit<P: Part>(self, store: &Store<P>) -> Self::Output {
        store.parts().iter().map(P::bounds).reduce(join)
    }
}

fn join(a: (DVec3, DVec3), b: (DVec3, DVec3)) -> (DVec3, DVec3) {
    (a.0.min(b.0), a.1.max(b.1))
}

fn material(scene: &Scene, (index, material): (usize, &Material)) -> Value {
    let model = match material.model {
        Model::Diffuse { .. } => "diffuse",
        Model::Mirror { .. } => "mirror",
        Model::Dielectric { .. } => "dielectric",
        Model::Phong { .. } => "phong",
    };
    let visible = match material.visible {
        Visible::Both => "both",
        Visible::Front => "front",
        Visible::Back => "back",
    };
    let back = material.back.and_then(|back| scene.materials.get(back)).map(|back| &back.name);
    json!({ "index": index, "name": material.name, "type": model, "back": back, "visible": visible })
}

fn texture(texture: &Texture) -> Value {
    match &texture.kind {
        TextureKind::Checker(_) => json!({ "name": texture.name, "type": "checker" }),
        TextureKind::Image(image) => json!({
            "name": texture.name, "type": "image", "file": image.file.display().to_string(),
            "width": image.width, "height": image.height,
        }),
    }
}

fn light((index, light): (usize, &Light)) -> Value {
    let kind = match light.source {
        Source::Point { falloff: Falloff::InverseSquare, .. } => "point",
        Source::Point { falloff: Falloff::None, .. } => "point without falloff",
        Source::Directional { .. } => "directional",
        Source::Spot { .. } => "spot",
        Source::Area { ref emitter, .. } => emitter.shape().kind(),
    };
    json!({ "index": index, "name": light.name, "type": kind, "shadows": light.shadows })
}

fn camera(camera: &scene::Camera) -> Value {
    let lens = match camera.lens {
        Lens::Pinhole { vfov } => json!({ "type": "pinhole", "vfov": vfov }),
        Lens::Orthographic { height } => json!({ "type": "orthographic", "height": height }),
        Lens::ThinLens { vfov, aperture, focus } => {
            json!({ "type": "thin-lens", "vfov": vfov, "aperture": aperture, "focus": focus })
        }
        Lens::Panoramic => json!({ "type": "panoramic" }),
    };
    let (eye, target, up) = (camera.eye.to_array(), camera.target.to_array(), camera.up.to_array());
    json!({ "name": camera.name, "eye": eye, "target": target, "up": up, "lens": lens })
}

fn background(scene: &Scene) -> Value {
    let kind = match scene.background.backdrop {
        Backdrop::Color(_) => "color",
        Backdrop::Gradient { .. } => "gradient",
        Backdrop::Image { .. } => "image",
    };
    json!({ "type": kind, "transparent": scene.background.transparent })
}

fn image(image: &scene::ImageSettings) -> Value {
    let Filter { kind, radius } = image.filter;
    let filter = match kind {
        FilterKind::Box => "box",
        FilterKind::Gaussian => "gaussian",
        FilterKind::BlackmanHarris => "blackman-harris",
    };
    json!({
        "width": image.width, "height": image.height, "spp": image.spp, "filter": filter, "filter_radius": radius,
    })
}

fn render(scene: &Scene) -> Value {
    let scene::RenderSettings { integrator, max_depth, seed, noise, ao_distance, ambient_occlusion, shutter } =
        scene.render;
    let integrator = match integrator {
        Integrator::Direct => "direct",
        Integrator::Ao => "ao",
        Integrator::Path => "path",
    };
    json!({
        "integrator": integrator, "max_depth": max_depth, "seed": seed, "noise": noise, "ao_distance": ao_distance,
        "ambient_occlusion": ambient_occlusion, "shutter": shutter,
    })
}

/// Names a page lists of each kind of thing, at most.
const LISTED: usize = 40;

/// The same for people.
fn page(info: &Value) -> String {
    let mut page = String::new();
    let mut line = |name: &str, text: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(page, "{name:<11} {text}");
    };
    line("scene", word(&info["scene"]));
    if let Some(frames) = info["frames"].as_u64() {
        line("frames", frames.to_string());
    }
    let kinds = info["primitives"].as_object().into_iter().flatten().filter(|(kind, _)| *kind != "total");
    let kinds: Vec<_> = kinds.map(|(kind, count)| format!("{count} {kind}")).collect();
    let kinds = if kinds.is_empty() { String::new() } else { format!(": {}", kinds.join(", ")) };
    line("primitives", format!("{}{kinds}", info["primitives"]["total"]));
    if !info["bounds"].is_null() {
        line("bounds", format!("{} to {}", vector(&info["bounds"]["min"]), vector(&info["bounds"]["max"])));
    }
    let mut list = |name: &str, items: &Value, text: &dyn Fn(&Value) -> String| {
        let items = items.as_array().map_or(&[][..], Vec::as_slice);
        for (i, item) in items.iter().take(LISTED).enumerate() {
            line(if i == 0 { name } else { "" }, text(item));
        }
        match items.len() {
            0 => line(name, "none".to_owned()),
            count if count > LISTED => line("", format!("and {} more (--json lists all)", count - LISTED)),
            _ => {}
        }
    };
    list("materials", &info["materials"], &|item| {
        let back = item["back"].as_str().map(|back| format!(", back {back}")).unwrap_or_default();
        let visible = item["visible"].as_str().filter(|side| *side != "both");
        let visible = visible.map(|side| format!(", {side} side only")).unwrap_or_default();
        format!("{} {}: {}{back}{visible}", item["index"], word(&item["name"]), word(&item["type"]))
    });
    list("textures", &info["textures"], &|item| {
        let file = item["file"].as_str().map(|file| format!(" {file}, {}x{}", item["width"], item["height"]));
        format!("{}: {}{}", word(&item["name"]), word(&item["type"]), file.unwrap_or_default())
    });
    list("lights", &info["lights"], &|item| {
        let name = item["name"].as_str().map(|name| format!(" {name}")).unwrap_or_default();
        let shadows = if item["shadows"] == json!(false) { ", no shadows" } else { "" };
        format!("{}{name}: {}{shadows}", item["index"], word(&item["type"]))
    });
    list("cameras", &info["cameras"], &|item| {
        let name = item["name"].as_str().map(|name| format!("{name}: ")).unwrap_or_default();
        let lens = &item["lens"];
        let angle = match lens["vfov"].as_f64() {
            Some(vfov) => format!("vfov {vfov}"),
            None => format!("height {}", lens["height"]),
        };
        format!("{name}{}, {angle}, from {} to {}", word(&lens["type"]), vector(&item["eye"]), vector(&item["target"]))
    });
    let through = if info["background"]["transparent"] == json!(true) { ", transparent" } else { "" };
    line("background", format!("{}{through}", word(&info["background"]["type"])));
    match &info["image"] {
        Value::Null => line("image", "none: render needs --resolution".to_owned()),
        image => {
            let (width, height, filter) = (&image["width"], &image["height"], word(&image["filter"]));
            line("image", format!("{width}x{height}, {} spp, {filter} {}", image["spp"], image["filter_radius"]));
        }
    }
    let render = &info["render"];
    line("render", format!("{}, depth {}, seed {}", word(&render["integrator"]), render["max_depth"], render["seed"]));
    let skipped = info["skipped"].as_array().map_or(&[][..], Vec::as_slice);
    for (i, skip) in skipped.iter().enumerate() {
        line(if i == 0 { "skipped" } else { "" }, format!("{}: {}", word(&skip["what"]), word(&skip["why"])));
    }
    let bytes = |name: &str| info["memory"][name].as_u64().map_or_else(|| "?".to_owned(), system::size);
    let (columns, tree) = (bytes("column_bytes"), bytes("tree_bytes"));
    line("memory", format!("columns {columns}, tree {tree}, {} in all while it was built", bytes("peak_bytes")));
    let seconds = |name: &str| info["seconds"][name].as_f64().unwrap_or(0.0);
    line("time", format!("read in {:.3} s, built in {:.3} s", seconds("load"), seconds("build")));
    page
}

fn word(value: &Value) -> String {
    value.as_str().unwrap_or_default().to_owned()
}

fn vector(value: &Value) -> String {
    let numbers = value.as_array().into_iter().flatten().map(|number| {
        let number = number.as_f64().unwrap_or(f64::NAN);
        if number != 0.0 && !(1e-3..1e6).contains(&number.abs()) {
            format!("{number:.4e}")
        } else {
            format!("{}", (number * 1e4).round() / 1e4)
        }
    });
    format!("({})", numbers.collect::<Vec<_>>().join(", "))
}
