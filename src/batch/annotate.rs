//! Ground truth beside a picture: what is seen where, as JSON after the manner of COCO.
//!
//! Boxes and pixel counts are those of the id layer. The visible share of an object is its pixel count over that of the
//! pixels of the picture, crop and overscan included, whose centres would show it if nothing else were there.
//!
//! Source: Lin et al., "Microsoft COCO: common objects in context", ECCV 2014, and its data format: `images`,
//! `annotations` with `bbox` as x, y, width and height, `categories`.

use std::collections::BTreeMap;

use glam::DVec3;
use serde_json::{Value, json};

use super::Job;
use crate::film::{Picture, Samples, Window};
use crate::reference::Reference;
use crate::render::{IdNames, Renderer};
use crate::scene::{Camera, Lens, Scene, bounding_balls};

/// Most rays against primitives for the visible share of one object.
const MOST_TESTS: usize = 50_000_000;

/// What the id layer shows of one object.
#[derive(Debug, Clone, Copy)]
struct Seen {
    pixels: u64,
    /// Pixels of the display window, half open.
    window: Window,
}

/// The page of a picture that has an id layer.
pub fn page(job: &Job, renderer: &Renderer, scene: &Scene, picture: &Picture, names: &IdNames) -> String {
    let seen = seen(picture);
    let frame = job.frame();
    // Lights are seen as well, and are no objects.
    let shown = seen.iter().map(|(id, seen)| (id, seen, primitives(scene, *id, names)));
    let objects = shown.filter(|(_, _, primitives)| !primitives.is_empty()).map(|(id, seen, primitives)| {
        let (place, material) = (place(scene, &primitives), primitives.first().map(|first| material(scene, *first)));
        let alone = alone(renderer, picture.window, scene, &primitives);
        let share = alone.map(|alone| (seen.pixels as f64 / alone.max(seen.pixels) as f64).min(1.0));
        let Window { x0, y0, .. } = seen.window;
        json!({
            "id": id,
            "image_id": frame,
            "category_id": material.map(|material| material + 1),
            "name": names.object.get(id),
            "bbox": [x0, y0, seen.window.width(), seen.window.height()],
            "area": seen.pixels,
            "visible_share": share,
            "position": place.map(|place| place.to_array()),
            "position_in_camera": place.map(|place| in_camera(renderer.view(), place)),
            "iscrowd": u32::from(primitives.len() > 1),
        })
    });
    let (width, height) = picture.display;
    let file = job.output.file_name().map(|name| name.to_string_lossy().into_owned());
    let image = json!({ "id": frame, "file_name": file, "width": width, "height": height });
    let category =
        |(index, material): (usize, &crate::scene::Material)| json!({ "id": index + 1, "name": material.name });
    let page = json!({
        "schema": 1,
        "images": [image],
        "camera": camera(renderer.view(), picture.display),
        "annotations": objects.collect::<Vec<_>>(),
        "categories": scene.materials.iter().enumerate().map(category).collect::<Vec<_>>(),
    });
    format!("{page}\n")
}

/// Pixels and boxes by id.
fn seen(picture: &Picture) -> BTreeMap<u32, Seen> {
    let mut seen: BTreeMap<u32, Seen> = BTreeMap::new();
    let Some(Samples::Uint(ids)) = picture.channel("id.object").map(|channel| &channel.samples) else { return seen };
    for (index, id) in ids.iter().enumerate().filter(|(_, id)| **id > 0) {
        let (x, y) = picture.window.pixel(index);
        let first = Seen { pixels: 0, window: Window { x0: x, y0: y, x1: x + 1, y1: y + 1 } };
        let entry = seen.entry(*id).or_insert(first);
        entry.pixels += 1;
        let Window { x0, y0, x1, y1 } = entry.window;
        entry.window = Window { x0: x0.min(x), y0: y0.min(y), x1: x1.max(x + 1), y1: y1.max(y + 1) };
    }
    seen
}

/// The primitives of an object: one, or the rows of a cloud.
fn primitives(scene: &Scene, id: u32, names: &IdNames) -> Vec<usize> {
    let (object, singles) = (id as usize - 1, scene.objects.len());
    if object < singles {
        return vec![object];
    }
    // Rows that are objects of their own are called `cloud:row` and have the primitive's number.
    let is_row = names.object.get(&id).and_then(|name| name.rsplit_once(':')).is_some_and(|(_, row)| {
        row.parse::<usize>().is_ok_and(|row| row <= object) && object < scene.primitive_count()
    });
    if is_row {
        return vec![object];
    }
    let mut start = singles;
    for (index, cloud) in scene.clouds.iter().enumerate() {
        if index == object - singles {
            return (start..start + cloud.len()).collect();
        }
        start += cloud.len();
    }
    Vec::new()
}

fn material(scene: &Scene, primitive: usize) -> usize {
    scene.primitive(primitive).map_or(0, |primitive| primitive.material)
}

/// The middle of the bounds; planes have none.
fn place(scene: &Scene, primitives: &[usize]) -> Option<DVec3> {
    let balls = balls(scene, primitives);
    let least = balls.iter().map(|(center, radius)| *center - *radius).reduce(DVec3::min)?;
    let most = balls.iter().map(|(center, radius)| *center + *radius).reduce(DVec3::max)?;
    Some(0.5 * (least + most))
}

