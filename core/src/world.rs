//! What paths read while they are traced: one name for scene, kernels, learned state and iteration. All of it is frozen
//! while an iteration runs.

use crate::accel::{Intersector, Occlusion8};
use crate::extension::Extension;
use crate::geometry::{Hit8, Ray8};
use crate::learn::LearnedState;
use crate::light::LightSelector;
use crate::sampler::Sampler;
use crate::scene::{Effects, Scene};
use bytemuck::{Pod, Zeroable};
use croupier_simd::Mask8;

/// One round of camera samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Iteration {
    /// 1 for the first; 0 before it.
    pub number: u64,
    /// Camera samples per pixel before it.
    pub first_sample: u32,
    /// Camera samples per pixel in it.
    pub samples: u32,
}

/// What tells a shard that its sums belong to a session: they do while both have the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Identity {
    /// Content hash of the scene.
    pub scene: u64,
    /// Number of restarts of the session ([`crate::SessionState::restart`]).
    pub epoch: u64,
    /// Iteration that runs.
    pub iteration: Iteration,
}

/// The read-only side of a render, as shards see it. Sealed: [`crate::Session`] is the one that hosts use.
pub trait World: sealed::Sealed {
    /// Effects that the kernels are compiled with.
    const EFFECTS: Effects;
    /// See [`Profile::LIGHT_TREES`](crate::profile::Profile::LIGHT_TREES).
    const LIGHT_TREES: bool;
    /// Do the kernels contain path guiding?
    const GUIDING: bool;
    /// What finds hits.
    type Intersector: Intersector;
    /// What chooses lights.
    type Lights: LightSelector;
    /// What the host computes.
    type Extension: Extension;
    /// What [`Self::unguided`] gives.
    type Unguided<'w>: World
    where
        Self: 'w;

    /// The same for kernels without path guiding, of the profile
    /// [`Profile::Unguided`](crate::profile::Profile::Unguided): what shards trace with that neither guide paths nor learn
    /// to, all of them where there is no guide.
    fn unguided(&self) -> Self::Unguided<'_>;
    /// The scene.
    fn scene(&self) -> &Scene<'_>;
    /// What finds hits.
    fn intersector(&self) -> &Self::Intersector;
    /// What chooses lights.
    fn lights(&self) -> &Self::Lights;
    /// What the host computes.
    fn extension(&self) -> &Self::Extension;
    /// Statistics of earlier iterations.
    fn learned(&self) -> &LearnedState<'_>;
    /// The iteration that runs.
    fn iteration(&self) -> Iteration;
    /// Where the numbers of paths come from; constant in kernels without the Sobol' sampler.
    fn sampler(&self) -> Sampler;
    /// Path segments at which every path ends.
    fn max_depth(&self) -> u32;
    /// Bits of the media that the camera is inside of.
    fn camera_media(&self) -> u32;

    /// Number of restarts.
    fn epoch(&self) -> u64;

    /// [`Intersector::closest`] of the kernels' profile.
    #[inline(always)]
    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        let all = self.intersector();
        if Self::EFFECTS.contains(Effects::INSTANCES) {
            all.closest(rays, active)
        } else {
            all.flat().closest(rays, active)
        }
    }

    /// [`Intersector::occluded`] of the kernels' profile.
    #[inline(always)]
    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
        let all = self.intersector();
        if Self::EFFECTS.contains(Effects::INSTANCES) {
            all.occluded(rays, active)
        } else {
            all.flat().occluded(rays, active)
        }
    }

    /// [`Intersector::occluded_by`] of the kernels' profile.
    #[inline(always)]
    fn occluded_by(&self, rays: &Ray8, active: Mask8, blocks: &dyn Fn(u32) -> bool) -> Occlusion8 {
        let all = self.intersector();
        if Self::EFFECTS.contains(Effects::INSTANCES) {
            all.occluded_by(rays, active, blocks)
        } else {
            all.flat().occluded_by(rays, active, blocks)
        }
    }

    /// What tells a shard that its sums belong here.
    fn identity(&self) -> Identity {
        Identity { scene: self.scene().hash, epoch: self.epoch(), iteration: self.iteration() }
    }
}

pub(crate) mod sealed {
    /// Keeps [`super::World`] to this crate.
    pub trait Sealed {}
}
