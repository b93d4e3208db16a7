//! Everything under light from everywhere: radiance is the albedo, and 1 where nothing is lost.

use croupier::Settings;
use croupier::unstable::scene::blob::MaterialKind;
use croupier_host::description::{Model, Reflectance};
use croupier_tests::bsdf::{Case, assert_every_kind, at_angle};
use croupier_tests::runner::{Image, render, settings};
use croupier_tests::scenes::*;
use croupier_tests::stats::{FAMILY_ALPHA, normal_quantile_upper, sidak};

/// Rounding of f32 over a few bounces, relative.
const ROUNDING: f64 = 3e-5;

/// |z| that a comparison among `m` may reach.
fn limit(m: usize) -> f64 {
    normal_quantile_upper(sidak(FAMILY_ALPHA, m) / 2.0)
}

/// The model and the oracle of the same parameters.
fn pair(kind: MaterialKind, reflectance: [f32; 3], eta: [f32; 3], k: [f32; 3], alpha: f32) -> (Model, Case) {
    use MaterialKind as M;
    let r = Reflectance::Constant(reflectance);
    let (int_ior, ext_ior) = (eta[0], 1.0);
    let model = match kind {
        M::Diffuse => Model::Diffuse { reflectance: r },
        M::Mirror => Model::Mirror { reflectance: r },
        M::Conductor => Model::Conductor { eta, k, reflectance: r },
        M::RoughConductor => Model::RoughConductor { eta, k, reflectance: r, alpha },
        M::Dielectric => Model::Dielectric { int_ior, ext_ior },
        M::RoughDielectric => Model::RoughDielectric { int_ior, ext_ior, alpha },
        M::ThinDielectric => Model::ThinDielectric { int_ior, ext_ior },
        M::Plastic => Model::Plastic { reflectance: r, int_ior, ext_ior },
        M::RoughPlastic => Model::RoughPlastic { reflectance: r, int_ior, ext_ior, alpha },
        M::Null => Model::Null,
        M::Own => Model::Own { reflectance: r, alpha },
        M::Principled => {
            Model::Principled(croupier_host::description::Principled { base_color: reflectance, ..Default::default() })
        }
    };
    (model, Case::new(kind, reflectance, eta, k, alpha))
}

fn pairs() -> Vec<(Model, Case)> {
    use MaterialKind::*;
    let (one, zero, colour) = ([1.0; 3], [0.0; 3], [0.8, 0.5, 0.1]);
    let (gold, gold_k) = ([0.143, 0.375, 1.442], [3.983, 2.386, 1.603]);
    let glass = [1.5; 3];
    let mut all = vec![
        pair(Diffuse, colour, zero, zero, 0.0),
        pair(Mirror, colour, zero, zero, 0.0),
        pair(Conductor, one, gold, gold_k, 0.0),
        pair(Dielectric, zero, glass, zero, 0.0),
        pair(Dielectric, zero, [0.75; 3], zero, 0.0),
        pair(ThinDielectric, zero, glass, zero, 0.0),
        pair(Plastic, colour, glass, zero, 0.0),
        pair(Null, zero, zero, zero, 0.0),
    ];
    for alpha in [0.05, 0.3, 1.0] {
        all.push(pair(RoughConductor, one, gold, gold_k, alpha));
        all.push(pair(RoughDielectric, zero, glass, zero, alpha));
        all.push(pair(RoughPlastic, colour, glass, zero, alpha));
    }
    let compensated = |(model, case): (Model, Case)| (model, case.compensated());
    for alpha in [0.05, 0.8] {
        all.push(compensated(pair(RoughConductor, one, gold, gold_k, alpha)));
        all.push(compensated(pair(RoughDielectric, zero, glass, zero, alpha)));
        all.push(compensated(pair(RoughPlastic, colour, glass, zero, alpha)));
    }
    assert_every_kind(&all.iter().map(|(_, c)| c.kind).collect::<Vec<_>>(), |_| true);
    all
}

/// One quad of a material around the origin, facing +z, seen at `degrees` from its normal; beyond 90 from behind.
fn quad_in_white_environment((model, case): &(Model, Case), two_sided: bool, degrees: f64) -> Vec<u8> {
    let w = at_angle(degrees, 0.0).map(|x| 10.0 * x);
    let mut s = in_white_environment(camera(w, [0.0; 3], 0.01, [4, 4]));
    let material = s.add_material("surface", *model);
    (s.materials[0].two_sided, s.materials[0].compensated) = (two_sided, case.is_compensated());
    add_quad(&mut s, "quad", material, facing_z(1.0, 0.0, 1.0));
    blob(&s).to_vec()
}

