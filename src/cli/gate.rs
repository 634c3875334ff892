//! `octray bench gate`: this build against a baseline, or against another build.
//!
//! Every side is run as a process of its own, so that builds of any age and kind can be set against each other; what they
//! say in their JSON is compared, and the CPU time that the system counted for them.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use octray::measure::gate::{self, Numbers, Race, RaceSettings, race};
use octray::output;
use octray::scene::Frames;
use serde_json::{Map, Value, json};
use tempfile::TempDir;

use super::Run;
use super::args::{self, Threads};
use super::exit::{Exit, Failure};
use super::{cpu, pictures, scene_file, system};

/// Rendering in a race takes at least so many seconds of CPU time, by more samples where it must.
const LEAST_SECONDS: f64 = 0.15;
/// Most samples per pixel for that.
const MOST_SPP: u32 = 4096;
/// (Pixel, primitive) pairs that the reference looks at, and bounds on the pixels.
const REFERENCE_WORK: f64 = 4e7;
const REFERENCE_PIXELS: (f64, f64) = (64.0, 4096.0);

const EXAMPLES: &str = "\
Examples:
  octray bench gate scenes/*.toml --baseline gate.json --write-baseline    once, and whenever a change is meant
  octray bench gate --baseline gate.json                                   work and error as they were?
  octray bench gate scenes/*.toml --against ~/octray-1.2/octray            and not slower than that build?

In your CI: keep gate.json and a build that you trust, and run the last two for every change of octray or of your scenes.";

/// Arguments of `octray bench gate`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = EXAMPLES,
    long_about = "Compare work, time and error of this build with a baseline or another build\n\n\
        Work is counted exactly (rays, hits, tests of boxes and primitives, lanes decided again, tiles): it must be the \
        same, and what changed is named. The error against the f64 reference may not grow. Time is measured only against \
        another build, by turns on the spot; how much that build differs from itself is the noise that decides what is \
        slower. Ends with 1 and the guilty lines where something got worse."
)]
pub struct Args {
    /// Scenes [default: those of the baseline]
    scenes: Vec<PathBuf>,
    /// JSON file of work and errors to compare with
    #[arg(long, value_name = "FILE.json", required_unless_present = "against")]
    baseline: Option<PathBuf>,
    /// Write the baseline instead of comparing with it
    #[arg(long, requires = "baseline", requires = "scenes", conflicts_with = "against")]
    write_baseline: bool,
    /// Another build, the one that is trusted
    #[arg(long, value_name = "BINARY")]
    against: Option<PathBuf>,
    /// The build under test [default: this one]
    #[arg(long, value_name = "BINARY")]
    binary: Option<PathBuf>,
    /// Samples per pixel of the work that is counted [default: as in the scene]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: Option<u32>,
    /// Pixels of the whole picture [default: as in the scene]
    #[arg(long, value_name = "WxH", value_parser = args::resolution)]
    resolution: Option<(u32, u32)>,
    /// Seconds that a scene's race may take; it ends as soon as the noise is small enough
    #[arg(long, value_name = "S", default_value = "120", value_parser = args::limit)]
    seconds: f64,
    /// Difference of time that is to be told, as a share
    #[arg(long, value_name = "X", default_value = "0.04", value_parser = args::limit)]
    tell: f64,
    /// Compare work and error only
    #[arg(long)]
    no_time: bool,
    #[command(flatten)]
    threads: Threads,
    /// Print the result as JSON
    #[arg(long)]
    json: bool,
}

/// One build and how it is run.
struct Side<'a> {
    binary: PathBuf,
    args: &'a Args,
    /// Where its files go.
    room: &'a TempDir,
}

/// What is known of a scene.
struct Case {
    scene: PathBuf,
    /// Of the whole picture.
    size: (u32, u32),
    spp: u32,
    primitives: usize,
}

/// What one side made of a scene.
#[derive(Clone, Default)]
struct Made {
    work: Numbers,
    error: Numbers,
}

/// What came of a scene.
struct Verdict {
    scene: String,
    guilty: Vec<String>,
    remarks: Vec<String>,
    race: Option<Race>,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    run.warn_of_build();
    let room =
        TempDir::new().map_err(|error| Failure::new(Exit::Output, format!("no temporary directory: {error}")))?;
    let own = std::env::current_exe().map_err(|error| Failure::new(Exit::Limit, error))?;
    let side = |binary: PathBuf| Side { binary, args, room: &room };
    let new = side(args.binary.clone().unwrap_or(own));
    let old = args.against.clone().map(side);
    if let (Some(path), true) = (&args.baseline, args.write_baseline) {
        return new.write_baseline(path, run);
    }
    let baseline = args.baseline.as_deref().map(read_baseline).transpose()?;
    let listed = baseline.as_ref().map_or(Vec::new(), scenes_of);
    let scenes = if args.scenes.is_empty() { &listed } else { &args.scenes };
    if scenes.is_empty() {
        return Err(Failure::new(Exit::Usage, "no scenes to look at: name some, or a baseline that does"));
    }
    let mut verdicts = Vec::new();
    for scene in scenes {
        let verdict = judge(args, scene, &new, old.as_ref(), baseline.as_ref(), run)?;
        if !args.json {
            run.console.print(&lines(&verdict))?;
        }
        verdicts.push(verdict);
    }
    let pass = verdicts.iter().all(|verdict| verdict.guilty.is_empty());
    if args.json {
        let scenes: Vec<Value> = verdicts.iter().map(verdict_json).collect();
        run.console.print_json(&json!({ "schema": 1, "pass": pass, "scenes": scenes }))?;
    }
    Ok(if pass { Exit::Done } else { Exit::No })
}

fn judge(
    args: &Args,
    scene: &Path,
    new: &Side,
    old: Option<&Side>,
    baseline: Option<&Value>,
    run: &Run,
) -> Result<Verdict, Failure> {
    let case = Case::new(scene, args)?;
    let name = scene.display().to_string();
    let mut verdict = Verdict { scene: name.clone(), guilty: Vec::new(), remarks: Vec::new(), race: None };
    let made = new.make(&case)?;
    if let Some(baseline) = baseline {
        match before(baseline, &name, &case) {
            Ok(before) => verdict.compare(&before, &made, "the baseline"),
            Err(why) => verdict.guilty.push(why),
        }
    }
    let Some(old) = old else { return Ok(verdict) };
    let against = old.binary.display().to_string();
    verdict.compare(&old.make(&case)?, &made, &against);
    let pictures = [old, new].map(|side| output::read(&side.picture(&case)));
    let [Ok(a), Ok(b)] = pictures else { return Err(Failure::new(Exit::Input, "a picture is gone")) };
    let same = a.pixels.iter().flatten().map(|x| x.to_bits()).eq(b.pixels.iter().flatten().map(|x| x.to_bits()));
    verdict
        .remarks
        .push(format!("the picture is {}", if same { "the same to the bit" } else { "not the same to the bit" }));
    if !args.no_time {
        run.console.note(&format!("{name}: both builds take turns, for at most {} s", args.seconds));
        verdict.race(run_race(args, &case, old, new)?, &against);
    }
    Ok(verdict)
}

fn run_race(args: &Args, case: &Case, old: &Side, new: &Side) -> Result<Race, Failure> {
    // Samples until it takes long enough, as the trusted build has it; that also warms up.
    let mut spp = case.spp;
    loop {
        let seconds = old.render(case, spp)?.1;
        if seconds >= LEAST_SECONDS || spp >= MOST_SPP {
            break;
        }
        let factor = (1.2 * LEAST_SECONDS / seconds.max(0.01)).ceil().max(2.0);
        spp = ((f64::from(spp) * factor) as u32).min(MOST_SPP);
    }
    new.render(case, spp)?;
    let settings = RaceSettings { budget: args.seconds, resolution: args.tell };
    race(settings, &mut || Ok(old.render(case, spp)?.1), &mut || Ok(new.render(case, spp)?.1))
}

impl Case {
    fn new(scene: &Path, args: &Args) -> Result<Self, Failure> {
        let loaded = Frames::new(scene).resolution(args.resolution).scene(1);
        let mut loaded = loaded.map_err(|errors| Failure::new(Exit::Input, errors))?;
        scene_file::resize(&mut loaded, args.resolution);
        let no_image = || Failure::new(Exit::Input, "has no image size: say --resolution WxH").of(scene);
        let image = loaded.image.as_ref().ok_or_else(no_image)?;
        let spp = args.spp.unwrap_or(image.spp);
        let size = (image.width, image.height);
        Ok(Case { scene: scene.into(), size, spp, primitives: loaded.primitive_count() })
    }

    /// A smaller picture, of as many pixels as the reference can afford.
    fn small(&self) -> (u32, u32) {
        let most = (REFERENCE_WORK / self.primitives.max(1) as f64).clamp(REFERENCE_PIXELS.0, REFERENCE_PIXELS.1);
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let scale = (most / (width * height)).sqrt().min(1.0);
        let side = |pixels: f64| ((pixels * scale).round() as u32).max(1);
        (side(width), side(height))
    }
}

impl Side<'_> {
    /// Counts and errors of a scene.
    fn make(&self, case: &Case) -> Result<Made, Failure> {
        let (stats, _) = self.render(case, case.spp)?;
        let work = numbers(&stats, &["rays", "hits", "tests", "redecided", "tiles"]);
        Ok(Made { work, error: self.check(case)? })
    }

    fn picture(&self, case: &Case) -> PathBuf {
        self.room.path().join(format!("{:x}-{}.exr", fingerprint(&self.binary), case.spp))
    }

    /// Renders a scene: the statistics, and the CPU seconds that it took as the system counts them.
    fn render(&self, case: &Case, spp: u32) -> Result<(Value, f64), Failure> {
        let stats = self.room.path().join("stats.json");
        let picture = if spp == case.spp { self.picture(case) } else { self.room.path().join("picture.exr") };
        let mut command = self.command("render", case, case.size);
        command
            .args(["--float", "--no-date", "--spp", &spp.to_string()])
            .arg("-o")
            .arg(picture)
            .arg("--stats")
            .arg(&stats);
        command.args(["-t", &self.args.threads.count().max(1).to_string()]);
        let before = system::children_seconds();
        let start = std::time::Instant::now();
        let output = self.run(command, &[0])?;
        let wall = start.elapsed().as_secs_f64();
        let cpu = system::children_seconds().zip(before).map(|(after, before)| after - before);
        let text = std::fs::read(&stats).map_err(|error| self.failure(&output, &error.to_string()))?;
        let stats = serde_json::from_slice(&text).map_err(|error| self.failure(&output, &error.to_string()))?;
        Ok((stats, cpu.unwrap_or(wall)))
    }

    /// Errors against the reference, on all pixels of a smaller picture.
    fn check(&self, case: &Case) -> Result<Numbers, Failure> {
        let mut command = self.command("check", case, case.small());
        command.args(["--json", "--seconds", "inf", "--spp", "1"]);
        let output = self.run(command, &[0, 1])?;
        let report: Value =
            serde_json::from_slice(&output.stdout).map_err(|error| self.failure(&output, &error.to_string()))?;
        let mut errors = Numbers::new();
        for (kind, rays) in report["rays"].as_object().into_iter().flatten() {
            errors.insert(format!("rays.{kind}.different"), rays["different"].as_f64().unwrap_or(f64::NAN));
        }
        for name in ["rel_rmse", "excluded", "visible"] {
            errors.insert(format!("picture.{name}"), report["picture"][name].as_f64().unwrap_or(f64::NAN));
        }
        errors.insert("failures".to_owned(), report["failures"].as_array().map_or(0.0, |list| list.len() as f64));
        Ok(errors)
    }

    fn command(&self, name: &str, case: &Case, size: (u32, u32)) -> Command {
        let mut command = Command::new(&self.binary);
        command.arg("-q").arg(name).arg(&case.scene).arg("--resolution").arg(format!("{}x{}", size.0, size.1));
        command
    }

    fn run(&self, mut command: Command, codes: &[i32]) -> Result<Output, Failure> {
        let output = command.stdin(Stdio::null()).output();
        let output =
            output.map_err(|error| Failure::new(Exit::Usage, format!("cannot be run: {error}")).of(&self.binary))?;
        match output.status.code() {
            Some(code) if codes.contains(&code) => Ok(output),
            _ => Err(self.failure(&output, &output.status.to_string())),
        }
    }

    fn failure(&self, output: &Output, why: &str) -> Failure {
        let said = String::from_utf8_lossy(&output.stderr);
        Failure::new(Exit::Input, format!("{why}\n{}", said.trim_end())).of(&self.binary)
    }

    fn write_baseline(&self, path: &Path, run: &Run) -> Result<Exit, Failure> {
        let inputs: Vec<&Path> = self.args.scenes.iter().map(PathBuf::as_path).collect();
        run.check_output(path, &inputs)?;
        let mut scenes = Map::new();
        for scene in &self.args.scenes {
            let case = Case::new(scene, self.args)?;
            let Made { work, error } = self.make(&case)?;
            let settings = json!({ "width": case.size.0, "height": case.size.1, "spp": case.spp });
            let entry = json!({ "settings": settings, "work": work, "error": error });
            scenes.insert(scene.display().to_string(), entry);
        }
        let (version, count) = (env!("CARGO_PKG_VERSION"), scenes.len());
        let file = json!({ "schema": 1, "octray": version, "simd": cpu::SIMD, "scenes": scenes });
        pictures::write_bytes(path, super::console::pretty(&file).as_bytes(), run)?;
        run.console.note(&format!("{}: the work and the errors of {count} scenes", path.display()));
        Ok(Exit::Done)
    }
}

/// Tells the builds' files apart.
fn fingerprint(binary: &Path) -> u64 {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let mut hasher = DefaultHasher::new();
    binary.hash(&mut hasher);
    hasher.finish()
}

/// All numbers under some names, by their paths.
fn numbers(json: &Value, names: &[&str]) -> Numbers {
    let mut found = Numbers::new();
    let mut waiting: Vec<(String, &Value)> = names.iter().map(|name| (name.to_string(), &json[*name])).collect();
    while let Some((path, value)) = waiting.pop() {
        if let Some(number) = value.as_f64() {
            found.insert(path, number);
        } else if let Some(object) = value.as_object() {
            waiting.extend(object.iter().map(|(name, value)| (format!("{path}.{name}"), value)));
        }
    }
    found
}

fn read_baseline(path: &Path) -> Result<Value, Failure> {
    let wrong = |why: String| Failure::new(Exit::Input, why).of(path);
    let bytes = std::fs::read(path).map_err(|error| wrong(format!("cannot be read: {error}")))?;
    let baseline: Value = serde_json::from_slice(&bytes).map_err(|error| wrong(format!("is no JSON: {error}")))?;
    if baseline["schema"] != 1 || !baseline["scenes"].is_object() {
        return Err(wrong("is no baseline of schema 1: --write-baseline makes one".to_owned()));
    }
    if baseline["simd"] != cpu::SIMD {
        let of = baseline["simd"].as_str().unwrap_or("unknown");
        return Err(wrong(format!("is of a build for {of} and this one is for {}: each needs its own", cpu::SIMD)));
    }
    Ok(baseline)
}

fn scenes_of(baseline: &Value) -> Vec<PathBuf> {
    baseline["scenes"].as_object().into_iter().flat_map(|scenes| scenes.keys().map(PathBuf::from)).collect()
}

/// What the baseline says of a scene, or why that cannot be compared.
fn before(baseline: &Value, name: &str, case: &Case) -> Result<Made, String> {
    let entry = baseline["scenes"].get(name).ok_or("is not in the baseline: write it again with this scene")?;
    let settings = json!({ "width": case.size.0, "height": case.size.1, "spp": case.spp });
    if entry["settings"] != settings {
        return Err(format!("the baseline has it with {} and now it is {settings}", entry["settings"]));
    }
    let list = |of: &str| -> Numbers {
        let pairs = entry[of].as_object().into_iter().flatten();
        pairs.map(|(name, value)| (name.clone(), value.as_f64().unwrap_or(f64::NAN))).collect()
    };
    Ok(Made { work: list("work"), error: list("error") })
}

impl Verdict {
    fn compare(&mut self, before: &Made, after: &Made, against: &str) {
        let work = gate::changes(&before.work, &after.work);
        let error = gate::grown(&before.error, &after.error);
        if work.is_empty() && error.is_empty() {
            self.remarks.push(format!("work and error are those of {against}"));
        }
        self.guilty.extend(work.into_iter().map(|line| format!("work: {line}, against {against}")));
        self.guilty.extend(error.into_iter().map(|line| format!("error: {line}, against {against}")));
    }

    fn race(&mut self, race: Race, against: &str) {
        let percent = |ratio: f64| 100.0 * (ratio - 1.0);
        let Race { ratio, self_ratio, limit, noise, rounds, seconds } = race;
        let figures = format!(
            "{:+.1} % CPU time against {against} ({rounds} rounds of {seconds:.2} s, {against} against itself {:+.1} %, \
             noise of a round {:.1} %, limit {:+.1} %)",
            percent(ratio),
            percent(self_ratio),
            100.0 * noise,
            percent(limit),
        );
        match race {
            race if race.is_slower() => self.guilty.push(format!("time: {figures}")),
            race if race.is_faster() => self.remarks.push(format!("faster: {figures}")),
            _ => self.remarks.push(format!("time: {figures}")),
        }
        if limit > 1.1 {
            let text = "this machine is too busy to tell a tenth: give it more --seconds, or a quieter hour";
            self.remarks.push(text.to_owned());
        }
        self.race = Some(race);
    }
}

fn lines(verdict: &Verdict) -> String {
    let word = if verdict.guilty.is_empty() { "ok" } else { "FAIL" };
    let guilty = verdict.guilty.iter().map(|line| format!("  !  {line}\n"));
    let remarks = verdict.remarks.iter().map(|line| format!("     {line}\n"));
    std::iter::once(format!("{word:<5}{}\n", verdict.scene)).chain(guilty).chain(remarks).collect()
}

fn verdict_json(verdict: &Verdict) -> Value {
    let race = verdict.race.map(|race| {
        let Race { ratio, self_ratio, limit, noise, rounds, seconds } = race;
        json!({
            "ratio": ratio, "self_ratio": self_ratio, "limit": limit, "noise": noise, "rounds": rounds, "seconds": seconds,
            "slower": race.is_slower(), "faster": race.is_faster(),
        })
    });
    let Verdict { scene, guilty, remarks, .. } = verdict;
    json!({ "scene": scene, "pass": guilty.is_empty(), "guilty": guilty, "remarks": remarks, "time": race })
}
