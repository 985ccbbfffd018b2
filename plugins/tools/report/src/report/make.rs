//! Makes a report: from a path and options to a folder of pages.

use super::overview::{MOST_OCCLUDED, MOST_WORST, by_occlusion};
use super::record::run_of;
use super::scored::ReportScores;
use super::{DatasetReport, ReportSelection, StatisticsProgress};
use crate::stats::{self, DatasetStatistics, StatisticsOptions};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::{Error, Result};
use syntable_model::left_out::LeftOut;
use syntable_model::reader::{self, Source};
use syntable_model::registry::Registry;
use syntable_runtime::durable::{self, Draft, Standing};
use syntable_runtime::images::{ImageWork, each};
use syntable_runtime::left_out::LeftOutReport;
use syntable_runtime::paths::{dataset_folder, lies_in};
use syntable_runtime::run::check_place;
use syntable_runtime::run::progress::count;

/// Creator in the list of files of a report's folder.
pub const MADE_BY: &str = "syntable report";

/// Content and folder of a report.
#[derive(Debug, Clone)]
pub struct ReportOptions {
    /// The dataset, in any readable format.
    pub dataset: Source,
    /// Format of the dataset; `None` detects it.
    pub format: Option<String>,
    /// Folder of the report; `None` uses the dataset's name with the suffix `-report`.
    pub out: Option<PathBuf>,
    /// Whether to replace an existing report in the folder.
    pub overwrite: bool,
    /// File of scores of predictions, written by `syntable eval --save`.
    pub scores: Option<PathBuf>,
    /// Maximum number of images: the most occluded ones, and others at even intervals. Statistics always cover all
    /// images.
    pub images: usize,
    /// Maximum number of scenes in space.
    pub scenes: usize,
    /// Whether to omit brightness, depth and near-duplicate views, which is faster.
    pub labels_only: bool,
}

impl ReportOptions {
    /// A report next to the dataset, with at most 500 images and 6 scenes.
    pub fn new(dataset: Source) -> Self {
        let (format, out, scores) = (None, None, None);
        Self { dataset, format, out, overwrite: false, scores, images: 500, scenes: 6, labels_only: false }
    }
}

/// Result of making a report.
#[derive(Debug, Clone)]
pub struct MadeReport {
    /// Its first page.
    pub index: PathBuf,
    /// Format of the dataset.
    pub format: &'static str,
    /// Images with labels in the report.
    pub images: usize,
    /// Images of the dataset.
    pub all_images: usize,
    /// Images of the dataset that were not chosen.
    pub images_not_chosen: usize,
    /// Scenes in space.
    pub scenes: usize,
    /// Notes for readers of the report.
    pub notes: Vec<Error>,
    /// Unreadable parts of the dataset, which the pages omit.
    pub left_out: LeftOutReport,
}

