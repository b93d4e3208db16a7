//! Hard scenes, rendered small with every strategy of roulette: never a NaN, every bound that was met is known, and the
//! mean is that of a closed form (`croupier_tests::hard::torture` has the scenes).
//!
//! Each mean is within 5 standard errors of the expectation (one false alarm in 1.7e6), and the standard error must be
//! below the stated part of it. Seeds are fixed.

use croupier_tests::hard::torture::{self, Hard, strategies};

/// Standard errors that a mean may be off by.
const SIGMAS: f64 = 5.0;

/// Renders with every strategy.
#[track_caller]
fn check(scenes: &[Hard]) {
    for hard in scenes {
        for (strategy, seed) in strategies().iter().zip(100..) {
            let r = hard.render(strategy, seed);
            r.numbers.assert_none(&r.what);
            assert_eq!(r.unexplained, None, "{}", r.what);
            let Some([mean, error]) = r.mean else { continue };
            let (what, e) = (r.what, &hard.expected);
            println!("{what}: {mean} +- {error:.1e}, expected {}", e.mean);
            assert!(error <= e.power * e.scale(), "{what}: {mean} +- {error} tells nothing");
            let off = (mean - e.mean).abs();
            assert!(off <= SIGMAS * error + e.rounding * e.scale(), "{what}: {mean} +- {error}, expected {}", e.mean);
        }
    }
}

/// Killed by: NaN from a normal of length 0, self-hits that trap light, a hit with no finite position.
#[test]
fn needles_and_slivers() {
    check(&torture::needles_and_slivers(1));
}

/// Killed by: a leak between slivers, an offset that leaves the box.
#[test]
fn slivers_that_close_a_box() {
    check(&torture::slivers_that_close_a_box());
}

/// Killed by: an offset that is too small for coplanar neighbours.
#[test]
fn coplanar_layers() {
    check(&torture::coplanar_layers());
}

/// Killed by: an offset of a fixed length, one that jumps the gap.
#[test]
fn thin_gaps() {
    check(&torture::thin_gaps());
}

/// Killed by: offsets that do not grow with the position (self-hits), or grow beyond the box.
#[test]
fn far_from_the_origin() {
    check(&torture::far_from_the_origin());
}

/// Killed by: an offset of a fixed length, an epsilon in world units.
#[test]
fn tiny_and_huge_boxes() {
    check(&torture::tiny_and_huge_boxes());
}

/// Killed by: the index of the wrong side, light lost between sides.
#[test]
fn nested_dielectrics() {
    check(&torture::nested_dielectrics());
}

/// Killed by: tables that lose a narrow row, a density without sin theta.
#[test]
fn an_environment_of_one_hot_texel() {
    check(&torture::an_environment_of_one_hot_texel());
}

/// Killed by: 0 / 0 in factors or relMSE.
#[test]
fn a_picture_without_variance() {
    check(&torture::a_picture_without_variance());
}

/// Killed by: 0 / 0 in a mean of 0, a light table of weights 0.
#[test]
fn a_black_picture() {
    check(&torture::a_black_picture());
}
