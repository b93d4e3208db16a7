//! Errors of loading.

use crate::look::LookError;
use std::path::{Path, PathBuf};
use std::{error, fmt, io};

/// Files that scenes come in.
const KINDS: &str = ".gltf, .glb, .obj, .ply, .stl";

/// Error in the files of a scene; every text names the file, and where in it.
#[derive(Debug)]
#[non_exhaustive]
pub enum LoadError {
    /// A file cannot be read.
    Read {
        /// File.
        path: PathBuf,
        /// Place that names it: file and line, or file and value.
        referrer: Option<String>,
        /// Reason given by the operating system.
        source: io::Error,
    },
    /// Neither a folder nor a file that scenes come in.
    Unknown {
        /// File.
        path: PathBuf,
    },
    /// A whole file.
    File {
        /// File.
        path: PathBuf,
        /// Fault, in words.
        what: String,
    },
    /// A place in a binary file.
    Binary {
        /// File.
        path: PathBuf,
        /// Bytes before the place.
        offset: u64,
        /// Fault, in words.
        what: String,
    },
    /// A line of a text file.
    Line {
        /// File.
        path: PathBuf,
        /// Line, from 1.
        line: u32,
        /// Fault, in words.
        what: String,
    },
    /// A value of a JSON file, or its syntax.
    Json {
        /// File.
        path: PathBuf,
        /// Path of the value, such as `materials.Glass.int_ior`; of a syntax error line and column.
        at: String,
        /// Fault, in words.
        what: String,
    },
    /// An image that cannot be decoded.
    Image {
        /// File.
        path: PathBuf,
        /// Place that names it: file and line, or file and value.
        referrer: String,
        /// Fault, in words.
        what: String,
    },
    /// A request that the scene cannot follow.
    Look {
        /// Scene.
        path: PathBuf,
        /// Fault.
        source: LookError,
    },
    /// Densities that do not fill their grid, or out of range.
    Grid {
        /// File.
        path: PathBuf,
        /// Place that names it: file and value.
        referrer: String,
        /// Fault, in words.
        what: String,
    },
}

impl LoadError {
    pub(super) fn line(path: &Path, line: u32, what: impl Into<String>) -> Self {
        Self::Line { path: path.into(), line, what: what.into() }
    }

    pub(super) fn file(path: &Path, what: impl Into<String>) -> Self {
        Self::File { path: path.into(), what: what.into() }
    }

    pub(super) fn binary(path: &Path, offset: u64, what: impl Into<String>) -> Self {
        Self::Binary { path: path.into(), offset, what: what.into() }
    }

    /// A value of a JSON file, by its path in the document.
    pub(super) fn json(path: &Path, at: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Json { path: path.into(), at: at.into(), what: what.into() }
    }

    pub(super) fn image(path: &Path, referrer: &str, what: String) -> Self {
        Self::Image { path: path.into(), referrer: referrer.into(), what }
    }

    pub(super) fn grid(path: &Path, referrer: &str, what: String) -> Self {
        Self::Grid { path: path.into(), referrer: referrer.into(), what }
    }

    /// The same error of a named object, where only the value's path says which.
    pub(super) fn within(self, object: &str) -> Self {
        let named = |what| format!("{object}: {what}");
        match self {
            Self::Json { path, at, what } => Self::Json { path, at, what: named(what) },
            Self::Grid { path, referrer, what } => Self::Grid { path, referrer, what: named(what) },
            other => other,
        }
    }
}

/// Text of a file for a message: in quotes, cut after 60 characters, without control characters.
pub(super) fn quoted(text: &str) -> String {
    let shown = text.chars().take(60).map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c });
    let more = if text.chars().nth(60).is_some() { "..." } else { "" };
    format!("`{}{more}`", shown.collect::<String>())
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read { path, referrer: None, source } => write!(f, "cannot read {}: {source}", path.display()),
            Self::Read { path, referrer: Some(by), source } => {
                write!(f, "cannot read {}, which {by} names: {source}", path.display())
            }
            Self::Unknown { path } => {
                write!(
                    f,
                    "{} is neither a folder with a scene.json nor a file of a known kind ({KINDS})",
                    path.display()
                )
            }
            Self::File { path, what } => write!(f, "{}: {what}", path.display()),
            Self::Binary { path, offset, what } => write!(f, "{}: byte {offset}: {what}", path.display()),
            Self::Look { path, source } => write!(f, "{}: {source}", path.display()),
            Self::Line { path, line, what } => write!(f, "{}:{line}: {what}", path.display()),
            Self::Json { path, at, what } => write!(f, "{}: {at}: {what}", path.display()),
            Self::Image { path, referrer, what } => {
                write!(f, "cannot use the image {}, which {referrer} names: {what}", path.display())
            }
            Self::Grid { path, referrer, what } => {
                write!(f, "cannot use the densities {}, which {referrer} names: {what}", path.display())
            }
        }
    }
}

impl error::Error for LoadError {
    fn source(&self) -> Option<&(dyn error::Error + 'static)> {
        match self {
            Self::Read { source, .. } => Some(source),
            _ => None,
        }
    }
}
