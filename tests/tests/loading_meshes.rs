//! PLY, STL and Radiance files: every form of them, and what broken ones are told.

use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::*;
use croupier_host::load::load;
use croupier_tests::loading::{self, corners, positions};
use croupier_tests::stats::SplitMix;
use std::fs;

fn try_load(name: &str, bytes: &[u8]) -> Result<SceneDescription, String> {
    loading::try_load(name, bytes).map(|(scene, _)| scene)
}

fn loaded(name: &str, bytes: &[u8]) -> SceneDescription {
    let scene = try_load(name, bytes).unwrap_or_else(|e| panic!("{name}: {e}"));
    let baked = bake(&scene, &BakeOptions::default(), |_, _| {}).unwrap_or_else(|e| panic!("{name}: {e}"));
    croupier::Scene::from_bytes(&baked.bytes).unwrap();
    scene
}

/// What a PLY file is made of: elements of properties, with values that any type can hold.
struct Ply {
    header: String,
    /// Values of each element in order: type and number.
    elements: Vec<Vec<(&'static str, f64)>>,
}

impl Ply {
    fn new(header: &str) -> Self {
        Self { header: header.into(), elements: Vec::new() }
    }

    fn element(mut self, values: &[(&'static str, f64)]) -> Self {
        self.elements.push(values.to_vec());
        self
    }

    fn bytes(&self, format: &str) -> Vec<u8> {
        let mut file = format!("ply\nformat {format} 1.0\n{}end_header\n", self.header).into_bytes();
        for element in &self.elements {
            if format == "ascii" {
                let words: Vec<String> = element.iter().map(|(_, x)| x.to_string()).collect();
                file.extend(format!("{}\n", words.join(" ")).bytes());
                continue;
            }
            for (kind, x) in element {
                let mut number = match *kind {
                    "char" | "int8" => (*x as i8).to_be_bytes().to_vec(),
                    "uchar" | "uint8" => (*x as u8).to_be_bytes().to_vec(),
                    "short" | "int16" => (*x as i16).to_be_bytes().to_vec(),
                    "ushort" | "uint16" => (*x as u16).to_be_bytes().to_vec(),
                    "int" | "int32" => (*x as i32).to_be_bytes().to_vec(),
                    "uint" | "uint32" => (*x as u32).to_be_bytes().to_vec(),
                    "float" | "float32" => (*x as f32).to_be_bytes().to_vec(),
                    "double" | "float64" => x.to_be_bytes().to_vec(),
                    other => panic!("{other}"),
                };
                if format == "binary_little_endian" {
                    number.reverse();
                }
                file.extend(number);
            }
        }
        file
    }
}

const FORMATS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];
const SQUARE: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 2.0, 0.0], [0.0, 2.0, 0.0]];

/// A square of vertices with coordinates of a type, and a face whose list has these types.
fn square(coordinate: &'static str, count: &'static str, index: &'static str, name: &str) -> Ply {
    let header = format!(
        "comment caf\u{e9}\nobj_info made by hand\nelement vertex 4\nproperty {coordinate} x\nproperty {coordinate} y\n\
         property {coordinate} z\nelement face 1\nproperty list {count} {index} {name}\n"
    );
    let vertices = SQUARE.iter().fold(Ply::new(&header), |ply, p| ply.element(&p.map(|x| (coordinate, x))));
    let corner = |i: u32| (index, f64::from(i));
    vertices.element(&[(count, 4.0), corner(0), corner(1), corner(2), corner(3)])
}

/// Killed by: a byte order, a type of the list or of a coordinate, or a name of the list that is not known.
#[test]
fn ply_of_every_number_type() {
    let lists = [("uchar", "int"), ("uint8", "uint32"), ("int", "ushort"), ("ushort", "uchar"), ("char", "short")];
    for format in FORMATS {
        for ((count, index), coordinate) in lists.into_iter().zip(["float", "double", "float32", "short", "uchar"]) {
            for name in ["vertex_indices", "vertex_index"] {
                let scene = loaded("a.ply", &square(coordinate, count, index, name).bytes(format));
                let p = |i: usize| SQUARE[i].map(|x| x as f32);
                assert_eq!(positions(&scene), [[p(0), p(1), p(2)], [p(0), p(2), p(3)]], "{format} {count} {index}");
                assert!(scene.triangles.iter().all(|t| !t.smooth));
                assert_eq!(scene.object_of(0), "a");
            }
        }
    }
}

