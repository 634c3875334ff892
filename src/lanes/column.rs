//! One quantity of all primitives of a kind.

use glam::DVec3;

use super::{Float8, LANES, Vec3x8, float8};

/// One f32 a row. Behind the last row stand eight of NaN, which no ray can hit, so that a block may
/// start at any row.
#[derive(Debug, Clone)]
pub struct Column(Vec<f32>);

/// Three columns: a vector a row.
#[derive(Debug, Clone)]
pub struct Column3 {
    x: Column,
    y: Column,
    z: Column,
}

impl Column {
    /// Stores the rows, rounded to f32.
    pub fn new(rows: impl Iterator<Item = f64>) -> Self {
        let padding = [f32::NAN; LANES];
        Column(rows.map(|x| x as f32).chain(padding).collect())
    }

    /// Row `i` in all lanes.
    #[inline(always)]
    pub fn splat(&self, i: usize) -> Float8 {
        float8(self.0[i])
    }

    /// Rows `first..first + 8`, a lane each.
    #[inline(always)]
    pub fn block(&self, first: usize) -> Float8 {
        let rows: [f32; LANES] = self.0[first..first + LANES].try_into().expect("eight rows");
        Float8::from(rows)
    }

    /// Lane `k` is row `rows[k]`.
    #[inline(always)]
    pub fn gather(&self, rows: [u32; LANES]) -> Float8 {
        let mut lanes = [0.0; LANES];
        for (lane, row) in lanes.iter_mut().zip(rows) {
            *lane = self.0[row as usize];
        }
        Float8::from(lanes)
    }

    /// Row `i`.
    #[inline(always)]
    pub fn row(&self, i: usize) -> f32 {
        self.0[i]
    }

    /// Memory in bytes.
    pub fn bytes(&self) -> usize {
        self.0.capacity() * size_of::<f32>()
    }
}

impl Column3 {
    /// Stores the rows, rounded to f32.
    pub fn new(rows: impl Iterator<Item = DVec3> + Clone) -> Self {
        let axis = |k: usize| Column::new(rows.clone().map(move |v| v[k]));
        Column3 { x: axis(0), y: axis(1), z: axis(2) }
    }

    /// Row `i` in all lanes.
    #[inline(always)]
    pub fn splat(&self, i: usize) -> Vec3x8 {
        Vec3x8::new(self.x.splat(i), self.y.splat(i), self.z.splat(i))
    }

    /// Rows `first..first + 8`, a lane each.
    #[inline(always)]
    pub fn block(&self, first: usize) -> Vec3x8 {
        Vec3x8::new(self.x.block(first), self.y.block(first), self.z.block(first))
    }

    /// Lane `k` is row `rows[k]`.
    #[inline(always)]
    pub fn gather(&self, rows: [u32; LANES]) -> Vec3x8 {
        Vec3x8::new(self.x.gather(rows), self.y.gather(rows), self.z.gather(rows))
    }

    /// Memory in bytes.
    pub fn bytes(&self) -> usize {
        self.x.bytes() + self.y.bytes() + self.z.bytes()
    }
}
