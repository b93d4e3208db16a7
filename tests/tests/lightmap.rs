//! Lightmaps against closed forms and against what a camera sees.

use croupier::unstable::profile::Full;
use croupier::{Scene, Settings};
use croupier_host::description::*;
use croupier_host::drive::{Options, Target, Unobserved, drive_with};
use croupier_host::lightmap::{Lightmap, LightmapOptions, Surface, TexelOrigin, render_lightmap};
use croupier_tests::runner::settings;
use croupier_tests::scenes::{add_box, add_quad, blob, camera, cornell, facing_y, grey, in_white_environment};
use std::f64::consts::PI;

/// Largest deviation in standard errors that chance explains: in 10^4 comparisons once in 2,000 runs.
const SIGMAS: f64 = 5.5;

fn options(size: [u32; 2], strategy: &str, samples: u32) -> LightmapOptions {
    let settings = croupier::Strategy::parse(strategy).map(|s| croupier_host::render::RenderOptions::new(s).settings);
    let target = Target::Spp(samples);
    LightmapOptions { settings: Settings { size, ..settings.unwrap() }, target, ..LightmapOptions::new(size) }
}

#[track_caller]
fn render(scene: &SceneDescription, object: &str, options: &LightmapOptions) -> Lightmap {
    let bytes = blob(scene);
    let surface = Surface::of(scene, &[object]).unwrap();
    let map = render_lightmap(Scene::from_bytes(&bytes).unwrap(), &surface, options, &Unobserved).unwrap();
    assert_eq!(map.rendered.counters.non_finite, 0);
    map
}

/// A floor of 2 x 2 around the origin, black, in the dark.
fn floor() -> SceneDescription {
    let mut s = SceneDescription { camera: camera([0.0, 2.0, 5.0], [0.0; 3], 40.0, [8, 8]), ..Default::default() };
    let black = s.add_material("black", grey(0.0));
    add_quad(&mut s, "floor", black, facing_y(1.0, 0.0, 1.0));
    s
}

/// Mean of `f(x, z)` over the part of the floor in a texel, row 0 at z = -1, by the midpoint rule.
fn over_texel(size: [u32; 2], texel: usize, f: impl Fn(f64, f64) -> f64) -> f64 {
    let n = 8;
    let (column, row) = (texel % size[0] as usize, texel / size[0] as usize);
    let at = |i: usize, k: usize, size: u32| 2.0 * (i as f64 + (k as f64 + 0.5) / n as f64) / f64::from(size) - 1.0;
    let sum: f64 = (0..n * n).map(|k| f(at(column, k % n, size[0]), at(row, k / n, size[1]))).sum();
    sum / (n * n) as f64
}

/// Every channel of every texel within [`SIGMAS`] standard errors of `expected(texel)`, and these below the share
/// `power` of it.
#[track_caller]
fn assert_irradiance(map: &Lightmap, power: f64, expected: impl Fn(usize) -> [f64; 3]) {
    for texel in 0..map.raw.len() {
        for (c, wanted) in expected(texel).into_iter().enumerate() {
            let (found, noise) = (f64::from(map.raw[texel][c]), f64::from(map.stderr[texel][c]));
            assert!(noise <= power * wanted, "texel {texel}: {noise} of {wanted}, the test could not tell");
            assert!(
                (found - wanted).abs() <= SIGMAS * noise + 1e-5 * wanted,
                "{texel}: {found}, not {wanted} +- {noise}"
            );
        }
    }
}

/// Killed by: irradiance over pi, directions that are not in proportion to the cosine, light samples that are counted
/// besides the rays that meet the same light.
#[test]
fn a_constant_environment_gives_pi_times_its_radiance() {
    let mut scene = floor();
    scene.environment = Some(Environment::Constant { radiance: [1.0, 2.0, 0.5] });
    for strategy in ["classic", "ears"] {
        let map = render(&scene, "floor", &options([8, 6], strategy, 512));
        assert_irradiance(&map, 0.03, |_| [1.0, 2.0, 0.5].map(|l| PI * l));
        assert!(map.origin.iter().all(|o| *o == TexelOrigin::Samples) && map.samples.iter().all(|n| *n == 512));
    }
}

