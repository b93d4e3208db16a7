//! From parts to a blob.
//!
//! 1. Every part is checked, so that what is written passes [`Scene::from_bytes`](crate::Scene::from_bytes).
//! 2. Sections of known length are written, triangles before the lights that refer to them.
//! 3. The tree is built behind them: nodes, then leaves. How many there are is known only then; the leaves move up to
//! the
//!    nodes.

use super::draft::{Draft, Length, records};
use super::error::{ComposeError, PerRecord};
use super::geometry::{area, has_area, vertex_normal};
use super::lat_long::LatLong;
use super::materials;
use super::math::Portable;
use super::parts::{ComposeLayout, SceneParts, Surround};
use crate::accel::{Built, Primitive, build_triangles};
use crate::edit::light_table;
use crate::light::{self, SceneExtent, luminance};
use crate::memory::{Carver, Measure, MemoryError};
use crate::scene::blob::*;
use crate::scene::{Field, Records, SceneError, SectionFault, check};
use bytemuck::Zeroable;
use core::f64::consts::TAU;
use core::ops::Range;

/// Most vertices, triangles and lights: child references have 27 bits for leaves.
const MOST: usize = (1 << 27) - 1;

/// Counts of a checked scene.
struct Counts {
    /// Triangles with an area.
    triangles: usize,
    /// Those of them that emit.
    emitters: usize,
    /// Entries of all tables of materials.
    tables: usize,
    environment: Option<Environment>,
}

impl Counts {
    fn lights(&self, parts: &SceneParts<'_>) -> usize {
        self.emitters + parts.lights.len() + usize::from(self.environment.is_some())
    }
}

/// Nodes that a tree over `n` triangles takes at most. A node with fewer than eight children has leaves only, at least
/// two of
/// them, and, but for the root, more than eight triangles; so with `f` full nodes and `p` others, p <= n / 9 and
/// 8 f + 2 p <= f + p - 1 + n.
fn most_nodes(triangles: usize) -> usize {
    if triangles == 0 { 0 } else { triangles.saturating_mul(5) / 21 + 1 }
}

/// The map of an environment that has one, if its size is right.
fn map_of<'a>(surround: &Surround<'a>) -> Result<Option<LatLong<'a>>, SceneError> {
    let Surround::Map { size, texels, .. } = *surround else { return Ok(None) };
    let of = SectionKind::Environment;
    for ((field, n), least) in [Field::Width, Field::Height].into_iter().zip(size).zip([1, 2]) {
        if n < least || n > MAX_SIDE {
            return Err(SceneError::Number { of, index: 0, field, found: n as f32 });
        }
    }
    let fault = SectionFault::Count(texels.len() as u64);
    let wrong = SceneError::Section { kind: SectionKind::EnvTexels, fault };
    LatLong::new(texels, size).map(Some).ok_or(wrong)
}

/// The record of an environment whose light is `light`; none if it is black.
fn environment(surround: &Surround<'_>, light: usize) -> Result<Option<Environment>, SceneError> {
    let of = SectionKind::Environment;
    let light = light as u32;
    let map = map_of(surround)?;
    let found = match *surround {
        Surround::Constant { radiance } => {
            let to_local = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            Environment { kind: EnvironmentKind::Constant as u32, light, radiance, to_local, ..Zeroable::zeroed() }
        }
        Surround::Map { size: [width, height], scale, to_world: [[a, b, c], [d, e, f], [g, h, i]], .. } => {
            Environment {
                kind: EnvironmentKind::Map as u32,
                light,
                width,
                height,
                // the inverse of a rotation
                to_local: [[a, d, g], [b, e, h], [c, f, i]],
                radiance: scale,
            }
        }
    };
    let mut brightest = [0.0f32; 3];
    for (index, texel) in (0u32..).zip(map.map_or(&[][..], |map| map.texels())) {
        check::emission(SectionKind::EnvTexels, index, texel)?;
        brightest.iter_mut().zip(texel).for_each(|(b, x)| *b = b.max(*x));
    }
    check::emission(of, 0, &found.radiance)?;
    check::environment(&found, brightest)?;
    let black = found.radiance == [0.0; 3] || (map.is_some() && brightest == [0.0; 3]);
    Ok((!black).then_some(found))
}

