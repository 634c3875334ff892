//! Plots of lines and points on two logarithmic axes, as SVG that needs no fonts to be made and none but the viewer's to be
//! read.

use std::fmt;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// Size in pixels.
const SIZE: (u32, u32) = (760, 480);
/// Colours that the colour-blind can tell apart: Okabe and Ito, "Color universal design", 2008.
const COLORS: [RGBColor; 10] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
    RGBColor(140, 140, 140),
    RGBColor(140, 86, 26),
    RGBColor(106, 61, 154),
];
const FONT: &str = "sans-serif";

/// A plot.
#[derive(Debug, Clone)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// What the horizontal axis counts.
    pub x: String,
    /// What the vertical axis counts.
    pub y: String,
    /// What is in it, the first at the bottom.
    pub series: Vec<Series>,
}

/// Points that belong together.
#[derive(Debug, Clone)]
pub struct Series {
    /// For the legend.
    pub name: String,
    /// Points; those that are not above 0 on both axes are left out.
    pub points: Vec<(f64, f64)>,
    /// How they are drawn.
    pub style: Style,
}

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Dots with a line through them.
    Line,
    /// Dots alone.
    Dots,
    /// Rings around dots of other series, joined by a dark line.
    Front,
}

impl Series {
    /// Dots with a line through them.
    pub fn line(name: impl Into<String>, points: Vec<(f64, f64)>) -> Self {
        Series { name: name.into(), points, style: Style::Line }
    }

    fn drawn(&self) -> impl Iterator<Item = (f64, f64)> {
        self.points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite() && *x > 0.0 && *y > 0.0)
    }
}

impl Chart {
    /// Nothing yet.
    pub fn new(title: &str, x: &str, y: &str) -> Self {
        Chart { title: title.into(), x: x.into(), y: y.into(), series: Vec::new() }
    }

    /// The plot as an SVG document; says so where there is nothing to draw.
    pub fn svg(&self) -> String {
        let mut svg = String::new();
        // Drawing into a string fails only where an axis is no axis, and those below are.
        if self.draw(&mut svg).is_err() {
            svg = format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\"><text y=\"20\">{}: no points</text></svg>",
                self.title
            );
        }
        svg
    }

    fn draw(&self, svg: &mut String) -> Result<(), DrawingAreaErrorKind<impl std::error::Error + Send + Sync + use<>>> {
        let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        root.fill(&WHITE)?;
        let ([left, right], [low, high]) = (self.range(|p| p.0), self.range(|p| p.1));
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, (FONT, 19))
            .margin(12)
            .margin_right(24)
            .x_label_area_size(44)
            .y_label_area_size(72)
            .build_cartesian_2d((left..right).log_scale(), (low..high).log_scale())?;
        let label = |value: &f64| number(*value);
        chart
            .configure_mesh()
            .bold_line_style(RGBColor(215, 215, 215))
            .light_line_style(RGBColor(242, 242, 242))
            .axis_style(RGBColor(90, 90, 90))
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&label)
            .y_label_formatter(&label)
            .label_style((FONT, 13))
            .axis_desc_style((FONT, 15))
            .draw()?;
        for (i, series) in self.series.iter().enumerate() {
            let color = COLORS[i % COLORS.len()];
            let drawn = match series.style {
                Style::Front => {
                    chart.draw_series(series.drawn().map(|p| Circle::new(p, 7, BLACK.stroke_width(2))))?;
                    chart.draw_series(LineSeries::new(series.drawn(), BLACK.mix(0.6).stroke_width(1)))?
                }
                Style::Line => {
                    chart.draw_series(LineSeries::new(series.drawn(), color.stroke_width(2)))?;
                    chart.draw_series(series.drawn().map(|p| Circle::new(p, 4, color.filled())))?
                }
                Style::Dots => chart.draw_series(series.drawn().map(|p| Circle::new(p, 4, color.filled())))?,
            };
            let front = series.style == Style::Front;
            drawn.label(&series.name).legend(move |(x, y)| {
                let style = if front { BLACK.stroke_width(2) } else { color.filled() };
                Circle::new((x + 10, y), 5, style)
            });
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(200, 200, 200))
            .label_font((FONT, 13).into_font().into_text_style(&root).pos(Pos::new(HPos::Left, VPos::Top)))
            .draw()?;
        root.present()
    }

    /// The decades that hold all values, so that every axis has at least two labels.
    fn range(&self, axis: fn((f64, f64)) -> f64) -> [f64; 2] {
        let values = || self.series.iter().flat_map(|series| series.drawn().map(axis));
        let (least, most) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
        let decade = |value: f64, up: f64| 10f64.powf((value.log10() * up).floor() * up);
        if least > most { [0.1, 10.0] } else { [decade(least / 1.01, 1.0), decade(most * 1.01, -1.0)] }
    }
}

/// A number on an axis: powers of ten as such, others short.
fn number(value: f64) -> String {
    let digits = format!("{value:.1e}");
    match value {
        v if (1e-3..1e5).contains(&v) => format!("{}", (v * 1e6).round() / 1e6),
        _ => digits.replace(".0e", "e"),
    }
}

impl fmt::Display for Chart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.svg())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_shows_every_point_and_name() {
        let mut chart = Chart::new("Cost", "rays", "seconds");
        chart.series.push(Series::line("slow", vec![(1.0, 10.0), (100.0, 1000.0), (0.0, 1.0), (1.0, f64::NAN)]));
        chart.series.push(Series { style: Style::Dots, ..Series::line("fast", vec![(10.0, 1.0)]) });
        chart.series.push(Series { style: Style::Front, ..Series::line("front", vec![(10.0, 1.0)]) });
        let svg = chart.svg();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{svg}");
        for text in ["Cost", "rays", "seconds", "slow", "fast", "front"] {
            assert!(svg.contains(text), "{text}");
        }
        // Two dots, one dot, one ring, and one of each name.
        assert_eq!(svg.matches("<circle").count(), 2 + 1 + 1 + 3, "{svg}");
    }

    #[test]
    fn nothing_to_draw_is_a_plot_too() {
        let mut chart = Chart::new("Nothing", "x", "y");
        assert!(chart.svg().contains("Nothing"));
        chart.series.push(Series::line("zero", vec![(0.0, 0.0)]));
        assert!(chart.svg().contains("Nothing") && chart.to_string().starts_with("<svg"));
    }

    #[test]
    fn numbers_on_axes_are_short() {
        let short = [1e-9, 2.5e-4, 0.01, 1.0, 20000.0, 1e7].map(number);
        assert_eq!(short, ["1e-9", "2.5e-4", "0.01", "1", "20000", "1e7"]);
    }
}
