//! What absorbing, emitting and scattering media let through, in the whole renderer, against closed forms: slabs, holes,
//! overlaps, cameras inside, glass with an interior; and media so dense that nothing but the bounds of the work is known.

use croupier::Settings;
use croupier_host::description::*;
use croupier_tests::bsdf::fresnel_dielectric;
use croupier_tests::light_oracle::{V, cross, dot, length, sub, unit, wide};
use croupier_tests::media_scene::*;
use croupier_tests::runner::{Image, render, settings};
use croupier_tests::scenes::*;

/// |z| that a comparison may reach: with the 200 of this file a false alarm in 2e4 runs.
const LIMIT: f64 = 5.2;

/// Rounding of positions and exponentials where nothing is random, relative.
const EXACT: f64 = 5e-5;

const SKY: [f32; 3] = [1.0, 0.5, 0.25];

fn render_depth(s: &SceneDescription, max_depth: u32, spp: u32) -> Image {
    let scene = blob(s);
    render(&scene, &Settings { max_depth, ..settings(&scene, "none") }, spp)
}

fn each(f: impl Fn(usize) -> f64) -> [f64; 3] {
    std::array::from_fn(f)
}

/// A slab of thickness `d` around z = 0, seen along a line at `degrees` from its normal; and the length of the way.
fn slab(medium: Medium, d: f32, degrees: f64, radiance: [f32; 3]) -> (SceneDescription, f64) {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let mut s = one_line([8.0 * sin, 0.0, 8.0 * cos], [0.0; 3], radiance);
    add_medium_box(&mut s, medium, [-40.0, -40.0, -d / 2.0], [40.0, 40.0, d / 2.0]);
    (s, f64::from(d) / cos)
}

/// The density of a grid that is 1 everywhere in the slab of thickness `d`.
fn constant_grid(medium: Medium, d: f32) -> Medium {
    let half = [40.0, 40.0, d / 2.0];
    in_grid(medium, [3, 5, 4], [half.map(|x| -x), half], vec![1.0; 60])
}

/// exp(-sigma_a d / cos) of the sky, and L (1 - exp(-sigma_a d / cos)) of the medium's own light; without noise where
/// the density is constant. Killed by: a length that is not that of the way, a channel for another, an emission without
/// its absorption, a boundary that counts as a segment.
#[test]
fn absorbing_slabs_follow_beer_and_lambert() {
    let (sigma, emission) = ([0.1, 1.0, 7.0], [2.0, 1.0, 0.5]);
    for degrees in [0.0, 35.0, 70.0] {
        for d in [0.5, 1.0] {
            for (radiance, emission) in [(SKY, [0.0; 3]), ([0.0; 3], emission), (SKY, emission)] {
                let medium = Medium { emission, ..homogeneous(sigma, [0.0; 3], 0.0) };
                let (s, way) = slab(medium.clone(), d, degrees, radiance);
                let pass = each(|c| (-f64::from(sigma[c]) * way).exp());
                let expected = each(|c| f64::from(radiance[c]) * pass[c] + f64::from(emission[c]) * (1.0 - pass[c]));
                let what = format!("{degrees} degrees, thickness {d}, {radiance:?}, {emission:?}");
                for max_depth in [1, 40] {
                    assert_exact(&what, &render_depth(&s, max_depth, 16), expected, EXACT * (1.0 + 7.0 * way));
                }
                let (s, _) = slab(constant_grid(medium, d), d, degrees, radiance);
                let image = render_depth(&s, 1, 4096);
                assert_channels(&format!("grid, {what}"), &image, expected, [LIMIT, 0.06, 1e-4, 0.05]);
            }
        }
    }
}

