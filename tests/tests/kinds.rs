//! What files, documents and the host say of kinds of materials and lights is what the blob's tables say.

use croupier::unstable::scene::blob::*;
use croupier::unstable::scene::{Effects, Scene};
use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::*;
use croupier_host::load::load;
use std::convert::Infallible;
use std::fs;
use std::path::{Path, PathBuf};

fn file(path: &str) -> String {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// First and last cells of the rows of a header's table, without backquotes; the first table of `//!` lines.
fn header_table(text: &str) -> Vec<(String, String)> {
    let rows = text.lines().take_while(|l| l.starts_with("//!")).filter_map(|l| l.strip_prefix("//! | `"));
    rows.map(|l| {
        let cells: Vec<&str> = l.trim_end_matches(" |").split(" | ").collect();
        (cells[0].trim_end_matches('`').to_string(), cells[cells.len() - 1].to_string())
    })
    .collect()
}

/// Fields of a material that hold a parameter, and the constant that its range is.
fn fields(parameter: Parameter) -> (&'static [&'static str], &'static str, [f32; 2]) {
    match parameter {
        Parameter::Reflectance => (&["reflectance"], "REFLECTANCE_RANGE", REFLECTANCE_RANGE),
        Parameter::Alpha => (&["alpha"], "ALPHA_RANGE", ALPHA_RANGE),
        Parameter::RelativeEta => (&["eta[0]"], "ETA_RANGE", ETA_RANGE),
        Parameter::ComplexEta => (&["eta", "k"], "CONDUCTOR_RANGE", CONDUCTOR_RANGE),
        Parameter::InternalReflectance => (&["fdr"], "FDR_RANGE", FDR_RANGE),
        Parameter::TransmittanceTable => (&["table"], "REFLECTANCE_RANGE", REFLECTANCE_RANGE),
        Parameter::CompensationTable => (&["table"], "COMPENSATION_RANGE", COMPENSATION_RANGE),
        Parameter::EnergyTable => (&["table"], "ENERGY_RANGE", ENERGY_RANGE),
        Parameter::Principled => (&["table"], "REFLECTANCE_RANGE", REFLECTANCE_RANGE),
    }
}

/// `bsdf/NAME.rs` opens with a table of exactly the parameters of the kind of that name, each with its range by the
/// constant's name. Killed by: a parameter in one of the two only, a range that is stated as a number, a kernel whose
/// file has another name.
#[test]
fn kernels_state_their_parameters() {
    for kind in MaterialKind::ALL {
        let name = kind.name();
        let mut stated = header_table(&file(&format!("core/src/bsdf/{name}.rs")));
        let mut wanted: Vec<(String, String)> = vec![];
        for parameter in kind.facts().parameters {
            let (fields, constant, range) = fields(*parameter);
            assert_eq!(parameter.range(), range, "{parameter:?}");
            wanted.extend(fields.iter().map(|f| (f.to_string(), format!("`{constant}`"))));
        }
        stated.iter_mut().for_each(|(_, range)| range.truncate(range.find(',').unwrap_or(range.len())));
        stated.sort();
        wanted.sort();
        assert_eq!(stated, wanted, "{name}");
    }
}

/// The same of `light/NAME.rs`. The environment's parameters are in a record of its own.
#[test]
fn lights_state_their_fields() {
    for kind in LightKind::ALL {
        let name = kind.name();
        let mut stated: Vec<String> =
            header_table(&file(&format!("core/src/light/{name}.rs"))).into_iter().map(|(f, _)| f).collect();
        let fields = kind.fields().iter().flat_map(|f| match f {
            LightField::Triangle => &["triangle", "area", "instance"][..],
            LightField::Environment => &[],
            LightField::Position | LightField::Direction => &["vector"],
            LightField::Emission => &["emission"],
            LightField::Disk | LightField::Radius => &["params[0]"],
            LightField::Shape => &["triangle"],
            LightField::HalfEdges => &["params[0..3]", "params[3..6]"],
            LightField::Circle => &["params[0..3]", "params[3]"],
            LightField::Cone => &["params[0..3]", "params[3]", "params[4]"],
        });
        let mut wanted: Vec<String> = fields.map(|f| f.to_string()).collect();
        stated.sort();
        wanted.sort();
        assert_eq!(stated, wanted, "{name}");
    }
}

