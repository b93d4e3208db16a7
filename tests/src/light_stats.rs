//! Random numbers for tests and the chi-square test.

/// SplitMix64 (Steele, Lea, Flood, OOPSLA 2014): reproducible streams from any seed.
#[derive(Clone, Debug)]
pub struct Rng(pub u64);

impl Rng {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// 32 random bits.
    pub fn word(&mut self) -> u32 {
        (self.bits() >> 32) as u32
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [a, b).
    pub fn range(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }

    /// Uniform on the unit sphere.
    pub fn direction(&mut self) -> [f64; 3] {
        let (z, phi) = (self.range(-1.0, 1.0), self.range(0.0, std::f64::consts::TAU));
        let r = (1.0 - z * z).max(0.0).sqrt();
        [r * phi.cos(), z, r * phi.sin()]
    }
}

/// Logarithm of the gamma function for x > 0 (Stirling's series after shifting the argument above 10).
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 10.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let r = 1.0 / (x * x);
    shift + (x - 0.5) * x.ln() - x
        + 0.5 * std::f64::consts::TAU.ln()
        + (1.0 / 12.0 - r * (1.0 / 360.0 - r / 1260.0)) / x
}

/// Upper tail of the chi-square distribution: the regularised incomplete gamma function Q(freedom / 2, x / 2)
/// (Abramowitz and Stegun 6.5.29 and 6.5.31).
pub fn chi_square_tail(x: f64, freedom: usize) -> f64 {
    let (a, x) = (freedom as f64 / 2.0, x / 2.0);
    if x <= 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-15 {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        return 1.0 - front * sum;
    }
    // Lentz's evaluation of the continued fraction.
    let (mut b, mut c) = (x + 1.0 - a, 1e300);
    let mut d = 1.0 / b;
    let mut h = d;
    for i in 1..100_000 {
        let n = -f64::from(i) * (f64::from(i) - a);
        b += 2.0;
        d = 1.0 / (n * d + b);
        c = b + n / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front * h
}

/// p-value of `counts` against `expected`, bins pooled in their order until each expects at least 5.
///
/// # Panics
/// If a bin that expects nothing has a count, or the sums differ by more than 1e-3 of the total.
pub fn chi_square(counts: &[u64], expected: &[f64]) -> f64 {
    assert_eq!(counts.len(), expected.len());
    let (total, sum) = (counts.iter().sum::<u64>() as f64, expected.iter().sum::<f64>());
    assert!((total - sum).abs() <= 1e-3 * total, "{total} samples, {sum} expected");
    let (mut x, mut bins, mut n, mut e) = (0.0, 0usize, 0.0, 0.0);
    for (c, w) in counts.iter().zip(expected) {
        assert!(*w > 0.0 || *c == 0, "{c} samples where none can be");
        (n, e) = (n + *c as f64, e + w);
        if e >= 5.0 {
            x += (n - e) * (n - e) / e;
            (n, e, bins) = (0.0, 0.0, bins + 1);
        }
    }
    chi_square_tail(x + if e > 0.0 { (n - e) * (n - e) / e.max(1.0) } else { 0.0 }, bins.max(2) - 1)
}