/// Irradiance of the plane y = 0 at (x, z) from a rectangle of radiance 1 at height `h`, facing down (Lambert 1760).
fn below_rectangle([x, z]: [f64; 2], [x0, x1]: [f64; 2], [z0, z1]: [f64; 2], h: f64) -> f64 {
    let corners = [[x0, z0], [x1, z0], [x1, z1], [x0, z1]].map(|[a, b]| [a - x, h, b - z]);
    let length = |v: [f64; 3]| v.iter().map(|k| k * k).sum::<f64>().sqrt();
    let mut sum = 0.0;
    for (a, b) in corners.into_iter().zip(corners.into_iter().cycle().skip(1)) {
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let dot: f64 = (0..3).map(|k| a[k] * b[k]).sum();
        sum += length(cross).atan2(dot) * cross[1] / length(cross);
    }
    sum.abs() / 2.0
}

/// Texel by texel. Killed by: rows that are upside down, columns and rows that change places, positions at centres of
/// texels where light changes, a light sample without its cosine or its distance.
#[test]
fn a_rectangle_follows_lambert() {
    let mut scene = floor();
    let emitter = scene.add_material("emitter", grey(0.0));
    let corners = [[0.1, 0.5, -0.7], [0.8, 0.5, -0.7], [0.8, 0.5, 0.2], [0.1, 0.5, 0.2]];
    add_quad(&mut scene, "emitter", emitter, corners);
    scene.emitters.push(Emitter::Area { material: emitter, radiance: [2.0, 1.0, 3.0] });
    let size = [12, 8];
    let expected = |texel| {
        let e = over_texel(size, texel, |x, z| below_rectangle([x, z], [0.1, 0.8], [-0.7, 0.2], 0.5));
        [2.0 * e, e, 3.0 * e]
    };
    for strategy in ["classic", "ears"] {
        assert_irradiance(&render(&scene, "floor", &options(size, strategy, 256)), 0.08, expected);
    }
}

/// Lights that no ray meets, on an instance that is moved, turned and mirrored: its map is that of the same triangles in
/// the world. Killed by: a map of the prototype's own space, fronts of a mirrored instance that become backs, triangles
/// of a description taken for those of a blob, which leaves out those without area.
#[test]
fn points_and_instances() {
    let mut scene = floor();
    scene.emitters.push(Emitter::Point { position: [0.3, 0.8, -0.4], intensity: [1.0, 2.0, 3.0] });
    let size = [10, 10];
    let expected = |texel| {
        let e = over_texel(size, texel, |x, z| 0.8 * ((x - 0.3f64).powi(2) + 0.64 + (z + 0.4f64).powi(2)).powf(-1.5));
        [e, 2.0 * e, 3.0 * e]
    };
    let settings = options(size, "classic", 256);
    let plain = render(&scene, "floor", &settings);
    assert_irradiance(&plain, 0.05, expected);
    let mut instanced = floor();
    instanced.emitters = scene.emitters.clone();
    instanced.vertices.clear();
    instanced.triangles.clear();
    instanced.objects.clear();
    let nowhere = [[0.0; 3]; 4];
    add_quad(&mut instanced, "no area", 0, nowhere);
    add_quad(&mut instanced, "part", 0, facing_y(1.0, 7.0, 1.0));
    instanced.vertices.iter_mut().for_each(|v| v.uv[0] = 1.0 - v.uv[0]);
    instanced.prototypes.push(Prototype { name: "slab".into(), triangles: 2..4, instances: Vec::new() });
    let mirror = [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, -7.0], [0.0, 0.0, 1.0, 0.0]];
    instanced.instances.push(Instance::new("placed", 0, mirror));
    let placed = render(&instanced, "placed", &settings);
    assert_irradiance(&placed, 0.05, expected);
    for (texel, (a, b)) in plain.raw.iter().zip(&placed.raw).enumerate() {
        let (column, row) = (texel % 10, texel / 10);
        // the triangles share other texels in a mirror
        if column != row && column + row != 9 {
            (0..3).for_each(|c| assert!((a[c] - b[c]).abs() <= 1e-4 * a[c], "{texel}: {a:?} {b:?}"));
        }
    }
    let refused = Surface::of(&instanced, &["part"]).unwrap_err().to_string();
    assert!(refused.contains("`part`") && refused.contains("`slab`") && refused.contains("instances"), "{refused}");
}

