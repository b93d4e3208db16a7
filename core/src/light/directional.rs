//! Parallel light from infinity.
//!
//! | parameter | unit | range |
//! |---|---|---|
//! | `vector` | unit direction towards the light, world space | |
//! | `emission` | irradiance on a facing surface | >= 0 |

use super::{Chosen, LightSample8};
use croupier_simd::{F32x8, Mask8};

#[inline(always)]
pub(super) fn sample(light: &Chosen) -> LightSample8 {
    LightSample8 {
        wi: light.vector,
        radiance: light.emission,
        pdf: F32x8::ONE,
        delta: Mask8::all_lanes(),
        infinite: Mask8::all_lanes(),
        valid: Mask8::all_lanes(),
        ..LightSample8::NONE
    }
}
