//! What works on whole pictures and scenes: the denoiser, validation of blobs, baking.

use super::{Kernels, Outcome, close, expect};
use croupier::unstable::denoise::{Noisy, denoise, scratch_len};
use croupier::unstable::film::{FilmSum, PixelStats};
use croupier::{Plan, Scene, Settings};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::builtin;
use croupier_tests::stats::SplitMix;
use std::hint::black_box;

pub(super) fn add(k: &mut Kernels) -> Outcome {
    denoiser(k)?;
    film(k)?;
    blobs(k)
}

const SIZE: [u32; 2] = [48, 32];

/// A picture of even grey with 8 samples of exponential noise per pixel: the noise goes, the mean stays.
fn denoiser(k: &mut Kernels) -> Outcome {
    let mut rng = SplitMix(15);
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let (mut color, mut variance) = (vec![0.0f32; pixels], vec![0.0f32; pixels]);
    for (c, v) in color.iter_mut().zip(&mut variance) {
        let samples: [f64; 8] = std::array::from_fn(|_| -(1.0 - rng.f64()).ln());
        let mean = samples.iter().sum::<f64>() / 8.0;
        (*c, *v) = (mean as f32, (samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 56.0) as f32);
    }
    let mut scratch = vec![0.0f32; scratch_len(SIZE)];
    let mut out = [(); 3].map(|()| vec![0.0f32; pixels]);
    let noisy = color.clone();
    let mut run = move || {
        let planes = |p| [p, p, p];
        let noisy = Noisy {
            size: SIZE,
            color: planes(black_box(&*color)),
            variance: planes(&*variance),
            albedo: [&[]; 3],
            normal: [&[]; 3],
        };
        let done = denoise(&noisy, &mut scratch, out.each_mut().map(|p| p.as_mut_slice()));
        done.map(|()| black_box(&out[0]).clone())
    };
    let clean = run().map_err(|e| e.to_string())?;
    let mean = |p: &[f32]| p.iter().map(|x| f64::from(*x)).sum::<f64>() / p.len() as f64;
    let error = |p: &[f32]| p.iter().map(|x| (f64::from(*x) - 1.0).powi(2)).sum::<f64>() / p.len() as f64;
    close("mean of the denoised picture", mean(&clean) / mean(&noisy), 1.0, 1e-4)?;
    expect(error(&noisy) > 8.0 * error(&clean), "the denoiser leaves the noise")?;
    k.whole(("picture", "denoise 48 x 32"), ("8 pixels", pixels / 8), move || {
        black_box(run().is_ok());
    });
    Ok(())
}

/// One more iteration of a small picture, added to those before: sums, deviations, what they say of the error.
fn film(k: &mut Kernels) -> Outcome {
    let size = [16, 16];
    let plan = Plan::new(&Settings { size, max_depth: 1, ..Settings::default() }).map_err(|e| e.to_string())?;
    let block: &'static mut AlignedBytes = Box::leak(Box::new(AlignedBytes::zeroed(plan.film_sum().size)));
    let mut sum = FilmSum::new(&plan, block.as_mut()).map_err(|e| e.to_string())?;
    let sample = |i: usize| PixelStats {
        sum: [0.1 * i as f64; 3],
        weight: 1.0,
        weight_sqr: 1.0,
        samples: 1,
        ..PixelStats::default()
    };
    (0..8).for_each(|_| sum.add(sample, |_, _| 0.0));
    for (i, p) in sum.finish(0.0).pixels().enumerate() {
        close("mean of a pixel", p.mean()[0], 0.1 * i as f64, 1e-15)?;
        expect(p.samples == 8, "samples of a pixel")?;
    }
    k.whole(("film", "add an iteration of 16 x 16"), ("8 pixels", 32), move || sum.add(black_box(sample), |_, _| 0.0));
    Ok(())
}

fn blobs(k: &mut Kernels) -> Outcome {
    let description = builtin::cornell_box();
    let baked = bake(&description, &BakeOptions::default(), |_, _| {}).map_err(|e| e.to_string())?;
    let blob: AlignedBytes = baked.bytes;
    let triangles = Scene::from_bytes(&blob).map_err(|e| e.to_string())?.triangles.len();
    let mut broken = AlignedBytes::zeroed(blob.len());
    broken.as_mut().copy_from_slice(&blob);
    let middle = blob.len() / 2;
    broken.as_mut()[middle] ^= 1;
    expect(Scene::from_bytes(&broken).is_err(), "a blob with one bit changed is taken")?;
    let again = bake(&description, &BakeOptions::default(), |_, _| {}).map_err(|e| e.to_string())?;
    expect(*again.bytes == *blob, "baking twice gives two scenes")?;
    k.whole(("scene", "blob validation, built-in"), ("8 triangles", triangles.div_ceil(8)), move || {
        black_box(Scene::from_bytes(black_box(&blob)).is_ok());
    });
    k.whole(("scene", "bake, built-in"), ("8 triangles", triangles.div_ceil(8)), move || {
        black_box(bake(black_box(&description), &BakeOptions::default(), |_, _| {}).is_ok());
    });
    Ok(())
}
