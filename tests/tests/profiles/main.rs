//! Kernel profiles: the same pixels in all that hold a scene, an error in all others, none that a scene does not need.
//! Instructions are counted by the benchmarks `effects` and `instructions`; docs/EFFECTS.md has the whole list.

mod scenes;

use croupier::unstable::profile::{AnyProfile, Custom, DiffuseOnly, Full, Profile, ProfileVisitor};
use croupier::unstable::scene::Records;
use croupier::unstable::{BYTES_PER_PATH, Effects};
use croupier::{Plan, Scene, Session, SessionError, Settings, Strategy};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{Model, Reflectance, Texture};
use croupier_host::drive::{DriveError, Options, Target, Unobserved, drive_scene, drive_with};
use croupier_host::effects::{beyond, reasons};
use croupier_tests::blob::Parts;
use croupier_tests::runner::{Image, Schedule, render_with};
use croupier_tests::scenes::{blob, cornell, everything};
use scenes::{LARGER, SCENES};
use std::collections::BTreeMap;

fn settings(scene: &Scene<'_>, strategy: &str) -> Settings {
    let strategy = Strategy::parse(strategy).unwrap();
    let learns = strategy.is_efficiency_aware();
    let s = Settings { strategy, shards: 2, aovs: true.into(), max_depth: 8, ..Settings::for_scene(scene) };
    Settings { shadow_roulette: learns, adaptive: learns, ..s }
}

