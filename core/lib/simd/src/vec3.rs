//! Small `f32` vectors: points, directions and linear Rec. 709 colors.

use crate::Real;
use std::ops::{Add, Mul, Neg, Sub};

/// Three numbers: a point or direction in meters, or a linear Rec. 709 color. Laid out as `[T; 3]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Vec3<T = f32> {
    /// First component, or red.
    pub x: T,
    /// Second component, or green.
    pub y: T,
    /// Third component, or blue.
    pub z: T,
}

/// A linear Rec. 709 color: radiance in nits, or a reflectance.
pub type Rgb<T = f32> = Vec3<T>;

/// Shorthand for a [`Vec3`].
#[inline(always)]
pub const fn vec3<T: Copy>(x: T, y: T, z: T) -> Vec3<T> {
    Vec3 { x, y, z }
}

impl Vec3 {
    /// The null vector, or black.
    pub const ZERO: Self = vec3(0.0, 0.0, 0.0);
    /// Ones, or white.
    pub const ONE: Self = vec3(1.0, 1.0, 1.0);

    /// The components in order.
    #[inline(always)]
    pub const fn array(self) -> [f32; 3] {
        [self.x, self.y, self.z]
    }

    /// The vector with unit length, or `other` if it is too short to have a direction.
    #[inline(always)]
    pub fn normalized_or(self, other: Self) -> Self {
        let square = self.dot(self);
        if square > 1e-30 && square < f32::INFINITY { self * (1.0 / square.sqrt()) } else { other }
    }

    /// Whether all components are 0.
    #[inline(always)]
    pub fn is_black(self) -> bool {
        self.x == 0.0 && self.y == 0.0 && self.z == 0.0
    }
}

impl<T: Real> Vec3<T> {
    /// The same vector in every lane.
    #[inline(always)]
    pub fn broadcast(v: Vec3) -> Self {
        vec3(T::splat(v.x), T::splat(v.y), T::splat(v.z))
    }

    /// The same number in every component.
    #[inline(always)]
    pub fn all(v: T) -> Self {
        vec3(v, v, v)
    }

    /// `yes` in the lanes where the mask is true, `no` elsewhere.
    #[inline(always)]
    pub fn select(mask: T::Mask, yes: Self, no: Self) -> Self {
        vec3(T::select(mask, yes.x, no.x), T::select(mask, yes.y, no.y), T::select(mask, yes.z, no.z))
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, o: Self) -> T {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        vec3(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    /// Euclidean length.
    #[inline(always)]
    pub fn length(self) -> T {
        self.dot(self).sqrt()
    }

    /// The vector with unit length; it must not be zero.
    #[inline(always)]
    pub fn normalized(self) -> Self {
        self * (T::splat(1.0) / self.length())
    }

    /// Largest component.
    #[inline(always)]
    pub fn max_component(self) -> T {
        self.x.larger(self.y.larger(self.z))
    }

    /// Luminance of a linear Rec. 709 color.
    #[inline(always)]
    pub fn luminance(self) -> T {
        self.x * 0.2126_f32 + self.y * 0.7152_f32 + self.z * 0.0722_f32
    }

    /// Linear interpolation: `self` at `t = 0`, `to` at `t = 1`.
    #[inline(always)]
    pub fn lerp(self, to: Self, t: T) -> Self {
        self + (to - self) * t
    }

    /// Applies a function to every component.
    #[inline(always)]
    pub fn map(self, f: impl Fn(T) -> T) -> Self {
        vec3(f(self.x), f(self.y), f(self.z))
    }
}

impl From<[f32; 3]> for Vec3 {
    #[inline(always)]
    fn from([x, y, z]: [f32; 3]) -> Self {
        vec3(x, y, z)
    }
}

macro_rules! componentwise {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl<T: Real> $trait for Vec3<T> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                vec3(self.x $op o.x, self.y $op o.y, self.z $op o.z)
            }
        }
    )*};
}
componentwise!(Add add +, Sub sub -, Mul mul *);

impl<T: Real> Mul<T> for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: T) -> Self {
        vec3(self.x * s, self.y * s, self.z * s)
    }
}

impl<T: Real> Neg for Vec3<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

/// A right-handed orthonormal frame around a direction.
#[derive(Clone, Copy, Debug)]
pub struct Basis<T = f32> {
    /// First axis, world.
    pub x: Vec3<T>,
    /// Second axis, world.
    pub y: Vec3<T>,
    /// Third axis, world.
    pub z: Vec3<T>,
}

impl<T: Real> Basis<T> {
    /// The frame around a unit vector, without branches (Duff et al., JCGT 2017).
    #[inline(always)]
    pub fn around(z: Vec3<T>) -> Self {
        let sign = T::splat(1.0).copysign(z.z);
        let a = T::splat(-1.0) / (sign + z.z);
        let b = z.x * z.y * a;
        Self {
            x: vec3(sign * z.x * z.x * a + 1.0_f32, sign * b, -sign * z.x),
            y: vec3(b, sign + z.y * z.y * a, -z.y),
            z,
        }
    }

    /// Converts from the world to the frame.
    #[inline(always)]
    pub fn to_local(self, v: Vec3<T>) -> Vec3<T> {
        vec3(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    /// Converts from the frame to the world.
    #[inline(always)]
    pub fn to_world(self, v: Vec3<T>) -> Vec3<T> {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bases_are_orthonormal_and_right_handed() {
        for z in [vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, -1.0), vec3(0.6, -0.48, 0.64), vec3(-0.1, 0.2, -0.9).normalized()]
        {
            let b = Basis::around(z);
            assert!((b.x.cross(b.y) - z).length() < 1e-6 && b.x.dot(b.y).abs() < 1e-6, "{b:?}");
            assert!((b.to_world(b.to_local(vec3(1.0, 2.0, 3.0))) - vec3(1.0, 2.0, 3.0)).length() < 1e-5);
        }
    }
}
