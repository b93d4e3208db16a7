//! Look-ups in the tables of principled materials.

use crate::scene::blob::{
    EnergyRow, LayerRecord, PRINCIPLED_COLUMNS, PRINCIPLED_ENERGY_ROWS, PRINCIPLED_NODES, PRINCIPLED_ROWS,
    ReflectionRow,
};
use croupier_simd::{F32x8, Mask8};

/// Squared cosines of the Gauss-Legendre rule on [0, 1] with [`PRINCIPLED_NODES`] points, and their weights: twice the
/// cosine-weighted mean over the hemisphere is the mean over the squared cosine.
pub const NODES: [(f32, f32); PRINCIPLED_NODES] = [
    (0.069_431_84, 0.173_927_42),
    (0.330_009_5, 0.326_072_58),
    (0.669_990_52, 0.326_072_58),
    (0.930_568_16, 0.173_927_42),
];

/// Tables of GGX reflection by roughness.
pub(super) type Reflections = [ReflectionRow; PRINCIPLED_ROWS];
/// Tables of the energy of solid transmission by roughness.
pub(super) type Energies = [EnergyRow; PRINCIPLED_ENERGY_ROWS];

/// What lanes without a table read: nothing is reflected.
pub(super) const NO_REFLECTIONS: &Reflections =
    &[ReflectionRow { columns: [[0.0, 0.0, 1.0, 0.0]; PRINCIPLED_COLUMNS], nodes: [[0.0; 2]; PRINCIPLED_NODES] };
        PRINCIPLED_ROWS];

/// A place in a table along one axis: the cell of each lane and the weight of its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell8 {
    index: [i32; 8],
    weight: F32x8,
}

impl Cell8 {
    /// Of `x` in 0..=1 among `entries` entries.
    #[inline(always)]
    fn new(x: F32x8, entries: usize) -> Self {
        let last = entries.saturating_sub(1) as f32;
        let x = x.clamp(0.0, 1.0) * last;
        let cell = x.floor().min(F32x8::splat(last - 1.0));
        Self { index: cell.to_i32().to_array(), weight: x - cell }
    }

    /// Of a cosine.
    #[inline(always)]
    pub(super) fn cosine(mu: F32x8) -> Self {
        Self::new(mu.abs().safe_sqrt(), PRINCIPLED_COLUMNS)
    }

    #[inline(always)]
    fn at(&self, lane: usize) -> usize {
        self.index[lane & 7] as usize
    }
}

/// Albedo of a layer at each lane's cosine.
#[inline(always)]
pub(super) fn layer(tables: &[&LayerRecord; 8], mu: Cell8) -> F32x8 {
    let entry = |l: usize, step: usize| tables[l].albedo.get(mu.at(l).wrapping_add(step)).copied().unwrap_or(0.0);
    let (a, b) = (F32x8::from_fn(|l| entry(l, 0)), F32x8::from_fn(|l| entry(l, 1)));
    a + mu.weight * (b - a)
}

/// GGX reflection at one direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reflection8 {
    /// Single-scattering albedo of Schlick's term `1 - (1 - c)^5`.
    pub(super) normal: F32x8,
    /// That of `(1 - c)^5`.
    pub(super) grazing: F32x8,
    /// Factor of compensation.
    pub(super) s: F32x8,
}

/// The rows of eight lanes between which their roughnesses lie.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows8<'s> {
    tables: [&'s Reflections; 8],
    row: Cell8,
}

impl<'s> Rows8<'s> {
    #[inline(always)]
    pub(super) fn new(tables: [&'s Reflections; 8], roughness: F32x8) -> Self {
        Self { tables, row: Cell8::new(roughness, PRINCIPLED_ROWS) }
    }

    #[inline(always)]
    fn lane(&self, l: usize, step: usize) -> Option<&'s ReflectionRow> {
        self.tables[l].get(self.row.at(l).wrapping_add(step))
    }

    /// Reflection at each lane's cosine.
    #[inline(always)]
    pub(super) fn reflection(&self, mu: Cell8) -> Reflection8 {
        const NOTHING: [f32; 4] = [0.0, 0.0, 1.0, 0.0];
        let (tx, ty) = (mu.weight.to_array(), self.row.weight.to_array());
        let mut out = [[0.0f32; 8]; 3];
        for l in 0..8 {
            let entry = |row: usize, column: usize| {
                let row = self.lane(l, row).and_then(|r| r.columns.get(mu.at(l).wrapping_add(column)));
                row.copied().unwrap_or(NOTHING)
            };
            let (a, b, c, d) = (entry(0, 0), entry(0, 1), entry(1, 0), entry(1, 1));
            for (k, out) in out.iter_mut().enumerate() {
                let lower = a[k] + tx[l] * (b[k] - a[k]);
                let upper = c[k] + tx[l] * (d[k] - c[k]);
                out[l] = lower + ty[l] * (upper - lower);
            }
        }
        let [normal, grazing, s] = out.map(F32x8::new);
        Reflection8 { normal, grazing, s }
    }

    /// The two albedos at node `k` of the quadrature.
    #[inline(always)]
    pub(super) fn node(&self, k: usize) -> [F32x8; 2] {
        let entry = |l: usize, step: usize, which: usize| {
            self.lane(l, step).and_then(|r| r.nodes.get(k)).map_or(0.0, |n| n[which & 1])
        };
        [0, 1].map(|which| {
            let (a, b) = (F32x8::from_fn(|l| entry(l, 0, which)), F32x8::from_fn(|l| entry(l, 1, which)));
            a + self.row.weight * (b - a)
        })
    }
}

/// Energy that rough interfaces scatter, seen from inside in the lanes of `below`; 1 where there is no table.
#[inline(always)]
pub(super) fn energy(tables: &[Option<&Energies>; 8], roughness: F32x8, mu: Cell8, below: Mask8) -> F32x8 {
    let row = Cell8::new(roughness, PRINCIPLED_ENERGY_ROWS);
    let side = |l: usize| usize::from(below.lane(l));
    let entry = |l: usize, step: usize, column: usize| {
        let row = tables[l].and_then(|t| t.get(row.at(l).wrapping_add(step)));
        row.and_then(|r| r.sides[side(l)].get(mu.at(l).wrapping_add(column))).copied().unwrap_or(1.0)
    };
    let mix = |step: usize| {
        let (a, b) = (F32x8::from_fn(|l| entry(l, step, 0)), F32x8::from_fn(|l| entry(l, step, 1)));
        a + mu.weight * (b - a)
    };
    let (a, b) = (mix(0), mix(1));
    a + row.weight * (b - a)
}
