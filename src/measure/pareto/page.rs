//! What a sweep looks like: a table for machines, a page for people.

use std::fmt::Write;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;

use super::{Point, Sweep, engine_name, filter_name};
use crate::measure::plot::{Chart, Series, Style};
use crate::output::{Description, png};

/// All points as CSV with a header.
pub fn csv(sweeps: &[Sweep]) -> String {
    let mut table =
        "scene,series,engine,certified,filter,triangles_per_sphere,spp,seconds,wall_seconds,rmse,rel_mse,max,front\n"
            .to_owned();
    for sweep in sweeps {
        let name = quoted(&sweep.name);
        for point in &sweep.points {
            let Point { series, engine, certified, filter, triangles, spp, .. } = point;
            let Point { seconds, wall_seconds, rmse, rel_mse, max, front, .. } = point;
            let (engine, filter) = (engine_name(*engine), filter_name(*filter));
            let triangles = triangles.map_or(String::new(), |count| count.to_string());
            // Writing to a string cannot fail.
            let _ = writeln!(
                table,
                "{name},{series},{engine},{certified},{filter},{triangles},{spp},{seconds:e},{wall_seconds:e},{rmse:e},{rel_mse:e},\
                 {max:e},{front}"
            );
        }
    }
    table
}

fn quoted(text: &str) -> String {
    let plain = text.chars().all(|c| !matches!(c, ',' | '"' | '\n' | '\r'));
    if plain { text.to_owned() } else { format!("\"{}\"", text.replace('"', "\"\"")) }
}

impl Sweep {
    /// A plot of one error against time.
    pub fn chart(&self, title: &str, error: fn(&Point) -> f64) -> Chart {
        let mut chart = Chart::new(title, "CPU seconds (plan, tree, tracing)", "error");
        for name in self.series() {
            let points = self.points.iter().filter(|point| point.series == name);
            chart.series.push(Series::line(name, points.map(|point| (point.seconds, error(point))).collect()));
        }
        let mut front: Vec<(f64, f64)> =
            self.points.iter().filter(|point| point.front).map(|point| (point.seconds, error(point))).collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0));
        chart.series.push(Series { name: "front (RMSE)".into(), points: front, style: Style::Front });
        chart
    }

    /// The three plots: file stem and plot.
    pub fn charts(&self) -> [(&'static str, Chart); 3] {
        [
            ("rmse", self.chart("RMSE against time", |point| point.rmse)),
            ("rel_mse", self.chart("Relative MSE against time", |point| point.rel_mse)),
            ("max", self.chart("Largest error against time", |point| point.max)),
        ]
    }
}

