//! Yes or no, eight times.

use std::ops::{BitAnd, BitAndAssign, BitOr, BitOrAssign, Not};

use bytemuck::cast;
use wide::i32x8;

use super::{Float8, LANES};

/// Eight yes-or-no lanes. A comparison with NaN is no.
#[derive(Debug, Clone, Copy)]
pub struct Mask8(Float8);

impl Mask8 {
    /// All lanes no.
    pub const NONE: Mask8 = Mask8(Float8::new([0.0; LANES]));

    /// Lane `i` is bit `i`.
    #[inline(always)]
    pub fn from_bits(bits: u32) -> Self {
        let own = i32x8::new([1, 2, 4, 8, 16, 32, 64, 128]);
        Mask8(cast((i32x8::splat(bits as i32) & own).simd_eq(own)))
    }

    /// Bit `i` is lane `i`.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        self.0.to_bitmask()
    }

    /// Whether any lane is yes.
    #[inline(always)]
    pub fn any(self) -> bool {
        self.0.to_bitmask() != 0
    }

    /// Whether all lanes are yes.
    #[inline(always)]
    pub fn all(self) -> bool {
        self.0.to_bitmask() == 0xff
    }

    /// The lanes that are yes, from the lowest.
    #[inline(always)]
    pub fn lanes(self) -> impl Iterator<Item = usize> {
        bits(self.bits())
    }

    /// Per lane `yes` or `no`, bit for bit.
    #[inline(always)]
    pub fn select(self, yes: Float8, no: Float8) -> Float8 {
        self.0.select(yes, no)
    }

    /// `a < b`.
    #[inline(always)]
    pub fn lt(a: Float8, b: Float8) -> Self {
        Mask8(a.simd_lt(b))
    }

    /// `a <= b`.
    #[inline(always)]
    pub fn le(a: Float8, b: Float8) -> Self {
        Mask8(a.simd_le(b))
    }

    /// `a > b`.
    #[inline(always)]
    pub fn gt(a: Float8, b: Float8) -> Self {
        Mask8(a.simd_gt(b))
    }

    /// `a >= b`.
    #[inline(always)]
    pub fn ge(a: Float8, b: Float8) -> Self {
        Mask8(a.simd_ge(b))
    }

    /// Lanes with the same bits, whatever number those are.
    #[inline(always)]
    pub fn same_bits(a: Float8, b: Float8) -> Self {
        let (a, b): (i32x8, i32x8) = (cast(a), cast(b));
        Mask8(cast(a.simd_eq(b)))
    }

    /// Lanes whose sign bit is set, -0 and negative NaN among them.
    #[inline(always)]
    pub fn sign(a: Float8) -> Self {
        // AVX chooses by the sign bit alone, whatever the others are; before it lanes are chosen bit by bit.
        if cfg!(target_feature = "avx") { Mask8(a) } else { Mask8(cast(cast::<_, i32x8>(a).simd_lt(i32x8::ZERO))) }
    }
}

/// The numbers of the bits that are set, from the lowest.
#[inline(always)]
pub fn bits(mut set: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lowest = (set != 0).then(|| set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        lowest
    })
}

impl BitAnd for Mask8 {
    type Output = Mask8;
    #[inline(always)]
    fn bitand(self, other: Mask8) -> Mask8 {
        Mask8(self.0 & other.0)
    }
}

impl BitOr for Mask8 {
    type Output = Mask8;
    #[inline(always)]
    fn bitor(self, other: Mask8) -> Mask8 {
        Mask8(self.0 | other.0)
    }
}

impl BitAndAssign for Mask8 {
    #[inline(always)]
    fn bitand_assign(&mut self, other: Mask8) {
        *self = *self & other;
    }
}

impl BitOrAssign for Mask8 {
    #[inline(always)]
    fn bitor_assign(&mut self, other: Mask8) {
        *self = *self | other;
    }
}

impl Not for Mask8 {
    type Output = Mask8;
    #[inline(always)]
    fn not(self) -> Mask8 {
        Mask8(!self.0)
    }
}
