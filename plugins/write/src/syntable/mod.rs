//! SynTable's dataset layout.

mod debug;
mod merge;
mod record;

pub(crate) use debug::nearness;

use crate::files::array::Array;
use crate::files::image::{Picture, Rounding, depth_units};
use crate::files::{shard, view};
use record::Labels;
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, CAMERA, DENOISER, DEPTH, EXPOSURE, INSTANCE, LABEL_POLICY, OBJECT_INFO, OCCLUSION_MASK,
    OCCLUSION_ORDER, OCCLUSION_RATE, RGB, VISIBLE_BOX, VISIBLE_MASK,
};

/// SynTable's layout, as SynTable's and UOAIS-Net's readers want it:
///
/// - `data/mono/rgb/{scene}_{view}.png`, 8-bit RGB;
/// - `data/mono/depth/{scene}_{view}.png`, 16-bit, whole millimetres along the optical axis, truncated; 0 is none;
/// - `data/mono/occlusion_order/{scene}_{view}.npy`, float64 `[N, N]`, 1 where the row's object occludes the column's;
/// - `annotation_final.json`: COCO's structure. `segmentation` is the amodal mask; `visible_mask`, `occluded_mask`,
///   `occluded_rate` and boxes stand beside it;
/// - `parameters/recipe.toml`: the resolved recipe.
///
/// Image ids are `scene · views_per_scene + view + 1`. Row and column n of the order matrix belong to the n-th
/// annotation of the image, which is `instance_ids[n]` of the image's record. Dates are constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SynTable {
    /// `correct`: one record an image, real areas, rates in full precision, camera, object poses and label policy.
    /// `release`: as the released program writes, for its own code: the image's record repeated for every annotation,
    /// area 0, foreign areas inside the masks, rates of two decimals, no object without a visible pixel or with a
    /// rate that rounds to 1.00, no image without annotations.
    pub compat: Compat,
    /// The box under `bbox`: SynTable's is `visible`; COCO's convention for an amodal `segmentation` is `amodal`. Both
    /// boxes are written under their own names too, in the `correct` mode.
    pub bbox: Bbox,
    /// Leaves images without annotations out of the annotation file; some readers of test sets ask for it. Their
    /// pictures are written all the same.
    pub skip_empty_images: bool,
    /// Also writes what SynTable's switch `--save-segmentation-data` does, except the pictures of single objects:
    /// instance maps, visible, amodal and occlusion masks as PNG, depth as PFM and as an 8-bit view.
    pub debug_masks: bool,
    /// Name of the annotation file.
    pub annotation_file: String,
    /// Folder inside the dataset that everything is written to; empty for the dataset's own.
    pub folder: String,
}

/// Whose JSON it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Compat {
    /// As a COCO reader expects it.
    Correct,
    /// As the released program writes it.
    Release,
}

/// A box.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Bbox {
    /// Of the visible mask.
    Visible,
    /// Of the amodal mask.
    Amodal,
}

impl Default for SynTable {
    fn default() -> Self {
        Self {
            compat: Compat::Correct,
            bbox: Bbox::Visible,
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
    const EXAMPLE: &'static str = "compat = \"correct\"\nskip_empty_images = false";
    fn build(self) -> Result<Box<dyn Writer>, Invalid> {
        if self.annotation_file.is_empty() || self.annotation_file.contains(['/', '\\']) {
            let message = format!("`{}` is not the name of a file", self.annotation_file);
            return Err(Invalid::new("annotation_file", message));
        }
        let inside = |part: &str| !part.is_empty() && part != "." && part != "..";
        if !self.folder.is_empty() && !self.folder.split('/').all(inside) {
            let message = format!("`{}` is not a folder inside the dataset", self.folder);
            return Err(Invalid::new("folder", message).help("write it as `a` or `a/b`"));
        }
        Ok(Box::new(self))
    }
}

impl Writer for SynTable {
    fn reads(&self) -> Vec<String> {
        let mut keys = keys![
            RGB,
            DEPTH,
            VISIBLE_MASK,
            AMODAL_MASK,
            OCCLUSION_MASK,
            OCCLUSION_RATE,
            OCCLUSION_ORDER,
            VISIBLE_BOX,
            AMODAL_BOX
        ];
        if self.compat == Compat::Correct {
            keys.extend(keys![OBJECT_INFO, CAMERA, EXPOSURE, DENOISER, LABEL_POLICY]);
        }
        if self.debug_masks {
            keys.extend(keys![INSTANCE]);
        }
        keys.iter().map(|key| key.name.to_owned()).collect()
    }

    fn scene(&self, _: &Site, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(SynTableScene { config: self.clone(), output, lines: Vec::new() }))
    }

    fn finish(&self, dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
        merge::annotations(self, dataset, finish)?;
        let path = self.path("parameters/recipe.toml");
        finish.write(&path, |out| out.write_all(dataset.recipe.as_bytes()).map_err(|error| Error::io(&path, &error)))
    }
}

impl SynTable {
    /// A path relative to the dataset.
    fn path(&self, path: &str) -> String {
        if self.folder.is_empty() { path.to_owned() } else { format!("{}/{path}", self.folder) }
    }
}

struct SynTableScene {
    config: SynTable,
    output: Output,
    lines: Vec<u8>,
}

impl SceneWriter for SynTableScene {
    fn view(&mut self, site: &Site, frame: &Frame) -> Result<()> {
        let name = format!("{}_{}", site.scene.id.0, view(site)?.id.0);
        let path = |folder: &str, end: &str| self.config.path(&format!("data/mono/{folder}/{name}.{end}"));
        Picture::rgb(frame.get(RGB)?).write(&self.output, &path("rgb", "png"))?;
        let depth = frame.get(DEPTH)?.map(|&depth| depth_units(depth, 1.0, Rounding::Truncate));
        Picture::gray16(&depth).write(&self.output, &path("depth", "png"))?;
        let labels = Labels::of(frame)?.annotated_by(self.config.compat);
        self.output.write(&path("occlusion_order", "npy"), &order_matrix(&labels).encode())?;
        if self.config.debug_masks {
            debug::write(&self.config, &self.output, site, frame, &labels, &name)?;
        }

        let image = match self.config.compat {
            Compat::Correct => record::image(site, frame, &labels, &name)?,
            Compat::Release => record::released_image(site, frame, &name)?,
        };
        shard::push_line(&mut self.lines, &("image", labels.ids().len(), image))?;
        for &id in labels.ids() {
            let annotation = match self.config.compat {
                Compat::Correct => record::annotation(site, frame, &labels, id, self.config.bbox)?,
                Compat::Release => record::released_annotation(site, &labels, id, self.config.bbox)?,
            };
            shard::push_line(&mut self.lines, &("annotation", annotation))?;
        }
        Ok(())
    }

    fn close(self: Box<Self>) -> Result<()> {
        self.output.write_shard(&self.lines)
    }
}

/// The occlusion order over the annotated instances.
fn order_matrix(labels: &Labels) -> Array {
    let rows = labels.rows();
    let elements = rows.iter().flat_map(|&i| rows.iter().map(move |&j| (i, j)));
    let bits = elements.map(|(i, j)| f64::from(u8::from(labels.order.occludes(i, j))));
    Array::matrix_f64(rows.len(), rows.len(), bits)
}

register!(SynTable);