/// What passes a slab unscattered: exp(-sigma_t d); and its light, L sigma_a / sigma_t (1 - exp(-sigma_t d)). Killed by:
/// scattering that is counted as absorption in the emission, or the other way round, an albedo on the light that passes,
/// a channel's free flight with the weight of another's.
#[test]
fn scattering_slabs_pass_what_is_not_scattered() {
    let cases = [
        ([0.0; 3], [0.1, 1.0, 3.0], [0.0; 3]),
        ([0.2, 0.5, 0.1], [1.0, 0.5, 0.1], [0.0; 3]),
        ([0.5, 0.1, 1.0], [0.5, 2.0, 0.0], [3.0, 2.0, 1.0]),
        // 10 : 1 : 0.1, and the other way round
        ([0.0; 3], [5.0, 0.5, 0.05], [0.0; 3]),
        ([0.0, 0.5, 0.05], [0.05, 0.0, 5.0], [1.0; 3]),
        // a clear channel, one that is opaque
        ([0.0, 0.0, 5e5], [0.0, 1.0, 5e5], [0.0, 0.0, 2.0]),
        ([1e6, 0.0, 0.1], [0.0, 0.0, 0.1], [2.0, 1.0, 1.0]),
    ];
    for (sigma_a, sigma_s, emission) in cases {
        for (d, degrees) in [(1.0, 0.0f64), (0.5, 50.0)] {
            let medium = Medium { emission, ..homogeneous(sigma_a, sigma_s, 0.3) };
            let way = f64::from(d) / degrees.to_radians().cos();
            let expected = each(|c| {
                let (a, s) = (f64::from(sigma_a[c]), f64::from(sigma_s[c]));
                let pass = (-(a + s) * way).exp();
                let own = if a > 0.0 { f64::from(emission[c]) * a / (a + s) * (1.0 - pass) } else { 0.0 };
                f64::from(SKY[c]) * pass + own
            });
            for grid in [false, true] {
                let medium = if grid { constant_grid(medium.clone(), d) } else { medium.clone() };
                let image = render_depth(&slab(medium, d, degrees, SKY).0, 1, 8192);
                let what = format!("grid {grid}, {sigma_a:?}, {sigma_s:?}, {degrees} degrees");
                assert_channels(&what, &image, expected, [LIMIT, 0.02, 1e-4, 0.05]);
            }
        }
    }
}

/// Grey absorption of that much per unit length.
fn grey_absorption(sigma: f32) -> Medium {
    homogeneous([sigma; 3], [0.0; 3], 0.0)
}

/// exp(-sum of sigma times length) along a line, for media of one channel each.
fn transmitted(parts: &[(f32, f64)]) -> [f64; 3] {
    [(-parts.iter().map(|(sigma, way)| f64::from(*sigma) * way).sum::<f64>()).exp(); 3]
}

/// Where media overlap, the first of the scene is there alone; seen from outside, from within one, from within both, from
/// either end; media that touch by an overlap leave no gap. Killed by: the last medium in place of the first, a sum of
/// both, a boundary within the first medium that ends it, a camera whose media are not looked up.
#[test]
fn the_first_of_overlapping_media_is_there_alone() {
    let (a, b) = (0.3, 1.1);
    // the first in -2..1 along x, the second in -1..3; a face that both had would be one surface too few
    let boxes = [(a, [-2.0, -0.5, -0.5], [1.0, 0.5, 0.5]), (b, [-1.0, -0.6, -0.625], [3.0, 0.75, 0.55])];
    let along = |reverse: bool, from: f64, to: f64| {
        let mut s = one_line([from, 0.01, 0.02], [to, 0.01, 0.02], [1.0; 3]);
        let order = if reverse { [1, 0] } else { [0, 1] };
        for (sigma, lo, hi) in order.map(|i| boxes[i]) {
            add_medium_box(&mut s, grey_absorption(sigma), lo, hi);
        }
        render_depth(&s, 1, 4)
    };
    let cases = [
        (false, -9.0, 9.0, [(a, 3.0), (b, 2.0)]),
        (false, 9.0, -9.0, [(a, 3.0), (b, 2.0)]),
        (true, -9.0, 9.0, [(a, 1.0), (b, 4.0)]),
        (true, 9.0, -9.0, [(a, 1.0), (b, 4.0)]),
        // inside the first, inside both, inside the second
        (false, -1.5, 9.0, [(a, 2.5), (b, 2.0)]),
        (false, 0.25, 9.0, [(a, 0.75), (b, 2.0)]),
        (false, 0.25, -9.0, [(a, 2.25), (b, 0.0)]),
        (true, 0.25, 9.0, [(a, 0.0), (b, 2.75)]),
        (true, 0.25, -9.0, [(a, 1.0), (b, 1.25)]),
        (false, 2.0, -9.0, [(a, 3.0), (b, 1.0)]),
        (true, 2.0, -9.0, [(a, 1.0), (b, 3.0)]),
    ];
    for (reverse, from, to, parts) in cases {
        let what = format!("reversed {reverse}, from {from} to {to}");
        assert_exact(&what, &along(reverse, from, to), transmitted(&parts), EXACT);
    }
    // a slope through all of it crosses the boundaries in another order at every height
    for (reverse, at) in [(false, 0), (true, 1)] {
        let [o, d] = [[-4.0, 1.0, 0.3], [1.0, -0.21, -0.05]];
        let target: [f64; 3] = std::array::from_fn(|i| o[i] + d[i]);
        let mut s = one_line(o, target, [1.0; 3]);
        let order = if reverse { [1, 0] } else { [0, 1] };
        for (sigma, lo, hi) in order.map(|i| boxes[i]) {
            add_medium_box(&mut s, grey_absorption(sigma), lo, hi);
        }
        let within = |i: usize| through_box(o, d, wide(boxes[i].1), wide(boxes[i].2)).unwrap();
        let (first, second) = (within(at), within(1 - at));
        let overlap = (first[1].min(second[1]) - first[0].max(second[0])).max(0.0);
        let parts = [
            (boxes[at].0, (first[1] - first[0]) * length(d)),
            (boxes[1 - at].0, (second[1] - second[0] - overlap) * length(d)),
        ];
        assert!(overlap > 0.1);
        assert_exact(&format!("slope, reversed {reverse}"), &render_depth(&s, 1, 4), transmitted(&parts), EXACT);
    }
}

