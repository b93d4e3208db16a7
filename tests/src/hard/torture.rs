//! Hard scenes, to be rendered small with every strategy of roulette.
//!
//! Most of their means have closed forms because they are furnaces, whose radiance no geometry changes: in a closed box
//! that emits L and reflects the share r everywhere it is the sum of L r^k, and what neither takes nor gives light
//! cannot be seen in an even environment. So triangles may be as bad as they like. Strategies are told apart by whether
//! they promise an unbiased mean: `threshold` does not, and is asked for finite pixels only.

use super::Found;
use crate::light_oracle::Map;
use crate::runner::{Image, Schedule, scheduled, settings};
use crate::scenes::*;
use crate::stats::SplitMix;
use croupier::unstable::learn::Learning;
use croupier::{Counters, Settings, Strategy};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::*;

const SIZE: [u32; 2] = [8, 8];
/// Samples of the iterations: learned factors are in use from the second on.
const ITERATIONS: [u32; 4] = [4, 4, 8, 16];

/// What is known of the mean of a picture.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Mean over pixels and channels.
    pub mean: f64,
    /// Largest standard error of one render with which a test says anything, relative to the mean (absolute for black).
    pub power: f64,
    /// What rounding may add, relative.
    pub rounding: f64,
    /// Part of the light that may get lost by a fault that is open (`docs/NUMERICS.md`); 0 if none is known.
    pub open_loss: f64,
}

impl Expected {
    /// The unit of [`Self::power`] and [`Self::rounding`].
    pub fn scale(&self) -> f64 {
        if self.mean > 0.0 { self.mean } else { 1.0 }
    }
}

fn exactly(mean: f64) -> Expected {
    Expected { mean, power: 0.02, rounding: 2e-5, open_loss: 0.0 }
}

/// A scene with what is known of its picture.
pub struct Hard {
    /// Name.
    pub name: String,
    /// The mean.
    pub expected: Expected,
    blob: AlignedBytes,
    repeat: u32,
}

/// What a render of a hard scene has given.
#[derive(Clone, Debug)]
pub struct Rendered {
    /// Scene and strategy.
    pub what: String,
    /// Means and variances of the pixels, and the picture's error, none of which may be negative or not finite.
    pub numbers: Found,
    /// What of the counters has no explanation.
    pub unexplained: Option<String>,
    /// Mean of the picture and its standard error, for strategies that promise the right one.
    pub mean: Option<[f64; 2]>,
}

/// Strategies in the words of the program, all of the table.
pub fn strategies() -> Vec<String> {
    Strategy::TABLE.iter().map(|(name, _)| if *name == "fixed" { "fixed:1.5".into() } else { (*name).into() }).collect()
}

impl Hard {
    /// `repeat` multiplies the samples.
    fn new(name: impl Into<String>, scene: &SceneDescription, repeat: u32, expected: &Expected) -> Self {
        Self { name: name.into(), expected: *expected, blob: blob(scene), repeat }
    }

    /// Renders it.
    pub fn render(&self, strategy: &str, seed: u64) -> Rendered {
        let learning = Learning { cache_bytes: 1 << 20, subdivide_count: 300.0, ..Learning::default() };
        let s = Settings { seed, learning, ..settings(&self.blob, strategy) };
        let iterations = ITERATIONS.map(|n| n * self.repeat);
        let image = scheduled(&self.blob, &s, &iterations, Schedule::InOrder(1 << 20));
        let biased = s.strategy.is_biased();
        Rendered {
            what: format!("{}, {strategy}, seed {seed}", self.name),
            numbers: numbers(&image),
            unexplained: unexplained(&image.counters, iterations.iter().sum()),
            mean: (!biased).then(|| [image.mean(), image.error_of_mean()]),
        }
    }
}

