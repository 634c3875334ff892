//! The unit of scheduling: a small square of pixels, all of their samples.

use std::mem::take;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::adaptive::{Cells, Effort, Noise, Sums};
use super::coverage::Coverage;
use super::layers::LayerWork;
use crate::accel::{Counts, PACKETS};
use crate::film::Window;
use crate::integrate::{
    CameraRays, Direct, PixelPattern, RayCounts, RayKind, Record, Room, Samples, Samples8, Spent, Summed, Taken, WAVE,
    Wave,
};
use crate::lanes::{LANES, Vec3x8};
use crate::plan::{LeftOut, Skip};

/// Pixels along an edge.
pub const EDGE: i32 = 32;
/// Pixels along an edge of the tiles that are sampled to a noise level, and of their cells.
const TILE: i32 = 64;
const CELL: i32 = 8;

/// A square of pixels that one thread renders, or the part of it that lies in the picture.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    pub window: Window,
    edge: i32,
}

/// What a block came to.
#[derive(Debug)]
pub struct BlockWork {
    /// Row by row.
    pub pixels: Vec<[f32; 4]>,
    /// Layers beside the colour, where any are asked for.
    pub layers: Option<LayerWork>,
    pub rays: RayCounts,
    pub tests: Counts,
    pub left_out: LeftOut,
    pub tiles: u64,
    pub background_tiles: u64,
    /// What was spent on its square to reach a noise level.
    pub effort: Option<Effort>,
}

impl BlockWork {
    /// Adds the counts of more work on the same block.
    pub fn absorb(&mut self, more: &BlockWork) {
        self.rays.add(&more.rays);
        self.tests.add(&more.tests);
        self.left_out.add(&more.left_out);
        self.tiles += more.tiles;
        self.background_tiles += more.background_tiles;
    }
}

/// After so many camera tiles is asked whether to stop: a few milliseconds, however many samples a pixel has.
const ASK_AFTER: u64 = 64;
/// Camera tiles that are traced before all that goes on from them, so that the tiles of that are full.
const BATCH: usize = 64;

impl Block {
    pub fn new(window: Window) -> Self {
        Block { window, edge: EDGE }
    }

    /// Blocks that cover a window, on the display window's own grid.
    pub fn cover(window: Window) -> Vec<Block> {
        Block::squares(window, EDGE)
    }

    /// Tiles to be sampled to a noise level that cover a window, on the display window's own grid.
    pub fn tiles(window: Window) -> Vec<Block> {
        Block::squares(window, TILE)
    }

    fn squares(window: Window, edge: i32) -> Vec<Block> {
        let starts = |from: i32, to: i32| (from.div_euclid(edge)..=(to - 1).div_euclid(edge)).map(move |i| i * edge);
        let part = |x: i32, y: i32| Window {
            x0: x.max(window.x0),
            y0: y.max(window.y0),
            x1: (x + edge).min(window.x1),
            y1: (y + edge).min(window.y1),
        };
        let row = |y| starts(window.x0, window.x1).map(move |x| Block { window: part(x, y), edge });
        starts(window.y0, window.y1).flat_map(row).collect()
    }

    /// The cells of a tile, and their pixels.
    pub fn cells(&self) -> (Vec<Block>, Cells) {
        let cells = Block::squares(self.window, CELL);
        let pixels = |cell: &Block| {
            let places = (0..cell.window.area()).map(|index| cell.window.pixel(index));
            places.filter_map(|(x, y)| self.window.index(x, y)).collect()
        };
        let pixels = cells.iter().map(pixels).collect();
        (cells, Cells { columns: self.window.width() / CELL as usize, pixels })
    }

    /// The whole square of the grid that it is a part of.
    pub fn whole(&self) -> Block {
        let Block { window, edge } = *self;
        let (x0, y0) = (window.x0.div_euclid(edge) * edge, window.y0.div_euclid(edge) * edge);
        Block { window: Window { x0, y0, x1: x0 + edge, y1: y0 + edge }, edge }
    }

    /// The smallest window of whole tiles, and so of whole blocks, around another.
    pub fn hull(window: Window) -> Window {
        let [low, high] = [|at: i32| at.div_euclid(TILE) * TILE, |at: i32| -(-at).div_euclid(TILE) * TILE];
        Window { x0: low(window.x0), y0: low(window.y0), x1: high(window.x1), y1: high(window.y1) }
    }

    /// Some samples of all pixels, and their means: pixels along a Z curve, the samples of one after another, 64 at a time.
    /// So a tile is as square as the number of samples allows, and each pixel sums in sample order.
    /// `None` where `stop` asked for that within.
    pub fn trace<R: Record>(
        &self,
        view: &View,
        direct: &Direct,
        range: Range<u32>,
        record: &mut R,
        stop: impl Fn() -> bool,
    ) -> Option<BlockWork> {
        let (mut sums, share) = (vec![[0.0; 4]; self.window.area()], 1.0 / range.len() as f64);
        let mut work = self.add((&mut sums, self.window), (view, direct), range, record, stop)?;
        work.pixels = sums.into_iter().map(|sum| sum.map(|x| (x * share) as f32)).collect();
        Some(work)
    }

