//! A scene on a device, and the rendering of its views.

use crate::arena::{Arena, Asset, Place};
use crate::device::{Bindings, Device, Kernel, PASS_STRIDE, Variant};
use crate::tables::{BodyPlace, EnvironmentPlaces, FAR, NONE, Tables};
use crate::trees::{MeshTree, TopLevel};
use bytemuck::{Pod, Zeroable};
use parking_lot::Mutex;
use std::sync::{Arc, OnceLock};
use syntable_model::context::Workers;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::{Error, Result};
use syntable_model::product::standard::{ALBEDO, COVERAGE, DEPTH, INSTANCE, NORMAL};
use syntable_model::product::{BitPlane, Plane, Products};
use syntable_model::scene::{EnvironmentMap, InstanceId, Scene};
use syntable_model::stage::{Bodies, RenderRequest, Window};
use syntable_prepare::labels::{BlendedLabels, instance_id};
use syntable_prepare::{
    AssetCache, Bounds, DistantLight, EmissiveBody, EnvironmentDistribution, LightTable, PreparedScene,
    ProjectedEnvironment, SampleOrder, SceneCache,
};
use syntable_transport::film::{Film, GUIDE_SAMPLES, Statistics, Task, Tracer, guide_seed, place};
use syntable_transport::{Dielectrics, PartSums, PathTracing, PixelFilter, PixelSums, RayCamera, Settings};

/// Bytes of trees that are kept on this side though no scene uses them.
const CAPACITY: u64 = 256 << 20;

/// Paths that are in flight at most; another number changes no image.
const MOST_PATHS: u64 = 1 << 21;

/// Planes of a path's state in `path.wgsl`, without guides and with them.
const STATE_PLANES: [u64; 2] = [10, 17];

/// Numbers of a pixel's sums in `path.wgsl`, without guides and with them.
const SUMS: [u64; 2] = [9, 24];

/// Words of the counters in `path.wgsl`.
const COUNTERS: u64 = 1028;

/// Where in them rays are counted.
const RAYS_COUNTED: usize = 1024;

/// Bounces that are submitted at once, before the device is asked whether any path is left.
const BOUNCES_AT_ONCE: u32 = 16;

/// Bounces of paths that are traced for guides alone.
const GUIDE_BOUNCES: u32 = 8;

/// Threads of a group of most kernels.
const GROUP: u64 = 64;

/// Flags of a view in `scene.wgsl`.
const WARPED: u32 = 1;
const TENT: u32 = 2;
const BLENDED_BY_COVERAGE: u32 = 4;
const ONLY_GUIDES: u32 = 8;

/// `View` in `scene.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct View {
    window: [i32; 4],
    origin: [f32; 4],
    corner: [f32; 4],
    along_u: [f32; 4],
    along_v: [f32; 4],
    right: [f32; 4],
    down: [f32; 4],
    rows: [[f32; 4]; 3],
    bodies: u32,
    materials: u32,
    layers: u32,
    textures: u32,
    lobes: u32,
    decode: u32,
    area_lights: u32,
    windows: u32,
    emitters: u32,
    distant_lights: u32,
    projection: u32,
    blocks: u32,
    warp: u32,
    area_count: u32,
    emitter_count: u32,
    distant_count: u32,
    objects: u32,
    foreground: u32,
    top_level: u32,
    top_items: u32,
    seen: u32,
    seen_items: u32,
    reach: f32,
    sample_bits: u32,
    block_bits: u32,
    block_columns: u32,
    flags: u32,
    max_bounces: u32,
    roulette_from: u32,
    capacity: u32,
    words: u32,
    depth_at: u32,
    instance_at: u32,
    normal_at: u32,
    albedo_at: u32,
    coverage_at: u32,
    before_at: u32,
    unused: [u32; 3],
}

/// `Pass` in `scene.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct Pass {
    first_pixel: u32,
    pixels: u32,
    first_sample: u32,
    samples: u32,
    bounce: u32,
    unused: [u32; 3],
}

/// What sessions share between scenes.
pub struct Caches {
    scene: SceneCache,
    trees: AssetCache<MeshTree>,
}

impl Default for Caches {
    fn default() -> Self {
        Self { scene: SceneCache::default(), trees: AssetCache::new(CAPACITY) }
    }
}

