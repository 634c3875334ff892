//! Picture files for the commands: where they go, and how their samples are stored.

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use clap::{Args, ValueEnum};
use octray::film::Picture;
use octray::output::{
    self, Bits, Coding, Compression, Contents, Description, Display, EncodeError, Encoded, Format, Losses, Options,
    OutputError, Storage, ToneMap, Transfer, aside,
};

use super::Run;
use super::exit::{Exit, Failure};

/// How samples are stored.
#[derive(Debug, Clone, Args)]
pub struct Depth {
    /// EXR: store colour in 32-bit floats instead of 16-bit ones
    #[arg(long)]
    float: bool,
    /// EXR: how samples are packed [default: zips]. pxr24, dwaa and dwab lose something; layers of 32 bits are kept from
    /// them, in a part of their own
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(Compression::ALL.map(Compression::name)))]
    compression: Option<String>,
    /// EXR: a part for each layer, instead of one for all
    #[arg(long)]
    multipart: bool,
    /// EXR: the name of the depth channel [default: depth.Z]
    #[arg(long, value_name = "NAME", value_parser = ["Z", "depth.Z"])]
    depth_name: Option<String>,
    /// EXR: Cryptomatte manifests in .json files beside the picture, not only those that are too long for its header
    #[arg(long)]
    crypto_sidecar: bool,
    /// EXR: who owns the picture, for its header
    #[arg(long, value_name = "TEXT")]
    pub owner: Option<String>,
    /// EXR: any words, for its header
    #[arg(long, value_name = "TEXT")]
    pub comments: Option<String>,
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
    /// PNG: high dynamic range, 16 bits by the curve of Rec. 2100 (PQ), light of 1 at 203 cd/m2
    #[arg(long, conflicts_with_all = ["bits", "white", "tonemap", "no_dither"])]
    hdr_png: bool,
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

