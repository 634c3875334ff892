//! The work that a render leaves out: what kinds of it there are, which of them this scene allows, and why.
//!
//! A new kind is a variant of [`Skip`] and its row in [`ROWS`]; whoever plans it calls [`Skips::decide`], whoever
//! leaves work out asks [`Skips::allows`] and counts in [`LeftOut`].

use std::ops::{Index, IndexMut};

use serde::Serialize;

/// A kind of work that may be left out. With or without, a picture is the same to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Skip {
    /// Kernels of kinds of primitives that are absent.
    Kinds,
    /// The tree, where there is little to be met.
    Tree,
    /// Camera rays that can only see the background.
    Background,
    /// Primitives that reach no pixel.
    Objects,
    /// Lights that give nothing to anything in the scene.
    Lights,
    /// Shadow rays where nothing can stand in the way.
    Occlusion,
    /// Shadow rays where a light gives nothing whether something is in its way or not.
    Shadows,
    /// Rays that go on from hits, and all that they need of these.
    Bounces,
    /// Attributes of hits that no material in use asks for.
    Shading,
    /// Textures that no primitive shows.
    Textures,
    /// Layers beside the colour that nobody asked for.
    Layers,
}

/// Each kind with its name, and the word for what is counted of it; none where nothing is.
const ROWS: [(Skip, &str, Option<&str>); 11] = [
    (Skip::Kinds, "kinds", Some("kernels")),
    (Skip::Tree, "tree", None),
    (Skip::Background, "background", Some("camera rays")),
    (Skip::Objects, "objects", Some("primitives")),
    (Skip::Lights, "lights", Some("lights")),
    (Skip::Occlusion, "occlusion", Some("shadow rays")),
    (Skip::Shadows, "shadows", Some("shadow rays")),
    (Skip::Bounces, "bounces", None),
    (Skip::Shading, "shading", None),
    (Skip::Textures, "textures", Some("textures")),
    (Skip::Layers, "layers", Some("layers")),
];

impl Skip {
    /// The kind of a name.
    pub fn named(name: &str) -> Option<Skip> {
        ROWS.iter().find(|row| row.1 == name).map(|row| row.0)
    }

    /// All names.
    pub fn names() -> impl Iterator<Item = &'static str> {
        ROWS.iter().map(|row| row.1)
    }
}

/// Kinds of work that a user allows to be left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SkipSet(u32);

impl Default for SkipSet {
    fn default() -> Self {
        SkipSet::ALL
    }
}

impl SkipSet {
    /// Everything that is not needed.
    pub const ALL: SkipSet = SkipSet(!0);
    /// Nothing: all the work is done.
    pub const NONE: SkipSet = SkipSet(0);

    /// The set without one kind.
    pub fn without(self, skip: Skip) -> Self {
        SkipSet(self.0 & !(1 << skip as u32))
    }

    /// Whether a kind is in it.
    pub fn has(self, skip: Skip) -> bool {
        self.0 >> (skip as u32) & 1 == 1
    }
}

/// What one render leaves out.
#[derive(Debug, Clone)]
pub struct Skips {
    allowed: SkipSet,
    left_out: u32,
    why: [String; ROWS.len()],
    planned: LeftOut,
}

/// A kind of work that is left out, for a reader.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Skipped {
    /// Its name.
    pub what: &'static str,
    /// Why the picture does not need it.
    pub why: String,
    /// How much of it was left out so far, where that is counted.
    pub count: Option<u64>,
    /// What is counted.
    pub of: Option<&'static str>,
}

/// How much work of each kind was left out.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub struct LeftOut([u64; ROWS.len()]);

impl Skips {
    /// Nothing is left out yet.
    pub fn new(allowed: SkipSet) -> Self {
        Skips { allowed, left_out: 0, why: Default::default(), planned: LeftOut::default() }
    }

    /// Leaves out a kind of work if there is a reason and the user allows it; `count` of it are so at once.
    pub fn decide(&mut self, skip: Skip, count: u64, why: Option<String>) {
        self.left_out &= !(1 << skip as u32);
        if let Some(why) = why.filter(|_| self.allowed.has(skip)) {
            self.left_out |= 1 << skip as u32;
            self.why[skip as usize] = why;
            self.planned[skip] = count;
        }
    }

    /// Whether work of a kind is left out wherever the picture does not need it.
    #[inline(always)]
    pub fn allows(&self, skip: Skip) -> bool {
        self.allowed.has(skip)
    }

    /// Whether the plan found some that is not needed.
    pub fn leaves_out(&self, skip: Skip) -> bool {
        self.left_out >> (skip as u32) & 1 == 1
    }

    /// What is left out and why, with what a render counted.
    pub fn report(&self, counted: &LeftOut) -> Vec<Skipped> {
        let skipped = |(skip, what, of): &(Skip, &'static str, Option<&'static str>)| Skipped {
            what,
            why: self.why[*skip as usize].clone(),
            count: of.map(|_| self.planned[*skip] + counted[*skip]),
            of: *of,
        };
        ROWS.iter().filter(|row| self.leaves_out(row.0)).map(skipped).collect()
    }
}

impl LeftOut {
    /// Sums up.
    pub fn add(&mut self, other: &LeftOut) {
        self.0.iter_mut().zip(other.0).for_each(|(sum, count)| *sum += count);
    }
}

impl Index<Skip> for LeftOut {
    type Output = u64;
    fn index(&self, skip: Skip) -> &u64 {
        &self.0[skip as usize]
    }
}

impl IndexMut<Skip> for LeftOut {
    fn index_mut(&mut self, skip: Skip) -> &mut u64 {
        &mut self.0[skip as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_stands_in_its_own_row() {
        for (index, (skip, name, _)) in ROWS.into_iter().enumerate() {
            assert_eq!((skip as usize, Skip::named(name)), (index, Some(skip)));
        }
    }

    #[test]
    fn only_what_is_allowed_and_has_a_reason_is_left_out() {
        let mut skips = Skips::new(SkipSet::ALL.without(Skip::Lights));
        skips.decide(Skip::Lights, 3, Some("dark".into()));
        skips.decide(Skip::Shadows, 0, None);
        skips.decide(Skip::Textures, 2, Some("unused".into()));
        let mut counted = LeftOut::default();
        counted[Skip::Textures] = 5;
        let report = skips.report(&counted);
        assert_eq!(report.len(), 1);
        assert_eq!((report[0].what, report[0].count, report[0].of), ("textures", Some(7), Some("textures")));
        assert!(skips.leaves_out(Skip::Textures) && !skips.leaves_out(Skip::Lights));
    }
}
