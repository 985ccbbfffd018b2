//! Collision shapes by object: computed once, cached in memory up to a maximum number, and on disk by mesh digest.
//!
//! Objects of one asset share a decomposition within each doubling of the size: a mesh is decomposed at the next power of two times
//! the asset's size, and the shape is made smaller from there. Bounds in meters, such as `max_deviation_m`, therefore hold at any
//! size.

use crate::collision_shape::CollisionShape;
use crate::decompose::{ConvexParts, DECOMPOSITION_VERSION, Method, convex_parts};
use crate::options::{Collision, Rapier};
use crate::{hull_codec, units};
use quick_cache::sync::Cache as MemoryCache;
use std::collections::BTreeSet;
use std::convert::Infallible;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use syntable_convex::{ConvexHull, HULL_VERSION};
use syntable_model::context::{Cache, Log, Steps, Workers};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::Result;
use syntable_model::geometry::Vector3;
use syntable_model::scene::{Mesh, Object};

/// Maximum deviation of a support that is not flat, meters: bodies lie in it.
const RELIEF_DEVIATION_M: f32 = 0.001;

/// Maximum number of parts of a support that is not flat.
const RELIEF_PARTS: usize = 512;

/// Maximum deviation of a flat support, meters, since no body stays below its top. A size that is drawn per scene
/// creates a new mesh each time, so decomposition must be fast.
const FLAT_DEVIATION_M: f32 = 0.03;

/// Use of a body's collision shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// The body moves, is a fixed object, or is a support without bodies that must stay on it.
    Body,
    /// A support with a flat top.
    Flat,
    /// A support with a rim or recesses.
    Relief,
}

impl Purpose {
    /// Maximum deviation of its parts, meters.
    pub fn max_deviation_m(self, config: &Rapier) -> f32 {
        match self {
            Self::Body => config.max_deviation_m as f32,
            Self::Flat => FLAT_DEVIATION_M,
            Self::Relief => RELIEF_DEVIATION_M,
        }
    }
}

/// Maximum number of shapes kept in memory.
const CAPACITY: usize = 512;

/// Computes and caches collision shapes. Threads that need the same shape wait for one computation.
pub struct HullCache {
    config: Rapier,
    shapes: MemoryCache<Digest, Result<Arc<CollisionShape>>>,
}

impl HullCache {
    /// An empty cache for the shapes of some options.
    pub fn new(config: &Rapier) -> Self {
        Self { config: config.clone(), shapes: MemoryCache::new(CAPACITY) }
    }

    fn method(&self, purpose: Purpose) -> Method {
        let max_deviation_m = purpose.max_deviation_m(&self.config);
        match (self.config.collision, purpose) {
            (Collision::ConvexHull, _) => Method::Hull,
            (Collision::Decomposition, Purpose::Relief) => Method::Cuts { max_deviation_m, max_parts: RELIEF_PARTS },
            (Collision::Decomposition, _) => {
                Method::Cuts { max_deviation_m, max_parts: self.config.max_parts as usize }
            }
        }
    }

    /// The shapes of some objects, in their order. All workers
    /// compute missing ones, and waiting callers see the progress.
    pub fn shapes(
        &self,
        objects: &[(&Object, Purpose)],
        cache: &dyn Cache,
        workers: &dyn Workers,
        log: &dyn Log,
    ) -> Vec<Result<Arc<CollisionShape>>> {
        let keys: Vec<Digest> = objects.iter().map(|&(object, purpose)| object_key(object, purpose)).collect();
        let missing: BTreeSet<Digest> = keys.iter().copied().filter(|key| self.shapes.peek(key).is_none()).collect();
        let (steps, begun) = (Steps::default(), AtomicUsize::new(0));
        let tell = |object: &Object, number: usize| {
            let (name, all) = (&object.name, missing.len());
            steps.begin(format!("decomposing `{name}` into convex parts ({} of {all})", number.min(all)));
        };
        let shape = |i: usize| {
            let (object, purpose) = objects[i];
            let (object, factor) = object.at_own_size();
            let size = decomposed_size(factor);
            let compute = || {
                // A caller that waited for another thread computes the shape that this thread has given up.
                workers.check_stop();
                let number = begun.fetch_add(1, Ordering::Relaxed) + 1;
                Ok::<_, Infallible>(self.compute(object, size, purpose, cache, &|| tell(object, number)))
            };
            let Ok(shape) = self.shapes.get_or_insert_with(&keys[i], compute);
            if factor == size { shape } else { shape?.scaled((factor / size) as f32).map(Arc::new) }
        };
        let shapes: Vec<OnceLock<Result<Arc<CollisionShape>>>> = objects.iter().map(|_| OnceLock::new()).collect();
        let mut all = || workers.run(objects.len(), &|i| _ = shapes[i].get_or_init(|| shape(i)));
        if missing.is_empty() {
            all()
        } else {
            log.during(&steps, &mut all)
        }
        shapes.into_iter().enumerate().map(|(i, found)| found.into_inner().unwrap_or_else(|| shape(i))).collect()
    }

