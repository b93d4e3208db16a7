//! Where a generated table comes from: date, commit, machine, compiler, instruction set and command.

use std::process::Command;

/// The provenance of what this program computes now, as lines (key, value) in a fixed order.
pub fn of_this_run(bin: &str) -> Vec<(String, String)> {
    let lines = [
        ("date", shell("date", &["-u", "+%Y-%m-%d"])),
        ("commit", Some(commit())),
        ("command", Some(command(bin))),
        ("machine", Some(machine())),
        ("load before", load()),
        ("compiler", Some(COMPILER.into())),
        ("instruction set", Some(instruction_set())),
        ("arithmetic", Some(ARITHMETIC.into())),
    ];
    let known = |value: Option<String>| value.unwrap_or_else(|| "unknown".into());
    lines.into_iter().map(|(key, value)| (key.into(), known(value))).collect()
}

/// Compiler of this build.
pub const COMPILER: &str = env!("RUSTC_VERSION");

/// Arithmetic of this build.
pub const ARITHMETIC: &str = if croupier::unstable::simd::REPRODUCIBLE { "reproducible" } else { "fast" };

/// Instruction set of this build: `x86-64-v3` with AVX2 and FMA.
pub fn instruction_set() -> String {
    let v3 = cfg!(all(target_feature = "avx2", target_feature = "fma"));
    format!("{}{}", std::env::consts::ARCH.replace('_', "-"), if v3 { "-v3" } else { "" })
}

/// What a program says of its version.
pub fn version_of(program: &str) -> String {
    shell(program, &["--version"]).unwrap_or_else(|| "unknown".into())
}

/// Commit of the work tree, and whether tracked files differ from it. Generated results do not count: a run of several
/// benchmarks changes them one by one.
fn commit() -> String {
    let git = |args: &[&str]| {
        let args = [&["-C", env!("CARGO_MANIFEST_DIR")], args].concat();
        shell("git", &args)
    };
    let Some(hash) = git(&["rev-parse", "--short=12", "HEAD"]) else { return "unknown".into() };
    let clean = git(&["status", "--porcelain", "--untracked-files=no", "--", ":/", ":(exclude,top)benches/results"]);
    match clean.as_deref() {
        Some("") => hash,
        _ => format!("{hash} with uncommitted changes"),
    }
}

/// The command that makes the same table; absolute paths are cut to their last part.
fn command(bin: &str) -> String {
    let option = env!("BUILD_OPTION");
    let features =
        [("fast", !croupier::unstable::simd::REPRODUCIBLE), ("effects-rows", cfg!(feature = "effects-rows"))];
    let features =
        features.map(|(name, there)| if there { format!(" --features {name}") } else { String::new() }).concat();
    let args: Vec<String> = std::env::args().skip(1).map(|a| shortened(&a)).collect();
    let args = if args.is_empty() { String::new() } else { format!(" -- {}", args.join(" ")) };
    format!("cargo run{option} -p croupier-benches{features} --bin {bin}{args}")
}

fn shortened(arg: &str) -> String {
    let (flag, value) = arg.split_once('=').map_or(("", arg), |(flag, value)| (flag, value));
    let path = std::path::Path::new(value);
    match path.file_name() {
        Some(name) if path.is_absolute() => {
            let equals = if flag.is_empty() { "" } else { "=" };
            format!("{flag}{equals}.../{}", name.to_string_lossy())
        }
        _ => arg.into(),
    }
}

/// Model of the processor and number of cores.
fn machine() -> String {
    let info = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let field = |name: &str| {
        let line = info.lines().find(|l| l.split(':').next().is_some_and(|key| key.trim() == name))?;
        Some(line.split_once(':')?.1.trim().to_string())
    };
    let model = field("model name").unwrap_or_else(|| "unknown processor".into());
    let kind = field("cpu family").zip(field("model"));
    let kind = kind.map_or(String::new(), |(family, model)| format!(" (family {family}, model {model})"));
    let cores = std::thread::available_parallelism().map_or("unknown".into(), |n| n.to_string());
    format!("{model}{kind}, {cores} cores")
}

/// Processes that wanted a core in the minute before, on average: what else the machine did, which times tell of.
fn load() -> Option<String> {
    Some(std::fs::read_to_string("/proc/loadavg").ok()?.split(' ').next()?.into())
}

/// Output of a program without its line end; `None` if it cannot run or fails.
fn shell(program: &str, args: &[&str]) -> Option<String> {
    let output = Command::new(program).args(args).output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim_end().into())
}
