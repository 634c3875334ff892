//! The rays of the throughput bench: the same sets for every tracer, so that figures compare.
//!
//! - *Camera*: one through the centre of each pixel, in tiles of 8 x 8 pixels, tiles row by row, pixels of a tile row by
//!   row; unit directions, computed in f64, stored in f32.
//! - *Shadow*: for each camera hit, in that order, from the surface to a point light; `t` is 1 at the light. Hits that
//!   face away from it are left out, and the list is closed up, so packets are full but of several tiles.
//! - *Bounce*: for each camera hit, in that order, a direction cosine-distributed about the normal, chosen by a hash of
//!   the pixel, without an end.

use std::f64::consts::TAU;

use glam::DVec3;

use crate::integrate::{CameraRays, Samples8};
use crate::lanes::{LANES, Ray, UNIT_ROUNDOFF};
use crate::scene::{Camera, Emitter, ImageSettings, Scene, Source, basis};
use crate::tracer::Hit;

/// Pixels along the edge of a tile.
const EDGE: u32 = 8;

/// Camera rays and the pixels they belong to.
#[derive(Debug)]
pub struct CameraSet {
    pub rays: Vec<Ray>,
    /// `y width + x`, one a ray.
    pub pixels: Vec<u32>,
}

impl CameraSet {
    /// One ray a pixel, in the coordinates of the scene.
    pub fn new(camera: &Camera, image: &ImageSettings) -> Self {
        let generator = generator(camera, image);
        let mut set = CameraSet { rays: Vec::new(), pixels: Vec::new() };
        for eight in eights(image) {
            let exact = generator.exact(&samples(&generator, &eight));
            for (i, (x, y)) in eight.iter().enumerate() {
                let (origin, dir) = exact.lane(i);
                set.rays.push(Ray::new(origin.as_vec3().to_array(), dir.normalize().as_vec3().to_array()));
                set.pixels.push(y * image.width + x);
            }
        }
        set
    }
}

/// Up to eight pixels of a row.
pub type Eight = Vec<(u32, u32)>;

/// What makes camera rays, in the coordinates of the scene.
pub fn generator(camera: &Camera, image: &ImageSettings) -> CameraRays {
    CameraRays::new(camera, DVec3::ZERO, (image.width, image.height), image.filter, 1, 0)
}

/// Up to eight samples, at the centres of these pixels.
pub fn samples(generator: &CameraRays, pixels: &[(u32, u32)]) -> Samples8 {
    let mut samples = Samples8::default();
    for (lane, (x, y)) in pixels.iter().enumerate() {
        let place = (*x as i32, *y as i32);
        samples.set(lane, place, generator.pattern(place.0, place.1), 0);
    }
    samples
}

/// The pixels of a picture, up to eight of a row of a tile together.
pub fn eights(image: &ImageSettings) -> Vec<Eight> {
    let (width, height) = (image.width, image.height);
    let cells = |end: u32| (0..end).step_by(EDGE as usize);
    let row = |x0: u32, y: u32| (x0..width.min(x0 + LANES as u32)).map(|x| (x, y)).collect();
    let tile = |y0: u32, x0: u32| (y0..height.min(y0 + EDGE)).map(move |y| row(x0, y));
    cells(height).flat_map(|y0| cells(width).flat_map(move |x0| tile(y0, x0))).collect()
}

/// A place that the shadow rays of a scene go to.
pub fn light_position(scene: &Scene) -> Option<DVec3> {
    scene.lights.iter().find_map(|light| match &light.source {
        Source::Point { position, .. } | Source::Spot { position, .. } => Some(*position),
        Source::Area { emitter: Emitter::Sphere { center, .. } | Emitter::Disk { center, .. }, .. } => Some(*center),
        Source::Area { emitter: Emitter::Polygon(polygon), .. } => polygon.corners.first().copied(),
        Source::Directional { .. } => None,
    })
}

