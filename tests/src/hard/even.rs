//! The mean of very many equal samples (NUMERICS FLM-1, STA-2): an even sky in one pixel.

use super::Found;
use crate::runner::{Schedule, scheduled, settings};
use crate::scenes::{blob, camera, in_white_environment};
use croupier_host::description::Environment;

/// Radiance that no sum of few bits holds.
const RADIANCE: [f32; 3] = [0.1, 1.0 / 3.0, 1e6 / 7.0];

/// Renders one pixel with `samples` samples in each of `iterations`. A failure is a mean off by more than n 2^-53 after
/// n additions, a standard error above 1e-9 of it, or a count that is not n. The figure is the relative error of the
/// mean.
pub fn sky(seed: u64, samples: u32, iterations: usize) -> Found {
    let mut scene = in_white_environment(camera([0.0; 3], [0.0, 0.0, -1.0], 40.0, [1, 1]));
    scene.environment = Some(Environment::Constant { radiance: RADIANCE });
    let blob = blob(&scene);
    let settings = croupier::Settings { seed, shards: 1, ..settings(&blob, "none") };
    let image = scheduled(&blob, &settings, &vec![samples; iterations], Schedule::InOrder(1 << 40));
    let n = u64::from(samples) * iterations as u64;
    let pixel = &image.pixels[0];
    let mut found = Found { cases: n, ..Found::default() };
    let counted = [pixel.samples, image.counters.camera_samples];
    found.fail(u64::from(counted != [n; 2]), || format!("{counted:?} samples in place of {n}"));
    for ((mean, variance), want) in pixel.mean().into_iter().zip(pixel.variance_of_mean()).zip(RADIANCE) {
        let want = f64::from(want);
        let error = (mean / want - 1.0).abs();
        found.figure(error);
        let ok = error <= n as f64 * 2f64.powi(-53) && variance.sqrt() <= 1e-9 * want;
        found.fail(u64::from(!ok), || format!("mean {mean} +- {:e} in place of {want}", variance.sqrt()));
    }
    found
}
