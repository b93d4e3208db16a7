//! Draws every sample file as the program shows it, in cells of 128x128 pixels, ten in a row, into PNG files of 40 that are named
//! after the argument: `cargo run --release -p croupier-tests --example contact_sheet -- target/samples`. A second argument
//! keeps the samples whose names contain it.

use croupier_host::image::write_png;
use croupier_host::look::exposure;
use croupier_host::tonemap::{Curve, tonemap};
use croupier_tests::samples;
use std::path::Path;

const SIDE: usize = 128;
const COLUMNS: usize = 10;
const ROWS: usize = 4;
const SPP: u32 = 16;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let stem = arguments.first().map_or("target/samples", |s| s);
    let wanted = arguments.get(1).map_or("", |s| s);
    let folder = tempfile::tempdir()?;
    let mut all = samples::all(folder.path());
    all.retain(|s| s.name.contains(wanted));
    for (sheet, samples) in all.chunks(COLUMNS * ROWS).enumerate() {
        let rows = samples.len().div_ceil(COLUMNS);
        let mut pixels = vec![[60; 3]; SIDE * COLUMNS * SIDE * rows];
        for (i, sample) in samples.iter().enumerate() {
            let shown = samples::show(sample, SIDE as u32, SPP);
            let place = format!("{sheet}: row {}, column {}", i / COLUMNS + 1, i % COLUMNS + 1);
            match shown {
                Err(e) => println!("{place}: {}: {e}", sample.name),
                Ok(shown) => {
                    println!("{place}: {}: {} triangles, {:.2} seen", sample.name, shown.triangles, shown.seen);
                    shown.notes.iter().for_each(|n| println!("    {n}"));
                    let picture = tonemap(&shown.picture, exposure::auto(&shown.picture), Curve::Shoulder);
                    let [width, height] = [shown.picture.width, shown.picture.height];
                    for (y, line) in picture.chunks(width).enumerate() {
                        let row = i / COLUMNS * SIDE + (SIDE - height) / 2 + y;
                        let start = row * SIDE * COLUMNS + i % COLUMNS * SIDE + (SIDE - width) / 2;
                        pixels[start..start + width].copy_from_slice(line);
                    }
                }
            }
        }
        let path = format!("{stem}-{sheet}.png");
        write_png(Path::new(&path), SIDE * COLUMNS, SIDE * rows, &pixels)?;
        println!("{path}");
    }
    Ok(())
}
