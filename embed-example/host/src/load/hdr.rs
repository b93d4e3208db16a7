//! Radiance pictures (.hdr, .pic): RGBE pixels, flat, run-length encoded the old way, or by component (Ward, Real
//! Pixels, Graphics Gems II; the format's reference is that of Radiance 4, File Formats).
//!
//! Read here, without a crate: `zune-hdr` decodes old runs wrongly, the crate `image` overflows on long ones, brings
//! colour management with it, and both know one orientation.

use crate::image::Rgb;

/// First bytes of every file.
pub(super) fn is_hdr(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?RADIANCE") || bytes.starts_with(b"#?RGBE")
}

/// The picture, of at most `free` bytes, divided by the product of its `EXPOSURE` lines.
pub(super) fn decode(bytes: &[u8], free: u64) -> Result<Rgb, String> {
    if !is_hdr(bytes) {
        return Err("not a Radiance picture: it does not begin with #?RADIANCE".into());
    }
    let mut rest = bytes;
    let mut exposure = 1.0f64;
    loop {
        let line = take_line(&mut rest).ok_or("the header has no end")?;
        let text = String::from_utf8_lossy(line);
        match text.trim_ascii().split_once('=').map(|(key, value)| (key.trim_ascii(), value.trim_ascii())) {
            _ if line.trim_ascii().is_empty() => break,
            Some(("FORMAT", value)) if value != "32-bit_rle_rgbe" => {
                return Err(format!("pixels are {}, only 32-bit_rle_rgbe is supported", super::error::quoted(value)));
            }
            Some(("EXPOSURE", value)) => match value.parse::<f64>() {
                Ok(x) if x.is_finite() && x > 0.0 => exposure *= x,
                _ => return Err(format!("EXPOSURE is {}", super::error::quoted(value))),
            },
            _ => {}
        }
    }
    let line = take_line(&mut rest).ok_or("the picture has no size")?;
    let size = Size::parse(&String::from_utf8_lossy(line))?;
    // A row takes a pixel or more, which runs can repeat.
    if 4 * size.rows as u64 > rest.len() as u64 {
        return Err(format!("{} bytes of pixels are too few for {} rows of {}", rest.len(), size.rows, size.row));
    }
    super::budget::fits(size.row as u64, size.rows as u64, 12, free)?;
    let mut pixels = vec![[0.0; 3]; size.row * size.rows];
    let mut row = vec![[0u8; 4]; size.row];
    for y in 0..size.rows {
        scanline(&mut rest, &mut row, &size).map_err(|what| format!("row {y}: {what}"))?;
        for (x, rgbe) in row.iter().enumerate() {
            pixels[size.place(x, y)] = linear(*rgbe, exposure);
        }
    }
    let [width, height] = size.picture();
    Rgb::new(width, height, pixels).ok_or_else(|| "its size does not fit its pixels".into())
}

/// The bytes up to the next line feed, which goes as well.
fn take_line<'b>(rest: &mut &'b [u8]) -> Option<&'b [u8]> {
    let end = rest.iter().position(|b| *b == b'\n')?;
    let line = &rest[..end];
    *rest = &rest[end + 1..];
    Some(line)
}

/// Rows as the file has them, and how they lie in the picture.
struct Size {
    /// Pixels of a row.
    row: usize,
    rows: usize,
    /// Rows of the file are columns of the picture.
    columns_first: bool,
    /// x decreases within the file, y increases.
    flip: [bool; 2],
}

impl Size {
    /// `-Y 512 +X 1024`, or any other of the eight orientations.
    fn parse(line: &str) -> Result<Self, String> {
        let wrong = || format!("{} is no size such as -Y 512 +X 1024", super::error::quoted(line.trim_ascii()));
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        let [outer, rows, inner, row] = *words.as_slice() else { return Err(wrong()) };
        let count = |word: &str| word.parse::<u32>().ok().filter(|n| (1..=65536).contains(n)).ok_or_else(wrong);
        let (rows, row) = (count(rows)? as usize, count(row)? as usize);
        let axis = |word: &str| match word {
            "+X" => Ok((0, false)),
            "-X" => Ok((0, true)),
            "-Y" => Ok((1, false)),
            "+Y" => Ok((1, true)),
            _ => Err(wrong()),
        };
        let ((a, flip_a), (b, flip_b)) = (axis(outer)?, axis(inner)?);
        if a == b {
            return Err(wrong());
        }
        let columns_first = a == 0;
        let flip = if columns_first { [flip_a, flip_b] } else { [flip_b, flip_a] };
        Ok(Self { row, rows, columns_first, flip })
    }

