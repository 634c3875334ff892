//! Light on hits that waits for its shadow rays: those of many waves are traced together, light by light, so that
//! rays that are close together can share a tile.

use super::direct::{Direct, Room, Samples};
use super::record::{RayKind, Record};
use super::wave::{Wave, Whose};
use crate::accel::{PACKETS, Tile};
use crate::lanes::{Float8, Mask8, RayPacket, Vec3x8, bits, float8};
use crate::shapes::RowRef;

/// Waves, and tiles of shadow rays, after which the rays are traced: more of them leave the caches.
const MOST_WAVES: usize = 64;
const MOST_TILES: usize = 128;

/// Light on some waves, by wave and in the order in which it is to be added up.
#[derive(Debug, Default)]
pub(super) struct Shadows {
    waves: Vec<Lit>,
    shares: Vec<Share>,
    /// By light.
    tiles: Vec<Tiles>,
}

/// Tiles of shadow rays, the first `used` of which are to be traced.
#[derive(Debug, Default)]
struct Tiles {
    tiles: Vec<Tile>,
    used: usize,
}

/// A wave, what reaches its samples without any light, and how many shares of lights there are up to here.
#[derive(Debug)]
struct Lit {
    whose: Whose,
    live: [u32; PACKETS],
    radiance: [Vec3x8; PACKETS],
    shares: usize,
}

/// What one light gives to the hits of a wave.
#[derive(Debug)]
pub(super) struct Share {
    pub light: usize,
    /// Packets with hits, a bit each.
    pub packets: u32,
    pub radiance: [Vec3x8; PACKETS],
    /// Lanes that it shines on, by packet.
    pub lit: [u32; PACKETS],
    /// Lanes whose shadow rays are traced, by packet.
    pub cast: [u32; PACKETS],
    /// Where they are among the tiles of the light.
    pub tile: Option<usize>,
}

impl Share {
    pub fn new(light: usize, packets: u32) -> Self {
        let (radiance, none) = ([Vec3x8::ZERO; PACKETS], [0; PACKETS]);
        Share { light, packets, radiance, lit: none, cast: none, tile: None }
    }
}

impl Shadows {
    /// Whether it is time to trace the rays.
    fn is_full(&self) -> bool {
        let tiles: usize = self.tiles.iter().map(|tiles| tiles.used).sum();
        self.waves.len() >= MOST_WAVES || tiles >= MOST_TILES
    }

    /// Takes a wave, all of whose shares of light have been added.
    pub fn end_wave(&mut self, wave: &Wave, live: [u32; PACKETS], radiance: [Vec3x8; PACKETS]) {
        self.waves.push(Lit { whose: wave.whose, live, radiance, shares: self.shares.len() });
    }

    /// Adds the share of a light.
    pub fn add(&mut self, share: Share) {
        self.shares.push(share);
    }

    /// Dead rays to be set, which are traced for a light, and their place.
    pub fn tile(&mut self, light: usize, common: Option<[f32; 3]>) -> (&mut Tile, usize) {
        if self.tiles.len() <= light {
            self.tiles.resize_with(light + 1, Tiles::default);
        }
        let Tiles { tiles, used } = &mut self.tiles[light];
        if *used == tiles.len() {
            tiles.push(Tile::empty());
        }
        let tile = &mut tiles[*used];
        tile.renew(common);
        tile.packets.fill(RayPacket::dead());
        *used += 1;
        (tile, *used - 1)
    }

    /// Adds up what is left of the light where its rays are known.
    fn add_up<R: Record>(&self, told: &[Vec<[RayPacket; PACKETS]>], samples: &mut Samples, record: &mut R) -> Counted {
        let (mut counted, mut first) = (Counted::default(), 0);
        for Lit { whose, live, radiance, shares } in &self.waves {
            let mut radiance = *radiance;
            for share in &self.shares[first..*shares] {
                let tile = share.tile.map(|tile| &self.tiles[share.light].tiles[tile]);
                for p in bits(share.packets) {
                    let cast = share.cast[p];
                    let bright = cast & tile.map_or(0, |tile| tile.packets[p].live().bits());
                    counted.rays += u64::from(cast.count_ones());
                    counted.dark += u64::from((cast & !bright).count_ones());
                    counted.packets += u64::from(cast != 0);
                    if R::ON {
                        let told = share.tile.map(|tile| &told[share.light][tile][p]);
                        share.tell(p, bright, told, whose, record);
                    }
                    let lit = Mask8::from_bits(share.lit[p] & (bright | !cast));
                    radiance[p] = Vec3x8::select(lit, radiance[p] + share.radiance[p], radiance[p]);
                }
            }
            samples.add(whose, live, &radiance);
            first = *shares;
        }
        counted
    }

    fn clear(&mut self) {
        self.waves.clear();
        self.shares.clear();
        self.tiles.iter_mut().for_each(|tiles| tiles.used = 0);
    }
}

/// Shadow rays, those that met something, and their packets.
#[derive(Default)]
struct Counted {
    rays: u64,
    dark: u64,
    packets: u64,
}

impl Share {
    fn tell<R: Record>(&self, p: usize, bright: u32, rays: Option<&RayPacket>, whose: &Whose, record: &mut R) {
        let (lit, cast) = (self.lit[p], self.cast[p]);
        for i in bits(lit & !cast) {
            record.lit(self.light, whose.slot(p, i), whose.path(p, i));
        }
        for (i, rays) in bits(lit & cast).zip(rays.into_iter().cycle()) {
            let dark = bright >> i & 1 == 0;
            record.shadow(self.light, rays.lane(i), dark, whose.slot(p, i), whose.path(p, i));
        }
    }
}

impl Direct<'_> {
    /// Traces the shadow rays that wait where there are enough of them, or a record wants to know of them.
    pub(super) fn settle_many<R: Record>(&self, room: &mut Room, record: &mut R) {
        if R::ON || record.counts_tiles() || room.shadows.is_full() {
            self.settle(room, record);
        }
    }

    /// Traces the shadow rays that wait, and adds the light to its samples.
    pub(super) fn settle<R: Record>(&self, room: &mut Room, record: &mut R) {
        let Room { shadows, walk, rays, samples, .. } = room;
        let packets = |Tiles { tiles, used }: &Tiles| tiles[..*used].iter().map(|tile| tile.packets).collect();
        let told = if R::ON { shadows.tiles.iter().map(packets).collect() } else { Vec::new() };
        let (kind, redecided) = (RayKind::Shadow as usize, walk.counts.redecided);
        for Tiles { tiles, used } in &mut shadows.tiles {
            self.tree.occluded_tiles(&mut tiles[..*used], walk);
        }
        let Counted { rays: all, dark, packets } = shadows.add_up(&told, samples, record);
        rays.redecided[kind] += walk.counts.redecided - redecided;
        rays.rays[kind] += all;
        rays.hits[kind] += dark;
        rays.packets[kind] += packets;
        shadows.clear();
    }
}

/// The rows that shadow rays cannot meet: those they leave from, or end on, from outside. All of them are convex, and the
/// rays stay clear of them by more than anything rounds by.
#[inline(always)]
pub(super) fn own(rows: Float8, front: Mask8) -> Float8 {
    let mut flat = 0;
    for (lane, row) in rows.to_array().into_iter().enumerate() {
        flat |= u32::from(RowRef::from_lane(row).is_flat()) << lane;
    }
    (front | Mask8::from_bits(flat)).select(rows, float8(RowRef::MISS.to_lane()))
}
