//! FLIP against the published evaluator, and what must hold for any difference.

use croupier_host::flip::{Viewing, flip};

const W: usize = 40;
const H: usize = 30;

/// 8-bit sRGB to linear, in f64 (IEC 61966-2-1).
fn linear(x: u8) -> f32 {
    let x = f64::from(x) / 255.0;
    (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
}

fn image(pixel: impl Fn(i64, i64) -> [i64; 3]) -> Vec<[f32; 3]> {
    (0..H as i64)
        .flat_map(|y| (0..W as i64).map(move |x| (x, y)))
        .map(|(x, y)| pixel(x, y).map(|v| linear(v as u8)))
        .collect()
}

fn hash(x: i64, y: i64) -> i64 {
    ((x * 73_856_093) ^ (y * 19_349_663)) >> 7 & 255
}

fn error(a: &[[f32; 3]], b: &[[f32; 3]]) -> Vec<f64> {
    flip(W, H, a, b, Viewing::default())
}

fn mean(map: &[f64]) -> f64 {
    map.iter().sum::<f64>() / map.len() as f64
}

/// Mean, and the errors of the pixels (20, 15) and (0, 0), as the authors' program (version 1.7, LDR, 67 pixels per
/// degree, 32-bit floats) finds them for the same pixels. Killed by: a change of any constant, filter or exponent.
#[test]
fn agrees_with_the_published_evaluator() {
    let gray = |v: i64| move |_, _| [v; 3];
    let sides = |edge: i64| move |x, _| if x < edge { [40, 90, 200] } else { [200, 160, 30] };
    let cases = [
        ("black and white", image(gray(0)), image(gray(255)), [0.967_388_3, 0.967_388_3, 0.967_388_3]),
        (
            "red and green",
            image(|_, _| [255, 0, 0]),
            image(|_, _| [0, 255, 0]),
            [0.986_664_95, 0.986_664_95, 0.986_664_95],
        ),
        (
            "gradient",
            image(|x, y| [x * 6, y * 8, 128]),
            image(|x, y| [x * 6, y * 8 + if x > 20 { 12 } else { 0 }, 128]),
            [0.119_598_9, 0.145_732_9, 0.0],
        ),
        (
            "dot",
            image(gray(100)),
            image(|x, y| if (x, y) == (20, 15) { [220; 3] } else { [100; 3] }),
            [0.003_532_85, 0.374_350_3, 0.0],
        ),
        ("edge", image(sides(20)), image(sides(22)), [0.152_800_4, 0.738_225_3, 0.0]),
        (
            "noise",
            image(|x, y| [hash(x, y), hash(x + 50, y), hash(x, y + 50)]),
            image(|x, y| [hash(x, y), hash(x + 51, y), hash(x + 3, y + 50)]),
            [0.341_019_6, 0.254_365_3, 0.449_796_7],
        ),
    ];
    for (name, a, b, expected) in cases {
        let map = error(&a, &b);
        let found = [mean(&map), map[15 * W + 20], map[0]];
        for (f, e) in found.iter().zip(expected) {
            assert!((f - e).abs() < 2e-4, "{name}: {found:?}, expected {expected:?}");
        }
    }
}

/// 0 for equal images, symmetric, growing with the difference, within [0, 1]. Killed by: a breach of any of these.
#[test]
fn is_a_difference() {
    let a = image(|x, y| [hash(x, y), x * 6, y * 8]);
    assert!(error(&a, &a).iter().all(|e| *e == 0.0));
    let mut last = 0.0;
    for step in [2.0, 5.0, 20.0, 80.0] {
        let b: Vec<[f32; 3]> = a.iter().map(|p| p.map(|x| (x + step / 255.0).min(1.0))).collect();
        let (there, back) = (error(&a, &b), error(&b, &a));
        assert_eq!(there, back);
        assert!(there.iter().all(|e| (0.0..=1.0).contains(e)));
        assert!(mean(&there) > last, "{step}");
        last = mean(&there);
    }
    // Blind to what is too fine to be seen. (Not exactly: beyond the corners the repeated pixels are no board.)
    let board = image(|x, y| [if (x + y) % 2 == 0 { 118 } else { 138 }; 3]);
    let flat = vec![[(linear(118) + linear(138)) / 2.0; 3]; W * H];
    let at = |pixels_per_degree| mean(&flip(W, H, &board, &flat, Viewing { pixels_per_degree }));
    assert!(at(67.0) < 0.05 * at(20.0), "{} {}", at(67.0), at(20.0));
}

/// Any input gives numbers: dies with an unchecked index or a NaN that spreads.
#[test]
fn takes_any_input() {
    let a = vec![[f32::NAN, f32::INFINITY, -1.0]; 6];
    assert!(flip(3, 2, &a, &[[0.5; 3]; 6], Viewing::default()).iter().all(|e| (0.0..=1.0).contains(e)));
    assert!(flip(0, 0, &[], &[], Viewing::default()).is_empty());
    assert!(flip(0, 5, &[], &[], Viewing::default()).is_empty());
    assert_eq!(flip(1, 1, &[[0.0; 3]], &[], Viewing::default()), [0.0]);
    assert_eq!(flip(5, 1, &[], &[], Viewing::default()).len(), 5);
}
