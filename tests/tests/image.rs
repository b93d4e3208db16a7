//! Pictures and their files.

use croupier_host::image::{ImageError, Picture, Rgb, write_png};
use croupier_host::tonemap::{Curve, SHOULDER, expose, tonemap};
use exr::prelude::{self as openexr, WritableImage};
use std::fs;
use std::path::{Path, PathBuf};

/// Values that survive only a copy of their bits: NaN with a payload, negative zero, denormals, infinities.
fn awkward(i: usize) -> f32 {
    match i % 7 {
        0 => f32::from_bits(0x7fc1_2345),
        1 => -0.0,
        2 => f32::from_bits(1 + i as u32),
        3 => f32::INFINITY,
        4 => -1.0e38,
        5 => 1.0 + f32::EPSILON,
        _ => i as f32 * 0.37,
    }
}

fn sample(width: usize, height: usize) -> Picture {
    let pixels = |k: usize| -> Vec<[f32; 3]> {
        (0..width * height).map(|i| [awkward(3 * i + k), awkward(3 * i + k + 1), awkward(3 * i + k + 2)]).collect()
    };
    let values = |k: usize| -> Vec<f32> { (0..width * height).map(|i| awkward(i + k)).collect() };
    let mut picture = Picture::new(width, height);
    picture.add3("", ["R", "G", "B"], &pixels(0));
    picture.add3("stderr", ["R", "G", "B"], &pixels(1));
    picture.add3("albedo", ["R", "G", "B"], &pixels(2));
    picture.add3("normal", ["X", "Y", "Z"], &pixels(3));
    picture.add1("depth", "Z", &values(4));
    picture.add1("cost", "Y", &values(5));
    picture.add1("factor1", "Y", &values(6));
    picture.add1("factor2", "Y", &values(7));
    picture
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// Killed by: a layer that is dropped or misnamed, swapped channels, values that pass through f16 or are made finite.
#[test]
fn every_layer_survives_bit_for_bit() {
    let dir = tempfile::tempdir().unwrap();
    for (width, height) in [(1, 1), (19, 35), (128, 16)] {
        let path = dir.path().join(format!("{width}.exr"));
        let picture = sample(width, height);
        picture.write_exr(&path).unwrap();
        let read = Picture::read_exr(&path).unwrap();
        assert_eq!((read.width, read.height, read.layers.len()), (width, height, picture.layers.len()));
        for layer in &picture.layers {
            let back = read.layer(&layer.name).unwrap_or_else(|| panic!("no layer {:?}", layer.name));
            let names = |l: &croupier_host::image::Layer| l.channels.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
            assert_eq!(names(back), names(layer));
            for (a, b) in back.channels.iter().zip(&layer.channels) {
                assert_eq!(bits(&a.values), bits(&b.values), "{}.{}", layer.name, a.name);
            }
        }
        let rgb = Rgb::read_exr(&path).unwrap();
        assert_eq!(bits(rgb.pixels.as_flattened()), bits(picture.rgb("").unwrap().pixels.as_flattened()));
    }
    let left: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 3, "temporary files stay behind: {left:?}");
}

/// A plain RGB reader must see the picture, not the standard error: dies if `""` is not the first layer of the file.
#[test]
fn other_readers_see_the_picture() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    let picture = sample(9, 4);
    picture.write_exr(&path).unwrap();
    let image = openexr::read_first_rgba_layer_from_file(
        &path,
        |size, _| vec![[0.0f32; 3]; size.area()],
        |pixels, at, (r, g, b, _): (f32, f32, f32, f32)| pixels[at.y() * 9 + at.x()] = [r, g, b],
    )
    .unwrap();
    let seen = image.layer_data.channel_data.pixels;
    assert_eq!(bits(seen.as_flattened()), bits(picture.rgb("").unwrap().pixels.as_flattened()));
}

