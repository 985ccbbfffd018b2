//! Writes UOAIS-Sim's layout.

use super::Uoais;
use super::record::{CATEGORY, FILE, UoaisAnnotation};
use crate::coco::MaskChoice;
use crate::family::find::FOLDER;
use crate::family::read::DEPTH_FILE;
use crate::family::write::{Family, ListedImages, SceneFiles, policy};
use crate::{depth, labels};
use syntable_formats::Extra;
use syntable_formats::coco::Category;
use syntable_formats::encode::rgb::RgbFiles;
use syntable_formats::encode::view_name;
use syntable_formats::read::SUPERCATEGORY;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;

/// Path of the color image, relative to the folder of the split.
fn rgb_path(image: &str) -> String {
    format!("rgb/{image}")
}

/// Path of the depth image, relative to the folder of the split.
fn depth_path(view: &str) -> String {
    format!("depth/{view}.png")
}

impl Family for Uoais {
    fn reads(&self) -> Vec<Input> {
        [Input::of(RGB), self.depth.input(), policy()].into_iter().chain(labels::inputs()).collect()
    }

    fn rgb(&self) -> RgbFiles {
        self.rgb
    }

    fn file(&self) -> String {
        format!("{FOLDER}/{FILE}{}.json", self.split)
    }

    fn files_of_view(&self, view: &str) -> Vec<String> {
        [rgb_path(&self.rgb.file_name(view)), depth_path(view)].map(|path| format!("{}/{path}", self.split)).to_vec()
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["skip_empty_images"]
    }

    fn categories(&self, _: &DatasetInfo) -> Result<Vec<Category>> {
        let (name, supercategory) = ("object".into(), SUPERCATEGORY.into());
        Ok(vec![Category { id: CATEGORY, name, supercategory, ..Category::default() }])
    }

    fn listed(&self) -> ListedImages {
        if self.skip_empty_images { ListedImages::Annotated } else { ListedImages::All }
    }

    fn view(&self, cx: &ImageContext, products: &Products, files: &mut SceneFiles) -> Result<()> {
        let name = view_name(cx.scene_id, cx.view_id);
        files.png(&format!("{}/{}", self.split, depth_path(&name)), &depth::image(self.depth, products, cx.log)?)?;
        let labels = MaskChoice::Amodal.shown(cx.log, labels::labels(cx.dataset, products)?);
        let extra = Extra::from_iter([(DEPTH_FILE.to_owned(), depth_path(&name).into())]);
        files.image_in(&self.split, &rgb_path(&self.rgb.file_name(&name)), products, labels.len(), extra)?;
        labels.iter().try_for_each(|label| files.annotation(&UoaisAnnotation::of(label)))
    }
}
