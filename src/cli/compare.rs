//! `octray compare`: how far apart two pictures are.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use octray::film::{Picture, Window};
use octray::measure::{Channel, Comparison, Spread, compare, heatmap};
use octray::output::{self, Contents, Format, png};

use super::Run;
use super::args;
use super::exit::{Exit, Failure};
use super::pictures;

const EXAMPLES: &str = "\
Examples:
  octray compare new.exr old.exr
  octray compare new.exr old.exr --max-rmse 1e-4 --heatmap where.png
  octray compare new.png old.png --min-psnr 40 --min-ssim 0.99 --json";

/// Arguments of `octray compare`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Measure how far apart two pictures are\n\n\
        RMSE, relative MSE and differences are of scene-linear values, PSNR and SSIM of what a display shows. \
        The largest difference and the share of different pixels are of all channels that both pictures have (ids, and \
        those of Cryptomattes, differ by 1 or not at all), the RMSE, PSNR and SSIM of colour and alpha. \
        Pixels lie where the windows of their files say; a PNG, which says none, on an EXR of as many pixels. \
        Ends with 1 where a limit is not kept."
)]
pub struct Args {
    /// Picture, EXR or PNG
    a: PathBuf,
    /// Picture to compare it with
    b: PathBuf,
    /// Write a picture of the differences, with a scale
    #[arg(long, value_name = "FILE.png")]
    heatmap: Option<PathBuf>,
    /// Print the numbers as JSON
    #[arg(long)]
    json: bool,
    /// Most that the root mean square error may be
    #[arg(long, value_name = "X", value_parser = args::limit, allow_negative_numbers = true)]
    max_rmse: Option<f64>,
    /// Most that any sample may differ by, those of layers included
    #[arg(long, value_name = "X", value_parser = args::limit, allow_negative_numbers = true)]
    max_diff: Option<f64>,
    /// Least that the peak signal-to-noise ratio may be, in dB
    #[arg(long, value_name = "X", value_parser = args::limit, allow_negative_numbers = true)]
    min_psnr: Option<f64>,
    /// Least that the structural similarity may be; 1 is the same
    #[arg(long, value_name = "X", value_parser = args::limit, allow_negative_numbers = true)]
    min_ssim: Option<f64>,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    if let Some(path) = &args.heatmap {
        if Format::of(path) != Some(Format::Png) {
            return Err(Failure::new(Exit::Usage, format!("{}: a heat map should end in .png", path.display())));
        }
        run.check_output(path, &[&args.a, &args.b])?;
    }
    let [a, b] = read(args, run)?;
    let comparison = compare(&a, &b)?;
    if let Some(path) = &args.heatmap {
        let title = format!("{} - {}", args.a.display(), args.b.display());
        let bytes = png::encode_raster(&heatmap(&a, &b)?, &title);
        let bytes = bytes.map_err(|error| Failure::new(Exit::Output, error).of(path))?;
        pictures::write_bytes(path, &bytes, run)?;
    }
    if args.json {
        let json = serde_json::to_value(&comparison).map_err(|error| Failure::new(Exit::Limit, error))?;
        run.console.print_json(&json)?;
    } else {
        run.console.print(&table(&comparison))?;
    }
    let broken = args.broken_limits(&comparison);
    broken.iter().for_each(|limit| run.console.note(&format!("octray: {limit}")));
    Ok(if broken.is_empty() { Exit::Done } else { Exit::No })
}

/// One of the pictures.
struct Side {
    picture: Picture,
    /// The window that was rendered, where transparent edges were left out.
    rendered: Option<Window>,
    /// Where the frame of an EXR begins.
    origin: Option<(i32, i32)>,
}

impl Side {
    fn read(path: &Path) -> Result<Side, Failure> {
        let Contents { picture, attributes, .. } = output::read_all(path)?;
        let rendered = attributes.as_ref().and_then(|attributes| attributes.rendered(&picture));
        Ok(Side { rendered, origin: attributes.map(|attributes| attributes.origin()), picture })
    }

