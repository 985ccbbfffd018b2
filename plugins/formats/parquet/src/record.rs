//! Names of files and columns, and the columns of products.
//!
//! A table has the same columns in all files of a dataset: columns depend on the keys of the products, never on values.

use crate::shred::ColumnType;
use syntable_formats::json;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CAMERA, CATEGORY_ID, OBJECT_INFO, VISIBILITY};
use syntable_model::product::{DistortionRecord, Form, Scope};

/// Extension of a table.
pub const EXTENSION: &str = "parquet";
/// Folder of tables with a row per view.
pub const VIEWS: &str = "views";
/// Folder of tables with a row per instance.
pub const INSTANCES: &str = "instances";
/// Folder of image files.
pub const IMAGE_FOLDER: &str = "images";
/// Key of the metadata with the categories of the dataset.
pub const CATEGORIES: &str = "categories";
/// Key of the metadata with the products that no linked crate defines.
pub const PRODUCTS: &str = "products";

/// Column of the scene's number.
pub const SCENE: &str = "scene";
/// Column of the view's number.
pub const VIEW: &str = "view";
/// Column of the instance's id; a list in a table of views.
pub const INSTANCE: &str = "instance";
/// Column of the image's width, px.
pub const WIDTH: &str = "width";
/// Column of the image's height, px.
pub const HEIGHT: &str = "height";
/// Columns of every table.
pub const OWN: [&str; 5] = [SCENE, VIEW, INSTANCE, WIDTH, HEIGHT];
/// Column of the path of an image.
pub const IMAGE_FILE: &str = "image_file";
/// Column of an image in the table.
pub const IMAGE: &str = "image";
/// Field of [`IMAGE`] with the file's content.
pub const IMAGE_BYTES: &str = "bytes";
/// Field of [`IMAGE`] with the file's name.
pub const IMAGE_PATH: &str = "path";
/// Column of the category's name, next to `category_id`.
pub const CATEGORY: &str = "category";

/// A field of a record that has its own column.
type RecordField = (&'static str, fn() -> ColumnType);

/// The records whose fields are columns; other records are JSON text.
fn fields(product: &str) -> Option<&'static [RecordField]> {
    const OF_OBJECT: &[RecordField] = &[
        ("asset", || ColumnType::Text),
        ("obj_id", || ColumnType::Int),
        ("mass_kg", || ColumnType::Float),
        ("world_from_object", matrix),
        ("camera_from_object", matrix),
        ("model_origin_m", || ColumnType::list(ColumnType::Float)),
    ];
    const OF_VISIBILITY: &[RecordField] = &[
        ("px_count_all", || ColumnType::Int),
        ("px_count_in_frame", || ColumnType::Int),
        ("px_count_valid", || ColumnType::Int),
        ("px_count_visib", || ColumnType::Int),
        ("visib_fract", || ColumnType::Float),
    ];
    // At most one of the coefficients of a lens is not null.
    const OF_CAMERA: &[RecordField] = &[
        ("K", matrix),
        ("world_from_camera", matrix),
        (DistortionRecord::NAMES[0], || ColumnType::list(ColumnType::Float)),
        (DistortionRecord::NAMES[1], || ColumnType::list(ColumnType::Float)),
        (DistortionRecord::NAMES[2], || ColumnType::list(ColumnType::Float)),
        (DistortionRecord::NAMES[3], || ColumnType::list(ColumnType::Float)),
        ("rig_camera", || ColumnType::Text),
        ("rig_pose", || ColumnType::Int),
        ("rig_from_camera", matrix),
    ];
    let all = [(OBJECT_INFO.name(), OF_OBJECT), (VISIBILITY.name(), OF_VISIBILITY), (CAMERA.name(), OF_CAMERA)];
    all.into_iter().find(|(name, _)| *name == product).map(|(_, fields)| fields)
}

/// Names of columns that no product may have.
pub fn reserved() -> Vec<&'static str> {
    let records = [OBJECT_INFO.name(), VISIBILITY.name(), CAMERA.name()];
    let of_records = records.into_iter().filter_map(fields).flatten().map(|(name, _)| *name);
    OWN.into_iter().chain([IMAGE_FILE, IMAGE]).chain([CATEGORY]).chain(of_records).collect()
}

/// The entries of a matrix, row by row.
fn matrix() -> ColumnType {
    ColumnType::list(ColumnType::Float)
}

/// COCO's compressed run lengths, as pycocotools accepts them.
fn run_lengths() -> ColumnType {
    ColumnType::Struct(vec![("size", ColumnType::list(ColumnType::Int)), ("counts", ColumnType::Text)])
}

/// An image in the form that Hugging Face `datasets` decodes.
pub fn image() -> ColumnType {
    ColumnType::Struct(vec![(IMAGE_BYTES, ColumnType::Bytes), (IMAGE_PATH, ColumnType::Text)])
}

/// A column that represents a part of a product.
#[derive(Debug, Clone, PartialEq)]
pub struct ParquetColumn {
    /// Its name in the table.
    pub name: String,
    /// Type of a cell of one instance, or of one view.
    pub node: ColumnType,
    part: ColumnPart,
}

