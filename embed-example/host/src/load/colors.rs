//! Colours at the vertices of triangles as a texture, which is what materials can have.
//!
//! Each triangle gets a block of 2 x 2 texels and vertices of its own, whose texture coordinates are the centres of
//! three of them. The fourth texel continues the colours linearly, so that bilinear interpolation within the triangle is
//! the interpolation of the vertices' colours, up to 8 bits; where the fourth had to be limited to 0 .. 1, colours near
//! the triangle's longest side are off by up to a quarter of what was cut. The corner that needs least of that is chosen.

use crate::description::{Texture, Vertex};
use crate::tonemap;
use croupier::unstable::scene::blob::MAX_SIDE;
use croupier::unstable::texture::SRGB_TO_LINEAR;

/// Linear value of an sRGB-encoded byte.
pub(super) fn linear(encoded: u8) -> f32 {
    SRGB_TO_LINEAR[usize::from(encoded)]
}

/// sRGB-encoded byte of a linear value; limited to 0 .. 1.
pub(super) fn encoded(linear: f32) -> u8 {
    (tonemap::srgb(linear.clamp(0.0, 1.0)) * 255.0).round() as u8
}

/// Gives every triangle vertices of its own, whose texture coordinates find the colours of `color` (linear with alpha, by
/// vertex before the change) in the texture that is returned. Second: for each new vertex the one that it was. Vertices must be
/// in range.
pub(super) fn paint(
    vertices: &mut Vec<Vertex>,
    triangles: &mut [[u32; 3]],
    color: impl Fn(u32) -> [f32; 4],
) -> Result<(Texture, Vec<u32>), String> {
    let columns = (triangles.len() as f64).sqrt().ceil().max(1.0) as usize;
    let rows = triangles.len().div_ceil(columns).max(1);
    let most = MAX_SIDE as usize / 2;
    if columns > most || triangles.len() > u32::MAX as usize / 3 {
        return Err(format!("{} triangles with colours at their vertices are too many", triangles.len()));
    }
    let (width, height) = (2 * columns, 2 * rows);
    let mut texels = vec![[0, 0, 0, 255]; width * height];
    let mut corners = Vec::with_capacity(3 * triangles.len());
    let mut origins = Vec::with_capacity(3 * triangles.len());
    for (i, triangle) in triangles.iter_mut().enumerate() {
        let colors = triangle.map(&color);
        let fourth = |k: usize| -> [f32; 4] {
            std::array::from_fn(|c| colors[(k + 1) % 3][c] + colors[(k + 2) % 3][c] - colors[k][c])
        };
        let cut = |k: usize| fourth(k).iter().map(|x| (x - x.clamp(0.0, 1.0)).abs()).sum::<f32>();
        let start = (0..3).min_by(|a, b| cut(*a).total_cmp(&cut(*b))).unwrap_or(0);
        let (x, y) = (2 * (i % columns), 2 * (i / columns));
        let alpha = |a: f32| (a.clamp(0.0, 1.0) * 255.0).round() as u8;
        let texel = |[r, g, b, a]: [f32; 4]| [encoded(r), encoded(g), encoded(b), alpha(a)];
        let places = [[x, y], [x + 1, y], [x, y + 1]];
        for (k, [x, y]) in places.into_iter().enumerate() {
            let corner = (start + k) % 3;
            texels[y * width + x] = texel(colors[corner]);
            // row 0 is the top, v = 1
            let uv = [(x as f64 + 0.5) / width as f64, 1.0 - (y as f64 + 0.5) / height as f64];
            origins.push(triangle[corner]);
            corners.push(Vertex { uv: uv.map(|x| x as f32), ..vertices[triangle[corner] as usize] });
        }
        texels[(y + 1) * width + x + 1] = texel(fourth(start));
        *triangle = [0, 1, 2].map(|k| 3 * i as u32 + k);
    }
    *vertices = corners;
    let name = "vertex colours".into();
    Ok((Texture { name, width: width as u32, height: height as u32, texels, ..Texture::default() }, origins))
}
