//! Validation: proves once what everything downstream relies on. Linear in the bytes, iterative, no allocation.
//!
//! Order matters: references are checked before anything follows them.

mod alias;
mod environment;
mod geometry;
mod lights;
mod materials;
mod tree;

use super::blob::*;
use super::error::{Field, SceneError};
use super::{Effects, Records};

/// Validates all records of a scene whose sections are sound; returns the effects that it calls for.
pub(super) fn scene(scene: &Records<'_>) -> Result<Effects, SceneError> {
    info(scene.info)?;
    let lens = camera(scene.camera)?;
    names(scene)?;
    materials::textures(scene)?;
    materials::materials(scene)?;
    geometry::vertices(scene)?;
    let surfaces = geometry::triangles(scene)?;
    let lights = lights::lights(scene)?;
    let environment = environment::environment(scene)?;
    lights::table(scene, environment.emits)?;
    tree::tree(scene)?;
    Ok(surfaces.with(lights).with(environment.effects).with(lens))
}

/// The record that is being checked.
#[derive(Clone, Copy)]
struct Record {
    of: SectionKind,
    index: usize,
}

impl Record {
    /// Sections have fewer than 2^31 records.
    fn index(self) -> u32 {
        u32::try_from(self.index).unwrap_or(u32::MAX)
    }

    fn bad(self, field: Field, found: f32) -> SceneError {
        SceneError::Number { of: self.of, index: self.index(), field, found }
    }

    /// `lo <= x <= hi`; false for NaN.
    fn within(self, field: Field, x: f32, lo: f32, hi: f32) -> Result<(), SceneError> {
        if x >= lo && x <= hi { Ok(()) } else { Err(self.bad(field, x)) }
    }

    fn all_within(self, field: Field, x: &[f32], lo: f32, hi: f32) -> Result<(), SceneError> {
        x.iter().try_for_each(|x| self.within(field, *x, lo, hi))
    }

    fn finite(self, field: Field, x: &[f32]) -> Result<(), SceneError> {
        self.all_within(field, x, f32::MIN, f32::MAX)
    }

    fn position(self, x: &[f32]) -> Result<(), SceneError> {
        self.all_within(Field::Position, x, -MAX_COORDINATE, MAX_COORDINATE)
    }

    /// A unit vector: squared length within 2e-3 of 1, so the length within 1e-3.
    fn unit(self, v: [f32; 3]) -> Result<(), SceneError> {
        self.all_within(Field::Direction, &v, -2.0, 2.0)?;
        self.within(Field::Direction, dot(v, v), 1.0 - 2e-3, 1.0 + 2e-3)
    }

    fn side(self, field: Field, x: u32, least: u32) -> Result<(), SceneError> {
        if x >= least && x <= MAX_SIDE { Ok(()) } else { Err(self.bad(field, x as f32)) }
    }

    fn zero(self, reserved: bool) -> Result<(), SceneError> {
        if reserved { Ok(()) } else { Err(SceneError::Reserved { of: self.of, index: self.index() }) }
    }

    fn wrong_reference(self, to: SectionKind, found: u32, count: usize) -> SceneError {
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        SceneError::Reference { of: self.of, index: self.index(), to, found, count }
    }

    /// The record that `found` refers to.
    fn follow<T>(self, to: SectionKind, found: u32, records: &[T]) -> Result<&T, SceneError> {
        records.get(found as usize).ok_or(self.wrong_reference(to, found, records.len()))
    }

    /// As [`Record::follow`], or [`NONE`].
    fn follow_if_any<T>(self, to: SectionKind, found: u32, records: &[T]) -> Result<(), SceneError> {
        if found == NONE { Ok(()) } else { self.follow(to, found, records).map(|_| ()) }
    }
}

/// Numbers the records of a section.
fn records<T>(of: SectionKind, records: &[T]) -> impl Iterator<Item = (Record, &T)> {
    records.iter().enumerate().map(move |(index, r)| (Record { of, index }, r))
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    let ([ax, ay, az], [bx, by, bz]) = (a, b);
    ax * bx + ay * by + az * bz
}

/// Cross product in `f64`.
fn cross([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> [f64; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

fn dot64([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> f64 {
    ax * bx + ay * by + az * bz
}

/// A well-mixed number per index (the finaliser of SplitMix64: Steele, Lea and Flood, OOPSLA 2014, fig. 16).
fn mark(index: u64) -> u64 {
    let x = index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

fn info(info: &SceneInfo) -> Result<(), SceneError> {
    let at = Record { of: SectionKind::Info, index: 0 };
    at.all_within(Field::Bounds, &info.bounds_min, -MAX_COORDINATE, MAX_COORDINATE)?;
    at.all_within(Field::Bounds, &info.bounds_max, -MAX_COORDINATE, MAX_COORDINATE)?;
    let pairs = info.bounds_min.iter().zip(&info.bounds_max);
    pairs.into_iter().try_for_each(|(lo, hi)| at.within(Field::Bounds, *lo, f32::MIN, *hi))
}

/// The axes must span space, so that no pixel has a direction of length 0; how long they are does not matter.
fn camera(c: &Camera) -> Result<Effects, SceneError> {
    let at = Record { of: SectionKind::Cameras, index: 0 };
    at.position(&c.origin)?;
    at.unit(c.forward)?;
    at.all_within(Field::ImagePlane, &c.right, -MAX_COORDINATE, MAX_COORDINATE)?;
    at.all_within(Field::ImagePlane, &c.down, -MAX_COORDINATE, MAX_COORDINATE)?;
    let [forward, right, down] = [c.forward, c.right, c.down].map(|v| v.map(f64::from));
    let volume = dot64(cross(right, down), forward);
    let lengths = dot64(right, right) * dot64(down, down);
    if volume * volume <= 1e-12 * lengths {
        return Err(at.bad(Field::ImagePlane, volume as f32));
    }
    at.within(Field::LensRadius, c.lens_radius, 0.0, MAX_COORDINATE)?;
    let nearest = if c.lens_radius > 0.0 { f32::MIN_POSITIVE } else { -MAX_COORDINATE };
    at.within(Field::FocusDistance, c.focus_distance, nearest, MAX_COORDINATE)?;
    let [width, height] = c.size;
    at.side(Field::Width, width, 1)?;
    at.side(Field::Height, height, 1)?;
    Ok(if c.lens_radius > 0.0 { Effects::LENS } else { Effects::default() })
}

fn names(scene: &Records<'_>) -> Result<(), SceneError> {
    let lines = scene.names.iter().filter(|b| **b == b'\n').count();
    let whole = scene.names.last().is_none_or(|b| *b == b'\n') && core::str::from_utf8(scene.names).is_ok();
    if whole && (scene.names.is_empty() || lines == scene.materials.len()) {
        return Ok(());
    }
    let materials = u32::try_from(scene.materials.len()).unwrap_or(u32::MAX);
    Err(SceneError::Names { lines: lines as u64, materials })
}
