//! Sampling tables and selection weights of lights: what baking adds to the scene's description of emission.

use crate::alias;
use croupier::unstable::light::{SceneExtent, luminance, power};
use croupier::unstable::scene::blob::{Alias, Environment, EnvironmentKind, Light};
use std::f64::consts::{PI, TAU};

/// Integral of bilinear luminance over each cell of a lat-long map, in luminance x sr, row by row.
///
/// Cell (i, j) spans texel columns i, i + 1 (wrapping) and rows j, j + 1; there are `width` x `(height - 1)` of them.
/// Row j lies at polar angle `j pi / (height - 1)`. Within a cell the map is linear in the polar angle, weighted with
/// its sine; the integral is exact.
fn cell_integrals(texels: &[[f32; 3]], width: usize, height: usize) -> Vec<f64> {
    assert!(width >= 1 && height >= 2 && texels.len() == width * height, "an environment map needs two rows");
    let step = PI / (height - 1) as f64;
    let at = |i: usize, j: usize| luminance(texels[j * width + i % width]);
    let mut cells = Vec::with_capacity(width * (height - 1));
    for j in 0..height - 1 {
        let (a, b) = (j as f64 * step, (j + 1) as f64 * step);
        // The integrals of sin and of s sin over the row, s from 0 at its upper edge to 1 at its lower one.
        let all = 2.0 * ((a + b) / 2.0).sin() * (step / 2.0).sin();
        let lower = ((b.sin() - a.sin()) / step - b.cos()).clamp(0.0, all);
        for i in 0..width {
            let (top, bottom) = (at(i, j) + at(i + 1, j), at(i, j + 1) + at(i + 1, j + 1));
            cells.push((top * (all - lower) + bottom * lower) / 2.0 * TAU / width as f64);
        }
    }
    cells
}

/// The alias tables of an environment map: one over its `height - 1` rows of cells, then one of `width` entries per
/// row, in the layout of the blob's `EnvAlias` section. Empty if the map is black.
///
/// A cell's weight is the integral of the bilinear luminance over its solid angle, so a cell between black texels is
/// never picked and any other one can be. `texels` are linear radiance, row 0 (+Y) first.
///
/// # Panics
/// Unless `width >= 1`, `height >= 2` and `texels.len() == width * height`.
pub fn map_tables(texels: &[[f32; 3]], width: u32, height: u32) -> Vec<Alias> {
    let cells = cell_integrals(texels, width as usize, height as usize);
    let rows: Vec<f64> = cells.chunks(width as usize).map(|row| row.iter().sum()).collect();
    let mut tables = alias::build(&rows);
    if tables.is_empty() {
        return tables;
    }
    for row in cells.chunks(width as usize) {
        let table = alias::build(row);
        // A black row is never picked; its table is there to keep the layout regular.
        tables.extend(if table.is_empty() { alias::build(&vec![1.0; width as usize]) } else { table });
    }
    tables
}

/// Integral of the environment's luminance over all directions, in luminance x sr. `texels` is empty for a constant.
pub fn luminance_integral(environment: &Environment, texels: &[[f32; 3]]) -> f64 {
    match EnvironmentKind::from_u32(environment.kind) {
        Some(EnvironmentKind::Constant) => 2.0 * TAU * luminance(environment.radiance),
        Some(EnvironmentKind::Map) => {
            let scaled: Vec<[f32; 3]> =
                texels.iter().map(|t| std::array::from_fn(|c| t[c] * environment.radiance[c])).collect();
            cell_integrals(&scaled, environment.width as usize, environment.height as usize).iter().sum()
        }
        None => 0.0,
    }
}

/// [`power`] of every light: the weights of the light alias table. `scene_radius` is the radius of a sphere around the
/// scene, world units; a scene without extent counts as one of radius 1, so that its infinite lights can still be
/// chosen.
pub fn light_weights(
    lights: &[Light],
    environment: Option<&Environment>,
    env_texels: &[[f32; 3]],
    scene_radius: f64,
) -> Vec<f64> {
    let extent = SceneExtent {
        radius: if scene_radius > 0.0 && scene_radius.is_finite() { scene_radius } else { 1.0 },
        environment: environment.map_or(0.0, |e| luminance_integral(e, env_texels)),
    };
    lights.iter().map(|l| power(l, &extent)).collect()
}
