//! Scene blobs made by hand, independently of the host's baking: a small scene that has one of everything, and the
//! writer that turns its parts into bytes. Corrupting a part and writing it again gives a blob with a valid hash.

use bytemuck::{Pod, Zeroable};
use croupier::unstable::scene::blob::*;

/// Bytes at an address that is a multiple of 64.
#[derive(Clone, Debug)]
pub struct Blob {
    lines: Vec<Line>,
    length: usize,
}

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([u8; 64]);

impl Blob {
    /// A copy of any bytes.
    pub fn new(bytes: &[u8]) -> Self {
        let mut lines = vec![Line::zeroed(); bytes.len().div_ceil(64)];
        bytemuck::cast_slice_mut(&mut lines)[..bytes.len()].copy_from_slice(bytes);
        Self { lines, length: bytes.len() }
    }

    /// The bytes.
    pub fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.lines)[..self.length]
    }

    /// The bytes, to corrupt.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.lines)[..self.length]
    }

    /// Makes the header's hash that of the content.
    pub fn rehash(&mut self) {
        let hash = content_hash(&self.bytes()[size_of::<Header>()..]);
        self.header(|h| h.hash = hash);
    }

    /// Edits the header.
    pub fn header(&mut self, edit: impl FnOnce(&mut Header)) {
        edit(bytemuck::from_bytes_mut(&mut self.bytes_mut()[..size_of::<Header>()]));
    }

    /// Edits entry `i` of the section table and fixes the hash.
    pub fn section(&mut self, i: usize, edit: impl FnOnce(&mut Section)) {
        let start = size_of::<Header>() + i * size_of::<Section>();
        edit(bytemuck::from_bytes_mut(&mut self.bytes_mut()[start..start + size_of::<Section>()]));
        self.rehash();
    }
}

/// The sections of a blob.
#[derive(Clone, Debug)]
#[expect(missing_docs, reason = "one field per section, named as in the scene")]
pub struct Parts {
    pub info: Vec<SceneInfo>,
    pub nodes: Vec<Node>,
    pub leaves: Vec<Leaf>,
    pub triangles: Vec<Triangle>,
    pub vertices: Vec<Vertex>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    pub texels: Vec<u32>,
    pub tables: Vec<f32>,
    pub lights: Vec<Light>,
    pub light_alias: Vec<Alias>,
    pub environment: Vec<Environment>,
    pub env_texels: Vec<[f32; 3]>,
    pub env_alias: Vec<Alias>,
    pub cameras: Vec<Camera>,
    pub media: Vec<Medium>,
    pub densities: Vec<f32>,
    pub majorants: Vec<f32>,
    pub names: Vec<u8>,
}

/// Adds the record of a principled material with its tables; the entry where it begins.
fn principled(tables: &mut Vec<f32>) -> u32 {
    let reflection = tables.len() as u32;
    let row = ReflectionRow { columns: [[0.5, 0.25, 1.0, 0.0]; 32], nodes: [[0.5, 0.25]; 4] };
    tables.extend_from_slice(bytemuck::cast_slice(&[row; PRINCIPLED_ROWS]));
    let energy = tables.len() as u32;
    tables.extend_from_slice(bytemuck::cast_slice(&[EnergyRow { sides: [[0.75; 32]; 2] }; PRINCIPLED_ENERGY_ROWS]));
    let record = tables.len() as u32;
    let layer = LayerRecord { albedo: [0.125; 32], nodes: [0.125; 4] };
    let mut textures = [TextureRecord::NONE; PRINCIPLED_TEXTURES];
    textures[0] = TextureRecord { texture: 0, transform: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] };
    tables.extend_from_slice(bytemuck::cast_slice(&[PrincipledRecord {
        metalness: 0.5,
        roughness: 0.5,
        transmission: 0.5,
        coat: 0.5,
        opacity: 1.0,
        f90: 1.0,
        f0: [0.04; 3],
        sheen_color: [0.5; 3],
        coat_alpha: 0.1,
        sheen_alpha: 0.5,
        eta: 1.5,
        normal_scale: 1.0,
        flags: 0,
        reflection,
        energy,
        textures,
        coat_layer: layer,
        sheen_layer: layer,
    }]));
    record
}

