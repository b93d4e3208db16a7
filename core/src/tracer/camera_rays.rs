//! Camera samples in the order of tiles, halves of their pixels' samples, pixels (Morton) and samples, eight at a time.
//! Neighbouring lanes are samples of one pixel or of neighbouring pixels, so primary packets are coherent. The halves
//! of a pixel are a tile's half apart, so that they hardly ever meet in a packet: combs round the samples of one packet
//! together, and the halves are to be independent ([`Half`]).

use super::book::Bookkeeping;
use super::job::Job;
use super::ledger::NO_RECORD;
use super::media_set::MediaSet8;
use super::packets::RayState8;
use super::path::Path8;
use super::root::PixelTarget;
use super::shading::moves;
use crate::camera;
use crate::extension::{Extension, PixelSamples8, SourceRays8};
use crate::film::Half;
use crate::geometry::Ray8;
use crate::learn::guiding::Guide;
use crate::rng::Key8;
use crate::sampler::{Origin, in_first_half};
use crate::scene::Effects;
use crate::tiles::{TILE_PIXELS, Tiles};
use crate::world::World;
use bytemuck::{Pod, Zeroable};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Where a shard is in its camera samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraCursor {
    /// Current tile, if any is left.
    tile: Option<u32>,
    /// First column and row of the current tile.
    start: [u32; 2],
    /// Pixel of the shard, tile by tile in Morton order.
    pixel: u32,
    /// Slot within the tile.
    slot: u32,
    /// Sample within the half of the pixel.
    sample: u32,
    half: Half,
}

/// The next camera sample.
#[derive(Clone, Copy, Debug)]
struct NextSample {
    /// Column and row.
    at: [u32; 2],
    /// Number of the pixel in the shard.
    pixel: u32,
    /// Number of the sample in the iteration.
    sample: u32,
    half: Half,
    /// How many samples of the pixel in the iteration belong to the first half.
    in_first_half: u32,
}

/// A cursor as numbers.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct CursorRecord {
    /// [`NO_TILE`] if none is left.
    tile: u32,
    pixel: u32,
    /// [`TILE_PIXELS`] more in the second half.
    slot: u32,
    sample: u32,
}

const NO_TILE: u32 = u32::MAX;

impl CameraCursor {
    pub(super) fn suspend(&self) -> CursorRecord {
        let Self { tile, pixel, slot, sample, half, .. } = *self;
        let slot = if half == Half::Second { slot + TILE_PIXELS } else { slot };
        CursorRecord { tile: tile.unwrap_or(NO_TILE), pixel, slot, sample }
    }

    /// `None` if shard `index` has no such tile, slot or pixel.
    pub(super) fn resume(tiles: &Tiles, index: u32, r: &CursorRecord) -> Option<Self> {
        let CursorRecord { tile, pixel, slot, sample } = *r;
        let tile = (tile != NO_TILE).then_some(tile);
        let sound = slot < 2 * TILE_PIXELS
            && tile.is_none_or(|tile| (tile as usize) < tiles.count())
            && pixel as usize <= tiles.pixels_of(index);
        let (half, slot) = if slot < TILE_PIXELS { (Half::First, slot) } else { (Half::Second, slot - TILE_PIXELS) };
        sound.then(|| Self { pixel, slot, sample, half, ..Self::at_tile(tiles, tile) })
    }

    /// At the first sample of the shard's first tile, or of another tile.
    fn at_tile(tiles: &Tiles, tile: Option<u32>) -> Self {
        Self { tile, start: tile.map_or([0; 2], |tile| tiles.start(tile)), ..Self::finished() }
    }

    pub(super) fn new(tiles: &Tiles, shard: u32, samples: u32) -> Self {
        Self::at_tile(tiles, if samples == 0 { None } else { tiles.next_of(shard, 0) })
    }

    pub(super) const fn finished() -> Self {
        Self { tile: None, start: [0; 2], pixel: 0, slot: 0, sample: 0, half: Half::First }
    }

    pub(super) fn is_finished(&self) -> bool {
        self.tile.is_none()
    }

