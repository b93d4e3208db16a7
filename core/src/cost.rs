//! Counted cost of rays, relative to a scattered ray. Costs are counted, never measured: the picture must not depend on
//! a clock.

/// Relative cost of a camera ray.
pub const COST_CAMERA: f32 = 1.0;
/// Relative cost of a scattered ray and the shading around it.
pub const COST_BOUNCE: f32 = 1.0;
/// Relative cost of a shadow ray: it ends at the first hit, and no vertex waits behind it.
pub const COST_SHADOW: f32 = 0.5;
/// Relative cost of a ray that goes on straight.
pub const COST_STRAIGHT: f32 = 1.0;
/// Steps through media (tentative collisions, bricks of density grids) that cost as much as a scattered ray.
pub const MEDIUM_STEPS_PER_RAY: u64 = 16;
