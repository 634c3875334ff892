//! Cryptomatte: names as floats, and which name is which.
//!
//! Source: Friedman and Jones, "Fully automatic ID mattes with support for motion blur and transparency",
//! SIGGRAPH talks, 2015; Psyop, "Cryptomatte specification", version 1.2.0.

use std::collections::{BTreeMap, HashSet};

use super::Channel;

/// One Cryptomatte among the channels of a picture, and its manifest.
///
/// Its channels are `NAME00.R` to `NAMEnn.A`: in layer n, R is the id of rank 2n and G its coverage, B the id of
/// rank 2n + 1 and A its coverage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cryptomatte {
    /// Type name and layer prefix: `crypto_object`. Holds no dot and ends in no digit.
    pub name: String,
    /// The names that are seen in the picture, with the bits of their ids.
    pub manifest: BTreeMap<String, u32>,
}

impl Cryptomatte {
    /// The id of a name: the bits of a finite float that is no denormal, hence safe in every program.
    pub fn id(name: &str) -> u32 {
        let hash = murmur3(name.as_bytes());
        match hash >> 23 & 255 {
            0 | 255 => hash ^ 1 << 23,
            _ => hash,
        }
    }

    /// The key of its metadata, `cryptomatte/KEY/name`: seven hexadecimal digits.
    pub fn key(&self) -> String {
        let digits = format!("{:08x}", murmur3(self.name.as_bytes()));
        digits[..7].to_owned()
    }

    /// Whether a channel is one of its own.
    pub fn owns(&self, channel: &Channel) -> bool {
        let rank = channel.layer().strip_prefix(&*self.name);
        rank.is_some_and(|rank| !rank.is_empty() && rank.bytes().all(|digit| digit.is_ascii_digit()))
    }

    /// The same with only the names that its channels among `channels` still hold.
    pub fn present(&self, channels: &[Channel]) -> Cryptomatte {
        let ids = |channel: &&Channel| channel.name.ends_with(".R") || channel.name.ends_with(".B");
        let seen: HashSet<u32> = channels
            .iter()
            .filter(|channel| self.owns(channel))
            .filter(ids)
            .flat_map(|channel| (0..channel.samples.len()).map(|i| channel.samples.bits(i)))
            .collect();
        let manifest = self.manifest.iter().filter(|(_, id)| seen.contains(id));
        Cryptomatte { name: self.name.clone(), manifest: manifest.map(|(name, id)| (name.clone(), *id)).collect() }
    }
}

/// MurmurHash3_x86_32 with seed 0.
///
/// Source: Appleby, "MurmurHash3", 2011, public domain: blocks of four bytes, then the rest, then a finish
/// that lets every bit of the input reach every bit of the output.
fn murmur3(bytes: &[u8]) -> u32 {
    let scramble = |block: u32| block.wrapping_mul(0xcc9e_2d51).rotate_left(15).wrapping_mul(0x1b87_3593);
    let (blocks, rest) = bytes.as_chunks::<4>();
    let mut hash = 0u32;
    for block in blocks {
        hash ^= scramble(u32::from_le_bytes(*block));
        hash = hash.rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64);
    }
    let rest = rest.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte));
    hash ^= scramble(rest) ^ bytes.len() as u32;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

#[cfg(test)]
mod tests {
    use super::super::Samples;
    use super::*;

    /// The vectors of the specification, and what its exponent rule is for.
    #[test]
    fn ids_are_those_of_the_specification() {
        assert_eq!(murmur3("torus".as_bytes()), 4_053_562_365);
        assert_eq!(murmur3("равнина".as_bytes()), 2_518_896_926);
        let ids = ["bunny", "default", "bunny_porcelain_mat"].map(Cryptomatte::id);
        assert_eq!(ids, [0x1385_1a76, 0x42c9_679f, 0xb24b_26d4]);
        let mut fixed = 0;
        for number in 0..2000 {
            let name = format!("object:{number}");
            let id = Cryptomatte::id(&name);
            assert!(f32::from_bits(id).is_normal(), "{name}");
            fixed += u32::from(id != murmur3(name.as_bytes()));
        }
        assert!((5..40).contains(&fixed), "{fixed} of 2000, 1 in 128 expected");
    }

    #[test]
    fn keys_are_those_of_the_specification() {
        let key = |name: &str| Cryptomatte { name: name.into(), manifest: BTreeMap::new() }.key();
        assert_eq!(key("crypto_object"), "f834d0a");
    }

    #[test]
    fn a_crop_keeps_the_names_that_it_shows() {
        let manifest = ["a", "b"].map(|name| (name.to_owned(), Cryptomatte::id(name))).into();
        let matte = Cryptomatte { name: "crypto_object".into(), manifest };
        let ids = vec![f32::from_bits(Cryptomatte::id("b")), 0.0];
        let channel = |name: &str| Channel { name: name.into(), samples: Samples::Float(ids.clone().into()) };
        let present = |name: &str| matte.present(&[channel(name)]).manifest.into_keys().collect::<Vec<_>>();
        assert_eq!(present("crypto_object00.R"), ["b"]);
        assert_eq!(present("crypto_object00.G"), Vec::<String>::new());
        assert_eq!(present("crypto_objects00.R"), Vec::<String>::new());
    }
}