/// A scene ready to be traced.
struct World {
    scene: PreparedScene,
    /// By body: digest of its object, tree and world box.
    bodies: Vec<(Digest, Arc<MeshTree>, Bounds)>,
}

/// Buffers that grow with what is rendered.
struct Buffers {
    tables: wgpu::Buffer,
    paths: wgpu::Buffer,
    queues: wgpu::Buffer,
    counters: wgpu::Buffer,
    output: wgpu::Buffer,
    view: wgpu::Buffer,
    passes: wgpu::Buffer,
    readable: wgpu::Buffer,
}

/// A session on a device.
pub struct GpuSession {
    device: Arc<Device>,
    options: PathTracing,
    caches: Arc<Caches>,
    world: Option<World>,
    geometry: Arena,
    shading: Arena,
    images: Arena,
    buffers: Buffers,
    /// Paths that are in flight at most.
    most_paths: u64,
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
            output: storage("output")?,
            view: device.uniforms("view", size_of::<View>() as u64)?,
            passes: device.uniforms("passes", PASS_STRIDE * u64::from(options.max_bounces.max(GUIDE_BOUNCES) + 1))?,
            readable: device.readable("readable", 0)?,
        };
        let (geometry, shading) = (Arena::new(&device, "trees", 16)?, Arena::new(&device, "triangles", 16)?);
        let images = Arena::new(&device, "textures", 4)?;
        Ok(Self { device, options, caches, world: None, geometry, shading, images, buffers, most_paths: MOST_PATHS })
    }

    /// Makes a scene ready.
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

        // Room for two top levels: that of all bodies, and that of those which camera rays meet.
        let reserved = 2 * TopLevel::room(bodies.len()) as u64;
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
        self.world = Some(World { scene: prepared, bodies });
        self.device.check()
    }

    /// Renders the wanted products of a view.
    pub fn render(&mut self, request: &RenderRequest, frame: &mut Products) -> Result<Statistics> {
        let not_loaded = || Error::new("no scene was loaded before rendering").help("call `load` first");
        let world = self.world.take().ok_or_else(not_loaded)?;
        let rendered = self.render_world(&world, request, frame);
        self.world = Some(world);
        rendered
    }

    fn render_world(&mut self, world: &World, request: &RenderRequest, frame: &mut Products) -> Result<Statistics> {
        let chosen = request.bodies.chosen(world.bodies.len())?;
        let camera = RayCamera::new(&request.view.camera, request.window);
        let lights = LightTable::new(&request.view.lights, &self.caches.scene)?;
        let [view, guide_view] = self.upload(world, request, &camera, &lights, &chosen)?;
        let wants = |key: syntable_model::product::KeyId| request.wants.contains(&key);
        let labels =
            [DEPTH.id(), INSTANCE.id(), NORMAL.id(), ALBEDO.id(), COVERAGE.id(), COVERAGE.before_support().id()];
        if labels.into_iter().any(wants) {
            self.labels(world, request, view, frame)?;
        }
        if !request.wants.iter().any(|want| Film::offers().contains(want)) {
            return Ok(Statistics::default());
        }
        let guides = Film::wants_guides(request.wants);
        let settings = self.options.settings();
        self.make_room(request.window.pixels(), settings.samples, guides)?;
        let capacity = self.capacity(guides);
        let tracer = GpuTracer {
            session: self,
            world,
            window: request.window,
            view: View { capacity, ..view },
            guide_view: View { capacity, ..guide_view },
            guides,
            counted: Mutex::new(Statistics::default()),
        };
        let film = Film::trace(&tracer, request.window, &tracer.session.options.budget(), request.workers)?;
        film.put(request.wants, &camera, request.workers, frame)?;
        Ok(film.statistics)
    }

    /// Writes the tables of a view; gives the uniforms of its paths, and of those that are traced for guides alone.
    fn upload(
        &mut self,
        world: &World,
        request: &RenderRequest,
        camera: &RayCamera,
        lights: &LightTable,
        chosen: &[bool],
    ) -> Result<[View; 2]> {
        let scene = &world.scene;
        let texture = |texture: &Arc<syntable_prepare::MipTexture>| {
            let texture = texture.clone();
            Asset {
                digest: texture.digest(),
                count: texture.levels().iter().map(|level| u64::from(level.width) * u64::from(level.height)).sum(),
                bytes: Box::new(move || {
                    let texels = |level: &syntable_prepare::MipLevel| {
                        let count = level.width as usize * level.height as usize;
                        texture.texels(*level)[..count].as_flattened().to_vec()
                    };
                    texture.levels().iter().flat_map(texels).collect()
                }),
            }
        };
        let mut images: Vec<_> = scene.materials.textures.iter().map(texture).collect();
        images.extend(environment_assets(lights));
        self.images.keep(&self.device, 0, &images)?;
        drop(images);

        // The top level, and that of what camera rays meet.
        let room = TopLevel::room(world.bodies.len()) as u32;
        let boxes = |keep: &dyn Fn(usize) -> bool| -> Vec<Bounds> {
            let of = |(number, (_, _, bounds)): (usize, &(Digest, Arc<MeshTree>, Bounds))| {
                if keep(number) { *bounds } else { Bounds::EMPTY }
            };
            world.bodies.iter().enumerate().map(of).collect()
        };
        let write_level = |place: u32, boxes: &[Bounds]| {
            let TopLevel { nodes, bodies } = TopLevel::build(boxes);
            let items = place + nodes.len() as u32;
            let vectors = [nodes, bodies].concat();
            self.device.write(self.geometry.buffer(), u64::from(place) * 16, bytemuck::cast_slice(&vectors));
            if vectors.is_empty() { [NONE; 2] } else { [place, items] }
        };
        // Bodies that only camera rays do not meet are lit, and light others.
        let is_lit = |body: usize| chosen[body] || matches!(request.bodies, Bodies::Seen(_));
        let lit = boxes(&is_lit);
        let top = write_level(0, &lit);
        let seen = match request.bodies {
            Bodies::Seen(_) => write_level(room, &boxes(&|body| chosen[body])),
            _ => top,
        };
        let reach = lit.iter().map(Bounds::reach).fold(0.0, f32::max);

        let mut tables = Tables::default();
        let [lobes, decode] = tables.constants();
        let bodies = scene.bodies.iter().zip(&world.bodies).map(|(body, (digest, tree, _))| {
            let (mesh, root) = (scene.mesh(body), self.geometry.place(digest));
            let shading = self.shading.place(digest);
            let after = |count: usize, there: bool| if there { shading + count as u32 } else { NONE };
            let (triangles, tangents) = (4 * mesh.triangles.len(), mesh.tangents.len());
            let place = BodyPlace {
                root,
                triangles: root + tree.nodes.len() as u32,
                reach: tree.reach,
                shading,
                tangents: after(triangles, tangents > 0),
                colors: after(triangles + tangents, !mesh.colors.is_empty()),
            };
            (body, place)
        });
        let bodies = tables.bodies(bodies);
        let materials = tables.materials(&scene.materials.materials);
        let layers = tables.layers(&scene.materials.layers);
        let textures = scene.materials.textures.iter().map(|texture| (texture, self.images.place(&texture.digest())));
        let textures = tables.textures(textures);
        let places = Environments(&self.images);
        let [area_lights, windows] = tables.area_lights(lights, &places);
        let emitters: Vec<EmissiveBody> =
            scene.emitters.iter().filter(|emitter| is_lit(emitter.instance as usize)).cloned().collect();
        let emitter_count = emitters.len() as u32;
        let emitters =
            tables.emitters(&emitters, |emitter| scene.mesh(&scene.bodies[emitter.instance as usize]).triangles.len());
        let distant_lights = tables.distant_lights(&lights.distant, &places);
        let projection = match scene.materials.has_projections {
            true => ProjectedEnvironment::new(&request.view.lights, lights),
            false => None,
        };
        let projection = tables.projection(projection.as_ref(), &places);
        let settings = self.options.settings();
        let order = SampleOrder::new(request.stream.seed(), settings.samples);
        let [blocks, block_columns] = tables.blocks(&order, request.window);
        let guide_order = SampleOrder::new(guide_seed(request.stream.seed()), GUIDE_SAMPLES);
        let [guide_blocks, guide_block_columns] = tables.blocks(&guide_order, request.window);
        let warp = tables.warp(camera, request.window);
        self.buffers.tables = self.grown(&self.buffers.tables, "tables", 16 * tables.entries().len() as u64)?;
        self.device.write(&self.buffers.tables, 0, bytemuck::cast_slice(tables.entries()));

        let Window { x, y, width, height } = request.window;
        let vector = |v: syntable_simd::Vec3, w: f32| [v.x, v.y, v.z, w];
        let [along_u, along_v] = camera.slopes();
        let lens = camera.lens.as_ref();
        let side =
            |of: fn(&syntable_transport::Lens) -> syntable_simd::Vec3| lens.map_or(syntable_simd::Vec3::ZERO, of);
        let limit = settings.max_indirect_luminance_nits.min(FAR);
        let flag = |bit: u32, on: bool| if on { bit } else { 0 };
        let view = View {
            window: [x, y, width as i32, height as i32],
            origin: vector(camera.origin(), camera.pixel_angle),
            corner: vector(camera.corner(0, 0), settings.spread(camera.pixel_angle)),
            along_u: vector(along_u, lens.map_or(0.0, |lens| lens.focus)),
            along_v: vector(along_v, settings.regularize),
            right: vector(side(|lens| lens.right), limit),
            down: vector(side(|lens| lens.down), 0.0),
            rows: camera.rows().map(|row| vector(row, 0.0)),
            bodies,
            materials,
            layers,
            textures,
            lobes,
            decode,
            area_lights,
            windows,
            emitters,
            distant_lights,
            projection,
            blocks,
            warp,
            area_count: lights.area.len() as u32,
            emitter_count,
            distant_count: lights.distant.len() as u32,
            objects: scene.objects as u32,
            foreground: scene.foreground as u32,
            top_level: top[0],
            top_items: top[1],
            seen: seen[0],
            seen_items: seen[1],
            reach,
            sample_bits: order.sample_bits(),
            block_bits: order.block_bits(),
            block_columns,
            flags: flag(WARPED, camera.is_warped())
                | flag(TENT, settings.filter == PixelFilter::Tent)
                | flag(BLENDED_BY_COVERAGE, self.options.blended_labels == BlendedLabels::Coverage),
            max_bounces: settings.max_bounces,
            roulette_from: settings.roulette_from,
            words: 2 * scene.objects.div_ceil(64).max(1) as u32,
            ..View::default()
        };
        let [a, b, c, _] = view.corner;
        let guide_view = View {
            corner: [a, b, c, Settings { samples: GUIDE_SAMPLES, ..settings }.spread(camera.pixel_angle)],
            blocks: guide_blocks,
            block_columns: guide_block_columns,
            sample_bits: guide_order.sample_bits(),
            block_bits: guide_order.block_bits(),
            flags: view.flags | ONLY_GUIDES,
            ..view
        };
        Ok([view, guide_view])
    }

    /// A buffer of at least a size: the same one if it is large enough.
    fn grown(&self, buffer: &wgpu::Buffer, label: &str, size: u64) -> Result<wgpu::Buffer> {
        match buffer.size() >= size {
            true => Ok(buffer.clone()),
            false => self.device.storage(label, size.next_power_of_two().min(self.device.max_buffer()).max(size)),
        }
    }

    /// Paths that the buffers have room for.
    fn capacity(&self, guides: bool) -> u32 {
        (self.buffers.paths.size() / (16 * STATE_PLANES[usize::from(guides)])).min(self.most_paths) as u32
    }

    /// Makes room for the paths of an image.
    fn make_room(&mut self, pixels: u64, samples: u32, guides: bool) -> Result<()> {
        let planes = STATE_PLANES[usize::from(guides)];
        let most = (self.device.max_buffer() / (16 * planes)).min(self.most_paths);
        let paths = (pixels * u64::from(samples.max(GUIDE_SAMPLES))).clamp(GROUP, most);
        self.buffers.paths = self.grown(&self.buffers.paths, "paths", paths * 16 * planes)?;
        let capacity = u64::from(self.capacity(guides));
        self.buffers.queues = self.grown(&self.buffers.queues, "queues", 4 * (3 * capacity + pixels))?;
        self.make_output(4 * SUMS[usize::from(guides)] * pixels)
    }

    fn make_output(&mut self, bytes: u64) -> Result<()> {
        if bytes > self.device.max_buffer() {
            let (name, mib) = (self.device.name(), bytes >> 20);
            return Err(Error::new(format!("the image needs {mib} MiB, which a buffer of {name} does not hold"))
                .help("lower the resolution, or render with `cpu_path`")
                .permanent());
        }
        self.buffers.output = self.grown(&self.buffers.output, "output", bytes)?;
        if self.buffers.readable.size() < bytes.max(4 * COUNTERS) {
            self.buffers.readable = self.device.readable("readable", bytes.max(4 * COUNTERS).next_power_of_two())?;
        }
        Ok(())
    }

    fn bind(&self) -> wgpu::BindGroup {
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
        })
    }

    fn variant(&self, world: &World, guides: bool) -> Variant {
        Variant {
            layered: world.scene.is_layered,
            cutouts: world.scene.has_cutouts,
            panes: world.scene.has_panes,
            guides,
            plain_dielectrics: self.options.dielectrics == Dielectrics::Gltf,
        }
    }

    /// Renders the wanted labels.
    fn labels(&mut self, world: &World, request: &RenderRequest, view: View, frame: &mut Products) -> Result<()> {
        let Window { width, height, .. } = request.window;
        let pixels = request.window.pixels() as usize;
        let mut end = 0;
        let mut section = |key: syntable_model::product::KeyId, words: usize| match request.wants.contains(&key) {
            true => {
                let start = end;
                end += pixels * words;
                start as u32
            }
            false => NONE,
        };
        // Sets first: their words are read in pairs.
        let set = view.words as usize;
        let view = View {
            coverage_at: section(COVERAGE.id(), set),
            before_at: section(COVERAGE.before_support().id(), set),
            depth_at: section(DEPTH.id(), 1),
            instance_at: section(INSTANCE.id(), 1),
            normal_at: section(NORMAL.id(), 3),
            albedo_at: section(ALBEDO.id(), 3),
            ..view
        };
        let count = end as u64;
        self.make_output(4 * count)?;
        self.device.write(&self.buffers.view, 0, bytemuck::bytes_of(&view));
        let (kernel, group) = (self.device.kernel(Kernel::Labels, self.variant(world, false)), self.bind());
        let mut encoder = self.device.encoder();
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&kernel);
            pass.set_bind_group(0, &group, &[0]);
            let squares = u64::from(width.div_ceil(8)) * u64::from(height.div_ceil(8));
            let [x, y] = groups(squares * GROUP, GROUP);
            pass.dispatch_workgroups(x, y, 1);
        }
        let objects = world.scene.objects;
        self.device.read(encoder, &self.buffers.output, &self.buffers.readable, count, |output: &[u32]| {
            let section =
                |start: u32, words: usize| (start != NONE).then(|| &output[start as usize..][..pixels * words]);
            for (key, start) in [(COVERAGE, view.coverage_at), (COVERAGE.before_support(), view.before_at)] {
                if let Some(words) = section(start, set) {
                    let pairs = words.as_chunks().0.iter().map(|&[low, high]| u64::from(low) | u64::from(high) << 32);
                    frame.put(key, BitPlane::from_words(width, height, objects, pairs.collect()))?;
                }
            }
            if let Some(words) = section(view.depth_at, 1) {
                let depth = |&word: &u32| {
                    let t = f32::from_bits(word);
                    if t < FAR { t } else { f32::INFINITY }
                };
                frame.put(DEPTH, Plane::from_vec(width, height, words.iter().map(depth).collect()))?;
            }
            if let Some(words) = section(view.instance_at, 1) {
                // Numbers count from 0, and the background is beyond the last.
                let id = |&word: &u32| if word == 0 { InstanceId::BACKGROUND } else { instance_id(word - 1) };
                frame.put(INSTANCE, Plane::from_vec(width, height, words.iter().map(id).collect()))?;
            }
            for (key, start) in [(NORMAL, view.normal_at), (ALBEDO, view.albedo_at)] {
                if let Some(words) = section(start, 3) {
                    let vector = |vector: &[u32; 3]| vector.map(f32::from_bits);
                    frame.put(key, Plane::from_vec(width, height, words.as_chunks().0.iter().map(vector).collect()))?;
                }
            }
            Ok(())
        })?
    }
}

