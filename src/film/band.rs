//! A picture in strips, which can be filled at the same time.

use std::mem::take;

use half::f16;

use super::{Picture, Samples, Window};

/// Some rows of a picture, all of its width, to write in.
#[derive(Debug)]
pub struct Band<'p> {
    /// The pixels that it has.
    window: Window,
    pixels: &'p mut [[f32; 4]],
    /// In the order of the picture's.
    channels: Vec<Strip<'p>>,
}

/// Samples of one channel in a band.
#[derive(Debug)]
enum Strip<'p> {
    Halves(&'p mut [f16]),
    Floats(&'p mut [f32]),
    Uint(&'p mut [u32]),
}

impl Picture {
    /// All of the picture in bands of so many rows, those of the display window's own grid: the band of row `y` is the one
    /// of the number `y.div_euclid(rows)`, counted from that of the first row.
    pub fn bands(&mut self, rows: i32) -> Vec<Band<'_>> {
        let (all, mut pixels) = (self.window, &mut self.pixels[..]);
        let mut channels: Vec<Strip<'_>> =
            self.channels.iter_mut().map(|channel| Strip::of(&mut channel.samples)).collect();
        let (mut bands, mut y0) = (Vec::new(), all.y0);
        while y0 < all.y1 {
            let y1 = ((y0.div_euclid(rows) + 1) * rows).min(all.y1);
            let window = Window { y0, y1, ..all };
            let (own, rest) = take(&mut pixels).split_at_mut(window.area());
            let channels = channels.iter_mut().map(|strip| strip.split_off(window.area())).collect();
            bands.push(Band { window, pixels: own, channels });
            (pixels, y0) = (rest, y1);
        }
        bands
    }

    /// Puts a part with the same channels where it belongs.
    pub fn put(&mut self, part: Picture) {
        let samples: Vec<Samples> = part.channels.into_iter().map(|channel| channel.samples).collect();
        self.band().put(part.window, &part.pixels, &samples);
    }

    /// All of the picture as one band.
    pub fn band(&mut self) -> Band<'_> {
        let channels = self.channels.iter_mut().map(|channel| Strip::of(&mut channel.samples)).collect();
        Band { window: self.window, pixels: &mut self.pixels, channels }
    }
}

impl Band<'_> {
    /// Puts the pixels of a window and their channels, as many as the picture has or none, where they belong. What lies
    /// beyond the band is left out.
    pub fn put(&mut self, window: Window, pixels: &[[f32; 4]], channels: &[Samples]) {
        let width = window.width();
        for (row, y) in (window.y0..window.y1).enumerate() {
            let Some(start) = self.window.index(window.x0, y) else { continue };
            let (to, from) = (start..start + width, row * width..(row + 1) * width);
            self.pixels[to].copy_from_slice(&pixels[from]);
        }
        // Channel by channel: each has pages of its own.
        for (strip, samples) in self.channels.iter_mut().zip(channels) {
            for (row, y) in (window.y0..window.y1).enumerate() {
                let Some(start) = self.window.index(window.x0, y) else { continue };
                let (to, from) = (start..start + width, row * width..(row + 1) * width);
                match (&mut *strip, samples) {
                    (Strip::Halves(own), Samples::Half(more)) => own[to].copy_from_slice(&more[from]),
                    (Strip::Floats(own), Samples::Unrounded(more) | Samples::Float(more)) => {
                        own[to].copy_from_slice(&more[from]);
                    }
                    (Strip::Uint(own), Samples::Uint(more)) => own[to].copy_from_slice(&more[from]),
                    _ => {}
                }
            }
        }
    }

    /// Copies all of it into a picture of the same window and channels.
    pub fn copy_to(&self, picture: &mut Picture) {
        let Some(start) = picture.window.index(self.window.x0, self.window.y0) else { return };
        let place = start..start + self.window.area();
        picture.pixels[place.clone()].copy_from_slice(self.pixels);
        for (own, channel) in self.channels.iter().zip(&mut picture.channels) {
            match (own, &mut channel.samples) {
                (Strip::Halves(own), Samples::Half(to)) => to[place.clone()].copy_from_slice(own),
                (Strip::Floats(own), Samples::Unrounded(to) | Samples::Float(to)) => {
                    to[place.clone()].copy_from_slice(own);
                }
                (Strip::Uint(own), Samples::Uint(to)) => to[place.clone()].copy_from_slice(own),
                _ => {}
            }
        }
    }
}

