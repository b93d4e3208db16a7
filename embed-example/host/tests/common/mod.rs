//! What tests of the program share.

/// Output as text.
pub(crate) fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// A Radiance picture of RGBE pixels, in rows from the top.
#[allow(dead_code, reason = "not every binary of tests needs it")]
pub(crate) fn hdr(width: usize, height: usize, pixel: impl Fn(usize, usize) -> [u8; 4]) -> Vec<u8> {
    let header = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n");
    let pixels = (0..height * width).flat_map(|i| pixel(i % width, i / width));
    header.into_bytes().into_iter().chain(pixels).collect()
}
