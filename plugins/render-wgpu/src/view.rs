//! The tables and uniforms of a view.

use crate::arena::{Arena, Asset, Place};
use crate::session::{GpuSession, World};
use crate::tables::{BodyPlace, EMITTER_SIZE, EnvironmentPlaces, NONE, Tables, TilePlace};
use crate::tiles::{SeenBodies, Shown};
use crate::trees::{MeshTree, TopLevel, body_node};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::Result;
use syntable_model::scene::EnvironmentMap;
use syntable_model::stage::RenderRequest;
use syntable_prepare::labels::BlendedLabels;
use syntable_prepare::{
    Bounds, DistantLight, EmissiveBody, EnvironmentDistribution, LightTable, PreparedBody, ProjectedEnvironment,
    SampleOrder,
};
use syntable_simd::functions::FAR;
use syntable_transport::film::{GUIDE_SAMPLES, guide_seed};
use syntable_transport::{PixelFilter, RayCamera, Settings};

/// Flags of a view in `scene.wgsl`.
pub const WARPED: u32 = 1;
pub const TENT: u32 = 2;
pub const BLENDED_BY_COVERAGE: u32 = 4;
pub const ONLY_GUIDES: u32 = 8;
pub const WITHOUT_BACKGROUND: u32 = 16;

/// `View` in `scene.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct View {
    pub window: [i32; 4],
    pub origin: [f32; 4],
    pub corner: [f32; 4],
    pub along_u: [f32; 4],
    pub along_v: [f32; 4],
    pub right: [f32; 4],
    pub down: [f32; 4],
    pub rows: [[f32; 4]; 3],
    pub bodies: u32,
    pub materials: u32,
    pub layers: u32,
    pub textures: u32,
    pub lobes: u32,
    pub decode: u32,
    pub area_lights: u32,
    pub windows: u32,
    pub emitters: u32,
    pub distant_lights: u32,
    pub projection: u32,
    pub blocks: u32,
    pub warp: u32,
    pub area_count: u32,
    pub emitter_count: u32,
    pub distant_count: u32,
    pub objects: u32,
    pub foreground: u32,
    pub top_level: u32,
    pub seen: u32,
    pub reach: f32,
    pub sample_bits: u32,
    pub block_bits: u32,
    pub block_columns: u32,
    pub flags: u32,
    pub max_bounces: u32,
    pub roulette_from: u32,
    pub capacity: u32,
    pub words: u32,
    pub depth_at: u32,
    pub instance_at: u32,
    pub normal_at: u32,
    pub albedo_at: u32,
    pub coverage_at: u32,
    pub before_at: u32,
    pub sums_at: u32,
    pub object_depths_at: u32,
    pub around_width: u32,
    pub around_height: u32,
    pub tiles: u32,
    pub tile_map: u32,
    pub unused: [u32; 3],
}

/// Uniforms are read in vectors.
const _: () = assert!(size_of::<View>().is_multiple_of(16));

/// `Pass` in `scene.wgsl`.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Pass {
    pub first_pixel: u32,
    pub pixels: u32,
    pub first_sample: u32,
    pub samples: u32,
    pub bounce: u32,
    pub list: u32,
    pub is_chosen: u32,
    pub unused: u32,
}