    /// Columns and rows of the picture.
    fn picture(&self) -> [usize; 2] {
        if self.columns_first { [self.rows, self.row] } else { [self.row, self.rows] }
    }

    /// Index in the picture, row 0 at the top, of pixel `i` of the file's row `j`.
    fn place(&self, i: usize, j: usize) -> usize {
        let [width, height] = self.picture();
        let (x, y) = if self.columns_first { (j, i) } else { (i, j) };
        let x = if self.flip[0] { width - 1 - x } else { x };
        let y = if self.flip[1] { height - 1 - y } else { y };
        y * width + x
    }

    fn coded_by_component(&self) -> bool {
        (8..=0x7fff).contains(&self.row)
    }
}

fn take<const N: usize>(rest: &mut &[u8]) -> Result<[u8; N], String> {
    let (head, tail) = rest.split_first_chunk().ok_or("the file ends within it")?;
    *rest = tail;
    Ok(*head)
}

/// One row.
fn scanline(rest: &mut &[u8], row: &mut [[u8; 4]], size: &Size) -> Result<(), String> {
    let coded = match **rest {
        [2, 2, high, low, ..] if high < 128 && size.coded_by_component() => {
            Some(usize::from(high) << 8 | usize::from(low))
        }
        _ => None,
    };
    let Some(length) = coded else { return old_runs(rest, row) };
    if length != row.len() {
        return Err(format!("it states {length} pixels, not {}", row.len()));
    }
    take::<4>(rest)?;
    for component in 0..4 {
        let mut at = 0;
        while at < row.len() {
            let [code] = take(rest)?;
            let count = usize::from(if code > 128 { code - 128 } else { code });
            let run = row.get_mut(at..at + count).filter(|run| !run.is_empty()).ok_or("a run passes its end")?;
            if code > 128 {
                let [value] = take(rest)?;
                run.iter_mut().for_each(|pixel| pixel[component] = value);
            } else {
                for pixel in run {
                    [pixel[component]] = take(rest)?;
                }
            }
            at += count;
        }
    }
    Ok(())
}

/// A row of single pixels; (1, 1, 1, n) repeats the one before n times, n 256 times as much in each that follows such.
fn old_runs(rest: &mut &[u8], row: &mut [[u8; 4]]) -> Result<(), String> {
    let (mut at, mut shift) = (0, 0u32);
    while at < row.len() {
        let pixel = take(rest)?;
        match pixel {
            [1, 1, 1, count] => {
                let last = *at.checked_sub(1).and_then(|i| row.get(i)).ok_or("a run before the first pixel")?;
                // two bytes of length are more than any row
                let count =
                    usize::from(count).checked_shl(shift).filter(|_| shift < 24).ok_or("a run passes its end")?;
                row.get_mut(at..at + count).ok_or("a run passes its end")?.fill(last);
                at += count;
                shift += 8;
            }
            pixel => {
                row[at] = pixel;
                at += 1;
                shift = 0;
            }
        }
    }
    Ok(())
}

/// Radiance of a pixel: mantissa 2^(exponent - 136), 0 for exponent 0. (Radiance's own reader adds 1/2 to mantissas;
/// most others, and the writers of panoramas, do not.)
fn linear([r, g, b, exponent]: [u8; 4], exposure: f64) -> [f32; 3] {
    let unit = if exponent == 0 { 0.0 } else { f64::from(i32::from(exponent) - 136).exp2() / exposure };
    [r, g, b].map(|mantissa| (f64::from(mantissa) * unit) as f32)
}