/// Makes a report: a folder of pages, which appears as a whole or not at all.
///
/// # Errors
/// If the dataset cannot be opened, the folder is in use, a file cannot be written, or the work was stopped.
pub fn make(registry: &Registry, options: &ReportOptions, work: &ImageWork) -> Result<MadeReport> {
    let ReportOptions { dataset: source, scores, .. } = options;
    let dataset = &source.path;
    let place = || match source.is_remote() {
        // Beside the dataset, a report would be in the store.
        true => beside(registry, Path::new(source.name().file_name().unwrap_or_default())),
        false => beside(registry, dataset),
    };
    let out = options.out.clone().map_or_else(place, Ok).map_err(Error::of_request)?;
    let read = dataset_folder(registry, dataset);
    for input in [Some(&read), Some(dataset), scores.as_ref()].into_iter().flatten() {
        if lies_in(input, &out) {
            let error =
                Error::new(format!("the folder contains {}, which a new report would replace", input.display()));
            return Err(error.in_file(&out).help("choose another folder with `options.out`").of_request());
        }
    }
    check_place(&out, dataset)?;
    check_out(&out, options.overwrite)?;
    let (format, opened) = registry.open_dataset(source, options.format.as_deref())?;
    let scored = scores.as_ref().map(|file| ReportScores::open(file, &opened)).transpose()?;
    let counting = StatisticsOptions { labels_only: options.labels_only, ..StatisticsOptions::default() };
    let mut incomplete = Vec::new();
    let counted = match stats::of(&opened, &counting, work) {
        Ok(statistics) => StatisticsProgress::Done(Box::new(statistics)),
        Err(error) if work.stop.is_requested() => return Err(error),
        Err(error) => {
            let error = error.in_file(dataset);
            incomplete.push(Error::new(format!("no statistics: {error}")).help("`syntable validate` lists all faults"));
            StatisticsProgress::Failed(error.to_string())
        }
    };
    let worst = scored.as_ref().map_or(&[][..], ReportScores::images);
    let (most_worst, most) = (worst.len(), options.images);
    let chosen = |of: &reader::OpenDataset| ReportSelection {
        images: choose(of.images.len(), most, statistics(&counted), worst),
        scenes: Some(options.scenes),
    };
    let mut report = DatasetReport::of(registry, opened, format.name(), source, chosen)?;
    if let Some(scored) = scored {
        report = report.with_scores(scored);
    }
    let not_objects = match statistics(&counted) {
        Some(statistics) => statistics.left_out.clone(),
        None => report.dataset().not_objects(&report.dataset().offers),
    };
    report.put_statistics(counted);
    let draft = Draft::begin(&out)?;
    write(&report, &draft, work)?;
    draft.publish_listed(MADE_BY)?;
    let note = || {
        Error::new(format!("the overview shows {MOST_WORST} of the {most_worst} worst images in the file of scores"))
            .help("the page of each image in the report shows its predictions")
    };
    let (shown, unread) = (report.images(), report.unread());
    Ok(MadeReport {
        index: out.join("index.html"),
        format: format.name(),
        images: shown - unread.len(),
        all_images: report.dataset().images.len(),
        images_not_chosen: report.dataset().images.len() - shown,
        scenes: report.scenes().len(),
        notes: (most_worst > MOST_WORST).then(note).into_iter().collect(),
        left_out: left_out(&report, unread, incomplete, not_objects),
    })
}

/// Data that the pages omit: unreadable images and other parts, and the statistics.
fn left_out(
    report: &DatasetReport,
    unread: Vec<String>,
    incomplete: Vec<Error>,
    not_objects: Vec<LeftOut>,
) -> LeftOutReport {
    let lost = report.lost();
    let mut parts = Vec::new();
    for (reasons, one) in [(unread.len(), "image"), (lost.len(), "other part")] {
        parts.extend((reasons > 0).then(|| count(reasons as u32, one)));
    }
    parts.extend((!incomplete.is_empty()).then(|| "the statistics".to_owned()));
    let mut left_out = LeftOutReport::default();
    if !parts.is_empty() {
        let reasons = unread.into_iter().chain(lost).map(Error::new);
        let summary = format!("{} cannot be read, so the pages omit them", parts.join(" and "));
        left_out.add(summary, incomplete.into_iter().chain(reasons));
    }
    left_out.annotations(&not_objects);
    left_out
}

fn statistics(counted: &StatisticsProgress) -> Option<&DatasetStatistics> {
    match counted {
        StatisticsProgress::Done(statistics) => Some(statistics),
        _ => None,
    }
}

/// Images to show, ascending: the images with the worst scores, the most occluded ones, and others at even intervals.
pub fn choose(all: usize, most: usize, statistics: Option<&DatasetStatistics>, worst: &[usize]) -> Vec<usize> {
    if most >= all {
        return (0..all).collect();
    }
    let occluded = statistics.map(by_occlusion).unwrap_or_default();
    let mut chosen: BTreeSet<usize> = worst.iter().copied().take(most / 2).collect();
    chosen.extend(occluded.into_iter().map(|(image, _)| image).take(MOST_OCCLUDED.min(most / 2)));
    let others: Vec<usize> = (0..all).filter(|image| !chosen.contains(image)).collect();
    let even = most.saturating_sub(chosen.len());
    chosen.extend((0..even).map(|number| others[number * others.len() / even.max(1)]));
    chosen.into_iter().collect()
}

