//! Rays through pixels.
