//! Values of flags that are no settings of the core.

use std::path::{Path, PathBuf};

/// The name of an EXR file.
pub(crate) fn exr_path(text: &str) -> Result<PathBuf, String> {
    path_ending_in("exr", text)
}

/// The name of an EXR file, or of a part of a picture.
pub(crate) fn picture_path(text: &str) -> Result<PathBuf, String> {
    exr_path(text).or_else(|e| path_ending_in(PART, text).map_err(|_| format!("{e}, with --part in .{PART}")))
}

/// Whether this is the name of a part of a picture.
pub(crate) fn is_part(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(PART))
}

/// How names of parts of pictures end.
const PART: &str = "crpart";

/// The name of a baked scene.
pub(crate) fn crp_path(text: &str) -> Result<PathBuf, String> {
    path_ending_in("crp", text)
}

/// The name of a JSON file.
pub(crate) fn json_path(text: &str) -> Result<PathBuf, String> {
    path_ending_in("json", text)
}

/// Most probes of a grid.
const MAX_PROBES: u32 = 1 << 18;

/// Three counts, such as `4x3x4`, of a grid that is not too large.
pub(crate) fn counts(text: &str) -> Result<[u32; 3], String> {
    let found: Option<Vec<u32>> = text.split('x').map(|n| n.parse().ok().filter(|n| (1..=1024).contains(n))).collect();
    let found = found.and_then(|v| <[u32; 3]>::try_from(v).ok()).filter(|n| n.iter().product::<u32>() <= MAX_PROBES);
    found.ok_or_else(|| format!("need NxNxN, each 1 to 1024, and at most {MAX_PROBES} in all"))
}

/// A share, from 0 to 1.
pub(crate) fn share(text: &str) -> Result<f32, String> {
    let found = text.parse::<f32>().ok().filter(|x| (0.0..=1.0).contains(x));
    found.ok_or_else(|| "need a number from 0 to 1".into())
}

fn path_ending_in(extension: &str, text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)) {
        Ok(path)
    } else {
        Err(format!("the name must end in .{extension}"))
    }
}

/// A finite number above 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        Ok(_) => Err("must be above 0 and finite".into()),
        Err(e) => Err(e.to_string()),
    }
}

/// An exposure in stops.
pub(crate) fn stops(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if x.abs() <= 100.0 => Ok(x),
        Ok(_) => Err("must be between -100 and 100".into()),
        Err(e) => Err(e.to_string()),
    }
}

/// A size in bytes, such as `512MiB`.
pub(crate) fn bytes(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| !c.is_ascii_digit());
    let unit: Option<u64> = match text.get(digits.len()..) {
        Some("") => Some(1),
        Some("KiB") => Some(1 << 10),
        Some("MiB") => Some(1 << 20),
        Some("GiB") => Some(1 << 30),
        Some("TiB") => Some(1 << 40),
        _ => None,
    };
    let n = digits.parse::<u64>().ok().zip(unit).and_then(|(n, unit)| n.checked_mul(unit));
    n.ok_or_else(|| "need a number of bytes, such as 512MiB or 2GiB".into())
}

/// Exposure of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Exposure {
    /// In stops.
    Stops(f32),
    /// What suits the picture.
    Auto,
}

/// An exposure: stops, or `auto`.
pub(crate) fn exposure(text: &str) -> Result<Exposure, String> {
    match text {
        "auto" => Ok(Exposure::Auto),
        _ => stops(text).map(Exposure::Stops).map_err(|e| format!("{e}; need stops or `auto`")),
    }
}
