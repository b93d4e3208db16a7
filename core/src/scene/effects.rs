//! Which effects a scene calls for.

use super::blob::MaterialKind;

/// A set of effects, one bit each; bits 0..16 are material kinds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Effects(pub u32);

macro_rules! effects {
    ($($(#[$doc:meta])* $name:ident = $bit:expr, $text:literal;)*) => {
        impl Effects {
            $($(#[$doc])* pub const $name: Self = Self(1 << $bit);)*
            /// Every effect with its name.
            pub const NAMES: &'static [(Self, &'static str)] = &[$((Self::$name, $text)),*];
        }
    };
}

effects! {
    /// Diffuse reflection.
    DIFFUSE = 0, "diffuse";
    /// Perfect mirror.
    MIRROR = 1, "mirror";
    /// Smooth conductor.
    CONDUCTOR = 2, "conductor";
    /// GGX conductor.
    ROUGH_CONDUCTOR = 3, "roughconductor";
    /// Smooth dielectric interface.
    DIELECTRIC = 4, "dielectric";
    /// GGX dielectric interface.
    ROUGH_DIELECTRIC = 5, "roughdielectric";
    /// Thin dielectric sheet.
    THIN_DIELECTRIC = 6, "thindielectric";
    /// Smooth plastic.
    PLASTIC = 7, "plastic";
    /// GGX plastic.
    ROUGH_PLASTIC = 8, "roughplastic";
    /// Index-matched boundary.
    NULL = 9, "null";
    /// Textures.
    TEXTURES = 16, "textures";
    /// Emitting triangles.
    AREA_LIGHTS = 17, "area lights";
    /// Lat-long environment map.
    ENVIRONMENT = 18, "environment map";
    /// Constant environment.
    CONSTANT = 19, "constant environment";
    /// Point or directional lights.
    DELTA_LIGHTS = 20, "point and directional lights";
    /// Thin lens.
    LENS = 21, "thin lens";
    /// Interpolated shading normals.
    SMOOTH_NORMALS = 22, "shading normals";
}

impl Effects {
    /// Union.
    pub const fn with(self, o: Self) -> Self {
        Self(self.0 | o.0)
    }

    /// Is every effect of `o` in `self`?
    pub const fn contains(self, o: Self) -> bool {
        self.0 & o.0 == o.0
    }

    /// Is any effect of `o` in `self`?
    pub const fn intersects(self, o: Self) -> bool {
        self.0 & o.0 != 0
    }

    /// The effect of a material kind.
    pub const fn of_material(kind: MaterialKind) -> Self {
        Self(1 << kind as u32)
    }
}
