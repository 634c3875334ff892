//! Values over time: `{ keys = [[1, 0.0], [24, 360.0]], interpolation = "smooth" }` in place of a number or vector.

use ::toml::de::DeValue;

use super::table::Item;
use super::values::choice;
use crate::scene::animation::{Interpolation, Key, Track, value};

const INTERPOLATIONS: &[(&str, Interpolation)] =
    &[("linear", Interpolation::Linear), ("smooth", Interpolation::Smooth), ("step", Interpolation::Step)];

/// Whether a value is given by keys.
pub fn is_keyed(item: &Item<'_>) -> bool {
    matches!(item.value, DeValue::Table(table) if table.get("keys").is_some())
}

/// Numbers that `plain` reads, or their keys at the frame that is being read; each key keeps the rules of `plain`.
pub fn at_frame<const N: usize>(item: &Item<'_>, plain: impl Fn(&Item<'_>) -> Option<[f64; N]>) -> Option<[f64; N]> {
    if !is_keyed(item) {
        return plain(item);
    }
    let table = item.table()?;
    let keys = table.need("keys", |list| keys(list, |value| plain(&value.called_as(item))));
    let interpolation = table.or("interpolation", Interpolation::default(), choice(INTERPOLATIONS));
    table.finish();
    let (keys, interpolation) = (keys?, interpolation?);
    let now = value(&keys, interpolation, item.context.file.frame as f64);
    item.context.log.animate(Track {
        part: None,
        key: item.key,
        keys: keys.into_iter().map(|(frame, value)| (frame, value.to_vec())).collect(),
        interpolation,
        now: now.to_vec(),
    });
    Some(now)
}

fn keys<const N: usize>(item: &Item<'_>, plain: impl Fn(&Item<'_>) -> Option<[f64; N]>) -> Option<Vec<Key<N>>> {
    let form = "must be a list of frames with their values, such as [[1, ...], [24, ...]]";
    let Some(elements) = item.elements().filter(|elements| elements.len() > 0) else { return item.wrong(form) };
    let mut last = f64::NEG_INFINITY;
    let mut key = |element: Item<'_>| {
        let pair: Option<Vec<Item<'_>>> = element.elements().map(Iterator::collect);
        let Some([frame, value]) = pair.as_deref() else { return element.wrong(form) };
        let Some(at) = super::values::as_f64(frame.value).filter(|at| at.is_finite()) else {
            return frame.wrong("must start with a frame, a number");
        };
        if at <= last {
            return frame.wrong("must ascend from frame to frame");
        }
        last = at;
        Some((at, plain(value)?))
    };
    // All are read before the list is judged, so that all their mistakes are noted.
    let read: Vec<_> = elements.map(&mut key).collect();
    read.into_iter().collect()
}
