//! Eight vectors of three.

use std::ops::{Add, Mul, Neg, Sub};

use super::{DVec3x8, Float8, LANES, Mask8, float8};

/// Eight vectors, a lane each.
#[derive(Debug, Clone, Copy)]
pub struct Vec3x8 {
    /// First coordinates.
    pub x: Float8,
    /// Second coordinates.
    pub y: Float8,
    /// Third coordinates.
    pub z: Float8,
}

impl Vec3x8 {
    /// Zero in all lanes.
    pub const ZERO: Vec3x8 = Vec3x8::new(Float8::ZERO, Float8::ZERO, Float8::ZERO);

    /// The same number throughout.
    pub const fn constant(x: f32) -> Self {
        let lanes = Float8::new([x; LANES]);
        Vec3x8::new(lanes, lanes, lanes)
    }

    /// From three columns.
    #[inline(always)]
    pub const fn new(x: Float8, y: Float8, z: Float8) -> Self {
        Vec3x8 { x, y, z }
    }

    /// The same vector in all lanes.
    #[inline(always)]
    pub fn splat([x, y, z]: [f32; 3]) -> Self {
        Vec3x8::new(float8(x), float8(y), float8(z))
    }

    /// Lane `i` is `f(i)`.
    #[inline(always)]
    pub fn from_fn(f: impl FnMut(usize) -> [f32; 3]) -> Self {
        let rows: [[f32; 3]; LANES] = std::array::from_fn(f);
        let axis = |k: usize| Float8::from(rows.map(|row| row[k]));
        Vec3x8::new(axis(0), axis(1), axis(2))
    }

    /// From f64.
    #[inline(always)]
    pub fn rounded(axes: &DVec3x8) -> Self {
        let axis = |k: usize| {
            let mut lanes = [0.0; LANES];
            for i in 0..LANES {
                lanes[i] = axes[k][i] as f32;
            }
            Float8::from(lanes)
        };
        Vec3x8::new(axis(0), axis(1), axis(2))
    }

    /// The vector of one lane.
    #[inline(always)]
    pub fn lane(&self, i: usize) -> [f32; 3] {
        [self.x.to_array()[i], self.y.to_array()[i], self.z.to_array()[i]]
    }

    /// Sets the vector of one lane.
    #[inline(always)]
    pub fn set_lane(&mut self, i: usize, [x, y, z]: [f32; 3]) {
        self.x.as_mut_array()[i] = x;
        self.y.as_mut_array()[i] = y;
        self.z.as_mut_array()[i] = z;
    }

    /// All lanes as vectors.
    #[inline(always)]
    pub fn to_arrays(self) -> [[f32; 3]; LANES] {
        let (x, y, z) = (self.x.to_array(), self.y.to_array(), self.z.to_array());
        std::array::from_fn(|i| [x[i], y[i], z[i]])
    }

    /// Dot product, fused.
    #[inline(always)]
    pub fn dot(self, other: Vec3x8) -> Float8 {
        self.x.mul_add(other.x, self.y.mul_add(other.y, self.z * other.z))
    }

    /// Cross product, fused.
    #[inline(always)]
    pub fn cross(self, other: Vec3x8) -> Vec3x8 {
        Vec3x8::new(
            self.y.mul_sub(other.z, self.z * other.y),
            self.z.mul_sub(other.x, self.x * other.z),
            self.x.mul_sub(other.y, self.y * other.x),
        )
    }

    /// `self * s + other`, fused.
    #[inline(always)]
    pub fn mul_add(self, s: Float8, other: Vec3x8) -> Vec3x8 {
        Vec3x8::new(self.x.mul_add(s, other.x), self.y.mul_add(s, other.y), self.z.mul_add(s, other.z))
    }

    /// Squared length.
    #[inline(always)]
    pub fn length_squared(self) -> Float8 {
        self.dot(self)
    }

    /// Length.
    #[inline(always)]
    pub fn length(self) -> Float8 {
        self.dot(self).sqrt()
    }

    /// To unit length; a zero vector gives NaN.
    #[inline(always)]
    pub fn normalize(self) -> Vec3x8 {
        self * (float8(1.0) / self.length())
    }

    /// Product by coordinates.
    #[inline(always)]
    pub fn scale(self, other: Vec3x8) -> Vec3x8 {
        Vec3x8::new(self.x * other.x, self.y * other.y, self.z * other.z)
    }

    /// Absolute values.
    #[inline(always)]
    pub fn abs(self) -> Vec3x8 {
        Vec3x8::new(self.x.abs(), self.y.abs(), self.z.abs())
    }

    /// The lesser of each coordinate; neither may be NaN.
    #[inline(always)]
    pub fn min(self, other: Vec3x8) -> Vec3x8 {
        Vec3x8::new(self.x.fast_min(other.x), self.y.fast_min(other.y), self.z.fast_min(other.z))
    }

    /// The greater of each coordinate; neither may be NaN.
    #[inline(always)]
    pub fn max(self, other: Vec3x8) -> Vec3x8 {
        Vec3x8::new(self.x.fast_max(other.x), self.y.fast_max(other.y), self.z.fast_max(other.z))
    }

    /// Sum of the coordinates: of absolute values the 1-norm.
    #[inline(always)]
    pub fn sum(self) -> Float8 {
        (self.x + self.y) + self.z
    }

    /// Per lane `yes` or `no`.
    #[inline(always)]
    pub fn select(mask: Mask8, yes: Vec3x8, no: Vec3x8) -> Vec3x8 {
        Vec3x8::new(mask.select(yes.x, no.x), mask.select(yes.y, no.y), mask.select(yes.z, no.z))
    }
}

impl Add for Vec3x8 {
    type Output = Vec3x8;
    #[inline(always)]
    fn add(self, other: Vec3x8) -> Vec3x8 {
        Vec3x8::new(self.x + other.x, self.y + other.y, self.z + other.z)
    }
}

impl Sub for Vec3x8 {
    type Output = Vec3x8;
    #[inline(always)]
    fn sub(self, other: Vec3x8) -> Vec3x8 {
        Vec3x8::new(self.x - other.x, self.y - other.y, self.z - other.z)
    }
}

impl Mul<Float8> for Vec3x8 {
    type Output = Vec3x8;
    #[inline(always)]
    fn mul(self, s: Float8) -> Vec3x8 {
        Vec3x8::new(self.x * s, self.y * s, self.z * s)
    }
}

impl Neg for Vec3x8 {
    type Output = Vec3x8;
    #[inline(always)]
    fn neg(self) -> Vec3x8 {
        Vec3x8::new(-self.x, -self.y, -self.z)
    }
}
