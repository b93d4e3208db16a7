//! The error that the film estimates is the true one.

use croupier::Settings;
use croupier::unstable::Sampler;
use croupier::unstable::film::{PixelStats, REL_MSE_EPSILON};
use croupier_tests::runner::{Image, Schedule, render, scheduled, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::normal_tail;

/// A grey wall under a white environment: every pixel's mean is exactly 0.5, and multiple importance sampling makes it
/// noisy.
fn grey_wall(size: [u32; 2]) -> Vec<u8> {
    let mut s = in_white_environment(camera([0.0, 0.0, 10.0], [0.0; 3], 1.0, size));
    let wall = s.add_material("wall", grey(0.5));
    add_quad(&mut s, "wall", wall, facing_z(1.0, 0.0, 1.0));
    blob(&s).to_vec()
}

fn seeds(scene: &[u8], strategy: &str, iterations: &[u32], n: u64) -> Vec<Image> {
    let base = settings(scene, strategy);
    let run = |seed| scheduled(scene, &Settings { seed, ..base }, iterations, Schedule::InOrder(1 << 20));
    (0..n).map(run).collect()
}

/// Scores (mean - truth) / standard error of many renders, sorted.
fn scores(images: &[Image]) -> Vec<f64> {
    let score = |p: &PixelStats| (p.mean()[1] - 0.5) / p.variance_of_mean()[1].sqrt();
    let mut z: Vec<f64> = images.iter().flat_map(|i| i.pixels.iter().map(score)).collect();
    z.sort_by(f64::total_cmp);
    z
}

/// Scores over 200 seeds are standard normal: Kolmogorov and Smirnov's test at 1e-6. With 12 800 scores it finds a
/// standard error that is off by 10 %, or a mean off by 6 % of one. Killed by: a sum of squares of something else than
/// camera samples, samples counted twice, the variance of one sample for that of the mean.
#[test]
fn scores_are_standard_normal() {
    let scene = grey_wall([8, 8]);
    for iterations in [&[128][..], &[1, 2, 61, 64]] {
        let z = scores(&seeds(&scene, "none", iterations, 200));
        let n = z.len() as f64;
        let distance = |(i, z): (usize, &f64)| {
            let below = 1.0 - normal_tail(*z);
            (below - i as f64 / n).abs().max((below - (i + 1) as f64 / n).abs())
        };
        let d = z.iter().enumerate().map(distance).fold(0.0, f64::max);
        let critical = ((2.0f64 / 1e-6).ln() / (2.0 * n)).sqrt();
        assert!(d < critical, "distance {d}, critical {critical}");
    }
}

/// With roulette and splitting the stated errors are upper bounds: one comb rounds a packet, so that the roundings of
/// its samples cancel, and the film takes the samples as independent. Killed by: a sum of squares per path instead of
/// per camera sample (then splitting states too little).
#[test]
fn errors_with_roulette_are_upper_bounds() {
    let scene = grey_wall([8, 8]);
    for strategy in ["fixed:0.6", "fixed:1.6", "fixed:3", "albedo"] {
        let z = scores(&seeds(&scene, strategy, &[128], 50));
        let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
        assert!((0.3..1.04).contains(&rms), "{strategy}: scores have a spread of {rms}");
    }
}

/// The estimated relMSE is the true one on average, and its 95 % interval holds it about that often; with few samples
/// it errs on the high side (3 % at 16). Killed by: an epsilon that is not in the denominator, a mean over pixels of
/// the wrong count, an interval of one standard error.
#[test]
fn the_error_estimate_is_right_on_average() {
    let scene = grey_wall([16, 16]);
    let actual = |i: &Image| {
        let error = |p: &PixelStats| p.mean().map(|m| (m - 0.5).powi(2)).iter().sum::<f64>() / 3.0;
        i.pixels.iter().map(error).sum::<f64>() / i.pixels.len() as f64 / (0.25 + REL_MSE_EPSILON)
    };
    // 51 200 squared errors: 0.6 % of noise
    for (spp, tolerance, fewest) in [(16, 0.06, 150), (128, 0.03, 175)] {
        let images = seeds(&scene, "none", &[spp], 200);
        let mean = |f: &dyn Fn(&Image) -> f64| images.iter().map(f).sum::<f64>() / images.len() as f64;
        let (truth, estimate) = (mean(&actual), mean(&|i| i.error.rel_mse));
        assert!((estimate / truth - 1.0).abs() < tolerance, "{estimate} estimated at {spp}, {truth} found");
        let holds = images.iter().filter(|i| i.error.low <= truth && truth <= i.error.high).count();
        assert!((fewest..=199).contains(&holds), "{holds} of 200 intervals hold the true error at {spp}");
    }
}

/// A diffuse box with strategies that end and split paths. Where roulette or splitting meets every path, packets' combs
/// make the true error less than the samples' spread says, up to 2.4 times, and so do Sobol' points, up to 4 times: the
/// halves of the samples show how much, after one iteration as after several. The limits were set when the first three
/// rows had run. Killed by: a sum of squares per path instead of per camera sample, a ratio upside down, halves that
/// share a sequence.
#[test]
fn the_error_estimate_is_right_with_roulette_and_sobol_points() {
    let scene = blob(&cornell([16, 16]));
    let growing = [1, 1, 2, 4, 8, 16, 32];
    let mut wrong = Vec::new();
    for (sampler, strategy, max_depth, iterations) in [
        (Sampler::Hashed, "classic", 12, &[256][..]),
        (Sampler::Hashed, "classic", 12, &[64; 4]),
        (Sampler::Hashed, "classic:1", 12, &[64]),
        (Sampler::Hashed, "classic:1", 12, &growing),
        (Sampler::Hashed, "fixed:3.3", 3, &[16]),
        (Sampler::Hashed, "fixed:3.3", 3, &[16; 4]),
        (Sampler::Hashed, "ears", 12, &growing),
        (Sampler::Sobol, "none", 12, &[64]),
        (Sampler::Sobol, "none", 12, &[15, 16]),
        (Sampler::Sobol, "none", 12, &growing),
        (Sampler::Sobol, "classic", 12, &[64; 4]),
        (Sampler::Sobol, "classic:1", 12, &growing),
        (Sampler::Sobol, "ears", 12, &growing),
    ] {
        let base = Settings { max_depth, sampler, ..settings(&scene, strategy) };
        let run = |seed| scheduled(&scene, &Settings { seed, ..base }, iterations, Schedule::InOrder(1 << 20));
        let images: Vec<Image> = (0..100).map(run).collect();
        let truth = rel_mse_of(&images);
        let ratio = images.iter().map(|i| i.error.rel_mse).sum::<f64>() / images.len() as f64 / truth;
        let count = |f: &dyn Fn(&Image) -> bool| images.iter().filter(|i| f(i)).count();
        let (below, held) =
            (count(&|i| i.error.high < truth), count(&|i| i.error.low <= truth && truth <= i.error.high));
        let what = format!(
            "{sampler:?} {strategy} {iterations:?}: {ratio:.3} of the true relMSE; {held} of 100 intervals hold it, \
             {below} are below"
        );
        println!("{what}");
        if !(0.93..=1.07).contains(&ratio) || below > 10 || held < 88 {
            wrong.push(what);
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// The relMSE that independent pictures of one scene have on average, from how they differ.
fn rel_mse_of(images: &[Image]) -> f64 {
    let n = images.len() as f64;
    let pixel = |i: usize, c: usize| {
        let of = |k: &Image| k.pixels[i].mean()[c];
        let mean = images.iter().map(of).sum::<f64>() / n;
        images.iter().map(|k| (of(k) - mean).powi(2)).sum::<f64>() / (n - 1.0) / (mean * mean + REL_MSE_EPSILON)
    };
    let pixels = images[0].pixels.len();
    (0..pixels).map(|i| pixel(i, 0) + pixel(i, 1) + pixel(i, 2)).sum::<f64>() / (3 * pixels) as f64
}

/// Pixels of a picture, and the blocks that it is cut into.
struct Blocks<'a> {
    pixels: &'a [PixelStats],
    size: [usize; 2],
}

impl Blocks<'_> {
    /// Columns, or rows, of the block that `at` of `n` is in.
    fn block(at: usize, n: usize) -> std::ops::Range<usize> {
        let edges = |b: usize| b * n / (n / 16)..(b + 1) * n / (n / 16);
        (0..n / 16).map(edges).find(|range| range.contains(&at)).unwrap()
    }

    /// Indices of pixels.
    fn of(&self, x: std::ops::Range<usize>, y: std::ops::Range<usize>) -> impl Iterator<Item = usize> {
        let w = self.size[0];
        y.flat_map(move |row| x.clone().map(move |column| row * w + column))
    }

    /// Within the picture, what the window around a pixel reaches.
    fn reach(at: usize, n: std::ops::Range<usize>) -> std::ops::Range<usize> {
        at.saturating_sub(2).max(n.start)..(at + 3).min(n.end)
    }

    /// Denominator of a pixel and channel, and what of it the window tells: see `core/src/film/surroundings.rs`.
    fn denominator(&self, i: usize, c: usize) -> [f64; 2] {
        let [w, h] = self.size;
        let [x, y] = [i % w, i / w];
        let others = self.of(Self::block(x, w), Self::block(y, h)).filter(|j| [j % w % 2, j / w % 2] != [x % 2, y % 2]);
        let around = self.of(Self::reach(x, 0..w), Self::reach(y, 0..h)).filter(|j| *j != i);
        // mean, noise, contrast, number
        let told = |of: Vec<usize>| {
            let n = of.len() as f64;
            let over = |f: &dyn Fn(&PixelStats) -> f64| of.iter().map(|j| f(&self.pixels[*j])).sum::<f64>() / n;
            let mean = over(&|p| p.mean()[c]);
            let noise = over(&|p| p.variance_of_mean()[c]);
            (mean, noise, (over(&|p| (p.mean()[c] - mean).powi(2)) - noise).max(0.0), n)
        };
        let (m, v) = (self.pixels[i].mean()[c], self.pixels[i].variance_of_mean()[c]);
        let (block_mean, block_noise, block_contrast, block) = told(others.collect());
        let (window_mean, noise, contrast, window) = told(around.collect());
        let part = |of: f64, rest: f64| if of > 0.0 { of / (of + rest) } else { 0.0 };
        let u = part(block_contrast, block_noise.max(noise) / window);
        let mean = block_mean + u * (window_mean - block_mean);
        let own = if v > 0.0 { v } else { noise };
        let off = (m - mean).powi(2);
        let w = part(contrast, own.max(noise)).max(if off > own { 1.0 - own / off } else { 0.0 });
        let e = mean + w * (m - mean);
        let of_others = u * u * noise / window + (1.0 - u).powi(2) * block_noise / block;
        let square = e * e - 0.9 * w * w * v - (1.0 - w).powi(2) * of_others;
        [square.max(0.0) + REL_MSE_EPSILON, (1.0 - w) * u * u]
    }

    /// Contributions of the pixels to the estimated relMSE, by definition, and how many windows count: see also
    /// `core/src/film/contrast.rs`.
    fn shares(&self) -> (Vec<f64>, usize) {
        let [w, h] = self.size;
        let known: Vec<[[f64; 2]; 3]> = (0..w * h).map(|i| std::array::from_fn(|c| self.denominator(i, c))).collect();
        let mut windows = 0;
        let mut channel = |i: usize, c: usize| {
            let [x, y] = [i % w, i / w];
            let window = self.of(Self::reach(x, Self::block(x, w)), Self::reach(y, Self::block(y, h)));
            let logs: Vec<f64> = window.filter(|j| *j != i).map(|j| known[j][c][0].ln()).collect();
            let [d, left] = known[i][c];
            let rise = left * (d.ln() - logs.iter().sum::<f64>() / logs.len() as f64);
            windows += usize::from(rise.abs() > 0.1);
            self.pixels[i].variance_of_mean()[c] / d * (0.5 * rise.clamp(-1.6, 1.6)).exp()
        };
        let shares = (0..w * h).map(|i| (channel(i, 0) + channel(i, 1) + channel(i, 2)) / 3.0).collect();
        (shares, windows)
    }
}

/// Class of a pixel, by the spread of its samples.
fn class(p: &PixelStats) -> usize {
    let squares = |x: [f64; 3]| x.iter().map(|x| x * x).sum::<f64>();
    let of_samples = p.variance_of_mean().iter().sum::<f64>() * p.samples as f64;
    [1.0, 8.0].iter().filter(|least| of_samples >= **least * squares(p.mean())).count()
}

/// Variances that the halves of pixels show over those that their samples state, by class: one channel of each pixel.
fn ratios(pixels: &[PixelStats]) -> [f64; 3] {
    let mut sums = [[0.0; 2]; 3];
    for (i, p) in pixels.iter().enumerate() {
        let (mean, variance) = (p.mean()[i % 3], p.variance_of_mean()[i % 3]);
        let scale = (mean * mean - 0.9 * variance).max(0.0) + REL_MSE_EPSILON;
        let (n, ahead) = (p.samples as f64, p.ahead);
        let difference = p.difference - ahead * mean;
        let [found, stated] = &mut sums[class(p)];
        *found += difference * difference / (n * n - ahead * ahead) / scale;
        *stated += variance / scale;
    }
    sums.map(|[found, stated]| found / stated)
}

/// The discarded pixels are the worst 0.01 %, and every pixel counts by what window and block say. Killed by: a selection that
/// takes the smallest, or one too many; a block that leaves pixels out or counts them twice, another parity; a window
/// with its own pixel, or that ends at the block; rows of logarithms of another place, a seam that is not one; halves
/// of another channel.
#[test]
fn the_worst_pixels_are_left_out() {
    let size = [200, 151];
    let scene = blob(&cornell(size));
    let image = render(&scene, &Settings { max_depth: 3, ..settings(&scene, "none") }, 5);
    let blocks = Blocks { pixels: &image.pixels, size: size.map(|n| n as usize) };
    let (shares, windows) = blocks.shares();
    let ratios = ratios(&image.pixels);
    let mut errors: Vec<f64> = shares.iter().zip(&image.pixels).map(|(x, p)| x * ratios[class(p)]).collect();
    assert!(windows > 300, "{windows}");
    errors.sort_by(f64::total_cmp);
    let kept = &errors[..errors.len() - errors.len() / 10_000];
    assert_eq!(errors.len() - kept.len(), 3);
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    // a pixel's error and its logarithms are of f32
    let close = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-6;
    assert!(close(image.error.rel_mse, mean(kept)), "{} for {}", image.error.rel_mse, mean(kept));
    assert!(close(image.error.rel_mse_all, mean(&errors)));
    assert!(image.error.rel_mse < image.error.rel_mse_all);
    assert!(image.error.low < image.error.rel_mse && image.error.rel_mse < image.error.high);
    let squares = kept.iter().map(|x| x * x).sum::<f64>();
    assert!(close(image.error.effective_pixels, kept.iter().sum::<f64>().powi(2) / squares));
}

/// One sample has no measurable variance: its square is used. Killed by: a division by
/// `n - 1 = 0`.
#[test]
fn one_sample_claims_nothing() {
    let scene = grey_wall([4, 4]);
    let image = render(&scene, &settings(&scene, "none"), 1);
    for p in &image.pixels {
        let (m, v) = (p.mean(), p.variance_of_mean());
        assert!((0..3).all(|c| v[c] == m[c] * m[c]), "{m:?} {v:?}");
    }
    assert!(image.error.rel_mse.is_finite());
    let empty = scheduled(&scene, &settings(&scene, "none"), &[0], Schedule::InOrder(100));
    assert!(empty.pixels.iter().all(|p| p.samples == 0 && p.mean() == [0.0; 3] && p.variance_of_mean() == [0.0; 3]));
}
