//! What a scene will take, before it is built or even read.

use std::path::Path;

use crate::film::Window;
use crate::output::{Compression, Storage};
use crate::scene::{CloudShapes, Scene, Shape, inputs};

/// Memory that a build takes for a sphere on top of the scene, in bytes: parts, boxes, tree and columns
/// together at their most (measured on a million: 360).
const SPHERE_BYTES: usize = 400;
/// The same for a corner of a polygon (measured on a million triangles: 185).
const CORNER_BYTES: usize = 200;
/// The same for every other primitive (measured on a million disks: 420).
const OTHER_BYTES: usize = 600;
/// The same with the scene itself, for a primitive of a kind that is not known yet.
const ANY_BYTES: u64 = 500;

/// Memory that a pixel takes at the most, in the picture and as a file, in bytes (measured on 16 million: 25).
const PIXEL_BYTES: u64 = 28;
/// The same for each channel of a layer (measured with 60 of them: 4.5).
const CHANNEL_BYTES: u64 = 5;
/// Memory that a packed pixel takes where rows are packed as they come, in halves (measured on 9 million: 9).
const PACKED_BYTES: u64 = 12;
/// The same in floats (measured: 23).
const PACKED_FLOAT_BYTES: u64 = 28;
/// The same for each channel of a layer (measured with 56 of them: 0.6).
const PACKED_CHANNEL_BYTES: u64 = 1;

/// How a picture is held until it is a file.
#[derive(Debug, Clone, Copy)]
pub enum Held {
    /// As a whole.
    Whole,
    /// Rows by so many threads, packed so as soon as they are traced.
    Rows(usize, Storage),
}

/// Bytes that the pixels of a window take at the most, with so many channels beside the colour.
pub fn of_pixels(window: Window, channels: usize, held: Held) -> u64 {
    let (pixels, channels) = (window.area() as u64, channels as u64);
    let whole = pixels.saturating_mul(PIXEL_BYTES + CHANNEL_BYTES * channels);
    let Held::Rows(threads, storage) = held else { return whole };
    let packed = match (storage.compression, storage.float) {
        // What is not shorter when packed is there in pieces and as the file of them (measured: 1.7 times).
        (Compression::None | Compression::Rle, float) => 2 * (if float { 16 } else { 8 } + 4 * channels),
        (_, true) => PACKED_FLOAT_BYTES + PACKED_CHANNEL_BYTES * channels,
        (_, false) => PACKED_BYTES + PACKED_CHANNEL_BYTES * channels,
    };
    // Bands of 64 rows that are not whole yet.
    let open = (window.width() as u64).saturating_mul(64 * (threads as u64 + 1));
    let rows = open.min(pixels).saturating_mul(16 + 4 * channels);
    pixels.saturating_mul(packed).saturating_add(rows)
}

/// Bytes that building columns and tree of a scene takes at the most.
pub fn to_build(scene: &Scene) -> u64 {
    let objects = scene.objects.iter().map(|object| match &object.shape {
        Shape::Sphere(_) => SPHERE_BYTES,
        Shape::Polygon(polygon) => CORNER_BYTES * polygon.corners.len(),
        Shape::Plane(_) | Shape::Disk(_) | Shape::Box(_) | Shape::Cylinder(_) | Shape::Cone(_) => OTHER_BYTES,
    });
    let clouds = scene.clouds.iter().map(|cloud| match &cloud.shapes {
        CloudShapes::Spheres(rows) => SPHERE_BYTES * rows.len(),
        CloudShapes::Polygons { corners, .. } => CORNER_BYTES * corners.len(),
        CloudShapes::Disks(_) | CloudShapes::Boxes(..) | CloudShapes::Cylinders(..) => OTHER_BYTES * cloud.len(),
    });
    objects.chain(clouds).sum::<usize>() as u64
}

/// Bytes that a scene file will take read and built, guessed from the sizes of the files that it names.
pub fn forecast(scene: &Path, frame: i64) -> u64 {
    inputs::files(scene, frame).iter().map(|path| of_file(path)).fold(0, u64::saturating_add)
}

/// By kind of file: arrays have 16 bytes a primitive or more (measured: 16 to 32), text has 30 a line, pictures decode
/// to 12 a texel, and packed text is a fifth of its length.
fn of_file(path: &Path) -> u64 {
    let length = std::fs::metadata(path).map_or(0, |found| found.len());
    let name = path.to_string_lossy().to_lowercase();
    let ends = |endings: &[&str]| endings.iter().any(|ending| name.ends_with(ending));
    let primitives = match () {
        () if ends(&[".png", ".jpg", ".jpeg", ".exr", ".hdr"]) => return length.saturating_mul(12),
        () if ends(&[".npy"]) => length / 16,
        () if ends(&[".gz"]) => length.saturating_mul(5) / 30,
        () => length / 30,
    };
    primitives.saturating_mul(ANY_BYTES).saturating_add(length)
}
