//! What files of atoms look like where no scene file says it.

use clap::{Args, ValueEnum};
use octray::scene::particles::{Bonds, Coloring, Look, Radius, Style};

const HEADING: &str = "Files of atoms (.xyz, .lammpstrj, .data, .pdb, .sdf, ..., also with .gz)";

/// The look of atoms.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = HEADING)]
pub struct Atoms {
    /// How atoms and bonds are drawn [default: ball-and-stick for .sdf and .mol, else spheres]
    #[arg(long, value_enum, value_name = "NAME")]
    style: Option<StyleName>,
    /// Radii: van-der-waals, covalent, a number for all, or a column of the file [default: the file's, else van-der-waals]
    #[arg(long, value_name = "WORD", value_parser = radius)]
    radius: Option<Radius>,
    /// Colour by a column of the file: a name (of XYZ without Properties: its number), by the colour map viridis
    /// from the least to the greatest value of the first frame [default: by element]
    #[arg(long, value_name = "COLUMN")]
    color_by: Option<String>,
    /// Bonds: auto, file, distance, none, or atoms nearer than a number
    #[arg(long, value_name = "WORD", value_parser = bonds, default_value = "auto")]
    bonds: Bonds,
    /// Copies of the periodic cell along its edges
    #[arg(long, value_name = "X,Y,Z", value_parser = copies)]
    replicate: Option<[u32; 3]>,
}

/// Styles by their names in scene files.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum StyleName {
    /// Atoms that fill their space
    Spheres,
    /// Small atoms joined by sticks
    BallAndStick,
    /// Sticks alone
    Licorice,
}

impl Atoms {
    /// As the library takes it.
    pub fn look(&self) -> Look {
        let style = self.style.map(|name| match name {
            StyleName::Spheres => Style::Spheres,
            StyleName::BallAndStick => Style::BallAndStick,
            StyleName::Licorice => Style::Licorice,
        });
        let by_column = |name: &String| Coloring::Column { name: name.clone(), map: Default::default(), range: None };
        Look {
            style,
            radius: self.radius.clone().unwrap_or_default(),
            color: self.color_by.as_ref().map(by_column).unwrap_or_default(),
            bonds: self.bonds,
            replicate: self.replicate.unwrap_or([1; 3]),
            ..Look::default()
        }
    }

    /// Whether the user chose anything.
    pub fn is_given(&self) -> bool {
        self.look() != Look::default()
    }
}

fn length(text: &str) -> Option<Option<f64>> {
    let number = text.parse::<f64>().ok()?;
    Some((number > 0.0 && number <= 1e15).then_some(number))
}

fn radius(text: &str) -> Result<Radius, String> {
    match (text, length(text)) {
        ("van-der-waals", _) => Ok(Radius::VanDerWaals),
        ("covalent", _) => Ok(Radius::Covalent),
        (_, Some(Some(radius))) => Ok(Radius::Same(radius)),
        (_, Some(None)) => Err("should be a number above 0".to_owned()),
        (name, None) => Ok(Radius::Column(name.to_owned())),
    }
}

fn bonds(text: &str) -> Result<Bonds, String> {
    match (text, length(text)) {
        ("auto", _) => Ok(Bonds::Auto),
        ("file", _) => Ok(Bonds::File),
        ("distance", _) => Ok(Bonds::Distance),
        ("none", _) => Ok(Bonds::None),
        (_, Some(Some(distance))) => Ok(Bonds::Within(distance)),
        _ => Err("should be auto, file, distance, none, or a distance above 0 such as 1.2".to_owned()),
    }
}

fn copies(text: &str) -> Result<[u32; 3], String> {
    let count = |text: &str| text.trim().parse::<u32>().ok().filter(|count| (1..=1 << 16).contains(count));
    let counts: Option<Vec<u32>> = text.split(',').map(count).collect();
    let error = "should be three whole numbers from 1 on, such as 2,2,1";
    counts.and_then(|counts| counts.try_into().ok()).ok_or_else(|| error.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_or_explained() {
        assert_eq!(copies("13, 13,1"), Ok([13, 13, 1]));
        assert!(["", "1,2", "0,1,1", "1,1,1,1", "a,b,c", "99999,1,1"].iter().all(|text| copies(text).is_err()));
        assert_eq!((bonds("1.2"), bonds("none")), (Ok(Bonds::Within(1.2)), Ok(Bonds::None)));
        assert!(["", "-1", "0", "nan", "some"].iter().all(|text| bonds(text).is_err()));
        assert_eq!(radius("0.5"), Ok(Radius::Same(0.5)));
        assert_eq!(radius("c_rad"), Ok(Radius::Column("c_rad".to_owned())));
        assert!(radius("-2").is_err());
    }
}
