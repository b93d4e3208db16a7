//! Principled materials from files: `scene.json`, and the keys of MTL that ask for one.

use croupier_host::bake::{BakeOptions, bake};
use croupier_host::description::*;
use croupier_host::load::{LoadReport, load};
use std::fs;
use std::path::Path;

fn write_png(path: &Path, rgba: [u8; 4]) {
    let mut encoder = png::Encoder::new(fs::File::create(path).unwrap(), 1, 1);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&rgba).unwrap();
}

/// A folder with one triangle, two textures and this material.
fn load_material(material: &str) -> Result<(SceneDescription, LoadReport), String> {
    let folder = tempfile::tempdir().unwrap();
    let json = format!(
        r#"{{ "geometry": {{ "file": "a.obj" }}, "camera": {{ "origin": [0, 0, 5], "target": [0, 0, 0],
        "up": [0, 1, 0], "vfov_deg": 40, "width": 4, "height": 4 }}, "materials": {{ "m": {material} }} }}"#
    );
    fs::write(folder.path().join("scene.json"), json).unwrap();
    fs::write(folder.path().join("a.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n").unwrap();
    write_png(&folder.path().join("a.png"), [10, 20, 30, 40]);
    write_png(&folder.path().join("b.png"), [50, 60, 70, 255]);
    load(folder.path()).map_err(|e| e.to_string())
}

fn load_mtl(text: &str) -> SceneDescription {
    let folder = tempfile::tempdir().unwrap();
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
    fs::write(folder.path().join("a.obj"), obj).unwrap();
    fs::write(folder.path().join("a.mtl"), format!("newmtl m\n{text}\n")).unwrap();
    write_png(&folder.path().join("a.png"), [10, 20, 30, 40]);
    write_png(&folder.path().join("b.png"), [50, 60, 70, 255]);
    let (scene, _) = load(&folder.path().join("a.obj")).unwrap();
    assert!(bake(&scene, &BakeOptions::default(), |_, _| {}).is_ok(), "{text}");
    scene
}

/// Every key of a scene file. Killed by: a key that sets another field or none, an encoding or a wrapping that is mixed up.
#[test]
fn scene_files_have_every_field() {
    let (scene, _) = load_material(r#"{ "type": "principled" }"#).unwrap();
    assert_eq!(scene.materials[0].model, Model::Principled(Principled::default()));
    assert!(!scene.materials[0].two_sided);
    let (scene, _) = load_material(
        r#"{ "type": "principled", "twosided": true, "base_color": [0.1, 0.2, 0.3], "metalness": 0.15,
        "roughness": 0.25, "ior": 1.4, "specular": 0.35, "specular_color": [0.4, 0.5, 0.6], "transmission": 0.45,
        "thin_walled": true, "coat": 0.55, "coat_roughness": 0.65, "sheen_color": 0.75, "sheen_roughness": 0.85,
        "emission": [1, 2, 3], "normal_scale": -2, "opacity": 0.95,
        "base_texture": { "file": "a.png", "alpha": "cutout", "transform": [[2, 0, 0.5], [0, 3, 0.25]] },
        "metal_rough_texture": "a.png", "transmission_texture": { "file": "b.png", "wrap": "clamp" },
        "coat_texture": { "file": "b.png", "wrap": ["mirror", "repeat"] }, "normal_texture": "b.png",
        "emission_texture": "a.png" }"#,
    )
    .unwrap();
    let m = &scene.materials[0];
    let of = |i| Some(TextureRef::new(i));
    let wanted = Principled {
        base_color: [0.1, 0.2, 0.3],
        base_texture: Some(TextureRef { texture: 0, transform: [[2.0, 0.0, 0.5], [0.0, 3.0, 0.25]] }),
        metalness: 0.15,
        roughness: 0.25,
        metal_rough_texture: of(1),
        ior: 1.4,
        specular: 0.35,
        specular_color: [0.4, 0.5, 0.6],
        transmission: 0.45,
        transmission_texture: of(2),
        thin_walled: true,
        coat: 0.55,
        coat_texture: of(3),
        coat_roughness: 0.65,
        sheen_color: [0.75; 3],
        sheen_roughness: 0.85,
        emission: [1.0, 2.0, 3.0],
        emission_texture: of(0),
        normal_texture: of(4),
        normal_scale: -2.0,
        opacity: 0.95,
    };
    let Model::Principled(mut found) = m.model else { panic!("{m:?}") };
    // textures are numbered as they are met
    let texture = |t: Option<TextureRef>| {
        let t = &scene.textures[t.unwrap().texture as usize];
        (t.texels[0][0], t.encoding, t.wrap)
    };
    let (linear, srgb, repeat) = (Encoding::Linear, Encoding::Srgb, [Wrap::Repeat; 2]);
    assert_eq!(texture(found.base_texture), (10, srgb, repeat));
    assert_eq!(texture(found.emission_texture), (10, srgb, repeat));
    assert_eq!(texture(found.metal_rough_texture), (10, linear, repeat));
    assert_eq!(texture(found.transmission_texture), (50, linear, [Wrap::Clamp; 2]));
    assert_eq!(texture(found.coat_texture), (50, linear, [Wrap::Mirror, Wrap::Repeat]));
    assert_eq!(texture(found.normal_texture), (50, linear, repeat));
    assert_eq!(scene.textures.len(), 5, "the base and the emission share one");
    for (f, w) in [
        (&mut found.metal_rough_texture, wanted.metal_rough_texture),
        (&mut found.transmission_texture, wanted.transmission_texture),
        (&mut found.coat_texture, wanted.coat_texture),
        (&mut found.normal_texture, wanted.normal_texture),
        (&mut found.emission_texture, wanted.emission_texture),
    ] {
        *f = w;
    }
    assert_eq!(found, wanted);
    assert!(m.two_sided && m.cutout);
    assert!(bake(&scene, &BakeOptions::default(), |_, _| {}).is_ok());
}

