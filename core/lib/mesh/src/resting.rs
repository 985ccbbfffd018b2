//! How an object rests on a plane: its convex hull and its stable poses.

use syntable_convex::{ConvexHull, HULL_VERSION, HullOptions, STABLE_VERSION, StablePose, stable_poses};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::scene::Object;

/// Accuracy of the hulls that poses are computed from. Their facets decide on what a body rests, so they keep more detail than
/// collision shapes.
const HULL: HullOptions = HullOptions { tolerance: 0.0001, max_vertices: 512, ..HullOptions::METERS };

/// Cosine of the angle between poses beside each other, 15°: facets of one curved side.
const BESIDE_COS: f64 = 0.966;

/// An object that tips over at a smaller angle does not stand, radians.
const MIN_TIPPING: f64 = 3.0 * std::f64::consts::PI / 180.0;

/// The convex hull of an object, and the poses in which it rests.
#[derive(Debug, PartialEq)]
pub struct RestingShape {
    /// Corners of its convex hull, body frame, meters.
    pub corners: Vec<[f32; 3]>,
    /// Its stable poses, most probable first. Empty only without a hull that has a volume.
    pub poses: Vec<StablePose>,
}

impl RestingShape {
    /// The key of an object's shape in caches.
    pub fn key(object: &Object) -> Digest {
        Hasher::new("resting shape")
            .digest(object.digest)
            .number(f64::from(HULL_VERSION))
            .number(f64::from(STABLE_VERSION))
            .number(f64::from(HULL.tolerance))
            .number(HULL.max_vertices as f64)
            .finish()
    }

    /// The shape of an object at its center of mass.
    pub fn of(object: &Object) -> Self {
        let hull = ConvexHull::new(&object.mesh.data().positions, &HULL);
        let poses = hull.as_ref().map_or_else(Vec::new, |hull| stable_poses(hull, object.mass.center.into()));
        Self { corners: hull.map_or_else(Vec::new, |hull| hull.points), poses }
    }

    /// Direction, body frame, that points up when the object stands: in the stable pose that is nearest to +z, or in a more probable one
    /// beside it. None without a stable pose.
    pub fn upright(&self) -> Option<[f64; 3]> {
        // Of poses that are equally near, `max_by` gives the last one, so the more probable ones come last.
        let nearest = |min: f64| {
            let poses = self.poses.iter().rev().filter(|pose| pose.tipping >= min);
            poses.max_by(|a, b| a.up[2].total_cmp(&b.up[2]))
        };
        let nearest = nearest(MIN_TIPPING).or_else(|| nearest(f64::NEG_INFINITY))?;
        let cosine = |pose: &StablePose| (0..3).map(|axis| pose.up[axis] * nearest.up[axis]).sum::<f64>();
        let beside = |pose: &&StablePose| pose.tipping >= nearest.tipping.min(MIN_TIPPING) && cosine(pose) > BESIDE_COS;
        self.poses.iter().find(beside).map(|pose| pose.up)
    }

    /// The stable pose at a point in [0, 1) of the cumulative probability.
    pub fn stable(&self, mut at: f64) -> Option<[f64; 3]> {
        for pose in &self.poses {
            at -= pose.probability;
            if at < 0.0 {
                return Some(pose.up);
            }
        }
        self.poses.last().map(|pose| pose.up)
    }

    /// The shape as bytes, for caches.
    pub fn encode(&self) -> Vec<u8> {
        let counts = [self.corners.len(), self.poses.len()].map(|count| (count as u32).to_le_bytes());
        let mut bytes = counts.concat();
        bytes.extend(self.corners.iter().flatten().flat_map(|x| x.to_le_bytes()));
        let numbers = self.poses.iter().flat_map(|pose| [&pose.up[..], &[pose.probability, pose.tipping]].concat());
        bytes.extend(numbers.flat_map(f64::to_le_bytes));
        bytes
    }

    /// The shape of such bytes; none if they are damaged.
    pub fn decode(bytes: &[u8]) -> Option<Self> {
        let (corners, rest) = bytes.split_first_chunk::<4>()?;
        let (count, rest) = rest.split_first_chunk::<4>()?;
        let [corners, count] = [corners, count].map(|bytes| u32::from_le_bytes(*bytes) as usize);
        let length = corners.checked_mul(12)?;
        let (corners, poses) = rest.split_at_checked(length)?;
        let (poses, rest) = poses.as_chunks::<40>();
        let corner = |bytes: &[u8; 12]| {
            let (numbers, _) = bytes.as_chunks::<4>();
            std::array::from_fn(|axis| f32::from_le_bytes(numbers[axis]))
        };
        let pose = |bytes: &[u8; 40]| {
            let (numbers, _) = bytes.as_chunks::<8>();
            let [x, y, z, probability, tipping] = std::array::from_fn(|i| f64::from_le_bytes(numbers[i]));
            StablePose { up: [x, y, z], probability, tipping }
        };
        (rest.is_empty() && poses.len() == count).then(|| Self {
            corners: corners.as_chunks::<12>().0.iter().map(corner).collect(),
            poses: poses.iter().map(pose).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_survives_the_cache() {
        let pose = StablePose { up: [0.6, 0.0, 0.8], probability: 0.25, tipping: 0.1 };
        let shape = RestingShape { corners: vec![[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]], poses: vec![pose; 3] };
        let bytes = shape.encode();
        assert_eq!(RestingShape::decode(&bytes), Some(shape));
        for end in 0..bytes.len() {
            assert_eq!(RestingShape::decode(&bytes[..end]), None, "{end} bytes");
        }
    }

    #[test]
    fn upright_is_the_stable_pose_that_is_nearest_to_the_file() {
        let pose = |up, probability, tipping| StablePose { up, probability, tipping };
        let shape = |poses| RestingShape { corners: Vec::new(), poses };
        let can = shape(vec![
            pose([1.0, 0.0, 0.0], 0.7, 0.0),
            pose([0.0, 0.0, -1.0], 0.15, 0.4),
            pose([0.0, 0.0, 1.0], 0.15, 0.4),
        ]);
        assert_eq!(can.upright(), Some([0.0, 0.0, 1.0]));
        // A pencil does not stand on its end.
        let pencil = shape(vec![pose([1.0, 0.0, 0.0], 0.99, 0.5), pose([0.0, 0.0, 1.0], 0.01, 0.02)]);
        assert_eq!(pencil.upright(), Some([1.0, 0.0, 0.0]));
        // A lying tube rests on its flat side, not on a facet of the curve beside it.
        let tube = shape(vec![
            pose([0.0, 0.0, -1.0], 0.5, 0.3),
            pose([0.0, 0.17, 0.985], 0.4, 0.3),
            pose([0.0, 0.0, 1.0], 0.1, 0.1),
        ]);
        assert_eq!(tube.upright(), Some([0.0, 0.17, 0.985]));
        let ball = shape(vec![pose([0.0, 0.6, 0.8], 0.6, 0.01), pose([0.0, 0.0, -1.0], 0.4, 0.01)]);
        assert_eq!(ball.upright(), Some([0.0, 0.6, 0.8]));
        assert_eq!(
            [0.0, 0.69, 0.71, 0.84, 0.86, 1.0].map(|at| can.stable(at).expect("a pose")[2]),
            [0.0, 0.0, -1.0, -1.0, 1.0, 1.0]
        );
        assert_eq!(shape(Vec::new()).upright(), None);
    }
}
