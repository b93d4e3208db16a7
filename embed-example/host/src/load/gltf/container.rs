//! Bytes of an asset: the chunks of a `.glb`, and what URIs name.

use super::super::LoadError;
use super::super::error::quoted;
use super::super::loader::Loader;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use percent_encoding::percent_decode_str;
use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

/// First bytes of every `.glb`.
pub(in super::super) fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

/// The JSON text and the binary chunk of a file, `.glb` or `.gltf`.
pub(super) fn chunks<'b>(path: &Path, bytes: &'b [u8]) -> Result<(&'b [u8], Option<&'b [u8]>), LoadError> {
    if !is_glb(bytes) {
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes), None));
    }
    let word = |at: usize| bytes.get(at..).and_then(|b| b.first_chunk()).map(|b| u32::from_le_bytes(*b));
    let error = |at: usize, what: String| LoadError::binary(path, at as u64, what);
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err(error(0, "the file ends within its header".into()));
    };
    if version != 2 {
        return Err(error(4, format!("version {version} of binary glTF, only 2 is supported")));
    }
    if length as usize > bytes.len() {
        return Err(error(8, format!("the header states {length} bytes, the file has {}", bytes.len())));
    }
    let (mut json, mut binary) = (None, None);
    let mut at = 12;
    // Chunks of unknown types are skipped, as the format asks for.
    while let (Some(size), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) {
        let Some(data) = bytes.get(at + 8..).and_then(|rest| rest.get(..size as usize)) else {
            return Err(error(at, format!("a chunk of {size} bytes does not fit into the file")));
        };
        match (kind, json, binary) {
            (b"JSON", None, _) => json = Some(data),
            (b"BIN\0", _, None) => binary = Some(data),
            _ => {}
        }
        at += 8 + size as usize;
    }
    Ok((json.ok_or_else(|| error(12, "no chunk of JSON".into()))?, binary))
}

/// What a URI names.
pub(super) enum Source {
    /// Bytes in the URI itself.
    Data(Vec<u8>),
    /// A file.
    File(PathBuf),
}

/// Bytes of a `data:` URI, or the file beside the asset. Files outside of the asset's folder are refused.
pub(super) fn resolve(asset: &Path, uri: &str) -> Result<Source, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (kind, data) = data.split_once(',').ok_or("a `data:` URI without a comma")?;
        let decoded = if kind.ends_with(";base64") {
            let config = GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
            let engine = GeneralPurpose::new(&STANDARD, config);
            engine.decode(data.trim_ascii()).map_err(|e| format!("a `data:` URI that is not base64: {e}"))?
        } else {
            percent_decode_str(data).collect()
        };
        return Ok(Source::Data(decoded));
    }
    let refused = |why: &str| format!("the URI {} {why}", quoted(uri));
    let name: Cow<'_, str> = percent_decode_str(uri).decode_utf8().map_err(|_| refused("is not UTF-8"))?;
    let scheme =
        name.split_once(':').filter(|(s, _)| s.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c)));
    if scheme.is_some() || name.contains('\0') {
        return Err(refused("is no relative path of a file"));
    }
    let relative = name.replace('\\', "/");
    let inside = |c: Component<'_>| matches!(c, Component::Normal(_) | Component::CurDir);
    if !Path::new(&relative).components().all(inside) {
        return Err(refused("leads out of the folder of the asset"));
    }
    let folder = asset.parent().unwrap_or(Path::new(""));
    Ok(Source::File(folder.join(relative)))
}

/// Bytes that a URI names; `at` is the URI's place in the document.
pub(super) fn read(loader: &mut Loader, asset: &Path, uri: &str, at: &str) -> Result<Vec<u8>, LoadError> {
    match resolve(asset, uri).map_err(|what| LoadError::json(asset, at, what))? {
        Source::Data(bytes) => Ok(bytes),
        Source::File(file) => loader.read(&file, Some(&format!("{} ({at})", asset.display()))),
    }
}
