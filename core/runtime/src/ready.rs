//! What can be known before a run beyond the text of a recipe: the paths of files, and what stages need from outside.
//! `check` and `run` ask here.

use crate::recipe::Recipe;
use std::collections::BTreeMap;
use syntable_model::error::{Error, Result};
use syntable_model::scene::{SceneId, ViewId};
use syntable_model::stage::{FileOf, check_path};

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

    /// The same without loading any library that the recipe names.
    pub fn found(&self) -> Result<()> {
        self.plan.found()?;
        self.checked()
    }

    fn checked(&self) -> Result<()> {
        for (id, writer) in &self.write {
            writer.ready().map_err(|error| error.context(format!("write.{id}")).permanent())?;
        }
        self.paths().map_err(Error::permanent)
    }

    /// Every path is inside the dataset, and has one scene and one writer.
    fn paths(&self) -> Result<()> {
        let dataset = crate::run::dataset_info(self);
        let mut seen: BTreeMap<String, (&str, String)> = BTreeMap::new();
        for (id, writer) in &self.write {
            for (scene, view) in SAMPLES {
                let (scene, view) = (scene.map(SceneId), view.map(ViewId));
                let of = FileOf { dataset: &dataset, id, scene, view };
                let whose = match (scene, view) {
                    (Some(scene), Some(view)) => format!("view {} of scene {}", view.0, scene.0),
                    (Some(scene), None) => format!("scene {}", scene.0),
                    _ => "the dataset".to_owned(),
                };
                let paths = writer.paths(&of).map_err(|error| error.context(format!("write.{id}")))?;
                for path in paths {
                    check_path("path", &path).map_err(|invalid| {
                        Error::new(invalid.message)
                            .help(invalid.help.unwrap_or_default())
                            .context(format!("write.{id}, the file of {whose}"))
                    })?;
                    if let Some((other, others)) = seen.insert(path.clone(), (id, whose.clone())) {
                        let message = if other == id {
                            format!("`write.{id}` writes {others} and {whose} to one path, `{path}`")
                        } else {
                            format!("`write.{other}` and `write.{id}` write to one path, `{path}`")
                        };
                        let help = if other == id {
                            "put the scene into the path, as in {{ scene.id | pad(width=6) }}, and the view if each has a file"
                        } else {
                            "give one of them another id, folder or file name"
                        };
                        return Err(Error::new(message).help(help));
                    }
                }
            }
        }
        Ok(())
    }
}