/// Killed by: elements and properties that are not skipped by their types; faces before vertices; a name that does not
/// count; a file whose extension says another kind; line ends of other systems.
#[test]
fn ply_with_other_elements() {
    let header = "element camera 1\nproperty float view\nproperty list uchar double more\nelement face 2\n\
        property uchar flags\nproperty list uchar int vertex_indices\nproperty list uchar float other\n\
        element vertex 4\nproperty float x\nproperty float confidence\nproperty float y\nproperty float z\n\
        element edge 1\nproperty int vertex1\nproperty int vertex2\n";
    let face = |corners: [f64; 3]| {
        let [a, b, c] = corners.map(|i| ("int", i));
        [("uchar", 9.0), ("uchar", 3.0), a, b, c, ("uchar", 1.0), ("float", 7.0)]
    };
    let mut ply = Ply::new(header)
        .element(&[("float", 1.0), ("uchar", 2.0), ("double", 3.0), ("double", 4.0)])
        .element(&face([0.0, 1.0, 2.0]))
        .element(&face([0.0, 2.0, 3.0]));
    for [x, y, z] in SQUARE {
        ply = ply.element(&[("float", x), ("float", 0.5), ("float", y), ("float", z)]);
    }
    let ply = ply.element(&[("int", 0.0), ("int", 1.0)]);
    for format in FORMATS {
        let bytes = ply.bytes(format);
        let wanted = positions(&loaded("a.ply", &bytes));
        assert_eq!(wanted.len(), 2);
        assert_eq!(positions(&loaded("a.obj", &bytes)), wanted, "{format}");
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        for newline in ["\r\n", "\r"] {
            let head = String::from_utf8(bytes[..end].to_vec()).unwrap().replace('\n', newline);
            let body = if format == "ascii" && newline == "\r\n" {
                String::from_utf8(bytes[end..].to_vec()).unwrap().replace('\n', "\r\n").into_bytes()
            } else {
                bytes[end..].to_vec()
            };
            assert_eq!(positions(&loaded("b.ply", &[head.as_bytes(), &body].concat())), wanted, "{format} {newline:?}");
        }
    }
    let latin = b"ply\nformat ascii 1.0\ncomment caf\xe9\nelement vertex 3\nproperty float x\nproperty float y\n\
        property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n\n1 0 0\n0 1e0 0\n3 0 1 2\n";
    assert_eq!(loaded("a.ply", latin).triangles.len(), 1);
}

/// Normals, texture coordinates by vertex and by corner, polygons that are not convex, strips. Killed by: normals of a
/// flat mesh; texture coordinates that corners share; a fan in place of ears; every second triangle of a strip.
#[test]
fn ply_with_normals_and_coordinates() {
    let names = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n\
        property float ny\nproperty float nz\nproperty float";
    for (u, v) in [("u", "v"), ("s", "t"), ("texture_u", "texture_v")] {
        let header =
            format!("{names} {u}\nproperty float {v}\nelement face 1\nproperty list uchar int vertex_indices\n");
        let mut ply = Ply::new(&header);
        for (i, p) in SQUARE[..3].iter().enumerate() {
            let rest = [0.0, 0.5, 1.0, i as f64, 0.25];
            ply = ply.element(&p.iter().chain(&rest).map(|x| ("float", *x)).collect::<Vec<_>>());
        }
        let ply = ply.element(&[("uchar", 3.0), ("int", 0.0), ("int", 1.0), ("int", 2.0)]);
        for format in FORMATS {
            let scene = loaded("a.ply", &ply.bytes(format));
            assert!(scene.triangles[0].smooth);
            let [_, b, _] = corners(&scene)[0];
            assert_eq!(b, Vertex { position: [2.0, 0.0, 0.0], normal: [0.0, 0.5, 1.0], uv: [1.0, 0.25] });
        }
    }
    let by_corner = b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        element face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n\
        0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1\n3 0 2 3 6 0.5 0.5 0 0 0.25 1\n";
    let scene = loaded("a.ply", by_corner);
    let uvs: Vec<[[f32; 2]; 3]> = corners(&scene).iter().map(|t| t.map(|v| v.uv)).collect();
    assert_eq!(uvs, [[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.5, 0.5], [0.0, 0.0], [0.25, 1.0]]]);
    let c_shape = b"ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n3 0 0\n3 1 0\n1 1 0\n1 2 0\n3 2 0\n\
        3 3 0\n0 3 0\n8 0 1 2 3 4 5 6 7\n";
    let area = |t: &[[f32; 3]; 3]| {
        let [a, b, c] = *t;
        ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
    };
    let triangles = positions(&loaded("a.ply", c_shape));
    assert_eq!(triangles.len(), 6);
    assert!(triangles.iter().all(|t| area(t) >= 0.0) && triangles.iter().map(area).sum::<f32>() == 7.0);
    let strips = b"ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
        element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n\
        8 0 1 2 3 -1 2 3 4\n";
    let triangles = positions(&loaded("a.ply", strips));
    assert_eq!(triangles.len(), 3);
    assert!(triangles.iter().all(|t| area(t) == 0.5), "{triangles:?}");
}

