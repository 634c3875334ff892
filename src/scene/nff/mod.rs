//! Scenes in Eric Haines's Neutral File Format, the output of the Standard Procedural Databases.
//!
//! Source: Haines, "A proposal for standard graphics environments", IEEE Computer Graphics and
//! Applications 7(11), 1987, with the format description of SPD 3.14. A file is a stream of words; where
//! lines end means nothing. What NFF leaves to the reader is decided here:
//!
//! - **View.** The angle is measured between the centres of the outermost pixels, [`Lens::Pinhole`]'s
//!   between the outer edges of the top and bottom ones: `tan(vfov/2) = tan(angle/2) H/(H-1)` with the
//!   picture H pixels high. Pixels are square, so where width and height differ the angle is the
//!   vertical one. One row alone has no centres to measure between: the angle is its edges' then.
//!   `hither` is read and not used. A file without a view has no camera and can only be queried.
//! - **Lights** have no falloff. NFF's classic shading is `kd x color x cos x strength`; [`Phong`](super::Model::Phong)
//!   has `E/pi`, so the intensity is pi x strength. A light without a colour has the strength
//!   `sqrt(n)/2n` for n lights of whatever colour, as SPD suggests; a colour is the strength as it stands.
//!   The ambient light is `sqrt(n)/2n` too, and none in a file without lights.
//! - **Sides.** `s`, `c` and `p` are seen from their front alone unless their surface transmits, `pp` from
//!   both sides, and what has a negative radius from inside alone. Backs still cast shadows.
//! - **Materials**: one for each surface and each way it is seen, in the order in which objects use them.
//!   Surface `i` (from 1, equal ones counted once) is `fi`, and `fi_two_sided` or `fi_inside` where an object
//!   is seen otherwise than is usual for the surface.
//! - `c` makes a [`Cylinder`](super::Cylinder) where both radii are equal, else a [`Cone`](super::Cone),
//!   open at both ends. An apex wider than the base is taken as it stands.

mod statement;
mod surface;
mod tokens;
mod unpack;

use std::f64::consts::PI;
use std::path::Path;

use glam::DVec3;

use self::statement::{Statements, View};
use super::error::Source;
use super::{Backdrop, Background, Camera, Falloff, Filter, ImageSettings, Lens, Light, Scene, SceneErrors};

pub use self::unpack::load;

/// Samples per pixel of a scene that names none.
const SPP: u32 = 16;

/// Reads the text of an NFF file; `path` is what its errors and warnings call it.
///
/// # Errors
/// All that is wrong with the file, in file order, each with its line and column.
pub fn read(text: &str, path: &Path) -> Result<Scene, SceneErrors> {
    let source = Source::new(path, text);
    let mut file = Statements::read(&source);
    if !file.errors.is_empty() {
        file.errors.add_source(&source);
        return Err(file.errors);
    }
    let count = file.lights.len() as f64;
    let usual = if file.lights.is_empty() { 0.0 } else { count.sqrt() / (2.0 * count) };
    let light = |(position, color): (DVec3, Option<DVec3>)| Light {
        name: None,
        shadows: true,
        source: super::Source::Point {
            position,
            intensity: PI * color.unwrap_or(DVec3::splat(usual)),
            falloff: Falloff::None,
        },
    };
    Ok(Scene {
        image: file.view.as_ref().map(image),
        cameras: file.view.iter().map(camera).collect(),
        background: Background {
            backdrop: Backdrop::Color(file.background.unwrap_or(DVec3::ZERO)),
            ..Background::default()
        },
        ambient: DVec3::splat(usual),
        lights: file.lights.into_iter().map(light).collect(),
        materials: file.surfaces.into_materials(),
        objects: file.objects,
        warnings: file.warnings,
        ..Scene::default()
    })
}

fn image(view: &View) -> ImageSettings {
    let [width, height] = view.resolution;
    ImageSettings { width, height, spp: SPP, filter: Filter::default() }
}

fn camera(view: &View) -> Camera {
    let [eye, target, up] = [view.from, view.at, view.up];
    Camera { name: None, eye, target, up, lens: Lens::Pinhole { vfov: edge_angle(view.angle, view.resolution[1]) } }
}

/// From the angle between the centres of the outermost of `rows` pixels to that between their edges, in degrees.
fn edge_angle(angle: f64, rows: u32) -> f64 {
    let rows = f64::from(rows);
    if rows < 2.0 {
        return angle;
    }
    2.0 * ((0.5 * angle).to_radians().tan() * rows / (rows - 1.0)).atan().to_degrees()
}

#[cfg(test)]
mod tests;