    /// Computes the shape of an object at `size` times its own; calls `tell` before its mesh is decomposed.
    fn compute(
        &self,
        object: &Object,
        size: f64,
        purpose: Purpose,
        cache: &dyn Cache,
        tell: &dyn Fn(),
    ) -> Result<Arc<CollisionShape>> {
        let object = &object.clone().transformed(Vector3::zeros(), size)?;
        let hulls: Vec<ConvexHull> = match (self.config.collision, &object.collision) {
            (Collision::Decomposition, Some(parts)) => parts.iter().filter_map(|part| units::hull(part)).collect(),
            _ => Vec::new(),
        };
        let parts = if hulls.is_empty() {
            cached_parts(&object.mesh, self.method(purpose), cache, tell)
        } else {
            // The source of the asset guarantees these parts.
            ConvexParts { hulls, deviation_m: 0.0 }
        };
        CollisionShape::new(&parts).map(Arc::new)
    }
}

/// The convex parts of a mesh, cached or computed. Calls `tell` before a computation.
fn cached_parts(mesh: &Mesh, method: Method, cache: &dyn Cache, tell: &dyn Fn()) -> ConvexParts {
    let key = mesh_key(mesh, method);
    // Cached and computed parts are the same to the bit, since both have gone through the codec.
    cache.get("convex-parts", key).and_then(|bytes| hull_codec::decode(&bytes)).unwrap_or_else(|| {
        tell();
        let parts = convex_parts(mesh, method);
        let bytes = hull_codec::encode(&parts);
        let parts = hull_codec::decode(&bytes).unwrap_or(parts);
        cache.put("convex-parts", key, &bytes);
        parts
    })
}

fn mesh_key(mesh: &Mesh, method: Method) -> Digest {
    let data = mesh.data();
    let hasher = Hasher::new("convex parts").number(f64::from(HULL_VERSION)).number(f64::from(DECOMPOSITION_VERSION));
    let hasher = match method {
        Method::Hull => hasher.text("hull"),
        Method::Cuts { max_deviation_m, max_parts } => {
            hasher.text("cuts").number(f64::from(max_deviation_m)).number(max_parts as f64)
        }
    };
    let options = units::HULL_OPTIONS;
    let positions: Vec<f32> = data.positions.iter().flatten().copied().collect();
    let triangles: Vec<u8> = data.triangles.iter().flatten().flat_map(|i| i.to_le_bytes()).collect();
    hasher
        .number(f64::from(options.min_thickness))
        .number(f64::from(options.tolerance))
        .number(f64::from(options.grid))
        .number(f64::from(options.engine_scale))
        .number(options.max_vertices as f64)
        .floats(positions.into_iter())
        .bytes(&triangles)
        .finish()
}

/// The size at which an object's mesh is decomposed, as a multiple of its own: the smallest power of two that is not below `factor`.
fn decomposed_size(factor: f64) -> f64 {
    // The fraction is in [0.5, 1).
    let (fraction, exponent) = libm::frexp(factor);
    libm::ldexp(1.0, if fraction == 0.5 { exponent - 1 } else { exponent })
}

