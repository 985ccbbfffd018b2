//! Moments of mass and volume.

use crate::geometry::Vector3;
use nalgebra::{Matrix3, SymmetricEigen};

/// Moments of a distribution of mass or volume: its integral, and the integrals of the position and of its outer
/// product.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// ∫ dm: kg, or m³ at a density of one.
    pub total: f64,
    /// ∫ p dm.
    pub first: Vector3<f64>,
    /// ∫ p pᵀ dm.
    pub second: Matrix3<f64>,
}

impl Moments {
    /// The moments of an empty distribution.
    pub const ZERO: Self = Self {
        total: 0.0,
        first: Vector3::new(0.0, 0.0, 0.0),
        second: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// The moments of the tetrahedron of the coordinates' origin and a triangle, at a density of one; negative if the
    /// origin is in front of the triangle. Their sum over a closed surface gives the moments of its inside.
    pub fn tetrahedron([a, b, c]: [Vector3<f64>; 3]) -> Self {
        let (volume, sum) = (a.dot(&b.cross(&c)) / 6.0, a + b + c);
        let squares = a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose();
        Self { total: volume, first: sum * (volume / 4.0), second: squares * (volume / 20.0) }
    }

    /// The moments of a triangle at one unit per area.
    pub fn triangle([a, b, c]: [Vector3<f64>; 3]) -> Self {
        let (area, sum) = ((b - a).cross(&(c - a)).norm() / 2.0, a + b + c);
        let squares = a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose();
        Self { total: area, first: sum * (area / 3.0), second: squares * (area / 12.0) }
    }

    /// The moments at a density multiplied by a factor.
    pub fn scaled(self, factor: f64) -> Self {
        Self { total: self.total * factor, first: self.first * factor, second: self.second * factor }
    }

    /// Center of mass, and ∫ (p − center)(p − center)ᵀ dm per unit of mass. None if no rigid body has such moments.
    pub(super) fn central(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let center = self.first / self.total;
        let spread = self.second / self.total - center * center.transpose();
        let is_finite = spread.iter().chain(center.iter()).all(|x| x.is_finite());
        let is_body = is_finite && {
            let moments = SymmetricEigen::new(spread).eigenvalues;
            moments.min() >= -1e-9 * moments.max() && moments.max() > 0.0
        };
        is_body.then_some((center, spread))
    }
}

impl std::ops::AddAssign for Moments {
    fn add_assign(&mut self, other: Self) {
        self.total += other.total;
        self.first += other.first;
        self.second += other.second;
    }
}
