//! What is known of a picture beside its pixels: where it comes from, and the run that made it.

use std::time::{Duration, SystemTime};

use super::exr::Attributes;
use crate::film::Window;
use crate::scene::Camera;

/// Where a picture comes from. All of it goes into an EXR header, the title also into a PNG.
///
/// Without a [`Run`], equal pictures become equal bytes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Description {
    /// The scene's file name or title: `render/scene`, and `Title` in a PNG.
    pub scene: Option<String>,
    /// A hash of the scene, in hexadecimal: `render/sceneHash`.
    pub scene_hash: Option<String>,
    /// The words of the command line that it was rendered with, beside those that say which pixels: `render/settings`.
    pub settings: Option<String>,
    /// The camera, for `worldToCamera`, `worldToNDC` and the screen window.
    pub camera: Option<Camera>,
    /// Samples per pixel: `render/spp` and `samplesPerPixel`.
    pub spp: Option<u32>,
    /// The seed of the samples: `render/seed`, as text, since a header has no 64-bit integers.
    pub seed: Option<u64>,
    /// The number of the frame: `render/frame`.
    pub frame: Option<i32>,
    /// The pixels that were rendered, where the picture has fewer because the others are transparent: `render/window`.
    pub rendered: Option<Window>,
    /// Frames per second as a fraction; readers assume 24/1 where it is absent, and so does `None` here.
    pub frames_per_second: Option<(i32, u32)>,
    /// Who owns the picture: `owner`.
    pub owner: Option<String>,
    /// Any words: `comments`.
    pub comments: Option<String>,
    /// The file's own name without extension; manifests beside it are named after it.
    pub file_stem: Option<String>,
    /// Attributes of the file that the picture was read from: written again, unless something here says otherwise.
    pub kept: Option<Attributes>,
    /// The run that made it; `None` leaves out everything that differs between two runs.
    pub run: Option<Run>,
}

/// What differs from run to run although the picture is the same.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// When the picture was done; written as UTC: `capDate` with `utcOffset` 0.
    pub date: SystemTime,
    /// Wall-clock seconds of the render: `render/seconds` and `renderTimeSeconds`.
    pub seconds: f64,
    /// Threads that rendered: `render/threads`.
    pub threads: u32,
    /// Rays traced, as text: `render/rays`.
    pub rays: Option<String>,
    /// Which shard of which number, "2/8", and which tile, "tile 2 of 4x3": `render/shard`.
    pub shard: Option<String>,
}

/// The name of the program and its version, as files state it.
pub fn software() -> String {
    format!("octray {}", env!("CARGO_PKG_VERSION"))
}

/// A moment as EXR writes it, "YYYY:MM:DD hh:mm:ss", in UTC; moments before 1970 become 1970.
///
/// The calendar is Hinnant's ("chrono-compatible low-level date algorithms", 2014, `civil_from_days`): years that
/// begin in March, so that the leap day comes last, in eras of 400 years or 146,097 days.
pub(super) fn utc(date: SystemTime) -> String {
    let seconds = date.duration_since(SystemTime::UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs();
    let (days, second) = (seconds / 86_400 + 719_468, seconds % 86_400); // days since 1 March of the year 0
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153; // from March
    let day = day - (153 * month + 2) / 5 + 1;
    let (year, month) = if month < 10 { (year, month + 3) } else { (year + 1, month - 9) };
    let (hour, minute, second) = (second / 3_600, second / 60 % 60, second % 60);
    format!("{:04}:{month:02}:{day:02} {hour:02}:{minute:02}:{second:02}", year + 400 * era)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let dates = [
            (0, "1970:01:01 00:00:00"),
            (951_782_399, "2000:02:28 23:59:59"),
            (951_782_400, "2000:02:29 00:00:00"),
            (951_868_800, "2000:03:01 00:00:00"),
            (1_709_210_096, "2024:02:29 12:34:56"),
            (4_107_542_400, "2100:03:01 00:00:00"),
        ];
        for (seconds, text) in dates {
            assert_eq!(utc(SystemTime::UNIX_EPOCH + Duration::from_secs(seconds)), text);
        }
        assert_eq!(utc(SystemTime::UNIX_EPOCH - Duration::from_secs(5)), "1970:01:01 00:00:00");
    }
}