    /// The same, added to the sums of a frame around it; without means.
    fn add<R: Record>(
        &self,
        (sums, frame): (&mut [[f64; 4]], Window),
        (view, direct): (&View, &Direct),
        range: Range<u32>,
        record: &mut R,
        stop: impl Fn() -> bool,
    ) -> Option<BlockWork> {
        let (window, View { rays, coverage, rooms }) = (self.window, *view);
        let may_pass = coverage.is_some() && record.passes_blanks();
        let blank = if may_pass { direct.blank() } else { None };
        let before = (Counts::default(), RayCounts::default());
        let room = rooms.take();
        let mut work = Work { rays, direct, record, sums, room, before, tiles: 0, background_tiles: 0 };
        let draws = R::ON || rays.draws() || direct.draws();
        let (mut batch, mut blank_samples) = (Batch::default(), 0);
        let edge = window.width().max(window.height()).next_power_of_two() as u32;
        let mut code = 0;
        while code < edge * edge {
            let (x, y) = (window.x0 + compact(code), window.y0 + compact(code >> 1));
            if range.len() == 1
                && code % LANES as u32 == 0
                && batch.count % LANES == 0
                && let Some(first) = whole_packet(window, frame, (x, y))
                && coverage.is_none_or(|coverage| coverage.sees_packet(x, y))
            {
                batch.sees = true;
                let pattern = draws.then_some(|x, y| rays.pattern(x, y));
                batch.push_pixels((x, y), pattern, range.start, (first, frame.width()));
                if batch.count == WAVE {
                    work.tile(&mut batch);
                    if work.tiles.is_multiple_of(ASK_AFTER) && stop() {
                        return None;
                    }
                    batch.sees = false;
                }
                code += LANES as u32;
                continue;
            }
            code += 1;
            let Some(index) = window.index(x, y).and_then(|_| frame.index(x, y)) else { continue };
            let sees = coverage.is_none_or(|coverage| coverage.sees(x, y));
            if let (false, Some(blank)) = (sees, &blank) {
                // So many equal numbers of 24 bits sum up exactly.
                let (sum, count) = (&mut work.sums[index], range.len() as f64);
                (0..4).for_each(|k| sum[k] += f64::from(blank[k]) * count);
                blank_samples += range.len() as u64;
                continue;
            }
            batch.sees |= sees;
            let pattern = if draws { rays.pattern(x, y) } else { PixelPattern::default() };
            let mut sample = range.start;
            while sample < range.end {
                sample = batch.push((x, y), pattern, sample..range.end, index);
                if batch.count == WAVE {
                    work.tile(&mut batch);
                    if work.tiles.is_multiple_of(ASK_AFTER) && stop() {
                        return None;
                    }
                    batch.sees = sees && sample < range.end;
                }
            }
        }
        work.tile(&mut batch);
        work.finish(&mut batch);
        let blank_tiles = blank_samples.div_ceil(WAVE as u64);
        let (tiles, background_tiles) = (work.tiles + blank_tiles, work.background_tiles + blank_tiles);
        let (mut room, pixels) = (work.room, Vec::new());
        let (tests, rays) = (take(&mut room.walk.counts), take(&mut room.rays));
        let mut left_out = take(&mut room.left_out);
        rooms.give(room);
        left_out[Skip::Background] += blank_samples;
        Some(BlockWork { pixels, layers: None, rays, tests, left_out, tiles, background_tiles, effort: None })
    }

    /// Where the rows of this part of a whole square are among its pixels.
    fn rows_in(&self, whole: &Block) -> Vec<Range<usize>> {
        let row = |y| whole.window.index(self.window.x0, y).map(|start| start..start + self.window.width());
        (self.window.y0..self.window.y1).filter_map(row).collect()
    }

    /// Those of the pixels of a whole square that lie in this part of it.
    pub fn part<T: Copy>(&self, whole: &Block, pixels: &[T]) -> Vec<T> {
        self.rows_in(whole).into_iter().flat_map(|row| &pixels[row]).copied().collect()
    }

