//! Scalar f64 oracles for lights, written from the definitions.

use std::f64::consts::{PI, TAU};

/// A vector.
pub type V = [f64; 3];

/// To f64.
pub fn wide(a: [f32; 3]) -> V {
    a.map(f64::from)
}

/// a - b.
pub fn sub(a: V, b: V) -> V {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// Dot product.
pub fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cross product.
pub fn cross(a: V, b: V) -> V {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Length.
pub fn length(a: V) -> f64 {
    dot(a, a).sqrt()
}

/// Unit vector.
pub fn unit(a: V) -> V {
    a.map(|x| x / length(a))
}

/// Area of a triangle.
pub fn area(p: [[f32; 3]; 3]) -> f64 {
    let [a, b, c] = p.map(wide);
    length(cross(sub(b, a), sub(c, a))) / 2.0
}

/// Solid angle of a triangle seen from `p` (Van Oosterom and Strackee 1983).
pub fn solid_angle(t: [[f32; 3]; 3], p: [f32; 3]) -> f64 {
    let [a, b, c] = t.map(|v| sub(wide(v), wide(p)));
    let (la, lb, lc) = (length(a), length(b), length(c));
    let below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    2.0 * dot(a, cross(b, c)).abs().atan2(below)
}

/// Distance along the unit direction `d` from `o` to the plane of a triangle.
pub fn plane_distance(t: [[f32; 3]; 3], o: V, d: V) -> f64 {
    let [a, b, c] = t.map(wide);
    let n = cross(sub(b, a), sub(c, a));
    dot(sub(a, o), n) / dot(d, n)
}

/// Irradiance at the origin of the plane y = 0 from a polygon of radiance 1 that emits to both sides (Lambert 1760):
/// half the sum over edges of the angle they subtend times the cosine between the floor's normal and that of the plane
/// through edge and origin, after clipping at the horizon.
pub fn polygon_irradiance(corners: &[V]) -> f64 {
    let mut above: Vec<V> = Vec::new();
    for (i, p) in corners.iter().enumerate() {
        let q = corners[(i + 1) % corners.len()];
        if p[1] >= 0.0 {
            above.push(*p);
        }
        if (p[1] < 0.0) != (q[1] < 0.0) {
            let t = p[1] / (p[1] - q[1]);
            above.push(std::array::from_fn(|c| p[c] + t * (q[c] - p[c])));
        }
    }
    let mut sum = 0.0;
    for (i, p) in above.iter().enumerate() {
        let q = above[(i + 1) % above.len()];
        let n = cross(*p, q);
        if length(n) > 0.0 {
            sum += length(n).atan2(dot(*p, q)) * n[1] / length(n);
        }
    }
    (sum / 2.0).abs()
}

/// Rec. 709 luminance.
pub fn luminance(c: V) -> f64 {
    0.212_671 * c[0] + 0.715_16 * c[1] + 0.072_169 * c[2]
}

/// A lat-long map in f64.
#[derive(Debug)]
pub struct Map {
    texels: Vec<V>,
    width: usize,
    height: usize,
}

/// Where a direction looks in a [`Map`].
#[derive(Clone, Copy, Debug)]
pub struct At {
    /// Left column.
    pub column: usize,
    /// Upper row.
    pub row: usize,
    /// Between the columns.
    pub x: f64,
    /// Between the rows, linear in the polar angle.
    pub y: f64,
    /// Share of the row's solid angle above.
    pub t: f64,
}

impl Map {
    /// From f32 texels.
    pub fn new(texels: &[[f32; 3]], width: usize, height: usize) -> Self {
        assert_eq!(texels.len(), width * height);
        Self { texels: texels.iter().map(|t| wide(*t)).collect(), width, height }
    }

    /// Columns of cells, rows of cells.
    pub fn cells(&self) -> [usize; 2] {
        [self.width, self.height - 1]
    }

    /// The place of `d` (map space, any length) by the words of the scene format.
    pub fn at(&self, d: V) -> At {
        let d = unit(d);
        let u = (d[0].atan2(-d[2]) / TAU).rem_euclid(1.0);
        let v = d[1].clamp(-1.0, 1.0).acos() / PI;
        let (column, row) = (u * self.width as f64 - 0.5, v * (self.height - 1) as f64);
        let j = (row.floor() as usize).min(self.height - 2);
        let [above, below] = self.cosines(j);
        At {
            column: column.floor().rem_euclid(self.width as f64) as usize,
            row: j,
            x: column - column.floor(),
            y: row - j as f64,
            t: (above - d[1]) / (above - below),
        }
    }

    /// Cosines of the polar angles of the upper and lower edge of a row of cells.
    pub fn cosines(&self, row: usize) -> [f64; 2] {
        [row, row + 1].map(|j| (PI * j as f64 / (self.height - 1) as f64).cos())
    }

    /// The unit direction at column position `x` and share `t` of the solid angle of a cell.
    pub fn direction(&self, column: usize, row: usize, x: f64, t: f64) -> V {
        let [above, below] = self.cosines(row);
        let y = above + t * (below - above);
        let (r, phi) = ((1.0 - y * y).max(0.0).sqrt(), TAU * (column as f64 + 0.5 + x) / self.width as f64);
        [r * phi.sin(), y, -r * phi.cos()]
    }

    /// Texel, wrapped in its row.
    pub fn texel(&self, column: usize, row: usize) -> V {
        self.texels[row * self.width + column % self.width]
    }

    /// Bilinear value.
    pub fn lookup(&self, d: V) -> V {
        let a = self.at(d);
        std::array::from_fn(|c| self.blend(a.column, a.row, a.x, a.y, |t| t[c]))
    }

    fn blend(&self, i: usize, j: usize, x: f64, y: f64, f: impl Fn(V) -> f64) -> f64 {
        let f = |i, j| f(self.texel(i, j));
        (f(i, j) * (1.0 - x) + f(i + 1, j) * x) * (1.0 - y) + (f(i, j + 1) * (1.0 - x) + f(i + 1, j + 1) * x) * y
    }

    /// Largest difference between the texels of the cell, over all channels: bounds the error that a small error of
    /// the place makes.
    pub fn contrast(&self, a: At) -> f64 {
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| self.texel(a.column + i, a.row + j));
        (0..3)
            .map(|c| {
                let v = corners.map(|k| k[c]);
                v.into_iter().fold(f64::MIN, f64::max) - v.into_iter().fold(f64::MAX, f64::min)
            })
            .fold(0.0, f64::max)
    }

    /// Integral of the bilinear luminance over a cell's solid angle, by the midpoint rule in the polar angle.
    pub fn cell_integral(&self, column: usize, row: usize) -> f64 {
        let n = 2000;
        let step = PI / (self.height - 1) as f64;
        (0..n)
            .map(|k| (f64::from(k) + 0.5) / f64::from(n))
            .map(|y| self.blend(column, row, 0.5, y, luminance) * ((row as f64 + y) * step).sin())
            .sum::<f64>()
            / f64::from(n)
            * step
            * TAU
            / self.width as f64
    }

    /// Probability of each cell, row by row: its share of the luminance above the mean over the sphere (Karlik et al.
    /// 2019), of all luminance if the map is even.
    pub fn probabilities(&self) -> Vec<f64> {
        let [w, h] = self.cells();
        let cells: Vec<f64> = (0..w * h).map(|k| self.cell_integral(k % w, k / w)).collect();
        let total: f64 = cells.iter().sum();
        let solid_angle = |j| {
            let [above, below] = self.cosines(j);
            (above - below) * TAU / w as f64
        };
        let above = |(k, c): (usize, &f64)| (c - total / (4.0 * PI) * solid_angle(k / w)).max(0.0);
        let left: Vec<f64> = cells.iter().enumerate().map(above).collect();
        let sum: f64 = left.iter().sum();
        if sum > 1e-3 * total {
            left.iter().map(|c| c / sum).collect()
        } else {
            cells.iter().map(|c| c / total).collect()
        }
    }

    /// Density of the place (x, t) in a cell, over the unit square: bilinear luminance, normalised.
    pub fn inside(&self, column: usize, row: usize, x: f64, t: f64) -> f64 {
        self.blend(column, row, x, t, luminance) / self.blend(column, row, 0.5, 0.5, luminance)
    }
}
