//! Texture look-up against the f64 oracle.

use croupier::unstable::scene::blob::TextureRecord;
use croupier::unstable::simd::{F32x8, Mask8, U32x8};
use croupier::unstable::texture::{SRGB_TO_LINEAR, lookup, referenced};
use croupier_tests::light_scene::LightScene;
use croupier_tests::stats::SplitMix;
use croupier_tests::texture_oracle as oracle;

const SIZES: [[u32; 2]; 5] = [[1, 1], [2, 1], [3, 5], [16, 8], [257, 31]];

fn scene() -> (LightScene, Vec<Vec<[u8; 3]>>) {
    let mut rng = SplitMix(1);
    let mut scene = LightScene::default();
    let mut plain = Vec::new();
    for [width, height] in SIZES {
        let texels: Vec<[u8; 3]> = (0..width * height).map(|_| std::array::from_fn(|_| rng.word() as u8)).collect();
        let first = scene.texels.len() as u32;
        scene.textures.push(croupier::unstable::scene::blob::Texture { first, width, height, flags: 0 });
        scene.texels.extend(texels.iter().map(|t| u32::from_le_bytes([t[0], t[1], t[2], 77])));
        plain.push(texels);
    }
    (scene, plain)
}

/// Killed by: 2.4 -> 2.2, threshold 0.04045 -> 0.0031308 (changes codes 1..10), too few Newton steps.
#[test]
fn srgb_table_is_exact() {
    for code in 0..=255u8 {
        assert_eq!(SRGB_TO_LINEAR[usize::from(code)], oracle::srgb_to_linear(code) as f32, "code {code}");
    }
}

/// Killed by: dropping the -1/2, v downwards, clamping instead of repeating, interpolating before decoding.
#[test]
fn look_up_agrees_with_the_oracle() {
    let (owner, plain) = scene();
    let scene = owner.scene();
    let mut rng = SplitMix(2);
    let mut worst = 0.0f64;
    for _ in 0..20_000 {
        let texture: [u32; 8] = std::array::from_fn(|_| rng.word() % SIZES.len() as u32);
        // A third of the coordinates on texel edges and centres, where rows and columns change.
        let coordinate = |rng: &mut SplitMix| match rng.word() % 3 {
            0 => (f64::from(rng.word() % 129) - 64.0) as f32 / 16.0,
            1 => rng.range(-4.0, 4.0) as f32,
            _ => rng.f64() as f32,
        };
        let u = F32x8::from_fn(|_| coordinate(&mut rng));
        let v = F32x8::from_fn(|_| coordinate(&mut rng));
        let got = lookup(&scene, U32x8::new(texture), [u, v], Mask8::all_lanes());
        for (i, k) in texture.into_iter().enumerate() {
            let k = k as usize;
            let uv = [u.lane(i), v.lane(i)].map(f64::from);
            let [w, h] = SIZES[k].map(i64::from);
            let want = oracle::lookup(&plain[k], w, h, uv);
            // Half an ulp of a fraction below 1 in the position of up to 257 texels, plus the blend.
            let bound = 1.2e-7 * (w.max(h) as f64) + 4e-7;
            for c in 0..3 {
                let error = (f64::from(got.lane(i)[c]) - want[c]).abs();
                worst = worst.max(error / bound);
                assert!(error <= bound, "texture {k} at {uv:?}: {:?} for {want:?}", got.lane(i));
            }
        }
    }
    println!("largest error: {worst:.2} of the bound");
}

