//! Who does what, and when.
//!
//! As many workers as threads take jobs in order. A worker traces its picture block by block in a way that lets the
//! others help: a picture that is small is done before anybody could, one that is large keeps all of them busy, and
//! when the list is empty those without a job help with what is left, so that no core idles before the last block.
//! While a large picture is traced by all, nobody opens another one; while one is read or built, others are.

use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::checkpoint::{Checkpoint, Saves};
use super::memory::{self, Held};
use super::source::{Shared, Ticket};
use super::write::{Finished, Room, Writer, line};
use super::{Event, Fresh, Job, JobError, Report, Shard, Sources, Watch, annotate, existing, ledger};
use crate::film::{Picture, Window};
use crate::output::exr::{Encoded, Packer};
use crate::output::{self, EncodeError, Format, OutputError, aside};
use crate::render::{RenderError, Renderer, Rendering, Task, moments, pool};
use crate::scene::inputs::{Hashes, hex, sha256};
use crate::scene::{Aov, Layers, Scene};

/// Samples of a picture that is worth all threads: some tenths of a second.
const LARGE: u64 = 1 << 22;

/// How a batch is run.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Threads; 0: as many as there are cores for this process.
    pub threads: usize,
    /// Flush each file by itself at once, instead of in groups.
    pub durable: bool,
    /// Leave out jobs whose files are there, whole and up to date.
    pub resume: bool,
    /// Keep a record beside the outputs.
    pub ledger: bool,
    /// Most memory for scenes, trees and pictures, in bytes, as forecast.
    pub max_memory: Option<u64>,
    /// Write what is seen where beside each picture: its name with `.json`.
    pub annotations: bool,
    /// Keep what is done of a single picture in a file, and go on from there.
    pub checkpoint: Option<Checkpoint>,
    /// Which part of the list this is, for the files.
    pub shard: Option<Shard>,
}

/// What a batch came to.
#[derive(Debug, Default)]
pub struct Summary {
    /// Jobs whose files were written.
    pub written: usize,
    /// Jobs whose files were there already.
    pub skipped: usize,
    /// Jobs that failed, by their index, and why.
    pub failed: Vec<(usize, JobError)>,
    /// Jobs that were not begun, since no file can be written there, or since the batch was stopped.
    pub left: usize,
    /// Whether it was asked to stop.
    pub cancelled: bool,
}

/// A picture that was traced.
struct Pictured {
    rendering: Rendering,
    /// What its file says of it.
    description: output::Description,
    /// What is seen where, if that is asked for.
    annotations: Option<(PathBuf, Vec<u8>)>,
    /// Its file, where it was packed as it was traced, and what of the time went there.
    packed: Option<(Packer, f64)>,
}

/// A batch on its way.
struct Batch<'a> {
    jobs: &'a [Job],
    options: &'a Options,
    watch: &'a dyn Watch,
    sources: &'a Sources,
    hashes: Mutex<Hashes>,
    ledgers: Option<ledger::Ledgers>,
    queue: Mutex<Queue>,
    /// Samples of large pictures that wait for a thread.
    large: AtomicU64,
    /// Jobs done, in millionths.
    done: AtomicU64,
    stop: AtomicBool,
    summary: Mutex<Summary>,
    /// Scene files whose memory was forecast.
    forecast: Mutex<HashSet<PathBuf>>,
    threads: usize,
}

#[derive(Default)]
struct Queue {
    next: usize,
    open: usize,
    bytes: u64,
}

/// What a worker is to do.
enum Turn {
    Job(usize, Ticket, u64),
    Help,
    End,
}

/// Runs all jobs, whatever becomes of single ones.
///
/// # Errors
/// The threads could not be started.
pub fn run(jobs: &[Job], options: &Options, sources: &Sources, watch: &dyn Watch) -> Result<Summary, RenderError> {
    let pool = pool(options.threads)?;
    sweep(jobs);
    let batch = Batch {
        jobs,
        options,
        watch,
        sources,
        hashes: Mutex::default(),
        ledgers: options.ledger.then(|| ledger::Ledgers::open(jobs)),
        queue: Mutex::default(),
        large: AtomicU64::new(0),
        done: AtomicU64::new(0),
        stop: AtomicBool::new(false),
        summary: Mutex::default(),
        forecast: Mutex::default(),
        threads: pool.current_num_threads(),
    };
    let room = Room::default();
    thread::scope(|scope| {
        let (writer, inbox) = line(&room, options.durable);
        let batch = &batch;
        let write = thread::Builder::new().name("write".into()).spawn_scoped(scope, move || {
            inbox.run(&|| false, &mut |job, result| batch.written(job, result));
        });
        write.map_err(|error| RenderError::Threads(error.to_string()))?;
        pool.broadcast(|_| {
            batch.work(&writer);
        });
        drop(writer);
        Ok::<(), RenderError>(())
    })?;
    let mut summary = batch.summary.into_inner().unwrap_or_else(PoisonError::into_inner);
    summary.cancelled = watch.cancelled();
    summary.left = jobs.len() - summary.written - summary.skipped - summary.failed.len();
    summary.failed.sort_by_key(|(job, _)| *job);
    Ok(summary)
}

