//! The functions of the standard library for the formulas that baking shares with composing.

use croupier::unstable::compose::Math;

/// Square root, sine, cosine and tangent of the standard library.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Std;

impl Math for Std {
    fn sqrt(x: f64) -> f64 {
        x.sqrt()
    }

    fn sin_cos(x: f64) -> (f64, f64) {
        x.sin_cos()
    }

    fn tan(x: f64) -> f64 {
        x.tan()
    }
}
