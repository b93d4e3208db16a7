//! Values of flags that are no settings of the core.

use std::path::PathBuf;

/// The name of an EXR file.
pub(crate) fn exr_path(text: &str) -> Result<PathBuf, String> {
    path_ending_in("exr", text)
}

/// The name of a baked scene.
pub(crate) fn crp_path(text: &str) -> Result<PathBuf, String> {
    path_ending_in("crp", text)
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
