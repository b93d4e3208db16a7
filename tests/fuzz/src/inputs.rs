//! What happens to the bytes of each format, from the file to a few rays: used by the fuzz targets and by
//! `tests/tests/fuzzed.rs`. A format that is added gets a row in [`FORMATS`], a function and seeds; a fuzz target of its
//! name goes into `targets/` and `Cargo.toml`.

use croupier::unstable::profile::{Full, Guided, Profile};
use croupier::unstable::scene::blob::{Header, content_hash};
use croupier::{Budget, Plan, Scene, Session, Settings, Shard, StepResult};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::blob::AlignedBytes;
use croupier_host::checkpoint;
use croupier_host::description::{Camera, Emitter, Environment, Model, Reflectance, SceneDescription, Vertex};
use croupier_host::image::Picture;
use croupier_host::load::{LoadOptions, load_with};
use croupier_host::look::Look;
use std::fs;
use std::path::{Path, PathBuf};

/// One kind of input.
pub struct Format {
    /// Name of the fuzz target and of the folder of its corpus.
    pub name: &'static str,
    /// Takes the bytes as far as they lead; whether they were accepted.
    pub run: fn(&mut Workbench, &[u8]) -> bool,
    /// Valid inputs to begin with.
    pub seeds: fn() -> Vec<Vec<u8>>,
    /// Words that mutations insert.
    pub words: &'static [&'static str],
}

/// Every format.
pub const FORMATS: &[Format] = &[
    Format {
        name: "obj",
        run: |b, d| b.load("a.obj", d),
        seeds: || vec![OBJ.to_vec(), NOTCH.to_vec()],
        words: &[
            "v ", "vt ", "vn ", "f ", "usemtl ", "mtllib ", "o ", "1/1/1", "-1", "//", "1e38", "nan", "\\\n", "\n",
        ],
    },
    Format {
        name: "mtl",
        run: |b, d| b.load("a.mtl", d),
        seeds: || vec![MTL.to_vec()],
        words: &[
            "newmtl ",
            "Kd ",
            "Ks ",
            "Ke ",
            "map_Kd ",
            "map_d t.png",
            "-s 1 1",
            "illum ",
            "Ni ",
            "Pr ",
            "Pm ",
            "1e38",
            "-1",
            "nan",
            "\n",
        ],
    },
    Format {
        name: "gltf",
        run: |b, d| b.load("a.gltf", d),
        seeds: || vec![include_bytes!("../corpus/gltf/all.gltf").to_vec()],
        words: &[
            "null",
            "[]",
            "{}",
            "-1",
            "1e999",
            "4294967296",
            ",",
            ":",
            "5120",
            "5121",
            "5125",
            "\"VEC4\"",
            "\"MAT4\"",
            "\"SCALAR\"",
            "\"sparse\"",
            "\"uri\"",
            "\"data:;base64,\"",
            "\"t.png\"",
            "\"byteStride\":1",
        ],
    },
    Format {
        name: "glb",
        run: |b, d| b.load("a.glb", d),
        seeds: || vec![include_bytes!("../corpus/glb/all.glb").to_vec()],
        words: &["JSON", "BIN\u{0}", "glTF", "null", "-1", "1e999", "4294967296"],
    },
    Format {
        name: "ply",
        run: |b, d| b.load("a.ply", d),
        seeds: || {
            vec![
                include_bytes!("../corpus/ply/text.ply").to_vec(),
                include_bytes!("../corpus/ply/little.ply").to_vec(),
                include_bytes!("../corpus/ply/big.ply").to_vec(),
            ]
        },
        words: &[
            "element ",
            "vertex ",
            "face ",
            "tristrips ",
            "property ",
            "list ",
            "uchar ",
            "int ",
            "double ",
            "x\n",
            "vertex_indices\n",
            "texcoord\n",
            "4294967295 ",
            "-1 ",
            "nan ",
            "1e38 ",
            "end_header\n",
            "\n",
            "\r\n",
        ],
    },
    Format {
        name: "stl",
        run: |b, d| b.load("a.stl", d),
        seeds: || {
            vec![include_bytes!("../corpus/stl/text.stl").to_vec(), include_bytes!("../corpus/stl/binary.stl").to_vec()]
        },
        words: &[
            "solid ",
            "facet ",
            "normal ",
            "outer loop ",
            "vertex ",
            "endloop ",
            "endfacet ",
            "nan ",
            "1e38 ",
            "\n",
        ],
    },
    Format {
        name: "json",
        run: |b, d| b.load("scene.json", d),
        seeds: || vec![JSON.to_vec()],
        words: &["null", "[]", "{}", "1e999", "-1", "\"m\"", "\"n\"", "4294967296", "true", ",", ":", "[[", "\\u0000"],
    },
    Format {
        name: "png",
        run: |b, d| b.load("t.png", d),
        seeds: png_seeds,
        words: &["IHDR", "IDAT", "PLTE", "tRNS", "IEND"],
    },
    Format { name: "jpeg", run: |b, d| b.load("t.jpg", d), seeds: jpeg_seeds, words: &["\u{0}", "JFIF"] },
    Format {
        name: "exr",
        run: |b, d| b.load("e.exr", d),
        seeds: exr_seeds,
        words: &["channels", "dataWindow", "box2i", "R", "B", "G"],
    },
    Format {
        name: "hdr",
        run: |b, d| b.load("e.exr", d),
        seeds: || {
            vec![include_bytes!("../corpus/hdr/flat.hdr").to_vec(), include_bytes!("../corpus/hdr/runs.hdr").to_vec()]
        },
        words: &["#?RGBE\n", "EXPOSURE=", "FORMAT=", "-Y ", "+X ", "65536 ", "\n", "\u{1}\u{1}\u{1}", "\u{2}\u{2}"],
    },
    Format { name: "blob", run: Workbench::blob, seeds: || vec![small_blob().to_vec()], words: &[] },
    Format { name: "cache", run: Workbench::cache, seeds: cache_seeds, words: &[] },
    Format { name: "guide", run: Workbench::guide, seeds: guide_seeds, words: &[] },
    Format { name: "checkpoint", run: Workbench::checkpoint, seeds: checkpoint_seeds, words: &["ears", "=", "\n"] },
];

