//! A file of atoms, read frame by frame.

use std::path::{Path, PathBuf};

use glam::DVec3;
use rayon::prelude::*;

use super::data;
use super::dump::Dump;
use super::frame::{Columns, Frame};
use super::lines::{Lines, Reading};
use super::pdb::Pdb;
use super::{sdf, xyz};
use crate::scene::error::SceneError;

/// Atoms whose nearest neighbours tell how far apart atoms are.
const SAMPLES: usize = 32;

/// Formats of files of atoms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// XYZ and extended XYZ.
    Xyz,
    /// LAMMPS dump.
    LammpsDump,
    /// LAMMPS data.
    LammpsData,
    /// Protein Data Bank.
    Pdb,
    /// Structure-data file, and MOL.
    Sdf,
}

/// Endings of names, each also with `.gz`.
const ENDINGS: &[(&str, Format)] = &[
    ("xyz", Format::Xyz),
    ("extxyz", Format::Xyz),
    ("lammpstrj", Format::LammpsDump),
    ("dump", Format::LammpsDump),
    ("lmp", Format::LammpsData),
    ("data", Format::LammpsData),
    ("pdb", Format::Pdb),
    ("ent", Format::Pdb),
    ("sdf", Format::Sdf),
    ("mol", Format::Sdf),
];

impl Format {
    /// The format of a file by its name.
    pub fn of(path: &Path) -> Option<Format> {
        let name = path.file_name()?.to_string_lossy().to_lowercase();
        let ending = name.strip_suffix(".gz").unwrap_or(&name).rsplit_once('.')?.1.to_owned();
        ENDINGS.iter().find(|(known, _)| *known == ending).map(|(_, format)| *format)
    }

    /// The endings that are known, for messages.
    pub fn endings() -> String {
        ENDINGS.iter().map(|(ending, _)| format!(".{ending}")).collect::<Vec<_>>().join(", ")
    }
}

/// What the first frame says about all: looks made from it do not change from frame to frame.
#[derive(Debug, Clone, Copy, Default)]
pub struct Summary {
    /// Median distance of an atom to its nearest neighbour; `None` for one atom.
    pub spacing: Option<f64>,
    /// Least and greatest value of the column that colours are made of.
    pub range: Option<[f32; 2]>,
    /// How far the centres of atoms reach in x, y and z.
    pub extent: DVec3,
}

/// A trajectory that is being read. Memory holds one frame at most.
pub struct Trajectory {
    path: PathBuf,
    format: Format,
    columns: Columns,
    bonds: bool,
    lines: Lines,
    reader: Reader,
    /// Number of the frame that comes next, from 1.
    next: u64,
    /// The first frame, until somebody takes it or goes past it.
    ahead: Option<Frame>,
    summary: Summary,
}

/// What readers remember between frames.
enum Reader {
    Xyz,
    Dump(Dump),
    Data,
    Pdb(Pdb),
    Sdf,
}

impl Reader {
    fn new(format: Format) -> Self {
        match format {
            Format::Xyz => Reader::Xyz,
            Format::LammpsDump => Reader::Dump(Dump::default()),
            Format::LammpsData => Reader::Data,
            Format::Pdb => Reader::Pdb(Pdb::default()),
            Format::Sdf => Reader::Sdf,
        }
    }
}

