//! Stage `trace`: closest hits, and what each ray finds.

use super::flight::RayState8;
use super::shard::Shard;
use crate::accel::{Hit8, Intersector};
use crate::cost::COST_BOUNCE;
use crate::light::LightSelector;
use crate::profile::Profile;
use crate::session::Session;

impl Shard<'_> {
    /// Traces a flight and hands it on: escaped lanes meet the environment, the others a surface and roulette.
    pub(super) fn advance<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        f: &RayState8,
    ) {
        if f.active.none() {
            return;
        }
        let hit = self.trace(session, f);
        let escaped = f.active.and_not(hit.hit);
        if escaped.any() {
            self.escape(session, f, escaped);
        }
        if hit.hit.any() {
            self.arrive(session, f, &hit);
        }
    }

    fn trace<P: Profile, I: Intersector, L: LightSelector>(
        &mut self,
        session: &Session<'_, '_, P, I, L>,
        f: &RayState8,
    ) -> Hit8 {
        let n = f.active.count();
        self.counters.trace.count(n);
        if f.depth.lane(f.active.lanes().next().unwrap_or(0)) > 1 {
            self.counters.scatter_rays += u64::from(n);
        }
        self.charge(f.active, f.root, f.ledger, COST_BOUNCE);
        let mut hit = session.intersector().closest(&f.ray, f.active);
        hit.hit &= f.active;
        hit
    }
}
