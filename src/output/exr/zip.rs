//! Chunks packed by zlib, as ZIPS and ZIP have them.
//!
//! The crate can do it too, at zlib's level 4 with a state of its own for each chunk. Level 1 of zlib-rs with one state
//! a thread takes a third of the time of level 4 for files that are 5 % longer, and two fifths of that of miniz_oxide at
//! level 1 for files that are 2 % shorter (128x128, lines of 3.3 KB: 1.9, 6.0 and 4.9 ms a picture).
//! Source: OpenEXR, `internal_zip.c`: bytes at even places, then those at odd ones; each as its difference from the one
//! before it, plus 128; then zlib; and as they were where that is no shorter.

use std::cell::RefCell;

use flate2::{Compress, Compression, FlushCompress, Status};

thread_local! {
    /// Of this thread: it takes as long to make as some lines to pack, and small pictures have not many.
    static OWN: RefCell<Packer> = RefCell::new(Packer::new());
}

/// The bytes of a chunk, little-endian, as the file holds them.
pub(super) fn pack(bytes: Vec<u8>) -> Vec<u8> {
    OWN.with_borrow_mut(|packer| packer.pack(bytes))
}

/// What a thread keeps from chunk to chunk.
struct Packer {
    zlib: Compress,
    sorted: Vec<u8>,
    packed: Vec<u8>,
}

impl Packer {
    fn new() -> Self {
        Packer { zlib: Compress::new(Compression::fast(), true), sorted: Vec::new(), packed: Vec::new() }
    }

    fn pack(&mut self, bytes: Vec<u8>) -> Vec<u8> {
        sort(&bytes, &mut self.sorted);
        self.zlib.reset();
        // No more than this is of use, and what stays is as long as it need be.
        self.packed.clear();
        self.packed.reserve(bytes.len());
        let ended = self.zlib.compress_vec(&self.sorted, &mut self.packed, FlushCompress::Finish);
        match ended {
            Ok(Status::StreamEnd) if self.packed.len() < bytes.len() => self.packed.clone(),
            _ => bytes,
        }
    }
}

/// Both steps before zlib.
fn sort(bytes: &[u8], sorted: &mut Vec<u8>) {
    sorted.clear();
    sorted.resize(bytes.len(), 0);
    let (even, odd) = sorted.split_at_mut(bytes.len().div_ceil(2));
    even.iter_mut().zip(bytes.iter().step_by(2)).for_each(|(place, byte)| *place = *byte);
    odd.iter_mut().zip(bytes.iter().skip(1).step_by(2)).for_each(|(place, byte)| *place = *byte);
    let mut before = sorted.first().copied().unwrap_or_default();
    for place in sorted.iter_mut().skip(1) {
        let byte = std::mem::replace(place, place.wrapping_sub(before).wrapping_add(128));
        before = byte;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_sorted_as_the_format_says() {
        let mut sorted = Vec::new();
        sort(&[10, 1, 12, 2, 9], &mut sorted);
        // 10 12 9 | 1 2 and their differences.
        assert_eq!(sorted, [10, 130, 125, 120, 129]);
        sort(&[], &mut sorted);
        assert!(sorted.is_empty());
    }

    #[test]
    fn what_does_not_shrink_stays_as_it_is() {
        let mut packer = Packer::new();
        let mut seed = 1u32;
        let noise = std::iter::repeat_with(|| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 24) as u8
        });
        let noise: Vec<u8> = noise.take(4000).collect();
        assert_eq!(packer.pack(noise.clone()), noise);
        let flat = packer.pack(vec![7; 4000]);
        assert!(flat.len() < 60 && packer.pack(vec![7; 4000]) == flat, "a state is as good as new: {}", flat.len());
        assert_eq!(packer.pack(vec![1, 2, 3]), [1, 2, 3]);
    }
}
