//! Sampling tables and selection weights of lights: what baking adds to the scene's description of emission.

use crate::alias;
use crate::math::Std;
use croupier::unstable::compose::LatLong;
use croupier::unstable::light::{SceneExtent, luminance, power};
use croupier::unstable::scene::blob::{Alias, Environment, EnvironmentKind, Light};
use std::f64::consts::TAU;

/// Integral of bilinear luminance over each cell of a lat-long map, in luminance x sr, row by row: `width` x
/// `(height - 1)` of them, see [`LatLong::row`].
fn cell_integrals(map: &LatLong<'_>) -> Vec<f64> {
    (0..map.rows()).flat_map(|j| (0..map.columns()).map(map.row::<Std>(j))).collect()
}

fn map(texels: &[[f32; 3]], width: u32, height: u32) -> LatLong<'_> {
    LatLong::new(texels, [width, height]).expect("an environment map needs two rows")
}

/// The alias tables of an environment map: one over its `height - 1` rows of cells, then one of `width` entries per
/// row, in the layout of the blob's `EnvAlias` section. Empty if the map is black.
///
/// A cell's weight is the integral of the bilinear luminance over its solid angle, above that of the map's mean
/// ([`LatLong::weights`]): a cell at or below the mean is never picked and any other one can be. `texels` are linear
/// radiance, row 0 (+Y) first.
///
/// # Panics
/// Unless `width >= 1`, `height >= 2` and `texels.len() == width * height`.
pub fn map_tables(texels: &[[f32; 3]], width: u32, height: u32) -> Vec<Alias> {
    let map = map(texels, width, height);
    let shared = map.shared_luminance::<Std>();
    let cells: Vec<f64> = (0..map.rows()).flat_map(|j| (0..map.columns()).map(map.weights::<Std>(j, shared))).collect();
    let rows: Vec<f64> = cells.chunks(width as usize).map(|row| row.iter().sum()).collect();
    let mut tables = alias::build(&rows);
    if tables.is_empty() {
        return tables;
    }
    for row in cells.chunks(width as usize) {
        let table = alias::build(row);
        // A row without weight is never picked; its table is there to keep the layout regular.
        tables.extend(if table.is_empty() { alias::build(&vec![1.0; width as usize]) } else { table });
    }
    tables
}

/// Integral of the environment's luminance over all directions, in luminance x sr. `texels` is empty for a constant.
pub fn luminance_integral(environment: &Environment, texels: &[[f32; 3]]) -> f64 {
    match EnvironmentKind::from_u32(environment.kind) {
        Some(EnvironmentKind::Constant) => 2.0 * TAU * luminance(environment.radiance),
        Some(EnvironmentKind::Map) => {
            let map = map(texels, environment.width, environment.height).scaled(environment.radiance);
            cell_integrals(&map).iter().sum()
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