/// A hole in fog: by a clear medium before it in the scene, or by a boundary of the fog itself that faces the hole.
/// Nothing is there that takes light away. Killed by: a clear medium that counts as none, so that the fog is met, an
/// inner boundary that begins the fog anew.
#[test]
fn holes_in_fog_are_clear() {
    let sigma = 0.8;
    for (from, way) in [(9.0, 4.0 - 1.2), (0.1, 2.0 - 0.6), (1.5, 3.5 - 1.2)] {
        for shell in [false, true] {
            let mut s = one_line([from, 0.03, 0.02], [-9.0, 0.03, 0.02], [1.0; 3]);
            if !shell {
                add_medium_box(&mut s, grey_absorption(0.0), [-0.6; 3], [0.6; 3]);
            }
            add_medium_box(&mut s, grey_absorption(sigma), [-2.0; 3], [2.0; 3]);
            if shell {
                let boundary = s.materials.len() as u32 - 1;
                add_box(&mut s, boundary, [-0.6; 3], [0.6; 3], true);
            }
            let what = format!("shell {shell}, from {from}");
            assert_exact(&what, &render_depth(&s, 1, 4), transmitted(&[(sigma, way)]), EXACT);
        }
    }
    // a sphere: the chord of a line that misses its centre by 0.3
    let mut s = one_line([9.0, 0.3, 0.0], [-9.0, 0.3, 0.0], [1.0; 3]);
    let clear = add_medium(&mut s, grey_absorption(0.0), Model::Null);
    add_sphere(&mut s, clear, [0.0; 3], 1.0, Sphere { subdivisions: 5, ..Sphere::default() });
    add_medium_box(&mut s, grey_absorption(sigma), [-2.0; 3], [2.0; 3]);
    let expected = transmitted(&[(sigma, 4.0 - 2.0 * (1.0f64 - 0.09).sqrt())]);
    assert_exact("sphere", &render_depth(&s, 1, 4), expected, 1e-3);
}

/// A solid of triangles with an absorbing interior in a constant environment of radiance 1.
struct Glass {
    triangles: Vec<[V; 3]>,
    eta: f64,
    sigma: [f64; 3],
}

impl Glass {
    /// Radiance from `o` along `d` by following both ways at every hit, until what is left is below 1e-7.
    fn radiance(&self, o: V, d: V, inside: bool, weight: f64) -> [f64; 3] {
        let mut hit: Option<(f64, V)> = None;
        for [a, b, c] in &self.triangles {
            let n = cross(sub(*b, *a), sub(*c, *a));
            let t = dot(sub(*a, o), n) / dot(d, n);
            let p: V = std::array::from_fn(|i| o[i] + t * d[i]);
            let within = [(a, b), (b, c), (c, a)].iter().all(|(u, v)| dot(cross(sub(**v, **u), sub(p, **u)), n) >= 0.0);
            if within && t > 1e-9 && hit.is_none_or(|h| t < h.0) {
                hit = Some((t, unit(n)));
            }
        }
        let Some((t, n)) = hit else {
            assert!(!inside, "a ray left the solid through an edge");
            return [1.0; 3];
        };
        let p: V = std::array::from_fn(|i| o[i] + t * d[i]);
        let n = if inside { n.map(|x| -x) } else { n };
        let cos = -dot(d, n);
        let (n1, n2) = if inside { (self.eta, 1.0) } else { (1.0, self.eta) };
        let r = fresnel_dielectric(cos, n1, n2);
        let mut sum = [0.0; 3];
        if weight * r > 1e-7 {
            let mirrored: V = std::array::from_fn(|i| d[i] + 2.0 * cos * n[i]);
            let found = self.radiance(p, unit(mirrored), inside, weight * r);
            sum = std::array::from_fn(|c| sum[c] + r * found[c]);
        }
        if weight * (1.0 - r) > 1e-7 {
            let eta = n1 / n2;
            let cos_t = (1.0 - eta * eta * (1.0 - cos * cos)).sqrt();
            let refracted: V = std::array::from_fn(|i| eta * d[i] + (eta * cos - cos_t) * n[i]);
            let found = self.radiance(p, unit(refracted), !inside, weight * (1.0 - r));
            let scale = (1.0 - r) * (n1 / n2).powi(2);
            sum = std::array::from_fn(|c| sum[c] + scale * found[c]);
        }
        let pass = if inside { self.sigma.map(|s| (-s * t).exp()) } else { [1.0; 3] };
        std::array::from_fn(|c| sum[c] * pass[c])
    }
}

