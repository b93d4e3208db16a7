//! Densities against samples and against f64, whatever a guide holds.

#![expect(clippy::disallowed_methods, reason = "oracles in f64 have the standard library")]

extern crate std;
mod light;
mod media;
mod saved;

use super::node::UNIFORM;
use super::sphere::{from_square, quantised, to_square};
use super::*;
use crate::rng::Key8;
use crate::sampler::Sampler;
use crate::testing::block;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};
use std::vec::Vec;

const BOUNDS: [[f32; 3]; 2] = [[0.0; 3], [1.0; 3]];
/// Cells of the finest level.
const CELLS: usize = 64 * 64;

struct Random(u64);

impl Random {
    fn next(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        (crate::rng::mix(self.0) >> 32) as u32
    }

    fn unit(&mut self) -> f32 {
        (self.next() >> 8) as f32 / 16_777_216.0
    }

    fn unit8(&mut self) -> F32x8 {
        F32x8::from_fn(|_| self.unit())
    }

    fn words(&mut self) -> [U32x8; 4] {
        [(); 4].map(|()| U32x8::from_fn(|_| self.next()))
    }
}

/// A guide and a log of `bytes` in all.
fn with_guide<R>(bytes: usize, f: impl FnOnce(&mut Guide<'_>, &mut GuideLog<'_>) -> R) -> R {
    let size = GuideSize::within(bytes, 1).expect("room for a guide");
    assert!(size.bytes(1).is_some_and(|b| b <= bytes));
    let (mut shared, at) = block(Guide::layout(size).expect("a size").size);
    let (mut own, other) = block(GuideLog::layout(size).expect("a size").size);
    let mut guide = Guide::new(size, BOUNDS, &mut shared[at..]).expect("a guide");
    f(&mut guide, &mut GuideLog::new(size, &mut own[other..]).expect("a log"))
}

fn middle(guide: &Guide<'_>) -> Guide8 {
    let p = Vec3x8::splat(0.4, 0.4, 0.4);
    guide.at(p, Some(Vec3x8::splat(0.0, 0.0, 1.0)), [F32x8::splat(0.5); 3], Mask8::all_lanes())
}

/// Light from around one direction, and a little from everywhere.
fn learn_spot(guide: &mut Guide<'_>, log: &mut GuideLog<'_>, n: u32, random: &mut Random) {
    log.clear();
    let leaf = middle(guide).leaf.lane(0);
    for i in 0..n {
        let spot = i % 4 != 0;
        let at = if spot { [0.71, 0.33].map(|x| x + 0.01 * random.unit()) } else { [random.unit(), random.unit()] };
        let point = quantised(from_square(at.map(F32x8::splat))).lane(0);
        // as the uniform sphere is sampled: what is bright counts more
        let (square, share) = if spot { (100.0, 200) } else { (1.0, 20) };
        log.add(leaf, share, point, square, 0.08);
    }
    guide.learn(0.75, core::iter::once(&*log));
}

/// Densities of all cells of the finest level.
fn densities(guide: &Guide<'_>, at: &Guide8) -> Vec<f64> {
    let cell = |i: usize| [i % 64, i / 64].map(|k| F32x8::splat((k as f32 + 0.5) / 64.0));
    (0..CELLS).map(|i| f64::from(guide.pdf(at, from_square(cell(i)), Mask8::all_lanes()).lane(3))).collect()
}