impl Trajectory {
    /// Opens a file and reads its first frame; `bonds`: whether those that the file gives are wanted.
    ///
    /// # Errors
    /// What is wrong with the file up to there.
    pub fn open(path: &Path, format: Format, columns: Columns, bonds: bool) -> Reading<Self> {
        let lines = Lines::open(path)?;
        let (reader, path) = (Reader::new(format), path.to_owned());
        let mut trajectory = Trajectory {
            path,
            format,
            columns,
            bonds,
            lines,
            reader,
            next: 1,
            ahead: None,
            summary: Summary::default(),
        };
        let Some(first) = trajectory.read()? else {
            return Err(Box::new(SceneError::of_file(&trajectory.path, "must hold atoms", "none")));
        };
        trajectory.summary = Summary::of(&first);
        trajectory.ahead = Some(first);
        Ok(trajectory)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its format.
    pub fn format(&self) -> Format {
        self.format
    }

    /// What its first frame says.
    pub fn summary(&self) -> Summary {
        self.summary
    }

    /// Frame `number`, counted from 1. A file of one frame is still: that one is all of them. Frames that are
    /// asked for in order are read once.
    ///
    /// # Errors
    /// What is wrong with the frame, or that the file ends before it.
    pub fn frame(&mut self, number: u64) -> Reading<Frame> {
        if number == 0 {
            return Err(Box::new(SceneError::of_file(&self.path, "frames count from 1", "frame 0")));
        }
        if number == 1
            && let Some(first) = self.ahead.take()
        {
            return Ok(first);
        }
        self.ahead = None;
        if number < self.next {
            self.rewind()?;
        }
        while self.next < number {
            if !self.skip()? {
                return self.past_the_end(number);
            }
        }
        match self.read()? {
            Some(frame) => Ok(frame),
            None => self.past_the_end(number),
        }
    }

    /// How many frames there are: looks through the rest of the file.
    ///
    /// # Errors
    /// What is wrong with it.
    pub fn count(&mut self) -> Reading<u64> {
        self.ahead = None;
        while self.skip()? {}
        Ok(self.next - 1)
    }

    fn past_the_end(&mut self, number: u64) -> Reading<Frame> {
        match self.next - 1 {
            1 => {
                self.rewind()?;
                self.frame(1)
            }
            frames => {
                let rule = format!("has {frames} frames: there is no frame {number}");
                Err(Box::new(SceneError::of_file(&self.path, rule, "")))
            }
        }
    }

    fn rewind(&mut self) -> Reading<()> {
        (self.lines, self.reader, self.next) = (Lines::open(&self.path)?, Reader::new(self.format), 1);
        Ok(())
    }

    fn read(&mut self) -> Reading<Option<Frame>> {
        let (lines, columns) = (&mut self.lines, &self.columns);
        let frame = match &mut self.reader {
            Reader::Xyz => xyz::read(lines, columns),
            Reader::Dump(dump) => dump.read(lines, columns),
            Reader::Data if self.next > 1 => Ok(None),
            Reader::Data => data::read(lines, columns, self.bonds),
            Reader::Pdb(pdb) => pdb.read(lines, columns, self.bonds),
            Reader::Sdf => sdf::read(lines, columns),
        }?;
        self.next += u64::from(frame.is_some());
        Ok(frame)
    }

    fn skip(&mut self) -> Reading<bool> {
        let lines = &mut self.lines;
        let there = match &mut self.reader {
            Reader::Xyz => xyz::skip(lines),
            Reader::Dump(dump) => dump.skip(lines),
            Reader::Data => Ok(self.next == 1),
            Reader::Pdb(pdb) => pdb.skip(lines),
            Reader::Sdf => sdf::skip(lines),
        }?;
        self.next += u64::from(there);
        Ok(there)
    }
}

impl Summary {
    fn of(frame: &Frame) -> Summary {
        let known = frame.kinds.iter().any(|kind| kind.element.is_some());
        let reach = |[low, high]: [DVec3; 2], [x, y, z, _]: &[f64; 4]| {
            let place = DVec3::new(*x, *y, *z);
            [low.min(place), high.max(place)]
        };
        let [low, high] = frame.atoms.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], reach);
        let ranges = frame.values.iter().map(|value| [*value, *value]);
        Summary {
            spacing: if known { None } else { spacing(&frame.atoms) },
            range: ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]),
            extent: high - low,
        }
    }
}

/// The median over some atoms, evenly drawn, of the distance to the nearest other one.
fn spacing(atoms: &[[f64; 4]]) -> Option<f64> {
    let step = (atoms.len() / SAMPLES).max(1);
    let nearest = |[x, y, z, _]: [f64; 4]| {
        // Eight at a time, so that none waits for the one before.
        let square = |[a, b, c, _]: &[f64; 4]| match (a - x).powi(2) + (b - y).powi(2) + (c - z).powi(2) {
            square if square > 0.0 => square,
            _ => f64::INFINITY,
        };
        let mut least = [f64::INFINITY; 8];
        let (eights, rest) = atoms.as_chunks::<8>();
        for eight in eights {
            least.iter_mut().zip(eight).for_each(|(least, atom)| *least = least.min(square(atom)));
        }
        least.into_iter().chain(rest.iter().map(square)).fold(f64::INFINITY, f64::min).sqrt()
    };
    let some: Vec<_> = atoms.iter().step_by(step).take(SAMPLES).copied().collect();
    let mut all: Vec<f64> = some.into_par_iter().map(nearest).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().filter(|distance| distance.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_formats() {
        let format = |name| Format::of(Path::new(name));
        assert_eq!(format("a/b.c/water.xyz.gz"), Some(Format::Xyz));
        assert_eq!(format("dump.LAMMPSTRJ"), Some(Format::LammpsDump));
        assert_eq!([format("a.gz"), format("xyz"), format("a.toml"), format(".pdb/x")], [None; 4]);
    }

    /// Three frames, taken in any order.
    #[test]
    fn any_frame_can_be_had() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.xyz");
        let frame = |x: u32| format!("2\n\nC {x} 0 0\nC {x} 1 0\n");
        std::fs::write(&file, (1..=3).map(frame).collect::<String>()).unwrap();
        let mut trajectory = Trajectory::open(&file, Format::Xyz, Columns::default(), false).unwrap();
        for number in [1, 2, 3, 1, 3, 2, 2] {
            assert_eq!(trajectory.frame(number).unwrap().atoms[0][0], number as f64);
        }
        let error = trajectory.frame(4).unwrap_err().to_string();
        assert!(error.ends_with("a.xyz: has 3 frames: there is no frame 4"), "{error}");
        assert_eq!(trajectory.frame(1).unwrap().len(), 2, "still there after an error");
        assert_eq!(trajectory.count().unwrap(), 3);
        std::fs::write(&file, frame(1)).unwrap();
        let mut still = Trajectory::open(&file, Format::Xyz, Columns::default(), false).unwrap();
        assert_eq!(still.frame(17).unwrap().atoms[0][0], 1.0, "one frame is all frames");
    }
}