const OBJ: &[u8] = include_bytes!("../corpus/obj/dialects.obj");
const NOTCH: &[u8] = include_bytes!("../corpus/obj/notch.obj");
const MTL: &[u8] = include_bytes!("../corpus/mtl/all.mtl");
const JSON: &[u8] = include_bytes!("../corpus/json/all.json");

/// A cube-free triangle pair with the materials that the other files define.
const PLAIN_OBJ: &str = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl m\nf 1/1 3/2 2/3\n\
    f 1 2 4\nf 2 3 4\nf 3 1 4\nusemtl n\nf 1 2 3\n";

/// Bytes that textures may take: a gibibyte holds them, what they are decoded into, and the rest.
const TEXTURE_MEMORY: u64 = 256 << 20;

/// Files and scenes that inputs need besides themselves.
pub struct Workbench {
    folder: PathBuf,
    scene: AlignedBytes,
}

impl Default for Workbench {
    fn default() -> Self {
        let thread = format!("{:?}", std::thread::current().id());
        let thread: String = thread.chars().filter(char::is_ascii_digit).collect();
        let folder = std::env::temp_dir().join(format!("croupier-fuzz-{}-{thread}", std::process::id()));
        fs::create_dir_all(&folder).expect("a temporary folder");
        let bench = Self { folder, scene: small_blob() };
        bench.restore();
        bench
    }
}

impl Drop for Workbench {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.folder);
    }
}

