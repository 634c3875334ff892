//! All kernels against the reference, on seeded rays, every lane both ways.

use glam::DVec3;

use super::brute::{packet_against_rows, ray_against_rows};
use super::{Ray64, RowRef, Stores};
use crate::fixtures::{Dice, MAKERS, Maker, exact, gray, object, ray, turn};
use crate::lanes::{ExactPacket, Float8, LANES, Mask8, Ray, RayPacket, Vec3x8};
use crate::plan::{Kind, Plan};
use crate::reference::{Reference, Verdict};
use crate::scene::{Polygon, Scene, Shape, Sphere, Visible};

/// One block of eight and one of three and padding.
const SHAPES: usize = 11;

/// Eleven of a kind beside each other, and a reference for each alone.
struct Bench {
    scene: Scene,
    center: DVec3,
    scale: f64,
    dice: Dice,
}

#[derive(Debug, Default)]
struct Tally {
    hits: usize,
    misses: usize,
    ties: usize,
}

impl Bench {
    fn new(maker: Maker, center: DVec3, scale: f64, visible: Visible) -> Bench {
        let mut dice = Dice(scale.to_bits() ^ center.x.to_bits());
        let mut objects = Vec::new();
        for _ in 0..SHAPES {
            let (place, size) = (center + dice.in_cube(2.0 * scale), scale * dice.between(0.3, 1.0));
            objects.push(object(maker(place, size, turn(&mut dice)), 0));
        }
        let mut clay = gray(0.5);
        clay.visible = visible;
        let scene = Scene { objects, materials: vec![clay], ..Scene::default() };
        Bench { scene, center, scale, dice }
    }

    fn references(&self) -> Vec<Reference> {
        let alone = |object: &crate::scene::Object| Scene {
            objects: vec![object.clone()],
            materials: self.scene.materials.clone(),
            ..Scene::default()
        };
        self.scene.objects.iter().map(|object| Reference::new(&alone(object))).collect()
    }

    /// Rays from near and far and from inside; a third of them aimed at silhouettes, edges and rims,
    /// which bisection between a hit and a miss finds.
    fn rays(&mut self, references: &[Reference], count: usize) -> Vec<Ray> {
        let Bench { center, scale, dice, .. } = self;
        (0..count)
            .map(|case| {
                let far = dice.log_between(0.5, 1e4) * *scale;
                let origin = *center + dice.direction() * far;
                let start = ray(origin, DVec3::X);
                let origin = DVec3::from_array(start.origin.map(f64::from));
                let mut aims = [0; 2].map(|_| *center + dice.in_cube(2.5 * *scale) - origin);
                if case % 3 == 0 {
                    let body = &references[dice.index(SHAPES)];
                    let met = |dir: DVec3| body.occluded(&exact(&ray(origin, dir)));
                    for _ in 0..40 {
                        if met(aims[0]) != met(aims[1]) {
                            break;
                        }
                        aims[1] = *center + dice.in_cube(2.5 * *scale) - origin;
                    }
                    let first = met(aims[0]);
                    for _ in 0..30 {
                        let middle = aims[0].midpoint(aims[1]);
                        aims[usize::from(met(middle) != first)] = middle;
                    }
                }
                // Directions of all lengths, and some rays that end early or start late.
                let dir = aims[dice.index(2)] * (dice.index(61) as f64 - 30.0).exp2() / far;
                let full = Ray { origin: start.origin, ..ray(origin, dir) };
                let reach = (far / dir.length()) as f32;
                match case % 7 {
                    0 => Ray { t_max: reach, ..full },
                    1 => Ray { t_min: reach, ..full },
                    _ => full,
                }
            })
            .collect()
    }
}

/// Where each primitive is met first: its parts together.
fn nearest(stores: &Stores, by_kind: impl Fn(Kind) -> Vec<Option<f32>>) -> [Option<f32>; SHAPES] {
    let mut first = [None; SHAPES];
    for kind in Kind::ALL {
        for (row, t) in by_kind(kind).into_iter().enumerate() {
            let best: &mut Option<f32> = &mut first[stores.owner(kind, row).primitive as usize];
            *best = [*best, t].into_iter().flatten().min_by(f32::total_cmp);
        }
    }
    first
}

