//! The columns of products.
//!
//! A table has the same columns in all files of a dataset: they follow from the keys of the products, never from values.

use crate::shred::Node;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CAMERA, CATEGORY_ID, OBJECT_INFO, VISIBILITY};
use syntable_model::product::{Form, Scope};

/// Columns of every table. `instance` is a list in a table of images.
pub const OWN: [&str; 5] = ["scene", "view", "instance", "width", "height"];
/// The path of an image, and an image in the table.
pub const IMAGES: [&str; 2] = ["image_file", "image"];
/// The class beside `category_id`.
pub const CATEGORY: &str = "category";

/// A field of a record that has a column of its own.
type Field = (&'static str, fn() -> Node);

/// The records whose fields are columns; other records are JSON text.
fn fields(product: &str) -> Option<&'static [Field]> {
    const OF_OBJECT: &[Field] = &[
        ("asset", || Node::Text),
        ("obj_id", || Node::Int),
        ("mass_kg", || Node::Float),
        ("world_from_object", matrix),
        ("camera_from_object", matrix),
        ("model_origin_m", || Node::list(Node::Float)),
    ];
    const OF_VISIBILITY: &[Field] = &[
        ("px_count_all", || Node::Int),
        ("px_count_in_frame", || Node::Int),
        ("px_count_valid", || Node::Int),
        ("px_count_visib", || Node::Int),
        ("visib_fract", || Node::Float),
    ];
    // Without a value where the lens is free of distortion.
    const OF_CAMERA: &[Field] =
        &[("K", matrix), ("world_from_camera", matrix), ("distortion_k1_k2_p1_p2_k3", || Node::list(Node::Float))];
    let all = [(OBJECT_INFO.name(), OF_OBJECT), (VISIBILITY.name(), OF_VISIBILITY), (CAMERA.name(), OF_CAMERA)];
    all.into_iter().find(|(name, _)| *name == product).map(|(_, fields)| fields)
}

/// Names of columns that no product may have.
pub fn reserved() -> Vec<&'static str> {
    let records = [OBJECT_INFO.name(), VISIBILITY.name(), CAMERA.name()];
    let of_records = records.into_iter().filter_map(fields).flatten().map(|(name, _)| *name);
    OWN.into_iter().chain(IMAGES).chain([CATEGORY]).chain(of_records).collect()
}

/// The entries of a matrix, row by row.
fn matrix() -> Node {
    Node::list(Node::Float)
}

/// COCO's compressed run lengths, as pycocotools takes them.
fn run_lengths() -> Node {
    Node::Struct(vec![("size", Node::list(Node::Int)), ("counts", Node::Text)])
}

/// An image in the form that Hugging Face `datasets` decodes.
pub fn image() -> Node {
    Node::Struct(vec![("bytes", Node::Bytes), ("path", Node::Text)])
}

/// A column that is made from a product.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// Its name in the table.
    pub name: String,
    /// Type of a cell of one instance, or of one view.
    pub node: Node,
    part: Part,
}

/// What a column has of a value.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
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

/// Refuses products that have no place in a table, with the reason and a remedy.
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
pub fn columns(key: &KeyId) -> Vec<Column> {
    let product = key.to_string();
    let column = |name: &str, node, part| Column { name: name.to_owned(), node, part };
    if let Some(fields) = fields(&product) {
        return fields.iter().map(|(field, node)| column(field, node(), Part::Field(field))).collect();
    }
    let whole = |node| column(&product, node, Part::Whole);
    match key.form().of_one() {
        Form::Int if product == CATEGORY_ID.name() => {
            vec![whole(Node::Int), column(CATEGORY, Node::Text, Part::Category)]
        }
        Form::Bool => vec![whole(Node::Bool)],
        Form::Int => vec![whole(Node::Int)],
        Form::Float => vec![whole(Node::Float)],
        Form::Text => vec![whole(Node::Text)],
        Form::Bytes => vec![whole(Node::Bytes)],
        Form::Ints(_) => vec![whole(Node::list(Node::Int))],
        Form::Mask => {
            vec![column(&product, run_lengths(), Part::Runs), column(&format!("{product}_area"), Node::Int, Part::Area)]
        }
        _ => vec![column(&product, Node::Text, Part::Json)],
    }
}

impl Column {
    /// The cell of a value of the product.
    pub fn cell(&self, value: &Value, dataset: &DatasetInfo) -> Result<Value> {
        Ok(match (self.part, value) {
            (_, Value::Null) => Value::Null,
            (Part::Runs, Value::Mask(mask)) => {
                let size = [mask.height(), mask.width()];
                Value::record([("size", size.into()), ("counts", mask.to_coco().into())])
            }
            (Part::Area, Value::Mask(mask)) => mask.area().into(),
            (Part::Category, &Value::Int(id)) => {
                let id = u32::try_from(id).map_err(|_| Error::new(format!("`category_id` is {id}, which is none")))?;
                dataset.category(id)?.1.into()
            }
            (Part::Field(field), Value::Record(fields)) => {
                let value = fields.iter().find(|(name, _)| name == field).map_or(&Value::Null, |(_, value)| value);
                if matches!(self.node, Node::List(_)) { flat(value) } else { value.clone() }
            }
            (Part::Json, value) => serde_json::to_string(value)
                .map_err(|error| Error::new(format!("cannot be written as JSON: {error}")))?
                .into(),
            (_, value) => value.clone(),
        })
    }
}

/// The value of a product from the cells of its columns.
pub fn value(columns: &[Column], cells: &[Value]) -> Result<Value> {
    let mut record = Vec::new();
    for (column, cell) in columns.iter().zip(cells) {
        match (column.part, cell) {
            // They say nothing new.
            (Part::Area | Part::Category, _) => {}
            (Part::Whole | Part::Runs, value) => return Ok(value.clone()),
            (Part::Json, Value::Text(text)) => {
                let json = serde_json::from_str::<serde_json::Value>(text);
                return Value::of(
                    &json.map_err(|error| Error::new(format!("column `{}` is not JSON: {error}", column.name)))?,
                );
            }
            (Part::Field(_) | Part::Json, Value::Null) => {}
            (Part::Field(field), value) => record.push((field.to_owned(), square(value))),
            (Part::Json, value) => return Ok(value.clone()),
        }
    }
    Ok(Value::Record(record))
}

/// The rows of a square matrix whose entries are given row by row; other values stay.
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
