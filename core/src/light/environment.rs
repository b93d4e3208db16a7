//! Light from infinity: a lat-long map or a constant.
//!
//! **Mapping.** In map space (`to_local` applied to the world direction) the polar angle from +Y is theta and the
//! azimuth is atan2(x, -z). Column position `azimuth / 2 pi * width - 1/2` wraps, row position
//! `theta / pi * (height - 1)` runs from +Y in row 0 to -Y in the last row; radiance is bilinear, times the scale.
//! theta is atan2(hypot(x, z), y): the same as acos(y), but as accurate at the poles as elsewhere.
//!
//! **Sampling.** Cells are what lies between four texels: `height - 1` rows of `width` cells. An alias table chooses
//! the row, another the cell in it; a cell's probability is its share of the integral of the luminance over the sphere,
//! above the map's mean (`compose/lat_long.rs` has the reason): cells at or below the mean have a density of 0, and BSDF
//! samples alone find them.
//! Inside a cell the density is bilinear in the four corner luminances over (column, share of the cell's solid angle
//! above), so there is no 1 / sin theta: the density is bounded, poles included (NUMERICS SMP-5), and 0 where the map
//! is black. Away from the poles the share is nearly linear in theta and samples follow the bilinear map itself, a
//! sun of a single texel included.
//!
//! The density is computed from the direction alone, for samples as for scattered rays: both agree bit for bit.
//!
//! **Small differences.** 1 - cos theta near a pole is a difference of nearly equal numbers. Rows are counted from the
//! nearer pole, and cos a - cos b is taken as 2 sin((a + b) / 2) sin((b - a) / 2) (compare NUMERICS SMP-8).

use super::power::{pick, probability};
use super::{Chosen, LightModel, LightSample8, LightSelector, SceneExtent, usable};
use crate::scene::Scene;
use crate::scene::blob::{Environment, EnvironmentKind, Light, NONE};
use core::f32::consts::{FRAC_1_PI, TAU};
use core::f64::consts::PI;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// 1 / (4 pi).
const UNIFORM_SPHERE: f32 = 0.25 * FRAC_1_PI;

/// World to map space.
#[inline(always)]
fn to_local(e: &Environment, d: Vec3x8) -> Vec3x8 {
    let [x, y, z] = e.to_local.map(|r| Vec3x8::splat(r[0], r[1], r[2]).dot(d));
    Vec3x8::new(x, y, z)
}

/// Map space to world: the transpose.
#[inline(always)]
fn to_world(e: &Environment, d: Vec3x8) -> Vec3x8 {
    let [x, y, z] = e.to_local.map(|r| Vec3x8::splat(r[0], r[1], r[2]));
    x * d.x + y * d.y + z * d.z
}

fn splat(c: [f32; 3]) -> Vec3x8 {
    Vec3x8::splat(c[0], c[1], c[2])
}

/// A cell of the map per lane, and the position in it.
struct MapPosition {
    column: [u32; 8],
    row: [u32; 8],
    /// Position from the left texels to the right ones.
    x: F32x8,
    /// Position from the upper texels to the lower ones, linear in theta.
    y: F32x8,
}

/// Position on the map in the direction `d` of map space. NaN gives some cell.
#[inline(always)]
fn map_position(e: &Environment, d: Vec3x8) -> MapPosition {
    let theta = (d.x * d.x + d.z * d.z).sqrt().atan2(d.y);
    let rows = e.height.max(2) - 1;
    let v = (theta * (FRAC_1_PI * rows as f32)).clamp(0.0, rows as f32);
    let row = v.floor().min(F32x8::splat((rows - 1) as f32));
    // In turns from -1/2 to 1/2, so that columns near the seam keep their precision on both sides.
    let c = d.x.atan2(-d.z) * (1.0 / TAU) * e.width as f32 - 0.5;
    let left = c.floor();
    let width = e.width.clamp(1, i32::MAX as u32) as i32;
    // columns of the left half are negative, by half a map and a texel at most
    let wrap = |i: i32| if i < 0 { i.saturating_add(width).max(0) as u32 } else { i.min(width - 1) as u32 };
    MapPosition {
        column: left.to_i32().to_array().map(wrap),
        row: row.to_i32().to_array().map(|j| j as u32),
        x: c - left,
        y: v - row,
    }
}