/// A faceted ball of glass with coloured absorption, against rays traced in f64 through the same facets; with the index
/// 1 the way is straight and nothing is random. Killed by: an interior that is on the wrong side of a refraction or of
/// an inner reflection, a way measured from the wrong point, a medium that is not left by reflection at the outside.
#[test]
fn glass_absorbs_along_refracted_ways() {
    let sigma = [0.2, 0.7, 1.5];
    for (eta, lines) in [(1.0, 4), (1.5, 5), (0.8, 3)] {
        for line in 0..lines {
            let y = 0.17 + 0.2 * f64::from(line);
            let (o, target) = ([0.21, y, 6.0], [0.11, 0.8 * y, 0.0]);
            let mut s = one_line(o, target, [1.0; 3]);
            let model = Model::Dielectric { int_ior: eta, ext_ior: 1.0 };
            let boundary = add_medium(&mut s, homogeneous(sigma, [0.0; 3], 0.0), model);
            add_sphere(&mut s, boundary, [0.0; 3], 1.0, Sphere { subdivisions: 2, ..Sphere::default() });
            let corner = |t: &Triangle| t.vertices.map(|v| wide(s.vertices[v as usize].position));
            let glass =
                Glass { triangles: s.triangles.iter().map(corner).collect(), eta: f64::from(eta), sigma: wide(sigma) };
            let expected = glass.radiance(o, unit(sub(target, o)), false, 1.0);
            let what = format!("index {eta}, line {line}");
            if eta == 1.0 {
                assert_exact(&what, &render_depth(&s, 40, 8), expected, 4e-4);
            } else {
                let image = render_depth(&s, 60, 8192);
                assert_channels(&what, &image, expected, [LIMIT, 0.01, 2e-4, 0.05]);
            }
        }
    }
}

/// Optical thicknesses of 1e9, homogeneous and in grids with empty cells beside cells of huge density: everything ends,
/// the roulette of steps that lead nowhere is counted, and what is bright stays below the sky. Killed by: a loop that
/// ends only when it has moved, a weight that grows without a bound, steps that no budget sees.
#[test]
fn opaque_media_end() {
    let mut values = vec![0.0; 8 * 8 * 8];
    for (i, v) in values.iter_mut().enumerate() {
        if i % 5 == 0 {
            *v = 1e9;
        }
    }
    let unit_box = [[-1.0; 3], [1.0; 3]];
    let dense = [
        ("scattering", homogeneous([0.0; 3], [1e9; 3], 0.0), false),
        ("one channel", homogeneous([0.0, 0.0, 1e9], [0.5, 0.1, 0.0], 0.9), false),
        ("grid", in_grid(homogeneous([0.1; 3], [1.0; 3], 0.0), [8; 3], unit_box, values.clone()), false),
        // a majorant of 1e9, of which hardly a collision is real
        ("null", in_grid(homogeneous([0.0; 3], [1.0, 1e-6, 1e-9], 0.0), [8; 3], unit_box, spike()), true),
    ];
    for (name, medium, roulette) in dense {
        let mut s = in_white_environment(camera([0.0, 0.0, 4.0], [0.0; 3], 30.0, [4, 4]));
        add_medium_box(&mut s, medium, [-1.0; 3], [1.0; 3]);
        let scene = blob(&s);
        for strategy in ["none", "classic"] {
            let image = render(&scene, &Settings { max_depth: 30, ..settings(&scene, strategy) }, 32);
            let c = image.counters;
            println!("{name}, {strategy}: {} rays, {} steps, {}", c.rays(), c.medium_steps, image.mean());
            assert_eq!((c.non_finite, c.camera_samples), (0, 512), "{name}");
            assert!(image.pixels.iter().all(|p| p.mean().iter().all(|x| (0.0..4.0).contains(x))), "{name}");
            assert!(c.medium_steps > 0 && c.work() > c.rays() || c.medium_steps < 16, "{name}: {c:?}");
            assert_eq!(c.work(), c.rays() + c.medium_steps / 16);
            assert!(!roulette || c.media_roulettes > 0, "{name}: {c:?}");
        }
    }
}

/// Nothing, but for one cell.
fn spike() -> Vec<f32> {
    let mut values = vec![1e-9; 512];
    values[4 * 64 + 4 * 8 + 4] = 1e9;
    values
}
