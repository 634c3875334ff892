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
    /// Some beyond each side.
    pub overscan: Option<Overscan>,
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
        self.crop.is_some() || self.crop_ndc.is_some()
    }

    /// The pixels of a picture of a size.
    pub fn window(&self, display: (u32, u32)) -> Window {
        let overscan = self.overscan.map_or([0; 2], |overscan| overscan.pixels(display));
        let crop = self.crop.or_else(|| self.crop_ndc.map(|corners| of_shares(corners, display)));
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
    fn shares_of_a_picture_are_whole_pixels() {
        let halves = [[0.0, 0.0, 0.5, 1.0], [0.5, 0.0, 1.0, 1.0]].map(|corners| of_shares(corners, (101, 50)));
        assert_eq!(halves[0], Window { x0: 0, y0: 0, x1: 51, y1: 50 });
        assert_eq!(halves[1], Window { x0: 51, y0: 0, x1: 101, y1: 50 });
    }
}
