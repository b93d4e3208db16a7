//! Kernel profiles: which effects the compiled kernels contain. An effect outside the profile costs nothing, because
//! the compiler removes it; a scene that calls for one outside is refused when the session starts.

use crate::scene::Effects;

/// A set of effects, fixed at compile time. A firmware defines its own; hosts choose one of the closed set here.
pub trait Profile {
    /// Effects that the kernels contain.
    const EFFECTS: Effects;
    /// Name of the profile in reports.
    const NAME: &'static str;
}

/// Diffuse surfaces under area lights or a constant environment.
#[derive(Clone, Copy, Debug)]
pub struct DiffuseOnly;

/// Every effect.
#[derive(Clone, Copy, Debug)]
pub struct Full;

impl Profile for DiffuseOnly {
    const EFFECTS: Effects = Effects::DIFFUSE
        .with(Effects::AREA_LIGHTS)
        .with(Effects::CONSTANT)
        .with(Effects::SMOOTH_NORMALS)
        .with(Effects::TEXTURES);
    const NAME: &'static str = "diffuse";
}

impl Profile for Full {
    const EFFECTS: Effects = Effects(u32::MAX);
    const NAME: &'static str = "full";
}

/// Closed set of profiles, for hosts that load arbitrary scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnyProfile {
    /// [`DiffuseOnly`].
    DiffuseOnly,
    /// [`Full`].
    Full,
}

impl AnyProfile {
    /// Smallest profile of the set that contains `effects`.
    pub const fn smallest(effects: Effects) -> Self {
        if DiffuseOnly::EFFECTS.contains(effects) { Self::DiffuseOnly } else { Self::Full }
    }

    /// Name of the profile in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::DiffuseOnly => DiffuseOnly::NAME,
            Self::Full => Full::NAME,
        }
    }
}
