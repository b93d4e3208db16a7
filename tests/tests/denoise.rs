//! The denoiser: what it must keep, what it must remove, and input that must not harm it.

use croupier::unstable::denoise::{DenoiseError, Noisy, Part, Planes, denoise, scratch_len};
use croupier::unstable::film::{PixelAov, PixelStats};
use croupier_tests::stats::SplitMix;

/// A mean of `n` exponentially distributed samples of mean 1, and its estimated variance: few samples carry much.
fn estimate(random: &mut SplitMix, n: usize) -> (f64, f64) {
    let samples: Vec<f64> = (0..n).map(|_| -(1.0 - random.f64()).ln()).collect();
    let mean = samples.iter().sum::<f64>() / n as f64;
    let square = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    (mean, square / (n * (n - 1)) as f64)
}

type Rgb = [f32; 3];

/// A picture to denoise, pixel by pixel.
#[derive(Clone)]
struct Picture {
    size: [u32; 2],
    color: Vec<Rgb>,
    variance: Vec<Rgb>,
    albedo: Vec<Rgb>,
    normal: Vec<Rgb>,
}

impl Picture {
    /// Exact pixels without features.
    fn exact(size: [u32; 2], color: impl Fn(usize, usize) -> Rgb) -> Self {
        let [w, h] = size.map(|n| n as usize);
        let color: Vec<Rgb> = (0..w * h).map(|i| color(i % w, i / w)).collect();
        Self { size, variance: vec![[0.0; 3]; color.len()], color, albedo: vec![], normal: vec![] }
    }

    /// The same picture as `n` samples per pixel would show it, all channels alike.
    fn noisy(mut self, n: usize, seed: u64) -> Self {
        let mut random = SplitMix(seed);
        for (color, variance) in self.color.iter_mut().zip(&mut self.variance) {
            let (mean, square) = estimate(&mut random, n);
            *variance = color.map(|x| (f64::from(x).powi(2) * square) as f32);
            *color = color.map(|x| (f64::from(x) * mean) as f32);
        }
        self
    }

    fn denoised(&self) -> Vec<Rgb> {
        let plane = |p: &[Rgb]| -> [Vec<f32>; 3] { [0, 1, 2].map(|c| p.iter().map(|p| p[c]).collect()) };
        let (color, variance) = (plane(&self.color), plane(&self.variance));
        let (albedo, normal) = (plane(&self.albedo), plane(&self.normal));
        fn shared(p: &[Vec<f32>; 3]) -> [&[f32]; 3] {
            p.each_ref().map(|p| p.as_slice())
        }
        let noisy = Noisy {
            size: self.size,
            color: shared(&color),
            variance: shared(&variance),
            albedo: shared(&albedo),
            normal: shared(&normal),
        };
        // Whatever the memory holds before must not matter.
        let mut scratch = vec![f32::NAN; scratch_len(self.size)];
        let mut out = [(); 3].map(|()| vec![f32::NAN; self.color.len()]);
        denoise(&noisy, &mut scratch, out.each_mut().map(|p| p.as_mut_slice())).unwrap();
        (0..self.color.len()).map(|i| [out[0][i], out[1][i], out[2][i]]).collect()
    }
}

fn mean(pixels: &[Rgb]) -> f64 {
    pixels.as_flattened().iter().map(|&x| f64::from(x)).sum::<f64>() / (3 * pixels.len()) as f64
}

fn mse(a: &[Rgb], b: &[Rgb]) -> f64 {
    let square = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).powi(2);
    a.as_flattened().iter().zip(b.as_flattened()).map(square).sum::<f64>() / (3 * a.len()) as f64
}

/// Killed by: the variance not filtered from level to level, the correction of the mean left out, a margin that takes
/// part.
#[test]
fn noise_goes_and_the_mean_stays() {
    for (n, seed) in [(4, 1), (4, 2), (16, 3)] {
        let truth = Picture::exact([125, 90], |_, _| [0.5, 0.25, 2.0]);
        let noisy = truth.clone().noisy(n, seed);
        let out = noisy.denoised();
        let gain = mse(&noisy.color, &truth.color) / mse(&out, &truth.color);
        assert!(gain > 15.0, "{n} samples: error only {gain} times smaller");
        let ratio = mean(&out) / mean(&noisy.color);
        assert!((ratio - 1.0).abs() < 1e-4, "{n} samples: mean changed by a factor {ratio}");
    }
}

