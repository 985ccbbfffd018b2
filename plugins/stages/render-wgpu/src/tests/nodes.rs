//! Benefit of nodes with eight boxes: rays through a room by the walk of the renderer, as bodies and as one mesh, and
//! by the walk of a tree of that mesh with two children per node and boxes in single precision.
//!
//! `cargo test --release -p syntable-render-wgpu --lib nodes -- --ignored --nocapture` prints rays per second.

use super::{call_beside, session, show};
use crate::arena::Asset;
use crate::device::Variant;
use crate::layout::{GROUP, Pass, groups};
use crate::session::GpuSession;
use crate::trees::MeshTree;
use std::sync::Arc;
use std::time::{Duration, Instant};
use syntable_model::digest::Digest;
use syntable_model::geometry::{Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::{Mesh, MeshData, Role, SettleReport};
use syntable_prepare::{BinaryTree, Bounds, TreeNode};
use syntable_simd::Vec3;
use syntable_testing::{room, scenes};
use syntable_transport::{PathTracing, RayCamera};

/// Width and height of the image, and samples of a pixel.
const SIZE: [u32; 2] = [640, 480];
const SAMPLES: u32 = 8;

/// Number of dispatches whose mean time is measured, and the time of earlier work that brings a card to its working
/// clock.
const DISPATCHES: u32 = 20;
const WARM_UP: Duration = Duration::from_millis(1500);

/// Maximum triangles of a leaf of either tree.
const LEAF: usize = 3;

/// Walks a tree of two children per node: the boxes of both, each with the place of a node, or the place and number of
/// triangles.
const TWO: &str = "
fn box_distance(lo: vec3<f32>, hi: vec3<f32>, origin: vec3<f32>, inverse: vec3<f32>, to: f32) -> f32 {
    let a = (lo - origin) * inverse;
    let b = (hi - origin) * inverse;
    let near = min(a, b);
    let far = max(a, b);
    let enter = max(max(near.x, near.y), max(near.z, 0.0));
    let leave = min(min(far.x, far.y), min(far.z, to));
    return select(FAR, enter, enter <= leave);
}
fn two_first(start: u32, ray: Ray) -> f32 {
    let inverse = 1.0 / ray.direction;
    let shear = shear_of(ray);
    // Places, with the number of triangles in the two highest bits.
    var stack: array<u32, DEPTH>;
    var height = 0u;
    var link = start;
    var best = FAR;
    loop {
        let count = link >> 30u;
        let place = link & 0x3fffffffu;
        if count > 0u {
            for (var i = 0u; i < count; i++) {
                let corners = place + 3u * i;
                let a = bitcast<vec4<f32>>(shading[corners]);
                let b = bitcast<vec4<f32>>(shading[corners + 1u]);
                let c = bitcast<vec4<f32>>(shading[corners + 2u]);
                let found = test_triangle(shear, a.xyz, b.xyz, c.xyz);
                if found.hit && found.t >= 0.0 && found.t < best {
                    best = found.t;
                }
            }
        } else {
            let a = bitcast<vec4<f32>>(shading[place]);
            let b = bitcast<vec4<f32>>(shading[place + 1u]);
            let c = bitcast<vec4<f32>>(shading[place + 2u]);
            let d = bitcast<vec4<f32>>(shading[place + 3u]);
            let first = box_distance(a.xyz, b.xyz, ray.origin, inverse, best);
            let second = box_distance(c.xyz, d.xyz, ray.origin, inverse, best);
            let is_first = first <= second;
            if min(first, second) < FAR {
                link = select(bits(c.w), bits(a.w), is_first);
                if max(first, second) < FAR {
                    stack[height] = select(bits(a.w), bits(c.w), is_first);
                    height += 1u;
                }
                continue;
            }
        }
        if height == 0u {
            break;
        }
        height -= 1u;
        link = stack[height];
    }
    return best;
}";

/// All triangles of a scene, as one mesh.
fn merged(scene: &Scene) -> MeshData {
    let mut data = MeshData::default();
    for body in scene.bodies() {
        for triangle in 0..body.object.mesh.data().triangles.len() {
            let first = data.positions.len() as u32;
            for corner in body.object.mesh.corners(triangle) {
                let p = body.world_from_body * corner;
                data.positions.push([p.x as f32, p.y as f32, p.z as f32]);
            }
            data.triangles.push([first, first + 1, first + 2]);
        }
    }
    data
}

/// A tree of two children per node, as words; places count vectors from `start`.
struct Two<'a> {
    tree: &'a BinaryTree,
    corners: &'a dyn Fn(u32) -> [[f32; 3]; 3],
    start: u32,
    vectors: Vec<[u32; 4]>,
    depth: usize,
}

