//! A scene on a device, and the rendering of its views.

use crate::arena::{Arena, Asset};
use crate::device::{Bindings, Device, Variant};
use crate::guided::GuidedFilter;
use crate::layout::{COUNTERS, GROUP, PASS_STRIDE, View};
use crate::planes::PLANE_WORDS;
use crate::queries::{QueriedBody, Structures};
use crate::trees::{MeshTree, NODE_SIZE, STACK, TopLevel};
use std::sync::{Arc, OnceLock};
use syntable_model::context::Workers;
use syntable_model::digest::Digest;
use syntable_model::error::Result;
use syntable_model::product::standard::OPACITY;
use syntable_model::scene::Scene;
use syntable_model::stage::{Bodies, RenderRequest};
use syntable_prepare::labels::BlendedLabels;
use syntable_prepare::{AssetCache, Bounds, PreparedScene, SceneCache};
use syntable_transport::components::Light;
use syntable_transport::film::GUIDE_SAMPLES;
use syntable_transport::path::GUIDE_BOUNCES;
use syntable_transport::{Dielectrics, PathTracing};

/// Maximum bytes of trees that the host keeps though no scene uses them.
const CAPACITY: u64 = 256 << 20;

/// Minimum paths that a pass has room for, however little memory is left.
const LEAST_PATHS: u64 = 1 << 18;

/// Planes of a path's state in `path.wgsl`, without guides and with them.
const STATE_PLANES: [u64; 2] = [10, 17];

/// Caches that sessions share between scenes.
pub struct Caches {
    pub scene: SceneCache,
    trees: AssetCache<MeshTree>,
}

impl Default for Caches {
    fn default() -> Self {
        Self { scene: SceneCache::default(), trees: AssetCache::new(CAPACITY) }
    }
}

/// A scene ready to be traced.
pub struct World {
    pub scene: PreparedScene,
    /// For each body: digest of its object, tree and world box.
    pub bodies: Vec<(Digest, Arc<MeshTree>, Bounds)>,
}

/// Buffers that grow with the scene and the image.
pub struct Buffers {
    pub tables: wgpu::Buffer,
    /// State of paths, followed by the planes of the image.
    pub paths: wgpu::Buffer,
    pub queues: wgpu::Buffer,
    pub counters: wgpu::Buffer,
    /// Numbers of workgroups, for indirect dispatches.
    pub groups: wgpu::Buffer,
    /// Labels, the denoised image, and sums of pixels.
    pub output: wgpu::Buffer,
    pub view: wgpu::Buffer,
    pub passes: wgpu::Buffer,
    pub readable: wgpu::Buffer,
}

/// Data that kernels gather.
#[derive(Clone, Copy, Debug)]
pub struct Gathered {
    /// Guides for denoisers, with the light.
    pub guides: bool,
    /// The opacity of pixels.
    pub opacity: bool,
    /// For windows with bodies of their own.
    pub tiles: bool,
    /// Rays meet all bodies of the scene.
    pub all_bodies: bool,
}

impl Gathered {
    /// Data that the products of a request need.
    pub fn wanted(request: &RenderRequest, guides: bool) -> Self {
        let opacity = request.wants.contains(&OPACITY.id());
        let all_bodies =
            request.only_tile().is_some_and(|tile| matches!(tile.bodies, Bodies::All | Bodies::Foreground));
        Self { guides, opacity, tiles: request.only_tile().is_none(), all_bodies }
    }
}

/// A session on a device.
pub struct GpuSession {
    pub device: Arc<Device>,
    pub options: PathTracing,
    /// Light that the paths of the current image gather.
    pub light: Light,
    pub caches: Arc<Caches>,
    /// The scene that was loaded.
    pub world: Option<World>,
    pub geometry: Arena,
    pub shading: Arena,
    pub images: Arena,
    pub buffers: Buffers,
    /// Acceleration structures of ray queries, on a device that has them.
    pub queried: Option<Structures>,
    /// The denoiser, from its first use on.
    pub guided: Option<GuidedFilter>,
    /// Width and height whose pixels are listed in the queues, and the place of the list.
    pub listed: Option<[u32; 3]>,
    /// Maximum paths of a pass.
    pub most_paths: u64,
    /// Maximum bytes of the state of paths; reduced once the device had too little memory.
    most_bytes: u64,
    /// Maximum levels of trees that walks with a short stack can take.
    pub short_stack: u32,
    /// Whether the trees of the last uploaded view have more levels.
    pub walks_deep: bool,
}