/// Files of other programs: one part per layer, 16-bit samples. Killed by: part names that are ignored.
#[test]
fn parts_are_layers_too() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("parts.exr");
    let part = |name: &str, level: f32| {
        let channel = |n: &str, x: f32| {
            openexr::AnyChannel::new(n, openexr::FlatSamples::F16(vec![openexr::f16::from_f32(x); 6]))
        };
        openexr::Layer::new(
            (3, 2),
            openexr::LayerAttributes::named(name),
            openexr::Encoding::FAST_LOSSLESS,
            openexr::AnyChannels::sort(vec![channel("R", level), channel("G", 0.5), channel("B", 0.25)].into()),
        )
    };
    let attributes = openexr::ImageAttributes::new(openexr::IntegerBounds::from_dimensions((3, 2)));
    let image = openexr::Image::from_layers(attributes, vec![part("beauty", 2.0), part("stderr", 4.0)]);
    image.write().to_file(&path).unwrap();
    let read = Picture::read_exr(&path).unwrap();
    assert_eq!(read.rgb("beauty").unwrap().pixels[5], [2.0, 0.5, 0.25]);
    assert_eq!(read.rgb("stderr").unwrap().pixels[0], [4.0, 0.5, 0.25]);
    assert_eq!(Rgb::read_exr(&path).unwrap().pixels[3], [2.0, 0.5, 0.25]);
}

fn scenes() -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    if !path.is_dir() {
        println!("skipped: no reference scenes beside the repository");
        return None;
    }
    Some(path)
}

/// References of another renderer: the means that its own report states. Killed by: lost rows or channels.
#[test]
fn references_have_their_stated_means() {
    let Some(scenes) = scenes() else { return };
    let mut seen = 0;
    for entry in fs::read_dir(scenes).unwrap() {
        let folder = entry.unwrap().path();
        let (json, exr) = (folder.join("scene.json"), folder.join("reference.exr"));
        if !json.is_file() || !exr.is_file() {
            continue;
        }
        let json: serde_json::Value = serde_json::from_slice(&fs::read(json).unwrap()).unwrap();
        let facts = &json["reference"];
        let image = Rgb::read_exr(&exr).unwrap();
        let stderr = Rgb::read_exr(&folder.join("reference_stderr.exr")).unwrap();
        assert_eq!(Some(image.width as u64), facts["width"].as_u64());
        assert_eq!(Some(image.height as u64), facts["height"].as_u64());
        assert_eq!((stderr.width, stderr.height), (image.width, image.height));
        for c in 0..3 {
            let n = image.pixels.len() as f64;
            let mean: f64 = image.pixels.iter().map(|p| f64::from(p[c])).sum::<f64>() / n;
            let stated = facts["mean_rgb"][c].as_f64().unwrap();
            assert!((mean / stated - 1.0).abs() < 1e-3, "{}: {mean} {stated}", folder.display());
            let se = stderr.pixels.iter().map(|p| f64::from(p[c]).powi(2)).sum::<f64>().sqrt() / n;
            let stated = facts["mean_rgb_stderr"][c].as_f64().unwrap();
            assert!((se / stated - 1.0).abs() < 1e-2, "{}: {se} {stated}", folder.display());
        }
        seen += 1;
    }
    assert!(seen > 0, "no scene has a reference");
}

