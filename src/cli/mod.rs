//! The command line: one file a command, and what they share.
//!
//! A command reads its arguments, calls the library, and says what came of it; it decides nothing about
//! pictures. Results go to standard output, remarks and errors to standard error, and the exit code tells
//! the cause ([`exit::Exit`]). What the library is asked to write is checked before the work begins.
//!
//! | file | what it is about |
//! |---|---|
//! | `render`, `batch`, `info`, `check`, `verify`, `compare`, `query`, `convert`, `merge`, `status`, `farm`, `manual` | one command each (`manual`: two) |
//! | `args`, `atoms`, `settings` | words that several commands understand |
//! | `jobs` | running what `render` and `batch` put on a list |
//! | `bench`, `gate`, `pareto` | measuring |
//! | `scene_file`, `pictures`, `hits` | files in and out |
//! | `console`, `progress`, `stats_json` | what is said, to people and machines |
//! | `cpu`, `system`, `signals`, `exit` | the world around the process |

mod again;
mod args;
mod atoms;
mod batch;
mod bench;
mod check;
mod compare;
mod console;
mod convert;
pub mod cpu;
mod exit;
mod explain;
mod extras;
mod farm;
mod gate;
mod hits;
mod info;
mod jobs;
mod layers;
mod manual;
mod merge;
mod pareto;
mod pictures;
mod preview;
mod progress;
mod query;
mod render;
mod scene_file;
mod settings;
mod sheet;
mod signals;
mod stats_json;
mod status;
mod stress;
mod system;
mod verify;

use std::path::Path;
use std::process::ExitCode;
use std::sync::LazyLock;
use std::time::Instant;

use clap::{Parser, Subcommand, ValueEnum};
use octray::output::{ColorSpace, aside};

use self::console::{Console, When};
use self::exit::{Exit, Failure};
use self::signals::Signals;

static VERSION: LazyLock<String> = LazyLock::new(cpu::version);

const EXAMPLES: &str = "\
Examples:
  octray render scenes/fig5.toml -o fig5.exr     render a scene
  octray info scenes/fig5.toml                   what is in it
  octray check scenes/fig5.toml                  is the picture right?
  octray compare fig5.exr yesterday.exr          how far apart are two pictures?

`octray COMMAND --help` has the options of a command and examples of their use.

Exit codes: 0 done; 1 the answer is no (check, verify, compare, bench gate); 2 wrong usage; 3 a bad input file;
4 an output cannot be written; 5 out of memory or over a limit; 6 the CPU lacks what this
build needs; 130 and 143 stopped by a signal.";

/// Batch renderer and ray tracer for analytic primitives
#[derive(Debug, Parser)]
#[command(name = "octray", version = VERSION.as_str(), after_help = EXAMPLES, max_term_width = 100)]
struct Cli {
    /// When to use colours in messages; or the primaries of an EXR, where one is written
    #[arg(long, global = true, value_enum, value_name = "WHEN")]
    color: Vec<Color>,
    /// Say nothing but errors
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Render scenes to EXR or PNG files
    Render(Box<render::Args>),
    /// Render a list of pictures: what is missing or stale
    Batch(Box<batch::Args>),
    /// Say what a scene holds and what it takes
    Info(info::Args),
    /// Check the engine against the f64 reference on a scene
    Check(check::Args),
    /// Print the tree of rays of one sample of a pixel
    Explain(explain::Args),
    /// Run what f32 is bad at, family by family, against exact geometry
    Stress(stress::Args),
    /// Confirm a picture by rendering it again
    Verify(verify::Args),
    /// Measure how far apart two pictures are
    Compare(compare::Args),
    /// Trace the rays of a file and write what they meet
    Query(query::Args),
    /// Measure throughput by the kind of ray, or guard it: `bench gate`
    Bench(bench::Args),
    /// Measure run time against error: a page, plots and a table
    Pareto(pareto::Args),
    /// Convert scenes to TOML, and pictures between EXR and PNG
    Convert(convert::Args),
    /// Join crops of one frame to the frame
    Merge(merge::Args),
    /// Say what a batch has done, by the record in its directory
    Status(status::Args),
    /// Write scripts that render on many machines
    Farm(farm::Args),
    /// Print the completions of a shell
    Completions(manual::CompletionArgs),
    /// Print the manual page, or write the pages of all commands
    Man(manual::ManArgs),
}