impl<'p> Strip<'p> {
    fn of(samples: &'p mut Samples) -> Self {
        match samples {
            Samples::Half(samples) => Strip::Halves(samples),
            Samples::Unrounded(samples) | Samples::Float(samples) => Strip::Floats(samples),
            Samples::Uint(samples) => Strip::Uint(samples),
        }
    }

    /// Takes the first samples out.
    fn split_off(&mut self, count: usize) -> Self {
        let (first, rest) = match self {
            Strip::Halves(all) => {
                let (first, rest) = take(all).split_at_mut(count);
                (Strip::Halves(first), Strip::Halves(rest))
            }
            Strip::Floats(all) => {
                let (first, rest) = take(all).split_at_mut(count);
                (Strip::Floats(first), Strip::Floats(rest))
            }
            Strip::Uint(all) => {
                let (first, rest) = take(all).split_at_mut(count);
                (Strip::Uint(first), Strip::Uint(rest))
            }
        };
        *self = rest;
        first
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Channel, Plane};
    use super::*;

    /// A picture of the same pixels and channels, all 0.
    fn blank(picture: &Picture) -> Picture {
        let mut blank = picture.clone();
        blank.pixels.fill([0.0; 4]);
        for channel in &mut blank.channels {
            match &mut channel.samples {
                Samples::Half(samples) => samples.fill(f16::ZERO),
                Samples::Unrounded(samples) | Samples::Float(samples) => samples.fill(0.0),
                Samples::Uint(samples) => samples.fill(0),
            }
        }
        blank
    }

    /// Blocks of a grid, last ones first, put in their bands make the picture that they were cut from, and so does what the
    /// bands say of themselves.
    #[test]
    fn blocks_in_bands_make_the_picture() {
        let window = Window { x0: -3, y0: -5, x1: 18, y1: 21 };
        let mut whole = Picture::new((16, 16), window);
        whole.pixels.iter_mut().enumerate().for_each(|(i, pixel)| *pixel = [i as f32, 1.0, 2.0, 3.0]);
        let numbers = 0..window.area() as u32;
        let floats: Plane<f32> = numbers.clone().map(|i| i as f32).collect();
        let mut channel = |name: &str, samples| whole.channels.push(Channel { name: name.into(), samples });
        channel("depth.Z", Samples::Float(floats.clone()));
        channel("id.object", Samples::Uint(numbers.collect()));
        channel("N.X", Samples::halves(&floats));
        channel("albedo.R", Samples::Unrounded(floats));
        let mut made = blank(&whole);
        assert!(made != whole);
        let mut bands = made.bands(8);
        assert_eq!(bands.iter().map(|band| band.window.height()).collect::<Vec<_>>(), [5, 8, 8, 5]);
        for (y0, y1) in [(16, 21), (8, 16), (0, 8), (-5, 0)] {
            for (x0, x1) in [(8, 18), (-3, 8)] {
                let part = whole.crop(Window { x0, y0, x1, y1 }).expect("inside");
                let samples: Vec<Samples> = part.channels.into_iter().map(|channel| channel.samples).collect();
                bands[(y0.div_euclid(8) + 1) as usize].put(part.window, &part.pixels, &samples);
            }
        }
        let mut copy = blank(&whole);
        bands.iter().for_each(|band| band.copy_to(&mut copy));
        assert_eq!(copy, whole);
        assert_eq!(made, whole);
    }
}
