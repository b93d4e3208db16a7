//! `croupier compare`

use super::console::{Outcome, say, say_json};
use super::values::stops;
use croupier_host::compare::{Bias, CompareOptions, Comparison, ImageMean, Inputs, compare};
use croupier_host::image::{ImageError, Picture, Rgb};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// EXR image
    image: PathBuf,
    /// EXR reference of the same size
    reference: PathBuf,
    /// Another image that differs from IMAGE in its seed only; may be repeated, standard errors come from their spread
    #[arg(long = "seed-image", value_name = "FILE")]
    seed_images: Vec<PathBuf>,
    /// Standard error of IMAGE per pixel; its own layer `stderr` if absent
    #[arg(long, value_name = "FILE", conflicts_with = "seed_images")]
    stderr_image: Option<PathBuf>,
    /// Standard error of REFERENCE per pixel; its own layer `stderr`, or the file NAME_stderr.exr beside it, if absent
    #[arg(long, value_name = "FILE")]
    stderr_reference: Option<PathBuf>,
    /// Keep the worst 0.01 % of the pixels in relMSE
    #[arg(long)]
    keep_outliers: bool,
    /// Exposure of FLIP in stops, -100 to 100
    #[arg(long, value_name = "STOPS", default_value_t = 0.0, value_parser = stops, allow_negative_numbers = true)]
    exposure: f32,
    /// Print the figures as one line of JSON
    #[arg(long)]
    json: bool,
}

/// Most blocks beyond 6 that the text output lists; JSON has them all.
const LISTED: usize = 10;

/// Runs the command.
pub(crate) fn run(args: &Args) -> Outcome {
    let (image, image_stderr) = read(&args.image, args.stderr_image.as_deref())?;
    let (reference, mut reference_stderr) = read(&args.reference, args.stderr_reference.as_deref())?;
    if reference_stderr.is_none() {
        let beside = beside(&args.reference);
        if beside.is_file() {
            reference_stderr = Some(Rgb::read_exr(&beside)?);
        }
    }
    let mut images = vec![image];
    for path in &args.seed_images {
        images.push(Rgb::read_exr(path)?);
    }
    let inputs = Inputs {
        images: &images,
        stderr: image_stderr.as_ref(),
        reference: &reference,
        reference_stderr: reference_stderr.as_ref(),
    };
    let options =
        CompareOptions { keep_outliers: args.keep_outliers, exposure: args.exposure, ..CompareOptions::default() };
    let name = |e| format!("{} and {}: {e}", args.image.display(), args.reference.display());
    let found = compare(&inputs, &options).map_err(name)?;
    if args.json { say_json(&found) } else { print(&found, reference_stderr.is_some()) }
}

/// Picture of a file and its standard error: from `stderr`, else from a layer of that name in the same file.
fn read(path: &Path, stderr: Option<&Path>) -> Result<(Rgb, Option<Rgb>), ImageError> {
    let picture = Picture::read_exr(path)?;
    let main = picture.main().ok_or_else(|| ImageError::NoRgb(path.into()))?;
    let stderr = stderr.map(Rgb::read_exr).transpose()?;
    Ok((main, stderr.or_else(|| picture.rgb("stderr"))))
}

/// `a/reference.exr` -> `a/reference_stderr.exr`
fn beside(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_stderr.exr"))
}

fn print(c: &Comparison, noisy_reference: bool) -> Outcome {
    let line = |name: &str, text: String| say(&format!("{name:16}{text}"));
    let noise = c.relmse_of_reference.map_or(String::new(), |n| format!("; noise of the reference adds {n:.4e}"));
    line("relMSE", format!("{:.6e} ({} worst pixels left out{noise})", c.relmse, c.relmse_discarded_pixels))?;
    line("MSE", format!("{:.6e}", c.mse))?;
    line("FLIP", format!("{:.6}", c.flip))?;
    line("mean", mean(&c.image_mean))?;
    line("mean reference", mean(&c.reference_mean))?;
    let spread = c.ratio.stderr.map_or(String::new(), |s| format!(" +- {s:.6}"));
    line("ratio", format!("{:.6}{spread}", c.ratio.value))?;
    if c.nonfinite_pixels > 0 {
        line("not finite", format!("{} pixels", c.nonfinite_pixels))?;
    }
    let (Some(plain), Some(robust)) = (&c.bias, &c.bias_robust) else {
        return line("bias", "unknown: the image has no standard error".into());
    };
    if !noisy_reference {
        line("note", "the reference has no standard error and is taken as exact".into())?;
    }
    line("z of blocks", scores(plain))?;
    line("firefly-robust", scores(robust))?;
    for b in robust.beyond6.iter().take(LISTED) {
        let channel = ["R", "G", "B"].get(b.channel).unwrap_or(&"?");
        let text = format!("({}, {}) {channel}: z {:.2}, {:.5} for {:.5}", b.x, b.y, b.z, b.image, b.reference);
        line("  beyond 6", text)?;
    }
    match robust.beyond6.len() {
        n if n > LISTED => line("", format!("... and {} more", n - LISTED)),
        _ => Ok(()),
    }
}

fn mean(m: &ImageMean) -> String {
    let [r, g, b] = m.mean;
    let spread = m.stderr.map_or(String::new(), |[r, g, b]| format!(" +- {r:.2e} {g:.2e} {b:.2e}"));
    format!("{r:.6} {g:.6} {b:.6}{spread}")
}

fn scores(b: &Bias) -> String {
    format!(
        "mean {:+.3}, rms {:.3}, {:.2} % beyond 3 (of {}), largest {:.2}, {} beyond 6",
        b.mean,
        b.rms,
        100.0 * b.beyond3,
        b.scores,
        b.max,
        b.beyond6.len()
    )
}