/// Killed by: a misspelt key that is ignored, a value out of range that is taken over.
#[test]
fn what_is_wrong_is_named() {
    for (material, message) in [
        (r#"{ "type": "principled", "roughnes": 1 }"#, "materials.m.roughnes: a principled material has no `roughnes`"),
        (r#"{ "type": "principled", "coat_texture": { "file": "a.png", "wrap": "border" } }"#, "`border`"),
        (r#"{ "type": "principled", "coat_texture": { "file": "a.png", "transform": [[1, 0, 0]] } }"#, "two rows"),
        (r#"{ "type": "principled", "metalness": "yes" }"#, "materials.m.metalness: expected a number"),
    ] {
        let error = load_material(material).err().unwrap_or_default();
        assert!(error.contains(message), "{error}");
    }
    for (change, message) in [
        ((|p| p.metalness = 1.5) as fn(&mut Principled), "metalness is 1.5"),
        (|p| p.roughness = f32::NAN, "roughness is NaN"),
        (|p| p.base_color[1] = -0.5, "base_color is -0.5"),
        (|p| p.ior = 0.05, "ior is 0.05"),
        (|p| p.opacity = 2.0, "opacity is 2"),
        (|p| p.normal_scale = 2e3, "normal_scale is 2000"),
        (|p| p.emission[0] = -1.0, "emission"),
        (|p| p.coat_texture = Some(TextureRef::new(3)), "refers to texture 3, there are 0"),
    ] {
        let mut p = Principled::default();
        change(&mut p);
        let mut s = SceneDescription::default();
        s.add_material("surface", Model::Principled(p));
        let error = bake(&s, &BakeOptions::default(), |_, _| {}).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains("`surface`") || error.contains("surface"), "{error}");
        assert!(error.contains(message), "{message}: {error}");
    }
    let mut s = SceneDescription::default();
    let texture = Texture { name: "t".into(), width: 1, height: 1, texels: vec![[0; 4]], ..Texture::default() };
    s.textures.push(Texture { encoding: Encoding::Linear, ..texture });
    s.add_material("wood", Model::Diffuse { reflectance: Reflectance::Texture(0) });
    let error = bake(&s, &BakeOptions::default(), |_, _| {}).unwrap_err().to_string();
    assert!(error.contains("`wood` is not principled"), "{error}");
}

/// The table of `load/mtl_principled.rs`. Killed by: a row that sets another field, textures of roughness and metalness in
/// each other's channel, a key that does not ask for the principled material.
#[test]
fn mtl_keys_become_fields() {
    let base = Principled { base_color: [0.5; 3], roughness: 0.5, sheen_roughness: 0.5, ..Principled::default() };
    for (text, wanted) in [
        ("Pc 0.5", Principled { coat: 0.5, ..base }),
        ("Pc 0.5\nPcr 0.25\nPr 0.75", Principled { coat: 0.5, coat_roughness: 0.25, roughness: 0.75, ..base }),
        ("Ps 0.25\nPm 0.75", Principled { sheen_color: [0.25; 3], metalness: 0.75, ..base }),
        ("Pcr 0\nKd 1 0 0\nNi 1.25", Principled { base_color: [1.0, 0.0, 0.0], ior: 1.25, ..base }),
        ("Pc 0\nd 0.75", Principled { opacity: 0.75, ..base }),
        ("Pc 0\nd 0.25\nNi 1", Principled { transmission: 1.0, thin_walled: true, ..base }),
        ("Pc 0\nillum 7\nNi 1.25", Principled { transmission: 1.0, ior: 1.25, ..base }),
        ("norm a.png", Principled { normal_texture: Some(TextureRef::new(0)), ..base }),
    ] {
        assert_eq!(load_mtl(text).materials[0].model, Model::Principled(wanted), "{text}");
    }
    let scene = load_mtl("map_Pr a.png\nmap_Pm b.png\nPr 0.25");
    let Model::Principled(p) = scene.materials[0].model else { panic!("{:?}", scene.materials) };
    assert_eq!((p.roughness, p.metalness), (1.0, 1.0));
    let texture = &scene.textures[p.metal_rough_texture.unwrap().texture as usize];
    assert_eq!((texture.texels[0][1], texture.texels[0][2], texture.encoding), (10, 50, Encoding::Linear));
    let scene = load_mtl("map_Kd a.png\nmap_Ke -clamp on b.png\nKe 2 3 4");
    let Model::Principled(p) = scene.materials[0].model else { panic!("{:?}", scene.materials) };
    assert_eq!((p.base_color, p.base_texture), ([1.0; 3], Some(TextureRef::new(0))));
    assert_eq!(scene.textures[p.emission_texture.unwrap().texture as usize].encoding, Encoding::Srgb);
    assert_eq!(scene.emitters[0], Emitter::Area { material: 0, radiance: [2.0, 3.0, 4.0] });
    assert!(
        matches!(load_mtl("Kd 1 1 1\nPr 0.5").materials[0].model, Model::RoughPlastic { .. }),
        "the mapping of before"
    );
}

/// `map_d`, alone and with colours. Killed by: an alpha that is the colour's, or the mean; glass in place of holes; a red that
/// counts beside an alpha; a texture for every material; `d` that is multiplied; texels of one size read with another's.
#[test]
fn mtl_opacity_maps_cut_holes() {
    let grey = |mask: &str| format!("Kd 0.5 0.25 1\nd 0\nillum 4\nmap_d {mask}");
    for (mask, alpha) in [("a.png", 40), ("-imfchan m b.png", 50)] {
        let scene = load_mtl(&grey(mask));
        let m = &scene.materials[0];
        let Model::Diffuse { reflectance: Reflectance::Texture(t) } = m.model else { panic!("{m:?}") };
        let texture = &scene.textures[t as usize];
        assert!(m.cutout);
        assert_eq!((&texture.texels[..], texture.encoding), (&[[188, 137, 255, alpha]][..], Encoding::Srgb));
    }
    let scene = load_mtl("map_Kd b.png\nmap_d a.png\nnewmtl n\nmap_Kd b.png\nmap_d a.png\nPc 1");
    let Model::Diffuse { reflectance: Reflectance::Texture(t) } = scene.materials[0].model else { panic!() };
    assert_eq!(scene.textures[t as usize].texels, [[50, 60, 70, 40]]);
    let scene = load_mtl("map_Kd b.png\nmap_d a.png\nPc 1\nd 0.25");
    let Model::Principled(p) = scene.materials[0].model else { panic!() };
    assert!(scene.materials[0].cutout && p.opacity == 1.0 && p.transmission == 0.0);
    assert_eq!(scene.textures[p.base_texture.unwrap().texture as usize].texels, [[50, 60, 70, 40]]);
    // a hole map of another size: four columns for one of the colour
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\nusemtl n\nf 1 2 3\n");
    write("a.mtl", "newmtl m\nmap_Kd b.png\nmap_d wide.png\nnewmtl n\nmap_Kd b.png\nmap_d wide.png\n");
    write_png(&folder.path().join("b.png"), [50, 60, 70, 255]);
    let mut encoder = png::Encoder::new(fs::File::create(folder.path().join("wide.png")).unwrap(), 4, 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_image_data(&[0, 100, 200, 255]).unwrap();
    let (scene, report) = load(&folder.path().join("a.obj")).unwrap();
    let texture = scene.textures.last().unwrap();
    assert_eq!((texture.width, texture.height, scene.textures.len()), (4, 1, 3), "{:?}", report.notes);
    assert_eq!(texture.texels, [0, 100, 200, 255].map(|a| [50, 60, 70, a]));
}