#[track_caller]
fn assert_radiance(what: &str, image: &Image, expected: [f64; 3], limit: f64) {
    assert_eq!(image.counters.non_finite, 0, "{what}");
    for (c, want) in expected.into_iter().enumerate() {
        let (mean, error) = (image.channel(c), image.error_of_channel(c));
        let off = mean - want;
        assert!(error <= 0.006 * want.max(0.1), "{what}: a standard error of {error} sees nothing");
        assert!(
            off.abs() <= limit * error + ROUNDING * want,
            "{what}, channel {c}: {mean} +- {error}, expected {want} ({:.2} standard errors)",
            off / error
        );
    }
}

/// One bounce of every model: the radiance is the albedo at that angle, by the quadrature of the oracle. Killed by: a
/// missing cosine, a wrong Fresnel term or MIS weight, 1/eta^2 left out, a lobe probability that is not in the weight.
#[test]
fn one_bounce_shows_the_albedo() {
    let (pairs, angles) = (pairs(), [0.0, 45.0, 75.0]);
    let limit = limit(pairs.len() * 5 * 3);
    for pair in &pairs {
        let case = &pair.1;
        let behind = if case.two_sided() { &[135.0, 150.0][..] } else { &[] };
        for degrees in angles.iter().chain(behind) {
            let wo = at_angle(*degrees, 0.0);
            let mut expected = case.integral(wo, 512).f;
            for lobe in case.lobes(wo) {
                expected = std::array::from_fn(|c| expected[c] + lobe.weight[c]);
            }
            let scene = quad_in_white_environment(pair, false, *degrees);
            let settings = Settings { max_depth: 2, ..settings(&scene, "none") };
            let image = render(&scene, &settings, 4096);
            assert_radiance(&format!("{} at {degrees} degrees", case.name()), &image, expected, limit);
        }
    }
}

/// The layer albedo of every model at that angle: 1 where light goes through; else the oracle's, exactly for smooth
/// surfaces and at least that for rough ones, whose masked light counts as reflected. Killed by: the parameter
/// `reflectance` in its place, which is 0 for glass and 1 for gold.
#[test]
fn first_hits_have_their_albedo() {
    for pair in &pairs() {
        let case = &pair.1;
        for degrees in [0.0, 45.0, 75.0] {
            let wo = at_angle(degrees, 0.0);
            let mut expected = case.integral(wo, 512).f;
            for lobe in case.lobes(wo) {
                expected = std::array::from_fn(|c| expected[c] + lobe.weight[c]);
            }
            let scene = quad_in_white_environment(pair, false, degrees);
            let image = render(&scene, &Settings { aovs: true.into(), max_depth: 2, ..settings(&scene, "none") }, 16);
            let hits: f64 = image.aovs.iter().map(|a| a.hits).sum();
            // what passes straight on is no hit, and the rest of a thin sheet is a mirror
            let straight = matches!(case.kind, MaterialKind::ThinDielectric | MaterialKind::Null);
            assert!(if straight { hits < 128.0 } else { hits == 256.0 }, "{}: {hits} hits", case.name());
            if case.kind == MaterialKind::Null || hits == 0.0 {
                continue;
            }
            for (c, want) in expected.into_iter().enumerate() {
                let found = image.aovs.iter().map(|a| a.albedo[c]).sum::<f64>() / hits;
                let what =
                    format!("{} of roughness {} at {degrees} degrees: {found} for {want}", case.name(), case.alpha());
                match () {
                    () if case.two_sided() => assert!((found - 1.0).abs() < 1e-6, "{what}"),
                    () if case.alpha() == 0.0 => assert!((found - want).abs() < 1e-3, "{what}"),
                    () => assert!((want - 0.02..=1.0).contains(&found), "{what}"),
                }
            }
        }
    }
}

/// The back of a one-sided opaque surface is black; that of a two-sided one is its front. Killed by: a flag that is not
/// read, a shading normal that is not turned.
#[test]
fn backs_are_black_or_fronts() {
    let pairs: Vec<_> = pairs().into_iter().filter(|(_, case)| !case.two_sided()).collect();
    assert!(pairs.len() >= 8);
    let limit = limit(2 * pairs.len() * 3);
    for pair in &pairs {
        let case = &pair.1;
        for degrees in [20.0, 60.0] {
            let front = at_angle(degrees, 0.0);
            let mut expected = case.integral(front, 512).f;
            for lobe in case.lobes(front) {
                expected = std::array::from_fn(|c| expected[c] + lobe.weight[c]);
            }
            let scene = quad_in_white_environment(pair, true, 180.0 - degrees);
            let image = render(&scene, &settings(&scene, "none"), 4096);
            assert_radiance(&format!("back of a two-sided {}", case.name()), &image, expected, limit);
            let scene = quad_in_white_environment(pair, false, 180.0 - degrees);
            let image = render(&scene, &settings(&scene, "none"), 16);
            assert_eq!(image.mean(), 0.0, "back of a one-sided {}", case.name());
        }
    }
}