/// Rays from what camera rays met to a light.
pub fn shadow(hits: &[Option<Hit>], rays: &[Ray], light: DVec3) -> Vec<Ray> {
    let lit = hits.iter().zip(rays).filter_map(|(hit, ray)| {
        let hit = hit.as_ref()?;
        let way = light - wide(hit.point);
        let origin = hit.spawn(way.as_vec3().to_array()).origin;
        let way = light - wide(origin);
        let dir = way.as_vec3().to_array();
        (facing(hit, ray).dot(way) > 0.0).then_some(Ray { origin, t_min: 0.0, dir, t_max: 1.0 })
    });
    lit.collect()
}

/// The same rays from their other end, which is one for all; the ends stay clear of the surfaces.
pub fn from_light(shadow: &[Ray], light: DVec3) -> Vec<Ray> {
    let position = light.as_vec3().to_array();
    let turned = |ray: &Ray| {
        let dir = (wide(ray.origin) - wide(position)).as_vec3().to_array();
        Ray { origin: position, t_min: 0.0, dir, t_max: 1.0 - 8.0 * UNIT_ROUNDOFF }
    };
    shadow.iter().map(turned).collect()
}

/// Rays that leave what camera rays met as a diffuse surface scatters them.
pub fn bounce(hits: &[Option<Hit>], set: &CameraSet) -> Vec<Ray> {
    let met = hits.iter().zip(&set.rays).zip(&set.pixels);
    let scattered = met.filter_map(|((hit, ray), pixel)| {
        let hit = hit.as_ref()?;
        let n = facing(hit, ray);
        let (a, b) = basis(n);
        let (u, angle) = (hash(2 * u64::from(*pixel)), TAU * hash(2 * u64::from(*pixel) + 1));
        let radius = u.sqrt();
        let dir = a * (radius * angle.cos()) + b * (radius * angle.sin()) + n * (1.0 - u).sqrt();
        Some(hit.spawn(dir.normalize().as_vec3().to_array()))
    });
    scattered.collect()
}

/// The normal on the side that the ray came from.
fn facing(hit: &Hit, ray: &Ray) -> DVec3 {
    let n = wide(hit.normal).normalize();
    if n.dot(wide(ray.dir)) > 0.0 { -n } else { n }
}

fn wide(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

/// A number in 0..1 of 24 bits. Source: the finalizer of SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom
/// number generators", OOPSLA 2014.
fn hash(x: u64) -> f64 {
    let z = x.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ z >> 31) >> 40) as f64 / f64::from(1 << 24)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Filter, Lens};

    fn image(width: u32, height: u32) -> ImageSettings {
        ImageSettings { width, height, spp: 4, filter: Filter::default() }
    }

    #[test]
    fn pixels_come_tile_by_tile_and_once() {
        let pixels: Vec<_> = eights(&image(19, 9)).into_iter().flatten().collect();
        assert_eq!(pixels[..9], [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0), (5, 0), (6, 0), (7, 0), (0, 1)]);
        assert_eq!((pixels[64], pixels.last()), ((8, 0), Some(&(18, 8))));
        let unique: std::collections::HashSet<_> = pixels.iter().collect();
        assert_eq!((pixels.len(), unique.len()), (19 * 9, 19 * 9));
    }

    #[test]
    fn camera_rays_go_through_pixel_centres() {
        let lens = Lens::Pinhole { vfov: 90.0 };
        let camera = Camera { name: None, eye: DVec3::Z, target: DVec3::ZERO, up: DVec3::Y, lens };
        let set = CameraSet::new(&camera, &image(16, 8));
        let dir = wide(set.rays[0].dir);
        // Half the height of the picture lies at 1: the first pixel's centre at 7/8 of it, and 15/8 to the left.
        assert!((dir / -dir.z - DVec3::new(-15.0 / 8.0, 7.0 / 8.0, -1.0)).length() < 1e-6, "{dir}");
        assert_eq!((set.rays[0].origin, set.pixels[8], set.pixels[64]), ([0.0, 0.0, 1.0], 16, 8));
        assert!((dir.length() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn hashes_are_those_of_the_other_harnesses() {
        // splitmix64 seeded with 0: its first output is 0xe220a8397b1dcdaf.
        assert_eq!(hash(0), f64::from(0x00e2_20a8) / f64::from(1 << 24));
    }
}
