//! The rules that the numbers of a scene keep, whichever file they come from.
//!
//! Readers ask here and add the place. What stands in a scene that passed can be traced: nothing is
//! NaN, nothing overflows when it is squared in f32, no shape is degenerate.

pub mod polygon;
mod simple;

use std::borrow::Cow;

use glam::DVec3;

use super::{Camera, Lens, Rows, Shape};

/// Largest size of a coordinate or length: its square still fits an f32.
pub const LARGEST: f64 = 1e15;
/// Most primitives of a scene: their indices are stored as i32.
pub const MOST_PRIMITIVES: usize = i32::MAX as usize;
/// Shortest direction, normal or axis: the square of its length still is a normal f64.
const SHORTEST: f64 = 1e-100;
/// Largest value of a colour, radiance or intensity: products of two still fit an f32.
const BRIGHTEST: f64 = 1e18;
/// Sine of the smallest angle between a camera's `up` and its view.
const LEAST_TILT: f64 = 1e-9;

/// A broken rule without its place.
#[derive(Debug, Clone, PartialEq)]
pub struct Broken {
    /// The key or column that breaks it; empty where it is the thing as a whole.
    pub key: &'static str,
    /// What would be right.
    pub rule: Cow<'static, str>,
    /// What is there.
    pub found: String,
}

/// What one number must be; finite in any case.
#[derive(Debug, Clone, Copy)]
pub struct Rule {
    limit: f64,
    holds: fn(f64) -> bool,
    text: &'static str,
}

impl Rule {
    /// Any finite number.
    pub const FINITE: Rule = Rule { limit: f64::MAX, holds: |_| true, text: "must be finite" };
    /// A coordinate.
    pub const COORDINATE: Rule = Rule { limit: LARGEST, ..Rule::FINITE };
    /// A radius or another size.
    pub const LENGTH: Rule = Rule { limit: LARGEST, holds: |x| x > 0.0, text: "must be > 0" };
    /// A size that may vanish.
    pub const LENGTH_OR_ZERO: Rule = Rule { limit: LARGEST, holds: |x| x >= 0.0, text: "must be >= 0" };
    /// A factor that divides.
    pub const POSITIVE: Rule = Rule { limit: BRIGHTEST, ..Rule::LENGTH };
    /// A component of a colour, radiance or intensity, or a weight of one.
    pub const COLOR: Rule = Rule { limit: BRIGHTEST, ..Rule::LENGTH_OR_ZERO };
    /// A part of a whole.
    pub const SHARE: Rule = Rule { holds: |x| (0.0..=1.0).contains(&x), text: "must be from 0 to 1", ..Rule::FINITE };
    /// The angle of view of a camera, degrees.
    pub const VFOV: Rule =
        Rule { holds: |x| x > 0.0 && x < 180.0, text: "must be greater than 0 and less than 180", ..Rule::FINITE };
    /// The half angle of a spot light, degrees.
    pub const CONE: Rule =
        Rule { holds: |x| x > 0.0 && x <= 90.0, text: "must be greater than 0 and at most 90", ..Rule::FINITE };
    /// Half the width of a pixel filter, pixels.
    pub const FILTER_RADIUS: Rule =
        Rule { holds: |x| x > 0.0 && x <= 64.0, text: "must be greater than 0 and at most 64", ..Rule::FINITE };

    /// What `x` should be, where it is not.
    pub fn broken_by(self, x: f64) -> Option<&'static str> {
        match x {
            _ if !x.is_finite() => Some("must be finite"),
            _ if !(self.holds)(x) => Some(self.text),
            _ if x.abs() > self.limit => {
                Some(if self.limit == LARGEST { "must be at most 1e15" } else { "must be at most 1e18" })
            }
            _ => None,
        }
    }
}

/// A number as messages show it.
pub fn show(x: f64) -> String {
    match x.abs() {
        size if x == 0.0 || (1e-5..1e16).contains(&size) || !x.is_finite() => format!("{x}"),
        _ => format!("{x:e}"),
    }
}

/// A vector as messages show it.
pub fn show_vector(v: DVec3) -> String {
    format!("[{}, {}, {}]", show(v.x), show(v.y), show(v.z))
}

/// What a direction, normal or axis should be, where `v` is not.
pub fn direction_broken_by(v: DVec3) -> Option<&'static str> {
    match v.abs().max_element() {
        _ if !v.is_finite() => Some("must be finite"),
        0.0 => Some("must not be zero"),
        size if size < SHORTEST => Some("must be longer than 1e-100"),
        size if size > LARGEST => Some("must be at most 1e15"),
        _ => None,
    }
}

/// Whether all rows are spheres that break no rule; what [`shape`] would say of one that does is not looked for.
pub fn are_spheres(rows: &Rows<4>) -> bool {
    // Written so that NaN is neither.
    let is_place = |x: f64| x.abs() <= LARGEST;
    let is_sphere = |[x, y, z, r]: [f64; 4]| is_place(x) & is_place(y) & is_place(z) & is_place(r) & (r > 0.0);
    match rows {
        Rows::F32(rows) => rows.iter().all(|row| is_sphere(row.map(f64::from))),
        Rows::F64(rows) => rows.iter().all(|row| is_sphere(*row)),
    }
}

