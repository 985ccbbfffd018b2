//! NumPy files of numeric arrays.

use syntable_formats::encode::kind::accepts;
use syntable_formats::encode::npy::{self, Array, Arrays};
use syntable_formats::encode::{scene_name, view_name};
use syntable_formats::include::{self, Included};
use syntable_formats::writer::ImageWriter;
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
    pub include: Included,
}

impl Default for Npy {
    fn default() -> Self {
        Self { include: ["depth", "instance", "occlusion_order"].into() }
    }
}

impl Config for Npy {
    type Stage = dyn Writer;
    const KIND: &'static str = "npy";
    const EXAMPLE: &'static str = "include = [\"depth\", \"amodal_mask\", \"occlusion_order\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(self.boxed())
    }
}

impl ImageWriter for Npy {
    type Scene = ();

    fn reads(&self) -> Vec<Input> {
        self.include.inputs(Accepts::If(|key| accepts(key, npy::check)))
    }

    fn view(&self, _: &mut (), cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        self.write(Scope::View, &view_name(cx.scene_id, cx.view_id), products, output, include::shape(cx))
    }

    fn close(&self, (): (), cx: &ImagesContext, products: &Products, output: &Output) -> Result<()> {
        self.write(Scope::Scene, &scene_name(cx.scene_id), products, output, [0, 0])
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        let arrays = include::paths(of, "npy", [&[""], &["", IDS_END]]);
        arrays.into_iter().chain(self.include.categories_path(of)).collect()
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        self.include.write_categories(cx.dataset, finish)
    }
}

impl Npy {
    /// Writes the products of a scope; `size` is the height and width of an image without instances.
    fn write(&self, scope: Scope, name: &str, products: &Products, output: &Output, size: [usize; 2]) -> Result<()> {
        for (product, key) in self.include.of_scope(products, scope) {
            let stem = include::stem(output.id(), product, name);
            let save = |array: Array, end: &str| output.write(&format!("{stem}{end}.npy"), &array.encode());
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
