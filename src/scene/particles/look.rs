//! How atoms are drawn: a frame becomes spheres, and cylinders for its bonds.

use std::collections::TryReserveError;

use glam::DVec3;

use super::bonds::{Halves, Reach};
use super::color_map::ColorMap;
use super::element::{Element, from_hex};
use super::frame::{Columns, Frame, Kind};
use super::trajectory::{Format, Summary, Trajectory};
use crate::scene::error::{Place, Warning};
use crate::scene::rules::{self, Broken};

/// How much longer than the sum of the covalent radii a bond may be, in angstrom.
///
/// Source: O'Boyle et al., "Open Babel: an open chemical toolbox", Journal of Cheminformatics 3:33, 2011.
const SLACK: f64 = 0.45;
/// Nearer atoms are no pair of atoms but one in two places, in angstrom; the same source.
const LEAST_BOND: f64 = 0.4;
/// Share of the van der Waals radius that a ball has beside its sticks.
const BALL: f64 = 0.25;
/// Radius of the sticks of balls and sticks and of licorice: in angstrom, or in distances to the nearest neighbour.
const STICK: [f64; 2] = [0.15, 0.1];
const LICORICE: [f64; 2] = [0.3, 0.2];
/// Radius of an atom of no known element among others that are known, in angstrom.
const UNKNOWN: f64 = 1.7;

/// Colours of kinds that are no elements.
///
/// Source: Okabe and Ito, "Color universal design" (2008).
const PALETTE: [u32; 8] = [0x56b4e9, 0xe69f00, 0x009e73, 0xf0e442, 0x0072b2, 0xd55e00, 0xcc79a7, 0x999999];

/// What is drawn of atoms and bonds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Atoms as spheres that fill their space.
    Spheres,
    /// Small spheres joined by cylinders.
    BallAndStick,
    /// Cylinders with round ends.
    Licorice,
}

/// Where radii come from.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Radius {
    /// From the file where it has them, else [`Radius::VanDerWaals`].
    #[default]
    Auto,
    /// Van der Waals radii; atoms of no element touch their nearest neighbours.
    VanDerWaals,
    /// Covalent radii; atoms of no element touch their nearest neighbours.
    Covalent,
    /// The same for all, scene units, > 0.
    Same(f64),
    /// A column of the file.
    Column(String),
}

/// Where colours come from.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Coloring {
    /// From the file where it has them, else [`Coloring::Kind`].
    #[default]
    Auto,
    /// By element; kinds that are no elements have colours of a palette.
    Kind,
    /// The same for all, linear Rec. 709.
    Same([f32; 3]),
    /// A column of the file by a colour map.
    Column {
        /// Its name.
        name: String,
        /// The map.
        map: ColorMap,
        /// Values at the ends of the map; `None`: the least and the greatest one of the first frame.
        range: Option<[f64; 2]>,
    },
}

/// Where bonds come from.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Bonds {
    /// Those of the file; by distance, too, where the format has none or names only some (XYZ, dumps, PDB).
    #[default]
    Auto,
    /// Those of the file.
    File,
    /// Atoms nearer than the sum of their covalent radii and 0.45 angstrom.
    Distance,
    /// Atoms nearer than this, scene units, > 0.
    Within(f64),
    /// None.
    None,
}

/// How the atoms of a file are drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct Look {
    /// `None`: balls and sticks for SDF, spheres for all others.
    pub style: Option<Style>,
    /// Radii of atoms.
    pub radius: Radius,
    /// Factor on the radii; `None`: 1/4 for balls and sticks, else 1.
    pub scale: Option<f64>,
    /// Colours of atoms and of their halves of bonds.
    pub color: Coloring,
    /// Bonds; spheres have none unless this says where from.
    pub bonds: Bonds,
    /// Radius of bonds, scene units, > 0; `None`: by style.
    pub bond_radius: Option<f64>,
    /// Elements of the types 1, 2, ... of LAMMPS, where the file does not tell them.
    pub elements: Vec<Element>,
    /// How often the cell is repeated along each of its edges.
    pub replicate: [u32; 3],
}

impl Default for Look {
    fn default() -> Self {
        Look {
            style: None,
            radius: Radius::default(),
            scale: None,
            color: Coloring::default(),
            bonds: Bonds::default(),
            bond_radius: None,
            elements: Vec::new(),
            replicate: [1; 3],
        }
    }
}

/// A frame as it is drawn.
#[derive(Debug, Default)]
pub struct Drawn {
    /// x, y, z, radius of each atom.
    pub spheres: Vec<[f64; 4]>,
    /// Their colours, linear Rec. 709.
    pub sphere_colors: Vec<[f32; 3]>,
    /// Base, apex and radius of each half of a bond.
    pub sticks: Vec<[f64; 7]>,
    /// Their colours.
    pub stick_colors: Vec<[f32; 3]>,
    /// What was passed over.
    pub warnings: Vec<Warning>,
}

impl Look {
    /// The style, for a format.
    pub fn style(&self, format: Format) -> Style {
        let usual = if format == Format::Sdf { Style::BallAndStick } else { Style::Spheres };
        self.style.unwrap_or(usual)
    }

