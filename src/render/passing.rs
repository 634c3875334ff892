//! Rows of a picture that are passed on as soon as all of their blocks are there.
//!
//! Only those rows take memory that are not whole yet, and what held rows that were passed on holds later ones: it is in
//! the caches, and the system has no new pages to clear.

use std::mem::replace;
use std::sync::{Arc, Mutex};

use super::gather::lock;
use super::layers::missed;
use crate::film::{Picture, Samples, Window};

/// The bands of a picture, from the top.
pub(super) struct Passing {
    /// The picture without a sample.
    picture: Picture,
    rows: i32,
    bands: Vec<Mutex<Passage>>,
    spare: Mutex<Vec<Picture>>,
}

/// A band that is whole.
pub(super) struct Whole {
    band: usize,
    rows: Arc<Picture>,
}

/// What became of a band.
enum Passage {
    /// No block is there.
    Empty,
    /// Some windows of it are there; elsewhere it holds anything.
    Open(Picture, Vec<Window>),
    /// All of it is there and about to be taken.
    Whole(Arc<Picture>),
    /// It was taken.
    Passed,
}

impl Passing {
    /// The picture in bands of so many rows, counted from the first one.
    pub fn new(picture: &Picture, rows: i32) -> Self {
        let picture = picture.hollow();
        let count = picture.window.height().div_ceil(rows as usize);
        let bands = (0..count).map(|_| Mutex::new(Passage::Empty)).collect();
        Passing { picture, rows, bands, spare: Mutex::default() }
    }

    /// Puts the pixels of a window and their channels where they belong: the rows that are whole by that, to be passed on.
    pub fn put(&self, window: Window, pixels: &[[f32; 4]], channels: &[Samples]) -> Vec<Whole> {
        let number = |y: i32| ((y - self.picture.window.y0) / self.rows) as usize;
        let bands = number(window.y0)..=number(window.y1 - 1);
        bands.filter_map(|band| self.put_in(band, window, pixels, channels)).collect()
    }

    /// Passes rows on, and takes back what held them.
    pub fn pass(&self, Whole { band, rows }: Whole, to: impl FnOnce(&Picture)) {
        to(&rows);
        *lock(&self.bands[band]) = Passage::Passed;
        lock(&self.spare).extend(Arc::into_inner(rows));
    }

    /// Puts what lies in a band there: the band, if it is whole by that.
    fn put_in(&self, band: usize, window: Window, pixels: &[[f32; 4]], channels: &[Samples]) -> Option<Whole> {
        let mut passage = lock(&self.bands[band]);
        if let Passage::Empty = *passage {
            *passage = Passage::Open(self.room(self.window(band)), Vec::new());
        }
        let Passage::Open(picture, there) = &mut *passage else { return None };
        picture.band().put(window, pixels, channels);
        there.push(Window { y0: window.y0.max(picture.window.y0), y1: window.y1.min(picture.window.y1), ..window });
        if there.iter().map(Window::area).sum::<usize>() < picture.window.area() {
            return None;
        }
        let Passage::Open(picture, _) = replace(&mut *passage, Passage::Passed) else { return None };
        let rows = Arc::new(picture);
        *passage = Passage::Whole(Arc::clone(&rows));
        Some(Whole { band, rows })
    }

    /// Copies of all rows that were not taken yet, band by band: nothing is seen where no block is there.
    pub fn waiting(&self) -> impl Iterator<Item = Picture> {
        (0..self.bands.len()).filter_map(|band| match &*lock(&self.bands[band]) {
            Passage::Empty => Some(missed(&self.picture, self.window(band))),
            Passage::Open(picture, there) => {
                let mut copy = missed(&self.picture, picture.window);
                there.iter().filter_map(|window| picture.crop(*window)).for_each(|part| copy.put(part));
                Some(copy)
            }
            Passage::Whole(picture) => Some(Picture::clone(picture)),
            Passage::Passed => None,
        })
    }

    fn window(&self, band: usize) -> Window {
        let all = self.picture.window;
        let y0 = all.y0 + band as i32 * self.rows;
        Window { y0, y1: all.y1.min(y0.saturating_add(self.rows)), ..all }
    }

    /// Room for a band that may hold anything.
    fn room(&self, window: Window) -> Picture {
        let mut spare = lock(&self.spare);
        let found = spare.iter().position(|picture| picture.window.area() == window.area());
        match found {
            Some(place) => Picture { window, ..spare.swap_remove(place) },
            None => missed(&self.picture, window),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::Channel;

    /// Bands are passed on once, each when its last block came, and put together they are the picture; what waits is what
    /// was put and not passed on.
    #[test]
    fn bands_are_passed_on_when_they_are_whole() {
        let window = Window { x0: -3, y0: 5, x1: 18, y1: 61 };
        let mut whole = Picture::new((16, 64), window);
        whole.pixels.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = [i as f32 + 1.0; 4]);
        let numbers = Samples::Uint((1..=window.area() as u32).collect());
        whole.channels.push(Channel { name: "id.object".into(), samples: numbers });
        let passed = Mutex::new(Vec::<Picture>::new());
        let passing = Passing::new(&whole, 16);
        let (mut put, mut count) = (Vec::new(), 0);
        for (y0, y1) in [(32, 61), (5, 20), (20, 32)] {
            for (x0, x1) in [(8, 18), (-3, 8)] {
                let part = whole.crop(Window { x0, y0, x1, y1 }).unwrap();
                let channels: Vec<Samples> = part.channels.into_iter().map(|channel| channel.samples).collect();
                let whole = passing.put(part.window, &part.pixels, &channels);
                whole.into_iter().for_each(|rows| passing.pass(rows, |rows| lock(&passed).push(rows.clone())));
                put.push(part.window);
                let mut made = missed(&passing.picture, window);
                let waiting: Vec<Picture> = passing.waiting().collect();
                for rows in lock(&passed).iter().chain(&waiting) {
                    let channels: Vec<Samples> = rows.channels.iter().map(|channel| channel.samples.clone()).collect();
                    made.band().put(rows.window, &rows.pixels, &channels);
                }
                for index in 0..window.area() {
                    let (x, y) = window.pixel(index);
                    let there = put.iter().any(|window| window.index(x, y).is_some());
                    let want = if there { index as u32 + 1 } else { 0 };
                    assert_eq!((made.pixels[index][3], made.channels[0].samples.bits(index)), (want as f32, want));
                }
            }
            count = [2, 2, 4][put.len() / 2 - 1].max(count);
            assert_eq!(lock(&passed).len(), count);
        }
        let mut tops: Vec<i32> = lock(&passed).iter().map(|rows| rows.window.y0).collect();
        tops.sort_unstable();
        assert_eq!((tops, passing.waiting().count()), (vec![5, 21, 37, 53], 0));
    }
}
