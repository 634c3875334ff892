//! Values over time: keys, and what lies between them.

/// How values go from key to key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// Straight.
    #[default]
    Linear,
    /// Without jumps in speed, at rest in the first and last key, and never beyond two neighbouring keys.
    Smooth,
    /// The last key's.
    Step,
}

/// A frame and the value there.
pub type Key<const N: usize> = (f64, [f64; N]);

/// A number or vector of a scene that changes over time. The scene itself holds the value at the frame for which it
/// was read; this is what the file said.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// What it belongs to; `None` for what a written scene keeps as it is at this frame: transforms of groups and what
    /// they move, points of lists, clouds.
    pub part: Option<Part>,
    /// Its key there.
    pub key: &'static str,
    /// Frames, ascending, and their values, all of the same length.
    pub keys: Vec<(f64, Vec<f64>)>,
    /// Between keys.
    pub interpolation: Interpolation,
    /// The value at the frame for which the scene was read.
    pub now: Vec<f64>,
}

/// A part of a scene, by its index where there are several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The picture.
    Image,
    /// The integrator's settings.
    Render,
    /// A camera.
    Camera(usize),
    /// The background.
    Background,
    /// The ambient light.
    Ambient,
    /// A texture.
    Texture(usize),
    /// A material.
    Material(usize),
    /// A light.
    Light(usize),
    /// A single shape.
    Shape(usize),
}

/// The value at a frame: before the first key its value, after the last one that one's. `keys` is not empty.
pub(super) fn value<const N: usize>(keys: &[Key<N>], interpolation: Interpolation, frame: f64) -> [f64; N] {
    let next = keys.partition_point(|(at, _)| *at <= frame);
    if next == 0 || next == keys.len() {
        return keys[next.saturating_sub(1)].1;
    }
    let ((from, a), (to, b)) = (keys[next - 1], keys[next]);
    let (width, t) = (to - from, (frame - from) / (to - from));
    match interpolation {
        Interpolation::Step => a,
        Interpolation::Linear => std::array::from_fn(|i| a[i] + t * (b[i] - a[i])),
        Interpolation::Smooth => std::array::from_fn(|i| {
            let (m, n) = (slope(keys, next - 1, i) * width, slope(keys, next, i) * width);
            let (u, v) = (1.0 - t, t * t);
            // Cubic Hermite: a and b at the ends, m and n their slopes there.
            a[i] * u * u * (1.0 + 2.0 * t) + b[i] * v * (3.0 - 2.0 * t) + m * t * u * u - n * v * u
        }),
    }
}

/// The slope at a key that keeps the curve between its neighbours.
///
/// Source: Fritsch and Butland, "A method for constructing local monotone piecewise cubic interpolants", SIAM
/// Journal on Scientific and Statistical Computing 5(2), 1984, equation 5; at both ends at rest.
fn slope<const N: usize>(keys: &[Key<N>], at: usize, i: usize) -> f64 {
    if at == 0 || at + 1 == keys.len() {
        return 0.0;
    }
    let step = |k: usize| (keys[k + 1].0 - keys[k].0, keys[k + 1].1[i] - keys[k].1[i]);
    let ((before, rise), (after, next_rise)) = (step(at - 1), step(at));
    let (a, b) = (rise / before, next_rise / after);
    if a * b <= 0.0 {
        return 0.0;
    }
    let share = (before + 2.0 * after) / (3.0 * (before + after));
    a * b / (share * b + (1.0 - share) * a)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEYS: [Key<2>; 4] = [(1.0, [0.0, 1.0]), (5.0, [8.0, 1.0]), (7.0, [9.0, -3.0]), (17.0, [2.0, -3.0])];

    fn at(interpolation: Interpolation, frame: f64) -> [f64; 2] {
        value(&KEYS, interpolation, frame)
    }

    #[test]
    fn keys_are_met_and_hold_beyond_the_ends() {
        for interpolation in [Interpolation::Linear, Interpolation::Smooth, Interpolation::Step] {
            for (frame, value) in KEYS {
                assert_eq!(at(interpolation, frame), value, "{interpolation:?} {frame}");
            }
            assert_eq!((at(interpolation, -9.0), at(interpolation, 99.0)), (KEYS[0].1, KEYS[3].1));
        }
        assert_eq!(at(Interpolation::Linear, 2.0), [2.0, 1.0]);
        assert_eq!(at(Interpolation::Step, 6.9), [8.0, 1.0]);
        assert_eq!(value(&[(3.0, [4.0])], Interpolation::Smooth, 1.0), [4.0]);
    }

    /// Two keys make the smoothstep; more never leave the range of their neighbours, and the speed has no jumps.
    #[test]
    fn smooth_is_smooth() {
        let two = [(0.0, [0.0]), (4.0, [1.0])];
        assert_eq!(value(&two, Interpolation::Smooth, 1.0), [0.15625]);
        for pair in KEYS.windows(2) {
            for step in 0..=100 {
                let frame = pair[0].0 + f64::from(step) / 100.0 * (pair[1].0 - pair[0].0);
                let now = at(Interpolation::Smooth, frame);
                for i in 0..2 {
                    let (low, high) = (pair[0].1[i].min(pair[1].1[i]), pair[0].1[i].max(pair[1].1[i]));
                    assert!((low - 1e-12..=high + 1e-12).contains(&now[i]), "{frame} {now:?}");
                }
            }
        }
        for (frame, _) in KEYS {
            let speed = |a: f64, b: f64| (at(Interpolation::Smooth, b)[0] - at(Interpolation::Smooth, a)[0]) / (b - a);
            let jump = speed(frame, frame + 1e-5) - speed(frame - 1e-5, frame);
            assert!(jump.abs() < 1e-3, "{frame} {jump}");
        }
    }
}
