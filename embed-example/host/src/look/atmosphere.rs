//! Clear atmosphere of the Earth: transmittance, and radiance of the sky with single and multiple scattering.
//!
//! The model is that of Hillaire, "A Scalable and Production Ready Sky and Atmosphere Rendering Technique" (EGSR 2020):
//! molecules (Rayleigh), aerosols (Mie, Henyey-Greenstein) and ozone over a ground sphere of albedo 0.3; light that is
//! scattered more than once is isotropic from its second scattering on (its section 5.5). Heights and aerosols are those
//! of its table 1. In place of three wavelengths there are eight, because three taken as red, green and blue make skies
//! too blue: scattering of molecules falls with the fourth power of the wavelength, the spectra of ozone and of the sun
//! are those of Bruneton, "Precomputed Atmospheric Scattering: a New Implementation" (2017). Colours come from the fits
//! of Wyman, Sloan and Shirley to the CIE 1931 observer (JCGT 2(2), 2013). Lengths are kilometres.

use std::f64::consts::PI;

type V = [f64; 3];
/// A value at each of [`WAVELENGTHS`].
type Spectrum = [f64; N];

/// Number of wavelengths.
const N: usize = 8;
/// Wavelengths, nanometres, in equal steps.
const WAVELENGTHS: Spectrum = [400.0, 440.0, 480.0, 520.0, 560.0, 600.0, 640.0, 680.0];
/// Irradiance of the sun outside of the atmosphere, W / m^2 / nm.
const SOLAR: Spectrum = [1.72765, 1.91198, 1.93377, 1.8685, 1.8341, 1.7533, 1.6048, 1.474];

/// Radius of the ground.
const GROUND: f64 = 6360.0;
/// Radius of the top of the atmosphere.
const TOP: f64 = 6460.0;
/// Height of the viewer above the ground: above the thickest haze.
const VIEWER: f64 = 0.2;
/// Scattering coefficient of the molecules at the ground for a wavelength of 1 micrometre; falls with its fourth power.
const RAYLEIGH: f64 = 1.24062e-3;
/// Height at which the density of the molecules has fallen to 1 / e.
const RAYLEIGH_SCALE: f64 = 8.0;
/// Scattering and absorption coefficient of the aerosols at the ground.
const MIE: [f64; 2] = [3.996e-3, 4.40e-3];
/// As [`RAYLEIGH_SCALE`], of the aerosols.
const MIE_SCALE: f64 = 1.2;
/// Mean cosine of the aerosols' phase function.
const MIE_G: f64 = 0.8;
/// Absorption coefficient of ozone where it is densest.
const OZONE: Spectrum = [8.2e-6, 8.5e-5, 4.164e-4, 1.1489e-3, 2.2916e-3, 2.6957e-3, 1.4299e-3, 6.49e-4];
/// Height where ozone is densest, and the distance from there at which there is none left.
const OZONE_LAYER: [f64; 2] = [25.0, 15.0];
/// Albedo of the ground below the atmosphere.
const ALBEDO: f64 = 0.3;
/// Steps of an integral along a ray.
const STEPS: usize = 40;
/// Entries of the table of transmittances: cosines, heights.
const TRANSMITTANCE: [usize; 2] = [96, 24];
/// Entries of the table of multiple scattering: cosines of the sun, heights.
const MULTIPLE: [usize; 2] = [16, 8];
/// Directions of an integral over the sphere: polar angles, azimuths.
const SPHERE: [usize; 2] = [8, 8];

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn along(p: V, d: V, t: f64) -> V {
    std::array::from_fn(|i| p[i] + d[i] * t)
}

fn spectrum(f: impl Fn(usize) -> f64) -> Spectrum {
    std::array::from_fn(f)
}

/// Scattering coefficients of the molecules at the ground.
fn rayleigh() -> Spectrum {
    WAVELENGTHS.map(|w| RAYLEIGH / (w * 1e-3).powi(4))
}

/// CIE 1931 colour matching functions x, y, z at a wavelength (Wyman et al., section 2.2).
fn observer(w: f64) -> V {
    let lobe = |middle: f64, below: f64, above: f64| {
        let t = (w - middle) * if w < middle { below } else { above };
        (-0.5 * t * t).exp()
    };
    [
        0.362 * lobe(442.0, 0.0624, 0.0374) + 1.056 * lobe(599.8, 0.0264, 0.0323) - 0.065 * lobe(501.1, 0.0490, 0.0382),
        0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322),
        1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725),
    ]
}

