//! Picture files for the commands: where they go, and how their samples are stored.

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use octray::film::Picture;
use octray::output::{self, Bits, Description, Format, Losses, Options, OutputError, aside};

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
        self.float || self.bits.is_some()
    }

    /// The options for a target, which must be of the format that they are for.
    pub fn options(&self, target: &Target) -> Result<Options, Failure> {
        match target.format() {
            Format::Exr if self.bits.is_some() => {
                Err(Failure::new(Exit::Usage, "--bits is for PNG: an EXR has 16 bits a sample, or 32 with --float"))
            }
            Format::Png if self.float => {
                Err(Failure::new(Exit::Usage, "--float is for EXR: a PNG has --bits 8 or --bits 16"))
            }
            _ => {
                let bits = if self.bits.as_deref() == Some("16") { Bits::Sixteen } else { Bits::Eight };
                Ok(Options { float: self.float, bits })
            }
        }
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
        Format::Png => output::png::encode(picture, options.bits, description),
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
