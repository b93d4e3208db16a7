//! Places the programs; see `machine.ld` and `user.ld`.

fn main() {
    println!("cargo:rerun-if-changed=machine.ld");
    println!("cargo:rerun-if-changed=user.ld");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none") {
        let folder = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_default();
        let script = if std::env::var_os("CARGO_FEATURE_USER_MODE").is_some() { "user.ld" } else { "machine.ld" };
        println!("cargo:rustc-link-arg-bins=-T{folder}/{script}");
    }
}
