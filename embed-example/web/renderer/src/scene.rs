//! A scene in the page's memory.

use crate::Refused;
use croupier::EditableScene;
use croupier::unstable::scene::blob::Camera;

/// A validated blob whose camera can change.
pub struct OpenScene(EditableScene<&'static mut [u8]>);

impl OpenScene {
    /// Validates the blob.
    pub(crate) fn new(blob: &'static mut [u8]) -> Result<Self, Refused> {
        EditableScene::new(blob).map(Self).map_err(|_| Refused::Scene)
    }

    /// The scene as it is now.
    pub(crate) fn scene(&self) -> croupier::Scene<'_> {
        self.0.scene()
    }

    /// The camera's record and the corners of the scene's box.
    pub(crate) fn view(&self) -> [u32; 23] {
        let scene = self.scene();
        let (c, info) = (scene.camera, scene.info);
        let vectors = [c.origin, c.forward, c.right, c.down];
        let words = core::iter::once(c.kind)
            .chain(vectors.into_iter().flatten().map(f32::to_bits))
            .chain([c.lens_radius.to_bits(), c.focus_distance.to_bits()])
            .chain(c.size)
            .chain([info.bounds_min, info.bounds_max].into_iter().flatten().map(f32::to_bits));
        let mut view = [0; 23];
        view.iter_mut().zip(words).for_each(|(to, from)| *to = from);
        view
    }

    /// Replaces the camera by one of a record.
    pub(crate) fn look(&mut self, record: &[u32; 17]) -> Result<(), Refused> {
        let [kind, vectors @ .., radius, focus, width, height] = *record;
        let mut words = vectors.into_iter().map(f32::from_bits);
        let mut vector = || core::array::from_fn(|_| words.next().unwrap_or(0.0));
        let camera = Camera {
            kind,
            origin: vector(),
            forward: vector(),
            right: vector(),
            down: vector(),
            lens_radius: f32::from_bits(radius),
            focus_distance: f32::from_bits(focus),
            size: [width, height],
        };
        self.0.edit().camera(camera).map_err(|_| Refused::Camera)
    }
}
