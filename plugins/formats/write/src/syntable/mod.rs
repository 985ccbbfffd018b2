//! The layout of SynTable datasets.

mod debug;
mod merge;
mod read;
mod record;

pub(crate) use debug::inverse_depth;

use record::Labels;
use syntable_formats::encode::npy::Array;
use syntable_formats::encode::png::{Image, Rounding, depth_units};
use syntable_formats::shard;
use syntable_formats::syntable::{depth_path, occlusion_order_path, rgb_path};
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::OcclusionOrder;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, BODIES, CAMERA, CATEGORY_ID, DENOISER, DEPTH, EXPOSURE, INSTANCE, LABEL_POLICY,
    OBJECT_INFO, OBJECT_NAME, OCCLUSION_MASK, OCCLUSION_ORDER, OCCLUSION_RATE, RGB, VISIBLE_BOX, VISIBLE_MASK,
};

/// Path of the copy of the resolved recipe.
const RECIPE: &str = "parameters/recipe.toml";

/// Writes the dataset layout that the readers of SynTable and UOAIS-Net expect.
///
/// # What it does
///
/// The annotation file has COCO's structure. `segmentation` is the amodal mask of an object; `visible_mask`,
/// `occluded_mask`, `occluded_rate` and boxes are fields beside it. Image ids are
/// `scene · views_per_scene + view + 1`, so that they are the same whichever scenes are done; they change once the recipe of a
/// dataset that grows has more views per scene. Categories are `object` (id 1) and, from 2, the classes of the recipe's pools in
/// the order of their names. `scenes` has a record per scene, whose `bodies` say what each id in the product `instance`
/// stands for: role, asset, category, materials and pose of objects, distractors, table and room. Row and column n of the occlusion order belong to the n-th annotation of the
/// image, which is `instance_ids[n]` of the image's record. Dates are constant.
///
/// What a dataset that is converted lacks is left out of the `coco` form: depth, order, camera and other fields. Without amodal
/// masks, `segmentation` and `area` are those of the visible mask, and nothing is said of occlusion.
///
/// # Output
///
/// - `data/mono/rgb/{scene}_{view}.png`: 8-bit RGB.
/// - `data/mono/depth/{scene}_{view}.png`: 16-bit depth along the optical axis, whole millimeters, truncated; 0 where
///   there is none.
/// - `data/mono/occlusion_order/{scene}_{view}.npy`: float64 `[N, N]`, 1 where the row's object occludes the column's.
/// - `annotation_final.json`: the annotations of all images.
/// - `parameters/recipe.toml`: the resolved recipe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SynTable {
    /// Form of the annotation file: `coco` for COCO's readers, `syntable_1` for programs that rely on the files of
    /// SynTable's release.
    pub compat: Compat,
    /// Mask whose box is written as `bbox`: `visible` as in SynTable, or `amodal` to fit `segmentation`. The `coco` form
    /// also has both boxes under their own names.
    pub bbox: BoxSource,
    /// Leaves images without annotations out of the annotation file, as some readers of test sets require. Their image
    /// files are written all the same. The `syntable_1` form never has such images.
    pub skip_empty_images: bool,
    /// Also writes the files of SynTable's switch `--save-segmentation-data`, except the images of single objects: instance
    /// maps, visible, amodal and occlusion masks as PNG, depth as PFM in meters and as 8-bit inverse depth. Of a dataset that
    /// is converted, instance maps are painted from the visible masks, and files of an object have its id less one in their
    /// names, since spawn numbers are not known.
    pub debug_masks: bool,
    /// File name of the annotation file.
    pub annotation_file: String,
    /// Folder inside the dataset for all files; empty for the dataset's own.
    pub folder: String,
}

/// Form of the annotation file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Compat {
    /// One record per image, true areas, rates in full precision; camera, object poses and label policy.
    Coco,
    /// The image's record repeated for every annotation, area 0, ten times the area of the amodal masks in
    /// `segmentation`, rates of two decimals, one category, depth that is truncated in single precision, `_` for `/` in
    /// names of objects. Objects without a visible pixel or with a rate that rounds to 1.00 are left out, and so are
    /// images without annotations.
    #[serde(rename = "syntable_1")]
    Syntable1,
}

/// Mask whose box is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum BoxSource {
    /// The visible mask; of an object without visible pixels, the amodal mask.
    Visible,
    /// The amodal mask.
    Amodal,
}

impl Default for SynTable {
    fn default() -> Self {
        Self {
            compat: Compat::Coco,
            bbox: BoxSource::Visible,
            skip_empty_images: false,
            debug_masks: false,
            annotation_file: "annotation_final.json".into(),
            folder: String::new(),
        }
    }
}

impl Config for SynTable {
    type Stage = dyn Writer;
    const KIND: &'static str = "syntable";
    const EXAMPLE: &'static str = "compat = \"coco\"\nskip_empty_images = false";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        if self.annotation_file.is_empty() || self.annotation_file.contains(['/', '\\']) {
            let message = format!("`{}` is not a file name", self.annotation_file);
            return Err(ConfigError::new("annotation_file", message));
        }
        check_path("annotation_file", &self.annotation_file)?;
        if !self.folder.is_empty() {
            check_path("folder", &self.folder)?;
        }
        Ok(self.boxed())
    }
}

impl ImageWriter for SynTable {
    /// The shard.
    type Scene = Vec<u8>;

