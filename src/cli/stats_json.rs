//! `--stats FILE.json`: what a run did and what it took.

use std::collections::BTreeMap;
use std::path::Path;

use octray::accel::Counts;
use octray::batch::{Job, Report};
use octray::integrate::RayKind;
use octray::plan::Kind;
use octray::render::{Engine, IdNames, Reached, Stats};
use serde_json::{Map, Value, json};

use super::console::pretty;
use super::exit::Failure;
use super::{Run, cpu, pictures, system};

/// Wall time by stage.
#[derive(Debug, Clone, Copy, Default)]
pub struct Seconds {
    /// Reading the scene.
    pub load: f64,
    /// Taking it apart.
    pub plan: f64,
    /// Columns and tree.
    pub build: f64,
    /// Tracing; shading is part of it.
    pub trace: f64,
    /// Encoding and writing.
    pub write: f64,
}

/// What every run has to tell. `shade` is null: it is not measured apart from `trace`, which holds it.
pub fn common(run: &Run, threads: usize, seconds: &Seconds) -> Map<String, Value> {
    let Seconds { load, plan, build, trace, write } = *seconds;
    let total = run.start.elapsed().as_secs_f64();
    let seconds = json!({
        "load": load, "plan": plan, "build": build, "trace": trace, "shade": null, "write": write, "total": total,
    });
    let mut stats = Map::new();
    let mut set = |name: &str, value: Value| stats.insert(name.to_owned(), value);
    set("schema", json!(1));
    set("octray", json!(env!("CARGO_PKG_VERSION")));
    set("simd", json!(cpu::SIMD));
    set("threads", json!(threads));
    set("seconds", seconds);
    set("cpu_seconds", json!(system::cpu_seconds()));
    stats
}

/// What a render did. The reference does not tell how many shadow rays met something: null.
pub fn add_render(stats: &mut Map<String, Value>, work: &Stats, is_reference: bool) {
    let by_kind = |counts: &[u64]| -> Map<String, Value> {
        RayKind::ALL.into_iter().map(|kind| (kind.name().to_owned(), json!(counts[kind as usize]))).collect()
    };
    let mut hits = by_kind(&work.rays.hits);
    if is_reference {
        hits.insert(RayKind::Shadow.name().to_owned(), Value::Null);
    }
    stats.insert("rays".to_owned(), Value::Object(by_kind(&work.rays.rays)));
    stats.insert("hits".to_owned(), Value::Object(hits));
    if let Some(reached) = &work.noise {
        let Reached { target, error, worst, short, samples, pixels } = *reached;
        let noise = json!({
            "target": target, "error": error, "worst_tile": worst, "short_tiles": short, "samples": samples,
            "pixels": pixels,
        });
        stats.insert("noise".to_owned(), noise);
    }
    add_tests(stats, &work.tests);
    stats.insert("tiles".to_owned(), json!({ "total": work.tiles, "background": work.background_tiles }));
    stats.insert("skipped".to_owned(), json!(work.skipped));
}

/// Tests done, in pairs. `box` counts boxes of tree nodes; the primitive of that name is `cuboid` here.
pub fn add_tests(stats: &mut Map<String, Value>, counts: &Counts) {
    let mut tests = Map::from_iter([("box".to_owned(), json!(counts.boxes))]);
    for kind in Kind::ALL {
        let name = match kind {
            Kind::Triangle | Kind::Quad | Kind::Octagon => "polygon",
            Kind::Box | Kind::TurnedBox => "cuboid",
            Kind::Sphere | Kind::Plane | Kind::Disk | Kind::Cylinder | Kind::Cone => kind.name(),
        };
        let before = tests.get(name).and_then(Value::as_u64).unwrap_or(0);
        tests.insert(name.to_owned(), json!(before + counts.kinds[kind as usize]));
    }
    stats.insert("tests".to_owned(), Value::Object(tests));
    stats.insert("redecided".to_owned(), json!(counts.redecided));
}

/// Memory so far, and what columns and tree take of it.
pub fn add_memory(stats: &mut Map<String, Value>, column_bytes: usize, tree_bytes: usize) {
    let peak = system::peak_bytes();
    let memory = json!({ "peak_bytes": peak, "column_bytes": column_bytes, "tree_bytes": tree_bytes });
    stats.insert("memory".to_owned(), memory);
}

/// What the numbers in the id channels stand for, where there are such channels.
pub fn add_names(stats: &mut Map<String, Value>, names: &IdNames) {
    let table = |names: &BTreeMap<u32, String>| -> Map<String, Value> {
        names.iter().map(|(number, name)| (number.to_string(), json!(name))).collect()
    };
    if *names != IdNames::default() {
        stats.insert("ids".to_owned(), json!({ "object": table(&names.object), "material": table(&names.material) }));
    }
}

/// What jobs did: of a single one, or with one entry a job in `frames`.
pub fn of_jobs(jobs: &[Job], reports: &[(usize, Report)], many: bool, run: &Run) -> Map<String, Value> {
    let one = |(index, report): &(usize, Report), with: &mut Map<String, Value>| {
        add_render(with, &report.stats, jobs[*index].settings.engine == Engine::Reference);
        add_names(with, &report.names);
    };
    let seconds = |report: &Report| Seconds {
        load: report.load_seconds,
        plan: report.stats.plan_seconds,
        build: report.stats.build_seconds,
        trace: report.stats.trace_seconds,
        write: report.write_seconds,
    };
    let mut sum = Seconds::default();
    for (_, report) in reports {
        let Seconds { load, plan, build, trace, write } = seconds(report);
        sum.load += load;
        sum.plan += plan;
        sum.build += build;
        sum.trace += trace;
        sum.write += write;
    }
    let most = |bytes: fn(&Report) -> usize| reports.iter().map(|(_, report)| bytes(report)).max().unwrap_or(0);
    let mut stats = common(run, reports.first().map_or(0, |(_, report)| report.stats.threads), &sum);
    if let ([report], false) = (reports, many) {
        one(report, &mut stats);
        // Told where there are such samples.
        if report.1.losses.clamped > 0 {
            stats.insert("clamped".to_owned(), json!(report.1.losses.clamped));
        }
    }
    add_memory(&mut stats, most(|report| report.stats.column_bytes), most(|report| report.stats.tree_bytes));
    if many {
        let frame = |entry: &(usize, Report)| {
            let (job, report) = (&jobs[entry.0], &entry.1);
            let Seconds { load, plan, build, trace, write } = seconds(report);
            let mut frame = Map::new();
            frame.insert("frame".to_owned(), json!(job.frame()));
            frame.insert("scene".to_owned(), json!(job.scene.display().to_string()));
            frame.insert("output".to_owned(), json!(job.to_string()));
            frame.insert("bytes".to_owned(), json!(report.bytes));
            frame.insert("hash".to_owned(), json!(report.hash));
            let seconds = json!({ "load": load, "plan": plan, "build": build, "trace": trace, "write": write });
            frame.insert("seconds".to_owned(), seconds);
            frame.insert("clamped".to_owned(), json!(report.losses.clamped));
            one(entry, &mut frame);
            Value::Object(frame)
        };
        stats.insert("frames".to_owned(), reports.iter().map(frame).collect());
    }
    stats
}

/// Writes them.
pub fn write(path: &Path, stats: Map<String, Value>, run: &Run) -> Result<(), Failure> {
    pictures::write_bytes(path, pretty(&Value::Object(stats)).as_bytes(), run)
}
