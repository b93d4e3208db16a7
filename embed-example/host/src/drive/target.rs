//! When a render ends. What is left until then, by its progress, is in `observe.rs`.

/// Stop condition of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// Samples per pixel, >= 1.
    Spp(u32),
    /// Seconds of rendering, > 0, on the wall or by [`Observer::seconds`](super::Observer::seconds). No iteration begins
    /// that would pass them at the speed so far; one that has begun is finished, and the first one, a sample per pixel,
    /// is rendered in any case. The image then depends on the machine.
    Seconds(f64),
    /// Rays of all kinds, >= 1. As with seconds, no iteration begins that would pass them at the cost so far.
    Rays(u64),
    /// Estimated relMSE of the whole image, > 0, checked after every iteration from 4 samples per pixel on.
    Error(f64),
}
