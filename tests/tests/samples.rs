//! Sample files from packages and documents with the features of the usual sample models, as bare files on the command
//! line: loaded, completed, baked and rendered. Nothing is fetched: `tests/samples/LICENCES.txt` says where files are from.

use croupier_host::load::load;
use croupier_tests::samples::{self, FILES, REFUSED, Sample};
use std::path::Path;

/// A closed box whose faces look inwards counts as a room: the camera stands in it.
const ROOM: &str = "easy-gltf/box_sparse.glb";

/// Its lights were exported again as lumens, after an import that took lumens for watts: 1.5 W/sr from 7 m away.
const DARK: &str = "easy-gltf/cube.glb";

fn check(sample: &Sample) -> Vec<String> {
    let shown = match samples::show(sample, 12, 4) {
        Ok(shown) => shown,
        Err(e) => return vec![e],
    };
    let mut wrong = Vec::new();
    if shown.triangles != sample.triangles {
        wrong.push(format!("{} triangles, there are {}", shown.triangles, sample.triangles));
    }
    let pixels = shown.picture.pixels.as_flattened();
    if pixels.iter().any(|x| !x.is_finite() || *x < 0.0) {
        wrong.push("a pixel that is no radiance".into());
    }
    let mean = pixels.iter().sum::<f32>() / pixels.len() as f32;
    let least = if sample.name == DARK { 1e-4 } else { 0.003 };
    if !(least..50.0).contains(&mean) {
        wrong.push(format!("the mean of the picture is {mean}"));
    }
    // thin ones cover a pixel or two
    if shown.seen == 0.0 || (shown.seen > 0.95) != (sample.name == ROOM) {
        wrong.push(format!("{} of the picture shows it", shown.seen));
    }
    wrong
}

/// Killed by: a format, an extension or a way to write numbers that is read wrongly; faces that are left out or come twice; a
/// camera that looks past the mesh; a missing light; NaN.
#[test]
fn samples_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let all = samples::all(folder.path());
    let meshes = all.iter().filter(|s| !s.path.extension().is_some_and(|e| e == "glb" || e == "gltf")).count();
    assert!(meshes >= 30 && all.len() - meshes >= 20, "{meshes} of {}", all.len());
    let wrong: Vec<String> =
        all.iter().flat_map(|s| check(s).into_iter().map(|w| format!("{}: {w}", s.name))).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Killed by: a scene without triangles that is rendered all the same.
#[test]
fn samples_without_triangles_are_refused() {
    for (name, words) in REFUSED {
        let error = load(&Path::new(env!("CARGO_MANIFEST_DIR")).join("samples").join(name)).unwrap_err().to_string();
        assert!(error.contains(words), "{name}: {error}");
    }
}

/// Every file is in the table, is named in LICENCES.txt, and all of them are small. Killed by: a file without a source.
#[test]
fn samples_have_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("samples");
    let sources = std::fs::read_to_string(folder.join("LICENCES.txt")).unwrap();
    let mut bytes = 0;
    let packages = std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_dir());
    for file in packages.flat_map(|p| std::fs::read_dir(p).unwrap().map(|e| e.unwrap().path())) {
        let name = file.strip_prefix(&folder).unwrap().to_str().unwrap().replace('\\', "/");
        let (package, own) = name.split_once('/').unwrap();
        let section = sources.split("\n== ").find(|s| s.starts_with(&format!("{package} "))).unwrap_or("");
        assert!(section.split_whitespace().any(|w| w == own), "{name} has no source");
        let mesh = ["obj", "ply", "stl", "gltf", "glb"]
            .contains(&file.extension().unwrap().to_ascii_lowercase().to_str().unwrap());
        let tested = FILES.iter().any(|(n, _)| *n == name) || REFUSED.iter().any(|(n, _)| *n == name);
        assert!(!mesh || tested, "{name} is not tested");
        bytes += file.metadata().unwrap().len();
    }
    assert!(bytes < 5_000_000, "{bytes} bytes");
}