const STYLE: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:#1c1c1c;background:#fff;max-width:1000px;margin:2rem auto;padding:0 1.2rem}\
h1{font-size:1.7rem;margin-bottom:.2rem}h2{margin:2.6rem 0 .6rem;font-size:1.3rem;border-top:1px solid #ddd;padding-top:1.6rem}\
.sub{color:#555;margin-top:0}.top{display:flex;gap:1.4rem;align-items:flex-start;flex-wrap:wrap}\
.top img{width:300px;height:auto;border-radius:4px;image-rendering:auto}.top div{flex:1;min-width:260px}\
svg{width:100%;height:auto}figure{margin:1.2rem 0}table{border-collapse:collapse;font-size:.88rem;width:100%}\
th,td{text-align:right;padding:.22rem .6rem;border-bottom:1px solid #eee;font-variant-numeric:tabular-nums}\
th:first-child,td:first-child{text-align:left}tr.front td{background:#f0f6fb;font-weight:600}\
details{margin:.8rem 0}summary{cursor:pointer;color:#0058a3}";

/// A page that needs nothing beside it: pictures, plots and tables of all scenes.
pub fn page(sweeps: &[Sweep], machine: &str) -> String {
    let mut page = String::from("<!doctype html><html lang=\"en\"><meta charset=\"utf-8\">");
    let _ = write!(
        page,
        "<meta name=\"viewport\" content=\"width=device-width\"><title>Run time against error</title>\
         <style>{STYLE}</style><h1>Run time against error</h1><p class=\"sub\">octray {} on {}</p>\
         <p>Every point is the same picture made in another way, and how far it is from a converged one. Down and to the left \
         is better; ringed points are the <b>front</b>: nothing else is both faster and nearer to the truth.</p>",
        env!("CARGO_PKG_VERSION"),
        escaped(machine),
    );
    sweeps.iter().for_each(|sweep| page.push_str(&section(sweep)));
    page.push_str(NOTES);
    page
}

const NOTES: &str = "<h2>How it was measured</h2><ul>\
<li>RMSE and largest error are of linear values, relative MSE is the mean of (a - b)<sup>2</sup> / (b<sup>2</sup> + 0.01).</li>\
<li>The converged picture was made by the packet engine with another seed, so it shares no sample with what it judges. Other \
filters are another picture, so they have a converged one of their own.</li>\
<li>Seconds are CPU time of all threads for planning, building the tree and tracing, the best of up to three; reading and \
writing files are not in it. The CSV file has wall time as well.</li>\
<li>Not certified: what f32 leaves open is not decided in f64. Single rays draw the same bits as packets: the same errors, later. The f64 reference is brute force.</li>\
<li>Spheres as triangles carry the sphere's normals at their corners; their errors end where the shape itself is wrong.</li>\
</ul></html>\n";

fn section(sweep: &Sweep) -> String {
    let window = sweep.converged.window;
    let mut text = format!("<h2>{}</h2><div class=\"top\">{}<div><p>", escaped(&sweep.name), thumbnail(sweep));
    let _ = write!(
        text,
        "{} x {} pixels, threads: {}. The converged picture has {} samples per pixel and took {:.1} s.",
        window.width(),
        window.height(),
        sweep.threads,
        sweep.converged_spp,
        sweep.converged_seconds,
    );
    if let Some(rate) = sweep.rate().filter(|rate| *rate < 0.0) {
        let _ = write!(
            text,
            " Along the packet series the RMSE falls as time<sup>{rate:.2}</sup>: halving it takes {:.1} times as long.",
            2f64.powf(-1.0 / rate),
        );
    }
    text.push_str("</p>");
    if !sweep.left_out.is_empty() {
        let items: String = sweep.left_out.iter().map(|line| format!("<li>{}</li>", escaped(line))).collect();
        let _ = write!(text, "<p>Left out:</p><ul>{items}</ul>");
    }
    text.push_str("</div></div>");
    let [rmse, others @ ..] = sweep.charts();
    let _ = write!(text, "<figure>{}</figure><h3>The front</h3>", rmse.1.svg());
    text.push_str(&table(sweep.points.iter().filter(|point| point.front)));
    text.push_str("<details><summary>Relative MSE and largest error</summary>");
    others.iter().for_each(|(_, chart)| text.push_str(&format!("<figure>{}</figure>", chart.svg())));
    text.push_str("</details><details><summary>All points</summary>");
    text.push_str(&table(sweep.points.iter()));
    text + "</details>"
}

fn table<'a>(points: impl Iterator<Item = &'a Point>) -> String {
    let mut points: Vec<&Point> = points.collect();
    points.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    let head = "<table><tr><th>how</th><th>samples per pixel</th><th>CPU seconds</th><th>RMSE</th><th>relative MSE</th>\
        <th>largest</th></tr>";
    let row = |point: &&Point| {
        let Point { series, spp, seconds, rmse, rel_mse, max, front, .. } = point;
        let class = if *front { " class=\"front\"" } else { "" };
        let series = escaped(series);
        format!(
            "<tr{class}><td>{series}</td><td>{spp}</td><td>{seconds:.4}</td><td>{rmse:.2e}</td><td>{rel_mse:.2e}</td>\
             <td>{max:.2e}</td></tr>"
        )
    };
    let rows: String = points.iter().map(row).collect();
    format!("{head}{rows}</table>")
}

/// The converged picture as a part of the page.
fn thumbnail(sweep: &Sweep) -> String {
    let encoded = png::encode(&sweep.converged, png::Coding::default(), &Description::default());
    let bytes = encoded.map(|(bytes, _)| BASE64_STANDARD.encode(bytes)).unwrap_or_default();
    format!("<img alt=\"the converged picture\" src=\"data:image/png;base64,{bytes}\">")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