/// Killed by: not masking non-finite coordinates, indexing without `get`.
#[test]
fn anything_goes_in_and_finite_colours_come_out() {
    let (owner, _) = scene();
    let scene = owner.scene();
    let special = [0.0, -0.0, 1.0, -1.0, 1e-45, -1e-45, -1e-20, 1e7, -8_388_609.0, 1e30, -1e30];
    let special = special.into_iter().chain([f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 0.999_999_94]);
    let special: Vec<f32> = special.collect();
    for &u in &special {
        for &v in &special {
            let index = U32x8::new([0, 1, 2, 3, 4, 5, u32::MAX, 1 << 31]);
            let uv = [F32x8::splat(u), F32x8::splat(v)];
            let got = lookup(&scene, index, uv, Mask8::all_lanes());
            assert!(got.is_finite().all());
            assert!((0..8).all(|i| got.lane(i).iter().all(|c| (0.0..=1.0).contains(c))));
            let some = lookup(&scene, index, uv, Mask8::from_bits(0b0101));
            for i in 0..8 {
                assert_eq!(some.lane(i), if i == 0 || i == 2 { got.lane(i) } else { [0.0; 3] });
            }
        }
    }
}

/// Referenced textures: affine coordinates, linear codes, clamping and mirroring, against bilinear interpolation of texels
/// that are looked up one by one. Killed by: a row of the transform that is swapped, decoding linear texels, an edge that
/// shows the other side.
#[test]
fn referenced_textures_are_wrapped_and_transformed() {
    let (mut owner, plain) = scene();
    let mut rng = SplitMix(6);
    for [mode_u, mode_v] in [[0, 1], [1, 2], [2, 0]] {
        owner.textures.iter_mut().for_each(|t| t.flags = 1 | mode_u << 1 | mode_v << 3);
        let scene = owner.scene();
        for _ in 0..500 {
            let k = (rng.word() % SIZES.len() as u32) as usize;
            let number = |rng: &mut SplitMix| rng.range(-2.0, 2.0) as f32;
            let transform: [[f32; 3]; 2] = std::array::from_fn(|_| std::array::from_fn(|_| number(&mut rng)));
            let reference = TextureRecord { texture: k as u32, transform };
            let none = TextureRecord::NONE;
            let of = std::array::from_fn(|l| [Some(&reference), None, Some(&none)][l % 3]);
            let uv = [number(&mut rng), number(&mut rng)];
            let (present, got) = referenced(&scene, &of, uv.map(F32x8::splat));
            assert_eq!(present.bits(), 0b0100_1001);
            assert_eq!((got.lane(1), got.lane(2)), ([1.0; 3], [1.0; 3]));
            let [w, h] = SIZES[k].map(i64::from);
            let at = transform
                .map(|[a, b, c]| f64::from(a) * f64::from(uv[0]) + f64::from(b) * f64::from(uv[1]) + f64::from(c));
            let wrapped = |i: i64, size: i64, mode: u32| match mode {
                0 => i.rem_euclid(size),
                1 => i.clamp(0, size - 1),
                _ => {
                    let i = i.rem_euclid(2 * size);
                    if i < size { i } else { 2 * size - 1 - i }
                }
            };
            let (x, y) = (at[0] * w as f64 - 0.5, at[1] * h as f64 - 0.5);
            let (fx, fy) = (x - x.floor(), y - y.floor());
            #[expect(clippy::needless_range_loop, reason = "the channel of several texels")]
            for c in 0..3 {
                let texel = |dx: i64, dy: i64| {
                    let column = wrapped(x.floor() as i64 + dx, w, mode_u);
                    let row = h - 1 - wrapped(y.floor() as i64 + dy, h, mode_v);
                    f64::from(plain[k][(row * w + column) as usize][c]) / 255.0
                };
                let lower = texel(0, 0) * (1.0 - fx) + texel(1, 0) * fx;
                let upper = texel(0, 1) * (1.0 - fx) + texel(1, 1) * fx;
                let want = lower * (1.0 - fy) + upper * fy;
                // coordinates of up to 10 have an error of 1e-6, in up to 257 texels
                let error = (f64::from(got.lane(3)[c]) - want).abs();
                assert!(error < 2e-6 * w.max(h) as f64 + 1e-6, "modes {mode_u} {mode_v}: {:?} {want}", got.lane(3));
            }
        }
    }
}
