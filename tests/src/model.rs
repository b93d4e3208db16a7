//! The model under test: the kernels of the core with the parameters of cases, as objects.

use crate::bsdf::Case;
use crate::records::none;
use croupier::unstable::bsdf::{Bsdf, Eval8, Inputs8, Sample8, Visitor, dispatch_in};
use croupier::unstable::scene::blob::{Camera, Material, SceneInfo};
use croupier::unstable::scene::{Effects, Records, Scene};
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};

impl Case {
    /// The model under test with this case's parameters in the lanes of `active`, indices of other lanes being garbage.
    pub fn model(&self, active: Mask8) -> Box<dyn Model> {
        packet([self; 8], active, Effects(u32::MAX))
    }
}

/// The kernel of a kernel profile with the parameters of eight cases of one kind.
pub fn packet(cases: [&Case; 8], active: Mask8, profile: Effects) -> Box<dyn Model> {
    let (scene, inputs) = inputs(cases, active);
    dispatch_in(profile, cases[0].kind, Boxed { scene, inputs, active }).unwrap()
}

/// A scene with the materials of eight cases, and what a kernel gathers its parameters by; lanes outside `active` are
/// garbage.
pub fn inputs(cases: [&Case; 8], active: Mask8) -> (Scene<'static>, Inputs8) {
    fn leak<T>(x: T) -> &'static T {
        Box::leak(Box::new(x))
    }
    // not the first material, so that a lost index shows
    let mut materials: Vec<Material> = vec![bytemuck::Zeroable::zeroed()];
    let mut tables = vec![];
    for case in cases {
        materials.push(case.material);
        if !case.table.is_empty() {
            materials.last_mut().unwrap().table += tables.len() as u32;
            tables.extend(&case.table);
        }
    }
    let scene = Scene::assume_valid(Records {
        materials: materials.leak(),
        tables: tables.leak(),
        ..none(leak::<SceneInfo>(bytemuck::Zeroable::zeroed()), leak::<Camera>(bytemuck::Zeroable::zeroed()))
    });
    let garbage = |i: usize| if active.lane(i) { i as u32 + 1 } else { 0xdead_beef };
    let colour = |i: usize| if active.lane(i) { cases[i].material.reflectance } else { [f32::NAN; 3] };
    (scene, Inputs8 { material: U32x8::from_fn(garbage), reflectance: Vec3x8::from_fn(colour) })
}

struct Boxed {
    scene: Scene<'static>,
    inputs: Inputs8,
    active: Mask8,
}

impl Visitor<'static> for Boxed {
    type Out = Box<dyn Model>;

    fn visit<B: Bsdf<'static>>(self) -> Box<dyn Model> {
        boxed(B::gather(&self.scene, &self.inputs, self.active), Straight::Lobe)
    }
}

/// What [`Model::sample`] does with light that passes straight on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Straight {
    /// It is one more lobe, chosen first by the number that chooses the lobe, as the tracer does.
    Lobe,
    /// It is left out, as by [`Bsdf::sample`].
    Apart,
}

/// A kernel as an object.
pub fn boxed<B: Bsdf<'static>>(kernel: B, straight: Straight) -> Box<dyn Model> {
    struct Holder<B>(B, Straight);
    impl<B: Bsdf<'static>> Model for Holder<B> {
        fn delta_only(&self) -> bool {
            B::DELTA
        }
        fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8 {
            self.0.eval(wo, wi)
        }
        fn sample(&self, wo: Vec3x8, u: [F32x8; 3]) -> Sample8 {
            if self.1 == Straight::Apart {
                return self.0.sample(wo, u);
            }
            let straight = self.0.straight(wo);
            let passes = u[2].lt(straight);
            let rest = F32x8::ZERO.max((u[2] - straight) / (1.0 - straight));
            let rest = F32x8::splat(1.0 - f32::EPSILON).min(straight.gt(F32x8::ZERO).select(rest, u[2]));
            let s = self.0.sample(wo, [u[0], u[1], rest]);
            Sample8 {
                wi: Vec3x8::select(passes, -wo, s.wi),
                weight: Vec3x8::select(passes, Vec3x8::ONE, s.weight),
                pdf: passes.select(F32x8::ZERO, s.pdf),
                delta: s.delta | passes,
                valid: s.valid | passes,
            }
        }
        fn albedo(&self, wo: Vec3x8) -> Vec3x8 {
            self.0.albedo(wo)
        }
        fn straight(&self, wo: Vec3x8) -> F32x8 {
            self.0.straight(wo)
        }
    }
    Box::new(Holder(kernel, straight))
}

/// [`Bsdf`] as an object, so that tests can run over a table of cases.
pub trait Model {
    /// [`Bsdf::DELTA`].
    fn delta_only(&self) -> bool;
    /// [`Bsdf::eval`].
    fn eval(&self, wo: Vec3x8, wi: Vec3x8) -> Eval8;
    /// [`Bsdf::sample`]; [`Straight`] says what becomes of light that passes straight on.
    fn sample(&self, wo: Vec3x8, u: [F32x8; 3]) -> Sample8;
    /// [`Bsdf::albedo`].
    fn albedo(&self, wo: Vec3x8) -> Vec3x8;
    /// [`Bsdf::straight`].
    fn straight(&self, wo: Vec3x8) -> F32x8;
}
