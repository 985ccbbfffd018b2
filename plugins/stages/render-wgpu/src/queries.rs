//! Acceleration structures of ray queries: one per mesh, kept like the tree of the mesh, and one over the bodies of a
//! scene.
//!
//! A query only finds a triangle (`shaders/queries.wgsl`). Its corners are read from the tree of its mesh; the
//! structure is built from the same triangles. For bodies with cut-outs or panes, the shader decides about each
//! triangle.

use crate::arena::Arena;
use crate::device::Device;
use std::collections::HashMap;
use syntable_model::digest::Digest;
use syntable_model::error::Result;
use syntable_prepare::PreparedBody;

/// Bytes of a corner of a triangle in the geometry.
const CORNER: u64 = 16;

/// A body of a scene: the digest of its object, and where its triangles are.
pub struct QueriedBody<'a> {
    pub digest: Digest,
    pub body: &'a PreparedBody,
    /// First vector of its triangles in the geometry, and their number; 0 for a body that rays do not meet.
    pub triangles: [u32; 2],
}

/// The acceleration structures of a session.
pub struct Structures {
    /// Of the meshes, by digest and by whether every triangle stops a ray.
    meshes: HashMap<(Digest, bool), wgpu::Blas>,
    /// Of the scene.
    scene: wgpu::Tlas,
}

impl Structures {
    /// Structures of a scene without bodies.
    pub fn new(device: &Device) -> Self {
        Self { meshes: HashMap::new(), scene: device.top_structure(1) }
    }

    /// The structure that kernels bind.
    pub fn scene(&self) -> &wgpu::Tlas {
        &self.scene
    }

    /// Builds the structures of new meshes, and the structure of the scene. Drops the structures of meshes that the
    /// geometry no longer holds.
    ///
    /// # Errors
    /// If the device failed, or did not finish in time.
    pub fn build(&mut self, device: &Device, geometry: &Arena, bodies: &[QueriedBody]) -> Result<()> {
        self.meshes.retain(|(digest, _), _| geometry.holds(digest));
        let room = self.scene.get().len();
        if bodies.len() > room {
            self.scene = device.top_structure(bodies.len().next_power_of_two() as u32);
        }
        let room = self.scene.get().len();
        let instances = self.scene.get_mut_slice(0..room).unwrap_or_default();
        instances.fill(None);
        for (number, (instance, queried)) in instances.iter_mut().zip(bodies).enumerate() {
            let [first, count] = queried.triangles;
            if count == 0 {
                continue;
            }
            let is_opaque = queried.body.flags == 0;
            let mesh = self.meshes.entry((queried.digest, is_opaque)).or_insert_with(|| {
                // One submission per mesh, so that the memory for building is not needed for all at once.
                device.build_structure(geometry.buffer(), first, count, is_opaque)
            });
            let transform: [f32; 12] = std::array::from_fn(|i| queried.body.world_from_body()[i / 4][i % 4]);
            *instance = Some(wgpu::TlasInstance::new(mesh, transform, number as u32, u8::MAX));
        }
        let mut encoder = device.encoder();
        encoder.build_acceleration_structures([], [&self.scene]);
        // Waits here, so that errors belong to the loaded scene, and the memory for building is free before rendering.
        let built = device.submit(encoder);
        device.wait(built)
    }
}

impl Device {
    /// A structure with room for a number of bodies.
    fn top_structure(&self, max_instances: u32) -> wgpu::Tlas {
        self.wgpu().create_tlas(&wgpu::CreateTlasDescriptor {
            label: Some("bodies"),
            max_instances,
            flags: wgpu::AccelerationStructureFlags::PREFER_FAST_TRACE,
            update_mode: wgpu::AccelerationStructureUpdateMode::Build,
        })
    }

