//! The choice between scattering and a null collision, for three channels at once.
//!
//! Tentative collisions come with the density M of a majorant, the same for all channels. At one of them
//! x_s,c = sigma_s,c / M of channel c scatters, x_a,c = sigma_a,c / M is absorbed, and the rest, x_n,c, goes on as if
//! nothing were there. Two of the three terms go on: one is chosen by the generalised selection estimator
//! ([`crate::rrs::select`]) with importances that sum over the channels what the path would carry on,
//!
//! ```text
//! I_k = sum_c b_c w_c x_k,c,   p_k = I_k / (I_s + I_n),   w_c <- w_c x_k,c / p_k        k = s, n
//! ```
//!
//! where b_c is the magnitude of the path's weight when the flight begins, and w_c the factor gathered since. Absorption
//! lowers both importances alike, and never ends a path by itself.
//!
//! *Unbiased* in each channel: E of the new w_c is w_c (x_s,c + x_n,c), each part with the choice that it belongs to,
//! and a choice of probability 0 has w_c x_k,c = 0 in every channel with b_c > 0.
//!
//! *Bounded.* Whichever k is chosen, sum_c b_c w_c becomes (I_s + I_n) = sum_c b_c w_c (1 - x_a,c): the sum is what it
//! was, less what is absorbed. So it never grows, and no channel ever exceeds sum_c b_c / b_c: 3 for a white path.
//!
//! *It is spectral multiple importance sampling* (Miller, Georgiev and Jarosz 2019) *by the balance heuristic over the
//! channels*, with no more state than w: without absorption w_c is the product of x_k,c over the choices so far, divided
//! by their probabilities. These telescope: the probability of the sequence is sum_c b_c prod x_k,c / sum_c b_c, which
//! is that of drawing a channel by b and then choosing by it alone; and w_c is prod x_k,c over that mixture, the
//! one-sample estimator with the balance heuristic. Densities of distances are common to the channels and cancel.
//! Kutz et al. 2017 ("Spectral and decomposition tracking") choose by histories of weights as well, bounded by other
//! means.
//!
//! *Dead channels.* Where b_c w_c is 0 the majorant of channel c is not needed: M is the largest extinction of the other
//! channels. A medium that is opaque in red only costs no steps once red is gone. In homogeneous media the channel of
//! the largest extinction is gone after one null collision, so that a flight has at most three.
//!
//! A scattering leaves the albedo out: w_c gets x_s,c + x_a,c in place of x_s,c, and the caller multiplies by
//! sigma_s,c / sigma_t,c where it samples the phase function. The bounds above hold for the product.

use super::coefficients::Media8;
use crate::rrs::select;
use croupier_simd::{F32x8, Mask8, Vec3x8};

/// Shares of a path's weight below this are no part of it: `1 / share` would overflow.
const MIN_SHARE: f32 = 1e-30;

/// Factors on the weights of paths during a flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weights8 {
    /// b_c over the largest of them.
    share: Vec3x8,
    /// w_c; 0 in channels that are gone.
    pub(super) weight: Vec3x8,
    /// Radiance met, without the path's weight.
    pub(super) emitted: Vec3x8,
    /// Largest extinction coefficient of the channels that are left.
    pub(super) sigma: F32x8,
}

impl Weights8 {
    /// Factors 1 in the channels in which paths have a weight.
    #[inline(always)]
    pub(super) fn new(media: &Media8, beta: Vec3x8) -> Self {
        let finite = |b: F32x8| b.is_finite().zero_unless(b.abs());
        let b = beta.map(finite);
        let share = b / b.max_component();
        let weight = share.map(|s| s.ge(F32x8::splat(MIN_SHARE)).zero_unless(F32x8::ONE));
        Self { share, weight, emitted: Vec3x8::ZERO, sigma: media.largest(weight) }
    }

    /// Lanes in which a channel is left.
    #[inline(always)]
    pub(super) fn alive(&self) -> Mask8 {
        self.weight.any_positive()
    }

    /// A tentative collision of `lanes` where the density is `fraction` of the majorant: adds the emission, chooses by
    /// `u`, updates the factors. Returns the lanes that scatter; those that lose all their channels are not alive
    /// afterwards.
    #[inline(always)]
    pub(super) fn collide(&mut self, media: &Media8, fraction: F32x8, u: F32x8, lanes: Mask8) -> Mask8 {
        let scale = fraction / self.sigma;
        let (absorbed, scattered) = (media.sigma_a * scale, media.sigma_s * scale);
        // a quotient, not a product: of the largest channel it is 1 exactly, so that a homogeneous medium takes it away
        let real = (media.sigma_t / self.sigma) * fraction;
        // rounding may take a density above its majorant (NUMERICS MED-6)
        let null = real.map(|x| F32x8::ZERO.max(1.0 - x));
        // a channel without weight may have coefficients that overflow
        let emitted = self.weight * absorbed * media.emission;
        let dead = |w: F32x8, e: F32x8| w.gt(F32x8::ZERO).zero_unless(e);
        let emitted =
            Vec3x8::new(dead(self.weight.x, emitted.x), dead(self.weight.y, emitted.y), dead(self.weight.z, emitted.z));
        self.emitted += emitted.zero_unless(lanes);
        let carried = self.share * self.weight;
        let sum = |x: Vec3x8| {
            let of = |b: F32x8, x: F32x8| b.gt(F32x8::ZERO).zero_unless(b * x);
            of(carried.x, x.x) + of(carried.y, x.y) + of(carried.z, x.z)
        };
        let selection = select([sum(scattered), sum(null)], u);
        let scatters = selection.chose(0);
        let factor = Vec3x8::select(scatters, real, null) * selection.scale;
        let weight = (self.weight * factor).zero_unless(selection.any);
        // a channel whose share underflows is gone
        let left = |w: F32x8, share: F32x8| (share * w).gt(F32x8::ZERO).zero_unless(w);
        let s = self.share;
        let weight = Vec3x8::new(left(weight.x, s.x), left(weight.y, s.y), left(weight.z, s.z));
        self.weight = Vec3x8::select(lanes, weight, self.weight);
        self.sigma = lanes.select(media.largest(self.weight), self.sigma);
        scatters & lanes
    }
}

/// Single-scattering albedo; 0 in channels without extinction.
#[inline(always)]
pub(super) fn albedo(media: &Media8) -> Vec3x8 {
    let of = |s: F32x8, t: F32x8| t.gt(F32x8::ZERO).zero_unless(s / t);
    let (s, t) = (media.sigma_s, media.sigma_t);
    Vec3x8::new(of(s.x, t.x), of(s.y, t.y), of(s.z, t.z))
}
