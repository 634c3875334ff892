//! What a user reads: results on standard output, everything else on standard error.

use std::io::{self, ErrorKind, IsTerminal, Write};

use super::exit::{Exit, Failure};

/// When to use colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum When {
    /// On a terminal, unless NO_COLOR is set.
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// How to talk to the user.
#[derive(Debug, Clone, Copy)]
pub struct Console {
    /// Whether standard error takes colours.
    pub color: bool,
    /// Errors only.
    pub quiet: bool,
}

impl Console {
    pub fn new(when: When, quiet: bool) -> Self {
        let set = |name| std::env::var_os(name).is_some_and(|value| !value.is_empty());
        let dumb = std::env::var_os("TERM").is_some_and(|term| term == "dumb");
        let color = match when {
            When::Always => true,
            When::Never => false,
            When::Auto => io::stderr().is_terminal() && !set("NO_COLOR") && !dumb,
        };
        Console { color, quiet }
    }

    /// A remark, unless they are not wanted.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            say(text);
        }
    }

    /// Something that may be wrong, unless remarks are not wanted.
    pub fn warn(&self, text: &str) {
        self.note(&format!("octray: {}: {text}", self.paint("33", "warning")));
    }

    /// Why the command failed.
    pub fn error(&self, text: &str) {
        say(&format!("octray: {}: {text}", self.paint("1;31", "error")));
    }

    /// Results: a page of text that ends in a line break, or JSON.
    ///
    /// Nobody reading any more is not a failure.
    pub fn print(&self, text: &str) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                Err(Failure::new(Exit::Output, format!("standard output cannot be written: {error}")))
            }
            _ => Ok(()),
        }
    }

    /// Results as JSON.
    pub fn print_json(&self, value: &serde_json::Value) -> Result<(), Failure> {
        self.print(&pretty(value))
    }

    fn paint(&self, code: &str, text: &str) -> String {
        if self.color { format!("\u{1b}[{code}m{text}\u{1b}[0m") } else { text.to_owned() }
    }
}

/// JSON for people to read as well, with a line break at the end.
pub fn pretty(value: &serde_json::Value) -> String {
    format!("{value:#}\n")
}

/// A line on standard error. Where nobody listens there is nobody to tell so.
pub fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}
