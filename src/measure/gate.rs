//! Judging one build of a renderer by another: exact counts, errors, and time by turns.
//!
//! Counts of work are exact, so they must be equal; a change is named. Errors against the reference may not grow. Time is
//! noisy, so both builds take turns on the spot, the older one twice a round: how far its two times of a round lie apart
//! is what noise alone does here and now, and decides how small a difference can be told.

use std::collections::BTreeMap;

use super::bench::median;

/// Numbers by name, such as `tests.box`.
pub type Numbers = BTreeMap<String, f64>;

/// Growth of an error that is let pass: what another order of roundings may do.
pub const ERROR_TOLERANCE: f64 = 0.01;

/// What differs between two lists of exact counts, a sentence each; a count that is missing is 0.
pub fn changes(before: &Numbers, after: &Numbers) -> Vec<String> {
    let names: std::collections::BTreeSet<&String> = before.keys().chain(after.keys()).collect();
    let change = |name: &String| {
        let (old, new) = (number(before, name), number(after, name));
        let share = if old > 0.0 { format!(" ({:+.2} %)", 100.0 * (new / old - 1.0)) } else { String::new() };
        (old != new).then(|| format!("{name} changed from {old} to {new}{share}"))
    };
    names.into_iter().filter_map(change).collect()
}

/// Errors that grew by more than [`ERROR_TOLERANCE`], a sentence each.
pub fn grown(before: &Numbers, after: &Numbers) -> Vec<String> {
    let growth = |(name, new): (&String, &f64)| {
        let old = number(before, name);
        // Also where one of them is no number.
        let kept = *new <= old * (1.0 + ERROR_TOLERANCE);
        (!kept).then(|| format!("{name} grew from {old:e} to {new:e}"))
    };
    after.iter().filter_map(growth).collect()
}

fn number(numbers: &Numbers, name: &str) -> f64 {
    numbers.get(name).copied().unwrap_or(0.0)
}

/// How long and how closely to look.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RaceSettings {
    /// Seconds, after which a race ends as it stands.
    pub budget: f64,
    /// Difference that is to be told, as a share; smaller ones are let pass as well.
    pub resolution: f64,
}

/// What came of a race.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Race {
    /// Time of the newer build over that of the older one: the median over all rounds.
    pub ratio: f64,
    /// The same of the older build over itself.
    pub self_ratio: f64,
    /// The largest ratio that noise explains.
    pub limit: f64,
    /// Spread of a round, as a share: 1.48 median absolute deviations.
    pub noise: f64,
    /// Rounds run.
    pub rounds: usize,
    /// Median time of the older build in seconds.
    pub seconds: f64,
}

/// Fewest and most rounds.
const ROUNDS: (usize, usize) = (15, 1000);
/// Standard errors of the median that noise may reach: with normal noise once in 30,000 races.
const SIGMAS: f64 = 4.0;

/// Lets two builds take turns; each closure runs one of them and tells its time in seconds. How long is decided by the noise
/// alone, never by the difference, so that looking again and again does not make noise look like a difference.
///
/// # Errors
/// Those of the closures.
pub fn race<E>(
    settings: RaceSettings,
    old: &mut dyn FnMut() -> Result<f64, E>,
    new: &mut dyn FnMut() -> Result<f64, E>,
) -> Result<Race, E> {
    let (mut differences, mut selves, mut times, mut spent) = (Vec::new(), Vec::new(), Vec::new(), 0.0);
    loop {
        // Who runs when changes from round to round.
        let (a, b, c) = match times.len() % 3 {
            0 => (old()?, new()?, old()?),
            1 => {
                let b = new()?;
                (old()?, b, old()?)
            }
            _ => {
                let (a, c) = (old()?, old()?);
                (a, new()?, c)
            }
        };
        spent += a + b + c;
        times.push((a * c).sqrt());
        differences.push((b * b / (a * c)).ln() / 2.0);
        selves.push((c / a).ln());
        let race = judge(settings, &differences, &selves, &times);
        let sharp = race.limit <= 1.0 + settings.resolution;
        if times.len() >= ROUNDS.0 && (sharp || spent >= settings.budget || times.len() >= ROUNDS.1) {
            return Ok(race);
        }
    }
}

