//! Surfaces of a host's intersector: balls, as analytic as the host wants them, against meshes and known values.

use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::film::{Aov, AovSet};
use croupier::unstable::geometry::{FIRST_OWN_SURFACE, Hit8, OwnSurface8, Ray8};
use croupier::unstable::profile::{DiffuseOnly, Full};
use croupier::unstable::scene::blob::NONE;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::{Budget, Plan, Scene, Session, SessionError, Settings, Shard, StepResult};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::*;
use croupier_tests::media_scene::{add_medium, homogeneous};
use croupier_tests::runner::{Image, settings};
use croupier_tests::scenes::*;

/// |z| that a comparison may reach: with the 30 of this file a false alarm in 1e5 runs.
const LIMIT: f64 = 5.2;

#[derive(Clone, Copy, Debug)]
struct Ball {
    center: [f32; 3],
    radius: f32,
    material: u32,
    /// Points to the right of the center have a texture coordinate u of 0.75, others of 0.25.
    object: u32,
    /// Shading normals are said to point inwards.
    inwards: bool,
    /// Everything that can be said wrongly of the right half, is.
    faulty: bool,
}

fn ball(center: [f32; 3], radius: f32, material: u32) -> Ball {
    Ball { center, radius, material, object: NONE, inwards: false, faulty: false }
}

/// Balls beside triangles.
struct WithBalls<'s> {
    triangles: WideBvh<'s>,
    balls: &'s [Ball],
}

impl Ball {
    /// Parameters of the nearest points, infinite where there is none.
    fn meets(&self, rays: &Ray8, active: Mask8) -> F32x8 {
        let [x, y, z] = self.center;
        let length = rays.d.length();
        let d = rays.d / length;
        let o = rays.o - Vec3x8::splat(x, y, z);
        let middle = -o.dot(d);
        let aside = o + d * middle;
        let half = (F32x8::splat(self.radius * self.radius) - aside.length_sqr()).safe_sqrt();
        let meets = aside.length().lt(F32x8::splat(self.radius)) & active;
        let within = |t: F32x8| {
            let t = t / length;
            (meets & t.gt(rays.tmin) & t.lt(rays.tmax)).select(t, F32x8::INFINITY)
        };
        within(middle - half).min(within(middle + half))
    }
}

impl Intersector for WithBalls<'_> {
    const SURFACES: bool = true;

    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        let mut hit = self.triangles.closest(rays, active);
        for (name, ball) in (FIRST_OWN_SURFACE..).zip(self.balls) {
            let t = ball.meets(rays, active);
            let nearer = t.lt(hit.t);
            hit.hit |= nearer;
            hit.t = nearer.select(t, hit.t);
            hit.triangle = U32x8::select(nearer, U32x8::splat(name), hit.triangle);
            // these are the host's own to use
            hit.u = nearer.select(F32x8::splat(f32::NAN), hit.u);
            hit.instance = [0, 1].map(|k| U32x8::select(nearer, U32x8::splat(7), hit.instance[k]));
        }
        hit
    }

    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
        let near = |ball: &Ball| ball.meets(rays, active).lt(F32x8::INFINITY);
        self.balls.iter().fold(self.triangles.occluded(rays, active), |met, ball| met | near(ball))
    }

    fn surface(&self, rays: &Ray8, hit: &Hit8, own: Mask8) -> OwnSurface8 {
        let of = |i: usize| own.lane(i).then(|| self.balls[(hit.triangle.lane(i) - FIRST_OWN_SURFACE) as usize]);
        let center = Vec3x8::from_fn(|i| of(i).map_or([0.0; 3], |b| b.center));
        let radius = F32x8::from_fn(|i| of(i).map_or(1.0, |b| b.radius));
        let ng = (rays.o + rays.d * own.zero_unless(hit.t) - center).normalize();
        let p = center + ng * radius;
        let error = radius * 4e-6 + center.abs().max_component() * 1e-6;
        let material = U32x8::from_fn(|i| of(i).map_or(0, |b| b.material));
        let right = ng.x.gt(F32x8::ZERO);
        let u = right.select(F32x8::splat(0.75), F32x8::splat(0.25));
        let inwards = Mask8::from_bits((0..8).fold(0, |m, i| m | u32::from(of(i).is_some_and(|b| b.inwards)) << i));
        let faulty = Mask8::from_bits((0..8).fold(0, |m, i| m | u32::from(of(i).is_some_and(|b| b.faulty)) << i));
        let bad = faulty & right;
        let nan = Vec3x8::splat(f32::NAN, f32::INFINITY, 0.0);
        OwnSurface8 {
            p: Vec3x8::select(bad, nan, p),
            ng: Vec3x8::select(bad, Vec3x8::ZERO, ng),
            error: bad.select(F32x8::splat(f32::NAN), error),
            // of any length
            ns: Vec3x8::select(bad, nan, Vec3x8::select(inwards, ng * -3.0, ng * 0.5)),
            uv: [bad.select(F32x8::splat(f32::NAN), u), F32x8::splat(0.5)],
            tangent: Vec3x8::splat(2.0, 0.0, 0.0),
            material: U32x8::select(bad, U32x8::splat(u32::MAX - 3), material),
            object: U32x8::from_fn(|i| of(i).map_or(NONE, |b| b.object)),
        }
    }
}

