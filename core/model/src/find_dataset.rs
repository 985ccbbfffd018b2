//! Finds the format of a dataset, and opens it.

use crate::error::{Error, Result};
use crate::files::RESERVED;
use crate::reader::{DatasetFormat, OpenDataset, Source, Unread};
use crate::registry::Registry;
use crate::shown::shown;
use crate::words::SHOWN;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Folder of annotation files in many datasets.
const ANNOTATIONS: &str = "annotations";

impl Registry {
    /// Opens a dataset in the named format, or in the format that it looks like.
    ///
    /// # Errors
    /// If the path does not exist, its format is unknown or ambiguous, it contains several datasets, or nothing can be
    /// read.
    pub fn open_dataset(&self, source: &Source, format: Option<&str>) -> Result<(Arc<dyn DatasetFormat>, OpenDataset)> {
        let Found { format, source, opened } = find(self.formats(), source, format)?;
        let dataset = opened.map_or_else(|| format.open(&source), Ok)?;
        Ok((format, dataset))
    }

    /// Finds the format of a dataset, and its folder or annotation file, without opening it. A folder that only
    /// contains one dataset is replaced by that dataset.
    ///
    /// # Errors
    /// If the path does not exist, its format is unknown or ambiguous, or it contains several datasets.
    pub fn find_dataset(&self, source: &Source, format: Option<&str>) -> Result<(Arc<dyn DatasetFormat>, Source)> {
        let Found { format, source, .. } = find(self.formats(), source, format)?;
        Ok((format, source))
    }

    /// The datasets of products by name that other writers of a run wrote into folders of their own, in the order of
    /// their names. `found` is the dataset that [`find_dataset`](Self::find_dataset) finds in the run's folder. None
    /// in a folder that no run made.
    pub fn companions(&self, run: &Source, found: &Source) -> Vec<(Arc<dyn DatasetFormat>, Source)> {
        if !is_of_run(&run.path) {
            return Vec::new();
        }
        let Ok(root) = run.folder(&run.path) else { return Vec::new() };
        let entries = std::fs::read_dir(&run.path).into_iter().flatten().flatten().map(|entry| entry.path());
        // A link may lead to a folder that the user did not name.
        let is_own = |path: &PathBuf| path.is_dir() && root.file(path.file_name().unwrap_or_default()).is_ok();
        let mut folders: Vec<PathBuf> = entries.filter(|path| *path != found.path && is_own(path)).collect();
        folders.sort();
        let of = |folder: PathBuf| {
            let format = self.formats().iter().find(|it| it.is_generic() && it.detects(&folder))?;
            Some((Arc::clone(format), run.at(&folder)))
        };
        folders.into_iter().filter_map(of).collect()
    }
}

/// A dataset whose format is known.
struct Found {
    format: Arc<dyn DatasetFormat>,
    source: Source,
    /// The open dataset, if it was opened to find it.
    opened: Option<OpenDataset>,
}

impl Found {
    fn of(format: &Arc<dyn DatasetFormat>, source: &Source) -> Self {
        Self { format: Arc::clone(format), source: source.clone(), opened: None }
    }
}

fn find(formats: &[Arc<dyn DatasetFormat>], source: &Source, format: Option<&str>) -> Result<Found> {
    let found = look_for(formats, source, format);
    // A file that could not be downloaded looks like no dataset.
    match source.take_outage() {
        Some(error) => Err(error),
        None => found,
    }
}