impl GpuSession {
    /// Writes the tables of a view; gives the uniforms of its paths, and of those that are traced for guides alone.
    pub fn upload(
        &mut self,
        world: &World,
        request: &RenderRequest,
        camera: &RayCamera,
        lights: &LightTable,
        shown: &Shown,
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

        let place = |(body, (digest, tree, _)): (&PreparedBody, &(Digest, Arc<MeshTree>, Bounds))| {
            let (mesh, root) = (scene.mesh(body), self.geometry.place(digest));
            let shading = self.shading.place(digest);
            let after = |count: usize, there: bool| if there { shading + count as u32 } else { NONE };
            let (triangles, tangents) = (4 * mesh.triangles.len(), mesh.tangents.len());
            BodyPlace {
                root,
                triangles: root + tree.nodes.len() as u32,
                reach: tree.reach,
                shading,
                tangents: after(triangles, tangents > 0),
                colors: after(triangles + tangents, !mesh.colors.is_empty()),
            }
        };
        let places: Vec<BodyPlace> = scene.bodies.iter().zip(&world.bodies).map(place).collect();

        // The top level, and that of what camera rays meet.
        let leaves: Vec<_> =
            scene.bodies.iter().zip(&places).enumerate().map(|(i, (body, place))| body_node(i, body, place)).collect();
        let room = TopLevel::room(world.bodies.len()) as u32;
        let boxes = |keep: &dyn Fn(usize) -> bool| -> Vec<Bounds> {
            let of = |(number, (_, _, bounds)): (usize, &(Digest, Arc<MeshTree>, Bounds))| {
                if keep(number) { *bounds } else { Bounds::EMPTY }
            };
            world.bodies.iter().enumerate().map(of).collect()
        };
        let write_level = |place: u32, boxes: &[Bounds]| {
            let tree = TopLevel::build(boxes, &leaves);
            self.device.write(self.geometry.buffer(), u64::from(place) * 16, bytemuck::cast_slice(&tree.nodes));
            (if tree.nodes.is_empty() { NONE } else { place }, tree.depth)
        };
        let lit = boxes(&|body| shown.is_lit(body));
        let top = write_level(0, &lit);
        let own = |seen: &SeenBodies| match seen {
            SeenBodies::All => top,
            SeenBodies::Many(chosen) => write_level(room, &boxes(&|body| chosen[body])),
            // Each body has a place for a level of its own.
            SeenBodies::One(one) => {
                let place = 2 * room + *one as u32 * TopLevel::room(1) as u32;
                write_level(place, &boxes(&|body| body == *one))
            }
        };
        let levels: Vec<[(u32, usize); 2]> = (shown.tiles.iter())
            .map(|tile| {
                let seen = own(&tile.seen);
                [if tile.alone { seen } else { top }, seen]
            })
            .collect();
        let depth = levels.iter().flatten().map(|(_, depth)| *depth).fold(top.1, usize::max);
        self.walks_deep =
            depth + world.bodies.iter().map(|(_, tree, _)| tree.depth).max().unwrap_or(0) > self.short_stack as usize;
        let levels: Vec<[u32; 2]> = levels.into_iter().map(|both| both.map(|(root, _)| root)).collect();
        let [top, seen] = levels.first().copied().unwrap_or([top.0; 2]);
        let reach = lit.iter().map(Bounds::reach).fold(0.0, f32::max);

        let mut tables = Tables::default();
        let [lobes, decode] = tables.constants();
        let bodies = tables.bodies(scene.bodies.iter().zip(places));
        let materials = tables.materials(&scene.materials.materials);
        let layers = tables.layers(&scene.materials.layers);
        let textures = scene.materials.textures.iter().map(|texture| (texture, self.images.place(&texture.digest())));
        let textures = tables.textures(textures);
        let places = Environments(&self.images);
        let [area_lights, windows] = tables.area_lights(lights, &places);
        let emitters: Vec<EmissiveBody> =
            scene.emitters.iter().filter(|emitter| shown.is_lit(emitter.instance as usize)).cloned().collect();
        let emitter_count = emitters.len() as u32;
        let emitters_at =
            tables.emitters(&emitters, |emitter| scene.mesh(&scene.bodies[emitter.instance as usize]).triangles.len());
        let tiles = tables.tiles(shown.tiles.iter().zip(&levels).map(|(tile, &[all, seen])| {
            let [first, count] = tile.emitters(&emitters);
            TilePlace { offset: tile.offset(), emitters: [emitters_at + first * EMITTER_SIZE, count], all, seen }
        }));
        let distant_lights = tables.distant_lights(&lights.distant, &places);
        let projection = match scene.materials.has_projections {
            true => ProjectedEnvironment::new(&request.view.lights, lights),
            false => None,
        };
        let projection = tables.projection(projection.as_ref(), &places);
        let (settings, around) = (self.options.settings(), shown.around());
        let order = SampleOrder::new(request.stream.seed(), settings.samples);
        let [blocks, block_columns] = tables.blocks(&order, around);
        let guide_order = SampleOrder::new(guide_seed(request.stream.seed()), GUIDE_SAMPLES);
        let [guide_blocks, guide_block_columns] = tables.blocks(&guide_order, around);
        let warp = tables.warp(camera, around);
        self.buffers.tables = self.grown(&self.buffers.tables, "tables", 16 * tables.entries().len() as u64)?;
        self.device.write(&self.buffers.tables, 0, bytemuck::cast_slice(tables.entries()));

        let [width, height] = request.size;
        let vector = |v: syntable_simd::Vec3, w: f32| [v.x, v.y, v.z, w];
        let [along_u, along_v] = camera.slopes();
        let lens = camera.lens.as_ref();
        let side =
            |of: fn(&syntable_transport::Lens) -> syntable_simd::Vec3| lens.map_or(syntable_simd::Vec3::ZERO, of);
        let limit = settings.max_indirect_luminance_nits.min(FAR);
        let flag = |bit: u32, on: bool| if on { bit } else { 0 };
        let view = View {
            window: [around.x, around.y, width as i32, height as i32],
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
            emitters: emitters_at,
            distant_lights,
            projection,
            blocks,
            warp,
            area_count: lights.area.len() as u32,
            emitter_count,
            distant_count: lights.distant.len() as u32,
            objects: scene.objects as u32,
            foreground: scene.foreground as u32,
            top_level: top,
            seen,
            reach,
            sample_bits: order.sample_bits(),
            block_bits: order.block_bits(),
            block_columns,
            flags: flag(WARPED, camera.is_warped())
                | flag(TENT, settings.filter == PixelFilter::Tent)
                | flag(WITHOUT_BACKGROUND, !request.background)
                | flag(BLENDED_BY_COVERAGE, self.options.blended_labels == BlendedLabels::Coverage),
            max_bounces: settings.max_bounces,
            roulette_from: settings.roulette_from,
            around_width: around.width,
            around_height: around.height,
            tiles,
            words: scene.objects.div_ceil(32).max(1) as u32,
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
