//! Checks the paths of writers before a run, where the paths are known.

use crate::plan::Plan;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::product::KeyId;
use syntable_model::scene::{SceneId, ViewId};
use syntable_model::stage::{DatasetInfo, FileOf, Scenes, Writer, check_path};

/// Scenes whose paths are compared, and views of each.
const SAMPLES: [u32; 2] = [0, 1];

/// Maximum number of further scenes and views whose paths are compared, because paths of the dataset have their numbers.
const MOST_NUMBERS: usize = 16;

/// The error of a writer that lacks something besides its options, with the writer's id.
pub(crate) fn unready<'w>((id, writer): (&'w str, &dyn Writer<Scenes>)) -> Option<(&'w str, Error)> {
    writer.ready().err().map(|error| (id, error.context(format!("write.{id}"))))
}

/// The writers with a path outside of the dataset, with the path of another file, or with a path that is a folder of
/// another file: at most one mistake for each writer.
pub(crate) fn bad_paths<'w>(
    dataset: &DatasetInfo,
    writers: &[(&'w str, &dyn Writer<Scenes>)],
    plan: Option<&Plan>,
) -> Vec<(&'w str, Error)> {
    let products = |writer: &dyn Writer<Scenes>| plan.map_or_else(Vec::new, |plan| plan.read_by(&writer.reads()));
    let writers: Vec<AskedWriter> =
        writers.iter().map(|&(id, writer)| AskedWriter { dataset, id, writer, products: products(writer) }).collect();
    let samples = samples(dataset, &writers);
    let mut seen = BTreeMap::new();
    let bad = |writer: &AskedWriter<'w, '_>| Some((writer.id, writer.add_paths(&samples, &mut seen).err()?));
    writers.iter().filter_map(bad).collect()
}

/// The dataset, scenes and views whose paths are compared. A file of the dataset may have the same name as a file of
/// any scene or view, so scenes and views with the numbers in such names are included.
fn samples(dataset: &DatasetInfo, writers: &[AskedWriter]) -> Vec<(Option<u32>, Option<u32>)> {
    let of_dataset = writers.iter().filter_map(|writer| writer.paths(None, None).ok()).flatten();
    let numbers: BTreeSet<u32> = of_dataset.flat_map(|path| numbers(&path)).take(MOST_NUMBERS).collect();
    let with_samples = |below: u32| -> BTreeSet<u32> {
        SAMPLES.into_iter().chain(numbers.iter().copied()).filter(|number| *number < below).collect()
    };
    let views = with_samples(dataset.views_per_scene);
    let of_scene =
        |scene: u32| std::iter::once(None).chain(views.iter().copied().map(Some)).map(move |view| (Some(scene), view));
    std::iter::once((None, None)).chain(with_samples(dataset.scenes).into_iter().flat_map(of_scene)).collect()
}

/// The numbers in a path.
fn numbers(path: &str) -> Vec<u32> {
    path.split(|letter: char| !letter.is_ascii_digit()).filter_map(|digits| digits.parse().ok()).collect()
}

/// The owner of a file: the id of its writer, and the scene, view or dataset of the file.
type Owner<'w> = (&'w str, String);

/// A writer that is asked for its paths.
struct AskedWriter<'w, 'a> {
    dataset: &'a DatasetInfo,
    id: &'w str,
    writer: &'a dyn Writer<Scenes>,
    products: Vec<KeyId>,
}

impl<'w> AskedWriter<'w, '_> {
    fn paths(&self, scene: Option<u32>, view: Option<u32>) -> Result<Vec<String>> {
        let (scene, view) = (scene.map(SceneId), view.map(ViewId));
        self.writer.paths(&FileOf { dataset: self.dataset, id: self.id, scene, view, products: &self.products })
    }

    /// Adds its paths to the paths that were `seen`, with their owners.
    fn add_paths(&self, samples: &[(Option<u32>, Option<u32>)], seen: &mut BTreeMap<String, Owner<'w>>) -> Result<()> {
        let id = self.id;
        for &(scene, view) in samples {
            let whose = match (scene, view) {
                (Some(scene), Some(view)) => format!("view {view} of scene {scene}"),
                (Some(scene), None) => format!("scene {scene}"),
                _ => "the dataset".to_owned(),
            };
            for path in self.paths(scene, view).map_err(|error| error.context(format!("write.{id}")))? {
                check_path("path", &path).map_err(|invalid| {
                    Error::new(invalid.message)
                        .help(invalid.help.unwrap_or_default())
                        .context(format!("write.{id}, the file of {whose}"))
                })?;
                // `a//b` is `a/b`.
                let parts = Path::new(&path).components().map(|part| part.as_os_str().to_string_lossy());
                let path = parts.collect::<Vec<_>>().join("/");
                if let Some(conflict) = folder_conflict(&path, id, seen) {
                    return Err(conflict);
                }
                if let Some(other) = seen.insert(path.clone(), (id, whose.clone())) {
                    return Err(shared_path(&path, &other, &(id, whose)));
                }
            }
        }
        Ok(())
    }
}

/// The error for two files with the same path.
fn shared_path(path: &str, (other, others): &Owner, (id, whose): &Owner) -> Error {
    if other == id {
        Error::new(format!("`write.{id}` writes {others} and {whose} to one path, `{path}`"))
            .help("put the scene into the path, as in {{ scene.id | pad(width=6) }}, and the view if each has a file")
    } else {
        Error::new(format!("`write.{other}` and `write.{id}` write to one path, `{path}`"))
            .help("give one of them another id, folder or file name")
    }
}

/// The error for a file that is also the folder of another file.
fn folder_conflict(path: &str, id: &str, seen: &BTreeMap<String, Owner>) -> Option<Error> {
    let above = path.match_indices('/').map(|(end, _)| &path[..end]);
    let file_above = above.filter_map(|folder| Some((folder, seen.get(folder)?.0, path, id))).next();
    let below = format!("{path}/");
    let file_below = seen.range(below.clone()..).next().filter(|(inside, _)| inside.starts_with(&below));
    let file_below = file_below.map(|(inside, (other, _))| (path, id, inside.as_str(), *other));
    let (file, of_file, inside, of_inside) = file_above.or(file_below)?;
    let message =
        format!("`{file}` is a file of `write.{of_file}`, and a folder of `write.{of_inside}` for `{inside}`");
    Some(Error::new(message).help("give one of them another id, folder or file name"))
}