/// A closed sphere that loses nothing is invisible, at every depth of paths and with roulette. Killed by: energy lost
/// or gained in total internal reflection, 1/eta^2 on one side only, roulette that is not made up for.
#[test]
fn lossless_spheres_are_invisible() {
    use MaterialKind::*;
    let (one, zero, glass) = ([1.0; 3], [0.0; 3], [1.5; 3]);
    let spheres = [
        pair(Diffuse, one, zero, zero, 0.0),
        pair(Mirror, one, zero, zero, 0.0),
        // no real part: total reflection
        pair(Conductor, one, zero, [2.0; 3], 0.0),
        pair(Dielectric, zero, glass, zero, 0.0),
        pair(Dielectric, zero, [0.6; 3], zero, 0.0),
        pair(ThinDielectric, zero, glass, zero, 0.0),
        pair(Plastic, one, glass, zero, 0.0),
        pair(Null, zero, zero, zero, 0.0),
    ];
    let strategies = ["none", "classic:2", "fixed:0.7", "throughput"];
    let limit = limit(spheres.len() * strategies.len() * 3);
    for (model, case) in &spheres {
        let mut s = in_white_environment(camera([0.0, 0.0, 5.0], [0.0; 3], 30.0, [8, 8]));
        let material = s.add_material("surface", *model);
        let flat = Sphere { subdivisions: 3, smooth: false, inwards: false };
        add_sphere(&mut s, material, [0.0; 3], 1.0, flat);
        let scene = blob(&s);
        for strategy in strategies {
            let settings = Settings { max_depth: 200, ..settings(&scene, strategy) };
            let image = render(&scene, &settings, 1024);
            assert_radiance(&format!("sphere of {}, {strategy}", case.name()), &image, [1.0; 3], limit);
        }
    }
}

/// So is a rough one that is compensated, within what its tables are off by at each bounce; single scattering shows.
/// Killed by: factors that only one of light samples and scattered rays has; a roulette weight that they miss.
#[test]
fn compensated_spheres_are_invisible() {
    use MaterialKind::*;
    let (one, zero, glass) = ([1.0; 3], [0.0; 3], [1.5; 3]);
    for alpha in [0.2, 0.7, 1.0] {
        for (model, case) in [
            pair(RoughConductor, one, zero, [2.0; 3], alpha),
            pair(RoughDielectric, zero, glass, zero, alpha),
            pair(RoughPlastic, one, glass, zero, alpha),
        ] {
            let mut s = in_white_environment(camera([0.0, 0.0, 5.0], [0.0; 3], 20.0, [8, 8]));
            let material = s.add_material("surface", model);
            add_sphere(&mut s, material, [0.0; 3], 1.0, Sphere { subdivisions: 3, smooth: false, inwards: false });
            let render_as = |compensated: bool, s: &mut croupier_host::description::SceneDescription| {
                s.materials[0].compensated = compensated;
                let scene = blob(s);
                // light wanders in rough glass
                let spp = if case.kind == RoughDielectric { 8192 } else { 4096 };
                render(&scene, &Settings { max_depth: 200, ..settings(&scene, "classic:8") }, spp)
            };
            let single = render_as(false, &mut s);
            let image = render_as(true, &mut s);
            let (mean, error) = (image.channel(0), image.error_of_channel(0));
            println!("{}: {} single, {mean} +- {error} compensated", case.name(), single.channel(0));
            assert!(error < 2e-3, "{}: +- {error}", case.name());
            assert!((mean - 1.0).abs() < 5e-3 + 4.0 * error, "{}: {mean} +- {error}", case.name());
            assert!(single.channel(0) < 0.99, "{}: {}", case.name(), single.channel(0));
        }
    }
}

