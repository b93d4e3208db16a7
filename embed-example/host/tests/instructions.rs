//! Instruction sets: which build of the program runs, and what an old processor is told.
#![cfg(feature = "program")]
#![cfg(all(target_os = "linux", target_arch = "x86_64"))]

mod common;

use common::text;
use croupier::{INSTRUCTION_SET, processor_instruction_set};
use std::fs::{self, Permissions};
use std::io::ErrorKind;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::{Command, Output};

/// Another set than that of this build, which programs can be for.
const OTHER: &str = if cfg!(target_feature = "avx2") { "x86-64" } else { "x86-64-v3" };

fn run(program: &Path, asked: Option<&str>, arguments: &[&str]) -> Output {
    let mut command = Command::new(program);
    command.args(arguments).env_remove("CROUPIER_INSTRUCTIONS");
    command.envs(asked.map(|set| ("CROUPIER_INSTRUCTIONS", set)));
    loop {
        match command.output() {
            // a child that another test has just begun may still hold the copy open
            Err(e) if e.kind() == ErrorKind::ExecutableFileBusy => std::thread::yield_now(),
            done => return done.unwrap(),
        }
    }
}

/// Killed by: a request that is ignored; arguments, name or status that are lost on the way; a variant that looks for
/// variants; a baseline program that leaves a faster one alone, or a fast one that looks for a slower one.
#[test]
fn the_program_becomes_another_build() {
    let root = tempfile::tempdir().unwrap();
    let [bin, libexec] = ["bin", "libexec/croupier"].map(|folder| root.path().join(folder));
    [&bin, &libexec].into_iter().for_each(|folder| fs::create_dir_all(folder).unwrap());
    let program = bin.join("croupier");
    fs::copy(env!("CARGO_BIN_EXE_croupier"), &program).unwrap();
    // programs are also reached through links
    let link = root.path().join("link");
    std::os::unix::fs::symlink(&program, &link).unwrap();
    let own = format!("croupier {} ({INSTRUCTION_SET})\n", env!("CARGO_PKG_VERSION"));
    assert_eq!(text(&run(&program, None, &["--version"]).stdout), own);
    assert_eq!(text(&run(&program, Some(INSTRUCTION_SET), &["--version"]).stdout), own);
    let missing = run(&program, Some("x86-64-v0"), &["--version"]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(text(&missing.stderr).contains("x86-64, x86-64-v3, x86-64-v4"), "{}", text(&missing.stderr));
    if OTHER > processor_instruction_set() {
        println!("this processor runs nothing but {INSTRUCTION_SET}");
        return;
    }
    let missing = run(&program, Some(OTHER), &["--version"]);
    assert_eq!(missing.status.code(), Some(1));
    assert!(text(&missing.stderr).contains(&format!("there is no croupier-{OTHER}")), "{}", text(&missing.stderr));
    let variant = libexec.join(format!("croupier-{OTHER}"));
    fs::write(&variant, "#!/bin/sh\necho the other one: \"$@\"\nexit 7\n").unwrap();
    fs::set_permissions(&variant, Permissions::from_mode(0o755)).unwrap();
    for program in [&program, &link] {
        let other = run(program, Some(OTHER), &["render", "a b", "--size"]);
        assert_eq!(
            (text(&other.stdout).as_str(), other.status.code()),
            ("the other one: render a b --size\n", Some(7))
        );
    }
    let chosen = text(&run(&program, None, &["--version"]).stdout);
    if OTHER > INSTRUCTION_SET {
        assert_eq!(chosen, "the other one: --version\n");
    } else {
        assert_eq!(chosen, own);
    }
    // what cannot be run is no reason to stop, unless it was asked for
    fs::set_permissions(&variant, Permissions::from_mode(0o644)).unwrap();
    assert_eq!(text(&run(&program, None, &["--version"]).stdout), own);
    let unusable = run(&program, Some(OTHER), &["--version"]);
    assert!(text(&unusable.stderr).contains("cannot run"), "{}", text(&unusable.stderr));
    // a variant that is not what its name says does not look for itself
    fs::copy(&program, bin.join(format!("croupier-{OTHER}"))).unwrap();
    let own_again = run(&program, None, &["--version"]);
    assert_eq!(text(&own_again.stdout), own);
    assert!(text(&run(&program, Some(OTHER), &["--version"]).stderr).contains("is built for"));
}

/// The program on an emulated processor of 2008, without AVX, and on one of 2013. Killed by: an illegal instruction in
/// place of a message; a build for every processor that needs a newer one.
#[test]
fn old_processors() {
    let emulated = |processor: &str, arguments: &[&str]| {
        let mut command = Command::new("qemu-x86_64");
        command.args(["-cpu", processor, env!("CARGO_BIN_EXE_croupier")]).args(arguments).output()
    };
    let Ok(old) = emulated("Nehalem", &["--version"]) else {
        println!("no qemu-x86_64: not tested here, but by the step `package` of .ci/run");
        return;
    };
    let said = text(&old.stderr);
    if cfg!(target_feature = "avx2") {
        assert_eq!(old.status.code(), Some(1), "{:?}: {said}", old.status);
        assert!(said.contains("this build needs a processor with x86-64-v3; this one lacks AVX"), "{said}");
    } else {
        assert_eq!(old.status.code(), Some(0), "{:?}: {said}", old.status);
        assert!(text(&old.stdout).contains(INSTRUCTION_SET));
    }
    let new = emulated("Haswell", &["--version"]).unwrap();
    assert!(text(&new.stdout).contains(INSTRUCTION_SET), "{:?}: {}", new.status, text(&new.stderr));
}
