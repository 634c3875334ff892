//! Which pixels and which layers a picture has, where that is not the scene's word.

use crate::film::Window;
use crate::render::Renderer;
use crate::scene::{Aov, Layers, Scene};

/// Layers beside the colour, in place of the scene's.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct LayerChoice {
    /// Names as `[image]` has them; none are the scene's own.
    pub aovs: Vec<String>,
    /// What each pixel cost, besides.
    pub cost: bool,
    /// Ids that a Cryptomatte keeps of a pixel.
    pub ranks: Option<u8>,
    /// Whether rows of clouds are objects of their own.
    pub instances: Option<bool>,
}

/// Which pixels are rendered.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct WindowChoice {
    /// These, and no others.
    pub crop: Option<Window>,
    /// The same by shares of width and height: x0, y0, x1, y1.
    pub crop_ndc: Option<[f64; 4]>,
    /// One of equal parts of the picture.
    pub tile: Option<Tile>,
    /// Some beyond each side.
    pub overscan: Option<Overscan>,
}

/// One part of a picture that is cut into columns and rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tile {
    /// How many columns there are.
    pub columns: u32,
    /// How many rows there are.
    pub rows: u32,
    /// Which part it is, from 1, row by row.
    pub index: u32,
}

impl Tile {
    /// Its pixels; none where there are more columns or rows than pixels.
    pub fn window(self, (width, height): (u32, u32)) -> Window {
        let (column, row) = ((self.index - 1) % self.columns, (self.index - 1) / self.columns);
        let edge = |size: u32, part: u32, of: u32| (u64::from(size) * u64::from(part) / u64::from(of)) as i32;
        Window {
            x0: edge(width, column, self.columns),
            y0: edge(height, row, self.rows),
            x1: edge(width, column + 1, self.columns),
            y1: edge(height, row + 1, self.rows),
        }
    }
}

/// "tile 2 of 4x3".
impl std::fmt::Display for Tile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "tile {} of {}x{}", self.index, self.columns, self.rows)
    }
}

/// What is added on each side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Overscan {
    /// So many pixels.
    Pixels(u32),
    /// Percents of width and height.
    Percent(f64),
}

impl LayerChoice {
    /// The layers of a render.
    ///
    /// # Errors
    /// A name that is none, and the names there are.
    pub fn layers(&self, scene: &Scene) -> Result<Layers, String> {
        let start = if self.aovs.is_empty() { scene.layers } else { Layers::default() };
        let named = self.aovs.iter().try_fold(start, |layers, name| layers.with_named(name));
        let mut layers = named.map_err(|unknown| unknown.to_string())?;
        layers.ranks = self.ranks.unwrap_or(scene.layers.ranks);
        layers.instances = self.instances.unwrap_or(scene.layers.instances);
        Ok(if self.cost { layers.with(Aov::Cost) } else { layers })
    }

    /// Whether all names are known.
    ///
    /// # Errors
    /// A name that is none, and the names there are.
    pub fn check(&self) -> Result<(), String> {
        self.layers(&Scene::default()).map(drop)
    }
}

impl WindowChoice {
    /// Whether some part of the picture was chosen.
    pub fn is_crop(&self) -> bool {
        self.crop.is_some() || self.crop_ndc.is_some() || self.tile.is_some()
    }

    /// The pixels of a picture of a size.
    pub fn window(&self, display: (u32, u32)) -> Window {
        let overscan = self.overscan.map_or([0; 2], |overscan| overscan.pixels(display));
        let crop = self.crop.or_else(|| self.crop_ndc.map(|corners| of_shares(corners, display)));
        let crop = crop.or_else(|| self.tile.map(|tile| tile.window(display)));
        crop.unwrap_or_else(|| Window::full(display).grown(overscan))
    }

    /// Sets the windows of a renderer.
    pub fn apply<'s>(&self, renderer: Renderer<'s>) -> Renderer<'s> {
        let display = (renderer.image().width, renderer.image().height);
        let mut renderer = renderer;
        if let Some(overscan) = self.overscan {
            renderer = renderer.overscan(overscan.pixels(display));
        }
        match self.is_crop() {
            true => renderer.crop(self.window(display)),
            false => renderer,
        }
    }
}

impl Overscan {
    /// Pixels on the left and right side, and above and below.
    pub fn pixels(self, (width, height): (u32, u32)) -> [u32; 2] {
        match self {
            Overscan::Pixels(pixels) => [pixels; 2],
            Overscan::Percent(percent) => {
                [width, height].map(|side| (f64::from(side) * percent / 100.0).round() as u32)
            }
        }
    }
}

/// Pixels whose centres lie within the shares.
fn of_shares([x0, y0, x1, y1]: [f64; 4], (width, height): (u32, u32)) -> Window {
    let pixel = |share: f64, side: u32| (share * f64::from(side)).round() as i32;
    Window { x0: pixel(x0, width), y0: pixel(y0, height), x1: pixel(x1, width), y1: pixel(y1, height) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_a_picture_once() {
        let mut seen = vec![0; 101 * 37];
        for index in 1..=12 {
            let Window { x0, y0, x1, y1 } = Tile { columns: 4, rows: 3, index }.window((101, 37));
            (y0..y1).for_each(|y| (x0..x1).for_each(|x| seen[(y * 101 + x) as usize] += 1));
        }
        assert!(seen.iter().all(|count| *count == 1));
    }

    #[test]
    fn shares_of_a_picture_are_whole_pixels() {
        let halves = [[0.0, 0.0, 0.5, 1.0], [0.5, 0.0, 1.0, 1.0]].map(|corners| of_shares(corners, (101, 50)));
        assert_eq!(halves[0], Window { x0: 0, y0: 0, x1: 51, y1: 50 });
        assert_eq!(halves[1], Window { x0: 51, y0: 0, x1: 101, y1: 50 });
    }
}
