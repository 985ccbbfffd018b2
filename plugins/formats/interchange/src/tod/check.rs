//! Faults of TOD's labels.

use super::record::{DESCRIPTION, LAST_OF_TABLETOP, SceneDescription, TABLE, WITH_TABLETOP};
use crate::label_images::{LabelImage, LabelRules};
use serde::de::IgnoredAny;
use std::path::Path;
use syntable_formats::decode;
use syntable_formats::json;
use syntable_model::files::DatasetFolder;
use syntable_model::prelude::*;
use syntable_model::reader::DatasetFault;
use syntable_model::rule;

/// The numbers of objects and the keys of views.
pub type SceneOutline = SceneDescription<IgnoredAny, IgnoredAny>;

impl SceneOutline {
    /// Reads the description in the folder of a scene.
    pub fn read(root: &DatasetFolder, scene: &Path) -> Result<Self> {
        let path = root.file(scene.join(DESCRIPTION))?;
        let text = decode::text(&path)?;
        serde_json::from_str(&text).map_err(|error| json::located(&error, None, &[]).in_file(&path))
    }

    /// The last label of what objects stand on.
    pub fn last_of_support(&self) -> u16 {
        if self.views.contains_key(WITH_TABLETOP) { LAST_OF_TABLETOP } else { TABLE }
    }
}

/// Each object has a description.
pub struct TodRules;

impl LabelRules for TodRules {
    fn faults(&self, root: &DatasetFolder, image: &LabelImage, labels: &[u16]) -> Vec<DatasetFault> {
        // Opening the dataset reports a description that cannot be read.
        let scene = image.labels.parent().unwrap_or(Path::new(""));
        let Ok(outline) = SceneOutline::read(root, scene) else { return Vec::new() };
        let count = outline.object_descriptions.len();
        let has_none = labels.iter().filter(|label| usize::from(**label - image.background) > count);
        let fault = |label: &u16| {
            let message = format!("label {label} has no entry in `object_descriptions`, which has {count}");
            DatasetFault::new(rule::RECORDS_AGREE, message)
        };
        has_none.map(fault).collect()
    }
}
