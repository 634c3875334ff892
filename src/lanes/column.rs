//! Quantities of eight rows side by side: what a block of a structure of arrays is made of.

use glam::DVec3;

use super::{Float8, LANES, Vec3x8, float8};

/// One or several quantities of eight rows, a lane a row.
pub trait Columns: Copy + Send + Sync {
    /// The quantities of one row in f64.
    type One: Copy;
    /// Eight rows, rounded to f32; missing ones are NaN, which no ray can hit.
    fn pack(rows: [Option<Self::One>; LANES]) -> Self;
    /// The row of one lane in all lanes.
    fn broadcast(&self, lane: usize) -> Self;
    /// Lane `i` is lane `row(i).1` of block `row(i).0`.
    fn gather<'a>(row: impl Fn(usize) -> (&'a Self, usize) + Copy) -> Self
    where
        Self: 'a;
}

impl Columns for Float8 {
    type One = f64;

    fn pack(rows: [Option<f64>; LANES]) -> Self {
        Float8::from(rows.map(|row| row.map_or(f32::NAN, |x| x as f32)))
    }

    #[inline(always)]
    fn broadcast(&self, lane: usize) -> Self {
        float8(self.as_array()[lane % LANES])
    }

    #[inline(always)]
    fn gather<'a>(row: impl Fn(usize) -> (&'a Self, usize) + Copy) -> Self
    where
        Self: 'a,
    {
        let mut lanes = [0.0; LANES];
        for (i, x) in lanes.iter_mut().enumerate() {
            let (block, lane) = row(i);
            *x = block.as_array()[lane % LANES];
        }
        Float8::from(lanes)
    }
}

impl Columns for Vec3x8 {
    type One = DVec3;

    fn pack(rows: [Option<DVec3>; LANES]) -> Self {
        let axis = |k: usize| Float8::pack(rows.map(|row| row.map(|v| v[k])));
        Vec3x8::new(axis(0), axis(1), axis(2))
    }

    #[inline(always)]
    fn broadcast(&self, lane: usize) -> Self {
        Vec3x8::new(self.x.broadcast(lane), self.y.broadcast(lane), self.z.broadcast(lane))
    }

    #[inline(always)]
    fn gather<'a>(row: impl Fn(usize) -> (&'a Self, usize) + Copy) -> Self
    where
        Self: 'a,
    {
        Vec3x8::new(
            Float8::gather(|i| (&row(i).0.x, row(i).1)),
            Float8::gather(|i| (&row(i).0.y, row(i).1)),
            Float8::gather(|i| (&row(i).0.z, row(i).1)),
        )
    }
}

impl<C: Columns, const N: usize> Columns for [C; N] {
    type One = [C::One; N];

    fn pack(rows: [Option<[C::One; N]>; LANES]) -> Self {
        std::array::from_fn(|k| C::pack(rows.map(|row| row.map(|all| all[k]))))
    }

    #[inline(always)]
    fn broadcast(&self, lane: usize) -> Self {
        let mut all = *self;
        all.iter_mut().for_each(|column| *column = column.broadcast(lane));
        all
    }

    #[inline(always)]
    fn gather<'a>(row: impl Fn(usize) -> (&'a Self, usize) + Copy) -> Self
    where
        Self: 'a,
    {
        let mut all = *row(0).0;
        for (k, column) in all.iter_mut().enumerate() {
            *column = C::gather(|i| (&row(i).0[k], row(i).1));
        }
        all
    }
}

impl<A: Columns, B: Columns> Columns for (A, B) {
    type One = (A::One, B::One);

    fn pack(rows: [Option<(A::One, B::One)>; LANES]) -> Self {
        (A::pack(rows.map(|row| row.map(|both| both.0))), B::pack(rows.map(|row| row.map(|both| both.1))))
    }

    #[inline(always)]
    fn broadcast(&self, lane: usize) -> Self {
        (self.0.broadcast(lane), self.1.broadcast(lane))
    }

    #[inline(always)]
    fn gather<'a>(row: impl Fn(usize) -> (&'a Self, usize) + Copy) -> Self
    where
        Self: 'a,
    {
        (A::gather(|i| (&row(i).0.0, row(i).1)), B::gather(|i| (&row(i).0.1, row(i).1)))
    }
}
