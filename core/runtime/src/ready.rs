//! What can be known before a run beyond the text of a recipe: the paths of files, and what stages need from outside.
//! `check` and `run` ask here.

use crate::recipe::Recipe;
use std::collections::BTreeMap;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{SceneId, ViewId};
use syntable_model::stage::{DatasetInfo, FileOf, Writer, check_path};

/// Scenes and views whose paths are compared: none, the dataset's own; two scenes of two views.
const SAMPLES: [(Option<u32>, Option<u32>); 7] = [
    (None, None),
    (Some(0), None),
    (Some(1), None),
    (Some(0), Some(0)),
    (Some(0), Some(1)),
    (Some(1), Some(0)),
    (Some(1), Some(1)),
];

impl Recipe {
    /// Finds mistakes that would end a run: all of them are permanent. Native libraries are loaded.
    pub fn ready(&self) -> Result<()> {
        self.plan.ready()?;
        self.render.devices().map_err(|error| error.context("render").permanent())?;
        self.checked()
    }

    fn checked(&self) -> Result<()> {
        let writers: Vec<(&str, &dyn Writer)> =
            self.write.iter().map(|(id, writer)| (id.as_str(), &**writer)).collect();
        let mistakes = writers.iter().filter_map(|writer| unready(*writer));
        let mut mistakes = mistakes.chain(bad_paths(&crate::run::dataset_info(self), &writers));
        mistakes.next().map_or(Ok(()), |(_, error)| Err(error.permanent()))
    }
}

/// What a writer lacks beside its options, with its id.
pub(crate) fn unready<'w>((id, writer): (&'w str, &dyn Writer)) -> Option<(&'w str, Error)> {
    writer.ready().err().map(|error| (id, error.context(format!("write.{id}"))))
}

/// The writers of which a path is outside of the dataset, or is that of another file: at most one mistake of each.
pub(crate) fn bad_paths<'w>(dataset: &DatasetInfo, writers: &[(&'w str, &dyn Writer)]) -> Vec<(&'w str, Error)> {
    let mut seen = BTreeMap::new();
    let bad = |&(id, writer): &(&'w str, &dyn Writer)| Some((id, paths_of(dataset, id, writer, &mut seen).err()?));
    writers.iter().filter_map(bad).collect()
}

/// Adds the paths of a writer to those that were `seen`, with whose they are.
fn paths_of<'w>(
    dataset: &DatasetInfo,
    id: &'w str,
    writer: &dyn Writer,
    seen: &mut BTreeMap<String, (&'w str, String)>,
) -> Result<()> {
    for (scene, view) in SAMPLES {
        let (scene, view) = (scene.map(SceneId), view.map(ViewId));
        let of = FileOf { dataset, id, scene, view };
        let whose = match (scene, view) {
            (Some(scene), Some(view)) => format!("view {} of scene {}", view.0, scene.0),
            (Some(scene), None) => format!("scene {}", scene.0),
            _ => "the dataset".to_owned(),
        };
        for path in writer.paths(&of).map_err(|error| error.context(format!("write.{id}")))? {
            check_path("path", &path).map_err(|invalid| {
                Error::new(invalid.message)
                    .help(invalid.help.unwrap_or_default())
                    .context(format!("write.{id}, the file of {whose}"))
            })?;
            let Some((other, others)) = seen.insert(path.clone(), (id, whose.clone())) else { continue };
            return Err(if other == id {
                Error::new(format!("`write.{id}` writes {others} and {whose} to one path, `{path}`")).help(
                    "put the scene into the path, as in {{ scene.id | pad(width=6) }}, and the view if each has a file",
                )
            } else {
                Error::new(format!("`write.{other}` and `write.{id}` write to one path, `{path}`"))
                    .help("give one of them another id, folder or file name")
            });
        }
    }
    Ok(())
}
