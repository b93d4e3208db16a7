//! Points of one key and of many: stratified where they go on, independent elsewhere.

extern crate std;
use super::*;
use std::vec::Vec;

/// No bit of a key moves two axes, each axis has its whole range. Killed by: an axis used twice, a shift by less.
#[test]
fn axes_share_no_bits() {
    let bits = |lo: u32, hi: u32| {
        Key8 { lo: U32x8::splat(lo), hi: U32x8::splat(hi) }.cache_jitter(Sampler::Hashed).map(|x| x.lane(5))
    };
    assert_eq!(bits(0, 0), [0.0; 3]);
    assert!(bits(!0, !0).iter().all(|x| (0.9999..1.0).contains(x)));
    for bit in 0..64 {
        let key = 1u64 << bit;
        let moved = bits(key as u32, (key >> 32) as u32).iter().filter(|x| **x > 0.0).count();
        assert_eq!(moved, 1, "bit {bit}");
    }
}

/// Of keys as vertices have them: uniform, and no axis goes with another or with what the first sample draws to
/// scatter. 64k keys, so that correlations of 0.02 are 5 standard deviations. Killed by: keys that count, an axis
/// that is drawn again, the bits of a sequence's key.
#[test]
fn jitter_is_uniform_and_independent() {
    for sampler in [Sampler::Hashed, Sampler::Sobol] {
        let mut rows: Vec<[f64; 6]> = Vec::new();
        for k in 0..8192u32 {
            let pixel = U32x8::from_fn(|i| 8 * k + i as u32);
            let key = vertex(sampler, 1, pixel, U32x8::splat(k & 3));
            let (j, drawn) = (key.cache_jitter(sampler), key.sample(sampler, ZERO).scattering(sampler));
            let column = |c: usize| if c < 3 { j[c] } else { drawn[c - 3] };
            rows.extend((0..8).map(|i| core::array::from_fn(|c| f64::from(column(c).lane(i)))));
        }
        let mean = |f: &dyn Fn(&[f64; 6]) -> f64| rows.iter().map(f).sum::<f64>() / rows.len() as f64;
        for a in 0..3 {
            for b in 0..6 {
                let moment = 12.0 * mean(&|r| (r[a] - 0.5) * (r[b] - 0.5));
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((moment - expected).abs() < 0.02, "{sampler:?}, axes {a} and {b}: {moment}");
            }
            assert!((mean(&|r| r[a]) - 0.5).abs() < 0.006, "{sampler:?}, axis {a}");
        }
    }
}

const ZERO: U32x8 = U32x8::splat(0);

/// Keys of the first vertices of camera samples.
fn vertex(sampler: Sampler, iteration: u64, pixel: U32x8, sample: U32x8) -> Key8 {
    let origin = Origin { seed: 9, iteration, first: 0, alone: false };
    let key = Key8::camera_sample(sampler, origin, pixel, [sample, U32x8::splat(64)]);
    let key = key.next_vertex(sampler, U32x8::splat(1));
    key.of_iteration(iteration, key.goes_on(sampler))
}

/// What 64 samples of a pixel draw with Sobol' points at vertex `depth`: sample number `n` of each.
fn drawn(iteration: u64, pixel: u32, depth: u32, n: u32) -> Vec<[[f32; 3]; 2]> {
    let (s, mut out) = (Sampler::Sobol, Vec::new());
    for first in (0..64).step_by(8) {
        let mut key = vertex(s, iteration, U32x8::splat(pixel), U32x8::from_fn(|i| first + i as u32));
        for d in 2..=depth {
            key = key.sample(s, ZERO).next_vertex(s, U32x8::splat(d));
        }
        let sample = key.sample(s, U32x8::splat(n));
        let (scattering, [light, u, v, _]) = (sample.scattering(s), sample.light(s).map(U32x8::to_unit));
        let numbers = [scattering, [u, v, light]];
        out.extend((0..8).map(|i| numbers.map(|x| x.map(|x| x.lane(i)))));
    }
    out
}

/// Number of the 64 cells of 8 x 8 that have points of the first pair of a block.
fn cells(points: &[[[f32; 3]; 2]], block: usize) -> usize {
    let cell = |p: &[[f32; 3]; 2]| (p[block][0] * 8.0) as usize * 8 + (p[block][1] * 8.0) as usize;
    points.iter().map(cell).collect::<std::collections::HashSet<_>>().len()
}

/// Samples of vertices 1 to 4 belong to sequences, in every block, whatever their number among siblings; later ones
/// do not: 64 independent points leave 23 of 64 cells empty. Killed by: a depth that is off by one, a child that
/// forgets its sample's number, keys of one depth in another.
#[test]
fn samples_of_early_vertices_are_stratified() {
    for pixel in 0..8 {
        for depth in 1..=SOBOL_DEPTH + 2 {
            for n in [0, 1, 7] {
                let points = drawn(1, pixel, depth, n);
                for block in 0..2 {
                    let found = cells(&points, block);
                    let sequence = depth <= SOBOL_DEPTH;
                    let expected = if sequence { found == 64 } else { (30..52).contains(&found) };
                    assert!(expected, "pixel {pixel}, depth {depth}, sibling {n}: {found} cells of 64");
                }
            }
        }
    }
}

