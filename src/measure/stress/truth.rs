//! What a ray meets, in numbers of 320 bits: plain formulas, since nothing can cancel there.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use glam::{DMat3, DVec3};

use crate::lanes::Ray;
use crate::scene::{Cone, Cuboid, Cylinder, Disk, Plane, Polygon, Scene, Shape, Sphere};

type Big = FBig<HalfEven>;
type Vector = [Big; 3];

const BITS: usize = 320;

/// The first place on a ray.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Rounded to f64.
    pub t: f64,
    pub primitive: usize,
    /// Unit, of the surface there, outward.
    pub normal: DVec3,
    /// Least radius of curvature, for what an error along the ray does to the normal; infinite for flat surfaces.
    pub bend: f64,
    /// Distance to the next place of another primitive.
    pub gap: f64,
    exact: Big,
}

/// A ray as the exact numbers that its bits are.
struct Line {
    origin: Vector,
    dir: Vector,
}

/// A place on a line.
struct Place {
    t: Big,
    normal: DVec3,
    bend: f64,
}

/// What a ray meets first, of equal places the lowest primitive; `None` for broken rays too.
pub fn closest(scene: &Scene, ray: &Ray) -> Option<Truth> {
    if !ray.is_valid() {
        return None;
    }
    let wide = |v: [f32; 3]| v.map(|x| big(f64::from(x)));
    let line = Line { origin: wide(ray.origin), dir: wide(ray.dir) };
    let start = big(f64::from(ray.t_min));
    let end = ray.t_max.is_finite().then(|| big(f64::from(ray.t_max)));
    let mut first: Option<Truth> = None;
    for (primitive, object) in scene.primitives().enumerate() {
        let places = places(&object.shape, &line).into_iter();
        let on = places.filter(|place| place.t > start && end.as_ref().is_none_or(|end| place.t <= *end));
        let Some(Place { t: exact, normal, bend }) = on.min_by(|a, b| a.t.cmp(&b.t)) else { continue };
        let (t, gap) = (exact.to_f64().value(), f64::INFINITY);
        let new = Truth { t, primitive, normal, bend, gap, exact };
        first = Some(match first {
            None => new,
            Some(old) => {
                let apart = (&new.exact - &old.exact).to_f64().value().abs();
                let gap = old.gap.min(apart);
                if new.exact < old.exact { Truth { gap: apart, ..new } } else { Truth { gap, ..old } }
            }
        });
    }
    first
}

fn big(x: f64) -> Big {
    Big::try_from(x).expect("a finite number").with_precision(BITS).value()
}

fn vector(v: DVec3) -> Vector {
    v.to_array().map(big)
}

fn dot(a: &Vector, b: &Vector) -> Big {
    &a[0] * &b[0] + &a[1] * &b[1] + &a[2] * &b[2]
}

fn minus(a: &Vector, b: &Vector) -> Vector {
    std::array::from_fn(|k| &a[k] - &b[k])
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    let part = |i: usize, j: usize| &a[i] * &b[j] - &a[j] * &b[i];
    [part(1, 2), part(2, 0), part(0, 1)]
}

/// `a + t b`.
fn along(a: &Vector, t: &Big, b: &Vector) -> Vector {
    std::array::from_fn(|k| &a[k] + t * &b[k])
}

fn narrow(v: &Vector) -> DVec3 {
    // Scaled first: what is small is not to be lost, nor what is large.
    DVec3::from_array(std::array::from_fn(|k| v[k].to_f64().value())).normalize_or(DVec3::Z)
}

