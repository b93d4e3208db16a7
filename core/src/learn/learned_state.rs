//! The session's side of learning: all learned statistics, frozen while an iteration runs.

use super::adaptive::{AllocationScalars, SampleAllocation};
use super::cache::{BINS, Cache, CacheScalars, NO_BIN, Training, VertexKind8};
use super::estimate::{EstimateScalars, PixelEstimates};
use super::guiding::{COMPILED, ENOUGH, Guide, GuideLog, GuideScalars, GuideUse, LEARNED, Promise, TrialShares, Watch};
use super::needs::Needs;
use super::picture::{Picture, PictureStatistics, error_of, outliers};
use super::settings::{Guiding, Learning, Objective};
use crate::cost::COST_BOUNCE;
use crate::counters::Counters;
use crate::film::{Film, PixelSums, TrimmedSums};
use crate::memory::{Carver, Measure, MemoryError};
use crate::rrs::{Learned8, Local8, Space};
use crate::tiles::BlockGrid;
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Bins of path lengths per block of pixels, for statistics over the picture: a block takes the bins of one leaf.
const DEPTHS: u32 = BINS as u32;

/// Learned statistics of a render: of the scene or the picture, of every pixel, of the picture as a whole.
#[derive(Debug)]
pub struct LearnedState<'m> {
    learning: Learning,
    size: [u32; 2],
    cache: Option<Cache<'m>>,
    guide: Option<Guide<'m>>,
    /// Whether guiding pays, if the settings leave that open.
    watch: Watch,
    /// Follows from `size`; every camera sample reads it.
    trial: TrialShares,
    /// Side of the pixel blocks of statistics over the picture.
    block: u32,
    pixels: PixelEstimates<'m>,
    allocation: SampleAllocation<'m>,
    picture: Picture,
    /// Some setting needs the statistics of the picture.
    needed: bool,
}

/// All of the learned state but what has a size.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct LearnedScalars {
    picture: Picture,
    cache: CacheScalars,
    guide: GuideScalars,
    watch: Watch,
    estimate: EstimateScalars,
    allocation: AllocationScalars,
}

impl LearnedScalars {
    /// Those of a render that has learned nothing, in a scene of these bounds.
    pub(crate) fn new(bounds: [[f32; 3]; 2]) -> Self {
        Self {
            picture: Picture::default(),
            cache: CacheScalars::new(bounds),
            guide: GuideScalars::new(bounds),
            watch: Watch::default(),
            estimate: EstimateScalars::default(),
            allocation: AllocationScalars::new(),
        }
    }

    /// Do these belong to a render with such needs?
    pub(crate) fn fit(&self, needs: &Needs) -> bool {
        needs.cache.is_none_or(|size| self.cache.fit(size)) && needs.guide.is_none_or(|size| self.guide.fit(size))
    }
}

impl<'m> LearnedState<'m> {
    pub(crate) fn measure(m: Measure, needs: &Needs) -> Measure {
        let m = needs.cache.map_or(m, |size| Cache::measure(m, size));
        let m = needs.guide.map_or(m, |size| Guide::measure(m, size));
        let m = PixelEstimates::measure(m, needs.size, needs.pixels);
        SampleAllocation::measure(m, needs.size, needs.adaptive)
    }

    /// Carves without touching what memory holds: [`Self::forget`] makes it empty, or it is that of the scalars.
    pub(crate) fn carve(c: &mut Carver<'m>, needs: &Needs, scalars: &LearnedScalars) -> Result<Self, MemoryError> {
        let n = *needs;
        let objective = n.learning.objective;
        let mut cache = n.cache.map(|size| Cache::carve(c, size, objective, &scalars.cache)).transpose()?;
        let mut block = 1;
        if let Some(cache) = cache.as_mut().filter(|_| n.space == Some(Space::Image)) {
            let blocks = |side: u32| BlockGrid::new(n.size, side).count();
            while blocks(block) > cache.size().leaves() as usize {
                block += 1;
            }
            cache.flatten(blocks(block) as u32);
        }
        Ok(Self {
            learning: n.learning,
            size: n.size,
            cache,
            guide: n.guide.filter(|_| COMPILED).map(|size| Guide::carve(c, size, &scalars.guide)).transpose()?,
            watch: scalars.watch,
            trial: TrialShares::of(n.size),
            block,
            pixels: PixelEstimates::carve(c, n.size, n.pixels, &n.learning, scalars.estimate)?,
            allocation: SampleAllocation::carve(c, n.size, n.adaptive, scalars.allocation)?,
            picture: scalars.picture,
            needed: n.pixels.is_some(),
        })
    }

