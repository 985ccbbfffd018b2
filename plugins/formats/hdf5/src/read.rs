//! Reads HDF5 files of BlenderProc's layout, from this program and from BlenderProc.

use crate::hdf5::BlenderProcDataset;
use crate::record::{BodyAttributes, EXTENSION, IDS_END};
use hdf5_pure::DType as Stored;
use hdf5_pure::{Datatype, DatatypeByteOrder, File, Layout, ReadSeekSource};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_formats::decode::{self, byte_count};
use syntable_formats::include;
use syntable_formats::known::KnownProducts;
use syntable_formats::read::{self, Faults, place_in_name};
use syntable_formats::samples::{self, Contents, SampleFields, SampleReader};
use syntable_model::limits::{IMAGE_PIXELS, MEMBER_BYTES};
use syntable_model::panics::guarded;
use syntable_model::prelude::*;
use syntable_model::product::standard::{CATEGORY_ID, INSTANCE, NORMAL, OBJECT_NAME, RGB, VISIBLE_IDS};
use syntable_model::product::{DType, Tensor};
use syntable_model::reader::{Format, Opened, Source, unnamed_category};
use syntable_model::rule;
use syntable_model::shown::shown;

syntable_model::register_format!(
    Format::new(
        "hdf5",
        "HDF5 files of views, as BlenderProc and the writer `hdf5` have them.",
        |root| !files_of(root).is_empty(),
        open,
    )
    .generic()
);

/// The files of a folder named by a view or a number, with scene and view.
fn files_of(folder: &Path) -> Vec<((u32, u32), PathBuf)> {
    let place = |path: &Path| {
        let stem = path.file_stem()?.to_str()?;
        // BlenderProc numbers the views of a scene.
        place_in_name(stem).or_else(|| Some((0, stem.parse().ok()?)))
    };
    let is_one = |path: &PathBuf| path.extension().is_some_and(|it| it == EXTENSION || it == "h5");
    read::entries(folder).into_iter().filter(is_one).filter_map(|path| Some((place(&path)?, path))).collect()
}

/// The files of the views.
struct Hdf5Views {
    paths: Vec<PathBuf>,
    known: KnownProducts,
}

fn open(source: &Source) -> Result<Opened> {
    let root = source.path.as_path();
    let all = files_of(root);
    if all.is_empty() {
        let help = "name the folder that has the files, such as 000000_0000.hdf5";
        return Err(Error::new("it has no HDF5 files of views").in_file(root).help(help));
    }
    let folder = source.folder(root)?;
    read::check_inside(&folder, all.iter().map(|(_, path)| path))?;
    let mut faults = Faults::default();
    let all = samples::files_of_views(all, &mut faults);
    let image = |(place, path): (&(u32, u32), &PathBuf)| read::image(*place, read::name_of(path));
    let images = all.iter().map(image).collect();
    let paths: Vec<PathBuf> = all.into_values().collect();
    let (mut fields, mut of_shown) = (BTreeSet::new(), BTreeSet::new());
    let (mut names, mut are_named) = (BTreeMap::new(), false);
    let known = KnownProducts::of(&folder)?;
    for path in &paths {
        let view = match Hdf5View::open(path, &known) {
            Ok(view) => view,
            // The fault is reported with the image.
            Err(_) => continue,
        };
        let attributes = view.attributes().unwrap_or_default();
        for body in attributes.iter().filter(|body| body.is_object()) {
            let (id, name) = (body.category_id, body.category_name());
            are_named |= body.category.is_some();
            let known: &String = names.entry(id).or_insert_with(|| name.clone());
            if *known != name {
                let message = format!("category {id} is `{name}`, which other files call `{known}`");
                faults.add(rule::UNIQUE_NAMES, shown(path).display().to_string(), message);
            }
        }
        // A hidden annotated object has a category as well, but no file states the name of this category.
        for id in view.categories() {
            names.entry(id).or_insert_with(|| unnamed_category(id.into()));
        }
        // If a file lacks a field that another file has, the error is reported when the field is read.
        fields.extend(view.fields());
        of_shown.extend(view.of_shown());
    }
    let named = names.into_iter().filter(|_| are_named).map(|(id, name): (u32, String)| (id.into(), name)).collect();
    let categories = include::categories_in(&folder)?;
    let views = Hdf5Views { paths, known: known.clone() };
    let contents = Contents { images, fields, known, faults, categories, named, of_shown, leaves_out_empty: false };
    Ok(samples::open(read::name_of(root), contents, Box::new(views)))
}

