//! Reads TOD's scenes.

use super::TodSplit;
use super::check::{SceneOutline, TodRules};
use super::record::{DESCRIPTION, IMAGES, SCENE, TABLE, WITHOUT_OBJECTS};
use crate::label_images::{LabelImage, LabelImages, note_missing, offers};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use syntable_formats::read::{self, Categories, Faults};
use syntable_model::prelude::*;
use syntable_model::reader::{Format, Opened, Source};
use syntable_model::rule;
use syntable_model::shown::shown;

syntable_model::register_format!(Format::new(
    "tod",
    "TOD's folders of scenes (`training_set` or `test_set`), as the writer `tod` writes them.",
    |root| SPLITS.iter().any(|split| scenes(&root.join(split)).values().any(|folder| has_labels(folder))),
    open,
));

/// Folders of scenes inside the folder of a dataset: the folder itself, or the folder of a split.
const SPLITS: [&str; 3] = ["", TodSplit::Train.folder(), TodSplit::Test.folder()];

/// Numbers and folders of scenes, in order.
fn scenes(root: &Path) -> BTreeMap<u32, PathBuf> {
    let number = |path: &PathBuf| path.file_name()?.to_str()?.strip_prefix(SCENE)?.parse::<u32>().ok();
    read::entries(root).into_iter().filter_map(|path| Some((number(&path)?, path))).collect()
}

/// Whether the folder of a scene has labels of the first view, or of the first view with objects.
fn has_labels(folder: &Path) -> bool {
    [0, WITHOUT_OBJECTS].iter().any(|view| folder.join(format!("{}{view:05}.png", IMAGES[2])).is_file())
}

/// The folder of the scenes inside the folder that the user named: this folder itself, or the only split in it.
fn scenes_folder(path: &Path) -> Result<PathBuf> {
    if !scenes(path).is_empty() {
        return Ok(PathBuf::new());
    }
    let splits = [TodSplit::Train, TodSplit::Test].map(TodSplit::folder);
    let found: Vec<&str> = splits.into_iter().filter(|folder| !scenes(&path.join(folder)).is_empty()).collect();
    match found.as_slice() {
        [only] => Ok(PathBuf::from(only)),
        [] => Err(Error::new(format!("it has no scene of TOD: no folder `{SCENE}00000` or the like")).in_file(path)),
        [first, ..] => Err(Error::new("it has several splits")
            .in_file(path)
            .help(format!("name one of them, such as {}", shown(&path.join(first)).display()))),
    }
}

fn open(source: &Source) -> Result<Opened> {
    let split = scenes_folder(&source.path)?;
    let root = source.folder(&source.path)?;
    let (mut faults, mut views) = (Faults::default(), Vec::new());
    for (scene, folder) in scenes(&source.path.join(&split)) {
        let inside = split.join(folder.file_name().unwrap_or_default());
        let folder = root.file(&inside)?;
        let background = match SceneOutline::read(&root, &inside) {
            Ok(outline) => outline.last_of_support(),
            Err(error) => {
                faults.add(rule::READABLE, inside.join(DESCRIPTION).display().to_string(), error.to_string());
                TABLE
            }
        };
        let images = read::entries_with(&folder, |end| ["jpeg", "jpg", "png"].contains(&end))?;
        let mut colors: BTreeMap<u32, PathBuf> = BTreeMap::new();
        let number = |stem: &str, start: &str| stem.strip_prefix(start)?.parse::<u32>().ok();
        for (stem, path) in &images {
            if let Some(view) = number(stem, IMAGES[0]) {
                colors.entry(view).or_insert_with(|| inside.join(path.file_name().unwrap_or_default()));
            }
        }
        for (stem, path) in &images {
            let others = IMAGES[1..].iter().filter_map(|start| number(stem, start));
            if others.into_iter().any(|view| !colors.contains_key(&view)) {
                let file = inside.join(path.file_name().unwrap_or_default());
                faults.lost(rule::RECORDS_AGREE, file.display().to_string(), "the color image of this view is missing");
            }
        }
        for (view, rgb) in colors {
            let path = |start: &str| inside.join(format!("{start}{view:05}.png"));
            let image = LabelImage { rgb, depth: path(IMAGES[1]), labels: path(IMAGES[2]), background };
            note_missing(&root, &image, &mut faults);
            views.push((image.rgb.display().to_string(), (scene, view), image));
        }
    }
    let (refs, views) = faults.in_order(views, |(name, place, _)| (name, Some(*place)));
    let info = Categories::default().info(read::name_of(&source.path), String::new(), &refs, String::new());
    let images = views.into_iter().map(|(.., image)| image).collect();
    let source = LabelImages { root, images, rules: TodRules };
    Ok(Opened { faults: faults.into_inner(), ..Opened::new(info, refs, offers(), source) })
}