/// Colours: constant ones in the material, others in a texture that gives every corner, and points between, the colour
/// that linear interpolation gives. Killed by: sRGB taken as linear; texture coordinates beside the centres of texels; a
/// fourth texel of the block that is none of the three colours' plane.
#[test]
fn ply_colors_become_textures() {
    let file = |colors: [[u8; 3]; 4]| {
        let header = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n\
            property uchar green\nproperty uchar blue\nproperty uchar alpha\nelement face 2\n\
            property list uchar int vertex_indices\n";
        let mut ply = Ply::new(header);
        for (p, c) in SQUARE.iter().zip(colors) {
            let color = c.map(|x| ("uchar", f64::from(x)));
            ply = ply.element(&[p.map(|x| ("float", x)).as_slice(), &color, &[("uchar", 255.0)]].concat());
        }
        let face = |t: [f64; 3]| [("uchar", 3.0), ("int", t[0]), ("int", t[1]), ("int", t[2])];
        ply.element(&face([0.0, 1.0, 2.0])).element(&face([0.0, 2.0, 3.0])).bytes("binary_little_endian")
    };
    let linear = |x: u8| croupier::unstable::texture::SRGB_TO_LINEAR[usize::from(x)];
    let scene = loaded("a.ply", &file([[188, 0, 255]; 4]));
    let wanted = Reflectance::Constant([188, 0, 255].map(linear));
    assert_eq!(scene.materials[0].model, Model::Diffuse { reflectance: wanted });
    let colors = [[200, 110, 60], [180, 90, 120], [160, 140, 90], [140, 100, 100]];
    let scene = loaded("a.ply", &file(colors));
    assert_eq!(scene.materials[0].model, Model::Diffuse { reflectance: Reflectance::Texture(0) });
    let texture = &scene.textures[0];
    let look_up = |uv: [f64; 2]| -> [f64; 3] {
        let x = uv[0] * f64::from(texture.width) - 0.5;
        let y = (1.0 - uv[1]) * f64::from(texture.height) - 0.5;
        let (i, j) = ((x + 1e-4).floor(), (y + 1e-4).floor());
        std::array::from_fn(|c| {
            let texel =
                |i: f64, j: f64| f64::from(linear(texture.texels[j as usize * texture.width as usize + i as usize][c]));
            let row = |j: f64| {
                texel(i, j) * (1.0 - (x - i)) + texel((i + 1.0).min(f64::from(texture.width) - 1.0), j) * (x - i)
            };
            row(j) * (1.0 - (y - j)) + row((j + 1.0).min(f64::from(texture.height) - 1.0)) * (y - j)
        })
    };
    let indices = [[0, 1, 2], [0, 2, 3]];
    for (triangle, from) in corners(&scene).iter().zip(indices) {
        for weights in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.2, 0.3, 0.5], [0.0, 0.5, 0.5]] {
            let uv = [0, 1].map(|k| (0..3).map(|i| weights[i] * f64::from(triangle[i].uv[k])).sum::<f64>());
            let found = look_up(uv);
            // which corner is first is free: positions tell
            let which = triangle.map(|v| SQUARE.iter().position(|p| p.map(|x| x as f32) == v.position).unwrap());
            assert!(which.iter().all(|i| from.contains(i)));
            for c in 0..3 {
                let wanted: f64 = (0..3).map(|i| weights[i] * f64::from(linear(colors[which[i]][c]))).sum();
                assert!((found[c] - wanted).abs() < 0.006, "{weights:?} {c}: {} for {wanted}", found[c]);
            }
        }
    }
}

