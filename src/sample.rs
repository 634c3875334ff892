//! Sample points: (seed, pixel, sample, dimension) to bits, and nothing but integers.
//!
//! Every pair of dimensions is a (0,2)-sequence: the first two dimensions of Sobol's sequence, each
//! coordinate Owen-scrambled. The point in the pixel takes it as it is, and what is drawn where the
//! camera ray ends in an order of its own such that both together are spread evenly in four
//! dimensions: an edge of a shadow that crosses a pixel asks for that. All else takes it in an order
//! shuffled by Owen scrambling. What shares that order is drawn for sums, never for products: such
//! points are good beside the point in the pixel, not beside each other. Nothing is carried from one
//! call to the next, so samples do not depend on threads, tiles or crops.
//!
//! Sources: Burley, "Practical hash-based Owen scrambling", Journal of Computer Graphics Techniques
//! 9(4), 2020; the hash is Vegdahl's refinement of Laine and Karras's ("Building a better LK hash",
//! 2021); the Pascal matrix by halving is from Ahmed, "An implementation algorithm of 2D Sobol sequence
//! fast, elegant, and compact", Eurographics Symposium on Rendering, 2024.

/// What a pair of dimensions is used for: one number each, so that no two uses share a pattern.
pub mod dimension {
    /// The point in the pixel.
    pub const FILTER: u32 = 0;
    /// The point on the lens.
    pub const LENS: u32 = 1;
    /// The direction in which a surface scatters.
    pub const SCATTER: u32 = 0;
    /// First which way a path goes on, then whether it does.
    pub const CHOICE: u32 = 1;
    /// The direction in which a surface looks for ambient light.
    pub const OPENNESS: u32 = 2;
    /// The place in light `i`: `LIGHTS + i`; the sky comes after the last light.
    pub const LIGHTS: u32 = 16;

    /// A use where the ray of a depth (the camera ray's is 1) has met a surface.
    pub fn at(depth: u32, what: u32) -> u32 {
        (depth << DEPTH).wrapping_add(what)
    }

    /// From this bit on a use tells its depth.
    pub(super) const DEPTH: u32 = 20;
}

/// Names the sample pattern of one pixel: all its samples and dimensions.
///
/// The pixel is counted in the display window, so that crops and shards see the same pattern.
pub fn pixel_key(seed: u64, x: i32, y: i32) -> u32 {
    let place = u64::from(x as u32) << 32 | u64::from(y as u32);
    (mix(mix(seed) ^ place) >> 32) as u32
}

/// In which order a pair of dimensions takes the points of the sequence.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Order {
    /// As it is.
    #[default]
    Plain,
    /// So that they are spread evenly beside those in plain order.
    Partner,
    /// Shuffled by a key.
    Shuffled,
}

impl Order {
    /// That of a use.
    #[inline]
    fn of(dimension: u32) -> Self {
        match (dimension >> dimension::DEPTH, dimension) {
            (0, dimension::FILTER) => Order::Plain,
            (1, _) if dimension != dimension::at(1, dimension::CHOICE) => Order::Partner,
            _ => Order::Shuffled,
        }
    }
}

/// The sample pattern of one pixel in one pair of dimensions: keys of its order and of its coordinates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Pattern {
    order: Order,
    shuffle: u32,
    first: u32,
    second: u32,
}

impl Pattern {
    /// The pattern of a pixel, by its key.
    #[inline]
    pub fn new(pixel_key: u32, dimension: u32) -> Self {
        let shuffle = hash(pixel_key ^ hash(dimension.wrapping_add(0x9e37_79b9)));
        let (first, second) = (hash(shuffle ^ 0x68bc_21eb), hash(shuffle ^ 0x02e5_be93));
        Pattern { order: Order::of(dimension), shuffle, first, second }
    }

    /// Sample `index`, as fractions of 2^32.
    #[inline]
    pub fn sample(&self, index: u32) -> [u32; 2] {
        let i = match self.order {
            Order::Plain => index,
            Order::Partner => partner(index),
            Order::Shuffled => shuffled(index, self.shuffle),
        };
        [laine_karras(i, self.first).reverse_bits(), laine_karras(pascal(i), self.second).reverse_bits()]
    }
}

