//! Which kernel runs a packet of samples. A class of its own type: a packet's class is not its material.

use crate::bsdf;
use crate::scene::blob::MaterialKind;

/// What packets of a class go through first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PacketClass(u8);

/// What a class scatters with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kernel {
    /// The BSDF of a material kind.
    Surface(MaterialKind),
    /// The phase function of a medium.
    Phase,
    /// Nothing: rays on their way.
    Straight,
}

/// Samples that wait together: those of one class, all with next event estimation or all without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Queue(u8);

/// Number of surface classes.
const SURFACES: u32 = MaterialKind::ALL.len() as u32;

/// What [`Arrival8::kind`](super::shading::Arrival8::kind) says of a vertex in a medium: no material kind has this number.
pub(crate) const PHASE_KIND: u32 = SURFACES;

impl PacketClass {
    /// How many there are.
    pub(crate) const COUNT: usize = SURFACES as usize + 2;

    /// Rays that go straight on.
    pub(crate) const STRAIGHT: Self = Self(PHASE_KIND as u8 + 1);

    /// The class of vertices of a kind: a material kind by its number in the blob, or [`PHASE_KIND`].
    pub(crate) fn of_kind(kind: u32) -> Option<Self> {
        (kind <= PHASE_KIND).then_some(Self(kind as u8))
    }

    /// Its kernel.
    #[inline(always)]
    pub(crate) fn kernel(self) -> Kernel {
        match MaterialKind::ALL.get(self.0 as usize) {
            Some(kind) => Kernel::Surface(*kind),
            None if u32::from(self.0) == PHASE_KIND => Kernel::Phase,
            None => Kernel::Straight,
        }
    }

    /// Does it scatter in single directions only, so that light samples are of no use?
    #[inline(always)]
    pub(crate) fn is_delta(self) -> bool {
        match self.kernel() {
            Kernel::Surface(kind) => bsdf::delta_kinds() >> kind as u32 & 1 == 1,
            Kernel::Phase => false,
            Kernel::Straight => true,
        }
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
    fn every_kind_has_a_class_and_two_queues() {
        let mut seen = [false; Queue::COUNT];
        let surfaces = MaterialKind::ALL.iter().map(|kind| (*kind as u32, Kernel::Surface(*kind)));
        let vertices = surfaces.chain([(PHASE_KIND, Kernel::Phase)]);
        let classes = vertices.map(|(kind, kernel)| (PacketClass::of_kind(kind).expect("a class"), kernel));
        for (class, kernel) in classes.chain([(PacketClass::STRAIGHT, Kernel::Straight)]) {
            assert_eq!(class.kernel(), kernel);
            for with_nee in [true, false] {
                let q = class.queue(with_nee);
                assert_eq!((q.class(), q.with_nee()), (class, with_nee));
                assert!(!core::mem::replace(&mut seen[q.index()], true));
            }
        }
        assert!(seen.iter().all(|s| *s) && Queue::all().map(Queue::index).eq(0..Queue::COUNT));
        assert_eq!(PacketClass::of_kind(PHASE_KIND + 1), None, "rays are no vertices");
    }
}