    /// Starts to build the structure of triangles, whose corners start at a vector of a buffer.
    fn build_structure(&self, buffer: &wgpu::Buffer, first: u32, count: u32, is_opaque: bool) -> wgpu::Blas {
        use wgpu::AccelerationStructureGeometryFlags as Flags;
        let size = wgpu::BlasTriangleGeometrySizeDescriptor {
            vertex_format: wgpu::VertexFormat::Float32x3,
            vertex_count: 3 * count,
            index_format: None,
            index_count: None,
            // A pane dims light once.
            flags: if is_opaque { Flags::OPAQUE } else { Flags::NO_DUPLICATE_ANY_HIT_INVOCATION },
        };
        let descriptor = wgpu::CreateBlasDescriptor {
            label: Some("mesh"),
            flags: wgpu::AccelerationStructureFlags::PREFER_FAST_TRACE,
            update_mode: wgpu::AccelerationStructureUpdateMode::Build,
        };
        let sizes = wgpu::BlasGeometrySizeDescriptors::Triangles { descriptors: vec![size.clone()] };
        let blas = self.wgpu().create_blas(&descriptor, sizes);
        let triangles = wgpu::BlasTriangleGeometry {
            size: &size,
            vertex_buffer: buffer,
            first_vertex: first,
            vertex_stride: CORNER,
            index_buffer: None,
            first_index: None,
            transform_buffer: None,
            transform_buffer_offset: None,
        };
        let geometry = wgpu::BlasGeometries::TriangleGeometries(vec![triangles]);
        let mut encoder = self.encoder();
        encoder.build_acceleration_structures([&wgpu::BlasBuildEntry { blas: &blas, geometry }], []);
        self.submit(encoder);
        blas
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adapters::{Adapters, RayQueries, SWITCH};
    use crate::device::Variant;
    use crate::session::GpuSession;
    use crate::tests::soups::scene;
    use crate::tests::{call, show};
    use std::sync::Arc;
    use syntable_model::prelude::*;
    use syntable_testing::scenes;
    use syntable_testing::tools::is_there;
    use syntable_testing::workers::Threads;
    use syntable_transport::PathTracing;

    /// Scenes of triangles, every other one with holes and panes.
    const SCENES: u64 = 2;

    /// Rays that are traced in each scene.
    const RAYS: u64 = 40_000;

    /// Words of a result.
    const RESULT: usize = 9;

    /// Of so many rays, one may have another result: it grazes an edge, or starts on a triangle.
    const RAYS_OF_A_SLIP: usize = 10_000;

    /// First hit of every ray, and the light that passes along it.
    const PROBE: &str = "
    let ray = Ray(v3(), v3());
    let from_ = f();
    let to = f();
    let hit = first_hit(view.top_level, ray, from_, number);
    let passed = passage_of_light(view.top_level, ray, to, number);
    put_u(hit.instance); put_u(hit.primitive); put(hit.t); put(hit.u); put(hit.v);
    put3(passed.transmittance);
    put_u(select(passed.panes, 0u, is_black(passed.transmittance)));";

    /// Rays across the scene: origin, direction of any length, start and end of the interval.
    fn rays(number: u64) -> Vec<[f32; 8]> {
        let mut random = Stream::root(70 + number);
        let ray = |i| {
            let d = random.direction();
            let length = [1.0, 1.0, 0.01, 30.0][i as usize % 4];
            let [x, y, z] = std::array::from_fn(|_| random.uniform(-1.5, 1.5) as f32);
            let [dx, dy, dz] = [d.x, d.y, d.z].map(|d| (d * length) as f32);
            let from = if random.chance(0.5) { 0.0 } else { random.uniform(0.0, 0.5 / length) as f32 };
            let to = random.uniform(0.0, 2.0 / length) as f32;
            match i {
                // Directions that are zero, huge, or along an axis, and a ray that ends where it starts.
                0 => [x, y, z, 0.0, 0.0, 0.0, from, to],
                1 => [x, y, z, f32::MAX, dy, dz, from, to],
                2 => [x, y, z, dx, dy, dz, from, 0.0],
                3 => [0.5 * x, 0.5 * y, 2.0, 0.0, 0.0, -1.0, 0.0, to],
                _ => [x, y, z, dx, dy, dz, from, to],
            }
        };
        (0..RAYS).map(ray).collect()
    }

    /// Results of rays in a scene, by queries and by walks.
    fn traced(session: &mut GpuSession, scene: &Scene, special: bool, rays: &[[f32; 8]]) -> [Vec<[u32; RESULT]>; 2] {
        show(session, scene, &scenes::view([0.0, -2.0, 1.0], [0.0; 3], [8, 8], 60.0));
        [true, false].map(|queries| {
            let variant = Variant { cutouts: special, panes: special, deep: true, queries, ..Variant::default() };
            call(session, PROBE, variant, rays)
        })
    }

    /// A session with ray queries, if an adapter has them.
    fn session() -> Option<GpuSession> {
        let adapters = Adapters::with_ray_queries(true);
        let queries = adapters.used().is_ok_and(|used| used[0].ray_queries == RayQueries::Used);
        // No ordinary software renderer has ray queries: only a run that asks for them requires them.
        if std::env::var(SWITCH).as_deref() != Ok("1") && !queries {
            eprintln!("skipped: no graphics adapter with ray queries");
            return None;
        }
        if !is_there(queries, "a graphics adapter with ray queries") {
            return None;
        }
        let device = Arc::new(Device::open(&adapters, 0).expect("opens"));
        Some(GpuSession::new(device, PathTracing::default(), Arc::default()).expect("opens"))
    }

    #[test]
    fn queries_find_what_walks_find() {
        let Some(mut session) = session() else { return };
        let (mut hits, mut lit, mut panes, mut covered) = (0, 0, 0, 0);
        for number in 0..SCENES {
            let special = number % 2 == 1;
            let (scene, rays) = (scene(number, special), rays(number));
            let [queried, walked] = traced(&mut session, &scene, special, &rays);
            let nothing = [u32::MAX; 2];
            hits += walked.iter().filter(|result| result[..2] != nothing).count();
            lit += walked.iter().filter(|result| result[5..8] == [1.0_f32.to_bits(); 3]).count();
            panes += walked.iter().filter(|result| result[8] > 0).count();
            covered += walked.iter().filter(|result| result[5..8] == [0; 3]).count();
            // Equal to the bit, as both compute a hit in the same way.
            let other_hit: Vec<usize> = (0..rays.len()).filter(|&i| queried[i][..5] != walked[i][..5]).collect();
            // The order of panes along a ray changes rounding.
            let near = |a: u32, b: u32| (f32::from_bits(a) - f32::from_bits(b)).abs() <= 1e-6;
            let alike = |i: usize| {
                let [a, b] = [&queried[i], &walked[i]];
                a[8] == b[8] && (5..8).all(|word| near(a[word], b[word]))
            };
            let other_light: Vec<usize> = (0..rays.len()).filter(|&i| !alike(i)).collect();
            println!("scene {number}: {} hits and {} shadows of {RAYS} differ", other_hit.len(), other_light.len());
            let most = rays.len() / RAYS_OF_A_SLIP;
            for (which, what) in [(&other_hit, "first hit"), (&other_light, "passage of light")] {
                let first = which.first().map(|&i| (rays[i], queried[i], walked[i]));
                assert!(which.len() <= most, "{} of {what} differ in scene {number}: {first:?}", which.len());
            }
            assert!(queried[0][..2] == nothing && queried[1][..2] == nothing && queried[3][..2] != nothing);
        }
        let all = (SCENES * RAYS) as usize;
        assert!(
            hits > all / 4 && lit > all / 10 && covered > all / 10 && panes > all / 100,
            "{hits} {lit} {covered} {panes}"
        );
    }

    #[test]
    fn structures_of_meshes_are_kept_for_as_long_as_their_trees() {
        let Some(mut session) = session() else { return };
        let kept = |session: &GpuSession| {
            let structures = session.queried.as_ref().expect("queries");
            (structures.meshes.clone(), structures.scene.get().iter().flatten().count())
        };
        session.load(&scene(0, false), &Threads(2)).expect("loads");
        let (first, bodies) = kept(&session);
        assert_eq!((first.len(), bodies), (5, 9), "four soups and the table");
        session.load(&scene(1, true), &Threads(2)).expect("loads");
        let (both, bodies) = kept(&session);
        assert_eq!(bodies, 33, "four shapes in four looks, twice, and the table");
        assert!(first.iter().all(|(key, blas)| both.get(key).is_none_or(|other| other == blas)), "none is built again");
        session.load(&scene(0, false), &Threads(2)).expect("loads");
        let (again, bodies) = kept(&session);
        assert!(bodies == 9 && again.keys().all(|(digest, _)| session.geometry.holds(digest)));
    }
}
