//! The scenes beside the repository load and bake whole. A clone without them skips these tests, and says so.

use croupier::Scene;
use croupier::unstable::Effects;
use croupier::unstable::scene::blob::MaterialKind;
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::load::load;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// Folders with a `scene.json`, in order.
fn scenes() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/scenes");
    let Ok(entries) = fs::read_dir(&root) else {
        println!("skipped: there is no folder {}", root.display());
        return Vec::new();
    };
    let mut folders: Vec<_> = entries.flatten().map(|e| e.path()).filter(|p| p.join("scene.json").exists()).collect();
    folders.sort();
    folders
}

fn json(folder: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join("scene.json")).unwrap()).unwrap()
}

fn floats(v: &Value) -> Vec<f32> {
    v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap() as f32).collect()
}

/// Killed by: counting a dropped triangle twice; a missing material kind in `scene_json::material`; light indices
/// off by one; a section at a wrong offset; a material of `also_exterior_of` without a clear inside, or after the medium.
#[test]
fn every_scene_bakes_whole() {
    for folder in scenes() {
        let json = json(&folder);
        let name = json["name"].as_str().unwrap();
        let (scene, report) = load(&folder).unwrap_or_else(|e| panic!("{name}: {e}"));
        let g = &json["geometry"];
        assert_eq!(scene.triangles.len() as u64, g["triangles"].as_u64().unwrap(), "{name}");
        assert_eq!(scene.vertices.len() as u64, g["vertices"].as_u64().unwrap(), "{name}");
        assert_eq!(scene.objects.len() as u64, g["groups"].as_u64().unwrap(), "{name}");
        assert!(report.notes.is_empty() && report.skipped_elements == 0, "{name}: {report:?}");
        let [lo, hi] = scene.bounds().unwrap();
        for (found, key) in [(lo, "bbox_min"), (hi, "bbox_max")] {
            for (a, b) in found.iter().zip(floats(&g[key])) {
                assert!((a - b).abs() <= 1e-5 * b.abs().max(1.0), "{name}: {found:?}, {key} {}", g[key]);
            }
        }
        let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap_or_else(|e| panic!("{name}: {e}"));
        let r = &baked.report;
        assert_eq!(u64::from(r.triangles + r.dropped_degenerate), g["triangles"].as_u64().unwrap(), "{name}");
        println!("{name}: {r:?}");

        let view = Scene::from_bytes(&baked.bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(view.triangles.len() as u32, r.triangles, "{name}");
        assert_eq!(view.info.dropped_triangles, r.dropped_degenerate, "{name}");
        assert_eq!(u64::from(view.info.max_depth), json["transport"]["max_depth"].as_u64().unwrap());
        let names: Vec<&str> = std::str::from_utf8(view.names).unwrap().lines().collect();
        assert_eq!(names.len(), view.materials.len() + scene.instances.len() + scene.objects.len());
        for (m, name) in view.materials.iter().zip(names) {
            let kind = MaterialKind::from_u32(m.kind).unwrap().name();
            assert_eq!(json["materials"][name]["type"], kind, "{name}");
            let two_sided = json["materials"][name].get("twosided").is_some_and(|t| *t == true);
            assert_eq!(m.flags == 1, two_sided, "{name}");
        }
        media(&json, &view);
        let emitting: Vec<&str> =
            json["emitters"].as_array().unwrap().iter().filter_map(|e| e["material"].as_str()).collect();
        let should_emit = |t: &&croupier_host::description::Triangle| {
            emitting.contains(&scene.materials[t.material as usize].name.as_str())
        };
        let area_lights = scene.triangles.iter().filter(should_emit).count() as u32 - r.dropped_lights;
        let environment = u32::from(view.environment.is_some());
        assert_eq!(view.lights.len() as u32, area_lights + environment, "{name}");
        let lit: Vec<u32> = view.triangles.iter().map(|t| t.light).filter(|l| *l != u32::MAX).collect();
        assert_eq!(lit, (0..area_lights).collect::<Vec<_>>(), "{name}");
        let sum: f64 = view.light_alias.iter().map(|a| f64::from(a.probability)).sum();
        assert!((sum - 1.0).abs() < 1e-5, "{name}: light probabilities sum to {sum}");
    }
}

/// The blob's media against those of the file: which material bounds which, what of it is clear, the coefficients.
fn media(json: &Value, view: &Scene<'_>) {
    let name = json["name"].as_str().unwrap();
    let listed = json["media"].as_array().unwrap();
    let behind = |material: &str| {
        let i = (0..view.materials.len() as u32).find(|i| view.material_name(*i) == material).unwrap();
        view.materials[i as usize].medium
    };
    let mut bounded = 0;
    for medium in listed {
        let i = behind(medium["boundary_material"].as_str().unwrap());
        bounded += 1;
        let m = &view.media[i as usize];
        let close = |a: f32, b: f64| (f64::from(a) - b).abs() <= 1e-6 * b.abs();
        assert_eq!(f64::from(m.g), medium["phase"]["g"].as_f64().unwrap_or(0.0) as f32 as f64, "{name}");
        for c in 0..3 {
            let number = |key: &str| medium[key][c].as_f64().unwrap();
            let [sigma_a, sigma_s] = match medium["type"].as_str().unwrap() {
                "homogeneous" => [number("sigma_a"), number("sigma_s")],
                _ => {
                    let sigma_t = medium["sigma_t_scale"].as_f64().unwrap();
                    [sigma_t * (1.0 - number("albedo")), sigma_t * number("albedo")]
                }
            };
            assert!(close(m.sigma_a[c], sigma_a) && close(m.sigma_s[c], sigma_s), "{name}: {m:?}");
        }
        if medium["type"] == "grid" {
            let cells: Vec<u64> =
                medium["resolution"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
            assert_eq!(m.cells.map(u64::from).to_vec(), cells, "{name}");
            assert_eq!(
                [m.bounds_min, m.bounds_max].map(|p| p.to_vec()),
                [&medium["bbox_min"], &medium["bbox_max"]].map(floats)
            );
        }
        for other in medium["also_exterior_of"].as_array().unwrap() {
            let inside = behind(other.as_str().unwrap());
            let m = &view.media[inside as usize];
            assert!(inside < i && m.sigma_a == [0.0; 3] && m.sigma_s == [0.0; 3], "{name}: {m:?}");
            bounded += 1;
        }
    }
    assert_eq!(view.media.len(), bounded, "{name}");
    assert_eq!(view.materials.iter().filter(|m| m.medium != u32::MAX).count(), bounded, "{name}");
    assert_eq!(view.effects.contains(Effects::MEDIA), bounded > 0, "{name}");
    assert_eq!(view.effects.contains(Effects::GRID_MEDIA), listed.iter().any(|m| m["type"] == "grid"), "{name}");
}

/// Positions, normals and texture coordinates of each corner, parsed the plain way.
type Corner = ([f32; 3], Option<[f32; 3]>, Option<[f32; 2]>);

fn plain_obj(text: &str) -> Vec<(String, [Corner; 3])> {
    let (mut v, mut vt, mut vn, mut material) = (vec![], vec![], vec![], String::new());
    let mut triangles = vec![];
    for line in text.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let numbers = || words[1..].iter().map(|w| w.parse().unwrap()).collect::<Vec<f32>>();
        match words[0] {
            "v" => v.push(<[f32; 3]>::try_from(numbers()).unwrap()),
            "vt" => vt.push(<[f32; 2]>::try_from(numbers()).unwrap()),
            "vn" => vn.push(<[f32; 3]>::try_from(numbers()).unwrap()),
            "usemtl" => material = words[1].into(),
            "f" => {
                let corner = |w: &&str| {
                    let mut i = w.split('/').map(|x| x.parse::<usize>().ok().map(|i| i - 1));
                    let p = i.next().flatten().map(|i| v[i]).unwrap();
                    let t = i.next().flatten().map(|i| vt[i]);
                    (p, i.next().flatten().map(|i| vn[i]), t)
                };
                let corners: Vec<Corner> = words[1..].iter().map(corner).collect();
                triangles.push((material.clone(), corners.try_into().unwrap()));
            }
            _ => {}
        }
    }
    triangles
}

/// Killed by: `tobj` without the groups that `enter` inserts; smooth = "the file has normals"; any reordering; v
/// flipped.
#[test]
fn loading_keeps_every_corner_in_order() {
    for folder in scenes() {
        let path = folder.join("scene.obj");
        let small = fs::metadata(&path).unwrap().len() < 12_000_000;
        if !small {
            continue;
        }
        let (scene, _) = load(&folder).unwrap();
        let oracle = plain_obj(&fs::read_to_string(&path).unwrap());
        assert_eq!(oracle.len(), scene.triangles.len());
        for (i, (t, (material, corners))) in scene.triangles.iter().zip(&oracle).enumerate() {
            assert_eq!(&scene.materials[t.material as usize].name, material, "{} triangle {i}", path.display());
            for (v, (p, n, uv)) in t.vertices.iter().zip(corners) {
                let v = scene.vertices[*v as usize];
                assert_eq!((v.position, t.smooth), (*p, n.is_some()), "{} triangle {i}", path.display());
                assert!(n.is_none_or(|n| n == v.normal) && uv.is_none_or(|uv| uv == v.uv), "triangle {i}");
            }
        }
    }
}

/// A bare OBJ of every scene, with its preview materials. Killed by: no sky; a camera inside what is no room.
#[test]
fn every_bare_obj_bakes() {
    for folder in scenes() {
        let path = folder.join("scene.obj");
        if fs::metadata(&path).unwrap().len() > 8_000_000 {
            continue;
        }
        let (scene, report) = load(&path).unwrap_or_else(|e| panic!("{e}"));
        assert!(report.notes.iter().any(|n| n.contains("camera")));
        assert!(scene.environment.is_some() || !scene.emitters.is_empty(), "{}", path.display());
        let [lo, hi] = scene.bounds().unwrap();
        let outside =
            (0..3).any(|i| scene.camera.origin[i] > f64::from(hi[i]) || scene.camera.origin[i] < f64::from(lo[i]));
        let in_room = report.notes.iter().any(|n| n.contains("placed in the room"));
        assert!(outside || in_room, "{}: {:?}", path.display(), scene.camera);
        let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap_or_else(|e| panic!("{e}"));
        assert!(Scene::from_bytes(&baked.bytes).is_ok());
    }
}
