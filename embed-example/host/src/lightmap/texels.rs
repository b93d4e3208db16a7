//! Which texels a surface covers, and where on it the samples of a texel begin.
//!
//! Texel (x, y), row 0 at the top, is the square from (x, y) to (x + 1, y + 1); coordinates (u, v) are at
//! `(u width, (1 - v) height)`. A texel is covered if any part of its square is: of a texel that is covered by triangles
//! as a whole or in part, samples are uniform over what is covered. So edges of charts are neither missed nor jagged, as
//! they are where only centres are looked at.

use super::charts::charts;
use super::clip::{Polygon, area, doubled_area, in_texel, shared_area};
use super::surface::{Patch, Surface};
use crate::text::excerpt;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Area of a texel below which it does not count as covered: rounding of texture coordinates.
const TOUCHED: f64 = 1e-6;
/// Area of a texel from which on two triangles overlap there.
const OVERLAPPING: f64 = 1.0 / 256.0;
/// Triangles in one texel up to which each pair is looked at; of more, only whether they have more area than the texel.
const PAIRED: usize = 32;

/// No chart: a texel that is not covered.
pub(super) const NO_CHART: u32 = u32::MAX;

/// Two objects, or one with itself, whose triangles share texels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Overlap {
    /// Names of the objects; twice the same if charts of one object overlap.
    pub objects: [String; 2],
    /// Texels that they share.
    pub texels: usize,
    /// Triangles that overlap others there.
    pub triangles: usize,
}

/// The overlap in words.
impl fmt::Display for Overlap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { objects: [a, b], texels, triangles } = self;
        let (a, b) = (excerpt(a), excerpt(b));
        if a == b {
            write!(f, "charts of object `{a}`")?
        } else {
            write!(f, "charts of the objects `{a}` and `{b}`")?
        }
        write!(f, " overlap in {texels} texels: {triangles} triangles share places in the map")
    }
}

/// A point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SurfaceSample {
    pub triangle: u32,
    pub instance: u32,
    /// Barycentric weights of vertices b and c.
    pub weights: [f32; 2],
}

/// What covers a texel.
#[derive(Clone, Copy)]
struct Cell {
    /// First of its pieces, or the one patch that covers all of it.
    first: u32,
    /// Number of its pieces, or [`WHOLE`].
    count: u32,
}

/// A texel within one patch.
const WHOLE: u32 = u32::MAX;

/// A triangle that is part of both a texel and a patch.
#[derive(Clone, Copy)]
struct Piece {
    patch: u32,
    /// Share of the covered area in the pieces up to this one.
    share: f32,
    /// Barycentric weights of the patch's vertices b and c at the corners.
    corners: [[f32; 2]; 3],
}

/// A patch in the plane of the map.
struct Flat {
    corners: [[f64; 2]; 3],
    doubled_area: f64,
}

impl Flat {
    fn new(patch: &Patch, [width, height]: [u32; 2]) -> Self {
        let corners =
            patch.uv.map(|[u, v]| [f64::from(u) * f64::from(width), (1.0 - f64::from(v)) * f64::from(height)]);
        Self { corners, doubled_area: doubled_area(corners) }
    }

    /// Barycentric weights of vertices b and c, within the triangle.
    fn weights(&self, p: [f64; 2]) -> [f32; 2] {
        let [a, b, c] = self.corners;
        let v = (doubled_area([c, a, p]) / self.doubled_area).clamp(0.0, 1.0);
        let w = (doubled_area([a, b, p]) / self.doubled_area).clamp(0.0, 1.0 - v);
        [v as f32, w as f32]
    }

    /// The part in a texel: the whole square if it lies within.
    fn part(&self, x: u32, y: u32) -> Part {
        let [l, t] = [x, y].map(f64::from);
        let square = [[l, t], [l + 1.0, t], [l + 1.0, t + 1.0], [l, t + 1.0]];
        let [a, b, c] = self.corners;
        let mut inside = true;
        for [p, q] in [[a, b], [b, c], [c, a]] {
            let behind = square.map(|r| doubled_area([p, q, r]) * self.doubled_area < 0.0);
            if behind == [true; 4] {
                return Part::Nothing;
            }
            inside &= behind == [false; 4];
        }
        if inside {
            return Part::Whole;
        }
        let polygon = in_texel(&self.corners, x, y);
        if area(&polygon) > TOUCHED { Part::Some(polygon) } else { Part::Nothing }
    }
}

