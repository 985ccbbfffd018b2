//! Parquet tables.

use crate::column::{self, Column, IMAGES, OWN};
use crate::file::Table;
use crate::shred::Node;
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::coco;
use syntable_formats::encode::{png, scene_name, view_name};
use syntable_formats::include::Included;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::product::{Form, Scope};

/// Writes Parquet tables, which pandas, Polars, DuckDB and Hugging Face `datasets` read.
///
/// # What it does
///
/// A table has a row per instance of a view, or with `rows = "views"` a row per view whose columns of instances are lists. The
/// columns `scene`, `view`, `instance`, `width` and `height` say what the row is of; the others are those of the included
/// products:
///
/// | product | columns |
/// | --- | --- |
/// | number or text, such as `occlusion_rate` | `{product}` |
/// | box, such as `visible_box` | `{product}`: list `[x, y, width, height]` |
/// | mask, such as `amodal_mask` | `{product}`: struct of `size` and `counts`, COCO's compressed run lengths as pycocotools takes them, and `{product}_area`, px |
/// | `category_id` | `category_id`, and its name, `category` |
/// | `object_info` | `asset`, `obj_id`, `mass_kg`, `world_from_object`, `camera_from_object`, `model_origin_m` |
/// | `camera` | `K`, `world_from_camera`, `distortion_k1_k2_p1_p2_k3` (of OpenCV; null without distortion) |
/// | `visibility` | `px_count_all`, `px_count_in_frame`, `px_count_valid`, `px_count_visib`, `visib_fract` |
/// | other records and lists | `{product}`: JSON text |
///
/// An instance has a row, or a place in the lists of its view, if any of the included products of the view has a value of it. So
/// where `object_info` or `visibility` has `objects = "all"`, objects that are not annotated have one, too: what only annotated
/// ones have, such as masks, boxes and `category_id`, is null there.
///
/// Matrices are lists of their entries, row by row. Cells without a value are null. Products of a view or a scene repeat in
/// the rows of its instances. A product that has an array per instance or per view stays out: `npz` has a place for it.
///
/// `image_file` is the path of the image from the table's folder. With `images = "embedded"` a row of a view has the image
/// itself, `image`, a struct of `bytes` (PNG) and `path`; `datasets` decodes it. Tables of instances do not embed
/// images: each would be there as often as it has instances, which readers unpack.
///
/// With ids of categories, the metadata of each table has the key `categories`: COCO's list of all categories of the recipe, as
/// JSON.
///
/// Each scene has a table of its own, with the same columns, so that a run that ends early leaves whole tables and a dataset
/// that grows leaves them as they are; readers take a folder or `*.parquet` for one table.
///
/// ```python
/// table = pandas.read_parquet("data/parquet/instances")
/// hidden = table[table.occlusion_rate > 0.5]
/// annotated = table[table.amodal_mask_area.notna()]
/// data = datasets.load_dataset("parquet", data_files="data/parquet/views/*.parquet")
/// ```
///
/// # Output
///
/// In `{id}`: `{rows}/{scene:06}.parquet`, and with `images = "files"` `images/{scene:06}_{view:04}.png`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Parquet {
    /// What a row is.
    pub rows: Rows,
    /// Products to write, of the view, its instances or the scene.
    pub include: Included,
    /// Where the images are.
    pub images: Images,
}

/// What a row of a table is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rows {
    /// An instance in a view. A view without instances has no row.
    Instances,
    /// A view with lists of its instances.
    Views,
}

/// Where images are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Images {
    /// There are none.
    None,
    /// PNG files beside the tables, whose paths the column `image_file` has.
    Files,
    /// In the column `image`, in tables of views.
    Embedded,
}

impl Rows {
    /// Name of the tables' folder.
    fn folder(self) -> &'static str {
        match self {
            Self::Instances => "instances",
            Self::Views => "views",
        }
    }
}

impl Default for Parquet {
    fn default() -> Self {
        let include = [
            "object_info",
            "category_id",
            "visible_box",
            "amodal_box",
            "occlusion_rate",
            "visible_mask",
            "amodal_mask",
            "camera",
        ];
        Self { rows: Rows::Instances, include: include.into(), images: Images::Files }
    }
}

