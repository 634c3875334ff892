//! How a command ends: its exit code, and the message where it failed.

use std::path::Path;

use octray::measure::CompareError;
use octray::measure::bench::BenchError;
use octray::output::{OutputError, ReadError};
use octray::render::RenderError;

/// Exit codes. Signals end with 128 and their number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// Done.
    Done = 0,
    /// The answer is no: a check failed, pictures differ by more than a limit.
    No = 1,
    /// The command line does not make sense.
    Usage = 2,
    /// An input file is bad: scene, picture, rays.
    Input = 3,
    /// An output cannot be written.
    Output = 4,
    /// Out of memory, or over a limit of the machine.
    Limit = 5,
    /// The CPU lacks what the build needs.
    Cpu = 6,
}

/// Why a command did not do its work: one clear message.
#[derive(Debug)]
pub struct Failure {
    pub exit: Exit,
    /// What, where, and what would be right; over several lines where a scene is shown.
    pub message: String,
}

impl Failure {
    pub fn new(exit: Exit, message: impl ToString) -> Self {
        Failure { exit, message: message.to_string() }
    }

    /// An error about an output file, as the system gave it.
    pub fn output(path: &Path, error: &std::io::Error) -> Self {
        Failure::new(Exit::Output, format!("{}: cannot be written: {error}", path.display()))
    }

    /// The same failure of a certain file.
    pub fn of(mut self, path: &Path) -> Self {
        self.message = format!("{}: {}", path.display(), self.message);
        self
    }
}

impl From<OutputError> for Failure {
    fn from(error: OutputError) -> Self {
        let exit = if let OutputError::Format { .. } = error { Exit::Usage } else { Exit::Output };
        Failure::new(exit, error)
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Failure::new(Exit::Input, error)
    }
}

impl From<CompareError> for Failure {
    fn from(error: CompareError) -> Self {
        Failure::new(Exit::Input, error)
    }
}

impl From<BenchError> for Failure {
    fn from(error: BenchError) -> Self {
        match error {
            BenchError::Render(error) => error.into(),
            BenchError::NothingMet | BenchError::NoLight => Failure::new(Exit::Input, error),
            BenchError::Wrong { .. } => Failure::new(Exit::No, error),
        }
    }
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        let exit = match error {
            RenderError::NoCamera | RenderError::NoImage | RenderError::Scene(_) => Exit::Input,
            RenderError::UnknownCamera { .. }
            | RenderError::BadWindow { .. }
            | RenderError::NoiseWithLayers
            | RenderError::NoiseWithShutter => Exit::Usage,
            RenderError::Threads(_) | RenderError::Cancelled => Exit::Limit,
        };
        Failure::new(exit, error)
    }
}