/// First steps through media belong to sequences as samples of vertices do: flights to vertices 1 to 4, and shadow rays
/// from there, behind however many surfaces; later steps do not. With hashed numbers all are words of the key.
/// Killed by: a block of steps that is hashed, a stretch whose key leaves the sequence or is that of another.
#[test]
fn first_steps_through_media_are_stratified() {
    let intervals = |words: &dyn Fn(Key8) -> U32x8, sampler, depth: u32| {
        let mut found = std::collections::HashSet::new();
        for first in (0..64).step_by(8) {
            let mut key = vertex(sampler, 1, U32x8::splat(5), U32x8::from_fn(|i| first + i as u32));
            for d in 2..=depth {
                key = key.sample(sampler, ZERO).next_vertex(sampler, U32x8::splat(d));
            }
            found.extend(words(key).to_array().map(|w| w >> 26));
        }
        found.len()
    };
    for sampler in [Sampler::Sobol, Sampler::Hashed] {
        for depth in 1..=SOBOL_DEPTH + 1 {
            for n in 0..2 {
                let spread = sampler == Sampler::Sobol && depth <= SOBOL_DEPTH && n == 0;
                let check = |found: usize, what: &str| {
                    let expected = if spread { found == 64 } else { (30..52).contains(&found) };
                    assert!(expected, "{sampler:?}, depth {depth}, block {n}, {what}: {found} of 64");
                };
                for word in 0..4 {
                    let flight = |key: Key8| key.flight_steps(sampler, n)[word / 2][word % 2];
                    check(intervals(&flight, sampler, depth), "flight");
                    for passed in [0, 1, 9] {
                        let through = |key: Key8| {
                            let stretch = key.sample(sampler, ZERO).shadow_stretch(sampler, passed);
                            stretch.transmittance_steps(sampler, n)[word]
                        };
                        check(intervals(&through, sampler, depth), "transmittance");
                    }
                }
            }
        }
    }
    let key = vertex(Sampler::Hashed, 1, ZERO, ZERO);
    let [a, b] = [0, 1].map(|passed| key.shadow_stretch(Sampler::Hashed, passed));
    assert_ne!((a.lo, a.hi), (b.lo, b.hi));
    assert_eq!(key.flight_steps(Sampler::Hashed, 0).concat(), key.words(FLIGHT_BLOCK));
    assert_eq!(a.transmittance_steps(Sampler::Hashed, 0), a.words(TRANSMITTANCE_BLOCK));
}

/// Siblings, depths, blocks, pixels and iterations: no two draw alike. Over 512 pixels the correlation of what the
/// same camera sample draws is below 0.13, 3 standard deviations of one pair and 5 of none of these. Killed by: a
/// scramble that two of them share, an iteration that begins as the one before.
#[test]
fn sequences_are_independent() {
    let columns: Vec<Vec<f64>> = [(1, 1, 0, 0), (1, 1, 1, 0), (1, 2, 0, 0), (1, 1, 0, 1), (2, 1, 0, 0), (1, 5, 0, 0)]
        .into_iter()
        .map(|(iteration, depth, n, block)| {
            (0..512).map(|p| f64::from(drawn(iteration, p, depth, n)[3][block][0]) - 0.5).collect()
        })
        .chain([(0..512).map(|p| f64::from(drawn(1, p + 1, 1, 0)[3][0][0]) - 0.5).collect()])
        .collect();
    for a in 0..columns.len() {
        for b in 0..=a {
            let r = columns[a].iter().zip(&columns[b]).map(|(a, b)| a * b).sum::<f64>() * 12.0 / 512.0;
            let expected = if a == b { 1.0 } else { 0.0 };
            assert!((r - expected).abs() < 0.22, "columns {a} and {b}: {r}");
        }
    }
}

