//! A sensor that wants to be served every few hundred rays, as a stand-in for whatever else a device has to do.

/// Counts how often and how late it is served.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sensor {
    /// Number of services.
    pub ticks: u64,
    /// Most rays between two of them.
    pub most_rays: u64,
    /// Most time between two of them, in the unit of the clock.
    pub most_time: u32,
    rays: u64,
    time: Option<u32>,
}

impl Sensor {
    /// Serves the sensor at the time `time` of a clock of 24 bits, after `rays` rays in all.
    pub fn serve(&mut self, rays: u64, time: u32) {
        self.ticks += 1;
        self.most_rays = self.most_rays.max(rays.wrapping_sub(self.rays));
        if let Some(before) = self.time {
            self.most_time = self.most_time.max(time.wrapping_sub(before) & 0x00ff_ffff);
        }
        (self.rays, self.time) = (rays, Some(time));
    }

    /// How it was served, by name: the same numbers on every machine.
    pub fn report(&self) -> [(&'static str, u64); 2] {
        [("ticks", self.ticks), ("rays_between_ticks", self.most_rays)]
    }
}
