//! Names given and names looked up.

use std::collections::HashMap;
use std::ops::Range;

use super::table::{Context, Item};
use crate::scene::error::{Place, shorten};

/// Names that a message lists.
const MOST_LISTED: usize = 12;
/// Characters of a name that are compared to find near ones.
const COMPARED: usize = 40;
/// Errors after which nobody reads suggestions any more.
const ENOUGH_ERRORS: usize = 100;

/// The names of one kind of thing, in the order in which they were given.
pub struct Names {
    /// Such as "material".
    kind: &'static str,
    list: Vec<String>,
    index: HashMap<String, (usize, Place)>,
}

impl Names {
    pub fn new(kind: &'static str) -> Self {
        Names { kind, list: Vec::new(), index: HashMap::new() }
    }

    /// Gives a name to the next index; `None` and an error where it is taken.
    pub fn give(&mut self, name: &str, context: Context<'_>, span: &Range<usize>) -> Option<usize> {
        if let Some((_, first)) = self.index.get(name) {
            let rule = format!("{} {:?} is named twice", self.kind, shorten(name));
            context.fail_with_help(span, rule, format!("the first one is at {first}"));
            return None;
        }
        let next = self.list.len();
        self.list.push(name.to_owned());
        self.index.insert(name.to_owned(), (next, context.place(span)));
        Some(next)
    }

    /// The index of the name that a value holds.
    pub fn find(&self, item: &Item<'_>) -> Option<usize> {
        let Some(name) = item.value.as_str() else {
            return item.wrong(&format!("must be the name of a {} in quotes", self.kind));
        };
        if let Some((index, _)) = self.index.get(name) {
            return Some(*index);
        }
        let log = item.context.log;
        if log.incomplete.get() {
            return None;
        }
        let known = || self.list.iter().map(String::as_str);
        let near = if log.count() < ENOUGH_ERRORS { did_you_mean(name, known()) } else { String::new() };
        let rule = match near.as_str() {
            "" => format!("there is no {} {:?}", self.kind, shorten(name)),
            _ => format!("there is no {} {:?}: {near}", self.kind, shorten(name)),
        };
        let help = match self.list.len() {
            0 => format!("the scene has no {}s", self.kind),
            n if n > MOST_LISTED => format!("the scene has {n} {}s", self.kind),
            _ => format!("{}s of the scene: {}", self.kind, known().map(shorten).collect::<Vec<_>>().join(", ")),
        };
        item.context.fail_with_help(&item.span, rule, help);
        None
    }

    pub fn into_list(self) -> Vec<String> {
        self.list
    }
}

/// `did you mean "radius"?`, or nothing where no name is near.
pub fn did_you_mean<'a>(word: &str, names: impl Iterator<Item = &'a str>) -> String {
    let word: Vec<char> = word.chars().take(COMPARED).collect();
    let most = (word.len() / 3).max(1);
    let mut near: Vec<_> = names.map(|name| (distance(&word, name), name)).filter(|(far, _)| *far <= most).collect();
    near.sort_by_key(|(far, _)| *far);
    let some: Vec<_> = near.iter().take(3).map(|(_, name)| format!("{name:?}")).collect();
    if some.is_empty() { String::new() } else { format!("did you mean {}?", some.join(" or ")) }
}

/// Letters to change, add, drop or swap with a neighbour to make one word of the other.
///
/// Source: Damerau, "A technique for computer detection and correction of spelling errors",
/// Communications of the ACM 7(3), 1964, in the form that edits no letter twice.
fn distance(a: &[char], b: &str) -> usize {
    let b: Vec<char> = b.chars().take(COMPARED).collect();
    let mut rows = vec![vec![0; b.len() + 1]; a.len() + 1];
    for i in 0..=a.len() {
        for j in 0..=b.len() {
            rows[i][j] = match (i, j) {
                (0, _) => j,
                (_, 0) => i,
                _ => {
                    let change = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
                    let least = change.min(rows[i - 1][j] + 1).min(rows[i][j - 1] + 1);
                    let swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
                    if swapped { least.min(rows[i - 2][j - 2] + 1) } else { least }
                }
            };
        }
    }
    rows[a.len()][b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_names_are_suggested() {
        let mean = |word| did_you_mean(word, ["radius", "center", "normal", "min"].into_iter());
        assert_eq!(mean("raduis"), "did you mean \"radius\"?");
        assert_eq!(mean("centre"), "did you mean \"center\"?");
        assert_eq!(mean("max"), "", "one letter of three must stay");
        assert_eq!(mean("mni"), "did you mean \"min\"?");
        assert_eq!(mean(&"x".repeat(100_000)), "");
        assert_eq!(did_you_mean("a", ["b", "c", "d", "e"].into_iter()), "did you mean \"b\" or \"c\" or \"d\"?");
    }
}
