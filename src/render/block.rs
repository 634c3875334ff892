//! The unit of scheduling: a small square of pixels, all of their samples.

use std::ops::Range;

use crate::accel::PACKETS;
use crate::film::{Picture, Window};
use crate::integrate::{CameraRays, Direct, PixelPattern, RayKind, Record, Room, Samples, Samples8, Wave};
use crate::lanes::LANES;

/// Pixels along an edge.
const EDGE: i32 = 32;

/// A square of pixels that one thread renders.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    pub window: Window,
}

/// What a block came to.
#[derive(Debug)]
pub struct BlockWork {
    /// Row by row.
    pub pixels: Vec<[f32; 4]>,
    pub room: Room,
    pub tiles: u64,
    pub background_tiles: u64,
}

impl Block {
    pub fn new(window: Window) -> Self {
        Block { window }
    }

    /// Blocks that cover a window, on the display window's own grid.
    pub fn cover(window: Window) -> Vec<Block> {
        let starts = |from: i32, to: i32| (from.div_euclid(EDGE)..=(to - 1).div_euclid(EDGE)).map(|i| i * EDGE);
        let block = |x: i32, y: i32| Window {
            x0: x.max(window.x0),
            y0: y.max(window.y0),
            x1: (x + EDGE).min(window.x1),
            y1: (y + EDGE).min(window.y1),
        };
        let row = |y| starts(window.x0, window.x1).map(move |x| Block::new(block(x, y)));
        starts(window.y0, window.y1).flat_map(row).collect()
    }

    /// All samples of all pixels: pixels along a Z curve, the samples of one after another, 64 at a time.
    /// So a tile is as square as the number of samples allows, and each pixel sums in sample order.
    pub fn trace<R: Record>(&self, rays: &CameraRays, direct: &Direct, spp: u32, record: &mut R) -> BlockWork {
        let window = self.window;
        let mut room = Room::default();
        let mut sums = vec![[0f64; 4]; window.area()];
        let (mut tiles, mut background_tiles) = (0, 0);
        let mut pending = Pending::default();
        let mut flush = |pending: &mut Pending, room: &mut Room| {
            if R::ON {
                record.tile(&mut pending.samples());
            }
            let met = room.rays.hits[RayKind::Camera as usize];
            let samples = direct.radiance(pending.wave(rays, direct.scatters(), room), room, record);
            pending.add_to(&samples, &mut sums);
            tiles += 1;
            background_tiles += u64::from(room.rays.hits[RayKind::Camera as usize] == met);
            pending.clear();
        };
        for code in 0..(EDGE * EDGE) as u32 {
            let (x, y) = (window.x0 + compact(code), window.y0 + compact(code >> 1));
            let Some(index) = window.index(x, y) else { continue };
            let pattern = rays.pattern(x, y);
            let mut sample = 0;
            while sample < spp {
                sample = pending.push((x, y), pattern, sample..spp, index);
                if pending.count == PACKETS * LANES {
                    flush(&mut pending, &mut room);
                }
            }
        }
        if pending.count > 0 {
            flush(&mut pending, &mut room);
        }
        let share = 1.0 / f64::from(spp);
        let pixels = sums.into_iter().map(|sum| sum.map(|x| (x * share) as f32)).collect();
        BlockWork { pixels, room, tiles, background_tiles }
    }

    /// Puts the pixels where they belong.
    pub fn copy_to(&self, pixels: &[[f32; 4]], picture: &mut Picture) {
        for (row, y) in pixels.chunks(self.window.width()).zip(self.window.y0..) {
            if let Some(start) = picture.window.index(self.window.x0, y) {
                picture.pixels[start..start + row.len()].copy_from_slice(row);
            }
        }
    }
}

/// Samples that wait for their tile to fill.
#[derive(Default)]
struct Pending {
    samples: [Samples8; PACKETS],
    pixels: [[u32; LANES]; PACKETS],
    count: usize,
}

impl Pending {
    /// Adds samples of a pixel as far as their packet has room: the first one that is left.
    #[inline(always)]
    fn push(&mut self, place: (i32, i32), pattern: PixelPattern, samples: Range<u32>, pixel: usize) -> u32 {
        let (p, lane) = (self.count / LANES, self.count % LANES);
        let count = LANES.min(lane + samples.len()) - lane;
        for (lane, sample) in (lane..lane + count).zip(samples.start..) {
            self.samples[p].set(lane, place, pattern, sample);
            self.pixels[p][lane] = pixel as u32;
        }
        self.count += count;
        samples.start + count as u32
    }

    fn clear(&mut self) {
        self.count = 0;
    }

    fn samples(&self) -> impl Iterator<Item = (i32, i32, u32)> {
        let lane = |k: usize| (&self.samples[k / LANES], k % LANES);
        (0..self.count).map(lane).map(|(samples, i)| (samples.x[i], samples.y[i], samples.index[i]))
    }

    fn wave(&self, rays: &CameraRays, keep_exact: bool, room: &mut Room) -> Wave {
        let count = |p: usize| self.count.saturating_sub(p * LANES).min(LANES);
        let mut wave = Wave::camera(room.tile(rays.common_origin()), keep_exact);
        for (p, samples) in self.samples.iter().enumerate() {
            let exact = rays.exact(samples);
            wave.tile.packets[p] = rays.packet(&exact, count(p));
            if let Some(kept) = &mut wave.exact {
                kept[p] = exact;
            }
        }
        wave
    }

    fn add_to(&self, samples: &Samples, sums: &mut [[f64; 4]]) {
        for p in 0..self.count.div_ceil(LANES) {
            let (colors, alphas) = (samples.radiance[p].to_arrays(), samples.alpha[p].to_array());
            for i in 0..LANES.min(self.count - p * LANES) {
                let [r, g, b] = colors[i].map(f64::from);
                let sum = &mut sums[self.pixels[p][i] as usize];
                *sum = [sum[0] + r, sum[1] + g, sum[2] + b, sum[3] + f64::from(alphas[i])];
            }
        }
    }
}

/// The even bits of a number, side by side.
fn compact(code: u32) -> i32 {
    let mut x = code & 0x5555_5555;
    x = (x | x >> 1) & 0x3333_3333;
    x = (x | x >> 2) & 0x0f0f_0f0f;
    x = (x | x >> 4) & 0x00ff_00ff;
    ((x | x >> 8) & 0x0000_ffff) as i32
}