impl Two<'_> {
    /// Indices of the triangles below a node, unless they are too many for a leaf.
    fn leaf(&self, node: usize) -> Option<Vec<u32>> {
        let (mut items, mut pending) = (Vec::new(), vec![node]);
        while let Some(node) = pending.pop() {
            match self.tree.nodes[node].kind {
                TreeNode::Item(item) => items.push(item),
                TreeNode::Pair(a, b) => pending.extend([a, b]),
            }
            if items.len() + pending.len() > LEAF {
                return None;
            }
        }
        Some(items)
    }

    /// Writes a node; returns its place, with the number of its triangles.
    fn write(&mut self, node: usize, depth: usize) -> u32 {
        let place = self.start + self.vectors.len() as u32;
        self.depth = self.depth.max(depth);
        if let Some(items) = self.leaf(node) {
            for item in &items {
                self.vectors.extend((self.corners)(*item).map(|[x, y, z]| [x.to_bits(), y.to_bits(), z.to_bits(), 0]));
            }
            return place | (items.len() as u32) << 30;
        }
        let TreeNode::Pair(a, b) = self.tree.nodes[node].kind else { unreachable!("a single item is a leaf") };
        let at = self.vectors.len();
        self.vectors.extend([[0; 4]; 4]);
        for (number, child) in [a, b].into_iter().enumerate() {
            let link = self.write(child, depth + 1);
            let Bounds { lo, hi } = self.tree.nodes[child].bounds;
            for (row, (corner, word)) in [(lo, link), (hi, 0)].into_iter().enumerate() {
                let [x, y, z] = corner.map(f32::to_bits);
                self.vectors[at + 2 * number + row] = [x, y, z, word];
            }
        }
        place
    }
}

/// Seconds of a dispatch of the kernel that was called last, on its rows.
fn seconds(session: &GpuSession, kernel: &wgpu::ComputePipeline, rays: usize) -> f64 {
    let device = &session.device;
    let pass = Pass { pixels: rays as u32, ..Pass::default() };
    device.write(&session.buffers.passes, 0, bytemuck::bytes_of(&pass));
    let run = |times: u32| {
        let mut encoder = device.encoder();
        for _ in 0..times {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            let [x, y] = groups(rays as u64, GROUP);
            pass.set_pipeline(kernel);
            pass.set_bind_group(0, &session.bind(), &[0]);
            pass.dispatch_workgroups(x, y, 1);
        }
        let start = Instant::now();
        device.wait(device.submit(encoder)).expect("ends");
        start.elapsed().as_secs_f64()
    };
    let start = Instant::now();
    while session.device.is_hardware() && start.elapsed() < WARM_UP {
        run(DISPATCHES);
    }
    run(DISPATCHES) / f64::from(DISPATCHES)
}

