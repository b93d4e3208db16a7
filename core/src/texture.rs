//! Bilinear texture look-up: 8-bit sRGB texels, decoded to linear before they are interpolated.
//!
//! Texel (i, j), j counted from the bottom row, has its centre at ((i + 1/2) / width, (j + 1/2) / height); both
//! coordinates repeat. v = 0 is the lower edge of the bottom row (the OBJ convention).

use crate::scene::Scene;
use crate::scene::blob::{
    NONE, TEXTURE_CLAMP, TEXTURE_LINEAR, TEXTURE_MIRROR, TEXTURE_REPEAT, TEXTURE_WRAP, TEXTURE_WRAP_U, TEXTURE_WRAP_V,
    Texture, TextureRecord,
};
use croupier_simd::{F32x8, I32x8, Mask8, U32x8, Vec3x8};

/// Linear value of each sRGB code (IEC 61966-2-1), every entry the nearest `f32` to the exact value.
pub const SRGB_TO_LINEAR: [f32; 256] = {
    let mut table = [0.0; 256];
    let mut code = 0;
    while code < 256 {
        let c = code as f64 / 255.0;
        table[code] = if c <= 0.04045 { c / 12.92 } else { power_12_5((c + 0.055) / 1.055) } as f32;
        code += 1;
    }
    table
};

/// x^2.4 for 0.05 < x <= 1: the twelfth power of the fifth root, the root by Newton's iteration from above.
const fn power_12_5(x: f64) -> f64 {
    let mut y = 1.0;
    let mut i = 0;
    while i < 40 {
        y -= (y - x / (y * y * y * y)) / 5.0;
        i += 1;
    }
    let y4 = y * y * y * y;
    y4 * y4 * y4
}

/// Position between texel centres along one axis of `size` texels: the lower texel and the weight of the next one.
#[inline(always)]
fn position(coordinate: F32x8, size: F32x8) -> (F32x8, F32x8) {
    let c = coordinate.is_finite().zero_unless(coordinate);
    let x = (c - c.floor()) * size - 0.5;
    let lower = x.floor();
    (lower, x - lower)
}

/// Linear Rec. 709 colour of `texture` at `uv`, per lane; 0 outside `active`, where `texture` and `uv` may be anything.
///
/// Non-finite coordinates count as 0; at magnitudes above 2^23 the coordinate has no fraction left, and the result is
/// that of an integer. The error of the position is half an ulp of the coordinate times the size, in texels. Textures
/// may have up to 2^24 columns and rows.
pub fn lookup(scene: &Scene<'_>, texture: U32x8, uv: [F32x8; 2], active: Mask8) -> Vec3x8 {
    interpolated::<false>(scene, texture, uv, active, decoded)
}

/// Alpha of `texture` at `uv`, 0 to 1, under the conditions of [`lookup`]. Not encoded: alpha is linear.
pub fn alpha(scene: &Scene<'_>, texture: U32x8, uv: [F32x8; 2], active: Mask8) -> F32x8 {
    interpolated::<false>(scene, texture, uv, active, opacity).x
}

/// Linear Rec. 709 colours, or numbers code / 255 of linear textures, of a referenced texture per lane at the surface
/// coordinates `uv`, and the lanes that have one; 1 in the others.
pub fn referenced(scene: &Scene<'_>, of: &[Option<&TextureRecord>; 8], uv: [F32x8; 2]) -> (Mask8, Vec3x8) {
    let (index, present) = indices(of);
    if present.none() {
        return (present, Vec3x8::ONE);
    }
    let uv = transformed(of, uv);
    let i = index.to_array();
    let is_linear = |l: usize| scene.textures.get(i[l] as usize).is_some_and(|t| t.flags & TEXTURE_LINEAR != 0);
    let linear = Mask8::from_bits(present.lanes().fold(0, |bits, l| bits | u32::from(is_linear(l)) << l));
    let mut out = Vec3x8::ONE;
    if linear.any() {
        out = Vec3x8::select(linear, interpolated::<true>(scene, index, uv, linear, numbers), out);
    }
    let encoded = present.and_not(linear);
    if encoded.any() {
        out = Vec3x8::select(encoded, interpolated::<true>(scene, index, uv, encoded, decoded), out);
    }
    (present, out)
}

/// Alpha of a referenced texture per lane, as [`referenced`].
pub fn referenced_alpha(scene: &Scene<'_>, of: &[Option<&TextureRecord>; 8], uv: [F32x8; 2]) -> F32x8 {
    let (index, present) = indices(of);
    present.select(interpolated::<true>(scene, index, transformed(of, uv), present, opacity).x, F32x8::ONE)
}

/// Linear colours of sRGB texels.
#[inline(always)]
fn decoded(texels: &[[u8; 4]; 8]) -> Vec3x8 {
    let channel = |c: usize| F32x8::from_fn(|i| SRGB_TO_LINEAR[texels[i][c] as usize]);
    Vec3x8::new(channel(0), channel(1), channel(2))
}

/// Numbers code / 255 of linear texels.
#[inline(always)]
fn numbers(texels: &[[u8; 4]; 8]) -> Vec3x8 {
    let channel = |c: usize| F32x8::from_fn(|i| f32::from(texels[i][c])) / 255.0;
    Vec3x8::new(channel(0), channel(1), channel(2))
}