/// Each wrong file and what its message says. Killed by: an error without line or byte, or a file that is taken.
#[test]
fn broken_ply_files() {
    let ascii = |header: &str, body: &str| format!("ply\nformat ascii 1.0\n{header}end_header\n{body}").into_bytes();
    let vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let faces = "element face 1\nproperty list uchar int vertex_indices\n";
    let both = format!("{vertices}{faces}");
    let good = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert_eq!(loaded("a.ply", &ascii(&both, good)).triangles.len(), 1);
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (b"solid\n".to_vec(), "@/a.ply:1: a PLY file begins with a line `ply`"),
        (b"ply\nformat ascii 1.0\n".to_vec(), "no `end_header`"),
        (ascii(&both, "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), "a face has vertex 3, but there are 3"),
        (ascii(&both, "0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), "@/a.ply:13: face 0: there is no vertex -1"),
        (ascii(&both, "0 0 0\n1 0 0\n0 x 0\n3 0 1 2\n"), "@/a.ply:12: vertex 2: "),
        (ascii(&both, "0 0 0\n1 0\n0 1 0\n3 0 1 2\n"), "@/a.ply:11: vertex 1: "),
        (ascii(&both, "0 0 0\n1 0 1e60\n0 1 0\n3 0 1 2\n"), "@/a.ply:11: vertex 1: a coordinate is inf"),
        (ascii(&both, "0 0 0\n1 0 0\n0 1 0\n"), "face 0: the file ends before it"),
        (ascii(&both, "0 0 0\n1 0 0\n0 1 0\n2 0 1\n"), "no face has three corners"),
        (ascii(vertices, "0 0 0\n1 0 0\n0 1 0\n"), "3 vertices, but no faces"),
        (ascii(&vertices.replace(" 3", " 4000000000"), good), "4000000000 elements `vertex` do not fit"),
        (ascii("element vertex 3\n", good), "elements `vertex` have no properties"),
        (ascii(&vertices.replace("float z", "float w"), good), "no property `z`"),
        (ascii("element vertex x\n", good), "@/a.ply:3: "),
        (ascii("property float x\n", good), "@/a.ply:3: "),
        (b"ply\nformat binary_middle_endian 1.0\nend_header\n".to_vec(), "@/a.ply:2: "),
        (ascii(&both.replace("list uchar int", "int"), "0 0 0\n1 0 0\n0 1 0\n3\n"), "face 0: "),
    ];
    for (bytes, wanted) in cases {
        let error = try_load("a.ply", &bytes).unwrap_err();
        assert!(error.contains(wanted) && error.len() < 300 && error.lines().count() == 1, "{error:?}: {wanted}");
    }
    let ply = square("float", "uchar", "int", "vertex_indices").bytes("binary_little_endian");
    let error = try_load("a.ply", &ply[..ply.len() - 1]).unwrap_err();
    assert!(error.contains(&format!("byte {}: face 0: the file ends within it", ply.len() - 17)), "{error}");
}

/// Killed by: a panic, or an allocation that a count in the file decides.
#[test]
fn corrupted_meshes_are_survived() {
    let files = [
        ("a.ply", square("float", "uchar", "int", "vertex_indices").bytes("ascii")),
        ("a.ply", square("double", "ushort", "uint", "vertex_index").bytes("binary_big_endian")),
        ("a.stl", binary_stl(b"solid but binary", &TRIANGLES)),
        ("a.stl", text_stl("thing", &TRIANGLES).into_bytes()),
        ("sky.hdr", hdr("-Y 3 +X 20", &[coded_row(20), old_row(20), flat_row(20)].concat())),
    ];
    let mut random = SplitMix(7);
    for (name, bytes) in files {
        for round in 0..1000 {
            let mut bytes = bytes.clone();
            for _ in 0..=round % 4 {
                let at = (random.bits() % bytes.len() as u64) as usize;
                match random.bits() % 4 {
                    0 => bytes.truncate(at.max(1)),
                    1 => bytes[at] = random.bits() as u8,
                    2 => bytes[at] ^= 1 << (random.bits() % 8),
                    _ => drop(bytes.remove(at.min(bytes.len() - 1))),
                }
                if bytes.is_empty() {
                    break;
                }
            }
            let _ = if name == "sky.hdr" { environment(&bytes).map(drop) } else { try_load(name, &bytes).map(drop) };
        }
    }
}

type Facet = [[f32; 3]; 3];

const TRIANGLES: [Facet; 2] =
    [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.5, -0.0]], [[1.0, 0.0, 0.0], [1.0, 1.0, 0.25], [0.0, 1.5, 0.0]]];

fn binary_stl(header: &[u8], triangles: &[Facet]) -> Vec<u8> {
    let mut file = header.to_vec();
    file.resize(80, 0);
    file.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        file.extend([0; 12]);
        file.extend(t.as_flattened().iter().flat_map(|x| x.to_le_bytes()));
        file.extend([1, 2]);
    }
    file
}

