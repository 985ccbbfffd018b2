//! Annotators make products from products: once per view, moment, scene or dataset.

use crate::context::{DatasetContext, FrameContext, ImageContext, SceneContext, ViewContext};
use crate::error::Result;
use crate::product::{KeyId, Products};
use crate::scene::{SceneId, View};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Annotates each image from its products, as a pure function of these. It also serves datasets that were read.
pub trait ImageAnnotator: Send + Sync {
    /// The products that it reads, of the view, its moment or the scene.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the view.
    fn provides(&self) -> Vec<KeyId>;
    /// Puts all that it provides into `products`, which holds what it reads.
    ///
    /// # Errors
    /// Fail the attempt at the scene.
    fn annotate(&self, cx: &ImageContext, products: &mut Products) -> Result<()>;
    /// Groups of its products that it can make separately. If a dataset that was read lacks the input of a group,
    /// [`annotate`](Self::annotate) leaves the group out.
    fn groups(&self) -> Vec<ProductGroup> {
        vec![ProductGroup { reads: self.reads(), provides: self.provides() }]
    }
}

/// Annotates each view of a scene that the program made, as a pure function of bodies, camera, lights and products.
pub trait ViewAnnotator: Send + Sync {
    /// The products that it reads, of the view, its moment or the scene.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the view.
    fn provides(&self) -> Vec<KeyId>;
    /// Puts all that it provides into `products`, which holds what it reads.
    ///
    /// # Errors
    /// Fail the attempt at the scene.
    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()>;
}

/// Products, and the products that they are made from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProductGroup {
    /// The products that are read.
    pub reads: Vec<KeyId>,
    /// The products that are provided.
    pub provides: Vec<KeyId>,
}

/// Annotates each moment of a scene that the program made, as a pure function of the bodies at this moment and of products. It
/// runs once for all views at the moment, before the first of them is rendered.
pub trait FrameAnnotator: Send + Sync {
    /// The products that it reads, of the moment, or of the scene before its views. It cannot read products of views.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the moment ([`Scope::Frame`](crate::product::Scope::Frame)).
    fn provides(&self) -> Vec<KeyId>;
    /// Puts all that it provides into `products`, which holds what it reads.
    ///
    /// # Errors
    /// Fail the attempt at the scene.
    fn annotate(&self, cx: &FrameContext, products: &mut Products) -> Result<()>;
}

/// Annotates each scene, from its bodies or from the products of all its views.
pub trait SceneAnnotator: Send + Sync {
    /// The products that it reads, of the scene, or of each view and its moment. If it reads products of views or moments, it
    /// runs after the views, and no stage of a view can read what it provides.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the scene.
    fn provides(&self) -> Vec<KeyId>;
    /// Puts all that it provides into `products`, which holds the products of the scene that it reads. `views` has all
    /// views in order, each with the products that it reads. `views` is empty if the annotator runs before the views.
    ///
    /// # Errors
    /// Fail the attempt at the scene.
    fn annotate(&self, cx: &SceneContext, views: &[ViewProducts], products: &mut Products) -> Result<()>;
}

/// A view with some of its products.
#[derive(Clone)]
pub struct ViewProducts {
    /// Camera, exposure and lights.
    pub view: Arc<View>,
    /// The products that the reader declared.
    pub products: Products,
}

/// Annotates the dataset, at the end of every run, from the recorded products of all scenes that are done.
pub trait DatasetAnnotator: Send + Sync {
    /// The products that it reads, of each scene, moment or view. The run records them as JSON when a scene is done, so a
    /// resumed run has the products of earlier scenes.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the dataset.
    fn provides(&self) -> Vec<KeyId>;
    /// Puts all that it provides into `products`. `scenes` gives the scenes in order, one in memory at a time.
    ///
    /// # Errors
    /// The run reports them. A permanent error or an error of a file stops the run after its first scene.
    fn annotate(
        &self,
        cx: &DatasetContext,
        scenes: &mut dyn Iterator<Item = Result<RecordedScene>>,
        products: &mut Products,
    ) -> Result<()>;
}

/// The recorded products of a scene that is done.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedScene {
    /// The scene.
    pub scene: SceneId,
    /// Products of the scene by name, encoded as JSON.
    pub scene_values: BTreeMap<String, serde_json::Value>,
    /// Products of each view and its moment by name, in order of the views, encoded as JSON.
    pub view_values: Vec<BTreeMap<String, serde_json::Value>>,
}