fn compare(name: &str, bench: &mut Bench, count: usize) -> Tally {
    let references = bench.references();
    let rays = bench.rays(&references, count);
    let plan = Plan::new(&bench.scene, DVec3::ZERO);
    let stores = Stores::new(plan.parts(), None, &plan.visible);
    let cull = stores.hide_any();
    let mut tally = Tally::default();
    for eight in rays.chunks(LANES) {
        let packet = RayPacket::gather(eight);
        let rows = Kind::ALL.map(|kind| packet_against_rows(&stores, kind, &packet, cull));
        for (lane, ray) in eight.iter().enumerate() {
            let got = nearest(&stores, |kind| {
                let one = ray_against_rows(&stores, kind, ray, cull);
                let other: Vec<Option<f32>> = rows[kind as usize].iter().map(|row| row[lane]).collect();
                assert_eq!(one.iter().map(bits).collect::<Vec<_>>(), other.iter().map(bits).collect::<Vec<_>>());
                one
            });
            for (primitive, t) in got.into_iter().enumerate() {
                match references[primitive].verdict(&exact(ray), t.map(|_| 0), t) {
                    Verdict::Same if t.is_some() => tally.hits += 1,
                    Verdict::Same => tally.misses += 1,
                    Verdict::Tie => tally.ties += 1,
                    wrong => {
                        let shape: &Shape = &bench.scene.objects[primitive].shape;
                        panic!("{name}: {shape:?}, {ray:?}: got {t:?}, {wrong:?}");
                    }
                }
            }
        }
    }
    tally
}

fn bits(t: &Option<f32>) -> Option<u32> {
    t.map(f32::to_bits)
}

const PLACES: [(f64, f64); 5] = [(0.0, 1.0), (0.0, 1e-3), (0.0, 1e4), (1e3, 1.0), (-1e3, 30.0)];

fn at(place: f64) -> DVec3 {
    place * DVec3::new(1.0, -0.3, 0.7)
}

#[test]
fn kernels_agree_with_the_reference_in_every_lane_both_ways() {
    for (name, maker) in MAKERS {
        let mut total = Tally::default();
        for (place, scale) in PLACES {
            let tally = compare(name, &mut Bench::new(maker, at(place), scale, Visible::Both), 3000);
            total = Tally {
                hits: total.hits + tally.hits,
                misses: total.misses + tally.misses,
                ties: total.ties + tally.ties,
            };
        }
        // Of 165,000 pairs each, most of them misses: a ray meets few of eleven bodies.
        let least_misses = if name == "plane" { 10_000 } else { 100_000 };
        assert!(total.hits > 2000 && total.misses > least_misses && total.ties < 5000, "{name}: {total:?}");
    }
}

#[test]
fn kernels_agree_with_the_reference_where_a_side_is_hidden() {
    for visible in [Visible::Front, Visible::Back] {
        for (name, maker) in MAKERS {
            let tally = compare(name, &mut Bench::new(maker, at(100.0), 1.0, visible), 3000);
            assert!(tally.hits > 300 && tally.misses > 5000, "{name} {visible:?}: {tally:?}");
        }
    }
}

/// Dead lanes full of NaN, infinity and zeros, in every number and place, change nothing for the living.
#[test]
fn dead_lanes_never_hit_and_never_matter() {
    let mut living = 0;
    for (name, maker) in MAKERS {
        let mut bench = Bench::new(maker, at(10.0), 1.0, Visible::Both);
        let references = bench.references();
        let rays = bench.rays(&references, 200);
        let plan = Plan::new(&bench.scene, DVec3::ZERO);
        let stores = Stores::new(plan.parts(), None, &plan.visible);
        for (case, eight) in rays.chunks_exact(LANES).enumerate() {
            let full = RayPacket::gather(eight);
            let live = match case {
                0..8 => (1u32 << (case + 1)) - 1,
                _ => bench.dice.next() as u32 & 0xff,
            };
            let junk = [f32::NAN, f32::INFINITY, 0.0, -f32::NAN, 1.0][case % 5];
            let packet = with_dead(&full, Mask8::from_bits(live), junk);
            for kind in Kind::ALL {
                let (all, some) = (
                    packet_against_rows(&stores, kind, &full, false),
                    packet_against_rows(&stores, kind, &packet, false),
                );
                for (all, some) in all.iter().zip(&some) {
                    for lane in 0..LANES {
                        let want = all[lane].filter(|_| live >> lane & 1 == 1);
                        assert_eq!(bits(&some[lane]), bits(&want), "{name} {live:08b} {junk} {lane}");
                        living += usize::from(want.is_some());
                    }
                }
            }
        }
    }
    assert!(living > 1000, "{living}");
}

