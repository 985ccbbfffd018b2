//! Lights with a shape.

use super::harness::{Call, Function, Row, Tolerance::Within};
use syntable_prepare::{AreaLight, DiskLight, NO_WINDOW, RectLight, SphereLight};
use syntable_simd::{Basis, Vec3};
use syntable_transport::light::Shape;

/// A light: a sphere, a rectangle or a disk.
struct Placed {
    center: Vec3,
    axes: Basis,
    half: [f32; 2],
    radius: f32,
}

impl Placed {
    /// A point near the light: anywhere, on it, behind it, far away, or at its center.
    fn point(&self, row: &mut Row) -> Vec3 {
        let offset = row.offset(self.radius);
        row.given(self.center + offset)
    }

    /// A direction from a point that may hit the light.
    fn aim(&self, row: &mut Row, p: Vec3) {
        let [x, y] = [0, 1].map(|_| row.random(-1.2, 1.2));
        let target = self.center + self.axes.x * (x * self.half[0]) + self.axes.y * (y * self.half[1]);
        row.given((target - p).normalized_or(self.axes.z));
    }
}

fn light(row: &mut Row) -> Placed {
    row.below(3);
    let center = row.vector(2.0);
    let axes = Basis::around(row.axis());
    row.given(axes.x);
    row.given(axes.y);
    row.given(axes.z);
    let half = [row.within(0.02, 2.0, &[0.5, 0.1]), row.within(0.02, 2.0, &[0.5, 0.1])];
    let radius = row.within(0.02, 2.0, &[0.5, 0.1]);
    row.positive(4.0);
    Placed { center, axes, half, radius }
}

fn area_light(x: &mut Call) -> AreaLight {
    let sort = x.u();
    let [center, x_axis, y_axis, normal] = [0; 4].map(|_| x.v3());
    let (half, radius, luminance) = (x.v2(), x.f(), x.f());
    let radiance = Vec3::ONE;
    match sort {
        0 => AreaLight::Sphere(SphereLight { center, radius, radiance, luminance }),
        1 => {
            let (x, y, window) = (x_axis, y_axis, NO_WINDOW);
            AreaLight::Rect(RectLight { center, x, y, normal, half, radiance, luminance, window })
        }
        _ => AreaLight::Disk(DiskLight { center, normal, radius, radiance, luminance }),
    }
}

pub fn functions() -> Vec<Function> {
    vec![
        Function::new(
            "shape_intersect",
            Within(1e-5, 2e-6),
            |row| {
                let light = light(row);
                let p = light.point(row);
                light.aim(row, p);
            },
            "put(shape_intersect(shape(), v3(), v3()));",
            |x| Shape(&area_light(x)).intersect(x.v3(), x.v3()),
        )
        .covers(&["rect_local"]),
        Function::new(
            "shape_sample",
            Within(1e-5, 1e-5),
            |row| {
                light(row).point(row);
                row.unit();
                row.unit();
            },
            "let s = shape_sample(shape(), v3(), v2()); put_b(s.valid);
             put3(select(vec3(0.0), s.direction, s.valid));
             put(select(0.0, s.distance, s.valid)); put(select(0.0, s.pdf, s.valid));",
            |x| {
                let s = Shape(&area_light(x)).sample(x.v3(), x.v2());
                let there = |y: f32| if s.valid { y } else { 0.0 };
                (s.valid, s.direction.map(there), [there(s.distance), there(s.pdf)])
            },
        )
        .covers(&["sphere_cone", "rect_spherical", "spherical_point"]),
        Function::new(
            "shape_pdf",
            Within(1e-5, 0.0),
            |row| {
                light(row).point(row);
                row.positive(2.0);
            },
            "put(shape_pdf(shape(), v3(), f()));",
            |x| Shape(&area_light(x)).pdf(x.v3(), x.f()),
        )
        .covers(&["rect_is_far", "rect_area"]),
        Function::new(
            "shape_importance",
            Within(1e-5, 0.0),
            |row| {
                light(row).point(row);
                row.direction();
            },
            "put(shape_importance(shape(), v3(), v3()));",
            |x| Shape(&area_light(x)).importance(x.v3(), x.v3()),
        ),
    ]
}