impl Workbench {
    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.folder.join(name), bytes).expect("a file in the temporary folder");
    }

    /// Writes the valid files.
    fn restore(&self) {
        self.write("a.obj", PLAIN_OBJ.as_bytes());
        self.write("a.mtl", MTL);
        self.write("scene.json", JSON);
        self.write("d.bin", bytemuck::cast_slice(&[0.5f32, 1.0]));
        for (name, seeds) in [("t.png", png_seeds()), ("t.jpg", jpeg_seeds()), ("e.exr", exr_seeds())] {
            self.write(name, &seeds[0]);
        }
    }

    /// Loads the scene that the file of this name belongs to, bakes it, validates and renders it.
    fn load(&mut self, name: &str, data: &[u8]) -> bool {
        self.write(name, data);
        let scene = self.folder.join(match name {
            "a.mtl" | "t.png" | "t.jpg" => "a.obj",
            "e.exr" => "scene.json",
            scene => scene,
        });
        let options = LoadOptions { strict: false, texture_memory: TEXTURE_MEMORY };
        // daylight would take a hundred times as long as the rest
        let environment = Some(Environment::Constant { radiance: [1.0; 3] });
        let loaded = load_with(&scene, &options, &Look { without_ground: true, environment, ..Look::default() });
        if let Err(e) = &loaded {
            assert_message(&e.to_string(), &self.folder);
        }
        let Ok((mut scene, report)) = loaded else { return false };
        report.notes.iter().for_each(|n| assert_message(n, &self.folder));
        // nor are tables of maps of interest here, and those of compensation in one input of sixteen, which take ten times as
        // long as the rest
        scene.environment = None;
        if !content_hash(data).is_multiple_of(16) {
            scene.materials.iter_mut().for_each(|m| m.compensated = false);
        }
        let texels: usize = scene.textures.iter().map(|t| t.texels.len()).sum();
        if scene.triangles.len() > 1000 || scene.instances.len() > 1000 || texels > 1 << 20 {
            return true;
        }
        match bake(&scene, &BakeOptions::default(), |_, _| {}) {
            Ok(baked) => {
                let scene = Scene::from_bytes(&baked.bytes).expect("what is baked is valid");
                render(&scene, |_| true);
            }
            Err(e) => assert_message(&e.to_string(), &self.folder),
        }
        true
    }

    /// A blob whose length and hash are made right.
    fn blob(&mut self, data: &[u8]) -> bool {
        let mut bytes = AlignedBytes::zeroed(data.len());
        bytes.as_mut().copy_from_slice(data);
        if let Some((head, rest)) = bytes.as_mut().split_at_mut_checked(size_of::<Header>()) {
            let header: &mut Header = bytemuck::from_bytes_mut(head);
            header.length = data.len() as u64;
            header.hash = content_hash(rest);
        }
        Scene::from_bytes(&bytes).map(|scene| render(&scene, |_| true)).is_ok()
    }

    /// A saved cache whose hash is made right.
    fn cache(&mut self, data: &[u8]) -> bool {
        let bytes = with_hash(data);
        let scene = Scene::from_bytes(&self.scene).expect("a valid scene");
        render(&scene, |session| session.cache_mut().is_some_and(|c| c.load(&bytes).is_ok()))
    }

    /// A saved guide whose hash is made right, loaded, then added to itself.
    fn guide(&mut self, data: &[u8]) -> bool {
        let bytes = with_hash(data);
        let scene = Scene::from_bytes(&self.scene).expect("a valid scene");
        render_with::<Guided<Full>>(&scene, &guided_settings(&scene), |session| {
            let loaded = session.load_statistics(&bytes);
            if let Err(e) = &loaded {
                assert_message(&e.to_string(), Path::new("none"));
            }
            loaded.is_ok() && session.merge_statistics(&bytes).is_ok()
        })
    }

    /// A checkpoint whose hashes are made right.
    fn checkpoint(&mut self, data: &[u8]) -> bool {
        let mut bytes = data.to_vec();
        checkpoint::seal(&mut bytes);
        let scene = Scene::from_bytes(&self.scene).expect("a valid scene");
        let settings = settings(&scene);
        let plan = Plan::new(&settings).expect("valid settings");
        let mut block = AlignedBytes::zeroed(plan.session().size);
        let length = bytes.len() as u64;
        if let Err(e) = checkpoint::read_from(&*bytes, length, scene.hash, &settings, block.as_mut()) {
            assert_message(&e.to_string(), Path::new("none"));
            return false;
        }
        Session::resume(scene, &plan, block.as_mut()).map(|mut s| iterate(&mut s, &plan)).is_ok()
    }
}

/// Messages are short, and show no control characters. The folder's own name does not count.
fn assert_message(text: &str, folder: &Path) {
    let text = text.replace(&folder.display().to_string(), "");
    assert!(text.len() < 900, "{} bytes: {text}", text.len());
    assert!(text.chars().all(|c| !c.is_control()), "{text:?}");
}

/// Saved statistics whose hash is made right: that of everything after it.
fn with_hash(data: &[u8]) -> Vec<u8> {
    let mut bytes = data.to_vec();
    if let Some((head, rest)) = bytes.split_at_mut_checked(16) {
        head[8..].copy_from_slice(&content_hash(rest).to_le_bytes());
    }
    bytes
}

/// A guide and no cache: its bytes are all that is saved.
fn guided_settings(scene: &Scene<'_>) -> Settings {
    let mut s = settings(scene);
    for (name, value) in [("rrs", "classic"), ("guiding", "on"), ("guide-bytes", "96KiB")] {
        s.set(name, value).expect("a setting");
    }
    s
}

