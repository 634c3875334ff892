//! A scene around a file of atoms alone: a look for people who have a molecule and no scene file.

use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;

use super::{Drawn, Format, Look, Trajectory};
use crate::scene::frames::{Draft, OpenCamera, Store};
use crate::scene::{
    Backdrop, Background, Camera, Cloud, CloudMaterial, CloudShapes, Filter, ImageSettings, Lens, Light, Material,
    Model, Paint, Rows, Scene, SceneError, SceneErrors, Source, Visible, fit, rules,
};

/// Size of the picture, and samples per pixel.
const IMAGE: (u32, u32, u32) = (1200, 900, 16);
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
    let (lights, ambient) = light(&camera);
    let scene = Scene {
        image: Some(ImageSettings { width, height, spp, filter: Filter::default() }),
        cameras: vec![camera],
        background: Background { backdrop: Backdrop::Color(DVec3::ONE), ..Background::default() },
        ambient,
        lights,
        materials: vec![material("atoms"), material("bonds")],
        warnings: drawn.warnings.clone(),
        clouds: clouds(drawn, [0, 1]),
        ..Scene::default()
    };
    if let Some((row, broken)) = first_broken(&scene) {
        return Err(SceneError::of_file(path, format!("atom {row}: {}", broken.rule), broken.found).into());
    }
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

/// All light of the look: a key light over the left shoulder, a fill light from the right without shadows, and
/// ambient light that stands for the light of the surroundings, which ambient occlusion would shade.
fn light(camera: &Camera) -> (Vec<Light>, DVec3) {
    let (right, up, forward) = camera.axes();
    let light = |name: &str, from: [f64; 3], strength: f64, shadows: bool| Light {
        name: Some(name.to_owned()),
        shadows,
        source: Source::Directional {
            direction: from[0] * right + from[1] * up + from[2] * forward,
            irradiance: DVec3::splat(PI * strength),
        },
    };
    let lights = vec![light("key", [0.6, -0.8, 0.8], 0.75, true), light("fill", [-0.8, -0.2, 1.0], 0.15, false)];
    (lights, DVec3::splat(0.15))
}
