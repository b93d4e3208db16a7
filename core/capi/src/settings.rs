//! Settings by name and text.

use crate::fault::{CoreError, Failure, Fault, answer, croupier_message, promised};
use crate::memory::{checked, output, put_text, text};
use crate::scene::{croupier_scene, scene_at};
use crate::status::croupier_status::{self, *};
use core::ffi::c_char;
use croupier::{SettingError, Settings, SettingsError};

/// Settings of a render. Its members are the library's; the struct may be copied. Threads may read it at the same time.
#[derive(Clone, Copy)]
#[repr(C)]
pub struct croupier_settings {
    /// Not for programs.
    pub opaque: [u64; 64],
}

/// A plain value in an opaque struct of the caller's, between two marks.
#[repr(C)]
pub(crate) struct Stored<T> {
    mark: u64,
    value: T,
    end: u64,
}

const MARK: u64 = u64::from_le_bytes(*b"CRPVALUE");

impl<T: Copy> Stored<T> {
    /// Words in front of the second mark.
    const END: usize = size_of::<Self>() / size_of::<u64>() - 1;

    /// The value in an opaque struct `S`.
    ///
    /// # Safety
    /// The caller's promise.
    pub(crate) unsafe fn at<'a, S>(pointer: *const S, about: &'static str) -> Result<&'a T, Fault> {
        const { assert!(size_of::<Self>() <= size_of::<S>() && align_of::<Self>() <= align_of::<S>()) };
        let pointer = checked(pointer, about)?.cast::<Self>();
        let first = pointer.cast::<u64>();
        const { assert!(size_of::<Self>().is_multiple_of(size_of::<u64>()) && align_of::<Self>() >= align_of::<u64>()) };
        // SAFETY: the caller's promise, within the struct.
        let first_mark = unsafe { first.read() };
        // SAFETY: the same, its last word.
        let end_mark = unsafe { first.as_ptr().wrapping_add(Self::END).read() };
        if first_mark != MARK || end_mark != !MARK {
            return Err(Fault::new(CROUPIER_NO_OBJECT, about));
        }
        // SAFETY: `put` has made it; the caller promises that nobody else has written there.
        Ok(&unsafe { pointer.as_ref() }.value)
    }

    /// Makes one.
    ///
    /// # Safety
    /// The caller's promise.
    pub(crate) unsafe fn put<S>(pointer: *mut S, value: T, about: &'static str) -> Result<(), Fault> {
        let pointer = checked(pointer, about)?.cast::<Self>();
        // SAFETY: the caller's promise; `at` has compared the sizes.
        unsafe { pointer.write(Self { mark: MARK, value, end: !MARK }) };
        Ok(())
    }
}

impl CoreError for SettingError {
    fn status(&self) -> croupier_status {
        match self {
            Self::Name => CROUPIER_RANGE,
            _ => CROUPIER_SETTINGS,
        }
    }
}

impl CoreError for SettingsError {
    fn status(&self) -> croupier_status {
        CROUPIER_SETTINGS
    }
}

/// Name in messages.
const SETTINGS: &str = "settings";

/// The settings in a struct.
///
/// # Safety
/// The caller's promise.
pub(crate) unsafe fn settings_at<'a>(settings: *const croupier_settings) -> Result<&'a Settings, Fault> {
    promised!(Stored::at(settings, SETTINGS))
}

/// Changes the settings in a struct.
///
/// # Safety
/// The caller's promise.
unsafe fn change<E>(
    settings: *mut croupier_settings,
    change: impl FnOnce(&mut Settings) -> Result<(), E>,
) -> Result<(), Failure<E>> {
    let mut changed: Settings = *promised!(settings_at(settings))?;
    change(&mut changed).map_err(Failure::Core)?;
    promised!(Stored::put(settings, changed, SETTINGS))?;
    Ok(())
}