/// The four texels around each cell of `mask`: upper left, upper right, lower left, lower right. Zeros elsewhere.
#[inline(always)]
fn corners(scene: &Scene<'_>, e: &Environment, at: &MapPosition, mask: Mask8) -> [Vec3x8; 4] {
    let width = e.width as usize;
    let numbers: &[f32] = bytemuck::cast_slice(scene.env_texels);
    // both texels of a row, and two numbers behind them that are not read
    let pair = |row: usize, left: usize| {
        let first = 3 * (row * width + left);
        match numbers.get(first..).and_then(|n| n.first_chunk::<8>()) {
            Some(n) if left + 1 < width => *n,
            _ => seam(scene, row * width, left, width),
        }
    };
    let (mut upper, mut lower) = ([F32x8::ZERO; 8], [F32x8::ZERO; 8]);
    for i in mask.lanes() {
        let (row, left) = (at.row[i] as usize, at.column[i] as usize);
        (upper[i], lower[i]) = (F32x8::new(pair(row, left)), F32x8::new(pair(row + 1, left)));
    }
    let [a, b, c, d, e, f, ..] = F32x8::transpose(upper);
    let [g, h, i, j, k, l, ..] = F32x8::transpose(lower);
    [Vec3x8::new(a, b, c), Vec3x8::new(d, e, f), Vec3x8::new(g, h, i), Vec3x8::new(j, k, l)]
}

/// The texel in column `left` of the row that begins at `start` and the next one, where that is the first of its row, or
/// the map ends behind it.
#[cold]
#[inline(never)]
fn seam(scene: &Scene<'_>, start: usize, left: usize, width: usize) -> [f32; 8] {
    let right = if left + 1 < width { left + 1 } else { 0 };
    let texel = |column: usize| scene.env_texels.get(start + column).copied().unwrap_or([0.0; 3]);
    let ([a, b, c], [d, e, f]) = (texel(left), texel(right));
    [a, b, c, d, e, f, 0.0, 0.0]
}

#[inline(always)]
fn lerp(t: F32x8, a: F32x8, b: F32x8) -> F32x8 {
    a * (1.0 - t) + b * t
}

#[inline(always)]
fn bilinear(c: [Vec3x8; 4], x: F32x8, y: F32x8) -> Vec3x8 {
    let row = |a: Vec3x8, b: Vec3x8| a * (1.0 - x) + b * x;
    row(c[0], c[1]) * (1.0 - y) + row(c[2], c[3]) * y
}

/// A row of cells, turned so that its pole is above.
struct Band {
    /// Lanes that are nearer the lower pole.
    flipped: Mask8,
    /// Rows between the pole and the band.
    row: F32x8,
    /// Half the angle of a row, in turns.
    half_step: f32,
    /// (cos upper - cos lower) / 2: the band's share of the sphere.
    share: F32x8,
}

impl Band {
    #[inline(always)]
    fn new(e: &Environment, row: [u32; 8]) -> Self {
        let rows = e.height.max(2) - 1;
        let row = F32x8::from_fn(|i| row[i] as f32);
        let flipped = row.ge(F32x8::splat(rows.div_ceil(2) as f32));
        let row = flipped.select((rows - 1) as f32 - row, row);
        let half_step = 0.25 / rows as f32;
        let sin_half = F32x8::splat(half_step).sin_cos_2pi().0;
        let share = ((row * 2.0 + 1.0) * half_step).sin_cos_2pi().0 * sin_half;
        Self { flipped, row, half_step, share }
    }

    /// `x` from the pole's side, of a coordinate that runs from 0 to 1 downwards, and back.
    #[inline(always)]
    fn turn(&self, x: F32x8) -> F32x8 {
        self.flipped.select(1.0 - x, x)
    }

    /// Share of the band's solid angle above the height `y` in it, both downwards from 0 to 1.
    #[inline(always)]
    fn share_above(&self, y: F32x8) -> F32x8 {
        let y = self.turn(y);
        let (sum, difference) = ((self.row * 2.0 + y) * self.half_step, y * self.half_step);
        let above = sum.sin_cos_2pi().0 * difference.sin_cos_2pi().0;
        self.turn((above / self.share).clamp(0.0, 1.0))
    }

