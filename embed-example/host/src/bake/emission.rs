//! Emission textures: how much light triangles emit with them.

use crate::description::{Encoding, Model, SceneDescription, Texture, TextureRef, Wrap};
use croupier::unstable::texture::SRGB_TO_LINEAR;

/// Most texels that are looked at to tell whether a triangle is black; larger ones are taken to emit.
const MOST_TEXELS: i64 = 1 << 16;
/// Most points per side of the mean over a triangle.
const MOST_POINTS: f64 = 32.0;

/// Emission texture of a material, if it has one.
pub(super) fn texture_of(scene: &SceneDescription, material: u32) -> Option<(&Texture, TextureRef)> {
    let Model::Principled(p) = scene.materials.get(material as usize)?.model else { return None };
    let reference = p.emission_texture?;
    Some((scene.textures.get(reference.texture as usize)?, reference))
}

/// Texel `i` along an axis of `size`.
fn wrapped(i: i64, size: u32, wrap: Wrap) -> usize {
    let size = i64::from(size.max(1));
    let at = match wrap {
        Wrap::Repeat => i.rem_euclid(size),
        Wrap::Clamp => i.clamp(0, size - 1),
        Wrap::Mirror => {
            let i = i.rem_euclid(2 * size);
            i.min(2 * size - 1 - i)
        }
    };
    at as usize
}

/// The linear value of a texel, row 0 at the bottom.
fn texel(t: &Texture, x: i64, y: i64) -> [f64; 3] {
    let column = wrapped(x, t.width, t.wrap[0]);
    let row = t.height as usize - 1 - wrapped(y, t.height, t.wrap[1]);
    let [r, g, b, _] = t.texels.get(row * t.width as usize + column).copied().unwrap_or_default();
    [r, g, b].map(|code| match t.encoding {
        Encoding::Srgb => f64::from(SRGB_TO_LINEAR[usize::from(code)]),
        Encoding::Linear => f64::from(code) / 255.0,
    })
}

/// Mean of the texture over a triangle with these coordinates at its corners, about; `None` if it is black all over.
pub(super) fn mean(texture: &Texture, reference: &TextureRef, uv: [[f32; 2]; 3]) -> Option<[f64; 3]> {
    let at = uv.map(|[u, v]| {
        let [x, y] = reference.transform.map(|[a, b, c]| f64::from(a * u + b * v + c));
        [x * f64::from(texture.width), y * f64::from(texture.height)]
    });
    let bound = |k: usize, f: fn(f64, f64) -> f64| at.iter().map(|p| p[k]).fold(at[0][k], f);
    // bilinear interpolation reaches half a texel further, rounding a little more
    let [x0, y0] = [0, 1].map(|k| (bound(k, f64::min) - 0.75).floor() as i64);
    let [x1, y1] = [0, 1].map(|k| (bound(k, f64::max) + 0.75).floor() as i64);
    let texels = x1.saturating_sub(x0).saturating_add(1).saturating_mul(y1.saturating_sub(y0).saturating_add(1));
    let lit = |c: [f64; 3]| c != [0.0; 3];
    if texels <= MOST_TEXELS && !(y0..=y1).any(|y| (x0..=x1).any(|x| lit(texel(texture, x, y)))) {
        return None;
    }
    let n = (2.0 * (texels as f64).sqrt()).clamp(4.0, MOST_POINTS) as u32;
    let mut sum = [0.0; 3];
    for i in 0..n * n {
        // centres of equal parts of the triangle: cells of a square, those beyond the diagonal mirrored
        let [mut b, mut c] = [i % n, i / n].map(|k| (f64::from(k) + 0.5) / f64::from(n));
        if b + c > 1.0 {
            (b, c) = (1.0 - b, 1.0 - c);
        }
        let a = 1.0 - b - c;
        let [x, y] = [0, 1].map(|k: usize| (at[0][k] * a + at[1][k] * b + at[2][k] * c).floor() as i64);
        let t = texel(texture, x, y);
        sum = std::array::from_fn(|k| sum[k] + t[k] / f64::from(n * n));
    }
    // what the points missed must be found sometimes as well
    Some(sum.map(|x| x.max(1e-3)))
}