    fn reads(&self) -> Vec<Input> {
        let mut inputs = vec![Input::of(RGB), Input::of(VISIBLE_MASK), Input::of(VISIBLE_BOX)];
        let of_all = [
            Input::of(DEPTH),
            Input::of(AMODAL_MASK),
            Input::of(OCCLUSION_MASK),
            Input::of(OCCLUSION_RATE),
            Input::of(OCCLUSION_ORDER),
            Input::of(AMODAL_BOX),
        ];
        // Programs that rely on the files of the release find all of this in them.
        let needs_all = self.compat == Compat::Syntable1 || self.debug_masks;
        inputs.push(Input::of(OBJECT_NAME).optional());
        inputs.extend(of_all.into_iter().map(|input| if needs_all { input } else { input.optional() }));
        if self.compat == Compat::Coco {
            let more = [Input::of(CATEGORY_ID), Input::of(OBJECT_INFO), Input::of(CAMERA), Input::of(EXPOSURE)];
            let more = more.into_iter().chain([Input::of(DENOISER), Input::of(LABEL_POLICY), Input::of(BODIES)]);
            inputs.extend(more.map(Input::optional));
        }
        if self.debug_masks {
            // A run always has these. A dataset that was read may lack them: then ids are painted from visible masks.
            inputs.push(Input::of(INSTANCE).optional());
            if self.compat == Compat::Syntable1 {
                inputs.extend([Input::of(OBJECT_INFO), Input::of(BODIES)].map(Input::optional));
            }
        }
        inputs
    }

    fn view(&self, lines: &mut Vec<u8>, cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let (scene, view) = (cx.scene_id.0, cx.view_id.0);
        Image::rgb(products.get(RGB)?).write(output, &self.path(&rgb_path(scene, view)))?;
        let rounding = match self.compat {
            Compat::Coco => Rounding::Truncate,
            Compat::Syntable1 => Rounding::TruncateSingle,
        };
        if let Some(depth) = products.optional(DEPTH)? {
            let depth = depth.map(|&depth| depth_units(depth, 1.0, rounding));
            Image::gray16(&depth).write(output, &self.path(&depth_path(scene, view)))?;
        }
        let labels = Labels::of(products)?.annotated_by(self.compat);
        if let Some(order) = labels.order {
            let matrix = order_matrix(order, labels.ids());
            output.write(&self.path(&occlusion_order_path(scene, view)), &matrix.encode())?;
        }
        if self.debug_masks {
            debug::write(self, output, cx, products, &labels, &view_stem(scene, view))?;
        }

        let image = match self.compat {
            Compat::Coco => record::image(cx, products, &labels)?,
            Compat::Syntable1 => record::image_1(cx, products)?,
        };
        shard::push_image(lines, labels.ids().len(), &image)?;
        labels.ids().iter().try_for_each(|&id| match self.compat {
            Compat::Coco => {
                shard::push_annotation(lines, &record::annotation(cx.dataset, products, &labels, id, self.bbox)?)
            }
            Compat::Syntable1 => {
                shard::push_annotation(lines, &record::annotation_1(products, &labels, id, self.bbox)?)
            }
        })
    }

    fn close(&self, mut lines: Vec<u8>, cx: &ImagesContext, products: &Products, output: &Output) -> Result<()> {
        if self.compat == Compat::Coco
            && let Some(scene) = record::scene(cx, products)?
        {
            shard::push_scene(&mut lines, &scene)?;
        }
        output.write_shard(&lines)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match (of.scene, of.view) {
            (Some(scene), Some(view)) => {
                let paths = [rgb_path, depth_path, occlusion_order_path].map(|path| path(scene.0, view.0));
                let debug = debug::paths(&view_stem(scene.0, view.0));
                let debug = debug.into_iter().filter(|_| self.debug_masks);
                paths.into_iter().chain(debug).map(|path| self.path(&path)).collect()
            }
            (None, None) => vec![self.path(&self.annotation_file), self.path(RECIPE)],
            _ => Vec::new(),
        }
    }

    fn finish_options(&self) -> &'static [&'static str] {
        &["annotation_file", "skip_empty_images"]
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        merge::annotations(self, cx.dataset, finish)?;
        let path = self.path(RECIPE);
        finish.write(&path, |out| out.write_all(cx.dataset.recipe.as_bytes()).map_err(|error| Error::io(&path, &error)))
    }
}

impl SynTable {
    /// A path relative to the dataset.
    fn path(&self, path: &str) -> String {
        if self.folder.is_empty() { path.to_owned() } else { format!("{}/{path}", self.folder) }
    }
}

/// Name of a view in the files for debugging.
fn view_stem(scene: u32, view: u32) -> String {
    format!("{scene}_{view}")
}

/// The occlusion order over the annotated instances.
fn order_matrix(order: &OcclusionOrder, annotated: &[InstanceId]) -> Array {
    let row = |id: &InstanceId| order.ids().binary_search(id).expect("the ids are those of the order");
    let rows: Vec<usize> = annotated.iter().map(row).collect();
    let elements = rows.iter().flat_map(|&i| rows.iter().map(move |&j| (i, j)));
    let bits = elements.map(|(i, j)| f64::from(u8::from(order.occludes(i, j))));
    Array::matrix_f64(rows.len(), rows.len(), bits)
}

register!(SynTable);
