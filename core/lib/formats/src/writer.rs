//! Writers whose scenes share the options.

use std::sync::Arc;
use syntable_model::prelude::*;

/// A [`Writer`] without the part that is the same in all formats: its scenes borrow the options, and [`Scene`](Self::Scene) holds
/// what a scene keeps between its views. A format that writes each view by itself keeps `()`, and needs
/// [`reads`](Self::reads) and [`view`](Self::view) alone.
pub trait ImageWriter: Send + Sync + Sized + 'static {
    /// What a scene keeps between its views.
    type Scene: Default + Send;

    /// As [`Writer::reads`].
    fn reads(&self) -> Vec<Input>;

    /// Writes one view; see [`SceneWriter::view`].
    ///
    /// # Errors
    /// If a product is missing, or a file cannot be written.
    fn view(&self, scene: &mut Self::Scene, cx: &ImageContext, products: &Products, output: &Output) -> Result<()>;

    /// Ends the scene; see [`SceneWriter::close`].
    ///
    /// # Errors
    /// If a product is missing, or a file cannot be written.
    fn close(&self, scene: Self::Scene, cx: &ImagesContext, products: &Products, output: &Output) -> Result<()> {
        let _ = (scene, cx, products, output);
        Ok(())
    }

    /// As [`Writer::finish`].
    ///
    /// # Errors
    /// If a shard cannot be read, or a file cannot be written.
    fn finish(&self, cx: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        let _ = (cx, products, finish);
        Ok(())
    }

    /// As [`Writer::paths`].
    fn paths(&self, of: &FileOf) -> Vec<String>;

    /// As [`Writer::finish_options`].
    fn finish_options(&self) -> &'static [&'static str] {
        &[]
    }

    /// The writer.
    fn boxed(self) -> Box<dyn Writer> {
        Box::new(Shared(Arc::new(self)))
    }
}

/// A writer that its scenes share.
struct Shared<W>(Arc<W>);

impl<W: ImageWriter> Writer for Shared<W> {
    fn reads(&self) -> Vec<Input> {
        self.0.reads()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(SharedScene { writer: Arc::clone(&self.0), output, scene: W::Scene::default() }))
    }

    fn finish(&self, cx: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        self.0.finish(cx, products, finish)
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        Ok(self.0.paths(of))
    }

    fn finish_options(&self) -> &'static [&'static str] {
        self.0.finish_options()
    }
}

struct SharedScene<W: ImageWriter> {
    writer: Arc<W>,
    output: Output,
    scene: W::Scene,
}

impl<W: ImageWriter> SceneWriter for SharedScene<W> {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        self.writer.view(&mut self.scene, cx, products, &self.output)
    }

    fn close(self: Box<Self>, cx: &ImagesContext, products: &Products) -> Result<()> {
        let Self { writer, output, scene } = *self;
        writer.close(scene, cx, products, &output)
    }
}
