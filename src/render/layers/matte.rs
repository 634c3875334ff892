//! Which ids a pixel's samples saw, and how often.

/// Counts of keys by pixel of a block, in lists that share one room.
#[derive(Debug)]
pub(super) struct Tally {
    heads: Vec<u32>,
    entries: Vec<Entry>,
}

#[derive(Debug, Clone, Copy)]
struct Entry {
    key: u32,
    count: u32,
    next: u32,
}

const END: u32 = u32::MAX;

impl Tally {
    pub fn new(pixels: usize) -> Self {
        Tally { heads: vec![END; pixels], entries: Vec::new() }
    }

    /// Counts one sample of a pixel.
    pub fn add(&mut self, pixel: usize, key: u32) {
        let mut at = self.heads[pixel];
        while let Some(entry) = self.entries.get_mut(at as usize) {
            if entry.key == key {
                entry.count += 1;
                return;
            }
            at = entry.next;
        }
        self.entries.push(Entry { key, count: 1, next: self.heads[pixel] });
        self.heads[pixel] = self.entries.len() as u32 - 1;
    }

    /// Keys of a pixel and how many samples saw them.
    pub fn of(&self, pixel: usize) -> impl Iterator<Item = (u32, u32)> {
        let mut at = self.heads[pixel];
        std::iter::from_fn(move || {
            let entry = self.entries.get(at as usize)?;
            at = entry.next;
            Some((entry.key, entry.count))
        })
    }
}

/// One rank: the bits of an id, the samples that saw it, and a key that it stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rank {
    pub id: u32,
    pub count: u32,
    pub key: u32,
}

/// Ids by falling coverage, equal ones by their bits; equal ids are one.
pub(super) fn ranked(seen: impl Iterator<Item = (u32, u32)>, ids: &[u32], ranks: &mut Vec<Rank>) {
    ranks.clear();
    for (key, count) in seen {
        let id = ids[key as usize];
        match ranks.iter_mut().find(|rank| rank.id == id) {
            Some(rank) => (rank.count, rank.key) = (rank.count + count, rank.key.min(key)),
            None => ranks.push(Rank { id, count, key }),
        }
    }
    ranks.sort_unstable_by_key(|rank| (std::cmp::Reverse(rank.count), rank.id));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_ranked_by_coverage_and_equal_names_are_one() {
        let mut tally = Tally::new(3);
        for key in [4, 1, 4, 2, 0, 2, 3] {
            tally.add(1, key);
        }
        tally.add(2, 0);
        let (ids, mut ranks) = ([90, 80, 70, 90, 60], Vec::new());
        ranked(tally.of(1), &ids, &mut ranks);
        let rank = |id, count, key| Rank { id, count, key };
        assert_eq!(ranks, [rank(60, 2, 4), rank(70, 2, 2), rank(90, 2, 0), rank(80, 1, 1)]);
        ranked(tally.of(0), &ids, &mut ranks);
        assert_eq!(ranks, []);
    }
}
