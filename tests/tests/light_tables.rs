//! Alias tables and light powers: what sampling does is what the tables state.

use bytemuck::Zeroable;
use croupier::unstable::light::{LightSelector, PowerSelector};
use croupier::unstable::scene::blob::*;
use croupier::unstable::simd::{Mask8, U32x8, Vec3x8};
use croupier_host::{alias, environment};
use croupier_tests::light_oracle::{Map, luminance, wide};
use croupier_tests::light_scene::{IDENTITY, LightScene};
use croupier_tests::stats::SplitMix;

const RANGE: u64 = 1 << 32;

/// n weights over many magnitudes, a third of them 0.
fn weights(n: usize, rng: &mut SplitMix) -> Vec<f64> {
    (0..n).map(|i| if i % 3 == 1 { 0.0 } else { rng.f64().powi(4) * 3.7 }).collect()
}

fn owner(weights: &[f64]) -> LightScene {
    let mut s = LightScene::default();
    for _ in weights {
        s = s.delta(LightKind::Point, [0.0; 3], [1.0; 3]);
    }
    s.select_by(weights)
}

/// Random numbers per item, counted: in each slot of the table they change item at most once, found by bisection.
fn count(owner: &LightScene, n: usize) -> Vec<u64> {
    let selector = PowerSelector(owner.scene());
    let pick = |r: u64| {
        selector.select(Vec3x8::ZERO, Vec3x8::ZERO, U32x8::splat(r as u32), Mask8::all_lanes()).0.lane(0) as usize
    };
    let mut counts = vec![0; n];
    let mut start = 0u64;
    for slot in 0..n as u64 {
        // The last number r with floor(r n / 2^32) = slot, one more.
        let end = ((slot + 1) * RANGE).div_ceil(n as u64);
        let (first, last) = (pick(start), pick(end - 1));
        let (mut low, mut high) = (start, end - 1);
        while high - low > 1 {
            let middle = (low + high) / 2;
            if pick(middle) == first { low = middle } else { high = middle }
        }
        let change = if first == last { end } else { high };
        counts[first] += change - start;
        counts[last] += end - change;
        start = end;
    }
    counts
}

/// Killed by: threshold off by one, `<=` in the pick, probabilities from the weights, slots of equal capacity.
#[test]
fn every_random_number_is_accounted_for() {
    let mut rng = SplitMix(10);
    let tables: Vec<Vec<f64>> = [1, 2, 3, 5, 7, 64, 1000, 1024]
        .into_iter()
        .flat_map(|n| [weights(n, &mut rng), (0..n).map(|i| 1e-12 + (i % 2) as f64).collect(), vec![0.3; n]])
        .chain([vec![1e308, 1e308, 1e-308], vec![f64::NAN, 1.0, f64::INFINITY, -5.0], vec![0.0, 0.0, 1e-300]])
        .collect();
    for w in tables {
        let widths = alias::widths(&w).unwrap();
        assert_eq!(widths.iter().sum::<u64>(), RANGE);
        let s = owner(&w);
        assert_eq!(count(&s, w.len()), widths, "{w:?}");
        for (i, width) in widths.iter().enumerate() {
            assert_eq!(*width > 0, w[i] > 0.0 && w[i].is_finite());
            assert_eq!(s.light_alias[i].probability, (*width as f64 / RANGE as f64) as f32);
        }
    }
}

/// Widths follow the weights within one unit each, plus the unit that every positive weight is given. Killed by:
/// dealing out the rest to one item, f32 sums.
#[test]
fn widths_follow_the_weights() {
    let mut rng = SplitMix(11);
    for n in [1usize, 2, 3, 1024, 1 << 20] {
        let w = weights(n, &mut rng);
        let total: f64 = w.iter().sum();
        let positive = w.iter().filter(|w| **w > 0.0).count() as f64;
        let widths = alias::widths(&w).unwrap();
        assert_eq!(widths.iter().sum::<u64>(), RANGE);
        for (w, width) in w.iter().zip(&widths) {
            let share = w / total * RANGE as f64;
            let bound = 2.0 + share * positive / RANGE as f64 + share * 1e-12;
            assert!((*width as f64 - share).abs() <= bound, "{width} for {share}");
            assert_eq!(*width > 0, *w > 0.0);
        }
        let table = alias::build(&w);
        let sum: f64 = table.iter().map(|a| f64::from(a.probability)).sum();
        assert!((sum - 1.0).abs() < 1e-7);
        assert!(table.iter().enumerate().all(|(i, a)| a.threshold < u32::MAX || a.alias as usize == i));
    }
}

