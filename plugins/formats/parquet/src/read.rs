//! Reads tables of instances or views.

use crate::bounds;
use crate::record::{
    self, CATEGORIES, CATEGORY, EXTENSION, HEIGHT, IMAGE, IMAGE_FILE, INSTANCE, INSTANCES, OWN, PRODUCTS,
    ParquetColumn, SCENE, VIEW, VIEWS, WIDTH,
};
use bytes::Bytes;
use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, FileReader, Length, SerializedFileReader};
use parquet::record::{Field, Row};
use parquet::schema::types::Type;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syntable_formats::coco::Category;
use syntable_formats::decode::{self, FileContent};
use syntable_formats::known::KnownProducts;
use syntable_formats::read::{self, Faults};
use syntable_formats::samples::{self, Contents, Latest, SampleFields, SampleReader};
use syntable_model::files::DatasetFolder;
use syntable_model::limits::TABLE_BYTES;
use syntable_model::mirror::DatasetFile;
use syntable_model::panics::guarded;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CAMERA, CATEGORY_ID, RGB};
use syntable_model::reader::{Format, Opened, Source};
use syntable_model::rule;

syntable_model::register_format!(
    Format::new(
        "parquet",
        "Parquet tables of instances or views, as the writer `parquet` has them.",
        |root| !tables_of(root).is_empty(),
        open,
    )
    .generic()
);

/// Folders of tables. Tables of views come first, since they also contain images without instances.
const FOLDERS: [&str; 2] = [VIEWS, INSTANCES];

/// The tables of a dataset, or of one of its folders, that are named by a scene.
fn tables_of(root: &Path) -> Vec<PathBuf> {
    let of = |folder: &Path| {
        let is_one = |path: &PathBuf| {
            let stem = path.file_stem().and_then(|stem| stem.to_str());
            path.extension().is_some_and(|it| it == EXTENSION) && stem.is_some_and(|it| it.parse::<u32>().is_ok())
        };
        read::entries(folder).into_iter().filter(is_one).collect::<Vec<_>>()
    };
    let folders = FOLDERS.map(|folder| root.join(folder)).into_iter().chain([root.to_owned()]);
    folders.map(|folder| of(&folder)).find(|tables| !tables.is_empty()).unwrap_or_default()
}

/// Name of the library in errors.
const LIBRARY: &str = "the library that reads Parquet";

/// The folder of tables. If it is one of the writer's folders, image names may lead to the writer's folder of images
/// next to it.
fn folder_of(source: &Source, tables: &Path) -> Result<DatasetFolder> {
    if tables != source.path {
        return Ok(source.folder(&source.path)?.inner(tables.file_name().unwrap_or_default()));
    }
    let whole = tables.canonicalize().map_err(|error| Error::io(tables, &error))?;
    match (whole.parent(), whole.file_name()) {
        (Some(above), Some(name)) if FOLDERS.iter().any(|folder| name == *folder) => {
            Ok(source.folder(above)?.inner(name))
        }
        _ => source.folder(tables),
    }
}

/// A file of a table, for the format's library.
struct TableFile(DatasetFile);

impl Length for TableFile {
    fn len(&self) -> u64 {
        self.0.size().unwrap_or_default()
    }
}

impl ChunkReader for TableFile {
    type T = BufReader<DatasetFile>;

    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        let mut file = self.0.try_clone()?;
        file.seek(SeekFrom::Start(start))?;
        Ok(BufReader::new(file))
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        let mut bytes = Vec::new();
        let read = self.get_read(start)?.take(length as u64).read_to_end(&mut bytes)?;
        match read == length {
            true => Ok(bytes.into()),
            false => Err(ParquetError::EOF(format!("{length} bytes at {start}, but the file has {read} of them"))),
        }
    }
}

/// An open table.
struct TableReader {
    reader: SerializedFileReader<TableFile>,
    path: PathBuf,
}

impl TableReader {
    fn open(path: &Path) -> Result<Self> {
        let mut file = decode::open(path)?;
        bounds::check_footer(&mut file).map_err(|error| error.in_file(path))?;
        let reader = guarded(LIBRARY, path, || {
            SerializedFileReader::new(TableFile(file)).map_err(|error| unreadable(path, &error))
        })?;
        Ok(Self { reader, path: path.to_owned() })
    }

