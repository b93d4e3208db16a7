//! The version of the compiler that builds this package, which generated tables state: `RUSTC_VERSION`.

use std::process::Command;

fn main() {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(rustc).arg("--version").output();
    let version = output.ok().and_then(|o| String::from_utf8(o.stdout).ok()).unwrap_or_else(|| "unknown".into());
    println!("cargo::rustc-env=RUSTC_VERSION={}", version.trim());
    // cargo runs this again for another compiler whatever files it watches
    println!("cargo::rerun-if-changed=build.rs");
}
