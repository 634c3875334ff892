//! One ray.

/// A ray: the points `origin + t dir` with `t_min < t <= t_max`.
///
/// `dir` need not be of unit length; `t` counts lengths of `dir`. A zero direction, a NaN or an
/// infinite coordinate makes a ray that hits nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Scene units.
    pub origin: [f32; 3],
    /// Open end.
    pub t_min: f32,
    /// Any length but zero.
    pub dir: [f32; 3],
    /// Closed end; infinity for no end.
    pub t_max: f32,
}

impl Ray {
    /// All of the ray before its origin: `0 < t`.
    pub fn new(origin: [f32; 3], dir: [f32; 3]) -> Self {
        Ray { origin, t_min: 0.0, dir, t_max: f32::INFINITY }
    }

    /// Whether it can hit anything.
    pub fn is_valid(&self) -> bool {
        let finite = self.origin.iter().chain(&self.dir).all(|x| x.is_finite());
        finite && self.dir != [0.0; 3] && self.t_min < self.t_max
    }
}