    fn schema(&self) -> &Type {
        self.reader.metadata().file_metadata().schema()
    }

    fn columns(&self) -> BTreeSet<String> {
        self.schema().get_fields().iter().map(|field| field.name().to_owned()).collect()
    }

    /// A text in the metadata.
    fn metadata(&self, key: &str) -> Option<&str> {
        let pairs = self.reader.metadata().file_metadata().key_value_metadata()?;
        pairs.iter().find(|pair| pair.key == key)?.value.as_deref()
    }

    /// The categories in the metadata.
    fn categories(&self) -> Option<Vec<Category>> {
        serde_json::from_str(self.metadata(CATEGORIES)?).ok()
    }

    /// The products of linked crates, and the products that the metadata declares; none without declarations.
    ///
    /// # Errors
    /// If the declarations are faulty.
    fn products(&self) -> Result<Option<KnownProducts>> {
        let declared = |text: &str| KnownProducts::declared_in(text.as_bytes());
        let known = self.metadata(PRODUCTS).map(declared).transpose();
        known.map_err(|error| error.context("metadata `products`").in_file(&self.path))
    }

    /// Calls `each` with each row, reading the wanted columns only.
    fn each_row(&self, wanted: impl Fn(&str) -> bool, each: &mut dyn FnMut(TableRow)) -> Result<()> {
        let fail = |error: ParquetError| unreadable(&self.path, &error);
        let mut file = decode::open(&self.path)?;
        let texts = bounds::check_pages(&mut file, self.reader.metadata(), &wanted);
        let texts = texts.map_err(|error| error.in_file(&self.path))?;
        guarded(LIBRARY, &self.path, || {
            bounds::check_texts(&self.reader, texts).map_err(|error| error.in_file(&self.path))?;
            let fields: Vec<_> =
                self.schema().get_fields().iter().filter(|field| wanted(field.name())).cloned().collect();
            let names: Arc<[String]> = fields.iter().map(|field| field.name().to_owned()).collect();
            let schema = Type::group_type_builder(self.schema().name()).with_fields(fields).build().map_err(fail)?;
            let mut bytes = 0;
            for row in self.reader.get_row_iter(Some(schema)).map_err(fail)? {
                let row: Row = row.map_err(fail)?;
                let values: Vec<Field> = row.into_columns().into_iter().map(|(_, field)| field).collect();
                // Texts are copies of dictionary entries, which take no space in the file.
                bytes += values.iter().map(text_bytes).sum::<u64>();
                TABLE_BYTES.check(bytes).map_err(|error| error.in_file(&self.path))?;
                each(TableRow { names: Arc::clone(&names), values });
            }
            Ok(())
        })
    }

    /// All rows, with the wanted columns only.
    fn rows(&self, wanted: impl Fn(&str) -> bool) -> Result<TableRows> {
        let mut rows = TableRows::new();
        self.each_row(wanted, &mut |row| rows.push(row))?;
        Ok(rows)
    }
}

fn unreadable(path: &Path, error: &ParquetError) -> Error {
    // A store that does not answer says nothing about the file.
    if let ParquetError::External(inner) = error
        && let Some(failure) = inner.downcast_ref::<io::Error>()
        && failure.get_ref().is_some_and(|inner| inner.is::<Error>())
    {
        return Error::io(path, failure);
    }
    let error_of = Error::new(format!("not a readable Parquet file: {error}")).in_file(path);
    match error.to_string().contains("Disabled feature") {
        true => error_of.help("write it without compression, or with snappy"),
        false => error_of,
    }
}

/// The tables and the positions of their rows.
struct ParquetTables {
    /// Scene and view of each image, the index of its table in `paths`, and its size.
    places: Vec<((u32, u32), usize, [u32; 2])>,
    paths: Vec<PathBuf>,
    /// Folder of the tables, to which image names are relative.
    folder: DatasetFolder,
    columns: BTreeSet<String>,
    known: KnownProducts,
    /// The rows of the most recently read tables, by table and columns: a scene has many views.
    latest: Latest<(usize, BTreeSet<String>), TableRows>,
}

