//! Pictures of principled materials: normal maps, textures of parameters, emission textures.

use croupier::Settings;
use croupier_host::description::*;
use croupier_tests::bsdf::{V, combine, dot};
use croupier_tests::quadrature::midpoint;
use croupier_tests::runner::{Image, render, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::SplitMix;
use std::f64::consts::PI;

fn texture(encoding: Encoding, size: [u32; 2], texel: impl FnMut(u32) -> [u8; 4]) -> Texture {
    let texels = (0..size[0] * size[1]).map(texel).collect();
    Texture { name: "texture".into(), width: size[0], height: size[1], texels, encoding, ..Texture::default() }
}

fn constant(encoding: Encoding, texel: [u8; 4]) -> Texture {
    texture(encoding, [2, 2], |_| texel)
}

/// A quad of a principled material that fills the picture, seen at an angle to its normal in degrees, in a white
/// environment.
fn quad(p: Principled, textures: Vec<Texture>, degrees: f64, two_sided: bool) -> SceneDescription {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let eye = camera([10.0 * sin, 0.0, 10.0 * cos], [0.0; 3], 1.0, [8, 8]);
    let mut s = SceneDescription { textures, ..in_white_environment(eye) };
    let material = s.add_material("quad", Model::Principled(p));
    s.materials[material as usize].two_sided = two_sided;
    add_quad(&mut s, "quad", material, facing_z(100.0, 0.0, 1.0));
    // many texels in the picture
    s.vertices.iter_mut().for_each(|v| v.uv = v.uv.map(|x| x * 300.0));
    s
}

fn picture(s: &SceneDescription, spp: u32) -> Image {
    let scene = blob(s);
    let image = render(&scene, &Settings { max_depth: 8, ..settings(&scene, "none") }, spp);
    assert_eq!(image.counters.non_finite, 0);
    image
}

/// Normals all over the hemisphere.
fn rough_normals() -> Texture {
    let mut rng = SplitMix(4);
    texture(Encoding::Linear, [16, 16], |_| {
        let [x, y, z] = rng.direction();
        let code = |c: f64| (127.5 + 127.5 * c).round() as u8;
        [code(x), code(y), code(z.abs()), 255]
    })
}

/// White furnace under random normals: the mean of the picture is that without the map, within 3 %, at every angle, and no
/// pixel falls below 0.8. Killed by: directions below the surface that are lost or left where they are, normals that face away.
#[test]
fn normal_maps_keep_energy() {
    let base = Principled { base_color: [1.0; 3], roughness: 0.5, ..Principled::default() };
    for (what, p, two_sided) in [
        ("diffuse", Principled { specular: 0.0, ..base }, false),
        ("dielectric", base, false),
        ("two-sided", base, true),
        ("metal", Principled { metalness: 1.0, ..base }, false),
        ("smooth metal", Principled { metalness: 1.0, roughness: 0.1, ..base }, false),
        ("sheet", Principled { transmission: 1.0, thin_walled: true, ..base }, true),
    ] {
        for degrees in [0.0, 45.0, 75.0, 85.0, 89.0] {
            let mapped = Principled { normal_texture: Some(TextureRef::new(0)), ..p };
            let with = picture(&quad(mapped, vec![rough_normals()], degrees, two_sided), 256);
            let without = picture(&quad(p, vec![], degrees, two_sided), 256);
            let (a, b) = (with.mean(), without.mean());
            println!("{what} at {degrees}: {a:.4}, flat {b:.4}");
            assert!((a - b).abs() < 0.03 * b, "{what} at {degrees}: {a}, flat {b}");
            let darkest = with.pixels.iter().map(|p| p.mean()[1]).fold(f64::INFINITY, f64::min);
            assert!(darkest > 0.8, "{what} at {degrees}: a pixel of {darkest}");
        }
    }
}

/// Killed by: a map of flat normals that changes a bit, a texture of ones that changes a parameter.
#[test]
fn textures_without_effect_change_nothing() {
    let p = Principled { base_color: [0.8, 0.4, 0.2], coat: 0.5, transmission: 0.25, ..Principled::default() };
    let p = Principled { metalness: 0.5, roughness: 0.25, emission: [0.5, 1.0, 2.0], ..p };
    let white = constant(Encoding::Srgb, [255; 4]);
    let ones = constant(Encoding::Linear, [255; 4]);
    let flat = constant(Encoding::Linear, [128, 128, 255, 255]);
    let plain = picture(&quad(p, vec![], 40.0, true), 16);
    let of = |i| Some(TextureRef::new(i));
    for (what, changed) in [
        ("base", Principled { base_texture: of(0), ..p }),
        ("emission", Principled { emission_texture: of(0), ..p }),
        ("metalness and roughness", Principled { metal_rough_texture: of(1), ..p }),
        ("transmission", Principled { transmission_texture: of(1), ..p }),
        ("coat", Principled { coat_texture: of(1), ..p }),
        ("normal", Principled { normal_texture: of(2), ..p }),
    ] {
        let textured = picture(&quad(changed, vec![white.clone(), ones.clone(), flat.clone()], 40.0, true), 16);
        assert!(textured.bits() == plain.bits(), "{what}");
    }
}

/// A constant texture is the constant that it stands for, in its own channel. Killed by: a channel or an encoding that is
/// mixed up, a factor that is left out.
#[test]
fn constant_textures_are_constants() {
    let p = Principled { base_color: [0.9, 0.6, 0.3], coat: 1.0, transmission: 0.5, ..Principled::default() };
    let p = Principled { metalness: 0.5, roughness: 0.8, ..p };
    let code = |x: u8| f32::from(x) / 255.0;
    let linear = constant(Encoding::Linear, [51, 102, 204, 255]);
    let srgb = constant(Encoding::Srgb, [188, 137, 225, 255]);
    let decoded = [188u8, 137, 225].map(|c| croupier::unstable::texture::SRGB_TO_LINEAR[usize::from(c)]);
    let (of, half) = (|i| Some(TextureRef::new(i)), 0.5);
    for (what, textured, plain) in [
        (
            "base",
            Principled { base_texture: of(1), ..p },
            Principled { base_color: std::array::from_fn(|c| p.base_color[c] * decoded[c]), ..p },
        ),
        (
            "metalness and roughness",
            Principled { metal_rough_texture: of(0), ..p },
            Principled { roughness: p.roughness * code(102), metalness: half * code(204), ..p },
        ),
        (
            "transmission",
            Principled { transmission_texture: of(0), ..p },
            Principled { transmission: half * code(51), ..p },
        ),
        ("coat", Principled { coat_texture: of(0), ..p }, Principled { coat: code(51), ..p }),
        (
            "emission",
            Principled { emission: [1.0, 2.0, 3.0], emission_texture: of(1), ..p },
            Principled { emission: std::array::from_fn(|c| [1.0, 2.0, 3.0][c] * decoded[c]), ..p },
        ),
    ] {
        let a = picture(&quad(textured, vec![linear.clone(), srgb.clone()], 40.0, true), 64);
        let b = picture(&quad(plain, vec![], 40.0, true), 64);
        let unlike = picture(&quad(p, vec![], 40.0, true), 64);
        for c in 0..3 {
            let (x, y) = (a.channel(c), b.channel(c));
            // the same random numbers: only rounding differs
            assert!((x - y).abs() < 2e-3 * y, "{what}, channel {c}: {x}, {y}");
        }
        let moved = (0..3).map(|c| (a.channel(c) - unlike.channel(c)).abs()).fold(0.0, f64::max);
        assert!(moved > 3e-3, "{what}: the texture changes too little to be seen: {moved}");
    }
}

/// Opacity as a factor and as alpha: what passes shows the environment, doubled behind. Killed by: alpha without the
/// flag, opacity that is not a share.
#[test]
fn opacity_passes_light() {
    let black = Principled { base_color: [0.0; 3], specular: 0.0, ..Principled::default() };
    let half = picture(&quad(Principled { opacity: 0.25, ..black }, vec![], 20.0, true), 256);
    assert!((half.mean() - 0.75).abs() < 0.02, "{}", half.mean());
    let leaf = constant(Encoding::Srgb, [255, 255, 255, 102]);
    let p = Principled { opacity: 0.5, base_texture: Some(TextureRef::new(0)), ..black };
    let mut s = quad(p, vec![leaf], 20.0, true);
    assert!((picture(&s, 256).mean() - 0.5).abs() < 0.02, "alpha counts where it is not asked for");
    s.materials[0].cutout = true;
    assert!((picture(&s, 256).mean() - 0.8).abs() < 0.02, "alpha 0.4 times opacity 0.5");
}

/// What an emission texture of two columns, 1 and 0, clamped, has at u.
fn ramp(u: f64) -> f64 {
    (1.5 - 2.0 * u).clamp(0.0, 1.0)
}

fn glowing(texture: Texture, emission: [f32; 3]) -> (Texture, Principled) {
    let p = Principled { base_color: [0.0; 3], specular: 0.0, emission, ..Principled::default() };
    (texture, Principled { emission_texture: Some(TextureRef::new(0)), ..p })
}

fn half_lit() -> (Texture, Principled) {
    let columns = texture(Encoding::Linear, [2, 1], |i| [if i == 0 { 255 } else { 0 }; 4]);
    glowing(Texture { wrap: [Wrap::Clamp; 2], ..columns }, [2.0, 1.0, 4.0])
}

/// A picture filled by an emitter shows the mean of the texture times the emission. Killed by: a texture at other
/// coordinates, an emission that is not multiplied, one that shows from behind.
#[test]
fn emission_textures_are_seen() {
    let (texture, p) = half_lit();
    let mut s = SceneDescription {
        textures: vec![texture],
        camera: camera([0.0, 0.0, 10.0], [0.0; 3], 2.0 * (0.1f64).atan().to_degrees(), [8, 8]),
        ..SceneDescription::default()
    };
    let material = s.add_material("glow", Model::Principled(p));
    add_quad(&mut s, "glow", material, facing_z(1.0, 0.0, 1.0));
    let image = picture(&s, 64);
    for (c, emission) in [2.0, 1.0, 4.0].into_iter().enumerate() {
        let mean = image.channel(c);
        assert!((mean - 0.5 * emission).abs() < 0.005 * emission, "channel {c}: {mean}");
    }
    let bright = |x: usize| (0..8).map(|y| image.pixels[y * 8 + x].mean()[0]).sum::<f64>() / 8.0;
    assert!(bright(0) > 1.99 && bright(7) < 0.01 && bright(3) > bright(4), "the ramp runs along u");
    s.camera = camera([0.0, 0.0, -10.0], [0.0; 3], 10.0, [8, 8]);
    assert_eq!(picture(&s, 4).mean(), 0.0, "from behind");
}

/// A diffuse floor under a light with a texture, against quadrature of what the light sends; light samples and scattered
/// rays both find it. Killed by: a texture that one of the two techniques ignores or sees elsewhere, a choice of lights
/// that is not divided by.
#[test]
fn emission_textures_illuminate() {
    let (texture, p) = half_lit();
    let mut s = spot(0.8, [4, 4]);
    s.textures = vec![texture];
    let material = s.add_material("glow", Model::Principled(p));
    // wide enough that scattered rays find it often
    let corners = [[-1.5f32, 1.0, -0.5], [1.5, 1.0, -0.5], [1.5, 1.0, 1.5], [-1.5, 1.0, 1.5]];
    add_quad(&mut s, "glow", material, corners);
    let wide: Vec<V> = corners.iter().map(|c| c.map(f64::from)).collect();
    let irradiance = midpoint(400, 0.0, 1.0, |u| {
        midpoint(400, 0.0, 1.0, |v| {
            let a = combine(wide[0], 1.0 - u, wide[1], u);
            let b = combine(wide[3], 1.0 - u, wide[2], u);
            let d = combine(a, 1.0 - v, b, v);
            let r2 = dot(d, d);
            // both cosines are height over distance; an area of 6
            ramp(u) * d[1] * d[1] / (r2 * r2) * 6.0
        })
    });
    let scene = blob(&s);
    let image = render(&scene, &Settings { max_depth: 2, ..settings(&scene, "none") }, 16_384);
    for (c, emission) in [2.0, 1.0, 4.0].into_iter().enumerate() {
        let (mean, error, want) = (image.channel(c), image.error_of_channel(c), emission * irradiance * 0.8 / PI);
        println!("channel {c}: {mean} +- {error}, expected {want}");
        assert!(error < 0.004 * want && (mean - want).abs() < 5.0 * error + 2e-4 * want, "{mean} +- {error}, {want}");
    }
    // light samples share the light by its mean: the dark half is no light
    let lights = croupier::Scene::from_bytes(&scene).unwrap().lights.len();
    assert_eq!(lights, 2);
}

/// Triangles on which the texture is black are no lights. Killed by: a light for every triangle of the material.
#[test]
fn black_parts_of_emission_textures_are_no_lights() {
    let (texture, p) = half_lit();
    let mut s = SceneDescription { textures: vec![texture], ..SceneDescription::default() };
    let material = s.add_material("glow", Model::Principled(p));
    add_quad(&mut s, "lit", material, facing_z(1.0, 0.0, 1.0));
    add_quad(&mut s, "dark", material, facing_z(1.0, 1.0, 1.0));
    // the second quad has the right edge of the texture only
    s.vertices[4..].iter_mut().for_each(|v| v.uv[0] = 0.9 + 0.1 * v.uv[0]);
    let scene = blob(&s);
    assert_eq!(croupier::Scene::from_bytes(&scene).unwrap().lights.len(), 2);
}
