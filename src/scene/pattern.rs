//! Names of files that stand for one file a frame: `particles.####.npy`.
//!
//! Source: the notations of compositing programs as the documentation of Fileseq lists them; here `#` alone is four
//! digits, and `##`, `###`, ... are as many as there are, as `@`, `@@`, ... are where they stand apart.

/// The name for a frame: its first `#...`, `%04d`, `$F4` or `@@@@` replaced by the frame's number with so many digits; `None`
/// where the name has none.
pub fn name(pattern: &str, frame: i64) -> Option<String> {
    let hashes = || {
        let start = pattern.find('#')?;
        let length = pattern[start..].chars().take_while(|c| *c == '#').count();
        Some((start, length, if length == 1 { 4 } else { length }))
    };
    let (start, length, digits) =
        hashes().or_else(|| printf(pattern)).or_else(|| variable(pattern)).or_else(|| ats(pattern))?;
    let sign = if frame < 0 { "-" } else { "" };
    let number = format!("{sign}{:0digits$}", frame.unsigned_abs());
    Some([&pattern[..start], &number, &pattern[start + length..]].concat())
}

/// `%d` or `%04d`: where, how long, how many digits.
fn printf(pattern: &str) -> Option<(usize, usize, usize)> {
    pattern.match_indices('%').find_map(|(start, _)| {
        let digits = leading_digits(&pattern[start + 1..]);
        let width = if digits.is_empty() { Some(1) } else { digits.strip_prefix('0')?.parse().ok() };
        let ends = pattern[start + 1 + digits.len()..].starts_with('d');
        Some((start, digits.len() + 2, width.filter(|width| ends && *width < 20)?))
    })
}

/// `$F` or `$F4`.
fn variable(pattern: &str) -> Option<(usize, usize, usize)> {
    let start = pattern.find("$F")?;
    let digits: String = leading_digits(&pattern[start + 2..]).chars().take(1).collect();
    Some((start, 2 + digits.len(), digits.parse().unwrap_or(1)))
}

/// `@@@`: between what is no letter and no digit, since `me@home.npy` is a name like others.
fn ats(pattern: &str) -> Option<(usize, usize, usize)> {
    let rest = pattern.trim_start_matches(|c| c != '@');
    let (start, length) = (pattern.len() - rest.len(), rest.len() - rest.trim_start_matches('@').len());
    let apart = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric());
    let is_apart = apart(pattern[..start].chars().next_back()) && apart(rest[length..].chars().next());
    (length > 0 && is_apart).then_some((start, length, length))
}

fn leading_digits(text: &str) -> &str {
    &text[..text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len())]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_notation_is_known() {
        let names = ["a.#.npy", "a.####.npy", "a.##.npy", "a%04d.npy", "a.%d", "a.$F4.exr", "a.$F.exr", "a_@@@.exr"];
        let want = ["a.0007.npy", "a.0007.npy", "a.07.npy", "a0007.npy", "a.7", "a.0007.exr", "a.7.exr", "a_007.exr"];
        assert_eq!(names.map(|pattern| name(pattern, 7).unwrap()), want);
        assert_eq!(name("a.####.npy", 12_345).as_deref(), Some("a.12345.npy"));
        assert_eq!(name("a.####.npy", -3).as_deref(), Some("a.-0003.npy"));
        for plain in ["a.npy", "100%.npy", "5%4d.npy", "%", "$", "é", "%0d", "%099999999999999999999d", "me@home.npy"]
        {
            assert_eq!(name(plain, 7), None, "{plain}");
        }
    }
}
