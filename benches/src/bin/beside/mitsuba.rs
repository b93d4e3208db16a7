//! Mitsuba 3 in a process of its own: `benches/mitsuba/render.py`, which says how it is talked to.

use croupier_host::image::Rgb;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::json;
use std::error::Error;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Its samplers.
pub(crate) const SAMPLERS: [&str; 2] = ["independent", "multijitter"];

const SCRIPT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/mitsuba/render.py");

/// The process, with a scene loaded.
pub(crate) struct Mitsuba {
    child: Child,
    /// `None` once it has been told to end.
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    size: [usize; 2],
    /// Version, variant and threads.
    pub(crate) about: String,
}

/// A finished render.
pub(crate) struct Rendered {
    pub(crate) picture: Rgb,
    /// Per pixel.
    pub(crate) samples: f64,
    pub(crate) core_seconds: f64,
    /// Values of passes that were not finite, and counted as 0.
    pub(crate) not_finite: u64,
}

#[derive(Deserialize)]
struct Ready {
    mitsuba: String,
    variant: String,
    threads: u32,
    size: [usize; 2],
}

#[derive(Deserialize)]
struct Answer {
    samples: u32,
    core_seconds: f64,
    not_finite: u64,
    picture: PathBuf,
}

#[derive(Deserialize)]
struct Fault {
    error: String,
}

impl Mitsuba {
    /// Starts it and loads a scene, which needs a while.
    pub(crate) fn start(python: &Path, scene: &Path) -> Result<Self, Box<dyn Error>> {
        let mut command = Command::new(python);
        command.arg(SCRIPT).arg(scene).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command
            .spawn()
            .map_err(|e| format!("{}: {e}; `--python` names a Python that has Mitsuba 3", python.display()))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let output = BufReader::new(output.ok_or("Mitsuba's process has no output")?);
        let mut mitsuba = Self { child, input, output, size: [0; 2], about: String::new() };
        let ready: Ready = mitsuba.answer()?;
        let threads = if ready.threads == 1 { "one thread".into() } else { format!("{} threads", ready.threads) };
        mitsuba.about = format!("{}, {}, {threads}", ready.mitsuba, ready.variant);
        mitsuba.size = ready.size;
        Ok(mitsuba)
    }

    /// Renders with a sampler for a number of core-seconds; before its first time also compiles.
    pub(crate) fn render(&mut self, sampler: &str, seed: u64, seconds: f64) -> Result<Rendered, Box<dyn Error>> {
        let request = json!({ "sampler": sampler, "seconds": seconds, "seed": seed });
        let sent = self.input.as_mut().map(|input| writeln!(input, "{request}").and_then(|()| input.flush()));
        if !matches!(sent, Some(Ok(()))) {
            return Err(self.ended());
        }
        let answer: Answer = self.answer()?;
        if answer.samples == 0 || !(answer.core_seconds > 0.0 && answer.core_seconds.is_finite()) {
            return Err(format!("Mitsuba took {} samples in {} s", answer.samples, answer.core_seconds).into());
        }
        Ok(Rendered {
            picture: self.picture(&answer.picture)?,
            samples: answer.samples.into(),
            core_seconds: answer.core_seconds,
            not_finite: answer.not_finite,
        })
    }

    fn picture(&self, path: &Path) -> Result<Rgb, Box<dyn Error>> {
        let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
        let values: Vec<f32> = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
        let (pixels, [width, height]) = (values.as_chunks().0.to_vec(), self.size);
        let whole = bytes.len() == 12 * width * height;
        let picture = if whole { Rgb::new(width, height, pixels) } else { None };
        picture
            .ok_or_else(|| format!("Mitsuba's picture has {} bytes, not {width} x {height} pixels", bytes.len()).into())
    }

    fn answer<T: DeserializeOwned>(&mut self) -> Result<T, Box<dyn Error>> {
        let mut line = String::new();
        if !matches!(self.output.read_line(&mut line), Ok(1..)) {
            return Err(self.ended());
        }
        if let Ok(Fault { error }) = serde_json::from_str(&line) {
            return Err(format!("Mitsuba: {error}").into());
        }
        serde_json::from_str(&line).map_err(|e| format!("Mitsuba's answer '{}': {e}", line.trim_end()).into())
    }

    /// Why there is no answer.
    fn ended(&mut self) -> Box<dyn Error> {
        // it may still run, with its output closed
        self.input = None;
        let status = self.child.wait().map_or_else(|e| e.to_string(), |status| status.to_string());
        format!("Mitsuba's process ended without an answer ({status}); what it said is above").into()
    }
}

/// At the end of its input the process ends and removes its files; to kill it would leave them.
impl Drop for Mitsuba {
    fn drop(&mut self) {
        self.input = None;
        // there is nobody to tell
        let _ = self.child.wait();
    }
}