/// The cells of a row, by the names of their columns.
struct TableRow {
    names: Arc<[String]>,
    values: Vec<Field>,
}

impl TableRow {
    fn get(&self, column: &str) -> Option<&Field> {
        self.values.get(self.names.iter().position(|name| name == column)?)
    }
}

type TableRows = Vec<TableRow>;

/// Bytes of the texts of a cell.
fn text_bytes(field: &Field) -> u64 {
    match field {
        Field::Str(text) => text.len() as u64,
        Field::Group(row) => row.get_column_iter().map(|(_, field)| text_bytes(field)).sum(),
        Field::ListInternal(list) => list.elements().iter().map(text_bytes).sum(),
        _ => 0,
    }
}

fn open(source: &Source) -> Result<Opened> {
    let root = source.path.as_path();
    let paths = tables_of(root);
    if paths.is_empty() {
        let help = format!("name the folder that has `{INSTANCES}` or `{VIEWS}`, or the folder of the tables");
        return Err(Error::new("it has no tables of scenes").in_file(root).help(help));
    }
    let folder = folder_of(source, paths[0].parent().unwrap_or(root))?;
    read::check_inside(&folder, &paths)?;
    let (mut faults, mut views) = (Faults::default(), BTreeMap::<(u32, u32), (usize, [u32; 2])>::new());
    let (mut columns, mut names) = (BTreeSet::new(), BTreeMap::<u64, String>::new());
    let mut faulty = BTreeSet::new();
    // The categories of the first table that lists them. The names in rows cover only the categories of existing
    // objects.
    let (mut categories, mut known) = (None, KnownProducts::default());
    // Rows of views contain lists of instances.
    let mut has_views = false;
    for (table, path) in paths.iter().enumerate() {
        // Collects all rows before using them, since a damaged table is omitted as a whole.
        let read = TableReader::open(path).and_then(|table| {
            let rows = table.rows(|name| OWN.contains(&name) || [CATEGORY, CATEGORY_ID.name()].contains(&name))?;
            Ok((table.columns(), table.categories(), table.products()?, rows))
        });
        let (own, listed, declared, rows) = match read {
            Ok(read) => read,
            Err(error) => {
                faults.lost(rule::READABLE, read::file_name(path), format!("{error}: nothing of the scene is read"));
                continue;
            }
        };
        // If a table lacks a column that another table has, the error is reported when the column is read.
        columns.extend(own);
        categories = categories.or(listed);
        if let Some(declared) = declared {
            known.extend(&declared);
        }
        has_views |= rows.iter().any(|row| matches!(row.get(INSTANCE), Some(Field::ListInternal(_)) | None));
        for row in &rows {
            let number = |name: &str| u32::try_from(row.get(name).and_then(integer)?).ok();
            let (Some(scene), Some(view)) = (number(SCENE), number(VIEW)) else {
                let message = format!("a row has no numbers as `{SCENE}` and `{VIEW}`");
                faults.lost(rule::RECORDS_AGREE, read::file_name(path), message);
                continue;
            };
            let size = [WIDTH, HEIGHT].map(|edge| number(edge).unwrap_or_default());
            match views.entry((scene, view)) {
                Entry::Vacant(entry) => drop(entry.insert((table, size))),
                // Another row of an instance of the same view.
                Entry::Occupied(first) if *first.get() == (table, size) && !has_views => {}
                Entry::Occupied(first) => {
                    let file = read::file_name(path);
                    if first.get().0 == table && !has_views {
                        let message = format!("rows of view {view} have different sizes of its image");
                        faults.add(rule::UNIQUE_VIEWS, file, message);
                    } else {
                        let message = format!("view {view} of scene {scene} has another row");
                        faults.lost(rule::UNIQUE_VIEWS, file, message);
                    }
                }
            }
            let of = |name: &str| row.get(name).map(cells).unwrap_or_default();
            for (id, name) in of(CATEGORY_ID.name()).into_iter().zip(of(CATEGORY)) {
                if let (Some(id), Field::Str(name)) = (integer(&id).and_then(|id| u64::try_from(id).ok()), name) {
                    let known = names.entry(id).or_insert_with(|| name.clone());
                    if *known != name && faulty.insert(id) {
                        let message = format!("category {id} is `{name}`, which other rows call `{known}`");
                        faults.add(rule::UNIQUE_NAMES, read::file_name(path), message);
                    }
                }
            }
        }
    }
    let image = |&(scene, view): &(u32, u32)| read::image((scene, view), format!("scene {scene}, view {view}"));
    let contents = Contents {
        images: views.keys().map(image).collect(),
        fields: products_of(&columns, &known).into_keys().collect(),
        known: known.clone(),
        faults,
        categories,
        named: names,
        of_shown: BTreeSet::new(),
        leaves_out_empty: !has_views,
    };
    let places = views.into_iter().map(|(place, (table, size))| (place, table, size)).collect();
    Ok(samples::open(
        read::name_of(root),
        contents,
        Box::new(ParquetTables { places, paths, folder, columns, known, latest: Latest::default() }),
    ))
}

