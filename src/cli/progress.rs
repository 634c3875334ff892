//! How a batch goes on, for people (a bar on a terminal) and machines (lines on standard output).

use std::io::{self, Write};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use octray::batch::{Event, Job, Report, Summary, Watch};
use octray::output::{Format, Losses};
use serde_json::{Value, json};

use super::Run;
use super::preview::Preview;
use super::{extras, pictures, scene_file, system};

/// Redraws a second.
const RATE: u8 = 10;
/// Steps of the bar.
const STEPS: u64 = 1 << 20;
/// Least time between two lines about progress.
const PERIOD: Duration = Duration::from_millis(500);

/// Lines for machines.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Lines {
    /// One JSON object a line: start, frame_start, progress, frame_done, frame_skipped, warning, error, end
    Json,
    /// As Open Job Description has it: openjd_progress, openjd_status, openjd_fail
    Openjd,
}

/// Tells what happens.
pub struct Teller<'r> {
    run: &'r Run,
    lines: Option<Lines>,
    many: bool,
    preview: Option<Preview<'r>>,
    keep: bool,
    start: Instant,
    bar: ProgressBar,
    state: Mutex<State>,
}

#[derive(Default)]
struct State {
    last: Option<Instant>,
    reports: Vec<(usize, Report)>,
}

impl<'r> Teller<'r> {
    /// Begins; with `keep` the reports of all jobs are kept.
    pub fn new(
        run: &'r Run,
        lines: Option<Lines>,
        preview: Option<Preview<'r>>,
        many: bool,
        jobs: usize,
        keep: bool,
    ) -> Self {
        let hidden = run.console.quiet || lines.is_some();
        let target = match hidden {
            true => ProgressDrawTarget::hidden(),
            false => ProgressDrawTarget::stderr_with_hz(RATE),
        };
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %, {eta} left") {
            bar.set_style(style);
        }
        run.signals.clear(&bar);
        bar.enable_steady_tick(Duration::from_millis(500)); // the clock goes on where a block takes long
        let teller = Teller { run, lines, many, preview, keep, start: Instant::now(), bar, state: Mutex::default() };
        teller.line(json!({ "event": "start", "frames": jobs, "octray": env!("CARGO_PKG_VERSION") }));
        teller
    }

    /// What the jobs came to, those that were asked for.
    pub fn reports(&self) -> Vec<(usize, Report)> {
        let mut reports = std::mem::take(&mut self.state().reports);
        reports.sort_by_key(|(job, _)| *job);
        reports
    }

    /// The end of it all.
    pub fn end(&mut self, summary: &Summary) {
        self.bar.finish_and_clear();
        if let Some(preview) = self.preview.take() {
            preview.finish();
        }
        let (done, failed) = (summary.written + summary.skipped, summary.failed.len());
        self.line(json!({
            "event": "end", "written": summary.written, "skipped": summary.skipped, "failed": failed,
            "left": summary.left, "cancelled": summary.cancelled, "seconds": self.start.elapsed().as_secs_f64(),
        }));
        if self.lines == Some(Lines::Openjd) {
            match failed + summary.left {
                0 => self.out("openjd_progress: 100.0\n"),
                count => self.out(&format!("openjd_fail: {count} of {} pictures failed\n", done + count)),
            }
        }
    }

    /// "12.3 s (8.1 a second)".
    pub fn pace(&self, written: usize) -> String {
        let seconds = self.start.elapsed().as_secs_f64();
        format!("{seconds:.2} s, {:.1} pictures a second", written as f64 / seconds.max(1e-9))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn line(&self, value: Value) {
        if self.lines == Some(Lines::Json) {
            self.out(&format!("{value}\n"));
        }
    }

    /// A line, flushed. Where nobody listens there is nobody to tell so.
    fn out(&self, text: &str) {
        let mut out = io::stdout().lock();
        let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    }

    fn progress(&self, done: f64, job: &Job) {
        self.bar.set_position((done * STEPS as f64) as u64);
        let Some(lines) = self.lines else { return };
        let mut state = self.state();
        let is_early = state.last.is_some_and(|last| last.elapsed() < PERIOD);
        if is_early {
            return;
        }
        state.last = Some(Instant::now());
        drop(state);
        let spent = self.start.elapsed().as_secs_f64();
        let left = if done > 0.0 { json!(spent * (1.0 - done) / done) } else { Value::Null };
        match lines {
            Lines::Json => {
                self.line(json!({ "event": "progress", "frame": job.frame(), "done": done, "eta_s": left }));
            }
            Lines::Openjd => {
                self.out(&format!("openjd_progress: {:.1}\n", 100.0 * done));
                self.out(&format!("openjd_status: {}\n", one_line(&job.to_string())));
            }
        }
    }

    fn note(&self, text: &str) {
        self.bar.suspend(|| self.run.console.note(text));
    }

    fn frame_done(&self, index: usize, job: &Job, report: &Report) {
        if !self.many {
            self.bar.finish_and_clear();
        }
        self.losses(report.losses, job);
        if !self.many {
            self.note(&summary(job, report, self.start));
        }
        let stats = &report.stats;
        self.line(json!({
            "event": "frame_done", "job": index, "frame": job.frame(), "output": job.to_string(),
            "bytes": report.bytes, "rays": stats.rays.rays.iter().sum::<u64>(),
            "seconds": {
                "load": report.load_seconds, "plan": stats.plan_seconds, "build": stats.build_seconds,
                "trace": stats.trace_seconds, "write": report.write_seconds,
            },
        }));
        if self.keep {
            self.state().reports.push((index, report.clone()));
        }
    }

    fn losses(&self, losses: Losses, job: &Job) {
        let texts = pictures::losses(losses, job.format == Format::Exr);
        texts.iter().for_each(|text| self.bar.suspend(|| self.run.console.warn(&format!("{job}: {text}"))));
    }
}

