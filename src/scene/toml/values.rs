//! The kinds of values that keys hold: each function reads one, or notes what it should be.

use std::path::{Path, PathBuf};

use ::toml::de::DeValue;
use glam::{DQuat, DVec2, DVec3};

use super::keyed::{at_frame, is_keyed};
use super::table::Item;
use crate::scene::pattern;
use crate::scene::rules::{self, Rule};

/// A number that keeps a rule, or keys of such.
pub fn number(rule: Rule) -> impl Fn(&Item<'_>) -> Option<f64> + Copy {
    move |item| at_frame(item, |item| one(item, rule).map(|x| [x])).map(|[x]| x)
}

fn one(item: &Item<'_>, rule: Rule) -> Option<f64> {
    let Some(x) = as_f64(item.value) else { return item.wrong("must be a number") };
    rule.broken_by(x).map_or(Some(x), |text| item.wrong(text))
}

/// A whole number between two bounds, or keys of such; between keys it is rounded.
pub fn whole(least: u64, most: u64) -> impl Fn(&Item<'_>) -> Option<u64> + Copy {
    move |item| {
        if is_keyed(item) {
            let [x] = at_frame(item, |item| whole(least, most)(item).map(|x| [x as f64]))?;
            return Some((x.round() as u64).clamp(least, most));
        }
        let range = || match most {
            u64::MAX => format!("must be a whole number from {least} on, at most 2^64 - 1"),
            _ => format!("must be a whole number from {least} to {most}"),
        };
        let value = item.value.as_integer().and_then(|int| i128::from_str_radix(int.as_str(), int.radix()).ok());
        let whole = value.and_then(|value| u64::try_from(value).ok());
        whole.filter(|whole| (least..=most).contains(whole)).or_else(|| item.wrong(&range()))
    }
}

/// `true` or `false`.
pub fn flag(item: &Item<'_>) -> Option<bool> {
    item.value.as_bool().or_else(|| item.wrong("must be true or false"))
}

/// A text that is not empty.
pub fn text(item: &Item<'_>) -> Option<String> {
    let text = item.value.as_str().filter(|text| !text.is_empty());
    text.map(str::to_owned).or_else(|| item.wrong("must be a text in quotes"))
}

/// One of the given words.
pub fn choice<T: Copy>(words: &'static [(&'static str, T)]) -> impl Fn(&Item<'_>) -> Option<T> + Copy {
    move |item| {
        let found = item.value.as_str().and_then(|text| words.iter().find(|(word, _)| *word == text));
        let listed = || words.iter().map(|(word, _)| format!("{word:?}")).collect::<Vec<_>>().join(", ");
        let one_of = if words.len() > 1 { "one of " } else { "" };
        found.map(|(_, value)| *value).or_else(|| item.wrong(&format!("must be {one_of}{}", listed())))
    }
}

/// A coordinate triple.
pub fn point(item: &Item<'_>) -> Option<DVec3> {
    triple(item, Rule::COORDINATE)
}

/// Linear red, green, blue, >= 0.
pub fn color(item: &Item<'_>) -> Option<DVec3> {
    triple(item, Rule::COLOR)
}

/// A vector that is not zero, of any length.
pub fn direction(item: &Item<'_>) -> Option<DVec3> {
    let v = triple(item, Rule::FINITE)?;
    rules::direction_broken_by(v).map_or(Some(v), |text| item.wrong(text))
}

/// A size in each of x, y, z.
pub fn size(item: &Item<'_>) -> Option<DVec3> {
    triple(item, Rule::LENGTH)
}

fn triple(item: &Item<'_>, rule: Rule) -> Option<DVec3> {
    numbers(item, rule, "three numbers").map(DVec3::from_array)
}

/// Two numbers that keep a rule.
pub fn pair(rule: Rule) -> impl Fn(&Item<'_>) -> Option<[f64; 2]> + Copy {
    move |item| numbers(item, rule, "two numbers")
}

/// Texture coordinates.
pub fn uv(item: &Item<'_>) -> Option<DVec2> {
    pair(Rule::COORDINATE)(item).map(DVec2::from_array)
}

