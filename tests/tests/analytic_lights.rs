//! Light of every kind on a diffuse floor, against closed forms: Lambert's polygon formula, the sphere light, inverse
//! squares, quadrature over environment maps.
//!
//! Which sampling technique finds the light is chosen by the scene: a point or a direction can only be sampled, light
//! elsewhere both techniques find it and multiple importance sampling must give the same, behind a `null` boundary, too.

use croupier::Settings;
use croupier::unstable::scene::blob::MaterialKind;
use croupier_host::description::*;
use croupier_tests::bsdf::{Case, unit};
use croupier_tests::light_oracle::{Map, cross, dot, polygon_irradiance, sub, wide};
use croupier_tests::runner::{Image, render, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::SplitMix;
use std::f64::consts::PI;

/// |z| that a comparison may reach: with the 60 of this file a false alarm in 1e5 runs.
const LIMIT: f64 = 5.2;

type V = [f64; 3];

/// The corners of every triangle of a material that faces the origin.
fn facing_triangles(s: &SceneDescription, material: u32) -> Vec<[V; 3]> {
    let corners = |t: &Triangle| t.vertices.map(|v| wide(s.vertices[v as usize].position));
    let towards = |[a, b, c]: &[V; 3]| dot(cross(sub(*b, *a), sub(*c, *a)), *a) < 0.0;
    s.triangles.iter().filter(|t| t.material == material).map(corners).filter(towards).collect()
}

/// A floor of albedo 0.8 and an emitter of radiance 2 made by `build`; what the emitter adds to the floor, by the
/// formula.
fn emitter_scene(build: impl Fn(&mut SceneDescription, u32)) -> (SceneDescription, f64) {
    let mut s = spot(0.8, [4, 4]);
    let emitter = s.add_material("emitter", grey(0.0));
    build(&mut s, emitter);
    s.emitters.push(Emitter::Area { material: emitter, radiance: [2.0; 3] });
    let irradiance: f64 = facing_triangles(&s, emitter).iter().map(|t| 2.0 * polygon_irradiance(t)).sum();
    (s, irradiance * 0.8 / PI)
}

fn render_depth(s: &SceneDescription, max_depth: u32, spp: u32) -> Image {
    let scene = blob(s);
    let image = render(&scene, &Settings { max_depth, ..settings(&scene, "none") }, spp);
    assert_eq!(image.counters.non_finite, 0);
    image
}

#[track_caller]
fn assert_mean(what: &str, image: &Image, expected: f64, power: f64) {
    let (mean, error) = (image.mean(), image.error_of_mean());
    println!("{what}: {mean:.6} +- {error:.6}, expected {expected:.6}");
    assert!(error <= power * expected, "{what}: a standard error of {error} sees nothing");
    let off = (mean - expected).abs();
    assert!(off <= LIMIT * error + 1e-4 * expected, "{what}: {mean} +- {error}, expected {expected}");
}

/// Adds a triangle whose front faces the origin, or turns away from it.
fn add_triangle(s: &mut SceneDescription, material: u32, [a, b, c]: [[f32; 3]; 3], towards: bool) {
    let [p, q, r] = [a, b, c].map(wide);
    let faces = dot(cross(sub(q, p), sub(r, p)), p) < 0.0;
    let order = if faces == towards { [0, 1, 2] } else { [0, 2, 1] };
    let vertices = [a, b, c].map(|position| Vertex { position, ..Vertex::default() });
    s.add_mesh("triangle", material, &vertices, &[order], false);
}

const SLANTED: [[f32; 3]; 3] = [[1.0, 0.5, -0.5], [1.0, 0.6, 0.5], [0.7, 1.6, 0.1]];

/// High, slanted, large and near, cut by the horizon, a needle.
const TRIANGLES: [(&str, [[f32; 3]; 3]); 5] = [
    ("high", [[-0.5, 3.0, -0.4], [0.6, 3.0, -0.3], [0.1, 3.0, 0.7]]),
    ("slanted", SLANTED),
    ("large and near", [[-4.0, 0.8, -5.0], [5.0, 0.8, -4.0], [0.0, 0.9, 6.0]]),
    ("cut by the horizon", [[1.5, -1.0, -0.8], [1.5, -0.5, 0.9], [1.2, 1.0, 0.0]]),
    ("a needle of 1e6 : 1", [[-30.0, 2.0, 0.5], [30.0, 2.0, 0.5], [0.0, 2.0, 0.500_06]]),
];

/// Killed by: an area density without the cosine or the distance, a power heuristic whose weights do not sum to 1,
/// emission from the back.
#[test]
fn triangle_lights_follow_lambert() {
    for (name, corners) in TRIANGLES {
        let (s, expected) = emitter_scene(|s, emitter| add_triangle(s, emitter, corners, true));
        assert!(expected > 0.0);
        assert_mean(name, &render_depth(&s, 2, 8192), expected, 0.008);
        let (s, none) = emitter_scene(|s, emitter| add_triangle(s, emitter, corners, false));
        let image = render_depth(&s, 2, 16);
        assert_eq!((none, image.mean()), (0.0, 0.0), "{name} from behind");
    }
}

/// pi L (R/d)^2 cos, in the open and within a `null` boundary that both shadow rays and scattered rays pass. Killed by:
/// triangles of a mesh chosen with the wrong probability, a boundary that stops one technique, one that makes a ray forget
/// its density or how far it has come.
#[test]
fn sphere_lights_follow_the_closed_form() {
    let (centre, radius) = ([0.5f32, 1.2, -0.2], 0.6);
    let shape = Sphere { subdivisions: 4, smooth: true, inwards: false };
    let (mut s, expected) = emitter_scene(|s, emitter| add_sphere(s, emitter, centre, radius, shape));
    let d2 = dot(wide(centre), wide(centre));
    let closed = PI * 2.0 * f64::from(radius).powi(2) / d2 * f64::from(centre[1]) / d2.sqrt() * 0.8 / PI;
    assert!((expected / closed - 1.0).abs() < 0.01, "{expected} by its triangles, {closed} for a sphere");
    assert_mean("sphere light", &render_depth(&s, 2, 32_768), expected, 0.003);

    let air = s.add_material("air", Model::Null);
    add_box(&mut s, air, [-0.4, 0.4, -1.0], [1.3, 2.0, 0.6], false);
    let behind = render_depth(&s, 2, 32_768);
    assert_mean("sphere light behind null", &behind, expected, 0.003);
    assert!(behind.counters.straight_rays > 0, "scattered rays pass");
}

/// One surface of a model in place of the floor.
fn receiver(kind: MaterialKind, alpha: f32) -> (Model, Case) {
    let reflectance = Reflectance::Constant([0.7; 3]);
    let (eta, k) = ([0.2; 3], [3.0; 3]);
    let (int_ior, ext_ior) = (1.5, 1.0);
    match kind {
        MaterialKind::RoughConductor => {
            (Model::RoughConductor { eta, k, reflectance, alpha }, Case::new(kind, [0.7; 3], eta, k, alpha))
        }
        MaterialKind::RoughPlastic => (
            Model::RoughPlastic { reflectance, int_ior, ext_ior, alpha },
            Case::new(kind, [0.7; 3], [1.5; 3], [0.0; 3], alpha),
        ),
        _ => (Model::Plastic { reflectance, int_ior, ext_ior }, Case::new(kind, [0.7; 3], [1.5; 3], [0.0; 3], 0.0)),
    }
}

/// Radiance towards the camera of [`spot`] from a triangle of radiance 2, by quadrature over its area; delta lobes
/// excluded.
fn reflected(case: &Case, corners: [[f32; 3]; 3]) -> f64 {
    // the oracle's normal is +z
    let local = |v: V| unit([v[0], v[2], v[1]]);
    let [a, b, c] = corners.map(wide);
    let normal = cross(sub(b, a), sub(c, a));
    let n = 600;
    let (mut sum, wo) = (0.0, local([0.0, 0.3, 0.4]));
    for i in 0..n * n {
        let [s, t] = [i / n, i % n].map(|k| (f64::from(k) + 0.5) / f64::from(n));
        let p: V = std::array::from_fn(|k| a[k] * (1.0 - s) + s * (b[k] * (1.0 - t) + c[k] * t));
        // |normal| s ds dt is the area, its other factor the cosine
        let geometry = dot(normal, unit(p)).abs() * s / dot(p, p);
        sum += case.eval(wo, local(p)).f[0] * geometry;
    }
    2.0 * sum / f64::from(n * n)
}

/// Highlights of an area light from sharp to broad: for sharp ones only scattered rays find the light, for broad ones
/// only light samples do. Killed by: a weight of one technique with the other's density, a density per area, a lobe
/// that `eval` knows and `sample` does not.
#[test]
fn highlights_match_quadrature() {
    let mirrored = [[-0.5, 0.7, -1.3], [0.5, 0.7, -1.3], [0.0, 1.4, -1.0]];
    use MaterialKind::*;
    for (kind, alpha) in [
        (RoughConductor, 0.02),
        (RoughConductor, 0.1),
        (RoughConductor, 0.5),
        (RoughPlastic, 0.05),
        (RoughPlastic, 0.4),
    ] {
        for (name, corners) in [("mirrored", mirrored), ("slanted", SLANTED)] {
            let (model, case) = receiver(kind, alpha);
            let (mut s, _) = emitter_scene(|s, emitter| add_triangle(s, emitter, corners, true));
            s.materials[0].model = model;
            let expected = reflected(&case, corners);
            // a sharp highlight beside the mirror direction is next to nothing
            if expected > 1e-3 {
                let image = render_depth(&s, 2, 8192);
                assert_mean(&format!("{name} on {}", case.name()), &image, expected, 0.012);
            }
        }
    }
    // a delta lobe beside a diffuse one: the mirrored light is seen in it, whole
    let (model, case) = receiver(Plastic, 0.0);
    for (name, corners, seen) in [("mirrored", mirrored, 1.0), ("slanted", SLANTED, 0.0)] {
        let (mut s, _) = emitter_scene(|s, emitter| add_triangle(s, emitter, corners, true));
        s.materials[0].model = model;
        let wo = unit([0.0, 0.4, 0.3]);
        let expected = reflected(&case, corners) + seen * 2.0 * case.lobes(wo)[0].weight[0];
        assert_mean(&format!("{name} on plastic"), &render_depth(&s, 2, 8192), expected, 0.01);
    }
}

/// I cos / r^2 and E cos, without any noise. Killed by: distance instead of its square, a selection probability that is
/// left out, light from below.
#[test]
fn points_and_directions_follow_inverse_squares() {
    let mut rng = SplitMix(5);
    for _ in 0..20 {
        let (power, r) = (rng.range(0.5, 20.0) as f32, rng.range(0.6, 8.0));
        let position = rng.direction().map(|x| (x * r) as f32);
        let towards = unit(wide(position));
        let cos = towards[1].max(0.0);
        let point = Emitter::Point { position, intensity: [power; 3] };
        let direction = towards.map(|x| (-3.0 * x) as f32);
        let far = Emitter::Directional { direction, irradiance: [power; 3] };
        for (emitter, irradiance) in [(point, cos / dot(wide(position), wide(position))), (far, cos)] {
            let mut s = spot(0.8, [4, 4]);
            s.emitters.push(emitter);
            let expected = 0.8 / PI * f64::from(power) * irradiance;
            let image = render_depth(&s, 2, 16);
            // the spot is 1e-4 wide
            let off = (image.mean() - expected).abs();
            assert!(off <= 1e-4 * expected, "{emitter:?}: {}, expected {expected}", image.mean());
            // anything in between hides it, from either side
            for front in [1.0, -1.0] {
                let wall = s.add_material("wall", grey(0.5));
                let centre = towards.map(|x| (0.5 * x) as f32);
                let shade = facing_y(0.05, 0.0, front).map(|p| std::array::from_fn(|i| p[i] + centre[i]));
                s.materials.last_mut().unwrap().two_sided = false;
                add_quad(&mut s, "shade", wall, shade);
                // a shade seen edge-on hides nothing, one in the camera's way everything
                if cos > 0.3 && dot(towards, [0.0, 0.6, 0.8]) < 0.95 {
                    assert_eq!(render_depth(&s, 2, 4).mean(), 0.0, "{emitter:?} behind a shade");
                }
            }
        }
    }
}

/// A rough surface under a point light shows f cos times I / r^2, exactly. Killed by: a delta light that is weighted
/// against the scattered ray, which can never find it.
#[test]
fn highlights_of_points_are_exact() {
    for (kind, alpha) in [(MaterialKind::RoughConductor, 0.1), (MaterialKind::RoughPlastic, 0.3)] {
        for position in [[0.0f32, 0.9, -1.2], [0.4, 1.0, -0.9], [-1.0, 0.5, 0.3]] {
            let (model, case) = receiver(kind, alpha);
            let mut s = spot(0.8, [4, 4]);
            s.materials[0].model = model;
            s.emitters.push(Emitter::Point { position, intensity: [3.0; 3] });
            let [x, y, z] = wide(position);
            let f = case.eval(unit([0.0, 0.4, 0.3]), unit([x, z, y])).f[0];
            let expected = 3.0 * f / dot(wide(position), wide(position));
            let mean = render_depth(&s, 2, 16).mean();
            assert!((mean - expected).abs() <= 1e-3 * expected, "{}: {mean}, expected {expected}", case.name());
        }
    }
}

/// Irradiance of the floor by quadrature over the upper hemisphere.
fn environment_irradiance(radiance: impl Fn(V) -> V) -> V {
    let n = 1000;
    let mut sum = [0.0; 3];
    for i in 0..n * n {
        let (y2, phi) = ((f64::from(i / n) + 0.5) / f64::from(n), (f64::from(i % n) + 0.5) / f64::from(n) * 2.0 * PI);
        let r = (1.0 - y2).sqrt();
        let l = radiance([r * phi.cos(), y2.sqrt(), r * phi.sin()]);
        sum = std::array::from_fn(|c| sum[c] + l[c]);
    }
    sum.map(|x| x * PI / f64::from(n * n))
}

/// An uneven, rotated map with one texel far brighter than the rest. Killed by: a rotation used the wrong way round,
/// rows without their solid angle, the scale left out of radiance or of density.
#[test]
fn environment_maps_light_by_their_integral() {
    let (width, height) = (9usize, 6usize);
    let mut rng = SplitMix(8);
    for tilt in [0.0f64, 0.7] {
        let mut texels: Vec<[f32; 3]> = (0..width * height).map(|_| [(); 3].map(|()| rng.f32())).collect();
        texels[width + 3] = [40.0, 35.0, 30.0];
        let (sin, cos) = tilt.sin_cos();
        let to_world = [[1.0, 0.0, 0.0], [0.0, cos, -sin], [0.0, sin, cos]];
        let mut s = spot(0.8, [4, 4]);
        s.environment = Some(Environment::Map {
            width: width as u32,
            height: height as u32,
            texels: texels.clone(),
            scale: [0.5, 1.0, 2.0],
            to_world: to_world.map(|r| r.map(|x| x as f32)),
        });
        let map = Map::new(&texels, width, height);
        let to_map = |d: V| -> V { std::array::from_fn(|i| (0..3).map(|j| to_world[j][i] * d[j]).sum()) };
        let irradiance = environment_irradiance(|d| map.lookup(to_map(d)));
        let image = render_depth(&s, 2, 8192);
        for (c, scale) in [0.5, 1.0, 2.0].into_iter().enumerate() {
            let (mean, error) = (image.channel(c), image.error_of_channel(c));
            let expected = 0.8 / PI * scale * irradiance[c];
            assert!(error < 0.003 * expected, "{error} of {expected}");
            let off = (mean - expected).abs();
            // 1e-3: kinks of the map under the quadrature
            assert!(off < LIMIT * error + 1e-3 * expected, "channel {c}: {mean} +- {error}, expected {expected}");
        }
    }
}

/// A floor under a spot: I f^2 cos / r^2, from the cone's middle to its edge. Killed by: an axis that is turned round, a
/// falloff in the angle instead of its cosine or not squared, full angles for half ones, light outside the cone.
#[test]
fn spots_follow_their_falloff() {
    let height = 2.0;
    for tilt in [0.0f64, 5.0, 20.0, 29.0, 31.0] {
        for (inner_deg, outer_deg) in [(0.0f32, 30.0f32), (10.0, 30.0), (30.0, 30.0), (0.0, 0.25)] {
            let mut s = spot(0.8, [4, 4]);
            let (sin, cos) = tilt.to_radians().sin_cos();
            let direction = [3.0 * sin as f32, -3.0 * cos as f32, 0.0];
            let position = [0.0, height, 0.0];
            s.emitters.push(Emitter::Spot { position, direction, intensity: [3.0; 3], inner_deg, outer_deg });
            let [inner, outer] = [inner_deg, outer_deg].map(|t| f64::from(t).to_radians().cos());
            let f = if cos > inner { 1.0 } else { ((cos - outer) / (inner - outer)).max(0.0) };
            let expected = 0.8 / PI * 3.0 * f * f / f64::from(height).powi(2);
            let mean = render_depth(&s, 2, 64).mean();
            // 1e-3: the pixels see a spot of 7e-5 around the origin, whose light comes from other angles
            let off = (mean - expected).abs();
            assert!(off <= 1e-3 * expected + 1e-6, "{tilt}, {inner_deg} to {outer_deg}: {mean}, expected {expected}");
        }
    }
}

/// A floor under a sun: E times the cosine of its middle, whatever its size, where all of it is above the horizon; half
/// of that where a wall hides half of the disk. Killed by: a sun that is a direction, a disk that is not uniform over
/// its sides, an irradiance that depends on the angle.
#[test]
fn suns_light_like_their_disk() {
    for angle_deg in [0.53f32, 20.0] {
        for covered in [false, true] {
            let mut s = spot(0.8, [4, 4]);
            s.emitters.push(Emitter::Sun { direction: [0.0, -4.0, -3.0], irradiance: [2.0; 3], angle_deg });
            if covered {
                // its edge runs through the disk's middle
                let wall = s.add_material("wall", grey(0.0));
                let corners = [[0.0, 1.0, 0.0], [0.0, 1.0, 90.0], [90.0, 1.0, 90.0], [90.0, 1.0, 0.0]];
                add_quad(&mut s, "wall", wall, corners);
            }
            let share = if covered { 0.5 } else { 1.0 };
            let expected = 0.8 / PI * 2.0 * 0.8 * share;
            assert_mean("sun", &render_depth(&s, 2, 16_384), expected, 0.004);
        }
    }
}

/// All kinds together: the sum, with the environment behind the emitter hidden by it. Killed by: one light chosen for
/// another's probability.
#[test]
fn lights_add_up() {
    let (mut s, emitter) = emitter_scene(|s, emitter| add_triangle(s, emitter, SLANTED, true));
    let hidden = 0.25 * polygon_irradiance(&SLANTED.map(wide));
    s.environment = Some(Environment::Constant { radiance: [0.25; 3] });
    s.emitters.push(Emitter::Point { position: [0.0, 2.0, -1.0], intensity: [3.0; 3] });
    s.emitters.push(Emitter::Directional { direction: [0.6, -0.8, 0.0], irradiance: [0.7; 3] });
    let point = 3.0 * 2.0 / 5f64.powf(1.5);
    let expected = emitter + 0.8 / PI * (0.25 * PI - hidden + point + 0.7 * 0.8);
    assert_mean("all lights", &render_depth(&s, 2, 16_384), expected, 0.004);
}
/// An emitter whose plane goes through the origin of coordinates, or nearly: its position has no rounding error there,
/// the distance to it has. Killed by: a shadow ray that ends at the emitter's own error bound (up to 70 % of the light
/// lost).
#[test]
fn emitters_do_not_shadow_themselves() {
    for height in [2.0f32, 3.0, 20.0, 100.0] {
        for half in [0.01f32, 0.3, 30.0] {
            for tilt in [0.0, 0.1] {
                let corners = [[-half, height, -half], [half, height + tilt * half, -half], [0.0, height, half]];
                let (scene, expected) = emitter_scene(|s, emitter| add_triangle(s, emitter, corners, true));
                for shift in [0.0, -height, -0.999 * height] {
                    let mut s = scene.clone();
                    s.vertices.iter_mut().for_each(|v| v.position[1] += shift);
                    s.camera.origin[1] += f64::from(shift);
                    s.camera.target[1] += f64::from(shift);
                    let image = render_depth(&s, 2, 2048);
                    let what = format!("emitter of {half} at {height}, tilted by {tilt}, moved by {shift}");
                    // moving rounds the corners
                    let rounding = 1e-6 * f64::from(height / half);
                    let off = (image.mean() - expected).abs();
                    assert!(image.error_of_mean() < 0.004 * expected, "{what}: {}", image.error_of_mean() / expected);
                    let fine = off <= LIMIT * image.error_of_mean() + (1e-4 + rounding) * expected;
                    assert!(fine, "{what}: {} of what it should be", image.mean() / expected);
                }
            }
        }
    }
}

/// Needles of every direction, thin rectangles' halves up to 1e6 : 1 and obtuse ones up to 1e3 : 1 (beyond, normals in
/// f32 tilt by a percent and more). Killed by: an emitter's triangle that a shadow ray hits before its end, because t
/// is a mean of far away vertices with inexact weights; a normal from two nearly parallel edges.
#[test]
fn needles_shine_like_other_triangles() {
    let mut rng = SplitMix(21);
    for aspect in [1e2, 1e3, 1e4, 1e5, 1e6] {
        for k in 0..12 {
            let (long, across) = (rng.direction(), rng.direction());
            let half = if k % 2 == 0 || aspect < 1e3 { 3.0 } else { 20.0 };
            let across = unit(cross(long, across)).map(|x| 2.0 * x * half / aspect);
            let near = rng.direction();
            let middle = [1.5 * near[0], 2.0, 1.5 * near[2]];
            let corner = |s: f64, t: f64| -> [f32; 3] {
                std::array::from_fn(|i| (middle[i] + s * half * long[i] + t * across[i]) as f32)
            };
            let obtuse = k < 6;
            if obtuse && aspect > 1e3 {
                continue;
            }
            let mut corners = [corner(-1.0, 0.0), corner(1.0, 0.0), corner(if obtuse { 0.3 } else { 1.0 }, 1.0)];
            corners.rotate_left(k % 3);
            let (s, expected) = emitter_scene(|s, emitter| add_triangle(s, emitter, corners, true));
            let image = render_depth(&s, 2, 8192);
            assert_mean(&format!("needle of {aspect} : 1, {corners:?}"), &image, expected, 0.02);
        }
    }
}

/// A point light within 1e-10 of what it lights is taken for one at that distance, and every such sample is counted.
/// Killed by: a silent clamp, a count of other lights.
#[test]
fn lights_that_are_too_near_are_counted() {
    for (exponent, clamped) in [(0, false), (-32, false), (-40, true)] {
        let scale = 2f32.powi(exponent);
        let mut s = spot(0.5, [8, 8]);
        place(&mut s, scale, 0.0);
        s.emitters.push(Emitter::Point { position: [0.0, 2.0 * scale, 0.0], intensity: [scale * scale; 3] });
        s.emitters.push(Emitter::Directional { direction: [0.0, -1.0, 0.0], irradiance: [1.0; 3] });
        let image = render_depth(&s, 2, 64);
        let counted = image.counters.distances_clamped;
        assert_eq!(counted > 0, clamped, "{scale}: {counted}");
        assert!(counted < image.counters.vertex_samples, "{scale}: the sun's samples are not");
        assert!(
            image.pixels.iter().all(|p| p.mean()[0].is_finite()) && image.mean() > 0.1,
            "{scale}: {}",
            image.mean()
        );
    }
}
