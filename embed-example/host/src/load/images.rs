//! Decoders: PNG textures, EXR environment maps. Errors are texts; the caller knows the file.

use crate::description::{Environment, Texture};
use crate::image::{Picture, Rgb};
use png::{BitDepth, ColorType, Transformations};
use std::io::Cursor;

/// Bytes that a decoded texture may need: the largest that the scene blob can hold.
const LARGEST: usize = 4 << 30;

/// Any PNG as 8-bit RGBA: palettes and few-bit greys are expanded, 16-bit values rounded, sRGB is assumed.
pub(super) fn png(bytes: &[u8]) -> Result<Texture, String> {
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: LARGEST });
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|e| format!("not a readable PNG: {e}"))?;
    let size = reader.output_buffer_size().filter(|n| *n <= LARGEST).ok_or("too large")?;
    let mut data = vec![0; size];
    let info = reader.next_frame(&mut data).map_err(|e| format!("not a readable PNG: {e}"))?;
    data.truncate(info.buffer_size());
    if info.bit_depth == BitDepth::Sixteen {
        let reduced = |b: &[u8]| ((u32::from(b[0]) << 8 | u32::from(b[1])) * 255 + 32767) / 65535;
        data = data.chunks_exact(2).map(|b| reduced(b) as u8).collect();
    }
    let texels = match info.color_type {
        ColorType::Grayscale => data.iter().map(|&y| [y, y, y, 255]).collect(),
        ColorType::GrayscaleAlpha => data.chunks_exact(2).map(|t| [t[0], t[0], t[0], t[1]]).collect(),
        ColorType::Rgb => data.chunks_exact(3).map(|t| [t[0], t[1], t[2], 255]).collect(),
        ColorType::Rgba => data.chunks_exact(4).map(|t| [t[0], t[1], t[2], t[3]]).collect(),
        ColorType::Indexed => return Err("its palette was not expanded".into()),
    };
    Ok(Texture { name: String::new(), width: info.width, height: info.height, texels })
}

/// The RGB picture of an EXR as an unscaled, unrotated environment map, and how many negative or NaN numbers (filters leave
/// them behind) became 0.
pub(super) fn exr(bytes: &[u8]) -> Result<(Environment, usize), String> {
    let picture = Picture::decode_exr(Cursor::new(bytes)).map_err(|e| format!("not a readable EXR: {e}"))?;
    let Rgb { width, height, pixels: mut texels } = picture.main().ok_or("no layer with channels R, G and B")?;
    let mut clamped = 0;
    for x in texels.iter_mut().flatten() {
        if x.is_nan() || *x < 0.0 {
            *x = 0.0;
            clamped += 1;
        }
    }
    let (width, height) = (width as u32, height as u32);
    if height < 2 {
        return Err(format!("an environment map of {width} x {height} pixels needs 2 rows"));
    }
    let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    Ok((Environment::Map { width, height, texels, scale: [1.0; 3], to_world }, clamped))
}
