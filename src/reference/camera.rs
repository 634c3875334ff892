//! Points of the picture as rays.

use std::f64::consts::{PI, TAU};

use glam::{DVec2, DVec3};

use super::{Ray, Reference};
use crate::sample;
use crate::scene::{Camera, FilterTable, ImageSettings, Lens, RenderSettings};

/// A camera with the settings of its picture, ready to take it.
#[derive(Debug, Clone)]
pub struct View {
    eye: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    lens: Lens,
    width: f64,
    height: f64,
    filter: FilterTable,
    seed: u64,
    /// Samples per pixel.
    pub(super) spp: u32,
    /// What is computed, and how far.
    pub(super) settings: RenderSettings,
}

impl Reference {
    /// Prepares a camera of the scene (in the scene's coordinates) for pictures of these settings.
    pub fn view(&self, camera: &Camera, image: &ImageSettings, render: &RenderSettings) -> View {
        let (right, up, forward) = camera.axes();
        View {
            eye: camera.eye - self.origin,
            right,
            up,
            forward,
            lens: camera.lens,
            width: f64::from(image.width),
            height: f64::from(image.height),
            filter: FilterTable::new(image.filter),
            seed: render.seed,
            spp: image.spp.max(1),
            settings: render.clone(),
        }
    }
}

impl View {
    /// How far a sample is from the centre of its pixel, in pixels: right, down.
    fn offset(&self, x: i32, y: i32, sample: u32) -> DVec2 {
        if self.spp == 1 {
            return DVec2::ZERO;
        }
        let pair = sample::pair(self.key(x, y), sample, sample::dimension::FILTER);
        DVec2::from_array(pair.map(|fraction| self.filter.offset(fraction)))
    }

    /// The point of the picture, in pixels, that a sample of a pixel looks through.
    pub fn point(&self, x: i32, y: i32, sample: u32) -> (f64, f64) {
        let center = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
        (center + self.offset(x, y, sample)).into()
    }

    /// The square of the distance between the point of a sample and the centre of its pixel, in pixels.
    pub fn distance(&self, x: i32, y: i32, sample: u32) -> f64 {
        self.offset(x, y, sample).length_squared()
    }

    /// How far a length of a direction leads along the view axis; in a panorama, away from the eye.
    pub fn depth_scale(&self, dir: DVec3) -> f64 {
        match self.lens {
            Lens::Pinhole { .. } | Lens::Orthographic { .. } | Lens::ThinLens { .. } => dir.dot(self.forward),
            Lens::Panoramic => dir.length(),
        }
    }

    /// Samples per pixel.
    pub fn samples(&self) -> u32 {
        self.spp
    }

    /// The name of a pixel's sample patterns.
    pub fn key(&self, x: i32, y: i32) -> u32 {
        sample::pixel_key(self.seed, x, y)
    }

    /// The camera ray of a sample of a pixel.
    pub fn sample(&self, x: i32, y: i32, sample: u32) -> Ray {
        let (px, py) = self.point(x, y, sample);
        let key = self.key(x, y);
        match self.lens {
            Lens::ThinLens { .. } => self.ray(px, py, sample::pair(key, sample, sample::dimension::LENS)),
            Lens::Pinhole { .. } | Lens::Orthographic { .. } | Lens::Panoramic => self.ray(px, py, [0; 2]),
        }
    }

    /// The ray through a point of the picture, in pixels from its upper left corner, and for a thin lens
    /// through a point of that.
    pub fn ray(&self, x: f64, y: f64, lens: [u32; 2]) -> Ray {
        let across = (2.0 * x - self.width) / self.height;
        let upward = (self.height - 2.0 * y) / self.height;
        let shift = across * self.right + upward * self.up;
        let (origin, dir) = match self.lens {
            Lens::Pinhole { vfov } => (self.eye, self.forward + (0.5 * vfov.to_radians()).tan() * shift),
            Lens::Orthographic { height } => (self.eye + 0.5 * height * shift, self.forward),
            Lens::ThinLens { vfov, aperture, focus } => {
                let sharp = focus * (self.forward + (0.5 * vfov.to_radians()).tan() * shift);
                let [u, v] = lens.map(sample::unit);
                let place = DVec2::from_angle(TAU * v) * (aperture * u.sqrt());
                let off = place.x * self.right + place.y * self.up;
                (self.eye + off, sharp - off)
            }
            Lens::Panoramic => {
                let (azimuth, elevation) = (TAU * (x / self.width - 0.5), PI * (0.5 - y / self.height));
                let level = azimuth.sin() * self.right + azimuth.cos() * self.forward;
                (self.eye, elevation.cos() * level + elevation.sin() * self.up)
            }
        };
        Ray { origin, dir, t_min: 0.0, t_max: f64::INFINITY }
    }
}
