//! Who is right where two tracers disagree: what f32 cannot decide is no mistake.
//!
//! Every place where a ray meets or nearly meets a body comes with a **unit**, the error of `t` that a
//! careful f32 kernel cannot avoid, and with a **margin**, the distance of the decision hit or miss from
//! its turning point in such errors. Both are first-order: of f32 products and sums of the ray, which
//! is taken as exact, and of what storing the scene in f32 relative to the origin costs. A number that
//! f32 holds costs nothing, any other one u |x|, coordinates and radii alike, and the same holds for the
//! difference of an anchor and the ray's origin. A decision within [`TOLERANCE`] of them is ambiguous.
//!
//! A place is *possible* where nothing that speaks against it is further than the tolerance; it is
//! *sure* where it is a hit and nothing comes as near as the tolerance to undoing it.

use super::body::Body;
use super::line::{Line, Root};
use super::{Placed, Ray, Reference};

/// Half the spacing of f32 numbers at 1: the relative error of one rounding.
pub const U: f64 = 1.0 / (1u64 << 24) as f64;

/// The same of f64: what even exact geometry, done in f64, leaves open.
pub const U64: f64 = 0.5 * f64::EPSILON;

/// Decisions closer than this many attainable errors are ambiguous.
pub const TOLERANCE: f64 = 8.0;

/// What to think of another tracer's answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// It is the reference's own.
    Same,
    /// It is another one, and f32 could not tell them apart.
    Tie,
    /// It is wrong.
    Different {
        /// The primitive that the reference meets, `None` for none. For an occlusion query the
        /// closest of all that could be in the way.
        expected: Option<usize>,
        /// Where, in lengths of the ray's direction.
        expected_t: Option<f64>,
    },
}

/// `a / b`, where 0 of 0 is nothing.
pub fn ratio(a: f64, b: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / b }
}

impl Root {
    fn possible(&self, line: &Line) -> bool {
        let slack = TOLERANCE * self.unit;
        let between = line.t_min - slack < self.t && self.t <= line.t_max + slack;
        (self.hit || self.margin > -TOLERANCE) && (between || slack == f64::INFINITY)
    }

    fn sure(&self, line: &Line) -> bool {
        let slack = TOLERANCE * self.unit;
        let between = line.t_min + slack < self.t && self.t <= line.t_max - slack;
        self.hit && self.margin >= TOLERANCE && between && slack.is_finite()
    }
}

impl Placed {
    /// Whether camera and secondary rays may see this place, and whether they surely do.
    fn shows(&self, root: &Root) -> (bool, bool) {
        let (sees, doubt) = (self.sees(root.front), root.facing < TOLERANCE);
        let one_sided = !(self.sees(true) && self.sees(false));
        (sees || doubt, sees && !(one_sided && doubt))
    }
}

/// A place on a ray where a primitive is met, or nearly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Index of the primitive.
    pub primitive: usize,
    /// In lengths of the ray's direction.
    pub t: f64,
    /// Whether it is met, in f64.
    pub hit: bool,
    /// The error of `t` that f32 cannot avoid.
    pub unit: f64,
    /// How far the decision hit or miss is from turning, in its own f32 errors; negative for a miss.
    pub margin: f64,
}

/// A place on a line, by primitive.
pub(super) type Found = (usize, Root);

impl Reference {
    /// Judges the closest hit that another tracer found: the primitive, and where it says so, `t`.
    ///
    /// A different primitive is excused where it is possible and no sure one lies nearer by more than
    /// the tolerance times the units of both. A miss is excused where nothing is sure. A `t` must be
    /// within the tolerance of a place for which this holds, on the right primitive too.
    pub fn verdict(&self, ray: &Ray, got: Option<usize>, got_t: Option<f32>) -> Verdict {
        self.verdict_in(U, ray, got, got_t)
    }

    /// The same without mercy for f32: a different primitive is excused only where f64 cannot tell them apart.
    pub fn verdict_exact(&self, ray: &Ray, got: Option<usize>) -> Verdict {
        self.verdict_in(U64, ray, got, None)
    }

    fn verdict_in(&self, u: f64, ray: &Ray, got: Option<usize>, got_t: Option<f32>) -> Verdict {
        let expected = self.closest_of(ray, Placed::sees);
        let same = expected.map(|(primitive, _)| primitive) == got;
        let excused = match Line::judged(ray, u) {
            Some(line) => self.excused(&line, got, got_t),
            None => got.is_none(),
        };
        match (same, excused) {
            (true, true) => Verdict::Same,
            (true, false) if got_t.is_none() => Verdict::Same,
            (false, true) => Verdict::Tie,
            (_, false) => Verdict::Different {
                expected: expected.map(|(primitive, _)| primitive),
                expected_t: expected.map(|(_, t)| t),
            },
        }
    }

