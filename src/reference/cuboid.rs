//! Boxes: what six half-spaces have in common.

use glam::{DMat3, DVec2, DVec3};

use super::exact;
use super::line::{Line, Root, Roots, Surface};
use super::span::{Face, Span};
use crate::scene;

/// A box. Part `2 i` is its lower face across axis `i`, part `2 i + 1` the upper one.
#[derive(Debug, Clone)]
pub struct Cuboid {
    /// Corners before the rotation.
    min: DVec3,
    max: DVec3,
    /// Turns the box about its centre; `None`: axis-aligned.
    axes: Option<DMat3>,
}

/// A line's view of two opposite faces.
struct Slab {
    /// From the origin to the two faces along the axis, lower first.
    faces: [f64; 2],
    /// Axis . direction.
    speed: f64,
    /// The f32 errors of both.
    face_errors: [f64; 2],
    speed_error: f64,
}

impl Cuboid {
    pub fn new(cuboid: &scene::Cuboid, origin: DVec3) -> Cuboid {
        let axes = cuboid.rotation.map(|rotation| DMat3::from_quat(rotation.normalize()));
        Cuboid { min: cuboid.min - origin, max: cuboid.max - origin, axes }
    }

    fn center(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    fn slab(&self, line: &Line, i: usize) -> Slab {
        let Some(axes) = self.axes else {
            // f32 divides differences of stored numbers: nothing is lost but their own rounding.
            let faces = [self.min[i] - line.origin[i], self.max[i] - line.origin[i]];
            let error = |corner: f64, face: f64| line.stored(corner) + line.stored(face);
            let face_errors = [error(self.min[i], faces[0]), error(self.max[i], faces[1])];
            return Slab { faces, speed: line.dir[i], face_errors, speed_error: line.u * line.dir[i].abs() };
        };
        let (axis, half) = (axes.col(i), 0.5 * (self.max[i] - self.min[i]));
        let f = self.center() - line.origin;
        let middle = exact::dot(axis.to_array(), f.to_array());
        let anchor = (axis * line.anchor_error(self.center())).abs().element_sum();
        let error = line.u * ((axis * f).abs().element_sum() + half) + anchor + line.stored(half);
        Slab {
            faces: [middle - half, middle + half],
            speed: exact::dot(axis.to_array(), line.dir.to_array()),
            face_errors: [error; 2],
            speed_error: line.u * (axis * line.dir).abs().element_sum(),
        }
    }

    pub fn roots(&self, line: &Line) -> Roots {
        let mut span = Span::all(line);
        for i in 0..3 {
            let slab = self.slab(line, i);
            for (side, outward) in [-1.0, 1.0].into_iter().enumerate() {
                span.cut(Face {
                    distance: outward * slab.faces[side],
                    speed: outward * slab.speed,
                    distance_error: slab.face_errors[side],
                    speed_error: slab.speed_error,
                    part: (2 * i + side) as u8,
                });
            }
        }
        span.roots(line)
    }

    pub fn surface(&self, line: &Line, root: &Root) -> Surface {
        let (axis, side) = (usize::from(root.part / 2), usize::from(root.part % 2));
        // Distances from the lower faces, within the box, and exactly on the face that was hit.
        let size = self.max - self.min;
        let mut inside = DVec3::from_array(std::array::from_fn(|i| {
            let slab = self.slab(line, i);
            root.t.mul_add(slab.speed, -slab.faces[0]).clamp(0.0, size[i])
        }));
        inside[axis] = if side == 1 { size[axis] } else { 0.0 };
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let uv = DVec2::new(inside[u] / size[u], inside[v] / size[v]);
        let outward = if side == 1 { 1.0 } else { -1.0 };
        let (point, normal) = match self.axes {
            Some(axes) => (self.center() + axes * (inside - 0.5 * size), outward * axes.col(axis)),
            None => {
                let mut point = self.min + inside;
                point[axis] = if side == 1 { self.max[axis] } else { self.min[axis] };
                (point, outward * DVec3::AXES[axis])
            }
        };
        Surface::flat(point, normal, uv, size.max_element())
    }
}
