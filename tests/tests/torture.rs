//! Hard scenes, rendered small with every strategy of roulette: never a NaN, every bound that was met is known, and the
//! mean is that of a closed form.
//!
//! Most of the closed forms are furnaces, whose radiance no geometry changes: in a closed box that emits L and reflects
//! the share r everywhere it is the sum of L r^k, and what neither takes nor gives light cannot be seen in an even
//! environment. So triangles may be as bad as they like. Each mean is within 5 standard errors of the expectation (one
//! false alarm in 1.7e6), and the standard error must be below the stated part of it. Seeds are fixed. Strategies are
//! told apart by whether they promise an unbiased mean: `threshold` does not, and is asked for finite pixels only.

use croupier::unstable::learn::Learning;
use croupier::{Counters, Settings, Strategy};
use croupier_host::description::*;
use croupier_tests::light_oracle::Map;
use croupier_tests::runner::{Image, Schedule, scheduled, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::SplitMix;

const SIZE: [u32; 2] = [8, 8];
/// Samples of the iterations: learned factors are in use from the second on.
const ITERATIONS: [u32; 4] = [4, 4, 8, 16];
/// Standard errors that a mean may be off by.
const SIGMAS: f64 = 5.0;

/// What is known of the mean of a picture.
struct Expected {
    mean: f64,
    /// Largest standard error with which the test says anything, relative to the mean (absolute for black).
    power: f64,
    /// What rounding may add, relative.
    rounding: f64,
}

fn exactly(mean: f64) -> Expected {
    Expected { mean, power: 0.02, rounding: 2e-5 }
}

/// Strategies in the words of the program, all of the table.
fn strategies() -> Vec<String> {
    Strategy::TABLE.iter().map(|(name, _)| if *name == "fixed" { "fixed:1.5".into() } else { (*name).into() }).collect()
}

/// Renders with every strategy; `repeat` multiplies the samples.
#[track_caller]
fn torture(what: &str, scene: &SceneDescription, repeat: u32, expected: &Expected) {
    let blob = blob(scene);
    for (seed, name) in strategies().into_iter().enumerate() {
        let learning = Learning { cache_bytes: 1 << 20, subdivide_count: 300.0, ..Learning::default() };
        let s = Settings { seed: 100 + seed as u64, learning, ..settings(&blob, &name) };
        let iterations = ITERATIONS.map(|n| n * repeat);
        let image = scheduled(&blob, &s, &iterations, Schedule::InOrder(1 << 20));
        let what = format!("{what}, {name}");
        sound(&what, &image);
        explained(&what, &image.counters, iterations.iter().sum::<u32>());
        let strategy = s.strategy;
        if strategy.is_biased() {
            continue;
        }
        let (mean, error) = (image.mean(), image.error_of_mean());
        let scale = if expected.mean > 0.0 { expected.mean } else { 1.0 };
        println!("{what}: {mean} +- {error:.1e}, expected {}", expected.mean);
        assert!(error <= expected.power * scale, "{what}: {mean} +- {error} tells nothing");
        let off = (mean - expected.mean).abs();
        assert!(
            off <= SIGMAS * error + expected.rounding * scale,
            "{what}: {mean} +- {error}, expected {}",
            expected.mean
        );
    }
}

/// Every number that a picture has is one.
#[track_caller]
fn sound(what: &str, image: &Image) {
    for p in &image.pixels {
        let numbers = p.mean().into_iter().chain(p.variance_of_mean());
        assert!(numbers.clone().all(|x| x.is_finite() && x >= 0.0), "{what}: {:?}", numbers.collect::<Vec<_>>());
    }
    let e = image.error.rel_mse;
    assert!(e.is_finite() && e >= 0.0, "{what}: relMSE {e}");
}

/// Counts of what must not happen are 0, and the others add up.
#[track_caller]
fn explained(what: &str, c: &Counters, samples: u32) {
    let never = [c.non_finite, c.factors_not_finite, c.passages_cut, c.distances_clamped, c.media_roulettes];
    assert_eq!(never, [0; 5], "{what}: {c:?}");
    assert_eq!((c.first_non_finite, c.max_length_reached), (0, 0), "{what}: {c:?}");
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    assert_eq!((c.camera_samples, c.camera_rays), (pixels * u64::from(samples), pixels * u64::from(samples)), "{what}");
    // a sample of a vertex is a ray at most, and asks for one shadow ray at most
    assert!(c.scatter_rays <= c.vertex_samples, "{what}: {c:?}");
    assert!(c.shadow_rays_terminated + c.light_samples_skipped <= c.vertex_samples, "{what}: {c:?}");
    assert!(c.samples_refused <= c.samples_logged, "{what}: {c:?}");
    // nothing here is so large that learning had to leave out samples
    assert_eq!((c.samples_refused, c.ledger_full), (0, 0), "{what}: {c:?}");
}

/// Light of `depth` segments in a closed box.
fn in_box(rho: f64, radiance: f64, depth: i32) -> Expected {
    exactly(radiance * (1.0 - rho.powi(depth)) / (1.0 - rho))
}

fn glowing(rho: f32, radiance: f32, depth: u32) -> SceneDescription {
    SceneDescription { max_depth: depth, ..glowing_box(rho, radiance, SIZE) }
}

/// White from both sides, which vanishes in a white environment.
fn white(scene: &mut SceneDescription) -> u32 {
    let white = scene.add_material("white", grey(1.0));
    scene.materials[white as usize].two_sided = true;
    white
}

/// 400 triangles of aspect 1e3 to 1e7, of edges from 1e-6 to 1, some of no area at all, in a white environment.
/// Killed by: NaN from a normal of length 0, self-hits that trap light, a hit with no finite position.
#[test]
fn needles_and_slivers() {
    let mut s = in_white_environment(camera([0.0, 0.0, 4.0], [0.0; 3], 30.0, SIZE));
    s.max_depth = 100;
    let material = white(&mut s);
    let mut rng = SplitMix(1);
    for n in 0..400 {
        let centre: [f64; 3] = std::array::from_fn(|_| rng.range(-1.0, 1.0));
        let (long, across) = (rng.direction(), rng.direction());
        let length = 10f64.powf(rng.range(-6.0, 0.0));
        let aspect = if n % 20 == 0 { f64::INFINITY } else { 10f64.powf(rng.range(3.0, 7.0)) };
        let at = |l: f64, a: f64| std::array::from_fn(|i| (centre[i] + length * (l * long[i] + a * across[i])) as f32);
        let corners = [at(0.0, 0.0), at(1.0, 0.0), at(0.5, 1.0 / aspect)];
        let vertices = corners.map(|position| Vertex { position, ..Vertex::default() });
        s.add_mesh("needle", material, &vertices, &[[0, 1, 2]], false);
    }
    torture("needles", &s, 1, &exactly(1.0));
}

/// A fan of slivers that closes a box, so that every ray near its middle is near an edge. Killed by: a leak between
/// slivers, an offset that leaves the box.
#[test]
fn slivers_that_close_a_box() {
    let mut s = glowing(0.5, 1.0, 12);
    s.vertices.clear();
    s.triangles.clear();
    s.objects.clear();
    add_box(&mut s, 0, [-1.0; 3], [1.0; 3], true);
    // its last side, z = 1, once more as 3000 triangles around the middle, a little in front of it
    let rim = |i: u32| {
        let t = f64::from(i % 3000) / 3000.0 * std::f64::consts::TAU;
        let scale = 1.0 / t.cos().abs().max(t.sin().abs());
        [(t.cos() * scale) as f32, (t.sin() * scale) as f32, 0.875]
    };
    let mut corners = vec![[0.0, 0.0, 0.875]];
    corners.extend((0..3000).map(rim));
    let vertices: Vec<_> = corners.into_iter().map(|position| Vertex { position, ..Vertex::default() }).collect();
    // seen from -z counter-clockwise
    let fan: Vec<[u32; 3]> = (0..3000).map(|i| [0, 1 + (i + 1) % 3000, 1 + i]).collect();
    s.add_mesh("fan", 0, &vertices, &fan, false);
    s.camera = camera([0.1, -0.2, -0.7], [0.0, 0.0, 0.875], 20.0, SIZE);
    torture("slivers that close a box", &s, 1, &in_box(0.5, 1.0, 12));
}

/// Five sheets in one plane: light that leaves one must not meet another. Half of the light comes back, once. Killed
/// by: an offset that is too small for coplanar neighbours.
#[test]
fn coplanar_layers() {
    let mut s = in_white_environment(camera([0.0, 1.5, 1.0], [0.0; 3], 20.0, SIZE));
    s.max_depth = 100;
    let half = s.add_material("half", grey(0.5));
    s.materials[half as usize].two_sided = true;
    for n in 0..5 {
        // other triangles in each
        add_quad(&mut s, "layer", half, facing_y(4.0 + 0.37 * n as f32, 0.0, if n % 2 == 0 { 1.0 } else { -1.0 }));
    }
    torture("coplanar layers", &s, 2, &exactly(0.5));
}

/// A box 2^-14 thin: light must neither get out nor miss the near side. Killed by: an offset of a fixed length, one
/// that jumps the gap.
#[test]
fn thin_gaps() {
    let mut s = glowing(0.5, 1.0, 12);
    let gap = 2f32.powi(-14);
    for v in &mut s.vertices {
        v.position[1] *= gap;
    }
    s.camera = camera([0.1, 0.0, 0.3], [0.4, 0.0, -1.0], 0.005, SIZE);
    torture("a thin box", &s, 1, &in_box(0.5, 1.0, 12));
}

/// A box of half-width 64 at 2^20 = 1e6 in all axes. Killed by: offsets that do not grow with the position (self-hits),
/// or grow beyond the box.
#[test]
fn far_from_the_origin() {
    let mut s = glowing(0.5, 1.0, 12);
    place(&mut s, 64.0, 1_048_576.0);
    torture("at 1e6", &s, 1, &in_box(0.5, 1.0, 12));
}

/// Boxes of half-widths 1e-4 and 1e4. Killed by: an offset of a fixed length, an epsilon in world units.
#[test]
fn tiny_and_huge_boxes() {
    for power in [-13, 13] {
        let mut s = glowing(0.5, 1.0, 12);
        place(&mut s, 2f32.powi(power), 0.0);
        torture(&format!("a box of half-width 2^{power}"), &s, 1, &in_box(0.5, 1.0, 12));
    }
}

/// A ball of diamond in one of water in one of glass. Killed by: the index of the wrong side, light lost between sides.
#[test]
fn nested_dielectrics() {
    let mut s = in_white_environment(camera([1.0, 1.4, 5.0], [0.0; 3], 20.0, SIZE));
    s.max_depth = 200;
    let outer = s.add_material("outer", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    let middle = s.add_material("middle", Model::Dielectric { int_ior: 1.33, ext_ior: 1.5 });
    let inner = s.add_material("inner", Model::Dielectric { int_ior: 2.4, ext_ior: 1.33 });
    let shape = Sphere { subdivisions: 2, smooth: false, inwards: false };
    add_sphere(&mut s, outer, [0.0; 3], 1.0, shape);
    add_sphere(&mut s, middle, [0.1, 0.0, 0.0], 0.7, shape);
    add_sphere(&mut s, inner, [0.0, 0.1, 0.0], 0.4, shape);
    torture("nested dielectrics", &s, 3, &Expected { power: 0.03, rounding: 1e-4, ..exactly(1.0) });
}

/// A black sky with one bright texel, by quadrature. Killed by: tables that lose a narrow row, a density without sin
/// theta.
#[test]
fn an_environment_of_one_hot_texel() {
    let (width, height) = (64, 33);
    for row in [1usize, 9] {
        let mut texels = vec![[0.0f32; 3]; width * height];
        texels[row * width + 17] = [1e6; 3];
        let map = Map::new(&texels, width, height);
        // light on the floor, over the cells around the texel
        let mut sum = 0.0;
        const N: usize = 200;
        for j in row - 1..=row {
            let [above, below] = map.cosines(j);
            for i in [16, 17] {
                for n in 0..N * N {
                    let [x, t] = [n % N, n / N].map(|n| (n as f64 + 0.5) / N as f64);
                    let d = map.direction(i, j, x, t);
                    sum += map.lookup(d)[0] * d[1].max(0.0) * (above - below) / (N * N) as f64;
                }
            }
        }
        let expected = 0.5 * sum * std::f64::consts::TAU / width as f64 / std::f64::consts::PI;
        let mut s = spot(0.5, SIZE);
        let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let (width, height) = (width as u32, height as u32);
        s.environment = Some(Environment::Map { width, height, texels, scale: [1.0; 3], to_world });
        torture(&format!("a hot texel in row {row}"), &s, 2, &Expected { rounding: 1e-3, ..exactly(expected) });
    }
}

/// Nothing but an even environment: every sample is the same, and learning has a variance of 0 to divide by. Killed by:
/// 0 / 0 in factors or relMSE.
#[test]
fn a_picture_without_variance() {
    let s = in_white_environment(camera([0.0; 3], [0.0, 0.0, -1.0], 40.0, SIZE));
    torture("nothing but sky", &s, 1, &Expected { rounding: 0.0, ..exactly(1.0) });
    // and with vertices, whose samples all are the same
    torture("an even box", &glowing(0.0, 1.0, 12), 1, &Expected { rounding: 1e-6, ..exactly(1.0) });
}

/// No light at all, and a light that nothing can see. Killed by: 0 / 0 in a mean of 0, a light table of weights 0.
#[test]
fn a_black_picture() {
    let black = Expected { mean: 0.0, power: 0.0, rounding: 0.0 };
    torture("no light", &spot(0.8, SIZE), 1, &black);
    let mut s = spot(0.8, SIZE);
    s.environment = Some(Environment::Constant { radiance: [0.0; 3] });
    torture("a black sky", &s, 1, &black);
    let mut s = spot(0.8, SIZE);
    // below the floor
    s.emitters.push(Emitter::Point { position: [0.0, -1.0, 0.0], intensity: [5.0; 3] });
    torture("a light below the floor", &s, 1, &black);
}
