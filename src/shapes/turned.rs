//! Boxes that are turned: the axis-aligned test in the box's own frame.

use glam::{DVec2, DVec3};

use super::cuboid::{Face, Stretch, face_uv, face64, slabs64};
use super::{Hidden8, Part, Ray64, Surface8, Surface64, roundings};
use crate::lanes::{Float8, Hit8, RayPacket, Vec3x8};
use crate::plan::{Owner, TurnedBoxPart};
use crate::scene::Visible;

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    min: Vec3x8, // corners relative to the origin, in the frame of the box
    max: Vec3x8,
    error: Vec3x8, // of both
    axes: [Vec3x8; 3],
}

impl Part for TurnedBoxPart {
    /// Center and half size, and the unit axes.
    type Rows = ([Vec3x8; 2], [Vec3x8; 3]);
    type Face = Self::Rows;
    type Anchor = Anchor;

    fn row(&self) -> ([DVec3; 2], [DVec3; 3]) {
        ([self.center, self.half], self.axes)
    }

    #[inline(always)]
    fn bounds8(([center, half], axes): &Self::Rows) -> (Vec3x8, Vec3x8) {
        let reach = axes[0].abs() * half.x + axes[1].abs() * half.y + axes[2].abs() * half.z;
        (*center - reach, *center + reach)
    }

    /// The difference is turned, not its two ends: far from the origin that keeps the box's size.
    #[inline(always)]
    fn anchor(rows: &Self::Rows, origin: &Vec3x8) -> Anchor {
        let ([center, half], axes) = *rows;
        let from = center - *origin;
        let f = local(&axes, from);
        // The center rounds with the scene, the origin with the camera, the difference once, its turning five times; then it
        // is added and divided.
        let moved = roundings(3.5) * center.abs().sum() + roundings(8.0) * from.abs().sum();
        let error = (f.abs() + half) * roundings(6.0) + Vec3x8::new(moved, moved, moved);
        Anchor { min: f - half, max: f + half, error, axes }
    }

    #[inline(always)]
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        _: &Self::Rows,
        anchor: &Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        _: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8 {
        let Anchor { min, max, error, axes } = anchor;
        let dir = local(axes, rays.dir);
        Stretch::new::<CERTIFY>(*min, *max, *error, dir, turning(rays)).first_of::<CULL, CERTIFY>(hidden, rays)
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let f = self.local(self.center - ray.origin);
        let (entry, exit) = slabs64(f - self.half, f + self.half, self.local(ray.dir));
        (entry <= exit).then(|| ray.first(entry, exit, visible)).flatten()
    }

    fn refine(&self, ray: &Ray64, t: f64, visible: Visible) -> Surface64 {
        let (f, dir) = (self.local(self.center - ray.origin), self.local(ray.dir));
        let (t, axis, upper) = face64(f - self.half, f + self.half, dir, t, visible);
        let side = if upper { 1.0 } else { -1.0 };
        let mut point = t * dir - f;
        point[axis] = side * self.half[axis];
        let turned = (0..3).map(|k| self.axes[k] * point[k]).sum::<DVec3>();
        Surface64 { t, point: self.center + turned, normal: side * self.axes[axis] }
    }

    #[inline(always)]
    fn face(rows: &Self::Rows) -> &Self::Rows {
        rows
    }

    fn surface(rows: &Self::Rows, rays: &RayPacket, t: Float8) -> Surface8 {
        let Anchor { min, max, error, .. } = Self::anchor(rows, &rays.origin);
        let ([center, half], axes) = *rows;
        let turned = turning(rays);
        let face = Face::at(t, [min, max, error], local(&axes, rays.dir), turned);
        let from_center = rays.dir.mul_add(t, rays.origin - center);
        let (point, normal) = face.put(-half, half, local(&axes, from_center));
        let turn = |v: Vec3x8| axes[0].mul_add(v.x, axes[1].mul_add(v.y, axes[2] * v.z));
        let error = roundings(4.0) * center.abs().sum() + roundings(8.0) * half.sum();
        Surface8 { point: center + turn(point), normal: turn(normal), error, vague: face.vague }
    }

    fn uv(&self, point: DVec3) -> DVec2 {
        face_uv(-self.half, self.half, self.local(point - self.center))
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let half: DVec3 = (0..3).map(|k| self.axes[k].abs() * self.half[k]).sum();
        (self.center - half, self.center + half)
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

/// Turning rounds each coordinate of a direction by a share of the whole.
#[inline(always)]
fn turning(rays: &RayPacket) -> Float8 {
    roundings(6.0) * rays.dir.abs().sum()
}

#[inline(always)]
fn local(axes: &[Vec3x8; 3], v: Vec3x8) -> Vec3x8 {
    Vec3x8::new(axes[0].dot(v), axes[1].dot(v), axes[2].dot(v))
}