fn broken(shape: &str, key: &'static str, text: &str, found: String) -> Broken {
    Broken { key, rule: format!("{shape} {key} {text}").into(), found }
}

/// Checks one number of a shape.
fn number(shape: &str, key: &'static str, x: f64, rule: Rule) -> Result<(), Broken> {
    rule.broken_by(x).map_or(Ok(()), |text| Err(broken(shape, key, text, show(x))))
}

fn point(shape: &str, key: &'static str, v: DVec3) -> Result<(), Broken> {
    v.to_array().into_iter().try_for_each(|x| number(shape, key, x, Rule::COORDINATE))
}

fn direction(shape: &str, key: &'static str, v: DVec3) -> Result<(), Broken> {
    direction_broken_by(v).map_or(Ok(()), |text| Err(broken(shape, key, text, show_vector(v))))
}

/// Checks a shape in world coordinates.
///
/// # Errors
/// The first rule it breaks. The corners of a polygon must keep all rules of [`polygon::clean`],
/// with none left to drop.
pub fn shape(shape: &Shape) -> Result<(), Broken> {
    let kind = shape.kind();
    match shape {
        Shape::Sphere(sphere) => {
            point(kind, "center", sphere.center)?;
            number(kind, "radius", sphere.radius, Rule::LENGTH)
        }
        Shape::Plane(plane) => {
            point(kind, "point", plane.point)?;
            direction(kind, "normal", plane.normal)
        }
        Shape::Disk(disk) => {
            point(kind, "center", disk.center)?;
            direction(kind, "normal", disk.normal)?;
            number(kind, "radius", disk.radius, Rule::LENGTH)?;
            number(kind, "inner_radius", disk.inner_radius, Rule::LENGTH_OR_ZERO)?;
            let fits = disk.inner_radius < disk.radius;
            if fits {
                Ok(())
            } else {
                Err(broken(kind, "inner_radius", "must be less than its radius", show(disk.inner_radius)))
            }
        }
        Shape::Box(cuboid) => {
            point(kind, "min", cuboid.min)?;
            point(kind, "max", cuboid.max)?;
            let found = || format!("{} to {}", show_vector(cuboid.min), show_vector(cuboid.max));
            let solid = cuboid.min.cmplt(cuboid.max).all();
            if solid { Ok(()) } else { Err(broken(kind, "min", "must be less than max in x, y and z", found())) }
        }
        Shape::Cylinder(cylinder) => {
            axis(kind, cylinder.base, cylinder.apex)?;
            number(kind, "radius", cylinder.radius, Rule::LENGTH)
        }
        Shape::Cone(cone) => {
            axis(kind, cone.base, cone.apex)?;
            number(kind, "radius", cone.radius, Rule::LENGTH_OR_ZERO)?;
            number(kind, "apex_radius", cone.apex_radius, Rule::LENGTH_OR_ZERO)?;
            let text = "must differ from its radius (equal radii are a cylinder)";
            let found = || show(cone.apex_radius);
            if cone.radius == cone.apex_radius { Err(broken(kind, "apex_radius", text, found())) } else { Ok(()) }
        }
        Shape::Polygon(polygon) => polygon::check(polygon),
    }
}

fn axis(kind: &str, base: DVec3, apex: DVec3) -> Result<(), Broken> {
    point(kind, "base", base)?;
    point(kind, "apex", apex)?;
    let long = direction_broken_by(apex - base).is_none();
    if long { Ok(()) } else { Err(broken(kind, "apex", "must differ from its base", show_vector(apex))) }
}

/// Checks that a camera's numbers go together.
///
/// # Errors
/// The first rule it breaks.
pub fn camera(camera: &Camera) -> Result<(), Broken> {
    let kind = "camera";
    point(kind, "eye", camera.eye)?;
    point(kind, "target", camera.target)?;
    direction(kind, "up", camera.up)?;
    match camera.lens {
        Lens::Pinhole { vfov } => number(kind, "vfov", vfov, Rule::VFOV)?,
        Lens::Orthographic { height } => number(kind, "height", height, Rule::LENGTH)?,
        Lens::ThinLens { vfov, aperture, focus } => {
            number(kind, "vfov", vfov, Rule::VFOV)?;
            number(kind, "aperture", aperture, Rule::LENGTH)?;
            number(kind, "focus", focus, Rule::LENGTH)?;
        }
        Lens::Panoramic => {}
    }
    let view = camera.target - camera.eye;
    if direction_broken_by(view).is_some() {
        return Err(broken(kind, "target", "must differ from its eye", show_vector(camera.target)));
    }
    if view.normalize().cross(camera.up.normalize()).length() <= LEAST_TILT {
        return Err(broken(kind, "up", "must not be parallel to the view", show_vector(camera.up)));
    }
    Ok(())
}
