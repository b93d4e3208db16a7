//! Scenes of a few lines, run through the program.

use super::{croupier, text};
use std::fs;

/// Three vertices.
pub(crate) const V: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A file of a row: name and content.
pub(crate) type File = (&'static str, Vec<u8>);

/// A text.
pub(crate) fn t(name: &'static str, text: impl Into<String>) -> File {
    (name, text.into().into_bytes())
}

/// An OBJ that a library belongs to.
pub(crate) fn obj(mtl: &str) -> Vec<File> {
    vec![t("a.obj", format!("mtllib a.mtl\n{V}usemtl m\nf 1 2 3\n")), t("a.mtl", mtl)]
}

/// A scene file, and the OBJ that it may name.
pub(crate) fn json(geometry: &str, camera: &str, materials: &str) -> Vec<File> {
    let camera = if camera.is_empty() {
        r#""origin": [0,0,5], "target": [0,0,0], "up": [0,1,0], "vfov_deg": 30, "width": 8, "height": 8"#
    } else {
        camera
    };
    let text = format!(r#"{{"camera": {{{camera}}}, "materials": {{{materials}}}, "geometry": {geometry}}}"#);
    vec![t("scene.json", text), t("a.obj", format!("{V}usemtl m\nf 1 2 3\n"))]
}

/// The material of that OBJ.
pub(crate) const GREY: &str = r#""m": {"type": "diffuse", "reflectance": [0.5,0.5,0.5]}"#;

/// Runs the program in a folder with the files: exit status, messages, the folder.
pub(crate) fn run(files: &[File], arguments: &[&str]) -> (Option<i32>, String, tempfile::TempDir) {
    let dir = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, bytes)| {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    });
    let out = croupier(dir.path(), arguments);
    (out.status.code(), text(&out.stderr), dir)
}

/// The quickest render.
pub(crate) const RENDER: [&str; 6] = ["--size", "8x8", "--spp", "1", "-o", "x.exr"];

/// Most bytes of an input that a message quotes.
pub(crate) const QUOTED: usize = 300;

/// Each line, which may quote several excerpts, is short between its back quotes, and quotes are closed.
pub(crate) fn quotes_little(messages: &str) {
    for line in messages.lines() {
        let quoted: Vec<&str> = line.split('`').skip(1).step_by(2).collect();
        let bytes: usize = quoted.iter().map(|q| q.len()).sum();
        assert!(bytes <= QUOTED && line.matches('`').count() % 2 == 0, "{bytes} bytes are quoted: {line}");
    }
}

/// A glTF triangle whose colours are the image.
pub(crate) fn gltf(image: &str) -> Vec<File> {
    let bytes = [0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes);
    let document = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "material": 0}}]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
        "textures": [{{"source": 0}}], "images": [{{"uri": "{image}"}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{{"byteLength": 36, "uri": "a.bin"}}]}}"#
    );
    vec![t("a.gltf", document), ("a.bin", bytes.concat())]
}