/// What of a texel a patch covers.
enum Part {
    Nothing,
    Whole,
    Some(Polygon),
}

/// The texels of a map.
pub(super) struct Texels {
    pub size: [u32; 2],
    cells: Vec<Cell>,
    pieces: Vec<Piece>,
    patches: Vec<Patch>,
    flat: Vec<Flat>,
    /// Share of each texel that is covered, 0 to 1.
    pub coverage: Vec<f32>,
    /// Chart of each texel, the one with the most area in it; [`NO_CHART`] where none is.
    pub chart: Vec<u32>,
    /// Number of charts.
    pub charts: u32,
    /// Triangles whose charts overlap.
    pub overlaps: Vec<Overlap>,
}

impl Texels {
    pub(super) fn new(surface: &Surface, size: [u32; 2]) -> Self {
        let patches = surface.patches.clone();
        let flat: Vec<Flat> = patches.iter().map(|p| Flat::new(p, size)).collect();
        let of_patch = charts(&patches);
        let count = size[0] as usize * size[1] as usize;
        let mut texels = Self {
            size,
            cells: vec![Cell { first: 0, count: 0 }; count],
            pieces: Vec::new(),
            patches,
            flat,
            coverage: vec![0.0; count],
            chart: vec![NO_CHART; count],
            charts: of_patch.iter().max().map_or(0, |last| last + 1),
            overlaps: Vec::new(),
        };
        let mut found = Overlaps::default();
        for covered in texels.touched().chunk_by(|a, b| a[0] == b[0]) {
            texels.cover(covered, &of_patch, &mut found);
        }
        texels.overlaps = found.named(&surface.objects);
        texels
    }

    /// Every (texel, patch) where the patch covers some of the texel, sorted.
    fn touched(&self) -> Vec<[u32; 2]> {
        let mut out = Vec::new();
        for (number, flat) in (0..).zip(&self.flat).filter(|(_, f)| f.doubled_area != 0.0) {
            let range = |axis: usize| {
                let of = flat.corners.map(|p| p[axis]);
                let (low, high) = (of.into_iter().fold(f64::MAX, f64::min), of.into_iter().fold(f64::MIN, f64::max));
                (low.floor().max(0.0) as u32)..(high.ceil().min(f64::from(self.size[axis])) as u32)
            };
            for y in range(1) {
                for x in range(0) {
                    if !matches!(flat.part(x, y), Part::Nothing) {
                        out.push([y * self.size[0] + x, number]);
                    }
                }
            }
        }
        out.sort_unstable();
        out
    }

