//! Structural similarity, by rows.
//!
//! Source: Wang, Bovik, Sheikh and Simoncelli, "Image quality assessment: from error visibility to structural
//! similarity", IEEE Transactions on Image Processing 13(4), 2004, equations (13) to (17).

use std::collections::VecDeque;

/// Pixels across a window.
const WINDOW: usize = 11;
/// Standard deviation of a window's weights, in pixels.
const SIGMA: f64 = 1.5;
/// (K1 L)^2 and (K2 L)^2 with L = 1, the range of the values.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Weighted sums over a part of a window: a, b, a^2, b^2, ab.
type Moments = [f64; 5];

/// The mean over all windows that lie wholly inside. `a` and `b` hold values in 0..1, row by row, `width` a row; they
/// are of one length and not empty. A picture smaller than a window gets one of its own size.
pub(super) fn ssim(a: &[f64], b: &[f64], width: usize) -> f64 {
    let height = a.len() / width;
    let (across, down) = (weights(width), weights(height));
    let mut rows: VecDeque<Vec<Moments>> = VecDeque::with_capacity(down.len());
    let (mut sum, mut count) = (0.0, 0);
    for (a, b) in a.chunks_exact(width).zip(b.chunks_exact(width)) {
        if rows.len() == down.len() {
            rows.pop_front();
        }
        rows.push_back(filter_row(a, b, &across));
        if rows.len() == down.len() {
            for x in 0..width + 1 - across.len() {
                sum += similarity(weigh(rows.iter().zip(&down).map(|(row, &weight)| (row[x], weight))));
                count += 1;
            }
        }
    }
    sum / f64::from(count)
}

/// Weights of a window along one axis; their sum is 1.
fn weights(length: usize) -> Vec<f64> {
    let count = length.min(WINDOW);
    let middle = (count as f64 - 1.0) / 2.0;
    let weights: Vec<f64> = (0..count).map(|i| (-(i as f64 - middle).powi(2) / (2.0 * SIGMA * SIGMA)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| weight / sum).collect()
}

fn filter_row(a: &[f64], b: &[f64], weights: &[f64]) -> Vec<Moments> {
    let moments: Vec<Moments> = a.iter().zip(b).map(|(&a, &b)| [a, b, a * a, b * b, a * b]).collect();
    moments.windows(weights.len()).map(|part| weigh(part.iter().copied().zip(weights.iter().copied()))).collect()
}

fn weigh(terms: impl Iterator<Item = (Moments, f64)>) -> Moments {
    terms.fold([0.0; 5], |sum, (moments, weight)| std::array::from_fn(|i| sum[i] + weight * moments[i]))
}

fn similarity([a, b, aa, bb, ab]: Moments) -> f64 {
    let (var_a, var_b, covariance) = (aa - a * a, bb - b * b, ab - a * b);
    (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (var_a + var_b + C2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(width: usize, height: usize, phase: f64) -> Vec<f64> {
        let value = |i: usize| {
            let (x, y) = ((i % width) as f64, (i / width) as f64);
            0.5 + 0.25 * (0.7 * x + phase).sin() + 0.2 * (0.43 * y * (1.0 + phase) + 0.05 * x).cos()
        };
        (0..width * height).map(value).collect()
    }

    /// The definition word by word: for every window its weighted mean, then variance about that mean.
    fn slow(a: &[f64], b: &[f64], width: usize) -> f64 {
        let height = a.len() / width;
        let mut all = Vec::new();
        for y in 5..height - 5 {
            for x in 5..width - 5 {
                let mut window = Vec::new();
                for (dy, dx) in (0..121).map(|i| (i / 11, i % 11)) {
                    let r2 = (dx as f64 - 5.0).powi(2) + (dy as f64 - 5.0).powi(2);
                    let place = (y + dy - 5) * width + x + dx - 5;
                    window.push(((-r2 / 4.5).exp(), a[place], b[place]));
                }
                let total: f64 = window.iter().map(|w| w.0).sum();
                let mean = |f: &dyn Fn(f64, f64) -> f64| window.iter().map(|w| w.0 * f(w.1, w.2)).sum::<f64>() / total;
                let (ma, mb) = (mean(&|a, _| a), mean(&|_, b| b));
                let (va, vb) = (mean(&|a, _| (a - ma).powi(2)), mean(&|_, b| (b - mb).powi(2)));
                let cov = mean(&|a, b| (a - ma) * (b - mb));
                let luminance = (2.0 * ma * mb + 1e-4) / (ma * ma + mb * mb + 1e-4);
                all.push(luminance * (2.0 * cov + 9e-4) / (va + vb + 9e-4));
            }
        }
        all.iter().sum::<f64>() / all.len() as f64
    }

    #[test]
    fn rows_give_what_the_definition_says() {
        let (a, b) = (wave(23, 17, 0.0), wave(23, 17, 0.6));
        let (got, want) = (ssim(&a, &b, 23), slow(&a, &b, 23));
        assert!((got - want).abs() < 1e-12 && (0.1..0.95).contains(&want), "{got} {want}");
    }

    #[test]
    fn equal_is_one_and_small_pictures_have_a_value() {
        for (width, height) in [(1, 1), (1, 30), (30, 1), (4, 4), (11, 11), (40, 25)] {
            let a = wave(width, height, 0.0);
            assert_eq!(ssim(&a, &a, width), 1.0, "{width}x{height}");
            let darker: Vec<f64> = a.iter().map(|value| 0.5 * value).collect();
            let apart = ssim(&a, &darker, width);
            assert!(apart > 0.0 && apart < 0.95, "{width}x{height}: {apart}");
        }
    }
}
