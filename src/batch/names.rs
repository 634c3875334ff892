//! Names of pictures: patterns with places for the scene, the camera, the frame and the job's number.

use std::path::PathBuf;

use super::{Job, View, stem};
use crate::scene::pattern;

/// The name of a job's picture. `{scene}` is the scene's name without its kind, `{camera}` that of the camera, `{job}`
/// the job's number with six digits, `####` (or any other notation of a frame's place) its frame.
///
/// # Errors
/// A pattern without a place for the frame where there are `many`.
pub fn name(pattern: &str, job: &Job, number: usize, many: bool) -> Result<PathBuf, String> {
    let camera = match &job.view {
        View::First => "camera",
        View::Named(name) => name,
        View::Given(camera) => camera.name.as_deref().unwrap_or("camera"),
    };
    let safe = |text: &str| text.replace(['/', '\\', '\0'], "_");
    // The frame first: a scene's own name may hold what looks like a place for it.
    let framed = pattern::name(pattern, job.frame());
    if many && framed.is_none() {
        let help = "say it like out.####.exr, or give --out-dir";
        return Err(format!("{pattern}: has no place for the number of the frame: {help}"));
    }
    let name = framed.unwrap_or_else(|| pattern.to_owned());
    let name = name.replace("{job}", &format!("{number:06}")).replace("{camera}", &safe(camera));
    Ok(PathBuf::from(name.replace("{scene}", &stem(&job.scene))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Format;

    #[test]
    fn patterns_have_places() {
        let job = Job {
            scene: "x/water.xyz.gz".into(),
            look: Default::default(),
            view: View::Named("top/left".into()),
            frame: Some(12),
            settings: Default::default(),
            output: PathBuf::new(),
            format: Format::Exr,
        };
        let name = |pattern: &str, many| name(pattern, &job, 3, many).map(|name| name.display().to_string());
        assert_eq!(name("{scene}.{camera}.####.exr", true).as_deref(), Ok("water.top_left.0012.exr"));
        assert_eq!(name("{job}.png", false).as_deref(), Ok("000003.png"));
        assert!(name("a.exr", true).unwrap_err().contains("has no place for the number of the frame"));
    }
}
