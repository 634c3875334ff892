//! What the build asks of the CPU, and what it is called.

use std::io::{self, Write};
use std::process::ExitCode;

use super::exit::Exit;

/// SIMD level of this build.
pub const SIMD: &str = if cfg!(all(target_feature = "avx512f", target_feature = "avx2", target_feature = "fma")) {
    "AVX-512"
} else if cfg!(all(target_feature = "avx2", target_feature = "fma")) {
    "AVX2+FMA"
} else if cfg!(target_feature = "avx") {
    "AVX"
} else if cfg!(target_feature = "sse2") {
    "SSE2"
} else if cfg!(target_feature = "neon") {
    "NEON"
} else {
    "none"
};

/// Whether this is a debug build.
pub const DEBUG: bool = cfg!(debug_assertions);

/// Version, SIMD level and kind of build, as `--version` shows them.
pub fn version() -> String {
    format!("{} ({SIMD}, {} build)", env!("CARGO_PKG_VERSION"), if DEBUG { "debug" } else { "release" })
}

/// What makes this build slow.
pub fn warnings() -> Vec<String> {
    let mut warnings = Vec::new();
    if DEBUG {
        warnings.push("this is a debug build, some fifty times slower: build with --release".to_owned());
    }
    if cfg!(target_arch = "x86_64") && !cfg!(all(target_feature = "avx2", target_feature = "fma")) {
        warnings.push(format!(
            "this is the slow {SIMD} build: for AVX2 build it with \
             RUSTFLAGS=\"-C target-cpu=x86-64-v3\" cargo install octray"
        ));
    }
    warnings
}

/// Says in one line that this CPU cannot run this build.
#[cold]
#[inline(never)]
pub fn refuse() -> ExitCode {
    // Bytes as they are: formatting might use the very instructions that are missing.
    let message = b"octray: error: this CPU lacks AVX2, FMA or another part of x86-64-v3 that this build of octray \
        uses: build it with RUSTFLAGS=\"-C target-cpu=x86-64\" (slower), or run it on another machine\n";
    let _ = io::stderr().write_all(message);
    ExitCode::from(Exit::Cpu as u8)
}

/// Whether the CPU has every instruction set that this build uses.
///
/// `is_x86_feature_detected!` does not serve here: of a feature that the build enables it says yes
/// without asking the CPU.
#[cfg(target_arch = "x86_64")]
#[inline(never)]
pub fn is_sufficient() -> bool {
    use raw_cpuid::native_cpuid::cpuid_count;
    let last = cpuid_count(0, 0).eax;
    let last_extended = cpuid_count(0x8000_0000, 0).eax;
    let basic = cpuid_count(1, 0).ecx;
    let wide = if last >= 7 { cpuid_count(7, 0).ebx } else { 0 };
    let extended = if last_extended >= 0x8000_0001 { cpuid_count(0x8000_0001, 0).ecx } else { 0 };
    // Bits as in Intel, "64 and IA-32 architectures software developer's manual", volume 2, CPUID; the
    // system must have switched on the wide registers as well (OSXSAVE, bit 27).
    let has = |used: bool, register: u32, bit: u32| !used || register >> bit & 1 == 1;
    has(cfg!(target_feature = "avx"), basic, 27)
        && has(cfg!(target_feature = "avx"), basic, 28)
        && has(cfg!(target_feature = "fma"), basic, 12)
        && has(cfg!(target_feature = "sse4.1"), basic, 19)
        && has(cfg!(target_feature = "sse4.2"), basic, 20)
        && has(cfg!(target_feature = "movbe"), basic, 22)
        && has(cfg!(target_feature = "popcnt"), basic, 23)
        && has(cfg!(target_feature = "f16c"), basic, 29)
        && has(cfg!(target_feature = "bmi1"), wide, 3)
        && has(cfg!(target_feature = "avx2"), wide, 5)
        && has(cfg!(target_feature = "bmi2"), wide, 8)
        && has(cfg!(target_feature = "avx512f"), wide, 16)
        && has(cfg!(target_feature = "avx512dq"), wide, 17)
        && has(cfg!(target_feature = "avx512bw"), wide, 30)
        && has(cfg!(target_feature = "avx512vl"), wide, 31)
        && has(cfg!(target_feature = "lzcnt"), extended, 5)
}

/// Other CPUs have what their target says.
#[cfg(not(target_arch = "x86_64"))]
pub fn is_sufficient() -> bool {
    true
}
