//! Environment maps under test, each as a scene has it and in f64.

use crate::hit::sample;
use crate::light_oracle::{Map, V, dot, wide};
use crate::light_scene::{IDENTITY, LightScene};
use crate::stats::SplitMix;
use croupier::unstable::light::{LightSample8, PowerSelector, environment_pdf, environment_radiance};
use croupier::unstable::scene::blob::LightKind;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Scale of all maps.
pub const SCALE: f32 = 1.5;
/// Where light arrives, which makes no difference.
pub const HERE: Vec3x8 = Vec3x8::ZERO;
/// A rotation that moves every axis, with entries that f32 rounds.
pub const TURNED: [[f32; 3]; 3] = [[0.0, 0.6, 0.8], [0.0, -0.8, 0.6], [1.0, 0.0, 0.0]];

/// A map, as it is in a scene and in f64.
pub struct Case {
    /// Name.
    pub name: &'static str,
    /// The scene, with another light.
    pub owner: LightScene,
    /// The map in f64.
    pub map: Map,
    /// World to map space.
    pub to_local: [[f32; 3]; 3],
}

impl Case {
    /// A map of `w` x `h` texels, turned by `to_local`.
    pub fn new(
        name: &'static str,
        w: usize,
        h: usize,
        to_local: [[f32; 3]; 3],
        mut f: impl FnMut(usize, usize) -> [f32; 3],
    ) -> Self {
        let texels: Vec<_> = (0..w * h).map(|k| f(k % w, k / w)).collect();
        let map = Map::new(&texels, w, h);
        // Another light, so that the selection probability is not 1.
        let owner = LightScene::default()
            .delta(LightKind::Point, [5.0, 0.0, 0.0], [1.0; 3])
            .map(texels, [w as u32, h as u32], SCALE, to_local)
            .select_by(&[1.0, 3.0]);
        Self { name, owner, map, to_local }
    }

    /// World to map space in f64.
    pub fn local(&self, d: [f32; 3]) -> V {
        self.to_local.map(|r| dot(wide(r), wide(d)))
    }

    /// Map to world space.
    pub fn world(&self, d: V) -> [f32; 3] {
        std::array::from_fn(|c| (0..3).map(|r| f64::from(self.to_local[r][c]) * d[r]).sum::<f64>() as f32)
    }

    /// Densities of directions.
    pub fn pdf(&self, d: Vec3x8) -> F32x8 {
        let scene = self.owner.scene();
        environment_pdf(&scene, &PowerSelector(scene), HERE, HERE, d, Mask8::all_lanes())
    }

    /// Radiance from directions.
    pub fn radiance(&self, d: Vec3x8) -> Vec3x8 {
        environment_radiance(&self.owner.scene(), d, Mask8::all_lanes())
    }

    /// A sample of the environment: the first word set so that the selector cannot pick the other light.
    pub fn draw(&self, words: [U32x8; 4]) -> LightSample8 {
        let scene = self.owner.scene();
        sample(&scene, &PowerSelector(scene), HERE, HERE, words, Mask8::all_lanes())
    }
}

/// Maps of all kinds.
pub fn cases() -> Vec<Case> {
    let mut rng = SplitMix(30);
    let mut noise = move |n: i32| -> [f32; 3] { std::array::from_fn(|_| rng.f64().powi(n) as f32) };
    let mut hot = SplitMix(31);
    let mut dim = move || -> [f32; 3] { [(0.1 + 0.1 * hot.f64()) as f32; 3] };
    vec![
        Case::new("noise", 16, 9, TURNED, |_, _| noise(2)),
        Case::new("sun", 32, 17, TURNED, |i, j| if (i, j) == (31, 5) { [5e4, 4e4, 3e4] } else { dim() }),
        Case::new("polar suns", 8, 5, IDENTITY, |i, j| if i == 3 && j % 4 == 0 { [900.0; 3] } else { [1.0; 3] }),
        Case::new("half black", 12, 7, IDENTITY, |i, j| if i < 6 && j > 2 { [0.0, 0.7, 0.1] } else { [0.0; 3] }),
        Case::new("smallest", 1, 2, IDENTITY, |_, j| [1.0, 2.0 + j as f32, 0.0]),
        Case::new("even", 64, 2, TURNED, |_, _| [0.25; 3]),
        Case::new("fine", 2048, 1024, IDENTITY, |i, j| [((i * 7 + j * 13) % 31) as f32; 3]),
    ]
}

/// Random numbers of a packet of light samples.
pub fn random_words(rng: &mut SplitMix) -> [U32x8; 4] {
    std::array::from_fn(|_| U32x8::from_fn(|_| rng.word()))
}
