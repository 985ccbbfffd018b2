//! The stages of the pipeline, one trait per file.
//!
//! asset sources → placers → settler → per view: view sampler, camera, light samplers, renderer, denoiser → sensors →
//! annotators → writers.
//!
//! All traits are object-safe and take `&self`. A stage never changes after its construction, and returns the state that a run must
//! remember. It receives its random numbers.

mod annotator;
mod asset_source;
mod atlas;
mod camera_model;
mod denoiser;
mod image_writer_of_scenes;
mod light_sampler;
mod output;
mod placer;
mod renderer;
mod sensor;
mod settler;
mod subject;
mod view_sampler;
mod window;
mod writer;

pub use annotator::{
    DatasetAnnotator, FrameAnnotator, ImageAnnotator, ProductGroup, RecordedScene, SceneAnnotator, ViewAnnotator,
    ViewProducts,
};
pub use asset_source::{AssetLimits, AssetSource};
pub use atlas::{Atlas, AtlasTile};
pub use camera_model::CameraModel;
pub use denoiser::Denoiser;
pub use light_sampler::LightSampler;
pub use output::{
    DAMAGED, FileWriter, Finish, Output, RESERVED, check_path, is_shared, path_of_scene, shard_path, unreadable,
};
pub use placer::{Companions, Part, PartUse, Placer};
pub use renderer::{Bodies, DeviceClass, LabelSurface, RenderDevice, RenderRequest, RenderSession, Renderer, Tile};
pub use sensor::Sensor;
pub use settler::Settler;
pub use subject::{Images, Scenes, Subject};
pub use view_sampler::{Shell, ViewSampler};
pub use window::Window;
pub use writer::{Accepts, FileOf, Input, InputNeed, SceneWriter, Writer};

use crate::error::{Error, Result};
use crate::product::KeyId;

/// Facts about the dataset that every stage may know.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DatasetInfo {
    /// `dataset.name` of the recipe.
    pub name: String,
    /// `dataset.seed`.
    pub seed: u64,
    /// `dataset.scenes`.
    pub scenes: u32,
    /// `dataset.views_per_scene`, or the number of views of the scene at hand: the first scenes of a grown dataset may have
    /// fewer.
    pub views_per_scene: u32,
    /// Text of the resolved recipe, without the digests of its inputs.
    pub recipe: String,
    /// Name and version of the program.
    pub program: String,
    /// Names of the classes of the recipe's pools, sorted, without `object`.
    pub classes: Vec<String>,
    /// The categories of a dataset that was read and has ids, ascending. Empty if they follow from `classes`.
    pub own_categories: Vec<OwnCategory>,
    /// Which surface the labels of the renderer describe.
    pub label_surface: LabelSurface,
}

/// A category of a dataset that was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OwnCategory {
    /// Its id, from 1.
    pub id: u32,
    /// Such as `mug`.
    pub name: String,
    /// COCO's supercategory, such as `kitchen`. Empty if it has none.
    pub supercategory: String,
}

