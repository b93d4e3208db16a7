//! The kernels that a session can have: the built-in parts, or those of a host, each compiled once. A session that has
//! no callbacks refers to the first alone, so that a program which starts no other is linked without them.

use crate::parts::*;
use croupier::unstable::accel::{Intersector, WideBvh};
use croupier::unstable::bsdf::NoBsdf;
use croupier::unstable::extension::{Extension, PixelSamples8, SourcePoints8, SourceRays8};
use croupier::unstable::geometry::{FIRST_OWN_SURFACE, Hit8, OwnSurface8, Ray8};
use croupier::unstable::light::TreeSelector;
use croupier::unstable::profile::Full;
use croupier::unstable::scene::blob::NONE;
use croupier::unstable::simd::{F32x8, Mask8, U32x8, Vec3x8};
use croupier::{Budget, Plan, SavedShardError, Scene, Session, SessionBuilder, SessionError, SessionState};
use croupier::{Shard, StepResult};

/// What a kernel does.
pub(crate) struct Kernel {
    /// Builds or resumes a session in its block.
    pub start: fn(Scene<'_>, &croupier_parts, &Plan, &'static mut [u8], bool) -> Started,
    /// Steps a shard.
    pub step: fn(Scene<'_>, &croupier_parts, &State, &mut Shard<'static>, Budget) -> Result<StepResult, SessionError>,
    /// Goes over to another state of the scene.
    pub change: fn(Scene<'_>, &croupier_parts, &mut State, bool) -> Result<(), SessionError>,
    /// Takes saved bytes into a shard.
    pub load: fn(Scene<'_>, &croupier_parts, &State, &mut Shard<'static>, &[u8]) -> Loaded,
    /// Has the shard stepped in the iteration of the session?
    pub has_joined: fn(Scene<'_>, &croupier_parts, &State, &Shard<'static>) -> bool,
}

pub(crate) type State = SessionState<'static>;
pub(crate) type Loaded = Result<Result<(), SavedShardError>, SessionError>;
pub(crate) type Started = Result<State, SessionError>;

impl Kernel {
    /// The kernel without callbacks.
    pub(crate) const BUILT_IN: &'static Self = &of::<BuiltIn>();

    /// The kernel for callbacks.
    pub(crate) fn for_parts(parts: &croupier_parts) -> &'static Self {
        match parts {
            croupier_parts { rays: Some(_), .. } => const { &of::<HostRays>() },
            croupier_parts { points: Some(_), .. } => const { &of::<HostPoints>() },
            croupier_parts { closest: Some(_), .. } => const { &of::<HostIntersector>() },
            _ => Self::BUILT_IN,
        }
    }
}

/// Types of a kernel.
trait Parts {
    type Intersector<'s>: Intersector;
    type Extension: Extension;

    fn of<'s>(scene: Scene<'s>, host: &croupier_parts) -> (Self::Intersector<'s>, Self::Extension);
}

/// Effects that scenes may have: all.
#[cfg(not(feature = "guiding"))]
type Profile = Full;
/// The same with path guiding, for sessions whose settings ask for it.
#[cfg(feature = "guiding")]
type Profile = croupier::unstable::profile::Guided<Full>;

type Builder<'s, K> =
    SessionBuilder<'s, Profile, <K as Parts>::Intersector<'s>, TreeSelector<'s>, <K as Parts>::Extension>;

fn builder<'s, K: Parts>(scene: Scene<'s>, host: &croupier_parts) -> Builder<'s, K> {
    let (intersector, extension) = K::of(scene, host);
    Session::builder(scene).profile::<Profile>().intersector(intersector).extension(extension)
}

