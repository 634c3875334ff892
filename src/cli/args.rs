//! Words of the command line that several commands understand.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use octray::film::Window;
use octray::render::Engine;

/// Most pixels along a side, as in scene files.
const MOST_PIXELS_A_SIDE: u32 = 65_536;
/// Most pixels of a picture, as in scene files.
const MOST_PIXELS: u64 = 1 << 30;
/// Most threads: more than any machine has cores, fewer than any runs out of.
const MOST_THREADS: u64 = 1024;

/// Who finds what rays meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum EngineName {
    /// Eight rays at a time: fast
    #[default]
    Packet,
    /// Every ray by itself: the same bits, more slowly
    Single,
    /// The f64 reference, every ray against every primitive: slow, to compare with
    Reference,
}

impl From<EngineName> for Engine {
    fn from(name: EngineName) -> Engine {
        match name {
            EngineName::Packet => Engine::Packet,
            EngineName::Single => Engine::Single,
            EngineName::Reference => Engine::Reference,
        }
    }
}

/// How many cores to use.
#[derive(Debug, Clone, Copy, Args)]
pub struct Threads {
    /// Threads; 0: as many as this process has cores, or as SLURM_CPUS_PER_TASK says
    #[arg(short = 't', long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u64).range(0..=MOST_THREADS))]
    threads: u64,
}

impl Threads {
    /// Gives the rest of the process as many: what packs pictures takes the threads that there are.
    pub fn rule(self) {
        // Only the first one who asks is heard, and that does no harm.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(self.count()).build_global();
    }

    /// The number of threads; 0: one a core.
    pub fn count(self) -> usize {
        let slurm = || std::env::var("SLURM_CPUS_PER_TASK").ok()?.trim().parse::<u64>().ok();
        let threads = if self.threads > 0 { self.threads } else { slurm().unwrap_or(0) };
        threads.min(MOST_THREADS) as usize
    }
}

/// Where numbers about the run go.
#[derive(Debug, Clone, Args)]
pub struct StatsFile {
    /// Write times, ray counts and memory to a JSON file
    #[arg(long = "stats", value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
}

/// `640x480`.
pub fn resolution(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse::<u32>().ok().filter(|side| (1..=MOST_PIXELS_A_SIDE).contains(side));
    let sides = text.split_once(['x', 'X']).and_then(|(width, height)| Some((side(width)?, side(height)?)));
    let (width, height) = sides.ok_or("should be WIDTHxHEIGHT in pixels, each from 1 to 65536, such as 640x480")?;
    if u64::from(width) * u64::from(height) > MOST_PIXELS {
        return Err("should have at most 1073741824 (2^30) pixels".to_owned());
    }
    Ok((width, height))
}

/// `4x2`: columns and rows.
pub fn tiles(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| text.parse::<u32>().ok().filter(|side| (1..=1000).contains(side));
    let sides = text.split_once(['x', 'X']).and_then(|(columns, rows)| Some((side(columns)?, side(rows)?)));
    sides.ok_or_else(|| "should be COLUMNSxROWS, each from 1 to 1000, such as 4x2".to_owned())
}

/// `X0,Y0,X1,Y1`, half open.
pub fn crop(text: &str) -> Result<Window, String> {
    let numbers: Option<Vec<i32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, x1, y1]) if x0 < x1 && y0 < y1 => Ok(Window { x0, y0, x1, y1 }),
        Some(&[_, _, _, _]) => Err("holds no pixels: should be X0,Y0,X1,Y1 with X0 < X1 and Y0 < Y1".to_owned()),
        _ => Err("should be X0,Y0,X1,Y1: the first pixel, and the one past the last, such as 0,0,320,240".to_owned()),
    }
}

/// A limit: a number that is not negative.
pub fn limit(text: &str) -> Result<f64, String> {
    let limit = text.parse::<f64>().ok().filter(|limit| *limit >= 0.0);
    limit.ok_or_else(|| "should be a number, 0 or more".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_or_explained() {
        assert_eq!((resolution("640x480"), resolution("1X65536")), (Ok((640, 480)), Ok((1, 65_536))));
        for text in ["", "640", "640x", "x480", "0x480", "640x65537", "-1x5", "640x480x3", "6.5x4"] {
            assert!(resolution(text).unwrap_err().contains("such as 640x480"), "{text}");
        }
        assert!(resolution("65536x65536").unwrap_err().contains("2^30"));
    }

    #[test]
    fn windows_are_read_or_explained() {
        assert_eq!(crop("0,1, 20,30"), Ok(Window { x0: 0, y0: 1, x1: 20, y1: 30 }));
        for text in ["", "1,2,3", "1,2,3,4,5", "a,b,c,d", "0,0,1e3,4", "0,0,99999999999,4"] {
            assert!(crop(text).unwrap_err().contains("such as"), "{text}");
        }
        assert!(crop("5,0,5,9").unwrap_err().contains("holds no pixels"));
    }

    #[test]
    fn limits_are_not_negative() {
        assert_eq!((limit("0"), limit("1e-3"), limit("inf")), (Ok(0.0), Ok(1e-3), Ok(f64::INFINITY)));
        assert!(["-1", "nan", "", "x"].iter().all(|text| limit(text).is_err()));
    }
}