/// `docs/SCENES.md` has a row for every material type with its keys, and states the ranges. Killed by: a type or a key
/// that only one of them knows, a range that only one of them changes.
#[test]
fn scenes_md_states_types_and_ranges() {
    let text = file("docs/SCENES.md");
    for kind in MaterialKind::ALL {
        let keys: Vec<String> =
            kind.facts().parameters.iter().flat_map(|p| p.keys()).map(|k| format!("`{k}`")).collect();
        let start = format!("| `{}` | ", kind.name());
        let row = text.lines().find_map(|l| l.strip_prefix(&start)).unwrap_or_else(|| panic!("no row `{start}`"));
        let mut stated: Vec<&str> = row.split(" | ").next().unwrap_or("").split(", ").collect();
        let mut wanted: Vec<&str> = if keys.is_empty() { vec!["none"] } else { keys.iter().map(|k| &**k).collect() };
        stated.sort();
        wanted.sort();
        assert_eq!(stated, wanted, "{}", kind.name());
    }
    let flat = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let range = |before: &str| -> [f32; 2] {
        let (_, rest) = flat.split_once(before).unwrap_or_else(|| panic!("no `{before}`"));
        let words: Vec<&str> = rest.split_whitespace().collect();
        [words[0], words[2]].map(|w| w.trim_matches([',', '.', ';', '(']).parse().unwrap())
    };
    assert_eq!(range("`alpha` is the GGX width itself, "), ALPHA_RANGE);
    assert_eq!(range("`int_ior` / `ext_ior` "), ETA_RANGE);
    assert_eq!(range("`eta` and `k` are colours from "), CONDUCTOR_RANGE);
    assert_eq!(range("`reflectance` is a colour from "), REFLECTANCE_RANGE);
    assert!(flat.contains(&format!("in no channel both below {MIN_CONDUCTOR:e}")));
    for kind in LightKind::ALL.iter().filter(|k| **k != LightKind::Environment) {
        assert!(text.contains(&format!("| `{}` | ", kind.name())), "{}", kind.name());
    }
    for kind in EnvironmentKind::ALL {
        assert!(text.contains(&format!("| `{}` | ", kind.name())), "{}", kind.name());
    }
}

/// Gives every parameter a value within its range and notes which were asked for.
#[derive(Default)]
struct Source(Vec<&'static str>);

impl Source {
    fn give<T>(&mut self, key: &'static str, value: T) -> Result<T, Infallible> {
        self.0.push(key);
        Ok(value)
    }
}

impl ParameterSource for Source {
    type Error = Infallible;

    fn reflectance(&mut self) -> Result<Reflectance, Infallible> {
        self.give("reflectance", Reflectance::Constant([0.5; 3]))
    }

    fn eta(&mut self) -> Result<[f32; 3], Infallible> {
        self.give("eta", [0.2; 3])
    }

    fn k(&mut self) -> Result<[f32; 3], Infallible> {
        self.give("k", [3.0; 3])
    }

    fn int_ior(&mut self) -> Result<f32, Infallible> {
        self.give("int_ior", 1.5)
    }

    fn ext_ior(&mut self) -> Result<f32, Infallible> {
        self.give("ext_ior", 1.0)
    }

    fn alpha(&mut self) -> Result<f32, Infallible> {
        self.give("alpha", 0.2)
    }

    fn principled(&mut self) -> Result<Principled, Infallible> {
        Ok(Principled::default())
    }
}

/// The model of a kind has the parameters of its row, bakes into a material of that kind that the scene door lets
/// through, and has every parameter that the kind uses. Killed by: a field of a model that its row lacks, a derived
/// parameter that baking leaves out; tables of compensation in materials that are not compensated, or the flag in kinds
/// that do not know it.
#[test]
fn models_have_the_parameters_of_their_rows() {
    for kind in MaterialKind::ALL {
        let mut source = Source::default();
        let Ok(model) = Model::from_source(*kind, &mut source);
        let mut wanted: Vec<&str> = kind.facts().parameters.iter().flat_map(|p| p.keys()).copied().collect();
        source.0.sort();
        wanted.sort();
        assert_eq!(source.0, wanted, "{}", kind.name());
        assert_eq!(model.kind(), *kind);

        for compensated in [false, true] {
            let mut s = SceneDescription::default();
            s.add_material("surface", model);
            s.materials[0].compensated = compensated;
            let baked = bake(&s, &BakeOptions::default(), |_, _| {}).unwrap();
            let scene = Scene::from_bytes(&baked.bytes).unwrap();
            let (m, facts) = (&scene.materials[0], kind.facts());
            let two_sided = !facts.transmissive || *kind == MaterialKind::Principled;
            let known = [(MATERIAL_TWO_SIDED, two_sided), (MATERIAL_COMPENSATED, facts.compensates())];
            let asked = |flag| flag != MATERIAL_COMPENSATED || compensated;
            let flags = known.iter().filter(|(flag, holds)| *holds && asked(*flag)).map(|(flag, _)| flag).sum();
            assert_eq!((m.kind, m.flags), (*kind as u32, flags), "{}", kind.name());
            let effect = scene.effects.contains(Effects::MULTIPLE_SCATTERING);
            assert!(!effect || compensated && facts.compensates(), "{}", kind.name());
            let mut entries = 0;
            for parameter in facts.parameters.iter().filter(|p| compensated || !p.compensates()) {
                let holds = match parameter {
                    Parameter::Reflectance => m.reflectance == [0.5; 3],
                    Parameter::Alpha => m.alpha == 0.2,
                    Parameter::RelativeEta => m.eta[0] == 1.5,
                    Parameter::ComplexEta => (m.eta, m.k) == ([0.2; 3], [3.0; 3]),
                    Parameter::InternalReflectance => m.fdr > 0.4 && m.fdr < 0.7,
                    Parameter::Principled => m.table != NONE,
                    Parameter::TransmittanceTable | Parameter::CompensationTable | Parameter::EnergyTable => {
                        m.table == 0 && scene.tables.len() >= entries + parameter.entries()
                    }
                };
                assert!(holds, "{} and its {parameter:?}", kind.name());
                entries += parameter.entries();
            }
            if *kind == MaterialKind::Principled {
                // its record knows where its tables are
                entries = scene.tables.len();
            }
            assert_eq!((scene.tables.len(), m.table == NONE), (entries, entries == 0), "{}", kind.name());
        }
    }
}

/// A folder with one triangle of a material of this type with these keys.
fn write_scene(folder: &Path, kind: MaterialKind, keys: &[&str]) {
    let value = |key: &str| match key {
        "reflectance" => "[0.5, 0.5, 0.5]",
        "eta" => "[0.2, 0.2, 0.2]",
        "k" => "[3, 3, 3]",
        "int_ior" => "1.5",
        "ext_ior" => "1",
        "alpha" => "0.2",
        _ => panic!("no value for `{key}`"),
    };
    let parameters: String = keys.iter().map(|k| format!(", \"{k}\": {}", value(k))).collect();
    let json = format!(
        r#"{{ "geometry": {{ "file": "a.obj" }}, "camera": {{ "origin": [0, 0, 5], "target": [0, 0, 0],
        "up": [0, 1, 0], "vfov_deg": 40, "width": 4, "height": 4 }}, "materials": {{ "surface":
        {{ "type": "{}"{parameters} }} }} }}"#,
        kind.name()
    );
    fs::write(folder.join("scene.json"), json).unwrap();
    fs::write(folder.join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl surface\nf 1 2 3\n").unwrap();
}

