//! Camera rays: points of the picture in f64, rays in f32.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::lanes::{ExactPacket, LANES, Mask8, RayPacket, Vec3x8, float8};
use crate::sample::{self, Pattern, Pattern8, dimension};
use crate::scene::{Camera, Filter, FilterTable, Lens};

/// One camera over one display window.
#[derive(Debug)]
pub struct CameraRays {
    /// `None`: samples sit at the centres of pixels.
    filter: Option<FilterTable>,
    seed: u64,
    /// Direction, and its change a pixel right and down.
    dir: [DVec3; 3],
    /// Origin, relative to the plan's, and its change.
    origin: [DVec3; 3],
    optics: Optics,
    common: Option<[f32; 3]>,
}

/// What becomes of the ray through a point of the picture.
#[derive(Debug, Clone, Copy)]
enum Optics {
    /// It is straight.
    Straight,
    /// It starts elsewhere on a lens, whose radii right and up these are, and goes to the same point at
    /// so many lengths of its direction.
    Lens([DVec3; 2], f64),
    /// Its direction goes round: right, up and forward; turns a pixel right and down, in radians; the middle of the
    /// picture in pixels, from which turns are counted so that the horizon is at 0.
    Round([DVec3; 3], [f64; 2], [f64; 2]),
}

impl CameraRays {
    /// `origin` is the plan's; with one sample a pixel it sits at the pixel's centre.
    pub fn new(camera: &Camera, origin: DVec3, display: (u32, u32), filter: Filter, spp: u32, seed: u64) -> Self {
        let (width, height) = (f64::from(display.0), f64::from(display.1));
        let (right, up, forward) = camera.axes();
        // The point (0, 0), and one pixel right and down, for half a picture height of 1.
        let plane = [up - right * (width / height), right * (2.0 / height), up * (-2.0 / height)];
        let eye = camera.eye - origin;
        let optics = match camera.lens {
            Lens::Pinhole { .. } | Lens::Orthographic { .. } => Optics::Straight,
            Lens::ThinLens { aperture, focus, .. } => Optics::Lens([right * aperture, up * aperture], focus),
            Lens::Panoramic => {
                Optics::Round([right, up, forward], [TAU / width, PI / height], [0.5 * width, 0.5 * height])
            }
        };
        let (dir, origin) = match camera.lens {
            Lens::Pinhole { vfov } | Lens::ThinLens { vfov, .. } => {
                let scale = (vfov.to_radians() / 2.0).tan();
                ([forward + plane[0] * scale, plane[1] * scale, plane[2] * scale], [eye, DVec3::ZERO, DVec3::ZERO])
            }
            Lens::Orthographic { height } => {
                let scale = height / 2.0;
                ([forward, DVec3::ZERO, DVec3::ZERO], [eye + plane[0] * scale, plane[1] * scale, plane[2] * scale])
            }
            Lens::Panoramic => ([forward, DVec3::ZERO, DVec3::ZERO], [eye, DVec3::ZERO, DVec3::ZERO]),
        };
        let shared = origin[1] == DVec3::ZERO && !matches!(optics, Optics::Lens(..));
        let common = shared.then(|| origin[0].as_vec3().to_array());
        let filter = (spp > 1).then(|| FilterTable::new(filter));
        CameraRays { filter, seed, dir, origin, optics, common }
    }

    /// The origin, where all rays share it.
    pub fn common_origin(&self) -> Option<[f32; 3]> {
        self.common
    }

    /// Whether samples are spread over the picture, and not all at the centres of pixels.
    pub fn spreads(&self) -> bool {
        self.filter.is_some()
    }

    /// Whether the rays of a pixel depend on its sample pattern.
    pub fn draws(&self) -> bool {
        self.filter.is_some() || matches!(self.optics, Optics::Lens(..))
    }

    /// The sample pattern of a pixel.
    pub fn pattern(&self, x: i32, y: i32) -> PixelPattern {
        let key = sample::pixel_key(self.seed, x, y);
        PixelPattern { key, filter: Pattern::new(key, dimension::FILTER) }
    }

    /// Eight rays in f64.
    pub fn exact(&self, samples: &Samples8) -> ExactPacket {
        let mut rays = ExactPacket::default();
        self.set_exact(samples, &samples.points(&self.offsets(samples)), &mut rays);
        rays
    }