impl GpuSession {
    /// Opens a session.
    pub fn new(device: Arc<Device>, options: PathTracing, caches: Arc<Caches>) -> Result<Self> {
        let storage = |label| device.storage(label, 0);
        let buffers = Buffers {
            tables: storage("tables")?,
            paths: storage("paths")?,
            queues: storage("queues")?,
            counters: device.storage("counters", 4 * COUNTERS)?,
            groups: device.indirect("groups", 24)?,
            output: storage("output")?,
            view: device.uniforms("view", size_of::<View>() as u64)?,
            passes: device.uniforms("passes", PASS_STRIDE * u64::from(options.max_bounces.max(GUIDE_BOUNCES) + 1))?,
            readable: device.readable("readable", 0)?,
        };
        let (most_paths, most_bytes) = (device.most_paths(), device.max_buffer());
        let (geometry, shading) = (Arena::new(&device, "trees", 16)?, Arena::new(&device, "triangles", 16)?);
        let images = Arena::new(&device, "textures", 4)?;
        let queried = device.has_queries().then(|| Structures::new(&device));
        Ok(Self {
            device,
            options,
            light: Light::All,
            caches,
            world: None,
            geometry,
            shading,
            images,
            buffers,
            queried,
            guided: None,
            listed: None,
            most_paths,
            most_bytes,
            short_stack: STACK,
            walks_deep: false,
        })
    }

    /// Prepares a scene, and uploads it.
    pub fn load(&mut self, scene: &Scene, workers: &dyn Workers) -> Result<()> {
        self.world = None;
        let bodies = scene.bodies();
        let prepared = PreparedScene::new(scene, &self.caches.scene, workers);
        let build = |i: usize| {
            let object = &bodies[i].object;
            let data = object.mesh.data();
            let build = || MeshTree::build(&data.positions, &data.triangles);
            (object.digest, self.caches.trees.get(object.digest, build, MeshTree::size))
        };
        let trees: Vec<OnceLock<(Digest, Arc<MeshTree>)>> = bodies.iter().map(|_| OnceLock::new()).collect();
        workers.run(bodies.len(), &|i| {
            trees[i].get_or_init(|| build(i));
        });
        let placed = |(number, tree): (usize, OnceLock<(Digest, Arc<MeshTree>)>)| {
            let (digest, tree) = tree.into_inner().unwrap_or_else(|| build(number));
            let bounds = placed_bounds(&prepared.bodies[number].world_from_body(), &tree.outline);
            (digest, tree, bounds)
        };
        let bodies: Vec<_> = trees.into_iter().enumerate().map(placed).collect();

        // Room for two top levels, of all bodies and of the bodies that camera rays meet, and for one of each body
        // alone. The vectors of bodies for ray queries follow.
        let for_queries = if self.queried.is_some() { bodies.len() * NODE_SIZE } else { 0 };
        let reserved = (body_nodes_at(bodies.len()) + for_queries) as u64;
        let tree_of = |(digest, tree, _): &(Digest, Arc<MeshTree>, Bounds)| {
            let tree = tree.clone();
            Asset {
                digest: *digest,
                count: (tree.nodes.len() + tree.triangles.len()) as u64,
                bytes: Box::new(move || {
                    [bytemuck::cast_slice(&tree.nodes), bytemuck::cast_slice(&tree.triangles)].concat()
                }),
            }
        };
        self.geometry.keep(&self.device, reserved, &bodies.iter().map(tree_of).collect::<Vec<_>>())?;
        let triangles_of = |(number, (digest, ..)): (usize, &(Digest, Arc<MeshTree>, Bounds))| {
            let mesh = prepared.mesh(&prepared.bodies[number]);
            let (triangles, tangents, colors) = (mesh.triangles.len(), mesh.tangents.len(), mesh.colors.len());
            Asset {
                digest: *digest,
                count: (4 * triangles + tangents + 2 * colors) as u64,
                bytes: Box::new(move || bytemuck::cast_slice(&shading_words(mesh)).to_vec()),
            }
        };
        let assets: Vec<_> = bodies.iter().enumerate().map(triangles_of).collect();
        self.shading.keep(&self.device, 0, &assets)?;
        drop(assets);
        if let Some(queried) = &mut self.queried {
            let of = |(body, (digest, tree, bounds)): (_, &(Digest, Arc<MeshTree>, Bounds))| {
                let first = self.geometry.place(digest) + tree.nodes.len() as u32;
                let count = if bounds.is_empty() { 0 } else { tree.triangles.len() as u32 / 3 };
                QueriedBody { digest: *digest, body, triangles: [first, count] }
            };
            let all: Vec<_> = prepared.bodies.iter().zip(&bodies).map(of).collect();
            queried.build(&self.device, &self.geometry, &all)?;
        }
        self.world = Some(World { scene: prepared, bodies });
        self.device.check()
    }

