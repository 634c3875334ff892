//! The stress atlas: what f32 is bad at, family by family, against numbers of 320 bits.
//!
//! Source of the families and bounds: what textbook formulas and f32 prototypes get wrong, as the literature has it
//! (Haines, Günther and Akenine-Möller, *Ray Tracing Gems*, 2019, chapter 7; Woop, Benthin and Wald, JCGT 2(1),
//! 2013; Ize, JCGT 2(2), 2013; Pharr, Jakob and Humphreys, *Physically Based Rendering*, 4th edition, 6.8).
//!
//! | file | what it says |
//! |---|---|
//! | `families` | scenes and rays |
//! | `truth` | what those meet, beyond f64 |
//! | `engines` | who is asked |
//! | `score` | how far off an answer is |
//! | `trials` | what is no family: broken rays, live lanes, mirrored scenes, rays that leave surfaces |
//! | `table`, `plot` | what came of it |

mod dice;
mod engines;
mod families;
mod plot;
mod score;
mod table;
mod trials;
mod truth;

use rayon::prelude::*;
use serde::Serialize;

pub use self::engines::Engine;
pub use self::plot::plot;
pub use self::trials::Trial;

use self::engines::Asked;
use self::families::Set;
use self::score::Tally;

/// What is run.
#[derive(Debug, Clone)]
pub struct StressSettings {
    /// Only families and trials whose name holds this.
    pub family: Option<String>,
    /// Draws other shapes and rays of the same families.
    pub seed: u64,
    /// Rays of each value of a parameter.
    pub rays: usize,
}

impl Default for StressSettings {
    fn default() -> Self {
        StressSettings { family: None, seed: 0, rays: 480 }
    }
}

/// One line of the table.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// Its name.
    pub family: &'static str,
    /// The value of its parameter.
    pub parameter: String,
    /// Who was asked.
    pub engine: Engine,
    /// Rays asked.
    pub rays: u64,
    /// Other primitives than in exact geometry, hits for misses and misses for hits, but for ties.
    pub wrong: u64,
    /// Other answers that f64 cannot tell apart from the right one.
    pub ties: u64,
    /// Rays whose hit or miss no f32 kernel could tell.
    pub ambiguous: u64,
    /// Numbers that are none.
    pub nan: u64,
    /// Error of `t` in ulps of f32: median, 99th percentile, largest.
    pub ulp: [f64; 3],
    /// Error of `t` over what f32 kernels cannot avoid: the same.
    pub unit: [f64; 3],
    /// Largest error of normals over what f32 kernels cannot avoid.
    pub normal: f64,
    /// Largest difference of a normal's length from 1, in roundings of f32.
    pub length: f64,
    /// Time a ray, all there is to know of hits included; noisy.
    pub ns_per_ray: f64,
    /// Origin, t_min, direction, t_max of the worst ray, as bits of f32.
    pub worst: Option<[u32; 8]>,
    /// Whether all bounds hold; f32 alone is not judged.
    pub pass: bool,
}

/// All lines, and the trials.
#[derive(Debug, Clone, Serialize)]
pub struct StressReport {
    /// Version of these names.
    pub schema: u32,
    /// Whether all bounds hold.
    pub pass: bool,
    /// Seed of the shapes and rays.
    pub seed: u64,
    /// By family, parameter and engine.
    pub rows: Vec<Row>,
    /// What is no family.
    pub trials: Vec<Trial>,
}

/// The names of all families and trials.
pub fn names() -> Vec<&'static str> {
    families::all().iter().map(|family| family.name).chain(trials::NAMES).collect()
}

/// Runs what is wanted.
pub fn stress(settings: &StressSettings) -> StressReport {
    let wanted = |name: &str| settings.family.as_ref().is_none_or(|part| name.contains(part.as_str()));
    let families = families::all().into_iter().filter(|family| wanted(family.name));
    let sets: Vec<Set> = families.flat_map(|family| family.sets(settings.seed, settings.rays)).collect();
    let rows: Vec<Row> = sets.par_iter().flat_map_iter(judge).collect();
    let trials = trials::run(settings.seed, settings.rays, &wanted);
    let pass = rows.iter().all(|row| row.pass) && trials.iter().all(|trial| trial.wrong == 0);
    StressReport { schema: 1, pass, seed: settings.seed, rows, trials }
}

fn judge(set: &Set) -> Vec<Row> {
    let mut tallies = Engine::ALL.map(Tally::new);
    for (scene, rays) in &set.cases {
        let truths: Vec<_> = rays.iter().map(|ray| truth::closest(scene, ray)).collect();
        let judge = score::Judge::new(scene);
        for tally in &mut tallies {
            let start = std::time::Instant::now();
            let asked = Asked::new(tally.engine, scene);
            tally.seconds -= start.elapsed().as_secs_f64();
            let answers = asked.closest(rays);
            tally.seconds += start.elapsed().as_secs_f64();
            for ((ray, truth), answer) in rays.iter().zip(&truths).zip(answers) {
                judge.add(ray, truth.as_ref(), answer, tally);
            }
        }
    }
    tallies.into_iter().map(|tally| tally.row(set)).collect()
}
