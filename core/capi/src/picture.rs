//! What a session shows: pixels, auxiliary values, errors, counters; and pixels of shards that are not finished.

use crate::fault::{Fault, answer, croupier_message, promised};
use crate::kernels;
use crate::memory::{Versioned, apart, array, array_mut, output, range, write_struct, zeroed};
use crate::parts::{croupier_hits8, croupier_rays8};
use crate::scene::{croupier_scene, scene_at};
use crate::session::{croupier_session, session_at};
use crate::shard::{croupier_shard, shard_at};
use crate::status::croupier_status::{self, *};
use bytemuck::{Pod, Zeroable};
use croupier::unstable::film::Aov;
use croupier::{Counters, Film};

/// A pixel of the picture so far. Linear Rec. 709.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_pixel {
    /// Mean radiance.
    pub mean: [f32; 3],
    /// Standard error of the mean, right on average over the picture from two samples on.
    pub standard_error: [f32; 3],
    /// Camera samples; 0 before the end of the first iteration.
    pub samples: u32,
    /// Rays of all kinds, at most 2^32 - 1; 0 unless the settings ask for the AOV cost or are adaptive.
    pub rays: u32,
}

impl croupier_pixel {
    fn of(film: &Film<'_>, index: usize) -> Self {
        let clamped = |n: u64| u32::try_from(n).unwrap_or(u32::MAX);
        let p = film.pixel(index);
        Self {
            mean: p.mean().map(|x| x as f32),
            standard_error: film.standard_error(index).map(|x| x as f32),
            samples: clamped(p.samples),
            rays: clamped(p.rays),
        }
    }
}

/// Auxiliary values of pixels. Where nothing else is said, planes hold means over the camera samples, those that missed
/// everything counted as 0: divide by CROUPIER_AOV_ALPHA for means over the samples that hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum croupier_aov {
    /// Albedo of the first hit: red, green, blue.
    CROUPIER_AOV_ALBEDO = 0,
    /// Shading normal of the first hit, world space: x, y, z.
    CROUPIER_AOV_NORMAL = 1,
    /// Distance to the first hit, world units.
    CROUPIER_AOV_DEPTH = 2,
    /// Share of the camera samples that hit, 0 to 1.
    CROUPIER_AOV_ALPHA = 3,
    /// Sums of the factors of roulette at vertices of depth 1, 2, 3 and above, and numbers of these vertices: eight
    /// planes.
    CROUPIER_AOV_FACTORS = 4,
    /// Number of paths: the camera sample and what splitting added.
    CROUPIER_AOV_PATHS = 5,
    /// Number of rays; has no plane, see croupier_pixel.
    CROUPIER_AOV_COST = 6,
    /// Radiance of what is seen directly: red, green, blue.
    CROUPIER_AOV_EMISSION = 7,
    /// Radiance of light that scattered once.
    CROUPIER_AOV_DIRECT = 8,
    /// Radiance of light that scattered more often.
    CROUPIER_AOV_INDIRECT = 9,
    /// Index of the material of the first sample's first hit, -1 without one.
    CROUPIER_AOV_MATERIAL = 10,
    /// Index of its object, -1 without one: croupier_scene_object_name.
    CROUPIER_AOV_OBJECT = 11,
    /// The two materials that cover most of the pixel: index, share, index, share.
    CROUPIER_AOV_MATERIAL_COVERAGE = 12,
    /// The two objects that cover most of the pixel, likewise.
    CROUPIER_AOV_OBJECT_COVERAGE = 13,
    /// Motion of the first hit across the picture while the shutter is open, pixels: x, y.
    CROUPIER_AOV_MOTION = 14,
}

const _: () = {
    use croupier_aov::*;
    assert!(CROUPIER_AOV_COST as u32 == Aov::Cost as u32 && CROUPIER_AOV_INDIRECT as u32 == Aov::Indirect as u32);
    assert!(CROUPIER_AOV_MOTION as u32 == Aov::Motion as u32 && Aov::ALL.len() == 15);
};

/// Auxiliary value of a number.
fn aov_of(number: u32) -> Result<Aov, Fault> {
    Aov::ALL.get(number as usize).copied().ok_or(Fault::new(CROUPIER_RANGE, "aov").at(number.into()))
}