/// A render with one of the closed set.
struct Render<'a, 's>(Scene<'s>, &'a Settings, &'a [u32]);

impl ProfileVisitor for Render<'_, '_> {
    type Out = Image;

    fn visit<P: Profile + Send + Sync>(self) -> Image {
        let bvh = croupier::unstable::accel::WideBvh::new(&self.0);
        render_with::<P, _>(self.0, bvh, self.1, self.2, Schedule::InOrder(1 << 20))
    }
}

/// Killed by: a scene that calls for more or less than its row says, an effect without a scene.
#[test]
fn the_scenes_call_for_every_effect() {
    let mut all = Effects(0);
    for s in SCENES {
        let bytes = (s.blob)();
        assert_eq!(Scene::from_bytes(&bytes).unwrap().effects, s.effects, "{}", s.name);
        all = all.with(s.effects);
    }
    // a host's own model needs a host: `extensions.rs`
    let missing: Vec<_> = Effects::NAMES.iter().filter(|(e, _)| !all.contains(*e) && *e != Effects::OWN).collect();
    assert!(missing.is_empty(), "{missing:?}");
}

/// Killed by: a random number, a sum or a branch that depends on what is compiled in and not on what the scene
/// calls for.
#[test]
fn pixels_are_the_same_in_every_profile_that_holds_the_scene() {
    for s in SCENES {
        let bytes = (s.blob)();
        let scene = Scene::from_bytes(&bytes).unwrap();
        for strategy in ["classic", "ears"] {
            let (settings, samples) = (settings(&scene, strategy), [1, 2]);
            let full = Render(scene, &settings, &samples).visit::<Full>();
            assert!(full.mean() > 0.0, "{}: black", s.name);
            for profile in AnyProfile::ALL.iter().filter(|p| p.effects().contains(s.effects)) {
                let image = profile.dispatch(Render(scene, &settings, &samples));
                assert!(image.bits() == full.bits(), "{}, {strategy}, profile {}", s.name, profile.name());
                assert_eq!(image.counters, full.counters, "{}, {strategy}, {}", s.name, profile.name());
            }
            let larger = LARGER.iter().filter(|(effects, _)| effects.contains(s.effects)).map(|(_, render)| render);
            for (i, render) in [&s.exactly].into_iter().chain(larger).enumerate() {
                let image = render(scene, &settings, &samples);
                assert!(image.bits() == full.bits(), "{}, {strategy}, custom profile {i}", s.name);
            }
        }
    }
}

/// Starts a session over a scene that calls for `effects`, whatever it holds.
fn start<P: Profile>(effects: Effects) -> Option<SessionError> {
    let bytes = blob(&cornell([8, 8]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let scene = Scene::assume_valid(Records { effects, ..*scene });
    let plan = Plan::new(&Settings::for_scene(&scene)).unwrap();
    let mut shared = AlignedBytes::zeroed(plan.session().size);
    Session::builder(scene).profile::<P>().build(&plan, shared.as_mut()).err()
}

macro_rules! each_effect {
    ($($effect:ident),*) => {
        const EACH: &[Effects] = &[$(Effects::$effect),*];
        /// Errors of sessions: of a profile without an effect over a scene that calls for all; of a profile with it
        /// alone, and of one without any, over a scene that calls for it.
        const STARTS: &[fn() -> [Option<SessionError>; 3]] = &[$(|| [
            start::<Custom<{ !Effects::$effect.0 }>>(Effects(u32::MAX).without(Effects::OWN)),
            start::<Custom<{ Effects::$effect.0 }>>(Effects::$effect),
            start::<Custom<0>>(Effects::$effect),
        ]),*];
    };
}

each_effect!(
    DIFFUSE,
    MIRROR,
    CONDUCTOR,
    ROUGH_CONDUCTOR,
    DIELECTRIC,
    ROUGH_DIELECTRIC,
    THIN_DIELECTRIC,
    PLASTIC,
    ROUGH_PLASTIC,
    NULL,
    PRINCIPLED,
    TEXTURES,
    AREA_LIGHTS,
    ENVIRONMENT,
    CONSTANT,
    DELTA_LIGHTS,
    LENS,
    SMOOTH_NORMALS,
    MEDIA,
    GRID_MEDIA,
    ALPHA,
    MULTIPLE_SCATTERING,
    INSTANCES,
    MOTION,
    NORMAL_MAPS,
    PROJECTIONS,
    SHAPE_LIGHTS
);

/// Killed by: an effect that a session does not look for, a message without its name.
#[test]
fn each_effect_outside_the_profile_is_an_error_that_names_it() {
    // materials of the hosts' own are refused by every profile unless a host brings a model: `extensions.rs`
    let names = || Effects::NAMES.iter().filter(|(e, _)| *e != Effects::OWN);
    assert!(names().map(|(e, _)| e).eq(EACH), "an effect is not tested");
    for ((effect, name), starts) in names().zip(STARTS) {
        let [without, alone, empty] = starts();
        for error in [without, empty] {
            let error = error.expect("an error");
            assert_eq!(error, SessionError::Profile { missing: *effect });
            assert!(error.to_string().ends_with(&format!("outside the kernel profile: {name}")), "{error}");
        }
        assert_eq!(alone, None, "{name}");
    }
    let bytes = blob(&everything([8, 8]));
    let scene = Scene::from_bytes(&bytes).unwrap();
    let options = Options::new(settings(&scene, "classic"), Target::Spp(1));
    let refused = drive_with::<DiffuseOnly>(scene, &options, &Unobserved);
    assert!(matches!(refused, Err(DriveError::Session(SessionError::Profile { .. }))));
}

/// Killed by: state of a path that a setting or a scene's effects enlarge.
#[test]
fn bytes_per_path_do_not_depend_on_effects() {
    for s in SCENES {
        let bytes = (s.blob)();
        let base = settings(&Scene::from_bytes(&bytes).unwrap(), "classic");
        let shard = |ring| Plan::new(&Settings { ring, ..base }).unwrap().shard().size;
        assert_eq!(shard(2048) - shard(1024), 1024 * BYTES_PER_PATH, "{}", s.name);
    }
}

/// Killed by: a dispatch that takes another profile than the smallest, a profile that no scene needs.
#[test]
fn every_profile_runs_and_none_that_a_scene_does_not_need() {
    let mut runs: BTreeMap<&str, u32> = BTreeMap::new();
    for s in SCENES {
        let bytes = (s.blob)();
        let scene = Scene::from_bytes(&bytes).unwrap();
        let options = Options::new(settings(&scene, "classic"), Target::Spp(1));
        let ran = drive_scene(scene, &options, &Unobserved).unwrap().profile;
        let holds = AnyProfile::ALL.iter().filter(|p| p.effects().contains(s.effects));
        let fewest = holds.min_by_key(|p| p.effects().0.count_ones()).unwrap();
        assert_eq!(ran, fewest.name(), "{}", s.name);
        *runs.entry(ran).or_default() += 1;
    }
    let never: Vec<_> = AnyProfile::ALL.iter().map(|p| p.name()).filter(|n| !runs.contains_key(n)).collect();
    assert!(never.is_empty(), "{never:?} never run: {runs:?}");
    assert_eq!(runs.values().sum::<u32>() as usize, SCENES.len());
    assert!(AnyProfile::ALL.len() <= 12, "each profile is compiled into every host");
}

/// A firmware's own profile renders its scene as the full one does. Killed by: a profile of another scene.
#[test]
fn the_firmware_has_kernels_for_its_scene() {
    let blob = Parts::tiny().blob();
    let scene = Scene::from_bytes(blob.bytes()).unwrap();
    let surplus: Vec<_> = croupier_firmware::ProbeKernels::EFFECTS.without(scene.effects).names().collect();
    let missing: Vec<_> = scene.effects.without(croupier_firmware::ProbeKernels::EFFECTS).names().collect();
    assert!(surplus.is_empty() && missing.is_empty(), "{surplus:?} not needed, {missing:?} missing");
    let (settings, samples) = (Settings { size: [8, 8], ..settings(&scene, "classic") }, [2]);
    let own = Render(scene, &settings, &samples).visit::<croupier_firmware::ProbeKernels>();
    assert!(own.bits() == Render(scene, &settings, &samples).visit::<Full>().bits() && own.mean() > 0.0);
}

/// Killed by: an effect without a reason, a reason for what is not there.
#[test]
fn every_effect_has_a_reason() {
    for s in SCENES {
        let bytes = (s.blob)();
        let scene = Scene::from_bytes(&bytes).unwrap();
        let reasons = reasons(&scene);
        assert!(reasons.iter().map(|r| r.name).eq(s.effects.names()), "{}: {reasons:?}", s.name);
        for r in &reasons {
            assert!(!r.facts.is_empty() && !r.to_string().contains(" 0 "), "{}: {r}", s.name);
            let json = serde_json::to_value(r).unwrap();
            assert_eq!(json.as_object().unwrap().len(), 1 + r.facts.len(), "two facts have one name: {json}");
        }
        let profile = AnyProfile::smallest(s.effects).effects();
        let beyond: Vec<_> = beyond(&scene);
        assert!(beyond.iter().all(|name| !s.effects.names().any(|n| n == *name)));
        assert_eq!(beyond.len() + reasons.len(), profile.names().count(), "{}", s.name);
    }
}

/// Killed by: materials counted that no triangle has, a wrong fact.
#[test]
fn reasons_count_what_triangles_use() {
    let mut scene = everything([8, 8]);
    scene.textures.push(Texture {
        name: "unused".into(),
        width: 1,
        height: 1,
        texels: vec![[0; 4]],
        ..Texture::default()
    });
    scene.add_material("unused", Model::Diffuse { reflectance: Reflectance::Texture(1) });
    scene.add_material("unused", Model::Mirror { reflectance: Reflectance::Constant([1.0; 3]) });
    let bytes = blob(&scene);
    let found: Vec<_> = reasons(&Scene::from_bytes(&bytes).unwrap()).iter().map(ToString::to_string).collect();
    assert_eq!(
        found,
        [
            "diffuse: 2 materials, 4 triangles",
            "roughconductor: 1 material, 512 triangles",
            "dielectric: 1 material, 512 triangles",
            "thindielectric: 1 material, 2 triangles",
            "roughplastic: 1 material, 512 triangles",
            "null: 1 material, 12 triangles",
            "textures: 1 material, 1 image",
            "area lights: 2 triangles",
            "environment map: 4x61",
            "point, directional, spot and sun lights: 1 point light, 1 directional light",
            "thin lens: radius 0.05, focus distance 5",
            "shading normals: 3 materials, 1536 triangles",
        ]
    );
}