    /// The square that it is a part of, sampled until it is good enough, while a record looks on; all is of that square.
    pub fn trace_until<R: Record>(
        &self,
        noise: &Noise,
        view: &View,
        direct: &Direct,
        record: &mut R,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Option<BlockWork> {
        let whole = self.whole();
        let (cells, pixels) = whole.cells();
        let mut all: Option<BlockWork> = None;
        let draw = |cell: usize, sums: &mut Sums, range: Range<u32>| {
            let work = cells[cell].add((sums, whole.window), (view, direct), range, record, stop)?;
            match &mut all {
                None => all = Some(work),
                Some(all) => all.absorb(&work),
            }
            Some(())
        };
        let (pixels, effort) = noise.sample(&pixels, draw)?;
        all.map(|work| BlockWork { pixels, effort: Some(effort), ..work })
    }

    /// The part of a block's pixels and layers that lies in this one.
    pub fn cut(&self, whole: &Block, work: &mut BlockWork) {
        work.pixels = self.part(whole, &work.pixels);
        if let Some(layers) = &mut work.layers {
            let rows = self.rows_in(whole);
            layers.channels.iter_mut().for_each(|samples| *samples = samples.rows(&rows));
        }
    }
}

/// What all blocks of a picture have in common.
#[derive(Clone, Copy)]
pub struct View<'a> {
    pub rays: &'a CameraRays,
    /// What of the picture may see anything; without, all of it.
    pub coverage: Option<&'a Coverage>,
    /// Room for the work.
    pub rooms: &'a Rooms,
}

/// Room for work on blocks: a thread takes one and brings it back, which is cheaper than making one for each block.
#[derive(Debug, Default)]
pub struct Rooms(Mutex<Vec<Room>>);

impl Rooms {
    fn take(&self) -> Room {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default()
    }

    fn give(&self, room: Room) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(room);
    }
}

/// Work on a block.
struct Work<'a, 's, R: Record> {
    rays: &'a CameraRays,
    direct: &'a Direct<'s>,
    record: &'a mut R,
    sums: &'a mut [[f64; 4]],
    room: Room,
    /// Tests and rays that a record was told of already.
    before: (Counts, RayCounts),
    tiles: u64,
    background_tiles: u64,
}

/// Samples that wait for their tile to fill, and the pixels of all samples of the tiles before.
#[derive(Default)]
struct Batch {
    samples: [Samples8; PACKETS],
    count: usize,
    pixels: Vec<[u32; LANES]>,
    /// Samples with a tile of their own already.
    traced: usize,
    /// Squares of the waiting samples' distances from the centres of their pixels, where a record wants them.
    distances: [[f64; LANES]; PACKETS],
    /// Waiting packets that are one sample of each of 4 x 2 pixels, a bit each.
    squares: u32,
    /// Whether the samples that wait may see anything but the background.
    sees: bool,
}

impl<R: Record> Work<'_, '_, R> {
    /// Traces the samples that wait, and after some tiles what goes on from them.
    fn tile(&mut self, batch: &mut Batch) {
        if batch.count == 0 {
            return;
        }
        if R::ON {
            self.record.tile(batch.traced, &mut batch.samples());
        }
        let met = self.room.rays.hits[RayKind::Camera as usize];
        batch.fill::<R>(self.room.camera_wave(self.rays.common_origin()), self.rays, self.direct.goes_on());
        if self.direct.draws() {
            self.room.seeds.extend(batch.samples);
        }
        if R::SURFACES {
            let Batch { samples, count, pixels, traced, distances, squares, .. } = &*batch;
            let pixels = &pixels[traced / LANES..];
            self.record.taken(&Taken { count: *count, samples, pixels, distances, squares: *squares });
        }
        self.direct.trace_camera(batch.sees, &mut self.room, self.record);
        if R::SURFACES {
            self.tell_cost(batch.count, &batch.pixels[batch.traced / LANES..]);
        }
        self.tiles += 1;
        self.background_tiles += u64::from(self.room.rays.hits[RayKind::Camera as usize] == met);
        batch.traced += batch.count;
        (batch.count, batch.squares) = (0, 0);
        if batch.traced == BATCH * WAVE {
            self.finish(batch);
        }
    }

    /// Tells of the tests and rays since the last time.
    fn tell_cost(&mut self, count: usize, pixels: &[[u32; LANES]]) {
        if count > 0 && self.record.counts_tiles() {
            let now = (self.room.walk.counts, self.room.rays);
            let before = std::mem::replace(&mut self.before, now);
            let (tests, rays) = (now.0.since(&before.0), now.1.since(&before.1));
            self.record.spent(&Spent { count, pixels, tests, rays });
        }
    }

    /// Traces what goes on and adds the samples to their pixels.
    fn finish(&mut self, batch: &mut Batch) {
        self.direct.finish(&mut self.room, self.record);
        batch.add_to(&self.room.samples, self.sums);
        if R::SURFACES {
            let (count, pixels, samples) = (batch.traced, &batch.pixels[..], &self.room.samples);
            self.record.summed(&Summed { count, pixels, samples });
            self.tell_cost(count, pixels);
        }
        self.room.begin();
        (batch.traced, batch.count) = (0, 0);
        batch.pixels.clear();
    }
}

