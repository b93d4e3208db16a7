//! Arithmetic and the scene door: numbers that must be the same on every machine.

use crate::Aligned;
use croupier::Scene;
use croupier::unstable::Effects;
use croupier::unstable::profile::{Custom, Profile};
use croupier::unstable::rng::Key8;
use croupier::unstable::scene::blob::content_hash;
use croupier::unstable::simd::{F32x8, U32x8};

/// Kernels for the tiny scene: what it calls for, and no more.
pub type ProbeKernels = Custom<{ SURFACES.with(LIGHTS).with(Effects::LENS).0 }>;
const SURFACES: Effects =
    Effects::DIFFUSE.with(Effects::ROUGH_PLASTIC).with(Effects::TEXTURES).with(Effects::SMOOTH_NORMALS);
const LIGHTS: Effects = Effects::AREA_LIGHTS.with(Effects::ENVIRONMENT).with(Effects::DELTA_LIGHTS);

/// A baked scene with one of everything.
static SCENE: &Aligned<{ include_bytes!("../tiny.crp").len() }> = &Aligned(*include_bytes!("../tiny.crp"));

/// The scene's bytes.
pub fn scene_bytes() -> &'static [u8] {
    &SCENE.0
}

/// Chains numbers into a hash.
struct Hash(u64);

impl Hash {
    fn add(&mut self, x: u64) {
        let mut bytes = [0; 16];
        for (to, from) in bytes.iter_mut().zip(self.0.to_le_bytes().into_iter().chain(x.to_le_bytes())) {
            *to = from;
        }
        self.0 = content_hash(&bytes);
    }

    fn add_floats(&mut self, x: F32x8) {
        x.to_bits().to_array().into_iter().for_each(|b| self.add(u64::from(b)));
    }
}

/// Results by name, in a fixed order.
pub fn probe() -> [(&'static str, u64); 3] {
    [("simd", simd()), ("scene", scene(scene_bytes())), ("damaged", damaged(scene_bytes()))]
}

/// The bits of arithmetic and of every elementary function on random numbers.
fn simd() -> u64 {
    let mut hash = Hash(0);
    for i in 0..64 {
        let key = Key8 { lo: U32x8::new([0, 1, 2, 3, 4, 5, 6, 7]), hi: U32x8::splat(i) };
        let [a, b, c, d] = key.uniforms(0);
        let (x, y) = (a * 40.0 - 20.0, b * 1e6);
        let (sin, cos) = c.sin_cos_2pi();
        for f in
            [x + y, x / (y + 1.0), y.sqrt(), x.exp(), y.ln(), b.powf(x), sin, cos, (d * 2.0 - 1.0).acos(), x.atan2(y)]
        {
            hash.add_floats(f);
        }
    }
    hash.0
}

/// What a blob holds, through the validating door; 0 if it is refused, or if [`ProbeKernels`] are not enough for it.
fn scene(bytes: &[u8]) -> u64 {
    let Ok(scene) = Scene::from_bytes(bytes) else { return 0 };
    if !ProbeKernels::EFFECTS.contains(scene.effects) {
        return 0;
    }
    let mut hash = Hash(scene.hash);
    let counts = [scene.nodes.len(), scene.leaves.len(), scene.triangles.len(), scene.lights.len()];
    counts.into_iter().for_each(|n| hash.add(n as u64));
    hash.add(u64::from(scene.effects.0));
    hash.0
}

/// How many truncations of a blob are refused.
fn damaged(bytes: &[u8]) -> u64 {
    let cuts = (0..bytes.len()).step_by(61);
    cuts.filter(|cut| bytes.get(..*cut).is_none_or(|b| Scene::from_bytes(b).is_err())).count() as u64
}
