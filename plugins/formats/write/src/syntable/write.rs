//! Writes SynTable's layout.

use super::record::{self, ViewLabels};
use super::{Compat, RECIPE, SynTable, debug, merge};
use syntable_formats::encode::npy::Array;
use syntable_formats::encode::png::{Rounding, depth_image};
use syntable_formats::image_file::{self, RgbFile};
use syntable_formats::include::write_file;
use syntable_formats::shard;
use syntable_formats::syntable::{depth_path, occlusion_order_path, rgb_path};
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::OcclusionOrder;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, BODIES, CAMERA, CATEGORY_ID, DENOISER, EXPOSURE, INSTANCE, LABEL_POLICY, OBJECT_INFO,
    OBJECT_NAME, OCCLUSION_MASK, OCCLUSION_ORDER, OCCLUSION_RATE, RGB, VISIBLE_BOX, VISIBLE_MASK,
};

impl ImageWriter for SynTable {
    /// Content of the shard.
    type Scene = Vec<u8>;

    fn reads(&self) -> Vec<Input> {
        let mut inputs = vec![Input::of(RGB), image_file::input(), Input::of(VISIBLE_MASK), Input::of(VISIBLE_BOX)];
        let of_all = [
            Input::of(AMODAL_MASK),
            Input::of(OCCLUSION_MASK),
            Input::of(OCCLUSION_RATE),
            Input::of(OCCLUSION_ORDER),
            Input::of(AMODAL_BOX),
        ];
        // Programs that rely on the files of the release expect all of these products.
        let needs_all = self.compat == Compat::Syntable1 || self.debug_masks;
        inputs.push(Input::of(OBJECT_NAME).optional());
        let depth = self.depth.input();
        inputs.push(if needs_all || !self.depth.is_default() { depth } else { depth.optional() });
        inputs.extend(of_all.into_iter().map(|input| if needs_all { input } else { input.optional() }));
        if self.compat == Compat::Coco {
            let more = [Input::of(CATEGORY_ID), Input::of(OBJECT_INFO), Input::of(CAMERA), Input::of(EXPOSURE)];
            let more = more.into_iter().chain([Input::of(DENOISER), Input::of(LABEL_POLICY), Input::of(BODIES)]);
            inputs.extend(more.map(Input::optional));
        }
        if self.debug_masks {
            // A run always has these products. A converted dataset may lack them; ids are then painted from visible
            // masks.
            inputs.push(Input::of(INSTANCE).optional());
            if self.compat == Compat::Syntable1 {
                inputs.extend([Input::of(OBJECT_INFO), Input::of(BODIES)].map(Input::optional));
            }
        }
        inputs
    }

    fn view(&self, lines: &mut Vec<u8>, cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let (scene, view) = (cx.scene_id.0, cx.view_id.0);
        let file = RgbFile::of(products, &[self.rgb.format], self.rgb)?;
        output.write(&self.path(&self.rgb_path(scene, view)), &file.bytes)?;
        let rounding = match self.compat {
            Compat::Coco => Rounding::Truncate,
            Compat::Syntable1 => Rounding::TruncateSingle,
        };
        if let Some(depth) = products.optional(self.depth.key())? {
            let remedy = "the layout has whole millimeters; also write depth with npy or exr";
            let depth = depth_image(depth, 1.0, rounding, (cx.log, remedy));
            depth.write(output, &self.path(&depth_path(scene, view)))?;
        }
        let labels = ViewLabels::of(products)?.annotated_by(self.compat)?;
        if let Some(order) = labels.order {
            let matrix = order_matrix(order, labels.ids());
            output.write(&self.path(&occlusion_order_path(scene, view)), &matrix.encode())?;
        }
        if self.debug_masks {
            debug::write(self, output, cx, products, &labels, &view_stem(scene, view))?;
        }

        let image = match self.compat {
            Compat::Coco => record::image(self, cx, products, &labels)?,
            Compat::Syntable1 => record::image_1(self, cx, products)?,
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
                let rgb = self.rgb_path(scene.0, view.0);
                let others = [depth_path, occlusion_order_path].map(|path| path(scene.0, view.0));
                let debug = debug::paths(&view_stem(scene.0, view.0));
                let debug = debug.into_iter().filter(|_| self.debug_masks);
                std::iter::once(rgb).chain(others).chain(debug).map(|path| self.path(&path)).collect()
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
        write_file(finish, &self.path(RECIPE), cx.dataset.recipe.as_bytes())
    }
}

impl SynTable {
    /// Path of a view's color image inside the writer's folder.
    pub fn rgb_path(&self, scene: u32, view: u32) -> String {
        rgb_path(scene, view, self.rgb.extension())
    }

    /// A path relative to the dataset.
    pub fn path(&self, path: &str) -> String {
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
