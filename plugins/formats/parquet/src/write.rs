//! Writes Parquet tables.

use crate::file::ParquetTable;
use crate::parquet::{Parquet, ParquetImages, ParquetRows};
use crate::record::{
    self, CATEGORIES, EXTENSION, IMAGE, IMAGE_BYTES, IMAGE_FILE, IMAGE_FOLDER, IMAGE_PATH, INSTANCE, OWN, PRODUCTS,
    ParquetColumn,
};
use crate::shred::ColumnType;
use std::collections::{BTreeMap, BTreeSet};
use syntable_formats::encode::{scene_name, view_name};
use syntable_formats::writer::ImageWriter;
use syntable_formats::{coco, json, known};
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::product::{Form, Scope};

impl ImageWriter for Parquet {
    type Scene = SceneRows;

    fn reads(&self) -> Vec<Input> {
        let rgb = (self.images != ParquetImages::None).then(|| Input::of(RGB));
        rgb.into_iter().chain(self.include.inputs(Accepts::when(record::accept))).collect()
    }

    fn view(&self, scene: &mut SceneRows, cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let name = view_name(cx.scene_id, cx.view_id);
        let image = self.image(&name, products, output)?;
        let (mut cells, mut instances) = (BTreeMap::new(), BTreeSet::new());
        for (product, key) in self.include.of_scope(products, Scope::View) {
            let own = ProductCells::of(product, &key, products, cx.dataset)?;
            if let ProductCells::PerInstance(cells) = &own {
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
            of_scene.insert(product.to_owned(), ProductCells::of(product, &key, products, cx.dataset)?);
            scene.keys.insert(product.to_owned(), key);
        }
        let is_per_instance = |key: &KeyId| matches!(key.form(), Form::PerInstance(_));
        if self.rows == ParquetRows::Instances && !scene.keys.values().any(is_per_instance) {
            return Err(Error::new("a table of instances without a product per instance has no rows")
                .help("include one, such as `visible_box`, or write `rows = \"views\"`"));
        }
        let mut table = ParquetTable::new(self.columns(&scene.keys))?;
        for view in &scene.views {
            self.push(&mut table, cx.scene_id.0, view, (&scene.keys, &of_scene))?;
        }
        let path = self.table_path(output.id(), &scene_name(cx.scene_id));
        let mut metadata = Vec::new();
        if self.include.has_category_ids() {
            metadata.push((CATEGORIES, json::text(&coco::categories(cx.dataset))?));
        }
        let keys: Vec<KeyId> = scene.keys.values().copied().collect();
        if let Some(declared) = known::declared(&keys) {
            metadata.push((PRODUCTS, json::text(&declared)?));
        }
        table.write(output.create(&path)?, &path, &cx.dataset.program, metadata)
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        match (of.scene, of.view) {
            (Some(scene), Some(view)) if self.images == ParquetImages::Files => {
                vec![format!("{}/{}", of.id, self.image_path(&view_name(scene, view)))]
            }
            (Some(scene), None) => vec![self.table_path(of.id, &scene_name(scene))],
            _ => Vec::new(),
        }
    }
}

impl Parquet {
    fn table_path(&self, id: &str, scene: &str) -> String {
        format!("{id}/{}/{scene}.{EXTENSION}", self.rows.folder())
    }

