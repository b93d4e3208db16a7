//! A film to which films of other renders are added, one after the other, each as an iteration: pictures that were
//! rendered in parts, apart from each other.

use super::pixel::{PixelStats, PixelSums};
use super::short::short;
use super::{Film, FilmLayout, FilmScalars};
use crate::memory::{Carver, Measure, MemoryError};

/// Film of several renders whose camera samples are different ones: every camera sample counts alike, whichever render
/// it is of, so that the mean is unbiased whatever the renders have learned. Weights by inverse variance would not be:
/// an estimated variance depends on the samples that it weighs.
#[derive(Debug)]
pub struct FilmSum<'m> {
    film: Film<'m>,
    /// The pixels with most error.
    largest: &'m mut [u32],
}

impl<'m> FilmSum<'m> {
    /// Bytes; [`Self::carve`] carves in the same order.
    pub(crate) fn measure(l: &FilmLayout) -> Measure {
        Film::measure(Measure::new().add::<u32>(Film::largest_len(l.pixels())), l)
    }

    pub(crate) fn carve(c: &mut Carver<'m>, l: &FilmLayout) -> Result<Self, MemoryError> {
        Ok(Self { largest: c.take_unset(Film::largest_len(l.pixels()))?, film: Film::carve(c, l, FilmScalars::new())? })
    }

    /// Adds a film: `pixel` gives the statistics of each pixel of it ([`Film::pixel`]), `plane` the value of a plane at a
    /// pixel ([`Film::plane`]); planes count from 0 in the order of [`Aov::ALL`](super::Aov::ALL) and of their channels. What must
    /// not depend on the order of films is added in a fixed one.
    pub fn add(&mut self, pixel: impl Fn(usize) -> PixelStats, plane: impl Fn(usize, usize) -> f32) {
        let film = &mut self.film;
        film.begin_merge();
        let mut row = [0.0; 64];
        for i in 0..film.len() {
            let p = pixel(i);
            let samples = u32::try_from(p.samples).unwrap_or(u32::MAX);
            let rays = u32::try_from(p.rays).unwrap_or(u32::MAX);
            let sums = PixelSums {
                sum: p.sum,
                spread: p.spread.map(short),
                samples,
                difference: p.difference as f32,
                ahead: p.ahead as i32,
            };
            let planes = film.aovs.planes();
            for (at, value) in row.iter_mut().take(planes).enumerate() {
                let mean = plane(at, i);
                *value = if film.aovs.is_index(at) { mean } else { (f64::from(mean) * f64::from(samples)) as f32 };
            }
            film.merge(i, &sums, rays, row.get(..planes).unwrap_or(&[]), 1.0);
        }
        film.end_merge();
    }

    /// The film, with the estimated error of the picture; `highlight` is that of the scene
    /// ([`Records::highlight`](crate::unstable::scene::Records::highlight)).
    pub fn finish(&mut self, highlight: f32) -> &Film<'m> {
        let Self { film, largest } = self;
        let mut errors = film.begin_errors();
        film.show_errors(0, usize::MAX, &mut errors, largest, highlight);
        film.estimate_error(&mut errors, largest, u64::MAX);
        film
    }
}

// all planes of all auxiliary values fit the row of a pixel
const _: () = {
    let (mut n, mut i) = (0, 0);
    while i < super::Aov::ALL.len() {
        n += super::Aov::ALL[i].channels().len();
        i += 1;
    }
    assert!(n <= 64);
};