    /// The next camera sample; a finished cursor gives `None`. `samples` is the number per pixel of a tile, and how
    /// many of them belong to the first half.
    fn next(&mut self, tiles: &Tiles, shard: u32, samples: impl Fn(u32) -> [u32; 2]) -> Option<NextSample> {
        while let Some(tile) = self.tile {
            let [samples, in_first_half] = samples(tile);
            let (half, before, wanted) = match self.half {
                Half::First => (Half::First, 0, in_first_half),
                Half::Second => (Half::Second, in_first_half, samples - in_first_half),
            };
            let pixel = tiles.pixel(self.start, self.slot);
            let sample = |at| NextSample { at, pixel: self.pixel, sample: before + self.sample, half, in_first_half };
            let found = pixel.filter(|_| self.sample < wanted).map(sample);
            self.sample = self.sample.saturating_add(1);
            if found.is_none() || self.sample >= wanted {
                self.sample = 0;
                self.pixel += u32::from(pixel.is_some());
                self.slot += 1;
                if self.slot == TILE_PIXELS {
                    self.next_half(tiles, shard, tile);
                }
            }
            if found.is_some() {
                return found;
            }
        }
        None
    }

    /// Goes on with the second half of a tile, or with the next tile.
    fn next_half(&mut self, tiles: &Tiles, shard: u32, tile: u32) {
        if self.half == Half::First {
            (self.half, self.slot) = (Half::Second, 0);
            self.pixel = self.pixel.saturating_sub(tiles.area(tile));
        } else {
            *self = Self { pixel: self.pixel, ..Self::at_tile(tiles, tiles.next_of(shard, tile + 1)) };
        }
    }
}

/// Up to eight camera samples that begin.
pub(super) struct CameraSamples8 {
    /// Lanes with a sample, the first `count`.
    pub asked: Mask8,
    pub count: u64,
    /// What an extension is told of them.
    pub pixels: PixelSamples8,
    /// Times of the samples, drawn if anything moves.
    pub time: F32x8,
    /// Whose samples these are.
    pub path: Path8,
    /// Keys of their first vertices.
    pub key: Key8,
    /// See [`PixelTarget::error_weight`].
    pub error_weight: Vec3x8,
}

/// The next camera samples of shard `index`; none when the cursor ran out within empty slots.
#[inline(always)]
pub(super) fn camera_samples<W: World>(
    world: &W,
    job: &Job,
    index: u32,
    cursor: &mut CameraCursor,
    book: &mut Bookkeeping<'_>,
) -> CameraSamples8 {
    let (settings, tiles, learned, iteration) = (&job.settings, &job.tiles, world.learned(), world.iteration());
    let sampler = world.sampler();
    let (seed, first) = (settings.seed, iteration.first_sample);
    let mut origin = Origin { seed, iteration: iteration.number, first, alone: false };
    let mut before = origin.first;
    if settings.adaptive {
        // numbers of one pixel must not come back in another iteration, however many samples it had
        origin = origin.apart();
        // the half that is one larger, if any, is the first in every other iteration
        before = iteration.number as u32;
    }
    let samples = |tile| {
        let samples = learned.samples_of_tile(tile);
        [samples, in_first_half(before, samples)]
    };
    // none without a cache: nothing but the guide learns then, and it is not asked here
    let unguided = learned.learned_samples(false);
    let promising = W::GUIDING && book.guide.promises_anything();
    let known = promising && learned.guide().is_some_and(Guide::knows_directions);
    let (mut x, mut y, mut pixel, mut sample) = ([0u32; 8], [0u32; 8], [0u32; 8], [0u32; 8]);
    let mut first_halves = [0u32; 8];
    let (mut root, mut record, mut weight) = ([0u32; 8], [NO_RECORD; 8], [[1.0; 3]; 8]);
    let mut lanes = 0;
    while lanes < 8 {
        let Some(next) = cursor.next(tiles, index, samples) else { break };
        let (p, s) = (next.at, next.sample);
        let film = tiles.film_index(p) as u32;
        if s == 0 {
            book.begin_pixel(next.pixel);
        }
        let (error_weight, share) = learned.error_weight(film);
        let mut target = PixelTarget::numbered(error_weight, share, film, next.pixel, s).with_half(next.half);
        let mut learning = unguided;
        let mut guided = false;
        if W::GUIDING {
            guided = learned.is_guided(iteration.number, p);
            target = target.with_guiding(guided);
            learning = learned.learned_samples(guided);
        }
        let Some(opened) = book.open_camera_sample(target, s < learning) else { break };
        if promising && opened.1 != NO_RECORD {
            let counts = if guided && known { error_weight } else { [0.0; 3] };
            book.guide.open_camera_sample(opened.1, learned.expected(film), counts);
        }
        [x[lanes], y[lanes]] = p;
        pixel[lanes] = film;
        (sample[lanes], first_halves[lanes]) = (s, next.in_first_half);
        weight[lanes] = error_weight;
        (root[lanes], record[lanes]) = opened;
        lanes += 1;
    }
    let key = Key8::camera_sample(sampler, origin, U32x8::new(pixel), [sample, first_halves].map(U32x8::new));
    let [u0, u1, u2, u3] = key.pixel_and_lens(sampler);
    let px = F32x8::from_fn(|i| x[i] as f32) + u0;
    let py = F32x8::from_fn(|i| y[i] as f32) + u1;
    let asked = Mask8::first(lanes);
    let (column, row) = (U32x8::new(x), U32x8::new(y));
    let (position, u) = ([px, py], [u2, u3]);
    let mut time = F32x8::ZERO;
    if moves::<W>(world.scene()) {
        time = key.time(sampler);
        for (root, time) in root.iter().zip(time.to_array()).take(lanes) {
            book.roots.get(*root).time = time;
        }
    }
    let depth = U32x8::splat(1);
    CameraSamples8 {
        asked,
        count: lanes as u64,
        pixels: PixelSamples8 { size: settings.size, column, row, position, u, active: asked },
        time,
        path: Path8 { root: U32x8::new(root), record: U32x8::new(record), depth },
        key: key.next_vertex(sampler, depth),
        error_weight: Vec3x8::from_fn(|i| weight[i]),
    }
}