/// Every error names its file. Killed by: an error without a path, a half-written file that replaces
/// a good one.
#[test]
fn errors_name_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let named = |e: ImageError, name: &str| {
        let text = e.to_string();
        assert!(text.contains(name), "{text}");
        assert!(!text.contains('\n'), "{text}");
    };
    named(Rgb::read_exr(&dir.path().join("missing.exr")).unwrap_err(), "missing.exr");
    named(Rgb::read_exr(dir.path()).unwrap_err(), &dir.path().file_name().unwrap().to_string_lossy());

    let garbage = dir.path().join("garbage.exr");
    fs::write(&garbage, b"this is no image").unwrap();
    named(Rgb::read_exr(&garbage).unwrap_err(), "garbage.exr");

    let good = dir.path().join("good.exr");
    sample(40, 30).write_exr(&good).unwrap();
    let bytes = fs::read(&good).unwrap();
    let cut = dir.path().join("cut.exr");
    fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    named(Rgb::read_exr(&cut).unwrap_err(), "cut.exr");

    let mut depth_only = Picture::new(2, 2);
    depth_only.add1("depth", "Z", &[1.0; 4]);
    let path = dir.path().join("depth.exr");
    depth_only.write_exr(&path).unwrap();
    let error = Rgb::read_exr(&path).unwrap_err();
    assert!(matches!(error, ImageError::NoRgb(_)));
    named(error, "depth.exr");

    let mut short = sample(40, 30);
    short.layers[4].channels[0].values.pop();
    let error = short.write_exr(&good).unwrap_err();
    assert!(error.to_string().contains("depth.Z has 1199 values for 1200 pixels"), "{error}");
    assert_eq!(fs::read(&good).unwrap(), bytes, "a failed write must leave the old file");

    named(sample(4, 4).write_exr(&dir.path().join("no/such/folder.exr")).unwrap_err(), "folder.exr");
    named(Picture::new(0, 0).write_exr(&dir.path().join("empty.exr")).unwrap_err(), "empty.exr");
    named(write_png(&dir.path().join("none.png"), 0, 0, &[]).unwrap_err(), "none.png");
    // This one fails half-way through the file.
    let short = dir.path().join("short.png");
    write_png(&short, 2, 2, &[[9; 3]; 4]).unwrap();
    let before = fs::read(&short).unwrap();
    named(write_png(&short, 2, 2, &[[0; 3]; 3]).unwrap_err(), "short.png");
    assert_eq!(fs::read(&short).unwrap(), before, "a failed write must leave the old file");
    let left: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 5, "failed writes leave files behind: {left:?}");
}

/// Damaged files give errors or other numbers, never a panic: dies with any unchecked size in the reader.
#[test]
fn damaged_files_do_not_panic() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.exr");
    sample(5, 3).write_exr(&path).unwrap();
    let good = fs::read(&path).unwrap();
    let mut refused = 0;
    for i in 0..good.len().min(700) {
        for flip in [0x01, 0x80, 0xff] {
            let mut bad = good.clone();
            bad[i] ^= flip;
            fs::write(&path, &bad).unwrap();
            refused += usize::from(Picture::read_exr(&path).is_err());
        }
    }
    assert!(refused > 500, "only {refused} damaged files were refused");
}

/// Killed by: an exposure that is no power of two, a plain gamma as transfer function, NaN as white.
#[test]
fn tone_mapping_is_srgb() {
    let image = Rgb::new(3, 1, vec![[0.0, 1.0, 0.5], [0.001, f32::NAN, f32::INFINITY], [-1.0, 0.25, 0.18]]).unwrap();
    // 0.5 -> 188 and 0.18 -> 118 are the well-known mid greys; 0.001 lies on the linear toe: 12.92 * 0.255 = 3.29.
    assert_eq!(tonemap(&image, 0.0, Curve::Clamp), [[0, 255, 188], [3, 0, 255], [0, 137, 118]]);
    assert_eq!(tonemap(&image, 1.0, Curve::Clamp)[2][1], 188);
    let ramp = Rgb::new(4000, 1, (0..4000).map(|i| [i as f32 * 1e-3; 3]).collect()).unwrap();
    let shown = expose(&ramp, 0.0, Curve::Shoulder);
    for (w, x) in shown.windows(2).zip(&ramp.pixels) {
        let step = w[1][0] - w[0][0];
        assert!((0.0..=1.001e-3).contains(&step) && w[1][0] <= 1.0, "at {}: {step}", x[0]);
        assert!(x[0] > SHOULDER || w[0][0] == x[0]);
    }
}

/// What `png` decodes is what was written: dies if rows are flipped or the sRGB mark is missing.
#[test]
fn png_is_srgb_and_upright() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    let pixels: Vec<[u8; 3]> = (0..12u8).map(|i| [i, 100 + i, 255 - i]).collect();
    write_png(&path, 4, 3, &pixels).unwrap();
    let mut reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(&path).unwrap())).read_info().unwrap();
    assert!(reader.info().srgb.is_some());
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.width, info.height), (4, 3));
    assert_eq!(bytes, pixels.as_flattened());
}
