//! The session's side of learning.

use super::cache::{Cache, CacheSize, Training};
use super::settings::{Learning, Objective};
use super::{COST_BOUNCE, COST_CAMERA, COST_SHADOW};
use crate::denoise::{self, Noisy};
use crate::film::{Film, PixelSums, REL_MSE_EPSILON, SqrtNewton, kth_largest};
use crate::memory::{Carver, Measure, MemoryError};
use crate::rrs::{Learned8, Norm};
use crate::scene::Scene;
use crate::settings::Settings;
use crate::tiles::TILE;
use crate::tracer::Counters;
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Bins of path lengths per block of pixels, for statistics over the picture.
const DEPTHS: u32 = 16;

/// Share of the pixels whose variance is left out of the picture's: a single outlier would decide all factors (EARS
/// section 5.2: 0.001 %).
const OUTLIERS: f64 = 1e-5;

/// Iterations count at most this much more than their work says.
const LARGEST_GAIN: f64 = 10.0;

/// Fewest and most samples of a pixel over the mean.
const LEAST_SHARE: f64 = 0.25;
const MOST_SHARE: f64 = 8.0;

/// How the estimate of the pixels is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimate {
    /// By the built-in denoiser; takes 80 bytes a pixel.
    #[default]
    Denoised,
    /// Means over squares of 8x8 pixels: 12 bytes for 64 pixels.
    Blocks,
}

/// What is known of the picture's error and cost per camera sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PictureStatistics {
    /// Mean error over the pixels (eq. 34) without the outliers.
    pub variance: f64,
    /// The outliers' part of it, kept apart.
    pub outliers: f64,
    /// Mean counted cost (eq. 33).
    pub cost: f64,
}

