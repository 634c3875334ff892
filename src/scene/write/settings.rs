//! All of a scene but its geometry.

use std::io;
use std::path::Path;

use glam::DVec3;

use super::text::{Table, keys, list, number, path, quoted, vector};
use crate::scene::{
    Backdrop, Background, Camera, ColorSpace, Emitter, Falloff, FilterKind, ImageSettings, Integrator, Layers, Lens,
    Light, Material, Model, Paint, Part, RenderSettings, Scene, Source, Texture, TextureFilter, TextureKind, Visible,
    Wrap,
};

/// Adds the tables of everything but shapes and clouds.
pub(super) fn all(scene: &Scene, file: &Path, add: &mut impl FnMut(Table)) -> io::Result<()> {
    let is_animated = |part| scene.tracks.iter().any(|track| track.part == Some(part));
    scene.image.iter().for_each(|settings| add(image(settings, scene.layers).over_time(scene, Part::Image)));
    if scene.render != RenderSettings::default() || is_animated(Part::Render) {
        add(render(&scene.render).over_time(scene, Part::Render));
    }
    for (index, lone_or_named) in scene.cameras.iter().enumerate() {
        add(camera(scene, index, lone_or_named));
    }
    if let Some(table) = background(&scene.background, is_animated(Part::Background), file)? {
        add(table.over_time(scene, Part::Background));
    }
    if scene.ambient != DVec3::ZERO || is_animated(Part::Ambient) {
        add(Table::new("ambient").set("color", vector(scene.ambient)).over_time(scene, Part::Ambient));
    }
    for (index, named) in scene.textures.iter().enumerate() {
        add(texture(named, file)?.over_time(scene, Part::Texture(index)));
    }
    for (index, named) in scene.materials.iter().enumerate() {
        add(material(scene, named).over_time(scene, Part::Material(index)));
    }
    for (index, source) in scene.lights.iter().enumerate() {
        add(light(source).over_time(scene, Part::Light(index)));
    }
    scene.groups.iter().for_each(|name| add(Table::one_of("groups").set("name", quoted(name))));
    Ok(())
}

fn image(image: &ImageSettings, layers: Layers) -> Table {
    let filter = match image.filter.kind {
        FilterKind::Box => "box",
        FilterKind::Gaussian => "gaussian",
        FilterKind::BlackmanHarris => "blackman-harris",
    };
    let usual = Layers::default();
    let names = (!layers.is_empty()).then(|| list(layers.iter().map(|aov| quoted(aov.name()))));
    Table::new("image")
        .set("width", image.width)
        .set("height", image.height)
        .set("spp", image.spp)
        .set("filter", quoted(filter))
        .set("filter_radius", number(image.filter.radius))
        .set_some("aovs", names)
        .set_some("crypto_ranks", (layers.ranks != usual.ranks).then_some(layers.ranks))
        .set_some("instances", layers.instances.then(|| quoted("each")))
}

fn render(render: &RenderSettings) -> Table {
    let integrator = match render.integrator {
        Integrator::Direct => "direct",
        Integrator::Ao => "ao",
        Integrator::Path => "path",
    };
    let distance = Some(render.ao_distance).filter(|distance| distance.is_finite());
    Table::new("render")
        .set("integrator", quoted(integrator))
        .set("max_depth", render.max_depth)
        .set("seed", render.seed)
        .set_some("noise", render.noise.map(number))
        .set_some("ao_distance", distance.map(number))
        .set_some("ambient_occlusion", render.ambient_occlusion.then_some(true))
        .set_some("shutter", (render.shutter > 0.0).then(|| number(render.shutter)))
}

fn camera(scene: &Scene, index: usize, camera: &Camera) -> Table {
    let part = Part::Camera(index);
    let orbit = scene.tracks.iter().find(|track| track.part == Some(part) && track.key == "orbit");
    let table = match &camera.name {
        Some(name) => Table::one_of("cameras").set("name", quoted(name)),
        None => Table::new("camera"),
    };
    let table = match camera.lens {
        Lens::Pinhole { vfov } => table.set("type", quoted("pinhole")).set("vfov", number(vfov)),
        Lens::Orthographic { height } => table.set("type", quoted("orthographic")).set("height", number(height)),
        Lens::ThinLens { vfov, aperture, focus } => table
            .set("type", quoted("thin-lens"))
            .set("vfov", number(vfov))
            .set("aperture", number(aperture))
            .set("focus", number(focus)),
        Lens::Panoramic => table.set("type", quoted("panoramic")),
    };
    // The eye is kept as it is turned at this frame.
    let angle = orbit.and_then(|track| track.now.first()).map_or(0.0, |angle| -angle);
    let table = table.set("eye", vector(camera.orbited(angle))).set("target", vector(camera.target));
    table.set("up", vector(camera.up)).set_some("orbit", orbit.map(keys)).over_time(scene, part)
}