impl SceneParts<'_> {
    /// Checks all parts and says how much memory composing takes.
    ///
    /// # Errors
    /// The first part that cannot be part of a scene.
    pub fn layout(&self) -> Result<ComposeLayout, ComposeError> {
        self.layout_of(&self.check()?)
    }

    fn layout_of(&self, counts: &Counts) -> Result<ComposeLayout, ComposeError> {
        let blob = self.fixed(counts).with::<Node>(most_nodes(counts.triangles)).with::<Leaf>(counts.triangles);
        let blob = Measure(blob.0).layout();
        let scratch = Measure::new().add::<Primitive>(counts.triangles).layout();
        let too_large = |given| MemoryError::TooSmall { needed: usize::MAX, given };
        Ok(ComposeLayout {
            blob: blob.ok_or(ComposeError::Blob(too_large(0)))?,
            scratch: scratch.ok_or(ComposeError::Scratch(too_large(0)))?,
        })
    }

    /// Composes the blob of the scene at the start of `blob`, and returns it. Both blocks must be aligned to
    /// [`BLOCK_ALIGN`](crate::BLOCK_ALIGN); [`Self::layout`] says how large they must be. Nothing is read from them.
    ///
    /// The same parts give the same bytes. Takes some microseconds a triangle, and 10^6 evaluations of Fresnel's
    /// equations
    /// for each rough plastic without a table.
    ///
    /// # Errors
    /// The first part that cannot be part of a scene, a block that is too small or misaligned. The blocks may have
    /// changed then.
    pub fn compose<'m>(&self, blob: &'m mut [u8], scratch: &mut [u8]) -> Result<&'m mut [u8], ComposeError> {
        let counts = self.check()?;
        let layout = self.layout_of(&counts)?;
        let needed = layout.blob.size;
        let given = blob.len();
        let too_small = |e| match e {
            MemoryError::Misaligned => ComposeError::Blob(MemoryError::Misaligned),
            MemoryError::TooSmall { .. } => ComposeError::Blob(MemoryError::TooSmall { needed, given }),
        };
        let mut carver = Carver::new(scratch, layout.scratch).map_err(ComposeError::Scratch)?;
        let primitives = carver.take_unset(counts.triangles).map_err(ComposeError::Scratch)?;
        self.write(blob, primitives, &counts).map_err(too_small)
    }

    /// Bytes of the sections of known length.
    fn fixed(&self, counts: &Counts) -> Length {
        let lights = counts.lights(self);
        let mut length = Length::new()
            .with::<SceneInfo>(1)
            .with::<Camera>(1)
            .with::<Triangle>(counts.triangles)
            .with::<Vertex>(self.positions.len())
            .with::<Material>(self.materials.len())
            .with::<Texture>(self.textures.len())
            .with::<u32>(self.texels.len())
            .with::<f32>(counts.tables)
            .with::<u8>(self.names.len())
            .with::<Light>(lights)
            .with::<Alias>(lights)
            .with::<Medium>(self.media.len());
        if let (Some(_), Some(surround)) = (&counts.environment, &self.environment) {
            length = length.with::<Environment>(1);
            if let Ok(Some(map)) = map_of(surround) {
                length = length.with::<[f32; 3]>(map.texels().len()).with::<Alias>(map.entries());
            }
        }
        length
    }

    fn check(&self) -> Result<Counts, ComposeError> {
        check::camera(&self.camera)?;
        let vertices = self.positions.len();
        let each = |what, found: usize, records: usize| {
            if found == 0 || found == records { Ok(()) } else { Err(ComposeError::Length { what, found, records }) }
        };
        each(PerRecord::Normals, self.normals.len(), vertices)?;
        each(PerRecord::Uvs, self.uvs.len(), vertices)?;
        each(PerRecord::TriangleMaterials, self.triangle_materials.len(), self.triangles.len())?;
        each(PerRecord::Emission, self.emission.len(), self.materials.len())?;
        for (of, found, most) in [
            (SectionKind::Vertices, vertices, MOST),
            (SectionKind::Triangles, self.triangles.len(), MOST),
            (SectionKind::Lights, self.lights.len(), MOST),
            (SectionKind::Materials, self.materials.len(), MOST),
            (SectionKind::Textures, self.textures.len(), MOST),
            (SectionKind::Texels, self.texels.len(), i32::MAX as usize),
            (SectionKind::Tables, self.tables.len(), MOST),
            (SectionKind::Names, self.names.len(), i32::MAX as usize),
        ] {
            if found > most {
                return Err(ComposeError::TooMany { of, found, most });
            }
        }
        for (index, m) in (0u32..).zip(self.media) {
            if m.kind == MediumKind::Grid as u32 {
                return Err(ComposeError::Grid { index });
            }
        }
        let derived = materials::check(self)?;
        for (index, rgb) in (0u32..).zip(self.emission) {
            check::emission(SectionKind::Materials, index, rgb)?;
        }
        for index in 0..vertices {
            check::vertex(index as u32, &self.vertex(index, false))?;
        }
        let (triangles, emitters) = self.check_triangles()?;
        let shapes = self.check_lights()?;
        let environment = match &self.environment {
            Some(surround) => environment(surround, emitters + self.lights.len() - shapes)?,
            None => None,
        };
        let counts = Counts { triangles, emitters, tables: self.tables.len() + derived, environment };
        match counts.lights(self) {
            found if found > MOST => Err(ComposeError::TooMany { of: SectionKind::Lights, found, most: MOST }),
            _ => Ok(counts),
        }
    }

    /// Triangles that have an area, and those of them that emit.
    fn check_triangles(&self) -> Result<(usize, usize), ComposeError> {
        let (mut kept, mut emitters) = (0, 0);
        for (i, t) in self.triangles.iter().enumerate() {
            let (of, index) = (SectionKind::Triangles, i as u32);
            let wrong = |to, found, count: usize| SceneError::Reference { of, index, to, found, count: count as u32 };
            if let Some(v) = t.iter().find(|v| **v as usize >= self.positions.len()) {
                return Err(wrong(SectionKind::Vertices, *v, self.positions.len()).into());
            }
            let material = self.material_of(i);
            if material as usize >= self.materials.len() {
                return Err(wrong(SectionKind::Materials, material, self.materials.len()).into());
            }
            if has_area::<Portable>(&self.corners(t)) {
                kept += 1;
                emitters += usize::from(self.emission_of(material) != [0.0; 3]);
            }
        }
        Ok((kept, emitters))
    }

    /// Checks the lights that are given; how many have a shape.
    fn check_lights(&self) -> Result<usize, ComposeError> {
        let mut shapes = 0;
        for (index, l) in (0u32..).zip(self.lights) {
            if let Some(kind) = LightKind::from_u32(l.kind) {
                let refers = |f: &LightField| matches!(f, LightField::Triangle | LightField::Environment);
                if kind.fields().iter().any(refers) {
                    return Err(ComposeError::Light { index });
                }
                shapes += usize::from(kind.has_shape());
            }
            check::light(&Records::NOTHING, index, l)?;
        }
        if shapes > MAX_SHAPE_LIGHTS {
            return Err(ComposeError::TooMany { of: SectionKind::Lights, found: shapes, most: MAX_SHAPE_LIGHTS });
        }
        Ok(shapes)
    }

    /// A vertex; its normal as it was given or of length 1.
    fn vertex(&self, index: usize, unit: bool) -> Vertex {
        let n = self.normals.get(index).copied().unwrap_or([0.0; 3]);
        Vertex {
            p: self.positions.get(index).copied().unwrap_or([0.0; 3]),
            n: if unit { vertex_normal::<Portable>(n) } else { n },
            uv: self.uvs.get(index).copied().unwrap_or([0.0; 2]),
        }
    }

    /// Triangles with an area, by their number among all, with their corners.
    fn kept(&self) -> impl Iterator<Item = (usize, &[u32; 3], [[f32; 3]; 3])> {
        let all = self.triangles.iter().enumerate().map(|(i, t)| (i, t, self.corners(t)));
        all.filter(|(_, _, corners)| has_area::<Portable>(corners))
    }

    fn write<'m>(
        &self,
        blob: &'m mut [u8],
        primitives: &mut [Primitive],
        counts: &Counts,
    ) -> Result<&'m mut [u8], MemoryError> {
        let mut draft = Draft::new(blob)?;
        let info = draft.section::<SceneInfo>(SectionKind::Info, 1)?;
        draft.copy(SectionKind::Cameras, &[self.camera])?;
        let triangles = draft.section::<Triangle>(SectionKind::Triangles, counts.triangles)?;
        let vertices = draft.section::<Vertex>(SectionKind::Vertices, self.positions.len())?;
        for (index, vertex) in draft.records::<Vertex>(&vertices).iter_mut().enumerate() {
            *vertex = self.vertex(index, true);
        }
        let materials = draft.section::<Material>(SectionKind::Materials, self.materials.len())?;
        draft.copy(SectionKind::Textures, self.textures)?;
        draft.copy(SectionKind::Texels, self.texels)?;
        let tables = draft.section::<f32>(SectionKind::Tables, counts.tables)?;
        let [of_materials, of_tables] = draft.split([&materials, &tables]);
        materials::write(self, records(of_materials), records(of_tables));
        draft.copy(SectionKind::Names, self.names)?;
        let lights = draft.section::<Light>(SectionKind::Lights, counts.lights(self))?;
        let alias = draft.section::<Alias>(SectionKind::LightAlias, counts.lights(self))?;
        let [of_triangles, of_lights] = draft.split([&triangles, &lights]);
        self.write_triangles(records(of_triangles), records(of_lights), primitives, counts);
        let integral = self.write_environment(&mut draft, counts)?;
        draft.copy(SectionKind::Media, self.media)?;

        let built = self.write_tree(&mut draft, &triangles, primitives)?;
        let [bounds_min, bounds_max] = built.bounds;
        let dropped_triangles = (self.triangles.len() - counts.triangles) as u32;
        let facts = SceneInfo { bounds_min, bounds_max, max_depth: self.max_depth, dropped_triangles };
        draft.records(&info).fill(facts);
        let extent = SceneExtent { radius: light_table::radius(&facts), environment: integral };
        let [table, lights] = draft.split([&alias, &lights]);
        let lights: &[Light] = records(lights);
        light_table::build(records(table), |i| lights.get(i as usize).map_or(0.0, |l| light::power(l, &extent)));
        Ok(draft.finish())
    }

    /// Triangles and lights that refer to each other, all other lights, and the boxes of the triangles.
    fn write_triangles(
        &self,
        triangles: &mut [Triangle],
        lights: &mut [Light],
        primitives: &mut [Primitive],
        counts: &Counts,
    ) {
        let mut next_light = 0u32;
        let mut out = triangles.iter_mut().zip(primitives.iter_mut());
        for (id, (i, vertex, corners)) in (0u32..).zip(self.kept()) {
            let Some((triangle, primitive)) = out.next() else { break };
            let material = self.material_of(i);
            let emission = self.emission_of(material);
            let mut light = NONE;
            if emission != [0.0; 3] {
                if let Some(record) = lights.get_mut(next_light as usize) {
                    let (kind, area) = (LightKind::Area as u32, area::<Portable>(&corners));
                    *record = Light { kind, triangle: id, area, emission, ..Zeroable::zeroed() };
                }
                light = next_light;
                next_light += 1;
            }
            let normal = |v: &u32| self.vertex(*v as usize, true).n != [0.0; 3];
            let flags = if vertex.iter().all(normal) { TRIANGLE_SMOOTH } else { 0 };
            *triangle = Triangle { vertex: *vertex, material, light, flags };
            let [a, b, c] = corners;
            let bound = |f: fn(f32, f32) -> f32| {
                let mut p = a;
                p.iter_mut().zip(b.iter().zip(&c)).for_each(|(x, (y, z))| *x = f(f(*x, *y), *z));
                p
            };
            *primitive = Primitive::new(id, [bound(f32::min), bound(f32::max)]);
        }
        let has_shape = |l: &&Light| LightKind::from_u32(l.kind).is_some_and(LightKind::has_shape);
        let environment = Light { kind: LightKind::Environment as u32, ..Zeroable::zeroed() };
        let without = self.lights.iter().filter(|l| !has_shape(l));
        let around = counts.environment.is_some().then_some(&environment);
        let others = without.chain(around).chain(self.lights.iter().filter(has_shape));
        lights.iter_mut().skip(next_light as usize).zip(others).for_each(|(place, l)| *place = *l);
    }

    /// The environment, its texels and tables; the integral of its luminance.
    fn write_environment(&self, draft: &mut Draft<'_>, counts: &Counts) -> Result<f64, MemoryError> {
        let (Some(environment), Some(surround)) = (&counts.environment, &self.environment) else { return Ok(0.0) };
        draft.copy(SectionKind::Environment, &[*environment])?;
        let Ok(Some(map)) = map_of(surround) else { return Ok(2.0 * TAU * luminance(environment.radiance)) };
        draft.copy(SectionKind::EnvTexels, map.texels())?;
        let tables = draft.section::<Alias>(SectionKind::EnvAlias, map.entries())?;
        map.tabulate::<Portable>(draft.records(&tables));
        Ok(map.scaled(environment.radiance).integral::<Portable>())
    }

    /// Builds the tree behind all other sections.
    fn write_tree(
        &self,
        draft: &mut Draft<'_>,
        triangles: &Range<usize>,
        primitives: &mut [Primitive],
    ) -> Result<Built, MemoryError> {
        let n = primitives.len();
        let all = draft.rest();
        let [node, leaf] = [size_of::<Node>(), size_of::<Leaf>()];
        // 7 full nodes and as many others as leaves halved, in the notation of `most_nodes`: 7 nodes for 4 leaves at
        // most
        let fitting = all.len().saturating_sub(node).saturating_mul(7) / (7 * leaf + 4 * node);
        let (mut most, mut leaves_room) = (most_nodes(n), n);
        if most.saturating_mul(node).saturating_add(n.saturating_mul(leaf)) > all.len() {
            (most, leaves_room) = (most.min(fitting.saturating_mul(4) / 7 + 1), n.min(fitting));
        }
        let given = all.len();
        let too_small = MemoryError::TooSmall { needed: usize::MAX, given };
        let nodes = all.start..all.start.saturating_add(most.saturating_mul(node));
        let leaves = nodes.end..nodes.end.saturating_add(leaves_room.saturating_mul(leaf));
        if leaves.end > all.end {
            return Err(too_small);
        }
        let [of_triangles, of_nodes, of_leaves] = draft.split([triangles, &nodes, &leaves]);
        let of_triangles: &[Triangle] = records(of_triangles);
        let corners = |id: u32| of_triangles.get(id as usize).map_or([[0.0; 3]; 3], |t| self.corners(&t.vertex));
        let (of_nodes, of_leaves) = ((records(of_nodes), 0), (records(of_leaves), 0));
        let built = build_triangles(primitives, &corners, of_nodes, of_leaves).map_err(|_| too_small)?;
        let made = |range: &Range<usize>, count: u32, size: usize| range.start..range.start + count as usize * size;
        let leaves = made(&leaves, built.leaves, leaf);
        draft.section::<Node>(SectionKind::Nodes, built.nodes as usize)?;
        let to = draft.section::<Leaf>(SectionKind::Leaves, built.leaves as usize)?;
        draft.shift(leaves, to.start);
        Ok(built)
    }
}