/// The part of a value that a column holds.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ColumnPart {
    /// The value itself.
    Whole,
    /// The value as JSON.
    Json,
    /// The run lengths of a mask.
    Runs,
    /// The number of pixels of a mask.
    Area,
    /// The name of a category.
    Category,
    /// A field of a record.
    Field(&'static str),
}

/// Refuses products that a table cannot store, with the reason and a remedy.
pub fn accept(key: &KeyId) -> Result<(), String> {
    let form = key.form();
    match form.of_one() {
        _ if key.scope == Scope::Dataset => Err("a row is of a view; write it with jsonl".into()),
        Form::Image { .. } => Err(format!("a table has no cells for a {form}; write it with npz or png")),
        Form::Tensor(_) => Err(format!("a table has no cells for a {form}; write it with npz")),
        _ => Ok(()),
    }
}

/// The columns of a product.
pub fn columns(key: &KeyId) -> Vec<ParquetColumn> {
    let product = key.to_string();
    let column = |name: &str, node, part| ParquetColumn { name: name.to_owned(), node, part };
    if let Some(fields) = fields(&product) {
        return fields.iter().map(|(field, node)| column(field, node(), ColumnPart::Field(field))).collect();
    }
    let whole = |node| column(&product, node, ColumnPart::Whole);
    match key.form().of_one() {
        Form::Int if product == CATEGORY_ID.name() => {
            vec![whole(ColumnType::Int), column(CATEGORY, ColumnType::Text, ColumnPart::Category)]
        }
        Form::Bool => vec![whole(ColumnType::Bool)],
        Form::Int => vec![whole(ColumnType::Int)],
        Form::Float => vec![whole(ColumnType::Float)],
        Form::Text => vec![whole(ColumnType::Text)],
        Form::Bytes => vec![whole(ColumnType::Bytes)],
        Form::Ints(_) => vec![whole(ColumnType::list(ColumnType::Int))],
        Form::Mask => {
            vec![
                column(&product, run_lengths(), ColumnPart::Runs),
                column(&format!("{product}_area"), ColumnType::Int, ColumnPart::Area),
            ]
        }
        _ => vec![column(&product, ColumnType::Text, ColumnPart::Json)],
    }
}

impl ParquetColumn {
    /// The cell of a value of the product.
    pub fn cell(&self, value: &Value, dataset: &DatasetInfo) -> Result<Value> {
        Ok(match (self.part, value) {
            (_, Value::Null) => Value::Null,
            (ColumnPart::Runs, Value::Mask(mask)) => {
                let size = [mask.height(), mask.width()];
                Value::record([("size", size.into()), ("counts", mask.to_coco().into())])
            }
            (ColumnPart::Area, Value::Mask(mask)) => mask.area().into(),
            (ColumnPart::Category, &Value::Int(id)) => {
                let id = u32::try_from(id).map_err(|_| Error::new(format!("`category_id` is {id}, which is none")))?;
                dataset.category(id)?.1.into()
            }
            (ColumnPart::Field(field), Value::Record(fields)) => {
                let value = fields.iter().find(|(name, _)| name == field).map_or(&Value::Null, |(_, value)| value);
                if matches!(self.node, ColumnType::List(_)) { flat(value) } else { value.clone() }
            }
            (ColumnPart::Json, value) => json::text(value)?.into(),
            (_, value) => value.clone(),
        })
    }
}

/// The value of a product from the cells of its columns.
pub fn value(columns: &[ParquetColumn], cells: &[Value]) -> Result<Value> {
    let mut record = Vec::new();
    for (column, cell) in columns.iter().zip(cells) {
        match (column.part, cell) {
            // These columns repeat information of other columns.
            (ColumnPart::Area | ColumnPart::Category, _) => {}
            (ColumnPart::Whole | ColumnPart::Runs, value) => return Ok(value.clone()),
            (ColumnPart::Json, Value::Text(text)) => {
                let json = serde_json::from_str::<serde_json::Value>(text);
                return Value::of(
                    &json.map_err(|error| Error::new(format!("column `{}` is not JSON: {error}", column.name)))?,
                );
            }
            (ColumnPart::Field(_) | ColumnPart::Json, Value::Null) => {}
            (ColumnPart::Field(field), value) => record.push((field.to_owned(), square(value))),
            (ColumnPart::Json, value) => return Ok(value.clone()),
        }
    }
    Ok(Value::Record(record))
}

/// The rows of a square matrix from its entries, row by row; other values are unchanged.
fn square(value: &Value) -> Value {
    let Value::List(entries) = value else { return value.clone() };
    match entries.len() {
        9 => Value::List(entries.chunks(3).map(|row| Value::List(row.to_vec())).collect()),
        16 => Value::List(entries.chunks(4).map(|row| Value::List(row.to_vec())).collect()),
        _ => value.clone(),
    }
}

/// The numbers of an array or of nested lists, in C order.
fn flat(value: &Value) -> Value {
    fn collect(value: &Value, numbers: &mut Vec<Value>) {
        match value {
            Value::List(values) => values.iter().for_each(|value| collect(value, numbers)),
            Value::Tensor(tensor) => numbers.extend((0..tensor.shape.iter().product()).map(|i| tensor.element(i))),
            value => numbers.push(value.clone()),
        }
    }
    if *value == Value::Null {
        return Value::Null;
    }
    let mut numbers = Vec::new();
    collect(value, &mut numbers);
    Value::List(numbers)
}
