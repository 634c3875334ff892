//! Infinite planes, and the plane under every flat shape.

use glam::{DVec2, DVec3};

use super::exact;
use super::line::{Line, Root, Roots, Surface};
use super::margin::{TOLERANCE, ratio};
use crate::scene;

/// `normal . (x - point) = 0`.
#[derive(Debug, Clone)]
pub struct Plane {
    pub point: DVec3,
    /// Unit.
    pub normal: DVec3,
    /// How far the shape strays from its plane, scene units: polygons may be planar only nearly.
    pub warp: f64,
}

impl Plane {
    pub fn new(plane: &scene::Plane, origin: DVec3) -> Plane {
        Plane { point: plane.point - origin, normal: plane.normal.normalize(), warp: 0.0 }
    }

    /// The one place where a line meets the plane, as a hit of unlimited margin.
    ///
    /// `None` where the line is parallel to the plane, lies it in the plane or not. Where f32 could
    /// not tell that, a judged line gets a miss at an unknown place instead.
    pub fn root(&self, line: &Line) -> Option<Root> {
        let (n, d) = (self.normal, line.dir);
        let (f, low) = exact::difference(self.point, line.origin);
        let distance = exact::dot([n.x, n.y, n.z, n.x, n.y, n.z], [f.x, f.y, f.z, low.x, low.y, low.z]);
        let speed = exact::dot(n.to_array(), d.to_array());
        let speed_error = line.u * (n * d).abs().element_sum();
        let t = distance / speed;
        let (hit, front) = (speed != 0.0 && t.is_finite(), speed < 0.0);
        if !line.judged {
            return hit.then_some(Root { t, hit, front, part: 0, unit: 0.0, margin: f64::INFINITY, facing: 0.0 });
        }
        let facing = ratio(speed.abs(), speed_error);
        if !hit {
            let unknown = Root { t: 0.0, hit, front, part: 0, unit: f64::INFINITY, margin: -0.0, facing };
            return (speed_error > 0.0).then_some(unknown);
        }
        let stored = (n * line.anchor_error(self.point)).abs().element_sum() + self.warp;
        let distance_error = line.u * (n * f).abs().element_sum() + stored;
        let unit = match facing {
            // First order says nothing about a quotient whose divisor may be 0.
            ..TOLERANCE => f64::INFINITY,
            _ => (distance_error + t.abs() * speed_error) / speed.abs() + line.u * t.abs(),
        };
        Some(Root { t, hit, front, part: 0, unit, margin: f64::INFINITY, facing })
    }

    pub fn roots(&self, line: &Line) -> Roots {
        [self.root(line), None]
    }

    /// From `self.point` to the place on the line, in the plane.
    pub fn offset(&self, line: &Line, t: f64) -> DVec3 {
        let (f, low) = exact::difference(self.point, line.origin);
        let x = exact::along(t, line.dir, f) - low;
        x - self.normal * self.normal.dot(x)
    }

    pub fn surface(&self, line: &Line, root: &Root) -> Surface {
        let x = self.offset(line, root.t);
        let (u, v) = scene::basis(self.normal);
        Surface::flat(self.point + x, self.normal, DVec2::new(x.dot(u), x.dot(v)), x.abs().max_element())
    }
}
