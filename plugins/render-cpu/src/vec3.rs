//! Small `f32` vectors: points, directions and linear Rec. 709 colours.

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub};

/// Three numbers: a point or direction in metres, or a linear Rec. 709 colour.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Vec3 {
    pub x: f32,
    pub y: f32,
    pub z: f32,
}

/// A linear Rec. 709 colour: radiance in nits, or a reflectance.
pub(crate) type Rgb = Vec3;

/// Shorthand for a [`Vec3`].
#[inline(always)]
pub(crate) const fn vec3(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3 { x, y, z }
}

impl Vec3 {
    pub const ZERO: Self = vec3(0.0, 0.0, 0.0);
    pub const ONE: Self = vec3(1.0, 1.0, 1.0);

    #[inline(always)]
    pub const fn splat(v: f32) -> Self {
        vec3(v, v, v)
    }

    #[inline(always)]
    pub fn dot(self, o: Self) -> f32 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    #[inline(always)]
    pub fn cross(self, o: Self) -> Self {
        vec3(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    #[inline(always)]
    pub fn length(self) -> f32 {
        self.dot(self).sqrt()
    }

    /// Unit length; the vector must not be zero.
    #[inline(always)]
    pub fn normalized(self) -> Self {
        self * (1.0 / self.length())
    }

    /// Unit length, or `other` if the vector is too short to have a direction.
    #[inline(always)]
    pub fn normalized_or(self, other: Self) -> Self {
        let square = self.dot(self);
        if square > 1e-30 && square < f32::INFINITY { self * (1.0 / square.sqrt()) } else { other }
    }

    #[inline(always)]
    pub fn max_component(self) -> f32 {
        max(self.x, max(self.y, self.z))
    }

    #[inline(always)]
    pub fn is_black(self) -> bool {
        self.x == 0.0 && self.y == 0.0 && self.z == 0.0
    }

    /// Luminance of a linear Rec. 709 colour.
    #[inline(always)]
    pub fn luminance(self) -> f32 {
        0.2126 * self.x + 0.7152 * self.y + 0.0722 * self.z
    }

    #[inline(always)]
    pub fn lerp(self, to: Self, t: f32) -> Self {
        self + (to - self) * t
    }

    #[inline(always)]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        vec3(f(self.x), f(self.y), f(self.z))
    }

    #[inline(always)]
    pub const fn array(self) -> [f32; 3] {
        [self.x, self.y, self.z]
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
        impl $trait for Vec3 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, o: Self) -> Self {
                vec3(self.x $op o.x, self.y $op o.y, self.z $op o.z)
            }
        }
    )*};
}
componentwise!(Add add +, Sub sub -, Mul mul *, Div div /);

impl Mul<f32> for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn mul(self, s: f32) -> Self {
        vec3(self.x * s, self.y * s, self.z * s)
    }
}

impl Neg for Vec3 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        vec3(-self.x, -self.y, -self.z)
    }
}

impl AddAssign for Vec3 {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl MulAssign for Vec3 {
    #[inline(always)]
    fn mul_assign(&mut self, o: Self) {
        *self = *self * o;
    }
}

impl MulAssign<f32> for Vec3 {
    #[inline(always)]
    fn mul_assign(&mut self, s: f32) {
        *self = *self * s;
    }
}

/// The larger number; the second if one is NaN. One instruction, unlike `f32::max`.
#[inline(always)]
pub(crate) fn max(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// The smaller number; the second if one is NaN.
#[inline(always)]
pub(crate) fn min(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// A right-handed orthonormal frame around a direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Basis {
    pub x: Vec3,
    pub y: Vec3,
    pub z: Vec3,
}

impl Basis {
    /// Around a unit vector, without branches (Duff et al., JCGT 2017).
    #[inline(always)]
    pub fn around(z: Vec3) -> Self {
        let sign = 1.0_f32.copysign(z.z);
        let a = -1.0 / (sign + z.z);
        let b = z.x * z.y * a;
        Self { x: vec3(1.0 + sign * z.x * z.x * a, sign * b, -sign * z.x), y: vec3(b, sign + z.y * z.y * a, -z.y), z }
    }

    #[inline(always)]
    pub fn to_local(self, v: Vec3) -> Vec3 {
        vec3(v.dot(self.x), v.dot(self.y), v.dot(self.z))
    }

    #[inline(always)]
    pub fn to_world(self, v: Vec3) -> Vec3 {
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