    /// Colours as they were rendered.
    fn untrimmed(&mut self) {
        if let Some(window) = self.rendered {
            self.picture = self.picture.colors_in(window);
        }
    }

    /// A PNG says no window: it lies where the other picture has as many pixels.
    fn lay_on(&mut self, other: &Picture) {
        let size = |window: Window| (window.width(), window.height());
        if self.origin.is_none() && size(self.picture.window) == size(other.window) {
            (self.picture.display, self.picture.window) = (other.display, other.window);
        }
    }
}

/// Both pictures, their pixels where the files say. Where transparent edges were left out of one of them, their colours as
/// they were rendered.
fn read(args: &Args, run: &Run) -> Result<[Picture; 2], Failure> {
    let [mut a, mut b] = [Side::read(&args.a)?, Side::read(&args.b)?];
    if let (Some(from), Some(to)) = (a.origin, b.origin) {
        let moved = |window: Window| window.moved(to.0.saturating_sub(from.0), to.1.saturating_sub(from.1));
        (b.picture.window, b.rendered) = (moved(b.picture.window), b.rendered.map(moved));
    }
    if a.picture.window != b.picture.window {
        if [&a, &b].into_iter().any(|side| side.rendered.is_some() && !side.picture.channels.is_empty()) {
            run.console.warn("layers are not compared: transparent edges were left out");
        }
        a.untrimmed();
        b.untrimmed();
    }
    a.lay_on(&b.picture);
    b.lay_on(&a.picture);
    Ok([a.picture, b.picture])
}

impl Args {
    /// What is past its limit; a number that is none is past every limit.
    fn broken_limits(&self, found: &Comparison) -> Vec<String> {
        let most = |name: &str, value: f64, limit: Option<f64>| {
            let limit = limit.filter(|limit| value.partial_cmp(limit).is_none_or(|order| order.is_gt()))?;
            Some(format!("{name} is {value:.6e}, more than {limit:e}"))
        };
        let least = |name: &str, value: f64, limit: Option<f64>| {
            let limit = limit.filter(|limit| value.partial_cmp(limit).is_none_or(|order| order.is_lt()))?;
            Some(format!("{name} is {value}, less than {limit}"))
        };
        let limits = [
            most("the RMSE", found.rmse, self.max_rmse),
            most("the largest difference", found.max.value, self.max_diff),
            least("the PSNR", found.psnr, self.min_psnr),
            least("the SSIM", found.ssim, self.min_ssim),
        ];
        limits.into_iter().flatten().collect()
    }
}

fn table(found: &Comparison) -> String {
    let mut page = String::new();
    let mut line = |name: &str, value: String| {
        // Writing to a string cannot fail.
        let _ = writeln!(page, "{name:<20} {value}");
    };
    line("RMSE", format!("{:.6e}", found.rmse));
    line("relative MSE", format!("{:.6e}", found.rel_mse));
    line("PSNR", format!("{:.2} dB", found.psnr));
    line("SSIM", format!("{:.6}", found.ssim));
    let max = &found.max;
    line("largest difference", format!("{:.6e} in {} at {},{}", max.value, max.channel, max.x, max.y));
    line("different pixels", format!("{:.4} % of {}", 100.0 * found.different_share, found.pixels));
    if found.non_finite > 0 {
        line("not finite", format!("{} samples", found.non_finite));
    }
    for (picture, names) in [("first", &found.only_a), ("second", &found.only_b)] {
        if !names.is_empty() {
            line(&format!("only in the {picture}"), names.join(" "));
        }
    }
    line("", format!("{:>12} {:>12} {:>12} {:>12} {:>12}", "RMSE", "bias", "median", "99 %", "max"));
    for Channel { name, different_share, spread } in &found.channels {
        line(
            name,
            match spread {
                Some(Spread { rmse, bias, p50, p99, max, .. }) => {
                    [rmse, bias, p50, p99, max].map(|number| format!("{number:>12.4e}")).join(" ")
                }
                None => format!("{:.4} % of pixels differ", 100.0 * different_share),
            },
        );
    }
    page
}