fn text_stl(name: &str, triangles: &[Facet]) -> String {
    let facet = |t: &Facet| {
        let vertices: String = t.iter().map(|[x, y, z]| format!("  vertex {x:e} {y} {z}\n")).collect();
        format!(" facet normal nan -nan(ind) 0\n  outer loop\n{vertices}  endloop\n endfacet\n")
    };
    format!("solid {name}\n{}endsolid {name}\n", triangles.iter().map(facet).collect::<String>())
}

/// Killed by: a binary file taken for text because of its header, or the other way round; capital keywords; a solid
/// without a name; the second solid of a file; bytes behind the triangles; corners at one place as two vertices.
#[test]
fn stl_in_every_form() {
    let text = text_stl("a name", &TRIANGLES);
    let one_line = text.replacen('\n', " \n", 1).replace("\n  ", " ").replace("\n endfacet", " endfacet");
    let two = format!("{}\n{}", text_stl("", &TRIANGLES[..1]), text_stl("b c", &TRIANGLES[1..]));
    let padded = [binary_stl(b"exported", &TRIANGLES), vec![0; 100]].concat();
    let files: Vec<(&str, Vec<u8>)> = vec![
        ("a.stl", binary_stl(b"exported", &TRIANGLES)),
        ("a.STL", binary_stl(b"solid of a CAD program", &TRIANGLES)),
        ("a.stl", padded),
        ("a.stl", text.clone().into_bytes()),
        ("a.stl", text.to_uppercase().replace("NAN", "nan").into_bytes()),
        ("a.stl", text.replace('\n', "\r\n").into_bytes()),
        ("a.stl", format!("\n  {text}").into_bytes()),
        ("a.stl", one_line.into_bytes()),
        ("a.stl", two.into_bytes()),
        ("a.stl", text.replace(" a name", "").into_bytes()),
        ("a.stl", [b"solid caf\xe9\n".as_slice(), text.split_once('\n').unwrap().1.as_bytes()].concat()),
    ];
    for (i, (name, bytes)) in files.iter().enumerate() {
        let scene = loaded(name, bytes);
        assert_eq!(positions(&scene), TRIANGLES, "file {i}");
        assert_eq!(scene.vertices.len(), 4, "file {i}");
        assert!(scene.triangles.iter().all(|t| !t.smooth));
    }
}

/// Killed by: an error without line or byte, or a file that is taken.
#[test]
fn broken_stl_files() {
    let binary = binary_stl(b"", &TRIANGLES);
    let mut infinite = binary.clone();
    infinite[84 + 50 + 12..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let text = text_stl("x", &TRIANGLES);
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (binary[..binary.len() - 1].to_vec(), "@/a.stl: not STL: no `solid`, and 183 bytes where"),
        (b"PNG".to_vec(), "3 bytes are less than the header"),
        (infinite, "@/a.stl: byte 134: a corner of triangle 1 is at inf"),
        (binary_stl(b"", &[]), "no triangles"),
        (b"solid x\nendsolid x\n".to_vec(), "no triangles"),
        (text.replacen("1e0 0 0", "1e0 0 zero", 1).into_bytes(), "@/a.stl:5: `zero` is not a number"),
        (text.replacen("1e0 0 0", "1e0 0", 1).into_bytes(), "@/a.stl:5: `vertex` needs 3 numbers"),
        (text.replacen("1e0 0 0", "1e60 0 0", 1).into_bytes(), "@/a.stl:5: a vertex is at inf"),
        (text.replacen("  vertex 1e0 0 0\n", "", 1).into_bytes(), "@/a.stl:7: a facet of 2 vertices"),
        (text.replacen("endloop", "vertex 0 0 0", 1).into_bytes(), "@/a.stl:7: a facet of more than 3 vertices"),
        (text.replacen(" facet", " faucet", 1).into_bytes(), "@/a.stl:2: `faucet` is unexpected here"),
        (text.as_bytes()[..text.rfind("endloop").unwrap()].to_vec(), "the file ends within this facet"),
    ];
    for (bytes, wanted) in cases {
        let error = try_load("a.stl", &bytes).unwrap_err();
        assert!(error.contains(wanted) && error.len() < 300, "{error:?}: {wanted}");
    }
}

