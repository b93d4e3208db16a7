//! What is learned from the arrivals of light paths.

use super::*;
use crate::learn::guiding::fraction::LeafSums;

/// A place that all arrivals have.
const P: Vec3x8 = Vec3x8::splat(0.4, 0.4, 0.4);

fn place(guide: &Guide<'_>) -> u32 {
    guide.place(P, Some(Vec3x8::splat(0.0, 0.0, 1.0))).lane(0)
}

/// A point in one of the cells of the first level.
fn in_cell(cell: u32, random: &mut Random) -> u32 {
    let low = random.next() & 0x3fff_3fff;
    (cell % 4) << 14 | (cell / 4) << 30 | low
}

/// Mean densities over that of all directions alike, by cells of the first level.
fn by_cell(guide: &Guide<'_>) -> [f64; 16] {
    let (mut sums, all) = ([0.0; 16], densities(guide, &middle(guide)));
    for (i, pdf) in all.iter().enumerate() {
        sums[i % 64 / 16 + i / 64 / 16 * 4] += pdf * 4.0 * core::f64::consts::PI / 256.0;
    }
    sums
}

/// As many arrivals from each cell, from one of four times the power, have four times the density there. Units do not
/// matter. Samples are guided, and have the density that the guide says. Killed by: the root of the power, power that counts
/// squared, an octree of another normal or place, a share of guided samples that stays 0.
#[test]
fn densities_go_with_power() {
    let mut random = Random(11);
    for scale in [1e-6, 1.0, 1e6] {
        with_guide(1 << 20, |guide, log| {
            log.clear();
            assert!(guide.is_new());
            for i in 0..20_000 {
                let power = if i % 16 == 5 { 4.0 * scale } else { scale };
                log.add_light(place(guide), in_cell(i % 16, &mut random), power, 0.01);
            }
            let leaf = middle(guide).leaf.lane(0);
            (0..100).for_each(|_| assert!(log.add(leaf, UNKNOWN_SHARE, random.next(), 0.3, 0.2)));
            guide.learn(0.75, core::iter::once(&*log));
            assert!(!guide.is_new() && guide.leaves() == 7 + 7 * super::super::light::SUBDIVISIONS);
            // EVEN of the samples are spread evenly
            let expected = |cell| (0.95 * if cell == 5 { 4.0 } else { 1.0 } / 19.0 + 0.05 / 16.0) * 16.0;
            for (cell, found) in by_cell(guide).into_iter().enumerate() {
                let expected = expected(cell);
                assert!((found / expected - 1.0).abs() < 0.02, "cell {cell}: {found} where {expected} was expected");
            }
            let fraction = middle(guide).fraction.lane(0);
            assert!(fraction >= 0.5, "a share of {fraction} guided samples where the BSDF hardly ever finds the light");
            assert_samples(guide, &mut random);
        });
    }
}

/// Camera paths go on from there: they soon outweigh what light paths have found, and keep where light comes from while
/// they have found nothing. Killed by: light paths that are learned from again, masses that are forgotten or never
/// outweighed.
#[test]
fn camera_paths_go_on() {
    let mut random = Random(12);
    with_guide(1 << 20, |guide, log| {
        log.clear();
        for _ in 0..2000 {
            log.add_light(place(guide), in_cell(5, &mut random), 3.0, 0.1);
        }
        let mut found = [0.0; 2];
        for (i, found) in found.iter_mut().enumerate() {
            let leaf = middle(guide).leaf.lane(0);
            for _ in 0..if i == 0 { 4 } else { 8000 } {
                log.add(leaf, UNKNOWN_SHARE, in_cell(10, &mut random), 1.0, 0.08);
            }
            guide.learn(0.75, core::iter::once(&*log));
            *found = by_cell(guide)[5] / by_cell(guide)[10];
            log.clear();
        }
        assert!(found[0] > 50.0 && found[1] < 1.0, "{found:?}");
    });
}

/// Of too few arrivals nothing is learned, whatever camera paths have found. Killed by: arrivals that are taken for
/// directions of camera paths, sums that are left behind.
#[test]
fn few_arrivals_change_nothing() {
    let learned = |arrivals: u32| {
        let mut random = Random(13);
        with_guide(1 << 18, |guide, log| {
            log.clear();
            let leaf = middle(guide).leaf.lane(0);
            (0..500).for_each(|_| assert!(log.add(leaf, 30, random.next(), 1.0, 0.2)));
            (0..arrivals).for_each(|i| log.add_light(place(guide), i << 20, 5.0, 0.1));
            guide.learn(0.75, core::iter::once(&*log));
            (densities(guide, &middle(guide)), middle(guide).fraction.lane(0), guide.leaves(), guide.nodes())
        })
    };
    assert_eq!(learned(0), learned(63));
    assert_ne!(learned(0), learned(64));
}

/// Scalars as memory may hold them: only those that learning can go on with are taken. Killed by: a source that there is
/// not, a level beyond the last.
#[test]
fn forged_sources_are_refused() {
    use crate::learn::guiding::light::{LIGHT, SUBDIVISIONS};
    with_guide(1 << 16, |guide, _| {
        let fits = |source, level| {
            let mut scalars = guide.scalars();
            (scalars.rebuild.source, scalars.rebuild.level) = (source, level);
            scalars.fit(guide.size)
        };
        assert!(fits(0, 0) && fits(LIGHT, SUBDIVISIONS));
        assert!(!fits(LIGHT + 1, 0) && !fits(LIGHT, SUBDIVISIONS + 1) && !fits(1, u32::MAX));
    });
}

/// Killed by: an overflow of squares, a place outside of the octrees, a sum of nothing that is divided by, arrivals that
/// find no room.
#[test]
fn adversarial_arrivals_are_sampled_as_they_say() {
    let mut random = Random(14);
    for bytes in [1 << 14, 1 << 19] {
        for case in 0..7 {
            with_guide(bytes, |guide, log| {
                log.clear();
                for _ in 0..2000 {
                    let power = match case {
                        0 => f32::MAX,
                        1 => f32::MIN_POSITIVE,
                        2 => [f32::NAN, f32::INFINITY, -1.0, 0.0, 1.0][random.next() as usize % 5],
                        3 => [1e-30, 1e15][random.next() as usize % 2],
                        4 => 1e-40,
                        5 => 1e-25,
                        _ => random.unit(),
                    };
                    let pdf = [0.0, 1e-12, f32::MAX, f32::NAN, 0.3][random.next() as usize % 5];
                    log.add_light(random.next(), random.next(), power, pdf);
                    log.add_light(place(guide), random.next(), power, pdf);
                    log.add(random.next(), random.next(), random.next(), power, pdf);
                }
                for _ in 0..3 {
                    guide.learn(random.unit(), core::iter::once(&*log));
                    assert_samples(guide, &mut random);
                    assert!((0.0..=0.75).contains(&middle(guide).fraction.lane(0)));
                    assert!((0.0..=0.75).contains(&guide.mean_fraction()));
                    let leaves = guide.leaves() as usize;
                    assert!(guide.leaves[..leaves].iter().all(LeafSums::is_sound), "case {case}");
                }
            });
        }
    }
}