impl Batch {
    /// Adds samples of a pixel as far as their packet has room: the first one that is left.
    #[inline(always)]
    fn push(&mut self, place: (i32, i32), pattern: PixelPattern, samples: Range<u32>, pixel: usize) -> u32 {
        let (p, lane) = (self.count / LANES, self.count % LANES);
        if lane == 0 {
            self.pixels.push([pixel as u32; LANES]);
        }
        let Some(pixels) = self.pixels.last_mut() else { return samples.end };
        let count = LANES.min(lane + samples.len()) - lane;
        if count == LANES {
            self.samples[p].set_all(place, pattern, samples.start);
        } else {
            for (lane, sample) in (lane..lane + count).zip(samples.start..) {
                self.samples[p].set(lane, place, pattern, sample);
                pixels[lane] = pixel as u32;
            }
        }
        self.count += count;
        samples.start + count as u32
    }

    /// Adds one sample of each of the eight pixels of a packet, whose first one is at `place`, and at `first` among the
    /// pixels of a frame of this width. No packet may be begun; without `pattern` nothing is drawn.
    #[inline(always)]
    fn push_pixels(
        &mut self,
        (x, y): (i32, i32),
        pattern: Option<impl Fn(i32, i32) -> PixelPattern>,
        sample: u32,
        (first, width): (usize, usize),
    ) {
        let samples = &mut self.samples[self.count / LANES];
        samples.x = PACKET.map(|(right, _)| x + right);
        samples.y = PACKET.map(|(_, down)| y + down);
        samples.index = [sample; LANES];
        if let Some(pattern) = pattern {
            for lane in 0..LANES {
                samples.set_pattern(lane, pattern(samples.x[lane], samples.y[lane]));
            }
        }
        self.pixels.push(PACKET.map(|(right, down)| (first + down as usize * width + right as usize) as u32));
        self.squares |= 1 << (self.count / LANES);
        self.count += LANES;
    }

    fn samples(&self) -> impl Iterator<Item = (i32, i32, u32)> {
        let lane = |k: usize| (&self.samples[k / LANES], k % LANES);
        (0..self.count).map(lane).map(|(samples, i)| (samples.x[i], samples.y[i], samples.index[i]))
    }

    fn fill<R: Record>(&mut self, wave: &mut Wave, rays: &CameraRays, keep_exact: bool) {
        let all = self.count;
        let count = |p: usize| all.saturating_sub(p * LANES).min(LANES);
        for (p, samples) in self.samples.iter().enumerate() {
            let offsets = rays.offsets(samples);
            // Others are the centres themselves.
            if R::SURFACES && rays.spreads() {
                let [right, down] = &offsets;
                self.distances[p] = std::array::from_fn(|i| right[i] * right[i] + down[i] * down[i]);
            }
            let exact = &mut wave.tile.exact_mut()[p];
            rays.set_exact(samples, &samples.points(&offsets), exact);
            if keep_exact {
                wave.exact[p] = *exact;
            }
            let packet = rays.packet(exact, count(p));
            wave.tile.packets[p] = packet;
        }
    }

    fn add_to(&self, samples: &Samples, sums: &mut [[f64; 4]]) {
        for (p, pixels) in self.pixels.iter().enumerate() {
            let Vec3x8 { x, y, z } = samples.radiance[p];
            let columns = [x, y, z, samples.alpha[p]].map(|column| column.to_array());
            let count = LANES.min(self.traced - p * LANES);
            if count == LANES && *pixels == [pixels[0]; LANES] {
                let sum = &mut sums[pixels[0] as usize];
                for k in 0..4 {
                    sum[k] = columns[k].iter().fold(sum[k], |sum, x| sum + f64::from(*x));
                }
                continue;
            }
            for (i, pixel) in pixels.iter().enumerate().take(count) {
                let sum = &mut sums[*pixel as usize];
                (0..4).for_each(|k| sum[k] += f64::from(columns[k][i]));
            }
        }
    }
}

/// The pixels of a packet, row by row: 4 x 2, which a Z curve meets one after another.
const PACKET: [(i32, i32); LANES] = [(0, 0), (1, 0), (2, 0), (3, 0), (0, 1), (1, 1), (2, 1), (3, 1)];

/// Where the first pixel of a packet is in a frame, if all of the packet lies in the window.
fn whole_packet(window: Window, frame: Window, (x, y): (i32, i32)) -> Option<usize> {
    window.index(x + 3, y + 1).and_then(|_| frame.index(x, y))
}

/// The even bits of a number, side by side.
fn compact(code: u32) -> i32 {
    let mut x = code & 0x5555_5555;
    x = (x | x >> 1) & 0x3333_3333;
    x = (x | x >> 2) & 0x0f0f_0f0f;
    x = (x | x >> 4) & 0x00ff_00ff;
    ((x | x >> 8) & 0x0000_ffff) as i32
}
