//! Boxes that are turned: the axis-aligned test in the box's own frame.

use glam::{DVec2, DVec3};

use super::cuboid::{face, face_uv, face64, first_of, slabs, slabs64};
use super::{Hidden8, Ray64, Sides, Store, Surface8, Surface64, nearer, roundings};
use crate::lanes::{Column3, Float8, Hit8, LANES, RayPacket, Vec3x8};
use crate::plan::{Owner, TurnedBoxPart};
use crate::scene::Visible;

/// All turned boxes of a render.
#[derive(Debug)]
pub struct TurnedBoxes {
    center: Column3,    // scene units
    half: Column3,      // scene units along the axes, > 0
    axes: [Column3; 3], // unit, at right angles
    sides: Sides,
    parts: Vec<TurnedBoxPart>,
}

/// Eight rows.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    center: Vec3x8,
    half: Vec3x8,
    axes: [Vec3x8; 3],
    hidden: Hidden8,
}

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    min: Vec3x8, // corners relative to the origin, in the frame of the box
    max: Vec3x8,
    axes: [Vec3x8; 3],
    hidden: Hidden8,
}

impl Store for TurnedBoxes {
    type Part = TurnedBoxPart;
    type Row = Row;
    type Anchor = Anchor;

    fn new(parts: Vec<TurnedBoxPart>, sides: Sides) -> Self {
        let center = Column3::new(parts.iter().map(|part| part.center));
        let half = Column3::new(parts.iter().map(|part| part.half));
        let axes = std::array::from_fn(|k| Column3::new(parts.iter().map(move |part| part.axes[k])));
        TurnedBoxes { center, half, axes, sides, parts }
    }

    fn parts(&self) -> &[TurnedBoxPart] {
        &self.parts
    }

    fn splat(&self, i: usize) -> Row {
        let axes = std::array::from_fn(|k| self.axes[k].splat(i));
        Row { center: self.center.splat(i), half: self.half.splat(i), axes, hidden: self.sides.splat(i) }
    }

    fn block(&self, first: usize) -> Row {
        let axes = std::array::from_fn(|k| self.axes[k].block(first));
        Row { center: self.center.block(first), half: self.half.block(first), axes, hidden: self.sides.block(first) }
    }

    fn gather(&self, rows: [u32; LANES]) -> Row {
        let axes = std::array::from_fn(|k| self.axes[k].gather(rows));
        let hidden = self.sides.lanes(|lane| rows[lane] as usize);
        Row { center: self.center.gather(rows), half: self.half.gather(rows), axes, hidden }
    }

    /// The difference is turned, not its two ends: far from the origin that keeps the box's size.
    #[inline(always)]
    fn anchor(row: &Row, origin: &Vec3x8) -> Anchor {
        let f = local(&row.axes, row.center - *origin);
        Anchor { min: f - row.half, max: f + row.half, axes: row.axes, hidden: row.hidden }
    }

    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor, rays: &RayPacket) -> Hit8 {
        let (entry, exit) = slabs(anchor.min, anchor.max, local(&anchor.axes, rays.dir));
        first_of::<CULL>(entry, exit, &anchor.hidden, rays)
    }

    fn decide(part: &TurnedBoxPart, ray: &Ray64, visible: Visible) -> Option<f64> {
        let f = part.local(part.center - ray.origin);
        let (entry, exit) = slabs64(f - part.half, f + part.half, part.local(ray.dir));
        (entry <= exit).then(|| ray.first(entry, exit, visible)).flatten()
    }

    fn refine(part: &TurnedBoxPart, ray: &Ray64, t: f64) -> Surface64 {
        let (f, dir) = (part.local(part.center - ray.origin), part.local(ray.dir));
        let (entry, exit) = slabs64(f - part.half, f + part.half, dir);
        let t = nearer(entry, exit, t);
        let (point, normal) = face64(-part.half, part.half, t * dir - f);
        let turn = |v: DVec3| (0..3).map(|k| part.axes[k] * v[k]).sum::<DVec3>();
        Surface64 { t, point: part.center + turn(point), normal: turn(normal) }
    }

    fn surface(row: &Row, rays: &RayPacket, t: Float8) -> Surface8 {
        let from_center = rays.dir.mul_add(t, rays.origin - row.center);
        let (point, normal) = face(-row.half, row.half, local(&row.axes, from_center));
        let turn = |v: Vec3x8| row.axes[0].mul_add(v.x, row.axes[1].mul_add(v.y, row.axes[2] * v.z));
        let reach = row.center.abs();
        let size = row.half.x + row.half.y + row.half.z;
        let error = roundings(4.0) * (reach.x + reach.y + reach.z) + roundings(8.0) * size;
        Surface8 { point: row.center + turn(point), normal: turn(normal), error }
    }

    fn uv(part: &TurnedBoxPart, point: DVec3) -> DVec2 {
        face_uv(-part.half, part.half, part.local(point - part.center))
    }

    fn bounds(part: &TurnedBoxPart) -> (DVec3, DVec3) {
        let half: DVec3 = (0..3).map(|k| part.axes[k].abs() * part.half[k]).sum();
        (part.center - half, part.center + half)
    }

    fn owner(part: &TurnedBoxPart) -> Owner {
        part.owner
    }

    fn sides(&self) -> &Sides {
        &self.sides
    }

    fn column_bytes(&self) -> usize {
        self.center.bytes() + self.half.bytes() + self.axes.iter().map(Column3::bytes).sum::<usize>()
    }
}

#[inline(always)]
fn local(axes: &[Vec3x8; 3], v: Vec3x8) -> Vec3x8 {
    Vec3x8::new(axes[0].dot(v), axes[1].dot(v), axes[2].dot(v))
}
