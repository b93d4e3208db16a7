//! Kernel profiles: which effects the compiled kernels contain. An effect outside the profile costs nothing, because
//! the compiler removes it; a scene that calls for one outside is refused when the session starts.
//!
//! A firmware, or a host that knows its scenes, names the effects that it needs:
//!
//! ```
//! use croupier::unstable::{Effects, profile::Custom};
//!
//! const EFFECTS: Effects = Effects::DIFFUSE.with(Effects::ROUGH_CONDUCTOR).with(Effects::DELTA_LIGHTS);
//! type Tiny = Custom<{ EFFECTS.0 }>;
//! // Session::builder(scene).profile::<Tiny>().build(&plan, block)
//! # use croupier::unstable::profile::Profile;
//! # assert_eq!(Tiny::EFFECTS, EFFECTS);
//! ```
//!
//! A host that loads any scene lets [`AnyProfile`] choose one of a closed set, once per session: every profile of the
//! set is compiled into the program. The set is one table at the end of this file; a row is a profile. What a row must
//! be worth is in docs/EFFECTS.md.

use crate::scene::Effects;
use core::marker::PhantomData;

/// A set of effects, fixed at compile time.
pub trait Profile {
    /// Effects that the kernels contain.
    const EFFECTS: Effects;
    /// Name of the profile in reports.
    const NAME: &'static str;
    /// Do the kernels contain [`Sampler::Sobol`](crate::unstable::Sampler::Sobol)? Settings that ask for it are refused where
    /// they do not.
    const SOBOL: bool = true;
    /// Do the kernels choose lights by the tree of scenes that have one? Without it they choose by power: pictures are as
    /// right, with more noise under many lights.
    const LIGHT_TREES: bool = true;
    /// Do the kernels contain path guiding ([`Learning::guiding`](crate::unstable::learn::Learning::guiding))?
    const GUIDING: bool = false;
    /// The same kernels without path guiding: `Self` for profiles that have none. Shards run them in iterations in which they
    /// neither guide paths nor learn to, so that a program has both. Scenes and samplers outside either are refused.
    type Unguided: Profile;
}

/// The profile `P` without [`Sampler::Sobol`](crate::unstable::Sampler::Sobol), the default: smaller code, for settings
/// with [`Sampler::Hashed`](crate::unstable::Sampler::Hashed).
#[derive(Clone, Copy, Debug)]
pub struct WithoutSobol<P>(PhantomData<P>);

impl<P: Profile> Profile for WithoutSobol<P> {
    const EFFECTS: Effects = P::EFFECTS;
    const NAME: &'static str = P::NAME;
    const SOBOL: bool = false;
    const LIGHT_TREES: bool = P::LIGHT_TREES;
    const GUIDING: bool = P::GUIDING;
    type Unguided = WithoutSobol<P::Unguided>;
}

/// The profile of exactly these effects, given by [`Effects`]' bits, without light trees.
#[derive(Clone, Copy, Debug)]
pub struct Custom<const EFFECTS: u32>;

impl<const EFFECTS: u32> Profile for Custom<EFFECTS> {
    const EFFECTS: Effects = Effects(EFFECTS);
    const NAME: &'static str = "custom";
    const LIGHT_TREES: bool = false;
    type Unguided = Self;
}

/// The profile `P` with path guiding, in builds with the crate's feature `guiding`.
#[derive(Clone, Copy, Debug)]
pub struct Guided<P>(PhantomData<P>);

impl<P: Profile> Profile for Guided<P> {
    const EFFECTS: Effects = P::EFFECTS;
    const NAME: &'static str = P::NAME;
    const SOBOL: bool = P::SOBOL;
    const LIGHT_TREES: bool = P::LIGHT_TREES;
    const GUIDING: bool = cfg!(feature = "guiding");
    type Unguided = P::Unguided;
}

/// Code to run with a profile that is chosen at run time; see [`AnyProfile::dispatch`].
pub trait ProfileVisitor {
    /// Result of the visit.
    type Out;

    /// Called with the profile.
    fn visit<P: Profile + Send + Sync>(self) -> Self::Out;
}

macro_rules! profiles {
    ($($(#[$doc:meta])* $profile:ident = $name:literal, $effects:expr;)*) => {
        $(
            $(#[$doc])*
            #[derive(Clone, Copy, Debug)]
            pub struct $profile;

            impl Profile for $profile {
                const EFFECTS: Effects = $effects;
                const NAME: &'static str = $name;
                type Unguided = Self;
            }
        )*

        /// Closed set of profiles, for hosts that load arbitrary scenes.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum AnyProfile { $($(#[$doc])* $profile),* }

        impl AnyProfile {
            /// Every profile of the set, none after one that contains it.
            pub const ALL: &'static [Self] = &[$(Self::$profile),*];

            /// Name of the profile in reports.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$profile => <$profile as Profile>::NAME),* }
            }

            /// Effects that its kernels contain.
            pub const fn effects(self) -> Effects {
                match self { $(Self::$profile => <$profile as Profile>::EFFECTS),* }
            }

            /// Calls `v` with the profile, once: nothing is chosen after that.
            #[inline(always)]
            pub fn dispatch<V: ProfileVisitor>(self, v: V) -> V::Out {
                match self { $(Self::$profile => v.visit::<$profile>()),* }
            }
        }
    };
}

impl AnyProfile {
    /// First profile of the set that contains `effects`: no other that does is smaller.
    pub const fn smallest(effects: Effects) -> Self {
        let mut rest = Self::ALL;
        while let [first, others @ ..] = rest {
            if first.effects().contains(effects) {
                return *first;
            }
            rest = others;
        }
        Self::Full
    }

    /// [`Self::dispatch`] with path guiding if it is asked for: then the profile is [`Surfaces`] or [`Full`], so that
    /// a host has two more kernels and not one for each profile.
    #[inline(always)]
    pub fn dispatch_guided<V: ProfileVisitor>(self, guided: bool, v: V) -> V::Out {
        match self {
            _ if !guided => self.dispatch(v),
            Self::DiffuseOnly | Self::Surfaces => v.visit::<Guided<Surfaces>>(),
            Self::Full => v.visit::<Guided<Full>>(),
        }
    }
}

// A profile after one that contains it would never be chosen, and some profile must hold every scene.
const _: () = {
    let mut rest = AnyProfile::ALL;
    while let [first, others @ ..] = rest {
        let mut later = others;
        while let [next, more @ ..] = later {
            assert!(!first.effects().contains(next.effects()), "a profile that is never chosen");
            later = more;
        }
        rest = others;
    }
    assert!(AnyProfile::Full.effects().0 == u32::MAX);
};

profiles! {
    /// Diffuse surfaces under area lights or a constant environment.
    DiffuseOnly = "diffuse", Effects::DIFFUSE
        .with(Effects::AREA_LIGHTS)
        .with(Effects::CONSTANT)
        .with(Effects::SMOOTH_NORMALS)
        .with(Effects::TEXTURES);
    /// Every material but the principled one, every light, textures, lens: light that travels straight from one
    /// surface to the next.
    Surfaces = "surfaces", Effects::ALL_MATERIALS
        .without(Effects::PRINCIPLED)
        .with(Effects::TEXTURES)
        .with(Effects::AREA_LIGHTS)
        .with(Effects::ENVIRONMENT)
        .with(Effects::CONSTANT)
        .with(Effects::DELTA_LIGHTS)
        .with(Effects::LENS)
        .with(Effects::SMOOTH_NORMALS);
    /// Every effect.
    Full = "full", Effects(u32::MAX);
}
