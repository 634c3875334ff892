//! Colours by uv.

use glam::{DVec2, DVec3};

use crate::scene::{Checker, ImageTexture, TextureFilter, TextureKind, Wrap};

/// The colour at `uv`, and the cell it was taken from: 0 or 1 in a checker, the number of the texel
/// (of its upper left one, where four are mixed) in a picture.
pub fn lookup(kind: &TextureKind, uv: DVec2) -> (DVec3, i64) {
    match kind {
        TextureKind::Checker(checker) => {
            let parity = checker_parity(checker, uv);
            (checker.colors[parity], parity as i64)
        }
        TextureKind::Image(image) => {
            let wrap = [image.wrap; 2];
            match image.filter {
                TextureFilter::Nearest => {
                    let (x, y) = (uv.x * image.width as f64, uv.y * image.height as f64);
                    (texel(image, wrap, x.floor(), y.floor()), cell(image, wrap, x.floor(), y.floor()) as i64)
                }
                TextureFilter::Bilinear => {
                    let corner = texel_place(image, uv).floor();
                    (bilinear(image, wrap, uv), cell(image, wrap, corner.x, corner.y) as i64)
                }
            }
        }
    }
}

fn checker_parity(checker: &Checker, uv: DVec2) -> usize {
    let sum = (uv.x * checker.scale[0]).floor() + (uv.y * checker.scale[1]).floor();
    usize::from(sum.rem_euclid(2.0) == 1.0)
}

/// A picture at `uv`, linear in u and v between the centres of its texels.
pub fn bilinear(image: &ImageTexture, wrap: [Wrap; 2], uv: DVec2) -> DVec3 {
    let place = texel_place(image, uv);
    let (corner, part) = (place.floor(), place - place.floor());
    let at = |i: f64, j: f64| texel(image, wrap, corner.x + i, corner.y + j);
    at(0.0, 0.0).lerp(at(1.0, 0.0), part.x).lerp(at(0.0, 1.0).lerp(at(1.0, 1.0), part.x), part.y)
}

/// `uv` in texels, counted from the centre of the first.
fn texel_place(image: &ImageTexture, uv: DVec2) -> DVec2 {
    uv * DVec2::new(image.width as f64, image.height as f64) - 0.5
}

fn texel(image: &ImageTexture, wrap: [Wrap; 2], i: f64, j: f64) -> DVec3 {
    let texel = image.texels.get(cell(image, wrap, i, j)).copied().unwrap_or_default();
    DVec3::from_array(texel.map(f64::from))
}

/// The number of texel (i, j), row by row; what lies outside is wrapped.
fn cell(image: &ImageTexture, wrap: [Wrap; 2], i: f64, j: f64) -> usize {
    let index = |k: f64, count: usize, wrap| match wrap {
        Wrap::Repeat => k.rem_euclid(count as f64) as usize,
        Wrap::Clamp => k.min(count as f64 - 1.0).max(0.0) as usize,
    };
    index(j, image.height, wrap[1]) * image.width + index(i, image.width, wrap[0])
}
