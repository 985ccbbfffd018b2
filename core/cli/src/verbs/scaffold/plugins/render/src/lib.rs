//! Renderer `first_hit`: depth and ids by rays through the pixel centers, without light.

use std::sync::Arc;
use syntable_model::context::Workers;
use syntable_model::geometry::{Aabb, Point3, Vector3};
use syntable_model::prelude::*;
use syntable_model::product::standard::{DEPTH, INSTANCE};
use syntable_model::scene::Body;

/// Tests every triangle of the bodies whose boxes a ray meets. It is slow, but simple enough to check other renderers.
/// It ignores cut-outs in textures.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FirstHit {}

impl Config for FirstHit {
    type Stage = dyn Renderer;
    const KIND: &'static str = "first_hit";
    const EXAMPLE: &'static str = "";
    fn build(self) -> Result<Box<dyn Renderer>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Renderer for FirstHit {
    // Without radiance, the program refuses recipes whose writers need an image.
    fn offers(&self) -> Vec<KeyId> {
        keys![DEPTH, INSTANCE]
    }

    fn open(&self, _: usize) -> Result<Box<dyn RenderSession>> {
        Ok(Box::new(Session { scene: None }))
    }

    fn cost(&self) -> String {
        "one ray per pixel".into()
    }
}
register!(FirstHit);

/// A session renders one scene after another.
struct Session {
    scene: Option<Arc<Scene>>,
}

impl RenderSession for Session {
    fn load(&mut self, scene: &Arc<Scene>, _: &dyn Workers) -> Result<()> {
        self.scene = Some(Arc::clone(scene));
        Ok(())
    }

    fn render(&mut self, request: &RenderRequest, products: &mut Products) -> Result<()> {
        let scene = self.scene.as_ref().ok_or_else(|| Error::new("no scene is loaded"))?;
        let [width, height] = request.size;
        // Pixels without a surface have an infinite depth and show no body.
        let mut hits = Plane::from_fn(width, height, |_, _| (f64::INFINITY, InstanceId::BACKGROUND));
        for tile in &request.tiles {
            let chosen = tile.bodies.chosen(scene.bodies().len())?;
            let bodies: Vec<&Body> =
                scene.bodies().iter().zip(chosen).filter_map(|(it, is)| is.then_some(it)).collect();
            for (x, y) in (0..tile.window.height).flat_map(|y| (0..tile.window.width).map(move |x| (x, y))) {
                let center = |start: i32, step: u32| f64::from(start) + f64::from(step) + 0.5;
                let (u, v) = (center(tile.window.x, x), center(tile.window.y, y));
                // The direction has z = 1 in the camera's frame, so its parameter is the depth.
                let camera = &request.view.camera;
                let Some(seen) = camera.unproject(u, v) else { continue };
                let direction = camera.world_from_camera.rotation * seen;
                let eye = Point3::from(camera.world_from_camera.translation.vector);
                let at = (tile.at[1] + y) as usize * width as usize + (tile.at[0] + x) as usize;
                for body in &bodies {
                    let depth = nearest_in(body, eye, direction);
                    if depth < hits.data()[at].0 {
                        hits.data_mut()[at] = (depth, body.id);
                    }
                }
            }
        }
        // A renderer provides exactly the products that the plan wants.
        for key in request.wants {
            if *key == DEPTH.id() {
                products.put(DEPTH, hits.map(|(depth, _)| *depth as f32))?;
            } else if *key == INSTANCE.id() {
                products.put(INSTANCE, hits.map(|(_, id)| *id))?;
            }
        }
        Ok(())
    }
}

/// Parameter of the nearest hit of a ray, infinite without one.
fn nearest_in(body: &Body, eye: Point3<f64>, direction: Vector3<f64>) -> f64 {
    let (eye, direction) = (body.world_from_body.inverse() * eye, body.world_from_body.inverse() * direction);
    let mesh = &body.object.mesh;
    if !meets(&mesh.bounds(), &eye, &direction) {
        return f64::INFINITY;
    }
    let hit = |triangle: usize| {
        let [a, b, c] = mesh.corners(triangle);
        let (ab, ac, from_a) = (b - a, c - a, eye - a);
        let normal = direction.cross(&ac);
        let scale = 1.0 / ab.dot(&normal);
        let u = from_a.dot(&normal) * scale;
        let other = from_a.cross(&ab);
        let (v, depth) = (direction.dot(&other) * scale, ac.dot(&other) * scale);
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && depth > 0.0).then_some(depth)
    };
    (0..mesh.data().triangles.len()).filter_map(hit).fold(f64::INFINITY, f64::min)
}

/// Whether a ray meets a box.
fn meets(bounds: &Aabb, eye: &Point3<f64>, direction: &Vector3<f64>) -> bool {
    let (mut near, mut far) = (0.0_f64, f64::INFINITY);
    for axis in 0..3 {
        let [a, b] = [bounds.min[axis], bounds.max[axis]].map(|side| (side - eye[axis]) / direction[axis]);
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    near <= far
}
