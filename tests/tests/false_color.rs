//! Numbers as colours: the scale, and the legend that says what it means.

use croupier_host::false_color::{Drawing, LEGEND, Scale, draw};

const GREY: [u8; 3] = [128; 3];
const WHITE: [u8; 3] = [255; 3];
const BLACK: [u8; 3] = [0; 3];

fn pixel(d: &Drawing, x: usize, y: usize) -> [u8; 3] {
    d.pixels[y * d.width + x]
}

/// Killed by: red and blue exchanged, a linear scale, a centre elsewhere than at 1, values beyond the ends that wrap,
/// values that are not there drawn as the smallest factor.
#[test]
fn factors_are_red_white_and_blue() {
    let s = Scale::FACTORS;
    assert_eq!(s.color(1.0), WHITE);
    let [low, high] = [0.05, 20.0].map(|x| s.color(x));
    assert!(low[0] > 2 * low[2] && high[2] > 2 * high[0], "{low:?} {high:?}");
    for (inside, outside) in [(0.05, 1e-30), (20.0, f32::INFINITY)] {
        assert_eq!(s.color(inside), s.color(outside));
    }
    for nothing in [0.0, -1.0, f32::NAN] {
        assert_eq!(s.color(nothing), GREY);
    }
    // the stops next to the centre lie at the fourth root of the ends
    let step = 20f32.powf(0.25);
    assert_eq!([1.0 / step, step].map(|x| s.color(x)), [[244, 165, 130], [146, 197, 222]]);
    // a little above 1 is a little blue
    let above = s.color(1.05);
    assert!(above[0] < above[2] && above[0] > 240, "{above:?}");
}

/// Killed by: ends that are not round, an outlier that takes the scale, a scale without width.
#[test]
fn other_scales_end_at_round_numbers() {
    let same = |a: Scale, b: &[f32]| assert_eq!(a, Scale::sequential(b));
    let mut values: Vec<f32> = (0..5000).map(|i| 3.1 + i as f32 * 0.01).collect();
    let scale = Scale::sequential(&values);
    same(scale, &[2.0, 100.0]);
    values.extend([1e9, 0.0, f32::NAN, f32::INFINITY]);
    same(scale, &values);
    assert_eq!(scale.color(2.0), [68, 1, 84]);
    assert_eq!(scale.color(100.0), [253, 231, 37]);
    // the middle of a logarithmic scale
    assert_eq!(scale.color(200f32.sqrt()), [33, 145, 140]);
    let one = Scale::sequential(&[5.0; 100]);
    assert!(one.color(5.0) == [68, 1, 84] && one.color(10.0) == [253, 231, 37], "{one:?}");
    for nothing in [&[][..], &[0.0, f32::NAN]] {
        assert!(Scale::sequential(nothing).color(1.0) != GREY);
    }
    for extreme in [&[f32::MIN_POSITIVE, f32::MAX][..], &[f32::MAX], &[f32::MIN_POSITIVE]] {
        let drawing = draw(extreme, 1, &Scale::sequential(extreme), "extreme");
        assert!(drawing.pixels[0] != GREY);
    }
}

/// Killed by: a legend over the picture, a bar of other colours than the picture's, labels left out or drawn one over
/// the other, a picture too narrow for its legend.
#[test]
fn the_legend_is_below_and_complete() {
    for (width, height) in [(1, 1), (3, 500), (192, 108), (1280, 4)] {
        let values: Vec<f32> = (0..width * height).map(|i| 0.05 * 1.01f32.powi(i as i32 % 600)).collect();
        let d = draw(&values, width, &Scale::FACTORS, "factor 1");
        assert_eq!((d.width, d.height), (width.max(200), height + LEGEND));
        assert_eq!(d.pixels.len(), d.width * d.height);
        for y in 0..height {
            for x in 0..width {
                assert_eq!(pixel(&d, x, y), Scale::FACTORS.color(values[y * width + x]));
            }
            assert!((width..d.width).all(|x| pixel(&d, x, y) == WHITE));
        }
        let bar: Vec<_> = (0..d.width).map(|x| pixel(&d, x, height + 8)).collect();
        let first = bar.iter().position(|c| *c == Scale::FACTORS.color(0.05)).unwrap();
        let last = bar.iter().rposition(|c| *c == Scale::FACTORS.color(20.0)).unwrap();
        assert!(last - first > 90, "{first} {last}");
        for (i, c) in bar[first..=last].iter().enumerate() {
            let t = i as f32 / (last - first) as f32;
            let expected = Scale::FACTORS.color(0.05 * 400f32.powf(t));
            assert!(c.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 3), "{i}: {c:?} {expected:?}");
        }
        // nine ticks, and below them labels that stand apart: a blank column or more between any two
        let ticks = (0..d.width).filter(|x| pixel(&d, *x, height + 15) == BLACK).count();
        assert_eq!(ticks, 9);
        let ink = |x: usize| (18..LEGEND).any(|y| pixel(&d, x, height + y) == BLACK);
        // first and last column of every label
        let mut words: Vec<[usize; 2]> = Vec::new();
        for x in (0..d.width).filter(|x| ink(*x)) {
            match words.last_mut().filter(|w| x - w[1] <= 6) {
                Some(word) => word[1] = x,
                None => words.push([x, x]),
            }
        }
        assert!(words.len() >= 3 && (width < 1000 || words.len() == 9), "{width}: {words:?}");
        assert!(words.iter().all(|w| w[1] - w[0] < 24), "{width}: {words:?}");
        let ink = (0..d.width).flat_map(|x| (0..LEGEND).map(move |y| (x, y)));
        let ink = ink.filter(|(x, y)| pixel(&d, *x, height + y) == BLACK);
        assert!(ink.clone().count() > 60, "no text");
        assert!(ink.clone().all(|(x, _)| x > 0 && x + 1 < d.width), "text is cut");
    }
}
