//! What edits of materials, lights and instances promise: a material's edit changes no other one, whatever is accepted
//! makes a valid blob, one identity has one light table.

use bytemuck::Zeroable;
use croupier::unstable::accel::Primitive;
use croupier::unstable::scene::InstanceFault;
use croupier::unstable::scene::blob::*;
use croupier::{EditError, EditableScene, Scene};
use croupier_host::blob::AlignedBytes;
use croupier_host::description::{
    self, Emitter, Instance, Model, Principled, Prototype, Reflectance, SceneDescription,
};
use croupier_tests::runner::{render, settings};
use croupier_tests::scenes::{add_box, blob, cornell, grey};
use std::cell::Cell;
use std::rc::Rc;

fn editable(scene: &SceneDescription) -> EditableScene<AlignedBytes> {
    EditableScene::new(blob(scene)).expect("a valid scene")
}

fn sealed(mut scene: EditableScene<AlignedBytes>) -> AlignedBytes {
    scene.seal();
    scene.into_bytes()
}

/// Cornell box whose white material is principled, and a second principled one.
fn layered(white: Principled) -> SceneDescription {
    let mut scene = cornell([16, 16]);
    let i = scene.materials.iter().position(|m| m.name == "white").unwrap_or(0);
    scene.materials[i].model = Model::Principled(white);
    let other = Principled { roughness: 0.75, metalness: 1.0, ..Principled::default() };
    let other = scene.add_material("metal", Model::Principled(other));
    add_box(&mut scene, other, [-0.3; 3], [-0.1; 3], false);
    scene
}

/// Colour alone, and colour with record, are replaced as baking would have made them; what is wrong leaves every byte as
/// it was. Killed by: a record that is lost, written elsewhere or not checked.
#[test]
fn principled_materials_are_edited_in_place() {
    let old = Principled { base_color: [0.5, 0.25, 0.75], roughness: 0.5, ..Principled::default() };
    let scene = layered(old);
    let index = blob_index(&scene);
    let find = |bytes: &[u8]| {
        let scene = Scene::from_bytes(bytes).unwrap();
        let m = scene.materials[index as usize];
        (m, *scene.principled(&m).expect("a record"))
    };
    let painted = blob(&layered(Principled { base_color: [0.125, 0.5, 0.5], ..old }));
    let mut edited = editable(&scene);
    let first = edited.scene().hash;
    edited.edit().material(index, find(&painted).0, &[]).unwrap();
    assert_ne!(edited.scene().hash, first);
    assert_eq!(&sealed(edited)[..], &painted[..]);

    let target = blob(&layered(Principled { roughness: 0.25, coat: 0.5, ..old }));
    let mut edited = editable(&scene);
    let (material, record) = find(&target);
    edited.edit().principled(index, material, record).unwrap();
    let (before, own) = find(&blob(&scene));
    edited.edit().principled(index, before, own).unwrap();
    assert_eq!(edited.scene().hash, first, "taken back");
    edited.edit().principled(index, material, record).unwrap();
    assert_eq!(&sealed(edited)[..], &target[..]);

    let mut edited = editable(&scene);
    let red = edited.scene().materials.iter().position(|m| m.kind == MaterialKind::Diffuse as u32).unwrap() as u32;
    let bytes = edited.bytes().to_vec();
    {
        let mut e = edited.edit();
        let fixed = |r: Result<(), EditError>| matches!(r, Err(EditError::Fixed { .. }));
        let invalid = |r: Result<(), EditError>| matches!(r, Err(EditError::Invalid(_)));
        assert!(fixed(e.material(red, material, &[])));
        assert!(fixed(e.principled(red, material, record)));
        assert!(fixed(e.principled(index, Material { kind: MaterialKind::Diffuse as u32, ..material }, record)));
        assert!(fixed(e.material(index, material, &[0.5])));
        assert!(invalid(e.principled(index, material, PrincipledRecord { roughness: 1.5, ..record })));
        assert!(invalid(e.principled(index, material, PrincipledRecord { flags: 64, ..record })));
        assert!(invalid(e.principled(index, material, PrincipledRecord { reflection: u32::MAX - 1, ..record })));
        assert!(matches!(e.principled(99, material, record), Err(EditError::Missing { .. })));
    }
    assert_eq!(edited.bytes(), &bytes[..]);
    assert_eq!(edited.scene().hash, first);
    // another kind is a door that closes behind the material
    let plain = Material { kind: MaterialKind::Diffuse as u32, ..material };
    edited.edit().material(index, plain, &[]).unwrap();
    assert!(matches!(edited.edit().material(index, material, &[]), Err(EditError::Fixed { .. })));
    Scene::from_bytes(&sealed(edited)).expect("a valid scene");
}

