//! The built-in box with an object that moves.

use croupier_host::description::{Instance, Prototype, SceneDescription};

/// Places the metal sphere of the built-in box in the world by an instance, where it is.
pub fn place_metal_sphere(scene: &mut SceneDescription) {
    let at = scene.objects.iter().position(|o| o.name == "metal sphere");
    if let Some([sphere, next]) = at.and_then(|i| scene.objects.get(i..i + 2)) {
        let triangles = sphere.first_triangle..next.first_triangle;
        let prototype = scene.prototypes.len() as u32;
        scene.prototypes.push(Prototype { name: "sphere".into(), triangles, instances: Vec::new() });
        let stay = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        scene.instances.push(Instance::new("metal sphere", prototype, stay));
    }
}