fn look_for(formats: &[Arc<dyn DatasetFormat>], source: &Source, format: Option<&str>) -> Result<Found> {
    let root = source.path.as_path();
    let names = || formats.iter().map(|format| format.name()).collect::<Vec<_>>().join(", ");
    if !root.is_dir() && !root.is_file() {
        return Err(Error::new("no such folder or file").in_file(root));
    }
    if let Some(name) = format {
        let named = formats.iter().find(|it| it.name() == name);
        return named.map(|format| Found::of(format, source)).ok_or_else(|| {
            Error::new(format!("unknown dataset format `{name}`")).help(format!("available formats: {}", names()))
        });
    }
    // A dataset with a layout of its own comes before products stored by name, wherever it is.
    for is_generic in [false, true] {
        let those = || formats.iter().filter(move |it| it.is_generic() == is_generic);
        let found: Vec<&Arc<dyn DatasetFormat>> = those().filter(|it| it.detects(root)).collect();
        match found.as_slice() {
            [only] => return Ok(Found::of(only, source)),
            [] => {}
            [first, second, ..] => {
                return Err(Error::new(format!("it looks like {} and like {}", first.name(), second.name()))
                    .in_file(root)
                    .help(help_with_files(root, &found)));
            }
        }
        let entries = std::fs::read_dir(root).into_iter().flatten().flatten().map(|entry| entry.path());
        let is_one = |path: &PathBuf| path.is_dir() && those().any(|it| it.detects(path));
        let mut inside: Vec<PathBuf> = entries.filter(is_one).collect();
        if let [only] = inside.as_slice() {
            // It may be a link to a folder that the user did not name.
            source.folder(root)?.file(only.file_name().unwrap_or_default())?;
        }
        inside.sort();
        match inside.as_slice() {
            // A writer's folder in a folder of its own, as `convert` makes it.
            [only] => return find(formats, &source.at(only), None),
            [] => {}
            several if is_of_run(root) => return fullest(formats, several, source),
            [first, others @ ..] => {
                return Err(Error::new(format!("it contains {} datasets", 1 + others.len()))
                    .in_file(root)
                    .help(format!("name one of them, such as {}", shown(first).display())));
            }
        }
    }
    if is_of_run(root) {
        return Err(Error::new("the dataset has no annotation files: a run writes them at its end")
            .in_file(root)
            .help(format!("finish the run, or add a writer of a readable format to its recipe: {}", names())));
    }
    if let Some(error) = Unread::known(root) {
        return Err(error.in_file(root));
    }
    if let Some(format) = formats.iter().find(|it| it.falls_back_to(root)) {
        return Ok(Found::of(format, source));
    }
    Err(Error::new("unrecognized dataset format")
        .in_file(root)
        .help(format!("name the format with `options.format`: {}", names())))
}

/// Help for a folder that several formats read: its annotation files with their formats. `--format` alone does not choose between
/// several files of one format.
fn help_with_files(root: &Path, formats: &[&Arc<dyn DatasetFormat>]) -> String {
    let of_folder =
        |folder: PathBuf| std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let files = of_folder(root.to_owned()).chain(of_folder(root.join(ANNOTATIONS))).filter(|path| path.is_file());
    let named = |file: PathBuf| {
        let format = formats.iter().find(|format| format.detects(&file))?;
        Some(format!("{} ({})", shown(&file).display(), format.name()))
    };
    let mut named: Vec<String> = files.filter_map(named).collect();
    named.sort();
    match named.len() {
        0 => "name the format with `options.format`".to_owned(),
        count if count > SHOWN => {
            format!("name one of its {count} annotation files, such as {}", named[..SHOWN].join(", "))
        }
        _ => format!("name one of its annotation files: {}", named.join(", ")),
    }
}

/// Whether a run of this program made a folder.
fn is_of_run(root: &Path) -> bool {
    root.join(RESERVED[0]).is_dir()
}

/// The dataset with the most products among the writers' folders of one run: they have the same images. A folder that cannot be
/// opened comes first, so that its fault is not hidden by another layout.
fn fullest(formats: &[Arc<dyn DatasetFormat>], folders: &[PathBuf], source: &Source) -> Result<Found> {
    let root = source.folder(&source.path)?;
    let mut best: Option<(usize, Found)> = None;
    for folder in folders {
        // It may be a link to a folder that the user did not name.
        root.file(folder.file_name().unwrap_or_default())?;
        let found = find(formats, &source.at(folder), None)?;
        let Ok(opened) = found.format.open(&found.source) else { return Ok(found) };
        let products = opened.offers.len();
        if best.as_ref().is_none_or(|(most, _)| products > *most) {
            best = Some((products, Found { opened: Some(opened), ..found }));
        }
    }
    best.map(|(_, found)| found).ok_or_else(|| Error::new("no dataset").in_file(&source.path))
}
