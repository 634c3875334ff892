//! How far off an answer is.

use glam::DVec3;

use super::Row;
use super::engines::{Answer, Engine, exact};
use super::families::Set;
use super::truth::Truth;
use crate::lanes::Ray;
use crate::reference::{Reference, U, Verdict};
use crate::scene::Scene;

/// Most of `t`'s error over what cannot be avoided, and of its 99th percentile.
const MOST_UNITS: [f64; 2] = [4.0, 2.0];
/// Most of `t`'s error in ulps.
const MOST_ULPS: f64 = 1.0;
/// Most of a normal's error over what cannot be avoided, and of its length in roundings.
const MOST_NORMAL: [f64; 2] = [4.0, 4.0];

/// Sums of one engine over one set.
pub struct Tally {
    pub engine: Engine,
    pub seconds: f64,
    rays: u64,
    wrong: u64,
    ties: u64,
    ambiguous: u64,
    nan: u64,
    ulps: Vec<f64>,
    units: Vec<f64>,
    normal: f64,
    length: f64,
    /// How bad the worst ray is, and its bits.
    worst: (f64, Option<[u32; 8]>),
}

/// What f64 and f32 can tell of one scene.
pub struct Judge {
    reference: Reference,
}

impl Judge {
    pub fn new(scene: &Scene) -> Self {
        Judge { reference: Reference::new(scene) }
    }

    pub fn add(&self, ray: &Ray, truth: Option<&Truth>, answer: Option<Answer>, tally: &mut Tally) {
        tally.rays += 1;
        let line = exact(ray);
        // f32 would be excused for the other answer.
        let flipped = self.reference.verdict_occluded(&line, truth.is_none());
        tally.ambiguous +=
            u64::from(flipped != Verdict::Different { expected: None, expected_t: None } && is_excused(flipped));
        let met = answer.map(|answer| answer.primitive);
        if met != truth.map(|truth| truth.primitive) {
            // Beyond f64 the truth knows better: what is no tie is wrong.
            let tie = self.is_tie(ray, truth, met);
            tally.ties += u64::from(tie);
            tally.wrong += u64::from(!tie);
            if !tie {
                tally.note(f64::INFINITY, ray);
            }
        }
        if let (Some(truth), Some(answer)) = (truth, answer.filter(|_| met == truth.map(|truth| truth.primitive))) {
            self.measure(ray, truth, &answer, tally);
        }
    }

    /// Whether f64 cannot tell the answer from the right one.
    fn is_tie(&self, ray: &Ray, truth: Option<&Truth>, met: Option<usize>) -> bool {
        let line = exact(ray);
        let close = truth.is_some_and(|truth| truth.gap <= 1e-13 * truth.t.abs());
        (met.is_some() && close)
            || self.reference.verdict_exact(&line, met) != Verdict::Same
                && is_excused(self.reference.verdict_exact(&line, met))
            || self.reference.verdict_exact(&line, truth.map(|truth| truth.primitive)) == Verdict::Tie
    }

    fn measure(&self, ray: &Ray, truth: &Truth, answer: &Answer, tally: &mut Tally) {
        let bad = !answer.t.is_finite() || answer.normal.is_some_and(|normal| !normal.is_finite());
        tally.nan += u64::from(bad);
        if bad {
            return tally.note(f64::INFINITY, ray);
        }
        let error = (answer.t - truth.t).abs();
        let ulp = f64::from((truth.t.abs() as f32).next_up()) - f64::from(truth.t.abs() as f32);
        let unit = self.reference.unit(&exact(ray), truth.primitive, truth.t).unwrap_or(0.0);
        // Rounding the exact place costs half an ulp whatever the unit is.
        let unit = unit.max(U * truth.t.abs());
        tally.ulps.push(error / ulp);
        tally.units.push(if unit.is_finite() { error / unit } else { 0.0 });
        tally.note(error / unit, ray);
        if let Some(normal) = answer.normal {
            self.measure_normal(ray, truth, normal, unit, tally);
        }
    }

    fn measure_normal(&self, ray: &Ray, truth: &Truth, normal: DVec3, unit: f64, tally: &mut Tally) {
        let line = exact(ray);
        tally.length = tally.length.max((normal.length() - 1.0).abs() / U);
        let error = (normal.normalize() - truth.normal).length();
        let way = line.origin.length() + truth.t.abs() * line.dir.length();
        let allowed = (unit * line.dir.length() + U * way) / truth.bend + 2.0 * U;
        tally.normal = tally.normal.max(if allowed.is_finite() { error / allowed } else { 0.0 });
    }
}

fn is_excused(verdict: Verdict) -> bool {
    !matches!(verdict, Verdict::Different { .. })
}

impl Tally {
    pub fn new(engine: Engine) -> Self {
        Tally {
            engine,
            seconds: 0.0,
            rays: 0,
            wrong: 0,
            ties: 0,
            ambiguous: 0,
            nan: 0,
            ulps: Vec::new(),
            units: Vec::new(),
            normal: 0.0,
            length: 0.0,
            worst: (0.0, None),
        }
    }

    fn note(&mut self, error: f64, ray: &Ray) {
        if error > self.worst.0 || (error == f64::INFINITY && self.worst.1.is_none()) {
            let ([x, y, z], [a, b, c]) = (ray.origin, ray.dir);
            self.worst = (error, Some([x, y, z, ray.t_min, a, b, c, ray.t_max].map(f32::to_bits)));
        }
    }

    pub fn row(mut self, set: &Set) -> Row {
        let (ulp, unit) = (percentiles(&mut self.ulps), percentiles(&mut self.units));
        let sound = self.wrong == 0
            && self.nan == 0
            && ulp[2] <= MOST_ULPS
            && unit[2] <= MOST_UNITS[0]
            && unit[1] <= MOST_UNITS[1]
            && self.normal <= MOST_NORMAL[0]
            && self.length <= MOST_NORMAL[1];
        Row {
            family: set.family,
            parameter: set.parameter.clone(),
            engine: self.engine,
            rays: self.rays,
            wrong: self.wrong,
            ties: self.ties,
            ambiguous: self.ambiguous,
            nan: self.nan,
            ulp,
            unit,
            normal: self.normal,
            length: self.length,
            ns_per_ray: 1e9 * self.seconds / self.rays.max(1) as f64,
            worst: self.worst.1,
            pass: sound || self.engine == Engine::F32,
        }
    }
}

/// Median, 99th percentile, largest.
fn percentiles(values: &mut [f64]) -> [f64; 3] {
    values.sort_unstable_by(f64::total_cmp);
    let at = |share: f64| values.get((share * values.len().saturating_sub(1) as f64) as usize).copied().unwrap_or(0.0);
    [at(0.5), at(0.99), at(1.0)]
}