/// Mean density times the sphere is 1, and samples have the density that the guide says: a chi-square test over the
/// cells of the finest level, together where fewer than 8 are expected. 400,000 samples; the limit has a probability
/// of 1e-6.
fn assert_samples(guide: &Guide<'_>, random: &mut Random) -> Vec<f64> {
    let at = middle(guide);
    let pdf = densities(guide, &at);
    let area = 4.0 * core::f64::consts::PI / CELLS as f64;
    let integral: f64 = pdf.iter().map(|p| p * area).sum();
    assert!((integral - 1.0).abs() < 1e-5, "the density integrates to {integral}");
    let mut counts = std::vec![0.0; CELLS];
    let packets = 50_000;
    for _ in 0..packets {
        let (d, q) = guide.sample(&at, random.words(), Mask8::all_lanes());
        let again = guide.pdf(&at, d, Mask8::all_lanes());
        let point = quantised(d).to_array();
        for (i, point) in point.into_iter().enumerate() {
            assert!((d.dot(d).lane(i) - 1.0).abs() < 1e-5, "a direction of length {}", d.dot(d).lane(i));
            let cell = (point >> 10 & 63) as usize + 64 * (point >> 26) as usize;
            counts[cell] += 1.0;
            // only on the borders of cells may rounding change the cell
            if q.lane(i) != again.lane(i) {
                let near = [point & 0xffff, point >> 16].map(|x| (x + 2) % 1024 < 5);
                assert!(near[0] || near[1], "density {} became {}", q.lane(i), again.lane(i));
            }
        }
    }
    let (mut chi, mut freedom, mut rest) = (0.0, 0.0, [0.0; 2]);
    for (count, p) in counts.iter().zip(&pdf) {
        let expected = p * area * 8.0 * f64::from(packets);
        let pair = if expected < 8.0 { &mut rest } else { &mut [0.0; 2] };
        (pair[0], pair[1]) = (pair[0] + count, pair[1] + expected);
        if expected >= 8.0 {
            chi += (count - expected) * (count - expected) / expected;
            freedom += 1.0;
        }
    }
    if rest[1] >= 8.0 {
        chi += (rest[0] - rest[1]).powi(2) / rest[1];
        freedom += 1.0;
    }
    // normal approximation of Wilson and Hilferty
    let f = f64::max(freedom - 1.0, 1.0);
    let z = ((chi / f).cbrt() - (1.0 - 2.0 / (9.0 * f))) / (2.0 / (9.0 * f)).sqrt();
    assert!(z < 4.9, "chi-square {chi} with {f} degrees of freedom: z = {z}");
    pdf
}

/// The map against the same formulas in f64, both ways, poles and seams included; equal areas by the mean of the
/// squares of coordinates, 1/3 each. Killed by: a sign, a swapped coordinate, the lower hemisphere unfolded elsewhere,
/// r in place of its square.
#[test]
fn directions_and_the_square_agree() {
    let mut random = Random(1);
    let (mut squares, packets) = ([0.0f64; 3], 40_000);
    let oracle = |[x, y, z]: [f64; 3]| {
        let r = (1.0 - z.abs()).max(0.0).sqrt();
        let v = if x == 0.0 && y == 0.0 { 0.0 } else { y.abs().atan2(x.abs()) / core::f64::consts::FRAC_PI_2 * r };
        let (u, v) = if z < 0.0 { (1.0 - v, 1.0 - (r - v)) } else { (r - v, v) };
        [u * x.signum(), v * y.signum()].map(|c| 0.5 * (c + 1.0))
    };
    for k in 0..packets {
        let at = [random.unit8(), random.unit8()];
        let d = from_square(at);
        let back = to_square(d);
        for i in 0..8 {
            let dir = d.lane(i).map(f64::from);
            let expected = oracle(dir);
            for c in 0..2 {
                let (a, b) = (f64::from(at[c].lane(i)), f64::from(back[c].lane(i)));
                assert!((a - b).abs() < 3e-6, "{at:?} came back as {back:?}");
                // 1 - |z| of the rounded direction cancels at the poles
                assert!(dir[2].abs() > 0.9999 || (b - expected[c]).abs() < 2e-5, "{dir:?}: {b} and {expected:?}");
            }
            (0..3).for_each(|c| squares[c] += dir[c] * dir[c]);
        }
        if k == 0 {
            for axis in 0..6 {
                let d = [0, 1, 2].map(|c| if axis / 2 == c { [1.0f32, -1.0][axis % 2] } else { 0.0 });
                let again = from_square(to_square(Vec3x8::splat(d[0], d[1], d[2]))).lane(0);
                (0..3).for_each(|c| assert!((again[c] - d[c]).abs() < 1e-3, "{d:?} became {again:?}"));
            }
        }
    }
    let n = 8.0 * f64::from(packets);
    assert!(squares.iter().all(|s| (s / n - 1.0 / 3.0).abs() < 0.003), "{:?}", squares.map(|s| s / n));
    assert_eq!(quantised(Vec3x8::splat(f32::NAN, 0.0, 0.0)).lane(0) & 0xffff, 0, "NaN has a cell");
}

/// Killed by: a density that is not the one of the samples on any level, cells that are no part of their node.
#[test]
fn samples_have_their_density() {
    let mut random = Random(2);
    with_guide(1 << 18, |guide, log| {
        let even = assert_samples(guide, &mut random);
        assert!(even.iter().all(|p| (p * 4.0 * core::f64::consts::PI - 1.0).abs() < 1e-6), "nothing learned is even");
        for _ in 0..3 {
            learn_spot(guide, log, 4000, &mut random);
        }
        let pdf = assert_samples(guide, &mut random);
        let most = pdf.iter().copied().fold(0.0, f64::max);
        assert!(most > 30.0, "the tree did not refine: {most}");
        assert!(guide.nodes() > 3, "{} nodes", guide.nodes());
    });
}