/// Index of the first principled material.
fn blob_index(scene: &SceneDescription) -> u32 {
    let bytes = blob(scene);
    let scene = Scene::from_bytes(&bytes).unwrap();
    scene.materials.iter().position(|m| scene.principled(m).is_some()).expect("a principled material") as u32
}

/// Equal tables are stored once; new ones for one material are refused, other colours are not. Killed by: an edit that
/// changes the material with the same tables, a refusal of what changes no table.
#[test]
fn no_edit_changes_another_material() {
    let mut scene = cornell([16, 16]);
    let rough = |rho| Model::RoughPlastic {
        reflectance: Reflectance::Constant([rho; 3]),
        alpha: 0.25,
        int_ior: 1.5,
        ext_ior: 1.0,
    };
    let [a, b] = [("a", 0.5), ("b", 0.25)].map(|(name, rho)| scene.add_material(name, rough(rho)));
    add_box(&mut scene, a, [-0.3; 3], [-0.1; 3], false);
    add_box(&mut scene, b, [0.1; 3], [0.3; 3], false);
    let mut edited = editable(&scene);
    let old = edited.scene().materials[a as usize];
    assert_eq!(old.table, edited.scene().materials[b as usize].table, "the baker shares tables");
    let first = old.table as usize;
    let count = TRANSMITTANCE_ENTRIES + if old.flags & MATERIAL_COMPENSATED != 0 { COMPENSATION_ENTRIES } else { 0 };
    let tables = edited.scene().tables.to_vec();
    let own = &tables[first..first + count];
    let new: Vec<f32> = own.iter().map(|x| 0.5 * x + 0.4).collect();
    let refused = edited.edit().material(a, Material { alpha: 0.3, ..old }, &new);
    assert_eq!(refused, Err(EditError::Shared { material: a, with: b }));
    assert!(refused.unwrap_err().to_string().contains(&format!("material {b} ")));
    assert_eq!(edited.scene().tables, &tables[..]);
    edited.edit().material(a, Material { reflectance: [0.75; 3], ..old }, own).unwrap();
    assert_eq!(edited.scene().materials[a as usize].reflectance, [0.75; 3]);
    // once the other is something else, the tables are this one's alone
    let plain = Material { kind: MaterialKind::Diffuse as u32, flags: 0, ..edited.scene().materials[b as usize] };
    edited.edit().material(b, plain, &[]).unwrap();
    edited.edit().material(a, Material { alpha: 0.3, ..old }, &new).unwrap();
    Scene::from_bytes(&sealed(edited)).expect("a valid scene");

    // a table that is legal where it lies in a principled record: albedos of its layers
    let mut scene = layered(Principled::default());
    let plastic = scene.add_material("plastic", rough(0.5));
    let bytes = blob(&scene);
    let index = blob_index(&scene);
    let found = Scene::from_bytes(&bytes).unwrap();
    let (m, old) = (found.materials[index as usize], &found.materials[plastic as usize]);
    let record = *found.principled(&m).unwrap();
    let table = m.table + (std::mem::offset_of!(PrincipledRecord, coat_layer) / size_of::<f32>()) as u32;
    let laid = Material { table, flags: old.flags & !MATERIAL_COMPENSATED, ..*old };
    let mut edited = EditableScene::new(patched(&bytes, &[(old, laid)])).expect("a legal blob");
    let refused = edited.edit().principled(index, m, PrincipledRecord { roughness: 0.125, ..record });
    assert_eq!(refused, Err(EditError::Shared { material: index, with: plastic }));
    edited.edit().principled(index, Material { reflectance: [0.5; 3], ..m }, record).unwrap();
    let zeros = [0.5; TRANSMITTANCE_ENTRIES];
    let refused = edited.edit().material(plastic, laid, &zeros);
    assert_eq!(refused, Err(EditError::Shared { material: plastic, with: index }));
}

/// A copy of a blob with other records in place of some of its own.
fn patched<T: bytemuck::Pod>(bytes: &AlignedBytes, records: &[(&T, T)]) -> AlignedBytes {
    let mut copy = AlignedBytes::zeroed(bytes.len());
    copy.as_mut().copy_from_slice(bytes);
    for (old, new) in records {
        let place = std::ptr::from_ref(*old) as usize - bytes.as_ptr() as usize;
        copy.as_mut()[place..place + size_of::<T>()].copy_from_slice(bytemuck::bytes_of(new));
    }
    let mut header: Header = bytemuck::pod_read_unaligned(&copy[..size_of::<Header>()]);
    header.hash = content_hash(&copy[size_of::<Header>()..header.length as usize]);
    copy.as_mut()[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&header));
    copy
}

