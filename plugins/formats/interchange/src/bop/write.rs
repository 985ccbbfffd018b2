//! The writer of BOP's layouts: its inputs and the paths of its files.

use super::record::{BopImage, FINISHED_SCENE_FILES, SCENE_FILES};
use super::{Bop, BopLayout, BopMeshes, BopObjects, finish, scene};
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_MASK, CAMERA, COVERAGE, INSTANCE, OBJECT_INFO, OBJECT_MODELS, RGB, VISIBILITY, VISIBLE_MASK,
};
use syntable_model::scene::SceneId;

impl Writer for Bop {
    fn reads(&self) -> Vec<Input> {
        let masks = match self.objects {
            // A dataset that is being converted has no coverage.
            BopObjects::Annotated => {
                vec![Input::of(AMODAL_MASK), Input::of(VISIBLE_MASK), Input::of(COVERAGE).optional()]
            }
            BopObjects::All => vec![Input::of(COVERAGE), Input::of(INSTANCE)],
        };
        let others =
            [Input::of(RGB), self.depth.input(), Input::of(CAMERA), Input::of(OBJECT_INFO), Input::of(VISIBILITY)];
        let models = (self.models != BopMeshes::None)
            .then(|| Input { option: Some("models".into()), ..Input::of(OBJECT_MODELS) });
        others.into_iter().chain(masks).chain(models).collect()
    }

    fn scene(&self, cx: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        let folder = self.folder(output.id(), cx.scene_id);
        Ok(Box::new(scene::BopScene::new(self.clone(), folder, output)?))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        let folder = |scene| self.folder(of.id, scene);
        Ok(match (of.scene, of.view) {
            (None, _) => finish::paths(self, of.dataset, of.id),
            (Some(_), _) if self.layout == BopLayout::Webdataset => Vec::new(),
            (Some(scene), Some(view)) => {
                let masks = [BopImage::Mask(0), BopImage::MaskVisib(0)];
                let rgb = BopImage::Rgb.path_as(view, self.rgb.extension());
                let others = [BopImage::Depth].into_iter().chain(masks).map(|image| image.path(view));
                std::iter::once(rgb).chain(others).map(|path| format!("{}/{path}", folder(scene))).collect()
            }
            (Some(scene), None) => {
                let names = SCENE_FILES.into_iter().chain(FINISHED_SCENE_FILES);
                names.map(|name| format!("{}/{name}", folder(scene))).collect()
            }
        })
    }

    fn needs_obj_ids(&self) -> bool {
        true
    }

    fn needs_sizes_of_assets(&self) -> bool {
        true
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        finish::write(self, cx, finish)
    }
}

impl Bop {
    /// Folder of a scene.
    pub fn folder(&self, id: &str, scene: SceneId) -> String {
        format!("{id}/{}/{:06}", self.split, scene.0)
    }

    /// Folder of the tar files.
    pub fn web_folder(&self, id: &str) -> String {
        format!("{id}/{}_web", self.split)
    }

    /// Whether methods are tested with this split.
    pub fn is_test(&self) -> bool {
        self.split == "test" || self.split.starts_with("test_")
    }
}