/// The sequence of each half goes on from iteration to iteration: its 64 samples fill all 64 cells, however they
/// are divided, and so do what goes before a bounce that is guided, but not that bounce, whose numbers are independent
/// of those of iterations before. Killed by: an iteration that begins anew, one that repeats points, lanes that are
/// guided and others exchanged, halves of other sizes.
#[test]
fn sequences_go_on_in_each_half() {
    let s = Sampler::Sobol;
    for (lengths, odd) in
        [(&[128][..], false), (&[1, 1, 2, 4, 8, 112], false), (&[3, 5, 50, 70], false), (&[60, 68], true)]
    {
        let mut cells = [(); 2].map(|()| [(); 3].map(|()| std::collections::HashSet::new()));
        let (mut before, mut counts) = (0, [0; 2]);
        for (iteration, &samples) in lengths.iter().enumerate() {
            let origin = Origin { seed: 9, iteration: iteration as u64 + 1, first: before, alone: false };
            let first = in_first_half(before, samples);
            for sample in 0..samples {
                let numbers = [sample, first].map(U32x8::splat);
                let key = Key8::camera_sample(s, origin, U32x8::splat(3), numbers);
                let vertex = key.next_vertex(s, U32x8::splat(1)).sample(s, ZERO);
                let guided = Mask8::from_bits(0b1010_1010) & vertex.goes_on(s);
                let bounce = vertex.of_iteration(origin.iteration, guided);
                assert!(vertex.goes_on(s).all() && bounce.goes_on(s).bits() == 0b0101_0101);
                let half = usize::from(sample >= first);
                let [pixel, light] = [key.pixel_and_lens(s), vertex.light(s).map(U32x8::to_unit)];
                let direction = bounce.scattering(s);
                let lane = usize::from(odd);
                let drawn = [[pixel[0], pixel[1]], [light[1], light[2]], [direction[0], direction[1]]];
                for (cells, [u, v]) in cells[half].iter_mut().zip(drawn) {
                    cells.insert((u.lane(lane) * 8.0) as usize * 8 + (v.lane(lane) * 8.0) as usize);
                }
                counts[half] += 1;
            }
            before += samples;
            assert!(counts[0] == counts[1] || counts[0] == counts[1] + 1, "{counts:?} of {before}");
        }
        for [pixel, light, bounce] in cells.map(|half| half.map(|cells| cells.len())) {
            assert_eq!((pixel, light, bounce == 64), (64, 64, !odd), "{lengths:?}: {bounce} cells");
        }
    }
}

/// With sequences of one iteration alone, the samples of a half fill all cells, none goes on at any depth, so that
/// bounces that a guide decides about have no others, and another iteration draws other numbers. Killed by: keys that are
/// taken for ones that go on, hashed ones, an iteration that repeats points.
#[test]
fn sequences_alone_do_not_go_on() {
    let s = Sampler::Sobol;
    let drawn = |iteration: u64| {
        let mut cells = std::collections::HashSet::new();
        let mut first = [0.0; 2];
        for sample in (0..64).step_by(8) {
            let origin = Origin { seed: 9, iteration, first: 7, alone: false }.apart();
            let numbers = [U32x8::from_fn(|i| sample + i as u32), U32x8::splat(64)];
            let mut key = Key8::camera_sample(s, origin, U32x8::splat(3), numbers);
            assert!(key.goes_on(s).none());
            for depth in 1..=SOBOL_DEPTH {
                key = key.next_vertex(s, U32x8::splat(depth)).sample(s, ZERO);
                assert!(key.goes_on(s).none() && key.is_hashed().none(), "depth {depth}");
            }
            let [u, v, _] = key.scattering(s);
            for i in 0..8 {
                cells.insert((u.lane(i) * 8.0) as usize * 8 + (v.lane(i) * 8.0) as usize);
            }
            first = [u.lane(0), v.lane(0)];
        }
        assert_eq!(cells.len(), 64, "iteration {iteration}");
        first
    };
    assert_ne!(drawn(1), drawn(2));
}

/// The halves of a pixel draw independently of each other: over 512 pixels the correlation of their samples is
/// below 0.22, 5 standard deviations. Killed by: one scramble for both.
#[test]
fn halves_are_independent() {
    let s = Sampler::Sobol;
    let origin = Origin { seed: 9, iteration: 1, first: 0, alone: false };
    for n in [0, 1, 5] {
        let product = |pixel: u32| {
            let sample = U32x8::from_fn(|i| n + 8 * (i as u32 & 1));
            let key = Key8::camera_sample(s, origin, U32x8::splat(pixel), [sample, U32x8::splat(8)]);
            let [u, ..] = key.pixel_and_lens(s);
            12.0 * f64::from(u.lane(0) - 0.5) * f64::from(u.lane(1) - 0.5)
        };
        let r = (0..512).map(product).sum::<f64>() / 512.0;
        assert!(r.abs() < 0.22, "sample {n}: {r}");
    }
}

/// Hashed numbers are what they were before there was a choice. Killed by: a key that another sampler changed.
#[test]
fn hashed_keys_are_hashes() {
    let (pixel, sample) = (U32x8::from_fn(|i| i as u32), U32x8::splat(5));
    let origin = Origin { seed: 9, iteration: 3, first: 40, alone: false };
    let key = Key8::camera_sample(Sampler::Hashed, origin, pixel, [sample, sample]);
    assert!(key.goes_on(Sampler::Hashed).none());
    let wanted = Key8::camera(9, pixel, U32x8::splat(45));
    assert_eq!((key.lo, key.hi), (wanted.lo, wanted.hi));
    let (a, b) = (key.next_vertex(Sampler::Hashed, ZERO), wanted.child(ZERO));
    assert_eq!((a.lo, a.hi), (b.lo, b.hi));
    assert_eq!(a.light(Sampler::Hashed), b.words(LIGHT_BLOCK));
}