const fn of<K: Parts>() -> Kernel {
    Kernel {
        start: |scene, host, plan, block, resume| {
            let builder = builder::<K>(scene, host);
            let session = if resume { builder.resume(plan, block) } else { builder.build(plan, block) };
            session.map(Session::into_state)
        },
        step: |scene, host, state, shard, budget| {
            let view = builder::<K>(scene, host).view(state)?;
            Ok(shard.step(&view, budget))
        },
        change: |scene, host, state, keep| state.change_scene(&builder::<K>(scene, host), keep),
        load: |scene, host, state, shard, bytes| {
            let view = builder::<K>(scene, host).view(state)?;
            Ok(shard.load(&view, bytes))
        },
        has_joined: |scene, host, state, shard| {
            builder::<K>(scene, host).view(state).is_ok_and(|view| shard.has_joined(&view))
        },
    }
}

/// No callbacks.
struct BuiltIn;

impl Parts for BuiltIn {
    type Intersector<'s> = WideBvh<'s>;
    type Extension = ();

    fn of<'s>(scene: Scene<'s>, _: &croupier_parts) -> (WideBvh<'s>, ()) {
        (WideBvh::new(&scene), ())
    }
}

/// A host's intersector, rays of the camera.
struct HostIntersector;

impl Parts for HostIntersector {
    type Intersector<'s> = Hosted<'s>;
    type Extension = ();

    fn of<'s>(scene: Scene<'s>, host: &croupier_parts) -> (Hosted<'s>, ()) {
        (Hosted::new(scene, host), ())
    }
}

/// A host's rays, and its intersector if it has one.
struct HostRays(croupier_parts);

impl Parts for HostRays {
    type Intersector<'s> = Hosted<'s>;
    type Extension = Self;

    fn of<'s>(scene: Scene<'s>, host: &croupier_parts) -> (Hosted<'s>, Self) {
        (Hosted::new(scene, host), Self(*host))
    }
}

/// A host's points, and its intersector if it has one.
struct HostPoints(croupier_parts);

impl Parts for HostPoints {
    type Intersector<'s> = Hosted<'s>;
    type Extension = Self;

    fn of<'s>(scene: Scene<'s>, host: &croupier_parts) -> (Hosted<'s>, Self) {
        (Hosted::new(scene, host), Self(*host))
    }
}

/// Memory that a callback sees starts at a multiple of 32.
#[repr(C, align(32))]
struct Aligned<T>(T);

fn rows(v: Vec3x8) -> [[f32; 8]; 3] {
    [v.x.to_array(), v.y.to_array(), v.z.to_array()]
}

fn vector([x, y, z]: [[f32; 8]; 3]) -> Vec3x8 {
    Vec3x8::new(F32x8::new(x), F32x8::new(y), F32x8::new(z))
}

impl croupier_rays8 {
    fn from_core(r: &Ray8) -> Self {
        Self {
            origin: rows(r.o),
            direction: rows(r.d),
            tmin: r.tmin.to_array(),
            tmax: r.tmax.to_array(),
            time: r.time.to_array(),
        }
    }

    pub(crate) fn to_core(self) -> Ray8 {
        let [tmin, tmax, time] = [self.tmin, self.tmax, self.time].map(F32x8::new);
        Ray8 { o: vector(self.origin), d: vector(self.direction), tmin, tmax, time }
    }
}

impl croupier_hits8 {
    pub(crate) fn from_core(h: &Hit8) -> Self {
        Self {
            t: h.t.to_array(),
            triangle: h.triangle.to_array(),
            u: h.u.to_array(),
            v: h.v.to_array(),
            instance: h.instance.map(U32x8::to_array),
        }
    }

    /// No hits of these rays.
    fn none(rays: &Ray8) -> Self {
        let (none, zero) = ([NONE; 8], [0.0; 8]);
        Self { t: rays.tmax.to_array(), triangle: none, u: zero, v: zero, instance: [none; 2] }
    }
}

/// An intersector of a host, or the scene's own tree where it has none.
struct Hosted<'s> {
    tree: WideBvh<'s>,
    host: croupier_parts,
    triangles: u32,
    instances: u32,
}

