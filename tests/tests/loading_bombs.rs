//! Small files that ask for much: memory stays near what they have bytes for. Alone in its binary, and one test, because
//! the counting allocator is global.

use croupier_host::load::{LoadOptions, load_with};
use croupier_host::look::Look;
use croupier_tests::allocator::{Counting, peak_of};
use std::fmt::Write;
use std::fs;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

/// A grey PNG of 2048 x 2048 texels, which are 16 MiB.
fn png() -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, 2048, 2048);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&vec![128; 2048 * 2048]).unwrap();
    out
}

/// A glTF triangle with a name of a megabyte, in 60,000 places of each of two nodes; the second one's count of places
/// stands for itself, without bytes.
fn places() -> String {
    let name = "n".repeat(1 << 20);
    let uri = "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA";
    let node = format!(
        r#"{{"mesh": 0, "name": "{name}", "extensions": {{"EXT_mesh_gpu_instancing": {{"attributes": {{"TRANSLATION": 1}}}}}}}}"#
    );
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0, 1]}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}}}]}}], "nodes": [{node}, {node}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}},
            {{"componentType": 5126, "count": 60000, "type": "VEC3"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}], "buffers": [{{"byteLength": 36, "uri": "{uri}"}}]}}"#
    )
}

/// Killed by: a texture that each material makes anew, a name that each place, group or material copies.
#[test]
fn memory_follows_the_bytes_of_the_files() {
    let (mut materials, mut faces) = (String::new(), format!("mtllib a.mtl\n{TRIANGLE}"));
    for i in 0..100 {
        writeln!(materials, "newmtl m{i}\nmap_Pr t.png").unwrap();
        writeln!(faces, "usemtl m{i}\nf 1 2 3").unwrap();
    }
    let mut groups = format!("o {}\n{TRIANGLE}", "n".repeat(1 << 20));
    (0..200).for_each(|i| writeln!(groups, "usemtl m{}\nf 1 2 3", i % 2).unwrap());
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in [
        ("textures.obj", faces.as_bytes()),
        ("a.mtl", materials.as_bytes()),
        ("t.png", &png()),
        ("groups.obj", groups.as_bytes()),
        ("places.gltf", places().as_bytes()),
    ] {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    // two textures and the decoder's buffers; the text, its copies and its words; 120,000 instances
    for (name, most) in [("textures.obj", 80 << 20), ("groups.obj", 12 << 20), ("places.gltf", 100 << 20)] {
        let load = || load_with(&folder.path().join(name), &LoadOptions::default(), &Look::default());
        let (peak, loaded) = peak_of(load);
        loaded.unwrap_or_else(|e| panic!("{name}: {e}"));
        println!("{name}: {} KiB", peak >> 10);
        assert!(peak <= most, "{name}: {peak} bytes");
    }
}