/// The same for all objects that share a shape.
fn object_key(object: &Object, purpose: Purpose) -> Digest {
    let (object, factor) = object.at_own_size();
    let bounds = object.mesh.bounds();
    bounds
        .min
        .iter()
        .chain(bounds.max.iter())
        .fold(Hasher::new("collision shape").digest(object.digest), |hasher, x| hasher.number(*x))
        .number(object.mesh.data().positions.len() as f64)
        .number(f64::from(purpose as u8))
        .number(decomposed_size(factor))
        .number(object.collision.as_ref().map_or(-1.0, |parts| parts.len() as f64))
        .finish()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kit;
    use std::sync::Mutex;
    use syntable_model::context::{NoCache, Serial};
    use syntable_model::error::Error;

    /// The reported steps of each piece of work, recorded at its end.
    #[derive(Default)]
    struct RecordedSteps(Mutex<Vec<Option<String>>>);
    impl Log for RecordedSteps {
        fn warn(&self, _: &Error) {}
        fn during(&self, steps: &Steps, work: &mut dyn FnMut()) {
            assert_eq!(steps.latest(), None);
            work();
            self.0.lock().expect("no panic").push(steps.latest());
        }
    }

    /// Counts disk look-ups: one per computed shape.
    #[derive(Default)]
    struct CountingCache(AtomicUsize);
    impl Cache for CountingCache {
        fn get(&self, _: &str, _: Digest) -> Option<Vec<u8>> {
            self.0.fetch_add(1, Ordering::Relaxed);
            // Long enough for the other threads to request the same shape.
            std::thread::sleep(std::time::Duration::from_millis(50));
            None
        }
        fn put(&self, _: &str, _: Digest, _: &[u8]) {}
    }

    struct TestWorkers;
    impl Workers for TestWorkers {
        fn threads(&self) -> usize {
            8
        }
        fn run(&self, jobs: usize, job: &(dyn Fn(usize) + Sync)) {
            std::thread::scope(|scope| (0..jobs).for_each(|i| drop(scope.spawn(move || job(i)))));
        }
    }

    #[test]
    fn threads_that_want_one_shape_compute_it_once() {
        let cube = kit::object("cube", kit::cuboid([0.0; 3], [0.1; 3]), 1.0);
        let slab = kit::object("slab", kit::cuboid([0.0; 3], [0.1, 0.1, 0.02]), 1.0);
        let objects: Vec<(&Object, Purpose)> =
            (0..8).map(|i| (if i % 2 == 0 { &*cube } else { &*slab }, Purpose::Body)).collect();
        let (shapes, disk) = (HullCache::new(&Rapier::default()), CountingCache::default());
        let found: Vec<_> = shapes
            .shapes(&objects, &disk, &TestWorkers, &RecordedSteps::default())
            .into_iter()
            .map(|s| s.expect("a shape"))
            .collect();
        assert_eq!(disk.0.load(Ordering::Relaxed), 2);
        for (i, shape) in found.iter().enumerate() {
            assert!(Arc::ptr_eq(shape, &found[i % 2]) && !Arc::ptr_eq(shape, &found[(i + 1) % 2]));
        }
    }

    /// The shapes of an object at some sizes, and the number of decompositions.
    fn at_sizes(object: &Arc<Object>, sizes: &[f64]) -> (Vec<Arc<CollisionShape>>, usize) {
        let resized: Vec<Arc<Object>> =
            sizes.iter().map(|factor| Arc::new(object.resized(*factor).expect("sound"))).collect();
        let objects: Vec<(&Object, Purpose)> = resized.iter().map(|object| (&**object, Purpose::Body)).collect();
        let (shapes, disk) = (HullCache::new(&Rapier::default()), CountingCache::default());
        let found = shapes.shapes(&objects, &disk, &TestWorkers, &RecordedSteps::default());
        (found.into_iter().map(|s| s.expect("a shape")).collect(), disk.0.load(Ordering::Relaxed))
    }

    #[test]
    fn objects_share_a_decomposition_within_each_doubling_of_the_size() {
        let tray = kit::object("tray", kit::tray([0.3, 0.2, 0.1], 0.02), 1.0);
        let sizes = [1.0, 0.51, 0.7, 1.7, 1.01, 2.0, 3.0];
        let (found, decompositions) = at_sizes(&tray, &sizes);
        assert_eq!(decompositions, 3);
        let volume = |shape: &CollisionShape| {
            let hull = |part: &parry3d::shape::SharedShape| {
                let points = syntable_convex::Polyhedron::of(&**part).expect("convex").points();
                let points: Vec<[f32; 3]> = points.iter().map(|point| (*point / units::PER_METER).to_array()).collect();
                f64::from(units::hull(&points).expect("a hull").volume())
            };
            shape.parts.iter().map(hull).sum::<f64>()
        };
        let base = volume(&found[0]);
        for (shape, factor) in found.iter().zip(sizes) {
            let want = base * factor.powi(3);
            assert!((volume(shape) / want - 1.0).abs() < 0.01, "{factor}: {} m³, not {want}", volume(shape));
        }
        // A user hears once of each shape that is poor.
        assert!(found[0].is_first_time() && !found[1].is_first_time() && found[3].is_first_time());
    }

    #[test]
    fn the_bound_of_the_deviation_holds_at_any_size() {
        let bound = Rapier::default().max_deviation_m as f32 + units::HULL_OPTIONS.tolerance;
        let bowl = kit::kit_objects().into_iter().find(|object| object.name == "bowl").expect("a bowl");
        // At four times its size, the bowl needs more than the maximum number of parts.
        let sizes = [1.0, 0.3, 0.6, 1.1, 1.5, 1.9];
        let (found, _) = at_sizes(&bowl, &sizes);
        // The bound decides the shape of the asset.
        assert!(found[0].deviation_m * 1.9 > bound, "{} m", found[0].deviation_m);
        for (shape, factor) in found.iter().zip(sizes) {
            assert!(shape.deviation_m <= bound, "{factor}: {} m", shape.deviation_m);
        }
    }

    #[test]
    fn who_waits_is_told_what_is_decomposed() {
        let cube = kit::object("cube", kit::cuboid([0.0; 3], [0.1; 3]), 1.0);
        let slab = kit::object("slab", kit::cuboid([0.0; 3], [0.1, 0.1, 0.02]), 1.0);
        let (shapes, told) = (HullCache::new(&Rapier::default()), RecordedSteps::default());
        let one: [(&Object, Purpose); 2] = [(&cube, Purpose::Body), (&cube, Purpose::Body)];
        let two: [(&Object, Purpose); 3] = [(&slab, Purpose::Flat), (&cube, Purpose::Body), (&slab, Purpose::Body)];
        for objects in [&one[..], &two, &two] {
            shapes.shapes(objects, &NoCache, &Serial, &told);
        }
        // All of the last shapes are cached, so no step is reported.
        let told = told.0.into_inner().expect("no panic");
        let steps = ["decomposing `cube` into convex parts (1 of 1)", "decomposing `slab` into convex parts (2 of 2)"];
        assert_eq!(told, steps.map(|step| Some(step.to_owned())));
    }
}
