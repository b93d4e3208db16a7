//! Errors of loading.

use crate::look::LookError;
use std::path::{Path, PathBuf};
use std::{error, fmt, io};

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

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Read { path, referrer: None, source } => write!(f, "cannot read {}: {source}", path.display()),
            Self::Read { path, referrer: Some(by), source } => {
                write!(f, "cannot read {}, which {by} names: {source}", path.display())
            }
            Self::Unknown { path } => {
                write!(f, "{} is neither a folder with a scene.json nor an .obj file", path.display())
            }
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