    /// Sets eight rays in f64, through the [points](Samples8::points) of their samples.
    #[inline(always)]
    pub fn set_exact(&self, samples: &Samples8, points: &[[f64; LANES]; 2], rays: &mut ExactPacket) {
        for k in 0..3 {
            match self.common {
                Some(_) => rays.origin[k] = [self.origin[0][k]; LANES],
                None => affine(&self.origin, k, points, &mut rays.origin[k]),
            }
            affine(&self.dir, k, points, &mut rays.dir[k]);
        }
        match &self.optics {
            Optics::Straight => {}
            Optics::Lens(radii, focus) => rays.through_lens(samples, radii, *focus),
            Optics::Round(axes, turns, middle) => rays.around(points, axes, (turns, middle)),
        }
    }

    /// The same rounded to f32; lanes from `count` on are dead.
    #[inline(always)]
    pub fn packet(&self, exact: &ExactPacket, count: usize) -> RayPacket {
        let live = Mask8::from_bits((1u32 << count) - 1);
        let origin = self.common.map_or_else(|| Vec3x8::rounded(&exact.origin), Vec3x8::splat);
        RayPacket::new(origin, Vec3x8::rounded(&exact.dir), float8(f32::INFINITY), live)
    }

    /// How far samples are from the centres of their pixels, in pixels: right, down.
    #[inline(always)]
    pub fn offsets(&self, samples: &Samples8) -> [[f64; LANES]; 2] {
        let Some(filter) = &self.filter else { return [[0.0; LANES]; 2] };
        let [right, down] = samples.pattern.sample(&samples.index);
        [filter.offsets(&right), filter.offsets(&down)]
    }
}

/// An axis of what changes by `base[1]` and `base[2]` a pixel right and down.
#[inline(always)]
fn affine(base: &[DVec3; 3], k: usize, points: &[[f64; LANES]; 2], axis: &mut [f64; LANES]) {
    let (start, right, down) = (base[0][k], base[1][k], base[2][k]);
    for lane in 0..LANES {
        axis[lane] = start + right * points[0][lane] + down * points[1][lane];
    }
}

/// The sample patterns of one pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct PixelPattern {
    /// Their name.
    pub key: u32,
    /// That of the points in the pixel.
    pub filter: Pattern,
}

/// Eight samples of pixels.
#[derive(Debug, Clone, Copy, Default)]
pub struct Samples8 {
    /// Columns of the pixels.
    pub x: [i32; LANES],
    /// Rows of the pixels.
    pub y: [i32; LANES],
    /// Names of the sample patterns of the pixels.
    pub key: [u32; LANES],
    /// Their patterns of the points in the pixels.
    pub pattern: Pattern8,
    /// Indices of the samples.
    pub index: [u32; LANES],
}

impl Samples8 {
    /// Points of the picture in pixels: x, y.
    #[inline(always)]
    pub fn points(&self, offsets: &[[f64; LANES]; 2]) -> [[f64; LANES]; 2] {
        let [mut x, mut y] = *offsets;
        for lane in 0..LANES {
            x[lane] += f64::from(self.x[lane]) + 0.5;
            y[lane] += f64::from(self.y[lane]) + 0.5;
        }
        [x, y]
    }

    /// Sets one sample: its pixel, that one's pattern, and its index.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, (x, y): (i32, i32), pattern: PixelPattern, index: u32) {
        (self.x[lane], self.y[lane], self.index[lane]) = (x, y, index);
        self.set_pattern(lane, pattern);
    }

    /// Sets the pattern of the pixel of one sample.
    #[inline(always)]
    pub fn set_pattern(&mut self, lane: usize, pattern: PixelPattern) {
        self.key[lane] = pattern.key;
        self.pattern.set(lane, pattern.filter);
    }
}

impl Samples8 {
    /// Sets eight samples of one pixel, from the index `first` on.
    #[inline(always)]
    pub fn set_all(&mut self, (x, y): (i32, i32), pattern: PixelPattern, first: u32) {
        let mut index = [first; LANES];
        (0..LANES).for_each(|lane| index[lane] += lane as u32);
        let (key, pattern) = ([pattern.key; LANES], Pattern8::splat(pattern.filter));
        *self = Samples8 { x: [x; LANES], y: [y; LANES], key, pattern, index };
    }
}