/// Estimated error of the picture against its own expectation.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_error_estimate {
    /// sizeof(croupier_error_estimate), set by the program.
    pub struct_size: u32,
    /// 1 if the samples tell the error. 0 if few pixels cause most of it: more of their kind are probably not found yet,
    /// or one that is found counts for too much; or if, in a picture of less than 40,000 pixels, one sample that shows the
    /// brightest light in a mirror, glass or another narrow lobe would make rel_mse more than a tenth larger. There is no
    /// interval then: the error is low at least.
    pub resolved: u32,
    /// Mean over pixels and channels of variance / (expectation^2 + 0.01), without the worst 0.01 % of the pixels, times
    /// independence. The expectation is estimated from the pixel and those around it.
    pub rel_mse: f64,
    /// Lower end of its 95 % confidence interval.
    pub low: f64,
    /// Upper end; infinite if the error is not resolved.
    pub high: f64,
    /// The same mean over all pixels.
    pub rel_mse_all: f64,
    /// Variance of the pixels over that of independent samples; 1 while it is not known.
    pub independence: f64,
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_error_estimate {
    const FIRST: u32 = 48;
    const NAME: &'static str = "estimate";

    fn empty() -> Self {
        zeroed()
    }
}

/// One round of camera samples.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_iteration {
    /// sizeof(croupier_iteration), set by the program.
    pub struct_size: u32,
    /// Camera samples per pixel in it.
    pub samples: u32,
    /// 1 for the first; 0 before it.
    pub number: u64,
    /// Camera samples per pixel before it.
    pub first_sample: u32,
    /// 0.
    pub reserved: u32,
    /// Number of times that the picture began again.
    pub restarts: u64,
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_iteration {
    const FIRST: u32 = 32;
    const NAME: &'static str = "iteration";

    fn empty() -> Self {
        zeroed()
    }
}

/// Lanes used of lanes offered: eight per packet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_utilisation {
    /// Packets run.
    pub packets: u64,
    /// Active lanes in them.
    pub lanes: u64,
}

/// Counts of work, and of every event in which a bound was reached.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct croupier_counters {
    /// sizeof(croupier_counters), set by the program.
    pub struct_size: u32,
    /// 0.
    pub reserved: u32,
    /// Closest-hit rays from the camera.
    pub camera_rays: u64,
    /// Closest-hit rays from scattering.
    pub scatter_rays: u64,
    /// Closest-hit rays that went on straight.
    pub straight_rays: u64,
    /// Steps through media.
    pub medium_steps: u64,
    /// Shadow rays, counted again behind every surface that they passed.
    pub shadow_rays: u64,
    /// Camera samples finished.
    pub camera_samples: u64,
    /// Samples of vertices.
    pub vertex_samples: u64,
    /// Vertices at which roulette ended the path.
    pub paths_terminated: u64,
    /// Samples that splitting added.
    pub splits: u64,
    /// Splits that a nearly full ring limited.
    pub splits_limited_by_ring: u64,
    /// Splits that the budget of their camera sample limited.
    pub splits_limited_by_budget: u64,
    /// Shadow rays terminated by roulette.
    pub shadow_rays_terminated: u64,
    /// Light samples left out by roulette.
    pub light_samples_skipped: u64,
    /// Sum of the segments of all paths.
    pub path_segments: u64,
    /// Samples offered to the statistics.
    pub samples_logged: u64,
    /// Samples that were not learned from because their bin had enough.
    pub samples_refused: u64,
    /// Shadow rays that were not learned from because their bin had enough.
    pub shadows_refused: u64,
    /// Samples without a record because the ledger was full.
    pub ledger_full: u64,
    /// Factors that were not finite and became 1.
    pub factors_not_finite: u64,
    /// Paths that ended because of the longest length, before max-depth.
    pub max_length_reached: u64,
    /// Light samples whose distance was clamped.
    pub distances_clamped: u64,
    /// Rays with so many steps through a medium that roulette decided.
    pub media_roulettes: u64,
    /// Shadow rays taken for blocked behind too many surfaces: light that is lost.
    pub passages_cut: u64,
    /// Contributions that were not finite and were not added.
    pub non_finite: u64,
    /// Index of the pixel of the first of them, plus 1; 0 without one.
    pub first_non_finite: u64,
    /// Lanes of the scatter stage.
    pub scatter: croupier_utilisation,
    /// Lanes of the closest-hit stage.
    pub trace: croupier_utilisation,
    /// Lanes of the shadow-ray stage.
    pub occlude: croupier_utilisation,
    /// Lanes of the shading stage.
    pub surface: croupier_utilisation,
    /// Lanes of look-ups in statistics.
    pub look_ups: croupier_utilisation,
    /// Lanes of rays that passed surfaces.
    pub passed: croupier_utilisation,
    /// Largest number of vertices that waited at once.
    pub ring_peak: u64,
    /// Closest-hit rays of light paths, which path guiding learns from at first, and as many steps through media as cost
    /// the same.
    pub light_path_rays: u64,
}