    /// Grows a buffer to at least `size` bytes.
    pub fn grow(&mut self, which: fn(&mut Buffers) -> &mut wgpu::Buffer, label: &str, size: u64) -> Result<()> {
        let buffer = which(&mut self.buffers);
        if buffer.size() < size {
            // Free the old buffer first.
            *buffer = self.device.storage(label, 0)?;
            *buffer = self.device.roomy_storage(label, size, size.next_power_of_two())?;
        }
        Ok(())
    }

    /// Makes room for the paths of an image and for its planes; returns the number of paths that fit.
    pub fn make_room(&mut self, pixels: u64, samples: u32, guides: bool) -> Result<u32> {
        let state = 16 * STATE_PLANES[usize::from(guides)];
        let most = (self.most_bytes / state).min(self.most_paths).max(GROUP);
        let paths = (pixels * u64::from(samples.max(GUIDE_SAMPLES))).clamp(GROUP, most);
        let planes = 4 * PLANE_WORDS[usize::from(guides)] * pixels;
        self.device.check_image("an image of that size", planes)?;
        self.make_room_for_paths(paths * state, planes.max(LEAST_PATHS.min(paths) * state))?;
        let capacity = (self.buffers.paths.size() / state).min(self.most_paths);
        self.make_queues(capacity, pixels)?;
        Ok(capacity as u32)
    }

    /// Makes room for the queues of paths, two lists of the pixels of an image, and the tiles of its pixels.
    pub fn make_queues(&mut self, capacity: u64, pixels: u64) -> Result<()> {
        let before = self.buffers.queues.size();
        self.grow(|buffers| &mut buffers.queues, "queues", 4 * (3 * capacity + 3 * pixels))?;
        if before != self.buffers.queues.size() {
            self.listed = None;
        }
        Ok(())
    }

    /// Makes room for the state of paths: `bytes`, or fewer down to `least` if the device lacks memory.
    fn make_room_for_paths(&mut self, mut bytes: u64, least: u64) -> Result<()> {
        if self.buffers.paths.size() >= bytes.max(least) {
            return Ok(());
        }
        // Free the old buffer first.
        self.buffers.paths = self.device.storage("paths", 0)?;
        while bytes > least {
            let reserve = self.device.storage_if_there_is_room("reserve", self.device.reserve())?;
            let paths = self.device.storage_if_there_is_room("paths", bytes)?;
            if let (Some(_), Some(paths)) = (reserve, paths) {
                self.buffers.paths = paths;
                return Ok(());
            }
            bytes /= 2;
            self.most_bytes = bytes.max(least);
        }
        self.buffers.paths = self.device.storage("paths", least)?;
        Ok(())
    }

    /// Makes room for a number of bytes of output.
    pub fn make_output(&mut self, bytes: u64) -> Result<()> {
        self.grow(|buffers| &mut buffers.output, "output", bytes)
    }

    /// Makes room for bytes that the host reads.
    pub fn make_readable(&mut self, bytes: u64) -> Result<()> {
        if self.buffers.readable.size() < bytes {
            self.buffers.readable = self.device.readable("readable", bytes)?;
        }
        Ok(())
    }

    /// Binds the buffers to the kernels.
    pub fn bind(&self) -> wgpu::BindGroup {
        let b = &self.buffers;
        self.device.bind(&Bindings {
            storage: [
                self.geometry.buffer(),
                self.shading.buffer(),
                self.images.buffer(),
                &b.tables,
                &b.paths,
                &b.queues,
                &b.counters,
                &b.output,
            ],
            view: &b.view,
            passes: &b.passes,
            queried: self.queried.as_ref().map(Structures::scene),
        })
    }

