//! Convex polygons of up to `N` corners; shorter ones repeat their last corner, whose edge of no length
//! is neutral in the test.

use glam::{DVec2, DVec3};

use super::plane::{flat_surface, flat_surface64, shows, side_hidden};
use super::{Hidden8, Ray64, Sides, Store, Surface8, Surface64, roundings};
use crate::lanes::{Column3, Float8, Hit8, LANES, Mask8, RayPacket, Vec3x8};
use crate::plan::{Owner, PolygonPart};
use crate::scene::Visible;

/// All convex polygons of a render with at most `N` corners.
#[derive(Debug)]
pub struct Polygons<const N: usize> {
    normal: Column3,       // unit, Newell's, of the whole polygon that this is a part of
    corners: [Column3; N], // scene units, counter-clockwise seen from the front
    sides: Sides,
    parts: Vec<PolygonPart<N>>,
}

/// Eight rows.
#[derive(Debug, Clone, Copy)]
pub struct Row<const N: usize> {
    normal: Vec3x8,
    corners: [Vec3x8; N],
    hidden: Hidden8,
}

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor<const N: usize> {
    height: Float8, // n . (first corner - origin)
    normal: Vec3x8,
    edges: [Vec3x8; N], // a x (b - a) for each edge ab seen from the origin
    bound: Float8,      // error of dir . edge for |dir|_1 = 1, the rounding of the scene included
    hidden: Hidden8,
}

impl<const N: usize> Store for Polygons<N> {
    type Part = PolygonPart<N>;
    type Row = Row<N>;
    type Anchor = Anchor<N>;

    fn new(parts: Vec<PolygonPart<N>>, sides: Sides) -> Self {
        let normal = Column3::new(parts.iter().map(|part| part.normal));
        let corners = std::array::from_fn(|k| Column3::new(parts.iter().map(move |part| part.corners[k])));
        Polygons { normal, corners, sides, parts }
    }

    fn parts(&self) -> &[PolygonPart<N>] {
        &self.parts
    }

    #[inline(always)]
    fn splat(&self, i: usize) -> Row<N> {
        let corners = std::array::from_fn(|k| self.corners[k].splat(i));
        Row { normal: self.normal.splat(i), corners, hidden: self.sides.splat(i) }
    }

    #[inline(always)]
    fn block(&self, first: usize) -> Row<N> {
        let corners = std::array::from_fn(|k| self.corners[k].block(first));
        Row { normal: self.normal.block(first), corners, hidden: self.sides.block(first) }
    }

    fn gather(&self, rows: [u32; LANES]) -> Row<N> {
        let corners = std::array::from_fn(|k| self.corners[k].gather(rows));
        let hidden = self.sides.lanes(|lane| rows[lane] as usize);
        Row { normal: self.normal.gather(rows), corners, hidden }
    }

    #[inline(always)]
    fn anchor(row: &Row<N>, origin: &Vec3x8) -> Anchor<N> {
        let a: [Vec3x8; N] = std::array::from_fn(|k| row.corners[k] - *origin);
        let side: [Vec3x8; N] = std::array::from_fn(|k| row.corners[(k + 1) % N] - row.corners[k]);
        let edges = std::array::from_fn(|k| a[k].cross(side[k]));
        let norm = |v: Vec3x8| (v.abs().x + v.abs().y) + v.abs().z;
        let (mut reach, mut size) = (Float8::ZERO, Float8::ZERO);
        for k in 0..N {
            reach = reach.fast_max(norm(a[k]) + norm(row.corners[k]));
            size = size.fast_max(norm(side[k]));
        }
        // Corners round with the scene, a with the subtraction, the product and the sum three times.
        let bound = roundings(8.0) * reach * size;
        Anchor { height: row.normal.dot(a[0]), normal: row.normal, edges, bound, hidden: row.hidden }
    }

    /// The ray passes each edge ab on the same side: the sign of `dir . (a x b)`, with a and b seen from
    /// the origin, as `a x (b - a)`, which loses nothing for small polygons far away. `t` comes from the
    /// plane. Lanes that pass an edge more closely than the bound are decided in f64, where touching
    /// counts, so no ray slips between two polygons that share an edge.
    ///
    /// Source: equation (10) of Kucherov, Morgun and Golenkovskaya, 2016, section IV C, with the origin
    /// moved to the ray's, without which it depends on where the scene lies.
    #[inline(always)]
    fn hit<const CULL: bool>(anchor: &Anchor<N>, rays: &RayPacket) -> Hit8 {
        let nd = anchor.normal.dot(rays.dir);
        // Seen from the front the edge products are negative; the sign of n . dir makes them positive.
        let flip = Mask8::sign(nd);
        let mut least = Float8::splat(f32::INFINITY);
        for edge in &anchor.edges {
            let e = edge.dot(rays.dir);
            least = least.fast_min(flip.select(-e, e));
        }
        let dir = rays.dir.abs();
        let bound = anchor.bound * (dir.x + dir.y + dir.z);
        let mut possible = Mask8::ge(least, -bound);
        if !possible.any() {
            return Hit8::none();
        }
        let t = anchor.height / nd;
        possible &= rays.accepts(t) & Mask8::lt(t, Float8::splat(f32::INFINITY));
        if CULL {
            possible &= !side_hidden(nd, &anchor.hidden);
        }
        let doubt = possible & Mask8::le(least, bound);
        Hit8 { t, mask: possible & !doubt, doubt }
    }

    fn decide(part: &PolygonPart<N>, ray: &Ray64, visible: Visible) -> Option<f64> {
        let a = part.corners.map(|corner| corner - ray.origin);
        let nd = part.normal.dot(ray.dir);
        let t = part.normal.dot(a[0]) / nd;
        if !(t.is_finite() && ray.accepts(t) && shows(nd, visible)) {
            return None;
        }
        let inside = |k: usize| {
            let (a, side) = (a[k], part.corners[(k + 1) % N] - part.corners[k]);
            let bound = 4.0 * f64::EPSILON * a.length() * side.length() * ray.dir.length();
            a.cross(side).dot(ray.dir) * nd.signum() >= -bound
        };
        (0..N).all(inside).then_some(t)
    }

    fn refine(part: &PolygonPart<N>, ray: &Ray64, _: f64) -> Surface64 {
        flat_surface64(part.corners[0], part.normal, ray)
    }

    #[inline(always)]
    fn surface(row: &Row<N>, rays: &RayPacket, t: Float8) -> Surface8 {
        flat_surface(row.corners[0], row.normal, rays, t)
    }

    /// In scene units along the first edge and across it. Polygons with `uvs` interpolate those instead.
    fn uv(part: &PolygonPart<N>, point: DVec3) -> DVec2 {
        let (d, edge) = (point - part.uv_origin, part.uv_edge);
        DVec2::new(d.dot(edge), d.dot(part.normal.cross(edge)))
    }

    fn bounds(part: &PolygonPart<N>) -> (DVec3, DVec3) {
        let corners = part.corners;
        (corners.iter().copied().fold(corners[0], DVec3::min), corners.iter().copied().fold(corners[0], DVec3::max))
    }

    fn owner(part: &PolygonPart<N>) -> Owner {
        part.owner
    }

    fn sides(&self) -> &Sides {
        &self.sides
    }

    fn column_bytes(&self) -> usize {
        self.normal.bytes() + self.corners.iter().map(Column3::bytes).sum::<usize>()
    }
}
