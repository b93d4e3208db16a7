//! The books of a shard: what every camera sample and every learned sample has gathered and cost so far, and where it
//! goes when it is finished. Stages compute packets; whatever outlives a packet is entered here.
//!
//! | book | holds | closes into |
//! |---|---|---|
//! | roots | camera samples in flight: radiance, rays | sums of pixels |
//! | ledger | learned samples in flight: estimate, cost | training, and the sample they are part of |
//! | training | statistics of this iteration | the session's cache |
//! | pixels, AOVs | sums per pixel | the session's film |
//! | counters | what happened | the session's counters |

use super::guide_notes::{GuideNote8, GuideNotes};
use super::job::Job;
use super::ledger::{Finished, Ledger, NO_RECORD};
use super::packets::{Contribution8, Emission8, Samples8, ShadowRays8};
use super::path::Path8;
use super::root::{PixelTarget, Roots};
use super::vertex::PathVertex;
use crate::cost::MEDIUM_STEPS_PER_RAY;
use crate::counters::Counters;
use crate::film::{Aov, AovLayout, AovSet, AovSums, PixelSums, REL_MSE_EPSILON, compared_channel};
use crate::learn::LearnedState;
use crate::learn::cache::NO_BIN;
use crate::learn::cache::Training;
use crate::learn::guiding::GuideLog;
use crate::light::{LightSample8, power_heuristic};
use crate::memory::{Carver, Measure, MemoryError};
use crate::rrs::Norm;
use crate::settings::{MAX_PATH_LENGTH, Settings};
use crate::world::World;
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Segments of a contribution's path behind those of the path that it is added to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Beyond {
    /// None: the ray met the light.
    Ray,
    /// A shadow ray.
    ShadowRay,
    /// Any number: what is expected of light that scatters further on.
    Unknown,
}

/// All that a shard keeps beyond a packet, but for the vertices that wait.
#[derive(Debug)]
pub(crate) struct Bookkeeping<'m> {
    pub(super) roots: Roots<'m>,
    pub(super) ledger: Ledger<'m>,
    pub(crate) training: Option<Training<'m>>,
    pub(super) guide: GuideNotes<'m>,
    /// Sums of the shard's pixels in this iteration, tile by tile in Morton order, as far as they are begun.
    pixels: &'m mut [PixelSums],
    /// Rays of those pixels, if anything needs them.
    rays: &'m mut [u32],
    pub(super) aovs: AovSums<'m>,
    /// Number of pixels begun; what memory holds of others is of no iteration.
    begun: usize,
    pub(crate) counters: Counters,
    /// Error of a sample beyond which it is an outlier to the statistics.
    outlier: f32,
    /// How the errors of the channels become one.
    norm: Norm,
}

/// What the books hold besides their slabs and sums.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct BookRecord {
    counters: Counters,
    free_roots: u64,
    free_records: u64,
    used_bins: u64,
    clear_bins: u64,
    begun: u64,
    outlier: f32,
    /// Directions offered to the log of path guiding.
    guide_offered: u32,
}

/// Camera samples in flight: every waiting vertex may have its own, and so may the lanes of a packet.
fn roots_capacity(settings: &Settings) -> usize {
    settings.ring as usize + 16
}

/// Records of samples in flight, if anything is learned from them.
fn ledger_capacity(settings: &Settings) -> usize {
    if settings.strategy.space().is_some() || settings.guides() { settings.learning.ledger as usize } else { 0 }
}