    /// The kernels that a scene needs.
    pub fn variant(&self, world: &World, Gathered { guides, opacity, tiles, all_bodies }: Gathered) -> Variant {
        Variant {
            layered: world.scene.is_layered,
            // For labels, glass is transparent by the test for cut-outs.
            cutouts: world.scene.has_cutouts
                || world.scene.has_glass && self.options.blended_labels == BlendedLabels::Opaque,
            panes: world.scene.has_panes,
            guides,
            only_guides: false,
            deep: self.walks_deep,
            plain_dielectrics: self.options.dielectrics == Dielectrics::Gltf,
            tiles,
            opacity,
            queries: self.queried.is_some() && all_bodies,
        }
    }
}

/// First vector of bodies for ray queries in the geometry of a scene with `bodies` bodies: after all top levels.
pub fn body_nodes_at(bodies: usize) -> usize {
    2 * TopLevel::room(bodies) + bodies * TopLevel::room(1)
}

/// The box around placed boxes; empty if it is not finite.
fn placed_bounds(world_from_body: &[[f32; 4]; 3], outline: &[Bounds]) -> Bounds {
    let parts = outline.iter().filter(|part| !part.is_empty());
    let bounds = parts.fold(Bounds::EMPTY, |all, part| all.union(&part.transformed(world_from_body)));
    if bounds.lo.iter().chain(&bounds.hi).all(|x| x.is_finite()) { bounds } else { Bounds::EMPTY }
}

