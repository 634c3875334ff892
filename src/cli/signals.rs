//! SIGINT and SIGTERM: stop at once, but never in the middle of writing a file.
//!
//! Batches look for signals themselves: they stop within a block of pixels, and have a second and a half for it.
//! Nothing but a file in the making has to be cleared away, so the first signal ends the process from a
//! thread of its own, whatever the others are doing (loading, building, tracing), within a tenth of a
//! second. A file that is being written is given up first, or finished where it is nearly done: it
//! appears whole, or not at all. A second signal does not wait for that.
//!
//! SIGUSR1 asks a render to write what it has so far, and to go on.

use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use octray::output::aside;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use super::console;

/// How often the thread looks up. A flag that is looked at works on every system.
const PERIOD: Duration = Duration::from_millis(50);
/// How long work may take that stops by itself.
const PATIENCE: Duration = Duration::from_millis(1500);

/// The watch over signals.
#[derive(Debug, Clone, Default)]
pub struct Signals {
    /// The signal that came, 0 before.
    caught: Arc<AtomicUsize>,
    /// Held while a file is written.
    writing: Arc<Mutex<()>>,
    /// SIGUSR1 came: somebody wants to see how far it is.
    asked: Arc<AtomicBool>,
    /// Set while the work stops by itself when a signal came.
    graceful: Arc<AtomicBool>,
    /// To be cleared before the last message.
    bar: Arc<OnceLock<ProgressBar>>,
}

impl Signals {
    /// Starts to watch. Where a signal cannot be caught, it ends the process as it always does.
    pub fn watch() -> Self {
        let signals = Signals::default();
        let watch = signals.clone();
        if thread::Builder::new().spawn(move || -> () { watch.wait() }).is_err() {
            return signals;
        }
        #[cfg(unix)]
        let _ = flag::register(signal_hook::consts::SIGUSR1, Arc::clone(&signals.asked));
        let again = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            let number = usize::try_from(signal).unwrap_or_default();
            // In this order: the first signal arms what the second one meets.
            let _ = flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&again))
                .and_then(|_| flag::register(signal, Arc::clone(&again)))
                .and_then(|_| flag::register_usize(signal, Arc::clone(&signals.caught), number));
        }
        signals
    }

    /// Does something that must not be left half-done. Where a signal comes meanwhile, the process ends after it.
    pub fn undisturbed<T>(&self, write: impl FnOnce() -> T) -> T {
        let held = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let result = write();
        drop(held);
        while self.is_caught() {
            thread::park(); // the watch ends the process
        }
        result
    }

    /// Does something that stops by itself soon after a signal came, and clears away what it made; if it does not, the
    /// process ends all the same.
    pub fn graceful<T>(&self, work: impl FnOnce() -> T) -> T {
        self.graceful.store(true, Ordering::Relaxed);
        let result = work();
        self.graceful.store(false, Ordering::Relaxed);
        result
    }

    /// Ends the process as the signal that came wants it.
    pub fn end(&self) -> ! {
        self.finish(self.caught.load(Ordering::Relaxed) as i32)
    }

    /// Whether a signal came, and what takes long should be given up.
    pub fn is_caught(&self) -> bool {
        self.caught.load(Ordering::Relaxed) != 0
    }

    /// Whether SIGUSR1 came since the last time that this was asked.
    pub fn is_asked(&self) -> bool {
        self.asked.load(Ordering::Relaxed) && self.asked.swap(false, Ordering::Relaxed)
    }

    /// Has a progress bar cleared before a signal ends the process.
    pub fn clear(&self, bar: &ProgressBar) {
        let _ = self.bar.set(bar.clone());
    }

    fn wait(&self) -> ! {
        let signal = loop {
            thread::sleep(PERIOD);
            match self.caught.load(Ordering::Relaxed) {
                0 => {}
                signal => break signal as i32,
            }
        };
        let caught = Instant::now();
        while self.graceful.load(Ordering::Relaxed) && caught.elapsed() < PATIENCE {
            thread::sleep(PERIOD);
        }
        self.finish(signal)
    }

    fn finish(&self, signal: i32) -> ! {
        let _held = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        aside::abandon();
        if let Some(bar) = self.bar.get() {
            bar.finish_and_clear();
        }
        console::say(&format!("octray: stopped by {}", if signal == SIGINT { "SIGINT" } else { "SIGTERM" }));
        process::exit(128 + signal)
    }
}
