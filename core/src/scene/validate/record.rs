//! What the checks of all sections share: the record that is being checked, and a little arithmetic.

use crate::rng::mix;
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError};

/// The record that is being checked.
#[derive(Clone, Copy)]
pub(super) struct Record {
    pub(super) of: SectionKind,
    pub(super) index: usize,
}

impl Record {
    /// Sections have fewer than 2^31 records.
    pub(super) fn index(self) -> u32 {
        u32::try_from(self.index).unwrap_or(u32::MAX)
    }

    pub(super) fn bad(self, field: Field, found: f32) -> SceneError {
        SceneError::Number { of: self.of, index: self.index(), field, found }
    }

    /// `lo <= x <= hi`; false for NaN.
    pub(super) fn within(self, field: Field, x: f32, lo: f32, hi: f32) -> Result<(), SceneError> {
        if x >= lo && x <= hi { Ok(()) } else { Err(self.bad(field, x)) }
    }

    // pages load modules: there neither its loop is repeated in dozens of places, nor `wrong_reference`
    #[cfg_attr(target_family = "wasm", inline(never))]
    pub(super) fn all_within(self, field: Field, x: &[f32], lo: f32, hi: f32) -> Result<(), SceneError> {
        x.iter().try_for_each(|x| self.within(field, *x, lo, hi))
    }

    pub(super) fn finite(self, field: Field, x: &[f32]) -> Result<(), SceneError> {
        self.all_within(field, x, f32::MIN, f32::MAX)
    }

    pub(super) fn position(self, x: &[f32]) -> Result<(), SceneError> {
        self.all_within(Field::Position, x, -MAX_COORDINATE, MAX_COORDINATE)
    }

    /// A unit vector: squared length within 2e-3 of 1, so the length within 1e-3.
    pub(super) fn unit(self, v: [f32; 3]) -> Result<(), SceneError> {
        self.all_within(Field::Direction, &v, -2.0, 2.0)?;
        self.within(Field::Direction, dot(v, v), 1.0 - 2e-3, 1.0 + 2e-3)
    }

    pub(super) fn side(self, field: Field, x: u32, least: u32) -> Result<(), SceneError> {
        if x >= least && x <= MAX_SIDE { Ok(()) } else { Err(self.bad(field, x as f32)) }
    }

    pub(super) fn zero(self, reserved: bool) -> Result<(), SceneError> {
        if reserved { Ok(()) } else { Err(SceneError::Reserved { of: self.of, index: self.index() }) }
    }

    #[cfg_attr(target_family = "wasm", inline(never))]
    pub(super) fn wrong_reference(self, to: SectionKind, found: u32, count: usize) -> SceneError {
        let count = u32::try_from(count).unwrap_or(u32::MAX);
        SceneError::Reference { of: self.of, index: self.index(), to, found, count }
    }

    /// The record that `found` refers to.
    pub(super) fn follow<T>(self, to: SectionKind, found: u32, records: &[T]) -> Result<&T, SceneError> {
        records.get(found as usize).ok_or(self.wrong_reference(to, found, records.len()))
    }

    /// As [`Record::follow`], or [`NONE`].
    pub(super) fn follow_if_any<T>(self, to: SectionKind, found: u32, records: &[T]) -> Result<(), SceneError> {
        if found == NONE { Ok(()) } else { self.follow(to, found, records).map(|_| ()) }
    }
}

/// Numbers the records of a section.
pub(super) fn records<T>(of: SectionKind, records: &[T]) -> impl Iterator<Item = (Record, &T)> {
    records.iter().enumerate().map(move |(index, r)| (Record { of, index }, r))
}

pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    let ([ax, ay, az], [bx, by, bz]) = (a, b);
    ax * bx + ay * by + az * bz
}

/// Cross product in `f64`.
pub(super) fn cross([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> [f64; 3] {
    [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
}

pub(super) fn dot64([ax, ay, az]: [f64; 3], [bx, by, bz]: [f64; 3]) -> f64 {
    ax * bx + ay * by + az * bz
}

/// A hash of an index.
pub(super) fn hash_of(index: u64) -> u64 {
    mix(index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15))
}
