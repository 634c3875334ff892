//! What waits to be opened.

use crate::lanes::{Float8, LANES};

/// Something that may hold hits from `entry` on.
#[derive(Debug, Clone, Copy, Default)]
pub struct Entry<T> {
    /// Place on the rays, at the earliest.
    pub entry: f32,
    /// What it is.
    pub what: T,
}

/// A stack of its own in a part of a longer one, which it does not outgrow.
pub struct Stack<'a, T> {
    items: &'a mut [Entry<T>],
    top: usize,
}

impl<'a, T: Copy> Stack<'a, T> {
    /// Empty.
    #[inline(always)]
    pub fn new(items: &'a mut [Entry<T>]) -> Self {
        Stack { items, top: 0 }
    }

    /// The next one that begins no further away than `far`.
    #[inline(always)]
    pub fn pop(&mut self, far: f32) -> Option<T> {
        self.pop_if(|entry, _| entry <= far)
    }

    /// The next one that is still of use; those before it are dropped.
    #[inline(always)]
    pub fn pop_if(&mut self, useful: impl Fn(f32, &T) -> bool) -> Option<T> {
        while self.top > 0 {
            self.top -= 1;
            let Entry { entry, what } = &self.items[self.top];
            if useful(*entry, what) {
                return Some(*what);
            }
        }
        None
    }

    /// The nearest of the slots that are met; the others are pushed, the nearest last. Where `ANY` hit will do they
    /// are in no order.
    #[inline(always)]
    pub fn nearest_first<const ANY: bool>(
        &mut self,
        entries: &Float8,
        mut slots: u32,
        what: impl Fn(usize) -> T,
    ) -> Option<T> {
        if slots == 0 {
            return None;
        }
        let first = slots.trailing_zeros() as usize;
        slots &= slots - 1;
        if slots == 0 {
            return Some(what(first));
        }
        let entries = entries.as_array();
        let entry = |slot: usize| Entry { entry: entries[slot % LANES], what: what(slot) };
        let (mut nearest, bottom) = (entry(first), self.top);
        while slots != 0 {
            let mut new = entry(slots.trailing_zeros() as usize);
            slots &= slots - 1;
            let mut at = self.top;
            self.top += 1;
            if !ANY {
                if new.entry < nearest.entry {
                    std::mem::swap(&mut new, &mut nearest);
                }
                while at > bottom && self.items[at - 1].entry < new.entry {
                    self.items[at] = self.items[at - 1];
                    at -= 1;
                }
            }
            self.items[at] = new;
        }
        Some(nearest.what)
    }
}
