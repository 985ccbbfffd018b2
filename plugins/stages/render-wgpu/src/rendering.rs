//! Renders views of the loaded scene: the tables of a view, then an image in one go or in rounds.

use crate::guided::guided_of;
use crate::session::{GpuSession, World};
use crate::tiles::Shown;
use crate::view::Parts;
use syntable_model::error::{Error, Result};
use syntable_model::product::Products;
use syntable_model::product::standard::{RADIANCE, RADIANCE_NOISY};
use syntable_model::stage::RenderRequest;
use syntable_prepare::LightTable;
use syntable_transport::film::Statistics;
use syntable_transport::{RayCamera, components};

impl GpuSession {
    /// Renders the wanted products of a view.
    pub fn render(&mut self, request: &RenderRequest, frame: &mut Products) -> Result<Statistics> {
        let not_loaded = || Error::new("no scene was loaded before rendering").help("call `load` first");
        let world = self.world.take().ok_or_else(not_loaded)?;
        let whole = if guided_of(request.denoiser).is_some() { RADIANCE_NOISY } else { RADIANCE };
        let rendered = components::render(request, whole, frame, |light, request, frame| {
            self.light = light;
            self.render_world(&world, request, frame)
        });
        self.world = Some(world);
        rendered
    }

    fn render_world(&mut self, world: &World, request: &RenderRequest, frame: &mut Products) -> Result<Statistics> {
        let shown = Shown::of(request, world.bodies.len())?;
        let camera = RayCamera::new(&request.view.camera, shown.around());
        let lights = LightTable::new(&request.view.lights, &self.caches.scene)?;
        let views = self.upload(&Parts { world, request, camera: &camera, lights: &lights, shown: &shown })?;
        match self.options.budget(self.light).is_fixed() {
            true => self.frame(world, request, views, frame),
            false => self.rounds(world, request, views, &camera, frame),
        }
    }
}
