//! NumPy archives: all arrays of a view in one file.

mod read;

use syntable_formats::encode::kind::accepts;
use syntable_formats::encode::npy::{self, Array, Arrays};
use syntable_formats::encode::{npz, scene_name, view_name};
use syntable_formats::include::{self, Included};
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::Scope;

/// Name of the array of the instances' ids.
const IDS: &str = "ids";

/// Writes one NumPy archive per view, for training loops.
///
/// # What it does
///
/// Each included product is an array of the archive under its own name, as the writer `npy` stores it: images as
/// `[height, width]` or `[height, width, channels]`, a value per instance as one array with the N instances along the first
/// axis. `ids`, u16 `[N]`, are the ids of these instances. The default has what a training loop of amodal instance
/// segmentation reads, without run lengths or JSON:
///
/// | array | type and shape | holds |
/// | --- | --- | --- |
/// | `rgb` | uint8 `[H, W, 3]` | the image |
/// | `depth` | float32 `[H, W]` | meters along the optical axis, infinite where there is nothing |
/// | `visible_ids` | uint16 `[H, W]` | id of the object that a pixel shows, 0 where it shows none |
/// | `amodal_bits` | uint8 `[N, H, ⌈W/8⌉]` | amodal masks; `np.unpackbits(bits, axis=2, count=W)` is `[N, H, W]` |
/// | `visible_box`, `amodal_box` | int64 `[N, 4]` | x, y, width, height, px |
/// | `category_id` | int64 `[N]` | category: 1 is `object`, then the classes of pools by name |
/// | `occlusion_order` | bool `[N, N]` | the row's object occludes the column's |
/// | `ids` | uint16 `[N]` | ids of the objects, in the order of all axes of N |
///
/// The archive has no pickled objects: `np.load(path)` reads it.
///
/// # Output
///
/// `{id}/{scene:06}_{view:04}.npz`. Products of the scene are in `{id}/{scene:06}.npz`, names of categories in
/// `{id}/categories.json`, in COCO's form, if ids of them are included.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Npz {
    /// Products to write.
    #[schemars(length(min = 1))]
    pub include: Included,
    /// Whether to compress the arrays. Labels shrink to a few percent; images and depth hardly, and load more slowly.
    pub compress: bool,
}

impl Default for Npz {
    fn default() -> Self {
        let include = [
            "rgb",
            "depth",
            "visible_ids",
            "amodal_bits",
            "visible_box",
            "amodal_box",
            "category_id",
            "occlusion_order",
        ];
        Self { include: include.into(), compress: true }
    }
}

impl Config for Npz {
    type Stage = dyn Writer;
    const KIND: &'static str = "npz";
    const EXAMPLE: &'static str =
        "include = [\"rgb\", \"visible_ids\", \"amodal_bits\", \"category_id\", \"occlusion_order\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        self.include.check_free(&[IDS])?;
        Ok(self.boxed())
    }
}

impl ImageWriter for Npz {
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
        let archive = include::path_of_all(of, |name| archive_path(of.id, name));
        archive.into_iter().chain(self.include.categories_path(of)).collect()
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        self.include.write_categories(cx.dataset, finish)
    }
}

fn archive_path(id: &str, name: &str) -> String {
    format!("{id}/{name}.npz")
}

impl Npz {
    /// Writes the products of a scope, if there are any; `size` is the height and width of an image without instances.
    fn write(&self, scope: Scope, name: &str, products: &Products, output: &Output, size: [usize; 2]) -> Result<()> {
        let mut archive: Vec<(&str, Array)> = Vec::new();
        let mut ids: Option<(&str, Array)> = None;
        for (product, key) in self.include.of_scope(products, scope) {
            match npy::arrays(product, &key, &products.value(product)?, size)? {
                Arrays::One(array) => archive.push((product, array)),
                Arrays::PerInstance { values, ids: of } => {
                    archive.push((product, values));
                    match &ids {
                        None => ids = Some((product, of)),
                        Some((_, same)) if *same == of => {}
                        Some((first, _)) => {
                            return Err(Error::new(format!("`{first}` and `{product}` are of different instances"))
                                .help("include them in two writers of the kind npz, or write them with npy"));
                        }
                    }
                }
            }
        }
        if archive.is_empty() {
            return Ok(());
        }
        archive.extend(ids.map(|(_, ids)| (IDS, ids)));
        let bytes = npz::encode(archive.iter().map(|(name, array)| (*name, array)), self.compress)?;
        output.write(&archive_path(output.id(), name), &bytes)
    }
}

register!(Npz);