/// In the box the floor's irradiance is what a camera sees of the floor times pi over the albedo: texels are pixels of an
/// orthographic camera below the emitter. Killed by: light of the first bounce counted twice or left out, an albedo of
/// the floor that is in the map, samples outside of their texel.
#[test]
fn the_map_is_what_a_camera_sees() {
    let size = [16, 16];
    let mut scene = cornell(size);
    scene.camera = Camera {
        projection: Projection::Orthographic { height: 2.0 },
        ..camera([0.0, 0.9, 0.0], [0.0, -1.0, 0.0], 45.0, size)
    };
    let bytes = blob(&scene);
    let base = Settings { seed: 5, ..settings(&bytes, "classic") };
    let seen =
        drive_with::<Full>(Scene::from_bytes(&bytes).unwrap(), &Options::new(base, Target::Spp(1024)), &Unobserved);
    let seen = seen.unwrap();
    let albedo = [0.6f32, 0.55, 0.5].map(f64::from);
    for strategy in ["classic", "ears"] {
        let map = render(&scene, "floor", &options(size, strategy, 512));
        let (mut squares, mut means) = (0.0, [0.0; 2]);
        for (texel, pixel) in seen.pixels.iter().enumerate() {
            for (c, albedo) in albedo.iter().enumerate() {
                let scale = PI / albedo;
                let (a, b) = (f64::from(map.raw[texel][c]), pixel.mean()[c] * scale);
                let noise = f64::from(map.stderr[texel][c]).hypot(pixel.variance_of_mean()[c].sqrt() * scale);
                assert!(noise < 0.06 * b, "{strategy}, texel {texel}: {noise} of {b}");
                assert!((a - b).abs() < SIGMAS * noise, "{strategy}, texel {texel}: {a} and {b} +- {noise}");
                squares += ((a - b) / noise).powi(2) / 768.0;
                means[0] += a / 768.0;
                means[1] += b / 768.0;
            }
        }
        assert!((means[0] / means[1] - 1.0).abs() < 5e-3, "{strategy}: {means:?}");
        // standard errors of `ears` are upper bounds
        assert!(squares < 1.4 && squares > 0.2, "{strategy}: mean squared deviation {squares}");
        for (texel, raw) in map.raw.iter().enumerate() {
            let sum: [f32; 3] = std::array::from_fn(|c| map.parts[0][texel][c] + map.parts[1][texel][c]);
            (0..3).for_each(|c| assert!((sum[c] - raw[c]).abs() < 1e-4 * raw[c], "{sum:?} {raw:?}"));
            assert!(map.parts[0][texel][0] > map.parts[1][texel][0] && map.parts[1][texel][0] > 0.0);
            assert!(map.normals[texel][1] > 0.999 && map.backs[texel] == 0.0);
        }
    }
}

/// A slanted chart in the middle of the map. Killed by: rings too many or too few, a gutter of black, covered texels that
/// are overwritten, texels taken for covered by their centres.
#[test]
fn gutters_repeat_the_border() {
    let mut scene = floor();
    scene.environment = Some(Environment::Constant { radiance: [1.0; 3] });
    let uv = [[0.31, 0.28], [0.72, 0.4], [0.66, 0.71], [0.35, 0.6]];
    scene.vertices.iter_mut().zip(uv).for_each(|(v, uv)| v.uv = uv);
    for gutter in [0, 1, 3] {
        let map = render(&scene, "floor", &LightmapOptions { gutter, ..options([24, 20], "classic", 8) });
        let at = |texel: usize| [(texel % 24) as i64, (texel / 24) as i64];
        let near = |a: usize, b: usize| {
            let ([x, y], [u, v]) = (at(a), at(b));
            (x - u).abs().max((y - v).abs())
        };
        let covered: Vec<usize> = (0..480).filter(|i| map.coverage[*i] > 0.0).collect();
        let partly = covered.iter().filter(|i| map.coverage[**i] < 0.999).count();
        assert!(covered.len() > 60 && partly > 20, "{} covered, {partly} in part", covered.len());
        let area: f64 = map.coverage.iter().map(|c| f64::from(*c)).sum();
        let exact: f64 =
            (0..4).map(|i| uv[i][0] * uv[(i + 1) % 4][1] - uv[i][1] * uv[(i + 1) % 4][0]).sum::<f32>().into();
        assert!((area - exact / 2.0 * 480.0).abs() < 1e-3, "{area}");
        for texel in 0..480 {
            let distance = covered.iter().map(|c| near(texel, *c)).min().unwrap();
            let wanted = match distance {
                0 => TexelOrigin::Samples,
                d if d <= i64::from(gutter) => TexelOrigin::Gutter,
                _ => TexelOrigin::Nowhere,
            };
            assert_eq!(map.origin[texel], wanted, "texel {texel}");
            match wanted {
                TexelOrigin::Samples => assert_eq!(map.irradiance[texel], map.raw[texel]),
                TexelOrigin::Gutter => {
                    let from = (0..480).filter(|i| near(*i, texel) == 1 && map.origin[*i] != TexelOrigin::Nowhere);
                    assert!(
                        from.clone().any(|i| map.irradiance[i] == map.irradiance[texel])
                            && map.irradiance[texel][0] > 0.0
                    );
                }
                _ => assert_eq!(map.irradiance[texel], [0.0; 3]),
            }
        }
        if gutter > 0 {
            // the middle of an edge of the chart
            let edge = map.lookup([0.515, 0.34])[0];
            assert!((f64::from(edge) / PI - 1.0).abs() < 0.3, "{edge}");
        }
    }
}

