//! LDR-FLIP: the difference that an observer sees who flips between two images.
//!
//! P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström, M. D. Fairchild: "FLIP: A Difference Evaluator
//! for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020.
//!
//! *Colour*: opponent space YCxCz -> blurred by the eye's contrast sensitivity -> clamped to the gamut -> L*a*b* with
//! Hunt's adjustment -> HyAB distance -> compressed to [0, 1]. *Features*: edges and points of the achromatic channel,
//! the larger difference of the two. *Both*: error = colour^(1 - feature).
//!
//! The filters are (sums of) products of a row and a column filter; beyond the image's edge the nearest pixel repeats.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Viewing conditions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Viewing {
    /// Pixels per degree of visual angle, > 0.
    pub pixels_per_degree: f64,
}

impl Default for Viewing {
    /// The paper's: 0.7 m from a screen of 3840 pixels on 0.7 m; 67 pixels per degree.
    fn default() -> Self {
        Self { pixels_per_degree: 0.7 * 3840.0 / 0.7 * PI / 180.0 }
    }
}

/// Exponent that compresses colour differences (the paper's q_c).
const COLOR_EXPONENT: f64 = 0.7;
/// Colour differences below the part `KNEE` (p_c) of the largest use the range [0, `KNEE_VALUE`] (p_t).
const KNEE: f64 = 0.4;
const KNEE_VALUE: f64 = 0.95;
/// Width of the feature detectors in degrees (w).
const FEATURE_WIDTH: f64 = 0.082;
/// Exponent of feature differences (q_f).
const FEATURE_EXPONENT: f64 = 0.5;
/// Contrast sensitivity of Y, Cx, Cz as sums of Gaussians a exp(-b f²) over the frequency f in cycles per degree: (a,
/// b) (the paper's table 1).
const SENSITIVITY: [[(f64, f64); 2]; 3] =
    [[(1.0, 0.0047), (0.0, 1e-5)], [(1.0, 0.0053), (0.0, 1e-5)], [(34.1, 0.04), (13.5, 0.025)]];

/// Linear Rec. 709 to XYZ.
const XYZ: [[f64; 3]; 3] = [
    [10_135_552.0 / 24_577_794.0, 8_788_810.0 / 24_577_794.0, 4_435_075.0 / 24_577_794.0],
    [2_613_072.0 / 12_288_897.0, 8_788_810.0 / 12_288_897.0, 887_015.0 / 12_288_897.0],
    [1_425_312.0 / 73_733_382.0, 8_788_810.0 / 73_733_382.0, 70_074_185.0 / 73_733_382.0],
];

/// One value per pixel, row by row.
struct Plane {
    width: usize,
    values: Vec<f64>,
}