/// So many numbers that keep a rule, or keys of such; `what` says how many.
pub fn numbers<const N: usize>(item: &Item<'_>, rule: Rule, what: &str) -> Option<[f64; N]> {
    at_frame(item, |item| plain_numbers(item, rule, what))
}

fn plain_numbers<const N: usize>(item: &Item<'_>, rule: Rule, what: &str) -> Option<[f64; N]> {
    let text = || format!("must be {what} in brackets");
    let Some(elements) = item.elements().filter(|elements| elements.len() == N) else {
        return item.wrong(&text());
    };
    let mut values = [Some(0.0); N];
    for (value, element) in values.iter_mut().zip(elements) {
        *value = match as_f64(element.value) {
            Some(_) => one(&element, rule),
            None => element.wrong("must hold numbers"),
        };
    }
    let all: Option<Vec<f64>> = values.into_iter().collect();
    all?.try_into().ok()
}

/// An array of one kind of values.
pub fn list<T>(item: &Item<'_>, what: &str, read: impl Fn(&Item<'_>) -> Option<T>) -> Option<Vec<T>> {
    let Some(elements) = item.elements() else {
        return item.wrong(&format!("must be a list of {what}"));
    };
    // All elements are read before the list is judged, so that all their mistakes are noted.
    let read: Vec<_> = elements.map(|element| read(&element)).collect();
    read.into_iter().collect()
}

/// `{ axis, angle }` or `{ quaternion }`; `None` inside for the turn by nothing.
pub fn rotation(item: &Item<'_>) -> Option<Option<DQuat>> {
    let table = item.table()?;
    let (axis, angle) = (table.maybe("axis", direction), table.maybe("angle", number(Rule::FINITE)));
    let quaternion = table.maybe("quaternion", |item| numbers::<4>(item, Rule::COORDINATE, "four numbers"));
    let turn = match (axis?, angle?, quaternion?) {
        (Some(axis), Some(angle), None) => Some(DQuat::from_axis_angle(axis.normalize(), angle.to_radians())),
        (None, None, Some(q)) => {
            let q = DQuat::from_array(q);
            let length = q.length();
            // One that is unit already stays what it is to the bit, so that written scenes read back the same.
            let unit = (length - 1.0).abs() <= 16.0 * f64::EPSILON;
            match length > 1e-100 {
                true => Some(if unit { q } else { q / length }),
                false => table.item("quaternion")?.wrong("must not be zero"),
            }
        }
        (None, None, None) | (Some(_), None, None) | (None, Some(_), None) => {
            table.missing("\"axis\" and \"angle\", or \"quaternion\"")
        }
        _ => table.exclusive(
            "rotation is either by axis and angle or by quaternion".to_owned(),
            &["axis", "angle", "quaternion"],
        ),
    };
    table.finish();
    turn.map(|turn| (turn.w.abs() != 1.0).then_some(turn))
}

/// A file that is named: its path as written, and where it is.
#[derive(Clone)]
pub struct NamedFile {
    pub shown: String,
    pub path: PathBuf,
}

/// A path, relative to the file that names it. One that stands for a file a frame is that of the frame, unless
/// there is a file of this very name.
pub fn file(item: &Item<'_>) -> Option<NamedFile> {
    let name = item.value.as_str().filter(|name| !name.is_empty() && !name.contains('\0'));
    let Some(name) = name else { return item.wrong("must be a path in quotes") };
    let place = |name: &str| item.context.file.dir.join(Path::new(name));
    let literal = NamedFile { shown: name.to_owned(), path: place(name) };
    let at_frame = pattern::name(name, item.context.file.frame).filter(|_| !literal.path.exists());
    Some(at_frame.map_or(literal, |name| NamedFile { path: place(&name), shown: name }))
}

/// The value of a float or an integer.
pub fn as_f64(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        DeValue::Integer(int) if int.radix() == 10 => int.as_str().parse().ok(),
        DeValue::Integer(int) => u128::from_str_radix(int.as_str(), int.radix()).ok().map(|value| value as f64),
        _ => None,
    }
}
