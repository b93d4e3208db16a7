//! The built-in box with objects that move.

use croupier_host::description::{Instance, Prototype, SceneDescription};

/// Places the metal sphere of the built-in box in the world by an instance, where it is.
pub fn place_metal_sphere(scene: &mut SceneDescription) {
    let stay = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    place_metal_spheres(scene, [stay]);
}

/// Takes the metal sphere of the built-in box out of the world and places it by each of these maps.
pub fn place_metal_spheres(scene: &mut SceneDescription, maps: impl IntoIterator<Item = [[f32; 4]; 3]>) {
    let at = scene.objects.iter().position(|o| o.name == "metal sphere");
    if let Some([sphere, next]) = at.and_then(|i| scene.objects.get(i..i + 2)) {
        let triangles = sphere.first_triangle..next.first_triangle;
        let prototype = scene.prototypes.len() as u32;
        scene.prototypes.push(Prototype { name: "sphere".into(), triangles, instances: Vec::new() });
        scene.instances.extend(maps.into_iter().map(|map| Instance::new("metal sphere", prototype, map)));
    }
}
