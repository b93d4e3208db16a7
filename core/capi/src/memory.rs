//! Pointers of the caller as slices, texts and versioned structs.

use crate::fault::{Fault, Text};
use crate::status::croupier_status::*;
use bytemuck::Pod;
use core::ffi::{CStr, c_char, c_void};
use core::ptr::NonNull;
use core::slice;

/// Alignment of blocks of memory, bytes.
pub(crate) const ALIGN: usize = croupier::BLOCK_ALIGN;

/// Longest text that is read, bytes.
const LONGEST: usize = 4096;

/// A pointer that is neither null nor misaligned.
pub(crate) fn checked<T>(pointer: *const T, about: &'static str) -> Result<NonNull<T>, Fault> {
    let pointer = NonNull::new(pointer.cast_mut()).ok_or(Fault::new(CROUPIER_NULL, about))?;
    if pointer.is_aligned() { Ok(pointer) } else { Err(Fault::new(CROUPIER_MISALIGNED, about)) }
}

/// Where a result goes.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn output<'a, T>(pointer: *mut T, about: &'static str) -> Result<Output<'a, T>, Fault> {
    let place = checked(pointer, about)?;
    // SAFETY: the caller's promise; nothing is read from there.
    Ok(Output(unsafe { place.cast().as_mut() }))
}

/// A place for a value, which it may not hold yet.
pub(crate) struct Output<'a, T>(&'a mut core::mem::MaybeUninit<T>);

impl<T> Output<'_, T> {
    pub(crate) fn set(&mut self, value: T) {
        self.0.write(value);
    }
}

/// Values of an array; the pointer may be null if there are none.
///
/// # Safety
/// The caller's promise for `count` values.
pub(crate) unsafe fn array<'a, T>(first: *const T, count: usize, about: &'static str) -> Result<&'a [T], Fault> {
    if count == 0 {
        return Ok(&[]);
    }
    let first = in_address_space(first, count, about)?;
    // SAFETY: the caller's promise; not null, aligned, at most `isize::MAX` bytes.
    Ok(unsafe { slice::from_raw_parts(first.as_ptr(), count) })
}

/// Values of an array to be written; the pointer may be null if there are none.
///
/// # Safety
/// The caller's promise for `count` values.
pub(crate) unsafe fn array_mut<'a, T: Pod>(
    first: *mut T,
    count: usize,
    about: &'static str,
) -> Result<&'a mut [T], Fault> {
    if count == 0 {
        return Ok(&mut []);
    }
    let first = in_address_space(first, count, about)?;
    // SAFETY: the caller's promise; not null, aligned, at most `isize::MAX` bytes; any bytes are values of `T`.
    Ok(unsafe { slice::from_raw_parts_mut(first.as_ptr(), count) })
}

fn in_address_space<T>(first: *const T, count: usize, about: &'static str) -> Result<NonNull<T>, Fault> {
    let first = checked(first, about)?;
    let bytes = count.checked_mul(size_of::<T>()).filter(|b| *b <= isize::MAX as usize);
    let end = bytes.and_then(|b| first.addr().get().checked_add(b));
    if end.is_some() { Ok(first) } else { Err(Fault::new(CROUPIER_SIZE, about)) }
}

/// A block of memory for an object: checked for size, alignment and the end of the address space.
pub(crate) fn block(
    memory: *mut c_void,
    given: usize,
    needed: usize,
    about: &'static str,
) -> Result<NonNull<u8>, Fault> {
    let memory = NonNull::new(memory.cast::<u8>()).ok_or(Fault::new(CROUPIER_NULL, about))?;
    // first of all: a fault that no other size can cure
    if !memory.addr().get().is_multiple_of(ALIGN) {
        return Err(Fault::new(CROUPIER_MISALIGNED, about));
    }
    if given < needed {
        return Err(Fault::sizes(about, needed, given));
    }
    in_address_space(memory.as_ptr(), needed, about)
}

/// Do two ranges of bytes, each by its address and length, have a byte in common?
pub(crate) fn overlap(a: (usize, usize), b: (usize, usize)) -> bool {
    a.1 > 0 && b.1 > 0 && a.0 < b.0.saturating_add(b.1) && b.0 < a.0.saturating_add(a.1)
}

/// Address and length of an array.
pub(crate) fn range<T>(array: &[T]) -> (usize, usize) {
    (array.as_ptr().addr(), size_of_val(array))
}

/// Refuses an array of the caller's that has a byte in common with one of the `places`, each an address and a length.
/// To be called before a slice is made of it.
pub(crate) fn apart<T>(
    first: *const T,
    count: usize,
    places: &[(usize, usize)],
    about: &'static str,
) -> Result<(), Fault> {
    if count == 0 {
        return Ok(());
    }
    // faults that no other place can cure come first
    let first = in_address_space(first, count, about)?;
    let own = (first.addr().get(), count.saturating_mul(size_of::<T>()));
    match places.iter().any(|place| overlap(own, *place)) {
        true => Err(Fault::new(CROUPIER_OVERLAP, about)),
        false => Ok(()),
    }
}

