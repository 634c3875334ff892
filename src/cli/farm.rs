//! `octray farm slurm`: a script that renders on a Slurm cluster.
//!
//! The script is one file that does three things by where it runs: called by hand it submits itself as an array and a
//! last job behind it; as a task of the array it renders its share; as the last job it does what tasks left undone and,
//! for tiles, joins them. Every part is rendered with `--resume`, so a task that runs twice (a node that was lost and came
//! back, a requeued job) finds its files or writes the same ones, and a task that was killed costs its share alone.

use std::path::{Path, PathBuf};

use octray::batch::{frames, stem};

use super::exit::{Exit, Failure};
use super::{Run, args, pictures};

const EXAMPLES: &str = "\
Examples:
  octray farm slurm turn.toml --frames 1-100 --shards 10 --out-dir out -o turn.sh
  octray farm slurm fig5.toml --tiles 4x2 --picture fig5.exr -o fig5.sh
  octray farm slurm turn.toml --frames 1-100 --shards 10 -o turn.sh -- --spp 256 --aov depth
  sh turn.sh                                   submits the array, and the job behind it
  sbatch turn.sh                               the array alone";

/// Arguments of `octray farm`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    engine: Engine,
}

#[derive(Debug, clap::Subcommand)]
enum Engine {
    /// Write a script for Slurm
    Slurm(Box<Slurm>),
}

/// Arguments of `octray farm slurm`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
struct Slurm {
    /// Scene file, as `octray render` takes it
    scene: PathBuf,
    /// Frames to render, such as 1-100
    #[arg(long, value_name = "LIST", value_parser = frames::list, required_unless_present = "tiles", allow_hyphen_values = true)]
    frames: Option<frames::FrameList>,
    /// Tasks that share the frames
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    shards: u32,
    /// Cut one picture into so many columns and rows instead, one task each
    #[arg(long, value_name = "CxR", value_parser = args::tiles, conflicts_with_all = ["frames", "shards"])]
    tiles: Option<(u32, u32)>,
    /// Directory for the frames
    #[arg(long, value_name = "DIR", default_value = "out")]
    out_dir: PathBuf,
    /// The picture that tiles are joined to [default: the scene's name with .exr]
    #[arg(long, value_name = "FILE", requires = "tiles")]
    picture: Option<PathBuf>,
    /// Script to write [default: the scene's name with .slurm.sh]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Cores of a task
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1024))]
    cpus: u32,
    /// Memory of a task, as Slurm takes it: 4G
    #[arg(long, value_name = "SIZE")]
    mem: Option<String>,
    /// Longest time of a task, as Slurm takes it: 01:00:00
    #[arg(long, value_name = "TIME")]
    time: Option<String>,
    /// Partition to run in
    #[arg(long, value_name = "NAME")]
    partition: Option<String>,
    /// Program to call on the nodes [default: this one]
    #[arg(long, value_name = "FILE")]
    octray: Option<PathBuf>,
    /// Further options of `octray render`, after --
    #[arg(last = true, value_name = "OPTIONS")]
    more: Vec<String>,
}

pub fn run(args: &Args, run: &Run) -> Result<Exit, Failure> {
    let Engine::Slurm(args) = &args.engine;
    if !args.scene.is_file() {
        return Err(Failure::new(Exit::Input, "there is no such scene file").of(&args.scene));
    }
    let output = args.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}.slurm.sh", stem(&args.scene))));
    run.check_output(&output, &[&args.scene])?;
    let text = args.script()?;
    pictures::write_bytes(&output, text.as_bytes(), run)?;
    let shown = output.display();
    run.console
        .note(&format!("octray: `sh {shown}` submits it: an array of {} tasks, and a job behind it", args.tasks()));
    Ok(Exit::Done)
}

impl Slurm {
    fn tasks(&self) -> u32 {
        match (self.tiles, &self.frames) {
            (Some((columns, rows)), _) => columns * rows,
            (None, Some(list)) => self.shards.min(u32::try_from(list.0.len()).unwrap_or(u32::MAX)),
            (None, None) => 1,
        }
    }