/// Everything learned, frozen while an iteration runs.
#[derive(Debug)]
pub(crate) struct Knowledge<'m> {
    learning: Learning,
    size: [u32; 2],
    cache: Option<Cache<'m>>,
    /// Side of the pixel blocks of statistics over the picture.
    block: u32,
    /// Estimates of pixels or blocks, rgb planes; empty if nothing needs the picture.
    estimate: [&'m mut [f32]; 3],
    /// Colour, variance, albedo and normal planes of the denoiser's input.
    planes: [&'m mut [f32]; 12],
    scratch: &'m mut [f32],
    /// Camera samples per pixel of each tile in this iteration; empty without adaptive sampling.
    counts: &'m mut [u32],
    /// Mean of `counts` over the pixels that was asked for.
    samples: u32,
    /// The picture per camera sample: of the last iteration, and blended over the iterations.
    last: PictureStatistics,
    blended: PictureStatistics,
    /// What `blended` weighs.
    weight: f64,
    /// Cost and variance of the first iteration.
    first: [f64; 2],
    /// An estimate of the pixels exists.
    estimated: bool,
    /// The host provides the estimate.
    given: bool,
    needed: bool,
}

/// Does anything need the statistics of the picture?
fn needs_image(s: &Settings) -> bool {
    s.strategy.needs_image() || s.shadow_roulette || s.adaptive
}

fn estimates(s: &Settings) -> usize {
    let [w, h] = s.size;
    match s.learning.estimate {
        _ if !needs_image(s) => 0,
        Estimate::Denoised => w as usize * h as usize,
        Estimate::Blocks => tiles(s),
    }
}

fn tiles(s: &Settings) -> usize {
    let [w, h] = s.size.map(|n| n.div_ceil(TILE) as usize);
    w * h
}

/// Values per denoiser plane and in its scratch.
fn planes(s: &Settings) -> [usize; 2] {
    if needs_image(s) && s.learning.estimate == Estimate::Denoised {
        [estimates(s), denoise::scratch_len(s.size)]
    } else {
        [0, 0]
    }
}

impl<'m> Knowledge<'m> {
    pub(crate) fn measure(m: Measure, s: &Settings, cache: Option<CacheSize>) -> Measure {
        let m = cache.map_or(m, |size| Cache::measure(m, size));
        let m = (0..3).fold(m, |m, _| m.add::<f32>(estimates(s)));
        let [plane, scratch] = planes(s);
        let m = (0..12).fold(m, |m, _| m.add::<f32>(plane)).add::<f32>(scratch);
        m.add::<u32>(if s.adaptive { tiles(s) } else { 0 })
    }

    pub(crate) fn carve(
        c: &mut Carver<'m>,
        s: &Settings,
        cache: Option<CacheSize>,
        scene: &Scene<'_>,
    ) -> Result<Self, MemoryError> {
        let cache = cache.map(|size| Cache::carve(c, size, scene.info.bounds_min, scene.info.bounds_max)).transpose()?;
        let leaves = cache.as_ref().map_or(1, |c| c.size().leaves());
        let mut k = Self {
            learning: s.learning,
            size: s.size,
            cache,
            block: (1..).find(|&b| s.size[0].div_ceil(b) as u64 * s.size[1].div_ceil(b) as u64 <= u64::from(leaves)).unwrap_or(1),
            estimate: core::array::from_fn(|_| Default::default()),
            planes: core::array::from_fn(|_| Default::default()),
            scratch: &mut [],
            counts: &mut [],
            samples: 1,
            last: PictureStatistics::default(),
            blended: PictureStatistics::default(),
            weight: 0.0,
            first: [0.0; 2],
            estimated: false,
            given: false,
            needed: needs_image(s),
        };
        for e in &mut k.estimate {
            *e = c.take(estimates(s))?;
        }
        let [plane, scratch] = planes(s);
        for p in &mut k.planes {
            *p = c.take(plane)?;
        }
        k.scratch = c.take(scratch)?;
        k.counts = c.take(if s.adaptive { tiles(s) } else { 0 })?;
        if s.strategy.space() == Some(crate::rrs::Space::Image) {
            let blocks = s.size[0].div_ceil(k.block) * s.size[1].div_ceil(k.block);
            if let Some(c) = &mut k.cache {
                c.flatten(blocks);
            }
        }
        Ok(k)
    }

    /// The cache of statistics over the scene. Those over the picture have no tree and cannot be saved.
    pub(crate) fn cache(&self) -> Option<&Cache<'m>> {
        self.cache.as_ref().filter(|c| !c.is_flat())
    }

    pub(crate) fn cache_mut(&mut self) -> Option<&mut Cache<'m>> {
        self.cache.as_mut().filter(|c| !c.is_flat())
    }

    /// Bins that shards may log to in this iteration.
    pub(crate) fn used_bins(&self) -> u32 {
        self.cache.as_ref().map_or(0, Cache::bins)
    }

    /// See [`Cache::find_jittered`].
    #[inline]
    pub(crate) fn scene_bins(&self, matte: Mask8, p: Vec3x8, dir: Vec3x8, jitter: [F32x8; 3], active: Mask8) -> U32x8 {
        match &self.cache {
            Some(c) => c.find_jittered(matte, p, dir, jitter, active),
            None => U32x8::splat(u32::MAX),
        }
    }

    /// The bin of path length `depth` under a pixel.
    pub(crate) fn image_bin(&self, film: u32, depth: u32) -> u32 {
        let (x, y) = (film % self.size[0] / self.block, film / self.size[0] / self.block);
        (y * self.size[0].div_ceil(self.block) + x) * DEPTHS + depth.clamp(1, DEPTHS) - 1
    }

    /// Index of a pixel's estimate.
    fn estimate_index(&self, film: u32) -> usize {
        match self.learning.estimate {
            Estimate::Denoised => film as usize,
            Estimate::Blocks => self.tile_of(film),
        }
    }

    fn tile_of(&self, film: u32) -> usize {
        let (x, y) = (film % self.size[0] / TILE, film / self.size[0] / TILE);
        (y * self.size[0].div_ceil(TILE) + x) as usize
    }

    /// Camera samples of the pixels of a tile in this iteration.
    pub(crate) fn samples_of_tile(&self, tile: u32) -> u32 {
        self.counts.get(tile as usize).copied().unwrap_or(self.samples)
    }

    /// Camera samples of a pixel in this iteration, relative to the mean.
    fn share(&self, film: u32) -> f64 {
        match self.counts.get(self.tile_of(film)) {
            Some(&n) if n > 0 => f64::from(n) / f64::from(self.samples.max(1)),
            _ => 1.0,
        }
    }

    /// Begins an iteration of `samples` camera samples per pixel in the mean: deals them out by the error of each tile
    /// that one more sample takes away per ray.
    pub(crate) fn begin(&mut self, samples: u32, film: &Film<'_>) {
        self.samples = samples;
        if self.counts.is_empty() {
            return;
        }
        self.counts.fill(samples);
        if !self.estimated || samples == 0 {
            return;
        }
        let pixels = film.pixels();
        let wish = |k: &Self, tile: usize| {
            let columns = k.size[0].div_ceil(TILE);
            let (x0, y0) = (tile as u32 % columns * TILE, tile as u32 / columns * TILE);
            let (mut error, mut rays, mut n) = (0.0, 0.0, 0.0);
            for y in y0..(y0 + TILE).min(k.size[1]) {
                for x in x0..(x0 + TILE).min(k.size[0]) {
                    let film = y * k.size[0] + x;
                    let Some(p) = pixels.get(film as usize) else { continue };
                    let importance = k.pixel_importance(film);
                    let variance = p.variance_of_mean();
                    let e = (0..3).map(|c| variance.get(c).unwrap_or(&0.0) * f64::from(*importance.get(c).unwrap_or(&0.0)));
                    error += e.sum::<f64>() * p.samples as f64;
                    rays += p.rays as f64 / p.samples.max(1) as f64;
                    n += 1.0;
                }
            }
            ((error / f64::max(rays, 1.0)).sqrt_newton(), n)
        };
        let (mut sum, mut area) = (0.0, 0.0);
        for tile in 0..self.counts.len() {
            let (w, n) = wish(self, tile);
            sum += w * n;
            area += n;
        }
        if !(sum > 0.0) {
            return;
        }
        for tile in 0..self.counts.len() {
            let share = (wish(self, tile).0 * area / sum).clamp(LEAST_SHARE, MOST_SHARE);
            if let Some(c) = self.counts.get_mut(tile) {
                *c = ((share * f64::from(samples) + 0.5) as u32).max(1);
            }
        }
    }

    /// What a squared error of a sample of a pixel counts, per channel: less if the pixel has more samples.
    #[inline]
    pub(crate) fn importance(&self, film: u32) -> [f32; 3] {
        let importance = self.pixel_importance(film);
        if self.counts.is_empty() {
            return importance;
        }
        let share = self.share(film) as f32;
        importance.map(|x| x / (share * share))
    }

    /// What a squared error of a pixel counts, per channel.
    #[inline]
    fn pixel_importance(&self, film: u32) -> [f32; 3] {
        if !self.estimated || self.learning.objective == Objective::Absolute {
            return [1.0; 3];
        }
        let i = self.estimate_index(film);
        core::array::from_fn(|c| {
            let x = self.estimate[c].get(i).copied().unwrap_or(0.0);
            1.0 / (x * x + REL_MSE_EPSILON as f32)
        })
    }

    /// Mean cost of a camera sample over its mean error; 0 while unknown.
    pub(crate) fn cost_over_variance(&self) -> f32 {
        let b = &self.blended;
        if self.weight > 0.0 && b.variance > 0.0 { (b.cost / b.variance).min(1e30) as f32 } else { 0.0 }
    }

    /// What is known of the picture, for vertices of pixels of this importance.
    #[inline]
    pub(crate) fn image8(&self, importance: Vec3x8) -> Learned8 {
        Learned8 {
            importance,
            norm: self.learning.norm,
            knobs: self.learning.knobs,
            cost_over_variance: F32x8::splat(self.cost_over_variance()),
            ..Learned8::NONE
        }
    }

    /// Adds what is known of eight bins, their values times `unscale`.
    #[inline]
    pub(crate) fn local8(&self, learned: &mut Learned8, bin: U32x8, unscale: Vec3x8, active: Mask8) {
        let Some(cache) = &self.cache else { return };
        let l = cache.local(bin, active);
        let square = unscale * unscale;
        learned.mean = l.mean * unscale;
        learned.moment = l.moment * square;
        learned.variance = l.variance * square;
        learned.cost = l.cost.max(F32x8::splat(COST_BOUNCE));
        learned.count = l.count;
    }

    /// The picture per camera sample: of the last iteration, and as factors use it.
    pub(crate) fn statistics(&self) -> [PictureStatistics; 2] {
        [self.last, self.blended]
    }

    /// Estimates of the pixels, rgb planes.
    pub(crate) fn estimate(&self) -> Option<[&[f32]; 3]> {
        let whole = self.estimated && self.learning.estimate == Estimate::Denoised;
        whole.then(|| core::array::from_fn(|c| &*self.estimate[c]))
    }

    /// The host's estimate of the pixels replaces the built-in one from now on.
    pub(crate) fn give_estimate(&mut self, rgb: &[[f32; 3]]) -> bool {
        if self.learning.estimate != Estimate::Denoised || rgb.len() != self.estimate[0].len() {
            return false;
        }
        for (i, p) in rgb.iter().enumerate() {
            for c in 0..3 {
                self.estimate[c][i] = if p[c].is_finite() { p[c] } else { 0.0 };
            }
        }
        (self.estimated, self.given) = (true, true);
        true
    }

    /// Weight of the samples of one pixel in an iteration of this weight.
    pub(crate) fn weight_of(&self, film: usize, weight: f64) -> f64 {
        if self.counts.is_empty() { weight } else { weight / self.share(film as u32) }
    }

    /// Weight of the samples of an iteration whose pixels `visit` shows: from what the iterations before it had. Its own
    /// variance must not be in it, since bright iterations are the noisy ones: the picture would be too dark.
    pub(crate) fn weigh(&mut self, counters: &Counters, visit: impl Fn(&mut dyn FnMut(usize, &PixelSums))) -> f64 {
        if !self.needed || !self.estimated {
            return 1.0;
        }
        let b = self.blended;
        self.measure_picture(counters, visit);
        let [cost, variance] = self.first;
        if !(cost > 0.0 && b.cost > 0.0 && b.variance > 0.0) {
            return 1.0;
        }
        // efficiency that has not grown is noise: with few samples the variance comes out too small
        let gain = (variance * cost / (b.variance * b.cost)).clamp(1.0, LARGEST_GAIN);
        b.cost / cost * gain
    }

    fn measure_picture(&mut self, counters: &Counters, visit: impl Fn(&mut dyn FnMut(usize, &PixelSums))) {
        let this = &*self;
        let pixels = |show: &mut dyn FnMut(f32)| {
            visit(&mut |film, sums| {
                if sums.samples > 0 {
                    show(this.error_of(film as u32, sums) as f32);
                }
            });
        };
        let mut n = 0u64;
        pixels(&mut |_| n += 1);
        let limit = |share: f64| kth_largest((n as f64 * share) as usize + 1, pixels);
        let outlier = limit(OUTLIERS);
        let mut s = PictureStatistics::default();
        let mut kept = 0u64;
        pixels(&mut |e| {
            // two disjoint sums: nothing is ever subtracted (NUMERICS STA-4)
            if e < outlier {
                s.variance += f64::from(e);
                kept += 1;
            } else {
                s.outliers += f64::from(e);
            }
        });
        let n = n.max(1) as f64;
        s.variance /= kept.max(1) as f64;
        s.outliers /= n;
        let c = counters;
        let cost = [(c.camera_rays, COST_CAMERA), (c.scatter_rays, COST_BOUNCE), (c.shadow_rays, COST_SHADOW)];
        let work: f64 = cost.iter().map(|&(n, cost)| n as f64 * f64::from(cost)).sum();
        s.cost = work / c.camera_samples.max(1) as f64;
        self.last = s;
        let old = self.weight * f64::from(self.learning.carry);
        self.weight = old + work;
        let blend = |a: f64, b: f64| (a * old + b * work) / self.weight.max(1e-300);
        self.blended = PictureStatistics {
            variance: blend(self.blended.variance, s.variance),
            outliers: blend(self.blended.outliers, s.outliers),
            cost: blend(self.blended.cost, s.cost),
        };
        if self.first[0] == 0.0 {
            self.first = [s.cost, s.variance];
        }
    }

    /// Mean error of a pixel's samples against its estimate, weighted by its importance and normed over the channels.
    fn error_of(&self, film: u32, p: &PixelSums) -> f64 {
        let i = self.estimate_index(film);
        let (n, importance, share) = (p.samples as f64, self.pixel_importance(film), self.share(film));
        let e: [f64; 3] = core::array::from_fn(|c| {
            let x = f64::from(self.estimate[c].get(i).copied().unwrap_or(0.0));
            let sqr = (p.sum_sqr[c] - 2.0 * x * p.sum[c]) / n + x * x;
            sqr.max(0.0) * f64::from(importance[c]) / share
        });
        match self.learning.norm {
            Norm::Max => e[0].max(e[1]).max(e[2]),
            Norm::Mean => (e[0] + e[1] + e[2]) / 3.0,
            Norm::Luminance => 0.2126 * e[0] + 0.7152 * e[1] + 0.0722 * e[2],
        }
    }

    /// Ends an iteration: a new estimate of the pixels from the film, of the picture from what `visit` shows.
    pub(crate) fn learn_picture(
        &mut self,
        film: &Film<'_>,
        counters: &Counters,
        visit: impl Fn(&mut dyn FnMut(usize, &PixelSums)),
    ) {
        if !self.needed {
            return;
        }
        let first = !self.estimated || self.weight == 0.0;
        if !self.given {
            match self.learning.estimate {
                Estimate::Denoised => self.denoise(film),
                Estimate::Blocks => self.average_blocks(film),
            }
            self.estimated = true;
        }
        if first {
            self.measure_picture(counters, visit);
        }
    }

    /// Ends an iteration: adds what the shards learned of the scene.
    pub(crate) fn learn_scene<'a, 'b: 'a>(&mut self, shards: impl Iterator<Item = &'a Training<'b>>) {
        if let Some(cache) = &mut self.cache {
            cache.prior_samples = f64::from(self.learning.knobs[4]);
            cache.begin_merge(f64::from(self.learning.knobs[0]));
            shards.for_each(|t| cache.absorb(t));
            cache.freeze(f64::from(self.learning.knobs[5]));
        }
    }

    fn denoise(&mut self, film: &Film<'_>) {
        for (i, p) in film.pixels().iter().enumerate() {
            let (mean, variance) = (p.mean(), p.variance_of_mean());
            for c in 0..3 {
                self.planes[c][i] = mean[c] as f32;
                self.planes[3 + c][i] = variance[c] as f32;
            }
        }
        for (i, a) in film.aovs().iter().enumerate() {
            for c in 0..3 {
                self.planes[6 + c][i] = (a.albedo[c] / a.hits.max(1.0)) as f32;
                self.planes[9 + c][i] = (a.normal[c] / a.hits.max(1.0)) as f32;
            }
        }
        let features = !film.aovs().is_empty();
        let planes = |first: usize, there: bool| -> [&[f32]; 3] {
            core::array::from_fn(|c| if there { &*self.planes[first + c] } else { &[] })
        };
        let noisy = Noisy {
            size: self.size,
            color: planes(0, true),
            variance: planes(3, true),
            albedo: planes(6, features),
            normal: planes(9, features),
        };
        let [r, g, b] = &mut self.estimate;
        // sizes are those of the plan
        let _ = denoise::denoise(&noisy, self.scratch, [r, g, b]);
    }

    fn average_blocks(&mut self, film: &Film<'_>) {
        for c in 0..3 {
            self.estimate[c].fill(0.0);
        }
        let (columns, [w, h]) = (self.size[0].div_ceil(TILE), self.size);
        for (i, p) in film.pixels().iter().enumerate() {
            let (x, y) = (i as u32 % w, i as u32 / w);
            let block = [w - x / TILE * TILE, h - y / TILE * TILE].map(|n| n.min(TILE)).iter().product::<u32>();
            let at = (y / TILE * columns + x / TILE) as usize;
            for (c, mean) in p.mean().into_iter().enumerate() {
                self.estimate[c][at] += (mean / f64::from(block)) as f32;
            }
        }
    }
}
