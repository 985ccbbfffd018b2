//! Make products from products: once per view, per scene or per dataset.

use crate::context::{DatasetContext, ImageContext, SceneContext, ViewContext};
use crate::error::Result;
use crate::product::{KeyId, Products};
use crate::scene::{SceneId, View};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Annotates each image from its products. A pure function of these: it also serves datasets that were read.
pub trait ImageAnnotator: Send + Sync {
    /// The products that it reads, of the view or the scene.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the view.
    fn provides(&self) -> Vec<KeyId>;
    /// Makes all of them and puts them into `products`, which holds those that it reads.
    ///
    /// # Errors
    /// Fail the attempt at the scene.
    fn annotate(&self, cx: &ImageContext, products: &mut Products) -> Result<()>;
    /// Groups of what it provides that can be made apart. A dataset that was read may lack what a group reads: then
    /// [`annotate`](Self::annotate) finds it missing and leaves the group out.
    fn groups(&self) -> Vec<ProductGroup> {
        vec![ProductGroup { reads: self.reads(), provides: self.provides() }]
    }
}

/// Annotates each view of a scene that the program made, from bodies, camera and lights as well as products. A pure function of
/// these.
pub trait ViewAnnotator: Send + Sync {
    /// The products that it reads, of the view or the scene.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the view.
    fn provides(&self) -> Vec<KeyId>;
    /// Makes all of them and puts them into `products`, which holds those that it reads.
    ///
    /// # Errors
    /// Fail the attempt at the scene.
    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()>;
}

/// Products, and those that they are made from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProductGroup {
    /// What is read.
    pub reads: Vec<KeyId>,
    /// What is provided.
    pub provides: Vec<KeyId>,
}

/// Annotates each scene, from its bodies or from the products of all its views.
pub trait SceneAnnotator: Send + Sync {
    /// The products that it reads, of the scene or of each view. If it reads products of views, it runs after the views,
    /// and no stage of a view can read what it provides.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the scene.
    fn provides(&self) -> Vec<KeyId>;
    /// Makes all of them and puts them into `products`, which holds the products of the scene that it reads. `views`
    /// holds all views in order, each with the products that it reads; it is empty if it reads none of views.
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
    /// The products that it reads, of each scene or of each view. They are recorded as JSON when a scene is done, so that
    /// a run that is resumed has those of earlier scenes.
    fn reads(&self) -> Vec<KeyId>;
    /// The products that it provides, of the dataset.
    fn provides(&self) -> Vec<KeyId>;
    /// Makes all of them and puts them into `products`. `scenes` gives the scenes in order, one in memory at a time.
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
    /// Products of each view by name, in order of the views, encoded as JSON.
    pub view_values: Vec<BTreeMap<String, serde_json::Value>>,
}