impl SampleReader for Hdf5Views {
    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<SampleFields> {
        let view = Hdf5View::open(&self.paths[image], &self.known)?;
        let own = view.fields().into_iter().filter(|name| wanted.contains(name.as_str()));
        own.map(|name| Ok((name.clone(), view.field(&name)?))).collect()
    }
}

/// Whether elements are little-endian floats of 16 bits.
fn is_half(of: &Datatype) -> bool {
    matches!(of, Datatype::FloatingPoint { size: 2, byte_order: DatatypeByteOrder::LittleEndian, .. })
}

/// Maximum number of bytes into which deflate expands one byte.
const UNFOLDS: u64 = 1032;

/// Name of the library in errors.
const LIBRARY: &str = "the library that reads HDF5";

/// An open file.
struct Hdf5View {
    file: File,
    path: PathBuf,
    /// Names of the datasets in the file.
    names: BTreeSet<String>,
    known: KnownProducts,
}

impl Hdf5View {
    fn open(path: &Path, known: &KnownProducts) -> Result<Self> {
        decode::open(path)?;
        guarded(LIBRARY, path, || Self::opened(path, known.clone()))
    }

    fn opened(path: &Path, known: KnownProducts) -> Result<Self> {
        let fail = |error: hdf5_pure::Error| Error::new(format!("not a readable HDF5 file: {error}")).in_file(path);
        // Only requested datasets are read.
        let content = ReadSeekSource::new(decode::open(path)?).map_err(|error| fail(error.into()))?;
        let file = File::from_source(content).map_err(fail)?;
        let names = file.root().datasets().map_err(fail)?.into_iter().collect();
        Ok(Self { file, path: path.to_owned(), names, known })
    }

    /// Names of the products in the attributes of bodies, which only visible objects have.
    fn of_shown(&self) -> impl Iterator<Item = String> {
        let names = [CATEGORY_ID.name(), OBJECT_NAME.name()];
        names.into_iter().filter(|name| !self.names.contains(*name)).map(str::to_owned)
    }

    /// The category ids in the dataset named after the product.
    fn categories(&self) -> BTreeSet<u32> {
        let own = self.names.contains(CATEGORY_ID.name()).then(|| self.included(CATEGORY_ID.name()).ok()).flatten();
        let Some(Value::PerInstance(own)) = own else { return BTreeSet::new() };
        let id = |value: &Value| if let Value::Int(id) = value { u32::try_from(*id).ok() } else { None };
        own.values().filter_map(id).collect()
    }

    fn has(&self, dataset: BlenderProcDataset) -> bool {
        self.names.contains(dataset.name())
    }

    /// Names of the products that the file stores or that follow from its BlenderProc datasets.
    fn fields(&self) -> BTreeSet<String> {
        let of_blenderproc = BlenderProcDataset::ALL.map(BlenderProcDataset::name);
        let is_ids = |name: &&String| name.strip_suffix(IDS_END).is_some_and(|of| self.names.contains(of));
        let own = self.names.iter().filter(|name| !of_blenderproc.contains(&name.as_str()) && !is_ids(name));
        let mut fields: BTreeSet<String> = own.cloned().collect();
        let has_bodies =
            self.has(BlenderProcDataset::InstanceSegmaps) && self.has(BlenderProcDataset::InstanceAttributeMaps);
        for (key, has) in [
            (RGB.id(), self.has(BlenderProcDataset::Colors)),
            (NORMAL.id(), self.has(BlenderProcDataset::Normals)),
            (INSTANCE.id(), self.has(BlenderProcDataset::InstanceSegmaps)),
            (VISIBLE_IDS.id(), has_bodies),
            (CATEGORY_ID.id(), has_bodies),
            (OBJECT_NAME.id(), has_bodies),
        ] {
            fields.extend(has.then(|| key.to_string()));
        }
        // BlenderProc datasets with the same name as a product.
        let same =
            [BlenderProcDataset::Depth, BlenderProcDataset::Distance].into_iter().filter(|dataset| self.has(*dataset));
        fields.extend(same.map(|dataset| dataset.name().to_owned()));
        fields
    }

    /// A product.
    fn field(&self, name: &str) -> Result<Value> {
        guarded(LIBRARY, &self.path, || self.decoded(name))
    }

