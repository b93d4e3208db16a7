//! All that was learned of the scene as bytes: the cache, then the guide, each as it saves itself, as far as there are
//! any. Factors that were learned with a guide suit paths that are guided by it, so the two belong together.
#![deny(clippy::indexing_slicing, clippy::unwrap_used, clippy::expect_used)]

use super::cache::{self, Cache, CacheError};
use super::guiding::{self, Guide};

/// Length of what [`save`] writes, bytes; 0 if there is nothing.
pub fn saved_len(cache: Option<&Cache<'_>>, guide: Option<&Guide<'_>>) -> usize {
    cache.map_or(0, Cache::saved_len).saturating_add(guide.map_or(0, Guide::saved_len))
}

/// Writes cache and guide; returns the bytes written.
///
/// # Errors
/// [`CacheError::Absent`] if there is neither, [`CacheError::Length`] if there is too little room.
pub fn save(cache: Option<&Cache<'_>>, guide: Option<&Guide<'_>>, out: &mut [u8]) -> Result<usize, CacheError> {
    if cache.is_none() && guide.is_none() {
        return Err(CacheError::Absent);
    }
    let (needed, given) = (saved_len(cache, guide), out.len());
    let of_cache = cache.map_or(0, Cache::saved_len);
    let out = out.get_mut(..needed).and_then(|out| out.split_at_mut_checked(of_cache));
    let (first, second) = out.ok_or(CacheError::Length { needed, given })?;
    cache.map(|c| c.save(first)).transpose()?;
    guide.map(|g| g.save(second)).transpose()?;
    Ok(needed)
}

/// Replaces what was learned by saved bytes: of a guide that has no room for all of it, by what fits. What only one side
/// has stays out, and is not read. After an error all is as before.
///
/// # Errors
/// Bytes that are damaged or of another scene or objective; [`CacheError::Absent`] if they hold nothing that there is
/// here.
pub fn load(cache: Option<&mut Cache<'_>>, guide: Option<&mut Guide<'_>>, bytes: &[u8]) -> Result<(), CacheError> {
    let (cache, guide) = pairs(cache, guide, bytes)?;
    cache.map_or(Ok(()), |(cache, bytes)| cache.load(bytes))?;
    let Some((guide, bytes)) = guide else { return Ok(()) };
    match guide.load(bytes) {
        Err(CacheError::Full { .. }) => {
            guide.reset();
            guide.merge(bytes)
        }
        loaded => loaded,
    }
}

/// Adds saved bytes to what was learned, as [`Cache::merge`] and [`Guide::merge`] do. After an error all is as before.
///
/// # Errors
/// Those of [`load`].
pub fn merge(cache: Option<&mut Cache<'_>>, guide: Option<&mut Guide<'_>>, bytes: &[u8]) -> Result<(), CacheError> {
    let (cache, guide) = pairs(cache, guide, bytes)?;
    cache.map_or(Ok(()), |(cache, bytes)| cache.merge(bytes))?;
    guide.map_or(Ok(()), |(guide, bytes)| guide.merge(bytes))
}

/// Something and the saved bytes for it.
type Pair<'b, T> = Option<(T, &'b [u8])>;

/// What there is, with its part of the bytes. That of the guide is checked, as the cache changes first.
fn pairs<'b, 'c, C, G: core::ops::Deref<Target = Guide<'c>>>(
    cache: Option<C>,
    guide: Option<G>,
    bytes: &'b [u8],
) -> Result<(Pair<'b, C>, Pair<'b, G>), CacheError> {
    let parts = parts(bytes)?;
    let (cache, guide) = (cache.zip(parts.cache), guide.zip(parts.guide));
    if cache.is_none() && guide.is_none() {
        return Err(CacheError::Absent);
    }
    guide.as_ref().map_or(Ok(()), |(guide, bytes)| guide.check(bytes))?;
    Ok((cache, guide))
}

/// What saved bytes hold, not yet checked.
#[derive(Clone, Copy, Default)]
struct Parts<'b> {
    cache: Option<&'b [u8]>,
    guide: Option<&'b [u8]>,
}

/// Divides saved bytes.
fn parts(bytes: &[u8]) -> Result<Parts<'_>, CacheError> {
    let (mut parts, mut rest) = (Parts::default(), bytes);
    loop {
        let taken = bytes.len() - rest.len();
        let (part, len) = match (cache::saved_length(rest), guiding::saved_length(rest)) {
            (Some(len), _) if parts.cache.is_none() && parts.guide.is_none() => (&mut parts.cache, len),
            (_, Some(len)) if parts.guide.is_none() => (&mut parts.guide, len),
            _ if taken > 0 => return Err(CacheError::Length { needed: taken, given: bytes.len() }),
            // says what they are instead
            _ => return Err(cache::not_saved(bytes)),
        };
        // what is too short says so where it is checked
        let (head, tail) = rest.split_at_checked(len).unwrap_or((rest, &[]));
        *part = Some(head);
        rest = tail;
        if rest.is_empty() {
            return Ok(parts);
        }
    }
}