/// Every type is read from a scene file with the keys of its row, and refused without any one of them. Killed by: a
/// type or a key that the reader does not know, a default.
#[test]
fn scene_files_need_every_key() {
    let folder = tempfile::tempdir().unwrap();
    for kind in MaterialKind::ALL {
        let keys: Vec<&str> = kind.facts().parameters.iter().flat_map(|p| p.keys()).copied().collect();
        write_scene(folder.path(), *kind, &keys);
        let (scene, _) = load(folder.path()).unwrap_or_else(|e| panic!("{}: {e}", kind.name()));
        let Ok(model) = Model::from_source(*kind, &mut Source::default());
        assert_eq!(scene.materials[0].model, model);
        for left_out in &keys {
            let rest: Vec<&str> = keys.iter().filter(|k| *k != left_out).copied().collect();
            write_scene(folder.path(), *kind, &rest);
            let error = load(folder.path()).unwrap_err().to_string();
            assert!(error.contains(&format!("materials.surface: `{left_out}` is missing")), "{error}");
        }
    }
}

/// One number of each parameter outside its range: baking names it. Killed by: a parameter that baking takes over
/// unchecked.
#[test]
fn baking_checks_every_parameter() {
    let reflectance = Reflectance::Constant([0.5, 0.5, REFLECTANCE_RANGE[1].next_up()]);
    let bad: [(Parameter, Model, &str); 4] = [
        (Parameter::Reflectance, Model::Diffuse { reflectance }, "reflectance is 1.0000001"),
        (
            Parameter::Alpha,
            Model::RoughDielectric { int_ior: 1.5, ext_ior: 1.0, alpha: ALPHA_RANGE[0].next_down() },
            "alpha is 9.99999",
        ),
        (Parameter::RelativeEta, Model::Dielectric { int_ior: ETA_RANGE[1].next_up(), ext_ior: 1.0 }, "is 100.00001"),
        (
            Parameter::ComplexEta,
            Model::Conductor { eta: [1.0; 3], k: [CONDUCTOR_RANGE[1].next_up(); 3], reflectance: GREY },
            "k is 10000.001",
        ),
    ];
    let given = |p: &&Parameter| !p.keys().is_empty();
    assert_eq!(Parameter::ALL.iter().filter(given).count(), bad.len(), "a parameter without a case");
    for (parameter, model, message) in bad {
        assert!(model.kind().facts().parameters.contains(&parameter));
        let mut s = SceneDescription::default();
        s.add_material("surface", model);
        let error = bake(&s, &BakeOptions::default(), |_, _| {}).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains("material `surface`") && error.contains(message), "{parameter:?}: {error}");
    }
}

const GREY: Reflectance = Reflectance::Constant([0.5; 3]);
