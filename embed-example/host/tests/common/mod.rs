//! What tests of the program share.
#![allow(dead_code, reason = "not every binary of tests needs all of it")]

pub(crate) mod inputs;

use std::path::Path;
use std::process::{Command, Output};

/// Runs the program in a folder.
pub(crate) fn croupier(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_croupier")).args(arguments).current_dir(folder).output().unwrap()
}

/// Output as text.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A Radiance picture of RGBE pixels, in rows from the top.
pub(crate) fn hdr(width: usize, height: usize, pixel: impl Fn(usize, usize) -> [u8; 4]) -> Vec<u8> {
    let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
    let pixels = (0..height * width).flat_map(|i| pixel(i % width, i / width));
    header.into_bytes().into_iter().chain(pixels).collect()
}

/// A grey PNG of this size whose pixels are all in `data`, which may be too few.
pub(crate) fn png(width: u32, height: u32, data: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    // What is missing is an error at the end of writing only.
    let mut writer = encoder.write_header().unwrap();
    writer.write_chunk(png::chunk::IDAT, data).unwrap();
    drop(writer);
    out
}

/// A complete PNG of 64 x 64 grey pixels.
pub(crate) fn small_png() -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, 64, 64);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[128; 64 * 64]).unwrap();
    out
}
