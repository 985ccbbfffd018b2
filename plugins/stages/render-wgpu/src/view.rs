//! The tables and uniforms of a view.

use crate::arena::{Arena, Asset, Place};
use crate::layout::{
    BLENDED_BY_COVERAGE, BodyPlace, EMITTER_SIZE, HOLDS_OUT, LABELS_THROUGH_GLASS, NONE, TENT, View, WARPED,
    WITHOUT_BACKGROUND, WITHOUT_SHADOWS,
};
use crate::session::{GpuSession, World, body_nodes_at};
use crate::tables::{EnvironmentPlaces, Tables, TilePlace};
use crate::tiles::{SeenBodies, Shown};
use crate::trees::{MeshTree, TopLevel, body_node};
use std::sync::Arc;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::Result;
use syntable_model::scene::EnvironmentMap;
use syntable_model::stage::{Bodies, RenderRequest};
use syntable_prepare::labels::BlendedLabels;
use syntable_prepare::{
    Bounds, DistantLight, EmissiveBody, EnvironmentDistribution, LightTable, MipLevel, MipTexture, PreparedBody,
    ProjectedEnvironment, SampleOrder,
};
use syntable_simd::Vec3;
use syntable_simd::functions::FAR;
use syntable_transport::film::{GUIDE_SAMPLES, guide_seed};
use syntable_transport::{Lens, PixelFilter, RayCamera, Settings};

/// Sources of the tables and uniforms.
pub struct Parts<'a> {
    pub world: &'a World,
    pub request: &'a RenderRequest<'a>,
    pub camera: &'a RayCamera,
    pub lights: &'a LightTable,
    pub shown: &'a Shown,
}

/// The top levels that the rays of a view walk.
struct Levels {
    /// First vector of the top level of all lit bodies; [`NONE`] without bodies.
    all: u32,
    /// For each tile: the top level for bounces and shadow rays, and the top level for camera rays.
    by_tile: Vec<[u32; 2]>,
    /// Largest absolute coordinate of a lit body.
    reach: f32,
}

impl GpuSession {
    /// Writes the tables of a view; returns the uniforms of its paths, and the uniforms of paths that only gather
    /// guides.
    pub fn upload(&mut self, parts: &Parts) -> Result<[View; 2]> {
        let mut images: Vec<_> = parts.world.scene.materials.textures.iter().map(texture_asset).collect();
        images.extend(environment_assets(parts.lights));
        self.images.keep(&self.device, 0, &images)?;
        drop(images);
        let places = self.body_places(parts.world);
        let levels = self.write_levels(parts, &places);
        let mut tables = Tables::default();
        let view = self.tabulate(&mut tables, parts, &places, &levels);
        let views = self.with_camera(&mut tables, view, parts);
        self.grow(|buffers| &mut buffers.tables, "tables", 16 * tables.entries().len() as u64)?;
        self.device.write(&self.buffers.tables, 0, bytemuck::cast_slice(tables.entries()));
        Ok(views)
    }

    /// Places of the geometry and the shading of every body.
    fn body_places(&self, World { scene, bodies }: &World) -> Vec<BodyPlace> {
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
        scene.bodies.iter().zip(bodies).map(place).collect()
    }

