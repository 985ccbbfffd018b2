//! NumPy files of numeric arrays.

use crate::include;
use syntable_formats::encode::kind::accepts;
use syntable_formats::encode::npy::{self, Array, Arrays};
use syntable_formats::encode::{scene_name, view_name};
use syntable_model::prelude::*;
use syntable_model::product::Scope;

/// End of the name of a file of instance ids.
const IDS_END: &str = "_ids";

/// Writes numeric arrays as NumPy files.
///
/// # What it does
///
/// Stores values as they are: images as `[height, width]` or `[height, width, channels]` of their own type, masks as
/// bool, numbers and lists of numbers as float64, int64 or uint64. A product per instance is one array with the instances along the first axis;
/// masks become `[N, height, width]`. `occlusion_order` is `[N, N]` of bool over the annotated instances in id order:
/// the row's object occludes the column's. Text and records do not fit; `jsonl` writes them.
///
/// # Output
///
/// `{id}/{product}/{scene:06}_{view:04}.npy`. A product per instance has its instance ids, u16 in the same order, in
/// `{id}/{product}/{scene:06}_{view:04}_ids.npy`. A product of the scene is `{id}/{product}/{scene:06}.npy`.
/// With ids of categories, `{id}/categories.json` has their names, in COCO's form.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Npy {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Vec<ProductName>,
}

impl Default for Npy {
    fn default() -> Self {
        Self { include: vec!["depth".into(), "instance".into(), "occlusion_order".into()] }
    }
}

impl Config for Npy {
    type Stage = dyn Writer;
    const KIND: &'static str = "npy";
    const EXAMPLE: &'static str = "include = [\"depth\", \"amodal_mask\", \"occlusion_order\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        include::check_unique(&self.include)?;
        Ok(Box::new(self))
    }
}

impl Writer for Npy {
    fn reads(&self) -> Vec<Input> {
        Input::included(&self.include, Accepts::If(|key| accepts(key, npy::check)))
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        Ok(Box::new(NpyScene { include: self.include.clone(), output }))
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        let categories = include::categories_path(&self.include, of.id).filter(|_| of.scene.is_none());
        Ok(include::paths(of, "npy", [&[""], &["", IDS_END]]).into_iter().chain(categories).collect())
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        include::write_categories(&self.include, cx.dataset, finish)
    }
}

struct NpyScene {
    include: Vec<ProductName>,
    output: Output,
}

impl SceneWriter for NpyScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let [width, height] = cx.size.map(|edge| edge as usize);
        let size = [height, width];
        self.write(Scope::View, &view_name(cx.scene_id, cx.view_id), products, size)
    }

    fn close(self: Box<Self>, cx: &ImagesContext, products: &Products) -> Result<()> {
        self.write(Scope::Scene, &scene_name(cx.scene_id), products, [0, 0])
    }
}

impl NpyScene {
    /// Writes the products of a scope; `size` is the height and width of an image without instances.
    fn write(&self, scope: Scope, name: &str, products: &Products, size: [usize; 2]) -> Result<()> {
        for (product, key) in include::of_scope(&self.include, products, scope) {
            let stem = include::stem(self.output.id(), product, name);
            let save = |array: Array, end: &str| self.output.write(&format!("{stem}{end}.npy"), &array.encode());
            match npy::arrays(product, &key, &products.value(product)?, size)? {
                Arrays::One(array) => save(array, "")?,
                Arrays::PerInstance { values, ids } => {
                    save(values, "")?;
                    save(ids, IDS_END)?;
                }
            }
        }
        Ok(())
    }
}

register!(Npy);
