//! What came of it, for people.

use std::fmt;

use super::{Row, StressReport, Trial};

impl fmt::Display for StressReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.rows.is_empty() {
            writeln!(
                f,
                "{:<20} {:>6} {:<9} {:>5} {:>5} {:>4} {:>5} {:>4}  {:^20}  {:^20} {:>6} {:>7}",
                "family",
                "value",
                "engine",
                "rays",
                "wrong",
                "ties",
                "ambig",
                "NaN",
                "ulp p50 p99 max",
                "unit p50 p99 max",
                "normal",
                "ns/ray"
            )?;
        }
        let mut last = ("", "");
        for row in &self.rows {
            let Row {
                family, parameter, engine, rays, wrong, ties, ambiguous, nan, ulp, unit, normal, ns_per_ray, ..
            } = row;
            let (name, value) = match last == (*family, parameter) {
                true => ("", ""),
                false => (*family, parameter.as_str()),
            };
            last = (*family, parameter);
            let three = |v: &[f64; 3]| format!("{} {} {}", short(v[0]), short(v[1]), short(v[2]));
            let mark = if row.pass { "" } else { "  FAIL" };
            writeln!(
                f,
                "{name:<20} {value:>6} {:<9} {rays:>5} {wrong:>5} {ties:>4} {ambiguous:>5} {nan:>4}  {:^20}  {:^20} {:>6} {ns_per_ray:>7.0}{mark}",
                engine.name(),
                three(ulp),
                three(unit),
                short(*normal)
            )?;
            if let Some(bits) = row.worst.filter(|_| !row.pass) {
                writeln!(f, "{:<20} worst ray {bits:08x?}", "")?;
            }
        }
        for Trial { name, rays, wrong, worst } in &self.trials {
            writeln!(f, "{name:<37} {rays:>6} rays {wrong:>5} wrong{}", if *wrong == 0 { "" } else { "  FAIL" })?;
            if let Some(bits) = worst {
                writeln!(f, "{:<20} first of them {bits:08x?}", "")?;
            }
        }
        let rays: u64 =
            self.rows.iter().map(|row| row.rays).sum::<u64>() + self.trials.iter().map(|t| t.rays).sum::<u64>();
        let failed =
            self.rows.iter().filter(|row| !row.pass).count() + self.trials.iter().filter(|t| t.wrong > 0).count();
        match self.pass {
            true => write!(f, "pass: {rays} answers, seed {}", self.seed),
            false => write!(f, "FAIL: {failed} lines are past a bound; {rays} answers, seed {}", self.seed),
        }
    }
}

/// Three figures or so.
fn short(x: f64) -> String {
    match x {
        0.0 => "0".into(),
        x if x < 0.005 => "0.00".into(),
        x if x < 10.0 => format!("{x:.2}"),
        x if x < 1000.0 => format!("{x:.0}"),
        x => format!("{x:.0e}"),
    }
}