impl Parts {
    /// The blob: header, table, sections in the order of their kinds.
    pub fn blob(&self) -> Blob {
        let mut table = Vec::new();
        let mut body: Vec<u8> = Vec::new();
        let first = (size_of::<Header>() + SectionKind::ALL.len() * size_of::<Section>()).next_multiple_of(ALIGN);
        let mut put = |kind: SectionKind, stride: usize, bytes: &[u8]| {
            body.resize(body.len().next_multiple_of(ALIGN), 0);
            let offset = (first + body.len()) as u64;
            table.push(Section {
                kind: kind as u32,
                stride: stride as u32,
                offset,
                count: (bytes.len() / stride) as u64,
            });
            body.extend_from_slice(bytes);
        };
        macro_rules! put {
            ($($field:ident $kind:ident $t:ty),*) => {
                $(put(SectionKind::$kind, size_of::<$t>(), bytemuck::cast_slice::<$t, u8>(&self.$field));)*
            };
        }
        put!(info Info SceneInfo, nodes Nodes Node, leaves Leaves Leaf, triangles Triangles Triangle,
            vertices Vertices Vertex, materials Materials Material, textures Textures Texture, texels Texels u32,
            tables Tables f32, lights Lights Light, light_alias LightAlias Alias,
            environment Environment Environment, env_texels EnvTexels [f32; 3], env_alias EnvAlias Alias,
            cameras Cameras Camera, media Media Medium, densities Densities f32, majorants Majorants f32,
            names Names u8);
        let header = Header {
            magic: MAGIC,
            version: VERSION,
            sections: table.len() as u32,
            length: (first + body.len()) as u64,
            hash: 0,
            reserved: [0; 8],
        };
        let mut bytes = bytemuck::bytes_of(&header).to_vec();
        bytes.extend_from_slice(bytemuck::cast_slice(&table));
        bytes.resize(first, 0);
        bytes.extend_from_slice(&body);
        let mut blob = Blob::new(&bytes);
        blob.rehash();
        blob
    }

    /// Makes a material compensated, with tables of ones that it shares with none.
    pub fn compensate(&mut self, index: usize) {
        let m = &mut self.materials[index];
        let parameters = MaterialKind::from_u32(m.kind).unwrap().facts().parameters;
        m.flags |= MATERIAL_COMPENSATED;
        m.table = self.tables.len() as u32;
        self.tables.extend(parameters.iter().flat_map(|p| vec![1.0; p.entries()]));
    }

