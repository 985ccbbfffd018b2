//! Reads tar files of samples.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_formats::decode::Content;
use syntable_formats::encode::kind::Kind;
use syntable_formats::encode::{exr, view_name};
use syntable_formats::include;
use syntable_formats::members::{Member, members};
use syntable_formats::read::{self, Faults, place_in_name};
use syntable_formats::samples::{self, Contents, Fields, Samples};
use syntable_model::prelude::*;
use syntable_model::product::linked;
use syntable_model::reader::{DatasetReader, Format};
use syntable_model::scene::{SceneId, ViewId};

syntable_model::register_format!(Format {
    name: "webdataset",
    doc: "Tar files of samples, as the writer `webdataset` has them: products under their names.",
    detect: |root| !shards_of(root).is_empty(),
    open,
    is_of_products: true,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// What BOP's own tar files are called.
const OF_BOP: &str = "shard";
/// The ids of the instances of an array.
const IDS: &str = "ids.npy";

/// The tar files of a folder that are called after a scene, `{name}-{scene:06}.tar`, sorted.
fn shards_of(folder: &Path) -> Vec<PathBuf> {
    let is_one = |path: &Path| {
        let stem = path.file_name()?.to_str()?.strip_suffix(".tar")?;
        let (name, number) = stem.rsplit_once('-')?;
        (name != OF_BOP && number.len() >= 6 && number.bytes().all(|digit| digit.is_ascii_digit())).then_some(())
    };
    read::entries(folder).into_iter().filter(|path| is_one(path).is_some() && path.is_file()).collect()
}

/// The members of a field, by what follows its name.
type Parts = BTreeMap<String, Member>;

/// The fields of each sample.
struct Shards(Vec<BTreeMap<String, Parts>>);

fn open(root: &Path) -> Result<Box<dyn DatasetReader>> {
    let shards = shards_of(root);
    if shards.is_empty() {
        let help = "name the folder that has the tar files, such as webdataset-000000.tar";
        return Err(Error::new("it has no tar files of samples").in_file(root).help(help).of_request());
    }
    let (mut all, mut faults) = (BTreeMap::<(u32, u32), BTreeMap<String, Parts>>::new(), Faults::default());
    for shard in &shards {
        let (found, damage) = members(shard);
        if let Some(error) = damage {
            let message = format!("{error}: nothing that follows in it is read");
            faults.add("readable", shard.display().to_string(), &message);
        }
        for member in found {
            let Some((key, field)) = member.name.split_once('.') else { continue };
            let Some(place) = place_in_name(key) else {
                let message = "its name does not begin with the numbers of a scene and a view, such as 000003_0001";
                faults.add("known_images", member.path().display().to_string(), message);
                continue;
            };
            let (product, end) = field.split_once('.').unwrap_or((field, ""));
            let parts = all.entry(place).or_default().entry(product.to_owned()).or_default();
            if parts.contains_key(end) {
                let message = "the sample has this member twice; the first one counts";
                faults.add("unique_views", member.path().display().to_string(), message);
                continue;
            }
            parts.insert(end.to_owned(), member);
        }
    }
    let image = |&(scene, view): &(u32, u32)| read::image((scene, view), view_name(SceneId(scene), ViewId(view)));
    let images = all.keys().map(image).collect();
    let samples: Vec<BTreeMap<String, Parts>> = all.into_values().collect();
    let fields = samples.iter().flat_map(BTreeMap::keys).cloned().collect();
    let contents = Contents { images, fields, faults, categories: include::categories_in(root)? };
    Ok(samples::open(read::name_of(root), contents, Box::new(Shards(samples))))
}

impl Samples for Shards {
    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<Fields> {
        let own = self.0[image].iter().filter(|(product, _)| wanted.contains(product.as_str()));
        own.map(|(product, parts)| Ok((product.clone(), value_of(product, parts)?))).collect()
    }
}

/// The value of a field.
fn value_of(product: &str, parts: &Parts) -> Result<Value> {
    let Some((end, member)) = parts.iter().find(|(end, _)| *end != IDS) else {
        return Err(Error::new(format!("its field `{product}` has ids alone")).permanent());
    };
    let content = member.content()?;
    match end.as_str() {
        "png" => Ok(Value::Tensor(content.image()?)),
        "npy" => match parts.get(IDS) {
            None => Ok(Value::Tensor(content.npy()?)),
            Some(ids) => {
                let values = samples::instances(&content.npy()?, &ids.content()?.npy()?);
                values.ok_or_else(|| content.refuse(format!("{} has not as many ids as it has values", ids.name)))
            }
        },
        "json" => content.json(),
        "exr" => exr_of(product, &content),
        _ => Err(content
            .refuse(format!("fields do not end with `.{end}`"))
            .help("write .png, .npy, .exr or .json after the name of the product")),
    }
}

/// A float image, whose channels are named after what it is.
fn exr_of(product: &str, content: &Content) -> Result<Value> {
    let key = linked().into_iter().find(|key| key.name == *product);
    let coding = key.and_then(|key| exr::Coding::of(&Kind::of_key(&key)).ok());
    let coding = coding.ok_or_else(|| content.refuse(format!("`{product}` is no product of a float image")))?;
    coding.decode(content.bytes()).map(Value::Tensor).map_err(|error| content.refuse(error.to_string()))
}