impl Watch for Teller<'_> {
    fn event(&self, event: &Event<'_>) {
        match event {
            Event::FrameStart(index, job) => {
                self.bar.set_message(job.to_string());
                let scene = job.scene.display().to_string();
                let (frame, output) = (job.frame(), job.to_string());
                self.line(json!({
                    "event": "frame_start", "job": index, "frame": frame, "scene": scene, "output": output,
                }));
            }
            Event::Progress(done, _, job) => self.progress(*done, job),
            Event::Block(_, job, renderer, fresh) => {
                if let Some(preview) = &self.preview {
                    preview.block(job, renderer, fresh);
                }
            }
            Event::Traced(index, job, rendering) => {
                if let Err(failure) = extras::write(job, rendering, self.run) {
                    self.event(&Event::Warning(*index, job, failure.message));
                }
            }
            Event::FrameDone(index, job, report) => self.frame_done(*index, job, report),
            Event::Skipped(index, job) => {
                if !self.many {
                    self.note(&format!("{job}: is there already, whole and up to date"));
                }
                let (frame, output) = (job.frame(), job.to_string());
                self.line(json!({ "event": "frame_skipped", "job": index, "frame": frame, "output": output }));
            }
            Event::Forecast(job, need, limit) => {
                let scene = job.scene.display();
                self.note(&format!("{scene}: about {need} MiB of memory are forecast, {limit} MiB are allowed"));
            }
            Event::Warning(index, job, text) => {
                self.note(&format!("octray: {text}"));
                self.line(json!({ "event": "warning", "job": index, "frame": job.frame(), "text": text }));
            }
            Event::Error(index, job, error) => {
                let text = error.to_string();
                self.line(json!({
                    "event": "error", "job": index, "frame": job.frame(), "output": job.to_string(), "text": text,
                }));
                // The error of a single job ends the command, which says it then.
                if self.many {
                    let message = match error {
                        octray::batch::JobError::Scene { path, errors } => {
                            scene_file::failure(path, errors, self.run.console.color).message
                        }
                        _ => text,
                    };
                    self.bar.suspend(|| self.run.console.error(&message));
                }
            }
        }
    }

    fn cancelled(&self) -> bool {
        self.run.signals.is_caught()
    }

    fn room(&self, bytes: u64, work: &str) -> Result<(), String> {
        system::need_memory(bytes, work).map_err(|failure| failure.message)
    }
}

fn one_line(text: &str) -> String {
    text.replace(['\n', '\r'], " ")
}

fn summary(job: &Job, report: &Report, start: Instant) -> String {
    let (stats, window) = (&report.stats, report.window);
    let rays = stats.rays.rays.iter().sum::<u64>();
    let (millions, seconds) = (rays as f64 / 1e6, stats.trace_seconds);
    format!(
        "{job}: {}x{} pixels, {}, {millions:.2} million rays in {seconds:.2} s ({:.1} Mrays/s), {:.2} s in all, {}",
        window.map_or(0, |window| window.width()),
        window.map_or(0, |window| window.height()),
        samples(report),
        millions / seconds.max(1e-9),
        start.elapsed().as_secs_f64(),
        system::peak_bytes().map_or_else(|| "done".to_owned(), |bytes| format!("{} of memory", system::size(bytes))),
    )
}

/// Samples per pixel, and the error where that decided on them.
fn samples(report: &Report) -> String {
    let Some(reached) = &report.stats.noise else { return format!("{} spp", report.spp) };
    let mean = reached.samples as f64 / reached.pixels.max(1) as f64;
    let short = match reached.short {
        0 => String::new(),
        tiles => format!(" ({tiles} tiles fell short)"),
    };
    let (error, worst) = (reached.error, reached.worst);
    format!("{mean:.1} spp on average, relative error {error:.4}, of the worst tile {worst:.4}{short}")
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_status_is_one_line() {
        assert_eq!(super::one_line("a\nopenjd_fail: b\r"), "a openjd_fail: b ");
    }
}