    /// A textured floor of rough plastic seen under an emitting quad, an environment map with one black row of cells,
    /// a point and a directional light; one material of every kind; a lens. The tree has two nodes and three leaves.
    pub fn tiny() -> Self {
        let vertex = |p: [f32; 3], n: [f32; 3], uv: [f32; 2]| Vertex { p, n, uv };
        let (up, down) = ([0.0, 1.0, 0.0], [0.0, -1.0, 0.0]);
        let vertices = vec![
            vertex([-2.0, 0.0, -2.0], up, [0.0, 0.0]),
            vertex([-2.0, 0.0, 2.0], up, [0.0, 1.0]),
            vertex([2.0, 0.0, 2.0], up, [1.0, 1.0]),
            vertex([2.0, 0.0, -2.0], up, [1.0, 0.0]),
            vertex([-0.5, 3.0, -0.5], down, [0.0, 0.0]),
            vertex([0.5, 3.0, -0.5], down, [0.0, 1.0]),
            vertex([0.5, 3.0, 0.5], down, [1.0, 1.0]),
            vertex([-0.5, 3.0, 0.5], down, [1.0, 0.0]),
        ];
        let triangle = |vertex, material, light, flags| Triangle { vertex, material, light, flags };
        let triangles = vec![
            triangle([0, 1, 2], 8, NONE, TRIANGLE_SMOOTH),
            triangle([0, 2, 3], 8, NONE, TRIANGLE_SMOOTH),
            triangle([4, 5, 6], 0, 0, 0),
            triangle([4, 6, 7], 0, 1, 0),
        ];
        let material = |kind: &MaterialKind| Material {
            kind: *kind as u32,
            texture: NONE,
            table: if kind.facts().parameters.contains(&Parameter::TransmittanceTable) { 0 } else { NONE },
            reflectance: [0.5, 0.6, 0.7],
            alpha: 0.2,
            eta: [1.5, 0.2, 1.1],
            fdr: 0.5963,
            k: [3.0, 2.5, 2.0],
            medium: NONE,
            ..Material::zeroed()
        };
        let mut materials: Vec<_> = MaterialKind::ALL.iter().map(material).collect();
        materials[0].flags = MATERIAL_TWO_SIDED;
        let mut tables: Vec<f32> = (0..64).map(|i| i as f32 / 64.0).collect();
        materials[MaterialKind::Principled as usize].table = principled(&mut tables);
        materials[8].texture = 0;
        let light_alias = alias(&[3, 3, 8, 1, 1]);
        let light = |kind: LightKind, triangle, area, vector, emission| Light {
            kind: kind as u32,
            triangle,
            area,
            vector,
            emission,
            reserved: 0,
            params: [0.0; 6],
        };
        let (zero, glow) = ([0.0; 3], [4.0, 3.0, 2.0]);
        let lights = vec![
            light(LightKind::Area, 2, 0.5, zero, glow),
            light(LightKind::Area, 3, 0.5, zero, glow),
            light(LightKind::Environment, NONE, 0.0, zero, zero),
            light(LightKind::Point, NONE, 0.0, [0.0, 2.0, 0.0], [1.0, 2.0, 3.0]),
            light(LightKind::Directional, NONE, 0.0, [0.0, 0.6, 0.8], [0.5; 3]),
        ];
        let mut parts = Self {
            info: vec![SceneInfo { max_depth: 8, ..SceneInfo::zeroed() }],
            nodes: Vec::new(),
            leaves: Vec::new(),
            triangles,
            vertices,
            materials,
            textures: vec![Texture { first: 1, width: 2, height: 3, flags: 0 }],
            texels: vec![0, 1, 2, 3, 4, 5, 6],
            tables,
            lights,
            light_alias,
            environment: vec![Environment {
                kind: EnvironmentKind::Map as u32,
                light: 2,
                width: 4,
                height: 4,
                to_local: [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]],
                radiance: [1.0; 3],
            }],
            env_texels: (0..16).map(|i| [if i < 8 { 0.0 } else { i as f32 }; 3]).collect(),
            env_alias: [alias(&[0, 3, 5]), alias(&[1, 1, 1, 1]), alias(&[1, 2, 3, 4]), alias(&[9, 0, 0, 1])].concat(),
            cameras: vec![Camera {
                kind: CameraKind::Perspective as u32,
                origin: [0.0, 1.0, 6.0],
                forward: [0.0, 0.0, -1.0],
                right: [0.5, 0.0, 0.0],
                down: [0.0, -0.5, 0.0],
                lens_radius: 0.1,
                focus_distance: 6.0,
                size: [64, 64],
            }],
            media: Vec::new(),
            densities: Vec::new(),
            majorants: Vec::new(),
            names: MaterialKind::ALL.iter().flat_map(|k| format!("{}\n", k.name()).into_bytes()).collect(),
        };
        parts.bounds();
        parts.node(&[]);
        let floor = parts.leaf(&[1, 0]);
        parts.child(0, 1, floor);
        let inner = parts.node(&[2, 3]);
        parts.child(0, 4, inner);
        let (a, b) = (parts.leaf(&[2]), parts.leaf(&[3]));
        parts.child(1, 0, a);
        parts.child(1, 7, b);
        parts
    }

    /// The tiny scene with a wavy sheet of 2 side^2 triangles in place of its quads, under a tree that splits index
    /// ranges in eight; no light but a constant environment.
    pub fn sheet(side: u32) -> Self {
        let mut parts = Self::tiny();
        let height = |i: u32, j: u32| ((i * 7 + j * 13) % 11) as f32 * 0.01;
        let n = side + 1;
        parts.vertices = (0..n * n)
            .map(|k| Vertex {
                p: [(k % n) as f32, height(k % n, k / n), (k / n) as f32],
                n: [0.0, 1.0, 0.0],
                uv: [0.0; 2],
            })
            .collect();
        let quad = |k: u32| {
            let a = k / side * n + k % side;
            [[a, a + n, a + n + 1], [a, a + n + 1, a + 1]]
        };
        let flat = |vertex| Triangle { vertex, material: 0, light: NONE, flags: 0 };
        parts.triangles = (0..side * side).flat_map(quad).map(flat).collect();
        parts.light_alias = alias(&[1]);
        parts.lights = vec![Light { kind: LightKind::Environment as u32, triangle: NONE, ..Light::zeroed() }];
        parts.environment[0].kind = EnvironmentKind::Constant as u32;
        parts.environment[0].light = 0;
        (parts.env_texels, parts.env_alias) = (Vec::new(), Vec::new());
        parts.nodes.clear();
        parts.leaves.clear();
        parts.bounds();
        let all: Vec<u32> = (0..parts.triangles.len() as u32).collect();
        parts.split(&all);
        parts
    }

    /// The tiny scene with a dielectric floor over a homogeneous medium and an emitting quad of null material over a
    /// grid of 6 x 3 x 5 cells. Neither boundary is closed, which blobs do not promise.
    pub fn smoky() -> Self {
        let mut parts = Self::tiny();
        let colours = Medium {
            sigma_a: [0.1, 0.2, 0.3],
            sigma_s: [1.0, 0.0, 2.0],
            emission: [0.0, 0.5, 0.0],
            g: -0.5,
            ..Medium::zeroed()
        };
        let cells = [6u32, 3, 5];
        let box_of_grid = ([-1.0, -0.5, -1.0], [1.0, 0.5, 1.0]);
        let grid = Medium {
            kind: MediumKind::Grid as u32,
            bounds_min: box_of_grid.0,
            bounds_max: box_of_grid.1,
            cells,
            first_density: 2,
            first_majorant: 1,
            ..colours
        };
        parts.media = vec![colours, grid];
        // Values that no grid owns may be anything.
        parts.densities = vec![f32::NAN, -1.0];
        parts.densities.extend((0..cells.iter().product()).map(|i| ((i * 37) % 101) as f32 / 64.0));
        parts.densities.push(f32::INFINITY);
        parts.majorants = vec![f32::NAN];
        parts.majorants.extend(majorants(cells, &parts.densities[2..]));
        parts.materials[MaterialKind::Dielectric as usize].medium = 0;
        parts.materials[MaterialKind::Null as usize].medium = 1;
        for (i, t) in parts.triangles.iter_mut().enumerate() {
            t.material = if i < 2 { MaterialKind::Dielectric } else { MaterialKind::Null } as u32;
        }
        parts
    }

    /// The tiny scene without triangles and lights.
    pub fn empty() -> Self {
        let mut parts = Self::tiny();
        parts.info[0] = SceneInfo::zeroed();
        (parts.nodes, parts.leaves, parts.triangles, parts.vertices) = (vec![], vec![], vec![], vec![]);
        (parts.lights, parts.light_alias, parts.environment) = (vec![], vec![], vec![]);
        (parts.env_texels, parts.env_alias) = (vec![], vec![]);
        parts
    }

    /// Puts a chain of `depth` nodes, each with one child, above one leaf that holds the first 8 triangles at most.
    pub fn chain(&mut self, depth: usize) {
        self.nodes.clear();
        self.leaves.clear();
        let all: Vec<u32> = (0..self.triangles.len() as u32).collect();
        let leaf = self.leaf(&all);
        for i in 0..depth {
            let node = self.node(&all);
            self.child(node.0 as usize, i % 8, if i + 1 < depth { (node.0 + 1, leaf.1) } else { leaf });
        }
    }

    /// Recomputes the scene's bounds.
    fn bounds(&mut self) {
        let all: Vec<u32> = (0..self.triangles.len() as u32).collect();
        [self.info[0].bounds_min, self.info[0].bounds_max] = self.around(&all);
    }

    /// Smallest and largest corner of some triangles.
    fn around(&self, triangles: &[u32]) -> [[f32; 3]; 2] {
        let mut b = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        for p in triangles.iter().flat_map(|t| self.triangles[*t as usize].vertex).map(|v| self.vertices[v as usize].p)
        {
            for axis in 0..3 {
                b[0][axis] = b[0][axis].min(p[axis]);
                b[1][axis] = b[1][axis].max(p[axis]);
            }
        }
        b
    }

    /// Appends an empty node; the reference to it with the box of `triangles`.
    fn node(&mut self, triangles: &[u32]) -> Reference {
        let mut bounds = [[f32::INFINITY; 8]; 6];
        bounds[3..].fill([f32::NEG_INFINITY; 8]);
        self.nodes.push(Node { bounds, child: [NONE; 8], reserved: [0; 8] });
        (self.nodes.len() as u32 - 1, self.around(triangles))
    }

    /// Appends a leaf; the reference to it with its box.
    fn leaf(&mut self, triangles: &[u32]) -> Reference {
        let mut leaf = Leaf { p: [[0.0; 8]; 9], triangle: [NONE; 8] };
        for (slot, t) in triangles.iter().enumerate() {
            leaf.triangle[slot] = *t;
            for (row, x) in
                self.triangles[*t as usize].vertex.map(|v| self.vertices[v as usize].p).iter().flatten().enumerate()
            {
                leaf.p[row][slot] = *x;
            }
        }
        self.leaves.push(leaf);
        (LEAF_BIT | (triangles.len() as u32) << 27 | (self.leaves.len() as u32 - 1), self.around(triangles))
    }

    /// Links a child.
    fn child(&mut self, node: usize, slot: usize, (reference, bounds): Reference) {
        self.nodes[node].child[slot] = reference;
        for (row, x) in bounds.iter().flatten().enumerate() {
            self.nodes[node].bounds[row][slot] = *x;
        }
    }

    /// A node over eight parts of a list, in preorder.
    fn split(&mut self, triangles: &[u32]) -> Reference {
        let reference = self.node(triangles);
        for (slot, part) in triangles.chunks(triangles.len().div_ceil(8)).enumerate() {
            let child = if part.len() <= 8 { self.leaf(part) } else { self.split(part) };
            self.child(reference.0 as usize, slot, child);
        }
        reference
    }
}