    /// Writes the top level of all lit bodies, and the top levels for camera rays of tiles; chooses the size of stacks.
    fn write_levels(&mut self, &Parts { world, shown, .. }: &Parts, places: &[BodyPlace]) -> Levels {
        let leaves: Vec<_> = (world.scene.bodies.iter().zip(places).enumerate())
            .map(|(number, (body, place))| body_node(number, body, place))
            .collect();
        if self.device.has_queries() {
            let at = 16 * body_nodes_at(world.bodies.len()) as u64;
            self.device.write(self.geometry.buffer(), at, bytemuck::cast_slice(&leaves));
        }
        let room = TopLevel::room(world.bodies.len()) as u32;
        let boxes = |keep: &dyn Fn(usize) -> bool| -> Vec<Bounds> {
            let of = |(number, (_, _, bounds)): (usize, &(Digest, Arc<MeshTree>, Bounds))| {
                if keep(number) { *bounds } else { Bounds::EMPTY }
            };
            world.bodies.iter().enumerate().map(of).collect()
        };
        let mut levels_of_trees = 0;
        let mut write = |place: u32, boxes: &[Bounds]| {
            let tree = TopLevel::build(boxes, &leaves);
            self.device.write(self.geometry.buffer(), u64::from(place) * 16, bytemuck::cast_slice(&tree.nodes));
            levels_of_trees = levels_of_trees.max(tree.depth);
            if tree.nodes.is_empty() { NONE } else { place }
        };
        let lit = boxes(&|body| shown.is_lit(body));
        let all = write(0, &lit);
        let mut own = |seen: &SeenBodies| match seen {
            SeenBodies::All => all,
            SeenBodies::Many(chosen) => write(room, &boxes(&|body| chosen[body])),
            // Each body has a place for a top level of its own.
            SeenBodies::One(one) => {
                let place = 2 * room + *one as u32 * TopLevel::room(1) as u32;
                write(place, &boxes(&|body| body == *one))
            }
        };
        let by_tile = (shown.tiles.iter())
            .map(|tile| {
                let seen = own(&tile.seen);
                [if tile.alone { seen } else { all }, seen]
            })
            .collect();
        levels_of_trees += world.bodies.iter().map(|(_, tree, _)| tree.depth).max().unwrap_or(0);
        self.walks_deep = levels_of_trees > self.short_stack as usize;
        Levels { all, by_tile, reach: lit.iter().map(Bounds::reach).fold(0.0, f32::max) }
    }

    /// Puts bodies, materials and lights into tables; returns uniforms with their places.
    fn tabulate(&self, tables: &mut Tables, parts: &Parts, places: &[BodyPlace], levels: &Levels) -> View {
        let &Parts { world, request, lights, shown, .. } = parts;
        let scene = &world.scene;
        let [lobes, decode] = tables.constants();
        let bodies = tables.bodies(scene.bodies.iter().zip(places.iter().copied()));
        let materials = tables.materials(&scene.materials.materials);
        let layers = tables.layers(&scene.materials.layers);
        let textures = scene.materials.textures.iter().map(|texture| (texture, self.images.place(&texture.digest())));
        let textures = tables.textures(textures);
        let environments = Environments(&self.images);
        let [area_lights, windows] = tables.area_lights(lights, &environments);
        let lit = scene.emitters.iter().filter(|emitter| shown.is_lit(emitter.instance as usize));
        let lit: Vec<EmissiveBody> = lit.cloned().collect();
        let triangles = |emitter: &EmissiveBody| scene.mesh(&scene.bodies[emitter.instance as usize]).triangles.len();
        let emitters = tables.emitters(&lit, triangles);
        let tiles = tables.tiles(shown.tiles.iter().zip(&levels.by_tile).map(|(tile, &[all, seen])| {
            let [first, count] = tile.emitters(&lit);
            TilePlace { offset: tile.offset(), emitters: [emitters + first * EMITTER_SIZE, count], all, seen }
        }));
        let distant_lights = tables.distant_lights(&lights.distant, &environments);
        let projection = match scene.materials.has_projections {
            true => ProjectedEnvironment::new(&request.view.lights, lights),
            false => None,
        };
        let [top_level, seen] = levels.by_tile.first().copied().unwrap_or([levels.all; 2]);
        View {
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
            projection: tables.projection(projection.as_ref(), &environments),
            area_count: lights.area.len() as u32,
            emitter_count: lit.len() as u32,
            distant_count: lights.distant.len() as u32,
            objects: scene.objects as u32,
            foreground: scene.foreground as u32,
            words: scene.objects.div_ceil(32).max(1) as u32,
            top_level,
            seen,
            tiles,
            body_nodes: body_nodes_at(world.bodies.len()) as u32,
            reach: levels.reach,
            ..View::default()
        }
    }