/// The patterns of eight samples in one pair of dimensions, side by side.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pattern8 {
    order: Order,
    shuffle: [u32; 8],
    first: [u32; 8],
    second: [u32; 8],
}

impl Pattern8 {
    /// Those of eight pixels, by their keys.
    #[inline(always)]
    pub fn new(pixel_keys: &[u32; 8], dimension: u32) -> Self {
        let mut patterns = Pattern8::default();
        for (lane, key) in pixel_keys.iter().enumerate() {
            patterns.set(lane, Pattern::new(*key, dimension));
        }
        patterns
    }

    /// The same pattern in all lanes.
    #[inline(always)]
    pub fn splat(Pattern { order, shuffle, first, second }: Pattern) -> Self {
        Pattern8 { order, shuffle: [shuffle; 8], first: [first; 8], second: [second; 8] }
    }

    /// Sets the pattern of one lane; that of all lanes is for the same use.
    #[inline(always)]
    pub fn set(&mut self, lane: usize, Pattern { order, shuffle, first, second }: Pattern) {
        self.order = order;
        (self.shuffle[lane], self.first[lane], self.second[lane]) = (shuffle, first, second);
    }

    /// Eight samples at once: the same bits as [`Pattern::sample`] one by one.
    #[inline(always)]
    pub fn sample(&self, index: &[u32; 8]) -> [[u32; 8]; 2] {
        let mut i = *index;
        match self.order {
            Order::Plain => {}
            Order::Partner => i.iter_mut().for_each(|i| *i = partner(*i)),
            Order::Shuffled => i.iter_mut().zip(&self.shuffle).for_each(|(i, key)| *i = shuffled(*i, *key)),
        }
        let (mut first, mut second) = ([0; 8], [0; 8]);
        for lane in 0..8 {
            first[lane] = laine_karras(i[lane], self.first[lane]).reverse_bits();
            second[lane] = laine_karras(pascal(i[lane]), self.second[lane]).reverse_bits();
        }
        [first, second]
    }
}

/// Sample `index` of a pixel in one pair of dimensions, as fractions of 2^32.
#[inline]
pub fn pair(pixel_key: u32, index: u32, dimension: u32) -> [u32; 2] {
    Pattern::new(pixel_key, dimension).sample(index)
}

/// Bits as the number they stand for, in the open interval 0..1.
#[inline]
pub fn unit(bits: u32) -> f64 {
    (f64::from(bits) + 0.5) * (1.0 / 4_294_967_296.0)
}