/// A white sphere in a glass one is as invisible, and inside glass radiance is eta^2 times that outside. Killed by:
/// radiance that is not scaled at the interface, or scaled like importance.
#[test]
fn glass_around_a_white_sphere_changes_nothing() {
    let sphere = Sphere { subdivisions: 4, smooth: false, inwards: false };
    let mut s = in_white_environment(camera([0.0, 0.0, 5.0], [0.0; 3], 15.0, [8, 8]));
    let glass = s.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    let white = s.add_material("white", grey(1.0));
    add_sphere(&mut s, glass, [0.0; 3], 1.0, sphere);
    add_sphere(&mut s, white, [0.0; 3], 0.6, sphere);
    let scene = blob(&s);
    let image = render(&scene, &Settings { max_depth: 200, ..settings(&scene, "none") }, 512);
    assert_radiance("white sphere in glass", &image, [1.0; 3], limit(7));

    let mut s = in_white_environment(camera([0.0; 3], [0.3, 0.2, -1.0], 40.0, [8, 8]));
    let glass = s.add_material("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 });
    add_sphere(&mut s, glass, [0.0; 3], 1.0, sphere);
    let scene = blob(&s);
    let image = render(&scene, &Settings { max_depth: 200, ..settings(&scene, "none") }, 1024);
    assert_radiance("environment from within glass", &image, [2.25; 3], limit(7));
}

/// In a closed box of albedo rho that emits L, radiance is L (1 + rho + rho^2 + ...), one term per path segment:
/// L / (1 - rho) in the end. Killed by: a depth off by one, emission counted by both techniques in full, roulette that
/// forgets its weight.
#[test]
fn closed_boxes_sum_the_geometric_series() {
    let depths = [1, 2, 3, 5, 12, 200];
    let limit = limit(3 * depths.len() * 3 * 3);
    for rho in [0.0, 0.5, 0.9f32] {
        let scene = blob(&glowing_box(rho, 0.75, [4, 4]));
        for max_depth in depths {
            for strategy in ["none", "classic:2", "fixed:1.3"] {
                let base = settings(&scene, strategy);
                let split_budget = 8;
                let settings = Settings { max_depth, split_budget, ..base };
                // long paths: many rays, and roulette makes them noisy
                let spp = match (max_depth, strategy) {
                    (200, "classic:2") if rho > 0.8 => 3000,
                    (200, "fixed:1.3") if rho > 0.8 => 512,
                    (200, _) if rho > 0.8 => 64,
                    (12.., _) => 1024,
                    _ => 512,
                };
                let image = render(&scene, &settings, spp);
                let r = f64::from(rho);
                let expected = 0.75 * (1.0 - r.powi(max_depth as i32)) / (1.0 - r);
                assert_radiance(&format!("box of {rho}, depth {max_depth}, {strategy}"), &image, [expected; 3], limit);
            }
        }
    }
}

/// The same inside a sphere of triangles.
#[test]
fn a_closed_sphere_sums_the_geometric_series() {
    let mut s = in_white_environment(camera([0.2, 0.1, 0.0], [0.0, 1.0, -1.0], 60.0, [4, 4]));
    let wall = s.add_material("wall", grey(0.5));
    add_sphere(&mut s, wall, [0.0; 3], 1.0, Sphere { subdivisions: 3, smooth: true, inwards: true });
    s.emitters.push(croupier_host::description::Emitter::Area { material: wall, radiance: [0.5; 3] });
    let scene = blob(&s);
    let image = render(&scene, &Settings { max_depth: 60, ..settings(&scene, "classic:3") }, 2048);
    // shading normals turn a few directions below their own facet: as little as the facets are off the sphere
    for c in 0..3 {
        assert!((image.channel(c) - 1.0).abs() < 0.004, "{} +- {}", image.channel(c), image.error_of_channel(c));
    }
}

/// A closed white box without light ends: every path has exactly 200 segments. Killed by: no hard stop, one off by one,
/// a setting that lifts it, a stop that is not counted.
#[test]
fn white_boxes_end_at_the_longest_path_length() {
    let scene = blob(&glowing_box(1.0, 0.0, [4, 4]));
    for (strategy, max_depth) in [("none", u32::MAX), ("none", 200), ("classic", 1000), ("contribution", 201)] {
        let c = render(&scene, &Settings { max_depth, ..settings(&scene, strategy) }, 4).counters;
        assert_eq!((c.camera_samples, c.camera_rays), (64, 64));
        assert_eq!((c.scatter_rays, c.shadow_rays), (64 * 199, 0), "{strategy}");
        assert_eq!(c.max_length_reached, if max_depth > 200 { 64 } else { 0 }, "{strategy}, {max_depth}");
    }
    // splitting spends its budget and then ends as well
    let settings = Settings { max_depth: u32::MAX, split_budget: 64, ..settings(&scene, "fixed:20") };
    let c = render(&scene, &settings, 1).counters;
    assert_eq!(c.camera_samples, 16);
    let most = 16 * (1 + 64 + 8 * 19) * 200;
    assert!(c.rays() > 16 * 64 * 150 && c.rays() < most, "{} rays", c.rays());
}