/// Two charts side by side without any gutter, one lit and one in the dark. Killed by: a denoiser that takes light from
/// the other chart, one that does nothing, charts that are one because their texels touch.
#[test]
fn denoising_stays_within_charts() {
    let mut scene = floor();
    let emitter = scene.add_material("emitter", grey(0.0));
    let corners = [[-0.3, 0.5, -0.3], [0.3, 0.5, -0.3], [0.3, 0.5, 0.3], [-0.3, 0.5, 0.3]];
    add_quad(&mut scene, "emitter", emitter, corners);
    scene.emitters.push(Emitter::Area { material: emitter, radiance: [1.0; 3] });
    scene.vertices.iter_mut().take(4).for_each(|v| v.uv[0] *= 0.5);
    // below the floor no light arrives
    add_quad(&mut scene, "cellar", 0, facing_y(1.0, -1.0, 1.0));
    scene.vertices.iter_mut().skip(8).for_each(|v| v.uv[0] = 0.5 + 0.5 * v.uv[0]);
    let size = [32, 16];
    let bytes = blob(&scene);
    let surface = Surface::of(&scene, &["floor", "cellar"]).unwrap();
    let of = |denoise| {
        let options = LightmapOptions { denoise, ..options(size, "classic", 4) };
        render_lightmap(Scene::from_bytes(&bytes).unwrap(), &surface, &options, &Unobserved).unwrap()
    };
    let (raw, denoised) = (of(false), of(true));
    assert_eq!((denoised.charts, denoised.overlaps.len(), &raw.raw), (2, 0, &denoised.raw));
    let (mut before, mut after) = (0.0, 0.0);
    for texel in 0..512 {
        if texel % 32 >= 16 {
            assert_eq!((denoised.chart[texel], denoised.irradiance[texel]), (1, [0.0; 3]), "texel {texel}");
            continue;
        }
        let size = [16, 16];
        let wanted = over_texel(size, texel / 32 * 16 + texel % 32, |x, z| {
            below_rectangle([x, z], [-0.3, 0.3], [-0.3, 0.3], 0.5)
        });
        before += (f64::from(raw.irradiance[texel][0]) - wanted).powi(2);
        after += (f64::from(denoised.irradiance[texel][0]) - wanted).powi(2);
    }
    assert!(after < 0.8 * before, "squared errors {before} and {after}");
}

/// A block stands on the floor: texels below it are filled from around it. Killed by: texels below that stay black, ones
/// beside it that count as inside, a limit of 1 that fills any.
#[test]
fn texels_inside_of_things_are_filled() {
    let mut scene = floor();
    scene.environment = Some(Environment::Constant { radiance: [1.0; 3] });
    add_box(&mut scene, 0, [-0.5, -0.1, -0.5], [0.25, 0.4, 0.5], false);
    let size = [16, 16];
    let map = render(&scene, "floor", &options(size, "classic", 64));
    let all = render(&scene, "floor", &LightmapOptions { most_backs: 1.0, ..options(size, "classic", 64) });
    for texel in 0..256 {
        let [column, row] = [texel % 16, texel / 16];
        let inside = (4..10).contains(&column) && (4..12).contains(&row);
        assert_eq!(map.backs[texel], f32::from(u8::from(inside)), "texel {texel}");
        let wanted = if inside { TexelOrigin::Filled } else { TexelOrigin::Samples };
        assert_eq!((map.origin[texel], all.origin[texel]), (wanted, TexelOrigin::Samples));
        assert!(map.irradiance[texel][0] > 0.5 && map.irradiance[texel][0] < 3.6, "{:?}", map.irradiance[texel]);
        assert_eq!(all.irradiance[texel] == [0.0; 3], inside, "texel {texel}");
    }
}

