//! Russian roulette and splitting: how many samples a vertex gets.
//!
//! A strategy gives a real factor `s` per lane; [`comb()`] rounds the factors of a packet to sample counts with
//! E\[n\] = s. Every estimate is divided by `s`, never by `n`, so it is unbiased for any positive `s` that was fixed
//! before the samples were drawn (EARS, SIGGRAPH 2022, eq. 10). How `s` is learned: docs/LEARNING.md.
//!
//! A new strategy is one file and one line in the table below. Choices among unlike terms, such as scattering or
//! passing in a medium, are [`select`]'s.

mod adrr;
mod adrrs;
mod albedo;
mod bolin_meyer;
mod classic;
mod comb;
mod contribution;
mod ear;
mod ears;
mod fixed;
mod learned;
mod light;
mod none;
mod selection;
mod threshold;
mod throughput;
mod winners;

pub use adrr::Adrr;
pub use adrrs::Adrrs;
pub use albedo::Albedo;
pub use bolin_meyer::BolinMeyer;
pub use classic::Classic;
pub use comb::{COMB_ONE, comb};
pub use contribution::Contribution;
pub use ear::Ear;
pub use ears::Ears;
pub use fixed::Fixed;
pub use learned::{Learned8, Local8, Norm, Space};
pub use none::None;
pub use selection::{Selection8, select};
pub use threshold::Threshold;
pub use throughput::Throughput;
pub use winners::Winners;

use core::fmt;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Smallest factor of an unbiased strategy.
pub const MIN_FACTOR: f32 = 0.05;
/// Largest factor of an unbiased strategy.
pub const MAX_FACTOR: f32 = 20.0;

/// Input of strategies, one vertex per lane.
#[derive(Clone, Copy, Debug)]
pub struct Vertices8 {
    /// Prefix weight: throughput over all factors so far.
    pub beta: Vec3x8,
    /// Weight of the last bounce, `f cos / pdf`; 1 at the first vertex.
    pub last_weight: Vec3x8,
    /// Albedo of this vertex seen from `wo`; 0 unless [`Strategy::needs_albedo`].
    pub albedo: Vec3x8,
    /// Product of the mean albedos of the vertices before this one.
    pub albedo_product: F32x8,
    /// Path segments from the camera; the first vertex has 1.
    pub depth: U32x8,
    /// Phong exponent that corresponds to the material's roughness; 0 unless [`Strategy::needs_shininess`].
    pub shininess: F32x8,
    /// Statistics learned before the iteration.
    pub learned: Learned8,
}

/// Contract of a strategy: a rule for factors.
pub trait RrsStrategy {
    /// Does [`Self::factor`] read `albedo` or `albedo_product`?
    const NEEDS_ALBEDO: bool = false;

    /// Does [`Self::factor`] read `shininess`?
    const NEEDS_SHININESS: bool = false;

    /// Is the factor the most efficient one (EARS, eq. 32), which is also the rule of roulette for next event
    /// estimation ([`crate::Settings::shadow_roulette`])?
    const EFFICIENCY_AWARE: bool = false;

    /// May the factor be 0, so that paths that count end and the picture is biased?
    const BIASED: bool = false;

    /// Does [`Self::factor`] read the picture's part of `learned`?
    const NEEDS_IMAGE: bool = false;

    /// Domain of the local statistics that the strategy learns, if any. They need the albedo and the picture.
    const SPACE: Option<Space> = Option::None;

    /// With these options, is the picture's part of `learned` needed ([`Self::NEEDS_IMAGE`])?
    fn reads_image(&self) -> bool {
        true
    }

    /// Writes the options that follow the colon in the strategy's text: its `parse` reads them back.
    fn write_options(&self, _: &mut fmt::Formatter<'_>) -> fmt::Result {
        Ok(())
    }

    /// Bits of the options: equal strategies have equal ones, and others do not. Those that there are not are 0.
    fn option_bits(&self) -> [u32; 4];

    /// Factor per lane, before clamping to [[`MIN_FACTOR`], [`MAX_FACTOR`]]. Lanes that are not finite count as 1.
    fn factor(&self, v: &Vertices8) -> F32x8;
}

