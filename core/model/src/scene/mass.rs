//! Mass of a rigid body, and how it is distributed.

use super::{Mesh, Moments, Topology};
use crate::geometry::{Point3, Vector3};
use nalgebra::Matrix3;
use serde::Serialize;

/// Where a mass comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MassOrigin {
    /// Stated for the object: by its source, by a table, or by its pool.
    Known,
    /// Volume times the density of a typical household object.
    Estimated,
    /// Given by the settler to all bodies alike.
    Assigned,
}

/// The region over which the mass is spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MassDistribution {
    /// The volume that the closed mesh encloses, at one density.
    Volume,
    /// The volume of the mesh with its holes closed, at one density.
    ClosedVolume,
    /// Closed parts of the mesh, each with its own density.
    Parts,
    /// The faces, at one mass per area: the mesh encloses no volume in a consistent way.
    Surface,
}

/// Mass, center of mass and inertia of a rigid object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassProperties {
    /// Mass, kg.
    pub kg: f64,
    /// Center of mass, body frame, meters.
    pub center: Point3<f64>,
    /// Inertia tensor per kilogram about the center of mass, along the axes of the body frame, m².
    pub specific_inertia: Matrix3<f64>,
    /// Where the mass comes from.
    pub origin: MassOrigin,
    /// The region over which the mass is spread.
    pub distribution: MassDistribution,
}

impl MassProperties {
    /// Mass properties of an object of one material, from its mesh: of the enclosed volume, with holes closed, or else
    /// of the surface. [`Self::distribution`] names the one that was used.
    pub fn of_mesh(mesh: &Mesh, kg: f64, origin: MassOrigin) -> Self {
        Self::of_topology(mesh, &Topology::of(mesh), kg, origin)
    }

    /// The same if the topology is known already.
    pub fn of_topology(mesh: &Mesh, topology: &Topology, kg: f64, origin: MassOrigin) -> Self {
        let bounds = mesh.bounds();
        let middle = bounds.center();
        let half = bounds.size() / 2.0;
        let is_inside = |center: &Vector3<f64>| (0..3).all(|axis| center[axis].abs() <= half[axis] * (1.0 + 1e-9));
        // Closed parts that overlap can enclose more than their box. The overlap then counts twice.
        let is_solid = topology.is_closed() && topology.is_oriented() || topology.enclosed_volume().is_some();
        let solid = if is_solid { topology.moments.central() } else { None };
        let (central, distribution) = match solid.filter(|(center, _)| is_inside(center)) {
            Some(central) if topology.is_closed() && topology.is_oriented() => {
                (Some(central), MassDistribution::Volume)
            }
            Some(central) => (Some(central), MassDistribution::ClosedVolume),
            None => {
                let mut surface = Moments::ZERO;
                for triangle in 0..mesh.data().triangles.len() {
                    surface += Moments::triangle(mesh.corners(triangle).map(|p| p - middle));
                }
                (surface.central(), MassDistribution::Surface)
            }
        };
        // A mesh whose area is lost in rounding is a point.
        let (center, spread) = central.unwrap_or((Vector3::zeros(), Matrix3::identity() * (half.norm_squared() / 9.0)));
        Self { kg, center: middle + center, specific_inertia: inertia(&spread), origin, distribution }
    }

    /// Mass properties of closed parts with densities in kg/m³, from the sum of their moments. None if no rigid body
    /// has such moments.
    pub fn of_moments(moments: &Moments, origin: MassOrigin, distribution: MassDistribution) -> Option<Self> {
        let (center, spread) = moments.central()?;
        let (kg, center) = (moments.total, center.into());
        Some(Self { kg, center, specific_inertia: inertia(&spread), origin, distribution })
    }

    /// The same distribution of another mass, kg.
    pub fn with_kg(self, kg: f64, origin: MassOrigin) -> Self {
        Self { kg, origin, ..self }
    }

    /// The same material moved and scaled: `p ↦ (p + offset) · factor`. The mass grows with the cube of the factor.
    pub fn transformed(self, offset: Vector3<f64>, factor: f64) -> Self {
        Self {
            kg: self.kg * factor.powi(3),
            center: (self.center.coords + offset).scale(factor).into(),
            specific_inertia: self.specific_inertia * factor.powi(2),
            ..self
        }
    }

    /// Inertia tensor about the center of mass along the axes of the body frame, kg m².
    pub fn inertia(&self) -> Matrix3<f64> {
        self.specific_inertia * self.kg
    }

    /// Whether a body can have these properties: all finite and the mass above zero.
    pub fn is_sound(&self) -> bool {
        self.kg > 0.0
            && self.kg.is_finite()
            && self.center.iter().chain(self.specific_inertia.iter()).all(|x| x.is_finite())
    }
}

