//! Bytes of files: regular ones, up to a stated size, of the kind that is asked for; and files near the one that is
//! named.

use crate::text;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};

/// Most bytes of a file that is read as a whole: 4 GiB. Larger ones are refused, also those that grow while they are
/// read.
pub const MAX_FILE_BYTES: u64 = 4 << 30;

/// Reads a regular file of up to [`MAX_FILE_BYTES`]. Folders, devices, pipes and sockets are refused before a byte is
/// read: they may be endless, or wait for ever.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    // Opening a pipe waits for its other end: look first.
    let found = fs::metadata(path)?;
    if !found.is_file() {
        let what = if found.is_dir() { "it is a folder" } else { "it is not a regular file" };
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    read_up_to(File::open(path)?, found.len(), MAX_FILE_BYTES)
}

/// Reads all of `file`, whose length is said to be `length`, unless it has more than `most` bytes.
fn read_up_to(file: impl Read, length: u64, most: u64) -> io::Result<Vec<u8>> {
    let too_long = |n: u64| {
        let limit = text::bytes(most);
        io::Error::new(io::ErrorKind::FileTooLarge, format!("{} or more, the limit is {limit}", text::bytes(n)))
    };
    if length > most {
        return Err(too_long(length));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(usize::try_from(length).map_err(|_| too_long(length))?)?;
    let mut limited = file.take(most.saturating_add(1));
    // Not read_to_end, which ends the program where there is no memory for more.
    let mut chunk = vec![0; 1 << 16];
    loop {
        let n = match limited.read(&mut chunk) {
            Ok(0) => return Ok(bytes),
            Ok(n) => n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Err(e),
        };
        if bytes.len() as u64 + n as u64 > most {
            return Err(too_long(bytes.len() as u64 + n as u64));
        }
        bytes.try_reserve(n)?;
        bytes.extend_from_slice(chunk.get(..n).unwrap_or_default());
    }
}

/// First bytes of kinds of files that are no text.
const MAGIC: &[(&[u8], &str)] = &[
    (b"\x89PNG\r\n\x1a\n", "a PNG image"),
    (&[0xff, 0xd8, 0xff], "a JPEG image"),
    (b"v/1\x01", "an EXR image"),
    (b"#?RADIANCE", "a Radiance HDR image"),
    (b"#?RGBE", "a Radiance HDR image"),
    (b"GIF8", "a GIF image"),
    (b"CROUPIER", "a baked scene"),
    (b"CRPCACHE", "saved statistics of a scene"),
    (b"glTF", "a binary glTF scene"),
    (b"PK\x03\x04", "a ZIP archive"),
    (b"\x1f\x8b", "a gzip archive"),
    (b"Kaydara FBX Binary", "an FBX scene"),
    (b"BLENDER", "a Blender file"),
    (b"%PDF", "a PDF document"),
    (b"\x7fELF", "a program"),
    (&[0xff, 0xfe], "UTF-16 text (save it as UTF-8)"),
    (&[0xfe, 0xff], "UTF-16 text (save it as UTF-8)"),
];

/// Byte order mark of UTF-8.
const BOM: &[u8] = "\u{feff}".as_bytes();

/// The text in `bytes`, without a byte order mark. Bytes that are not UTF-8 (comments of old exporters) become
/// replacement characters. What is no text is refused, in words: images, archives, UTF-16, anything with a zero byte.
pub(super) fn text(mut bytes: Vec<u8>) -> Result<String, String> {
    if let Some((_, what)) = MAGIC.iter().find(|(magic, _)| bytes.starts_with(magic)) {
        return Err(format!("it is {what}"));
    }
    if let Some(at) = bytes.iter().position(|b| *b == 0) {
        let zeros = |start: usize| bytes.iter().skip(start).step_by(2).take(512).filter(|b| **b == 0).count();
        let wide = bytes.len() >= 4 && zeros(0).max(zeros(1)) * 4 > bytes.len().min(1024);
        let what = if wide { "it is UTF-16 text (save it as UTF-8)" } else { "it is no text" };
        return Err(format!("{what}: byte {at} is 0"));
    }
    if bytes.starts_with(BOM) {
        bytes.drain(..BOM.len());
    }
    Ok(String::from_utf8(bytes).unwrap_or_else(|e| String::from_utf8_lossy(e.as_bytes()).into_owned()))
}

/// The file that is meant by `path`, which is not there: one whose folders and name differ only in case, else one of its
/// name, in any case, in the folder `beside`. Of several the first in the order of their names.
pub(super) fn nearest(path: &Path, beside: &Path) -> Option<PathBuf> {
    in_any_case(path).or_else(|| in_any_case(&beside.join(path.file_name()?))).filter(|found| found.is_file())
}

/// The path as it is on disk, if it is there but for upper and lower case.
fn in_any_case(path: &Path) -> Option<PathBuf> {
    let mut found = PathBuf::new();
    for part in path.components() {
        let next = found.join(part);
        let there = !matches!(part, Component::Normal(_)) || fs::symlink_metadata(&next).is_ok();
        found = if there { next } else { entry(&found, part.as_os_str())? };
    }
    Some(found)
}

fn entry(folder: &Path, name: &OsStr) -> Option<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let wanted = name.to_string_lossy().to_lowercase();
    let alike = |e: io::Result<fs::DirEntry>| {
        let name = e.ok()?.file_name();
        (name.to_string_lossy().to_lowercase() == wanted).then_some(name)
    };
    let name = fs::read_dir(folder).ok()?.filter_map(alike).min()?;
    Some(if folder == Path::new(".") { name.into() } else { folder.join(name) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a limit that is off by one, one that is believed from the stated length.
    #[test]
    fn endless_files_end() {
        assert_eq!(read_up_to(&[7u8; 100][..], 0, 100).unwrap(), [7; 100]);
        assert!(read_up_to(&[7u8; 101][..], 0, 100).unwrap_err().to_string().contains("the limit is 100 bytes"));
        assert!(read_up_to(&[7u8; 1][..], 101, 100).unwrap_err().to_string().contains("101 bytes or more"));
        assert!(read_up_to(io::repeat(1), 0, 1 << 20).unwrap_err().to_string().contains("the limit is 1.00 MiB"));
        assert!(read_up_to(&[0u8][..], u64::MAX, u64::MAX).is_err());
    }

    /// Killed by: a comment in Latin-1 that is taken for binary data, a byte order mark that stays.
    #[test]
    fn texts_are_told_from_other_files() {
        assert_eq!(text(b"\xef\xbb\xbfv 0 0 0".to_vec()).unwrap(), "v 0 0 0");
        assert_eq!(text(b"# caf\xe9\n".to_vec()).unwrap(), "# caf\u{fffd}\n");
        let wide: Vec<u8> = "v 0 0 0\nf 1 2 3\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        assert!(text(wide.clone()).unwrap_err().contains("UTF-16"));
        assert!(text([&[0xff, 0xfe], &wide[..]].concat()).unwrap_err().contains("UTF-16"));
        assert!(text(b"\x89PNG\r\n\x1a\nxyz".to_vec()).unwrap_err().contains("PNG"));
        assert_eq!(text(b"v 0 0 0\nv 1 \0 0".to_vec()).unwrap_err(), "it is no text: byte 12 is 0");
        assert_eq!(text(Vec::new()).unwrap(), "");
    }

    /// Killed by: only the last part of the path in any case, a folder that is taken for the file.
    #[test]
    fn files_of_another_case_are_found() {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir_all(dir.path().join("Textures/wood.png")).unwrap();
        fs::write(dir.path().join("Textures/Oak.PNG"), "").unwrap();
        fs::write(dir.path().join("ash.png"), "").unwrap();
        let near = |name: &str| nearest(&dir.path().join(name), dir.path());
        assert_eq!(near("textures/oak.png"), Some(dir.path().join("Textures/Oak.PNG")));
        assert_eq!(near("elsewhere/deep/ASH.png"), Some(dir.path().join("ash.png")));
        assert_eq!((near("TEXTURES/WOOD.png"), near("birch.png"), near("")), (None, None, None));
    }
}
