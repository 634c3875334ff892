//! Time a ray against the worst error, a dot a family and engine.

use std::fmt::Write;

use super::{Engine, StressReport};

const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 480.0;
/// Left, right, top, bottom.
const MARGINS: [f64; 4] = [70.0, 150.0, 30.0, 55.0];

/// An SVG picture of a report.
pub fn plot(report: &StressReport) -> String {
    let dots: Vec<(Engine, &str, f64, f64)> = report
        .rows
        .iter()
        .filter(|row| row.ns_per_ray > 0.0)
        .map(|row| (row.engine, row.family, row.ns_per_ray, row.unit[2].clamp(1e-3, 1e9)))
        .collect();
    let x = Axis::new(dots.iter().map(|dot| dot.2), MARGINS[0], WIDTH - MARGINS[1]);
    let y = Axis::new(dots.iter().map(|dot| dot.3), HEIGHT - MARGINS[3], MARGINS[2]);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{WIDTH}\" height=\"{HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"12\"><rect width=\"100%\" height=\"100%\" fill=\"white\"/>"
    );
    for decade in x.decades() {
        let at = x.place(10f64.powi(decade));
        let _ = write!(svg, "<path d=\"M{at:.1} {} V{}\" stroke=\"#ddd\"/>", MARGINS[2], HEIGHT - MARGINS[3]);
        let _ = write!(
            svg,
            "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">1e{decade}</text>",
            HEIGHT - MARGINS[3] + 18.0
        );
    }
    for decade in y.decades() {
        let at = y.place(10f64.powi(decade));
        let _ = write!(svg, "<path d=\"M{} {at:.1} H{}\" stroke=\"#ddd\"/>", MARGINS[0], WIDTH - MARGINS[1]);
        let _ =
            write!(svg, "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">1e{decade}</text>", MARGINS[0] - 8.0, at + 4.0);
    }
    let middle = (MARGINS[0] + WIDTH - MARGINS[1]) / 2.0;
    let _ = write!(svg, "<text x=\"{middle}\" y=\"{}\" text-anchor=\"middle\">ns a ray</text>", HEIGHT - 14.0);
    let _ = write!(svg, "<text x=\"{}\" y=\"18\">largest error of t, in what f32 cannot avoid</text>", MARGINS[0]);
    for (engine, family, ns, unit) in &dots {
        let (x, y, color) = (x.place(*ns), y.place(*unit), color(*engine));
        let _ = write!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{color}\" fill-opacity=\"0.6\"><title>{family}, {}: {ns:.0} \
             ns, {unit:.3}</title></circle>",
            engine.name()
        );
    }
    for (k, engine) in Engine::ALL.into_iter().enumerate() {
        let (x, y) = (WIDTH - MARGINS[1] + 20.0, MARGINS[2] + 20.0 * k as f64 + 10.0);
        let _ = write!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"5\" fill=\"{}\"/>", color(engine));
        let _ = write!(svg, "<text x=\"{}\" y=\"{}\">{}</text>", x + 12.0, y + 4.0, engine.name());
    }
    svg + "</svg>\n"
}

fn color(engine: Engine) -> &'static str {
    match engine {
        Engine::F32 => "#d55e00",
        Engine::Packet => "#0072b2",
        Engine::Single => "#009e73",
        Engine::Reference => "#666666",
    }
}

/// A logarithmic axis over some values.
struct Axis {
    low: f64,
    high: f64,
    from: f64,
    to: f64,
}

impl Axis {
    fn new(values: impl Iterator<Item = f64> + Clone, from: f64, to: f64) -> Self {
        let low = values.clone().fold(f64::INFINITY, f64::min).log10().floor();
        let high = values.fold(0.0, f64::max).log10().ceil();
        let (low, high) = if low.is_finite() && high > low { (low, high) } else { (0.0, 1.0) };
        Axis { low, high, from, to }
    }

    fn place(&self, value: f64) -> f64 {
        self.from + (value.log10() - self.low) / (self.high - self.low) * (self.to - self.from)
    }

    fn decades(&self) -> std::ops::RangeInclusive<i32> {
        self.low as i32..=self.high as i32
    }
}