/// Traces paths of a view.
struct GpuTracer<'a> {
    session: &'a GpuSession,
    world: &'a World,
    window: Window,
    view: View,
    guide_view: View,
    guides: bool,
    /// Rays counted so far.
    counted: Mutex<Statistics>,
}

impl Tracer for GpuTracer<'_> {
    fn has_guides(&self) -> bool {
        self.guides
    }

    fn trace(&self, tasks: Vec<Task>, workers: &dyn Workers) -> Result<Statistics> {
        let paths = tasks.iter().map(|task| (task.pixels.len() * task.samples.len()) as u64).sum();
        let [rays, shadow_rays] = self.run(&self.view, tasks, workers)?;
        let counted = std::mem::replace(&mut *self.counted.lock(), Statistics { paths: 0, rays, shadow_rays });
        Ok(Statistics { paths, rays: rays - counted.rays, shadow_rays: shadow_rays - counted.shadow_rays })
    }

    fn trace_guides(&self, _: u32, tasks: Vec<Task>, workers: &dyn Workers) -> Result<()> {
        self.run(&self.guide_view, tasks, workers).map(|_| ())
    }
}

impl GpuTracer<'_> {
    /// Traces the samples of tasks and adds their sums; gives the numbers of rays and of shadow rays of the view so far.
    fn run(&self, view: &View, tasks: Vec<Task>, workers: &dyn Workers) -> Result<[u64; 2]> {
        let Self { session, window, .. } = self;
        let (device, buffers) = (&session.device, &session.buffers);
        let Some(samples) = tasks.first().map(|task| task.samples.clone()) else { return Ok([0; 2]) };
        let mut pixels = Vec::new();
        for task in &tasks {
            pixels.extend(task.pixels.iter().map(|&pixel| {
                let (x, y) = place(task.area, pixel);
                (x - window.x) as u32 | ((y - window.y) as u32) << 16
            }));
        }
        let only_guides = view.flags & ONLY_GUIDES != 0;
        let (listed, capacity) = (pixels.len() as u32, view.capacity);
        device.write(&buffers.queues, 12 * u64::from(capacity), bytemuck::cast_slice(&pixels));
        device.write(&buffers.view, 0, bytemuck::bytes_of(view));
        let numbers = SUMS[usize::from(self.guides)];
        let mut encoder = device.encoder();
        encoder.clear_buffer(&buffers.output, 0, Some(4 * numbers * u64::from(listed)));
        if !only_guides && *self.counted.lock() == Statistics::default() {
            encoder.clear_buffer(&buffers.counters, 0, None);
        }
        let mut work = Work::new(self, encoder);
        let per_pass = (capacity / listed.max(1)).max(1).min(samples.len() as u32);
        let pixels_per_pass = listed.min(capacity / per_pass);
        for first_pixel in (0..listed).step_by(pixels_per_pass.max(1) as usize) {
            for first_sample in samples.clone().step_by(per_pass as usize) {
                let pass = Pass {
                    first_pixel,
                    pixels: pixels_per_pass.min(listed - first_pixel),
                    first_sample,
                    samples: per_pass.min(samples.end - first_sample),
                    bounce: 0,
                    unused: [0; 3],
                };
                let bounces = if only_guides { GUIDE_BOUNCES } else { view.max_bounces };
                work.pass(pass, bounces, !only_guides)?;
            }
        }
        let count = numbers * u64::from(listed);
        let counters = work.counters()?;
        let wide = |at: usize| u64::from(counters[at]) | u64::from(counters[at + 1]) << 32;
        device.read(device.encoder(), &buffers.output, &buffers.readable, count, |mut sums: &[f32]| {
            // Every task with the sums of its pixels.
            let mut jobs = Vec::with_capacity(tasks.len());
            for task in tasks {
                let (own, rest) = sums.split_at(task.pixels.len() * numbers as usize);
                sums = rest;
                jobs.push(Mutex::new((task, own)));
            }
            workers.run(jobs.len(), &|job| {
                let (task, sums) = &mut *jobs[job].lock();
                for (&pixel, sums) in task.pixels.iter().zip(sums.chunks_exact(numbers as usize)) {
                    task.sums[usize::from(pixel)].add_sums(&pixel_sums(sums, only_guides));
                }
            });
        })?;
        Ok([wide(RAYS_COUNTED), wide(RAYS_COUNTED + 2)])
    }
}

