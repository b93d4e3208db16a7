//! Instructions counted by callgrind, in the two parts of a render ([`serial`]) or in single calls: the running program
//! calls itself under valgrind.

use crate::serial;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::SceneDescription;
use croupier_host::{builtin, load};
use serde_json::Value;
use std::error::Error;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Kept counts are of builds with the profile `embed`, without LTO.
///
/// # Errors
/// Another build whose counts are to be kept; of one whose counts are compared it prints a note.
pub fn note_profile(write: bool) -> Result<(), String> {
    if env!("BUILD_OPTION").trim() == "--profile embed" {
        return Ok(());
    }
    if write {
        return Err("counts are kept of builds with `--profile embed`, and this is none".into());
    }
    println!("kept counts are of builds with `--profile embed`, and this is none");
    Ok(())
}

/// A temporary folder that is removed in the end.
#[derive(Debug)]
pub struct Folder(PathBuf);

impl Folder {
    /// A folder of this process; `name` is part of its own name.
    pub fn new(name: &str) -> std::io::Result<Self> {
        let path = std::env::temp_dir().join(format!("croupier-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path)?;
        Ok(Self(path))
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Bakes a scene into the folder; the blob's path.
    pub fn bake(&self, name: &str, description: &SceneDescription) -> Result<PathBuf, Box<dyn Error>> {
        let path = self.0.join(name).with_extension("crp");
        std::fs::write(&path, &*bake(description, &BakeOptions::default(), |_, _| {})?.bytes)?;
        Ok(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // what is left in a temporary folder does no harm
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The scene of a name: `built-in`, or that of a folder in `scenes`, `None` if it is not there.
pub fn description(name: &str, scenes: &Path) -> Result<Option<SceneDescription>, Box<dyn Error>> {
    let source = scenes.join(name);
    Ok(match name {
        "built-in" => Some(builtin::cornell_box()),
        _ if source.join("scene.json").exists() => Some(load::load(&source)?.0),
        _ => {
            println!("skipped {name}: there is no {}", source.display());
            None
        }
    })
}

/// The bytes of a blob, aligned.
pub fn read(blob: &Path) -> std::io::Result<AlignedBytes> {
    let read = std::fs::read(blob)?;
    let mut bytes = AlignedBytes::zeroed(read.len());
    bytes.as_mut().copy_from_slice(&read);
    Ok(bytes)
}

/// What was counted in a render.
#[derive(Clone, Copy, Debug)]
pub struct Counted {
    /// Rays of all kinds.
    pub rays: u64,
    /// Instructions in stepping, and in ending iterations.
    pub instructions: [u64; 2],
}

impl Counted {
    /// Instructions per ray of both.
    pub fn per_ray(&self) -> [f64; 2] {
        self.instructions.map(|n| n as f64 / self.rays as f64)
    }
}

/// Runs this program with `args` under callgrind; it must render once and print `{"rays": N}`. `label` names the run in
/// errors.
pub fn count(folder: &Folder, label: &str, args: &[&str]) -> Result<Counted, Box<dyn Error>> {
    let out = folder.path().join("callgrind.out");
    let functions = [serial::STEP, serial::END];
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--quiet", "--compress-strings=no", "--collect-atstart=no"]);
    valgrind.args(functions.map(|f| format!("--toggle-collect=*{f}*")));
    valgrind.arg(format!("--callgrind-out-file={}", out.display()));
    valgrind.arg(std::env::current_exe()?).args(args);
    let output = valgrind.output().map_err(|e| {
        format!("cannot run valgrind: {e}; Debian has it as `apt-get install valgrind`, other systems alike")
    })?;
    if !output.status.success() {
        return Err(format!("{label}: {}", String::from_utf8_lossy(&output.stderr)).into());
    }
    let rays: Value = serde_json::from_slice(&output.stdout)?;
    let rays = rays["rays"].as_u64().filter(|&n| n > 0).ok_or("a render without rays")?;
    let profile = std::fs::read_to_string(&out).map_err(|e| format!("{}: {e}", out.display()))?;
    let instructions = functions.map(|f| inclusive(&profile, f));
    let total = profile.lines().find_map(|l| l.strip_prefix("totals: ")?.trim().parse::<u64>().ok());
    if instructions.contains(&0) || total != Some(instructions.iter().sum()) {
        return Err(format!("callgrind counted {instructions:?} in {functions:?}, and {total:?} in all").into());
    }
    Ok(Counted { rays, instructions })
}

/// Makes a call that [`each_call`] counts. Not generic, so that the functions that callgrind looks for have one name.
#[inline(never)]
pub fn bench_collect(call: &mut dyn FnMut()) {
    // callgrind writes no profile where it does not collect, so the end of the call is in another function
    bench_one_call(call);
    // no call in place of the return
    black_box(());
}

/// What callgrind writes a profile after.
#[inline(never)]
fn bench_one_call(call: &mut dyn FnMut()) {
    call();
    black_box(());
}

/// Runs this program with `args` under callgrind; it must print a line for each call of [`bench_collect`]. The lines, each
/// with the instructions of its call.
pub fn each_call(folder: &Folder, args: &[&str]) -> Result<Vec<(String, u64)>, Box<dyn Error>> {
    let calls = profiles(folder, args, &[])?;
    let counted = calls.into_iter().map(|(line, profile)| match event(&profile, "Ir") {
        0 => Err("callgrind counted nothing in a call".into()),
        n => Ok((line, n)),
    });
    counted.collect()
}

/// What callgrind counts with caches: those of [`CACHES`], whatever machine it runs on.
#[derive(Clone, Copy, Debug)]
pub struct WithCaches {
    /// Instructions.
    pub instructions: u64,
    /// Reads and writes that miss the first data cache.
    pub first_misses: u64,
    /// Reads, writes and instructions that miss the last cache.
    pub last_misses: u64,
}

/// The caches that [`each_call_with_caches`] models: first ones of 32 KiB, the last one of 32 MiB.
pub const CACHES: [&str; 4] = ["--cache-sim=yes", "--I1=32768,8,64", "--D1=32768,8,64", "--LL=33554432,16,64"];

/// [`each_call`] with misses of caches.
pub fn each_call_with_caches(folder: &Folder, args: &[&str]) -> Result<Vec<(String, WithCaches)>, Box<dyn Error>> {
    let calls = profiles(folder, args, &CACHES)?;
    let counted = calls.into_iter().map(|(line, profile)| {
        let sum = |names: &[&str]| names.iter().map(|n| event(&profile, n)).sum();
        let with = WithCaches {
            instructions: sum(&["Ir"]),
            first_misses: sum(&["D1mr", "D1mw"]),
            last_misses: sum(&["ILmr", "DLmr", "DLmw"]),
        };
        if with.instructions > 0 { Ok((line, with)) } else { Err("callgrind counted nothing in a call".into()) }
    });
    counted.collect()
}

/// Total of an event in a profile, 0 where it is not counted.
fn event(profile: &str, name: &str) -> u64 {
    let line = |key: &str| profile.lines().find_map(|l: &str| l.strip_prefix(key));
    let (Some(names), Some(totals)) = (line("events: "), line("totals: ")) else { return 0 };
    // zeros at the end are left out
    let mut both = names.split_whitespace().zip(totals.split_whitespace());
    both.find(|(n, _)| *n == name).and_then(|(_, total)| total.parse().ok()).unwrap_or(0)
}

/// The lines that this program prints with `args`, each with the profile of its call of [`bench_collect`].
fn profiles(folder: &Folder, args: &[&str], options: &[&str]) -> Result<Vec<(String, String)>, Box<dyn Error>> {
    let out = folder.path().join("calls.out");
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--quiet", "--collect-atstart=no", "--dump-line=no"]).args(options);
    valgrind.args(["--toggle-collect=*bench_collect*", "--dump-after=*bench_one_call*"]);
    valgrind.arg(format!("--callgrind-out-file={}", out.display()));
    let output = valgrind.arg(std::env::current_exe()?).args(args).output()?;
    if !output.status.success() {
        return Err(String::from_utf8_lossy(&output.stderr).into());
    }
    let mut calls = Vec::new();
    for (line, number) in String::from_utf8(output.stdout)?.lines().zip(1..) {
        let path = folder.path().join(format!("calls.out.{number}"));
        let profile = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        std::fs::remove_file(&path)?;
        calls.push((line.to_owned(), profile));
    }
    Ok(calls)
}

/// Instructions in all calls of a function, with all that it calls. A profile has three lines for the calls from one
/// place: `cfn=` with the name, `calls=` with their number, the caller's line with the instructions.
fn inclusive(profile: &str, function: &str) -> u64 {
    let mut lines = profile.lines();
    let mut sum = 0;
    while let Some(line) = lines.next() {
        if line.strip_prefix("cfn=").is_some_and(|name| name.contains(function)) {
            let cost = lines.by_ref().nth(1).and_then(|l| l.split(' ').nth(1));
            sum += cost.and_then(|c| c.parse::<u64>().ok()).unwrap_or(0);
        }
    }
    sum
}
