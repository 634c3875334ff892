//! The stress families, in short.

use octray::measure::stress::{StressSettings, names, stress};

#[test]
fn all_families_keep_every_bound() {
    let report = stress(&StressSettings { family: None, seed: 0, rays: 32 });
    let broken: Vec<String> = report.rows.iter().filter(|row| !row.pass).map(|row| format!("{row:?}")).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    assert!(report.trials.iter().all(|trial| trial.wrong == 0 && trial.rays > 10), "{report}");
    assert!(report.pass, "{report}");
    let families: std::collections::HashSet<_> = report.rows.iter().map(|row| row.family).collect();
    assert!(families.len() + report.trials.len() == names().len() && families.len() >= 28, "{report}");
    // What is judged must be hard: f32 alone gets some of it wrong, and hits must be there to be measured.
    let wrong: u64 = report.rows.iter().filter(|row| row.engine.name() == "f32").map(|row| row.wrong).sum();
    assert!(wrong > 20 && report.rows.iter().filter(|row| row.ulp[2] > 0.0).count() > 100, "{report}");
}

/// Where the engine once failed, with more rays and other seeds than above.
#[test]
fn what_was_hard_to_get_right_stays_so() {
    for family in ["mesh seams", "box", "cone tip", "scale"] {
        for seed in [11, 12] {
            let report = stress(&StressSettings { family: Some(family.into()), seed, rays: 160 });
            assert!(report.pass && report.rows.len() >= 4, "{report}");
        }
    }
}