    /// Forgets the picture, but nothing learned.
    pub(crate) fn forget_film(&mut self) {
        self.allocation.begin_densities();
    }

    /// Forgets everything learned.
    pub(crate) fn forget(&mut self) {
        if let Some(cache) = &mut self.cache {
            cache.forget();
        }
        if let Some(guide) = self.guide_mut() {
            guide.reset();
        }
        self.watch = Watch::default();
        self.pixels.clear();
        self.picture = Picture::default();
        self.allocation.begin_densities();
    }

    /// The scalars, `fresh` those of a render that has learned nothing.
    pub(crate) fn scalars(&self, fresh: LearnedScalars) -> LearnedScalars {
        LearnedScalars {
            picture: self.picture,
            cache: self.cache.as_ref().map_or(fresh.cache, Cache::scalars),
            guide: self.guide().map_or(fresh.guide, Guide::scalars),
            watch: self.watch,
            estimate: self.pixels.scalars(),
            allocation: self.allocation.scalars(),
        }
    }

    /// Cache of statistics over the scene. Statistics over the picture have no tree and cannot be saved.
    pub(crate) fn cache(&self) -> Option<&Cache<'m>> {
        self.cache.as_ref().filter(|c| !c.is_flat())
    }

    pub(crate) fn cache_mut(&mut self) -> Option<&mut Cache<'m>> {
        self.of_scene_mut().0
    }

    /// Distributions of path guiding, if it is on.
    #[inline(always)]
    pub(crate) fn guide(&self) -> Option<&Guide<'m>> {
        self.guide.as_ref().filter(|_| COMPILED)
    }

    pub(crate) fn guide_mut(&mut self) -> Option<&mut Guide<'m>> {
        self.of_scene_mut().1
    }

    /// Cache and guide, to be changed.
    pub(crate) fn of_scene_mut(&mut self) -> (Option<&mut Cache<'m>>, Option<&mut Guide<'m>>) {
        let cache = self.cache.as_mut().filter(|c| !c.is_flat());
        (cache, self.guide.as_mut().filter(|_| COMPILED))
    }

    /// Does shard `index` of `shards` guide paths, or learn to, in the next iteration or the one that runs?
    #[inline(always)]
    pub(crate) fn trains(&self, shard: [u32; 2]) -> bool {
        self.guide().is_some() && (!self.watches() || self.watch.trains(shard))
    }

    /// Statistics were loaded: whether guiding pays is open again.
    pub(crate) fn forget_gain(&mut self) {
        self.watch = Watch::default();
    }

    /// Is the guide watched, whether it pays?
    #[inline(always)]
    pub(crate) fn watches(&self) -> bool {
        COMPILED && self.learning.guiding == Guiding::Auto
    }

    /// Are the samples of all pixels guided, where the guide asks for it?
    #[inline(always)]
    pub(crate) fn guides(&self) -> bool {
        !self.watches() || self.watch.enabled()
    }

    /// Does the guide learn from all samples with a record, guided or not?
    #[inline(always)]
    pub(crate) fn all_teach(&self) -> bool {
        self.watches() && self.watch.all_teach(self.trial)
    }

    /// Are samples of the pixel in column and row `at` guided in iteration `iteration`?
    #[inline(always)]
    pub(crate) fn is_guided(&self, iteration: u64, at: [u32; 2]) -> bool {
        !self.watches() || self.watch.is_guided(iteration, at, self.trial)
    }

    /// Part of the samples that the guide learns from that are guided, in an iteration of so many samples per pixel.
    #[inline(always)]
    pub(crate) fn guided_part(&self, samples: u32) -> f32 {
        if !self.watches() {
            return 1.0;
        }
        self.watch.guided_part(self.trial, [true, false].map(|guided| self.learned_samples(guided).min(samples)))
    }

    /// How many samples of a pixel are learned from in an iteration.
    #[inline(always)]
    pub(crate) fn learned_samples(&self, guided: bool) -> u32 {
        // without a cache nothing but the guide learns
        let asked = if self.cache.is_some() || !self.watches() { self.learning.samples } else { 0 };
        if self.guide().is_some() && guided { asked.max(LEARNED) } else { asked }
    }

    /// Whether guiding pays, if the settings leave that open.
    pub(crate) fn guide_use(&self) -> Option<GuideUse> {
        self.watches().then(|| GuideUse { enabled: self.watch.enabled(), gain: self.watch.gain() })
    }

    /// Is the guide to be trained by light paths: is there one that has learned nothing?
    pub(crate) fn wants_light_paths(&self) -> bool {
        self.guide().is_some_and(Guide::is_new)
    }

    /// Begins to learn from the logs of path guiding; `false` if it is off.
    pub(crate) fn begin_guide(&mut self) -> bool {
        let keep = self.learning.decay;
        self.guide_mut().map(|g| g.begin_learning(keep)).is_some()
    }

    /// Adds what a shard has found of what guiding promises.
    pub(crate) fn add_promise(&mut self, promise: &Promise) {
        self.watch.add(promise);
    }

    /// Are the shards' logs to be replayed next?
    pub(crate) fn guide_wants_logs(&self) -> bool {
        self.guide().is_some_and(Guide::wants_logs)
    }

    /// Are the logs replayed for the first time?
    pub(crate) fn is_first_replay(&self) -> bool {
        self.guide().is_some_and(Guide::is_first_replay)
    }

    /// Replays a log of an iteration of `samples` samples per pixel from entry `at` on, `limit` at most; their number, and
    /// `true` after the last.
    pub(crate) fn replay(&mut self, log: &GuideLog<'_>, at: usize, limit: usize, samples: u32) -> (usize, bool) {
        let guided = self.guided_part(samples);
        self.guide_mut().map_or((0, true), |g| g.replay(log, at, limit, guided))
    }

    /// All logs were replayed.
    pub(crate) fn end_replay(&mut self) {
        if let Some(g) = self.guide_mut() {
            g.end_replay();
        }
    }

    /// Goes on to learn where no logs are wanted; work done, in units of about a ray, and `true` after the last.
    /// `independence` as of [`Watch::decide`].
    pub(crate) fn learn_guide(&mut self, independence: Option<f64>) -> (u64, bool) {
        let Some(guide) = self.guide_mut() else { return (0, true) };
        let (work, done) = guide.learn_some();
        if done && self.watches() {
            let enough = self.guide().is_some_and(|g| g.has_learned_from(ENOUGH));
            self.watch.decide(self.learning.decay.into(), enough, independence);
        }
        (work, done)
    }

    /// Bins that shards may log to in this iteration.
    pub(crate) fn used_bins(&self) -> u32 {
        self.cache.as_ref().map_or(0, Cache::bins)
    }

    /// Bins of eight vertices; see [`Cache::find_jittered`].
    #[inline]
    pub(crate) fn scene_bins(
        &self,
        kind: VertexKind8,
        p: Vec3x8,
        dir: Vec3x8,
        jitter: [F32x8; 3],
        active: Mask8,
    ) -> U32x8 {
        match &self.cache {
            Some(c) => c.find_jittered(kind, p, dir, jitter, active),
            None => U32x8::splat(NO_BIN),
        }
    }

    /// Bin of path length `depth` under a pixel.
    pub(crate) fn image_bin(&self, film: u32, depth: u32) -> u32 {
        BlockGrid::new(self.size, self.block).of_pixel(film) * DEPTHS + depth.clamp(1, DEPTHS) - 1
    }

    /// Begins an iteration of `samples` camera samples per pixel in the mean.
    pub(crate) fn begin(&mut self, samples: u32) {
        self.allocation.allocate(samples);
    }

    /// Camera samples of each pixel of a tile in this iteration.
    pub(crate) fn samples_of_tile(&self, tile: u32) -> u32 {
        self.allocation.of_tile(tile)
    }

    /// Weight of a squared error of one sample of a pixel, per channel: less if the pixel has more samples. And the
    /// pixel's samples over those of the mean pixel.
    #[inline]
    pub(crate) fn error_weight(&self, film: u32) -> ([f32; 3], f32) {
        let share = self.allocation.share(film) as f32;
        (self.pixels.error_weight(film).map(|x| x / (share * share)), share)
    }

    /// Estimate of a pixel, rgb; 0 while unknown.
    #[inline]
    pub(crate) fn expected(&self, film: u32) -> [f32; 3] {
        self.pixels.value(film)
    }

    /// Bins of other directions; see [`Cache::bins_towards`].
    #[inline]
    pub(crate) fn bins_towards(&self, bin: U32x8, dir: Vec3x8, active: Mask8) -> U32x8 {
        match &self.cache {
            Some(c) => c.bins_towards(bin, dir, active),
            None => U32x8::splat(NO_BIN),
        }
    }

    /// Roots of visibilities; see [`Cache::visibility_root`].
    #[inline]
    pub(crate) fn visibility_root(&self, bin: U32x8) -> F32x8 {
        self.cache.as_ref().map_or(F32x8::ONE, |c| c.visibility_root(bin))
    }

    /// Mean cost of a camera sample over its mean weighted squared error; 0 while unknown.
    pub(crate) fn cost_over_variance(&self) -> f32 {
        self.picture.cost_over_variance()
    }

    /// Weighted squared error beyond which a sample is an outlier to the statistics; infinite while unknown.
    #[inline]
    pub(crate) fn outlier(&self) -> f32 {
        let limit = self.picture.blended.limit;
        if limit > 0.0 { limit as f32 } else { f32::INFINITY }
    }

    /// Statistics of the picture, for vertices of pixels with this error weight.
    #[inline]
    pub(crate) fn image8(&self, error_weight: Vec3x8) -> Learned8 {
        Learned8 {
            error_weight,
            norm: self.learning.norm,
            cost_over_variance: F32x8::splat(self.cost_over_variance()),
            ..Learned8::NONE
        }
    }

    /// Adds the statistics of eight bins, their values times `unscale`.
    #[inline]
    pub(crate) fn local8(&self, learned: &mut Learned8, bin: U32x8, unscale: Vec3x8, active: Mask8) {
        let Some(cache) = &self.cache else { return };
        let l = cache.local(bin, active);
        let square = unscale * unscale;
        learned.local = Local8 {
            mean: l.mean * unscale,
            moment: l.moment * square,
            variance: l.variance * square,
            cost: l.cost.max(F32x8::splat(COST_BOUNCE)),
            ..l
        };
    }

    /// Variance and cost per camera sample: of the last iteration, and as factors use them.
    pub(crate) fn statistics(&self) -> [PictureStatistics; 2] {
        [self.picture.last, self.picture.blended]
    }

    /// Are the error weights of the pixels known?
    pub(crate) fn weighs_pixels(&self) -> bool {
        self.pixels.known() || self.learning.objective == Objective::Absolute
    }

    /// Estimates of the pixels as rgb planes, if there is one per pixel.
    pub(crate) fn estimate(&self) -> Option<[&[f32]; 3]> {
        self.pixels.planes()
    }

    /// Replaces the built-in estimate of the pixels by the host's from now on; `false` if it does not fit. The densities
    /// of the next iteration's samples follow.
    pub(crate) fn give_estimate(&mut self, rgb: &[[f32; 3]], film: &Film<'_>) -> bool {
        if !self.pixels.give(rgb) {
            return false;
        }
        self.allocation.begin_densities();
        while !self.density_of_next(film) {}
        true
    }

    /// Is the picture to be measured against the estimate made before the iteration (`first` is false), or is it the
    /// first, which is measured against its own?
    pub(crate) fn measures(&self, first: bool) -> bool {
        self.needed && if first { !self.picture.known() } else { self.pixels.known() }
    }

    /// Sums of the errors of a picture of so many pixels, before any is shown.
    pub(crate) fn begin_errors(pixels: usize) -> TrimmedSums {
        TrimmedSums::new(outliers(pixels as u64))
    }

    /// Words that the sums of [`Self::begin_errors`] need.
    pub(crate) fn largest_len(pixels: usize) -> usize {
        TrimmedSums::heap_len(outliers(pixels as u64))
    }

    /// Shows the error of an iteration's pixel.
    pub(crate) fn show_error(&self, film: usize, sums: &PixelSums, s: &mut TrimmedSums, largest: &mut [u32]) {
        if sums.samples > 0 {
            let error = error_of(film as u32, sums, self.learning.norm, &self.pixels, &self.allocation);
            s.show([error, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], largest);
        }
    }

    /// Takes variance and cost of the iteration from the sums that have seen all of its pixels, in pieces as of
    /// [`TrimmedSums::end`]: of an iteration that was stopped early few pixels are left out, and nearly all that wait in
    /// the heap are taken out. Work, and whether it is done.
    pub(crate) fn picture_measured(
        &mut self,
        s: &mut TrimmedSums,
        largest: &mut [u32],
        counters: &Counters,
        limit: u64,
    ) -> (u64, bool) {
        let (work, done) = s.end(outliers(s.shown()), limit, largest);
        if done {
            self.picture.measured(&self.learning, s, counters);
        }
        (work, done)
    }

    /// Weight of each sample of a pixel: less where adaptive sampling took more, so that an iteration has the same
    /// weight in all pixels.
    ///
    /// All iterations have the same weight per sample, because other weights bias pictures. EARS merges iterations by
    /// inverse variance, but bright iterations are the noisy ones: pictures of 16 pixels with caustics came out 0.9 %
    /// too dark, and with weights by the variance or the work of earlier iterations up to 2 % too bright. As the
    /// lengths of iterations double, the first ones, which have learned least, cost little. A quarter of the weight for
    /// the very first made the next pictures worse and no later one better.
    #[inline]
    pub(crate) fn weight_of(&self, film: usize) -> f64 {
        1.0 / self.allocation.share(film as u32)
    }

    /// Begins a new estimate of the pixels from the film.
    pub(crate) fn begin_refresh(&mut self) {
        if self.needed {
            self.pixels.begin_refresh();
        }
        self.allocation.begin_densities();
    }

    /// Estimates pixels from the film, a row of one pass; `true` after the last.
    pub(crate) fn refresh_row(&mut self, film: &Film<'_>) -> bool {
        !self.needed || self.pixels.refresh_row(film)
    }

    /// Rows of the film that the next row of [`Self::refresh_row`] loads before its own.
    pub(crate) fn rows_to_load(&self) -> u32 {
        if self.needed { self.pixels.rows_to_load() } else { 0 }
    }

    /// Computes the density of the next iteration's samples in one tile; `true` after the last.
    pub(crate) fn density_of_next(&mut self, film: &Film<'_>) -> bool {
        self.allocation.density_of_next(film, &self.pixels)
    }

    /// Discounts statistics of the scene from bin `at` on, `limit` at most; their number, and `true` after the last.
    pub(crate) fn discount(&mut self, at: usize, limit: usize) -> (usize, bool) {
        // the variance in a bin is that of the guide that was: factors must not lag behind
        let guided = self.guide().is_some() && self.guides();
        let again = if guided { self.learning.decay } else { 1.0 };
        let keep = f64::from(self.learning.decay) * f64::from(again);
        self.cache.as_mut().map_or((0, true), |c| c.discount(keep, at, limit))
    }

    /// Adds what a shard learned, from bin `at` on, `limit` at most; their number, and `true` after the last.
    pub(crate) fn absorb(&mut self, t: &Training<'_>, at: usize, limit: usize) -> (usize, bool) {
        self.cache.as_mut().map_or((0, true), |c| c.absorb_some(t, at, limit))
    }

    /// Begins to compute what look-ups read.
    pub(crate) fn begin_freeze(&mut self) {
        if let Some(c) = &mut self.cache {
            c.begin_freeze();
        }
    }

    /// Computes what look-ups read; work done, in units of about a ray, and `true` after the last.
    pub(crate) fn freeze_some(&mut self) -> (u64, bool) {
        let count = f64::from(self.learning.subdivide_count);
        self.cache.as_mut().map_or((0, true), |c| c.freeze_some(count))
    }
}