    fn decoded(&self, name: &str) -> Result<Value> {
        // A dataset named after the product takes precedence.
        if self.names.contains(name) {
            return self.included(name);
        }
        let of_objects = |value: &dyn Fn(&BodyAttributes) -> Value| -> Result<Value> {
            let attributes = self.attributes()?;
            let objects = attributes.iter().filter(|body| body.is_object());
            Ok(Value::PerInstance(objects.map(|body| (body.id(), value(body))).collect()))
        };
        let is = |key: KeyId| key.is(name);
        if is(RGB.id()) {
            self.array(BlenderProcDataset::Colors.name()).map(Value::Tensor)
        } else if is(NORMAL.id()) {
            self.normals()
        } else if is(INSTANCE.id()) {
            self.array(BlenderProcDataset::InstanceSegmaps.name()).map(Value::Tensor)
        } else if is(VISIBLE_IDS.id()) {
            self.visible_ids()
        } else if is(CATEGORY_ID.id()) {
            of_objects(&|body| body.category_id.into())
        } else {
            // In our files, the pool precedes the asset's name.
            let of_asset = |body: &BodyAttributes| match body.name.split_once('/') {
                Some((_, name)) if body.role.is_some() => name.to_owned(),
                _ => body.name.clone(),
            };
            of_objects(&|body| of_asset(body).into())
        }
    }

    fn refuse(&self, name: &str, what: &str) -> Error {
        Error::new(format!("dataset `{name}`: {what}")).in_file(&self.path)
    }

    /// A product stored under its own name: an array, or JSON text.
    fn included(&self, name: &str) -> Result<Value> {
        if let Some(text) = self.text(name)? {
            let json: serde_json::Value =
                serde_json::from_str(&text).map_err(|error| self.refuse(name, &format!("not JSON: {error}")))?;
            return Value::of(&json);
        }
        let array = self.array(name)?;
        let ids = format!("{name}{IDS_END}");
        if !self.known.is_per_instance(name) || !self.names.contains(&ids) {
            return Ok(Value::Tensor(array));
        }
        let values = samples::instances(&array, &self.array(&ids)?);
        values.map_err(|reason| self.refuse(name, &reason))
    }

    /// Opens a dataset that is small enough to be read as a whole.
    fn dataset(&self, name: &str) -> Result<hdf5_pure::Dataset> {
        let fail = |error: hdf5_pure::Error| self.refuse(name, &error.to_string());
        let dataset = self.file.dataset(name).map_err(fail)?;
        let lengths = dataset.shape().map_err(fail)?;
        let size = dataset.element_size().map_err(fail)?;
        let factors: Vec<u64> = lengths.iter().copied().chain([size]).collect();
        MEMBER_BYTES
            .check_product(&factors)
            .and_then(|()| match lengths[..] {
                [height, width, ..] if !self.known.is_per_instance(name) => {
                    IMAGE_PIXELS.check_product(&[height, width])
                }
                _ => Ok(()),
            })
            .map_err(|error| error.context(format!("dataset `{name}` of shape {lengths:?}")).in_file(&self.path))?;
        let (stated, stored) = (lengths.iter().product::<u64>() * size, self.stored(&dataset, size).map_err(fail)?);
        if stored.is_some_and(|stored| stored < stated) {
            let what = format!("its shape {lengths:?} takes {stated} bytes, and less is stored");
            return Err(self.refuse(name, &what));
        }
        Ok(dataset)
    }

    /// Upper bound of the decompressed size of a dataset's stored parts, whose elements have `size` bytes; none if the
    /// size is unknown. The library fills regions that no chunk stores, so a small file could otherwise request a huge
    /// array.
    fn stored(&self, dataset: &hdf5_pure::Dataset, size: u64) -> Result<Option<u64>, hdf5_pure::Error> {
        Ok(match dataset.layout()? {
            Layout::Contiguous { size, .. } | Layout::Compact { size } => Some(size.min(self.file.file_size())),
            Layout::Chunked { chunk_shape, .. } => dataset.chunks().ok().map(|chunks| {
                let of_chunk = chunk_shape.iter().fold(size, |bytes, length| bytes.saturating_mul(*length));
                let unfolded = chunks.iter().map(|chunk| chunk.storage_size.saturating_mul(UNFOLDS).min(of_chunk));
                unfolded.fold(0, u64::saturating_add)
            }),
            _ => None,
        })
    }

    /// The text of a dataset; none if the dataset is not text.
    fn text(&self, name: &str) -> Result<Option<String>> {
        let fail = |error: hdf5_pure::Error| self.refuse(name, &error.to_string());
        let dataset = self.dataset(name)?;
        match dataset.dtype().map_err(fail)? {
            Stored::String | Stored::VariableLengthString => {
                Ok(dataset.read_string().map_err(fail)?.into_iter().next())
            }
            _ => Ok(None),
        }
    }

