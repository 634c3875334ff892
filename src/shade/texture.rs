//! Colours by uv.

use glam::{DVec2, DVec3};

use crate::scene::{Checker, ImageTexture, Texture, TextureFilter, TextureKind, Wrap};

/// The colour of a texture at a point, linear Rec. 709, and the cell it came from: pixels whose cells
/// differ between two tracers differ for a reason.
pub fn lookup(texture: &Texture, uv: DVec2) -> (DVec3, i64) {
    match &texture.kind {
        TextureKind::Checker(checker) => checker_at(checker, uv),
        TextureKind::Image(image) => image_at(image, uv),
    }
}

fn checker_at(checker: &Checker, uv: DVec2) -> (DVec3, i64) {
    let cell = (uv.x * checker.scale[0]).floor() + (uv.y * checker.scale[1]).floor();
    let odd = cell.rem_euclid(2.0) >= 1.0;
    (checker.colors[usize::from(odd)], i64::from(odd))
}

fn image_at(image: &ImageTexture, uv: DVec2) -> (DVec3, i64) {
    let (x, y) = (uv.x * image.width as f64, uv.y * image.height as f64);
    match image.filter {
        TextureFilter::Nearest => {
            let (i, j) = (wrap(x.floor(), image.width, image.wrap), wrap(y.floor(), image.height, image.wrap));
            (texel(image, i, j), (j * image.width + i) as i64)
        }
        TextureFilter::Bilinear => {
            let (i, j) =
                (wrap((x - 0.5).floor(), image.width, image.wrap), wrap((y - 0.5).floor(), image.height, image.wrap));
            (bilinear(image, uv, [image.wrap; 2]), (j * image.width + i) as i64)
        }
    }
}

/// The four texels round a point, weighed linearly.
pub fn bilinear(image: &ImageTexture, uv: DVec2, [wrap_u, wrap_v]: [Wrap; 2]) -> DVec3 {
    let (x, y) = (uv.x * image.width as f64 - 0.5, uv.y * image.height as f64 - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let at = |dx: f64, dy: f64| texel(image, wrap(x0 + dx, image.width, wrap_u), wrap(y0 + dy, image.height, wrap_v));
    at(0.0, 0.0).lerp(at(1.0, 0.0), fx).lerp(at(0.0, 1.0).lerp(at(1.0, 1.0), fx), fy)
}

fn wrap(x: f64, size: usize, wrap: Wrap) -> usize {
    match wrap {
        Wrap::Repeat => (x.rem_euclid(size as f64) as usize).min(size - 1),
        Wrap::Clamp => x.clamp(0.0, size as f64 - 1.0) as usize,
    }
}

fn texel(image: &ImageTexture, i: usize, j: usize) -> DVec3 {
    DVec3::from_array(image.texels[j * image.width + i].map(f64::from))
}
