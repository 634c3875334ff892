//! `octray completions` and `octray man`, from the definition of the command line itself.

use std::path::PathBuf;

use clap::CommandFactory;
use clap_complete::Shell;
use clap_mangen::Man;

use super::exit::{Exit, Failure};
use super::{Cli, Run, pictures};

const COMPLETION_EXAMPLES: &str = "\
Examples:
  octray completions bash > ~/.local/share/bash-completion/completions/octray
  octray completions fish > ~/.config/fish/completions/octray.fish";

const MAN_EXAMPLES: &str = "\
Examples:
  octray man | man -l -
  octray man ~/.local/share/man/man1";

/// Arguments of `octray completions`.
#[derive(Debug, clap::Args)]
#[command(after_help = COMPLETION_EXAMPLES)]
pub struct CompletionArgs {
    /// Shell to complete for
    #[arg(value_enum)]
    shell: Shell,
}

/// Arguments of `octray man`.
#[derive(Debug, clap::Args)]
#[command(after_help = MAN_EXAMPLES)]
pub struct ManArgs {
    /// Directory for the pages of all commands [default: the first page, to standard output]
    directory: Option<PathBuf>,
}

pub fn completions(args: &CompletionArgs, run: &Run) -> Result<Exit, Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "octray", &mut script);
    run.console.print(&String::from_utf8_lossy(&script))?;
    Ok(Exit::Done)
}

pub fn man(args: &ManArgs, run: &Run) -> Result<Exit, Failure> {
    let mut command = Cli::command();
    command.build();
    let Some(directory) = &args.directory else {
        run.console.print(&String::from_utf8_lossy(&page(command)?))?;
        return Ok(Exit::Done);
    };
    let commands: Vec<_> = command.get_subcommands().filter(|command| command.get_name() != "help").cloned().collect();
    for command in commands.into_iter().chain([command]) {
        let name = command.get_display_name().unwrap_or("octray").to_owned();
        pictures::write_bytes(&directory.join(format!("{name}.1")), &page(command)?, run)?;
    }
    Ok(Exit::Done)
}

fn page(command: clap::Command) -> Result<Vec<u8>, Failure> {
    let mut page = Vec::new();
    Man::new(command).render(&mut page).map_err(|error| Failure::new(Exit::Output, error))?;
    Ok(page)
}
