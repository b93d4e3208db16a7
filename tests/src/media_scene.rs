//! Scenes with participating media, and comparisons of what they show with numbers.

use croupier_host::description::*;

use crate::runner::Image;
use crate::scenes::{add_box, camera, in_white_environment};

/// A medium of density 1.
pub fn homogeneous(sigma_a: [f32; 3], sigma_s: [f32; 3], g: f32) -> Medium {
    Medium { name: "homogeneous".into(), sigma_a, sigma_s, g, ..Medium::default() }
}

/// The same medium with a density of `cells` values in a box.
pub fn in_grid(medium: Medium, cells: [u32; 3], bounds: [[f32; 3]; 2], values: Vec<f32>) -> Medium {
    Medium { name: "grid".into(), density: Density::Grid { cells, bounds, values }, ..medium }
}

/// Adds a medium; the material of its boundary, which is `model`.
pub fn add_medium(scene: &mut SceneDescription, medium: Medium, model: Model) -> u32 {
    scene.media.push(medium);
    let boundary = scene.add_material("boundary", model);
    scene.materials[boundary as usize].medium = Some(scene.media.len() as u32 - 1);
    boundary
}

/// Adds a medium in the box `lo..hi`, whose sides refract nothing.
pub fn add_medium_box(scene: &mut SceneDescription, medium: Medium, lo: [f32; 3], hi: [f32; 3]) {
    let boundary = add_medium(scene, medium, Model::Null);
    add_box(scene, boundary, lo, hi, false);
}

/// 4 x 4 pixels that all look along one line, to 1e-5 of its length, in a constant environment.
pub fn one_line(origin: [f64; 3], target: [f64; 3], radiance: [f32; 3]) -> SceneDescription {
    let mut scene = in_white_environment(camera(origin, target, 1.1e-3, [4, 4]));
    scene.environment = Some(Environment::Constant { radiance });
    scene
}

/// A light of intensity or irradiance 1, where nothing is to be seen but what it lights.
pub fn in_the_dark(origin: [f64; 3], target: [f64; 3], light: Emitter) -> SceneDescription {
    let mut scene = one_line(origin, target, [0.0; 3]);
    scene.environment = None;
    scene.emitters.push(light);
    scene
}

/// The radiance is what is expected in every pixel and channel, without noise: within `tolerance`, relative.
#[track_caller]
pub fn assert_exact(what: &str, image: &Image, expected: [f64; 3], tolerance: f64) {
    assert_eq!(image.counters.non_finite, 0, "{what}");
    for p in &image.pixels {
        for (c, want) in expected.into_iter().enumerate() {
            let (mean, error) = (p.mean()[c], p.variance_of_mean()[c].sqrt());
            assert!((mean - want).abs() <= tolerance * want, "{what}, channel {c}: {mean} for {want}");
            assert!(error <= tolerance * want, "{what}, channel {c}: noise of {error}");
        }
    }
}

/// The mean of every channel is what is expected, within `limit` standard errors and `rounding`, relative; a standard
/// error above `power` of that fails, as it could not tell. What is below `least` counts as that.
#[track_caller]
pub fn assert_channels(what: &str, image: &Image, expected: [f64; 3], [limit, power, rounding, least]: [f64; 4]) {
    assert_eq!(image.counters.non_finite, 0, "{what}");
    for (c, want) in expected.into_iter().enumerate() {
        let (mean, error) = (image.channel(c), image.error_of_channel(c));
        let (off, scale) = (mean - want, want.max(least));
        assert!(error <= power * scale, "{what}, channel {c}: {mean} +- {error} sees nothing, expected {want}");
        assert!(
            off.abs() <= limit * error + rounding * scale,
            "{what}, channel {c}: {mean} +- {error}, expected {want} ({:.2} standard errors)",
            off / error
        );
    }
}

/// Part of the line `o + t d` in the box `lo..hi`, as a range of t; `None` outside.
pub fn through_box(o: [f64; 3], d: [f64; 3], lo: [f64; 3], hi: [f64; 3]) -> Option<[f64; 2]> {
    let mut range = [f64::NEG_INFINITY, f64::INFINITY];
    for a in 0..3 {
        let (x, y) = ((lo[a] - o[a]) / d[a], (hi[a] - o[a]) / d[a]);
        range = [range[0].max(x.min(y)), range[1].min(x.max(y))];
    }
    (range[0] < range[1]).then_some(range)
}
