//! Flat disks and rings.

use glam::{DVec2, DVec3};

use super::line::{Line, Root, Roots, Surface, turns};
use super::margin::ratio;
use super::plane::Plane;
use crate::scene;

/// The points of a plane from `inner` to `radius` from its point, both included.
#[derive(Debug, Clone)]
pub struct Disk {
    plane: Plane,
    radius: f64,
    inner: f64,
}

impl Disk {
    pub fn new(disk: &scene::Disk, origin: DVec3) -> Disk {
        let plane = Plane { point: disk.center - origin, normal: disk.normal.normalize(), warp: 0.0 };
        Disk { plane, radius: disk.radius, inner: disk.inner_radius }
    }

    pub fn roots(&self, line: &Line) -> Roots {
        let Some(root) = self.plane.root(line) else { return [None, None] };
        let x = self.plane.offset(line, root.t);
        let distance = x.length();
        let hit = root.hit && self.inner <= distance && distance <= self.radius;
        if !line.judged {
            return [hit.then_some(root), None];
        }
        // The place slides along the line by the error of t; what of it is radial moves the decision.
        let slide = if distance > 0.0 { (x.dot(line.dir) / distance).abs() } else { line.dir.length() };
        let error = root.unit * slide + line.anchor_error(self.plane.point).length() + line.u * distance;
        let to = |radius: f64| error + line.stored(radius) + line.u * radius;
        let outer = ratio(self.radius - distance, to(self.radius));
        let inner = if self.inner > 0.0 { ratio(distance - self.inner, to(self.inner)) } else { f64::INFINITY };
        [Some(Root { hit, margin: root.margin.min(outer).min(inner), ..root }), None]
    }

    pub fn surface(&self, line: &Line, root: &Root) -> Surface {
        let x = self.plane.offset(line, root.t);
        let (u, v) = scene::basis(self.plane.normal);
        let uv = DVec2::new(turns(x.dot(v), x.dot(u)), (x.length() / self.radius).min(1.0));
        Surface::flat(self.plane.point + x, self.plane.normal, uv, self.radius)
    }
}