impl<'s> Hosted<'s> {
    fn new(scene: Scene<'s>, host: &croupier_parts) -> Self {
        let (triangles, instances) = (scene.triangles.len() as u32, scene.instances.len() as u32);
        Self { tree: WideBvh::new(&scene), host: *host, triangles, instances }
    }

    /// Lanes that a callback is asked for.
    fn asked(rays: &Ray8, active: Mask8) -> Mask8 {
        let moves = rays.d.abs().max_component().gt(F32x8::ZERO);
        active & rays.o.is_finite() & rays.d.is_finite() & moves
    }

    /// The hits of the lanes of `hit` that can be.
    fn sound(&self, rays: &Ray8, hit: Mask8, h: &croupier_hits8) -> Hit8 {
        let (t, triangle) = (F32x8::new(h.t), U32x8::new(h.triangle));
        let (u, v) = (F32x8::new(h.u), F32x8::new(h.v));
        let instance = h.instance.map(U32x8::new);
        let own = triangle.lt(U32x8::splat(NONE)).and_not(triangle.lt(U32x8::splat(FIRST_OWN_SURFACE)));
        let own = if self.host.surface.is_some() { own } else { Mask8::NONE };
        let placed = |i: U32x8| i.eq(U32x8::splat(NONE)) | i.lt(U32x8::splat(self.instances));
        let weights = u.is_finite() & v.is_finite();
        let listed = triangle.lt(U32x8::splat(self.triangles)) & weights & placed(instance[0]) & placed(instance[1]);
        let within = t.gt(rays.tmin) & t.lt(rays.tmax) & t.is_finite();
        let hit = hit & within & (listed | own);
        let none = U32x8::splat(NONE);
        Hit8 {
            hit,
            t: hit.select(t, rays.tmax),
            triangle: U32x8::select(hit, triangle, none),
            u: hit.zero_unless(u),
            v: hit.zero_unless(v),
            instance: instance.map(|i| U32x8::select(hit, i, none)),
        }
    }
}

impl Intersector for Hosted<'_> {
    const SURFACES: bool = true;

    fn closest(&self, rays: &Ray8, active: Mask8) -> Hit8 {
        let Some(closest) = self.host.closest else { return self.tree.closest(rays, active) };
        let asked = Self::asked(rays, active);
        let (of, mut hits) = (Aligned(croupier_rays8::from_core(rays)), Aligned(croupier_hits8::none(rays)));
        let mut found = Mask8::NONE;
        if asked.any() {
            // SAFETY: the host's function, with what its type says.
            found =
                Mask8::from_bits(unsafe { closest(self.host.user, &raw const of.0, asked.bits(), &raw mut hits.0) });
        }
        self.sound(rays, found & asked, &hits.0)
    }

    fn occluded(&self, rays: &Ray8, active: Mask8) -> Mask8 {
        let Some(occluded) = self.host.occluded else { return self.tree.occluded(rays, active) };
        let asked = Self::asked(rays, active);
        if asked.none() {
            return asked;
        }
        let of = Aligned(croupier_rays8::from_core(rays));
        // SAFETY: the host's function, with what its type says.
        Mask8::from_bits(unsafe { occluded(self.host.user, &raw const of.0, asked.bits()) }) & asked
    }

    fn surface(&self, rays: &Ray8, hit: &Hit8, own: Mask8) -> OwnSurface8 {
        let zero = [[0.0; 8]; 3];
        let mut s = Aligned(croupier_surfaces8 {
            point: zero,
            normal: zero,
            error: [0.0; 8],
            shading_normal: zero,
            uv: [[0.0; 8]; 2],
            tangent: zero,
            material: [NONE; 8],
            object: [NONE; 8],
        });
        if let Some(surface) = self.host.surface {
            let (of, hits) = (Aligned(croupier_rays8::from_core(rays)), Aligned(croupier_hits8::from_core(hit)));
            // SAFETY: the host's function, with what its type says.
            unsafe { surface(self.host.user, &raw const of.0, &raw const hits.0, own.bits(), &raw mut s.0) };
        }
        let s = &s.0;
        OwnSurface8 {
            ns: vector(s.shading_normal),
            uv: s.uv.map(F32x8::new),
            tangent: vector(s.tangent),
            object: U32x8::new(s.object),
            ..OwnSurface8::new(vector(s.point), vector(s.normal), F32x8::new(s.error), U32x8::new(s.material))
        }
    }
}