/// A box of glowing sides in a pair, the pair placed twice.
fn placed(scale: f32) -> SceneDescription {
    let mut scene = cornell([16, 16]);
    let first = scene.triangles.len() as u32;
    let glow = scene.add_material("glow", grey(0.5));
    scene.emitters.push(Emitter::Area { material: glow, radiance: [3.0, 2.0, 1.0] });
    add_box(&mut scene, glow, [-0.1; 3], [0.1; 3], false);
    let middle = scene.triangles.len() as u32;
    let of = |prototype, x: f32, s: f32| Instance {
        name: format!("at {x}"),
        prototype,
        to_world: [[s, 0.0, 0.0, x], [0.0, s, 0.0, 0.0], [0.0, 0.0, s, 0.0]],
        to_world_end: None,
        visible: true,
    };
    scene.prototypes.push(Prototype { name: "lamp".into(), triangles: first..middle, instances: vec![] });
    let pair = vec![of(0, -0.2, 1.0), of(0, 0.2, 1.0)];
    scene.prototypes.push(Prototype { name: "pair".into(), triangles: middle..middle, instances: pair });
    scene.instances = vec![of(0, 0.5, 1.0), of(1, -0.3, scale), of(1, 0.3, 1.0)];
    scene
}

/// The map of `m` moved by `d`, twice.
fn moved(m: [[f32; 4]; 3], d: [f32; 3]) -> [[[f32; 4]; 3]; 2] {
    let mut to = m;
    (0..3).for_each(|k| to[k][3] += d[k]);
    [to, to]
}

/// An instance within an object cannot go where an instance of the world would carry it out of range; nothing has changed
/// then. Killed by: a check of the object's own space alone.
#[test]
fn nested_moves_stay_in_range_in_the_world() {
    let scene = placed(1e4);
    let mut edited = editable(&scene);
    let nested = edited.scene().objects[0].instances;
    let (instances, bytes) = (edited.scene().instances.to_vec(), edited.bytes().to_vec());
    let far = MAX_COORDINATE * 1e-3;
    let outer = (0..nested).find(|i| instances[*i as usize].to_world[0][0][0] == 1e4).unwrap();
    {
        let mut e = edited.edit();
        let refused = e.transform(nested, moved(instances[nested as usize].to_world[0], [far, 0.0, 0.0]));
        let out =
            matches!(refused, Err(EditError::Transform { index, fault: InstanceFault::Outside(_) }) if index == outer);
        assert!(out, "{refused:?}");
    }
    assert_eq!(edited.bytes(), &bytes[..]);
    edited.edit().transform(nested, moved(instances[nested as usize].to_world[0], [1.0, 0.0, 0.0])).unwrap();
    Scene::from_bytes(&sealed(edited)).expect("a valid scene");
}

/// Moved, hidden and shown, moved back: the same scene has the same bytes, areas and all. Killed by: lights of instances
/// that are not those moved, bounds that stay enlarged, lights of nested instances that keep their area.
#[test]
fn moves_that_are_taken_back_leave_nothing() {
    let scene = placed(1.5);
    let mut edited = editable(&scene);
    let (before, hash) = (edited.scene().instances.to_vec(), edited.scene().hash);
    let (bounds, nested) = (*edited.scene().info, before.len() as u32 - 1);
    let areas = |e: &EditableScene<AlignedBytes>| e.scene().lights.iter().map(|l| l.area).collect::<Vec<_>>();
    let old = areas(&edited);
    let mut map = before[nested as usize].to_world[0];
    (0..3).for_each(|k| (0..3).for_each(|c| map[k][c] *= 2.0));
    edited.edit().transform(nested, [map; 2]).unwrap();
    let grown = areas(&edited);
    let quadrupled = old.iter().zip(&grown).filter(|(a, b)| (*b / *a - 4.0).abs() < 1e-3).count();
    let same = old.iter().zip(&grown).filter(|(a, b)| a == b).count();
    // twelve triangles in each of the two pairs
    assert_eq!((quadrupled, quadrupled + same), (24, old.len()));
    assert_ne!(edited.scene().hash, hash);
    edited.edit().transform(nested, before[nested as usize].to_world).unwrap();
    assert_eq!(areas(&edited), old);
    assert_eq!(edited.scene().info.bounds_min, bounds.bounds_min);
    assert_eq!(edited.scene().info.bounds_max, bounds.bounds_max);
    Scene::from_bytes(&sealed(edited)).expect("a valid scene");
}