/// Submissions of passes.
struct Work<'a> {
    tracer: &'a GpuTracer<'a>,
    encoder: wgpu::CommandEncoder,
    group: wgpu::BindGroup,
    kernels: [Arc<wgpu::ComputePipeline>; 5],
}

impl<'a> Work<'a> {
    fn new(tracer: &'a GpuTracer, encoder: wgpu::CommandEncoder) -> Self {
        let session = tracer.session;
        let variant = session.variant(tracer.world, tracer.guides);
        let kernels = [Kernel::Start, Kernel::Extend, Kernel::Shade, Kernel::Shadow, Kernel::Accumulate];
        let kernels = kernels.map(|kernel| session.device.kernel(kernel, variant));
        Self { tracer, encoder, group: session.bind(), kernels }
    }

    /// Traces the paths of a pass.
    fn pass(&mut self, pass: Pass, max_bounces: u32, shadows: bool) -> Result<()> {
        let session = self.tracer.session;
        let passes: Vec<u8> = (0..=max_bounces)
            .flat_map(|bounce| {
                let mut bytes = bytemuck::bytes_of(&Pass { bounce, ..pass }).to_vec();
                bytes.resize(PASS_STRIDE as usize, 0);
                bytes
            })
            .collect();
        // What was recorded reads the uniforms of earlier passes.
        self.submit();
        session.device.write(&session.buffers.passes, 0, &passes);
        let paths = u64::from(pass.pixels) * u64::from(pass.samples);
        let all = groups(paths, GROUP);
        self.dispatch(0, 0, groups(paths, 2 * GROUP));
        for bounce in 0..=max_bounces {
            self.dispatch(1, bounce, all);
            self.dispatch(2, bounce, all);
            if shadows && bounce < max_bounces {
                self.dispatch(3, bounce, all);
            }
            if bounce % BOUNCES_AT_ONCE == BOUNCES_AT_ONCE - 1 && bounce < max_bounces {
                let counters = self.counters()?;
                if counters[bounce as usize + 1] == 0 {
                    break;
                }
            }
        }
        self.dispatch(4, 0, groups(pass.pixels.into(), GROUP));
        Ok(())
    }

