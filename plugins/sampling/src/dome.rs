//! The paper's hemisphere (section 3): uniform directions above a raised centre.

use syntable_model::geometry::{Point3, Vector3};
use syntable_model::random::Stream;
use syntable_model::scene::Tabletop;

/// A point of the hemisphere shell around `centre`, at a distance drawn uniformly from `radius`.
///
/// With u, v uniform in [0, 1) the polar angle is acos(1 − v) and the azimuth 2πu, so that directions are uniform on
/// the hemisphere. `height` limits 1 − v = sin(elevation), so that part of the hemisphere can be chosen; the whole one
/// is (0, 1).
pub fn point(centre: Point3<f64>, radius: [f64; 2], height: [f64; 2], stream: &mut Stream) -> Point3<f64> {
    let distance = stream.uniform(radius[0], radius[1]);
    let azimuth = std::f64::consts::TAU * stream.unit();
    let z = height[1] - stream.unit() * (height[1] - height[0]);
    let r = (1.0 - z * z).max(0.0).sqrt();
    centre + distance * Vector3::new(r * azimuth.cos(), r * azimuth.sin(), z)
}

/// The hemisphere's centre: above the middle of the tabletop.
pub fn centre(tabletop: &Tabletop, offset_m: f64) -> Point3<f64> {
    tabletop.centre() + Vector3::z() * offset_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_testing::stats::kolmogorov_smirnov_p;

    #[test]
    fn directions_are_uniform_on_the_hemisphere() {
        let mut stream = Stream::root(3);
        let centre = Point3::new(0.1, 0.2, 0.9);
        let points: Vec<_> = (0..4000).map(|_| point(centre, [0.7, 1.4], [0.0, 1.0], &mut stream) - centre).collect();
        // Uniform directions have a uniform z (Archimedes), a uniform azimuth, and here a uniform distance.
        let mut z: Vec<f64> = points.iter().map(|p| p.z / p.norm()).collect();
        let mut azimuth: Vec<f64> = points.iter().map(|p| p.y.atan2(p.x) / std::f64::consts::TAU + 0.5).collect();
        let mut distance: Vec<f64> = points.iter().map(|p| (p.norm() - 0.7) / 0.7).collect();
        for samples in [&mut z, &mut azimuth, &mut distance] {
            assert!(kolmogorov_smirnov_p(samples, |x| x.clamp(0.0, 1.0)) > 0.01);
        }
    }
}