/// Killed by: returning a uniform table.
#[test]
fn nothing_to_choose_gives_an_empty_table_and_no_light() {
    assert!(alias::build(&[]).is_empty());
    assert!(alias::build(&[0.0, -1.0, f64::NAN, f64::INFINITY]).is_empty());
    let s = owner(&[0.0, 0.0]);
    let selector = PowerSelector(s.scene());
    let (light, p) = selector.select(Vec3x8::ZERO, Vec3x8::ZERO, U32x8::splat(77), Mask8::all_lanes());
    assert_eq!(p.to_array(), [0.0; 8]);
    assert_eq!(selector.probability(Vec3x8::ZERO, Vec3x8::ZERO, light, Mask8::all_lanes()).to_array(), [0.0; 8]);
}

/// Random maps; the cells' probabilities against numerical integration of what is above the mean. Killed by: omitting
/// the sine, exchanging the rows of a cell, no wrap in the last column, not counting a row's weight in the first table,
/// the mean of texels in place of that over the sphere, half of it, cells below it that are picked.
#[test]
fn map_tables_follow_the_luminance_above_the_mean() {
    let mut rng = SplitMix(12);
    for [w, h] in [[1usize, 2usize], [2, 2], [4, 3], [7, 6], [16, 9]] {
        let texels: Vec<[f32; 3]> = (0..w * h)
            .map(|_| {
                std::array::from_fn(
                    |_| if rng.word().is_multiple_of(3) { 0.0 } else { rng.f64().powi(3) as f32 * 90.0 },
                )
            })
            .collect();
        let map = Map::new(&texels, w, h);
        let tables = environment::map_tables(&texels, w as u32, h as u32);
        assert_eq!(tables.len(), (h - 1) * (w + 1));
        for (k, want) in map.probabilities().into_iter().enumerate() {
            let (i, j) = (k % w, k / w);
            let got = f64::from(tables[j].probability) * f64::from(tables[h - 1 + j * w + i].probability);
            assert!((got - want).abs() <= 1e-6 * want + 1e-7, "cell {i}, {j} of {w} x {h}: {got} for {want}");
        }
        // a factor on all texels, as an edit of the environment brings it, changes nothing
        let brighter: Vec<_> = texels.iter().map(|t| t.map(|x| 4.0 * x)).collect();
        let same = environment::map_tables(&brighter, w as u32, h as u32);
        assert_eq!(bytemuck::cast_slice::<_, u8>(&same), bytemuck::cast_slice::<_, u8>(&tables));
    }
    // even maps, whose rest above the mean is rounding, keep their whole luminance
    let even = environment::map_tables(&[[0.1, 0.3, 0.7]; 60], 10, 6);
    assert!(even.iter().all(|a| a.probability > 0.0));
    assert!(environment::map_tables(&[[0.0; 3]; 12], 4, 3).is_empty());
}