/// Planes of the film besides the picture.
struct Seen {
    image: Image,
    planes: Vec<Vec<Option<Vec<f32>>>>,
}

impl Seen {
    fn plane(&self, aov: Aov, channel: usize) -> &[f32] {
        self.planes[aov as usize][channel].as_deref().expect("a plane")
    }
}

fn render(bytes: &[u8], balls: &[Ball], s: &Settings, iterations: &[u32]) -> Seen {
    let scene = Scene::from_bytes(bytes).unwrap();
    let plan = Plan::new(s).unwrap();
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    let mut own = AlignedBytes::zeroed(plan.shard_of(0).size);
    let with_balls = WithBalls { triangles: WideBvh::new(&scene), balls };
    let mut session =
        Session::builder(scene).profile::<Full>().intersector(with_balls).build(&plan, shared.as_mut()).unwrap();
    let mut shard = Shard::new(&plan, 0, own.as_mut()).unwrap();
    for samples in iterations {
        session.begin_iteration(*samples);
        while shard.step(&session, Budget { rays: 1 << 20 }) == StepResult::More {}
        session.end_iteration([&shard]).unwrap();
    }
    let film = session.film();
    let plane = |aov: Aov| (0..aov.channels().len()).map(|c| film.plane(aov, c).map(<[f32]>::to_vec)).collect();
    let image = Image {
        size: film.size(),
        pixels: film.pixels().collect(),
        aovs: film.aovs().collect(),
        counters: *session.counters(),
        error: film.error_estimate(),
    };
    Seen { image, planes: Aov::ALL.into_iter().map(plane).collect() }
}

/// A room with a lamp; balls stand in the middle and to the left, of the first two materials.
fn room(model: Model, size: [u32; 2]) -> SceneDescription {
    let mut s = SceneDescription {
        camera: camera([0.0, 0.2, 0.95], [0.0, -0.3, -0.4], 75.0, size),
        ..SceneDescription::default()
    };
    s.add_material("ball", model);
    s.add_material(
        "other",
        Model::Plastic { reflectance: Reflectance::Constant([0.2, 0.5, 0.7]), int_ior: 1.5, ext_ior: 1.0 },
    );
    let wall = s.add_material("wall", diffuse([0.7, 0.6, 0.5]));
    add_box(&mut s, wall, [-1.0; 3], [1.0; 3], true);
    let glow = s.add_material("glow", grey(0.0));
    add_quad(&mut s, "lamp", glow, facing_y(0.5, 0.97, -1.0));
    s.emitters.push(Emitter::Area { material: glow, radiance: [5.0, 4.0, 3.0] });
    s
}

/// A boundary of triangles far away, without which the baker refuses a medium.
fn bound(s: &mut SceneDescription, material: u32) {
    add_box(s, material, [0.0, 0.0, 50.0], [0.001, 0.001, 50.001], false);
}

const PLACES: [([f32; 3], f32); 2] = [([0.1, -0.5, -0.2], 0.45), ([-0.6, -0.7, 0.1], 0.25)];

