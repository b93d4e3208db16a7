//! The picture of the examples of embedding: its file, its hashes, and that it shows something.

use croupier::Scene;
use croupier_tests::embedding::{HASHES, PICTURES, baked, render, settings};
use std::fmt::Write;

const BLOB: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../embed-example/box.crp");

fn bless() -> bool {
    std::env::var_os("BLESS").is_some()
}

/// Killed by: changing the layout of blobs or the built-in scene without `BLESS=1 cargo test -p croupier-tests --test
/// embedding`, which writes both files again.
#[test]
fn the_blob_of_the_examples_is_the_baked_box() {
    let blob = baked();
    if bless() {
        std::fs::write(BLOB, &*blob).unwrap();
    }
    assert!(std::fs::read(BLOB).unwrap() == *blob, "run again with BLESS=1");
    let scene = Scene::from_bytes(&blob).unwrap();
    assert_eq!(settings(&scene, 1).size, [64, 64]);
}

/// Every host compares its picture with this file. Killed by: any change of a bit in the film, on any instruction set.
#[test]
#[cfg_attr(feature = "fast", ignore = "bits of reproducible arithmetic")]
fn the_hashes_of_the_examples_are_those_of_rust() {
    let blob = baked();
    let mut text = String::new();
    for (name, shards) in PICTURES {
        writeln!(text, "{name} {:016x}", render(&blob, shards)).unwrap();
    }
    if bless() {
        std::fs::write(HASHES, &text).unwrap();
    }
    assert_eq!(std::fs::read_to_string(HASHES).unwrap(), text);
}