/// The density goes with the mean: a cell with 16 times the squares of the others has 4 times their density, and one with
/// the same contributions from four times as many samples too. Killed by: squares in place of their roots, EVEN as a factor,
/// samples that count by their density.
#[test]
fn densities_are_means() {
    with_guide(1 << 18, |guide, log| {
        let leaf = middle(guide).leaf.lane(0);
        for cell in 0..16u32 {
            let point = (cell % 4 * 4 + 2) << 12 | ((cell / 4 * 4 + 2) << 12) << 16;
            let (n, square) = match cell {
                5 => (1, 16.0),
                6 => (4, 1.0),
                _ => (1, 1.0),
            };
            (0..n).for_each(|i| assert!(log.add(leaf, UNKNOWN_SHARE, point, square, 0.25 * (1 + i) as f32)));
        }
        guide.learn(1.0, core::iter::once(&*log));
        let at = middle(guide);
        let pdf = |x: f32, y: f32| {
            let d = from_square([x, y].map(F32x8::splat));
            f64::from(guide.pdf(&at, d, Mask8::all_lanes()).lane(0)) * 4.0 * core::f64::consts::PI
        };
        // 0.95 of the mass is learned: 4 of 22 parts, or 1
        let expected = [4.0, 4.0, 1.0].map(|part| (0.95 * part / 22.0 + 0.05 / 16.0) * 16.0);
        for (found, expected) in [pdf(0.375, 0.375), pdf(0.625, 0.375), pdf(0.875, 0.125)].into_iter().zip(expected) {
            assert!((found - expected).abs() < 2e-3, "{found} where {expected} was expected");
        }
    });
}

/// Killed by: a cell of mass 0 that is sampled, a total of 0 or infinity divided by, numbers at the ends of their
/// range.
#[test]
fn adversarial_contents_are_sampled_as_they_say() {
    let mut random = Random(3);
    for case in 0..6 {
        with_guide(1 << 18, |guide, log| {
            let leaf = middle(guide).leaf.lane(0);
            for _ in 0..3 {
                log.clear();
                for i in 0..200 {
                    let (point, square, pdf) = match case {
                        // nothing, or not finite
                        0 => (random.next(), 0.0, 1.0),
                        1 => (random.next(), f32::NAN, f32::INFINITY),
                        // one hot cell
                        2 => (0x1234_5678, 1.0, 1.0),
                        // ends of the ranges
                        3 => (if i % 2 == 0 { 0 } else { u32::MAX }, f32::MAX, f32::MAX),
                        4 => (random.next(), f32::MIN_POSITIVE, f32::MIN_POSITIVE),
                        // leaves that are not there
                        _ => (random.next(), 1.0, 1.0),
                    };
                    let leaf = if case == 5 { random.next() } else { leaf };
                    log.add(leaf, random.next(), point, square, pdf);
                }
                guide.learn(random.unit(), core::iter::once(&*log));
            }
            assert_samples(guide, &mut random);
            assert!((0.0..=0.75).contains(&guide.mean_fraction()));
        });
    }
}

/// Many leaves in little room: nodes are returned and used again, nothing is lost, samples keep their density.
/// Killed by: a node in two places, a free node that is sampled, a subdivision without room.
#[test]
fn small_guides_run_out_of_room() {
    let mut random = Random(4);
    for bytes in [1 << 14, 1 << 16, 1 << 18] {
        with_guide(bytes, |guide, log| {
            for round in 0..12 {
                log.clear();
                let n = if round % 4 == 3 { 50 } else { 20_000 };
                for _ in 0..n / 8 {
                    let p = Vec3x8::new(random.unit8(), random.unit8(), random.unit8());
                    let d = from_square([random.unit8() * 0.1, random.unit8()]);
                    let n = from_square([random.unit8(), random.unit8()]);
                    let normal = (!random.next().is_multiple_of(4)).then_some(n);
                    let at = guide.at(p, normal, [F32x8::splat(0.5); 3], Mask8::all_lanes());
                    let (found, _) = guide.sample(&at, random.words(), at.known);
                    let point = quantised(Vec3x8::select(at.known, found, d));
                    for i in 0..8 {
                        log.add(at.leaf.lane(i), random.next(), point.lane(i), random.unit(), 0.1);
                    }
                }
                guide.learn(0.5, core::iter::once(&*log));
            }
            assert_samples(guide, &mut random);
            let leaves = guide.tree.leaves() as usize;
            assert!(guide.frozen.iter().take(leaves).all(|l| l.root != UNIFORM || l.share() == 0));
            let (s, most) = (guide.scalars(), guide.size.nodes);
            assert!(s.used <= most && s.free_nodes < s.used);
            assert_eq!(count_nodes(guide) + s.free_nodes + 1, s.used, "nodes in use and free ones are all");
            assert!(bytes > 1 << 14 || guide.refused() > 0, "a guide of {bytes} bytes was never full");
        });
    }
}

