//! Effects that a scene calls for. Those of materials, lights and environments follow from their tables in
//! [`super::blob`].

use super::blob::{EnvironmentKind, LightKind, MaterialKind, environment_table, light_table, material_table};
use crate::bits::bit_set;

/// A set of effects, one bit each; bits 0..16 are material kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effects(pub u32);

/// Bits for material kinds.
const MATERIAL_BITS: usize = 16;

macro_rules! materials {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $name:literal, $effect:ident,
        transmissive: $transmissive:literal, delta: $delta:literal, [$($parameter:ident),*];)*) => {
        bit_set!(Effects);

impl Effects {
            $($(#[$doc])* pub const $effect: Self = Self(1 << $number);)*
            /// The effects of all material kinds.
            pub const ALL_MATERIALS: Self = Self(0 $(| 1 << $number)*);
        }

        const MATERIALS: &[(Effects, &str)] = &[$((Effects::$effect, $name)),*];
    };
}
material_table!(materials);

macro_rules! effects {
    ($($(#[$doc:meta])* $name:ident = $bit:expr, $text:literal;)*) => {
        impl Effects {
            $($(#[$doc])* pub const $name: Self = Self(1 << $bit);)*
        }

        const OTHERS: &[(Effects, &str)] = &[$((Effects::$name, $text)),*];
    };
}

effects! {
    /// Textures.
    TEXTURES = 16, "textures";
    /// Emitting triangles.
    AREA_LIGHTS = 17, "area lights";
    /// Lat-long environment map.
    ENVIRONMENT = 18, "environment map";
    /// Constant environment.
    CONSTANT = 19, "constant environment";
    /// Lights that no scattered ray finds: point, directional, spot lights and suns.
    DELTA_LIGHTS = 20, "point, directional, spot and sun lights";
    /// Thin lens.
    LENS = 21, "thin lens";
    /// Interpolated shading normals.
    SMOOTH_NORMALS = 22, "shading normals";
    /// Participating media.
    MEDIA = 23, "media";
    /// Media with density grids.
    GRID_MEDIA = 24, "density grids";
    /// Textures whose alpha cuts holes.
    ALPHA = 25, "alpha cut-outs";
    /// Compensation of the energy that rough surfaces lose.
    MULTIPLE_SCATTERING = 26, "multiple scattering";
    /// Instances of objects.
    INSTANCES = 27, "instances";
    /// Instances that move while the shutter is open.
    MOTION = 28, "motion blur";
    /// Normal maps.
    NORMAL_MAPS = 29, "normal maps";
    /// Orthographic or panoramic camera.
    PROJECTIONS = 30, "orthographic or panoramic camera";
    /// Lights with shapes of their own: spheres, rectangles, disks.
    SHAPE_LIGHTS = 31, "sphere, rectangle and disk lights";
}

macro_rules! lights {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $name:literal, [$($effect:ident),*], [$($field:ident),*];)*) => {
        impl Effects {
            /// Effects of which a kernel needs at least one to sample lights of a kind.
            pub const fn of_light(kind: LightKind) -> Self {
                match kind { $(LightKind::$kind => Self(0)$(.with(Self::$effect))*),* }
            }
        }
    };
}
light_table!(lights);

macro_rules! environments {
    ($($(#[$doc:meta])* $kind:ident = $number:literal, $name:literal, $effect:ident;)*) => {
        impl Effects {
            /// The effect of an environment kind.
            pub const fn of_environment(kind: EnvironmentKind) -> Self {
                match kind { $(EnvironmentKind::$kind => Self::$effect),* }
            }
        }
    };
}
environment_table!(environments);

const COUNT: usize = MATERIALS.len() + OTHERS.len();

/// Both lists, one after the other.
#[expect(clippy::indexing_slicing, reason = "evaluated when it is compiled")]
const NAMES: [(Effects, &str); COUNT] = {
    let mut all = [(Effects(0), ""); COUNT];
    let mut i = 0;
    while i < COUNT {
        all[i] = if i < MATERIALS.len() { MATERIALS[i] } else { OTHERS[i - MATERIALS.len()] };
        i += 1;
    }
    all
};

// Materials keep to their bits, and no two effects share one.
#[expect(clippy::indexing_slicing, reason = "evaluated when it is compiled")]
const _: () = {
    let (mut i, mut seen) = (0, 0);
    while i < COUNT {
        let bit = NAMES[i].0.0;
        assert!(bit.count_ones() == 1 && seen & bit == 0);
        assert!((bit < 1 << MATERIAL_BITS) == (i < MATERIALS.len()));
        seen |= bit;
        i += 1;
    }
};

impl Effects {
    /// Every effect with its name.
    pub const NAMES: &'static [(Self, &'static str)] = &NAMES;

    /// Effects with which light may pass a surface straight on.
    pub const STRAIGHT: Self = Self::NULL.with(Self::THIN_DIELECTRIC).with(Self::ALPHA).with(Self::MEDIA);

    /// Names of the effects in the set.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.iter().filter(move |(effect, _)| self.contains(*effect)).map(|(_, name)| *name)
    }

    /// The effect of a material kind.
    pub const fn of_material(kind: MaterialKind) -> Self {
        Self(1 << kind as u32)
    }
}
