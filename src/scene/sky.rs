//! A lat-long picture as a light: where to look for its brightness.
//!
//! Source: Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th edition, 2023, sections 12.5 and A.5.

use std::f64::consts::{PI, TAU};

use glam::DVec2;

use super::ImageTexture;

/// The distribution of a picture's brightness (the mean of its channels) over the sphere.
///
/// Its cells lie between the centres of four texels, where lookups are bilinear: columns `i` between texels i and
/// i + 1, rows `j` between j - 1 and j, the first and the last as far as the poles. A cell is chosen by the
/// mean of its corners times its solid angle; within it the density is bilinear in azimuth and height.
#[derive(Debug, Clone)]
pub struct Sky {
    width: usize,
    height: usize,
    /// By texel.
    gray: Vec<f64>,
    /// By row of cells: share of the brightness up to its end.
    rows: Vec<f64>,
    /// By cell: share of its row's brightness up to its end.
    cells: Vec<f64>,
}

/// A cell, and where in it: east from its western side, south from its northern side by height, each 0 to 1.
struct Spot {
    i: usize,
    j: usize,
    east: f64,
    south: f64,
}

impl Sky {
    /// Takes a picture; `None` where it is black.
    pub fn new(image: &ImageTexture) -> Option<Self> {
        let gray = image.texels.iter().map(|[r, g, b]| (f64::from(*r) + f64::from(*g) + f64::from(*b)) / 3.0);
        let (width, height) = (image.width, image.height);
        let mut sky = Sky { width, height, gray: gray.collect(), rows: Vec::new(), cells: Vec::new() };
        let mut total = 0.0;
        for j in 0..=height {
            let mut sum = 0.0;
            for i in 0..width {
                sum += sky.corners(i, j).iter().sum::<f64>();
                sky.cells.push(sum);
            }
            if sum > 0.0 {
                sky.cells[j * width..].iter_mut().for_each(|end| *end /= sum);
            }
            let [north, south] = sky.heights(j);
            total += sum * (north - south);
            sky.rows.push(total);
        }
        sky.rows.iter_mut().for_each(|end| *end /= total);
        (total > 0.0 && total.is_finite()).then_some(sky)
    }

    /// Texture coordinates of (u, v): u chooses the column, v the row.
    pub fn sample(&self, u: f64, v: f64) -> DVec2 {
        let (j, v) = choose(&self.rows, v);
        let (i, u) = choose(&self.cells[j * self.width..(j + 1) * self.width], u);
        let [a, b, c, d] = self.corners(i, j);
        let south = linear(v, a + b, c + d);
        let east = linear(u, a + south * (c - a), b + south * (d - b));
        let [top, bottom] = self.heights(j);
        let height = (top + south * (bottom - top)).clamp(-1.0, 1.0);
        let u = (i as f64 + 0.5 + east) / self.width as f64;
        DVec2::new(u - u.floor(), height.acos() / PI)
    }

    /// The density of [`Sky::sample`] at texture coordinates, per steradian.
    pub fn density(&self, uv: DVec2) -> f64 {
        let Spot { i, j, east, south } = self.spot(uv);
        let [a, b, c, d] = self.corners(i, j);
        let (west, eastern) = (a + south * (c - a), b + south * (d - b));
        let mean = 0.25 * (a + b + c + d);
        let chance = share(&self.rows, j) * share(&self.cells[j * self.width..(j + 1) * self.width], i);
        let [top, bottom] = self.heights(j);
        match mean > 0.0 {
            true => chance * (west + east * (eastern - west)) / mean * self.width as f64 / (TAU * (top - bottom)),
            false => 0.0,
        }
    }

    fn spot(&self, uv: DVec2) -> Spot {
        let x = (uv.x - uv.x.floor()) * self.width as f64 - 0.5;
        let i = (x.floor().rem_euclid(self.width as f64) as usize).min(self.width - 1);
        let j = ((uv.y * self.height as f64 + 0.5) as usize).min(self.height);
        let [top, bottom] = self.heights(j);
        let south = ((top - (PI * uv.y).cos()) / (top - bottom)).clamp(0.0, 1.0);
        Spot { i, j, east: x - x.floor(), south }
    }

