//! Atoms from files of simulations and of chemistry, drawn as spheres and cylinders.
//!
//! [`Trajectory`] reads a file frame by frame, whatever its [`Format`]; [`Look`] says what a frame looks like.
//! Lengths are those of the file (angstrom in most). What cannot be placed is an error with its line, what is
//! merely odd a warning; nothing is placed by guess.
//!
//! | file | what it is about |
//! |---|---|
//! | `lines`, `fields` | text: lines, words, rows of columns |
//! | `xyz`, `dump`, `data`, `pdb`, `sdf` | one format each |
//! | `frame`, `element`, `color_map` | what is known of atoms, elements, colours |
//! | `trajectory` | frames in any order, read as seldom as can be |
//! | `bonds`, `look` | what is drawn |
//! | `scene` | camera, light and background for a file without a scene |

mod bonds;
mod color_map;
mod data;
mod dump;
mod element;
mod fields;
mod frame;
mod lines;
mod look;
mod pdb;
pub(super) mod scene;
mod sdf;
mod trajectory;
mod xyz;

pub use self::color_map::ColorMap;
pub use self::element::Element;
pub use self::frame::{Cell, Columns, Frame, Kind};
pub use self::lines::Reading;
pub use self::look::{Bonds, Coloring, Drawn, Look, Radius, Style};
pub use self::trajectory::{Format, Summary, Trajectory};
