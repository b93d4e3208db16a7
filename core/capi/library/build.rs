//! The name by which programs find the shared library, and the C library that it needs.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        // the first number changes when programs of the old one can no longer run with the new one
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libcroupier.so.0");
        // no_std: rustc asks for no library; memcpy, memset and abort are the C library's
        println!("cargo:rustc-cdylib-link-arg=-Wl,-z,defs,--gc-sections");
        println!("cargo:rustc-cdylib-link-arg=-lc");
    }
}
