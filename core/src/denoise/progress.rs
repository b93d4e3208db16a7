//! Denoising row by row: passes over the picture, and how far they have come.

use super::filter::{despeckle_row, smooth_row};
use super::finish::{finish_row, gain, lost_in_row};
use super::grid::Grid;
use super::noisy::NoisySource;
use super::prepare::{fill_row, load_row, prepare_row, smooth_variance_row};
use super::work::Work;
use bytemuck::{Pod, Zeroable};

/// Distance of the taps at each level, pixels.
const STEPS: [usize; 5] = [1, 2, 4, 8, 16];
/// Standard errors of a difference at which two pixels stop belonging together at the first level. Chosen by hand
/// after varying one number at a time, by the relMSE of seven scenes with 4 and 16 samples per pixel: no joint optimum,
/// and not checked on other scenes.
const MEMBERSHIP: f32 = 2.75;
/// Factor of [`MEMBERSHIP`] from level to level: filtered neighbours share samples, which variances count as
/// independent.
const MEMBERSHIP_DECAY: f32 = 0.95;

/// Passes over the rows of the picture, in order.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Pass {
    Prepare,
    FillDown,
    FillUp,
    Variance,
    Smooth(u32),
    Despeckle,
    Lost,
    Finish,
    Done,
}

impl Pass {
    fn of(number: u32) -> Self {
        const LEVELS: u32 = STEPS.len() as u32;
        match number {
            0 => Self::Prepare,
            1 => Self::FillDown,
            2 => Self::FillUp,
            3 => Self::Variance,
            n if n < 4 + LEVELS => Self::Smooth(n - 4),
            n if n == 4 + LEVELS => Self::Despeckle,
            n if n == 5 + LEVELS => Self::Lost,
            n if n == 6 + LEVELS => Self::Finish,
            _ => Self::Done,
        }
    }
}

/// How far denoising has come.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Progress {
    /// Radiance that the picture lost.
    lost: [f64; 3],
    /// Radiance of the pixels that take it back.
    takers: [f64; 3],
    pass: u32,
    row: u32,
    /// Not 0 if a pixel is absent.
    absent: u32,
    reserved: u32,
}

impl Progress {
    /// Rows that the next one loads before its own: the first of a pass loads all that the pass reads around it.
    pub(crate) fn rows_to_load(&self) -> u32 {
        match Pass::of(self.pass) {
            Pass::Variance | Pass::Despeckle if self.row == 0 => 1,
            Pass::Smooth(level) if self.row == 0 => STEPS.get(level as usize).map_or(1, |&step| step as u32),
            _ => 0,
        }
    }

    /// Works on the next row; `true` when there is none. `noisy` and `work` must be the same from the first row to the
    /// last.
    pub(crate) fn row<S: NoisySource>(&mut self, size: [u32; 2], noisy: &S, work: &mut Work<'_>) -> bool {
        let grid = Grid::new(size);
        let y = self.row as usize;
        let pass = Pass::of(self.pass);
        if pass == Pass::Done {
            return true;
        }
        // what the pass reads of row y + step, and before its first row of all rows above that
        let mut load = |step: usize| {
            let from = if y == 0 { 0 } else { y + step };
            (from..=y + step).for_each(|y| load_row(noisy, grid, y, work));
        };
        match pass {
            _ if y >= grid.rows => {}
            Pass::Prepare => self.absent |= u32::from(prepare_row(noisy, grid, y, work)),
            Pass::FillDown => fill_row(grid, y, false, work),
            Pass::FillUp => fill_row(grid, grid.rows - 1 - y, true, work),
            Pass::Variance => {
                load(1);
                smooth_variance_row(grid, y, work);
            }
            Pass::Smooth(level) => {
                let step = STEPS.get(level as usize).copied().unwrap_or(1);
                let factor = (0..level).fold(MEMBERSHIP, |f, _| f * MEMBERSHIP_DECAY);
                load(step);
                smooth_row(grid, step, factor * factor, y, work);
            }
            Pass::Despeckle => {
                load(1);
                despeckle_row(grid, y, work);
            }
            Pass::Lost => {
                let [lost, takers] = lost_in_row(noisy, grid, y, work);
                for c in 0..3 {
                    self.lost[c] += f64::from(lost[c]);
                    self.takers[c] += f64::from(takers[c]);
                }
            }
            Pass::Finish => finish_row(noisy, grid, y, gain(self.lost, self.takers), work),
            Pass::Done => {}
        }
        self.row = self.row.saturating_add(1);
        if self.row as usize >= grid.rows {
            (self.row, self.pass) = (0, self.pass + 1);
            if Pass::of(self.pass) == Pass::FillDown && self.absent == 0 {
                self.pass += 2;
            }
        }
        Pass::of(self.pass) == Pass::Done
    }
}
