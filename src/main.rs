//! The command `octray`: all of it is in [`cli`], behind a look at the CPU.
#![forbid(unsafe_code)]

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    // First of all: what follows may be made of instructions that an older CPU dies of.
    match cli::cpu::is_sufficient() {
        true => cli::run(),
        false => cli::cpu::refuse(),
    }
}
