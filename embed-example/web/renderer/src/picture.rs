//! A picture of a scene: a session and its only shard, in the page's memory.

use crate::Refused;
use crate::scene::OpenScene;
use croupier::unstable::Effects;
use croupier::unstable::film::Aov;
use croupier::unstable::profile::Custom;
use croupier::{Budget, Plan, Session, SessionBuilder, SessionState, Settings, Shard, StepResult};

/// Effects of the kernels that are compiled in; other scenes are refused.
pub(crate) type Kernels = Custom<{ SURFACES.with(LIGHTS).0 }>;
const SURFACES: Effects = Effects::DIFFUSE
    .with(Effects::CONDUCTOR)
    .with(Effects::DIELECTRIC)
    .with(Effects::ROUGH_CONDUCTOR)
    .with(Effects::ROUGH_PLASTIC)
    .with(Effects::SMOOTH_NORMALS)
    .with(Effects::TEXTURES)
    .with(Effects::MULTIPLE_SCATTERING);
const LIGHTS: Effects =
    Effects::AREA_LIGHTS.with(Effects::ENVIRONMENT).with(Effects::CONSTANT).with(Effects::DELTA_LIGHTS);

/// Number of [`Picture::numbers`].
pub(crate) const NUMBERS: usize = 12;

/// Sizes of a picture with these settings: `name=value` pairs with spaces between.
pub(crate) fn plan(scene: &OpenScene, settings: &[u8]) -> Result<Plan, Refused> {
    let text = str::from_utf8(settings).map_err(|_| Refused::Setting)?;
    let mut settings = Settings::for_scene(&scene.scene());
    for pair in text.split_ascii_whitespace() {
        let (name, value) = pair.split_once('=').ok_or(Refused::Setting)?;
        settings.set(name, value).map_err(|_| Refused::Setting)?;
    }
    Plan::new(&settings).map_err(|_| Refused::Settings)
}

/// Kernels of [`Kernels`], the scene's own tree, lights by power.
fn builder(scene: &OpenScene) -> SessionBuilder<'_, Kernels> {
    Session::builder(scene.scene()).profile::<Kernels>()
}

/// What a picture shows.
#[derive(Clone, Copy)]
pub(crate) enum Plane {
    /// Mean radiance, that of the iteration under way included: a preview while it runs.
    Picture,
    /// The denoised estimate of the pixels that learned roulette works with.
    Estimate,
    /// Mean factor of roulette at vertices of a depth: 0 is the first, 3 the fourth and all behind it.
    Factor(usize),
}

impl Plane {
    /// 0 is the picture, 1 the estimate, 2 to 5 the factors.
    pub(crate) fn from_number(x: u32) -> Option<Self> {
        match x {
            0 => Some(Self::Picture),
            1 => Some(Self::Estimate),
            2..6 => Some(Self::Factor(x as usize - 2)),
            _ => None,
        }
    }
}

/// See the head of this file.
pub struct Picture<'m> {
    state: SessionState<'m>,
    shard: Shard<'m>,
    /// An iteration has begun, and its end has not.
    running: bool,
}

impl<'m> Picture<'m> {
    /// Carves both blocks.
    pub(crate) fn new(
        scene: &OpenScene,
        plan: &Plan,
        session: &'m mut [u8],
        shard: &'m mut [u8],
    ) -> Result<Self, Refused> {
        let state = builder(scene).build(plan, session).map_err(|_| Refused::Session)?.into_state();
        let shard = Shard::new(plan, 0, shard).map_err(|_| Refused::Session)?;
        Ok(Self { state, shard, running: false })
    }

    /// See [`crate::picture_restart`].
    pub(crate) fn restart(&mut self, scene: &OpenScene) -> Result<(), Refused> {
        self.running = false;
        self.state.change_scene(&builder(scene), true).map_err(|_| Refused::Session)
    }

    /// See [`crate::picture_begin`].
    pub(crate) fn begin(&mut self, samples: u32) {
        self.running = true;
        self.state.begin_iteration(samples);
    }

    /// `true` at the end of the iteration.
    pub(crate) fn step(&mut self, scene: &OpenScene, rays: u32) -> bool {
        let budget = Budget { rays: rays.into() };
        // the kernels were enough for the scene when it was opened
        builder(scene).view(&self.state).map_or(true, |view| self.shard.step(&view, budget) == StepResult::Done)
    }

    /// `true` when the next iteration can begin.
    pub(crate) fn finish(&mut self, rays: u32) -> bool {
        self.running = false;
        // an error is an iteration that has not begun or not ended: nothing to finish
        self.state.finish_iteration([&self.shard], Budget { rays: rays.into() }) != Ok(StepResult::More)
    }

    /// See [`crate::picture_show`].
    pub(crate) fn show(&self, scene: &OpenScene, plane: Plane, out: &mut [[f32; 4]]) -> bool {
        let film = self.state.film();
        match plane {
            Plane::Picture => {
                for (to, pixel) in out.iter_mut().zip(film.pixels()) {
                    let [r, g, b] = pixel.mean().map(|x| x as f32);
                    *to = [r, g, b, pixel.samples as f32];
                }
                if self.running {
                    self.show_running(scene, out);
                }
                true
            }
            Plane::Estimate => {
                let Some([r, g, b]) = self.state.estimate() else { return false };
                for (((to, r), g), b) in out.iter_mut().zip(r).zip(g).zip(b) {
                    *to = [*r, *g, *b, 1.0];
                }
                true
            }
            Plane::Factor(depth) => {
                let planes = [depth, depth + 4].map(|channel| film.plane(Aov::Factors, channel));
                let [Some(sums), Some(numbers)] = planes else { return false };
                for ((to, sum), number) in out.iter_mut().zip(sums).zip(numbers) {
                    let factor = if *number > 0.0 { sum / number } else { 0.0 };
                    *to = [factor, 0.0, 0.0, *number];
                }
                true
            }
        }
    }

    /// Adds the samples of the iteration under way.
    fn show_running(&self, scene: &OpenScene, out: &mut [[f32; 4]]) {
        if !builder(scene).view(&self.state).is_ok_and(|view| self.shard.has_joined(&view)) {
            return;
        }
        self.shard.for_each_pixel(|index, mean, samples| {
            if let Some(to) = out.get_mut(index) {
                let [r, g, b] = mean.map(|x| x as f32);
                crate::color::average(core::slice::from_mut(to), &[[r, g, b, samples as f32]]);
            }
        });
    }

    /// Estimated relMSE and the ends of its 95 % interval, 0 and infinity where the samples do not tell it; the same
    /// over all pixels, outliers included; finished iterations; camera samples per pixel in them; rays, counted cost,
    /// splits, paths terminated; columns, rows.
    pub(crate) fn numbers(&self) -> [f64; NUMBERS] {
        let (film, counters) = (self.state.film(), self.state.counters());
        let (error, [width, height]) = (film.error_estimate(), film.size().map(f64::from));
        let (resolved, of) = (error.is_resolved(), |n: u64| n as f64);
        [
            error.rel_mse,
            if resolved { error.low } else { 0.0 },
            if resolved { error.high } else { f64::INFINITY },
            error.rel_mse_all,
            of(self.state.iteration().number),
            of(counters.camera_samples) / (width * height).max(1.0),
            of(counters.rays()),
            counters.cost(),
            of(counters.splits),
            of(counters.paths_terminated),
            width,
            height,
        ]
    }
}