/// The error map in [0, 1], row by row, of two images of `width * height` linear Rec. 709 pixels in [0, 1] (a picture
/// as the display shows it, before the sRGB transfer function); symmetric in the two. Values outside are clamped, NaN
/// and missing pixels are black.
pub fn flip(width: usize, height: usize, reference: &[[f32; 3]], test: &[[f32; 3]], viewing: Viewing) -> Vec<f64> {
    let [a, b] = [reference, test].map(|pixels| Seen::new(width, height, pixels, viewing));
    let largest = hyab(hunt_lab([0.0, 1.0, 0.0]), hunt_lab([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    let pixel = |i: usize| {
        let color = compress(hyab(a.color[i], b.color[i]).powf(COLOR_EXPONENT), largest);
        let edge = (a.edge[i] - b.edge[i]).abs();
        let point = (a.point[i] - b.point[i]).abs();
        let feature = (FRAC_1_SQRT_2 * edge.max(point)).powf(FEATURE_EXPONENT).min(1.0);
        color.powf(1.0 - feature)
    };
    (0..width * height).map(pixel).collect()
}

/// Features of one image as an observer perceives them.
struct Seen {
    /// Hunt-adjusted L*a*b* of the blurred image.
    color: Vec<[f64; 3]>,
    /// Strength of edges.
    edge: Vec<f64>,
    /// Strength of points.
    point: Vec<f64>,
}

impl Seen {
    fn new(width: usize, height: usize, pixels: &[[f32; 3]], viewing: Viewing) -> Self {
        let mut opponent: Vec<[f64; 3]> = pixels
            .iter()
            .map(|p| opponent_from_rgb(p.map(|x| if x.is_nan() { 0.0 } else { f64::from(x).clamp(0.0, 1.0) })))
            .collect();
        opponent.resize(width * height, opponent_from_rgb([0.0; 3]));
        let ppd = viewing.pixels_per_degree;
        let plane = |c: usize| Plane { width, values: opponent.iter().map(|p| p[c]).collect() };

        let blurred = [0, 1, 2].map(|c| sensitivity_filter(&plane(c), &SENSITIVITY[c], ppd));
        let shown = |i: usize| rgb_from_opponent([0, 1, 2].map(|c| blurred[c][i])).map(|x| x.clamp(0.0, 1.0));
        let color = (0..width * height).map(|i| hunt_lab(shown(i))).collect();

        let luminance = Plane { width, values: opponent.iter().map(|p| (p[0] + 16.0) / 116.0).collect() };
        let (edge, point) = features(&luminance, ppd);
        Self { color, edge, point }
    }
}

/// The image of one opponent channel on the retina: each Gaussian a exp(-b f²) over frequencies is the Gaussian a
/// sqrt(pi / b) exp(-pi² x² / b) over degrees. The filter as a whole has sum 1; all three channels use the radius of
/// the widest one.
fn sensitivity_filter(plane: &Plane, gaussians: &[(f64, f64); 2], ppd: f64) -> Vec<f64> {
    let widest = SENSITIVITY.iter().flatten().map(|g| g.1).fold(0.0, f64::max);
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * ppd).ceil() as usize;
    let kernels = gaussians.map(|(_, b)| kernel(radius, |x| (-PI * PI * (x / ppd).powi(2) / b).exp()));
    let weights = gaussians.map(|(a, b)| a * (PI / b).sqrt());
    let total: f64 = kernels.iter().zip(weights).map(|(k, w)| w * k.iter().sum::<f64>().powi(2)).sum();
    let mut sum = vec![0.0; plane.values.len()];
    for (k, w) in kernels.iter().zip(weights) {
        if w > 0.0 {
            for (s, x) in sum.iter_mut().zip(plane.convolve(k, k)) {
                *s += w / total * x;
            }
        }
    }
    sum
}

/// Strengths of edges and of points: lengths of the responses to the first and to the second derivatives of a Gaussian
/// along x and y. The positive weights of each filter sum to 1, the negative to -1.
fn features(luminance: &Plane, ppd: f64) -> (Vec<f64>, Vec<f64>) {
    let sigma = 0.5 * FEATURE_WIDTH * ppd;
    let radius = (3.0 * sigma).ceil() as usize;
    let gaussian = |x: f64| (-x * x / (2.0 * sigma * sigma)).exp();
    let smooth = kernel(radius, gaussian);
    let total: f64 = smooth.iter().sum();
    let smooth: Vec<f64> = smooth.iter().map(|w| w / total).collect();
    let strength = |derivative: Vec<f64>| -> Vec<f64> {
        let positive: f64 = derivative.iter().filter(|w| **w > 0.0).sum();
        let negative: f64 = -derivative.iter().filter(|w| **w < 0.0).sum::<f64>();
        let detect: Vec<f64> = derivative.iter().map(|w| w / if *w > 0.0 { positive } else { negative }).collect();
        let x = luminance.convolve(&detect, &smooth);
        let y = luminance.convolve(&smooth, &detect);
        x.iter().zip(y).map(|(x, y)| x.hypot(y)).collect()
    };
    let edge = strength(kernel(radius, |x| -x * gaussian(x)));
    let point = strength(kernel(radius, |x| (x * x / (sigma * sigma) - 1.0) * gaussian(x)));
    (edge, point)
}

/// Weights at -radius, ..., radius pixels.
fn kernel(radius: usize, weight: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..=2 * radius).map(|i| weight(i as f64 - radius as f64)).collect()
}

impl Plane {
    /// Convolution with `row[x] * column[y]`, both of odd length.
    fn convolve(&self, row: &[f64], column: &[f64]) -> Vec<f64> {
        let width = self.width;
        let height = self.values.len().checked_div(width).unwrap_or(0);
        let nearest = |i: usize, k: usize, radius: usize, n: usize| (i + k).saturating_sub(radius).min(n - 1);
        let mut middle = vec![0.0; self.values.len()];
        for (i, m) in middle.iter_mut().enumerate() {
            let (x, start) = (i % width, i / width * width);
            *m =
                row.iter().enumerate().map(|(k, w)| w * self.values[start + nearest(x, k, row.len() / 2, width)]).sum();
        }
        let mut out = vec![0.0; self.values.len()];
        for (y, line) in out.chunks_mut(width.max(1)).enumerate() {
            for (k, w) in column.iter().enumerate() {
                let from = nearest(y, k, column.len() / 2, height) * width;
                for (o, m) in line.iter_mut().zip(&middle[from..]) {
                    *o += w * m;
                }
            }
        }
        out
    }
}

/// Maps [0, `largest`] to [0, 1] by two straight lines.
fn compress(difference: f64, largest: f64) -> f64 {
    let knee = KNEE * largest;
    if difference < knee {
        KNEE_VALUE / knee * difference
    } else {
        KNEE_VALUE + (difference - knee) / (largest - knee) * (1.0 - KNEE_VALUE)
    }
}

/// City-block distance in lightness plus Euclidean distance in chroma.
fn hyab(p: [f64; 3], q: [f64; 3]) -> f64 {
    (p[0] - q[0]).abs() + (p[1] - q[1]).hypot(p[2] - q[2])
}

/// L*a*b* with the chroma scaled by L*/100: colours look less colourful in the dark (Hunt).
fn hunt_lab(rgb: [f64; 3]) -> [f64; 3] {
    const DELTA: f64 = 6.0 / 29.0;
    let f = |t: f64| if t > DELTA.powi(3) { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = xyz_relative_to_white(rgb).map(f);
    let lightness = 116.0 * y - 16.0;
    [lightness, 0.01 * lightness * 500.0 * (x - y), 0.01 * lightness * 200.0 * (y - z)]
}

/// YCxCz: L*a*b* without its cube roots.
fn opponent_from_rgb(rgb: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = xyz_relative_to_white(rgb);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn rgb_from_opponent([l, cx, cz]: [f64; 3]) -> [f64; 3] {
    let y = (l + 16.0) / 116.0;
    let relative = [y + cx / 500.0, y, y - cz / 200.0];
    // Cramer's rule on the 3x3 matrix: its inverse is needed nowhere else.
    let xyz = [0, 1, 2].map(|i| relative[i] * XYZ[i].iter().sum::<f64>());
    let column = |j: usize| [XYZ[0][j], XYZ[1][j], XYZ[2][j]];
    let [r, g, b] = [column(0), column(1), column(2)];
    let det = determinant(r, g, b);
    [determinant(xyz, g, b) / det, determinant(r, xyz, b) / det, determinant(r, g, xyz) / det]
}

fn determinant(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> f64 {
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
}

fn xyz_relative_to_white(rgb: [f64; 3]) -> [f64; 3] {
    XYZ.map(|row| row.iter().zip(rgb).map(|(m, x)| m * x).sum::<f64>() / row.iter().sum::<f64>())
}