    /// Path of an image inside the writer's folder.
    fn image_path(&self, view: &str) -> String {
        format!("{IMAGE_FOLDER}/{}", self.rgb.file_name(view))
    }
}

/// Keys of the products of a scene and its views, by name.
type Keys = BTreeMap<String, KeyId>;

/// The rows of a scene's table.
#[derive(Default)]
pub struct SceneRows {
    views: Vec<ViewRows>,
    keys: Keys,
}

/// The rows of a view.
struct ViewRows {
    view: u32,
    size: [u32; 2],
    image: Value,
    /// Ids of all instances for which any product has a value.
    instances: BTreeSet<InstanceId>,
    /// Cells of each product of the view by name, a list per column.
    cells: BTreeMap<String, ProductCells>,
}

/// The cells of a product, by column.
enum ProductCells {
    /// Of a view or a scene.
    One(Vec<Value>),
    /// Of each instance.
    PerInstance(BTreeMap<InstanceId, Vec<Value>>),
}

impl ProductCells {
    fn of(product: &str, key: &KeyId, products: &Products, dataset: &DatasetInfo) -> Result<Self> {
        let columns = record::columns(key);
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

    /// The cell of a view in a column: the list of its instances' cells, or the only cell.
    fn of_view(&self, instances: &BTreeSet<InstanceId>, column: usize) -> Value {
        match self {
            Self::One(cells) => cells[column].clone(),
            Self::PerInstance(_) => Value::List(instances.iter().map(|&id| self.of_instance(id, column)).collect()),
        }
    }
}

impl Parquet {
    /// The cell of a view's image. Writes the image file, if images are files.
    fn image(&self, view: &str, products: &Products, output: &Output) -> Result<Value> {
        let path = self.image_path(view);
        Ok(match self.images {
            ParquetImages::None => Value::Null,
            ParquetImages::Files => {
                self.rgb.write(products.get(RGB)?, output, &format!("{}/{path}", output.id()))?;
                format!("../{path}").into()
            }
            ParquetImages::Embedded => {
                let bytes = Value::Bytes(self.rgb.encode(products.get(RGB)?)?);
                Value::record([(IMAGE_BYTES, bytes), (IMAGE_PATH, self.rgb.file_name(view).into())])
            }
        })
    }

    /// The included products that exist, in the order of the recipe.
    fn included<'a>(&'a self, keys: &'a Keys) -> impl Iterator<Item = (&'a str, &'a KeyId)> {
        self.include.names().filter_map(|name| Some((name, keys.get(name)?)))
    }

    /// Names and types of the columns, in the order of the cells of [`push`](Self::push).
    fn columns(&self, keys: &Keys) -> Vec<(String, ColumnType)> {
        let per_view = self.rows == ParquetRows::Views;
        let of_instances = |node: ColumnType| if per_view { ColumnType::list(node) } else { node };
        let own = OWN.map(|name| {
            (name.to_owned(), if name == INSTANCE { of_instances(ColumnType::Int) } else { ColumnType::Int })
        });
        let image = match self.images {
            ParquetImages::None => None,
            ParquetImages::Files => Some((IMAGE_FILE.to_owned(), ColumnType::Text)),
            ParquetImages::Embedded => Some((IMAGE.to_owned(), record::image())),
        };
        let products = self.included(keys).flat_map(|(_, key)| {
            let is_list = matches!(key.form(), Form::PerInstance(_));
            let typed = move |ParquetColumn { name, node, .. }| (name, if is_list { of_instances(node) } else { node });
            record::columns(key).into_iter().map(typed)
        });
        own.into_iter().chain(image).chain(products).collect()
    }

    /// Adds the rows of a view.
    fn push(
        &self,
        table: &mut ParquetTable,
        scene: u32,
        rows: &ViewRows,
        (keys, of_scene): (&Keys, &BTreeMap<String, ProductCells>),
    ) -> Result<()> {
        let products = || {
            self.included(keys).filter_map(|(name, key)| {
                let cells = rows.cells.get(name).or_else(|| of_scene.get(name))?;
                Some((0..record::columns(key).len()).map(move |column| (cells, column)))
            })
        };
        let own = |instance: Value| {
            let [width, height] = rows.size.map(Value::from);
            let image = (self.images != ParquetImages::None).then(|| rows.image.clone());
            [scene.into(), rows.view.into(), instance, width, height].into_iter().chain(image)
        };
        let id = |id: InstanceId| Value::from(u32::from(id.0));
        match self.rows {
            ParquetRows::Instances => rows.instances.iter().try_for_each(|&instance| {
                let cells = products().flatten().map(|(cells, column)| cells.of_instance(instance, column));
                table.push(own(id(instance)).chain(cells))
            }),
            ParquetRows::Views => {
                let cells = products().flatten().map(|(cells, column)| cells.of_view(&rows.instances, column));
                let instances = rows.instances.iter().map(|&instance| id(instance)).collect::<Vec<_>>();
                table.push(own(Value::List(instances)).chain(cells))
            }
        }
    }
}