impl DatasetInfo {
    /// Id and name of the category of objects without a class. Every dataset has it.
    pub const OBJECT: (u32, &'static str) = (1, "object");

    /// Ids and names of the categories of annotation files: the dataset's own, or else [`OBJECT`](Self::OBJECT) and then the classes
    /// by name, from 2. In a run they depend only on the recipe, not on the drawn assets.
    pub fn categories(&self) -> impl Iterator<Item = (u32, &str)> {
        let own = self.own_categories.iter().map(|own| (own.id, own.name.as_str()));
        let of_classes = std::iter::once(Self::OBJECT)
            .chain((Self::OBJECT.0 + 1..).zip(self.classes.iter().map(String::as_str)))
            .filter(|_| self.own_categories.is_empty());
        own.chain(of_classes)
    }

    /// Id of the category of an object in annotation files: the category of its class, or else `object`.
    ///
    /// # Errors
    /// If the dataset has its own categories, and neither is among them.
    pub fn category_id(&self, class: &str) -> Result<u32> {
        let of = |name: &str| self.categories().find(|(_, other)| *other == name).map(|(id, _)| id);
        of(class).or_else(|| of(Self::OBJECT.1)).ok_or_else(|| {
            self.no_category(&format!("an object is of the class `{class}`, and the dataset has no such category"))
        })
    }

    /// Index of a category in [`categories`](Self::categories), from 0, and its name.
    ///
    /// # Errors
    /// If the dataset has no category with this id.
    pub fn category(&self, id: u32) -> Result<(usize, &str)> {
        let mut places = self.categories().enumerate();
        let found = places.find(|(_, (other, _))| *other == id).map(|(place, (_, name))| (place, name));
        found.ok_or_else(|| self.no_category(&format!("category {id} of an object is none of the dataset's")))
    }

    /// The supercategory of a category, if it has one.
    pub fn supercategory(&self, id: u32) -> Option<&str> {
        let own = self.own_categories.iter().find(|own| own.id == id)?;
        Some(own.supercategory.as_str()).filter(|name| !name.is_empty())
    }

    fn no_category(&self, message: &str) -> Error {
        let known: Vec<String> = self.categories().map(|(id, name)| format!("{id} ({name})")).collect();
        Error::new(message).help(format!("it has {}; add the category to them", known.join(", ")))
    }
}

/// A product that a stage replaces. All other stages that read `product` get the new one. The original stays available under
/// the key `original`, by which the stage itself reads it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Replacement {
    /// The product that the stage replaces.
    pub product: KeyId,
    /// Key of the same type under which the original is kept.
    pub original: KeyId,
    /// Whether the stage also replaces the product of [parts of the scene](crate::product::Framing::part), such as `radiance
    /// (objects alone)`. It then runs once more for each part, on its inputs.
    pub of_parts: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_count_from_two_by_name() {
        let classes = vec!["bowl".to_owned(), "mug".to_owned()];
        let (name, recipe, program) = (String::new(), String::new(), String::new());
        let dataset = DatasetInfo {
            name,
            seed: 0,
            scenes: 1,
            views_per_scene: 1,
            recipe,
            program,
            classes,
            own_categories: Vec::new(),
            label_surface: LabelSurface::First,
        };
        assert_eq!(dataset.categories().collect::<Vec<_>>(), [(1, "object"), (2, "bowl"), (3, "mug")]);
        let id = |name| dataset.category_id(name).expect("a category");
        assert_eq!(["mug", "bowl", "object", "shoe", ""].map(id), [3, 2, 1, 1, 1]);
        assert_eq!(
            [1, 2, 3].map(|id| dataset.category(id).expect("a category")),
            [(0, "object"), (1, "bowl"), (2, "mug")]
        );
        let error = dataset.category(4).expect_err("three categories");
        assert_eq!(error.message(), "category 4 of an object is none of the dataset's");
        assert_eq!(error.help_text(), Some("it has 1 (object), 2 (bowl), 3 (mug); add the category to them"));
        assert_eq!(dataset.supercategory(2), None);
        let own = [(17, "mug", "kitchen"), (90, "a", "")].map(|(id, name, supercategory)| OwnCategory {
            id,
            name: name.to_owned(),
            supercategory: supercategory.to_owned(),
        });
        let own = DatasetInfo { own_categories: own.to_vec(), ..dataset };
        assert_eq!([17, 90, 2].map(|id| own.supercategory(id)), [Some("kitchen"), None, None]);
        assert_eq!(own.categories().collect::<Vec<_>>(), [(17, "mug"), (90, "a")]);
        assert_eq!((own.category_id("mug").ok(), own.category(90).ok()), (Some(17), Some((1, "a"))));
        // No category has id 1.
        let errors = [own.category_id("shoe").expect_err("no `object`"), own.category(1).expect_err("no such id")];
        assert!(errors.iter().all(|error| error.help_text().is_some_and(|it| it.contains("17 (mug), 90 (a)"))));
    }
}