/// Up to eight camera rays of shard `index`; none when the cursor ran out within empty slots.
#[inline(always)]
pub(crate) fn camera_rays<W: World>(
    world: &W,
    job: &Job,
    index: u32,
    cursor: &mut CameraCursor,
    book: &mut Bookkeeping<'_>,
) -> RayState8 {
    let s = camera_samples(world, job, index, cursor, book);
    let source = if W::Extension::RAYS {
        let source = world.extension().rays(world.scene(), &s.pixels);
        SourceRays8 { active: source.active & s.asked, ..source }
    } else {
        let (origin, direction) = through_lens(world, s.pixels.size, s.pixels.position, s.pixels.u);
        SourceRays8 { origin, direction, weight: Vec3x8::ONE, active: s.asked }
    };
    let (o, d, active) = (source.origin, source.direction, source.active);
    if W::Extension::RAYS {
        book.close_lanes::<W>(s.asked.and_not(active), &s.path);
    }
    book.counters.camera_rays += s.count;
    RayState8 {
        active,
        ray: Ray8::unbounded(o, d).at(s.time),
        from: o,
        normal: Vec3x8::ZERO,
        travelled: F32x8::ZERO,
        media: camera_media(world),
        beta: source.weight,
        weight: source.weight,
        pdf: F32x8::ONE,
        skip_mis: Mask8::all_lanes(),
        path: s.path,
        key: s.key,
        albedo_product: F32x8::ONE,
        error_weight: s.error_weight,
    }
}

/// The media in which camera samples begin.
#[inline(always)]
pub(super) fn camera_media<W: World>(world: &W) -> MediaSet8 {
    if W::EFFECTS.contains(Effects::MEDIA) { MediaSet8::splat(world.camera_media()) } else { MediaSet8::NONE }
}

/// Rays of the scene's camera through points of the picture: origins and unit directions.
#[inline(always)]
fn through_lens<W: World>(world: &W, size: [u32; 2], [x, y]: [F32x8; 2], u: [F32x8; 2]) -> (Vec3x8, Vec3x8) {
    let scene = world.scene();
    let lens = if W::EFFECTS.contains(Effects::LENS) { u } else { [F32x8::ZERO; 2] };
    if W::EFFECTS.contains(Effects::PROJECTIONS) && scene.effects.contains(Effects::PROJECTIONS) {
        camera::project(scene.camera, size, x, y, lens)
    } else {
        camera::generate(scene.camera, size, x, y, lens)
    }
}