    /// Covers one texel.
    fn cover(&mut self, covered: &[[u32; 2]], of_patch: &[u32], found: &mut Overlaps) {
        let texel = covered[0][0];
        let (x, y) = (texel % self.size[0], texel / self.size[0]);
        let [l, t] = [x, y].map(f64::from);
        let square = || vec![[l, t], [l + 1.0, t], [l + 1.0, t + 1.0], [l, t + 1.0]];
        let parts: Vec<(u32, Polygon)> = covered
            .iter()
            .map(|[_, patch]| {
                let polygon = match self.flat[*patch as usize].part(x, y) {
                    Part::Nothing => Vec::new(),
                    Part::Whole => square(),
                    Part::Some(polygon) => polygon,
                };
                (*patch, polygon)
            })
            .collect();
        let areas: Vec<f64> = parts.iter().map(|(_, polygon)| area(polygon)).collect();
        let total: f64 = areas.iter().sum();
        let mut by_chart: BTreeMap<u32, f64> = BTreeMap::new();
        for ((patch, _), area) in parts.iter().zip(&areas) {
            *by_chart.entry(of_patch[*patch as usize]).or_default() += area;
        }
        let at = texel as usize;
        let largest = by_chart.into_iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)));
        self.chart[at] = largest.map_or(NO_CHART, |(chart, _)| chart);
        self.coverage[at] = total.min(1.0) as f32;
        self.find_overlaps(&parts, total, found);
        if let [(patch, _)] = parts[..]
            && total >= 1.0
        {
            self.cells[at] = Cell { first: patch, count: WHOLE };
            return;
        }
        let first = self.pieces.len();
        let mut sum = 0.0;
        for (patch, polygon) in &parts {
            let flat = &self.flat[*patch as usize];
            for pair in polygon.get(1..).unwrap_or_default().windows(2) {
                let corners = [polygon[0], pair[0], pair[1]];
                sum += doubled_area(corners).abs() / 2.0;
                let share = (sum / total).min(1.0) as f32;
                self.pieces.push(Piece { patch: *patch, share, corners: corners.map(|p| flat.weights(p)) });
            }
        }
        self.cells[at] = Cell { first: first as u32, count: (self.pieces.len() - first) as u32 };
    }

    fn find_overlaps(&self, parts: &[(u32, Polygon)], total: f64, found: &mut Overlaps) {
        let object = |patch: u32| self.patches[patch as usize].object;
        if parts.len() < 2 || (parts.len() > PAIRED && total < 1.0 + OVERLAPPING) {
            return;
        }
        if parts.len() > PAIRED {
            let patches = parts.iter().map(|p| p.0);
            found.add([object(parts[0].0); 2]).extend(patches);
            return;
        }
        let mut pairs = BTreeSet::new();
        for (i, (a, of_a)) in parts.iter().enumerate() {
            for (b, of_b) in &parts[i + 1..] {
                if shared_area(of_a, of_b) > OVERLAPPING {
                    let (x, y) = (object(*a), object(*b));
                    let pair = [x.min(y), x.max(y)];
                    let triangles = if pairs.insert(pair) { found.add(pair) } else { found.again(pair) };
                    triangles.extend([*a, *b]);
                }
            }
        }
    }

    /// Is any part of the texel covered?
    pub(super) fn is_covered(&self, texel: usize) -> bool {
        self.cells.get(texel).is_some_and(|c| c.count > 0)
    }

    /// The point of the covered part of a texel for two numbers in [0, 1), uniform if they are.
    pub(super) fn sample(&self, texel: usize, [u, v]: [f32; 2]) -> Option<SurfaceSample> {
        let cell = self.cells.get(texel).filter(|c| c.count > 0)?;
        if cell.count == WHOLE {
            let (x, y) = (texel as u32 % self.size[0], texel as u32 / self.size[0]);
            let p = [f64::from(x) + f64::from(u), f64::from(y) + f64::from(v)];
            return Some(self.on(cell.first, self.flat[cell.first as usize].weights(p)));
        }
        let pieces = self.pieces.get(cell.first as usize..(cell.first + cell.count) as usize)?;
        let at = pieces.partition_point(|p| p.share <= u).min(pieces.len() - 1);
        let before = at.checked_sub(1).map_or(0.0, |i| pieces[i].share);
        let piece = &pieces[at];
        // what is left of u is uniform again
        let u = ((u - before) / (piece.share - before)).clamp(0.0, 1.0);
        let root = u.sqrt();
        let share = [1.0 - root, root * (1.0 - v), root * v];
        let weight = |k: usize| (0..3).map(|i| share[i] * piece.corners[i][k]).sum::<f32>();
        Some(self.on(piece.patch, [weight(0), weight(1)]))
    }

    fn on(&self, patch: u32, weights: [f32; 2]) -> SurfaceSample {
        let Patch { triangle, instance, .. } = self.patches[patch as usize];
        SurfaceSample { triangle, instance, weights }
    }
}

/// Overlaps by pairs of objects: texels, and the patches in them.
#[derive(Default)]
struct Overlaps(BTreeMap<[u32; 2], (usize, BTreeSet<u32>)>);

impl Overlaps {
    /// Counts a texel; its patches are to be added.
    fn add(&mut self, pair: [u32; 2]) -> &mut BTreeSet<u32> {
        let (texels, patches) = self.0.entry(pair).or_default();
        *texels += 1;
        patches
    }

    /// The patches of a pair whose texel is counted.
    fn again(&mut self, pair: [u32; 2]) -> &mut BTreeSet<u32> {
        &mut self.0.entry(pair).or_default().1
    }

