//! Kinds of vertices whose statistics are kept apart: one row of the table below and one rule in [`VertexKind8::of`]
//! each. The number of octrees follows from the table.

use croupier_simd::{Mask8, U32x8};

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident;)*) => {
        /// Kind of a path vertex in the cache: each has an octree of its own.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u32)]
        pub enum VertexKind { $($(#[$doc])* $name),* }

        impl VertexKind {
            /// All kinds, in the order of their octrees.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];
        }
    };
}

kinds! {
    /// Diffuse vertices behind the first, keyed by the shading normal.
    Diffuse;
    /// All others behind the first, keyed by the direction that their reflection depends on.
    Glossy;
    /// Diffuse first vertices of a path. Their values are in units of their pixel.
    FirstDiffuse;
    /// All other first vertices of a path. Their values are in units of their pixel.
    FirstGlossy;
    /// Vertices in media behind the first, keyed by the viewing direction.
    Medium;
    /// First vertices of a path in media. Their values are in units of their pixel.
    FirstMedium;
}

/// Number of octrees, one for each kind.
pub(super) const ROOTS: u32 = VertexKind::ALL.len() as u32;

/// Kinds of eight vertices. No lane can hold anything but a row of [`VertexKind::ALL`], so look-ups need no check.
#[derive(Clone, Copy, Debug)]
pub struct VertexKind8(U32x8);

impl VertexKind8 {
    /// One kind in all lanes.
    pub fn splat(kind: VertexKind) -> Self {
        Self(U32x8::splat(kind as u32))
    }

    /// Kind `f(i)` in lane `i`.
    pub fn from_fn(mut f: impl FnMut(usize) -> VertexKind) -> Self {
        Self(U32x8::from_fn(|i| f(i) as u32))
    }

    /// Kinds by what sets them apart: vertices of diffuse materials, in media, and first vertices of a path.
    #[inline(always)]
    pub fn of(diffuse: Mask8, in_medium: Mask8, first: Mask8) -> Self {
        let of = |diffuse_kind: VertexKind, medium: VertexKind, glossy: VertexKind| {
            let surface = U32x8::select(diffuse, Self::splat(diffuse_kind).0, Self::splat(glossy).0);
            U32x8::select(in_medium, Self::splat(medium).0, surface)
        };
        let at_first = of(VertexKind::FirstDiffuse, VertexKind::FirstMedium, VertexKind::FirstGlossy);
        Self(U32x8::select(first, at_first, of(VertexKind::Diffuse, VertexKind::Medium, VertexKind::Glossy)))
    }

    /// Number of each lane's octree.
    #[inline(always)]
    pub(super) fn octree(self) -> U32x8 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a row whose number is not its place in the table, the two masks exchanged.
    #[test]
    fn kinds_follow_from_material_and_depth() {
        for (i, kind) in VertexKind::ALL.iter().enumerate() {
            assert_eq!(*kind as usize, i);
        }
        let (diffuse, first) = (Mask8::from_bits(0b0101), Mask8::from_bits(0b0011));
        let in_medium = Mask8::from_bits(0b11_0000);
        let found = VertexKind8::of(diffuse, in_medium, first | Mask8::from_bits(0b1_0000)).octree().to_array();

        let expected = [
            VertexKind::FirstDiffuse,
            VertexKind::FirstGlossy,
            VertexKind::Diffuse,
            VertexKind::Glossy,
            VertexKind::FirstMedium,
            VertexKind::Medium,
        ]
        .map(|k| k as u32);
        assert_eq!(found[..6], expected);
        assert_eq!(VertexKind8::from_fn(|i| VertexKind::ALL[i & 3]).octree().to_array()[5], VertexKind::Glossy as u32);
    }
}