/// Balls of all kinds of models are as bright as meshes of 32768 triangles, with the scene between them and the lamp. The
/// errors of the two means together are below 0.4 %, so that a difference of 2 % is always found. Killed by: a ray that
/// meets the ball that it leaves, a light sample that does not see the ball, a front that is the back, a normal or a
/// material of a triangle, a ball that a shadow ray's walk through a medium's boundary misses.
#[test]
fn balls_are_as_bright_as_fine_meshes() {
    let models = [
        ("diffuse", grey(0.8), "classic", false),
        ("mirror", Model::Mirror { reflectance: Reflectance::Constant([0.9; 3]) }, "classic", false),
        ("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 }, "classic", false),
        ("principled", Model::Principled(Principled { metalness: 0.5, ..Principled::default() }), "ears", false),
        ("fog", Model::Null, "classic", true),
    ];
    for (what, model, strategy, fog) in models {
        let mut description = room(model, [24, 20]);
        if fog {
            description.media.push(homogeneous([0.3, 0.6, 1.0], [2.0, 1.5, 1.0], 0.3));
            description.materials[0].medium = Some(0);
            bound(&mut description, 0);
        }
        let bare = blob(&description);
        for (material, (center, radius)) in (0..).zip(PLACES) {
            add_sphere(
                &mut description,
                material,
                center,
                radius,
                Sphere { subdivisions: 6, smooth: true, inwards: false },
            );
        }
        let meshes = blob(&description);
        let balls: Vec<Ball> = (0..).zip(PLACES).map(|(m, (center, radius))| ball(center, radius, m)).collect();
        let of = |bytes: &AlignedBytes, balls: &[Ball]| {
            let s = Settings { max_depth: 8, seed: 3, ..settings(bytes, strategy) };
            let seen = render(bytes, balls, &s, &[96, 416]).image;
            assert_eq!(seen.counters.non_finite, 0, "{what}");
            (seen.mean(), seen.error_of_mean())
        };
        let ((found, e1), (expected, e2)) = (of(&bare, &balls), of(&meshes, &[]));
        let error = e1.hypot(e2);
        println!("{what}: {found} against {expected} +- {error}");
        assert!(error < 0.004 * expected, "{what}: {error} of {expected}");
        // the mesh is within the ball by 1e-4 of its radius
        let allowed = LIMIT * error + 3e-4 * expected;
        assert!((found - expected).abs() <= allowed, "{what}: {found} is not {expected} +- {error}");
    }
}

/// Mirrors, glass and white balls in a white world are as bright as the world, anywhere, of any size. Killed by: an offset
/// that is too small, one to the wrong side, an error of the host's that is not heeded, a path that loses what it carries.
#[test]
fn nothing_is_lost_in_a_white_world() {
    let places = [
        ([0.0; 3], 1.0f32),
        ([0.0, 3.0, -2.0], 1e-3),
        ([1000.0, -700.0, 300.0], 1.0),
        ([0.3, 0.2, 0.1], 500.0),
        ([2e4, 1e4, -3e4], 40.0),
    ];
    let models = [
        ("mirror", Model::Mirror { reflectance: Reflectance::Constant([1.0; 3]) }, 4, 1e-6),
        ("glass", Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 }, 100, 1e-6),
        ("white", grey(1.0), 3, 0.0),
    ];
    for (center, radius) in places {
        for (what, model, max_depth, allowed) in models {
            let from = [0, 1, 2].map(|c| f64::from(center[c]) + [0.3, 0.5, 3.0][c] * f64::from(radius));
            let mut s = in_white_environment(camera(from, center.map(f64::from), 30.0, [32, 32]));
            let white = s.add_material("white", grey(1.0));
            let material = s.add_material(what, model);
            // behind the camera
            let far = f64::from(radius) * 50.0;
            let corner = |x: f64, y: f64| [(from[0] + x) as f32, (from[1] + y) as f32, (from[2] + far) as f32];
            add_quad(
                &mut s,
                "far",
                white,
                [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                    .map(|[x, y]| corner(x * far * 1e-3, y * far * 1e-3)),
            );
            let bytes = blob(&s);
            let s = Settings { max_depth, ..settings(&bytes, "none") };
            let seen = render(&bytes, &[ball(center, radius, material)], &s, &[64]).image;
            assert_eq!(seen.counters.non_finite, 0);
            let covered = seen.counters.scatter_rays;
            assert!(covered > 40_000, "{what} {center:?} {radius}: {covered}");
            let error = if allowed > 0.0 { allowed } else { LIMIT * seen.error_of_mean() };
            assert!(error < 8e-3, "{what}: {error}");
            assert!((seen.mean() - 1.0).abs() <= error, "{what} {center:?} {radius}: {} +- {error}", seen.mean());
        }
    }
}

/// Two balls before a camera. Killed by: an index of a triangle, a texture read at the triangle's coordinates, a shading
/// normal that is not the ball's, that stays on the back or that keeps its length, a map's tangent that is not the ball's,
/// instances of the host's that are taken for the scene's.
#[test]
fn balls_have_normals_coordinates_materials_and_objects() {
    let mut s =
        SceneDescription { camera: camera([0.0, 0.0, 40.0], [0.0; 3], 6.0, [32, 16]), ..SceneDescription::default() };
    let wall = s.add_material("wall", grey(0.25));
    add_quad(&mut s, "wall", wall, facing_z(9.0, -5.0, 1.0));
    let texels = vec![[255, 0, 0, 255], [0, 0, 255, 255]];
    s.textures.push(Texture { name: "two".into(), width: 2, height: 1, texels, ..Texture::default() });
    // (0.6, 0, 0.8)
    let tilted =
        Texture { name: "map".into(), width: 1, height: 1, texels: vec![[204, 128, 230, 255]], ..Texture::default() };
    s.textures.push(Texture { encoding: Encoding::Linear, ..tilted });
    let textured = s.add_material("textured", Model::Diffuse { reflectance: Reflectance::Texture(0) });
    let mapped = Principled { normal_texture: Some(TextureRef::new(1)), ..Principled::default() };
    let mapped = s.add_material("mapped", Model::Principled(mapped));
    let bytes = blob(&s);
    let balls = [
        Ball { object: 77, inwards: true, ..ball([-1.5, 0.0, 0.0], 1.0, textured) },
        Ball { object: NONE, ..ball([1.5, 0.0, 0.0], 1.0, mapped) },
    ];
    let aovs = AovSet::of(&[
        Aov::Albedo,
        Aov::Normal,
        Aov::Depth,
        Aov::Material,
        Aov::Object,
        Aov::ObjectCoverage,
        Aov::Motion,
    ]);
    let seen = render(&bytes, &balls, &Settings { aovs, max_depth: 2, ..settings(&bytes, "none") }, &[16]);
    let at = |x: f64| 8 * 32 + (16.0 + x * 16.0 / (40.0 * (3f64.to_radians()).tan() * 2.0)) as usize;
    let of = |aov: Aov, i: usize| (0..aov.channels().len()).map(|c| seen.plane(aov, c)[i]).collect::<Vec<f32>>();
    let (left, right) = (at(-1.8), at(-1.2));
    assert_eq!([of(Aov::Material, left), of(Aov::Object, left)], [[textured as f32], [77.0]]);
    assert_eq!(of(Aov::ObjectCoverage, left)[..2], [77.0, 1.0]);
    let [red, blue] = [of(Aov::Albedo, left), of(Aov::Albedo, right)];
    assert!(red[0] > 0.9 && red[2] < 0.1 && blue[0] < 0.1 && blue[2] > 0.9, "{red:?} {blue:?}");
    let normal = of(Aov::Normal, right);
    assert!((normal[0] - 0.3).abs() < 0.12 && normal[2] > 0.9, "{normal:?}");
    let middle = at(1.5);
    assert_eq!([of(Aov::Material, middle), of(Aov::Object, middle)], [[mapped as f32], [-1.0]]);
    let normal = of(Aov::Normal, middle);
    let toward = [0.6, 0.0, 0.8];
    assert!(normal.iter().zip(toward).all(|(n, t)| (n - t).abs() < 0.15), "{normal:?}");
    assert!((of(Aov::Depth, middle)[0] - 39.0).abs() < 0.1);
    let far = at(0.0);
    assert_eq!([of(Aov::Material, far), of(Aov::Object, far)], [[wall as f32], [0.0]]);
    assert!(
        Aov::Motion.channels().iter().enumerate().all(|(c, _)| seen.plane(Aov::Motion, c).iter().all(|m| *m == 0.0))
    );
}

/// What a medium within a ball absorbs, seen from outside and from within. Killed by: a boundary that is crossed on the
/// wrong side, a camera within a ball that counts as outside.
#[test]
fn balls_hold_media() {
    for (from, length) in [([0.0, 0.0, 5.0], 2.0), ([0.0, 0.0, 1e-4], 1.0)] {
        let mut s = in_white_environment(camera(from, [0.0; 3], 0.2, [4, 4]));
        let white = s.add_material("white", grey(1.0));
        add_quad(&mut s, "behind", white, facing_z(0.1, 90.0, 1.0));
        let material = add_medium(&mut s, homogeneous([0.5, 1.0, 2.0], [0.0; 3], 0.0), Model::Null);
        bound(&mut s, material);
        let bytes = blob(&s);
        let s = Settings { max_depth: 4, ..settings(&bytes, "none") };
        let seen = render(&bytes, &[ball([0.0; 3], 1.0, material)], &s, &[4096]).image;
        for (c, sigma) in [0.5f64, 1.0, 2.0].into_iter().enumerate() {
            let expected = (-sigma * length).exp();
            let error = LIMIT * seen.error_of_channel(c) + 1e-4;
            assert!(error < 0.2 * expected, "{error}");
            assert!((seen.channel(c) - expected).abs() < error, "{}, not {expected} +- {error}", seen.channel(c));
        }
    }
}

/// Killed by: effects of triangles' materials alone, which would make glass black without a word.
#[test]
fn materials_of_balls_need_a_profile_that_has_them() {
    let mut s = room(grey(0.5), [8, 8]);
    s.materials[1].model = grey(0.5);
    let plain = blob(&s);
    s.materials[1].model = Model::Dielectric { int_ior: 1.5, ext_ior: 1.0 };
    let glass = blob(&s);
    let build = |bytes: &AlignedBytes| {
        let scene = Scene::from_bytes(bytes).unwrap();
        let plan = Plan::new(&settings(bytes, "none")).unwrap();
        let mut shared = AlignedBytes::zeroed(plan.session().size);
        let balls = WithBalls { triangles: WideBvh::new(&scene), balls: &[] };
        let triangles = Session::builder(scene).profile::<DiffuseOnly>().build(&plan, shared.as_mut()).map(|_| ());
        let own = Session::builder(scene).profile::<DiffuseOnly>().intersector(balls).build(&plan, shared.as_mut());
        (triangles.is_ok(), own.map(|_| ()))
    };
    assert_eq!(build(&plain), (true, Ok(())));
    assert!(matches!(build(&glass), (true, Err(SessionError::Profile { .. }))));
}

/// A host may say anything of its surfaces: nothing panics, nothing that is not finite reaches the film, and pixels that see
/// nothing of it keep every bit. Killed by: an index that is trusted, a NaN that is added, lanes that are not their own.
#[test]
fn a_faulty_surface_spoils_its_own_lanes_only() {
    let mut s = in_white_environment(camera([0.0, 0.0, 40.0], [0.0; 3], 6.0, [32, 16]));
    let wall = s.add_material("wall", grey(0.25));
    add_quad(&mut s, "wall", wall, facing_z(90.0, -5.0, 1.0));
    let texels = vec![[255, 0, 0, 255], [0, 0, 255, 255]];
    s.textures.push(Texture { name: "two".into(), width: 2, height: 1, texels, ..Texture::default() });
    let textured = s.add_material("textured", Model::Diffuse { reflectance: Reflectance::Texture(0) });
    let bytes = blob(&s);
    let aovs = Aov::ALL.iter().fold(AovSet::NONE, |set, a| set.with(AovSet::of(&[*a])));
    // direct light alone: balls throw no light on each other
    let s = Settings { aovs, max_depth: 1, ..settings(&bytes, "none") };
    let right = ball([0.0; 3], 1.0, textured);
    let sound = render(&bytes, &[right], &s, &[8]);
    let faulty = render(&bytes, &[Ball { faulty: true, ..right }], &s, &[8]);
    let seen = |s: &Seen| s.plane(Aov::Albedo, 2)[8 * 32 + 17];
    assert!(seen(&sound) > 0.9 && seen(&faulty) < 0.1);
    let mut other = 0;
    for (i, (a, b)) in sound.image.pixels.iter().zip(&faulty.image.pixels).enumerate() {
        assert!(b.sum.iter().all(|x| x.is_finite()));
        if i % 32 < 16 {
            assert_eq!(a, b);
            let same = |aov: Aov| (0..aov.channels().len()).all(|c| sound.plane(aov, c)[i] == faulty.plane(aov, c)[i]);
            assert!(Aov::ALL.into_iter().all(same), "pixel {i}");
        } else {
            other += 1;
        }
    }
    assert!(other == 16 * 16 && faulty.planes.iter().flatten().flatten().flatten().all(|x| x.is_finite()));
    let deep = Settings { max_depth: 6, ..s };
    let deep = render(&bytes, &[Ball { faulty: true, ..right }], &deep, &[8]);
    assert!(deep.image.pixels.iter().all(|p| p.sum.iter().all(|x| x.is_finite())));
}
