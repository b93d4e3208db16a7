//! Bilinear texture look-up.