impl Config for Parquet {
    type Stage = dyn Writer;
    const KIND: &'static str = "parquet";
    const EXAMPLE: &'static str =
        "rows = \"instances\"\ninclude = [\"object_info\", \"category_id\", \"visible_box\", \"occlusion_rate\"]";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        self.include.check_free(&column::reserved())?;
        if (self.rows, self.images) == (Rows::Instances, Images::Embedded) {
            return Err(ConfigError::new("images", "a table of instances would have each image many times")
                .help("write `rows = \"views\"`, or `images = \"files\"`"));
        }
        Ok(self.boxed())
    }
}

impl ImageWriter for Parquet {
    type Scene = SceneRows;

    fn reads(&self) -> Vec<Input> {
        let rgb = (self.images != Images::None).then(|| Input::of(RGB));
        rgb.into_iter().chain(self.include.inputs(Accepts::If(column::accept))).collect()
    }

    fn view(&self, scene: &mut SceneRows, cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let name = view_name(cx.scene_id, cx.view_id);
        let image = self.image(&name, products, output)?;
        let (mut cells, mut instances) = (BTreeMap::new(), BTreeSet::new());
        for (product, key) in self.include.of_scope(products, Scope::View) {
            let own = Cells::of(product, &key, products, cx.dataset)?;
            if let Cells::PerInstance(cells) = &own {
                instances.extend(cells.keys());
            }
            cells.insert(product.to_owned(), own);
            scene.keys.insert(product.to_owned(), key);
        }
        scene.views.push(ViewRows { view: cx.view_id.0, size: cx.size, image, instances, cells });
        Ok(())
    }

    fn close(&self, mut scene: SceneRows, cx: &ImagesContext, products: &Products, output: &Output) -> Result<()> {
        let mut of_scene = BTreeMap::new();
        for (product, key) in self.include.of_scope(products, Scope::Scene) {
            of_scene.insert(product.to_owned(), Cells::of(product, &key, products, cx.dataset)?);
            scene.keys.insert(product.to_owned(), key);
        }
        let is_per_instance = |key: &KeyId| matches!(key.form(), Form::PerInstance(_));
        if self.rows == Rows::Instances && !scene.keys.values().any(is_per_instance) {
            return Err(Error::new("a table of instances without a product per instance has no rows")
                .help("include one, such as `visible_box`, or write `rows = \"views\"`"));
        }
        let mut table = Table::new(self.columns(&scene.keys))?;
        for view in &scene.views {
            self.push(&mut table, cx.scene_id.0, view, (&scene.keys, &of_scene))?;
        }
        let path = self.table_path(output.id(), &scene_name(cx.scene_id));
        let categories = || serde_json::to_string(&coco::categories(cx.dataset));
        let categories = self.include.has_category_ids().then(categories).transpose();
        let categories = categories.map_err(|error| Error::new(format!("cannot be written as JSON: {error}")))?;
        table.write(output.create(&path)?, &path, &cx.dataset.program, categories)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match (of.scene, of.view) {
            (Some(scene), Some(view)) if self.images == Images::Files => {
                vec![format!("{}/{}", of.id, image_path(&view_name(scene, view)))]
            }
            (Some(scene), None) => vec![self.table_path(of.id, &scene_name(scene))],
            _ => Vec::new(),
        }
    }
}

impl Parquet {
    fn table_path(&self, id: &str, scene: &str) -> String {
        format!("{id}/{}/{scene}.parquet", self.rows.folder())
    }
}

/// Path of an image inside the writer's folder.
fn image_path(view: &str) -> String {
    format!("images/{view}.png")
}

/// Keys of the products of a scene and its views, by name.
type Keys = BTreeMap<String, KeyId>;

/// What a scene keeps for its table.
#[derive(Default)]
pub struct SceneRows {
    views: Vec<ViewRows>,
    keys: Keys,
}

/// What a table has of a view.
struct ViewRows {
    view: u32,
    size: [u32; 2],
    image: Value,
    /// All instances that a product has a value of, by id.
    instances: BTreeSet<InstanceId>,
    /// Cells of each product of the view by name, a list per column.
    cells: BTreeMap<String, Cells>,
}

/// The cells of a product, by column.
enum Cells {
    /// Of a view or a scene.
    One(Vec<Value>),
    /// Of each instance.
    PerInstance(BTreeMap<InstanceId, Vec<Value>>),
}