/// An environment map of these bytes, through a scene file.
fn environment(bytes: &[u8]) -> Result<(u32, u32, Vec<[f32; 3]>), String> {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("sky.hdr"), bytes).unwrap();
    fs::write(at("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n").unwrap();
    let json = r#"{"camera": {"origin": [0, 0, 4], "target": [0, 0, 0], "up": [0, 1, 0], "vfov_deg": 40, "width": 8, "height": 8},
        "materials": {"m": {"type": "diffuse", "reflectance": [0.5, 0.5, 0.5]}},
        "emitters": [{"type": "envmap", "file": "sky.hdr"}], "geometry": {"file": "a.obj"}}"#;
    fs::write(at("scene.json"), json).unwrap();
    match load(&at("scene.json")).map_err(|e| e.to_string())?.0.environment {
        Some(Environment::Map { width, height, texels, .. }) => Ok((width, height, texels)),
        other => Err(format!("{other:?}")),
    }
}

fn hdr(size: &str, rows: &[u8]) -> Vec<u8> {
    let header = format!("#?RADIANCE\n# made by hand\nEXPOSURE= 0.5\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=4\n\n{size}\n");
    [header.as_bytes(), rows].concat()
}

/// Pixel x of the rows below: red x, green 7, blue 1 where x is 3, exponents 130 and 128.
fn pixel(x: u8) -> [u8; 4] {
    [x, 7, u8::from(x == 3), if x.is_multiple_of(2) { 130 } else { 128 }]
}

fn flat_row(n: u8) -> Vec<u8> {
    (0..n).flat_map(pixel).collect()
}

/// The pixels coded by component: red literally, green as one run, blue as both, exponents literally.
fn coded_row(n: u8) -> Vec<u8> {
    let mut row = vec![2, 2, 0, n, n];
    row.extend((0..n).map(|x| pixel(x)[0]));
    row.extend([128 + n, 7, 128 + 3, 0, 1, 1, 128 + n - 4, 0, n]);
    row.extend((0..n).map(|x| pixel(x)[3]));
    row
}

/// Pixel 4 and then runs of it: 3, and 2 (with 1 x 256 more it would be too long).
fn old_row(n: u8) -> Vec<u8> {
    let mut row: Vec<u8> = pixel(4).to_vec();
    row.extend([1, 1, 1, 3]);
    row.extend((4..n - 2).flat_map(pixel));
    row.extend([1, 1, 1, 2]);
    row
}

/// Rows of all three codes, and a run whose length takes two markers. Killed by: a component in the place of another;
/// old runs of the first pixel alone, or whose second marker does not count 256 times; exposure that multiplies.
#[test]
fn hdr_codes() {
    // the exposures' product is 2
    let linear =
        |p: [u8; 4]| [0, 1, 2].map(|c| (f64::from(p[c]) * f64::from(i32::from(p[3]) - 136).exp2() / 2.0) as f32);
    let (width, height, texels) =
        environment(&hdr("-Y 3 +X 20", &[coded_row(20), old_row(20), flat_row(20)].concat())).unwrap();
    assert_eq!((width, height), (20, 3));
    for x in 0..20u8 {
        for (row, source) in [(0, x), (1, x.clamp(4, 17)), (2, x)] {
            assert_eq!(texels[row * 20 + usize::from(x)], linear(pixel(source)), "row {row} pixel {x}");
        }
    }
    let long: Vec<u8> = [pixel(5), [1, 1, 1, 1], [1, 1, 1, 2], pixel(6)].concat();
    let (_, _, texels) = environment(&hdr("-Y 2 +X 515", &[long.clone(), long].concat())).unwrap();
    assert!(texels[..514].iter().all(|t| *t == linear(pixel(5))));
    assert_eq!(texels[514], linear(pixel(6)));
    let zero = environment(&hdr("-Y 2 +X 1", &[9, 9, 9, 0, 200, 9, 9, 255])).unwrap().2;
    assert_eq!(zero[0], [0.0; 3]);
    assert!(zero[1][0] > 1e37);
}

