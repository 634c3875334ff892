//! Convex polygons of up to `N` corners; shorter ones repeat their last corner.

use glam::{DVec2, DVec3};

use super::disk::round_bounds;
use super::plane::{Crossing, flat_surface, flat_surface64, shows, side_hidden};
use super::{Hidden8, Part, Ray64, Surface8, Surface64, VANISHED, VANISHING, roundings};
use crate::lanes::{Float8, Hit8, Mask8, RayPacket, UNIT_ROUNDOFF, Vec3x8, float8};
use crate::plan::{Owner, PolygonPart};
use crate::scene::Visible;

/// Eight rows seen from eight origins.
#[derive(Debug, Clone, Copy)]
pub struct Anchor {
    f: Vec3x8,      // from the origin to the center
    height: Float8, // n . f
    slip: Float8,   // of places on the polygon, but for that of what is as long as the way to there
}

/// More than what rounding takes from the distance of a place on the polygon and from its radius.
const BEYOND: f32 = 1.0 + 32.0 * UNIT_ROUNDOFF;

/// A place that f32 holds, beside `place` and as near the plane through it as there is one: what a corner of f32 loses to
/// rounding moves no plane.
fn held(place: DVec3, normal: DVec3) -> DVec3 {
    /// How far it may be from the place on an axis, in steps of f32 of the largest coordinate.
    const REACH: f64 = 2.0;
    let rounded = place.as_vec3().as_dvec3();
    let off = |from: DVec3| normal.dot(place - from);
    let step = |axis: usize| {
        let x = (place[axis] as f32).abs();
        f64::from(x.next_up() - x)
    };
    // The axis on which a step goes furthest along the normal first; those after it fill in what it leaves.
    let mut axes = [0, 1, 2];
    axes.sort_unstable_by(|a, b| (step(*b) * normal[*b].abs()).total_cmp(&(step(*a) * normal[*a].abs())));
    let reach = REACH * step(place.abs().max_position());
    let mut held = rounded;
    for axis in axes {
        let way = (off(held) / (step(axis) * normal[axis])).round() * step(axis);
        if way.abs() <= reach {
            held[axis] += way;
        }
    }
    let held = held.as_vec3().as_dvec3(); // which rounds where a step went past a power of two
    if off(held).abs() < off(rounded).abs() { held } else { rounded }
}

impl<const N: usize> Part for PolygonPart<N> {
    /// A center in the plane and the unit normal; the radius about the center, what places on the polygon are off by
    /// wherever rays come from, and the axis that edges are seen along (0, 1, 2); by edge the unit vector across it,
    /// inward, on the other two axes, and how far from the center the edge lies along that.
    type Rows = (([Vec3x8; 2], [Float8; 3]), [[Float8; 3]; N]);
    type Face = [Vec3x8; 2];
    type Anchor = Anchor;