    /// The columns that must be read.
    pub fn columns(&self) -> Columns {
        let radius = if let Radius::Column(name) = &self.radius { Some(name.clone()) } else { None };
        let value = if let Coloring::Column { name, .. } = &self.color { Some(name.clone()) } else { None };
        Columns { radius, value }
    }

    /// Whether the bonds of the file are wanted.
    pub fn needs_bonds(&self, format: Format) -> bool {
        match self.bonds {
            Bonds::Auto => self.style(format) != Style::Spheres,
            Bonds::File => true,
            Bonds::Distance | Bonds::Within(_) | Bonds::None => false,
        }
    }

    /// Draws a frame; `most` is how many primitives it may become.
    ///
    /// # Errors
    /// What cannot be done with this file.
    pub fn draw(&self, mut frame: Frame, file: &Trajectory, most: usize) -> Result<Drawn, Broken> {
        let (format, summary) = (file.format(), file.summary());
        self.name_types(&mut frame.kinds);
        let mut warnings = std::mem::take(&mut frame.warnings);
        let known = frame.kinds.iter().any(|kind| kind.element.is_some());
        if let Some(text) = unknown(&frame.kinds).filter(|_| known) {
            warnings.push(Warning { place: Place::file(file.path()), text });
        }
        let style = self.style(format);
        let stick = self.stick(style, known, summary);
        let copies = self.copies(&frame, most)?;
        let halves = self.halves(&frame, format, stick)?;
        if halves.rows.len().saturating_add(frame.len()).saturating_mul(copies.len()) > most {
            return Err(broken("replicate", "the cloud must have at most 2^31 - 1 primitives".to_owned(), "more"));
        }
        let colors = self.colors(&mut frame, summary);
        self.set_radii(&mut frame, style, stick, summary);
        let mut drawn = Drawn { spheres: frame.atoms, sphere_colors: colors, warnings, ..Drawn::default() };
        drawn.stick_colors = halves.atoms.iter().map(|atom| drawn.sphere_colors[*atom as usize]).collect();
        drawn.sticks = halves.rows;
        drawn.repeat(&copies).map_err(|_| broken("replicate", "needs more memory than there is".to_owned(), ""))?;
        Ok(drawn)
    }

    /// The radius of bonds.
    fn stick(&self, style: Style, known: bool, summary: Summary) -> f64 {
        let [angstrom, spacing] = if style == Style::Licorice { LICORICE } else { STICK };
        let usual = if known { angstrom } else { spacing * summary.spacing.unwrap_or(1.0) };
        self.bond_radius.unwrap_or(usual)
    }

    fn name_types(&self, kinds: &mut [Kind]) {
        for kind in kinds.iter_mut().filter(|kind| kind.element.is_none()) {
            let number = kind.label.parse::<usize>().ok();
            kind.element = number.and_then(|number| self.elements.get(number.checked_sub(1)?)).copied();
        }
    }

    /// How far the copies of a periodic cell are moved, the first one not at all.
    fn copies(&self, frame: &Frame, most: usize) -> Result<Vec<DVec3>, Broken> {
        let [x, y, z] = self.replicate;
        if self.replicate == [1; 3] {
            return Ok(vec![DVec3::ZERO]);
        }
        let Some(cell) = frame.cell else {
            return Err(broken("replicate", "must be left out: the file names no cell".to_owned(), ""));
        };
        let count = [x, y, z].into_iter().try_fold(1usize, |count, side| count.checked_mul(side as usize));
        if count.and_then(|count| count.checked_mul(frame.len())).is_none_or(|count| count > most) {
            return Err(broken("replicate", "the cloud must have at most 2^31 - 1 primitives".to_owned(), "more"));
        }
        let shift = |x: u32, y: u32, z: u32| cell.edges * DVec3::new(f64::from(x), f64::from(y), f64::from(z));
        Ok((0..z).flat_map(|c| (0..y).flat_map(move |b| (0..x).map(move |a| shift(a, b, c)))).collect())
    }

    fn halves(&self, frame: &Frame, format: Format, radius: f64) -> Result<Halves, Broken> {
        let style = self.style(format);
        let mut halves = Halves::default();
        let covalent = || Reach { shares: frame.kinds.iter().map(share).collect(), least: LEAST_BOND };
        match self.bonds {
            Bonds::None => {}
            Bonds::Auto if style == Style::Spheres => {}
            Bonds::Auto => match format {
                Format::Sdf | Format::LammpsData => halves.add_given(frame, radius, None),
                Format::Pdb | Format::Xyz | Format::LammpsDump => {
                    halves.add_near(frame, radius, &covalent());
                    halves.add_given(frame, radius, Some(&covalent()));
                }
            },
            Bonds::File => halves.add_given(frame, radius, None),
            Bonds::Distance => {
                if frame.kinds.iter().all(|kind| kind.element.is_none()) {
                    let rule = "by distance need the elements of atoms, which the file does not name: \
                                give \"elements\", or a distance such as bonds = 1.2";
                    return Err(broken("bonds", rule.to_owned(), ""));
                }
                halves.add_near(frame, radius, &covalent());
            }
            Bonds::Within(distance) => {
                let shares = vec![0.5 * distance; frame.kinds.len()];
                halves.add_near(frame, radius, &Reach { shares, least: 0.0 });
            }
        }
        Ok(halves)
    }

