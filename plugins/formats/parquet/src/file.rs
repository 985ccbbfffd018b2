//! One table as a Parquet file.

use crate::record::{IMAGE, IMAGE_BYTES};
use crate::shred::{ColumnLeaf, ColumnType, LeafValues, push};
use parquet::basic::Compression;
use parquet::data_type::{BoolType, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{ColumnPath, Type};
use std::collections::BTreeSet;
use std::io::Write;
use std::sync::Arc;
use syntable_model::error::{Error, Result};
use syntable_model::product::Value;

/// A table in memory, column by column.
pub struct ParquetTable {
    columns: Vec<(String, ColumnType)>,
    /// The leaves of each column.
    leaves: Vec<Vec<ColumnLeaf>>,
}

impl ParquetTable {
    /// A table without rows. Refuses two columns with the same name.
    pub fn new(columns: Vec<(String, ColumnType)>) -> Result<Self> {
        let mut seen = BTreeSet::new();
        if let Some((name, _)) = columns.iter().find(|(name, _)| !seen.insert(name.as_str())) {
            return Err(Error::new(format!("two products have a column `{name}`"))
                .help("write one of them with another writer"));
        }
        let leaves = columns.iter().map(|(_, node)| {
            let mut leaves = Vec::new();
            node.leaves(&mut leaves);
            leaves
        });
        let leaves = leaves.collect();
        Ok(Self { columns, leaves })
    }

    /// Appends a row, a cell per column.
    pub fn push(&mut self, cells: impl IntoIterator<Item = Value>) -> Result<()> {
        for (((name, node), leaves), cell) in self.columns.iter().zip(&mut self.leaves).zip(cells) {
            push(node, &cell, leaves).map_err(|error| error.context(format!("column `{name}`")))?;
        }
        Ok(())
    }

    /// Writes the table as a file with one row group, or with none if the table has no rows. The content does not
    /// depend on the clock. Errors report `path`. `metadata` has texts by key.
    pub fn write(self, out: impl Write + Send, path: &str, program: &str, metadata: Vec<(&str, String)>) -> Result<()> {
        self.try_write(out, program, metadata).map_err(|error| match error {
            // An error of the disk is not a fault of the scene.
            ParquetError::External(cause) if cause.is::<std::io::Error>() => {
                cause.downcast_ref().map_or_else(|| Error::new(cause.to_string()), |io| Error::io(path, io))
            }
            error => Error::new(format!("cannot be written: {error}")).in_file(path),
        })
    }

    fn try_write(
        self,
        out: impl Write + Send,
        program: &str,
        metadata: Vec<(&str, String)>,
    ) -> Result<(), ParquetError> {
        let fields = self.columns.iter().map(|(name, node)| node.schema(name)).collect::<Result<_, _>>()?;
        let schema = Type::group_type_builder("schema").with_fields(fields).build()?;
        let embeds = self.columns.iter().any(|(name, _)| name == IMAGE);
        let bytes = ColumnPath::new(vec![IMAGE.to_owned(), IMAGE_BYTES.to_owned()]);
        let own = metadata.into_iter().map(|(key, text)| KeyValue::new(key.to_owned(), text));
        let metadata: Vec<KeyValue> = embeds.then(|| hugging_face(IMAGE)).into_iter().chain(own).collect();
        let properties = WriterProperties::builder()
            .set_created_by(program.to_owned())
            .set_compression(Compression::SNAPPY)
            // Images are already compressed, and no two are equal.
            .set_column_compression(bytes.clone(), Compression::UNCOMPRESSED)
            .set_column_dictionary_enabled(bytes.clone(), false)
            .set_column_statistics_enabled(bytes, EnabledStatistics::None)
            .set_key_value_metadata(Some(metadata).filter(|pairs| !pairs.is_empty()));
        let mut file = SerializedFileWriter::new(out, Arc::new(schema), Arc::new(properties.build()))?;
        // Hugging Face `datasets` fails on a row group without rows.
        if self.leaves.iter().flatten().any(|leaf| !leaf.definition.is_empty()) {
            let mut group = file.next_row_group()?;
            for leaf in self.leaves.iter().flatten() {
                let mut column = group.next_column()?.ok_or_else(|| ParquetError::General("too few columns".into()))?;
                leaf.write(&mut column)?;
                column.close()?;
            }
            group.close()?;
        }
        file.close().map(drop)
    }
}

impl ColumnLeaf {
    fn write(&self, column: &mut SerializedColumnWriter) -> Result<(), ParquetError> {
        let levels = (Some(&*self.definition), Some(&*self.repetition));
        match &self.values {
            LeafValues::Bool(values) => column.typed::<BoolType>().write_batch(values, levels.0, levels.1),
            LeafValues::Int(values) => column.typed::<Int64Type>().write_batch(values, levels.0, levels.1),
            LeafValues::Float(values) => column.typed::<DoubleType>().write_batch(values, levels.0, levels.1),
            LeafValues::Bytes(values) => column.typed::<ByteArrayType>().write_batch(values, levels.0, levels.1),
        }
        .map(drop)
    }
}

/// The metadata by which Hugging Face `datasets` recognizes a column of images.
fn hugging_face(column: &str) -> KeyValue {
    let features = serde_json::json!({ "info": { "features": { column: { "_type": "Image" } } } });
    KeyValue::new("huggingface".to_owned(), features.to_string())
}
