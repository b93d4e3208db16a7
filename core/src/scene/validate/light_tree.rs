//! The tree over the lights: walks along trails end, and what choosing does is what densities say.

use super::record::records;
use crate::scene::Records;
use crate::scene::blob::*;
use crate::scene::error::{Field, SceneError, SectionFault};

/// Numbers are finite (radii may be infinite) and weights not negative, children come behind their parents and are
/// referred to once, and the trail of each light, if it has one, leads to it and to no other.
pub(super) fn light_tree(scene: &Records<'_>) -> Result<(), SceneError> {
    let (nodes, trails) = (scene.light_nodes, scene.light_trails);
    let count = |kind, n: usize| SceneError::Section { kind, fault: SectionFault::Count(n as u64) };
    let expected = if nodes.is_empty() { 0 } else { scene.lights.len() };
    if trails.len() != expected {
        return Err(count(SectionKind::LightTrails, trails.len()));
    }
    let (mut leaves, mut inner) = (0usize, 0usize);
    for (at, node) in records(SectionKind::LightNodes, nodes) {
        node.middle.iter().try_for_each(|row| at.finite(Field::Position, row))?;
        node.axis.iter().try_for_each(|row| at.all_within(Field::Direction, row, -2.0, 2.0))?;
        at.all_within(Field::Cone, &node.cos, -1.0, 1.0)?;
        at.all_within(Field::Cone, &node.sin, 0.0, 1.0)?;
        at.finite(Field::Position, &node.front)?;
        at.all_within(Field::ShapeSize, &node.radius, 0.0, f32::INFINITY)?;
        at.all_within(Field::Probability, &node.weight, 0.0, f32::MAX)?;
        for child in node.child.into_iter().filter(|c| *c != NONE) {
            if child & LEAF_BIT != 0 {
                leaves = leaves.saturating_add(1);
                at.follow(SectionKind::Lights, child & CHILD_INDEX, scene.lights)?;
            } else {
                inner = inner.saturating_add(1);
                at.follow(SectionKind::LightNodes, child, nodes)?;
                if child <= at.index() {
                    return Err(at.wrong_reference(SectionKind::LightNodes, child, nodes.len()));
                }
            }
        }
    }
    let mut found = 0usize;
    for (at, trail) in records(SectionKind::LightTrails, trails).filter(|(_, trail)| **trail != NONE) {
        if end_of(nodes, *trail) != Some(LEAF_BIT | at.index()) {
            return Err(at.wrong_reference(SectionKind::Lights, *trail, scene.lights.len()));
        }
        found = found.saturating_add(1);
    }
    // as many leaves as trails that reach one each: every light is in one leaf
    if found != leaves || inner != nodes.len().saturating_sub(1) {
        return Err(count(SectionKind::LightNodes, nodes.len()));
    }
    Ok(())
}

/// Where a trail leads: the reference of a light.
fn end_of(nodes: &[LightNode], trail: u32) -> Option<u32> {
    let (mut index, mut rest) = (0, trail);
    for _ in 0..MAX_LIGHT_DEPTH {
        let child = *nodes.get(index as usize)?.child.get(rest as usize & 7)?;
        if child == NONE || child & LEAF_BIT != 0 {
            // the rest of a trail is 0
            return Some(child).filter(|_| rest >> 3 == 0);
        }
        (index, rest) = (child, rest >> 3);
    }
    None
}
