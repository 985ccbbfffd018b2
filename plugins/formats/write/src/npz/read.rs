//! Reads NumPy archives, one per view.

use super::IDS;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use syntable_formats::decode::{self, Content};
use syntable_formats::encode::view_name;
use syntable_formats::include;
use syntable_formats::read::{self, Faults, place_in_name};
use syntable_formats::samples::{self, Contents, Fields, Samples};
use syntable_model::limits::{ARCHIVE_MEMBERS, MEMBER_BYTES};
use syntable_model::panics::guarded;
use syntable_model::prelude::*;
use syntable_model::reader::{Format, Opened, Source};
use syntable_model::scene::{SceneId, ViewId};
use zip::ZipArchive;

syntable_model::register_format!(Format {
    name: "npz",
    doc: "NumPy archives of views, as the writer `npz` has them: products under their names.",
    detect: |root| !archives_of(root).is_empty(),
    open,
    is_generic: true,
    crate_name: env!("CARGO_PKG_NAME"),
});

/// The archives of a folder that are called after a view, `{scene:06}_{view:04}.npz`, with scene and view.
fn archives_of(folder: &Path) -> Vec<((u32, u32), PathBuf)> {
    let archives = read::entries(folder).into_iter().filter(|path| path.extension().is_some_and(|it| it == "npz"));
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
    // An archive that lacks what another one has is at fault with it.
    let fields = paths.iter().filter_map(|path| Archive::open(path).ok()).flat_map(|archive| archive.names()).collect();
    let contents =
        Contents { images, fields, faults, categories: include::categories_in(&folder)?, ..Contents::default() };
    Ok(samples::open(read::name_of(root), contents, Box::new(Archives(paths))))
}

impl Samples for Archives {
    fn read(&self, image: usize, wanted: &BTreeSet<&str>) -> Result<Fields> {
        let mut archive = Archive::open(&self.0[image])?;
        let own: Vec<String> = archive.names().into_iter().filter(|name| wanted.contains(name.as_str())).collect();
        let mut fields = Fields::new();
        for name in own {
            let content = archive.array(&name)?;
            let array = content.npy()?;
            let value = match samples::is_per_instance(&name) {
                false => Value::Tensor(array),
                true => {
                    let values = samples::instances(&array, &archive.array(IDS)?.npy()?);
                    values.map_err(|reason| content.refuse(reason))?
                }
            };
            fields.insert(name, value);
        }
        Ok(fields)
    }
}

/// What the library is called when it fails.
const LIBRARY: &str = "the library that reads ZIP archives";

/// An archive that is open.
struct Archive {
    zip: ZipArchive<BufReader<File>>,
    path: PathBuf,
}

impl Archive {
    fn open(path: &Path) -> Result<Self> {
        // Of an archive, what is not asked for is not read.
        let file = decode::open(path)?;
        let refuse = |error| Error::new(format!("not a readable NumPy archive: {error}")).in_file(path);
        let zip = guarded(LIBRARY, path, || ZipArchive::new(BufReader::new(file)).map_err(refuse))?;
        ARCHIVE_MEMBERS.check(zip.len() as u64).map_err(|error| error.in_file(path))?;
        Ok(Self { zip, path: path.to_owned() })
    }

    /// Names of its arrays but for the ids.
    fn names(&self) -> BTreeSet<String> {
        let names = self.zip.file_names().flatten();
        let names = names.filter_map(|name| name.strip_suffix(".npy").map(str::to_owned));
        names.filter(|name| name != IDS).collect()
    }

    fn array(&mut self, name: &str) -> Result<Content> {
        let path = self.path.join(format!("{name}.npy"));
        guarded(LIBRARY, &path.clone(), || self.unpacked(name, path))
    }

    fn unpacked(&mut self, name: &str, path: PathBuf) -> Result<Content> {
        let refuse = |what: String| Error::new(what).in_file(&path);
        let file = self.zip.by_name(&format!("{name}.npy"));
        let file = file.map_err(|error| refuse(format!("the archive has no such array: {error}")))?;
        let mut bytes = Vec::new();
        let size = file.size();
        MEMBER_BYTES.check(size).map_err(|error| error.in_file(&path))?;
        // What is larger than the archive says is damaged. At its end, the sum of the array is compared.
        file.take(size + 1)
            .read_to_end(&mut bytes)
            .map_err(|error| refuse(format!("the array is damaged: {error}")))?;
        Ok(Content::new(bytes, path.clone()))
    }
}
