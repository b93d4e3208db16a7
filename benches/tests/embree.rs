//! The program in C that the comparison with Embree needs.

use std::path::Path;
use std::process::{Command, Stdio};

/// It compiles without a word from the compiler, and says what is wrong if there is no library: here a file that is none.
/// Killed by: a warning, a structure of another size (which it asserts), a library that is called without being there.
#[test]
fn rays_c_compiles_and_needs_a_library() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let (program, source) = (folder.join("rays"), concat!(env!("CARGO_MANIFEST_DIR"), "/../embree/rays.c"));
    let mut compiler = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()));
    compiler.args(["-std=c11", "-Wall", "-Wextra", "-pedantic", "-Werror", source, "-o"]).arg(&program).arg("-ldl");
    assert!(compiler.status().unwrap().success());
    let no_library = folder.join("no-library.so");
    std::fs::write(&no_library, "none").unwrap();
    let run = Command::new(&program).arg(no_library).arg("isa=avx2").stdin(Stdio::null()).output().unwrap();
    let words = String::from_utf8(run.stderr).unwrap();
    assert!(!run.status.success() && words.contains("Embree: cannot load"), "{words}");
}