// SAFETY: `repr(C)` and Pod, begins with its size.
unsafe impl Versioned for croupier_counters {
    const FIRST: u32 = 312;
    const NAME: &'static str = "counters";

    fn empty() -> Self {
        zeroed()
    }
}

impl croupier_counters {
    /// The same counts, which have the same order.
    pub(crate) fn from_core(c: &Counters) -> Self {
        const HEAD: usize = 8;
        const { assert!(size_of::<Self>() == size_of::<Counters>() + HEAD) };
        let mut counts = Self::empty();
        let members = bytemuck::bytes_of_mut(&mut counts).get_mut(HEAD..).unwrap_or_default();
        members.copy_from_slice(bytemuck::bytes_of(c));
        counts
    }
}

/// Pixels first to first + count - 1, row by row from the top left. CROUPIER_RANGE if there are not so many. While an
/// iteration is being finished, some pixels have it and others do not.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_pixels(
    session: *const croupier_session,
    first: usize,
    count: usize,
    pixels: *mut croupier_pixel,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let film = data.state()?.film();
        apart(pixels, count, &[data.place], "pixels")?;
        let to = promised!(array_mut(pixels, count, "pixels"))?;
        if first.checked_add(count).is_none_or(|end| end > film.pixels().len()) {
            return Err(Fault::new(CROUPIER_RANGE, "first pixel").at(first as u64));
        }
        for (i, pixel) in to.iter_mut().enumerate() {
            *pixel = croupier_pixel::of(film, first.saturating_add(i));
        }
        Ok(())
    })
}

/// Mean radiance of all pixels: red, green and blue of each, row by row from the top left. count is the number of
/// floats, three times the number of pixels, or the answer is CROUPIER_SIZE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_rgb(
    session: *const croupier_session,
    rgb: *mut f32,
    count: usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let film = data.state()?.film();
        let needed = film.pixels().len().saturating_mul(3);
        if count != needed {
            return Err(Fault::sizes("rgb", needed, count));
        }
        apart(rgb, count, &[data.place], "rgb")?;
        let to = promised!(array_mut(rgb, count, "rgb"))?;
        for (rgb, pixel) in to.as_chunks_mut().0.iter_mut().zip(film.pixels()) {
            *rgb = pixel.mean().map(|x| x as f32);
        }
        Ok(())
    })
}

/// Number of planes of an auxiliary value (croupier_aov); 0 if there is no such value.
#[unsafe(no_mangle)]
pub extern "C" fn croupier_aov_channels(aov: u32) -> u32 {
    aov_of(aov).map_or(0, |aov| aov.channels().len() as u32)
}

/// Plane channel of an auxiliary value (croupier_aov), a float per pixel, row by row from the top left. count is the
/// number of pixels, or the answer is CROUPIER_SIZE. CROUPIER_ABSENT if the settings do not ask for it, and before the
/// end of the first iteration; CROUPIER_RANGE if it has no such channel.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_plane(
    session: *const croupier_session,
    aov: u32,
    channel: u32,
    values: *mut f32,
    count: usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let aov = aov_of(aov)?;
        if channel as usize >= aov.channels().len() {
            return Err(Fault::new(CROUPIER_RANGE, "channel").at(channel.into()));
        }
        let plane = data.state()?.film().plane(aov, channel as usize);
        let plane = plane.ok_or(Fault::new(CROUPIER_ABSENT, aov.name()))?;
        if plane.len() != count {
            return Err(Fault::sizes("values", plane.len(), count));
        }
        apart(values, count, &[data.place], "values")?;
        promised!(array_mut(values, count, "values"))?.copy_from_slice(plane);
        Ok(())
    })
}