    /// (cos theta, sin theta) of the height with `t` of the band's solid angle above it.
    #[inline(always)]
    fn polar(&self, t: F32x8) -> (F32x8, F32x8) {
        let top = (self.row * self.half_step).sin_cos_2pi().0;
        // sin^2(theta / 2) = (1 - cos theta) / 2
        let half_sqr = (top * top + self.turn(t) * self.share).clamp(0.0, 1.0);
        let cos = 1.0 - half_sqr * 2.0;
        (self.flipped.select(-cos, cos), (half_sqr * (1.0 - half_sqr)).safe_sqrt() * 2.0)
    }
}

/// Corner luminances relative to their largest, in the order of [`corners`]; all 0 in a black cell.
#[inline(always)]
fn relative_luminance(c: [Vec3x8; 4]) -> [F32x8; 4] {
    let l = c.map(|k| F32x8::ZERO.max(k.luminance()));
    let largest = l[0].max(l[1]).max(l[2].max(l[3]));
    // The smallest subnormals have no reciprocal but can be divided by.
    l.map(|k| largest.gt(F32x8::ZERO).zero_unless(k / largest))
}

/// Solves for x: `u` of the integral over [0, 1] of the linear function from `a` to `b` lies below x. The stable root;
/// `a`, `b` in [0, 1]. 0 where both are 0.
#[inline(always)]
fn sample_linear(u: F32x8, a: F32x8, b: F32x8) -> F32x8 {
    let denominator = a + lerp(u, a * a, b * b).safe_sqrt();
    let x = denominator.gt(F32x8::ZERO).zero_unless(u * (a + b) / denominator);
    x.min(F32x8::ONE)
}

/// Solid-angle density of the map's sampler in the lanes of `mask`.
#[inline(always)]
fn map_density(scene: &Scene<'_>, e: &Environment, at: &MapPosition, c: [Vec3x8; 4], mask: Mask8) -> F32x8 {
    // a table of the rows, and behind it one of the cells of each row
    let (rows, tables) = (e.height.max(2) - 1, scene.env_alias);
    let mut chosen = [0.0f32; 8];
    for i in mask.lanes() {
        let cell = rows as usize + at.row[i] as usize * e.width as usize + at.column[i] as usize;
        let of_cell = tables.get(cell).map_or(0.0, |a| a.probability);
        chosen[i] = if at.row[i] < rows { probability(tables, at.row[i]) * of_cell } else { 0.0 };
    }
    let band = Band::new(e, at.row);
    let t = band.share_above(at.y);
    let l = relative_luminance(c);
    let mean = (l[0] + l[1] + l[2] + l[3]) * 0.25;
    let here = lerp(t, lerp(at.x, l[0], l[1]), lerp(at.x, l[2], l[3]));
    let solid_angle = band.share * (2.0 * TAU / e.width as f32);
    let pdf = F32x8::new(chosen) * here / (mean * solid_angle);
    (mask & usable(pdf)).zero_unless(pdf)
}

/// Light from infinity.
pub(super) struct Surroundings;

impl LightModel for Surroundings {
    const DELTA: bool = false;

    #[inline(always)]
    fn sample(scene: &Scene<'_>, _: &Chosen, _: Vec3x8, words: [U32x8; 3], mask: Mask8) -> LightSample8 {
        let Some(e) = scene.environment else { return LightSample8::NONE };
        let (wi, radiance, pdf) = if e.kind == EnvironmentKind::Map as u32 {
            let wi = sample_map(scene, e, words, mask);
            let at = map_position(e, to_local(e, wi));
            let c = corners(scene, e, &at, mask);
            (wi, bilinear(c, at.x, at.y) * splat(e.radiance), map_density(scene, e, &at, c, mask))
        } else {
            let [u0, u1] = [words[0], words[1]].map(U32x8::to_unit);
            let (sin, cos) = u1.sin_cos_2pi();
            let sin_theta = (u0 * (1.0 - u0)).safe_sqrt() * 2.0;
            let wi = Vec3x8::new(sin_theta * cos, 1.0 - u0 * 2.0, sin_theta * sin);
            (wi, splat(e.radiance), F32x8::splat(UNIFORM_SPHERE))
        };
        LightSample8 {
            wi,
            radiance,
            pdf,
            infinite: Mask8::all_lanes(),
            valid: mask & pdf.gt(F32x8::ZERO),
            ..LightSample8::NONE
        }
    }

    /// Power through a disk of the scene's radius.
    fn power(_: &Light, scene: &SceneExtent) -> f64 {
        PI * scene.radius * scene.radius * scene.environment
    }
}