    fn array(&self, name: &str) -> Result<Tensor> {
        fn bytes<T, const N: usize>(numbers: Vec<T>, to: fn(T) -> [u8; N]) -> Vec<u8> {
            numbers.into_iter().flat_map(to).collect()
        }
        let fail = |error: hdf5_pure::Error| self.refuse(name, &error.to_string());
        let dataset = self.dataset(name)?;
        let shape = dataset.shape().map_err(fail)?.into_iter().map(|length| length as usize).collect::<Vec<_>>();
        let (dtype, bytes) = match dataset.dtype().map_err(fail)? {
            Stored::U8 => (DType::U8, dataset.read_u8().map_err(fail)?),
            Stored::U16 => (DType::U16, bytes(dataset.read_u16().map_err(fail)?, u16::to_le_bytes)),
            Stored::U32 => (DType::U32, bytes(dataset.read_u32().map_err(fail)?, u32::to_le_bytes)),
            Stored::U64 => (DType::U64, bytes(dataset.read_u64().map_err(fail)?, u64::to_le_bytes)),
            Stored::I8 => (DType::I8, bytes(dataset.read_i8().map_err(fail)?, i8::to_le_bytes)),
            Stored::I16 => (DType::I16, bytes(dataset.read_i16().map_err(fail)?, i16::to_le_bytes)),
            Stored::I32 => (DType::I32, bytes(dataset.read_i32().map_err(fail)?, i32::to_le_bytes)),
            Stored::I64 => (DType::I64, bytes(dataset.read_i64().map_err(fail)?, i64::to_le_bytes)),
            Stored::F32 => (DType::F32, bytes(dataset.read_f32().map_err(fail)?, f32::to_le_bytes)),
            Stored::F64 => (DType::F64, bytes(dataset.read_f64().map_err(fail)?, f64::to_le_bytes)),
            // h5py's boolean.
            Stored::Enum(names) if names == ["FALSE", "TRUE"] => (DType::Bool, dataset.read_raw().map_err(fail)?),
            Stored::Other(other) if is_half(&other) => (DType::F16, dataset.read_raw().map_err(fail)?),
            other => return Err(self.refuse(name, &format!("elements of type {other} are not read"))),
        };
        if byte_count(&shape, dtype.size()) != Some(bytes.len()) {
            return Err(self.refuse(name, &format!("of shape {shape:?} it has {} bytes", bytes.len())));
        }
        let axes = match shape.len() {
            2 => vec!["y".into(), "x".into()],
            3 => vec!["y".into(), "x".into(), "channel".into()],
            axes => vec!["axis".into(); axes],
        };
        Ok(Tensor { dtype, axes, shape, bytes })
    }

    /// The bodies by id.
    fn attributes(&self) -> Result<Vec<BodyAttributes>> {
        let name = BlenderProcDataset::InstanceAttributeMaps.name();
        if !self.names.contains(name) {
            return Ok(Vec::new());
        }
        let text = self.text(name)?.ok_or_else(|| self.refuse(name, "it is no text"))?;
        serde_json::from_str(&text)
            .map_err(|error| self.refuse(name, &format!("not a list of instances with `idx`: {error}")))
    }

    /// The image of ids, with objects only.
    fn visible_ids(&self) -> Result<Value> {
        let objects: BTreeSet<u64> =
            self.attributes()?.iter().filter(|body| body.is_object()).map(|body| body.idx.into()).collect();
        let name = BlenderProcDataset::InstanceSegmaps.name();
        let array = self.array(name)?;
        let id = |at: usize| match array.element(at) {
            Value::Int(id) => u64::try_from(id).ok(),
            Value::Uint(id) => Some(id),
            _ => None,
        };
        let count = array.shape.iter().product::<usize>();
        let mut bytes = Vec::with_capacity(2 * count);
        for at in 0..count {
            let id = id(at).ok_or_else(|| self.refuse(name, "it has values that are no ids"))?;
            let shown = Some(id).filter(|id| objects.contains(id)).unwrap_or_default();
            // Ids of objects have 16 bits.
            bytes.extend((shown as u16).to_le_bytes());
        }
        Ok(Value::Tensor(Tensor { dtype: DType::U16, bytes, ..array }))
    }

    /// Normals of the camera frame, with y down and z forward.
    fn normals(&self) -> Result<Value> {
        let array = self.array(BlenderProcDataset::Normals.name())?;
        let [height, width, 3] = array.shape[..] else {
            return Err(self.refuse(BlenderProcDataset::Normals.name(), "it is no image of 3 channels"));
        };
        let number = |at: usize| match array.element(at) {
            Value::Float(value) => value as f32,
            Value::Int(value) => value as f32,
            _ => 0.0,
        };
        let normal = |x: u32, y: u32| {
            let at = 3 * (y as usize * width + x as usize);
            let [x, y, z] = [0, 1, 2].map(|axis| 2.0 * number(at + axis) - 1.0);
            [x, -y, -z]
        };
        Ok(Plane::from_fn(width as u32, height as u32, normal).into())
    }
}