fn settings(scene: &Scene<'_>) -> Settings {
    let mut s = Settings { size: [4, 3], shards: 1, aovs: true.into(), ..Settings::for_scene(scene) };
    for (name, value) in [("rrs", "ears"), ("cache-bytes", "96KiB"), ("ring", "32"), ("ledger", "64")] {
        s.set(name, value).expect("a setting");
    }
    s
}

/// A few rays of the scene, after a change of the session; whether the change succeeded.
fn render(scene: &Scene<'_>, change: impl FnOnce(&mut Session<'_, '_>) -> bool) -> bool {
    render_with::<Full>(scene, &settings(scene), change)
}

/// [`render`] with a profile and settings.
fn render_with<P: Profile>(
    scene: &Scene<'_>,
    settings: &Settings,
    change: impl FnOnce(&mut Session<'_, '_, P>) -> bool,
) -> bool {
    let plan = Plan::new(settings).expect("valid settings");
    let mut block = AlignedBytes::zeroed(plan.session().size);
    let built = Session::builder(*scene).profile::<P>().build(&plan, block.as_mut());
    let Ok(mut session) = built else { return false };
    let changed = change(&mut session);
    if changed {
        iterate(&mut session, &plan);
    }
    changed
}

/// Two iterations, of a bounded number of rays.
fn iterate<P: Profile>(session: &mut Session<'_, '_, P>, plan: &Plan) {
    let mut own = AlignedBytes::zeroed(plan.shard().size);
    let mut shard = Shard::new(plan, 0, own.as_mut()).expect("memory of the plan");
    for _ in 0..2 {
        session.begin_iteration(1);
        let mut steps = 0;
        while shard.step(session, Budget { rays: 60 }) != StepResult::Done {
            steps += 1;
            if steps == 3 {
                shard.stop();
            }
            if steps == 30 {
                return;
            }
        }
        session.end_iteration(std::slice::from_ref(&shard)).expect("a finished shard");
    }
    let _ = session.film().error_estimate();
}

/// The smallest scene with all kinds of records: a floor, a lamp, a constant environment.
fn small_blob() -> AlignedBytes {
    let mut scene = SceneDescription { camera: Camera { size: [4, 3], ..Camera::default() }, ..Default::default() };
    // the floor is seen around the light, so that there is something to learn
    for (name, side, z, y) in [("floor", 1.0, 0.5, [0.2; 3]), ("lamp", 0.3, 0.9, [0.0; 3])] {
        let material = scene.add_material(name, Model::Diffuse { reflectance: Reflectance::Constant(y) });
        let corners = [[-side, -side, z], [side, -side, z], [side, side, z], [-side, side, z]];
        let corners = corners.map(|position| Vertex { position, ..Vertex::default() });
        scene.add_mesh(name, material, &corners, &[[0, 1, 2], [0, 2, 3]], false);
    }
    scene.materials.iter_mut().for_each(|m| m.two_sided = true);
    scene.camera =
        Camera { origin: [0.0, 0.0, 3.0], target: [0.0; 3], up: [0.0, 1.0, 0.0], size: [4, 3], ..scene.camera };
    scene.emitters.push(Emitter::Area { material: 1, radiance: [3.0; 3] });
    scene.environment = Some(Environment::Constant { radiance: [0.5; 3] });
    bake(&scene, &BakeOptions::default(), |_, _| {}).expect("a valid scene").bytes
}

fn png_seeds() -> Vec<Vec<u8>> {
    use png::{BitDepth, ColorType};
    let kinds = [
        (ColorType::Rgba, BitDepth::Eight, 4 * 12),
        (ColorType::Grayscale, BitDepth::One, 3),
        (ColorType::Indexed, BitDepth::Eight, 12),
        (ColorType::Rgb, BitDepth::Sixteen, 6 * 12),
    ];
    kinds
        .iter()
        .map(|(color, depth, bytes)| {
            let mut out = Vec::new();
            let mut encoder = png::Encoder::new(&mut out, 4, 3);
            encoder.set_color(*color);
            encoder.set_depth(*depth);
            if *color == ColorType::Indexed {
                encoder.set_palette((0..=255).collect::<Vec<u8>>()[..192].to_vec());
            }
            let data: Vec<u8> = (0..*bytes).map(|i| i as u8 % 64).collect();
            encoder.write_header().and_then(|mut w| w.write_image_data(&data)).expect("a picture");
            out
        })
        .collect()
}

