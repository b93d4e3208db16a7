//! Pictures with lights chosen by the light tree are those with lights chosen by power, with less noise.

mod many_kinds;

use croupier::unstable::accel::WideBvh;
use croupier::unstable::light::{LightSelector, PowerSelector, TreeSelector};
use croupier::unstable::profile::Full;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{Camera, SceneDescription};
use croupier_tests::many_lights::cloud;
use croupier_tests::runner::{Image, settings};
use croupier_tests::scenes::{blob, camera};
use croupier_tests::stats::equivalent;
use many_kinds::mixed;

/// A camera that sees the floor below the lamps and hardly any lamp: what is seen directly has the same noise whatever
/// chooses lights.
fn at_the_floor(size: [u32; 2]) -> Camera {
    camera([0.0, 0.2, 3.0], [0.0, 0.0, 2.73], 50.0, size)
}

/// The blob of all kinds of lights over a floor.
fn lit() -> AlignedBytes {
    blob(&SceneDescription { camera: at_the_floor([12, 9]), ..mixed(200) })
}

/// Never inlined, so that a profiler finds it by its name.
#[inline(never)]
fn step_all<L: LightSelector>(session: &Session<'_, '_, Full, WideBvh<'_>, L>, shard: &mut Shard<'_>) {
    while shard.step(session, Budget { rays: 1 << 20 }) == StepResult::More {}
}

fn render_by<L: LightSelector>(scene: Scene<'_>, s: &Settings, spp: u32, selector: L) -> Image {
    let plan = Plan::new(s).unwrap();
    let [mut shared, mut block] = [plan.session(), plan.shard()].map(|l| AlignedBytes::zeroed(l.size));
    let mut session = Session::builder(scene).light_selector(selector).build(&plan, shared.as_mut()).unwrap();
    let mut shard = Shard::new(&plan, 0, block.as_mut()).unwrap();
    session.begin_iteration(spp);
    step_all(&session, &mut shard);
    session.end_iteration([&shard]).unwrap();
    let film = session.film();
    Image {
        size: film.size(),
        pixels: film.pixels().collect(),
        aovs: Vec::new(),
        counters: *session.counters(),
        error: film.error_estimate(),
    }
}

/// Relative difference of the means and its standard error.
fn difference(a: &Image, b: &Image) -> (f64, f64) {
    let error = a.error_of_mean().hypot(b.error_of_mean());
    ((a.mean() - b.mean()) / b.mean(), error / b.mean())
}

/// The picture of all kinds of lights is the same as with lights chosen by power, and less noisy. Differences above
/// 1 % show with a probability of 99 %. Killed by: a light that is left out, MIS densities of
/// another selector than samples have, delta lights that are not seen from some points.
#[test]
fn pictures_are_those_of_a_choice_by_power() {
    let bytes = lit();
    let scene = Scene::from_bytes(&bytes).unwrap();
    for depth in [2, 4] {
        let s = Settings { max_depth: depth, seed: 3, ..settings(&bytes, "none") };
        let tree = render_by(scene, &s, 5000, TreeSelector(scene));
        let power = render_by(scene, &Settings { seed: 4, ..s }, 10_000, PowerSelector(scene));
        let (d, error) = difference(&tree, &power);
        let gain = power.error_of_mean().powi(2) * 2.0 / tree.error_of_mean().powi(2);
        println!(
            "depth {depth}: {:+.3} % +- {:.3} %, variance of the mean {gain:.1} times less",
            100.0 * d,
            100.0 * error
        );
        assert!(error < 0.0025, "{error}");
        assert!(equivalent(d, error, 0.01, 0.01), "{d} +- {error}");
        assert!(gain > 2.0, "{gain}");
    }
}

/// A selector that states too much for what it picks is found out. Killed by: a test that cannot fail.
#[test]
fn wrong_densities_show() {
    struct Wrong<'s>(TreeSelector<'s>);
    impl LightSelector for Wrong<'_> {
        fn select(&self, p: Vec3x8, n: Vec3x8, r: U32x8, mask: Mask8) -> (U32x8, F32x8) {
            let (light, probability) = self.0.select(p, n, r, mask);
            (light, probability * 1.2)
        }
        fn probability(&self, p: Vec3x8, n: Vec3x8, light: U32x8, mask: Mask8) -> F32x8 {
            self.0.probability(p, n, light, mask)
        }
    }
    let bytes = lit();
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = Settings { max_depth: 2, seed: 5, ..settings(&bytes, "none") };
    let right = render_by(scene, &s, 5000, TreeSelector(scene));
    let wrong = render_by(scene, &Settings { seed: 6, ..s }, 5000, Wrong(TreeSelector(scene)));
    let (d, error) = difference(&wrong, &right);
    assert!(d + 5.0 * error < -0.01, "{d} +- {error}");
}

/// relMSE of a picture of `n` emitters with lights by the tree, or by power where there are too few for one, and by
/// power.
fn errors(n: u32) -> [f64; 2] {
    let bytes = blob(&SceneDescription { camera: at_the_floor([32, 24]), ..cloud(n, [32, 24]) });
    let scene = Scene::from_bytes(&bytes).unwrap();
    let s = Settings { max_depth: 3, seed: 8, ..settings(&bytes, "none") };
    let error = |image: Image| {
        let of = |(m, v): (f64, f64)| v / (m * m + 0.01);
        let pixels = image.pixels.iter().map(|p| p.mean().into_iter().zip(p.variance_of_mean()).map(of).sum::<f64>());
        let mut pixels: Vec<f64> = pixels.map(|x| x / 3.0).collect();
        pixels.sort_by(f64::total_cmp);
        pixels.truncate(pixels.len() * 199 / 200);
        println!("{n} emitters: {} rays", image.counters.rays());
        pixels.iter().sum::<f64>() / pixels.len() as f64
    };
    let errors =
        [error(render_by(scene, &s, 16, TreeSelector(scene))), error(render_by(scene, &s, 16, PowerSelector(scene)))];
    println!("{n} emitters: relMSE {:.4} by the tree, {:.4} by power", errors[0], errors[1]);
    errors
}

/// 10,000 emitters are chosen well enough that their picture is less noisy than by power at equal samples. Killed
/// by: a tree whose importance does not fall with distance, or whose parts are not near each other.
#[test]
fn ten_thousand_emitters_are_chosen_well() {
    let [tree, power] = errors(10_000);
    assert!(tree < 0.25 * power, "{tree} {power}");
}

/// With a single emitter there is no tree, and both ways are one. Killed by: a tree where none is worth it.
#[test]
fn one_emitter_has_no_tree() {
    let [tree, power] = errors(1);
    assert_eq!(tree, power);
}
