//! What the system says of this process: memory and CPU time, where it says so (Linux).

use std::fs;

use super::exit::{Exit, Failure};

/// Most memory that this process held so far, in bytes.
pub fn peak_bytes() -> Option<u64> {
    kilobytes(&fs::read_to_string("/proc/self/status").ok()?, "VmHWM:")
}

/// CPU seconds that all threads spent so far, those of the kernel included.
#[cfg(unix)]
pub fn cpu_seconds() -> Option<f64> {
    let spent = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(spent.tv_sec as f64 + spent.tv_nsec as f64 * 1e-9)
}

/// CPU seconds that all threads spent so far: not known here.
#[cfg(not(unix))]
pub fn cpu_seconds() -> Option<f64> {
    None
}

/// CPU seconds that all processes spent that this one started and waited for, and theirs.
#[cfg(unix)]
pub fn children_seconds() -> Option<f64> {
    use nix::sys::resource::{UsageWho, getrusage};
    let spent = getrusage(UsageWho::RUSAGE_CHILDREN).ok()?;
    let seconds = |time: nix::sys::time::TimeVal| time.tv_sec() as f64 + time.tv_usec() as f64 * 1e-6;
    Some(seconds(spent.user_time()) + seconds(spent.system_time()))
}

/// CPU seconds of processes that this one started: not known here.
#[cfg(not(unix))]
pub fn children_seconds() -> Option<f64> {
    None
}

/// What the CPU calls itself, where the system says so.
pub fn cpu_model() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    let name = line.and_then(|line| line.split_once(':')).map(|(_, name)| name.trim().to_owned());
    name.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

/// Makes sure that work will not run out of memory, where the system tells how much there is: it would
/// kill the process without a word later on.
pub fn need_memory(bytes: u64, work: &str) -> Result<(), Failure> {
    match available_bytes() {
        Some(available) if bytes > available => {
            let (need, have) = (size(bytes), size(available));
            Err(Failure::new(Exit::Limit, format!("{work} needs about {need} of memory, and {have} are available")))
        }
        _ => Ok(()),
    }
}

/// Memory that this process may still take: of the machine, of its control group, of its address space.
fn available_bytes() -> Option<u64> {
    let machine = || kilobytes(&fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable:");
    [machine(), group_bytes(), address_bytes()].into_iter().flatten().min()
}

/// What a control group (version 2, as containers have it) leaves.
fn group_bytes() -> Option<u64> {
    let number = |name| fs::read_to_string(format!("/sys/fs/cgroup/{name}")).ok()?.trim().parse::<u64>().ok();
    Some(number("memory.max")?.saturating_sub(number("memory.current")?))
}

/// What `ulimit -v` leaves.
fn address_bytes() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let line = limits.lines().find(|line| line.starts_with("Max address space"))?;
    let limit: u64 = line.split_ascii_whitespace().nth(3)?.parse().ok()?;
    Some(limit.saturating_sub(kilobytes(&fs::read_to_string("/proc/self/status").ok()?, "VmSize:")?))
}

/// The number behind a name in the files that count in kB.
fn kilobytes(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_ascii_whitespace().next()?.parse::<u64>().ok()?.checked_mul(1024)
}

/// Bytes for people.
pub fn size(bytes: u64) -> String {
    let (mut value, mut units) = (bytes as f64, ["B", "KiB", "MiB", "GiB", "TiB"].into_iter());
    let mut unit = units.next();
    while value >= 1024.0 {
        let Some(next) = units.next() else { break };
        (value, unit) = (value / 1024.0, Some(next));
    }
    let digits = if value < 10.0 && bytes >= 1024 { 1 } else { 0 };
    format!("{value:.digits$} {}", unit.unwrap_or("B"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_read_well() {
        let sizes = [0, 1023, 1024, 1536, 10 << 20, 34 << 30, u64::MAX].map(size);
        assert_eq!(sizes, ["0 B", "1023 B", "1.0 KiB", "1.5 KiB", "10 MiB", "34 GiB", "16777216 TiB"]);
    }

    #[test]
    fn numbers_are_found_by_their_name() {
        let text = "VmPeak:\t  9 kB\nVmHWM:\t    1784 kB\nOdd: kB\n";
        assert_eq!(kilobytes(text, "VmHWM:"), Some(1784 * 1024));
        assert_eq!((kilobytes(text, "Odd:"), kilobytes(text, "VmSize:")), (None, None));
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_system_answers() {
        let spin = std::time::Instant::now();
        while cpu_seconds().unwrap() == 0.0 {
            assert!(spin.elapsed().as_secs() < 60, "a busy process spends CPU time");
        }
        assert!(peak_bytes().unwrap() > 1 << 16);
        assert!(need_memory(1 << 16, "a line").is_ok());
        let error = need_memory(1 << 60, "the picture").unwrap_err();
        assert_eq!(error.exit, Exit::Limit);
        assert!(error.message.starts_with("the picture needs about 1048576 TiB of memory, and "), "{}", error.message);
    }
}