/// Nodes that can be reached; fails if one is reached twice.
fn count_nodes(guide: &Guide<'_>) -> u32 {
    let mut seen = std::vec![false; guide.nodes.len()];
    let mut open: Vec<u16> = guide.frozen.iter().take(guide.leaves() as usize).map(|l| l.root).collect();
    while let Some(node) = open.pop().map(usize::from) {
        if node != 0 {
            assert!(!core::mem::replace(&mut seen[node], true), "node {node} is in two places");
            open.extend(guide.nodes[node].child);
        }
    }
    seen.iter().filter(|s| **s).count() as u32
}

/// Pieces of any size have the same bits, and so have shards in their order. Killed by: sums that depend on pieces, a
/// round that begins again, another order of the logs.
#[test]
fn pieces_do_not_change_what_is_learned() {
    let bits = |limit: usize| {
        let mut random = Random(5);
        with_guide(1 << 18, |guide, log| {
            for _ in 0..4 {
                log.clear();
                for _ in 0..3000 {
                    let p = Vec3x8::new(random.unit8(), random.unit8(), random.unit8());
                    let at = guide.at(p, Some(p), [F32x8::splat(0.5); 3], Mask8::all_lanes());
                    log.add(at.leaf.lane(0), random.next(), random.next(), random.unit(), random.unit());
                }
                guide.begin_learning(0.75);
                loop {
                    let mut at = 0;
                    while guide.wants_logs() {
                        let (n, done) = guide.replay(log, at, limit, 1.0);
                        at += n;
                        if done {
                            guide.end_replay();
                        }
                    }
                    if guide.learn_some().1 {
                        break;
                    }
                }
            }
            densities(guide, &middle(guide)).into_iter().map(f64::to_bits).collect::<Vec<_>>()
        })
    };
    let whole = bits(usize::MAX);
    assert!(whole == bits(1) && whole == bits(77));
}

/// A guide that finds the light is used for most samples, one that finds nothing for none, and little is done where
/// little is known. Killed by: shares exchanged, moments not divided by those without a guide, no shrinking,
/// a useless guide that is used.
#[test]
fn shares_follow_what_the_guide_promises() {
    let learned = |n: u32, share: u32| {
        with_guide(1 << 18, |guide, log| {
            let leaf = middle(guide).leaf.lane(0);
            (0..n).for_each(|i| {
                log.add(leaf, share, i << 10, 1.0, 0.1);
            });
            guide.learn(1.0, core::iter::once(&*log));
            middle(guide).fraction.lane(0)
        })
    };
    assert!(learned(1000, 250) >= 0.625, "the guide finds what the BSDF does not");
    assert_eq!(learned(1000, 2), 0.0, "the guide finds nothing");
    assert_eq!(learned(1000, 127), 0.75, "both are the same: it costs nothing, and the rest of the path may gain");
    // 2 + 2 / (1 - g) is within a tenth of 4 up to 1/6
    assert_eq!(learned(2, 127), 0.125, "the same, but two samples tell little");
    assert_eq!(learned(1000, UNKNOWN_SHARE), 0.0, "nothing is known");
    assert!(learned(1, 250) < 0.3, "one sample tells little");
    // a third of the squares is the BSDF's alone, and the rest has a 50th of the guide's density from it: the least of
    // 1/3 / (1 - g) + 2/3 / 50 / g is at 1/6
    let half = with_guide(1 << 18, |guide, log| {
        let leaf = middle(guide).leaf.lane(0);
        for i in 0..3000u32 {
            log.add(leaf, if i % 3 == 0 { 0 } else { 249 }, i << 10, 1.0, 0.1);
        }
        guide.learn(1.0, core::iter::once(&*log));
        middle(guide).fraction.lane(0)
    });
    assert!((0.125..=0.25).contains(&half), "{half}");
}