/// Linear Rec. 709 of a share of the sun's light; its scale is the callers'.
fn rgb(share: &Spectrum) -> V {
    let mut xyz = [0.0; 3];
    for ((w, sun), share) in WAVELENGTHS.into_iter().zip(SOLAR).zip(share) {
        let seen = observer(w);
        (0..3).for_each(|c| xyz[c] += seen[c] * sun * share);
    }
    let to_rgb =
        [[3.2404542, -1.5371385, -0.4985314], [-0.969266, 1.8760108, 0.041556], [0.0556434, -0.2040259, 1.0572252]];
    // saturated colours of a low sun leave the range of Rec. 709
    to_rgb.map(|row| dot(row, xyz).max(0.0))
}

/// Smallest positive distance along the unit direction `d` from `p` to the sphere of a radius around the origin.
fn sphere(p: V, d: V, radius: f64) -> Option<f64> {
    let (b, c) = (dot(p, d), dot(p, p) - radius * radius);
    let root = b * b - c;
    (root >= 0.0).then(|| [-b - root.sqrt(), -b + root.sqrt()])?.into_iter().find(|t| *t > 1e-6)
}

/// Coefficients at a height: scattering of molecules (those of the ground are `air`), of aerosols, extinction.
fn coefficients(air: &Spectrum, height: f64) -> (Spectrum, f64, Spectrum) {
    let molecules = (-height / RAYLEIGH_SCALE).exp();
    let rayleigh = air.map(|s| s * molecules);
    let mie = (-height / MIE_SCALE).exp();
    let ozone = (1.0 - (height - OZONE_LAYER[0]).abs() / OZONE_LAYER[1]).max(0.0);
    let extinction = spectrum(|c| rayleigh[c] + (MIE[0] + MIE[1]) * mie + OZONE[c] * ozone);
    (rayleigh, MIE[0] * mie, extinction)
}

/// Bilinear lookup at coordinates of 0 to 1.
fn lookup(table: &[Spectrum], [width, height]: [usize; 2], x: f64, y: f64) -> Spectrum {
    let place = |x: f64, n: usize| {
        let x = x.clamp(0.0, 1.0) * (n - 1) as f64;
        let i = (x as usize).min(n - 2);
        (i, x - i as f64)
    };
    let ((i, x), (j, y)) = (place(x, width), place(y, height));
    let row = |j: usize, c: usize| table[j * width + i][c] * (1.0 - x) + table[j * width + i + 1][c] * x;
    spectrum(|c| row(j, c) * (1.0 - y) + row(j + 1, c) * y)
}

/// What a ray through the atmosphere gathers.
struct Gathered {
    /// Radiance of the first scatterings, and of light that was scattered before if the tables know of it.
    radiance: Spectrum,
    /// Share of isotropic light of radiance 1 that is scattered into the ray.
    scattered: Spectrum,
    /// Transmittance from the ray's end.
    transmittance: Spectrum,
}

/// The atmosphere under the sun. Colours are linear Rec. 709 with a scale of their own, the same for sun and sky.
#[derive(Debug)]
pub struct Atmosphere {
    air: Spectrum,
    transmittance: Vec<Spectrum>,
    multiple: Vec<Spectrum>,
}

impl Default for Atmosphere {
    fn default() -> Self {
        Self::new()
    }
}

impl Atmosphere {
    /// Computes the tables.
    pub fn new() -> Self {
        let mut atmosphere = Self { air: rayleigh(), transmittance: Vec::new(), multiple: Vec::new() };
        let [width, height] = TRANSMITTANCE;
        atmosphere.transmittance = (0..width * height)
            .map(|k| {
                let [x, y] = [(k % width) as f64 / (width - 1) as f64, (k / width) as f64 / (height - 1) as f64];
                optical(&atmosphere.air, GROUND + (TOP - GROUND) * y * y, cosine_of(x))
            })
            .collect();
        let [width, height] = MULTIPLE;
        atmosphere.multiple = (0..width * height)
            .map(|k| {
                let [x, y] = [(k % width) as f64 / (width - 1) as f64, (k / width) as f64 / (height - 1) as f64];
                atmosphere.scattered_again(GROUND + 1e-3 + (TOP - GROUND - 2e-3) * y, 2.0 * x - 1.0)
            })
            .collect();
        atmosphere
    }

    /// Transmittance from the radius `r` to space under the cosine `mu` to the zenith; 0 through the ground.
    fn to_space(&self, r: f64, mu: f64) -> Spectrum {
        // the horizon, seen from r
        let horizon = -(1.0 - (GROUND / r).powi(2)).max(0.0).sqrt();
        if mu < horizon {
            return [0.0; N];
        }
        let height = ((r - GROUND) / (TOP - GROUND)).max(0.0).sqrt();
        lookup(&self.transmittance, TRANSMITTANCE, place_of(mu), height)
    }

