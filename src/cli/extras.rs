//! What is drawn beside a picture.

use octray::batch::Job;
use octray::measure::heatmap;
use octray::output::png;
use octray::render::Rendering;

use super::exit::{Exit, Failure};
use super::{Run, pictures};

/// Draws the cost layer of a job that asked for it: its own name with `.cost.png`.
pub fn write(job: &Job, rendering: &Rendering, run: &Run) -> Result<(), Failure> {
    if !job.settings.layers.cost || job.output.as_os_str() == "-" {
        return Ok(());
    }
    let (picture, name) = (&rendering.picture, job.output.with_extension("cost.png"));
    let tests = |name: &str| picture.channel(name).and_then(|channel| channel.samples.floats()).unwrap_or_default();
    let (boxes, prims) = (tests("cost.box"), tests("cost.prim"));
    let values: Vec<f64> = boxes.iter().zip(&*prims).map(|(a, b)| f64::from(*a) + f64::from(*b)).collect();
    let map = heatmap::map_of(&values, picture.window).map_err(|error| Failure::new(Exit::Output, error))?;
    let bytes = png::encode_raster(&map, "Box and primitive tests of each pixel")
        .map_err(|error| Failure::new(Exit::Output, error))?;
    pictures::write_bytes(&name, &bytes, run)?;
    run.console.note(&format!("{}: box and primitive tests of each pixel", name.display()));
    Ok(())
}
