//! Stage `settle`: vertices with samples wait in the ring, the other paths end.

use super::book::Bookkeeping;
use super::class::PacketClass;
use super::ring::Ring;
use super::roulette::Decision8;
use super::shading::Arrival8;
use crate::world::World;

/// Stores the arrived vertices that go on by decision `d`; closes the others.
#[inline(always)]
pub(crate) fn settle<W: World>(book: &mut Bookkeeping<'_>, ring: &mut Ring<'_>, a: &Arrival8, d: &Decision8) {
    let records = a.vertex.records();
    let path = &a.vertex.path;
    let (root, record, depth) = (path.root.to_array(), path.record.to_array(), path.depth.to_array());
    for i in a.active.lanes() {
        let Some(class) = PacketClass::of_kind(a.kind[i]).filter(|_| d.n[i] > 0) else {
            book.counters.paths_terminated += 1;
            book.close::<W>(root[i], record[i], depth[i]);
            continue;
        };
        let extra = d.n[i] - 1;
        book.counters.splits += u64::from(extra);
        book.counters.light_samples_skipped += u64::from(d.n[i] - d.with_nee[i]);
        let Some(r) = book.roots.find(root[i]) else { continue };
        r.splits = r.splits.saturating_add(extra);
        // the lane's share of `open` passes to the waiting vertex
        ring.push(class, records[i]);
    }
}
