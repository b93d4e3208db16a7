//! What generated tables state: `RUSTC_VERSION`, the version of the compiler that builds this package, and `BUILD_OPTION`,
//! the option of cargo that chooses the profile.

use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("--version").output();
    let version = output.ok().and_then(|o| String::from_utf8(o.stdout).ok()).unwrap_or_else(|| "unknown".into());
    println!("cargo::rustc-env=RUSTC_VERSION={}", version.trim());
    // cargo's PROFILE is the one that a profile inherits from, but the folder <target>/<profile>/build/<package>/out has its
    // own name
    let out = PathBuf::from(std::env::var_os("OUT_DIR").unwrap_or_default());
    let profile = out.ancestors().nth(3).and_then(Path::file_name).unwrap_or_default().to_string_lossy();
    let option = match &*profile {
        "debug" => String::new(),
        "release" => " --release".into(),
        other => format!(" --profile {other}"),
    };
    println!("cargo::rustc-env=BUILD_OPTION={option}");
    // cargo runs this again for another compiler whatever files it watches
    println!("cargo::rerun-if-changed=build.rs");
}
