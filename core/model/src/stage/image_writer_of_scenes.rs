//! A writer of images among writers of scenes.

use crate::context::{DatasetContext, SceneContext, ViewContext};
use crate::error::Result;
use crate::product::Products;
use crate::stage::{FileOf, Finish, Input, Output, SceneWriter, Scenes, Writer};

impl dyn Writer {
    /// The same writer for scenes that the program made. It still gets only their images and labels.
    pub fn of_scenes(self: Box<Self>) -> Box<dyn Writer<Scenes>> {
        Box::new(ImageWriterOfScenes(self))
    }
}

/// A writer of images, or its writer of one scene.
struct ImageWriterOfScenes<W>(W);

impl Writer<Scenes> for ImageWriterOfScenes<Box<dyn Writer>> {
    fn reads(&self) -> Vec<Input> {
        self.0.reads()
    }

    fn scene(&self, cx: &SceneContext, output: Output) -> Result<Box<dyn SceneWriter<Scenes>>> {
        Ok(Box::new(ImageWriterOfScenes(self.0.scene(cx, output)?)))
    }

    fn finish(&self, cx: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        self.0.finish(cx, products, finish)
    }

    fn needs_obj_ids(&self) -> bool {
        self.0.needs_obj_ids()
    }

    fn needs_sizes_of_assets(&self) -> bool {
        self.0.needs_sizes_of_assets()
    }

    fn ready(&self) -> Result<()> {
        self.0.ready()
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        self.0.paths(of)
    }

    fn finish_options(&self) -> &'static [&'static str] {
        self.0.finish_options()
    }
}

impl SceneWriter<Scenes> for ImageWriterOfScenes<Box<dyn SceneWriter>> {
    fn view(&mut self, cx: &ViewContext, products: &Products) -> Result<()> {
        self.0.view(cx, products)
    }

    fn close(self: Box<Self>, cx: &SceneContext, products: &Products) -> Result<()> {
        self.0.close(cx, products)
    }
}
