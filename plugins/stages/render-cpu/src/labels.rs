//! All labels from one cast per pixel: the bodies on the ray through the pixel center, at any depth.
//!
//! The first hits in every body decide all labels: the nearest hit gives the visible body, and all hits together give
//! the coverage. Both come from the same hits, so a visible object always covers its pixel. Of bodies at equal depth,
//! the body with the lower id is in front, so objects come before distractors, supports and room parts.

use crate::world::World;
use parking_lot::Mutex;
use syntable_bvh::{Hit, Ray, SceneBvh};
use syntable_model::context::Workers;
use syntable_model::product::{BitPlane, Plane};
use syntable_model::scene::InstanceId;
use syntable_model::stage::Window;
use syntable_prepare::ProjectedEnvironment;
use syntable_prepare::labels::{BASE_LAYER, BlendedLabels, instance_id};
use syntable_simd::Vec3;
use syntable_transport::RayCamera;
use syntable_transport::surface::surface;

/// Edge of the squares of pixels that are cast together.
const TILE: i32 = 8;

/// The planes to fill; `None` for labels that are not wanted.
#[derive(Debug, Default)]
pub(crate) struct Labels {
    pub depth: Option<Plane<f32>>,
    pub instance: Option<Plane<InstanceId>>,
    pub normal: Option<Plane<[f32; 3]>>,
    pub albedo: Option<Plane<[f32; 3]>>,
    pub coverage: Option<BitPlane>,
    pub coverage_before_support: Option<BitPlane>,
    /// Hits in objects, from which `ObjectDepths` is made.
    pub object_depths: Option<Vec<(u32, InstanceId, f32)>>,
}

/// Hits of one pixel's ray.
#[derive(Clone, Copy)]
struct Pixel {
    /// Column and row in the image.
    x: i32,
    y: i32,
    /// The nearest hit.
    first: Option<Hit>,
    /// Depth of the nearest body that is not an object.
    support: f32,
}

/// Casts labels of a view.
pub(crate) struct LabelCaster<'a> {
    world: &'a World,
    camera: &'a RayCamera,
    window: Window,
    blended: BlendedLabels,
    /// For materials that show the environment.
    projection: Option<&'a ProjectedEnvironment>,
    /// Bodies with cut-outs, and with glass that labels look through. Each has a tree of its own, since hits on them
    /// must be tested.
    cutouts: Vec<(u32, SceneBvh)>,
}

/// One square's results.
struct Tile {
    pixels: Vec<Pixel>,
    /// Position in `pixels`, body, and depth of the first hit in it.
    hits: Vec<(u32, Hit)>,
}

impl<'a> LabelCaster<'a> {
    pub fn new(
        world: &'a World,
        camera: &'a RayCamera,
        window: Window,
        blended: BlendedLabels,
        projection: Option<&'a ProjectedEnvironment>,
    ) -> Self {
        let cutouts =
            (0..world.scene.bodies.len()).filter(|&i| world.is_seen(i) && world.scene.bodies[i].is_tested(blended));
        let cutouts = cutouts.map(|i| (i as u32, world.alone(i))).collect();
        Self { world, camera, window, blended, projection, cutouts }
    }

    /// Fills the planes.
    pub fn cast(&self, labels: &mut Labels, workers: &dyn Workers) {
        let window = self.window;
        let bands = window.height.div_ceil(TILE as u32);
        let shaded = labels.normal.is_some() || labels.albedo.is_some();
        let labels = Mutex::new(labels);
        workers.run(bands as usize, &|band| {
            let top = window.y + band as i32 * TILE;
            let bottom = (top + TILE).min(window.bottom());
            for left in (window.x..window.right()).step_by(TILE as usize) {
                let right = (left + TILE).min(window.right());
                let tile = self.tile([left, top, right, bottom]);
                let surfaces: Vec<_> = tile.pixels.iter().map(|pixel| self.surface(pixel, shaded)).collect();
                let mut labels = labels.lock();
                self.store(&mut labels, &tile, &surfaces);
            }
        });
    }