/// A grey JPEG of 8 x 8 pixels: one block, of which the first coefficient is 0.
fn jpeg_seeds() -> Vec<Vec<u8>> {
    let segment = |marker: u8, data: &[u8]| [&[0xff, marker, 0, data.len() as u8 + 2], data].concat();
    let tables = |class: u8, symbols: &[u8]| {
        let mut counts = [0; 16];
        counts[0] = symbols.len() as u8;
        segment(0xc4, &[&[class], &counts[..], symbols].concat())
    };
    let frame = segment(0xc0, &[8, 0, 8, 0, 8, 1, 1, 0x11, 0]);
    let quantisation = segment(0xdb, &[&[0][..], &[1; 64]].concat());
    let scan = segment(0xda, &[1, 1, 0, 0, 63, 0]);
    // both codes are the bit 0
    let all = [
        &[0xff, 0xd8][..],
        &quantisation,
        &frame,
        &tables(0, &[0]),
        &tables(0x10, &[0]),
        &scan,
        &[0x3f],
        &[0xff, 0xd9],
    ];
    vec![all.concat()]
}

fn exr_seeds() -> Vec<Vec<u8>> {
    let mut picture = Picture::new(3, 2);
    picture.add3("", ["R", "G", "B"], &[[0.5, 1.0, 2.0]; 6]);
    picture.add1("depth", "Z", &[1.0; 6]);
    let path = std::env::temp_dir().join(format!(
        "croupier-fuzz-{}-{:?}.exr",
        std::process::id(),
        std::thread::current().id()
    ));
    picture.write_exr(&path).expect("a picture");
    let bytes = fs::read(&path).expect("a picture");
    let _ = fs::remove_file(&path);
    vec![bytes]
}

fn cache_seeds() -> Vec<Vec<u8>> {
    let blob = small_blob();
    let scene = Scene::from_bytes(&blob).expect("a valid scene");
    let plan = Plan::new(&settings(&scene)).expect("valid settings");
    let mut block = AlignedBytes::zeroed(plan.session().size);
    let mut session = Session::new(scene, &plan, block.as_mut()).expect("memory of the plan");
    iterate(&mut session, &plan);
    let cache = session.cache().expect("a strategy that learns");
    let mut saved = vec![0; cache.saved_len()];
    cache.save(&mut saved).expect("memory of that length");
    vec![saved]
}

/// A guide that has learned, and one that has not.
fn guide_seeds() -> Vec<Vec<u8>> {
    let blob = small_blob();
    let scene = Scene::from_bytes(&blob).expect("a valid scene");
    let settings = Settings { size: [64, 48], ..guided_settings(&scene) };
    let plan = Plan::new(&settings).expect("valid settings");
    let mut block = AlignedBytes::zeroed(plan.session().size);
    let built = Session::builder(scene).profile::<Guided<Full>>().build(&plan, block.as_mut());
    let mut session = built.expect("memory of the plan");
    let mut own = AlignedBytes::zeroed(plan.shard().size);
    let mut shard = Shard::new(&plan, 0, own.as_mut()).expect("memory of the plan");
    let save = |session: &Session<'_, '_, Guided<Full>>| {
        let mut saved = vec![0; session.saved_statistics_len()];
        session.save_statistics(&mut saved).expect("memory of that length");
        saved
    };
    let empty = save(&session);
    for samples in [1, 2, 4, 8] {
        session.begin_iteration(samples);
        while shard.step(&session, Budget { rays: 1 << 16 }) != StepResult::Done {}
        session.end_iteration(std::slice::from_ref(&shard)).expect("a finished shard");
    }
    let learned = save(&session);
    assert!(learned.len() > 4 * empty.len(), "{} and {} bytes", learned.len(), empty.len());
    vec![learned, empty]
}

fn checkpoint_seeds() -> Vec<Vec<u8>> {
    let blob = small_blob();
    let scene = Scene::from_bytes(&blob).expect("a valid scene");
    let settings = settings(&scene);
    let plan = Plan::new(&settings).expect("valid settings");
    let mut block = AlignedBytes::zeroed(plan.session().size);
    let mut session = Session::new(scene, &plan, block.as_mut()).expect("memory of the plan");
    iterate(&mut session, &plan);
    session.suspend();
    let path = std::env::temp_dir().join(format!(
        "croupier-fuzz-{}-{:?}.check",
        std::process::id(),
        std::thread::current().id()
    ));
    let written = checkpoint::write(&path, scene.hash, &settings, &checkpoint::Progress::default(), &block);
    written.expect("a checkpoint");
    let bytes = fs::read(&path).expect("a checkpoint");
    let _ = fs::remove_file(&path);
    vec![bytes]
}
