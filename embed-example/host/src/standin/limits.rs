//! Stand-in for the limits in `croupier::scene::blob`.
pub const MAX_COORDINATE: f32 = 1e9;
pub const MAX_EMISSION: f32 = 1e18;
pub const MAX_SIDE: u32 = 1 << 16;
pub const ALPHA_RANGE: [f32; 2] = [1e-4, 1.0];
pub const ETA_RANGE: [f32; 2] = [0.01, 100.0];
pub const MAX_CONDUCTOR: f32 = 1e4;