/// Estimated error of the picture, as of the end of the last iteration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_error_estimate(
    session: *const croupier_session,
    estimate: *mut croupier_error_estimate,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let e = data.state()?.film().error_estimate();
        let shown = croupier_error_estimate {
            resolved: e.is_resolved().into(),
            rel_mse: e.rel_mse,
            low: if e.is_resolved() { e.low } else { e.at_least },
            high: if e.is_resolved() { e.high } else { f64::INFINITY },
            rel_mse_all: e.rel_mse_all,
            independence: e.independence,
            ..croupier_error_estimate::empty()
        };
        promised!(write_struct(estimate, &shown))
    })
}

/// The current iteration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_iteration(
    session: *const croupier_session,
    iteration: *mut croupier_iteration,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let (i, restarts) = (data.state()?.iteration(), data.state()?.epoch());
        let (number, samples, first_sample) = (i.number, i.samples, i.first_sample);
        let shown = croupier_iteration { samples, number, first_sample, restarts, ..croupier_iteration::empty() };
        promised!(write_struct(iteration, &shown))
    })
}

/// Counts of all finished iterations.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_session_counters(
    session: *const croupier_session,
    counters: *mut croupier_counters,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(session_at(session))?.read()?;
        let counts = croupier_counters::from_core(data.state()?.counters());
        promised!(write_struct(counters, &counts))
    })
}

/// Pixels of a shard in the iteration under way, for previews: writes red, green and blue of the mean of each pixel
/// that has finished camera samples where croupier_session_rgb has them, and leaves the others as they are. count is
/// three times the number of pixels of the picture, or the answer is CROUPIER_SIZE. Means are biased while samples of
/// a pixel are in flight.
/// *written, which may be null, becomes the number of pixels; 0 if the shard has not stepped in this iteration.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_shard_unfinished(
    shard: *const croupier_shard,
    session: *const croupier_session,
    rgb: *mut f32,
    count: usize,
    written: *mut usize,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let session = promised!(session_at(session))?.read()?;
        let data = promised!(shard_at(shard))?.read()?;
        let (state, shard) = (session.state()?, data.shard()?);
        data.fits(&session)?;
        let needed = state.film().pixels().len().saturating_mul(3);
        if count != needed {
            return Err(Fault::sizes("rgb", needed, count));
        }
        apart(rgb, count, &[session.place, data.place], "rgb")?;
        let to = promised!(array_mut(rgb, count, "rgb"))?.as_chunks_mut().0;
        let mut number = if written.is_null() { None } else { Some(promised!(output(written, "written"))?) };
        let scene = session.scene()?;
        let mut shown = 0usize;
        if (session.kernel.has_joined)(scene.scene.scene(), &session.parts, state, shard) {
            shard.for_each_pixel(|i, mean, _| {
                if let Some(pixel) = to.get_mut(i) {
                    *pixel = mean.map(|x| x as f32);
                    shown = shown.saturating_add(1);
                }
            });
        }
        if let Some(number) = &mut number {
            number.set(shown);
        }
        Ok(())
    })
}

/// Closest hits of eight rays with the scene's triangles: picking, visibility, and the built-in part of an intersector
/// of the host's own. Lanes of active count (bit i is lane i); *hit becomes the lanes that hit.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_closest(
    scene: *const croupier_scene,
    rays: *const croupier_rays8,
    active: u32,
    hits: *mut croupier_hits8,
    hit: *mut u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let rays = promised!(array(rays, 1, "rays"))?.first().ok_or(Fault::new(CROUPIER_NULL, "rays"))?;
        apart(hits, 1, &[range(core::slice::from_ref(rays))], "hits")?;
        let (mut to, mut lanes) = (promised!(output(hits, "hits"))?, promised!(output(hit, "hit"))?);
        let (found, mask) = kernels::closest(&data.scene.scene(), rays, active);
        to.set(found);
        lanes.set(mask);
        Ok(())
    })
}

/// Lanes of active whose rays hit any of the scene's triangles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn croupier_scene_occluded(
    scene: *const croupier_scene,
    rays: *const croupier_rays8,
    active: u32,
    occluded: *mut u32,
    message: *mut croupier_message,
) -> croupier_status {
    answer!(message, Fault, {
        let data = promised!(scene_at(scene))?.read()?;
        let rays = promised!(array(rays, 1, "rays"))?.first().ok_or(Fault::new(CROUPIER_NULL, "rays"))?;
        let mut lanes = promised!(output(occluded, "occluded"))?;
        lanes.set(kernels::occluded(&data.scene.scene(), rays, active));
        Ok(())
    })
}