/// The power of lights without a place depends on the scene's bounds: after a move that changes them the table is the
/// one of the state, and an edit that changes no byte changes no table. Killed by: a table that is built when something
/// else is edited.
#[test]
fn one_identity_has_one_light_table() {
    let mut scene = placed(1.0);
    scene.emitters.push(Emitter::Directional { direction: [0.1, -1.0, 0.2], irradiance: [0.2; 3] });
    scene.environment = Some(description::Environment::Constant { radiance: [0.3, 0.4, 0.5] });
    let mut edited = editable(&scene);
    let map = edited.scene().instances[0].to_world[0];
    edited.edit().transform(0, moved(map, [20.0, 0.0, 0.0])).unwrap();
    let (hash, bytes) = (edited.scene().hash, edited.bytes().to_vec());
    let (light, environment) = (edited.scene().lights[0], *edited.scene().environment.unwrap());
    edited.edit().light(0, light).unwrap();
    edited.edit().environment(environment).unwrap();
    edited.edit().visible(0, true).unwrap();
    assert_eq!(edited.scene().hash, hash);
    assert!(edited.bytes() == &bytes[..], "an edit that changes nothing");

    // the table is that of baking, to rounding
    let mut target = scene.clone();
    target.instances[0].to_world = moved(map, [20.0, 0.0, 0.0])[0];
    let target = blob(&target);
    let target = Scene::from_bytes(&target).unwrap();
    assert_eq!(edited.scene().light_alias.len(), target.light_alias.len());
    for (a, b) in edited.scene().light_alias.iter().zip(target.light_alias) {
        assert!((f64::from(a.probability) / f64::from(b.probability) - 1.0).abs() < 1e-4);
    }
}

/// A map's power follows from its texels, whatever else emits: alone at first, then with a light of known power. Killed
/// by: a share of the table that is taken for a power, weights of rows that are not those of the sphere.
#[test]
fn the_power_of_a_map_is_that_of_its_texels() {
    let texels: Vec<[f32; 3]> = (0..8 * 5).map(|i| [0.1 * (i % 7) as f32, 0.5, 0.05 * (i / 8) as f32]).collect();
    let mut scene = cornell([16, 16]);
    scene.emitters.iter_mut().for_each(|e| {
        if let Emitter::Area { radiance, .. } = e {
            *radiance = [1e-30; 3];
        }
    });
    let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    scene.environment =
        Some(description::Environment::Map { texels, width: 8, height: 5, to_world, scale: [1.0, 2.0, 0.5] });
    let mut lit = scene.clone();
    lit.emitters.iter_mut().for_each(|e| {
        if let Emitter::Area { radiance, .. } = e {
            *radiance = [5.0; 3];
        }
    });
    let mut edited = editable(&scene);
    let target = blob(&lit);
    let target = Scene::from_bytes(&target).unwrap();
    let mut e = edited.edit();
    for (i, l) in (0..).zip(target.lights) {
        e.light(i, *l).unwrap();
    }
    drop(e);
    for (a, b) in edited.scene().light_alias.iter().zip(target.light_alias) {
        assert!((f64::from(a.probability) / f64::from(b.probability) - 1.0).abs() < 1e-4, "{a:?} {b:?}");
    }
}