/// A text of the caller's that ends with a zero byte.
///
/// # Safety
/// The caller's promise, up to the zero byte.
pub(crate) unsafe fn text<'a>(text: *const c_char, about: &'static str) -> Result<&'a str, Fault> {
    checked(text, about)?;
    // SAFETY: the caller's promise.
    let text = unsafe { CStr::from_ptr(text) };
    let short = text.to_bytes().len() <= LONGEST;
    text.to_str().ok().filter(|_| short).ok_or(Fault::new(CROUPIER_TEXT, about))
}

/// Writes a text into a buffer of `size` bytes, cut off between two characters if it is longer and ended by a zero byte; `length` is its whole
/// length without that. Neither is needed.
///
/// # Safety
/// The caller's promise for both.
pub(crate) unsafe fn put_text(
    buffer: *mut c_char,
    size: usize,
    length: *mut usize,
    write: impl Fn(&mut dyn core::fmt::Write),
) -> Result<(), Fault> {
    struct Length(usize);
    impl core::fmt::Write for Length {
        fn write_str(&mut self, text: &str) -> core::fmt::Result {
            self.0 = self.0.saturating_add(text.len());
            Ok(())
        }
    }
    if !length.is_null() {
        let mut measured = Length(0);
        write(&mut measured);
        // SAFETY: the caller's promise.
        unsafe { output(length, "length") }?.set(measured.0);
    }
    if !buffer.is_null() {
        // SAFETY: the caller's promise.
        let buffer = unsafe { array_mut(buffer, size, "text") }?;
        write(&mut Text::new(buffer));
    }
    Ok(())
}

/// A struct whose first member is its size, so that later versions can have more members.
///
/// # Safety
/// `repr(C)`, begins with the `u32` `struct_size`, and any bytes are a value.
pub(crate) unsafe trait Versioned: Copy {
    /// Size of the first version.
    const FIRST: u32;
    /// Name in messages.
    const NAME: &'static str;

    /// What members are that the caller's version does not have.
    fn empty() -> Self;
}

/// A struct of zeros but for its size.
pub(crate) fn zeroed<T: Pod>() -> T {
    let mut value = T::zeroed();
    let head = bytemuck::bytes_of_mut(&mut value).first_chunk_mut();
    if let Some(head) = head {
        *head = (size_of::<T>() as u32).to_ne_bytes();
    }
    value
}

/// Largest size of a struct that is believed.
const ABSURD: u32 = 1 << 16;

/// Bytes that the caller's version of a struct and this one have in common.
///
/// # Safety
/// The caller's promise, for the `struct_size` at least.
unsafe fn common<T: Versioned>(pointer: *const T) -> Result<(NonNull<u8>, usize), Fault> {
    let pointer = checked(pointer, T::NAME)?;
    // SAFETY: the caller's promise; the struct begins with it.
    let size: u32 = unsafe { pointer.cast().read() };
    if size < T::FIRST || size > ABSURD || !size.is_multiple_of(4) {
        let sizes = Some([T::FIRST.into(), size.into()]);
        return Err(Fault { sizes, ..Fault::new(CROUPIER_STRUCT_SIZE, T::NAME) });
    }
    Ok((pointer.cast(), size_of::<T>().min(size as usize)))
}

/// Reads a struct of any version.
///
/// # Safety
/// The caller's promise for as many bytes as its `struct_size` says.
pub(crate) unsafe fn read_struct<T: Versioned>(pointer: *const T) -> Result<T, Fault> {
    // SAFETY: the promise of this function.
    let (from, bytes) = unsafe { common(pointer) }?;
    let mut value = T::empty();
    let to = (&raw mut value).cast::<u8>();
    // SAFETY: both have so many bytes, and any are a value of `T`.
    unsafe { to.copy_from_nonoverlapping(from.as_ptr(), bytes) };
    Ok(value)
}

/// Writes a struct of any version; its `struct_size` stays the caller's, and so do members that this version does not
/// know.
///
/// # Safety
/// As of [`read_struct`].
pub(crate) unsafe fn write_struct<T: Versioned + Pod>(pointer: *mut T, value: &T) -> Result<(), Fault> {
    const HEAD: usize = size_of::<u32>();
    // SAFETY: the promise of this function.
    let (to, bytes) = unsafe { common(pointer) }?;
    let members = bytemuck::bytes_of(value).get(HEAD..bytes).unwrap_or_default();
    let to = to.as_ptr().wrapping_add(HEAD);
    // SAFETY: the caller has `bytes` bytes there, of which these are all but the first.
    unsafe { to.copy_from_nonoverlapping(members.as_ptr(), members.len()) };
    Ok(())
}