/// The eight orientations of one picture. Killed by: an axis that is not flipped, columns taken for rows.
#[test]
fn hdr_orientations() {
    // value of the pixel in column x from the left, row y from the top
    let value = |x: usize, y: usize| (10 * y + x + 2) as u8;
    let (width, height) = (3, 2);
    for outer in ["-Y", "+Y", "-X", "+X"] {
        for inner in ["-Y", "+Y", "-X", "+X"] {
            if outer[1..] == inner[1..] {
                let found = environment(&hdr(&format!("{outer} 2 {inner} 3"), &[1; 24]));
                assert!(found.unwrap_err().contains("is no size"), "{outer} {inner}");
                continue;
            }
            let (rows, row) = if outer.ends_with('Y') { (height, width) } else { (width, height) };
            let mut pixels = Vec::new();
            for j in 0..rows {
                for i in 0..row {
                    let at = |axis: &str, k: usize| match axis {
                        "+X" | "-Y" => k,
                        "-X" => width - 1 - k,
                        _ => height - 1 - k,
                    };
                    let (x, y) =
                        if outer.ends_with('Y') { (at(inner, i), at(outer, j)) } else { (at(outer, j), at(inner, i)) };
                    let v = value(x, y);
                    pixels.extend([v, v, v, 137]);
                }
            }
            let found = environment(&hdr(&format!("{outer} {rows} {inner} {row}"), &pixels));
            let (w, h, texels) = found.unwrap();
            assert_eq!((w as usize, h as usize), (width, height));
            let wanted: Vec<f32> = (0..6).map(|i| f32::from(value(i % 3, i / 3))).collect();
            assert_eq!(texels.iter().map(|t| t[0]).collect::<Vec<_>>(), wanted, "{outer} {inner}");
        }
    }
}

/// Killed by: a file that is taken, an error without the image's name or the row.
#[test]
fn broken_hdr_files() {
    let row = coded_row(20);
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (b"#?RADIANCE\n".to_vec(), "the header has no end"),
        (b"#?RGBE\nFORMAT=32-bit_rle_xyze\n\n-Y 2 +X 2\n".to_vec(), "`32-bit_rle_xyze`, only"),
        (b"#?RGBE\nEXPOSURE=0\n\n-Y 2 +X 2\n".to_vec(), "EXPOSURE is `0`"),
        (b"#?RGBE\n\n".to_vec(), "the picture has no size"),
        (hdr("-Y 2", &row), "`-Y 2` is no size such as"),
        (hdr("-Y 0 +X 8", &row), "is no size"),
        (hdr("-Y 65536 +X 65536", &row), "bytes of pixels are too few"),
        (hdr("-Y 1 +X 20", &row), "needs 2 rows"),
        (hdr("-Y 2 +X 20", &[row.clone(), row[..30].to_vec()].concat()), "row 1: the file ends within it"),
        (hdr("-Y 2 +X 21", &[row.clone(), row.clone()].concat()), "row 0: it states 20 pixels, not 21"),
        (hdr("-Y 2 +X 20", &[vec![2, 2, 0, 20, 21], vec![0; 90]].concat()), "row 0: a run passes its end"),
        (hdr("-Y 2 +X 20", &[vec![2, 2, 0, 20, 0], vec![0; 90]].concat()), "row 0: a run passes its end"),
        (hdr("-Y 2 +X 20", &[vec![1, 1, 1, 5], vec![0; 90]].concat()), "row 0: a run before the first pixel"),
        (hdr("-Y 2 +X 20", &[vec![9, 9, 9, 9, 1, 1, 1, 20], vec![0; 90]].concat()), "row 0: a run passes its end"),
    ];
    for (bytes, wanted) in cases {
        let error = environment(&bytes).unwrap_err();
        assert!(error.contains(wanted) && error.contains("sky.hdr") && error.len() < 500, "{error:?}: {wanted}");
    }
}
