//! A finished picture and the window that it covers.

use super::channel::Channel;
use super::cryptomatte::Cryptomatte;
use super::plane::Plane;

/// A rectangle of pixels, half open: `x0 <= x < x1`, `y0 <= y < y1`; x right, y down, the first pixel
/// of the display window at (0, 0). Empty where `x1 <= x0` or `y1 <= y0`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Left edge, inside.
    pub x0: i32,
    /// Upper edge, inside.
    pub y0: i32,
    /// Right edge, outside.
    pub x1: i32,
    /// Lower edge, outside.
    pub y1: i32,
}

impl Window {
    /// The whole of a display window of this size (width, height).
    pub fn full(display: (u32, u32)) -> Self {
        let edge = |size: u32| i32::try_from(size).unwrap_or(i32::MAX);
        Window { x0: 0, y0: 0, x1: edge(display.0), y1: edge(display.1) }
    }

    /// With so many pixels more on the left and right side, and so many above and below.
    pub fn grown(&self, [x, y]: [u32; 2]) -> Window {
        let less = |edge: i32, by: u32| edge.saturating_sub_unsigned(by);
        let more = |edge: i32, by: u32| edge.saturating_add_unsigned(by);
        Window { x0: less(self.x0, x), y0: less(self.y0, y), x1: more(self.x1, x), y1: more(self.y1, y) }
    }

    /// So many pixels further right and down.
    pub fn moved(&self, x: i32, y: i32) -> Window {
        let Window { x0, y0, x1, y1 } = *self;
        let to = i32::saturating_add;
        Window { x0: to(x0, x), y0: to(y0, y), x1: to(x1, x), y1: to(y1, y) }
    }

    /// Pixels from left to right.
    pub fn width(&self) -> usize {
        extent(self.x0, self.x1)
    }

    /// Pixels from top to bottom.
    pub fn height(&self) -> usize {
        extent(self.y0, self.y1)
    }

    /// All pixels.
    pub fn area(&self) -> usize {
        self.width().saturating_mul(self.height())
    }

    /// The place of a pixel in a row-by-row list of the window's pixels, or `None` outside.
    #[inline]
    pub fn index(&self, x: i32, y: i32) -> Option<usize> {
        let inside = (self.x0..self.x1).contains(&x) && (self.y0..self.y1).contains(&y);
        inside.then(|| extent(self.y0, y) * self.width() + extent(self.x0, x))
    }

    /// The pixel (x, y) at a place of that list: the inverse of [`Window::index`] for places within the window.
    #[inline]
    pub fn pixel(&self, index: usize) -> (i32, i32) {
        let width = self.width().max(1);
        (self.x0.wrapping_add((index % width) as i32), self.y0.wrapping_add((index / width) as i32))
    }

    /// Whether every pixel of `other` lies inside.
    pub fn holds(&self, other: &Window) -> bool {
        self.x0 <= other.x0 && self.y0 <= other.y0 && other.x1 <= self.x1 && other.y1 <= self.y1
    }
}

/// "4x3 at 10,20": width, height and the first pixel.
impl std::fmt::Display for Window {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{} at {},{}", self.width(), self.height(), self.x0, self.y0)
    }
}

fn extent(from: i32, to: i32) -> usize {
    usize::try_from(i64::from(to) - i64::from(from)).unwrap_or(0)
}

/// A finished picture: scene-linear Rec. 709 with premultiplied alpha, and the layers beside it.
///
/// A writer refuses a picture whose lists of pixels are not as long as its window is large.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width and height of the full frame, in pixels: the display window, whose first pixel is (0, 0).
    pub display: (u32, u32),
    /// The pixels that are present: the data window. A crop lies inside the display window, an
    /// overscan reaches beyond it.
    pub window: Window,
    /// Red, green, blue, alpha of each pixel of the window, row by row from the top. Radiance has no
    /// upper bound, alpha is in 0..1, colour is already multiplied by alpha.
    pub pixels: Plane<[f32; 4]>,
    /// Layers beside the colour, in no order that means anything; no name occurs twice.
    pub channels: Vec<Channel>,
    /// What the Cryptomatte channels among them stand for.
    pub cryptomattes: Vec<Cryptomatte>,
}

impl Picture {
    /// A picture of transparent black, without layers.
    pub fn new(display: (u32, u32), window: Window) -> Self {
        let pixels = Plane::zeroed(window.area());
        Picture { display, window, pixels, channels: Vec::new(), cryptomattes: Vec::new() }
    }

    /// What it is a picture of, without a sample: windows, names and types. Nothing that is whole.
    pub fn hollow(&self) -> Self {
        let channel =
            |channel: &Channel| Channel { name: channel.name.clone(), samples: channel.samples.kind().zeros(0) };
        let matte = |matte: &Cryptomatte| Cryptomatte { name: matte.name.clone(), manifest: Default::default() };
        Picture {
            display: self.display,
            window: self.window,
            pixels: Plane::default(),
            channels: self.channels.iter().map(channel).collect(),
            cryptomattes: self.cryptomattes.iter().map(matte).collect(),
        }
    }

    /// The layer channel of this full name, `depth.Z`.
    pub fn channel(&self, name: &str) -> Option<&Channel> {
        self.channels.iter().find(|channel| channel.name == name)
    }

    /// The pixel at (x, y) of the display window, or `None` where the picture has none.
    pub fn get(&self, x: i32, y: i32) -> Option<[f32; 4]> {
        self.window.index(x, y).and_then(|index| self.pixels.get(index)).copied()
    }

