//! Stage `refill`: camera samples in the order of tiles, pixels (Morton) and samples, eight at a time. Neighbouring
//! lanes are samples of one pixel or of neighbouring pixels, so primary packets are coherent.

use super::flight::RayState8;
use super::ledger::NO_RECORD;
use super::root::Target;
use super::shard::Shard;
use crate::accel::{Intersector, Ray8};
use crate::camera;
use crate::light::LightSelector;
use crate::profile::Profile;
use crate::rng::Key8;
use crate::scene::Effects;
use crate::session::Session;
use crate::tiles::{TILE_PIXELS, Tiles};
use croupier_simd::{F32x8, Mask8, U32x8, Vec3x8};

/// Where a shard is in its camera samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cursor {
    /// Current tile, if any is left.
    tile: Option<u32>,
    /// Pixel slots of the tiles before it.
    base: u32,
    /// Slot within the tile.
    slot: u32,
    /// Sample within the pixel.
    sample: u32,
}

impl Cursor {
    pub(super) fn new(tiles: &Tiles, shard: u32, samples: u32) -> Self {
        let tile = if samples == 0 { None } else { tiles.next_of(shard, 0) };
        Self { tile, base: 0, slot: 0, sample: 0 }
    }

    pub(super) const fn finished() -> Self {
        Self { tile: None, base: 0, slot: 0, sample: 0 }
    }

    pub(super) fn is_finished(&self) -> bool {
        self.tile.is_none()
    }

    /// The next (pixel, pixel slot, sample); a finished cursor gives `None`. `samples` is the number per pixel of a
    /// tile.
    fn next(&mut self, tiles: &Tiles, shard: u32, samples: impl Fn(u32) -> u32) -> Option<([u32; 2], u32, u32)> {
        while let Some(tile) = self.tile {
            let found = tiles.pixel(tile, self.slot).map(|p| (p, self.base + self.slot, self.sample));
            self.sample += 1;
            if found.is_none() || self.sample >= samples(tile) {
                self.sample = 0;
                self.slot += 1;
                if self.slot == TILE_PIXELS {
                    self.slot = 0;
                    self.base += TILE_PIXELS;
                    self.tile = tiles.next_of(shard, tile + 1);
                }
            }
            if found.is_some() {
                return found;
            }
        }
        None
    }
}

impl Shard<'_> {
    /// Up to eight camera rays. `None` when the cursor ran out within empty slots.
    pub(super) fn camera_rays<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
    ) -> Option<RayState8> {
        let iteration = session.iteration();
        // numbers of one pixel must not come back in another iteration, however many samples it had
        let settings = &self.job.settings;
        let (seed, first_sample) = match settings.adaptive {
            true => (settings.seed ^ iteration.number.wrapping_mul(0x9e37_79b9_7f4a_7c15), 0),
            false => (settings.seed, iteration.first_sample),
        };
        let tiles = self.job.tiles;
        let (mut x, mut y, mut pixel, mut sample, mut root) = ([0u32; 8], [0u32; 8], [0u32; 8], [0u32; 8], [0u32; 8]);
        let (mut ledger, mut weight) = ([NO_RECORD; 8], [[1.0; 3]; 8]);
        let mut lanes = 0;
        while lanes < 8 {
            let Some((p, slot, s)) = self.cursor.next(&tiles, self.index, |t| session.learned().samples_of_tile(t))
            else {
                break;
            };
            let film = tiles.film_index(p) as u32;
            let (error_weight, share) = session.learned().error_weight(film);
            let Some(r) = self.roots.open(Target { error_weight, share, film, pixel: slot }) else { break };
            [x[lanes], y[lanes]] = p;
            pixel[lanes] = film;
            sample[lanes] = first_sample.wrapping_add(s);
            root[lanes] = r;
            weight[lanes] = error_weight;
            if self.ledger.is_on() && s < settings.learning.samples {
                ledger[lanes] = self.ledger.open(NO_RECORD, false);
                self.counters.ledger_full += u64::from(ledger[lanes] == NO_RECORD);
            }
            lanes += 1;
        }
        if lanes == 0 {
            return None;
        }
        let key = Key8::camera(seed, U32x8::new(pixel), U32x8::new(sample));
        let [u0, u1, u2, u3] = key.uniforms(0);
        let px = F32x8::from_fn(|i| x[i] as f32) + u0;
        let py = F32x8::from_fn(|i| y[i] as f32) + u1;
        let lens = if P::EFFECTS.contains(Effects::LENS) { [u2, u3] } else { [F32x8::ZERO; 2] };
        let (o, d) = camera::generate(session.scene().camera, self.job.settings.size, px, py, lens);
        let active = Mask8::first(lanes);
        self.counters.camera_rays += lanes as u64;
        Some(RayState8 {
            active,
            ray: Ray8 { o, d, tmin: F32x8::ZERO, tmax: F32x8::INFINITY },
            from: o,
            normal: Vec3x8::ZERO,
            beta: Vec3x8::ONE,
            weight: Vec3x8::ONE,
            pdf: F32x8::ONE,
            alone: Mask8::all_lanes(),
            root: U32x8::new(root),
            ledger: U32x8::new(ledger),
            key: key.child(U32x8::splat(0)),
            depth: U32x8::splat(1),
            albedo_product: F32x8::ONE,
            error_weight: Vec3x8::from_fn(|i| weight[i]),
        })
    }
}