/// Alpha of texels, in `x`.
#[inline(always)]
fn opacity(texels: &[[u8; 4]; 8]) -> Vec3x8 {
    Vec3x8::new(F32x8::from_fn(|i| f32::from(texels[i][3])) / 255.0, F32x8::ZERO, F32x8::ZERO)
}

/// Indices of the textures, and the lanes that have one.
#[inline(always)]
fn indices(of: &[Option<&TextureRecord>; 8]) -> (U32x8, Mask8) {
    let index = U32x8::from_fn(|l| of[l].map_or(NONE, |t| t.texture));
    (index, !index.eq(U32x8::splat(NONE)))
}

/// Coordinates of the textures.
#[inline(always)]
fn transformed(of: &[Option<&TextureRecord>; 8], uv: [F32x8; 2]) -> [F32x8; 2] {
    let entry = |row: usize, k: usize| F32x8::from_fn(|l| of[l].map_or(0.0, |t| t.transform[row & 1][k % 3]));
    [0, 1].map(|row| entry(row, 0) * uv[0] + entry(row, 1) * uv[1] + entry(row, 2))
}

/// Whole parts of coordinates along one axis of clamped and mirrored textures, brought into [0, 1) so that only the
/// neighbours of the edges are left to [`neighbour`].
#[inline(always)]
fn wrapped(c: F32x8, mode: U32x8) -> F32x8 {
    let c = c.is_finite().zero_unless(c);
    let half = (c * 0.5 - (c * 0.5).floor()) * 2.0;
    let mirrored = half.gt(F32x8::ONE).select(2.0 - half, half);
    let below_one = 1.0 - f32::EPSILON / 2.0;
    let of = |k: u32| mode.eq(U32x8::splat(k));
    let c = of(TEXTURE_CLAMP).select(c.clamp(0.0, below_one), c);
    of(TEXTURE_MIRROR).select(mirrored.clamp(0.0, below_one), c)
}

/// Bilinear mean of what `value` makes of the texels around `uv`: of the bytes of eight texels.
#[inline(always)]
fn interpolated<const ANY_WRAP: bool>(
    scene: &Scene<'_>,
    texture: U32x8,
    uv: [F32x8; 2],
    active: Mask8,
    value: impl Fn(&[[u8; 4]; 8]) -> Vec3x8,
) -> Vec3x8 {
    const NOTHING: &Texture = &Texture { first: 0, width: 1, height: 1, flags: 0 };
    let index = U32x8::select(active, texture, U32x8::splat(NONE)).to_array();
    let record = index.map(|i| scene.textures.get(i as usize).unwrap_or(NOTHING));
    let [first, width, height] = [
        U32x8::from_fn(|i| record[i].first),
        U32x8::from_fn(|i| record[i].width),
        U32x8::from_fn(|i| record[i].height),
    ];
    let mode = |shift: u32| U32x8::from_fn(|i| record[i].flags >> shift & TEXTURE_WRAP);
    // a constant where all textures repeat
    let repeat = U32x8::splat(TEXTURE_REPEAT);
    let modes = if ANY_WRAP { [mode(TEXTURE_WRAP_U), mode(TEXTURE_WRAP_V)] } else { [repeat; 2] };
    let uv = if ANY_WRAP { [wrapped(uv[0], modes[0]), wrapped(uv[1], modes[1])] } else { uv };
    let (x, fx) = position(uv[0], width.to_i32().to_f32());
    let (y, fy) = position(uv[1], height.to_i32().to_f32());
    let next = |i: I32x8| [i, i + I32x8::splat(1)];
    let columns = next(x.to_i32()).map(|i| neighbour::<ANY_WRAP>(i, width, modes[0]));
    // the file's row 0 is the top
    let last = height - U32x8::splat(1);
    let rows = next(y.to_i32()).map(|i| last - neighbour::<ANY_WRAP>(i, height, modes[1]));
    let corner = |column: U32x8, row: U32x8| {
        let texel = (first + row * width + column).to_array();
        value(&texel.map(|i| scene.texels.get(i as usize).copied().unwrap_or(0).to_le_bytes()))
    };
    let lower = corner(columns[0], rows[0]) * (1.0 - fx) + corner(columns[1], rows[0]) * fx;
    let upper = corner(columns[0], rows[1]) * (1.0 - fx) + corner(columns[1], rows[1]) * fx;
    (lower * (1.0 - fy) + upper * fy).zero_unless(active)
}

/// `i` in -1..=size by the wrapping `mode`: a mirrored or clamped texture has its edge again beyond the edge.
#[inline(always)]
fn neighbour<const ANY_WRAP: bool>(i: I32x8, size: U32x8, mode: U32x8) -> U32x8 {
    let (negative, bits) = (i.lt(I32x8::splat(0)), i.to_u32());
    let repeated = wrap(U32x8::select(negative, bits + size, bits), size);
    if !ANY_WRAP {
        return repeated;
    }
    let (last, i) = (size - U32x8::splat(1), U32x8::select(negative, U32x8::splat(0), bits));
    U32x8::select(mode.eq(U32x8::splat(TEXTURE_REPEAT)), repeated, U32x8::select(i.lt(size), i, last))
}

/// `i` in 0..=size brought into 0..size; anything else to some texel.
#[inline(always)]
fn wrap(i: U32x8, size: U32x8) -> U32x8 {
    let (last, beyond) = (size - U32x8::splat(1), i - size);
    U32x8::select(i.lt(size), i, U32x8::select(beyond.lt(size), beyond, last))
}
