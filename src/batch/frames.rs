//! Frames of an animation, as people write them.

/// Most frames of one command.
const MOST_FRAMES: usize = 1_000_000;

/// Frames in the order in which they are rendered, none twice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameList(
    /// Their numbers.
    pub Vec<i64>,
);

/// `1-100`, `1-100x2`, `1,5,10-20`, `-5--1`; commas or blanks between them. Backwards where the second one is less.
///
/// # Errors
/// What would be right.
///
/// Source: The Foundry, Nuke manual, "Defining frame ranges"; the documentation of Fileseq.
pub fn list(text: &str) -> Result<FrameList, String> {
    let wrong = || "should be frames such as 1-100, 1-100x2 (every second one) or 1,5,10-20".to_owned();
    let mut frames = Vec::new();
    for part in text.split([',', ' ']).filter(|part| !part.is_empty()) {
        let (first, last, step) = range(part).ok_or_else(wrong)?;
        let count = usize::try_from(first.abs_diff(last) / step.unsigned_abs()).unwrap_or(usize::MAX);
        if frames.len().saturating_add(count) >= MOST_FRAMES {
            return Err(format!("should be at most {MOST_FRAMES} frames"));
        }
        let way = if first <= last { step } else { -step };
        frames.extend((0..=count as i64).map(|index| first + index * way));
    }
    let mut seen = std::collections::HashSet::new();
    frames.retain(|frame| seen.insert(*frame));
    if frames.is_empty() { Err(wrong()) } else { Ok(FrameList(frames)) }
}

/// The first and last frame of a part, and its step.
fn range(part: &str) -> Option<(i64, i64, i64)> {
    let frame = |text: &str| text.parse::<i32>().ok().map(i64::from);
    let (frames, step) = part.split_once(['x', 'X']).map_or((part, Some(1)), |(frames, step)| (frames, frame(step)));
    // The dash of a range is the first one that does not begin a number.
    let dash = frames.char_indices().skip(1).find(|(_, c)| *c == '-').map(|(at, _)| at);
    let (first, last) = match dash {
        Some(at) => (frame(&frames[..at])?, frame(&frames[at + 1..])?),
        None => (frame(frames)?, frame(frames)?),
    };
    Some((first, last, step.filter(|step| *step > 0)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_read_or_explained() {
        let frames = |text| list(text).map(|list| list.0);
        assert_eq!(frames("1-10x3"), Ok(vec![1, 4, 7, 10]));
        assert_eq!(frames("1, 5,10-12 5"), Ok(vec![1, 5, 10, 11, 12]));
        assert_eq!(frames("-5--3"), Ok(vec![-5, -4, -3]));
        assert_eq!(frames("-1-1"), Ok(vec![-1, 0, 1]));
        assert_eq!(frames("9-1x4"), Ok(vec![9, 5, 1]));
        assert_eq!(frames("7"), Ok(vec![7]));
        for text in ["", ",", "a", "1-", "1-2x0", "1-2x-1", "1--", "-", "1-2-3", "1.5", "é-é", "99999999999"] {
            assert!(frames(text).is_err(), "{text}");
        }
        assert!(frames("1-1000001").unwrap_err().contains("at most"));
    }
}
