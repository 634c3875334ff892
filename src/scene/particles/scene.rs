//! A scene around a file of atoms alone: a look for people who have a molecule and no scene file.

use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;

use super::{Drawn, Format, Look, Trajectory};
use crate::scene::frames::{Draft, OpenCamera, Store};
use crate::scene::{
    Backdrop, Background, Camera, Cloud, CloudMaterial, CloudShapes, Emitter, Filter, ImageSettings, Lens, Light,
    Material, Model, Paint, RenderSettings, Rows, Scene, SceneError, SceneErrors, Source, Visible, fit, rules,
};

/// Size of the picture, and samples per pixel.
const IMAGE: (u32, u32, u32) = (1200, 900, 32);
/// Degrees; far away, as molecules are usually drawn.
const VFOV: f64 = 20.0;
/// Reflected share of light where an atom's colour is white: less than the background.
const ALBEDO: f64 = 0.95;

/// Reads a frame of a file of atoms as a scene; its camera is to see all of the first one.
pub(in crate::scene) fn read(
    path: &Path,
    format: Format,
    look: &Look,
    frame: i64,
    store: &mut Store,
) -> Result<Draft, SceneErrors> {
    let (columns, bonds) = (look.columns(), look.needs_bonds(format));
    let key = (0, path.to_owned(), columns.clone(), bonds);
    let open = || Trajectory::open(path, format, columns, bonds);
    let trajectory = store.trajectories.get(key, open).map_err(|error| *error)?;
    let atoms = trajectory.frame(number(frame)).map_err(|error| *error)?;
    let drawn = look.draw(atoms, trajectory, rules::MOST_PRIMITIVES);
    let drawn = drawn.map_err(|broken| {
        let rule = [broken.key, &*broken.rule].join(" ").trim().to_owned();
        SceneError::of_file(path, rule, broken.found)
    })?;
    let up = if stands(trajectory.summary().extent) { DVec3::Z } else { DVec3::Y };
    let lens = Lens::Pinhole { vfov: VFOV };
    let camera = Camera { name: None, eye: fit::direction(up), target: DVec3::ZERO, up, lens };
    let (width, height, spp) = IMAGE;
    let mut scene = Scene {
        image: Some(ImageSettings { width, height, spp, filter: Filter::default() }),
        cameras: vec![camera],
        background: Background { backdrop: Backdrop::Color(DVec3::ONE), ..Background::default() },
        ambient: DVec3::splat(AMBIENT),
        render: RenderSettings { ambient_occlusion: true, ..RenderSettings::default() },
        materials: vec![material("atoms"), material("bonds")],
        warnings: drawn.warnings.clone(),
        clouds: clouds(drawn, [0, 1]),
        ..Scene::default()
    };
    if let Some((row, broken)) = first_broken(&scene) {
        return Err(SceneError::of_file(path, format!("atom {row}: {}", broken.rule), broken.found).into());
    }
    scene.lights = lights(&scene);
    Ok(Draft { scene, cameras: vec![OpenCamera { index: 0, framed: true, orbit: None }] })
}

/// Whether atoms reach so far along z that they are looked at from the side, with z up.
fn stands(extent: DVec3) -> bool {
    extent.z > 1.5 * extent.x.max(extent.y)
}

/// Frames before the first one are it.
pub(in crate::scene) fn number(frame: i64) -> u64 {
    frame.max(1).unsigned_abs()
}

/// The clouds of a drawn frame: spheres, and cylinders where there are bonds, of two materials.
pub(in crate::scene) fn clouds(drawn: Drawn, materials: [usize; 2]) -> Vec<Cloud> {
    let cloud = |shapes, material, colors| Cloud {
        shapes,
        material: CloudMaterial::One(material),
        colors: Some(colors),
        name: None,
        group: None,
    };
    let mut clouds = vec![cloud(CloudShapes::Spheres(Rows::F64(drawn.spheres)), materials[0], drawn.sphere_colors)];
    if !drawn.sticks.is_empty() {
        // The ends are inside the atoms and inside each other.
        clouds.push(cloud(CloudShapes::Cylinders(Rows::F64(drawn.sticks), false), materials[1], drawn.stick_colors));
    }
    clouds
}

fn first_broken(scene: &Scene) -> Option<(usize, rules::Broken)> {
    let mut all = scene.primitives().enumerate();
    all.find_map(|(row, primitive)| rules::shape(&primitive.shape).err().map(|broken| (row + 1, broken)))
}

fn material(name: &str) -> Material {
    let model = Model::Diffuse { albedo: Paint::Color(DVec3::splat(ALBEDO)) };
    Material { name: name.to_owned(), model, back: None, visible: Visible::Both }
}

/// Ambient light, which reaches a place as far as that is open: it shows what lies deeper.
const AMBIENT: f64 = 0.45;
/// Irradiance over pi of the key light, and of the fill light.
const KEY: f64 = 0.55;
const FILL: f64 = 0.05;
/// How far the key light is, in radii of the scene, and how large it is seen from there: the half angle in degrees, of
/// which shadows are as soft.
const KEY_DISTANCE: f64 = 20.0;
const KEY_ANGLE: f64 = 4.0;

/// The lights of the look beside ambient light: a soft key light over the left shoulder and a fill light from the right
/// without shadows.
fn lights(scene: &Scene) -> Vec<Light> {
    let Some(camera) = scene.cameras.first() else { return Vec::new() };
    let (right, up, forward) = camera.axes();
    let along = |[x, y, z]: [f64; 3]| (x * right + y * up + z * forward).normalize();
    let (center, radius) = fit::ball(scene);
    let (way, distance) = (along([0.6, -0.8, 0.8]), KEY_DISTANCE * radius);
    let size = KEY_ANGLE.to_radians().tan();
    let emitter = Emitter::Disk { center: center - distance * way, normal: way, radius: distance * size };
    let key = Source::Area { emitter, radiance: DVec3::splat(KEY / (size * size)), visible: false };
    let fill = Source::Directional { direction: along([-0.8, -0.2, 1.0]), irradiance: DVec3::splat(PI * FILL) };
    let light = |name: &str, source, shadows| Light { name: Some(name.to_owned()), shadows, source };
    vec![light("key", key, true), light("fill", fill, false)]
}