/// The inertia tensor of a spread of mass.
fn inertia(spread: &Matrix3<f64>) -> Matrix3<f64> {
    Matrix3::identity() * spread.trace() - spread
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::MeshData;
    use std::f64::consts::{PI, TAU};

    /// A closed profile (radius, height), counterclockwise seen with the axis to the left, revolved around z.
    fn revolved(profile: &[[f64; 2]], columns: u32) -> MeshData {
        let mut data = MeshData::default();
        let rows = profile.len() as u32;
        for [r, z] in profile {
            for column in 0..columns {
                let (sin, cos) = (TAU * f64::from(column) / f64::from(columns)).sin_cos();
                data.positions.push([r * cos, r * sin, *z].map(|x| x as f32));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let at = |r: u32, c: u32| r % rows * columns + c % columns;
                let [a, b, c, d] = [at(row, column), at(row, column + 1), at(row + 1, column + 1), at(row + 1, column)];
                data.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        data
    }

    fn cuboid(center: [f32; 3], size: [f32; 3]) -> MeshData {
        let positions = (0..8)
            .map(|i| std::array::from_fn(|k| center[k] + size[k] * if i >> k & 1 == 0 { -0.5 } else { 0.5 }))
            .collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        MeshData { positions, triangles, ..MeshData::default() }
    }

    fn of(data: MeshData, kg: f64) -> MassProperties {
        MassProperties::of_mesh(&Mesh::new(data).expect("sound"), kg, MassOrigin::Known)
    }

    fn assert_is(found: &MassProperties, center: [f64; 3], diagonal: [f64; 3], tolerance: f64) {
        let size = diagonal.iter().sum::<f64>();
        assert!((found.center - Point3::from(center)).norm() < tolerance, "{found:?}, not {center:?}");
        let wanted = Matrix3::from_diagonal(&Vector3::from(diagonal));
        assert!((found.inertia() - wanted).norm() < tolerance * size, "{found:?}, not {diagonal:?}");
    }

    #[test]
    fn a_box_and_a_cylinder_have_their_closed_forms() {
        let found = of(cuboid([0.3, -0.2, 1.0], [0.1, 0.2, 0.4]), 3.0);
        assert_eq!(found.distribution, MassDistribution::Volume);
        // m/12 (b² + c²)
        assert_is(&found, [0.3, -0.2, 1.0], [0.25 * 0.2, 0.25 * 0.17, 0.25 * 0.05], 1e-6);
        let (r, h) = (0.04, 0.1);
        let found = of(revolved(&[[0.0, 0.0], [r, 0.0], [r, h], [0.0, h]], 400), 0.5);
        let across = 0.5 * (3.0 * r * r + h * h) / 12.0;
        assert_is(&found, [0.0, 0.0, h / 2.0], [across, across, 0.5 * r * r / 2.0], 1e-4);
    }

    #[test]
    fn a_mug_is_hollow() {
        // A cylinder of 4 by 10 cm with a cavity of 3.7 cm that ends 5 mm above the bottom.
        let (r, h, inner, floor) = (0.04, 0.1, 0.037, 0.005);
        let profile = [[0.0, 0.0], [r, 0.0], [r, h], [inner, h], [inner, floor], [0.0, floor]];
        let found = of(revolved(&profile, 400), 0.3);
        let (full, cavity) = (PI * r * r * h, PI * inner * inner * (h - floor));
        let volume = full - cavity;
        let z = (full * h / 2.0 - cavity * (h + floor) / 2.0) / volume;
        let density = 0.3 / volume;
        // Difference of two cylinders, each moved to the common center.
        let across = |v: f64, r: f64, height: f64, middle: f64| {
            density * v * ((3.0 * r * r + height * height) / 12.0 + (middle - z).powi(2))
        };
        let tilt = across(full, r, h, h / 2.0) - across(cavity, inner, h - floor, (h + floor) / 2.0);
        let spin = density * (full * r * r - cavity * inner * inner) / 2.0;
        assert_is(&found, [0.0, 0.0, z], [tilt, tilt, spin], 1e-4);
        assert!(z < 0.045, "the bottom pulls it down: {z}");
    }

    #[test]
    fn holes_are_closed_and_what_encloses_nothing_is_a_surface() {
        let mut open = cuboid([0.0, 0.0, 0.2], [0.2, 0.2, 0.4]);
        open.triangles.drain(2..4);
        let found = of(open, 1.0);
        assert_eq!(found.distribution, MassDistribution::ClosedVolume);
        assert_is(&found, [0.0, 0.0, 0.2], [0.2 / 12.0, 0.2 / 12.0, 0.08 / 12.0], 1e-6);
        // A sheet of 0.2 m by 0.4 m.
        let mut sheet = cuboid([0.0; 3], [0.2, 0.4, 0.0]);
        sheet.triangles.truncate(2);
        let found = of(sheet, 1.0);
        assert_eq!(found.distribution, MassDistribution::Surface);
        assert_is(&found, [0.0; 3], [0.16 / 12.0, 0.04 / 12.0, 0.2 / 12.0], 1e-6);
        // Faces that look either way enclose nothing.
        let mut mixed = cuboid([0.0; 3], [0.2, 0.2, 0.2]);
        (0..6).for_each(|face| mixed.triangles[2 * face].swap(1, 2));
        let found = of(mixed, 1.0);
        assert!(found.is_sound() && found.center.coords.norm() < 0.1, "{found:?}");
    }

    #[test]
    fn scaled_material_keeps_its_density() {
        let small = of(cuboid([0.1, 0.0, 0.0], [0.1, 0.2, 0.4]), 1.0);
        let offset = Vector3::new(0.0, 0.3, 0.0);
        let scaled = small.transformed(offset, 2.0);
        let wanted = of(cuboid([0.2, 0.6, 0.0], [0.2, 0.4, 0.8]), 8.0);
        assert!((scaled.kg - 8.0).abs() < 1e-12 && (scaled.center - wanted.center).norm() < 1e-6);
        assert!((scaled.inertia() - wanted.inertia()).norm() < 1e-5);
    }
}