    /// Light that has been scattered twice or more, per irradiance of the sun, at the radius `r` under the sun's cosine.
    fn again(&self, r: f64, mu_sun: f64) -> Spectrum {
        if self.multiple.is_empty() {
            return [0.0; N];
        }
        lookup(&self.multiple, MULTIPLE, (mu_sun + 1.0) / 2.0, (r - GROUND) / (TOP - GROUND))
    }

    /// Integrates along a ray, the sun in direction `sun`. Phase functions are isotropic with `isotropic`.
    fn gather(&self, p: V, d: V, sun: V, isotropic: bool) -> Gathered {
        let ground = sphere(p, d, GROUND);
        let length = ground.or_else(|| sphere(p, d, TOP)).unwrap_or(0.0);
        let cos = dot(d, sun);
        let uniform = 1.0 / (4.0 * PI);
        let rayleigh_phase = if isotropic { uniform } else { 3.0 / (16.0 * PI) * (1.0 + cos * cos) };
        let spread = 1.0 + MIE_G * MIE_G - 2.0 * MIE_G * cos;
        let mie_phase = if isotropic { uniform } else { uniform * (1.0 - MIE_G * MIE_G) / (spread * spread.sqrt()) };
        let mut out = Gathered { radiance: [0.0; N], scattered: [0.0; N], transmittance: [1.0; N] };
        for k in 0..STEPS {
            // shorter steps near the viewer, where the air is densest
            let [a, b] = [k, k + 1].map(|k| length * (k as f64 / STEPS as f64).powi(2));
            let q = along(p, d, (a + b) / 2.0);
            let r = dot(q, q).sqrt();
            let (rayleigh, mie, extinction) = coefficients(&self.air, (r - GROUND).max(0.0));
            let mu_sun = dot(q, sun) / r;
            let (lit, again) = (self.to_space(r, mu_sun), self.again(r, mu_sun));
            for c in 0..N {
                let scattering = rayleigh[c] + mie;
                let source = (rayleigh[c] * rayleigh_phase + mie * mie_phase) * lit[c] + scattering * again[c];
                let passes = (-extinction[c] * (b - a)).exp();
                // exact for constant coefficients
                let share = out.transmittance[c] * (1.0 - passes) / extinction[c];
                out.radiance[c] += share * source;
                out.scattered[c] += share * scattering;
                out.transmittance[c] *= passes;
            }
        }
        if let (true, Some(t)) = (isotropic, ground) {
            let q = along(p, d, t);
            let mu_sun = dot(q, sun) / GROUND;
            let lit = self.to_space(GROUND, mu_sun);
            for ((radiance, passes), lit) in out.radiance.iter_mut().zip(out.transmittance).zip(lit) {
                *radiance += passes * lit * mu_sun.max(0.0) * ALBEDO / PI;
            }
        }
        out
    }

    /// Equations 5 to 10 of the paper: second-order scattering over 1 less the share that is scattered once more.
    fn scattered_again(&self, r: f64, mu_sun: f64) -> Spectrum {
        let p = [0.0, r, 0.0];
        let sun = [(1.0 - mu_sun * mu_sun).max(0.0).sqrt(), mu_sun, 0.0];
        let (mut second, mut share) = ([0.0; N], [0.0; N]);
        let [rows, columns] = SPHERE;
        for k in 0..rows * columns {
            let y = 1.0 - 2.0 * ((k / columns) as f64 + 0.5) / rows as f64;
            let phi = 2.0 * PI * ((k % columns) as f64 + 0.5) / columns as f64;
            let s = (1.0 - y * y).sqrt();
            let g = self.gather(p, [s * phi.cos(), y, s * phi.sin()], sun, true);
            for c in 0..N {
                second[c] += g.radiance[c] / (rows * columns) as f64;
                share[c] += g.scattered[c] / (rows * columns) as f64;
            }
        }
        spectrum(|c| second[c] / (1.0 - share[c]).max(1e-3))
    }

    /// Radiance of the sky in the unit direction `d`, y up and not below the horizon, for the sun in the unit direction
    /// `sun`, without the sun's own disk.
    pub fn sky(&self, d: V, sun: V) -> V {
        // The viewer's horizon lies below y = 0 by a little; no ray may meet the ground.
        let [x, y, z] = d;
        let y = y.max(0.0);
        let scale = 1.0 / (x * x + y * y + z * z).sqrt();
        rgb(&self.gather([0.0, GROUND + VIEWER, 0.0], [x * scale, y * scale, z * scale], sun, false).radiance)
    }

    /// Irradiance of a surface that faces the sun at a cosine to the zenith.
    pub fn sun(&self, mu: f64) -> V {
        rgb(&self.to_space(GROUND + VIEWER, mu))
    }
}

