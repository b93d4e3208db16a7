//! A scene with many lights of many kinds.

use croupier_host::description::{Emitter, Environment, LightShape, SceneDescription, ShapeLight};
use croupier_tests::many_lights::cloud;

/// A cloud of emitters with lights of all other kinds but an environment map.
pub(crate) fn mixed(n: u32) -> SceneDescription {
    let mut s = cloud(n, [12, 9]);
    // above the cloud: next to a lamp their noise would hide everything
    let at = |k: u32| [k as f32 - 4.0, 3.5 + 0.1 * k as f32, 1.5 - 0.5 * k as f32];
    for k in 0..6 {
        s.emitters.push(Emitter::Point { position: at(k), intensity: [0.3, 0.2, 0.1 * k as f32] });
        s.emitters.push(Emitter::Spot {
            position: at(k + 1),
            direction: [0.3 * k as f32 - 1.0, -1.0, 0.2],
            intensity: [1.0, 0.5, 0.2],
            inner_deg: 10.0,
            outer_deg: 35.0,
        });
    }
    s.emitters.push(Emitter::Sun { direction: [-1.0, -2.0, -0.5], irradiance: [0.2, 0.15, 0.1], angle_deg: 1.0 });
    s.emitters.push(Emitter::Directional { direction: [1.0, -2.0, 0.5], irradiance: [0.05, 0.05, 0.1] });
    s.environment = Some(Environment::Constant { radiance: [0.02; 3] });
    let light = |shape, position, two_sided| {
        Emitter::Shape(ShapeLight { shape, position, radiance: [3.0, 2.0, 1.0], two_sided, visible: true })
    };
    s.emitters.push(light(LightShape::Sphere { radius: 0.2 }, [2.0, 1.0, 1.0], false));
    let edges = [[0.5, 0.0, 0.0], [0.0, 0.3, 0.4]];
    s.emitters.push(light(LightShape::Rectangle { edges }, [-2.0, 2.0, 1.0], true));
    s.emitters.push(light(LightShape::Disk { direction: [0.0, -1.0, 0.0], radius: 0.3 }, [0.0, 2.0, 3.0], false));
    s
}