#[test]
#[ignore = "measures: cargo test --release -p syntable-render-wgpu --lib nodes -- --ignored --nocapture"]
fn nodes_of_eight_boxes_and_of_two() {
    let Some(mut session) = session() else { return };
    let room_scene = room::scene();
    let data = merged(&room_scene);
    let mut builder = scenes::table();
    let mut object = (*scenes::object("room", Mesh::new(data).expect("sound"), [0.5; 3])).clone();
    object.digest = Digest::of(b"room");
    builder.add(scenes::body(Arc::new(object), [0.0; 3], Role::Object));
    let scene = builder.freeze(SettleReport::default()).expect("sound");
    let view = room::view(SIZE[0], SIZE[1]);
    show(&mut session, &scene, &view);

    // Including the table under the room.
    let data = merged(&scene);
    let corners = |item: u32| data.triangles[item as usize].map(|index| data.positions[index as usize]);
    let boxes: Vec<Bounds> = (0..data.triangles.len() as u32)
        .map(|item| {
            let mut bounds = Bounds::EMPTY;
            corners(item).into_iter().for_each(|corner| bounds.include(corner));
            bounds
        })
        .collect();
    let tree = BinaryTree::by_area(&boxes);
    let digest = Digest::of(b"two");
    let build = |start: u32| {
        let mut two = Two { tree: &tree, corners: &corners, start, vectors: Vec::new(), depth: 0 };
        two.write(0, 1);
        (two.vectors, two.depth)
    };
    let (vectors, depth) = build(0);
    let count = vectors.len() as u64;
    // The place is known only after the call of `keep`.
    let room = || Asset { digest, count, bytes: Box::new(|| bytemuck::cast_slice(&vectors).to_vec()) };
    let device = session.device.clone();
    session.shading.keep(&device, 0, &[room()]).expect("room");
    let start = session.shading.place(&digest);
    let (placed, _) = build(start);
    device.write(session.shading.buffer(), 16 * u64::from(start), bytemuck::cast_slice(&placed));
    let eight = MeshTree::build(&data.positions, &data.triangles).size();
    println!("{} triangles; {} MiB by eight boxes, {} by two, {depth} levels", boxes.len(), eight >> 20, count >> 16);

    let camera = RayCamera::new(&view.camera, syntable_model::stage::Window::of(&view.camera.intrinsics));
    let mut random = Stream::root(4);
    let mut rows: Vec<[f32; 6]> = Vec::new();
    for (top, left) in (0..SIZE[1]).step_by(8).flat_map(|y| (0..SIZE[0]).step_by(8).map(move |x| (y, x))) {
        for (y, x) in (top..top + 8).flat_map(|y| (left..left + 8).map(move |x| (y, x))) {
            for _ in 0..SAMPLES {
                let [u, v] = [x, y].map(|place| f64::from(place) + random.unit());
                let ray = camera.ray(u, v).expect("no distortion");
                let d = Vec3::from(ray.direction).normalized_or(Vec3::ZERO).array();
                rows.push([ray.origin[0], ray.origin[1], ray.origin[2], d[0], d[1], d[2]]);
            }
        }
    }
    let variant = Variant::default();
    let mut bodies = GpuSession::new(device, PathTracing::default(), Arc::default()).expect("opens");
    show(&mut bodies, &room_scene, &view);
    let eight = "let ray = Ray(v3(), v3());
        let hit = walk(FIRST, view.top_level, ray, 0.0, FAR, 0u, NONE).hit; put(hit.t); put_u(hit.primitive);";
    let two = format!("let ray = Ray(v3(), v3()); put(two_first({start}u, ray)); put_u(0u);");
    let functions = TWO.replace("DEPTH", &depth.to_string());
    for name in ["camera rays", "rays of the first bounce"] {
        let rate = |session: &mut GpuSession, functions: &str, statements: &str| {
            let (results, kernel) = call_beside(session, functions, statements, variant, &rows);
            (rows.len() as f64 / seconds(session, &kernel, rows.len()) / 1e9, results)
        };
        let ((by_bodies, _), (by_eight, hits)) = (rate(&mut bodies, "", eight), rate(&mut session, "", eight));
        let (by_two, others): (f64, Vec<[u32; 2]>) = rate(&mut session, &functions, &two);
        let unlike = hits.iter().zip(&others).filter(|([a, _], [b, _])| {
            let [a, b] = [a, b].map(|&word| f32::from_bits(word));
            (a - b).abs() > 1e-4 * a.abs()
        });
        let unlike = unlike.count();
        println!(
            "{name}: billions/s: {by_eight:.2} by eight boxes, {by_two:.2} by two; bodies by eight {by_bodies:.2}; {unlike} of {} distances differ",
            rows.len()
        );
        assert!(unlike * 500 <= rows.len(), "{unlike}");
        // Directions as after scattering by matte surfaces.
        let bounced = rows.iter().zip(&hits).map(|(row, &[t, primitive])| {
            let t = f64::from(f32::from_bits(t).min(100.0));
            let [x, y, z, dx, dy, dz] = row.map(f64::from);
            let along = Vector3::new(dx, dy, dz);
            let triangle = data.triangles.get(primitive as usize).copied().unwrap_or([0, 1, 2]);
            let [a, b, c] = triangle.map(|i| Point3::from(data.positions[i as usize].map(f64::from)));
            let normal = (b - a).cross(&(c - a)).normalize();
            let normal = if normal.dot(&along) > 0.0 { -normal } else { normal };
            let d = (normal + random.direction()).normalize();
            let p = Point3::new(x, y, z) + along * t + normal * 1e-4;
            [p.x as f32, p.y as f32, p.z as f32, d.x as f32, d.y as f32, d.z as f32]
        });
        rows = bounced.collect();
    }
}