/// All lights off, or all that emit hidden, are scenes that can be stored and rendered: black. A scene that was baked
/// without light stays without. Killed by: a validator that refuses what edits make, a light table of no light that
/// gives samples, an environment that lights up where there is no table.
#[test]
fn dark_scenes_can_be_sealed() {
    let scene = cornell([16, 16]);
    let bytes = blob(&scene);
    let material = Scene::from_bytes(&bytes).unwrap().triangles.iter().find(|t| t.light != NONE).unwrap().material;
    let mut edited = editable(&scene);
    edited.edit().emission(material, [0.0; 3]).unwrap();
    let dark = sealed(edited);
    Scene::from_bytes(&dark).expect("all lights off");
    for strategy in ["classic", "ears"] {
        let image = render(&dark, &settings(&dark, strategy), 4);
        assert_eq!(image.mean(), 0.0, "{strategy}");
    }

    let mut scene = placed(1.0);
    scene
        .emitters
        .retain(|e| matches!(e, Emitter::Area { material, .. } if scene.materials[*material as usize].name == "glow"));
    let mut edited = editable(&scene);
    let world = edited.scene().objects[0].instances;
    (0..world).for_each(|i| edited.edit().visible(i, false).unwrap());
    assert!(edited.scene().light_alias.iter().all(|a| a.probability == 0.0));
    let hidden = sealed(edited);
    Scene::from_bytes(&hidden).expect("all that emit are hidden");
    assert_eq!(render(&hidden, &settings(&hidden, "classic"), 4).mean(), 0.0);

    // a table without any share is refused while a light can be seen
    let bytes = blob(&cornell([16, 16]));
    let found = Scene::from_bytes(&bytes).unwrap();
    let none = |(i, a)| (a, Alias { threshold: u32::MAX, alias: i, probability: 0.0 });
    let shares: Vec<_> = (0..).zip(found.light_alias).map(none).collect();
    assert!(Scene::from_bytes(&patched(&bytes, &shares)).is_err());

    // a black environment and no table: this baker leaves both out, others may not
    let mut scene = cornell([16, 16]);
    scene.emitters.clear();
    scene.environment = Some(description::Environment::Constant { radiance: [1.0; 3] });
    let bytes = blob(&scene);
    let environment = Scene::from_bytes(&bytes).unwrap().environment.unwrap();
    let black = Environment { radiance: [0.0; 3], ..*environment };
    let mut black = patched(&bytes, &[(environment, black)]);
    let sections: &mut [Section] = {
        let header: Header = bytemuck::pod_read_unaligned(&black[..size_of::<Header>()]);
        let end = size_of::<Header>() + header.sections as usize * size_of::<Section>();
        bytemuck::cast_slice_mut(&mut black.as_mut()[size_of::<Header>()..end])
    };
    sections.iter_mut().filter(|s| s.kind == SectionKind::LightAlias as u32).for_each(|s| s.count = 0);
    let black = patched::<Environment>(&black, &[]);
    let mut edited = EditableScene::new(black).expect("a black scene without a table");
    assert!(edited.scene().light_alias.is_empty());
    let environment = *edited.scene().environment.unwrap();
    let refused = edited.edit().environment(Environment { radiance: [1.0; 3], ..environment });
    assert!(matches!(refused, Err(EditError::Fixed { of: SectionKind::Environment, index: 0 })));
    edited.edit().environment(environment).unwrap();
    Scene::from_bytes(&sealed(edited)).expect("still black");
}

/// Killed by: an error that names something else than the room, a scratch for other trees than the world's.
#[test]
fn rebuilding_says_how_much_room_it_needs() {
    let mut edited = editable(&placed(1.0));
    let instances = edited.scene().objects[0].instances as usize;
    let mut e = edited.edit();
    let needed = e.rebuild_len();
    assert_eq!(needed, instances + 1, "the world's instances and its own triangles");
    let mut room = vec![Primitive::zeroed(); needed - 1];
    let refused = e.rebuild(&mut room);
    assert_eq!(refused, Err(EditError::Room { needed, given: needed - 1 }));
    assert!(refused.unwrap_err().to_string().contains(&needed.to_string()));
    room.push(Primitive::zeroed());
    e.rebuild(&mut room).unwrap();
    drop(e);
    let mut flat = editable(&cornell([16, 16]));
    assert!(matches!(flat.edit().rebuild(&mut room), Err(EditError::Missing { of: SectionKind::Objects, .. })));
}

/// Two copies of a blob, the second at an odd place, and which of them is shown.
struct Copies {
    bytes: AlignedBytes,
    from: Rc<Cell<usize>>,
}

impl AsRef<[u8]> for Copies {
    fn as_ref(&self) -> &[u8] {
        &self.bytes[self.from.get()..]
    }
}

/// A container that has lost its alignment shows no scene under the identity of the one that it had. Killed by: the hash
/// of the scene on the empty one.
#[test]
fn a_misaligned_container_has_no_identity() {
    let blob = blob(&cornell([16, 16]));
    let odd = blob.len() + 1;
    let mut bytes = AlignedBytes::zeroed(2 * odd);
    [0, odd].iter().for_each(|at| bytes.as_mut()[*at..at + blob.len()].copy_from_slice(&blob));
    let from = Rc::new(Cell::new(0));
    let scene = EditableScene::new(Copies { bytes, from: from.clone() }).unwrap();
    let hash = scene.scene().hash;
    assert!(hash != 0 && !scene.scene().triangles.is_empty());
    from.set(odd);
    assert_eq!((scene.scene().hash, scene.scene().triangles.len()), (0, 0));
    from.set(0);
    assert_eq!(scene.scene().hash, hash);
}
