//! Reads tar files of samples.

use super::record::{EXR, IDS, JSON, NPY, PNG, is_shard};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_formats::decode::FileContent;
use syntable_formats::encode::kind::ValueKind;
use syntable_formats::encode::{exr, view_name};
use syntable_formats::include;
use syntable_formats::known::KnownProducts;
use syntable_formats::members::{self, TarMember};
use syntable_formats::read::{self, Faults};
use syntable_formats::samples::{self, Contents, SampleFields, SampleReader};
use syntable_model::prelude::*;
use syntable_model::product::standard::RGB;
use syntable_model::reader::{Format, Opened, Source};
use syntable_model::scene::{SceneId, ViewId};

syntable_model::register_format!(
    Format::new(
        "webdataset",
        "Tar files of samples, as the writer `webdataset` has them: products under their names.",
        |root| !shards_of(root).is_empty(),
        open,
    )
    .generic()
);

/// Prefix of the names of BOP's tar files.
const OF_BOP: &str = "shard-";

/// The tar files of a folder that have the names of shards, sorted.
fn tar_files(folder: &Path) -> Vec<PathBuf> {
    read::entries(folder).into_iter().filter(|path| is_shard(&read::file_name(path))).collect()
}

/// The shards, without files named like BOP's.
fn shards_of(folder: &Path) -> Vec<PathBuf> {
    let is_bops = |path: &PathBuf| read::file_name(path).starts_with(OF_BOP);
    tar_files(folder).into_iter().filter(|path| !is_bops(path)).collect()
}

/// The fields of each sample.
struct Shards {
    samples: Vec<BTreeMap<String, TarMember>>,
    known: KnownProducts,
}

fn open(source: &Source) -> Result<Opened> {
    let root = source.path.as_path();
    let folder = source.folder(root)?;
    let shards = tar_files(root);
    if shards.is_empty() {
        let help = "name the folder that has the tar files, such as webdataset-000000.tar";
        return Err(Error::new("it has no tar files of samples").in_file(root).help(help));
    }
    read::check_inside(&folder, &shards)?;
    let mut faults = Faults::default();
    let all = members::samples(&shards, &mut faults);
    let image = |&(scene, view): &(u32, u32)| read::image((scene, view), view_name(SceneId(scene), ViewId(view)));
    let images = all.keys().map(image).collect();
    let product_of = |field: &String| field.split('.').next().unwrap_or_default().to_owned();
    let fields = all.values().flat_map(|sample| sample.fields.keys().map(product_of)).collect();
    let (categories, known) = (include::categories_in(&folder)?, KnownProducts::of(&folder)?);
    let shards = Shards { samples: all.into_values().map(|sample| sample.fields).collect(), known: known.clone() };
    let contents = Contents { images, fields, known, faults, categories, ..Contents::default() };
    Ok(samples::open(read::name_of(root), contents, Box::new(shards)))
}

impl SampleReader for Shards {
    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<SampleFields> {
        // The members of each product, by the suffix after the product's name.
        let mut products: BTreeMap<&str, BTreeMap<&str, &TarMember>> = BTreeMap::new();
        for (field, member) in &self.samples[image] {
            let (product, end) = field.split_once('.').unwrap_or((field, ""));
            if wanted.contains(product) {
                products.entry(product).or_default().insert(end, member);
            }
        }
        let value = |(product, parts): (&str, BTreeMap<_, _>)| {
            Ok((product.to_owned(), value_of(product, &parts, &self.known)?))
        };
        products.into_iter().map(value).collect()
    }
}

/// The value of a field.
fn value_of(product: &str, parts: &BTreeMap<&str, &TarMember>, known: &KnownProducts) -> Result<Value> {
    let Some((end, member)) = parts.iter().find(|(end, _)| **end != IDS) else {
        return Err(Error::new(format!("its field `{product}` has ids alone")));
    };
    let content = member.content()?;
    match *end {
        PNG => Ok(Value::Tensor(content.image()?)),
        "jpg" | "jpeg" if product == RGB.name() => Ok(content.rgb()?.into()),
        NPY => match parts.get(IDS) {
            None => Ok(Value::Tensor(content.npy()?)),
            Some(ids) => {
                let values = samples::instances(&content.npy()?, &ids.content()?.npy()?);
                values.map_err(|reason| content.refuse(reason))
            }
        },
        JSON => content.json(),
        EXR => exr_of(product, &content, known),
        _ => Err(content
            .refuse(format!("fields do not end with `.{end}`"))
            .help("write .png, .npy, .exr or .json after the name of the product")),
    }
}

/// A float image whose channel names depend on its kind.
fn exr_of(product: &str, content: &FileContent, known: &KnownProducts) -> Result<Value> {
    let coding = known.named(product).and_then(|key| exr::ExrCoding::of(&ValueKind::of_key(key)).ok());
    let coding = coding.ok_or_else(|| content.refuse(format!("`{product}` is no product of a float image")))?;
    let decoded = content.guarded("the library that decodes EXR", || coding.decode(content.bytes()));
    decoded.map(Value::Tensor).map_err(|error| content.located(error))
}