    fn dispatch(&mut self, kernel: usize, bounce: u32, [x, y]: [u32; 2]) {
        let mut pass = self.encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.kernels[kernel]);
        pass.set_bind_group(0, &self.group, &[bounce * PASS_STRIDE as u32]);
        pass.dispatch_workgroups(x, y, 1);
    }

    fn submit(&mut self) {
        let device = &self.tracer.session.device;
        device.submit(std::mem::replace(&mut self.encoder, device.encoder()));
    }

    /// Waits for what was recorded, and gives the counters.
    fn counters(&mut self) -> Result<Vec<u32>> {
        let (device, buffers) = (&self.tracer.session.device, &self.tracer.session.buffers);
        let encoder = std::mem::replace(&mut self.encoder, device.encoder());
        device.read(encoder, &buffers.counters, &buffers.readable, COUNTERS, <[u32]>::to_vec)
    }
}

/// Groups along x and y for a number of threads.
fn groups(threads: u64, group: u64) -> [u32; 2] {
    const MOST: u64 = 65_535;
    let count = threads.div_ceil(group).max(1);
    let rows = count.div_ceil(MOST);
    [count.div_ceil(rows) as u32, rows as u32]
}

/// Sums of a pixel from the numbers of `path.wgsl`.
fn pixel_sums(numbers: &[f32], only_guides: bool) -> PixelSums {
    let three = |first: usize| [0, 1, 2].map(|c| numbers[first + c]);
    let guides = numbers.len() as u64 == SUMS[1];
    let mut sums = PixelSums::default();
    if !only_guides {
        // What rounding added was to be subtracted from the next number.
        let exact = |at: usize| f64::from(numbers[at]) - f64::from(numbers[at + 4]);
        sums.samples = numbers[8] as u32;
        sums.radiance = [0, 1, 2].map(exact);
        sums.square = exact(3);
        if guides {
            sums.specular = PartSums::new(three(16), numbers[19]);
            sums.demodulated = PartSums::new(three(20), numbers[23]);
        }
    }
    if guides {
        sums.guide_samples = numbers[9] as u32;
        (sums.albedo, sums.normal) = (three(10), three(13));
    }
    sums
}