fn balls(scene: &Scene, primitives: &[usize]) -> Vec<(DVec3, f64)> {
    let mut balls = Vec::new();
    for primitive in primitives.iter().filter_map(|index| scene.primitive(*index)) {
        bounding_balls(&primitive.shape, &mut balls);
    }
    balls
}

/// Pixels of a window whose centres show the object where it is alone; `None` where that takes too long.
fn alone(renderer: &Renderer, window: Window, scene: &Scene, primitives: &[usize]) -> Option<u64> {
    let display = (renderer.image().width, renderer.image().height);
    let window = reach(renderer.view(), display, window, &balls(scene, primitives)).unwrap_or(window);
    if window.area().saturating_mul(primitives.len()) > MOST_TESTS {
        return None;
    }
    let object = |index: &usize| {
        let primitive = scene.primitive(*index)?;
        let shape = primitive.shape.into_owned();
        Some(crate::scene::Object { shape, material: primitive.material, name: None, group: None })
    };
    let objects = primitives.iter().filter_map(object).collect();
    let scene = Scene { objects, materials: scene.materials.clone(), ..Scene::default() };
    let tracer = Reference::relative_to(&scene, renderer.view().eye);
    let view = tracer.view(renderer.view(), renderer.image(), &Default::default());
    let shows = |x: i32, y: i32| {
        let ray = view.ray(f64::from(x) + 0.5, f64::from(y) + 0.5, [0; 2]);
        u64::from(tracer.closest(&ray).is_some())
    };
    Some((window.y0..window.y1).map(|y| (window.x0..window.x1).map(|x| shows(x, y)).sum::<u64>()).sum())
}

/// The pixels of a window that may show what is in the balls; `None` where they reach behind the eye, or the lens is not
/// that of a pinhole.
fn reach(camera: &Camera, (width, height): (u32, u32), full: Window, balls: &[(DVec3, f64)]) -> Option<Window> {
    let Lens::Pinhole { vfov } = camera.lens else { return None };
    let scale = f64::from(height) / 2.0 / (vfov.to_radians() / 2.0).tan();
    let (right, up, forward) = camera.axes();
    let middle = [f64::from(width) / 2.0, f64::from(height) / 2.0];
    let (mut least, mut most) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for (center, radius) in balls {
        let from_eye = *center - camera.eye;
        let depth = from_eye.dot(forward);
        let near = depth - radius;
        if near <= 1e-3 * depth.abs() {
            return None;
        }
        for (axis, middle, i) in [(right, middle[0], 0), (-up, middle[1], 1)] {
            let along = from_eye.dot(axis);
            for edge in [along - radius, along + radius] {
                for depth in [near, depth + radius] {
                    let place = middle + scale * edge / depth;
                    (least[i], most[i]) = (least[i].min(place), most[i].max(place));
                }
            }
        }
    }
    let edge = |place: f64, low: i32, high: i32| place.clamp(f64::from(low), f64::from(high)) as i32;
    let window = Window {
        x0: edge(least[0].floor(), full.x0, full.x1),
        y0: edge(least[1].floor(), full.y0, full.y1),
        x1: edge(most[0].ceil(), full.x0, full.x1),
        y1: edge(most[1].ceil(), full.y0, full.y1),
    };
    (!balls.is_empty()).then_some(window)
}

/// Right, down and forward from the eye, scene units.
fn in_camera(camera: &Camera, place: DVec3) -> [f64; 3] {
    let (right, up, forward) = camera.axes();
    let from_eye = place - camera.eye;
    [from_eye.dot(right), -from_eye.dot(up), from_eye.dot(forward)]
}

/// Intrinsics in pixels (corners of the first pixel at 0, 0) and pose: x right, y down, z forward, row by row.
fn camera(camera: &Camera, (width, height): (u32, u32)) -> Value {
    let (right, up, forward) = camera.axes();
    let down = -up;
    let row = |i: usize| [right[i], down[i], forward[i], camera.eye[i]];
    let intrinsics = match camera.lens {
        Lens::Pinhole { vfov } | Lens::ThinLens { vfov, .. } => {
            let f = f64::from(height) / 2.0 / (vfov.to_radians() / 2.0).tan();
            json!([[f, 0.0, f64::from(width) / 2.0], [0.0, f, f64::from(height) / 2.0], [0.0, 0.0, 1.0]])
        }
        Lens::Orthographic { .. } | Lens::Panoramic => Value::Null,
    };
    let (kind, extent) = match camera.lens {
        Lens::Pinhole { vfov } => ("pinhole", json!({ "vfov": vfov })),
        Lens::ThinLens { vfov, aperture, focus } => {
            ("thin_lens", json!({ "vfov": vfov, "aperture": aperture, "focus": focus }))
        }
        Lens::Orthographic { height } => ("orthographic", json!({ "height": height })),
        Lens::Panoramic => ("panoramic", json!({})),
    };
    json!({
        "type": kind, "lens": extent, "name": camera.name, "intrinsics": intrinsics,
        "world_from_camera": [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]],
    })
}