/// Unit world direction from the map's sampler. The words choose row, cell, and position in the cell; the position
/// takes 16 bits for each coordinate from the last word, and below them the 8 lowest bits of the first two, which move
/// the choice of row and cell in 2^-24 of the cases only.
#[inline(always)]
fn sample_map(scene: &Scene<'_>, e: &Environment, words: [U32x8; 3], mask: Mask8) -> Vec3x8 {
    // lanes outside the mask read the first entries, which are near
    let [r_row, r_column] = [words[0], words[1]].map(|w| U32x8::select(mask, w, U32x8::splat(0)));
    // without tables (a black map) the first cell, whose density is 0
    let or_first = |k: U32x8| U32x8::select(k.eq(U32x8::splat(NONE)), U32x8::splat(0), k);
    let rows = e.height.max(2) - 1;
    let row = or_first(pick(scene.env_alias, U32x8::splat(0), rows, r_row));
    let start = U32x8::splat(rows) + row * U32x8::splat(e.width);
    let column = or_first(pick(scene.env_alias, start, e.width, r_column));
    let (row, column) = (row.to_array(), column.to_array());
    let low = |w: U32x8| (w & U32x8::splat(0xff)) << 8;
    let u0 = ((words[2] & U32x8::splat(0xffff_0000)) | low(words[0])).to_unit();
    let u1 = ((words[2] << 16) | low(words[1])).to_unit();
    let at = MapPosition { column, row, x: F32x8::ZERO, y: F32x8::ZERO };
    let l = relative_luminance(corners(scene, e, &at, mask));
    let t = sample_linear(u0, l[0] + l[1], l[2] + l[3]);
    let x = sample_linear(u1, lerp(t, l[0], l[2]), lerp(t, l[1], l[3]));
    let (cos_theta, sin_theta) = Band::new(e, row).polar(t);
    let turn = (F32x8::from_fn(|i| column[i] as f32) + 0.5 + x) / F32x8::splat(e.width as f32);
    let (sin_phi, cos_phi) = turn.sin_cos_2pi();
    to_world(e, Vec3x8::new(sin_theta * sin_phi, cos_theta, -(sin_theta * cos_phi)))
}

/// Radiance of the environment in the unit world directions `dir` (away from the viewer). 0 outside `mask` and without
/// an environment.
#[inline(always)]
pub fn environment_radiance(scene: &Scene<'_>, dir: Vec3x8, mask: Mask8) -> Vec3x8 {
    let Some(e) = scene.environment else { return Vec3x8::ZERO };
    let radiance = splat(e.radiance);
    if e.kind != EnvironmentKind::Map as u32 {
        return radiance.zero_unless(mask);
    }
    let at = map_position(e, to_local(e, dir));
    (bilinear(corners(scene, e, &at, mask), at.x, at.y) * radiance).zero_unless(mask)
}

/// Density with which [`super::sample_of`] at `p`, `n` chooses the unit world direction `dir` to the environment:
/// selection probability times solid-angle density. 0 outside `mask` and in cells of a map that are not brighter than its
/// mean.
#[inline(always)]
pub fn environment_pdf<S: LightSelector>(
    scene: &Scene<'_>,
    selector: &S,
    p: Vec3x8,
    n: Vec3x8,
    dir: Vec3x8,
    mask: Mask8,
) -> F32x8 {
    environment_met(scene, selector, [p, n], dir, mask).1
}

/// [`environment_radiance`] and [`environment_pdf`], from `p` with normals `n`: the map is read once.
#[inline(always)]
pub fn environment_met<S: LightSelector>(
    scene: &Scene<'_>,
    selector: &S,
    [p, n]: [Vec3x8; 2],
    dir: Vec3x8,
    mask: Mask8,
) -> (Vec3x8, F32x8) {
    let Some(e) = scene.environment else { return (Vec3x8::ZERO, F32x8::ZERO) };
    let (mut radiance, mut density) = (splat(e.radiance), F32x8::splat(UNIFORM_SPHERE));
    if e.kind == EnvironmentKind::Map as u32 {
        let at = map_position(e, to_local(e, dir));
        let c = corners(scene, e, &at, mask);
        (radiance, density) = (bilinear(c, at.x, at.y) * radiance, map_density(scene, e, &at, c, mask));
    }
    let pdf = density * selector.probability(p, n, U32x8::splat(e.light), mask);
    (radiance.zero_unless(mask), (mask & usable(pdf)).zero_unless(pdf))
}
