//! Real spherical harmonics up to band 2, rgb.
//!
//! Convention: Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment Maps, SIGGRAPH 2001,
//! equation 3, orthonormal over the sphere and without the phase of Condon and Shortley, for unit directions (x, y, z) in
//! world space:
//!
//! | index `l (l + 1) + m` | l, m | function |
//! |---|---|---|
//! | 0 | 0, 0 | 0.282095 |
//! | 1 | 1, -1 | 0.488603 y |
//! | 2 | 1, 0 | 0.488603 z |
//! | 3 | 1, 1 | 0.488603 x |
//! | 4 | 2, -2 | 1.092548 x y |
//! | 5 | 2, -1 | 1.092548 y z |
//! | 6 | 2, 0 | 0.315392 (3 z² - 1) |
//! | 7 | 2, 1 | 1.092548 x z |
//! | 8 | 2, 2 | 0.546274 (x² - y²) |

use std::f64::consts::PI;

/// Number of coefficients.
pub const COEFFICIENTS: usize = 9;

/// Values of all functions in a unit direction.
pub fn basis([x, y, z]: [f64; 3]) -> [f64; COEFFICIENTS] {
    let (band1, band2) = ((3.0 / (4.0 * PI)).sqrt(), (15.0 / (4.0 * PI)).sqrt());
    [
        (1.0 / (4.0 * PI)).sqrt(),
        band1 * y,
        band1 * z,
        band1 * x,
        band2 * x * y,
        band2 * y * z,
        (5.0 / (16.0 * PI)).sqrt() * (3.0 * z * z - 1.0),
        band2 * x * z,
        0.5 * band2 * (x * x - y * y),
    ]
}

/// Coefficients of a function over directions; [`basis`] has their order. Rgb each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Harmonics(pub [[f64; 3]; COEFFICIENTS]);

impl Harmonics {
    /// The function in a unit direction: what of it lies in the first three bands. May be negative.
    pub fn eval(&self, direction: [f64; 3]) -> [f64; 3] {
        self.weighted(direction, [1.0; 3])
    }

    /// Irradiance of a surface whose normal is the unit vector `n`, if the function is incident radiance (equation 5 of
    /// the paper; exact for radiance in the first three bands, within a few percent for most others). Radiance times
    /// steradian; a diffuse surface of albedo a shows a / pi of it.
    pub fn irradiance(&self, n: [f64; 3]) -> [f64; 3] {
        self.weighted(n, [PI, 2.0 * PI / 3.0, PI / 4.0])
    }

    /// Sum with a factor for each band.
    fn weighted(&self, direction: [f64; 3], band: [f64; 3]) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (i, (coefficient, value)) in self.0.iter().zip(basis(direction)).enumerate() {
            let factor = value * band[usize::from(i > 0) + usize::from(i > 3)];
            (0..3).for_each(|c| sum[c] += factor * coefficient[c]);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: a factor or a sign of any function, two that change places.
    #[test]
    fn functions_are_orthonormal() {
        let (rows, columns) = (64, 8);
        let mut products = [[0.0; COEFFICIENTS]; COEFFICIENTS];
        for i in 0..rows {
            // Gauss is not needed: polynomials of degree 4 in z by Simpson would be exact, the midpoint rule nearly is
            let z = (f64::from(i) + 0.5) / f64::from(rows) * 2.0 - 1.0;
            for j in 0..columns {
                let phi = f64::from(j) / f64::from(columns) * 2.0 * PI;
                let r = (1.0 - z * z).sqrt();
                let y = basis([r * phi.cos(), r * phi.sin(), z]);
                let weight = 4.0 * PI / f64::from(rows * columns);
                for a in 0..COEFFICIENTS {
                    (0..COEFFICIENTS).for_each(|b| products[a][b] += weight * y[a] * y[b]);
                }
            }
        }
        for (a, row) in products.iter().enumerate() {
            for (b, product) in row.iter().enumerate() {
                assert!((product - f64::from(u8::from(a == b))).abs() < 2e-3, "{a} {b}: {product}");
            }
        }
        // the paper's numbers
        let [x, y, z] = [0.36, 0.48, 0.8];
        let paper = [
            0.282095,
            0.488603 * y,
            0.488603 * z,
            0.488603 * x,
            1.092548 * x * y,
            1.092548 * y * z,
            0.315392 * (3.0 * z * z - 1.0),
            1.092548 * x * z,
            0.546274 * (x * x - y * y),
        ];
        for (a, b) in basis([x, y, z]).into_iter().zip(paper) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
    }
}
