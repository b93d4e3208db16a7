//! Vertices and triangles.

use super::BakeError;
use crate::description::{SceneDescription, Triangle, Vertex};
use crate::math::Std;
use croupier::unstable::compose::{self, vertex_normal};
use croupier::unstable::scene::blob::MAX_COORDINATE;
use croupier::unstable::scene::blob::{self, NONE, TRIANGLE_OBJECT_SHIFT, TRIANGLE_SMOOTH};
use glam::Vec3;
use std::ops::Range;

/// Largest number of an object that the blob can hold; those behind it share it.
const LAST_OBJECT: u32 = u32::MAX >> TRIANGLE_OBJECT_SHIFT;

/// Geometry of the blob, and what else baking needs of it.
pub(super) struct Geometry {
    pub vertices: Vec<blob::Vertex>,
    pub triangles: Vec<blob::Triangle>,
    /// Corner positions of `triangles`.
    pub corners: Vec<[[f32; 3]; 3]>,
    /// Triangles by object; one object without instances.
    pub objects: Vec<Range<u32>>,
    pub dropped_degenerate: u32,
    pub dropped_lights: u32,
    pub flattened: u32,
}

/// Area of a triangle as lights state it.
pub(super) fn area(corners: &[[f32; 3]; 3]) -> f32 {
    compose::area::<Std>(corners)
}

/// Does a triangle have an area that `f32` can hold? One without is hit by no ray and has no normal: it is left out.
fn has_area(corners: &[[f32; 3]; 3]) -> bool {
    compose::has_area::<Std>(corners)
}

/// Index in the description of each triangle that is taken over, in order; `runs` as for [`bake`].
pub(super) fn order(scene: &SceneDescription, runs: &[Vec<Range<u32>>]) -> Vec<u32> {
    let corners =
        |t: &Triangle| t.vertices.map(|v| scene.vertices.get(v as usize).map_or([f32::NAN; 3], |v| v.position));
    let taken = |i: &u32| scene.triangles.get(*i as usize).is_some_and(|t| has_area(&corners(t)));
    runs.iter().flatten().flat_map(Clone::clone).filter(taken).collect()
}

/// `emission` tells which materials emit, `runs` which triangles make up each object.
pub(super) fn bake(
    scene: &SceneDescription,
    emission: &[[f32; 3]],
    runs: &[Vec<Range<u32>>],
) -> Result<Geometry, BakeError> {
    for (what, count) in [("vertices", scene.vertices.len()), ("triangles", scene.triangles.len())] {
        if count >= 1 << 27 {
            return Err(BakeError::TooMany { what, count });
        }
    }
    let mut g = Geometry {
        vertices: scene
            .vertices
            .iter()
            .map(|v| blob::Vertex { p: v.position, n: vertex_normal::<Std>(v.normal), uv: v.uv })
            .collect(),
        triangles: Vec::with_capacity(scene.triangles.len()),
        corners: Vec::with_capacity(scene.triangles.len()),
        objects: Vec::with_capacity(runs.len()),
        dropped_degenerate: 0,
        dropped_lights: 0,
        flattened: 0,
    };
    for (i, v) in (0..).zip(&scene.vertices) {
        check(scene, i, v)?;
    }
    for (i, t) in (0..).zip(&scene.triangles) {
        let index = |what, found, count| {
            Err(BakeError::Index { object: scene.object_of(i).into(), triangle: i, what, found, count })
        };
        if let Some(v) = t.vertices.iter().find(|v| **v as usize >= scene.vertices.len()) {
            return index("vertex", *v, scene.vertices.len());
        }
        if t.material as usize >= scene.materials.len() {
            return index("material", t.material, scene.materials.len());
        }
    }
    for runs in runs {
        let first = g.triangles.len() as u32;
        for i in runs.iter().flat_map(Clone::clone) {
            let t = &scene.triangles[i as usize];
            g.add(t, scene.object_number(i), emission[t.material as usize] != [0.0; 3]);
        }
        g.objects.push(first..g.triangles.len() as u32);
    }
    Ok(g)
}

/// Every number is finite and not too large.
fn check(scene: &SceneDescription, index: u32, v: &Vertex) -> Result<(), BakeError> {
    let fine = |x: &f32| x.abs() <= MAX_COORDINATE;
    let kinds: [(&'static str, &[f32]); 3] =
        [("position", &v.position), ("normal", &v.normal), ("texture coordinate", &v.uv)];
    for (what, numbers) in kinds {
        if let Some(found) = numbers.iter().find(|x| !fine(x)) {
            let user = scene.triangles.iter().position(|t| t.vertices.contains(&index));
            let object = user.map_or("unused", |t| scene.object_of(t as u32)).into();
            return Err(BakeError::Vertex { object, vertex: index, what, found: *found });
        }
    }
    Ok(())
}

impl Geometry {
    /// Takes a triangle over unless it has no area that `f32` can hold: no ray hits it, and it has no normal.
    fn add(&mut self, t: &Triangle, object: u32, emits: bool) {
        let corner = t.vertices.map(|v| self.vertices[v as usize]);
        let corners = corner.map(|v| v.p);
        if !has_area(&corners) {
            self.dropped_degenerate += 1;
            self.dropped_lights += u32::from(emits);
            return;
        }
        // Opposite normals cancel at single points only, which is for whoever interpolates them; a corner without a
        // normal has no shading normal all around it.
        let smooth = t.smooth && corner.iter().all(|v| v.n != [0.0; 3]);
        self.flattened += u32::from(t.smooth && !smooth);
        let smooth = if smooth { TRIANGLE_SMOOTH } else { 0 };
        let flags = smooth | object.min(LAST_OBJECT) << TRIANGLE_OBJECT_SHIFT;
        self.triangles.push(blob::Triangle { vertex: t.vertices, material: t.material, light: NONE, flags });
        self.corners.push(corners);
    }

    /// Smallest and largest coordinates of an object's triangles; zeros without any.
    pub(super) fn bounds_of(&self, object: usize) -> [[f32; 3]; 2] {
        let Some(own) = self.objects.get(object).filter(|o| !o.is_empty()) else { return [[0.0; 3]; 2] };
        let points = self.corners[own.start as usize..own.end as usize].as_flattened();
        points.iter().fold([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]], |[lo, hi], p| {
            [std::array::from_fn(|i| lo[i].min(p[i])), std::array::from_fn(|i| hi[i].max(p[i]))]
        })
    }
}

/// Half the diagonal of bounds.
pub(super) fn radius(bounds: [[f32; 3]; 2]) -> f64 {
    let [lo, hi] = bounds.map(|p| Vec3::from_array(p).as_dvec3());
    (hi - lo).length() / 2.0
}
