//! Guides as bytes, and guides that are added to others.

use super::*;

fn saved(guide: &Guide<'_>) -> Vec<u8> {
    let mut bytes = std::vec![0; guide.saved_len()];
    assert_eq!(guide.save(&mut bytes), Ok(bytes.len()));
    bytes
}

fn rehash(bytes: &mut [u8]) {
    let hash = crate::scene::blob::content_hash(&bytes[16..]);
    bytes[8..16].copy_from_slice(&hash.to_le_bytes());
}

/// What was saved is loaded, saves as the same bytes and samples the same; other bytes change nothing, and numbers
/// that are not finite are refused under a hash that is right. Killed by: a leaf in another place, a level left out,
/// an unchecked number, a check after the first change.
#[test]
fn saved_guides_come_back() {
    let mut random = Random(6);
    let bytes = with_guide(1 << 18, |guide, log| {
        for _ in 0..4 {
            learn_spot(guide, log, 9000, &mut random);
        }
        assert!(guide.leaves() > shared::ROOTS, "the leaf was not subdivided");
        let bytes = saved(guide);
        let before = densities(guide, &middle(guide));
        with_guide(1 << 18, |other, log| {
            learn_spot(other, log, 100, &mut random);
            let own = saved(other);
            for at in (64..bytes.len()).step_by(41) {
                let mut bad = bytes.clone();
                bad[at] ^= 0xff;
                assert!(other.load(&bad).is_err() && other.load(&bytes[..at]).is_err());
                for value in [0xffu8, 0x7f] {
                    bad.copy_from_slice(&bytes);
                    let end = (at + 4).min(bad.len());
                    bad[at..end].fill(value);
                    rehash(&mut bad);
                    if other.load(&bad).is_ok() {
                        other.load(&own).expect("its own bytes");
                    }
                }
                assert!(saved(other) == own, "bytes that were refused have changed the guide");
            }
            other.load(&bytes).expect("a saved guide");
            assert!(saved(other) == bytes);
            // sums are an eighth of those that were frozen: where a cell begins may be rounded the other way, by 2^-16 of
            // its node, which on the third level is at most 256 * 16 * 2^-16 / (4 pi) = 0.005 at each end
            for (a, b) in before.iter().zip(densities(other, &middle(other))) {
                assert!((a - b).abs() <= 1e-3 * a + 0.011, "density {a} became {b}");
            }
            assert_samples(other, &mut random);
        });
        bytes
    });
    // the last mass of the last node
    let mut bad = bytes.clone();
    let at = bad.len() - 32 - 4;
    bad[at..at + 4].copy_from_slice(&f32::NAN.to_le_bytes());
    rehash(&mut bad);
    with_guide(1 << 18, |guide, _| {
        assert!(matches!(guide.load(&bad), Err(crate::learn::cache::CacheError::Sum { found, .. }) if found.is_nan()));
    });
    with_guide(1 << 14, |guide, _| {
        assert!(matches!(guide.load(&bytes), Err(crate::learn::cache::CacheError::Full { .. })), "a small one");
    });
}

/// What all trees have learned.
fn learned(guide: &Guide<'_>) -> f64 {
    let used = guide.frozen.iter().take(guide.leaves() as usize);
    used.filter(|f| f.root != UNIFORM).map(|f| f64::from(guide.mass(f.root, 0))).sum()
}

/// Contributions that all leaves have learned from.
fn contributions(guide: &Guide<'_>) -> f64 {
    guide.leaves.iter().take(guide.leaves() as usize).map(|l| f64::from(l.hits)).sum()
}

/// A saved guide that has learned from light around one place of the sphere.
fn learned_at(at: [f32; 2], n: u32, square: f32) -> Vec<u8> {
    let mut random = Random(7);
    with_guide(1 << 18, |guide, log| {
        for _ in 0..4 {
            log.clear();
            let leaf = middle(guide).leaf.lane(0);
            for _ in 0..n {
                let point = at.map(|x| F32x8::splat(x + 0.01 * random.unit()));
                log.add(leaf, 200, quantised(from_square(point)).lane(0), square, 0.08);
            }
            guide.learn(0.75, core::iter::once(&*log));
        }
        saved(guide)
    })
}

/// What guides have learned is added, and nothing lost, whichever is finer and however little room there is; what comes
/// of it samples as its densities say. Killed by: a part of the tree left out or counted twice, shares that are not
/// those of volumes, densities that are not computed anew.
#[test]
fn merged_guides_know_what_both_knew() {
    let mut random = Random(8);
    let (fine, coarse) = (learned_at([0.71, 0.33], 9000, 100.0), learned_at([0.2, 0.8], 200, 1e7));
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-4;
    let alone = |bytes: &[u8]| {
        with_guide(1 << 18, |guide, _| {
            guide.load(bytes).expect("a saved guide");
            let (leaves, sum, loaded) = (guide.leaves(), learned(guide), densities(guide, &middle(guide)));
            let hits = contributions(guide);
            guide.reset();
            guide.merge(bytes).expect("a saved guide");
            assert!(guide.leaves() == leaves && near(learned(guide), sum), "merged into nothing it is itself");
            for (a, b) in loaded.iter().zip(densities(guide, &middle(guide))) {
                assert!((a - b).abs() <= 1e-3 * a + 0.011, "density {a} became {b}");
            }
            assert!(hits > 100.0 && near(contributions(guide), hits) && guide.mean_fraction() > 0.0, "{hits}");
            (leaves, sum, hits)
        })
    };
    let ((leaves, much, many), (few, little, fewer)) = (alone(&fine), alone(&coarse));
    assert!(leaves > few, "both are as fine: {leaves}");
    for (first, second) in [(&fine, &coarse), (&coarse, &fine)] {
        with_guide(1 << 18, |guide, _| {
            guide.load(first).expect("a saved guide");
            guide.merge(second).expect("a saved guide");
            assert!(guide.leaves() == leaves && near(learned(guide), much + little), "{}", learned(guide));
            assert!(near(contributions(guide), many + fewer), "{}", contributions(guide));
            let pdf = assert_samples(guide, &mut random);
            let lit = |[x, y]: [f64; 2]| pdf[(x * 64.0) as usize + 64 * (y * 64.0) as usize];
            let [a, b, dark] = [[0.715, 0.335], [0.205, 0.805], [0.5, 0.1]].map(lit);
            assert!(a > 10.0 * dark && b > 2.0 * dark, "{a}, {b}, elsewhere {dark}");
        });
    }
    with_guide(1 << 14, |guide, _| {
        for (bytes, sum) in [(&coarse, little), (&fine, much + little)] {
            guide.merge(bytes).expect("what fits");
            assert!(near(learned(guide), sum), "{} of {sum}", learned(guide));
        }
        assert_samples(guide, &mut random);
        let before = saved(guide);
        for at in (0..fine.len()).step_by(101) {
            let mut bad = fine.clone();
            bad[at] ^= 0x11;
            assert!(guide.merge(&bad).is_err() && guide.merge(&fine[..at]).is_err());
        }
        assert!(saved(guide) == before, "bytes that were refused have changed the guide");
    });
}
