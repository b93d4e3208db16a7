//! Follows everything in a scene the way rendering does, with plain indexing: an index that validation let through
//! and that is out of range panics.

use croupier::Scene;
use croupier::unstable::scene::blob::*;

/// Entries of a traversal stack that pushes all children of a node but the one it enters.
const STACK: usize = 256;

/// Touches every record; returns how many steps that took.
pub fn everything(scene: &Scene<'_>) -> usize {
    let mut steps = tree(scene);
    for t in scene.triangles {
        for v in t.vertex.map(|v| &scene.vertices[v as usize]) {
            assert!(v.p.iter().chain(&v.n).chain(&v.uv).all(|x| x.is_finite()));
            if t.flags & TRIANGLE_SMOOTH != 0 {
                let length = v.n.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
                assert!((length - 1.0).abs() < 1.1e-3);
            }
        }
        material(scene, &scene.materials[t.material as usize]);
        if t.light != NONE {
            assert_eq!(scene.lights[t.light as usize].kind, LightKind::Area as u32);
        }
        steps += 1;
    }
    scene.materials.iter().for_each(|m| material(scene, m));
    assert!(scene.media.len() <= MAX_MEDIA);
    scene.media.iter().for_each(|m| medium(scene, m));
    pick(scene.light_alias);
    let has_shape = |l: &&Light| LightKind::from_u32(l.kind).is_some_and(LightKind::has_shape);
    let shapes = scene.lights.iter().filter(has_shape).count();
    assert!(shapes <= MAX_SHAPE_LIGHTS && scene.lights.iter().rev().take(shapes).all(|l| has_shape(&l)));
    for l in scene.lights {
        assert!(l.emission.iter().all(|x| x.is_finite() && *x >= 0.0));
        if l.kind == LightKind::Area as u32 {
            assert!(l.area > 0.0 && scene.triangles[l.triangle as usize].light != NONE);
        }
    }
    if let Some(e) = scene.environment {
        assert_eq!(scene.lights[e.light as usize].kind, LightKind::Environment as u32);
        if e.kind == EnvironmentKind::Map as u32 {
            environment(scene, e);
        }
    }
    let c = scene.camera;
    for corner in 0..4 {
        let [x, y] = [corner & 1, corner >> 1].map(|s| if s == 0 { -1.0 } else { 1.0 });
        let d: [f32; 3] = core::array::from_fn(|i| c.forward[i] + x * c.right[i] + y * c.down[i]);
        assert!(d.iter().all(|x| x.is_finite()) && d.iter().any(|x| *x != 0.0));
    }
    steps
}

/// Depth-first through boxes and leaves, as far as a stack of [`STACK`] allows (it must).
fn tree(scene: &Scene<'_>) -> usize {
    let mut stack = [0u32; STACK];
    let mut n = 0;
    if !scene.nodes.is_empty() {
        n = 1;
    }
    let (mut steps, mut seen) = (0, vec![0u32; scene.triangles.len()]);
    while n > 0 {
        n -= 1;
        let r = stack[n];
        steps += 1;
        if r & LEAF_BIT != 0 {
            let leaf = &scene.leaves[(r & CHILD_INDEX) as usize];
            let count = (r & !LEAF_BIT) >> 27;
            leaf.triangle[..count as usize].iter().for_each(|t| seen[*t as usize] += 1);
            continue;
        }
        for child in scene.nodes[r as usize].child {
            if child != NONE {
                stack[n] = child;
                n += 1;
            }
        }
    }
    assert!(seen.iter().all(|s| *s == 1), "every triangle once");
    steps
}

fn material(scene: &Scene<'_>, m: &Material) {
    let kind = MaterialKind::from_u32(m.kind).unwrap();
    let compensated = m.flags & MATERIAL_COMPENSATED != 0;
    let used = kind.facts().parameters.iter().filter(|p| compensated || !p.compensates());
    used.filter(|p| p.entries() > 0).fold(m.table as usize, |first, p| {
        let ([lo, hi], table) = (p.range(), &scene.tables[first..][..p.entries()]);
        assert!(table.iter().all(|x| (lo..=hi).contains(x)));
        first + p.entries()
    });
    if m.texture != NONE {
        let t = &scene.textures[m.texture as usize];
        let _ = scene.texels[(t.first + (t.height - 1) * t.width + t.width - 1) as usize];
    }
    if m.medium != NONE {
        let _ = scene.media[m.medium as usize];
    }
}

/// The corners of a medium's grid, and the majorants there.
fn medium(scene: &Scene<'_>, m: &Medium) {
    let sigma_t = (0..3).map(|c| m.sigma_a[c] + m.sigma_s[c]).fold(0.0, f32::max);
    assert!(sigma_t.is_finite());
    if m.kind == MediumKind::Homogeneous as u32 {
        return;
    }
    assert_eq!(m.kind, MediumKind::Grid as u32);
    let value = |values: &[f32], first: u32, n: [u32; 3], at: [u32; 3]| {
        values[first as usize + ((at[2] * n[1] + at[1]) * n[0] + at[0]) as usize]
    };
    for corner in 0..8 {
        let cell: [u32; 3] = core::array::from_fn(|axis| if corner >> axis & 1 == 0 { 0 } else { m.cells[axis] - 1 });
        let density = value(scene.densities, m.first_density, m.cells, cell);
        let majorant = value(scene.majorants, m.first_majorant, m.bricks(), cell.map(|i| i / BRICK));
        assert!(density >= 0.0 && density <= majorant && (majorant * sigma_t).is_finite());
    }
}

/// Picks with many numbers; what is picked has a probability.
fn pick(table: &[Alias]) {
    let n = table.len() as u64;
    for i in 0..if n == 0 { 0 } else { 64 * n } {
        let r = (i * 0x0123_4567_89ab) & 0xffff_ffff;
        let (slot, low) = ((r * n) >> 32, (r * n) as u32);
        let a = &table[slot as usize];
        let item = if a.threshold == u32::MAX || low < a.threshold { slot as usize } else { a.alias as usize };
        assert!(table[item].probability > 0.0);
    }
}

fn environment(scene: &Scene<'_>, e: &Environment) {
    let (w, h) = (e.width as usize, e.height as usize);
    assert!(scene.env_texels[w * h - 1].iter().all(|x| x.is_finite()));
    if scene.env_alias.is_empty() {
        return;
    }
    let (rows, cells) = scene.env_alias.split_at(h - 1);
    pick(rows);
    for (row, table) in rows.iter().enumerate().map(|(i, r)| (r, &cells[i * w..(i + 1) * w])) {
        if row.probability > 0.0 {
            pick(table);
        }
    }
}