/// Triangles, tangents and colors of a mesh, as `scene.wgsl` and `material.wgsl` read them.
fn shading_words(mesh: &syntable_prepare::ShadingMesh) -> Vec<[u32; 4]> {
    let mut words = Vec::with_capacity(4 * mesh.triangles.len() + mesh.tangents.len() + 2 * mesh.colors.len());
    for t in &mesh.triangles {
        let [n0, n1, n2] = t.normals;
        let [a, b, c] = t.uvs.map(|uv| uv.map(f32::to_bits));
        let flags = u32::from(t.slot) | u32::from(t.smooth) << 16 | u32::from(t.mirrored) << 24;
        words.push([t.normal.x, t.normal.y, t.normal.z, t.plane].map(f32::to_bits));
        words.push([n0, n1, n2, a[0]]);
        words.push([a[1], b[0], b[1], c[0]]);
        words.push([c[1], t.uv_per_m.to_bits(), flags, 0]);
    }
    words.extend(mesh.tangents.iter().map(|&[a, b, c]| [a, b, c, 0]));
    for colors in &mesh.colors {
        let c = |i: usize| u32::from(colors[i / 3][i % 3]);
        words.push([c(0) | c(1) << 16, c(2) | c(3) << 16, c(4) | c(5) << 16, c(6) | c(7) << 16]);
        words.push([c(8), 0, 0, 0]);
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::adapters::Adapters;
    use syntable_guided::Guided;
    use syntable_model::prelude::*;
    use syntable_model::product::standard::{
        COVERAGE, DENOISE_ALBEDO, DEPTH, INSTANCE, RADIANCE, RADIANCE_NOISY, RADIANCE_SPECULAR, RADIANCE_VARIANCE,
    };
    use syntable_testing::room::{self, Look};
    use syntable_testing::tools::is_there;
    use syntable_testing::workers::Threads;

    #[test]
    fn neither_passes_nor_windows_nor_what_came_before_change_an_image() {
        let adapters = Adapters::find();
        if !is_there(adapters.used().is_ok(), "a graphics adapter") {
            return;
        }
        let device = Arc::new(Device::open(&adapters, 0).expect("opens"));
        let options = PathTracing { samples_per_pixel: 24, max_bounces: 4, ..PathTracing::default() };
        let (scene, view) = (room::scene_of(Look::Glass), room::view(24, 20));
        let wants = [RADIANCE.id(), RADIANCE_VARIANCE.id(), RADIANCE_SPECULAR.id(), DENOISE_ALBEDO.id()];
        let all = RenderRequest::new(&view, &wants, Stream::root(3), &Threads(2));
        let render = |session: &mut GpuSession, request: &RenderRequest| {
            let mut frame = Products::new();
            session.render(request, &mut frame).expect("renders");
            frame
        };
        let open = |most_paths: u64| {
            let mut session = GpuSession::new(device.clone(), options.clone(), Arc::default()).expect("opens");
            session.most_paths = most_paths;
            session.load(&scene, &Threads(2)).expect("loads");
            session
        };
        let mut one_pass = open(device.most_paths());
        let whole = render(&mut one_pass, &all);
        // Each pass has a part of the samples of all pixels, then fewer paths than pixels.
        for most_paths in [7 * 24 * 20, 200] {
            let parts = render(&mut open(most_paths), &all);
            assert_eq!(parts.get(RADIANCE), whole.get(RADIANCE), "{most_paths} paths");
            assert_eq!(parts.get(RADIANCE_VARIANCE), whole.get(RADIANCE_VARIANCE), "{most_paths} paths");
            assert_eq!(parts.get(RADIANCE_SPECULAR), whole.get(RADIANCE_SPECULAR), "{most_paths} paths");
            assert_eq!(parts.get(DENOISE_ALBEDO), whole.get(DENOISE_ALBEDO), "{most_paths} paths");
        }
        // Labels for three squares at once, and a filter whose kernels are submitted one by one.
        let labels = [DEPTH.id(), INSTANCE.id(), COVERAGE.id(), RADIANCE.id(), RADIANCE_NOISY.id()];
        let denoiser: Box<dyn Denoiser> = Guided::default().build().expect("sound");
        let denoised = RenderRequest { wants: &labels, denoiser: Some(&*denoiser), ..all.clone() };
        let [once, parts] = [render(&mut one_pass, &denoised), render(&mut open(200), &denoised)];
        assert!(once.get(RADIANCE).expect("made") != once.get(RADIANCE_NOISY).expect("made"), "nothing was filtered");
        macro_rules! same {
            ($($key:ident),*) => {$(assert!(once.get($key) == parts.get($key), "{}", $key.name());)*};
        }
        same!(DEPTH, INSTANCE, COVERAGE, RADIANCE, RADIANCE_NOISY);
        // Long stacks, which trees of many levels need.
        let mut deep = open(device.most_paths());
        deep.short_stack = 0;
        assert_eq!(render(&mut deep, &all).get(RADIANCE), whole.get(RADIANCE), "with long stacks");
        assert!(deep.walks_deep && !one_pass.walks_deep);
        // Room for more paths than the minimum of a pass, on a device with small buffers, too.
        one_pass.make_room_for_paths(LEAST_PATHS * 16 * STATE_PLANES[1] + 256, LEAST_PATHS).expect("room");
        // A pixel is the same in a window that reaches beyond the image and is rendered after an image without guides.
        let window = Window { x: -5, y: 3, width: 20, height: 30 };
        let part = render(&mut one_pass, &RenderRequest { wants: &[RADIANCE.id()], ..all.of(window, Bodies::All) });
        let (part, whole) = (part.get(RADIANCE).expect("made"), whole.get(RADIANCE).expect("made"));
        for (x, y) in (0..15).flat_map(|x| (3..20).map(move |y| (x, y))) {
            assert_eq!(part.at(x + 5, y - 3), whole.at(x, y), "pixel {x}, {y}");
        }
    }

    #[test]
    #[ignore = "takes all the memory of a card: cargo test --release -p syntable-render-wgpu --lib -- --ignored"]
    fn a_card_with_little_memory_left_gets_fewer_paths() {
        let device = Arc::new(Device::open(&Adapters::find(), 0).expect("opens"));
        let (scene, view) = (room::scene_of(Look::Mixed), room::view(320, 240));
        let wants = [RADIANCE.id()];
        let request = RenderRequest::new(&view, &wants, Stream::root(3), &Threads(2));
        let render = || {
            let options = PathTracing { samples_per_pixel: 32, ..PathTracing::default() };
            let mut session = GpuSession::new(device.clone(), options, Arc::default()).expect("opens");
            session.load(&scene, &Threads(2)).expect("loads");
            let mut frame = Products::new();
            session.render(&request, &mut frame).expect("renders");
            (frame, session.buffers.paths.size())
        };
        let (whole, roomy) = render();
        let mut taken = Vec::new();
        for size in [1 << 30, 1 << 25] {
            while let Some(buffer) = device.storage_if_there_is_room("taken", size).expect("no other failure") {
                taken.push(buffer);
            }
        }
        // Free memory for the buffers of a scene, and for a part of its paths.
        let mut free = 0;
        while free < device.reserve() + roomy / 4 {
            free += taken.pop().expect("more than that was taken").size();
        }
        let (part, narrow) = render();
        println!("{} MiB of paths, then {}", roomy >> 20, narrow >> 20);
        assert!(narrow < roomy, "{narrow} of {roomy}");
        assert_eq!(part.get(RADIANCE), whole.get(RADIANCE));
    }
}