    fn excused(&self, line: &Line, got: Option<usize>, got_t: Option<f32>) -> bool {
        let mut sure: Vec<Found> = Vec::new();
        let mut possible: Vec<Root> = Vec::new();
        for (primitive, placed) in self.placed.iter().enumerate() {
            for root in placed.body.roots(line).into_iter().flatten() {
                let (may_show, shows) = placed.shows(&root);
                if shows && root.sure(line) {
                    sure.push((primitive, root));
                }
                if got == Some(primitive) && may_show && root.possible(line) {
                    possible.push(root);
                }
            }
        }
        if got.is_none() {
            return sure.is_empty();
        }
        possible.iter().any(|place| {
            let overlooked = |(_, other): &Found| other.t < place.t - TOLERANCE * (other.unit + place.unit);
            let fits = |t: f32| (f64::from(t) / line.scale - place.t).abs() <= TOLERANCE * place.unit;
            got_t.is_none_or(fits) && (place.unit == f64::INFINITY || !sure.iter().any(overlooked))
        })
    }

    /// Judges an occlusion query: `got` says whether another tracer found anything in the way.
    pub fn verdict_occluded(&self, ray: &Ray, got: bool) -> Verdict {
        self.verdict_occluded_in(U, ray, got)
    }

    /// The same without mercy for f32.
    pub fn verdict_occluded_exact(&self, ray: &Ray, got: bool) -> Verdict {
        self.verdict_occluded_in(U64, ray, got)
    }

    fn verdict_occluded_in(&self, u: f64, ray: &Ray, got: bool) -> Verdict {
        if self.occluded(ray) == got {
            return Verdict::Same;
        }
        let roots = |placed: &Placed, line: &Line| placed.body.roots(line).into_iter().flatten().collect::<Vec<_>>();
        let excused = Line::judged(ray, u).is_some_and(|line| {
            let mut places = self.placed.iter().flat_map(|placed| roots(placed, &line));
            if got { places.any(|root| root.possible(&line)) } else { !places.any(|root| root.sure(&line)) }
        });
        if excused {
            return Verdict::Tie;
        }
        let expected = self.closest_of(ray, |_, _| true);
        Verdict::Different { expected: expected.map(|(primitive, _)| primitive), expected_t: expected.map(|(_, t)| t) }
    }

    /// Of places on a ray that f64 cannot tell apart, the one of the lowest primitive.
    pub(super) fn lowest_tie(&self, line: &Line, first: Found, near: &[Found]) -> Found {
        let judged = Line { judged: true, u: U64, ..*line };
        let noise = |(primitive, root): &Found| {
            let same = |other: &Root| other.t == root.t;
            let mut roots = self.placed[*primitive].body.roots(&judged).into_iter().flatten();
            roots.find(same).map_or(0.0, |root| TOLERANCE * root.unit.min(1e-6 * root.t.abs()))
        };
        let slack = noise(&first);
        let ties = near.iter().filter(|other| other.1.t - first.1.t <= slack + noise(other));
        ties.copied().min_by_key(|(primitive, _)| *primitive).unwrap_or(first)
    }

    /// All places on a ray where something is met or nearly met, nearest first.
    pub fn places(&self, ray: &Ray) -> Vec<Place> {
        let Some(line) = Line::new(ray, true) else { return Vec::new() };
        let of = |(primitive, placed): (usize, &Placed)| {
            let roots = placed.body.roots(&line).into_iter().flatten().filter(|root| root.possible(&line));
            let place = |root: Root| Place {
                primitive,
                t: root.t * line.scale,
                hit: root.hit && line.holds(root.t),
                unit: root.unit * line.scale,
                margin: root.margin,
            };
            roots.map(place).collect::<Vec<_>>()
        };
        let mut places: Vec<Place> = self.placed.iter().enumerate().flat_map(of).collect();
        places.sort_by(|a, b| a.t.total_cmp(&b.t));
        places
    }

    /// How far the decision that a ray meets a primitive near `t` is from turning, in the errors that f32 cannot avoid:
    /// hit or miss, and beyond the start or not. Below [`TOLERANCE`] no f32 kernel could tell.
    pub fn margin(&self, ray: &Ray, primitive: usize, t: f64) -> Option<f64> {
        let line = Line::new(ray, true)?;
        let places = self.placed.get(primitive)?.body.roots(&line).into_iter().flatten();
        let off = |root: &Root| (root.t - t / line.scale).abs();
        let nearest = places.min_by(|a, b| off(a).total_cmp(&off(b)))?;
        Some(nearest.margin.min(ratio(nearest.t - line.t_min, nearest.unit)))
    }

    /// The error of `t` that f32 cannot avoid at the place of a primitive on the ray that is nearest to `t`.
    pub fn unit(&self, ray: &Ray, primitive: usize, t: f64) -> Option<f64> {
        let line = Line::new(ray, true)?;
        let places = self.placed.get(primitive)?.body.roots(&line).into_iter().flatten();
        let off = |root: &Root| (root.t - t / line.scale).abs();
        places.min_by(|a, b| off(a).total_cmp(&off(b))).map(|root| root.unit * line.scale)
    }

    /// The difference of a `t` from the nearest place of one primitive on the ray, in units of that
    /// place; `None` where the primitive is not even nearly met.
    pub fn units(&self, ray: &Ray, primitive: usize, t: f32) -> Option<f64> {
        let line = Line::new(ray, true)?;
        let body: &Body = &self.placed.get(primitive)?.body;
        let places = body.roots(&line).into_iter().flatten().filter(|root| root.possible(&line));
        let units = places.map(|root| ratio((f64::from(t) / line.scale - root.t).abs(), root.unit));
        units.min_by(f64::total_cmp)
    }
}