fn background(background: &Background, animated: bool, file: &Path) -> io::Result<Option<Table>> {
    let table = Table::new("background");
    let table = match &background.backdrop {
        Backdrop::Color(DVec3::ZERO) if !background.transparent && !animated => return Ok(None),
        Backdrop::Color(color) => table.set("color", vector(*color)),
        Backdrop::Gradient { top, bottom } => table.set("top", vector(*top)).set("bottom", vector(*bottom)),
        Backdrop::Image { image, scale, rotation } => {
            let table = table.set("image", path(&image.file, file)?);
            let table = table.set("scale", number(*scale)).set("rotation", number(*rotation));
            if background.light { table } else { table.set("light", false) }
        }
    };
    Ok(Some(if background.transparent { table.set("transparent", true) } else { table }))
}

fn texture(texture: &Texture, file: &Path) -> io::Result<Table> {
    let table = Table::named("textures", &texture.name);
    Ok(match &texture.kind {
        TextureKind::Checker(checker) => table
            .set("type", quoted("checker"))
            .set("colors", list(checker.colors.into_iter().map(vector)))
            .set("scale", list(checker.scale.into_iter().map(number))),
        TextureKind::Image(image) => {
            let wrap = match image.wrap {
                Wrap::Repeat => "repeat",
                Wrap::Clamp => "clamp",
            };
            let filter = match image.filter {
                TextureFilter::Bilinear => "bilinear",
                TextureFilter::Nearest => "nearest",
            };
            let color_space = match image.color_space {
                ColorSpace::Srgb => "srgb",
                ColorSpace::Linear => "linear",
            };
            table
                .set("type", quoted("image"))
                .set("file", path(&image.file, file)?)
                .set("wrap", quoted(wrap))
                .set("filter", quoted(filter))
                .set("color_space", quoted(color_space))
        }
    })
}

fn material(scene: &Scene, material: &Material) -> Table {
    let paint = |paint| match paint {
        Paint::Color(color) => vector(color),
        Paint::Texture(texture) => format!("{{ texture = {} }}", quoted(&scene.textures[texture].name)),
    };
    let table = Table::named("materials", &material.name);
    let table = match material.model {
        Model::Diffuse { albedo } => table.set("type", quoted("diffuse")).set("albedo", paint(albedo)),
        Model::Mirror { reflectance } => table.set("type", quoted("mirror")).set("reflectance", paint(reflectance)),
        Model::Dielectric { ior, tint } => {
            table.set("type", quoted("dielectric")).set("ior", number(ior)).set("tint", paint(tint))
        }
        Model::Phong { color, kd, ks, shine, transmittance, ior } => table
            .set("type", quoted("phong"))
            .set("color", paint(color))
            .set("kd", number(kd))
            .set("ks", number(ks))
            .set("shine", number(shine))
            .set("transmittance", number(transmittance))
            .set("ior", number(ior)),
    };
    let table = table.set_some("back", material.back.map(|back| quoted(&scene.materials[back].name)));
    match material.visible {
        Visible::Both => table,
        Visible::Front => table.set("one_sided", true),
        Visible::Back => table.set("one_sided", quoted("back")),
    }
}

fn light(light: &Light) -> Table {
    let table = Table::one_of("lights").set_some("name", light.name.as_deref().map(quoted));
    let table = match &light.source {
        &Source::Point { position, intensity, falloff } => {
            let falloff = match falloff {
                Falloff::InverseSquare => "inverse-square",
                Falloff::None => "none",
            };
            table
                .set("type", quoted("point"))
                .set("position", vector(position))
                .set("intensity", vector(intensity))
                .set("falloff", quoted(falloff))
        }
        &Source::Directional { direction, irradiance } => table
            .set("type", quoted("directional"))
            .set("direction", vector(direction))
            .set("irradiance", vector(irradiance)),
        &Source::Spot { position, direction, intensity, cone, penumbra } => table
            .set("type", quoted("spot"))
            .set("position", vector(position))
            .set("direction", vector(direction))
            .set("intensity", vector(intensity))
            .set("cone", number(cone))
            .set("penumbra", number(penumbra)),
        Source::Area { emitter, radiance, visible } => {
            let table = emission(table, emitter).set("radiance", vector(*radiance));
            if *visible { table } else { table.set("visible", false) }
        }
    };
    if light.shadows { table } else { table.set("shadows", false) }
}

fn emission(table: Table, emitter: &Emitter) -> Table {
    match emitter {
        Emitter::Sphere { center, radius } => {
            table.set("type", quoted("sphere")).set("center", vector(*center)).set("radius", number(*radius))
        }
        Emitter::Disk { center, normal, radius } => table
            .set("type", quoted("disk"))
            .set("center", vector(*center))
            .set("normal", vector(*normal))
            .set("radius", number(*radius)),
        Emitter::Polygon(polygon) => {
            table.set("type", quoted("polygon")).set("corners", list(polygon.corners.iter().copied().map(vector)))
        }
    }
}
