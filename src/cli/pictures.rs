//! Picture files for the commands: where they go, and how their samples are stored.

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use octray::film::Picture;
use octray::output::{self, Bits, Coding, Description, Display, Format, Losses, Options, OutputError, ToneMap, aside};

use super::Run;
use super::exit::{Exit, Failure};

/// How samples are stored.
#[derive(Debug, Clone, Args)]
pub struct Depth {
    /// EXR: store 32-bit floats instead of 16-bit ones
    #[arg(long)]
    float: bool,
    /// PNG: bits a sample, 8 (usual) or 16
    #[arg(long, value_name = "8|16", value_parser = ["8", "16"])]
    bits: Option<String>,
    /// PNG: brighter by so many stops, or darker by a negative number [default: 0]
    #[arg(long, value_name = "STOPS", value_parser = stops, allow_negative_numbers = true)]
    exposure: Option<f32>,
    /// PNG: the light that becomes white [default: 1, or what the tone map makes of it]
    #[arg(long, value_name = "X", value_parser = white)]
    white: Option<f32>,
    /// PNG: how bright light is fitted into what a display can show [default: none, it is cut off]
    #[arg(long, value_enum, value_name = "NAME")]
    tonemap: Option<ToneMapName>,
    /// PNG: round 8-bit samples to the nearest instead of dithering them by a fixed pattern
    #[arg(long)]
    no_dither: bool,
}

/// Tone maps by their names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ToneMapName {
    /// Cut off above 1
    None,
    /// Reinhard's curve on luminance; --white is its white point
    Reinhard,
    /// The ACES reference and output transforms, as fitted by Hill
    Aces,
    /// AgX, the base look
    Agx,
    /// Khronos PBR Neutral: true colours, highlights compressed
    Khronos,
}

impl From<ToneMapName> for ToneMap {
    fn from(name: ToneMapName) -> Self {
        match name {
            ToneMapName::None => ToneMap::None,
            ToneMapName::Reinhard => ToneMap::Reinhard,
            ToneMapName::Aces => ToneMap::Aces,
            ToneMapName::Agx => ToneMap::Agx,
            ToneMapName::Khronos => ToneMap::Khronos,
        }
    }
}

fn stops(text: &str) -> Result<f32, String> {
    let stops = text.parse::<f32>().ok().filter(|stops| stops.abs() <= 64.0);
    stops.ok_or_else(|| "should be a number of stops from -64 to 64".to_owned())
}

fn white(text: &str) -> Result<f32, String> {
    let white = text.parse::<f32>().ok().filter(|white| (1e-6..=1e9).contains(white));
    white.ok_or_else(|| "should be a number above 0 (1e-6 to 1e9)".to_owned())
}

/// Where a picture goes.
#[derive(Debug, Clone)]
pub enum Target {
    /// A file of a known format.
    File(PathBuf, Format),
    /// Standard output, as EXR.
    Stdout,
}

impl Target {
    /// A file name, or `-`; makes sure that it can be written, so that no work is done in vain.
    pub fn new(path: &Path, inputs: &[&Path], run: &Run) -> Result<Self, Failure> {
        if path.as_os_str() == "-" {
            return match io::stdout().is_terminal() {
                true => Err(Failure::new(Exit::Usage, "an EXR file is nothing for a terminal: say -o FILE")),
                false => Ok(Target::Stdout),
            };
        }
        run.check_output(path, inputs)?;
        let format = Format::of(path).or_else(|| is_device(path).then_some(Format::Exr));
        let format = format.ok_or_else(|| OutputError::Format { path: path.into() })?;
        Ok(Target::File(path.into(), format))
    }

    fn format(&self) -> Format {
        match self {
            Target::File(_, format) => *format,
            Target::Stdout => Format::Exr,
        }
    }
}

/// As messages name it.
impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Target::File(path, _) => write!(f, "{}", path.display()),
            Target::Stdout => f.write_str("standard output"),
        }
    }
}

impl Depth {
    /// Whether the user chose anything.
    pub fn is_given(&self) -> bool {
        self.float || self.of_png().is_some()
    }

    /// The first option given that is for PNG alone.
    fn of_png(&self) -> Option<&'static str> {
        let given = [
            (self.bits.is_some(), "--bits"),
            (self.exposure.is_some(), "--exposure"),
            (self.white.is_some(), "--white"),
            (self.tonemap.is_some(), "--tonemap"),
            (self.no_dither, "--no-dither"),
        ];
        given.into_iter().find_map(|(given, name)| given.then_some(name))
    }

    /// The options for a target, which must be of the format that they are for.
    pub fn options(&self, target: &Target) -> Result<Options, Failure> {
        let usage = |text: String| Err(Failure::new(Exit::Usage, text));
        match (target.format(), self.of_png()) {
            (Format::Exr, Some("--bits")) => {
                usage("--bits is for PNG: an EXR has 16 bits a sample, or 32 with --float".into())
            }
            (Format::Exr, Some(name)) => usage(format!("{name} is for PNG: an EXR holds the light itself")),
            (Format::Png, _) if self.float => usage("--float is for EXR: a PNG has --bits 8 or --bits 16".into()),
            _ => Ok(Options { float: self.float, coding: self.coding() }),
        }
    }

    fn coding(&self) -> Coding {
        let display = Display {
            exposure: self.exposure.unwrap_or(0.0),
            white: self.white,
            tone_map: self.tonemap.map_or(ToneMap::None, ToneMap::from),
        };
        let bits = if self.bits.as_deref() == Some("16") { Bits::Sixteen } else { Bits::Eight };
        Coding { bits, display, dither: !self.no_dither }
    }
}

/// Writes a picture whole, or not at all, and says what the format could not hold.
pub fn write(
    picture: &Picture,
    target: &Target,
    options: Options,
    description: &Description,
    run: &Run,
) -> Result<(), Failure> {
    let encoded = match target.format() {
        Format::Exr => output::exr::encode(picture, options.float, description),
        Format::Png => output::png::encode(picture, options.coding, description),
    };
    let (bytes, losses) =
        encoded.map_err(|error| Failure::new(Exit::Output, format!("{target}: cannot be encoded: {error}")))?;
    match target {
        Target::File(path, _) => write_bytes(path, &bytes, run)?,
        Target::Stdout => {
            let mut out = io::stdout().lock();
            let written = out.write_all(&bytes).and_then(|()| out.flush());
            written.map_err(|error| Failure::output(Path::new("standard output"), &error))?;
        }
    }
    tell(losses, target, run);
    Ok(())
}

/// Whether a name is that of a device or pipe and says no format: such a one takes EXR, as standard output does.
fn is_device(path: &Path) -> bool {
    path.extension().is_none() && std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
}

/// Writes bytes whole, or not at all.
pub fn write_bytes(path: &Path, bytes: &[u8], run: &Run) -> Result<(), Failure> {
    Ok(run.signals.undisturbed(|| aside::write_while(path, bytes, || !run.signals.is_caught()))?)
}

/// A PNG clamps bright light by its nature; everything else is worth a word.
fn tell(losses: Losses, target: &Target, run: &Run) {
    if losses.dropped > 0 {
        run.console.warn(&format!("{target}: {} samples are not finite and became 0", losses.dropped));
    }
    if losses.clamped > 0 && target.format() == Format::Exr {
        let most = "the largest 16-bit number, 65504";
        run.console.warn(&format!("{target}: {} samples became {most}: --float keeps them", losses.clamped));
    }
}