/// The two things that `--color` is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Color {
    /// Colours in messages on a terminal, unless NO_COLOR is set (usual)
    Auto,
    /// Colours in messages always
    Always,
    /// Colours in messages never
    Never,
    /// EXR files in linear Rec. 709, which readers take for granted (usual)
    Rec709,
    /// EXR files in ACEScg
    Acescg,
}

impl Cli {
    fn messages(&self) -> When {
        let when = |color: &Color| match color {
            Color::Auto => Some(When::Auto),
            Color::Always => Some(When::Always),
            Color::Never => Some(When::Never),
            Color::Rec709 | Color::Acescg => None,
        };
        self.color.iter().rev().find_map(when).unwrap_or_default()
    }

    /// Of an EXR, if they are said.
    fn primaries(&self) -> Option<ColorSpace> {
        let space = |color: &Color| match color {
            Color::Rec709 => Some(ColorSpace::Rec709),
            Color::Acescg => Some(ColorSpace::AcesCg),
            Color::Auto | Color::Always | Color::Never => None,
        };
        self.color.iter().rev().find_map(space)
    }
}

/// What surrounds a command.
#[derive(Debug)]
pub struct Run {
    /// When the process began.
    start: Instant,
    console: Console,
    signals: Signals,
    /// The primaries of EXR files, where the command line says them.
    color_space: Option<ColorSpace>,
}

impl Run {
    /// Makes sure, before any work, that a file can be written.
    fn check_output(&self, path: &Path, inputs: &[&Path]) -> Result<(), Failure> {
        let same = |input: &&&Path| {
            path == **input
                || path.canonicalize().is_ok_and(|path| input.canonicalize().is_ok_and(|input| path == input))
        };
        if inputs.iter().find(same).is_some() {
            let text = "is an input as well: the output should be another file";
            return Err(Failure::new(Exit::Usage, text).of(path));
        }
        Ok(self.signals.undisturbed(|| aside::check(path))?)
    }

    /// The same for something that is done quietly.
    fn hushed(&self) -> Run {
        Run {
            start: self.start,
            console: Console { quiet: true, ..self.console },
            signals: self.signals.clone(),
            color_space: self.color_space,
        }
    }

    /// Says what makes this build slow, before work that takes time.
    fn warn_of_build(&self) {
        cpu::warnings().iter().for_each(|warning| self.console.warn(warning));
    }
}

/// Runs the command line of this process.
#[inline(never)]
pub fn run() -> ExitCode {
    let start = Instant::now();
    std::panic::set_hook(Box::new(|panic| {
        let place = panic.location().map(|place| format!(" at {}:{}", place.file(), place.line())).unwrap_or_default();
        console::say(&format!("octray: error: a mistake in octray itself{place}; please report it with the scene"));
    }));
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(message) => {
            let _ = message.print();
            return ExitCode::from(u8::try_from(message.exit_code()).unwrap_or(Exit::Usage as u8));
        }
    };
    let (console, color_space) = (Console::new(cli.messages(), cli.quiet), cli.primaries());
    let run = Run { start, console, signals: Signals::watch(), color_space };
    let writes_exr =
        matches!(cli.command, Command::Render(_) | Command::Batch(_) | Command::Convert(_) | Command::Merge(_));
    if run.color_space.is_some() && !writes_exr {
        run.console.error("--color rec709 and acescg are about EXR files, and this command writes none");
        return ExitCode::from(Exit::Usage as u8);
    }
    let result = match &cli.command {
        Command::Render(args) => render::run(args, &run),
        Command::Batch(args) => batch::run(args, &run),
        Command::Info(args) => info::run(args, &run),
        Command::Check(args) => check::run(args, &run),
        Command::Explain(args) => explain::run(args, &run),
        Command::Stress(args) => stress::run(args, &run),
        Command::Verify(args) => verify::run(args, &run),
        Command::Compare(args) => compare::run(args, &run),
        Command::Query(args) => query::run(args, &run),
        Command::Bench(args) => bench::run(args, &run),
        Command::Pareto(args) => pareto::run(args, &run),
        Command::Convert(args) => convert::run(args, &run),
        Command::Merge(args) => merge::run(args, &run),
        Command::Status(args) => status::run(args, &run),
        Command::Farm(args) => farm::run(args, &run),
        Command::Completions(args) => manual::completions(args, &run),
        Command::Man(args) => manual::man(args, &run),
    };
    let exit = result.unwrap_or_else(|failure| {
        run.console.error(&failure.message);
        failure.exit
    });
    ExitCode::from(exit as u8)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn the_definition_of_the_command_line_is_sound() {
        super::Cli::command().debug_assert();
    }
}