/// Without an albedo or a normal to tell: the errors alone keep the edge. Killed by: the distance of the colors left
/// out of the weight.
#[test]
fn an_edge_that_noise_does_not_explain_stays() {
    let truth = Picture::exact([64, 48], |x, _| if x < 31 { [0.1; 3] } else { [1.0; 3] });
    let noisy = truth.clone().noisy(64, 5);
    let out = noisy.denoised();
    for (i, pixel) in out.iter().enumerate() {
        // The rest of the noise is allowed, mixing the two sides is not.
        let (x, low) = (i % 64, i % 64 < 31);
        assert!(if low { pixel[0] < 0.3 } else { pixel[0] > 0.6 }, "column {x}: {}", pixel[0]);
    }
    assert!(mse(&noisy.color, &truth.color) > 5.0 * mse(&out, &truth.color));
}

/// Stripes as wide as a pixel under even light. Killed by: not dividing by the albedo, not multiplying.
#[test]
fn texture_comes_back_from_the_albedo() {
    let paint = |x: usize, y: usize| if (x + y).is_multiple_of(2) { [0.4, 0.3, 0.8] } else { [0.5, 0.3, 0.6] };
    let mut truth = Picture::exact([80, 40], |x, y| paint(x, y).map(|a| 1.5 * a));
    truth.albedo = (0..80 * 40).map(|i| paint(i % 80, i / 80)).collect();
    truth.normal = vec![[0.0, 0.0, 1.0]; 80 * 40];
    let noisy = truth.clone().noisy(4, 7);
    let out = noisy.denoised();
    let gain = mse(&noisy.color, &truth.color) / mse(&out, &truth.color);
    assert!(gain > 15.0, "error only {gain} times smaller");
    let stripes: f64 = (0..out.len()).map(|i| f64::from(out[i][2] - out[i][1])).sum::<f64>() / out.len() as f64;
    assert!((stripes / 0.6 - 1.0).abs() < 0.1, "contrast {stripes}");
}

/// Two walls under unlike light that differ in nothing but their normal. Killed by: the normal left out of the weight.
#[test]
fn normals_separate() {
    let mut truth = Picture::exact([64, 64], |x, _| if x < 32 { [0.3; 3] } else { [0.45; 3] });
    truth.normal = (0..64 * 64).map(|i| if i % 64 < 32 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] }).collect();
    truth.albedo = vec![[0.5; 3]; 64 * 64];
    let out = truth.clone().noisy(4, 9).denoised();
    let column = |x: usize| (0..64).map(|y| f64::from(out[y * 64 + x][0])).sum::<f64>() / 64.0;
    assert!(column(31) < 0.31 && column(32) > 0.42, "{} {}", column(31), column(32));
}

/// Killed by: a variance that is never 0, a correction that exact pixels take part in, averaging without the test.
#[test]
fn a_picture_without_noise_comes_back() {
    let mut random = SplitMix(11);
    let values: Vec<Rgb> = (0..33 * 21).map(|_| [(); 3].map(|()| (8.0 * random.f64()) as f32)).collect();
    let mut picture = Picture::exact([33, 21], |x, y| values[y * 33 + x]);
    for features in [false, true] {
        if features {
            picture.albedo = values.iter().map(|v| v.map(|x| x / 8.0)).collect();
            picture.normal = vec![[0.0, 1.0, 0.0]; values.len()];
        }
        for (a, b) in picture.denoised().as_flattened().iter().zip(values.as_flattened()) {
            assert!((a - b).abs() <= 1e-6 * b.abs().max(1.0), "{a} instead of {b}");
        }
    }
}

/// An exact emitter in a noisy wall: it neither bleeds nor takes part in the correction of the mean; the wall's noise
/// reaches its rim only. Killed by: the weight `noisy` of the correction set to 1.
#[test]
fn an_emitter_keeps_its_value() {
    let emitter = |x: usize, y: usize| (30..40).contains(&x) && (10..20).contains(&y);
    let truth = Picture::exact([70, 50], |x, y| if emitter(x, y) { [50.0; 3] } else { [0.2; 3] });
    let mut noisy = truth.clone().noisy(4, 13);
    let inside = |i: usize| emitter(i % 70, i / 70);
    for i in (0..70 * 50).filter(|&i| inside(i)) {
        (noisy.color[i], noisy.variance[i]) = ([50.0; 3], [0.0; 3]);
    }
    for (i, pixel) in noisy.denoised().iter().enumerate() {
        if inside(i) {
            let rim = !((31..39).contains(&(i % 70)) && (11..19).contains(&(i / 70)));
            assert!((pixel[0] - 50.0).abs() < if rim { 5e-2 } else { 5e-5 }, "{}", pixel[0]);
        } else {
            assert!(pixel[0] < 1.0, "the emitter bleeds: {} at {:?}", pixel[0], (i % 70, i / 70));
        }
    }
}