    /// Whether there is a pixel at all, and one for each place of the window, in each channel.
    pub fn is_whole(&self) -> bool {
        let area = self.window.area();
        area > 0 && self.pixels.len() == area && self.channels.iter().all(|channel| channel.samples.len() == area)
    }

    /// The smallest window that holds every pixel that is not wholly transparent, and at least one pixel.
    pub fn seen(&self) -> Window {
        let start = Window { x1: self.window.x0 + 1, y1: self.window.y0 + 1, ..self.window };
        let places = self.pixels.iter().enumerate().filter(|(_, pixel)| **pixel != [0.0; 4]);
        let grown = |seen: Option<Window>, (x, y): (i32, i32)| {
            let Window { x0, y0, x1, y1 } = seen.unwrap_or(Window { x0: x, y0: y, x1: x + 1, y1: y + 1 });
            Some(Window { x0: x0.min(x), y0: y0.min(y), x1: x1.max(x + 1), y1: y1.max(y + 1) })
        };
        places.map(|(index, _)| self.window.pixel(index)).fold(None, grown).unwrap_or(start)
    }

    /// Leaves out rows and columns at the edges that are wholly transparent; the window before, where there were such.
    pub fn trim(&mut self) -> Option<Window> {
        let window = self.seen();
        let part = self.crop(window).filter(|_| window != self.window)?;
        Some(std::mem::replace(self, part).window)
    }

    /// The colours alone in another window, transparent black where there are none.
    pub fn colors_in(&self, window: Window) -> Picture {
        let mut picture = Picture::new(self.display, window);
        for (index, pixel) in picture.pixels.iter_mut().enumerate() {
            let (x, y) = window.pixel(index);
            *pixel = self.get(x, y).unwrap_or_default();
        }
        picture
    }

    /// The part of the picture that lies in `window`; the frame stays the same, and manifests keep the names
    /// that are left. `None` where the window is empty or reaches beyond the picture's own.
    pub fn crop(&self, window: Window) -> Option<Picture> {
        if window.area() == 0 || !self.window.holds(&window) || !self.is_whole() {
            return None;
        }
        let row = |y| self.window.index(window.x0, y).map(|start| start..start + window.width());
        let rows: Vec<_> = (window.y0..window.y1).filter_map(row).collect();
        let pixels = rows.iter().flat_map(|row| &self.pixels[row.clone()]).copied().collect();
        let channels: Vec<_> = self.channels.iter().map(|channel| channel.rows(&rows)).collect();
        let cryptomattes = self.cryptomattes.iter().map(|matte| matte.present(&channels)).collect();
        Some(Picture { display: self.display, window, pixels, channels, cryptomattes })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Samples;
    use super::*;

    #[test]
    fn index_and_pixel_are_inverse() {
        let window = Window { x0: -2, y0: 3, x1: 5, y1: 9 };
        assert_eq!((window.width(), window.height(), window.area()), (7, 6, 42));
        for index in 0..window.area() {
            let (x, y) = window.pixel(index);
            assert_eq!(window.index(x, y), Some(index));
        }
        assert_eq!(window.index(5, 3), None);
        assert_eq!(window.index(-2, 9), None);
        assert_eq!(Window { x0: 3, y0: 0, x1: -1, y1: 4 }.area(), 0);
    }

    #[test]
    fn crop_keeps_each_pixel_in_its_place() {
        let mut picture = Picture::new((6, 4), Window::full((6, 4)));
        for (index, pixel) in picture.pixels.iter_mut().enumerate() {
            pixel[0] = index as f32;
        }
        let samples = Samples::Uint((0..24).collect());
        picture.channels.push(Channel { name: "id.object".into(), samples });
        let window = Window { x0: 2, y0: 1, x1: 5, y1: 3 };
        let part = picture.crop(window).expect("inside");
        let ids = part.channel("id.object").map(|channel| &channel.samples);
        assert_eq!(ids, Some(&Samples::Uint(vec![8, 9, 10, 14, 15, 16].into())));
        assert_eq!(part.display, (6, 4));
        for index in 0..window.area() {
            let (x, y) = window.pixel(index);
            assert_eq!(part.get(x, y), picture.get(x, y), "{x} {y}");
        }
        assert_eq!(part.get(1, 1), None);
        assert_eq!(picture.crop(Window { x0: 2, y0: 1, x1: 7, y1: 3 }), None);
        assert_eq!(picture.crop(Window { x0: 2, y0: 1, x1: 2, y1: 3 }), None);
    }

    #[test]
    fn what_is_seen_has_the_smallest_window() {
        let mut picture = Picture::new((6, 4), Window { x0: -1, y0: -1, x1: 7, y1: 5 });
        assert_eq!(picture.seen(), Window { x0: -1, y0: -1, x1: 0, y1: 0 });
        for (x, y) in [(2, 0), (4, 3)] {
            let index = picture.window.index(x, y).unwrap();
            picture.pixels[index][3] = 0.25;
        }
        let (whole, window) = (picture.clone(), Window { x0: 2, y0: 0, x1: 5, y1: 4 });
        assert_eq!(picture.seen(), window);
        assert_eq!((picture.trim(), picture.window), (Some(whole.window), window));
        assert_eq!(picture.trim(), None);
        assert_eq!(picture.colors_in(whole.window), whole);
    }

    #[test]
    fn a_channel_that_is_too_short_is_seen() {
        let mut picture = Picture::new((2, 2), Window::full((2, 2)));
        assert!(picture.is_whole());
        picture.channels.push(Channel { name: "depth.Z".into(), samples: Samples::Float(vec![1.0; 3].into()) });
        assert!(!picture.is_whole());
    }
}