    fn colors(&self, frame: &mut Frame, summary: Summary) -> Vec<[f32; 3]> {
        match &self.color {
            Coloring::Auto if !frame.colors.is_empty() => std::mem::take(&mut frame.colors),
            Coloring::Auto | Coloring::Kind => {
                let by_kind: Vec<_> = frame.kinds.iter().map(kind_color).collect();
                frame.kind.iter().map(|kind| by_kind[usize::from(*kind)]).collect()
            }
            Coloring::Same(color) => vec![*color; frame.len()],
            Coloring::Column { map, range, .. } => {
                let [low, high] = range.unwrap_or_else(|| summary.range.unwrap_or_default().map(f64::from));
                let width = if high > low { high - low } else { 1.0 };
                frame.values.iter().map(|value| map.color((f64::from(*value) - low) / width)).collect()
            }
        }
    }

    fn set_radii(&self, frame: &mut Frame, style: Style, stick: f64, summary: Summary) {
        let usual = if style == Style::BallAndStick { BALL } else { 1.0 };
        let scale = self.scale.unwrap_or(usual);
        let known = frame.kinds.iter().any(|kind| kind.element.is_some());
        let touching = 0.5 * summary.spacing.unwrap_or(1.0);
        let by_kind = frame.kinds.iter().map(|kind| match (kind.element, &self.radius) {
            (_, Radius::Same(radius)) => *radius,
            (Some(element), Radius::Covalent) => element.covalent(),
            (Some(element), _) => element.van_der_waals(),
            (None, _) => {
                if known {
                    UNKNOWN
                } else {
                    touching
                }
            }
        });
        let by_kind: Vec<f64> = by_kind.collect();
        let own = matches!(self.radius, Radius::Auto | Radius::Column(_));
        for (atom, kind) in frame.atoms.iter_mut().zip(&frame.kind) {
            let radius = if own && atom[3] > 0.0 { atom[3] } else { by_kind[usize::from(*kind)] };
            atom[3] = if style == Style::Licorice { stick * self.scale.unwrap_or(1.0) } else { radius * scale };
        }
    }
}

fn broken(key: &'static str, rule: String, found: &str) -> Broken {
    Broken { key, rule: rule.into(), found: found.to_owned() }
}

/// What an atom adds to the longest bond that it has.
fn share(kind: &Kind) -> f64 {
    kind.element.map_or(-1.0, |element| element.covalent() + 0.5 * SLACK)
}

/// A sentence about kinds that are no elements among others that are.
fn unknown(kinds: &[Kind]) -> Option<String> {
    let labels: Vec<_> =
        kinds.iter().filter(|kind| kind.element.is_none()).map(|kind| format!("{:?}", kind.label)).collect();
    let first: Vec<_> = labels.iter().take(8).map(String::as_str).collect();
    let more = if labels.len() > first.len() { ", ..." } else { "" };
    let text = || {
        format!(
            "no element is called {}{more}: such atoms have the radius {} and no bonds",
            first.join(", "),
            rules::show(UNKNOWN)
        )
    };
    (!labels.is_empty()).then(text)
}

/// By element; else by the number of the type, or by the letters of the label, so that it is the same in all frames.
fn kind_color(kind: &Kind) -> [f32; 3] {
    let index = match kind.label.parse::<usize>() {
        Ok(number) => number.wrapping_sub(1),
        // FNV-1a: Fowler, Noll and Vo, 1991.
        Err(_) => kind
            .label
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
            as usize,
    };
    kind.element.map_or_else(|| from_hex(PALETTE[index % PALETTE.len()]), Element::color)
}

impl Drawn {
    /// Appends the moved copies of all atoms and bonds.
    fn repeat(&mut self, copies: &[DVec3]) -> Result<(), TryReserveError> {
        repeat(&mut self.spheres, copies, 1)?;
        repeat(&mut self.sticks, copies, 2)?;
        for colors in [&mut self.sphere_colors, &mut self.stick_colors] {
            let count = colors.len();
            colors.try_reserve_exact(count * (copies.len() - 1))?;
            (1..copies.len()).for_each(|_| colors.extend_from_within(..count));
        }
        Ok(())
    }
}

/// Appends the moved copies of rows that start with so many points.
fn repeat<const N: usize>(rows: &mut Vec<[f64; N]>, copies: &[DVec3], points: usize) -> Result<(), TryReserveError> {
    let count = rows.len();
    rows.try_reserve_exact(count * (copies.len() - 1))?;
    for copy in &copies[1..] {
        for index in 0..count {
            let mut row = rows[index];
            for (at, x) in row[..3 * points].iter_mut().enumerate() {
                *x += copy[at % 3];
            }
            rows.push(row);
        }
    }
    Ok(())
}