/// The products that the columns represent, with the columns of each.
fn products_of(columns: &BTreeSet<String>, known: &KnownProducts) -> BTreeMap<String, Vec<ParquetColumn>> {
    let of = |key: &KeyId| {
        let own: Vec<ParquetColumn> =
            record::columns(key).into_iter().filter(|column| columns.contains(&column.name)).collect();
        (!own.is_empty() && record::accept(key).is_ok()).then(|| (key.to_string(), own))
    };
    let mut products: BTreeMap<String, Vec<ParquetColumn>> = known.iter().filter_map(of).collect();
    if columns.contains(IMAGE_FILE) || columns.contains(IMAGE) {
        products.insert(RGB.name().to_owned(), Vec::new());
    }
    products
}

impl SampleReader for ParquetTables {
    fn size(&self, image: usize) -> Option<[u32; 2]> {
        Some(self.places[image].2).filter(|size| !size.contains(&0))
    }

    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<SampleFields> {
        let ((scene, view), table, size) = self.places[image];
        let path = &self.paths[table];
        let mut products = products_of(&self.columns, &self.known);
        products.retain(|name, _| wanted.contains(name.as_str()));
        let has_image = products.remove(RGB.name()).is_some();
        let needed: BTreeSet<&str> = products.values().flatten().map(|column| column.name.as_str()).collect();
        let of_row = [SCENE, VIEW, INSTANCE]
            .into_iter()
            .chain(needed)
            .chain([IMAGE_FILE, IMAGE].into_iter().filter(|_| has_image));
        let wanted: BTreeSet<String> = of_row.map(str::to_owned).collect();
        let read = || TableReader::open(path)?.rows(|name| wanted.contains(name));
        let all = self.latest.get((table, wanted.clone()), read)?;
        let is_own = |row: &&TableRow| {
            let is = |name: &str, number: u32| row.get(name).and_then(integer) == Some(i128::from(number));
            is(SCENE, scene) && is(VIEW, view)
        };
        let rows: Vec<&TableRow> = all.iter().filter(is_own).collect();
        let refuse = |what: String| Error::new(what).in_file(path);
        let mut fields = SampleFields::new();
        let first = rows.first().ok_or_else(|| refuse("its rows have changed".to_owned()))?;
        for (name, columns) in products {
            // Other tables may have these columns.
            if columns.iter().all(|column| first.get(&column.name).is_none()) {
                continue;
            }
            if let Some(column) = columns.iter().find(|column| first.get(&column.name).is_none()) {
                return Err(refuse(format!("it has no column `{}`, which others have", column.name)));
            }
            let value = if self.known.is_per_instance(&name) {
                of_instances(&columns, &rows).map_err(|error| error.in_file(path))?
            } else {
                let cells: Vec<Option<&Field>> = columns.iter().map(|column| first.get(&column.name)).collect();
                let value = record::value(&columns, &cells.into_iter().map(cell).collect::<Vec<_>>());
                let value = value.map_err(|error| error.in_file(path))?;
                match (name == CAMERA.name(), value) {
                    (true, Value::Record(own)) => {
                        let [width, height] = size.map(Value::from);
                        let size = [("width".to_owned(), width), ("height".to_owned(), height)];
                        Value::Record(size.into_iter().chain(own).collect())
                    }
                    (_, value) => value,
                }
            };
            fields.insert(name, value);
        }
        if has_image {
            fields.insert(RGB.name().to_owned(), self.rgb(path, first)?);
        }
        Ok(fields)
    }
}