/// Every number that a picture has.
fn numbers(image: &Image) -> Found {
    let mut found = Found::default();
    let of_pixels = image.pixels.iter().flat_map(|p| p.mean().into_iter().chain(p.variance_of_mean()));
    for x in of_pixels.chain([image.error.rel_mse]) {
        found.case(x.is_finite() && x >= 0.0, || format!("a pixel has {x}"));
    }
    found
}

/// Counts of what must not happen are 0, and the others add up; what does not.
fn unexplained(c: &Counters, samples: u32) -> Option<String> {
    let never = [c.non_finite, c.factors_not_finite, c.passages_cut, c.distances_clamped, c.media_roulettes];
    let all = u64::from(SIZE[0] * SIZE[1]) * u64::from(samples);
    let wrong = [
        ("what must not happen", never != [0; 5] || (c.first_non_finite, c.max_length_reached) != (0, 0)),
        ("camera samples", (c.camera_samples, c.camera_rays) != (all, all)),
        // a sample of a vertex is a ray at most, and asks for one shadow ray at most
        ("rays", c.scatter_rays > c.vertex_samples),
        ("shadow rays", c.shadow_rays_terminated + c.light_samples_skipped > c.vertex_samples),
        // nothing here is so large that learning had to leave out samples
        ("what is learned", (c.samples_refused, c.ledger_full) != (0, 0)),
    ];
    let found: Vec<&str> = wrong.iter().filter(|(_, wrong)| *wrong).map(|(what, _)| *what).collect();
    (!found.is_empty()).then(|| format!("{}: {c:?}", found.join(", ")))
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

/// All of them; the seed makes the needles.
pub fn all(seed: u64) -> Vec<Hard> {
    [
        needles_and_slivers(seed),
        slivers_that_close_a_box(),
        coplanar_layers(),
        thin_gaps(),
        far_from_the_origin(),
        tiny_and_huge_boxes(),
        nested_dielectrics(),
        an_environment_of_one_hot_texel(),
        a_picture_without_variance(),
        a_black_picture(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// 400 triangles of aspect 1e3 to 1e7, of edges from 1e-6 to 1, some of no area at all, in a white environment.
pub fn needles_and_slivers(seed: u64) -> Vec<Hard> {
    let mut s = in_white_environment(camera([0.0, 0.0, 4.0], [0.0; 3], 30.0, SIZE));
    s.max_depth = 100;
    let material = white(&mut s);
    let mut rng = SplitMix(seed);
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
    vec![Hard::new("needles", &s, 1, &exactly(1.0))]
}

/// A fan of slivers that closes a box, so that every ray near its middle is near an edge.
pub fn slivers_that_close_a_box() -> Vec<Hard> {
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
    vec![Hard::new("slivers that close a box", &s, 1, &in_box(0.5, 1.0, 12))]
}

/// Five sheets in one plane: light that leaves one must not meet another. Half of the light comes back, once.
pub fn coplanar_layers() -> Vec<Hard> {
    let mut s = in_white_environment(camera([0.0, 1.5, 1.0], [0.0; 3], 20.0, SIZE));
    s.max_depth = 100;
    let half = s.add_material("half", grey(0.5));
    s.materials[half as usize].two_sided = true;
    for n in 0..5 {
        // other triangles in each
        add_quad(&mut s, "layer", half, facing_y(4.0 + 0.37 * n as f32, 0.0, if n % 2 == 0 { 1.0 } else { -1.0 }));
    }
    vec![Hard::new("coplanar layers", &s, 2, &exactly(0.5))]
}

/// A box 2^-14 thin: light must neither get out nor miss the near side. Its narrow walls are needles, through which a
/// part of the light gets lost in the corners (TRI-5 among the open cases of `docs/NUMERICS.md`).
pub fn thin_gaps() -> Vec<Hard> {
    let mut s = glowing(0.5, 1.0, 12);
    let gap = 2f32.powi(-14);
    for v in &mut s.vertices {
        v.position[1] *= gap;
    }
    s.camera = camera([0.1, 0.0, 0.3], [0.4, 0.0, -1.0], 0.005, SIZE);
    vec![Hard::new("a thin box", &s, 1, &Expected { open_loss: 0.01, ..in_box(0.5, 1.0, 12) })]
}

/// A box of half-width 64 at 2^20 = 1e6 in all axes.
pub fn far_from_the_origin() -> Vec<Hard> {
    let mut s = glowing(0.5, 1.0, 12);
    place(&mut s, 64.0, 1_048_576.0);
    vec![Hard::new("at 1e6", &s, 1, &in_box(0.5, 1.0, 12))]
}

/// Boxes of half-widths 1e-4 and 1e4.
pub fn tiny_and_huge_boxes() -> Vec<Hard> {
    let mut all = vec![];
    for power in [-13, 13] {
        let mut s = glowing(0.5, 1.0, 12);
        place(&mut s, 2f32.powi(power), 0.0);
        all.push(Hard::new(format!("a box of half-width 2^{power}"), &s, 1, &in_box(0.5, 1.0, 12)));
    }
    all
}

/// A ball of diamond in one of water in one of glass.
pub fn nested_dielectrics() -> Vec<Hard> {
    let mut s = in_white_environment(camera([1.0, 1.4, 5.0], [0.0; 3], 20.0, SIZE));
    s.max_depth = 200;
    let outer = s.add_material("outer", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    let middle = s.add_material("middle", Model::Dielectric { int_ior: 1.33, ext_ior: 1.5 });
    let inner = s.add_material("inner", Model::Dielectric { int_ior: 2.4, ext_ior: 1.33 });
    let shape = Sphere { subdivisions: 2, smooth: false, inwards: false };
    add_sphere(&mut s, outer, [0.0; 3], 1.0, shape);
    add_sphere(&mut s, middle, [0.1, 0.0, 0.0], 0.7, shape);
    add_sphere(&mut s, inner, [0.0, 0.1, 0.0], 0.4, shape);
    vec![Hard::new("nested dielectrics", &s, 3, &Expected { power: 0.03, rounding: 1e-4, ..exactly(1.0) })]
}

/// A black sky with one bright texel, by quadrature.
pub fn an_environment_of_one_hot_texel() -> Vec<Hard> {
    let mut all = vec![];
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
        all.push(Hard::new(
            format!("a hot texel in row {row}"),
            &s,
            2,
            &Expected { rounding: 1e-3, ..exactly(expected) },
        ));
    }
    all
}

/// Nothing but an even environment: every sample is the same, and learning has a variance of 0 to divide by.
pub fn a_picture_without_variance() -> Vec<Hard> {
    let mut all = vec![];
    let s = in_white_environment(camera([0.0; 3], [0.0, 0.0, -1.0], 40.0, SIZE));
    all.push(Hard::new("nothing but sky", &s, 1, &Expected { rounding: 0.0, ..exactly(1.0) }));
    // and with vertices, whose samples all are the same
    all.push(Hard::new("an even box", &glowing(0.0, 1.0, 12), 1, &Expected { rounding: 1e-6, ..exactly(1.0) }));
    all
}

/// No light at all, and a light that nothing can see.
pub fn a_black_picture() -> Vec<Hard> {
    let mut all = vec![];
    let black = Expected { power: 0.0, rounding: 0.0, ..exactly(0.0) };
    all.push(Hard::new("no light", &spot(0.8, SIZE), 1, &black));
    let mut s = spot(0.8, SIZE);
    s.environment = Some(Environment::Constant { radiance: [0.0; 3] });
    all.push(Hard::new("a black sky", &s, 1, &black));
    let mut s = spot(0.8, SIZE);
    // below the floor
    s.emitters.push(Emitter::Point { position: [0.0, -1.0, 0.0], intensity: [5.0; 3] });
    all.push(Hard::new("a light below the floor", &s, 1, &black));
    all
}
