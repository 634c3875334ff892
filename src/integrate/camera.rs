//! Camera rays: points of the picture in f64, rays in f32.

use glam::DVec3;

use crate::lanes::{LANES, Mask8, RayPacket, Vec3x8, float8};
use crate::sample::{self, dimension};
use crate::scene::{Camera, Filter, FilterTable, Lens};

/// One camera over one display window.
#[derive(Debug)]
pub struct CameraRays {
    filter: FilterTable,
    seed: u64,
    centered: bool,
    /// Direction, and its change a pixel right and down.
    dir: [DVec3; 3],
    /// Origin, relative to the plan's, and its change.
    origin: [DVec3; 3],
}

impl CameraRays {
    /// `origin` is the plan's; with one sample a pixel it sits at the pixel's centre.
    pub fn new(camera: &Camera, origin: DVec3, display: (u32, u32), filter: Filter, spp: u32, seed: u64) -> Self {
        let (width, height) = (f64::from(display.0), f64::from(display.1));
        let (right, up, forward) = camera.axes();
        // The point (0, 0), and one pixel right and down, for half a picture height of 1.
        let plane = [up - right * (width / height), right * (2.0 / height), up * (-2.0 / height)];
        let eye = camera.eye - origin;
        let (dir, origin) = match camera.lens {
            Lens::Pinhole { vfov } => {
                let scale = (vfov.to_radians() / 2.0).tan();
                ([forward + plane[0] * scale, plane[1] * scale, plane[2] * scale], [eye, DVec3::ZERO, DVec3::ZERO])
            }
            Lens::Orthographic { height } => {
                let scale = height / 2.0;
                ([forward, DVec3::ZERO, DVec3::ZERO], [eye + plane[0] * scale, plane[1] * scale, plane[2] * scale])
            }
        };
        CameraRays { filter: FilterTable::new(filter), seed, centered: spp == 1, dir, origin }
    }

    /// The origin, where all rays share it.
    pub fn common_origin(&self) -> Option<[f32; 3]> {
        (self.origin[1] == DVec3::ZERO).then(|| self.origin[0].as_vec3().to_array())
    }

    /// Names the sample pattern of a pixel.
    pub fn key(&self, x: i32, y: i32) -> u32 {
        sample::pixel_key(self.seed, x, y)
    }

    /// Eight rays in f64: pixel, its key and sample index by lane.
    #[inline(always)]
    pub fn exact(&self, samples: &[(i32, i32, u32, u32); LANES]) -> [(DVec3, DVec3); LANES] {
        samples.map(|(x, y, key, index)| {
            let (x, y) = self.point(x, y, key, index);
            let at = |base: &[DVec3; 3]| base[0] + base[1] * x + base[2] * y;
            (at(&self.origin), at(&self.dir))
        })
    }

    /// The same rounded; lanes from `count` on are dead.
    #[inline(always)]
    pub fn packet(&self, exact: &[(DVec3, DVec3); LANES], count: usize) -> RayPacket {
        let live = Mask8::from_bits((1u32 << count) - 1);
        let origin = match self.common_origin() {
            Some(origin) => Vec3x8::splat(origin),
            None => Vec3x8::from_fn(|i| exact[i].0.as_vec3().to_array()),
        };
        RayPacket::new(origin, Vec3x8::from_fn(|i| exact[i].1.as_vec3().to_array()), float8(f32::INFINITY), live)
    }

    #[inline(always)]
    fn point(&self, x: i32, y: i32, key: u32, index: u32) -> (f64, f64) {
        let center = (f64::from(x) + 0.5, f64::from(y) + 0.5);
        if self.centered {
            return center;
        }
        let [a, b] = sample::pair(key, index, dimension::FILTER).map(sample::unit);
        (center.0 + self.filter.offset(a), center.1 + self.filter.offset(b))
    }
}
