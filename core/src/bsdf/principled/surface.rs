//! What textures say of a principled material at a point, and how three words hold it: a waiting vertex has no more
//! room than its reflectance.

use crate::scene::Scene;
use crate::scene::blob::{MATERIAL_CUTOUT, Material, PRINCIPLED_ALPHA, PrincipledRecord, PrincipledTexture};
use crate::texture;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Parameters of principled materials that textures change, per lane.
#[derive(Clone, Copy, Debug)]
pub struct Surface8 {
    /// Base colour.
    pub base: Vec3x8,
    /// Square root of the GGX width.
    pub roughness: F32x8,
    /// Share of metal.
    pub metalness: F32x8,
    /// Share of the dielectric that transmits.
    pub transmission: F32x8,
    /// Strength of the coat.
    pub coat: F32x8,
}

/// The nearest of `levels` equal steps from 0 to 1.
#[inline(always)]
fn level(x: F32x8, levels: u32) -> U32x8 {
    (x.clamp(0.0, 1.0) * levels as f32 + 0.5).to_i32().to_u32()
}

#[inline(always)]
fn value(bits: U32x8, levels: u32) -> F32x8 {
    (bits & U32x8::splat(levels)).to_i32().to_f32() * (1.0 / levels as f32)
}

const BITS_16: u32 = (1 << 16) - 1;
const BITS_11: u32 = (1 << 11) - 1;
const BITS_10: u32 = (1 << 10) - 1;

impl Surface8 {
    /// As the reflectance of a vertex: 16 bits for the square root of each channel of the base colour and for the
    /// roughness, 11 for metalness and transmission, 10 for the coat. 0 and 1 are exact.
    #[inline(always)]
    pub fn pack(&self) -> Vec3x8 {
        let [r, g, b] = [self.base.x, self.base.y, self.base.z].map(|c| level(c.safe_sqrt(), BITS_16));
        let shares =
            level(self.metalness, BITS_11) | level(self.transmission, BITS_11) << 11 | level(self.coat, BITS_10) << 22;
        let words = [r | g << 16, b | level(self.roughness, BITS_16) << 16, shares];
        let [x, y, z] = words.map(F32x8::from_bits);
        Vec3x8::new(x, y, z)
    }

    /// The inverse of [`Self::pack`], up to rounding. Any bits give parameters from 0 to 1.
    #[inline(always)]
    pub fn unpack(packed: Vec3x8) -> Self {
        let [x, y, z] = [packed.x, packed.y, packed.z].map(F32x8::to_bits);
        let channel = |bits| value(bits, BITS_16).sqr();
        Self {
            base: Vec3x8::new(channel(x), channel(x >> 16), channel(y)),
            roughness: value(y >> 16, BITS_16),
            metalness: value(z, BITS_11),
            transmission: value(z >> 11, BITS_11),
            coat: value(z >> 22, BITS_10),
        }
    }
}

/// What the textures of principled materials say at eight points.
#[derive(Clone, Copy, Debug)]
pub struct Textured8 {
    /// Parameters.
    pub surface: Surface8,
    /// Share of light that meets the surface.
    pub opacity: F32x8,
    /// Lanes with a normal map.
    pub mapped: Mask8,
    /// Normal in tangent space, of any length, z > 0; +z where there is no map.
    pub normal: Vec3x8,
}

/// Colour and alpha of a texture of each lane's record at the surface coordinates `uv`, in the lanes that have it; 1 in
/// others.
#[inline(always)]
fn fetch(
    scene: &Scene<'_>,
    records: &[Option<&PrincipledRecord>; 8],
    which: PrincipledTexture,
    uv: [F32x8; 2],
) -> (Mask8, Vec3x8) {
    texture::referenced(scene, &records.map(|r| r.and_then(|r| r.textures.get(which as usize))), uv)
}

/// Parameters of the principled materials in the lanes of `active` at the surface coordinates `uv`; `[textures, normal_maps]`
/// is whether the kernel profile has them.
#[inline(never)]
pub fn textured(
    scene: &Scene<'_>,
    material: &[u32; 8],
    uv: [F32x8; 2],
    active: Mask8,
    [textures, normal_maps]: [bool; 2],
) -> Textured8 {
    const IDLE: &Material = super::super::IDLE;
    let bits = active.bits();
    let m: [&Material; 8] = core::array::from_fn(|l| {
        let m = if bits >> l & 1 == 1 { scene.materials.get(material[l] as usize) } else { None };
        m.unwrap_or(IDLE)
    });
    let records = m.map(|m| scene.principled(m));
    let get = |f: fn(&PrincipledRecord) -> f32| F32x8::from_fn(|l| records[l].map_or(0.0, f));
    let is_cut = |l: usize| m[l].flags & MATERIAL_CUTOUT != 0;
    let cutout = Mask8::from_bits((0..8).fold(0, |bits, l| bits | u32::from(is_cut(l)) << l));
    let mut out = Textured8 {
        surface: Surface8 {
            base: Vec3x8::from_fn(|l| m[l].reflectance),
            roughness: get(|r| r.roughness),
            metalness: get(|r| r.metalness),
            transmission: get(|r| r.transmission),
            coat: get(|r| r.coat),
        },
        opacity: cutout.select(get(|r| r.opacity), F32x8::ONE),
        mapped: Mask8::NONE,
        normal: Vec3x8::splat(0.0, 0.0, 1.0),
    };
    if !textures {
        return out;
    }
    let by_alpha = |l: usize| records[l].is_some_and(|r| r.flags & PRINCIPLED_ALPHA != 0);
    let by_alpha = Mask8::from_bits((0..8).fold(0, |bits, l| bits | u32::from(by_alpha(l)) << l));
    let s = &mut out.surface;
    let (_, rgb) = fetch(scene, &records, PrincipledTexture::Base, uv);
    s.base *= rgb;
    let cut = cutout & by_alpha;
    if cut.any() {
        let base = records.map(|r| r.and_then(|r| r.textures.get(PrincipledTexture::Base as usize)));
        out.opacity = cut.select(out.opacity * texture::referenced_alpha(scene, &base, uv), out.opacity);
    }
    let (_, rgb) = fetch(scene, &records, PrincipledTexture::MetalRough, uv);
    s.roughness *= rgb.y;
    s.metalness *= rgb.z;
    let (_, rgb) = fetch(scene, &records, PrincipledTexture::Transmission, uv);
    s.transmission *= rgb.x;
    let (_, rgb) = fetch(scene, &records, PrincipledTexture::Coat, uv);
    s.coat *= rgb.x;
    if normal_maps {
        let (mapped, rgb) = fetch(scene, &records, PrincipledTexture::Normal, uv);
        let n = rgb.map(decoded);
        let scale = get(|r| r.normal_scale);
        // normals from behind have no meaning in a map
        let n = Vec3x8::new(n.x * scale, n.y * scale, n.z.max(F32x8::splat(1e-3)));
        out.mapped = mapped;
        out.normal = Vec3x8::select(mapped, n, out.normal);
    }
    out
}

/// The component that a texel of a normal map stands for. 128 of 255 is zero, as well as 127.5: no 8-bit texel is the
/// latter, and all tools write the former.
#[inline(always)]
fn decoded(x: F32x8) -> F32x8 {
    let n = x * 2.0 - 1.0;
    n.abs().lt(F32x8::splat(1.5 / 255.0)).select(F32x8::ZERO, n)
}