/// One pixel has a sample that all others missed: its energy is distributed over its neighbours, and none is lost.
/// Killed by: a level or the correction of the mean left out, fireflies clamped, its own variance smoothed away.
#[test]
fn a_firefly_is_distributed() {
    let mut noisy = Picture::exact([97, 65], |_, _| [0.1; 3]).noisy(8, 17);
    let before = mean(&noisy.color);
    let at = 32 * 97 + 48;
    let energy = 800.0;
    noisy.color[at] = [energy; 3];
    noisy.variance[at] = [energy * energy; 3];
    let out = noisy.denoised();
    let ratio = mean(&out) / mean(&noisy.color);
    assert!((ratio - 1.0).abs() < 0.01, "energy changed by a factor {ratio}");
    let largest = out.as_flattened().iter().fold(0.0f32, |a, &b| a.max(b));
    assert!(largest < energy / 300.0, "brightest pixel still {largest}");
    // Near it, and not everywhere: the corners are unchanged.
    assert!(
        f64::from(out[0][0]) < 2.0 * before && f64::from(out[at][0]) > 5.0 * before,
        "{} {}",
        out[0][0],
        out[at][0]
    );
}

/// Killed by: absent pixels taken as black (the picture darkens), a NaN that passes, only one of the two sweeps.
#[test]
fn absent_pixels_are_filled() {
    let clean = Picture::exact([40, 30], |_, _| [0.5; 3]).noisy(16, 19);
    let bad: [f32; 5] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 3e38, -1e20];
    for (k, &bad) in bad.iter().enumerate() {
        for in_variance in [false, true] {
            if in_variance && bad < 0.0 {
                // A negative variance is no variance.
                continue;
            }
            let mut picture = clean.clone();
            // The first pixels, the last ones, and a block of them.
            for i in (0..1200).filter(|i| *i < 90 + k || *i > 1150 || ((10..20).contains(&(i / 40)) && i % 40 < 7)) {
                let plane = if in_variance { &mut picture.variance } else { &mut picture.color };
                plane[i][k % 3] = bad;
            }
            for (i, x) in picture.denoised().as_flattened().iter().enumerate() {
                assert!((0.3..0.8).contains(x), "{bad}: {x} at {:?}", (i / 3 % 40, i / 120));
            }
        }
    }
}

/// Features may be anything too. Killed by: features that are not clamped.
#[test]
fn broken_features_do_no_harm() {
    let mut picture = Picture::exact([20, 20], |_, _| [0.5; 3]).noisy(16, 23);
    (picture.albedo, picture.normal) = (vec![[0.5; 3]; 400], vec![[0.0, 0.0, 1.0]; 400]);
    for (i, bad) in [f32::NAN, f32::INFINITY, -f32::INFINITY, 1e38, -1e38].into_iter().enumerate() {
        picture.albedo[37 * i + 40] = [bad, 0.5, bad];
        picture.normal[53 * i + 25] = [bad, bad, 0.0];
    }
    assert!(picture.denoised().as_flattened().iter().all(|x| (0.0..2.0).contains(x)));
}

/// Pictures narrower than a packet, than a tap's reach, and none at all. Killed by: a margin or a tail that counts as
/// picture (means then move towards 0), the bounds of a pixel without neighbours.
#[test]
fn every_size_works() {
    for size in [[1, 1], [7, 3], [3, 7], [8, 1], [9, 2], [1, 40], [17, 5], [64, 33]] {
        let noisy = Picture::exact(size, |_, _| [1.0; 3]).noisy(16, u64::from(size[0]));
        let out = noisy.denoised();
        let (low, high) = noisy.color.iter().fold((f32::MAX, 0.0f32), |(l, h), p| (l.min(p[0]), h.max(p[0])));
        // The correction of the mean may leave the range of the samples a little.
        assert!(out.as_flattened().iter().all(|x| (0.95 * low..=1.05 * high).contains(x)), "{size:?}");
        assert!((mean(&out) / mean(&noisy.color) - 1.0).abs() < 1e-4, "{size:?}");
        let black = Picture::exact(size, |_, _| [0.0; 3]).denoised();
        assert!(black.as_flattened().iter().all(|&x| x == 0.0), "{size:?}");
        let absent = Picture::exact(size, |_, _| [f32::NAN; 3]).denoised();
        assert!(absent.as_flattened().iter().all(|&x| x == 0.0), "{size:?}");
    }
    assert!(Picture::exact([0, 5], |_, _| [0.0; 3]).denoised().is_empty());
}