    fn script(&self) -> Result<String, Failure> {
        let octray = match &self.octray {
            Some(path) => path.clone(),
            None => std::env::current_exe().unwrap_or_else(|_| PathBuf::from("octray")),
        };
        let name = stem(&self.scene);
        let tasks = self.tasks();
        let mut head = vec![
            format!("--job-name={}", word(&name)),
            format!("--array=1-{tasks}"),
            "--ntasks=1".to_owned(),
            format!("--cpus-per-task={}", self.cpus),
            "--requeue".to_owned(),
            "--open-mode=append".to_owned(),
        ];
        head.extend(self.mem.iter().map(|mem| format!("--mem={mem}")));
        head.extend(self.time.iter().map(|time| format!("--time={time}")));
        head.extend(self.partition.iter().map(|name| format!("--partition={name}")));
        if let Some(bad) = head.iter().find(|line| line.contains(['\n', '\r'])) {
            return Err(Failure::new(Exit::Usage, format!("{bad:?} should be one line")));
        }
        let head: String = head.iter().map(|line| format!("#SBATCH {line}\n")).collect();
        let more: String = self.more.iter().map(|option| format!(" {}", quoted(option))).collect();
        let (task, last) = self.work(&name, &more);
        let (octray, scene) = (quoted_path(&octray), quoted_path(&self.scene));
        Ok(format!(
            "#!/bin/sh\n{head}
# Written by octray {version}. `sh` this file: it submits itself, and a job that ends the work behind it.
set -eu
octray={octray}
scene={scene}

if [ -z \"${{SLURM_JOB_ID:-}}\" ]; then
    array=$(sbatch --parsable \"$0\")
    last=$(sbatch --parsable --array=0 --dependency=\"afterany:${{array%%;*}}\" \"$0\")
    echo \"array ${{array%%;*}}, behind it ${{last%%;*}}\"
    exit
fi

if [ \"$SLURM_ARRAY_TASK_ID\" != 0 ]; then
    # A step of its own, so that it gets the signals that Slurm sends.
    {task}
    exit
fi

# Behind the array: what its tasks left undone, if anything.
{last}
",
            version = env!("CARGO_PKG_VERSION"),
        ))
    }

    /// What a task does, and what the last job does.
    fn work(&self, name: &str, more: &str) -> (String, String) {
        let render = "srun \"$octray\" render \"$scene\" --quiet --resume --no-date";
        match (self.tiles, &self.frames) {
            (Some((columns, rows)), _) => {
                let picture = self.picture.clone().unwrap_or_else(|| PathBuf::from(format!("{name}.exr")));
                let parts = picture.with_extension("parts");
                let part = |index: &str| format!("{}/{index}.exr", quoted_path(&parts));
                let tile =
                    |index: &str| format!("{render} --tiles {columns}x{rows} --tile {index} -o {}{more}", part(index));
                let all: Vec<String> = (1..=columns * rows).map(|index| part(&index.to_string())).collect();
                let make = format!("mkdir -p {}", quoted_path(&parts));
                let task = format!("{make}\n    exec {}", tile("\"$SLURM_ARRAY_TASK_ID\""));
                let last = format!(
                    "{make}\nfor tile in $(seq {}); do\n    {}\ndone\n\"$octray\" merge {} -o {}\nrm -r {}",
                    columns * rows,
                    tile("\"$tile\""),
                    all.join(" "),
                    quoted_path(&picture),
                    quoted_path(&parts),
                );
                (task, last)
            }
            (None, list) => {
                let list = list.as_ref().map(|list| ranges(&list.0)).unwrap_or_default();
                let all = format!("{render} --frames {list} --out-dir {}{more}", quoted_path(&self.out_dir));
                let task = format!("exec {all} --shard \"$SLURM_ARRAY_TASK_ID/{}\"", self.tasks());
                (task, format!("{all}\n\"$octray\" status {}", quoted_path(&self.out_dir)))
            }
        }
    }
}

/// A list of frames as `--frames` takes it, with runs of neighbours as ranges.
fn ranges(frames: &[i64]) -> String {
    let mut parts: Vec<(i64, i64)> = Vec::new();
    for frame in frames {
        match parts.last_mut() {
            Some((_, last)) if *last + 1 == *frame => *last = *frame,
            _ => parts.push((*frame, *frame)),
        }
    }
    let part = |(first, last): &(i64, i64)| if first == last { first.to_string() } else { format!("{first}-{last}") };
    parts.iter().map(part).collect::<Vec<_>>().join(",")
}

fn word(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}

fn quoted_path(path: &Path) -> String {
    quoted(&path.to_string_lossy())
}

/// A word of the shell, whatever it holds.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:+%@".contains(c);
    match !text.is_empty() && text.chars().all(plain) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', "'\\''")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_safe_in_a_shell() {
        assert_eq!(
            (quoted("a-b.exr"), quoted("a b"), quoted("it's"), quoted("")),
            ("a-b.exr".to_owned(), "'a b'".to_owned(), "'it'\\''s'".to_owned(), "''".to_owned())
        );
        assert_eq!(ranges(&[1, 2, 3, 7, 9, 10, -2]), "1-3,7,9-10,-2");
        assert_eq!(frames::list(&ranges(&[1, 2, 3, 7, 9, 10, -2])).unwrap().0, [1, 2, 3, 7, 9, 10, -2]);
        assert_eq!(word("a b/c"), "a_b_c");
    }
}
