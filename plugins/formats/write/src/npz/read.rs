//! Reads NumPy archives, one per view.

use super::record::{ARCHIVE, IDS};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use syntable_formats::decode::{self, FileContent};
use syntable_formats::encode::view_name;
use syntable_formats::include;
use syntable_formats::read::{self, Faults, place_in_name};
use syntable_formats::record_arrays;
use syntable_formats::samples::{self, Contents, SampleFields, SampleReader};
use syntable_model::limits::{ARCHIVE_MEMBERS, MEMBER_BYTES};
use syntable_model::panics::guarded;
use syntable_model::prelude::*;
use syntable_model::product::{Form, linked};
use syntable_model::reader::{Format, Opened, Source};
use syntable_model::scene::{SceneId, ViewId};
use zip::ZipArchive;

syntable_model::register_format!(
    Format::new(
        "npz",
        "NumPy archives of views, as the writer `npz` has them: products under their names.",
        |root| !archives_of(root).is_empty(),
        open,
    )
    .generic()
);

/// The archives of a folder named by a view, `{scene:06}_{view:04}.npz`, with scene and view.
fn archives_of(folder: &Path) -> Vec<((u32, u32), PathBuf)> {
    let archives = read::entries(folder).into_iter().filter(|path| path.extension().is_some_and(|it| it == ARCHIVE));
    archives.filter_map(|path| Some((place_in_name(path.file_name()?.to_str()?)?, path))).collect()
}

/// The archives of the views.
struct Archives(Vec<PathBuf>);

fn open(source: &Source) -> Result<Opened> {
    let root = source.path.as_path();
    let folder = source.folder(root)?;
    let all = archives_of(root);
    if all.is_empty() {
        let help = "name the folder that has the archives, such as 000000_0000.npz";
        return Err(Error::new("it has no archives of views").in_file(root).help(help));
    }
    read::check_inside(&folder, all.iter().map(|(_, path)| path))?;
    let mut faults = Faults::default();
    let all = samples::files_of_views(all, &mut faults);
    let image = |&(scene, view): &(u32, u32)| read::image((scene, view), view_name(SceneId(scene), ViewId(view)));
    let images = all.keys().map(image).collect();
    let paths: Vec<PathBuf> = all.into_values().collect();
    // If an archive lacks an array that another archive has, the error is reported when the array is read.
    let fields = paths
        .iter()
        .filter_map(|path| NpzArchive::open(path).ok())
        .flat_map(|archive| archive.names())
        .map(|array| record_arrays::product_of(&array))
        .collect();
    let contents =
        Contents { images, fields, faults, categories: include::categories_in(&folder)?, ..Contents::default() };
    Ok(samples::open(read::name_of(root), contents, Box::new(Archives(paths))))
}

impl SampleReader for Archives {
    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<SampleFields> {
        let mut archive = NpzArchive::open(&self.0[image])?;
        let mut products: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for array in archive.names() {
            let product = record_arrays::product_of(&array);
            if wanted.contains(product.as_str()) {
                products.entry(product).or_default().insert(array);
            }
        }
        let keys = linked();
        // Records of no instances, and lists without records, have no arrays.
        let has_no_ids = archive.zip.index_for_name(&format!("{IDS}.npy")).is_some() && archive.ids()?.is_empty();
        for key in keys.iter().filter(|key| record_arrays::may_be_absent(key, has_no_ids)) {
            let name = key.to_string();
            if wanted.contains(name.as_str()) {
                products.entry(name).or_default();
            }
        }
        let mut fields = SampleFields::new();
        for (product, names) in products {
            let key = keys.iter().find(|key| key.is(&product));
            let value = match key.filter(|key| record_arrays::is_of_arrays(key)) {
                None => archive.numbers(&product)?,
                Some(key) => archive.record(&product, key, names)?,
            };
            fields.insert(product, value);
        }
        Ok(fields)
    }
}

/// Name of the library in errors.
const LIBRARY: &str = "the library that reads ZIP archives";

/// An open archive.
struct NpzArchive {
    zip: ZipArchive<BufReader<File>>,
    path: PathBuf,
}

impl NpzArchive {
    fn open(path: &Path) -> Result<Self> {
        // Only requested arrays are read.
        let file = decode::open(path)?;
        let refuse = |error| Error::new(format!("not a readable NumPy archive: {error}")).in_file(path);
        let zip = guarded(LIBRARY, path, || ZipArchive::new(BufReader::new(file)).map_err(refuse))?;
        ARCHIVE_MEMBERS.check(zip.len() as u64).map_err(|error| error.in_file(path))?;
        Ok(Self { zip, path: path.to_owned() })
    }

    /// The value of a product of numbers.
    fn numbers(&mut self, product: &str) -> Result<Value> {
        let content = self.array(product)?;
        let array = content.npy()?;
        if !samples::is_per_instance(product) {
            return Ok(Value::Tensor(array));
        }
        samples::instances(&array, &self.array(IDS)?.npy()?).map_err(|reason| content.refuse(reason))
    }

    /// The ids of the instances along the first axes.
    fn ids(&mut self) -> Result<Vec<InstanceId>> {
        let content = self.array(IDS)?;
        samples::ids_of(&content.npy()?).map_err(|reason| content.refuse(reason))
    }

    /// The value of a product of records or texts, from its arrays.
    fn record(&mut self, product: &str, key: &KeyId, names: BTreeSet<String>) -> Result<Value> {
        let ids = if matches!(key.form(), Form::PerInstance(_)) { self.ids()? } else { Vec::new() };
        let array = |name: String| Ok((name.clone(), self.array(&name)?.npy_array()?));
        let arrays = names.into_iter().map(array).collect::<Result<BTreeMap<_, _>>>()?;
        let value = record_arrays::value(product, key, &arrays, &ids);
        value.map_err(|error| error.context(format!("product `{product}`")).in_file(&self.path))
    }

    /// Names of its arrays, without the array of ids.
    fn names(&self) -> BTreeSet<String> {
        let names = self.zip.file_names().flatten();
        let names = names.filter_map(|name| name.strip_suffix(".npy").map(str::to_owned));
        names.filter(|name| name != IDS).collect()
    }

    fn array(&mut self, name: &str) -> Result<FileContent> {
        let path = self.path.join(format!("{name}.npy"));
        guarded(LIBRARY, &path.clone(), || self.unpacked(name, path))
    }

    fn unpacked(&mut self, name: &str, path: PathBuf) -> Result<FileContent> {
        let refuse = |what: String| Error::new(what).in_file(&path);
        let file = self.zip.by_name(&format!("{name}.npy"));
        let file = file.map_err(|error| refuse(format!("the archive has no such array: {error}")))?;
        let mut bytes = Vec::new();
        let size = file.size();
        MEMBER_BYTES.check(size).map_err(|error| error.in_file(&path))?;
        // An array that is larger than the archive states is damaged. The library verifies the checksum at the end of
        // the array.
        file.take(size + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| refuse(format!("the array is damaged: {error}")))?;
        Ok(FileContent::new(bytes, path.clone()))
    }
}