/// Killed by: anything that depends on the order in which threads finish.
#[test]
fn threads_do_not_change_a_bit() {
    let scene = cornell([8, 8]);
    let of = |threads| {
        let map = render(&scene, "left", &LightmapOptions { threads, denoise: true, ..options([24, 24], "ears", 16) });
        (map.irradiance, map.stderr, map.backs, map.origin)
    };
    let one = of(1);
    assert!(one == of(2) && one == of(4));
    // shards are part of what makes the map
    let shards = |shards| {
        let o = options([24, 24], "ears", 64);
        let map = render(&scene, "left", &LightmapOptions { settings: Settings { shards, ..o.settings }, ..o });
        map.raw.iter().flatten().map(|x| f64::from(*x)).sum::<f64>() / (3.0 * 576.0)
    };
    let means = [1, 2, 4].map(shards);
    assert!(means.iter().all(|m| (m / means[0] - 1.0).abs() < 0.01), "{means:?}");
}

/// Killed by: a message without the object, a map that is made of nothing, overlaps that nobody hears of, objects of one
/// name of which only the first is taken.
#[test]
fn objects_that_have_no_map_are_named() {
    let mut scene = in_white_environment(camera([0.0, 2.0, 5.0], [0.0; 3], 40.0, [8, 8]));
    let black = scene.add_material("black", grey(0.0));
    for (name, scale) in [("floor", 1.0), ("flat", 0.0), ("tiled", 3.0), ("other", 1.0)] {
        let first = scene.vertices.len();
        add_quad(&mut scene, name, black, facing_y(1.0, 0.0, 1.0));
        scene.vertices[first..].iter_mut().for_each(|v| v.uv = v.uv.map(|x| scale * x));
    }
    let error = |names: &[&str]| Surface::of(&scene, names).unwrap_err().to_string();
    assert_eq!(error(&["flor"]), "there is no object `flor`; there are `floor`, `flat`, `tiled`, `other`");
    assert_eq!(
        error(&["floor", "flat"]),
        "object `flat` has no texture coordinates: none of its 2 triangles has an area in them"
    );
    assert_eq!(
        error(&["tiled"]),
        "object `tiled`: 2 of 2 triangles have texture coordinates outside of 0 to 1, where the map is"
    );
    let bytes = blob(&scene);
    let view = Scene::from_bytes(&bytes).unwrap();
    let both = Surface::of(&scene, &["floor", "other"]).unwrap();
    let map = render_lightmap(view, &both, &options([8, 8], "classic", 1), &Unobserved).unwrap();
    let words: Vec<String> = map.overlaps.iter().map(ToString::to_string).collect();
    let said = "charts of the objects `floor` and `other` overlap in 64 texels: 4 triangles share places in the map";
    assert_eq!(words, [said]);
    // a second set of coordinates
    let halves = |vertex: u32, v: &Vertex| [v.uv[0] * 0.5 + if vertex >= 12 { 0.5 } else { 0.0 }, v.uv[1]];
    let apart = Surface::of_mapped(&scene, &["floor", "other"], halves).unwrap();
    let map = render_lightmap(view, &apart, &options([8, 8], "classic", 1), &Unobserved).unwrap();
    assert!(map.overlaps.is_empty() && map.charts == 2);
    let alone = blob(&floor());
    let other = render_lightmap(Scene::from_bytes(&alone).unwrap(), &both, &options([8, 8], "classic", 1), &Unobserved);
    assert!(other.unwrap_err().to_string().contains("2 triangles"));
    let none = render_lightmap(view, &both, &options([8, 0], "classic", 1), &Unobserved);
    assert!(none.unwrap_err().to_string().contains("8x0"));
}
