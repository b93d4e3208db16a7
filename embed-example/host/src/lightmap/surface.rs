//! The triangles that a lightmap covers, and their places in the map.

use super::error::LightmapError;
use crate::bake::triangle_order;
use crate::description::{SceneDescription, Vertex};
use crate::sides::opaque;
use croupier::unstable::scene::blob::NONE;
use std::collections::HashMap;

/// A triangle with its place in the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Patch {
    /// Triangle of the blob.
    pub triangle: u32,
    /// Instance of the blob around it, or `NONE`.
    pub instance: u32,
    /// Number of its object among [`Surface::objects`].
    pub object: u32,
    /// Texture coordinates of the corners, v upwards; the map is the unit square.
    pub uv: [[f32; 2]; 3],
    /// Positions of the corners, in the object's own space.
    pub corners: [[f32; 3]; 3],
}

/// Triangles of one or several objects of a scene, with texture coordinates that no two of them should share.
#[derive(Clone, Debug, PartialEq)]
pub struct Surface {
    pub(super) patches: Vec<Patch>,
    pub(super) objects: Vec<String>,
    /// Triangles of the scene's blob.
    pub(super) triangles: usize,
    /// Materials whose backs nobody should see.
    pub(super) opaque: Vec<bool>,
}

impl Surface {
    /// The objects of these names with the texture coordinates of their vertices. A name is that of an object of the
    /// world, or of an instance: the triangles of its prototype, in its place. Several that have the name are taken
    /// together.
    ///
    /// # Errors
    /// An object that is not there, is part of a prototype, or has no area in texture coordinates or coordinates outside
    /// of the unit square.
    pub fn of(scene: &SceneDescription, objects: &[&str]) -> Result<Self, LightmapError> {
        Self::of_mapped(scene, objects, |_, vertex| vertex.uv)
    }

    /// [`Self::of`] with other texture coordinates: `uv` says those of each corner, by vertex index. For hosts with a
    /// second set.
    ///
    /// # Errors
    /// As of [`Self::of`].
    pub fn of_mapped(
        scene: &SceneDescription,
        objects: &[&str],
        uv: impl Fn(u32, &Vertex) -> [f32; 2],
    ) -> Result<Self, LightmapError> {
        let order = triangle_order(scene)?;
        let places: HashMap<u32, u32> = order.iter().zip(0..).map(|(source, at)| (*source, at)).collect();
        let mut out = Self {
            patches: Vec::new(),
            objects: objects.iter().map(|name| (*name).into()).collect(),
            triangles: order.len(),
            opaque: opaque(scene),
        };
        for (number, name) in (0..).zip(objects) {
            let before = out.patches.len();
            for (run, instance) in runs(scene, name)? {
                for source in run {
                    let Some(triangle) = places.get(&source) else { continue };
                    let corner = scene.triangles[source as usize].vertices;
                    let vertex = corner.map(|v| scene.vertices[v as usize]);
                    let uv = [0, 1, 2].map(|k| uv(corner[k], &vertex[k]));
                    let corners = vertex.map(|v| v.position);
                    out.patches.push(Patch { triangle: *triangle, instance, object: number, uv, corners });
                }
            }
            check(name, &out.patches[before..])?;
        }
        Ok(out)
    }

    /// Names of the objects, as they were asked for.
    pub fn objects(&self) -> &[String] {
        &self.objects
    }
}

/// Runs of triangles of the description that have a name, and the instances of the blob around them.
fn runs(scene: &SceneDescription, name: &str) -> Result<Vec<(std::ops::Range<u32>, u32)>, LightmapError> {
    let mut found = Vec::new();
    let mut prototype = None;
    for (i, object) in scene.objects.iter().enumerate().filter(|(_, o)| o.name == name) {
        let end = scene.objects.get(i + 1).map_or(scene.triangles.len() as u32, |o| o.first_triangle);
        let run = object.first_triangle..end;
        match scene.prototypes.iter().find(|p| p.triangles.contains(&run.start)) {
            Some(p) => prototype = Some(p.name.clone()),
            None => found.push((run, NONE)),
        }
    }
    for (i, instance) in (0..).zip(&scene.instances).filter(|(_, i)| i.name == name) {
        let placed = scene.prototypes.get(instance.prototype as usize);
        found.extend(placed.map(|p| (p.triangles.clone(), i)));
    }
    if !found.is_empty() {
        return Ok(found);
    }
    match prototype {
        Some(prototype) => Err(LightmapError::InPrototype { object: name.into(), prototype }),
        None => {
            let mut all: Vec<&str> = scene.objects.iter().map(|o| &*o.name).collect();
            all.extend(scene.instances.iter().map(|i| &*i.name));
            all.dedup();
            Err(LightmapError::NoObject { object: name.into(), known: all.into_iter().map(String::from).collect() })
        }
    }
}

/// Twice the area in texture coordinates.
fn doubled_area([a, b, c]: [[f32; 2]; 3]) -> f64 {
    let [a, b, c] = [a, b, c].map(|p| p.map(f64::from));
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// How far outside of the unit square coordinates may lie, for those that were rounded.
const BORDER: f32 = 1e-4;

fn check(object: &str, patches: &[Patch]) -> Result<(), LightmapError> {
    let of = patches.len();
    if patches.iter().all(|p| doubled_area(p.uv) == 0.0) {
        return Err(LightmapError::NoCoordinates { object: object.into(), triangles: of });
    }
    let inside = |x: &f32| (-BORDER..=1.0 + BORDER).contains(x);
    let outside = patches.iter().filter(|p| !p.uv.as_flattened().iter().all(inside));
    match outside.count() {
        0 => Ok(()),
        triangles => Err(LightmapError::Outside { object: object.into(), triangles, of }),
    }
}