fn first_given<const N: usize>(given: [(bool, &'static str); N]) -> Option<&'static str> {
    given.into_iter().find_map(|(given, name)| given.then_some(name))
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

    pub fn format(&self) -> Format {
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
        self.of_exr().or(self.of_png()).is_some()
    }

    /// The first option given that is for EXR alone.
    fn of_exr(&self) -> Option<&'static str> {
        first_given([
            (self.float, "--float"),
            (self.compression.is_some(), "--compression"),
            (self.multipart, "--multipart"),
            (self.depth_name.is_some(), "--depth-name"),
            (self.crypto_sidecar, "--crypto-sidecar"),
            (self.owner.is_some(), "--owner"),
            (self.comments.is_some(), "--comments"),
        ])
    }

    /// The first option given that is for PNG alone.
    fn of_png(&self) -> Option<&'static str> {
        first_given([
            (self.bits.is_some(), "--bits"),
            (self.exposure.is_some(), "--exposure"),
            (self.white.is_some(), "--white"),
            (self.tonemap.is_some(), "--tonemap"),
            (self.no_dither, "--no-dither"),
            (self.hdr_png, "--hdr-png"),
        ])
    }

    /// The options for a target, which must be of the format that they are for.
    pub fn options(&self, target: &Target, run: &Run) -> Result<Options, Failure> {
        let usage = |text: String| Err(Failure::new(Exit::Usage, text));
        let color = run.color_space.map(|_| "--color rec709|acescg");
        match (target.format(), self.of_png(), self.of_exr().or(color)) {
            (Format::Exr, Some("--bits"), _) => {
                usage("--bits is for PNG: an EXR has 16 bits a sample, or 32 with --float".into())
            }
            (Format::Exr, Some(name), _) => usage(format!("{name} is for PNG: an EXR holds the light itself")),
            (Format::Png, _, Some("--float")) => usage("--float is for EXR: a PNG has --bits 8 or --bits 16".into()),
            (Format::Png, _, Some(name)) => usage(format!("{name} is for EXR: a PNG has one way to store a picture")),
            _ => Ok(Options { exr: self.storage(run), coding: self.coding() }),
        }
    }

    fn storage(&self, run: &Run) -> Storage {
        let named = |name: &String| Compression::ALL.into_iter().find(|compression| compression.name() == *name);
        Storage {
            float: self.float,
            compression: self.compression.as_ref().and_then(named).unwrap_or_default(),
            multipart: self.multipart,
            root_depth: self.depth_name.as_deref() == Some("Z"),
            color: run.color_space.unwrap_or_default(),
            sidecar: self.crypto_sidecar,
            ..Storage::default()
        }
    }

    fn coding(&self) -> Coding {
        let display = Display {
            exposure: self.exposure.unwrap_or(0.0),
            white: self.white,
            tone_map: self.tonemap.map_or(ToneMap::None, ToneMap::from),
        };
        let bits = if self.bits.as_deref() == Some("16") { Bits::Sixteen } else { Bits::Eight };
        let transfer = if self.hdr_png { Transfer::Pq } else { Transfer::Srgb };
        Coding { bits, display, dither: !self.no_dither, transfer }
    }
}

/// Pictures of files to be written as these options say. Colours stay in the primaries of the files where the target has the
/// same, so that they keep their bits. Says where names are missing.
pub fn ready(
    files: Vec<(&Path, Contents)>,
    (target, options): (&Target, &mut Options),
    run: &Run,
) -> Result<Vec<Contents>, Failure> {
    for (path, found) in &files {
        found.unnamed.iter().for_each(|fault| run.console.warn(&format!("{}: {fault}", path.display())));
    }
    let color = |found: &Contents| found.storage.map(|storage| storage.color);
    if target.format() == Format::Exr && files.iter().all(|(_, found)| color(found) == Some(options.exr.color)) {
        options.exr.given = options.exr.color;
        return Ok(files.into_iter().map(|(_, found)| found).collect());
    }
    files.into_iter().map(|(path, found)| Ok(found.in_rec709(path)?)).collect()
}

/// Writes the picture of a file whole, or not at all, and says what the format could not hold. What cannot be encoded is the
/// file's fault.
pub fn write(
    (source, picture): (&Path, &Picture),
    target: &Target,
    options: Options,
    description: Description,
    run: &Run,
) -> Result<(), Failure> {
    let name = match target {
        Target::File(path, _) => output::stem(path),
        Target::Stdout => None,
    };
    let description = Description { file_stem: name, ..description };
    let encoded = output::encode(target.format(), picture, options, &description);
    let fault = |error| Failure::new(Exit::Input, format!("cannot be written as {target}: {error}")).of(source);
    save(encoded.map_err(fault)?, target, run)
}

/// Writes an encoded picture, and says what the format could not hold.
pub fn put(encoded: Result<Encoded, EncodeError>, target: &Target, run: &Run) -> Result<(), Failure> {
    let fault = |error| Failure::new(Exit::Output, format!("{target}: cannot be encoded: {error}"));
    save(encoded.map_err(fault)?, target, run)
}

fn save(encoded: Encoded, target: &Target, run: &Run) -> Result<(), Failure> {
    match target {
        Target::File(path, _) => {
            for file in &encoded.beside {
                write_bytes(&path.with_file_name(&file.name), &file.bytes, run)?;
            }
            write_bytes(path, &encoded.bytes, run)?;
        }
        Target::Stdout => {
            let mut out = io::stdout().lock();
            let written = out.write_all(&encoded.bytes).and_then(|()| out.flush());
            written.map_err(|error| Failure::output(Path::new("standard output"), &error))?;
        }
    }
    tell(encoded.losses, target, run);
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

fn tell(losses: Losses, target: &Target, run: &Run) {
    let texts = self::losses(losses, target.format() == Format::Exr);
    texts.iter().for_each(|text| run.console.warn(&format!("{target}: {text}")));
}

/// What a format could not hold, in words. A PNG clamps bright light by its nature; everything else is worth a word.
pub fn losses(losses: Losses, is_exr: bool) -> Vec<String> {
    let mut texts = Vec::new();
    if losses.dropped > 0 {
        texts.push(format!("{} samples are not finite and became 0", losses.dropped));
    }
    if losses.clamped > 0 && is_exr {
        let most = "the largest 16-bit number, 65504";
        texts.push(format!("{} samples became {most}: --float keeps them", losses.clamped));
    }
    texts
}