    fn row(&self) -> (([DVec3; 2], [f64; 3]), [[f64; 3]; N]) {
        let (first, normal) = (self.uv_origin, self.normal);
        let greatest = |of: &dyn Fn(DVec3) -> f64| self.corners.iter().map(|corner| of(*corner)).fold(0.0, f64::max);
        let warp = greatest(&|corner| normal.dot(corner - first).abs());
        let (low, high) = self.bounds();
        let middle = low.midpoint(high);
        let center = held(middle + normal * normal.dot(first - middle), normal);
        let slip = 9.0 * f64::from(UNIT_ROUNDOFF) * center.abs().element_sum() + warp;
        let radius = greatest(&|corner| corner.distance(center));
        let axis = normal.abs().max_position();
        let seen = |corner: DVec3| match axis {
            0 => DVec2::new(corner.y, corner.z),
            1 => DVec2::new(corner.x, corner.z),
            _ => DVec2::new(corner.x, corner.y),
        };
        // Corners go around the other way where the axis is the second one, or the normal goes against it.
        let turn = if (axis == 1) == (normal[axis] > 0.0) { -1.0 } else { 1.0 };
        let edge = |k: usize| {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % N]);
            match (turn * seen(b - a).perp()).try_normalize() {
                Some(inward) => [inward.x, inward.y, inward.dot(seen(a - center))],
                None => [0.0, 0.0, f64::NEG_INFINITY], // of a corner that is repeated: all is inside
            }
        };
        (([center, normal], [radius, slip, axis as f64]), std::array::from_fn(edge))
    }

    #[inline(always)]
    fn bounds8((([center, normal], [radius, ..]), _): &Self::Rows) -> (Vec3x8, Vec3x8) {
        round_bounds(*center, *normal, *radius)
    }

    #[inline(always)]
    fn anchor((([center, normal], [_, slip, _]), _): &Self::Rows, origin: &Vec3x8) -> Anchor {
        let f = *center - *origin;
        Anchor { f, height: normal.dot(f), slip: roundings(31.0).mul_add(f.abs().sum(), *slip) }
    }

    /// By the circle around the corners, which needs no edges: beyond it by more than the bound of [`Part::hit`].
    #[inline(always)]
    fn misses(((rows, [radius, ..]), _): &Self::Rows, anchor: &Anchor, rays: &RayPacket) -> Mask8 {
        let dir = rays.dir.abs().sum();
        let crossing = Crossing::within::<true>(anchor.height, anchor.slip, rows[1].dot(rays.dir), dir);
        let x = rays.dir.mul_add(crossing.t, -anchor.f);
        let reach = crossing.error.mul_add(dir, *radius + float8(VANISHING)) * float8(BEYOND);
        !crossing.on::<true>(rays).0 | Mask8::gt(x.dot(x), reach * reach)
    }

    /// `t` comes from the plane, as in equation (6) of the paper; the point there, seen from the center so that
    /// nothing large cancels, is held against each edge on the two axes across which the polygon is widest. Lanes that
    /// pass an edge more closely than the bound are decided in f64, where touching counts, so no ray slips between two
    /// polygons that share an edge.
    ///
    /// The bound is one for the place on the ray and for that beside the edges, and generous: few lanes are decided again
    /// for it, and all pay for a finer one. With d the direction, c the center and f the way to it, in 1-norms, and u a
    /// rounding, `t` is known to `(4/3)(6u |t d| + 10u |f| + 3.5u |c|)/|n . d| + 2u |t|` (see `height_error` and
    /// `Crossing`), and corners beside the plane are seen aside by `warp |d|/|n . d|`. The point there is off by `|d|` times
    /// these, and by `10u (|t d| + |f|) + 7u |f| + 4u |c|`: the center rounds with the scene, the origin with the camera, f
    /// and t d with every operation. As `|n . d| <= |d|`, `|d|/|n . d|` times `20.5u |t d| + 31u |f| + 9u |c| + warp` is more
    /// than all of it.
    ///
    /// Source: Kucherov, Morgun and Golenkovskaya, 2016, section IV; the axes as in Badouel, "An efficient ray-polygon
    /// intersection", Graphics Gems, 1990.
    #[inline(always)]
    fn hit<'a, const CULL: bool, const CERTIFY: bool>(
        ((rows, [.., axis]), edges): &Self::Rows,
        anchor: &Anchor,
        rays: &RayPacket,
        hidden: &Hidden8,
        _: impl Fn(usize) -> Option<&'a Self>,
    ) -> Hit8 {
        let nd = rows[1].dot(rays.dir);
        let dir = rays.dir.abs().sum();
        let crossing = Crossing::within::<CERTIFY>(anchor.height, anchor.slip, nd, dir);
        let (mut met, mut open) = crossing.on::<CERTIFY>(rays);
        if CULL {
            met &= !side_hidden(nd, hidden) | open;
        }
        if !met.any() {
            return Hit8::none();
        }
        let x = rays.dir.mul_add(crossing.t, -anchor.f);
        let u = Mask8::lt(*axis, Float8::splat(0.5)).select(x.y, x.x);
        let v = Mask8::gt(*axis, Float8::splat(1.5)).select(x.y, x.z);
        let mut least = Float8::splat(f32::INFINITY);
        for [across_u, across_v, edge] in edges {
            least = least.fast_min(across_u.mul_add(u, across_v.mul_sub(v, *edge)));
        }
        if !CERTIFY {
            let mask = met & Mask8::ge(least, Float8::ZERO);
            return Hit8 { t: crossing.t, error: Float8::ZERO, mask, doubt: Mask8::NONE };
        }
        let bound = crossing.error.mul_add(dir, float8(VANISHED));
        let possible = met & !Mask8::lt(least, -bound);
        open &= possible;
        let doubt = open | (possible & !Mask8::gt(least, bound));
        Hit8 { t: crossing.t, error: crossing.error, mask: possible & !open, doubt }
    }

    fn decide(&self, ray: &Ray64, visible: Visible) -> Option<f64> {
        let a = self.corners.map(|corner| corner - ray.origin);
        let nd = self.normal.dot(ray.dir);
        let t = self.normal.dot(self.uv_origin - ray.origin) / nd;
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
        flat_surface64(self.uv_origin, self.normal, ray)
    }

    #[inline(always)]
    fn face(((face, _), _): &Self::Rows) -> &[Vec3x8; 2] {
        face
    }

    #[inline(always)]
    fn surface([center, normal]: &Self::Face, rays: &RayPacket, t: Float8) -> Surface8 {
        flat_surface(*center, *normal, rays, t)
    }

    /// In scene units along the first edge and across it. Polygons with `uvs` interpolate those instead.
    fn uv(&self, point: DVec3) -> DVec2 {
        let (d, edge) = (point - self.uv_origin, self.uv_edge);
        DVec2::new(d.dot(edge), d.dot(self.normal.cross(edge)))
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        // Corners may lie a little beside the plane, in which rays meet the polygon.
        let in_plane = |corner: &DVec3| corner - self.normal * self.normal.dot(corner - self.uv_origin);
        let points = || self.corners.iter().copied().chain(self.corners.iter().map(in_plane));
        (points().fold(DVec3::INFINITY, DVec3::min), points().fold(DVec3::NEG_INFINITY, DVec3::max))
    }

    fn owner(&self) -> Owner {
        self.owner
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_plane_of_a_polygon_stays_where_it_is() {
        let (mut plain, mut kept, mut count) = (0.0, 0.0, 0.0);
        for k in 1..=1000 {
            let turn = |rate: f64| (f64::from(k) * rate).sin();
            let normal = DVec3::new(turn(1.1), turn(2.3), turn(3.7)).normalize();
            let place = DVec3::new(11.0 * turn(0.7), 0.3 * turn(5.3), 90.0 * turn(7.9));
            let off = |from: DVec3| normal.dot(place - from).abs();
            let (held, rounded) = (held(place, normal), place.as_vec3().as_dvec3());
            assert_eq!(held, held.as_vec3().as_dvec3());
            assert!(off(held) <= off(rounded));
            // A step of f32 is at most so large a part of the largest coordinate, and rounding takes half of one.
            let reach = 2.5 * f64::from(f32::EPSILON) * place.abs().max_element();
            assert!((held - place).abs().max_element() <= reach);
            (plain, kept, count) = (plain + off(rounded), kept + off(held), count + 1.0);
        }
        assert!(kept < 0.1 * plain, "{} beside {} a place", kept / count, plain / count);
        let (place, up) = (DVec3::new(0.1, 3.0, 0.7), DVec3::Y);
        assert_eq!(held(place, up), place.as_vec3().as_dvec3());
        assert_eq!(held(DVec3::ZERO, up), DVec3::ZERO);
    }
}
