//! Decoders: PNG and JPEG textures, EXR and Radiance environment maps. Errors are texts; the caller knows the file.

use super::hdr;
use crate::description::{Environment, Texture};
use crate::image::{Picture, Rgb};
use png::{BitDepth, ColorType, Transformations};
use std::io::Cursor;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Bytes that a decoded texture may need: the largest that the scene blob can hold.
const LARGEST: usize = 4 << 30;

/// A PNG or JPEG as 8-bit RGBA: its first bytes tell which, names of files are often wrong.
pub(super) fn texture(bytes: &[u8]) -> Result<Texture, String> {
    if bytes.starts_with(&[0xff, 0xd8]) { jpeg(bytes) } else { png(bytes) }
}

/// Any PNG as 8-bit RGBA: palettes and few-bit greys are expanded, 16-bit values rounded, sRGB is assumed.
fn png(bytes: &[u8]) -> Result<Texture, String> {
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), png::Limits { bytes: LARGEST });
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|e| format!("not a readable PNG or JPEG: {e}"))?;
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
    Ok(Texture { name: String::new(), width: info.width, height: info.height, texels, ..Texture::default() })
}

/// Any JPEG of 8 bits a channel, up to 16384 pixels a side; grey, RGB, YCbCr or CMYK, sRGB is assumed. Files that end
/// early are refused (strict mode), which would fill up with grey; if only their last bytes are missing that may go
/// unnoticed.
fn jpeg(bytes: &[u8]) -> Result<Texture, String> {
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGBA).set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let data = decoder.decode().map_err(|e| format!("not a readable JPEG: {e}"))?;
    let size = decoder.info().map_or([0; 2], |i| [i.width, i.height]);
    let texels: Vec<[u8; 4]> = data.as_chunks().0.to_vec();
    if texels.is_empty() || texels.len() != usize::from(size[0]) * usize::from(size[1]) {
        return Err(format!("a JPEG of {} texels for {} x {} pixels", texels.len(), size[0], size[1]));
    }
    Ok(Texture { name: String::new(), width: size[0].into(), height: size[1].into(), texels, ..Texture::default() })
}

/// The RGB picture of an EXR or a Radiance file, told by its first bytes, as an unscaled, unrotated environment map, and how many negative or NaN numbers (filters
/// leave them behind) became 0.
pub(super) fn environment(bytes: &[u8]) -> Result<(Environment, usize), String> {
    let picture = if hdr::is_hdr(bytes) {
        hdr::decode(bytes)?
    } else {
        let picture = Picture::decode_exr(Cursor::new(bytes)).map_err(|e| format!("not a readable EXR: {e}"))?;
        picture.main().ok_or("no layer with channels R, G and B")?
    };
    let Rgb { width, height, pixels: mut texels } = picture;
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
