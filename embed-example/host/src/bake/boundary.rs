//! Boundaries of media: closed, their front sides outwards.
//!
//! A path takes a medium up where it passes a boundary from the front and lays it down where it passes one from the
//! back. Through a hole it would carry the medium to infinity. A boundary is closed if along every edge as many
//! triangles run one way as the other, vertices at the same position being one. That is stricter than a surface without
//! a gap: an edge that meets the middle of another one, with no vertex there, is refused.

use super::BakeError;
use crate::description::{SceneDescription, Triangle};
use glam::DVec3;
use std::collections::HashMap;
use std::ops::Range;

/// Every medium has a boundary, which is closed and as a whole faces outwards, in each object on its own. Indices of vertices and materials have been
/// checked, those of media are checked with the materials.
pub(super) fn check(scene: &SceneDescription, runs: &[Vec<Range<u32>>]) -> Result<(), BakeError> {
    if scene.media.is_empty() {
        return Ok(());
    }
    let mut bounded = vec![false; scene.media.len()];
    for runs in runs {
        let mut fronts: Vec<Vec<u32>> = vec![Vec::new(); scene.media.len()];
        for i in runs.iter().cloned().flatten() {
            let medium = scene.materials[scene.triangles[i as usize].material as usize].medium;
            if let Some(triangles) = medium.and_then(|m| fronts.get_mut(m as usize)) {
                triangles.push(i);
            }
        }
        for (index, (medium, triangles)) in scene.media.iter().zip(&fronts).enumerate() {
            let name = || medium.name.clone();
            let Some(first) = triangles.first() else { continue };
            bounded[index] = true;
            closed(scene, triangles).map_err(|(triangle, edge, times)| {
                let object = scene.object_of(triangle).into();
                BakeError::Leak { medium: name(), object, edge, times }
            })?;
            if faces_inwards(scene, triangles) {
                return Err(BakeError::InsideOut { medium: name(), object: scene.object_of(*first).into() });
            }
        }
    }
    match bounded.iter().position(|b| !b) {
        Some(medium) => Err(BakeError::NoBoundary { medium: scene.media[medium].name.clone() }),
        None => Ok(()),
    }
}

/// Whether these triangles can bound a medium. Indices of their vertices are in range.
pub(crate) fn is_closed(scene: &SceneDescription, triangles: &[u32]) -> bool {
    closed(scene, triangles).is_ok() && !faces_inwards(scene, triangles)
}

fn corners(scene: &SceneDescription, triangle: u32) -> [[f32; 3]; 3] {
    let t: &Triangle = &scene.triangles[triangle as usize];
    t.vertices.map(|v| scene.vertices[v as usize].position)
}

/// A triangle, its edge that has too few or too many opposites, and how often triangles run along it each way.
type Fault = (u32, [[f32; 3]; 2], [u32; 2]);

/// Whether along every edge as many triangles run one way as the other; else the first edge where they do not.
///
/// Triangles without area count, although the blob will not have them: what they join stays joined.
fn closed(scene: &SceneDescription, triangles: &[u32]) -> Result<(), Fault> {
    let mut points: HashMap<[u32; 3], u32> = HashMap::new();
    let mut weld = |p: [f32; 3]| {
        let next = points.len() as u32;
        // adding 0 makes one zero of both
        *points.entry(p.map(|x| (x + 0.0).to_bits())).or_insert(next)
    };
    let welded: Vec<[u32; 3]> = triangles.iter().map(|t| corners(scene, *t).map(&mut weld)).collect();
    let edges = |t: &[u32; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    // by the ends in ascending order: runs upwards and downwards
    let mut runs: HashMap<[u32; 2], [u32; 2]> = HashMap::with_capacity(2 * triangles.len());
    for [a, b] in welded.iter().flat_map(edges) {
        if a != b {
            runs.entry([a.min(b), a.max(b)]).or_default()[usize::from(a > b)] += 1;
        }
    }
    for (triangle, ends) in triangles.iter().zip(&welded) {
        for (k, [a, b]) in edges(ends).into_iter().enumerate() {
            let [up, down] = runs.get(&[a.min(b), a.max(b)]).copied().unwrap_or_default();
            if up != down {
                let p = corners(scene, *triangle);
                let times = if a < b { [up, down] } else { [down, up] };
                return Err((*triangle, [p[k], p[(k + 1) % 3]], times));
            }
        }
    }
    Ok(())
}

/// Whether the volume that a closed boundary encloses is negative, by more than the rounding of its sum.
fn faces_inwards(scene: &SceneDescription, triangles: &[u32]) -> bool {
    let origin = triangles.first().map_or([0.0; 3], |t| corners(scene, *t)[0]);
    let relative = |p: [f32; 3]| DVec3::from_array(p.map(f64::from)) - DVec3::from_array(origin.map(f64::from));
    let (mut sum, mut size) = (0.0, 0.0);
    for t in triangles {
        let [a, b, c] = corners(scene, *t).map(relative);
        let volume = a.dot(b.cross(c));
        sum += volume;
        size += volume.abs();
    }
    sum < -1e-9 * size
}
