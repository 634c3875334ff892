//! Convex polygons of up to `N` corners; shorter ones, which have more than four, repeat their last corner.

use glam::{DVec2, DVec3};

use super::plane::{Crossing, flat_surface, flat_surface64, height_error, shows, side_hidden};
use super::{Hidden8, Part, Ray64, Surface8, Surface64, VANISHED, roundings};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, Vec3x8, float8};
use crate::plan::{Owner, PolygonPart};
use crate::scene::Visible;

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor<const N: usize> {
    height: Float8, // n . (first corner - origin)
    error: Float8,  // of the height
    normal: Vec3x8,
    edges: [Vec3x8; N], // a x (b - a) for each edge ab seen from the origin
    bound: Float8,      // error of dir . edge for |dir|_1 = 1, the rounding of the scene included
}

impl<const N: usize> Part for PolygonPart<N> {
    /// The unit normal of the whole polygon that this is a part of, and the corners.
    type Rows = (Vec3x8, [Vec3x8; N]);
    type Anchor = Anchor<N>;

    fn row(&self) -> (DVec3, [DVec3; N]) {
        (self.normal, self.corners)
    }

    #[inline(always)]
    fn anchor<'a>(rows: &Self::Rows, origin: &Vec3x8, _: impl Fn(usize) -> Option<&'a Self>) -> Anchor<N> {
        let (normal, corners) = rows;
        let mut edges = [Vec3x8::ZERO; N];
        let (mut reach, mut size) = (Float8::ZERO, Float8::ZERO);
        for k in 0..N {
            let (a, side) = (corners[k] - *origin, corners[(k + 1) % N] - corners[k]);
            let length = side.abs().sum();
            edges[k] = a.cross(side);
            // A corner that is repeated has an edge of no length, which says nothing: another one stands in for it.
            if (4..N - 1).contains(&k) {
                edges[k] = Vec3x8::select(Mask8::le(length, Float8::ZERO), edges[k - 1], edges[k]);
            }
            reach = reach.fast_max(a.abs().sum() + corners[k].abs().sum());
            size = size.fast_max(length);
        }
        // Corners round with the scene, a with the subtraction: each moves an edge by two of its roundings, and turns
        // it by as much over the widest way across, of which two edges make one of four corners, four one of eight.
        // Products, sum and direction round six times.
        let bound = (roundings(if N > 4 { 18.0 } else { 12.0 }) * reach).mul_add(size, float8(VANISHED));
        let first = corners[0] - *origin;
        let error = height_error(*normal, corners[0], first);
        Anchor { height: normal.dot(first), error, normal: *normal, edges, bound }
    }

    /// The ray passes each edge ab on the same side: the sign of `dir . (a x b)`, with a and b seen from
    /// the origin, as `a x (b - a)`, which loses nothing for small polygons far away. `t` comes from the
    /// plane. Lanes that pass an edge more closely than the bound are decided in f64, where touching
    /// counts, so no ray slips between two polygons that share an edge.
    ///
    /// Source: equation (10) of Kucherov, Morgun and Golenkovskaya, 2016, section IV C, with the origin
    /// moved to the ray's, without which it depends on where the scene lies.
    #[inline(always)]
    fn hit<const CULL: bool, const CERTIFY: bool>(anchor: &Anchor<N>, rays: &RayPacket, hidden: &Hidden8) -> Hit8 {
        let nd = anchor.normal.dot(rays.dir);
        // Seen from the front the edge products are negative; the sign of n . dir makes them positive.
        let flip = Mask8::sign(nd);
        let mut least = Float8::splat(f32::INFINITY);
        for edge in &anchor.edges {
            let e = edge.dot(rays.dir);
            least = least.fast_min(flip.select(-e, e));
        }
        let dir = rays.dir.abs().sum();
        let bound = if CERTIFY { anchor.bound.mul_add(dir, float8(VANISHED)) } else { Float8::ZERO };
        let mut possible = Mask8::ge(least, -bound);
        if !possible.any() {
            return Hit8::none();
        }
        let crossing = Crossing::new::<CERTIFY>(anchor.height, anchor.error, nd, dir);
        let (met, mut open) = crossing.on::<CERTIFY>(rays);
        possible &= met;
        if CULL {
            possible &= !side_hidden(nd, hidden) | open;
        }
        open &= possible;
        let mut doubt = open;
        if CERTIFY {
            doubt |= possible & Mask8::le(least, bound);
        }
        Hit8 { t: crossing.t, error: crossing.error, mask: possible & !open, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let a = self.corners.map(|corner| corner - ray.origin);
        let nd = self.normal.dot(ray.dir);
        let t = self.normal.dot(a[0]) / nd;
        if !(t.is_finite() && ray.accepts(t) && shows(nd, visible)) {
            return None;
        }
        let inside = |k: usize| {
            let (a, side) = (a[k], self.corners[(k + 1) % N] - self.corners[k]);
            let bound = 4.0 * f64::EPSILON * a.length() * side.length() * ray.dir.length();
            a.cross(side).dot(ray.dir) * nd.signum() >= -bound
        };
        (0..N).all(inside).then_some(t)
    }

    fn refine(&self, ray: &Ray64, _: f64, _: Visible) -> Surface64 {
        flat_surface64(self.corners[0], self.normal, ray)
    }

    #[inline(always)]
    fn surface((normal, corners): &Self::Rows, rays: &RayPacket, t: Float8) -> Surface8 {
        flat_surface(corners[0], *normal, rays, t)
    }

    /// In scene units along the first edge and across it. Polygons with `uvs` interpolate those instead.
    fn uv(&self, point: DVec3) -> DVec2 {
        let (d, edge) = (point - self.uv_origin, self.uv_edge);
        DVec2::new(d.dot(edge), d.dot(self.normal.cross(edge)))
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let corners = self.corners;
        (corners.iter().copied().fold(corners[0], DVec3::min), corners.iter().copied().fold(corners[0], DVec3::max))
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}