fn judge(settings: RaceSettings, differences: &[f64], selves: &[f64], times: &[f64]) -> Race {
    let rounds = differences.len();
    // A difference is of one time against the mean of two, a pair against itself of one against one: variances 3/2 and 2.
    let noise = (deviation(selves) * 0.75f64.sqrt()).max(deviation(differences));
    // The standard error of a median is sqrt(pi/2) times that of a mean.
    let root = (rounds as f64).sqrt();
    let error = 1.2533 * noise / root;
    // Of few rounds the noise itself is not well known, and a race ends when it happens to look small.
    let limit = (SIGMAS * error * (1.0 + 1.0 / root)).max(settings.resolution / 2.0);
    Race {
        ratio: median(differences).exp(),
        self_ratio: median(selves).exp(),
        limit: limit.exp(),
        noise,
        rounds,
        seconds: median(times),
    }
}

/// The standard deviation of normal values, judged by their median absolute deviation, which outliers do not change.
fn deviation(values: &[f64]) -> f64 {
    let middle = median(values);
    1.4826 * median(&values.iter().map(|value| (value - middle).abs()).collect::<Vec<_>>())
}

impl Race {
    /// Whether the newer build is slower than noise explains.
    pub fn is_slower(&self) -> bool {
        self.ratio > self.limit
    }

    /// Whether it is faster than noise explains.
    pub fn is_faster(&self) -> bool {
        self.ratio * self.limit < 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::Dice;

    fn numbers(pairs: &[(&str, f64)]) -> Numbers {
        pairs.iter().map(|(name, value)| (name.to_string(), *value)).collect()
    }

    #[test]
    fn every_change_of_a_count_is_named() {
        let before = numbers(&[("rays.camera", 100.0), ("tests.box", 800.0), ("tests.disk", 0.0)]);
        assert!(changes(&before, &before).is_empty());
        let after = numbers(&[("rays.camera", 100.0), ("tests.box", 1000.0), ("tests.sphere", 5.0)]);
        let named = changes(&before, &after);
        let box_line = "tests.box changed from 800 to 1000 (+25.00 %)";
        assert_eq!(named, [box_line, "tests.sphere changed from 0 to 5"]);
        assert_eq!(changes(&after, &before).len(), 2);
    }

    #[test]
    fn errors_may_shrink_but_not_grow() {
        let before = numbers(&[("rel_rmse", 1e-6), ("different", 0.0)]);
        assert!(grown(&before, &numbers(&[("rel_rmse", 1.005e-6), ("different", 0.0)])).is_empty());
        assert!(grown(&before, &numbers(&[("rel_rmse", 0.0)])).is_empty());
        let worse = grown(&before, &numbers(&[("rel_rmse", f64::NAN), ("different", 1.0)]));
        assert_eq!(worse, ["different grew from 0e0 to 1e0", "rel_rmse grew from 1e-6 to NaN"]);
    }

    /// A clock that drifts, jitters, and now and then is far off, as that of a busy machine.
    fn clock(dice: &mut Dice, jitter: f64) -> f64 {
        let normal = (0..12).map(|_| dice.unit()).sum::<f64>() - 6.0;
        let outlier = if dice.unit() < 0.05 { 1.0 + dice.unit() } else { 1.0 };
        0.2 * (jitter * normal).exp() * outlier
    }

    fn simulated(seed: u64, jitter: f64, slower: f64) -> Race {
        let dice = std::cell::RefCell::new(Dice(seed));
        let settings = RaceSettings { budget: 120.0, resolution: 0.04 };
        let mut old = || Ok::<f64, ()>(clock(&mut dice.borrow_mut(), jitter));
        race(settings, &mut old, &mut || Ok(slower * clock(&mut dice.borrow_mut(), jitter))).unwrap()
    }

    #[test]
    fn the_same_build_passes_and_a_tenth_more_time_fails() {
        for jitter in [0.002, 0.01, 0.03, 0.08] {
            for seed in 0..200 {
                let same = simulated(seed, jitter, 1.0);
                assert!(!same.is_slower() && !same.is_faster(), "jitter {jitter}, seed {seed}: {same:?}");
                let slow = simulated(seed, jitter, 1.1);
                assert!(slow.is_slower(), "jitter {jitter}, seed {seed}: {slow:?}");
                assert!(simulated(seed, jitter, 1.0 / 1.1).is_faster());
            }
        }
    }

    #[test]
    fn a_failure_of_a_build_ends_the_race() {
        let settings = RaceSettings { budget: 1.0, resolution: 0.04 };
        assert_eq!(race(settings, &mut || Err("gone"), &mut || Ok(1.0)), Err("gone"));
    }
}