fn places(shape: &Shape, line: &Line) -> Vec<Place> {
    match shape {
        Shape::Sphere(Sphere { center, radius }) => sphere(*center, *radius, line),
        Shape::Plane(Plane { point, normal }) => flat(*point, &vector(*normal), line).into_iter().collect(),
        Shape::Disk(disk) => on_disk(disk, line),
        Shape::Polygon(polygon) => on_polygon(polygon, line),
        Shape::Box(cuboid) => on_box(cuboid, line),
        Shape::Cylinder(Cylinder { base, apex, radius, caps }) => {
            let cone = Cone { base: *base, apex: *apex, radius: *radius, apex_radius: *radius, caps: *caps };
            on_cone(&cone, line)
        }
        Shape::Cone(cone) => on_cone(cone, line),
    }
}

/// The roots of `a t^2 + 2 b t + c`.
fn roots(a: &Big, b: &Big, c: &Big) -> Vec<Big> {
    let zero = big(0.0);
    if *a == zero {
        return if *b == zero { Vec::new() } else { vec![-c / (big(2.0) * b)] };
    }
    let discriminant = b * b - a * c;
    if discriminant < zero {
        return Vec::new();
    }
    let root = discriminant.sqrt();
    vec![(-b - &root) / a, (-b + root) / a]
}

fn sphere(center: DVec3, radius: f64, line: &Line) -> Vec<Place> {
    let y = minus(&line.origin, &vector(center));
    let r = big(radius);
    let found = roots(&dot(&line.dir, &line.dir), &dot(&y, &line.dir), &(dot(&y, &y) - &r * &r));
    let place = |t: Big| Place { normal: narrow(&along(&y, &t, &line.dir)), t, bend: radius };
    found.into_iter().map(place).collect()
}

fn flat(point: DVec3, normal: &Vector, line: &Line) -> Option<Place> {
    let speed = dot(normal, &line.dir);
    let height = dot(normal, &minus(&vector(point), &line.origin));
    let place = |t| Place { t, normal: narrow(normal), bend: f64::INFINITY };
    (speed != big(0.0)).then(|| place(height / speed))
}

fn on_disk(disk: &Disk, line: &Line) -> Vec<Place> {
    let y = minus(&line.origin, &vector(disk.center));
    let inside = |place: &Place| {
        let x = along(&y, &place.t, &line.dir);
        let (rho2, r, inner) = (dot(&x, &x), big(disk.radius), big(disk.inner_radius));
        rho2 <= &r * &r && rho2 >= &inner * &inner
    };
    flat(disk.center, &vector(disk.normal), line).filter(inside).into_iter().collect()
}

fn on_polygon(polygon: &Polygon, line: &Line) -> Vec<Place> {
    let corners: Vec<Vector> = polygon.corners.iter().map(|corner| vector(*corner)).collect();
    let edges: Vec<(&Vector, &Vector)> = corners.iter().zip(corners.iter().cycle().skip(1)).collect();
    let zero = big(0.0);
    let mut normal = [zero.clone(), zero.clone(), zero.clone()];
    for (a, b) in &edges {
        let part = cross(&minus(a, &corners[0]), &minus(b, &corners[0]));
        normal = std::array::from_fn(|k| &normal[k] + &part[k]);
    }
    let Some(place) = flat(polygon.corners[0], &normal, line) else { return Vec::new() };
    // Seen along the ray: how often the outline goes round it.
    let seen: Vec<Vector> = corners.iter().map(|corner| minus(corner, &line.origin)).collect();
    let size = narrow(&line.dir).abs();
    let k = if size.x >= size.y && size.x >= size.z { 0 } else { usize::from(size.z > size.y) + 1 };
    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
    let flat: Vec<[Big; 2]> =
        seen.iter().map(|a| [i, j].map(|axis| &a[axis] * &line.dir[k] - &a[k] * &line.dir[axis])).collect();
    let mut windings = 0;
    for n in 0..flat.len() {
        let (a, b) = (&flat[n], &flat[(n + 1) % flat.len()]);
        let hand = &a[0] * &b[1] - &a[1] * &b[0];
        if hand == zero && &a[0] * &b[0] + &a[1] * &b[1] <= zero {
            return vec![place]; // on the edge
        }
        match (a[1] >= zero, b[1] >= zero) {
            (false, true) if hand < zero => windings += 1,
            (true, false) if hand > zero => windings -= 1,
            _ => {}
        }
    }
    if windings == 0 { Vec::new() } else { vec![place] }
}

