//! Decoders: PNG and JPEG textures, EXR and Radiance environment maps. Errors are texts; the caller knows the file. What
//! decoding takes is known from a header, and compared with the memory that is `free`, before anything of that size is
//! allocated.

use super::budget::fits;
use super::hdr;
use crate::description::{Environment, Texture};
use crate::image::{Picture, Rgb};
use crate::text;
use exr::meta::MetaData;
use exr::meta::attribute::SampleType;
use png::{BitDepth, ColorType, Transformations};
use std::io::Cursor;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// A texture, and what of its file was ignored.
pub(super) struct Decoded {
    pub texture: Texture,
    pub ignored: Option<&'static str>,
}

/// A PNG or JPEG as 8-bit RGBA: its first bytes tell which, names of files are often wrong.
pub(super) fn texture(bytes: &[u8], free: u64) -> Result<Decoded, String> {
    if bytes.starts_with(&[0xff, 0xd8]) {
        jpeg(bytes, free)
    } else {
        png(bytes, free).map(|texture| Decoded { texture, ignored: None })
    }
}

/// The beginning of a decoder's message, in one line: it may quote the file.
fn said(e: &dyn std::fmt::Display) -> String {
    let words = e.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    text::excerpt(&words).into_owned()
}

/// Zeros, or an error where there is no memory for them.
fn zeros(n: usize) -> Result<Vec<u8>, String> {
    let mut data = Vec::new();
    data.try_reserve_exact(n).map_err(|_| format!("no memory for {}", text::bytes(n as u64)))?;
    data.resize(n, 0);
    Ok(data)
}

/// Any PNG as 8-bit RGBA: palettes and few-bit greys are expanded, 16-bit values rounded, sRGB is assumed.
fn png(bytes: &[u8], free: u64) -> Result<Texture, String> {
    // The decoder's own buffers, of rows and text chunks.
    let limits = png::Limits { bytes: usize::try_from(free).unwrap_or(usize::MAX) };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|e| format!("not a readable PNG or JPEG: {}", said(&e)))?;
    let (width, height) = reader.info().size();
    let (color, depth) = reader.output_color_type();
    // as decoded, reduced to 8 bits, as texels
    let samples = color.samples() as u64;
    let reduced = if depth == BitDepth::Sixteen { 3 * samples } else { samples };
    fits(width.into(), height.into(), reduced + 4, free)?;
    let mut data = zeros(reader.output_buffer_size().ok_or("too large")?)?;
    let info = reader.next_frame(&mut data).map_err(|e| format!("not a readable PNG: {}", said(&e)))?;
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

/// Bytes a pixel that the JPEG decoder takes: RGBA twice, coefficients of up to four channels of a progressive file,
/// rounded up to whole blocks.
const JPEG_BYTES: u64 = 2 * 4 + 4 * 2;

/// Any JPEG of 8 bits a channel, up to 16384 pixels a side; grey, RGB, YCbCr or CMYK, sRGB is assumed. Files that end
/// early are refused (strict mode), which would fill up with grey; if only their last bytes are missing that may go
/// unnoticed. Bytes behind the end of the picture (cameras' previews, downloads' padding) are ignored.
fn jpeg(bytes: &[u8], free: u64) -> Result<Decoded, String> {
    let unreadable = |e: &dyn std::fmt::Display| format!("not a readable JPEG: {}", said(e));
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGBA).set_strict_mode(true);
    let end = jpeg_end(bytes).unwrap_or(bytes.len());
    let picture = bytes.get(..end).unwrap_or(bytes);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(picture), options);
    decoder.decode_headers().map_err(|e| unreadable(&e))?;
    let [width, height] = decoder.info().map_or([0; 2], |i| [i.width, i.height]);
    fits(width.into(), height.into(), JPEG_BYTES, free)?;
    let mut data = zeros(decoder.output_buffer_size().ok_or("too large")?)?;
    decoder.decode_into(&mut data).map_err(|e| unreadable(&e))?;
    let texels: Vec<[u8; 4]> = data.as_chunks().0.to_vec();
    if texels.is_empty() || texels.len() != usize::from(width) * usize::from(height) {
        return Err(format!("a JPEG of {} texels for {width} x {height} pixels", texels.len()));
    }
    let (width, height) = (width.into(), height.into());
    let texture = Texture { name: String::new(), width, height, texels, ..Texture::default() };
    let ignored = (end < bytes.len()).then_some("there are bytes behind the end of the JPEG");
    Ok(Decoded { texture, ignored })
}

/// Length of a JPEG up to the end of its picture, if that is there: segments have a length, the coded data behind a
/// start of scan ends at the first marker that is no restart (ITU T.81, annex B).
fn jpeg_end(bytes: &[u8]) -> Option<usize> {
    let mut at = 2;
    loop {
        // the next marker: coded data may precede it, where a 0xff is followed by 0
        while *bytes.get(at)? != 0xff || matches!(*bytes.get(at + 1)?, 0 | 0xff | 0xd0..=0xd7) {
            at += 1;
        }
        match *bytes.get(at + 1)? {
            0xd9 => return Some(at + 2),
            // without a length
            0x01 | 0xd8 => at += 2,
            _ => at += 2 + usize::from(u16::from_be_bytes([*bytes.get(at + 2)?, *bytes.get(at + 3)?])),
        }
    }
}

/// The RGB picture of an EXR or a Radiance file, told by its first bytes, as an unscaled, unrotated environment map, and
/// how many negative, NaN or infinite numbers (filters and overflows leave them behind) became 0.
pub(super) fn environment(bytes: &[u8], free: u64) -> Result<(Environment, usize), String> {
    let picture = if hdr::is_hdr(bytes) { hdr::decode(bytes, free)? } else { exr(bytes, free)? };
    let Rgb { width, height, pixels: mut texels } = picture;
    let mut clamped = 0;
    for x in texels.iter_mut().flatten() {
        if !x.is_finite() || *x < 0.0 {
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

/// The RGB picture of an EXR.
fn exr(bytes: &[u8], free: u64) -> Result<Rgb, String> {
    let unreadable = |e: &dyn std::fmt::Display| format!("not a readable EXR: {}", said(e));
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(|e| unreadable(&e))?;
    for header in &meta.headers {
        let channels = &header.channels.list;
        // as decoded, as 32-bit planes of a picture, three of them as pixels
        let size = |t: SampleType| if t == SampleType::F16 { 2 } else { 4 };
        let each: u64 = channels.iter().map(|c| size(c.sample_type) + 4).sum();
        let share = free / meta.headers.len().max(1) as u64;
        fits(header.layer_size.x() as u64, header.layer_size.y() as u64, each + 12, share)?;
    }
    let picture = Picture::decode_exr(Cursor::new(bytes)).map_err(|e| unreadable(&e))?;
    picture.main().ok_or_else(|| "no layer with channels R, G and B".into())
}