/// Each power against its closed form, the map's against a dense grid of directions. Killed by: pi -> 1 in any of
/// them, the scale left out, the environment's integral taken over a hemisphere.
#[test]
fn lights_weigh_their_power() {
    use std::f64::consts::PI;
    let mut rng = SplitMix(13);
    let (w, h) = (6usize, 5usize);
    let texels: Vec<[f32; 3]> = (0..w * h).map(|_| std::array::from_fn(|_| rng.f64() as f32)).collect();
    let map = Map::new(&texels, w, h);
    let n = 600;
    let mut integral = 0.0;
    for i in 0..n {
        for j in 0..n {
            let y = 1.0 - 2.0 * (f64::from(j) + 0.5) / f64::from(n);
            let (r, phi) = ((1.0 - y * y).sqrt(), 2.0 * PI * (f64::from(i) + 0.5) / f64::from(n));
            integral += luminance(map.lookup([r * phi.cos(), y, r * phi.sin()]));
        }
    }
    integral *= 4.0 * PI / f64::from(n) / f64::from(n);
    let e = Environment {
        kind: EnvironmentKind::Map as u32,
        light: 3,
        width: w as u32,
        height: h as u32,
        to_local: IDENTITY,
        radiance: [2.5; 3],
    };
    let c = [3.0f32, 1.0, 0.25];
    let y = luminance(wide(c));
    let light = |k: &LightKind| Light { kind: *k as u32, area: 0.75, emission: c, ..Light::zeroed() };
    let lights: Vec<Light> = LightKind::ALL.iter().map(light).collect();
    let radius = 3.0;
    let got = environment::light_weights(&lights, Some(&e), &texels, radius);
    let disk = PI * radius * radius;
    assert_eq!(got.len(), lights.len());
    for (got, kind) in got.iter().zip(LightKind::ALL) {
        let want = match kind {
            LightKind::Area => PI * 0.75 * y,
            LightKind::Environment => disk * 2.5 * integral,
            LightKind::Point => 4.0 * PI * y,
            LightKind::Directional | LightKind::Sun => disk * y,
            // without a cone or a size: nothing
            LightKind::Spot | LightKind::Sphere | LightKind::Rectangle | LightKind::Disk => continue,
        };
        assert!((got / want - 1.0).abs() < 1e-5, "{}: {got} for {want}", kind.name());
    }
    // A spot's falloff squared, integrated over the sphere by the midpoint rule.
    for (outer, inner) in [(2.0f32, 0.0f32), (0.5, 0.125), (0.01, 0.01)] {
        let spot = Light { params: [0.0, 0.0, 1.0, outer, inner, 0.0], ..light(&LightKind::Spot) };
        let got = environment::light_weights(&[spot], None, &[], radius)[0];
        let (steps, [outer, inner]) = (100_000, [outer, inner].map(f64::from));
        let falloff = |k: i32| {
            let x = (f64::from(k) + 0.5) / f64::from(steps) * outer;
            if x < inner { 1.0 } else { ((outer - x) / (outer - inner)).powi(2) }
        };
        let want = 2.0 * PI * y * outer / f64::from(steps) * (0..steps).map(falloff).sum::<f64>();
        assert!((got / want - 1.0).abs() < 1e-4, "spot {outer} {inner}: {got} for {want}");
    }
    // radiance times pi times the area, of both sides where there are two
    for (kind, params, area) in [
        (LightKind::Sphere, [1.5, 0.0, 0.0, 0.0, 0.0, 0.0], 4.0 * PI * 2.25),
        (LightKind::Rectangle, [0.0, 1.5, 2.0, 0.5, 0.0, 0.0], 2.0 * 2.5),
        (LightKind::Disk, [0.0, 0.6, 0.8, 1.5, 0.0, 0.0], PI * 2.25),
    ] {
        for (triangle, sides) in [(0, 1.0), (SHAPE_TWO_SIDED, 2.0), (SHAPE_HIDDEN, 1.0)] {
            let shape = Light { params, triangle, ..light(&kind) };
            let got = environment::light_weights(&[shape], None, &[], radius)[0];
            let sides = if kind == LightKind::Sphere { 1.0 } else { sides };
            let want = PI * area * sides * y;
            assert!((got / want - 1.0).abs() < 1e-6, "{}: {got} for {want}", kind.name());
        }
    }
    let constant = Environment { kind: EnvironmentKind::Constant as u32, radiance: c, ..e };
    let got = environment::light_weights(&[light(&LightKind::Environment)], Some(&constant), &[], radius)[0];
    assert!((got / (disk * 4.0 * PI * y) - 1.0).abs() < 1e-12);
}