fn samples8(s: &PixelSamples8) -> Aligned<croupier_samples8> {
    let [width, height] = s.size;
    Aligned(croupier_samples8 {
        width,
        height,
        column: s.column.to_array(),
        row: s.row.to_array(),
        position: s.position.map(F32x8::to_array),
        u: s.u.map(F32x8::to_array),
    })
}

impl Extension for HostRays {
    type Bsdf = NoBsdf;
    const RAYS: bool = true;

    fn rays(&self, _: &Scene<'_>, samples: &PixelSamples8) -> SourceRays8 {
        let zero = [[0.0; 8]; 3];
        let one = [[1.0; 8]; 3];
        let mut r = Aligned(croupier_source_rays8 { origin: zero, direction: zero, weight: one });
        let mut active = 0;
        if let Some(rays) = self.0.rays {
            let of = samples8(samples);
            // SAFETY: the host's function, with what its type says.
            active = unsafe { rays(self.0.user, &raw const of.0, samples.active.bits(), &raw mut r.0) };
        }
        let [origin, direction, weight] = [r.0.origin, r.0.direction, r.0.weight].map(vector);
        let finite = origin.is_finite() & direction.is_finite() & weight.is_finite();
        let moves = direction.abs().max_component().gt(F32x8::ZERO);
        let active = samples.active & Mask8::from_bits(active) & finite & moves;
        // what a lane without a ray holds must not be a NaN
        let up = Vec3x8::splat(0.0, 0.0, 1.0);
        let direction = Vec3x8::select(active, direction, up);
        SourceRays8 { origin: origin.zero_unless(active), direction, weight: weight.zero_unless(active), active }
    }
}

impl Extension for HostPoints {
    type Bsdf = NoBsdf;
    const POINTS: bool = true;

    fn points(&self, _: &Scene<'_>, samples: &PixelSamples8) -> SourcePoints8 {
        let (none, zero) = ([NONE; 8], [0.0; 8]);
        let scale = [[1.0; 8]; 3];
        let mut p = Aligned(croupier_source_points8 { triangle: none, instance: [none; 2], u: zero, v: zero, scale });
        let mut active = 0;
        if let Some(points) = self.0.points {
            let of = samples8(samples);
            // SAFETY: the host's function, with what its type says.
            active = unsafe { points(self.0.user, &raw const of.0, samples.active.bits(), &raw mut p.0) };
        }
        let p = &p.0;
        SourcePoints8 {
            triangle: U32x8::new(p.triangle),
            instance: p.instance.map(U32x8::new),
            weights: [F32x8::new(p.u), F32x8::new(p.v)],
            scale: vector(p.scale),
            active: samples.active & Mask8::from_bits(active),
        }
    }
}

/// Hits of the scene's own tree.
pub(crate) fn closest(scene: &Scene<'_>, rays: &croupier_rays8, active: u32) -> (croupier_hits8, u32) {
    let hits = WideBvh::new(scene).closest(&rays.to_core(), Mask8::from_bits(active));
    (croupier_hits8::from_core(&hits), hits.hit.bits())
}

/// Lanes that hit anything of the scene's own tree.
pub(crate) fn occluded(scene: &Scene<'_>, rays: &croupier_rays8, active: u32) -> u32 {
    WideBvh::new(scene).occluded(&rays.to_core(), Mask8::from_bits(active)).bits()
}

const _: () = assert!(CROUPIER_OWN_SURFACE == FIRST_OWN_SURFACE);