/// Coordinate of 0 to 1 in the table of a cosine, most of them near the horizon.
fn place_of(mu: f64) -> f64 {
    0.5 + 0.5 * mu.signum() * mu.abs().sqrt()
}

fn cosine_of(x: f64) -> f64 {
    let s = 2.0 * x - 1.0;
    s.abs() * s
}

/// Transmittance from the radius `r` to space under the cosine `mu`, by integration; whatever the ground hides.
fn optical(air: &Spectrum, r: f64, mu: f64) -> Spectrum {
    let (p, d) = ([0.0, r, 0.0], [(1.0 - mu * mu).max(0.0).sqrt(), mu, 0.0]);
    let length = sphere(p, d, TOP).unwrap_or(0.0);
    let mut depth = [0.0; N];
    for k in 0..2 * STEPS {
        // shorter steps at the start, where the air is densest
        let [a, b] = [k, k + 1].map(|k| length * (k as f64 / (2 * STEPS) as f64).powi(2));
        let q = along(p, d, (a + b) / 2.0);
        // below the ground as at the ground, so that the table is smooth across the horizon
        let (_, _, extinction) = coefficients(air, (dot(q, q).sqrt() - GROUND).max(0.0));
        (0..N).for_each(|c| depth[c] += extinction[c] * (b - a));
    }
    depth.map(|t| (-t).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Optical depth of the zenith by the closed forms of the exponential layers and of the ozone tent. Killed by: a
    /// wrong scale height, a table that is not the integral, a horizon that hides nothing.
    #[test]
    fn transmittance_follows_the_layers() {
        let a = Atmosphere::new();
        let up = a.to_space(GROUND + VIEWER, 1.0);
        for c in 0..N {
            let layer = |s: f64, h: f64| s * h * ((-VIEWER / h).exp() - (-(TOP - GROUND) / h).exp());
            let air = layer(a.air[c], RAYLEIGH_SCALE) + layer(MIE[0] + MIE[1], MIE_SCALE);
            let depth = air + OZONE[c] * OZONE_LAYER[1];
            assert!((up[c].ln() + depth).abs() < 0.01 * depth, "{c}: {} for {depth}", -up[c].ln());
        }
        let [red, green, blue] = a.sun(0.02);
        assert!(red > 1.5 * green && green > 1.5 * blue, "{red} {green} {blue}");
        assert_eq!(a.sun(-0.1), [0.0; 3]);
    }

    /// Energy: what reaches the ground, direct and diffuse, is less than what arrives at the top, and most of it; the sky
    /// is blue at noon, its zenith bluer than its horizon. Killed by: a phase function that is not normalised, multiple
    /// scattering added twice.
    #[test]
    fn a_noon_sky_is_blue_and_gives_no_energy_away() {
        let a = Atmosphere::new();
        let (mu, n) = (0.8f64, 32);
        let sun = [(1.0 - mu * mu).sqrt(), mu, 0.0];
        let mut diffuse = [0.0; N];
        let p = [0.0, GROUND + VIEWER, 0.0];
        for k in 0..n * n {
            // uniform in y^2: the cosine is part of the density
            let y = ((f64::from(k / n) + 0.5) / f64::from(n)).sqrt();
            let phi = 2.0 * PI * (f64::from(k % n) + 0.5) / f64::from(n);
            let s = (1.0 - y * y).sqrt();
            let l = a.gather(p, [s * phi.cos(), y, s * phi.sin()], sun, false).radiance;
            (0..N).for_each(|c| diffuse[c] += PI * l[c] / f64::from(n * n));
        }
        let direct = a.to_space(GROUND + VIEWER, mu);
        for c in 0..N {
            let reaches = (direct[c] * mu + diffuse[c]) / mu;
            assert!(reaches > 0.7 && reaches < 1.0, "{c}: {reaches}");
        }
        assert!(diffuse[1] > 1.5 * diffuse[6] && diffuse[6] > 0.02, "{diffuse:?}");
        let (zenith, horizon) = (a.sky([0.0, 1.0, 0.0], sun), a.sky([0.0, 0.02, 1.0], sun));
        assert!(zenith[2] / zenith[0] > 1.3 * horizon[2] / horizon[0], "{zenith:?} {horizon:?}");
    }

    /// Equal energy is near white, a thin band at the red end is red. Killed by: rows of the matrix in another order.
    #[test]
    fn spectra_become_colours() {
        let white = rgb(&SOLAR.map(|s| 1.0 / s));
        let mean = white.iter().sum::<f64>() / 3.0;
        assert!(white.iter().all(|c| (c / mean - 1.0).abs() < 0.25), "{white:?}");
        let red = rgb(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        assert!(red[0] > 10.0 * red[1].max(red[2]), "{red:?}");
    }
}
