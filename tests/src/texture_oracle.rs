//! Scalar f64 oracle for textures and cameras, written from the scene format.

/// sRGB code to linear (IEC 61966-2-1).
pub fn srgb_to_linear(code: u8) -> f64 {
    let c = f64::from(code) / 255.0;
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Bilinear look-up, repeating, v = 0 at the bottom; `texels` row 0 is the top.
pub fn lookup(texels: &[[u8; 3]], width: i64, height: i64, uv: [f64; 2]) -> [f64; 3] {
    let (x, y) = (uv[0] * width as f64 - 0.5, uv[1] * height as f64 - 0.5);
    let (i, j) = (x.floor(), y.floor());
    let (fx, fy) = (x - i, y - j);
    let at = |i: i64, j: i64, c: usize| {
        let (column, up) = (i.rem_euclid(width), j.rem_euclid(height));
        srgb_to_linear(texels[((height - 1 - up) * width + column) as usize][c])
    };
    let (i, j) = (i as i64, j as i64);
    std::array::from_fn(|c| {
        (at(i, j, c) * (1.0 - fx) + at(i + 1, j, c) * fx) * (1.0 - fy)
            + (at(i, j + 1, c) * (1.0 - fx) + at(i + 1, j + 1, c) * fx) * fy
    })
}