    fn named(self, objects: &[String]) -> Vec<Overlap> {
        let name = |i: u32| objects.get(i as usize).cloned().unwrap_or_default();
        let overlap = |(pair, (texels, patches)): ([u32; 2], (usize, BTreeSet<u32>))| Overlap {
            objects: pair.map(name),
            texels,
            triangles: patches.len(),
        };
        self.0.into_iter().map(overlap).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use croupier::unstable::scene::blob::NONE;

    fn surface(uv: &[[[f32; 2]; 3]]) -> Surface {
        let patch = |(triangle, uv): (u32, &[[f32; 2]; 3])| Patch {
            triangle,
            instance: NONE,
            object: 0,
            uv: *uv,
            corners: uv.map(|p| [p[0], p[1], 0.0]),
        };
        Surface {
            patches: (0..).zip(uv).map(patch).collect(),
            objects: vec!["thing".into()],
            triangles: uv.len(),
            opaque: Vec::new(),
        }
    }

    /// Samples lie within texel and triangle, and are uniform over what is covered: their mean is its centre of mass.
    /// Killed by: samples of another texel, a v that points down, a piece that is chosen too often, two roots or none.
    #[test]
    fn samples_are_uniform_over_what_is_covered() {
        let triangles = [[[0.1, 0.15], [0.9, 0.2], [0.35, 0.8]], [[0.9, 0.2], [0.95, 0.9], [0.35, 0.8]]];
        let texels = Texels::new(&surface(&triangles), [7, 5]);
        assert_eq!((texels.charts, texels.overlaps.len()), (1, 0));
        let n = 256;
        for texel in 0..35 {
            let (x, y) = ((texel % 7) as u32, (texel / 7) as u32);
            let parts: Vec<Polygon> =
                texels.flat.iter().map(|f| in_texel(&f.corners, x, y)).filter(|p| area(p) > TOUCHED).collect();
            let total: f64 = parts.iter().map(|p| area(p)).sum();
            assert_eq!(texels.is_covered(texel), total > 0.0);
            assert!((f64::from(texels.coverage[texel]) - total).abs() < 1e-6);
            if total == 0.0 {
                assert_eq!(texels.sample(texel, [0.5; 2]), None);
                continue;
            }
            let mut centre = [0.0; 2];
            for part in &parts {
                for pair in part[1..].windows(2) {
                    let corners = [part[0], pair[0], pair[1]];
                    let share = doubled_area(corners).abs() / 2.0 / total;
                    (0..2).for_each(|k| centre[k] += share * corners.iter().map(|p| p[k]).sum::<f64>() / 3.0);
                }
            }
            let mut mean = [0.0; 2];
            for i in 0..n * n {
                let numbers = [i % n, i / n].map(|i| (i as f32 + 0.5) / n as f32);
                let s = texels.sample(texel, numbers).unwrap();
                let [b, c] = s.weights.map(f64::from);
                let corners = texels.flat[s.triangle as usize].corners;
                let p: [f64; 2] =
                    std::array::from_fn(|k| corners[0][k] * (1.0 - b - c) + corners[1][k] * b + corners[2][k] * c);
                assert!(b >= 0.0 && c >= 0.0 && b + c < 1.0 + 1e-6);
                assert!(
                    (p[0] - f64::from(x) - 0.5).abs() < 0.5 + 1e-5 && (p[1] - f64::from(y) - 0.5).abs() < 0.5 + 1e-5
                );
                (0..2).for_each(|k| mean[k] += p[k] / (n * n) as f64);
            }
            for k in 0..2 {
                assert!((mean[k] - centre[k]).abs() < 0.01, "texel {texel}: {mean:?} is not {centre:?}");
            }
        }
        // row 0 is at the top
        assert!(texels.is_covered(6) && texels.is_covered(28) && !texels.is_covered(0));
    }

    /// Killed by: edges that neighbours share taken for overlaps, charts that overlap within a texel overlooked,
    /// triangles that are counted twice.
    #[test]
    fn overlaps_are_found() {
        let square = |l: f32, r: f32| [[[l, 0.0], [r, 0.0], [r, 1.0]], [[l, 0.0], [r, 1.0], [l, 1.0]]];
        let of = |b: [[[f32; 2]; 3]; 2]| Texels::new(&surface(&[square(0.0, 0.5), b].concat()), [8, 8]).overlaps;
        assert_eq!(of(square(0.5, 1.0)), []);
        let found = of(square(0.45, 1.0));
        let objects = ["thing".to_string(), "thing".to_string()];
        assert_eq!(found, [Overlap { objects, texels: 8, triangles: 4 }]);
    }
}
