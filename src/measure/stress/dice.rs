//! Numbers that look random and are the same in every run.

use glam::{DQuat, DVec3};

use crate::lanes::Ray;

/// SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
#[derive(Debug, Clone)]
pub struct Dice(u64);

impl Dice {
    /// One for a seed and a name, so that each family rolls its own.
    pub fn new(seed: u64, name: &str) -> Self {
        let mut dice = Dice(name.bytes().fold(seed, |sum, byte| sum.rotate_left(7) ^ u64::from(byte)));
        dice.next();
        dice
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let x = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    pub fn index(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 / (1u64 << 53) as f64)
    }

    /// Evenly spread over the orders of magnitude.
    pub fn log_between(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    pub fn in_cube(&mut self, half: f64) -> DVec3 {
        DVec3::new(self.between(-half, half), self.between(-half, half), self.between(-half, half))
    }

    /// Of unit length.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.in_cube(1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    pub fn turn(&mut self) -> DQuat {
        DQuat::from_axis_angle(self.direction(), self.between(0.0, 6.0))
    }

    /// A sign.
    pub fn sign(&mut self) -> f64 {
        if self.index(2) == 0 { 1.0 } else { -1.0 }
    }
}

/// The ray whose bits are nearest, through a point.
pub fn toward(origin: DVec3, point: DVec3) -> Ray {
    let start = origin.as_vec3();
    Ray::new(start.to_array(), (point - start.as_dvec3()).as_vec3().to_array())
}