/// Owen scrambling of bit-reversed digits: every bit is flipped by a hash of those below it.
#[inline(always)]
fn laine_karras(mut x: u32, key: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(key);
    x = x.wrapping_mul((key >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^ x.wrapping_mul(0x53a2_2864)
}

/// An index among as many others in another order.
#[inline(always)]
fn shuffled(index: u32, key: u32) -> u32 {
    laine_karras(index.reverse_bits(), key).reverse_bits()
}

/// Sobol's second dimension, bits reversed: the index times Pascal's triangle modulo 2.
#[inline(always)]
fn pascal(mut i: u32) -> u32 {
    i ^= (i >> 16) & 0x0000_ffff;
    i ^= (i >> 8) & 0x00ff_00ff;
    i ^= (i >> 4) & 0x0f0f_0f0f;
    i ^= (i >> 2) & 0x3333_3333;
    i ^ ((i >> 1) & 0x5555_5555)
}

/// The index whose point goes with that of another one: bits change by those above them alone, so the first 2^k stay among
/// themselves. The masks were found by a search for those with which the fewest elementary intervals in four dimensions
/// hold more points than their share, up to 4096 of them.
#[inline(always)]
fn partner(mut i: u32) -> u32 {
    i ^= (i >> 1) & 0x02c9_2b40;
    i ^= (i >> 2) & 0xb287_f077;
    i ^= (i >> 3) & 0xafab_54e3;
    i ^= (i >> 4) & 0x2571_6d75;
    i ^= (i >> 5) & 0xf162_1eeb;
    i ^= (i >> 6) & 0x1452_1b43;
    i ^= (i >> 7) & 0x7527_f4f2;
    i ^ ((i >> 8) & 0x373c_25ed)
}

/// A 32-bit finaliser (Wellons, "Prospecting for hash functions", 2018).
#[inline]
fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// SplitMix64's finaliser (Steele, Lea and Flood, OOPSLA 2014).
fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIGHT: u32 = (1 << dimension::DEPTH) + dimension::LIGHTS;

    #[test]
    fn eight_samples_are_the_same_as_one_by_one() {
        let keys: [u32; 8] = std::array::from_fn(|lane| lane as u32 * 77 + 5);
        let index = std::array::from_fn(|lane| lane as u32 * 1_000_003);
        for dimension in [dimension::FILTER, dimension::LENS, LIGHT] {
            let [first, second] = Pattern8::new(&keys, dimension).sample(&index);
            for (lane, index) in index.into_iter().enumerate() {
                assert_eq!(pair(keys[lane], index, dimension), [first[lane], second[lane]]);
            }
        }
    }

    /// Sobol's second dimension by its textbook recurrence (Bratley and Fox, 1988): v_j = v_{j-1} ^ v_{j-1}/2.
    fn sobol1(index: u32) -> u32 {
        let mut direction = 1u32 << 31;
        let mut x = 0;
        for bit in 0..32 {
            if index >> bit & 1 == 1 {
                x ^= direction;
            }
            direction ^= direction >> 1;
        }
        x
    }

    #[test]
    fn pascal_is_sobols_second_dimension() {
        for i in (0..5000).chain([u32::MAX, 0x8000_0001, 0x1234_5678]) {
            assert_eq!(pascal(i).reverse_bits(), sobol1(i), "{i}");
        }
    }

    /// Of 2^k samples exactly one lies in each elementary interval of area 2^-k.
    #[test]
    fn every_power_of_two_is_stratified() {
        for (pixel, dimension) in [(0, 0), (77, 1), (12_345, 9), (5, LIGHT)] {
            let key = pixel_key(3, pixel, 5);
            for k in 0..=8u32 {
                for columns in 0..=k {
                    let mut seen = vec![false; 1 << k];
                    for index in 0..1u32 << k {
                        let [x, y] = pair(key, index, dimension).map(u64::from);
                        let cell = (x << columns >> 32) << (k - columns) | (y << (k - columns) >> 32);
                        assert!(!std::mem::replace(&mut seen[cell as usize], true), "{k} {columns} {index}");
                    }
                }
            }
        }
    }

    /// Of 16 and of 256 samples one lies in each cell of a grid over pixel and light.
    #[test]
    fn pixel_and_light_are_stratified_together() {
        for (pixel, bits) in [(0, 1), (77, 1), (5, 2), (12_345, 2)] {
            let key = pixel_key(3, pixel, 5);
            let mut seen = vec![false; 1 << (4 * bits)];
            for index in 0..1 << (4 * bits) {
                let points = [pair(key, index, dimension::FILTER), pair(key, index, LIGHT)].concat();
                let cell = points.iter().fold(0, |cell, x| cell << bits | (x >> (32 - bits)) as usize);
                assert!(!std::mem::replace(&mut seen[cell], true), "{pixel} {bits} {index}");
            }
        }
    }

    #[test]
    fn pixels_and_dimensions_are_unlike() {
        let first = |key, dimension| pair(key, 0, dimension);
        assert_ne!(first(pixel_key(0, 0, 0), 0), first(pixel_key(0, 1, 0), 0));
        assert_ne!(first(pixel_key(0, 0, 0), 0), first(pixel_key(1, 0, 0), 0));
        assert_ne!(first(pixel_key(0, 0, 0), 0), first(pixel_key(0, 0, 0), 1));
    }
}