impl<'m> Bookkeeping<'m> {
    /// Bytes; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(m: Measure, job: &Job, pixels: usize) -> Measure {
        let s = &job.settings;
        let m = Ledger::measure(Roots::measure(m, roots_capacity(s)), ledger_capacity(s));
        let m = job.cache.map_or(m, |size| Training::measure(m, size));
        let m = GuideNotes::measure(m, job, ledger_capacity(s));
        m.add::<PixelSums>(pixels)
            .add::<u32>(if s.counts_rays() { pixels } else { 0 })
            .add::<f32>(pixels.saturating_mul(AovLayout::new(s.aovs).planes))
    }

    pub(crate) fn carve(c: &mut Carver<'m>, job: &Job, pixels: usize) -> Result<Self, MemoryError> {
        let s = &job.settings;
        let aovs = AovLayout::new(s.aovs);
        Ok(Self {
            roots: Roots::carve(c, roots_capacity(s))?,
            ledger: Ledger::carve(c, ledger_capacity(s))?,
            training: job.cache.map(|size| Training::carve(c, size)).transpose()?,
            guide: GuideNotes::carve(c, job, ledger_capacity(s))?,
            pixels: c.take_unset(pixels)?,
            rays: c.take_unset(if s.counts_rays() { pixels } else { 0 })?,
            aovs: AovSums::new(aovs, c.take_unset(pixels.saturating_mul(aovs.planes))?),
            begun: 0,
            counters: Counters::default(),
            outlier: f32::INFINITY,
            norm: s.learning.norm,
        })
    }

    /// All but slabs and sums, for [`Self::resume`].
    pub(crate) fn suspend(&self) -> BookRecord {
        let bins = self.training.as_ref().map_or([0; 2], Training::suspend);
        BookRecord {
            counters: self.counters,
            free_roots: self.roots.suspend(),
            free_records: self.ledger.suspend(),
            used_bins: bins[0],
            clear_bins: bins[1],
            begun: self.begun as u64,
            outlier: self.outlier,
            guide_offered: self.guide.log().map_or(0, GuideLog::offered),
        }
    }

    /// Goes on with the slabs and sums that the memory holds; `None` if the record is not that of such books.
    pub(crate) fn resume(&mut self, r: &BookRecord) -> Option<()> {
        self.roots.resume(r.free_roots)?;
        self.ledger.resume(r.free_records)?;
        if let Some(training) = &mut self.training {
            training.resume([r.used_bins, r.clear_bins])?;
        }
        if let Some(log) = self.guide.log_mut() {
            log.resume(r.guide_offered);
        }
        self.begun = usize::try_from(r.begun).ok().filter(|&begun| begun <= self.pixels.len())?;
        (self.counters, self.outlier) = (r.counters, r.outlier);
        Some(())
    }

    /// Empties the books.
    pub(crate) fn reset(&mut self) {
        self.roots.reset();
        self.ledger.reset();
        self.guide.clear();
        self.counters = Counters::default();
        self.begun = 0;
    }

    /// Begins an iteration with empty books.
    pub(crate) fn begin(&mut self, learned: &LearnedState<'_>) {
        self.reset();
        self.outlier = learned.outlier();
        if let Some(t) = &mut self.training {
            t.begin(learned.used_bins());
        }
    }

    /// Clears the next of the statistics of this iteration; `true` when all are clear.
    pub(super) fn clear_some(&mut self) -> bool {
        self.training.as_mut().is_none_or(Training::clear_some)
    }

    /// Are the statistics of this iteration clear of those before?
    pub(super) fn is_clear(&self) -> bool {
        self.training.as_ref().is_none_or(Training::is_clear)
    }

    /// Begins pixel `slot` of the shard, the next one, with empty sums.
    #[inline]
    pub(super) fn begin_pixel(&mut self, slot: u32) {
        let slot = slot as usize;
        if let Some(p) = self.pixels.get_mut(slot) {
            *p = PixelSums::default();
        }
        if let Some(r) = self.rays.get_mut(slot) {
            *r = 0;
        }
        self.aovs.clear(slot);
        self.begun = (slot + 1).min(self.pixels.len());
    }

    /// Sums, rays and auxiliary sums of pixel `slot` in this iteration; none before it begins.
    #[inline]
    pub(super) fn pixel(&self, slot: usize) -> (PixelSums, u32, &[f32]) {
        match self.pixels.get(slot) {
            Some(p) if slot < self.begun => (*p, self.rays.get(slot).copied().unwrap_or(0), self.aovs.row(slot)),
            _ => (PixelSums::default(), 0, &[]),
        }
    }

    /// Number of pixels that have begun.
    pub(super) fn begun(&self) -> usize {
        self.begun
    }

    /// Bytes of [`Self::sums`] of `pixels` pixels.
    pub(super) fn lengths(&self, pixels: usize) -> [usize; 3] {
        let rays = if self.rays.is_empty() { 0 } else { pixels * size_of::<u32>() };
        [pixels * size_of::<PixelSums>(), rays, pixels * self.aovs.layout.planes * size_of::<f32>()]
    }

    /// Sums of the pixels that have begun, their rays and their auxiliary sums, as bytes.
    pub(super) fn sums(&self) -> [&[u8]; 3] {
        let parts = [bytemuck::cast_slice(self.pixels), bytemuck::cast_slice(self.rays), self.aovs.bytes()];
        let lengths = self.lengths(self.begun);
        [0, 1, 2].map(|i| parts[i].get(..lengths[i]).unwrap_or(&[]))
    }

    /// Takes `begun` pixels from the bytes of [`Self::sums`].
    pub(super) fn load(&mut self, begun: usize, sums: [&[u8]; 3]) {
        let pixels = bytemuck::cast_slice_mut(self.pixels);
        let parts = [pixels, bytemuck::cast_slice_mut(self.rays), self.aovs.bytes_mut()];
        for (part, bytes) in parts.into_iter().zip(sums) {
            part.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
        }
        self.begun = begun.min(self.pixels.len());
    }

    /// Opens a camera sample: its root and, if it is `learned` from, its ledger record. `None` cannot happen while
    /// roots outnumber vertices by two packets.
    #[inline]
    pub(super) fn open_camera_sample(&mut self, target: PixelTarget, learned: bool) -> Option<(u32, u32)> {
        let root = self.roots.open(target)?;
        if !learned || !self.ledger.is_on() {
            return Some((root, NO_RECORD));
        }
        let record = self.ledger.open(NO_RECORD, false);
        self.counters.ledger_full += u64::from(record == NO_RECORD);
        Some((root, record))
    }

    /// `lanes` samples of a waiting vertex are drawn; `drained` if they are its last.
    #[inline(always)]
    pub(super) fn draw(&mut self, v: &PathVertex, lanes: u32, drained: bool) {
        if let Some(root) = self.roots.find(v.root()) {
            root.open += lanes - u32::from(drained);
        }
        self.ledger.draw(v.record(), lanes, drained);
    }

    /// A ledger record for each of the first `lanes` samples of vertices with the records `parents`, as long as there
    /// are any.
    pub(super) fn open_samples<W: World>(&mut self, parents: U32x8, lanes: usize, with_nee: bool) -> U32x8 {
        let mut out = [NO_RECORD; 8];
        if self.ledger.is_on() {
            let parents = parents.to_array();
            for (record, &parent) in out.iter_mut().zip(&parents).take(lanes) {
                if parent == NO_RECORD {
                    continue;
                }
                *record = self.ledger.open(parent, with_nee);
                if *record == NO_RECORD {
                    self.counters.ledger_full += 1;
                    self.ledger.mark_incomplete(parent);
                    self.close_record::<W>(parent);
                } else if W::GUIDING && self.guide.promises_anything() {
                    self.guide.open(*record);
                }
            }
        }
        U32x8::new(out)
    }

    /// Adds radiance to the roots and ledger records of the lanes in `mask`; `beyond` says by which part of the path. What is not finite is counted, not added.
    #[inline]
    pub(super) fn accumulate(&mut self, mask: Mask8, path: &Path8, found: &Contribution8, beyond: Beyond) {
        let radiance = found.pixel;
        let mask = mask & radiance.abs().max_component().gt(F32x8::ZERO) | mask.and_not(radiance.is_finite());
        if mask.none() {
            return;
        }
        let good = mask & radiance.is_finite();
        let root = path.root.to_array();
        let (r, g, b) = (radiance.x.to_array(), radiance.y.to_array(), radiance.z.to_array());
        for i in good.lanes() {
            let Some(root) = self.roots.find(root[i]) else { continue };
            let sum = &mut root.radiance;
            sum[0] += f64::from(r[i]);
            sum[1] += f64::from(g[i]);
            sum[2] += f64::from(b[i]);
        }
        for i in mask.and_not(good).lanes() {
            self.count_non_finite(root[i]);
        }
        if self.aovs.layout.any(AovSet::LIGHT) {
            self.record_light(good, path, radiance, beyond);
        }
        let logged = mask.and_not(path.record.eq(U32x8::splat(NO_RECORD)));
        if logged.any() {
            let x = found.local * self.firefly_scale(good, radiance, path.root);
            let (r, g, b) = (x.x.to_array(), x.y.to_array(), x.z.to_array());
            let record = path.record.to_array();
            for i in (good & logged).lanes() {
                self.ledger.accumulate(record[i], [r[i], g[i], b[i]]);
            }
            for i in mask.and_not(good).lanes() {
                self.ledger.mark_incomplete(record[i]);
            }
        }
    }

    /// Adds emission that rays met, and tells path guiding with which weights.
    #[inline(always)]
    pub(super) fn accumulate_emission<W: World>(&mut self, mask: Mask8, path: &Path8, e: &Emission8) {
        self.accumulate(mask, path, &e.found, Beyond::Ray);
        if W::GUIDING && self.guide.promises_anything() {
            self.note_emission(mask, path, e);
        }
    }

    /// See [`GuideNotes::met`].
    #[inline(never)]
    fn note_emission(&mut self, mask: Mask8, path: &Path8, e: &Emission8) {
        let found = &e.found;
        let logged = mask.and_not(path.record.eq(U32x8::splat(NO_RECORD)));
        let good = logged & found.local.any_positive() & found.pixel.is_finite() & e.weight.lt(F32x8::ONE);
        if good.none() {
            return;
        }
        let local = (found.local * self.firefly_scale(good, found.pixel, path.root)).mean();
        for i in good.lanes() {
            self.guide.met(path.record.lane(i), local.lane(i), e.weight.lane(i));
        }
    }

    /// What part of eight contributions the statistics take. The variance of the picture leaves outliers out; so must
    /// the moments that are weighed against it, or cells that met one sample of them would always split.
    fn firefly_scale(&self, mask: Mask8, radiance: Vec3x8, root: U32x8) -> F32x8 {
        let limit = F32x8::splat(self.outlier);
        let square = radiance * radiance;
        // the error weight of a channel is at most that of a black pixel, unless adaptive sampling gives a pixel few samples:
        // then a firefly below this bound keeps its size
        let most = square.max_component() * F32x8::splat(1.0 / REL_MSE_EPSILON as f32);
        if (mask & most.gt(limit)).none() {
            return F32x8::ONE;
        }
        let error = self.norm.of(square * self.roots.targets(root, mask).error_weight);
        error.gt(limit).select((limit / error).sqrt(), F32x8::ONE)
    }

    /// Counts a value that was not finite and remembers the first pixel.
    pub(super) fn count_non_finite(&mut self, root: u32) {
        self.counters.non_finite += 1;
        if self.counters.first_non_finite == 0 {
            self.counters.first_non_finite = u64::from(self.roots.get(root).target.film()) + 1;
        }
    }

    /// Counts the lanes of `broken`, whose weight is not finite; what they are part of is not learned from.
    #[inline]
    pub(super) fn break_lanes(&mut self, broken: Mask8, path: &Path8) {
        for i in broken.lanes() {
            self.count_non_finite(path.root.lane(i));
            self.ledger.mark_incomplete(path.record.lane(i));
        }
    }

    /// Charges one ray of relative `cost` to the root and the ledger record of each lane in `mask`.
    #[inline]
    pub(super) fn charge(&mut self, mask: Mask8, path: &Path8, cost: f32) {
        let root = path.root.to_array();
        for i in mask.lanes() {
            if let Some(root) = self.roots.find(root[i]) {
                root.rays += 1;
            }
        }
        let logged = mask.and_not(path.record.eq(U32x8::splat(NO_RECORD)));
        if logged.any() {
            let record = path.record.to_array();
            for i in logged.lanes() {
                self.ledger.charge(record[i], cost);
            }
        }
    }

    /// Charges `steps` steps through media to the lanes in `mask`, each its equal share, and counts the lanes of which
    /// roulette had to decide.
    pub(super) fn charge_medium(&mut self, mask: Mask8, path: &Path8, steps: u32, roulettes: u32) {
        self.counters.medium_steps += u64::from(steps);
        self.counters.media_roulettes += u64::from(roulettes);
        let logged = mask.and_not(path.record.eq(U32x8::splat(NO_RECORD)));
        let cost = steps as f32 / (MEDIUM_STEPS_PER_RAY as f32 * mask.count().max(1) as f32);
        for i in logged.lanes() {
            self.ledger.charge(path.record.lane(i), cost);
        }
    }

    /// Tells the records of the lanes in `active` at which bin the samples of the vertex that they led to are logged,
    /// times which scale, and what they count (`inner`, the bounce's weight over the vertex's factor).
    #[inline]
    pub(super) fn arrive(&mut self, active: Mask8, path: &Path8, bin: U32x8, scale: Vec3x8, inner: Vec3x8) {
        let active = active.and_not(path.record.eq(U32x8::splat(NO_RECORD)));
        let (record, bin) = (path.record.to_array(), bin.to_array());
        for i in active.lanes() {
            self.ledger.arrive(record[i], bin[i], scale.lane(i), inner.lane(i));
        }
    }

    /// Tells the statistics what came of the shadow rays of `samples`: those of `visible` met nothing that
    /// blocks.
    pub(super) fn learn_shadow_rays(&mut self, samples: &Samples8, s: &ShadowRays8, visible: Mask8) {
        if self.training.is_none() {
            return;
        }
        let v = &samples.vertex;
        let logged = s.active.and_not(s.path.record.eq(U32x8::splat(NO_RECORD)));
        if logged.none() {
            return;
        }
        let local = s.found.local * self.firefly_scale(visible & logged, s.found.pixel, s.path.root);
        let Some(training) = &mut self.training else { return };
        for i in (logged & s.towards.lt(U32x8::splat(NO_BIN))).lanes() {
            let taken = training.log_shadow(s.towards.lane(i), visible.lane(i));
            self.counters.shadows_refused += u64::from(!taken);
        }
        for i in (visible & logged).lanes() {
            let (x, scale) = (local.lane(i), self.ledger.scale(v.path.record.lane(i)));
            training.log_nee(v.bin.lane(i), [0, 1, 2].map(|c| x[c] * scale[c]), v.nee_probability.lane(i));
        }
    }

    /// Notes the directions that the bounces of eight samples took, after their next event estimation.
    #[inline(never)]
    pub(super) fn note_directions(
        &mut self,
        note: &GuideNote8,
        samples: &Samples8,
        light: Option<&LightSample8>,
        nee_pdf: F32x8,
    ) {
        let path = &samples.path;
        let lanes = note.lanes.and_not(path.record.eq(U32x8::splat(NO_RECORD)));
        if lanes.none() {
            return;
        }
        // without the guide the light sample has another weight, but that of a delta light
        let ratio = light.filter(|_| self.guide.promises_anything()).map_or(F32x8::ONE, |l| {
            let [with, without] = [nee_pdf, note.nee_pdf].map(|pdf| power_heuristic(l.pdf, pdf));
            (l.delta | !with.gt(F32x8::ZERO)).select(F32x8::ONE, without / with)
        });
        for i in lanes.lanes() {
            let slot = path.record.lane(i);
            self.guide.note(slot, note, i, self.ledger.radiance(slot), ratio.lane(i));
            self.ledger.mark_noted(slot);
        }
    }

    /// Counts the lanes of `ended`, whose paths are as long as paths can be, if the settings ask for longer ones.
    #[inline(always)]
    pub(super) fn count_longest(&mut self, settings: &Settings, ended: Mask8) {
        if settings.max_depth > MAX_PATH_LENGTH {
            self.counters.max_length_reached += u64::from(ended.count());
        }
    }

    /// Ends the paths of the lanes in `mask`.
    pub(super) fn close_lanes<W: World>(&mut self, mask: Mask8, path: &Path8) {
        let (root, record, depth) = (path.root.to_array(), path.record.to_array(), path.depth.to_array());
        for i in mask.lanes() {
            self.close::<W>(root[i], record[i], depth[i]);
        }
    }

    /// Ends a path of `depth` segments: closes a lane or a drained vertex of `root` and `record`. A finished camera
    /// sample goes to its pixel.
    #[inline]
    pub(super) fn close<W: World>(&mut self, root: u32, record: u32, depth: u32) {
        self.counters.path_segments += u64::from(depth);
        self.close_record::<W>(record);
        if let Some(done) = self.roots.close(root) {
            self.counters.camera_samples += 1;
            let pixel = done.target.pixel();
            if let Some(p) = self.pixels.get_mut(pixel) {
                let target = &done.target;
                p.add(done.radiance, target.half(), compared_channel(target.film() as usize));
            }
            if let Some(r) = self.rays.get_mut(pixel) {
                *r = r.saturating_add(done.rays);
            }
            if let Some(paths) = self.aovs.get(pixel, Aov::Paths, 0) {
                *paths += 1.0 + done.splits as f32;
            }
        }
    }

    /// Closes a lane or a drained vertex of a ledger record and logs what that finishes.
    #[inline]
    fn close_record<W: World>(&mut self, record: u32) {
        let (training, counters, guide) = (&mut self.training, &mut self.counters, &mut self.guide);
        // two copies of the code: renders without a guide do not even read what it learns from
        if !W::GUIDING || guide.log().is_none() {
            self.ledger.close(record, |f| log(training, counters, &f));
        } else {
            let promising = guide.promises_anything();
            let camera_sample = self.ledger.close(record, |f| {
                if promising || f.noted {
                    guide.close(&f);
                }
                log(training, counters, &f);
            });
            if promising && let Some(f) = self.ledger.camera_sample(camera_sample) {
                guide.close_camera_sample(&f);
            }
        }
    }
}

/// Logs a finished sample.
#[inline(always)]
fn log(training: &mut Option<Training<'_>>, counters: &mut Counters, f: &Finished) {
    let Some(t) = training.as_mut().filter(|_| f.bin != NO_BIN) else { return };
    counters.samples_logged += 1;
    if !t.log(f.bin, f.value, f.cost) {
        counters.samples_refused += 1;
    } else if let Some(d) = f.pair {
        t.log_pair(f.bin, d);
    }
}