/// A child reference and its box.
type Reference = (u32, [[f32; 3]; 2]);

/// The least majorants of a grid: every cell raises those of the bricks that hold one of its neighbours or itself.
pub fn majorants(cells: [u32; 3], densities: &[f32]) -> Vec<f32> {
    let bricks = cells.map(|n| n.div_ceil(BRICK));
    let mut largest = vec![0.0f32; bricks.iter().product::<u32>() as usize];
    let steps = || (0..27i64).map(|k| [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1]);
    for (i, density) in (0..cells.iter().product::<u32>()).zip(densities) {
        let cell = [i % cells[0], i / cells[0] % cells[1], i / (cells[0] * cells[1])];
        for step in steps() {
            let near: [i64; 3] = core::array::from_fn(|axis| i64::from(cell[axis]) + step[axis]);
            if (0..3).all(|axis| (0..i64::from(cells[axis])).contains(&near[axis])) {
                let [x, y, z] = near.map(|n| n as u32 / BRICK);
                let most = &mut largest[((z * bricks[1] + y) * bricks[0] + x) as usize];
                *most = most.max(*density);
            }
        }
    }
    let inflated = |most: f32| {
        let exact = f64::from(most) * f64::from(MAJORANT_MARGIN);
        if f64::from(exact as f32) < exact { (exact as f32).next_up() } else { exact as f32 }
    };
    largest.into_iter().map(inflated).collect()
}