/// Environments among the images of an arena.
struct Environments<'a>(&'a Arena);

impl EnvironmentPlaces for Environments<'_> {
    fn radiance(&self, map: &EnvironmentMap) -> Place {
        self.0.place(&map.digest)
    }

    fn distribution(&self, distribution: &EnvironmentDistribution) -> Place {
        self.0.place(&of_distribution(distribution))
    }
}

/// Digest of a distribution, as an image.
fn of_distribution(distribution: &EnvironmentDistribution) -> Digest {
    Hasher::new("environment distribution").digest(distribution.map().digest).finish()
}

/// Environment maps that the lights of a view show, and the distributions of those that are sampled.
fn environment_assets(lights: &LightTable) -> Vec<Asset<'static>> {
    let mut assets = Vec::new();
    let radiance = |map: &Arc<EnvironmentMap>| {
        let map = map.clone();
        let (digest, count) = (map.digest, 3 * map.texels().len() as u64);
        Asset { digest, count, bytes: Box::new(move || bytemuck::cast_slice(map.texels().as_flattened()).to_vec()) }
    };
    for light in &lights.distant {
        let DistantLight::Environment(light) = light else { continue };
        let distribution = light.distribution.clone();
        assets.push(radiance(&light.placed.map));
        assets.push(Asset {
            digest: of_distribution(&distribution),
            count: (distribution.rows().len() + distribution.texels().len()) as u64,
            bytes: Box::new(move || {
                [distribution.rows(), distribution.texels()].map(bytemuck::cast_slice::<f32, u8>).concat()
            }),
        });
    }
    assets.extend(lights.windows.iter().map(|window| radiance(&window.view.map)));
    assets
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
    use crate::device::Adapters;
    use syntable_model::prelude::*;
    use syntable_model::product::standard::{DENOISE_ALBEDO, RADIANCE, RADIANCE_SPECULAR, RADIANCE_VARIANCE};
    use syntable_testing::room::{self, Look};
    use syntable_testing::workers::Threads;

    #[test]
    fn neither_passes_nor_windows_nor_what_came_before_change_an_image() {
        let adapters = Adapters::find();
        if adapters.list().is_empty() {
            assert!(std::env::var("SYNTABLE_REQUIRE_TOOLS").as_deref() != Ok("1"), "no adapter");
            return eprintln!("there is no graphics adapter: passes are not tested");
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
        let mut one_pass = open(MOST_PATHS);
        let whole = render(&mut one_pass, &all);
        // A part of the samples of all pixels a pass; then fewer paths than pixels.
        for most_paths in [7 * 24 * 20, 200] {
            let parts = render(&mut open(most_paths), &all);
            assert_eq!(parts.get(RADIANCE), whole.get(RADIANCE), "{most_paths} paths");
            assert_eq!(parts.get(RADIANCE_VARIANCE), whole.get(RADIANCE_VARIANCE), "{most_paths} paths");
            assert_eq!(parts.get(RADIANCE_SPECULAR), whole.get(RADIANCE_SPECULAR), "{most_paths} paths");
            assert_eq!(parts.get(DENOISE_ALBEDO), whole.get(DENOISE_ALBEDO), "{most_paths} paths");
        }
        // A pixel is the same in a window that reaches beyond the image, rendered after another one without guides.
        let window = Window { x: -5, y: 3, width: 20, height: 30 };
        let part = render(&mut one_pass, &RenderRequest { window, wants: &[RADIANCE.id()], ..all.clone() });
        let (part, whole) = (part.get(RADIANCE).expect("made"), whole.get(RADIANCE).expect("made"));
        for (x, y) in (0..15).flat_map(|x| (3..20).map(move |y| (x, y))) {
            assert_eq!(part.at(x + 5, y - 3), whole.at(x, y), "pixel {x}, {y}");
        }
    }
}
