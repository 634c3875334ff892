//! Layers beside the colour, and windows, as options.

use clap::{Args, ValueEnum};
use octray::batch::{LayerChoice, Overscan, Tile, WindowChoice};
use octray::film::Window;
use octray::scene::Layers;

use super::args;
use super::exit::{Exit, Failure};

/// Which layers there are beside the colour.
#[derive(Debug, Clone, Args)]
pub struct LayerArgs {
    /// Layers beside the colour, in place of the scene's: depth, position, normal, albedo, uv, motion, ids, samples, variance, margin,
    /// crypto_object, crypto_material, crypto_asset, cryptomatte (those three), all
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    aov: Vec<String>,
    /// Add what each pixel cost (cost.box, cost.prim, cost.lanes), and draw it: FILE.cost.png
    #[arg(long)]
    pub cost: bool,
    /// Ids that a Cryptomatte keeps of a pixel: even, from 2 to 16 [default: as in the scene, 6]
    #[arg(long, value_name = "N", value_parser = ranks)]
    crypto_ranks: Option<u8>,
    /// What ids and Cryptomattes tell apart of a cloud [default: as in the scene, grouped]
    #[arg(long, value_enum, value_name = "HOW")]
    instances: Option<Instances>,
}

/// What a cloud is in ids and Cryptomattes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Instances {
    /// One object
    Grouped,
    /// Each row is an object of its own: name:17
    Each,
}

/// Which pixels are rendered.
#[derive(Debug, Clone, Args)]
pub struct Windows {
    /// Render only these pixels, the second corner excluded; they are the same as in the whole picture
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = args::crop, allow_hyphen_values = true)]
    crop: Option<Window>,
    /// The same by shares of width and height: 0,0,0.5,1 is the left half
    #[arg(long, value_name = "X0,Y0,X1,Y1", value_parser = ndc, allow_hyphen_values = true, conflicts_with = "crop")]
    crop_ndc: Option<[f64; 4]>,
    /// Cut the picture into so many columns and rows, and render one of the parts
    #[arg(long, value_name = "CxR", value_parser = args::tiles, requires = "tile", conflicts_with_all = ["crop", "crop_ndc", "overscan"])]
    tiles: Option<(u32, u32)>,
    /// Which of --tiles: from 1, row by row
    #[arg(long, value_name = "K", requires = "tiles", value_parser = clap::value_parser!(u32).range(1..))]
    tile: Option<u32>,
    /// Render so many pixels, or percents of width and height, beyond each side as well
    #[arg(long, value_name = "N|N%", value_parser = overscan)]
    overscan: Option<Overscan>,
}

/// Most pixels beyond a side, as many as along one.
const MOST_OVERSCAN: u32 = 65_536;

impl LayerArgs {
    /// As the library takes them.
    ///
    /// # Errors
    /// Names that are none.
    pub fn choice(&self) -> Result<LayerChoice, Failure> {
        let choice = LayerChoice {
            aovs: self.aov.iter().map(|name| name.trim().to_owned()).collect(),
            cost: self.cost,
            ranks: self.crypto_ranks,
            instances: self.instances.map(|how| how == Instances::Each),
        };
        choice.check().map_err(|unknown| Failure::new(Exit::Usage, format!("--aov: {unknown}")))?;
        Ok(choice)
    }
}

impl Windows {
    /// As the library takes them.
    ///
    /// # Errors
    /// A tile that there is not.
    pub fn choice(&self) -> Result<WindowChoice, Failure> {
        let tile = self.tiles.zip(self.tile).map(|((columns, rows), index)| Tile { columns, rows, index });
        if let Some(Tile { columns, rows, index }) = tile.filter(|tile| tile.index > tile.columns * tile.rows) {
            let text = format!("--tile {index} is none of the {} tiles of {columns}x{rows}", columns * rows);
            return Err(Failure::new(Exit::Usage, text));
        }
        Ok(WindowChoice { crop: self.crop, crop_ndc: self.crop_ndc, tile, overscan: self.overscan })
    }
}

fn ndc(text: &str) -> Result<[f64; 4], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let finite = |x: &f64| x.abs() <= 1e3;
    match numbers.as_deref() {
        Some(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 && [x0, y0, x1, y1].iter().all(finite) => Ok([x0, y0, x1, y1]),
        _ => Err("should be X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1: 0,0 is the upper left corner, 1,1 the lower right \
                  one"
        .to_owned()),
    }
}

fn overscan(text: &str) -> Result<Overscan, String> {
    let found = match text.strip_suffix('%') {
        Some(percent) => percent.trim().parse().ok().filter(|x| (0.0..=1000.0).contains(x)).map(Overscan::Percent),
        None => text.trim().parse().ok().filter(|x| *x <= MOST_OVERSCAN).map(Overscan::Pixels),
    };
    found.ok_or_else(|| "should be pixels such as 32, or percents of the picture such as 10%".to_owned())
}

fn ranks(text: &str) -> Result<u8, String> {
    let ranks = text.parse().ok().filter(|ranks| (2..=Layers::MOST_RANKS).contains(ranks) && ranks % 2 == 0);
    ranks.ok_or_else(|| "should be an even number from 2 to 16, such as 6".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overscan_is_pixels_or_percents() {
        assert_eq!(overscan("32").map(|over| over.pixels((640, 480))), Ok([32, 32]));
        assert_eq!(overscan("10%").map(|over| over.pixels((640, 485))), Ok([64, 49]));
        for text in ["", "-1", "1.5", "x%", "-3%", "nan%", "99999999"] {
            assert!(overscan(text).unwrap_err().contains("10%"), "{text}");
        }
    }

    #[test]
    fn shares_are_read_or_explained() {
        assert_eq!(ndc("0, 0,0.5,1"), Ok([0.0, 0.0, 0.5, 1.0]));
        for text in ["", "0,0,1", "0,0,0,1", "0,0,nan,1", "0,0,inf,1"] {
            assert!(ndc(text).is_err(), "{text}");
        }
    }

    #[test]
    fn ranks_come_in_pairs() {
        assert_eq!(ranks("16"), Ok(16));
        assert!(["0", "3", "18", "x"].iter().all(|text| ranks(text).is_err()));
    }
}