/// An alias table by the two-stack method (Vose 1991) in exact integers; some weight must be above 0.
pub fn alias(weights: &[u32]) -> Vec<Alias> {
    let n = weights.len() as u128;
    let total: u128 = weights.iter().map(|w| u128::from(*w)).sum();
    // How full each slot is, in units where 2^32 * total is exactly full.
    let full = total << 32;
    let mut fill: Vec<u128> = weights.iter().map(|w| (u128::from(*w) * n) << 32).collect();
    let mut table: Vec<Alias> =
        (0..weights.len()).map(|i| Alias { threshold: u32::MAX, alias: i as u32, probability: 0.0 }).collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..weights.len()).partition(|i| fill[*i] < full);
    while let (Some(s), Some(l)) = (small.pop(), large.last().copied()) {
        table[s].threshold = (fill[s] / total) as u32;
        table[s].alias = l as u32;
        fill[l] -= full - fill[s];
        if fill[l] < full {
            small.push(l);
            large.pop();
        }
    }
    for (item, width) in widths(&table).iter().enumerate() {
        table[item].probability = (*width as f64 / 4_294_967_296.0) as f32;
    }
    table
}

/// How many of the 2^32 random numbers pick each item, by searching for the numbers where the pick changes.
pub fn widths(table: &[Alias]) -> Vec<u64> {
    let n = table.len() as u128;
    let mut widths = vec![0; table.len()];
    // Least r with r * n >= x.
    let least = |x: u128| {
        let (mut lo, mut hi) = (0u64, 1u64 << 32);
        while lo < hi {
            let mid = (lo + hi) / 2;
            if u128::from(mid) * n >= x { hi = mid } else { lo = mid + 1 }
        }
        lo
    };
    for (i, a) in table.iter().enumerate() {
        let threshold = if a.threshold == u32::MAX { 1 << 32 } else { u128::from(a.threshold) };
        let start = (i as u128) << 32;
        let [from, kept, to] = [start, start + threshold, start + (1 << 32)].map(least);
        widths[i] += kept - from;
        widths[a.alias as usize] += to - kept;
    }
    widths
}
