//! Which kernel runs a packet of samples. A class of its own type: a packet's class is not its material, so that other
//! scattering functions (of media, say) can have classes too.

use crate::scene::blob::MaterialKind;

/// One kernel of the scatter stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PacketClass(u8);

/// Samples that wait together: those of one class, all with next event estimation or all without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Queue(u8);

impl PacketClass {
    /// How many there are.
    pub(crate) const COUNT: usize = MaterialKind::ALL.len();

    /// The class of surfaces of a material kind, given by its number in the blob.
    pub(crate) fn of_material(kind: u32) -> Option<Self> {
        ((kind as usize) < Self::COUNT).then_some(Self(kind as u8))
    }

    /// The kernel: a BSDF.
    pub(crate) fn bsdf(self) -> MaterialKind {
        MaterialKind::ALL[self.0 as usize % Self::COUNT]
    }

    /// Where its samples wait.
    pub(crate) fn queue(self, with_nee: bool) -> Queue {
        Queue(if with_nee { self.0 } else { self.0 + Self::COUNT as u8 })
    }
}

const _: () = assert!(2 * PacketClass::COUNT <= u8::MAX as usize);

impl Queue {
    /// How many there are.
    pub(crate) const COUNT: usize = 2 * PacketClass::COUNT;

    /// Every queue, those with next event estimation first.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        (0..Self::COUNT as u8).map(Self)
    }

    /// The queues whose bits are set, in order.
    #[inline(always)]
    pub(crate) fn of_bits(mut bits: u32) -> impl Iterator<Item = Self> {
        core::iter::from_fn(move || {
            let first = bits.trailing_zeros();
            bits &= bits.wrapping_sub(1);
            (first < Self::COUNT as u32).then_some(Self(first as u8))
        })
    }

    /// Number of the queue, below [`Self::COUNT`].
    pub(crate) fn index(self) -> usize {
        self.0 as usize
    }

    /// The class of its samples.
    pub(crate) fn class(self) -> PacketClass {
        PacketClass(self.0 % PacketClass::COUNT as u8)
    }

    /// Do the samples in it have next event estimation?
    pub(crate) fn with_nee(self) -> bool {
        self.index() < PacketClass::COUNT
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Killed by: two kinds in one class, a queue that forgets what its samples do.
    #[test]
    fn every_material_kind_has_a_class_and_two_queues() {
        let mut seen = [false; Queue::COUNT];
        for kind in MaterialKind::ALL {
            let class = PacketClass::of_material(*kind as u32).expect("a class");
            assert_eq!(class.bsdf(), *kind);
            for with_nee in [true, false] {
                let q = class.queue(with_nee);
                assert_eq!((q.class(), q.with_nee()), (class, with_nee));
                assert!(!core::mem::replace(&mut seen[q.index()], true));
            }
        }
        assert!(seen.iter().all(|s| *s) && Queue::all().map(Queue::index).eq(0..Queue::COUNT));
        assert_eq!(PacketClass::of_material(PacketClass::COUNT as u32), None);
    }
}