    /// Casts the rays of a square [left, top, right, bottom].
    fn tile(&self, [left, top, right, bottom]: [i32; 4]) -> Tile {
        let place = (top..bottom).flat_map(|y| (left..right).map(move |x| (x, y)));
        let pixels = place.map(|(x, y)| Pixel { x, y, first: None, support: f32::INFINITY });
        let mut tile = Tile { pixels: pixels.collect(), hits: Vec::new() };
        // Pixels outside the image of the lens have no ray; the others keep their order.
        let seen: Vec<(usize, Ray)> =
            tile.pixels.iter().enumerate().filter_map(|(number, pixel)| Some((number, self.ray(pixel)?))).collect();
        let rays: Vec<Ray> = seen.iter().map(|(_, ray)| *ray).collect();
        self.world.seen().all_instances_tile(&rays, 0.0, f32::INFINITY, |number, hit| {
            if !self.world.scene.bodies[hit.instance as usize].is_tested(self.blended) {
                tile.hits.push((seen[number].0 as u32, hit));
            }
        });
        for (instance, tree) in &self.cutouts {
            for &(number, ref ray) in &seen {
                let solid = |hit: &Hit| self.world.is_labeled(hit, ray, *instance, self.blended);
                if let Some(hit) = tree.closest_where(ray, 0.0, f32::INFINITY, solid) {
                    tile.hits.push((number as u32, Hit { instance: *instance, ..hit }));
                }
            }
        }
        for &(number, hit) in &tile.hits {
            let pixel = &mut tile.pixels[number as usize];
            if pixel.first.is_none_or(|first| (hit.t, hit.instance) < (first.t, first.instance)) {
                pixel.first = Some(hit);
            }
            if hit.instance as usize >= self.world.scene.foreground && hit.t < pixel.support {
                pixel.support = hit.t;
            }
        }
        for pixel in &mut tile.pixels {
            pixel.first = pixel.first.filter(|hit| !self.world.is_held_out(hit.instance));
        }
        tile
    }

    /// Column and row in the window.
    fn place(&self, pixel: &Pixel) -> (u32, u32) {
        ((pixel.x - self.window.x) as u32, (pixel.y - self.window.y) as u32)
    }

    fn ray(&self, pixel: &Pixel) -> Option<Ray> {
        self.camera.ray(f64::from(pixel.x) + 0.5, f64::from(pixel.y) + 0.5)
    }

    /// Normal in the camera's frame, and base color, of the visible surface of a pixel.
    fn surface(&self, pixel: &Pixel, shaded: bool) -> [[f32; 3]; 2] {
        match pixel.first {
            Some(hit) if shaded => {
                let Some(ray) = self.ray(pixel) else { return [[0.0; 3]; 2] };
                let direction = Vec3::from(ray.direction);
                let distance = hit.t * direction.length();
                let width = self.camera.pixel_angle * distance;
                let (origin, along) = (ray.origin.into(), direction.normalized());
                let (scene, point) = (&self.world.scene, hit.point());
                let surface = surface(scene, &point, origin, along, distance, width, BASE_LAYER, self.projection);
                [self.camera.rotate_to_camera(surface.normal).array(), surface.albedo.array()]
            }
            _ => [[0.0; 3]; 2],
        }
    }

    fn store(&self, labels: &mut Labels, tile: &Tile, surfaces: &[[[f32; 3]; 2]]) {
        for (pixel, [normal, albedo]) in tile.pixels.iter().zip(surfaces) {
            let (column, row) = self.place(pixel);
            let index = row as usize * self.window.width as usize + column as usize;
            if let Some(depth) = &mut labels.depth {
                depth.data_mut()[index] = pixel.first.map_or(f32::INFINITY, |hit| hit.t);
            }
            if let Some(instance) = &mut labels.instance {
                instance.data_mut()[index] =
                    pixel.first.map_or(InstanceId::BACKGROUND, |hit| instance_id(hit.instance));
            }
            if let Some(plane) = &mut labels.normal {
                plane.data_mut()[index] = *normal;
            }
            if let Some(plane) = &mut labels.albedo {
                plane.data_mut()[index] = *albedo;
            }
        }
        for &(number, hit) in &tile.hits {
            if hit.instance as usize >= self.world.scene.objects {
                continue;
            }
            let pixel = &tile.pixels[number as usize];
            let (column, row) = self.place(pixel);
            if let Some(hits) = &mut labels.object_depths {
                hits.push((row * self.window.width + column, instance_id(hit.instance), hit.t));
            }
            if let Some(plane) = &mut labels.coverage {
                plane.insert(column, row, instance_id(hit.instance));
            }
            if let Some(plane) = &mut labels.coverage_before_support
                && hit.t <= pixel.support
            {
                plane.insert(column, row, instance_id(hit.instance));
            }
        }
    }
}
