//! Memory that decoding may take.

use crate::text;

/// Fails unless an image whose decoding takes `bytes_per_pixel` fits.
pub(super) fn fits(width: u64, height: u64, bytes_per_pixel: u64, free: u64) -> Result<(), String> {
    match width.checked_mul(height).and_then(|n| n.checked_mul(bytes_per_pixel)) {
        Some(n) if n <= free => Ok(()),
        n => {
            let needed = n.map_or("more than 16 EiB".into(), text::bytes);
            let free = text::bytes(free);
            Err(format!("{width} x {height} pixels take {needed} to decode, {free} of the texture memory are free"))
        }
    }
}
