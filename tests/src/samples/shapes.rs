//! Meshes of glTF documents.

use crate::gltf::{Document, FLOAT, U16};
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};

/// Corners with normals and texture coordinates, and triangles.
#[derive(Clone, Debug, Default)]
pub(super) struct Shape {
    pub(super) positions: Vec<[f64; 3]>,
    pub(super) normals: Vec<[f64; 3]>,
    pub(super) uvs: Vec<[f64; 2]>,
    pub(super) faces: Vec<[u32; 3]>,
}

impl Shape {
    /// A square of side 2 in the plane z = 0, facing +z; the first row of a texture is at its top.
    pub(super) fn square() -> Self {
        let uvs = vec![[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
        let positions = uvs.iter().map(|[u, v]| [2.0 * u - 1.0, 1.0 - 2.0 * v, 0.0]).collect();
        Self { positions, normals: vec![[0.0, 0.0, 1.0]; 4], uvs, faces: vec![[0, 1, 2], [0, 2, 3]] }
    }

    /// A cube from -1 to 1: 12 triangles.
    pub(super) fn cube() -> Self {
        let mut cube = Self::default();
        let square = Self::square();
        // Each axis in turn takes the square's normal; the other two follow in order, mirrored ones in reverse.
        for axis in 0..3 {
            for side in [1.0, -1.0] {
                let first = cube.positions.len() as u32;
                let place = |[x, y]: [f64; 2], z: f64| {
                    let mut p = [0.0; 3];
                    (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side * z, side * x, y);
                    p
                };
                cube.positions.extend(square.positions.iter().map(|[x, y, _]| place([*x, *y], 1.0)));
                cube.normals.extend([place([0.0; 2], 1.0); 4]);
                cube.uvs.extend(&square.uvs);
                cube.faces.extend(square.faces.iter().map(|f| f.map(|i| first + i)));
            }
        }
        cube
    }

    /// Points of rows by columns, a row for each `v` from 0 to 1 and a column for each `u`; texture coordinates are u and v.
    fn grid(columns: u32, rows: u32, point: impl Fn(f64, f64) -> ([f64; 3], [f64; 3])) -> Self {
        let mut grid = Self::default();
        for (j, i) in (0..=rows).flat_map(|j| (0..=columns).map(move |i| (j, i))) {
            let (u, v) = (f64::from(i) / f64::from(columns), f64::from(j) / f64::from(rows));
            let (position, normal) = point(u, v);
            grid.positions.push(position);
            grid.normals.push(normal);
            grid.uvs.push([u, v]);
        }
        for (j, i) in (0..rows).flat_map(|j| (0..columns).map(move |i| (j, i))) {
            let a = j * (columns + 1) + i;
            let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
            grid.faces.extend([[a, d, c], [a, c, b]]);
        }
        grid.faces.retain(|f| {
            let [a, b, c] = f.map(|i| grid.positions[i as usize]);
            a != b && b != c && c != a
        });
        grid
    }

    /// A sphere of radius 1, y up, closed: 2 (rows - 1) columns triangles.
    pub(super) fn sphere(columns: u32, rows: u32) -> Self {
        Self::grid(columns, rows, |u, v| {
            // exactly one point at each pole, and one seam
            let (sin, cos) = if u == 1.0 { (0.0, 1.0) } else { (TAU * u).sin_cos() };
            let (across, up) = if v == 0.0 || v == 1.0 { (0.0, 1.0 - 2.0 * v) } else { (PI * v).sin_cos() };
            let p = [across * sin + 0.0, up, across * cos + 0.0];
            (p, p)
        })
    }

    /// The side of a cylinder of radius 1 along x from -1 to 1: 2 columns triangles.
    pub(super) fn tube(columns: u32) -> Self {
        Self::grid(columns, 1, |u, v| {
            let (sin, cos) = (TAU * u).sin_cos();
            ([1.0 - 2.0 * v, cos, -sin], [0.0, cos, -sin])
        })
    }

    /// A wavy cloth of side 2 above the plane y = 0: 2 n² triangles.
    pub(super) fn cloth(n: u32) -> Self {
        let height = |x: f64, z: f64| 0.2 * (4.0 * x).sin() * (3.0 * z).cos();
        Self::grid(n, n, |u, v| {
            let (x, z) = (2.0 * u - 1.0, 2.0 * v - 1.0);
            let slope = [0.8 * (4.0 * x).cos() * (3.0 * z).cos(), -0.6 * (4.0 * x).sin() * (3.0 * z).sin()];
            let length = (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt();
            ([x, height(x, z), z], [-slope[0] / length, 1.0 / length, -slope[1] / length])
        })
    }

    /// Adds the attributes and indices to a document: a primitive without a material.
    pub(super) fn primitive(&self, document: &mut Document) -> Value {
        let attributes = json!({"POSITION": document.floats(&self.positions),
            "NORMAL": document.floats(&self.normals), "TEXCOORD_0": document.floats(&self.uvs)});
        json!({"attributes": attributes, "indices": self.indices(document)})
    }

    /// The accessor of the triangles' corners.
    pub(super) fn indices(&self, document: &mut Document) -> usize {
        let corners: Vec<f64> = self.faces.as_flattened().iter().map(|i| f64::from(*i)).collect();
        document.accessor(U16, 1, false, &corners)
    }

    /// The mesh with a new material.
    pub(super) fn mesh(&self, document: &mut Document, material: Value) -> usize {
        let material = document.push("materials", material);
        let mut primitive = self.primitive(document);
        primitive["material"] = json!(material);
        document.mesh(primitive)
    }

    /// The mesh with positions and normals in turn in one buffer view.
    pub(super) fn interleaved(&self, document: &mut Document) -> usize {
        let rows: Vec<f64> = self.positions.iter().zip(&self.normals).flat_map(|(p, n)| [*p, *n].concat()).collect();
        let view = document.view(&crate::gltf::encode(FLOAT, &rows));
        document.json["bufferViews"][view]["byteStride"] = json!(24);
        let mut accessor = |offset: u32| {
            let accessor = json!({"bufferView": view, "byteOffset": offset, "componentType": FLOAT,
                "count": self.positions.len(), "type": "VEC3"});
            document.push("accessors", accessor)
        };
        let attributes = json!({"POSITION": accessor(0), "NORMAL": accessor(12)});
        let indices = self.indices(document);
        document.mesh(json!({"attributes": attributes, "indices": indices}))
    }
}
