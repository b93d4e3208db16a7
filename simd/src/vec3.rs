//! Three-component vectors and orthonormal frames, eight at a time. Colours are `Vec3x8` as well.

use crate::{F32x8, Mask8};
use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub};

/// Eight 3-vectors (or RGB colours), one component per field.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Vec3x8 {
    /// First component, red.
    pub x: F32x8,
    /// Second component, green.
    pub y: F32x8,
    /// Third component, blue.
    pub z: F32x8,
}

/// Weights of red, green and blue in luminance: the Y row of the matrix from linear Rec. 709 (D65) to CIE XYZ.
pub const LUMINANCE: [f64; 3] = [0.212_671, 0.715_16, 0.072_169];

impl Vec3x8 {
    /// Zero vectors.
    pub const ZERO: Self = Self::splat(0.0, 0.0, 0.0);
    /// Vectors with all components 1.
    pub const ONE: Self = Self::splat(1.0, 1.0, 1.0);

    /// Vectors of these components.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn new(x: F32x8, y: F32x8, z: F32x8) -> Self {
        Self { x, y, z }
    }

    /// One vector in all lanes.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn splat(x: f32, y: f32, z: f32) -> Self {
        Self { x: F32x8::splat(x), y: F32x8::splat(y), z: F32x8::splat(z) }
    }

    /// Vectors with one value in all three components.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub const fn grey(x: F32x8) -> Self {
        Self { x, y: x, z: x }
    }

    /// Lane `i` = `f(i)`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn from_fn(mut f: impl FnMut(usize) -> [f32; 3]) -> Self {
        let a = [f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)];
        Self::new(F32x8::from_fn(|i| a[i][0]), F32x8::from_fn(|i| a[i][1]), F32x8::from_fn(|i| a[i][2]))
    }

    /// Lane `i & 7` as an array.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn lane(self, i: usize) -> [f32; 3] {
        [self.x.lane(i), self.y.lane(i), self.z.lane(i)]
    }

    /// Applies `f` to each component.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn map(self, f: impl Fn(F32x8) -> F32x8) -> Self {
        Self::new(f(self.x), f(self.y), f(self.z))
    }

    /// Dot product, summed x, y, z in this order.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn dot(self, o: Self) -> F32x8 {
        self.z.mul_add(o.z, self.y.mul_add(o.y, self.x * o.x))
    }

    /// Cross product, each component the difference of two separately rounded products.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn cross(self, o: Self) -> Self {
        Self::new(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    /// Squared length.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn length_sqr(self) -> F32x8 {
        self.dot(self)
    }

    /// Length.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn length(self) -> F32x8 {
        self.length_sqr().sqrt()
    }

    /// Unit vector of the same direction; scales first, so that no finite non-zero vector under- or overflows
    /// (NUMERICS FRM-4). The zero vector gives NaN.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn normalize(self) -> Self {
        let v = self / self.abs().max_component();
        v / v.length()
    }

    /// Unit vector, `self / |self|`, for vectors whose squared length neither under- nor overflows (1e-18 < |v| <
    /// 1e18).
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn normalize_fast(self) -> Self {
        self * (F32x8::ONE / self.length())
    }

    /// Component-wise absolute value.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn abs(self) -> Self {
        self.map(F32x8::abs)
    }

    /// Largest component.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn max_component(self) -> F32x8 {
        self.x.max(self.y).max(self.z)
    }

    /// Mean of the components.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn mean(self) -> F32x8 {
        (self.x + self.y + self.z) * (1.0 / 3.0)
    }

    /// Luminance of linear Rec. 709 colours, by [`LUMINANCE`].
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn luminance(self) -> F32x8 {
        const WEIGHTS: [f32; 3] = [LUMINANCE[0] as f32, LUMINANCE[1] as f32, LUMINANCE[2] as f32];
        self.x * WEIGHTS[0] + self.y * WEIGHTS[1] + self.z * WEIGHTS[2]
    }

    /// Are all components finite?
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn is_finite(self) -> Mask8 {
        self.x.is_finite() & self.y.is_finite() & self.z.is_finite()
    }

    /// Is any component above 0?
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn any_positive(self) -> Mask8 {
        self.max_component().gt(F32x8::ZERO)
    }

    /// `a` where `mask`, else `b`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn select(mask: Mask8, a: Self, b: Self) -> Self {
        Self::new(mask.select(a.x, b.x), mask.select(a.y, b.y), mask.select(a.z, b.z))
    }

    /// `self` where `mask`, else 0.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn zero_unless(self, mask: Mask8) -> Self {
        self.map(|c| mask.zero_unless(c))
    }
}

macro_rules! ops {
    ($($tr:ident $f:ident $op:tt),*) => {$(
        impl $tr for Vec3x8 {
            type Output = Self;
            #[cfg_attr(feature = "compact", inline(never))]
            #[cfg_attr(not(feature = "compact"), inline(always))]
            fn $f(self, o: Self) -> Self {
                Self::new(self.x $op o.x, self.y $op o.y, self.z $op o.z)
            }
        }
    )*};
}
ops!(Add add +, Sub sub -, Mul mul *);

impl Mul<F32x8> for Vec3x8 {
    type Output = Self;
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn mul(self, s: F32x8) -> Self {
        self.map(|c| c * s)
    }
}

impl Mul<f32> for Vec3x8 {
    type Output = Self;
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn mul(self, s: f32) -> Self {
        self.map(|c| c * s)
    }
}

impl Div<F32x8> for Vec3x8 {
    type Output = Self;
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn div(self, s: F32x8) -> Self {
        self.map(|c| c / s)
    }
}

impl Neg for Vec3x8 {
    type Output = Self;
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn neg(self) -> Self {
        self.map(|c| -c)
    }
}

impl AddAssign for Vec3x8 {
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl MulAssign for Vec3x8 {
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}

/// Eight right-handed orthonormal frames; `n` is the local +z axis.
#[derive(Clone, Copy, Debug, Default)]
pub struct Frame8 {
    /// Local x axis in world space.
    pub s: Vec3x8,
    /// Local y axis in world space.
    pub t: Vec3x8,
    /// Local z axis in world space.
    pub n: Vec3x8,
}

impl Frame8 {
    /// Frame around the unit vector `n` (Duff et al., JCGT 6(1) 2017): orthonormal within 3e-7 for every unit `n`.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn from_normal(n: Vec3x8) -> Self {
        let sign = F32x8::ONE.copysign(n.z);
        let a = -F32x8::ONE / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3x8::new(F32x8::ONE + sign * n.x * n.x * a, sign * b, -(sign * n.x)),
            t: Vec3x8::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// World to local.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn to_local(&self, v: Vec3x8) -> Vec3x8 {
        Vec3x8::new(v.dot(self.s), v.dot(self.t), v.dot(self.n))
    }

    /// Local to world.
    #[cfg_attr(feature = "compact", inline(never))]
    #[cfg_attr(not(feature = "compact"), inline(always))]
    pub fn to_world(&self, v: Vec3x8) -> Vec3x8 {
        self.s * v.x + self.t * v.y + self.n * v.z
    }
}