/// The share to guide does not depend on how many samples were guided: directions of the same light as in the test above,
/// drawn by a mixture in which all samples, a tenth of them or none are guided. Killed by: a part that is left out, counted
/// twice or of other samples.
#[test]
fn shares_do_not_depend_on_the_part_that_is_guided() {
    for part in [1.0_f32, 0.1, 0.0] {
        let found = with_guide(1 << 18, |guide, log| {
            let leaf = middle(guide).leaf.lane(0);
            (0..1000).for_each(|i| {
                log.add(leaf, 250, i << 10, 1.0, 0.1);
            });
            guide.learn(1.0, core::iter::once(&*log));
            let overall = middle(guide).fraction.lane(0) * part;
            assert!(part == 0.0 || overall > 0.06, "{overall}");
            log.clear();
            for i in 0..3000u32 {
                let share = if i % 3 == 0 { 0 } else { 249 };
                let t = (share as f32 + 0.5) / 255.0;
                let square = (1.0 - t) / (overall * t + (1.0 - overall) * (1.0 - t));
                log.add(leaf, share, i << 10, square, 0.1);
            }
            guide.begin_learning(0.0);
            while !guide.learn_some().1 {
                if guide.wants_logs() {
                    guide.replay(log, 0, usize::MAX, part);
                    guide.end_replay();
                }
            }
            middle(guide).fraction.lane(0)
        });
        assert!((0.125..=0.25).contains(&found), "{found} where {part} of the samples are guided");
    }
}

/// A full log is a uniform sample of what was offered: one of 64, of which each eighth of what was offered keeps as many,
/// about ten, standard deviation 3. Killed by: the first ones kept, the last ones kept, a weight that forgets those
/// that are lost.
#[test]
fn full_logs_keep_a_random_part() {
    let size = GuideSize::within(1 << 14, 4).expect("a size");
    let mut kept = [0u32; 8];
    let (mut own, at) = block(GuideLog::layout(size).expect("a size").size);
    let mut log = GuideLog::new(size, &mut own[at..]).expect("a log");
    let room = size.hits();
    log.clear();
    let all = 64 * room;
    let lost = (0..all).filter(|i| !log.add(0, 0, *i, 1.0, 1.0)).count();
    assert_eq!((log.len() as u32, lost as u32), (room, all - room));
    assert_eq!(log.weight(), 64.0);
    log.hits().iter().for_each(|h| kept[(h.point / (8 * room)) as usize & 7] += 1);
    let mean = f64::from(room) / 8.0;
    assert!(kept.iter().all(|k| (f64::from(*k) / mean - 1.0).abs() < 1.0), "{kept:?}, mean {mean}");
    assert!(log.bytes().len() == 12 * room as usize && GuideLog::unsound(log.bytes()).is_none());
    let nan = [0u8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xc0, 0x7f];
    assert_eq!(GuideLog::unsound(&nan), Some(0), "NaN is no square");
}

/// 65,000 contributions are fewer than 65,536; with three quarters of them and 20,000 more there are 68,750. Killed by: a
/// number that is never reached, or always, leaves that are left out.
#[test]
fn contributions_are_counted() {
    with_guide(1 << 18, |guide, log| {
        let mut random = Random(9);
        learn_spot(guide, log, 65_000, &mut random);
        assert!(guide.has_learned_from(64_000.0) && !guide.has_learned_from(ENOUGH));
        learn_spot(guide, log, 20_000, &mut random);
        assert!(guide.leaves() > shared::ROOTS && guide.has_learned_from(ENOUGH) && !guide.has_learned_from(69_000.0));
    });
}

/// Keys of vertices sample as random words do. Killed by: words of a key that go together.
#[test]
fn keys_choose_evenly() {
    with_guide(1 << 18, |guide, _| {
        let at = middle(guide);
        let mut counts = [0u32; 16];
        for k in 0..4096u32 {
            let camera = Key8::camera(1, U32x8::from_fn(|i| 8 * k + i as u32), U32x8::splat(0));
            let key = camera.next_vertex(Sampler::Hashed, U32x8::splat(1));
            let (d, _) = guide.sample(&at, key.guided_direction(Sampler::Hashed), Mask8::all_lanes());
            quantised(d).to_array().iter().for_each(|p| counts[(p >> 14 & 3 | p >> 30 << 2) as usize] += 1);
        }
        // 2048 each, standard deviation 44
        assert!(counts.iter().all(|c| c.abs_diff(2048) < 220), "{counts:?}");
    });
}
