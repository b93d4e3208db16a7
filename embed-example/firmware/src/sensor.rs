//! A sensor that wants to be served every few hundred rays, as a stand-in for whatever else a device has to do.

/// Counts how often and how late it is served.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensor {
    /// Number of services.
    pub ticks: u64,
    /// Most rays between two of them.
    pub most_rays: u64,
    /// Most time between two of them in the unit of the clock: while rays are traced, and at the end of an iteration.
    pub most_time: [u64; 2],
    /// Time between the first and the last.
    pub time: u64,
    rays: u64,
    last: Option<u32>,
}

impl Sensor {
    /// Serves the sensor at the time `time` of a clock of 24 bits, after `rays` rays in all.
    pub fn serve(&mut self, rays: u64, time: u32) {
        let rays_between = rays.wrapping_sub(self.rays);
        self.ticks += 1;
        self.most_rays = self.most_rays.max(rays_between);
        if let Some(last) = self.last {
            let between = u64::from(time.wrapping_sub(last) & 0x00ff_ffff);
            let [tracing, ending] = &mut self.most_time;
            let most = if rays_between > 0 { tracing } else { ending };
            *most = between.max(*most);
            self.time += between;
        }
        (self.rays, self.last) = (rays, Some(time));
    }

    /// How it was served, by name: the same numbers on every machine.
    pub fn report(&self) -> [(&'static str, u64); 2] {
        [("ticks", self.ticks), ("rays_between_ticks", self.most_rays)]
    }
}