fn with_dead(rays: &RayPacket, live: Mask8, junk: f32) -> RayPacket {
    let nothing = Vec3x8::splat([junk; 3]);
    let pick = |yes, no| Vec3x8::select(live, yes, no);
    RayPacket {
        origin: pick(rays.origin, nothing),
        dir: pick(rays.dir, nothing),
        t_min: live.select(rays.t_min, Float8::splat(f32::INFINITY)),
        t_max: live.select(rays.t_max, Float8::splat(f32::NEG_INFINITY)),
        inv_dd: live.select(rays.inv_dd, Float8::splat(junk)),
    }
}

/// The row of a primitive that a ray meets first, and where.
fn first_row(stores: &Stores, ray: &Ray, primitive: u32) -> Option<(f32, RowRef)> {
    let of_kind = |kind| {
        let rows = ray_against_rows(stores, kind, ray, false).into_iter().enumerate();
        rows.filter_map(move |(row, t)| Some((t?, RowRef::new(kind, row))))
    };
    let rows = Kind::ALL.into_iter().flat_map(of_kind);
    let own = rows.filter(|(_, row)| row.kind().map(|kind| stores.owner(kind, row.row()).primitive) == Some(primitive));
    own.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// However small a body is, though no square of its size is left in f32.
#[test]
fn normals_of_tiny_bodies_are_unit() {
    for (name, maker) in MAKERS {
        for scale in [1e-18, 1e-24, 1e-29] {
            let mut bench = Bench::new(maker, at(0.0), scale, Visible::Both);
            let references = bench.references();
            let plan = Plan::new(&bench.scene, DVec3::ZERO);
            let stores = Stores::new(plan.parts(), None, &plan.visible);
            let mut judged = 0;
            for case in 0..3000 {
                let (dice, primitive) = (&mut bench.dice, case % SHAPES);
                let origin = dice.direction() * 8.0 * scale;
                let ray = ray(origin, (dice.in_cube(2.5 * scale) - origin) / scale);
                let Some(want) = references[primitive].closest(&exact(&ray)) else { continue };
                let own = Kind::ALL.into_iter().flat_map(|kind| {
                    let rows = 0..ray_against_rows(&stores, kind, &ray, false).len();
                    rows.map(move |row| RowRef::new(kind, row))
                });
                let normals = own
                    .filter(|row| {
                        row.kind().map(|kind| stores.owner(kind, row.row()).primitive) == Some(primitive as u32)
                    })
                    .map(|row| {
                        let lanes = Float8::splat(row.to_lane());
                        let (surface, _) =
                            stores.surface::<false>(lanes, &RayPacket::splat(&ray), Float8::splat(want.t as f32), None);
                        DVec3::from_array(surface.normal.lane(3).map(f64::from))
                    });
                let off = normals.map(|normal| (normal - want.normal).length()).fold(f64::INFINITY, f64::min);
                assert!(off < 1e-3, "{name} {scale:e}: {off:e}");
                judged += 1;
            }
            assert!(judged > 20, "{name}: {judged}");
        }
    }
}

/// Spheres of 60 radii away are no specks, unless a ray meets them flatly: there f32 alone is off by 4e-5.
#[test]
fn flat_hits_of_spheres_have_the_normals_of_f64() {
    let (center, radius, mut dice) = (DVec3::new(0.7, -1.1, -2.0), 0.04, Dice(7));
    let objects = vec![object(Shape::Sphere(Sphere { center, radius }), 0)];
    let scene = Scene { objects, materials: vec![gray(0.5)], ..Scene::default() };
    let plan = Plan::new(&scene, DVec3::ZERO);
    let stores = Stores::new(plan.parts(), None, &plan.visible);
    let row = RowRef::new(Kind::Sphere, 0);
    for _ in 0..300 {
        let mut rays = [exact(&ray(DVec3::ZERO, DVec3::X)); LANES];
        for ray in &mut rays {
            let aside = dice.direction().cross(center).normalize() * radius * dice.between(0.9, 0.9999);
            ray.dir = (center + aside).normalize();
        }
        let axes = |of: fn(DVec3) -> f64| rays.map(|ray| of(ray.dir));
        let before = ExactPacket { origin: [[0.0; LANES]; 3], dir: [axes(|d| d.x), axes(|d| d.y), axes(|d| d.z)] };
        let lines = rays.map(|ray| Ray64 { origin: ray.origin, dir: ray.dir, t_min: 0.0, t_max: f64::INFINITY });
        // As the kernel has them: what it is off by grows with the slant.
        let t = rays.map(|line| ray_against_rows(&stores, Kind::Sphere, &ray(line.origin, line.dir), false)[0]);
        let t = Float8::from(t.map(|t| t.expect("a hit")));
        let dir = Vec3x8::from_fn(|i| rays[i].dir.as_vec3().to_array());
        let packet = RayPacket::new(Vec3x8::ZERO, dir, t, Mask8::from_bits(0xff));
        let hits = Float8::splat(row.to_lane());
        let (mut surface, _) = stores.surface::<false>(hits, &packet, t, Some(&before));
        stores.sharpen_specks(0xff, &hits.to_array(), (&packet, &before), &mut surface);
        for (i, line) in lines.iter().enumerate() {
            let want = stores.refine(row, line, f64::from(t.to_array()[i])).expect("a row").normal;
            let off = (DVec3::from_array(surface.normal.lane(i).map(f64::from)) - want).length();
            assert!(off < 1e-6, "{off:e}: {line:?}");
        }
    }
}

/// Each of eight hits in f64 has the bits that it has alone, whatever the other lanes met: also from so far away that f32
/// cannot tell the entry from the exit.
#[test]
fn eight_hits_in_f64_are_those_of_one_by_one() {
    for visible in [Visible::Both, Visible::Back] {
        let mut dice = Dice(11);
        let mut places = Vec::new();
        let mut object_of = |maker: Maker| {
            places.push(dice.in_cube(3.0));
            object(maker(places[places.len() - 1], dice.between(0.3, 1.0), turn(&mut dice)), 0)
        };
        let objects: Vec<_> = MAKERS.iter().flat_map(|(_, maker)| [object_of(*maker), object_of(*maker)]).collect();
        let mut clay = gray(0.5);
        clay.visible = visible;
        let scene = Scene { objects, materials: vec![clay], ..Scene::default() };
        let plan = Plan::new(&scene, DVec3::ZERO);
        let stores = Stores::new(plan.parts(), None, &plan.visible);
        let (mut judged, mut full) = (0, 0);
        // Of one primitive, or each lane of another one.
        for packet in 0..2000 {
            let (mut lines, mut hits, mut t, mut lanes) = (Vec::new(), [0.0; LANES], [0.0; LANES], 0);
            for lane in 0..LANES {
                let primitive = (packet / 2 + lane * (packet % 2)) % places.len();
                let origin = dice.direction() * if packet % 3 == 0 { 3e6 } else { dice.log_between(6.0, 300.0) };
                let line = ray(origin, places[primitive] + dice.in_cube(0.2) - origin);
                if let Some((place, row)) = first_row(&stores, &line, primitive as u32) {
                    (hits[lane], t[lane], lanes) = (row.to_lane(), place, lanes | 1 << lane);
                }
                lines.push(Ray64 { t_min: 0.0, t_max: f64::INFINITY, ..Ray64::exact(&line) });
            }
            full += usize::from(lanes == 0xff && RowRef::from_lane(hits[0]).kind() == Some(Kind::Sphere));
            let axis = |of: &dyn Fn(&Ray64) -> f64| std::array::from_fn(|lane| of(&lines[lane]));
            let origin = [0, 1, 2].map(|k| axis(&|line| line.origin[k]));
            let rays = ExactPacket { origin, dir: [0, 1, 2].map(|k| axis(&|line| line.dir[k])) };
            let found = stores.refine8(lanes, &hits, &rays, &t);
            for lane in Mask8::from_bits(lanes).lanes() {
                let row = RowRef::from_lane(hits[lane]);
                let one = stores.refine(row, &lines[lane], f64::from(t[lane])).expect("a row");
                assert_eq!(found.point.map(|axis| axis[lane]), one.point.to_array(), "{row:?}");
                assert_eq!(found.normal.map(|axis| axis[lane]), one.normal.to_array(), "{row:?}");
                judged += 1;
            }
        }
        assert!(judged > 3000 && full > 20, "{judged}, {full}");
    }
}

/// Rays at its corners, which the circle around a polygon touches, also where squares vanish: the kernels' answers hold that
/// what certainly misses is not met.
#[test]
fn corners_of_polygons_do_not_certainly_miss() {
    for scale in [1e-22, 1e-21, 1e-18, 1e-6, 1.0, 1e6] {
        let (mut dice, mut met) = (Dice(3), 0);
        for case in 0..180 {
            let maker = MAKERS.iter().find(|(name, _)| *name == ["triangle", "quad", "octagon"][case % 3]).expect("it");
            let (center, size) = (dice.in_cube(scale), scale * dice.between(0.3, 1.0));
            let shape = maker.1(center, size, turn(&mut dice));
            let Shape::Polygon(Polygon { corners, .. }) = shape.clone() else { panic!("{shape:?}") };
            let scene = Scene { objects: vec![object(shape, 0)], materials: vec![gray(0.5)], ..Scene::default() };
            let plan = Plan::new(&scene, DVec3::ZERO);
            let stores = Stores::new(plan.parts(), None, &plan.visible);
            for corner in corners {
                for share in [0.9, 0.99, 0.9999, 0.999999, 1.0] {
                    let origin = dice.direction() * 8.0 * scale;
                    let ray = ray(origin, (center.lerp(corner, share) - origin) / scale);
                    let answers = Kind::ALL.into_iter().flat_map(|kind| ray_against_rows(&stores, kind, &ray, false));
                    met += answers.flatten().count();
                }
            }
        }
        assert!(met > 2000, "{scale:e}: {met}");
    }
}

/// The points that light and spawned rays start from: in f64 the reference's own, in f32 no further from
/// the surface than they say.
#[test]
fn surfaces_are_where_the_reference_has_them() {
    for (name, maker) in MAKERS {
        let mut judged = 0;
        for (place, scale) in PLACES {
            let mut bench = Bench::new(maker, at(place), scale, Visible::Both);
            let references = bench.references();
            let plan = Plan::new(&bench.scene, DVec3::ZERO);
            let stores = Stores::new(plan.parts(), None, &plan.visible);
            let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
            for case in 0..4000 {
                let (center, dice) = (bench.center, &mut bench.dice);
                let origin = center + dice.direction() * dice.log_between(0.5, 300.0) * scale;
                let ray = ray(origin, center + dice.in_cube(2.5 * scale) - origin);
                let primitive = case % SHAPES;
                let Some((t, row)) = first_row(&stores, &ray, primitive as u32) else { continue };
                let Some(want) = references[primitive].closest(&exact(&ray)) else { continue };
                let dir = exact(&ray).dir;
                let cos = want.normal.dot(dir.normalize()).abs();
                if cos < 1e-2 {
                    continue;
                }
                judged += 1;
                let context = || format!("{name}: {:?} {ray:?} {want:?}", bench.scene.objects[primitive].shape);
                // f64 rounds some sums of the largest number in the way; a slant magnifies that.
                let size = want.point.length() + exact(&ray).origin.length() + scale;
                let bound = 64.0 * f64::EPSILON * size / cos;
                let fine = stores.refine(row, &Ray64::exact(&ray), f64::from(t)).expect("a row");
                let along = (fine.t - want.t).abs() * dir.length();
                assert!(along <= bound && (fine.point - want.point).length() <= bound, "{} {fine:?}", context());
                // A cone turns round its tip at any rate; elsewhere within a tenth of the scale at most.
                let turned = (fine.normal - want.normal).length();
                let near_tip = name == "open cone" && turned < 1e-6;
                assert!(near_tip || turned <= 1e-12 + 20.0 * bound / scale, "{} {fine:?} {turned:e}", context());

                let lanes = Float8::splat(row.to_lane());
                let (coarse, _) = stores.surface::<false>(lanes, &RayPacket::splat(&ray), Float8::splat(t), None);
                let (point, normal) = (wide(coarse.point.lane(3)), wide(coarse.normal.lane(3)));
                let off = point - want.point;
                let other_face = normal.dot(want.normal) < 0.9;
                let error = f64::from(coarse.error.to_array()[3]);
                // What is off along the surface leaves its tangent plane by the square of that.
                let bent = off.length_squared() / (0.1 * scale);
                let height = off.dot(want.normal).abs();
                assert!(other_face || height <= error + bent, "{}: {height:e} {error:e} {bent:e}", context());
                assert!((normal.length() - 1.0).abs() < 4.0 * f64::from(f32::EPSILON), "{} {normal}", context());
            }
        }
        assert!(judged > 200, "{name}: {judged}");
    }
}