impl Cells {
    fn of(product: &str, key: &KeyId, products: &Products, dataset: &DatasetInfo) -> Result<Self> {
        let columns = column::columns(key);
        let row = |value: &Value| {
            let cells = columns.iter().map(|column| column.cell(value, dataset)).collect::<Result<Vec<Value>>>();
            cells.map_err(|error| error.context(format!("product `{product}`")))
        };
        Ok(match products.value(product)? {
            Value::PerInstance(values) => {
                Self::PerInstance(values.iter().map(|(id, value)| Ok((*id, row(value)?))).collect::<Result<_>>()?)
            }
            value => Self::One(row(&value)?),
        })
    }

    /// The cell of an instance in a column.
    fn of_instance(&self, id: InstanceId, column: usize) -> Value {
        match self {
            Self::One(cells) => cells[column].clone(),
            Self::PerInstance(cells) => cells.get(&id).map_or(Value::Null, |cells| cells[column].clone()),
        }
    }

    /// The cell of a view in a column: a list of those of its instances, or the only one.
    fn of_view(&self, instances: &BTreeSet<InstanceId>, column: usize) -> Value {
        match self {
            Self::One(cells) => cells[column].clone(),
            Self::PerInstance(_) => Value::List(instances.iter().map(|&id| self.of_instance(id, column)).collect()),
        }
    }
}

impl Parquet {
    /// The cell of a view's image, which is written here if it has a file.
    fn image(&self, view: &str, products: &Products, output: &Output) -> Result<Value> {
        let path = image_path(view);
        Ok(match self.images {
            Images::None => Value::Null,
            Images::Files => {
                png::Image::rgb(products.get(RGB)?).write(output, &format!("{}/{path}", output.id()))?;
                format!("../{path}").into()
            }
            Images::Embedded => {
                let bytes = Value::Bytes(png::Image::rgb(products.get(RGB)?).encode()?);
                Value::record([("bytes", bytes), ("path", format!("{view}.png").into())])
            }
        })
    }

    /// The included products that there are, in the order of the recipe.
    fn included<'a>(&'a self, keys: &'a Keys) -> impl Iterator<Item = (&'a str, &'a KeyId)> {
        self.include.names().filter_map(|name| Some((name, keys.get(name)?)))
    }

    /// Names and types of the columns, in the order of the cells of [`push`](Self::push).
    fn columns(&self, keys: &Keys) -> Vec<(String, Node)> {
        let per_view = self.rows == Rows::Views;
        let of_instances = |node: Node| if per_view { Node::list(node) } else { node };
        let own =
            OWN.map(|name| (name.to_owned(), if name == "instance" { of_instances(Node::Int) } else { Node::Int }));
        let [file, image] = IMAGES.map(str::to_owned);
        let image = match self.images {
            Images::None => None,
            Images::Files => Some((file, Node::Text)),
            Images::Embedded => Some((image, column::image())),
        };
        let products = self.included(keys).flat_map(|(_, key)| {
            let is_list = matches!(key.form(), Form::PerInstance(_));
            let typed = move |Column { name, node, .. }| (name, if is_list { of_instances(node) } else { node });
            column::columns(key).into_iter().map(typed)
        });
        own.into_iter().chain(image).chain(products).collect()
    }

    /// Adds the rows of a view.
    fn push(
        &self,
        table: &mut Table,
        scene: u32,
        rows: &ViewRows,
        (keys, of_scene): (&Keys, &BTreeMap<String, Cells>),
    ) -> Result<()> {
        let products = || {
            self.included(keys).filter_map(|(name, key)| {
                let cells = rows.cells.get(name).or_else(|| of_scene.get(name))?;
                Some((0..column::columns(key).len()).map(move |column| (cells, column)))
            })
        };
        let own = |instance: Value| {
            let [width, height] = rows.size.map(Value::from);
            let image = (self.images != Images::None).then(|| rows.image.clone());
            [scene.into(), rows.view.into(), instance, width, height].into_iter().chain(image)
        };
        let id = |id: InstanceId| Value::from(u32::from(id.0));
        match self.rows {
            Rows::Instances => rows.instances.iter().try_for_each(|&instance| {
                let cells = products().flatten().map(|(cells, column)| cells.of_instance(instance, column));
                table.push(own(id(instance)).chain(cells))
            }),
            Rows::Views => {
                let cells = products().flatten().map(|(cells, column)| cells.of_view(&rows.instances, column));
                let instances = rows.instances.iter().map(|&instance| id(instance)).collect::<Vec<_>>();
                table.push(own(Value::List(instances)).chain(cells))
            }
        }
    }
}

register!(Parquet);
