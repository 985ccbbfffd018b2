//! Writers whose scenes share the options.

use crate::encode::{scene_name, view_name};
use crate::include::{self, Included, IncludedProducts};
use std::collections::BTreeSet;
use std::sync::Arc;
use syntable_model::prelude::*;
use syntable_model::product::Scope;

/// A [`Writer`] without the part that is the same in all formats: its scenes borrow the options, and
/// [`Scene`](Self::Scene) holds the state of a scene between its views. A format that writes each view separately uses
/// `()`, and implements only [`reads`](Self::reads), [`view`](Self::view) and [`paths`](Self::paths).
pub trait ImageWriter: Send + Sync + Sized + 'static {
    /// The state of a scene between its views.
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

    /// As [`Writer::for_dataset`].
    fn for_dataset(&self, has: &BTreeSet<String>) -> Option<Self> {
        let _ = has;
        None
    }

    /// As [`Writer::paths`].
    fn paths(&self, of: &FileOf) -> Vec<String>;

    /// As [`Writer::finish_options`].
    fn finish_options(&self) -> &'static [&'static str] {
        &[]
    }

    /// The writer.
    fn boxed(self) -> Box<dyn Writer> {
        Box::new(SharedWriter(Arc::new(self)))
    }
}

/// A generic writer with separate files for each view and each scene: the options, the names of the files and their
/// encoding. [`writer`](Self::writer) passes the included products, and writes the [lists of
/// the dataset](include::write_lists).
pub trait ProductWriter: Send + Sync + Sized + 'static {
    /// The option `include`.
    fn include(&self) -> &Included;

    /// Refuses products that the files cannot hold, with the reason and a remedy.
    ///
    /// # Errors
    /// If the files cannot hold products of this key.
    fn accepts(key: &KeyId) -> Result<(), String>;

    /// Paths of the files of a view or a scene; see [`Writer::paths`].
    fn paths(&self, of: &FileOf) -> Vec<String>;

    /// Writes the files of a view or a scene.
    ///
    /// # Errors
    /// If a product is missing or cannot be encoded, or a file cannot be written.
    fn write(&self, included: &IncludedProducts) -> Result<()>;

    /// The writer.
    fn writer(self) -> Box<dyn Writer> {
        GenericWriter(self).boxed()
    }
}

struct GenericWriter<W>(W);

impl<W: ProductWriter> ImageWriter for GenericWriter<W> {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        self.0.include().inputs(Accepts::when(W::accepts))
    }

    fn view(&self, (): &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let (name, shape) = (view_name(cx.scene_id, cx.view_id), include::shape(cx));
        let (include, scope, log) = (self.0.include(), Scope::View, cx.log);
        self.0.write(&IncludedProducts { include, scope, products, output, name, shape, log })
    }

    fn close(&self, (): (), cx: &ImagesContext, products: &Products, output: &Output) -> Result<()> {
        let (name, shape) = (scene_name(cx.scene_id), [0, 0]);
        let (include, scope, log) = (self.0.include(), Scope::Scene, cx.log);
        self.0.write(&IncludedProducts { include, scope, products, output, name, shape, log })
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        self.0.paths(of).into_iter().chain(self.0.include().list_paths(of)).collect()
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        self.0.include().write_lists(cx.dataset, finish)
    }
}

/// A writer shared by its scenes.
struct SharedWriter<W>(Arc<W>);

impl<W: ImageWriter> Writer for SharedWriter<W> {
    fn reads(&self) -> Vec<Input> {
        self.0.reads()
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(SharedScene { writer: Arc::clone(&self.0), output, scene: W::Scene::default() }))
    }

    fn finish(&self, cx: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        self.0.finish(cx, products, finish)
    }

    fn for_dataset(&self, has: &BTreeSet<String>) -> Option<Box<dyn Writer>> {
        self.0.for_dataset(has).map(W::boxed)
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