/// Makes settings of memory that may hold anything: the default ones, with size and depth of the scene. scene may be
/// null; then croupier_settings_set_size and croupier_settings_set of "max-depth" have to follow.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_init(
    settings: *mut croupier_settings,
    scene: *const croupier_scene,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let mut value = Settings::default();
        if !scene.is_null() {
            let scene = promised!(scene_at(scene))?;
            value = value.with_scene(&scene.read()?.scene.scene());
        }
        promised!(Stored::put(settings, value, SETTINGS))
    })
}

/// Sets one setting from a text: names, values and their meaning are the options of the program croupier, such as
/// ("rrs", "ears"), ("aovs", "albedo,normal"), ("cache-bytes", "24MiB"). CROUPIER_RANGE if no setting has the name,
/// CROUPIER_SETTINGS if the text is no value in its range; nothing has changed then.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_set(
    settings: *mut croupier_settings,
    name: *const c_char,
    value: *const c_char,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SettingError>, {
        let name = promised!(text(name, "name"))?;
        let value = promised!(text(value, "value"))?;
        promised!(change(settings, |s| s.set(name, value)))
    })
}

/// Text of a setting, which croupier_settings_set reads back. Writes at most size bytes, the last one 0; length, which
/// may be null, becomes the length of the whole text without it. CROUPIER_RANGE if no setting has the name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_get(
    settings: *const croupier_settings,
    name: *const c_char,
    value: *mut c_char,
    size: usize,
    length: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let settings = promised!(settings_at(settings))?;
        let name = promised!(text(name, "name"))?;
        let found = settings.get(name).ok_or(Fault::new(CROUPIER_RANGE, "name"))?;
        promised!(put_text(value, size, length, |out| _ = write!(out, "{found}")))
    })
}

/// Number of settings.
#[unsafe(no_mangle)]
pub extern "C" fn croupier_settings_count() -> usize {
    Settings::TABLE.len()
}

/// Name of setting index, below croupier_settings_count(). Texts as of croupier_settings_get.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_name(
    index: usize,
    name: *mut c_char,
    size: usize,
    length: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let row = Settings::TABLE.get(index).ok_or(Fault::new(CROUPIER_RANGE, "index").at(index as u64))?;
        promised!(put_text(name, size, length, |out| _ = out.write_str(row.name)))
    })
}

/// Meaning and range of setting index, a line. Texts as of croupier_settings_get.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_help(
    index: usize,
    help: *mut c_char,
    size: usize,
    length: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let row = Settings::TABLE.get(index).ok_or(Fault::new(CROUPIER_RANGE, "index").at(index as u64))?;
        promised!(put_text(help, size, length, |out| _ = write!(out, "{}: {}", row.help, row.range)))
    })
}

/// Sets columns and rows of the picture, pixels; at least 1 x 1 and at most 2^31 pixels, which croupier_plan_init
/// checks.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_set_size(
    settings: *mut croupier_settings,
    width: u32,
    height: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SettingError>, {
        promised!(change(settings, |s| {
            s.size = [width, height];
            Ok(())
        }))
    })
}

/// Sets the number of shards, units of parallel work, 1 to 65536. The picture depends on it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_set_shards(
    settings: *mut croupier_settings,
    shards: u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SettingError>, {
        promised!(change(settings, |s| {
            s.shards = shards;
            Ok(())
        }))
    })
}

/// Sets the seed of all random numbers: another one gives another, independent picture.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_set_seed(
    settings: *mut croupier_settings,
    seed: u64,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Failure<SettingError>, {
        promised!(change(settings, |s| {
            s.seed = seed;
            Ok(())
        }))
    })
}

/// Columns and rows of the picture, pixels; 0 x 0 while they are open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_settings_size(
    settings: *const croupier_settings,
    width: *mut u32,
    height: *mut u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let size = promised!(settings_at(settings))?.size;
        let (mut to_width, mut to_height) = (promised!(output(width, "width"))?, promised!(output(height, "height"))?);
        to_width.set(size[0]);
        to_height.set(size[1]);
        Ok(())
    })
}
