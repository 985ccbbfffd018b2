//! Reads NumPy archives, one per view.

use std::collections::{BTreeMap, BTreeSet};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use syntable_formats::encode::view_name;
use syntable_formats::include;
use syntable_formats::known::KnownProducts;
use syntable_formats::npz_archive::{ARCHIVE, IDS, NpzArchive};
use syntable_formats::read::{self, Faults, place_in_name};
use syntable_formats::record_arrays;
use syntable_formats::samples::{self, Contents, SampleFields, SampleReader};
use syntable_model::mirror::DatasetFile;
use syntable_model::prelude::*;
use syntable_model::product::Form;
use syntable_model::reader::{Format, Opened, Source};
use syntable_model::scene::{SceneId, ViewId};

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

/// An open archive of a view.
type NpzFile = NpzArchive<BufReader<DatasetFile>>;

/// The archives of the views.
struct Archives {
    paths: Vec<PathBuf>,
    known: KnownProducts,
}

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
    let known = KnownProducts::of(&folder)?;
    // If an archive lacks an array that another archive has, the error is reported when the array is read.
    let fields = paths
        .iter()
        .filter_map(|path| NpzArchive::open(path).ok())
        .flat_map(|archive| archive.names())
        .map(|array| record_arrays::product_of(&array, &known))
        .collect();
    let (categories, archives) = (include::categories_in(&folder)?, Archives { paths, known: known.clone() });
    let contents = Contents { images, fields, known, faults, categories, ..Contents::default() };
    Ok(samples::open(read::name_of(root), contents, Box::new(archives)))
}

impl SampleReader for Archives {
    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<SampleFields> {
        let mut archive = NpzArchive::open(&self.paths[image])?;
        let mut products: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for array in archive.names() {
            let product = record_arrays::product_of(&array, &self.known);
            if wanted.contains(product.as_str()) {
                products.entry(product).or_default().insert(array);
            }
        }
        // Records of no instances, and lists without records, have no arrays.
        let has_no_ids = archive.ids()?.is_some_and(|ids| ids.is_empty());
        for key in self.known.iter().filter(|key| record_arrays::may_be_absent(key, has_no_ids)) {
            let name = key.to_string();
            if wanted.contains(name.as_str()) {
                products.entry(name).or_default();
            }
        }
        let mut fields = SampleFields::new();
        for (product, names) in products {
            let key = self.known.named(&product);
            let value = match key.filter(|key| record_arrays::is_of_arrays(key, names.contains(&product))) {
                None => numbers(&mut archive, &product, self.known.is_per_instance(&product))?,
                Some(key) => record(&mut archive, &product, key, names)?,
            };
            fields.insert(product, value);
        }
        Ok(fields)
    }
}

/// The value of a product of numbers.
fn numbers(archive: &mut NpzFile, product: &str, is_per_instance: bool) -> Result<Value> {
    let content = archive.array(product)?;
    let array = content.npy()?;
    if !is_per_instance {
        return Ok(Value::Tensor(array));
    }
    samples::instances(&array, &archive.array(IDS)?.npy()?).map_err(|reason| content.refuse(reason))
}

/// The value of a product of records or texts, from its arrays.
fn record(archive: &mut NpzFile, product: &str, key: &KeyId, names: BTreeSet<String>) -> Result<Value> {
    let ids = match key.form() {
        // Without the array of ids, the error names it.
        Form::PerInstance(_) => archive.ids()?.map_or_else(|| archive.array(IDS).map(|_| Vec::new()), Ok)?,
        _ => Vec::new(),
    };
    let array = |name: String| Ok((name.clone(), archive.array(&name)?.npy_array()?));
    let arrays = names.into_iter().map(array).collect::<Result<BTreeMap<_, _>>>()?;
    let value = record_arrays::value(product, key, &arrays, &ids);
    value.map_err(|error| error.context(format!("product `{product}`")).in_file(archive.path()))
}