macro_rules! strategies {
    ($($(#[$doc:meta])* $name:ident, $text:literal, $help:literal;)*) => {
        /// Strategy of roulette and splitting, with its parameters.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Strategy { $($(#[$doc])* $name($name)),* }

        impl Strategy {
            /// Names and one-line descriptions of all strategies.
            pub const TABLE: &'static [(&'static str, &'static str)] = &[$(($text, $help)),*];

            /// Name in [`Self::TABLE`].
            pub const fn name(&self) -> &'static str {
                match self { $(Self::$name(_) => $text),* }
            }

            /// Parses `name` or `name:options`; see [`Self::TABLE`].
            pub fn parse(text: &str) -> Result<Self, ParseError> {
                let (name, options) = text.split_once(':').unwrap_or((text, ""));
                match name {
                    $($text => $name::parse(options).map(Self::$name).ok_or(ParseError::Options($text)),)*
                    _ => Err(ParseError::Name),
                }
            }

            /// Does the factor depend on the albedo ([`RrsStrategy::NEEDS_ALBEDO`])?
            pub fn needs_albedo(&self) -> bool {
                // samples are logged over the albedo
                self.space().is_some() || match self { $(Self::$name(_) => <$name as RrsStrategy>::NEEDS_ALBEDO),* }
            }

            /// Does the factor depend on the shininess ([`RrsStrategy::NEEDS_SHININESS`])?
            pub fn needs_shininess(&self) -> bool {
                match self { $(Self::$name(_) => <$name as RrsStrategy>::NEEDS_SHININESS),* }
            }

            /// Does the factor depend on statistics of the picture?
            pub fn needs_image(&self) -> bool {
                self.space().is_some() || match self {
                    $(Self::$name(x) => <$name as RrsStrategy>::NEEDS_IMAGE && x.reads_image()),*
                }
            }

            /// Is the factor the most efficient one ([`RrsStrategy::EFFICIENCY_AWARE`])?
            pub fn is_efficiency_aware(&self) -> bool {
                match self { $(Self::$name(_) => <$name as RrsStrategy>::EFFICIENCY_AWARE),* }
            }

            /// Domain of the local statistics that the strategy learns ([`RrsStrategy::SPACE`]).
            pub fn space(&self) -> Option<Space> {
                match self { $(Self::$name(_) => <$name as RrsStrategy>::SPACE),* }
            }

            /// May the factor be 0, so that the picture is biased?
            pub const fn is_biased(&self) -> bool {
                match self { $(Self::$name(_) => <$name as RrsStrategy>::BIASED),* }
            }

            /// Bits of the options ([`RrsStrategy::option_bits`]).
            pub(crate) fn option_bits(&self) -> [u32; 4] {
                match self { $(Self::$name(x) => x.option_bits()),* }
            }

            /// Factor per lane: unbiased strategies are clamped to [[`MIN_FACTOR`], [`MAX_FACTOR`]], and a factor
            /// that is not finite is 1 (NUMERICS RRS-3).
            #[inline(always)]
            pub fn factor(&self, v: &Vertices8) -> F32x8 {
                self.checked_factor(v).0
            }

            /// [`Self::factor`], and the lanes whose factor was finite.
            #[inline(always)]
            pub(crate) fn checked_factor(&self, v: &Vertices8) -> (F32x8, Mask8) {
                let s = match self { $(Self::$name(x) => x.factor(v)),* };
                let finite = s.is_finite();
                let s = finite.select(s, F32x8::ONE);
                (if self.is_biased() { s } else { s.clamp(MIN_FACTOR, MAX_FACTOR) }, finite)
            }
        }

        /// The text that [`Strategy::parse`] reads back, without options that are the default.
        impl fmt::Display for Strategy {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(self.name())?;
                match self {
                    $(Self::$name(x) if $name::parse("") != Some(*x) => {
                        f.write_str(":")?;
                        x.write_options(f)
                    })*
                    _ => Ok(()),
                }
            }
        }
    };
}

strategies! {
    /// No roulette: 1 up to `max_depth`.
    None, "none", "factor 1; paths end at max_depth only";
    /// Deterministic termination, biased.
    Threshold, "threshold", "threshold[:EPS]: 1 while throughput > EPS, else the path ends (biased on purpose)";
    /// Roulette by the last bounce's weight.
    Contribution, "contribution", "largest rgb of the last bounce's weight";
    /// Roulette by throughput.
    Throughput, "throughput", "throughput[:max|luminance|mean[:LO:HI[:START]]]: clamped norm of the throughput";
    /// Roulette by albedo.
    Albedo, "albedo", "albedo[:product]: albedo of the vertex, or of all vertices so far multiplied";
    /// Roulette by throughput times albedo.
    Classic, "classic", "classic[:START[:relative]]: throughput x albedo from the START-th bounce (5), absolute or over the pixel";
    /// Go with the winners.
    Winners, "winners", "winners[:VR:VV]: throughput x albedo x sqrt(VR + VV / (shininess + 1)^2)";
    /// Factors per pixel and path length.
    BolinMeyer, "bolin-meyer", "bolin-meyer[:plain]: most efficient factor per pixel block and path length, learned";
    /// Adjoint-driven roulette.
    Adrr, "adrr", "adjoint-driven roulette: expected contribution over the pixel, weight window, learned";
    /// Adjoint-driven roulette and splitting.
    Adrrs, "adrrs", "adjoint-driven roulette and splitting, learned";
    /// Efficiency-aware roulette.
    Ear, "ear", "ear[:plain]: efficiency-aware roulette, learned; plain trusts its statistics at once";
    /// Efficiency-aware roulette and splitting.
    Ears, "ears", "ears[:plain]: efficiency-aware roulette and splitting, learned; plain trusts its statistics at once";
    /// Constant factor.
    Fixed, "fixed", "fixed:S: the constant factor S at every vertex, 0.05 to 20";
}

impl Default for Strategy {
    fn default() -> Self {
        Self::Classic(Classic::default())
    }
}

/// Reason why a strategy's text is not understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParseError {
    /// The name is not that of any strategy.
    Name,
    /// The options after the colon do not fit the named strategy.
    Options(&'static str),
}

impl fmt::Display for ParseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Name => {
                f.write_str("unknown roulette strategy; known are ")?;
                let mut names = Strategy::TABLE.iter().enumerate();
                names.try_for_each(|(i, (n, _))| write!(f, "{}{n}", if i == 0 { "" } else { ", " }))
            }
            Self::Options(name) => {
                let help = Strategy::TABLE.iter().find(|t| t.0 == *name).map_or("", |t| t.1);
                write!(f, "options of roulette strategy `{name}` not understood; {help}")
            }
        }
    }
}

impl core::error::Error for ParseError {}

/// Number of an option, `default` if the text is empty.
fn number<T: core::str::FromStr>(text: &str, default: T) -> Option<T> {
    if text.is_empty() { Some(default) } else { text.parse().ok() }
}
