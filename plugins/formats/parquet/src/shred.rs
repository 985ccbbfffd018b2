//! Nested values as the flat columns of Parquet.
//!
//! Each leaf of a column's type is a list of its values with two levels per entry. The definition level counts the
//! optional and repeated nodes above the value that exist. The repetition level identifies the list that the entry
//! continues. All nodes are optional, and lists have the three levels of the format's specification, so every reader
//! recognizes them as lists.

use parquet::basic::{ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::schema::types::{Type, TypePtr};
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::product::Value;

/// The type of a cell. All cells may be null.
#[derive(Debug, Clone, PartialEq)]
pub enum ColumnType {
    /// A boolean.
    Bool,
    /// A signed integer of 64 bits.
    Int,
    /// A double.
    Float,
    /// UTF-8 text.
    Text,
    /// Bytes.
    Bytes,
    /// Named fields.
    Struct(Vec<(&'static str, ColumnType)>),
    /// A list of any length.
    List(Box<ColumnType>),
}

impl ColumnType {
    /// A list of elements of a type.
    pub fn list(of: Self) -> Self {
        Self::List(Box::new(of))
    }

    /// The type in Parquet's schema.
    pub fn schema(&self, name: &str) -> Result<TypePtr, ParquetError> {
        let leaf = |physical| Type::primitive_type_builder(name, physical).with_repetition(Repetition::OPTIONAL);
        let group = |fields| Type::group_type_builder(name).with_repetition(Repetition::OPTIONAL).with_fields(fields);
        let schema = match self {
            Self::Bool => leaf(Physical::BOOLEAN).build()?,
            Self::Int => leaf(Physical::INT64).build()?,
            Self::Float => leaf(Physical::DOUBLE).build()?,
            Self::Text => leaf(Physical::BYTE_ARRAY).with_logical_type(Some(LogicalType::String)).build()?,
            Self::Bytes => leaf(Physical::BYTE_ARRAY).build()?,
            Self::Struct(fields) => {
                let fields = fields.iter().map(|(name, node)| node.schema(name)).collect::<Result<_, _>>()?;
                group(fields).build()?
            }
            Self::List(of) => {
                let list = Type::group_type_builder("list").with_repetition(Repetition::REPEATED);
                let list = list.with_fields(vec![of.schema("element")?]).build()?;
                group(vec![Arc::new(list)])
                    .with_converted_type(ConvertedType::LIST)
                    .with_logical_type(Some(LogicalType::List))
                    .build()?
            }
        };
        Ok(Arc::new(schema))
    }

    /// Appends an empty leaf for each leaf of the type.
    pub fn leaves(&self, leaves: &mut Vec<ColumnLeaf>) {
        match self {
            Self::Bool => leaves.push(ColumnLeaf::new(LeafValues::Bool(Vec::new()))),
            Self::Int => leaves.push(ColumnLeaf::new(LeafValues::Int(Vec::new()))),
            Self::Float => leaves.push(ColumnLeaf::new(LeafValues::Float(Vec::new()))),
            Self::Text | Self::Bytes => leaves.push(ColumnLeaf::new(LeafValues::Bytes(Vec::new()))),
            Self::Struct(fields) => fields.iter().for_each(|(_, node)| node.leaves(leaves)),
            Self::List(of) => of.leaves(leaves),
        }
    }

    fn leaf_count(&self) -> usize {
        match self {
            Self::Struct(fields) => fields.iter().map(|(_, node)| node.leaf_count()).sum(),
            Self::List(of) => of.leaf_count(),
            _ => 1,
        }
    }
}

/// The values of a leaf.
pub enum LeafValues {
    /// Booleans.
    Bool(Vec<bool>),
    /// Integers.
    Int(Vec<i64>),
    /// Doubles.
    Float(Vec<f64>),
    /// Bytes or text.
    Bytes(Vec<ByteArray>),
}

/// A leaf of a column: its values, and the levels of all entries.
pub struct ColumnLeaf {
    /// The values that are not null.
    pub values: LeafValues,
    /// Definition level of each entry.
    pub definition: Vec<i16>,
    /// Repetition level of each entry.
    pub repetition: Vec<i16>,
}

/// Position of an entry in the nested lists.
#[derive(Clone, Copy)]
struct LevelPlace {
    definition: i16,
    repetition: i16,
    /// Number of enclosing lists.
    depth: i16,
}

impl ColumnLeaf {
    fn new(values: LeafValues) -> Self {
        Self { values, definition: Vec::new(), repetition: Vec::new() }
    }

    fn entry(&mut self, place: LevelPlace) {
        self.definition.push(place.definition);
        self.repetition.push(place.repetition);
    }
}

/// Appends the cell of a row to the leaves of its column.
pub fn push(node: &ColumnType, cell: &Value, leaves: &mut [ColumnLeaf]) -> Result<()> {
    push_at(node, cell, leaves, LevelPlace { definition: 0, repetition: 0, depth: 0 })
}

fn push_at(node: &ColumnType, cell: &Value, leaves: &mut [ColumnLeaf], place: LevelPlace) -> Result<()> {
    let there = LevelPlace { definition: place.definition + 1, ..place };
    match (node, cell) {
        (_, Value::Null) => leaves.iter_mut().for_each(|leaf| leaf.entry(place)),
        (ColumnType::Struct(fields), Value::Record(values)) => {
            let mut rest = leaves;
            for (name, node) in fields {
                let own;
                (own, rest) = rest.split_at_mut(node.leaf_count());
                let value = values.iter().find(|(other, _)| other == name).map_or(&Value::Null, |(_, value)| value);
                push_at(node, value, own, there)?;
            }
        }
        (ColumnType::List(_), Value::List(values)) if values.is_empty() => {
            leaves.iter_mut().for_each(|leaf| leaf.entry(there));
        }
        (ColumnType::List(of), Value::List(values)) => {
            let first = LevelPlace { definition: place.definition + 2, depth: place.depth + 1, ..place };
            for (i, value) in values.iter().enumerate() {
                let repetition = if i == 0 { place.repetition } else { first.depth };
                push_at(of, value, leaves, LevelPlace { repetition, ..first })?;
            }
        }
        (node, cell) => {
            let [leaf] = leaves else { return Err(mismatch(node, cell)) };
            match (&mut leaf.values, cell) {
                (LeafValues::Bool(values), &Value::Bool(value)) => values.push(value),
                (LeafValues::Int(values), &Value::Int(value)) => values.push(value),
                (LeafValues::Int(values), &Value::Uint(value)) => {
                    values.push(i64::try_from(value).map_err(|_| mismatch(node, cell))?);
                }
                (LeafValues::Float(values), &Value::Float(value)) => values.push(value),
                (LeafValues::Float(values), &Value::Int(value)) => values.push(value as f64),
                (LeafValues::Float(values), &Value::Uint(value)) => values.push(value as f64),
                (LeafValues::Bytes(values), Value::Text(value)) if *node == ColumnType::Text => {
                    values.push(value.as_str().into())
                }
                (LeafValues::Bytes(values), Value::Bytes(value)) if *node == ColumnType::Bytes => {
                    values.push(value.clone().into());
                }
                _ => return Err(mismatch(node, cell)),
            }
            leaf.entry(there);
        }
    }
    Ok(())
}

fn mismatch(node: &ColumnType, cell: &Value) -> Error {
    let cell = serde_json::to_string(cell).unwrap_or_default();
    let start: String = cell.chars().take(40).collect();
    Error::new(format!("the column holds {}, not {start}", node.name())).help("write the product with jsonl")
}

impl ColumnType {
    fn name(&self) -> &'static str {
        match self {
            Self::Bool => "truth values",
            Self::Int => "integers of 64 bits",
            Self::Float => "numbers",
            Self::Text => "text",
            Self::Bytes => "bytes",
            Self::Struct(_) => "records",
            Self::List(_) => "lists",
        }
    }
}