/// Default folder of a report: next to the dataset, because a run owns the files in its folder.
fn beside(registry: &Registry, dataset: &Path) -> Result<PathBuf> {
    let whole = std::path::absolute(dataset).map_err(|error| Error::io(dataset, &error))?;
    let folder = &dataset_folder(registry, &whole);
    let Some(name) = folder.file_name() else {
        return Err(Error::new("the dataset's folder has no name")
            .in_file(dataset)
            .help("choose a folder for the report with `options.out`"));
    };
    // For a writer's folder, the report goes next to the folder of the run.
    if let Some(run) = run_of(folder)?.filter(|run| run != folder) {
        let inner = folder.strip_prefix(&run).unwrap_or(folder).iter();
        let names = run.file_name().into_iter().chain(inner).map(|name| name.to_string_lossy());
        let names: Vec<_> = names.collect();
        return Ok(run.with_file_name(format!("{}-report", names.join("-"))));
    }
    let mut named = name.to_owned();
    named.push("-report");
    let is_named = *folder == whole && dataset.is_dir() && dataset.file_name().is_some();
    Ok(if is_named { dataset.with_file_name(named) } else { folder.with_file_name(named) })
}

/// Refuses a folder that cannot hold a report.
fn check_out(out: &Path, overwrite: bool) -> Result<()> {
    let refuse = |what: &str, help: &str| {
        // A report that was killed at its very end is complete, but leaves remains of the command next to it.
        let _ = durable::mend(out);
        Err(Error::new(what).in_file(out).help(help))
    };
    match durable::standing(out)? {
        Standing::Made(listing) if listing.made_by == MADE_BY => match overwrite {
            true => listing.check(out).and_then(|()| durable::mend(out)),
            false => refuse("the folder has a report", "`options.overwrite` replaces it"),
        },
        Standing::Made(_) | Standing::Other => refuse(
            "the path exists and is not a report",
            "choose another folder with `options.out`; no file was changed",
        ),
        Standing::Free => durable::mend(out),
    }
}

/// Writes all files of a report into a folder.
///
/// # Errors
/// If a file cannot be written, or the work was stopped. Unreadable parts of the dataset are omitted, see
/// [`DatasetReport::unread`] and [`DatasetReport::lost`].
pub fn write(report: &DatasetReport, draft: &Draft, work: &ImageWork) -> Result<()> {
    report.gather_licenses();
    let mut edition = Some(Hasher::new("edition of a report"));
    let mut add = |digest: Digest| edition = edition.take().map(|it| it.digest(digest));
    let of_file = |path: &str, bytes: &[u8]| Hasher::new("a file").text(path).bytes(bytes).finish();
    // Images state whether the report has their scene in 3-D.
    for (scene, path) in report.scene_paths() {
        match report.file(&path) {
            Ok(Some(bytes)) => {
                draft.write(&path, &bytes)?;
                add(of_file(&path, &bytes));
            }
            Ok(None) => {}
            Err(error) => report.lose_scene(scene, &error),
        }
    }
    let image = |place: usize| {
        let mut hasher = Hasher::new("files of an image");
        for (path, bytes) in report.files_of_image(place)? {
            draft.write(&path, &bytes)?;
            hasher = hasher.text(&path).bytes(&bytes);
        }
        Ok(hasher.finish())
    };
    each(work, "showed", report.images(), &image, &mut |_, digest| add(digest))?;
    let (pages, others): (Vec<String>, Vec<String>) =
        report.other_paths().into_iter().partition(|path| path.ends_with(".html"));
    for path in others {
        if let Some(bytes) = report.file(&path)? {
            draft.write(&path, &bytes)?;
            add(of_file(&path, &bytes));
        }
    }
    // Pages refer to other files with the report's digest, so that browsers do not use cached files of an earlier
    // report.
    if let Some(edition) = edition {
        report.put_edition(&edition.finish());
    }
    for path in pages {
        if let Some(bytes) = report.file(&path)? {
            draft.write(&path, &bytes)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn images_are_chosen_at_even_distances() {
        assert_eq!(choose(5, 9, None, &[]), [0, 1, 2, 3, 4]);
        assert_eq!(choose(100, 4, None, &[]), [0, 25, 50, 75]);
        assert_eq!(choose(7, 3, None, &[]), [0, 2, 4]);
        // The worst images take at most one half.
        assert_eq!(choose(100, 4, None, &[77, 3, 50]), [0, 3, 50, 77]);
        // The result has the requested number of images, whatever the preferred images.
        for (all, most) in (2..20).flat_map(|all| (1..all).map(move |most| (all, most))) {
            let shown = choose(all, most, None, &[all - 1, 0, all / 2]);
            assert!(shown.len() == most && shown.is_sorted(), "{most} of {all}: {shown:?}");
        }
    }
}
