//! Scenes with participating media, and comparisons of what they show with numbers.

use croupier_host::description::*;

use crate::runner::Image;
use crate::scenes::*;

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

/// Fog in a box, denser smoke in a grid within it, a pane before both and a sheet with holes, under a sun and a sky; the
/// camera is in the fog.
pub fn misty(size: [u32; 2]) -> SceneDescription {
    let mut s = SceneDescription {
        camera: camera([0.3, 0.9, 3.2], [0.0, 0.6, 0.0], 42.0, size),
        ..SceneDescription::default()
    };
    let texels = (0..16u8).map(|i| [40 + 12 * i, 200 - 9 * i, 90, 17 * (i * 7 % 16)]).collect();
    s.textures.push(Texture { name: "holes".into(), width: 4, height: 4, texels, ..Texture::default() });
    let values = (0..7 * 6 * 5).map(|i| (i * 37 % 101) as f32 / 50.0 * f32::from(i % 3 != 0)).collect();
    let smoke = Medium { emission: [0.2, 0.05, 0.0], ..homogeneous([0.5, 0.8, 1.5], [4.0, 3.0, 2.0], 0.5) };
    let bounds = [[-0.7, 0.1, -0.7], [0.6, 1.2, 0.5]];
    add_medium_box(&mut s, in_grid(smoke, [7, 6, 5], bounds, values), bounds[0], bounds[1]);
    let fog = homogeneous([0.02, 0.03, 0.05], [0.1, 0.12, 0.2], -0.2);
    add_medium_box(&mut s, fog, [-2.5, 0.0, -2.5], [2.5, 2.5, 3.5]);
    let floor = s.add_material("floor", diffuse([0.6, 0.5, 0.4]));
    add_quad(&mut s, "floor", floor, facing_y(4.0, -0.05, 1.0));
    let emitter = s.add_material("emitter", grey(0.3));
    add_quad(&mut s, "emitter", emitter, facing_y(0.4, 2.2, -1.0));
    s.emitters.push(Emitter::Area { material: emitter, radiance: [9.0, 8.0, 7.0] });
    let pane = s.add_material("pane", Model::ThinDielectric { int_ior: 1.5, ext_ior: 1.0 });
    add_quad(&mut s, "pane", pane, facing_z(0.8, 1.1, 1.0).map(|[x, y, z]| [x - 0.4, y + 0.9, z]));
    let holes = s.add_material("holes", Model::Diffuse { reflectance: Reflectance::Texture(0) });
    s.materials[holes as usize].cutout = true;
    add_quad(&mut s, "holes", holes, facing_z(0.5, 0.8, 1.0).map(|[x, y, z]| [x + 0.8, y + 0.6, z]));
    let marble = homogeneous([0.1, 0.3, 0.6], [6.0, 5.0, 4.0], 0.0);
    let skin = add_medium(&mut s, marble, Model::Dielectric { int_ior: 1.4, ext_ior: 1.0 });
    add_sphere(&mut s, skin, [1.2, 0.4, -0.6], 0.4, Sphere { subdivisions: 3, smooth: true, inwards: false });
    s.emitters.push(Emitter::Directional { direction: [-1.0, -2.0, -0.5], irradiance: [1.5, 1.4, 1.2] });
    s.environment = Some(Environment::Constant { radiance: [0.2, 0.3, 0.5] });
    s
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
