//! Camera rays: points of the picture in f64, rays in f32.

use glam::DVec3;

use crate::lanes::{Float8, LANES, Mask8, RayPacket, Vec3x8, float8};
use crate::sample::{self, Pattern, Pattern8, dimension};
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

    /// The sample pattern of a pixel.
    pub fn pattern(&self, x: i32, y: i32) -> Pattern {
        Pattern::new(sample::pixel_key(self.seed, x, y), dimension::FILTER)
    }

    /// Eight rays in f64.
    #[inline(always)]
    pub fn exact(&self, samples: &Samples8) -> ExactPacket {
        let points = self.points(samples);
        let at = |base: &[DVec3; 3], k: usize| {
            let mut axis = [0.0; LANES];
            for lane in 0..LANES {
                axis[lane] = base[0][k] + base[1][k] * points[0][lane] + base[2][k] * points[1][lane];
            }
            axis
        };
        ExactPacket { origin: [0, 1, 2].map(|k| at(&self.origin, k)), dir: [0, 1, 2].map(|k| at(&self.dir, k)) }
    }

    /// The same rounded; lanes from `count` on are dead.
    #[inline(always)]
    pub fn packet(&self, exact: &ExactPacket, count: usize) -> RayPacket {
        let live = Mask8::from_bits((1u32 << count) - 1);
        let origin = match self.common_origin() {
            Some(origin) => Vec3x8::splat(origin),
            None => rounded(&exact.origin),
        };
        RayPacket::new(origin, rounded(&exact.dir), float8(f32::INFINITY), live)
    }

    /// Points of the picture in pixels: x, y.
    #[inline(always)]
    fn points(&self, samples: &Samples8) -> [[f64; LANES]; 2] {
        let mut points = [samples.x, samples.y].map(|axis| axis.map(|pixel| f64::from(pixel) + 0.5));
        if self.centered {
            return points;
        }
        for (axis, bits) in points.iter_mut().zip(samples.pattern.sample(&samples.index)) {
            for lane in 0..LANES {
                axis[lane] += self.filter.offset(bits[lane]);
            }
        }
        points
    }
}

/// Eight samples of pixels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Samples8 {
    /// Columns of the pixels.
    pub x: [i32; LANES],
    /// Rows of the pixels.
    pub y: [i32; LANES],
    /// Sample patterns of the pixels.
    pub pattern: Pattern8,
    /// Indices of the samples.
    pub index: [u32; LANES],
}

impl Samples8 {
    /// Sets one sample: its pixel, that one's pattern, and its index.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, (x, y): (i32, i32), pattern: Pattern, index: u32) {
        (self.x[lane], self.y[lane], self.index[lane]) = (x, y, index);
        self.pattern.set(lane, pattern);
    }
}

/// Origins and directions of eight rays in f64, by axis.
#[derive(Debug, Clone, Copy, Default)]
pub struct ExactPacket {
    /// Scene units, relative to the plan's origin.
    pub origin: [[f64; LANES]; 3],
    /// Any length.
    pub dir: [[f64; LANES]; 3],
}

impl ExactPacket {
    /// Origin and direction of one ray.
    pub fn lane(&self, i: usize) -> (DVec3, DVec3) {
        let at = |axes: &[[f64; LANES]; 3]| DVec3::new(axes[0][i], axes[1][i], axes[2][i]);
        (at(&self.origin), at(&self.dir))
    }

    /// Sets one ray.
    pub fn set_lane(&mut self, i: usize, origin: DVec3, dir: DVec3) {
        for k in 0..3 {
            (self.origin[k][i], self.dir[k][i]) = (origin[k], dir[k]);
        }
    }
}

#[inline(always)]
fn rounded(axes: &[[f64; LANES]; 3]) -> Vec3x8 {
    let axis = |k: usize| {
        let mut lanes = [0.0; LANES];
        for i in 0..LANES {
            lanes[i] = axes[k][i] as f32;
        }
        Float8::from(lanes)
    };
    Vec3x8::new(axis(0), axis(1), axis(2))
}