/// Killed by: scratch memory that is read before it is written (it is NaN in one run and 0 in the other).
#[test]
fn the_same_picture_gives_the_same_bits() {
    let picture = Picture::exact([50, 31], |x, y| [0.1 + 0.01 * x as f32, 0.5, 0.02 * y as f32]).noisy(4, 29);
    let mut memory = vec![0.0; Planes::len(picture.size, false)];
    let mut scratch = vec![0.0; scratch_len(picture.size)];
    let mut planes = Planes::carve(picture.size, false, &mut memory).unwrap();
    for (i, (color, variance)) in picture.color.iter().zip(&picture.variance).enumerate() {
        for c in 0..3 {
            (planes.color[c][i], planes.variance[c][i]) = (color[c], variance[c]);
        }
    }
    let expected = picture.denoised();
    for _ in 0..2 {
        planes.denoise(&mut scratch).unwrap();
        for (i, pixel) in expected.iter().enumerate() {
            assert_eq!(pixel.map(f32::to_bits), [0, 1, 2].map(|c| planes.out[c][i].to_bits()), "pixel {i}");
        }
    }
}

/// Killed by: dividing by hits instead of samples, the variance of one sample instead of that of the mean, a pixel
/// without samples as a black one.
#[test]
fn planes_take_the_film() {
    let mut memory = vec![0.0; Planes::len([2, 1], true)];
    let mut planes = Planes::carve([2, 1], true, &mut memory).unwrap();
    let (sum, spread) = ([4.0, 8.0, 0.0], [6.0, 0.0, 0.0]);
    let stats = PixelStats { sum, spread, weight: 4.0, weight_sqr: 4.0, samples: 4, rays: 9, ..PixelStats::default() };
    let aov = PixelAov { albedo: [2.0, 1.0, 0.0], normal: [0.0, -2.0, 1.0], hits: 2.0, ..Default::default() };
    planes.set(0, &stats, Some(&aov));
    planes.set(1, &PixelStats::default(), None);
    let at = |p: &[&mut [f32]; 3], i: usize| [p[0][i], p[1][i], p[2][i]];
    assert_eq!(at(&planes.color, 0), [1.0, 2.0, 0.0]);
    assert_eq!(at(&planes.variance, 0), [0.5, 0.0, 0.0]);
    assert_eq!(at(&planes.albedo, 0), [0.5, 0.25, 0.0]);
    assert_eq!(at(&planes.normal, 0), [0.0, -0.5, 0.25]);
    assert!(at(&planes.color, 1).iter().all(|x| x.is_nan()));
    planes.set(2, &stats, None);
    let mut scratch = vec![0.0; scratch_len([2, 1])];
    planes.denoise(&mut scratch).unwrap();
    assert!(planes.out.iter().all(|p| p.iter().all(|x| x.is_finite())));
}

/// Every slice one value short. Killed by: a check left out or naming another part.
#[test]
fn short_slices_are_errors() {
    let size = [13, 5];
    let (n, s) = (65, scratch_len(size));
    let plane = vec![0.0f32; n];
    let run = |lengths: [usize; 6]| {
        let [color, variance, albedo, normal, scratch, out] = lengths;
        let of = |n: usize| [&plane[..], &plane[..], &plane[..n]];
        let noisy = Noisy { size, color: of(color), variance: of(variance), albedo: of(albedo), normal: of(normal) };
        let mut outs = [vec![0.0; n], vec![0.0; n], vec![0.0; out]];
        denoise(&noisy, &mut vec![0.0; scratch], outs.each_mut().map(|p| p.as_mut_slice()))
    };
    assert_eq!(run([n, n, n, n, s, n]), Ok(()));
    let parts = [Part::Color, Part::Variance, Part::Albedo, Part::Normal, Part::Scratch, Part::Out];
    for (i, part) in parts.into_iter().enumerate() {
        let mut lengths = [n, n, n, n, s, n];
        lengths[i] -= 1;
        let needed = lengths[i] + 1;
        assert_eq!(run(lengths), Err(DenoiseError { part, size, needed, given: needed - 1 }));
    }
    let error = Planes::carve(size, true, &mut [0.0; 9]).map(|_| ()).unwrap_err();
    assert_eq!(error, DenoiseError { part: Part::Planes, size, needed: 15 * 65, given: 9 });
    assert_eq!(error.to_string(), "plane memory for 13x5 pixels needs 975 values, 9 given");
    // No size is too large to ask for.
    assert_eq!(scratch_len([u32::MAX; 2]), usize::MAX);
    assert!(Planes::carve([u32::MAX; 2], true, &mut []).is_err());
}
