//! Whether a picture is there already: the file as a whole, not just its name.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use exr::meta::MetaData;
use exr::meta::attribute::{AttributeValue, Text};

use super::Job;
use super::ledger::{Ledgers, settings_hash};
use crate::output::{self, Format};
use crate::render::Renderer;
use crate::scene::inputs::{hex, sha256};

/// Whether a record tells, by hashes of the scene's files, of the settings and of the file, that the file of a job is
/// what the job would write.
pub fn is_recorded(job: &Job, files_hash: &str, ledgers: &Ledgers) -> bool {
    ledgers.entry(job).is_some_and(|entry| {
        let is_same = entry.scene_hash == files_hash && entry.settings_hash == settings_hash(job);
        is_same && file_hash(&job.output).as_deref() == Some(&entry.hash)
    })
}

/// Whether an EXR file tells it of itself: all its pixels are there, and its header names the same hash of the scene,
/// window, samples, seed and frame. A PNG says too little to be trusted.
pub fn is_current(job: &Job, renderer: &Renderer, scene_hash: &str) -> bool {
    job.format == Format::Exr && is_current_exr(job, renderer, scene_hash).unwrap_or(false)
}

fn file_hash(path: &Path) -> Option<String> {
    let mut file = File::open(path).ok()?;
    sha256(&mut file).ok().map(|hash| hex(&hash))
}

/// By the header, then by all pixels: a file that was cut short does not decode.
fn is_current_exr(job: &Job, renderer: &Renderer, scene_hash: &str) -> Option<bool> {
    let file = BufReader::new(File::open(&job.output).ok()?);
    let meta = MetaData::read_from_buffered(file, false).ok()?;
    let header = meta.headers.first()?;
    let other = &header.own_attributes.other;
    let word = |name: &str| match other.get(&Text::from_slice_unchecked(name.as_bytes()))? {
        AttributeValue::Text(text) => Some(text.to_string()),
        AttributeValue::I32(number) => Some(number.to_string()),
        _ => None,
    };
    let is = |name: &str, want: String| word(name) == Some(want);
    let is_same = is("render/sceneHash", scene_hash.to_owned())
        && is("render/spp", renderer.image().spp.to_string())
        && is("render/seed", renderer.pattern().to_string())
        && job.frame.is_none_or(|frame| is("render/frame", frame.to_string()));
    if !is_same {
        return Some(false);
    }
    let picture = output::read(&job.output).ok()?;
    let want = renderer.window().ok()?;
    // A transparent background may have been trimmed.
    let window = picture.window == want || (!job.settings.windows.is_crop() && want.holds(&picture.window));
    let size = (renderer.image().width, renderer.image().height) == picture.display;
    let layers = job.settings.layers.aovs.is_empty() || !picture.channels.is_empty();
    Some(size && window && layers && picture.is_whole())
}