fn on_box(cuboid: &Cuboid, line: &Line) -> Vec<Place> {
    let axes = cuboid.rotation.map_or(DMat3::IDENTITY, |turn| DMat3::from_quat(turn.normalize()));
    let (min, max, two) = (vector(cuboid.min), vector(cuboid.max), big(2.0));
    let center: Vector = std::array::from_fn(|k| (&min[k] + &max[k]) / &two);
    let y = minus(&line.origin, &center);
    let mut ends: [Option<Place>; 2] = [None, None];
    for k in 0..3 {
        let axis = vector(axes.col(k));
        let half = (&max[k] - &min[k]) / &two;
        let (height, speed) = (dot(&axis, &y), dot(&axis, &line.dir));
        if speed == big(0.0) {
            if height > half || height < -&half {
                return Vec::new();
            }
            continue;
        }
        let (a, b) = ((-&half - &height) / &speed, (&half - &height) / &speed);
        let (near, far) = if a < b { (a, b) } else { (b, a) };
        let ahead = if speed > big(0.0) { axes.col(k) } else { -axes.col(k) };
        let place = |t, normal| Place { t, normal, bend: f64::INFINITY };
        if ends[0].as_ref().is_none_or(|end| near > end.t) {
            ends[0] = Some(place(near, -ahead));
        }
        if ends[1].as_ref().is_none_or(|end| far < end.t) {
            ends[1] = Some(place(far, ahead));
        }
    }
    match ends {
        [Some(near), Some(far)] if near.t <= far.t => vec![near, far],
        _ => Vec::new(),
    }
}

fn on_cone(cone: &Cone, line: &Line) -> Vec<Place> {
    let (base, apex) = (vector(cone.base), vector(cone.apex));
    let axis = minus(&apex, &base);
    let (y, d, length2) = (minus(&line.origin, &base), &line.dir, dot(&axis, &axis));
    let (ya, da) = (dot(&y, &axis), dot(d, &axis));
    let growth = (big(cone.apex_radius) - big(cone.radius)) / &length2;
    let (rho, turn) = (big(cone.radius) + &growth * &ya, &growth * &da);
    let a = dot(d, d) - &da * &da / &length2 - &turn * &turn;
    let b = dot(&y, d) - &ya * &da / &length2 - &rho * &turn;
    let c = dot(&y, &y) - &ya * &ya / &length2 - &rho * &rho;
    let zero = big(0.0);
    let side = |t: Big| {
        let height = &ya + &t * &da;
        if height < zero || height > length2 {
            return None;
        }
        let x = along(&y, &t, d);
        let share = &height / &length2;
        let radial: Vector = std::array::from_fn(|k| &x[k] - &share * &axis[k]);
        let local = (big(cone.radius) + &growth * &height).to_f64().value();
        let slope = (cone.apex_radius - cone.radius) / (cone.apex - cone.base).length();
        let normal = narrow(&radial) - slope * (cone.apex - cone.base).normalize();
        Some(Place { t, normal: normal.normalize(), bend: local })
    };
    let mut places: Vec<Place> = roots(&a, &b, &c).into_iter().filter_map(side).collect();
    if cone.caps {
        let back = minus(&base, &apex);
        for (center, radius, normal) in [(cone.base, cone.radius, &back), (cone.apex, cone.apex_radius, &axis)] {
            let from = minus(&line.origin, &vector(center));
            let inside = |place: &Place| {
                let x = along(&from, &place.t, d);
                dot(&x, &x) <= big(radius) * big(radius)
            };
            places.extend(flat(center, normal, line).filter(inside).filter(|_| radius > 0.0));
        }
    }
    places
}