/// Clears away what dead processes left where files will be written.
fn sweep(jobs: &[Job]) {
    let mut folders: Vec<&Path> = jobs.iter().filter_map(|job| job.output.parent()).collect();
    folders.sort_unstable();
    folders.dedup();
    for folder in folders {
        aside::sweep(if folder.as_os_str().is_empty() { Path::new(".") } else { folder });
    }
}

impl Batch<'_> {
    /// What one thread does until there is nothing left to begin.
    fn work(&self, writer: &Writer<'_>) {
        loop {
            match self.turn() {
                Turn::End => break,
                Turn::Help => match rayon::yield_now() {
                    Some(rayon::Yield::Executed) => {}
                    _ => thread::sleep(Duration::from_micros(200)),
                },
                Turn::Job(index, ticket, bytes) => {
                    let job = &self.jobs[index];
                    let result = catch_unwind(AssertUnwindSafe(|| self.render(index, ticket, writer)));
                    let mut queue = lock(&self.queue);
                    queue.open -= 1;
                    queue.bytes -= bytes;
                    drop(queue);
                    match result {
                        Ok(Ok(())) => {}
                        Ok(Err(JobError::Cancelled)) => {}
                        Ok(Err(error)) => self.fail(index, error),
                        Err(_) => self.fail(index, JobError::Mistake { path: job.scene.clone() }),
                    }
                }
            }
        }
    }

    /// The next job, where there is room and need for one.
    fn turn(&self) -> Turn {
        if self.stopped() {
            return Turn::End;
        }
        let mut queue = lock(&self.queue);
        let Some(job) = self.jobs.get(queue.next) else { return Turn::End };
        if queue.open > 0 && self.large.load(Ordering::Relaxed) > LARGE {
            return Turn::Help;
        }
        let bytes = match self.options.max_memory {
            None => 0,
            Some(limit) => {
                let bytes = memory::forecast(&job.scene, job.frame());
                if queue.open > 0 && queue.bytes.saturating_add(bytes) > limit {
                    return Turn::Help;
                }
                bytes
            }
        };
        let index = queue.next;
        queue.next += 1;
        queue.open += 1;
        queue.bytes += bytes;
        Turn::Job(index, self.sources.ticket(job), bytes)
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.watch.cancelled()
    }

    /// From the scene file to the bytes of the picture.
    fn render(&self, index: usize, ticket: Ticket, writer: &Writer<'_>) -> Result<(), JobError> {
        let job = &self.jobs[index];
        let start = Instant::now();
        if self.options.resume && self.is_recorded(job) {
            self.skip(index);
            return Ok(());
        }
        self.watch.event(&Event::FrameStart(index, job));
        self.allow(job)?;
        let loaded = self.sources.load(ticket);
        let (shared, is_new) = loaded.map_err(|errors| JobError::Scene { path: job.scene.clone(), errors })?;
        let load_seconds = if is_new { start.elapsed().as_secs_f64() } else { 0.0 };
        let scene = &shared.scene;
        if is_new {
            scene.warnings.iter().for_each(|warning| self.warn(index, warning.to_string()));
        }
        let Some(pictured) = self.picture(index, &shared)? else {
            self.skip(index);
            return Ok(());
        };
        let Pictured { mut rendering, mut description, annotations, packed } = pictured;
        if packed.is_none() {
            if is_trimmed(job, scene) {
                description.rendered = rendering.picture.trim();
            }
            self.watch.event(&Event::Traced(index, job, &rendering));
        }
        let (encoding, pack_seconds) = (Instant::now(), packed.as_ref().map_or(0.0, |(_, seconds)| *seconds));
        let encoded = match packed {
            Some((packer, _)) => packer.finish(&rendering.picture.cryptomattes, &description),
            None => output::encode(job.format, &rendering.picture, job.settings.options, &description),
        };
        let Encoded { bytes, losses, beside } = encoded.map_err(|error| encode_error(job, error))?;
        let hash = self.ledgers.as_ref().map(|_| sha256(&mut bytes.as_slice()).map(|hash| hex(&hash)));
        let hash = hash.and_then(Result::ok).unwrap_or_default();
        let report = Report {
            load_seconds,
            write_seconds: pack_seconds + encoding.elapsed().as_secs_f64(),
            window: Some(rendering.picture.window),
            spp: description.spp.unwrap_or_default(),
            stats: rendering.stats,
            names: rendering.names,
            losses,
            bytes: bytes.len() as u64,
            hash,
        };
        let beside = beside.into_iter().map(|file| (job.output.with_file_name(&file.name), file.bytes));
        let beside = annotations.into_iter().chain(beside).collect();
        writer.write(Finished { job: index, path: job.output.clone(), beside, bytes, report });
        Ok(())
    }

    /// Whether the record of the batch has this very picture.
    fn is_recorded(&self, job: &Job) -> bool {
        let Some(ledgers) = &self.ledgers else { return false };
        self.files_hash(job).is_some_and(|hash| existing::is_recorded(job, &hash, ledgers))
    }

    fn skip(&self, index: usize) {
        lock(&self.summary).skipped += 1;
        self.advance(1.0, index);
        self.watch.event(&Event::Skipped(index, &self.jobs[index]));
    }

    /// Traces a picture with the help of whoever has nothing else to do; `None` where the file is there already.
    fn picture(&self, index: usize, shared: &Shared) -> Result<Option<Pictured>, JobError> {
        let (job, scene) = (&self.jobs[index], &shared.scene);
        let failed = |error| match error {
            RenderError::Cancelled => JobError::Cancelled,
            error => JobError::Render { path: job.scene.clone(), error },
        };
        let (next, moments);
        let mut renderer = job.renderer(scene).map_err(failed)?;
        next = self.next_frame(index, scene, renderer.settings().shutter > 0.0);
        if let Some(next) = &next {
            moments = self.moments(shared, next, &renderer);
            renderer = renderer.next_frame(&next.scene).moments(&moments);
        }
        let wanted = job.settings.layers.layers(scene).unwrap_or(scene.layers);
        if self.options.annotations {
            renderer = renderer.layers(wanted.with(Aov::Ids));
        }
        let hash = || shared.picture_hash(&renderer, next.as_deref());
        let known = self.options.resume.then(hash);
        if known.as_ref().is_some_and(|hash| existing::is_current(job, &renderer, hash)) {
            return Ok(None);
        }
        self.room(job, scene, &renderer)?;
        // A million rows are hashed in a tenth of the time that their tree takes, beside it.
        let (task, scene_hash) = rayon::join(|| Task::new(&renderer), || known.unwrap_or_else(hash));
        let task = task.map_err(failed)?;
        let (start, total) = (Instant::now(), task.total());
        self.large.fetch_add(total, Ordering::Relaxed);
        let waiting = AtomicU64::new(total);
        let stopped = || self.stopped();
        let saves = self.options.checkpoint.as_ref();
        let saves = saves.map(|to| Saves::new(to, format!("{scene_hash} {}", ledger::settings_hash(job))));
        let packer = self.packer(job, scene, renderer.aovs(), &task)?;
        let pack = |rows: &Picture| packer.iter().for_each(|packer| packer.pack(rows));
        let mut unfinished = match &saves {
            None if packer.is_some() => task.begin_hollow(),
            None => task.begin(),
            Some(saves) => saves.open(&task).map_err(|reason| JobError::Checkpoint { path: saves.path(), reason })?,
        };
        let done = unfinished.done();
        let blocks: Vec<usize> = (0..task.blocks()).filter(|block| !done[*block]).collect();
        let gathering = match &packer {
            Some(packer) => unfinished.pass(&task, packer.rows(), &pack),
            None => unfinished.open(&task),
        };
        let so_far = |name: &Path| {
            let partial = packer.as_ref().map(|packer| packer.so_far(gathering.waiting())).transpose()?;
            let Rendering { picture, stats, .. } = task.finish(gathering.so_far(), 0, Instant::now());
            let file_stem = output::stem(name);
            let description = output::Description { file_stem, ..job.description(&renderer, &stats, None, None) };
            match partial {
                Some(packer) => packer.finish(&picture.cryptomattes, &description),
                None => output::encode(job.format, &picture, job.settings.options, &description),
            }
        };
        let trace = |block| {
            let samples = task.samples(block);
            self.large.fetch_sub(samples, Ordering::Relaxed);
            waiting.fetch_sub(samples, Ordering::Relaxed);
            if self.stopped() {
                return None;
            }
            let traced = task.trace(block, &stopped)?;
            let (window, pixels) = task.pixels(&traced);
            self.watch.event(&Event::Block(index, job, &renderer, &Fresh { window, pixels, so_far: &so_far }));
            gathering.add(traced);
            self.advance(samples as f64 / total as f64, index);
            if let Some(Err(error)) = saves.as_ref().map(|saves| saves.write_if_due(&gathering)) {
                self.warn(index, error.to_string());
            }
            Some(())
        };
        let traced: Option<()> = blocks.into_par_iter().map(trace).collect();
        self.large.fetch_sub(waiting.load(Ordering::Relaxed), Ordering::Relaxed);
        if let (None, Some(saves)) = (traced, &saves) {
            saves.write(&gathering)?;
        }
        drop(gathering);
        traced.ok_or(JobError::Cancelled)?;
        let mut rendering = task.finish(unfinished, self.threads, start);
        let apart = packer.as_ref().map_or(0.0, |packer| rendering.stats.set_apart(packer.seconds()));
        let packed = packer.map(|packer| (packer, apart));
        let annotations = self.options.annotations.then(|| {
            let page = annotate::page(job, &renderer, scene, &rendering.picture, &rendering.names);
            (job.output.with_extension("json"), page.into_bytes())
        });
        if !wanted.has(Aov::Ids) {
            rendering.picture.channels.retain(|channel| channel.layer() != "id");
        }
        let shard = self.options.shard.map(|shard| shard.to_string());
        let description = job.description(&renderer, &rendering.stats, Some(scene_hash), shard);
        Ok(Some(Pictured { rendering, description, annotations, packed }))
    }

    /// Whether rows of an EXR can be packed as they are traced; not where the whole picture is needed in the end: to find what
    /// of it is to be written, for what is told beside it, for a checkpoint, or since what pixels cost is found for whole
    /// blocks and sorted out in the end.
    fn held(&self, job: &Job, scene: &Scene, layers: Layers) -> Held {
        let is_kept = self.options.annotations || self.options.checkpoint.is_some() || layers.has(Aov::Cost);
        match job.format == Format::Exr && !is_trimmed(job, scene) && !is_kept {
            true => Held::Rows(self.threads, job.settings.options.exr),
            false => Held::Whole,
        }
    }

    /// What packs the rows of a picture that is not held as a whole.
    fn packer(&self, job: &Job, scene: &Scene, layers: Layers, task: &Task) -> Result<Option<Packer>, JobError> {
        if let Held::Whole = self.held(job, scene, layers) {
            return Ok(None);
        }
        let packer = Packer::new(&task.hollow(), job.settings.options.exr);
        packer.map(Some).map_err(|error| encode_error(job, error))
    }

    /// The moments that a picture is blurred over; none where nothing moves.
    fn moments(&self, shared: &Shared, next: &Shared, renderer: &Renderer) -> Vec<Scene> {
        let (shutter, spp) = (renderer.settings().shutter, renderer.image().spp);
        let moves = shutter > 0.0 && shared.sum().hash("") != next.sum().hash("");
        if moves { moments(&shared.scene, &next.scene, shutter, spp) } else { Vec::new() }
    }

    /// The scene that motion leads to, where that is asked for by a layer or by an open shutter.
    fn next_frame(&self, index: usize, scene: &Scene, is_open: bool) -> Option<Arc<Shared>> {
        let job = &self.jobs[index];
        let layers = job.settings.layers.layers(scene).ok()?;
        if !layers.has(Aov::Motion) && !is_open {
            return None;
        }
        let frame = job.frame() + 1;
        let ticket = self.sources.ticket(&Job { frame: Some(frame), ..job.clone() });
        let told = |errors| self.warn(index, format!("{job}: nothing moves: there is no frame {frame}: {errors}"));
        self.sources.load(ticket).map_err(told).ok().map(|(scene, _)| scene)
    }

    /// Refuses what would need more memory than was allowed, before it is read.
    fn allow(&self, job: &Job) -> Result<(), JobError> {
        let Some(limit) = self.options.max_memory else { return Ok(()) };
        // What the scene says of its picture is not known yet.
        let held = self.held(job, &Scene::default(), Layers::default());
        let pixels = job.settings.resolution.map_or(0, |size| memory::of_pixels(Window::full(size), 0, held));
        let need = memory::forecast(&job.scene, job.frame()).saturating_add(pixels);
        if need <= limit {
            // Once a scene file, before it is read.
            if lock(&self.forecast).insert(job.scene.clone()) {
                self.watch.event(&Event::Forecast(job, mib(need), mib(limit)));
            }
            return Ok(());
        }
        Err(too_much(job, need, limit))
    }

    /// Makes sure that there is room for the tree and the picture, now that both are known.
    fn room(&self, job: &Job, scene: &Scene, renderer: &Renderer<'_>) -> Result<(), JobError> {
        let window = renderer.window().map_err(|error| JobError::Render { path: Default::default(), error })?;
        let work = format!("a picture of {}x{} pixels", window.width(), window.height());
        let pixels = memory::of_pixels(window, renderer.channel_count(), self.held(job, scene, renderer.aovs()));
        let moments = renderer.moment_count() as u64;
        let need = memory::to_build(scene).saturating_mul(moments).saturating_add(pixels);
        match self.options.max_memory {
            Some(limit) if need > limit => Err(too_much(job, need, limit)),
            _ => self.watch.room(need, &work).map_err(JobError::Memory),
        }
    }

    /// A hash over all files that the scene of a job names.
    fn files_hash(&self, job: &Job) -> Option<String> {
        let mut hashes = lock(&self.hashes);
        let own = hashes.scene(&job.scene, job.frame()).ok()?;
        if !job.looks_ahead() {
            return Some(own);
        }
        let next = hashes.scene(&job.scene, job.frame() + 1).unwrap_or_default();
        sha256(&mut format!("{own} {next}").as_bytes()).map(|hash| hex(&hash)).ok()
    }

    /// Called when a file has its name, or will not get it.
    fn written(&self, index: usize, result: Result<Report, OutputError>) {
        let job = &self.jobs[index];
        match result {
            Ok(report) => {
                // A picture that is there has no need of its checkpoint.
                if let Some(checkpoint) = &self.options.checkpoint {
                    let _ = std::fs::remove_file(&checkpoint.path);
                }
                if let Some(ledgers) = &self.ledgers {
                    let hash = self.files_hash(job).unwrap_or_default();
                    if let Err(error) = ledgers.add(job, &hash, &report) {
                        self.warn(index, format!("the record of the batch cannot be written: {error}"));
                    }
                }
                lock(&self.summary).written += 1;
                self.watch.event(&Event::FrameDone(index, job, &report));
            }
            Err(error) => self.fail(index, error.into()),
        }
    }

    fn fail(&self, index: usize, error: JobError) {
        // Where nothing can be written, nothing else can either.
        if let JobError::Output(OutputError::Io { source, .. }) = &error {
            use std::io::ErrorKind::{PermissionDenied, ReadOnlyFilesystem, StorageFull};
            if matches!(source.kind(), PermissionDenied | ReadOnlyFilesystem | StorageFull) {
                self.stop.store(true, Ordering::Relaxed);
            }
        }
        self.watch.event(&Event::Error(index, &self.jobs[index], &error));
        lock(&self.summary).failed.push((index, error));
    }

    fn warn(&self, index: usize, text: String) {
        self.watch.event(&Event::Warning(index, &self.jobs[index], text));
    }

    /// Some share of one job was done.
    fn advance(&self, share: f64, index: usize) {
        let more = (share * 1e6) as u64;
        let done = self.done.fetch_add(more, Ordering::Relaxed) + more;
        let all = (done as f64 / 1e6 / self.jobs.len() as f64).min(1.0);
        self.watch.event(&Event::Progress(all, index, &self.jobs[index]));
    }
}

/// Whether its file leaves out edges that show nothing.
fn is_trimmed(job: &Job, scene: &Scene) -> bool {
    scene.background.transparent && !job.settings.windows.is_crop() && job.format == Format::Exr
}

fn encode_error(job: &Job, error: EncodeError) -> JobError {
    JobError::Encode { path: job.output.clone(), error }
}

fn mib(bytes: u64) -> u64 {
    bytes.div_ceil(1 << 20)
}

fn too_much(job: &Job, need: u64, limit: u64) -> JobError {
    let (scene, need, limit) = (job.scene.display(), mib(need), mib(limit));
    JobError::Memory(format!("{scene}: about {need} MiB of memory are needed, and the limit is {limit} MiB"))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