impl ExactPacket {
    /// From points of a lens: radii right and up, and the lengths of the direction to what is sharp.
    fn through_lens(&mut self, samples: &Samples8, radii: &[DVec3; 2], focus: f64) {
        for lane in 0..LANES {
            let [u, v] = sample::pair(samples.key[lane], samples.index[lane], dimension::LENS).map(sample::unit);
            let (sin, cos) = (TAU * v).sin_cos();
            let off = (radii[0] * cos + radii[1] * sin) * u.sqrt();
            let (origin, dir) = self.lane(lane);
            self.set_lane(lane, origin + off, dir - off / focus);
        }
    }

    /// All round: points of the picture in pixels, right, up and forward, radians a pixel from the middle on.
    fn around(&mut self, points: &[[f64; LANES]; 2], axes: &[DVec3; 3], (turns, middle): (&[f64; 2], &[f64; 2])) {
        for (lane, (x, y)) in points[0].iter().zip(&points[1]).enumerate() {
            let (sin, cos) = ((x - middle[0]) * turns[0]).sin_cos();
            let (height, level) = ((middle[1] - y) * turns[1]).sin_cos();
            let (origin, _) = self.lane(lane);
            self.set_lane(lane, origin, (axes[0] * sin + axes[2] * cos) * level + axes[1] * height);
        }
    }

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

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(lens: Lens) -> Camera {
        let (eye, target) = (DVec3::new(3.0, -2.0, 5.0), DVec3::new(-1.0, 0.5, 0.25));
        Camera { name: None, eye, target, up: DVec3::new(0.1, 1.0, -0.2), lens }
    }

    /// The first samples of a pixel, as rays.
    fn rays(camera: &Camera, spp: u32, place: (i32, i32)) -> Vec<(DVec3, DVec3)> {
        let filter = Filter::default();
        let rays = CameraRays::new(camera, DVec3::ZERO, (64, 32), filter, spp, 7);
        let mut samples = Samples8::default();
        (0..LANES).for_each(|lane| samples.set(lane, place, rays.pattern(place.0, place.1), lane as u32));
        let packet = rays.exact(&samples);
        (0..LANES).map(|lane| packet.lane(lane)).collect()
    }

    /// Whatever its place on the lens, a ray meets the sharp plane where the pinhole's does, and eight
    /// samples are spread over the lens.
    #[test]
    fn a_lens_is_sharp_at_its_focus() {
        let lens = Lens::ThinLens { vfov: 40.0, aperture: 0.3, focus: 6.0 };
        let (thin, pinhole) = (camera(lens), camera(Lens::Pinhole { vfov: 40.0 }));
        let (right, up, forward) = thin.axes();
        let mut quarters = 0;
        for (a, b) in rays(&thin, 8, (11, 20)).iter().zip(rays(&pinhole, 8, (11, 20))) {
            let sharp = |(origin, dir): (DVec3, DVec3)| {
                origin + dir * ((thin.eye + 6.0 * forward - origin).dot(forward) / dir.dot(forward))
            };
            assert!((sharp(*a) - sharp(b)).length() < 1e-12);
            let off = a.0 - thin.eye;
            assert!(off.length() <= 0.3 && off.dot(forward).abs() < 1e-12);
            quarters |= 1 << (usize::from(off.dot(right) > 0.0) + 2 * usize::from(off.dot(up) > 0.0));
        }
        assert_eq!(quarters, 15);
    }

    /// The middle of a panorama looks forward, a quarter to the right of it right, its first row up.
    #[test]
    fn a_panorama_goes_round() {
        let camera = camera(Lens::Panoramic);
        let (right, up, forward) = camera.axes();
        let look = |x, y| rays(&camera, 1, (x, y))[0].1.normalize();
        let pixel = TAU / 64.0;
        for (got, want) in [((32, 16), forward), ((48, 16), right), ((0, 16), -forward), ((5, 0), up), ((9, 31), -up)] {
            assert!(look(got.0, got.1).angle_between(want) < pixel, "{got:?}");
        }
        assert_eq!(rays(&camera, 1, (3, 4))[0].0, camera.eye);
    }
}
