//! glTF documents made in code: JSON, and one buffer that grows.

use serde_json::{Value, json};

/// Component types of accessors.
pub const FLOAT: u32 = 5126;
/// Unsigned bytes.
pub const U8: u32 = 5121;
/// Signed bytes.
pub const I8: u32 = 5120;
/// Unsigned shorts.
pub const U16: u32 = 5123;
/// Signed shorts.
pub const I16: u32 = 5122;
/// Unsigned integers.
pub const U32: u32 = 5125;

/// A document and its buffer.
#[derive(Clone, Debug)]
pub struct Document {
    /// JSON, without `buffers`.
    pub json: Value,
    /// The buffer.
    pub bytes: Vec<u8>,
}

impl Default for Document {
    fn default() -> Self {
        let json = json!({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]});
        Self { json, bytes: Vec::new() }
    }
}

/// Components as bytes.
pub fn encode(component: u32, values: &[f64]) -> Vec<u8> {
    let bytes = |x: f64| match component {
        FLOAT => (x as f32).to_le_bytes().to_vec(),
        U8 => vec![x as u8],
        I8 => vec![x as i8 as u8],
        U16 => (x as u16).to_le_bytes().to_vec(),
        I16 => (x as i16).to_le_bytes().to_vec(),
        U32 => (x as u32).to_le_bytes().to_vec(),
        other => panic!("component type {other}"),
    };
    values.iter().flat_map(|x| bytes(*x)).collect()
}

impl Document {
    /// Adds an element to a list of the document, which may not be there yet; returns its index.
    pub fn push(&mut self, list: &str, value: Value) -> usize {
        let list = &mut self.json[list];
        if list.is_null() {
            *list = json!([]);
        }
        let list = list.as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// A buffer view of these bytes.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0xab);
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        self.push("bufferViews", json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}))
    }

    /// An accessor of packed elements of `width` components.
    pub fn accessor(&mut self, component: u32, width: usize, normalized: bool, values: &[f64]) -> usize {
        let kind = ["", "SCALAR", "VEC2", "VEC3", "VEC4"].get(width).copied().unwrap_or("MAT4");
        let view = self.view(&encode(component, values));
        let count = values.len() / width;
        let accessor = json!({"bufferView": view, "componentType": component, "count": count, "type": kind,
            "normalized": normalized});
        self.push("accessors", accessor)
    }

    /// An accessor of floats.
    pub fn floats<const N: usize>(&mut self, values: &[[f64; N]]) -> usize {
        self.accessor(FLOAT, N, false, values.as_flattened())
    }

    /// A node of the scene.
    pub fn node(&mut self, node: Value) -> usize {
        let index = self.push("nodes", node);
        self.json["scenes"][0]["nodes"].as_array_mut().unwrap().push(json!(index));
        index
    }

    /// A mesh of one primitive; returns its index.
    pub fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({"primitives": [primitive]}))
    }

    /// A triangle (0, 0, 0), (1, 0, 0), (0, 1, 0) with texture coordinates, normals and perhaps a material: its mesh.
    pub fn triangle(&mut self, material: Option<usize>) -> usize {
        let position = self.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let normal = self.floats(&[[0.0, 0.0, 1.0]; 3]);
        let uv = self.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        let mut primitive = json!({"attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv}});
        if let Some(material) = material {
            primitive["material"] = json!(material);
        }
        self.mesh(primitive)
    }

    /// A document of that triangle with a material.
    pub fn of_material(material: Value) -> Self {
        let mut document = Self::default();
        let material = document.push("materials", material);
        let mesh = document.triangle(Some(material));
        document.node(json!({"mesh": mesh}));
        document
    }

    /// The bytes of a PNG of RGBA texels as an image and a texture; returns the texture's index.
    pub fn texture(&mut self, width: u32, height: u32, texels: &[[u8; 4]]) -> usize {
        let view = self.view(&png(width, height, texels));
        let image = self.push("images", json!({"bufferView": view, "mimeType": "image/png"}));
        self.push("textures", json!({"source": image}))
    }

    fn with_buffer(&self, buffer: Value) -> Vec<u8> {
        let mut json = self.json.clone();
        if !self.bytes.is_empty() {
            json["buffers"] = json!([buffer]);
        }
        json.to_string().into_bytes()
    }

    /// As `.gltf` whose buffer has a URI.
    pub fn gltf(&self, uri: &str) -> Vec<u8> {
        self.with_buffer(json!({"byteLength": self.bytes.len(), "uri": uri}))
    }

    /// As `.gltf` with the buffer inside.
    pub fn embedded(&self) -> Vec<u8> {
        self.gltf(&format!("data:application/octet-stream;base64,{}", base64(&self.bytes)))
    }

    /// As `.glb`.
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.with_buffer(json!({"byteLength": self.bytes.len()}));
        json.resize(json.len().next_multiple_of(4), b' ');
        let mut binary = self.bytes.clone();
        binary.resize(binary.len().next_multiple_of(4), 0);
        let word = |n: usize| (n as u32).to_le_bytes();
        let length = 12 + 8 + json.len() + 8 + binary.len();
        let header = [b"glTF".as_slice(), &word(2), &word(length)].concat();
        [&header, &word(json.len())[..], b"JSON", &json, &word(binary.len()), b"BIN\0", &binary].concat()
    }
}

/// RFC 4648, without line breaks.
pub fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |b: &[u8]| {
        let n = (0..3).fold(0u32, |n, i| n << 8 | u32::from(b.get(i).copied().unwrap_or(0)));
        let digit = |i: usize| if i <= b.len() { char::from(DIGITS[(n >> (18 - 6 * i) & 63) as usize]) } else { '=' };
        [0, 1, 2, 3].map(digit)
    };
    bytes.chunks(3).flat_map(group).collect()
}

/// A PNG of RGBA texels.
pub fn png(width: u32, height: u32, texels: &[[u8; 4]]) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header().unwrap().write_image_data(texels.as_flattened()).unwrap();
    file
}