    /// Brightness at the corners of a cell: north-west, north-east, south-west, south-east.
    fn corners(&self, i: usize, j: usize) -> [f64; 4] {
        let at = |i: usize, j: usize| self.gray[j.min(self.height - 1) * self.width + i % self.width];
        let north = j.saturating_sub(1);
        [at(i, north), at(i + 1, north), at(i, j), at(i + 1, j)]
    }

    /// Heights of the northern and southern side of a row of cells on the unit sphere.
    fn heights(&self, j: usize) -> [f64; 2] {
        let at = |texels: f64| (PI * (texels / self.height as f64).clamp(0.0, 1.0)).cos();
        [at(j as f64 - 0.5), at(j as f64 + 0.5)]
    }
}

/// The place in 0..1 where the integral of the line from `a` to `b` has come to the share `u`.
fn linear(u: f64, a: f64, b: f64) -> f64 {
    let root = (a * a + u * (b * b - a * a)).max(0.0).sqrt();
    if a + root > 0.0 { (u * (a + b) / (a + root)).clamp(0.0, 1.0) } else { u }
}

fn share(ends: &[f64], k: usize) -> f64 {
    if k == 0 { ends[0] } else { ends[k] - ends[k - 1] }
}

/// The interval that holds a fraction, and where in it.
fn choose(ends: &[f64], u: f64) -> (usize, f64) {
    let k = ends.partition_point(|end| *end <= u).min(ends.len() - 1);
    let start = if k == 0 { 0.0 } else { ends[k - 1] };
    (k, ((u - start) / (ends[k] - start)).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::scene::{ColorSpace, TextureFilter, Wrap};

    fn picture(width: usize, height: usize, texel: impl Fn(usize, usize) -> f32) -> ImageTexture {
        let texels: Vec<[f32; 3]> = (0..width * height).map(|k| [texel(k % width, k / width); 3]).collect();
        ImageTexture {
            file: "sky.exr".into(),
            wrap: Wrap::Repeat,
            filter: TextureFilter::Bilinear,
            color_space: ColorSpace::Linear,
            width,
            height,
            texels: Arc::from(texels),
        }
    }

    /// The mean of 1/density over the samples is 4 pi where all of the sky shines; the brightness over the density
    /// is nearly the same everywhere, as only heights and angles part from each other within a cell.
    #[test]
    fn samples_follow_the_brightness() {
        let texel = |i: usize, j: usize| 1.0 + (i * 7 % 5) as f32 + if (i, j) == (3, 2) { 100.0 } else { 0.0 };
        let image = picture(32, 16, texel);
        let sky = Sky::new(&image).unwrap();
        let gray = |uv: DVec2| {
            let (x, y) = (uv.x * 32.0 - 0.5, uv.y * 16.0 - 0.5);
            let at = |i: f64, j: f64| f64::from(texel(i.rem_euclid(32.0) as usize, j.clamp(0.0, 15.0) as usize));
            let (fx, fy) = (x - x.floor(), y - y.floor());
            let row = |j: f64| at(x.floor(), j) * (1.0 - fx) + at(x.floor() + 1.0, j) * fx;
            row(y.floor()) * (1.0 - fy) + row(y.floor() + 1.0) * fy
        };
        let (mut sum, mut light, mut squares, n) = (0.0, 0.0, 0.0, 300);
        for k in 0..n * n {
            let at = |k: usize| (k as f64 + 0.5) / n as f64;
            let uv = sky.sample(at(k / n), at(k % n));
            let (density, gray) = (sky.density(uv), gray(uv));
            (sum, light, squares) = (sum + 1.0 / density, light + gray / density, squares + (gray / density).powi(2));
        }
        let count = (n * n) as f64;
        assert!((sum / count / (4.0 * PI) - 1.0).abs() < 2e-3, "{}", sum / count);
        let variance = squares / count / (light / count).powi(2) - 1.0;
        assert!(variance < 2e-3, "{variance}");
    }

    #[test]
    fn a_black_sky_is_no_light() {
        assert!(Sky::new(&picture(4, 2, |_, _| 0.0)).is_none());
        let one = Sky::new(&picture(1, 1, |_, _| 2.0)).unwrap();
        for uv in [DVec2::new(0.3, 0.9), DVec2::new(0.99, 0.1)] {
            assert!((one.density(uv) - 0.25 / PI).abs() < 1e-14);
        }
    }
}
