//! A bar with the time left, on a terminal only.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use octray::Progress;

use super::Run;

/// Redraws a second.
const RATE: u8 = 10;

/// The bar of one render; it counts samples.
pub struct Bar(ProgressBar);

impl Bar {
    /// Shows a bar on standard error, unless that is no terminal or the user wants quiet.
    pub fn new(run: &Run, what: String) -> Self {
        let target = match run.console.quiet {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr_with_hz(RATE),
        };
        let bar = ProgressBar::with_draw_target(Some(1), target).with_message(what);
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %, {eta} left") {
            bar.set_style(style);
        }
        run.signals.clear(&bar);
        bar.enable_steady_tick(Duration::from_millis(500)); // the clock goes on where a block takes long
        Bar(bar)
    }
}

impl Progress for Bar {
    fn advance(&self, done: u64, total: u64) {
        self.0.set_length(total);
        // Threads may come in another order than they counted.
        if done > self.0.position() {
            self.0.set_position(done);
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