    /// Adds the camera, the order of samples and the options to uniforms: for paths, and for paths that only gather
    /// guides.
    fn with_camera(&self, tables: &mut Tables, view: View, parts: &Parts) -> [View; 2] {
        let &Parts { request, camera, shown, .. } = parts;
        let (settings, around) = (self.options.settings(self.light), shown.around());
        let order = SampleOrder::new(request.stream.seed(), settings.samples);
        let [blocks, block_columns] = tables.blocks(&order, around);
        let guide_order = SampleOrder::new(guide_seed(request.stream.seed()), GUIDE_SAMPLES);
        let [guide_blocks, guide_block_columns] = tables.blocks(&guide_order, around);
        let [width, height] = request.size;
        let vector = |v: Vec3, w: f32| [v.x, v.y, v.z, w];
        let corner = |settings: Settings| vector(camera.corner(0, 0), settings.spread(camera.pixel_angle));
        let [along_u, along_v] = camera.slopes();
        let lens = camera.lens.as_ref();
        let side = |of: fn(&Lens) -> Vec3| lens.map_or(Vec3::ZERO, of);
        let flag = |bit: u32, on: bool| if on { bit } else { 0 };
        let view = View {
            window: [around.x, around.y, width as i32, height as i32],
            origin: vector(camera.origin(), camera.pixel_angle),
            corner: corner(settings),
            along_u: vector(along_u, lens.map_or(0.0, |lens| lens.focus)),
            along_v: vector(along_v, settings.regularize),
            right: vector(side(|lens| lens.right), settings.max_indirect_luminance_nits.min(FAR)),
            down: vector(side(|lens| lens.down), 0.0),
            rows: camera.rows().map(|row| vector(row, 0.0)),
            blocks,
            warp: tables.warp(camera, around),
            sample_bits: order.sample_bits(),
            block_bits: order.block_bits(),
            block_columns,
            flags: flag(WARPED, camera.is_warped())
                | flag(TENT, settings.filter == PixelFilter::Tent)
                | flag(WITHOUT_BACKGROUND, !request.background)
                | flag(WITHOUT_SHADOWS, !settings.shadows)
                | flag(HOLDS_OUT, request.tiles.iter().any(|tile| tile.bodies == Bodies::Foreground))
                | flag(BLENDED_BY_COVERAGE, self.options.blended_labels != BlendedLabels::Shape)
                | flag(LABELS_THROUGH_GLASS, self.options.blended_labels == BlendedLabels::Opaque),
            max_bounces: settings.max_bounces,
            roulette_from: settings.roulette_from,
            around_width: around.width,
            around_height: around.height,
            ..view
        };
        let guide_view = View {
            corner: corner(Settings { samples: GUIDE_SAMPLES, ..settings }),
            blocks: guide_blocks,
            block_columns: guide_block_columns,
            sample_bits: guide_order.sample_bits(),
            block_bits: guide_order.block_bits(),
            ..view
        };
        [view, guide_view]
    }
}

/// The levels of a texture, as an image.
fn texture_asset(texture: &Arc<MipTexture>) -> Asset<'static> {
    let texture = texture.clone();
    let texels = |level: &MipLevel| level.width as usize * level.height as usize;
    Asset {
        digest: texture.digest(),
        count: texture.levels().iter().map(|level| texels(level) as u64).sum(),
        bytes: Box::new(move || {
            let bytes = |level: &MipLevel| texture.texels(*level)[..texels(level)].as_flattened();
            texture.levels().iter().map(bytes).collect::<Vec<_>>().concat()
        }),
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

/// Environment maps of the lights of a view, and the distributions of the sampled maps.
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
