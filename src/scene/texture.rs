//! Textures: colours by uv. v runs down: (0, 0) is the upper left corner of an image.

use std::path::PathBuf;
use std::sync::Arc;

use glam::DVec3;

/// A named texture.
#[derive(Debug, Clone)]
pub struct Texture {
    /// The user's name.
    pub name: String,
    /// Pattern or picture.
    pub kind: TextureKind,
}

/// What a texture shows.
#[derive(Debug, Clone)]
pub enum TextureKind {
    /// Two colours in squares.
    Checker(Checker),
    /// A picture.
    Image(ImageTexture),
}

/// `colors[(floor(u scale.0) + floor(v scale.1)) mod 2]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Checker {
    /// Linear Rec. 709.
    pub colors: [DVec3; 2],
    /// Cells per unit of u and of v, > 0.
    pub scale: [f64; 2],
}

/// A picture looked up by uv: texel (i, j) has its centre at u = (i + 1/2)/width, v = (j + 1/2)/height.
#[derive(Debug, Clone)]
pub struct ImageTexture {
    /// The file it came from.
    pub file: PathBuf,
    /// Outside 0..1.
    pub wrap: Wrap,
    /// Between texels.
    pub filter: TextureFilter,
    /// How the file's values become linear ones.
    pub color_space: ColorSpace,
    /// Texels, >= 1.
    pub width: usize,
    /// Texels, >= 1.
    pub height: usize,
    /// Linear Rec. 709, row by row from the top, `width x height` texels; none where no primitive shows the picture.
    pub texels: Arc<[Texel]>,
}

/// Red, green, blue.
pub type Texel = [f32; 3];

/// What lies outside 0..1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// Its edge.
    Clamp,
}

/// What lies between texels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TextureFilter {
    /// Linear in u and v.
    #[default]
    Bilinear,
    /// The nearest texel.
    Nearest,
}

/// How a file's values become linear ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// By the piecewise sRGB curve (IEC 61966-2-1).
    Srgb,
    /// They are linear.
    Linear,
}
