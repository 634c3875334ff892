//! Any of the bodies: where a primitive of the scene becomes one, and the only place that asks which.

use glam::DVec3;

use super::cone::Cone;
use super::cuboid::Cuboid;
use super::cylinder::cylinder;
use super::disk::Disk;
use super::line::{Line, Root, Roots, Surface};
use super::plane::Plane;
use super::polygon::Polygon;
use super::sphere::Sphere;
use crate::scene::Shape;

/// The geometry of one primitive, relative to the tracer's origin.
#[derive(Debug, Clone)]
pub enum Body {
    Sphere(Sphere),
    Plane(Plane),
    Disk(Disk),
    Polygon(Polygon),
    Box(Cuboid),
    /// Cylinders too.
    Cone(Cone),
}

impl Body {
    pub fn new(shape: &Shape, origin: DVec3) -> Body {
        match shape {
            Shape::Sphere(sphere) => Body::Sphere(Sphere::new(sphere, origin)),
            Shape::Plane(plane) => Body::Plane(Plane::new(plane, origin)),
            Shape::Disk(disk) => Body::Disk(Disk::new(disk, origin)),
            Shape::Polygon(polygon) => Body::Polygon(Polygon::new(polygon, origin)),
            Shape::Box(cuboid) => Body::Box(Cuboid::new(cuboid, origin)),
            Shape::Cylinder(shape) => Body::Cone(cylinder(shape, origin)),
            Shape::Cone(cone) => Body::Cone(Cone::new(cone, origin)),
        }
    }

    /// Where a line meets it; of a judged line also where it nearly does.
    pub fn roots(&self, line: &Line) -> Roots {
        match self {
            Body::Sphere(sphere) => sphere.roots(line),
            Body::Plane(plane) => plane.roots(line),
            Body::Disk(disk) => disk.roots(line),
            Body::Polygon(polygon) => polygon.roots(line),
            Body::Box(cuboid) => cuboid.roots(line),
            Body::Cone(cone) => cone.roots(line),
        }
    }

    /// What there is to know at one of its roots.
    pub fn surface(&self, line: &Line, root: &Root) -> Surface {
        match self {
            Body::Sphere(sphere) => sphere.surface(line, root),
            Body::Plane(plane) => plane.surface(line, root),
            Body::Disk(disk) => disk.surface(line, root),
            Body::Polygon(polygon) => polygon.surface(line, root),
            Body::Box(cuboid) => cuboid.surface(line, root),
            Body::Cone(cone) => cone.surface(line, root),
        }
    }
}