impl ParquetTables {
    /// The image of a row.
    fn rgb(&self, table: &Path, row: &TableRow) -> Result<Value> {
        let content = match (row.get(IMAGE_FILE), row.get(IMAGE)) {
            (Some(Field::Str(file)), _) => FileContent::read(&self.folder.file(file)?)?,
            (_, Some(Field::Group(image))) => {
                let bytes = image.get_column_iter().find_map(|(_, field)| match field {
                    Field::Bytes(bytes) => Some(bytes.data().to_vec()),
                    _ => None,
                });
                FileContent::new(bytes.unwrap_or_default(), table.join(IMAGE))
            }
            _ => return Err(Error::new("a row has no image").in_file(table)),
        };
        Ok(content.rgb()?.into())
    }
}

/// The values of a product by instance. A cell without a value is skipped.
fn of_instances(columns: &[ParquetColumn], rows: &[&TableRow]) -> Result<Value> {
    let refuse = |what: &str| Error::new(what);
    let mut seen = BTreeSet::new();
    let mut values = BTreeMap::new();
    for row in rows {
        let ids = row.get(INSTANCE).map(cells).unwrap_or_default();
        // A row of a view has lists; a row of an instance has values.
        let is_view = matches!(row.get(INSTANCE), Some(Field::ListInternal(_)));
        let of_column = |column: &ParquetColumn| match row.get(&column.name) {
            Some(Field::ListInternal(list)) if is_view => list.elements().to_vec(),
            Some(field) if !is_view => vec![field.clone()],
            _ => vec![Field::Null; ids.len()],
        };
        let of_columns: Vec<Vec<Field>> = columns.iter().map(of_column).collect();
        if of_columns.iter().any(|cells| cells.len() != ids.len()) {
            return Err(refuse("a row has not as many values as instances"));
        }
        for (at, id) in ids.iter().enumerate() {
            let own: Vec<Value> = of_columns.iter().map(|cells| cell(Some(&cells[at]))).collect();
            let id = integer(id).and_then(|id| u16::try_from(id).ok()).filter(|id| *id > 0);
            let id = InstanceId(id.ok_or_else(|| refuse("`instance` is no number from 1 to 65535"))?);
            if !seen.insert(id) {
                return Err(refuse(&format!("instance {id} of a view occurs twice")));
            }
            if own.iter().any(|value| *value != Value::Null) {
                values.insert(id, record::value(columns, &own)?);
            }
        }
    }
    Ok(Value::PerInstance(values))
}

/// The elements of a list, or the single value.
fn cells(field: &Field) -> Vec<Field> {
    match field {
        Field::ListInternal(list) => list.elements().to_vec(),
        Field::Null => Vec::new(),
        field => vec![field.clone()],
    }
}

fn integer(field: &Field) -> Option<i128> {
    Some(match field {
        Field::Byte(value) => (*value).into(),
        Field::Short(value) => (*value).into(),
        Field::Int(value) => (*value).into(),
        Field::Long(value) => (*value).into(),
        Field::UByte(value) => (*value).into(),
        Field::UShort(value) => (*value).into(),
        Field::UInt(value) => (*value).into(),
        Field::ULong(value) => (*value).into(),
        _ => return None,
    })
}

/// A cell as a value; null if the cell does not exist.
fn cell(field: Option<&Field>) -> Value {
    match field {
        Some(Field::Bool(value)) => (*value).into(),
        Some(Field::Float(value)) => f64::from(*value).into(),
        Some(Field::Double(value)) => (*value).into(),
        Some(Field::Str(text)) => text.as_str().into(),
        Some(Field::Bytes(bytes)) => Value::Bytes(bytes.data().to_vec()),
        Some(Field::ListInternal(list)) => Value::List(list.elements().iter().map(|it| cell(Some(it))).collect()),
        Some(Field::Group(row)) => {
            Value::Record(row.get_column_iter().map(|(name, it)| (name.clone(), cell(Some(it)))).collect())
        }
        Some(field) => integer(field).and_then(|value| i64::try_from(value).ok()).map_or(Value::Null, Value::from),
        None => Value::Null,
    }
}
