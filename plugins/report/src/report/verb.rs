//! `syntable report`.

use super::overview::{MOST_OCCLUDED, MOST_WORST, by_occlusion};
use super::record::run_of;
use super::scored::Scored;
use super::{Counted, Report, Shown};
use crate::arguments;
use crate::stats::{self, Options, Statistics};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::{Error, Result};
use syntable_model::reader;
use syntable_model::registry::Registry;
use syntable_runtime::clap::{Arg, ArgAction, ArgMatches, Command, value_parser};
use syntable_runtime::cli::{Console, Exit, LeftOutReport, Message, Verb, amount, dataset_folder, lies_in};
use syntable_runtime::durable::{self, Draft, Standing};
use syntable_runtime::images::each;
use syntable_runtime::run::progress::{Reporter, count};
use syntable_runtime::workers::Pool;

syntable_runtime::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

/// What the list of files in a report's folder says of who made it.
pub const MADE_BY: &str = "syntable report";

fn command() -> Command {
    let flag = |name: &'static str| Arg::new(name).long(name);
    Command::new("report")
        .about("Make pages that show a dataset: card, statistics, images with labels, occlusion graphs, scenes in space")
        .arg(arguments::dataset())
        .arg(flag("out").value_name("DIR").value_parser(value_parser!(PathBuf)).help(
            "Folder of the report; the dataset's with `-report` after its name if left out. Open its index.html",
        ))
        .arg(flag("overwrite").action(ArgAction::SetTrue).help("Replace a report that is in the folder"))
        .arg(arguments::format())
        .arg(arguments::trust_paths())
        .arg(arguments::scores())
        .arg(flag("images").value_name("N").value_parser(amount).default_value("500").help(
            "Most images in the report, or `all`: the most occluded ones, and others at even distances. An image takes about \
             0.1 MB. The numbers are always those of all",
        ))
        .arg(
            flag("scenes")
                .value_name("N")
                .value_parser(amount)
                .default_value("6")
                .help("Most scenes to look at in space, or `all`: those that the writer `gltf` wrote, the first ones"),
        )
        .arg(flag("labels-only").action(ArgAction::SetTrue).help(
            "Count labels alone, which is faster: leaves out brightness, depth and near-duplicate views",
        ))
        .arg(arguments::threads("Worker threads; all cores if left out. The report does not depend on it"))
        .after_help(
            "Examples:
  syntable report data                             data-report/index.html
  syntable report data --out pages --images all    with every image
  syntable report data --scores scores.json        with the worst predictions (see `syntable eval --save`)
  syntable report coco/annotations.json --out pages --format coco",
        )
}

fn run(console: &Console, _: &Registry, arguments: &ArgMatches) -> std::result::Result<(), Exit> {
    let path = |name: &str| arguments.get_one::<PathBuf>(name);
    let number = |name: &str| arguments.get_one::<usize>(name).copied().unwrap_or(usize::MAX);
    let Some(dataset) = path("dataset") else { return Ok(()) };
    let out = path("out").cloned().map_or_else(|| beside(dataset), Ok).map_err(Exit::wrong)?;
    let read = dataset_folder(dataset);
    for input in [Some(&read), Some(dataset), path("scores")].into_iter().flatten() {
        if lies_in(input, &out) {
            let error = Error::new(format!("{} lies in it, and a new report would replace it", input.display()));
            return Err(Exit::wrong(error.in_file(&out).help("choose another folder with --out")));
        }
    }
    check_out(&out, arguments.get_flag("overwrite")).map_err(Exit::stopped)?;
    let pool = Pool::new(arguments::threads_of(arguments)).map_err(Exit::stopped)?;
    let format = arguments.get_one::<String>("format").map(String::as_str);
    let source = arguments::source(dataset, arguments);
    let (format, opened) = reader::open_source(&source, format).map_err(Exit::stopped)?;
    let scored = path("scores").map(|file| Scored::open(file, &*opened)).transpose().map_err(Exit::stopped)?;
    let options = Options { images: !arguments.get_flag("labels-only"), ..Options::default() };
    let mut incomplete = Vec::new();
    let counted = match stats::of(&*opened, &options, (&pool, console.reporter())) {
        Ok(statistics) => Counted::Done(Box::new(statistics)),
        Err(error) => {
            let error = error.in_file(dataset);
            incomplete
                .push(Error::new(format!("no statistics: {error}")).help("`syntable validate` lists what is wrong"));
            Counted::Failed(error.to_string())
        }
    };
    let (images, scenes) = (number("images"), number("scenes"));
    let chosen = |of: &dyn reader::DatasetReader| Shown {
        images: choose(of.images().len(), images, statistics(&counted), scored.as_ref().map_or(&[], Scored::images)),
        scenes: Some(scenes),
    };
    let mut report = Report::of(opened, format.name, &source, chosen).map_err(Exit::stopped)?;
    let worst = scored.as_ref().map_or(0, |scored| scored.images().len());
    if let Some(scored) = scored {
        report = report.with_scores(scored);
    }
    report.put_statistics(counted);
    let draft = Draft::begin(&out).map_err(Exit::stopped)?;
    write(&report, &draft, (&pool, console.reporter())).map_err(Exit::stopped)?;
    draft.publish_listed(MADE_BY).map_err(Exit::stopped)?;
    if worst > MOST_WORST {
        let note =
            Error::new(format!("the overview shows {MOST_WORST} of the {worst} worst images in the file of scores"));
        console.say(&Message::Warning(note.help("the page of each image in the report shows its predictions")));
    }
    let (shown, all) = (report.images(), report.dataset().images().len());
    let left_out = if shown < all { format!("; --images all adds the other {}", all - shown) } else { String::new() };
    let (unread, lost) = (report.unread(), report.lost());
    console.print(&format!(
        "{}, read as {}: {} of {all} images with labels, {} in space{left_out}\n",
        out.join("index.html").display(),
        format.name,
        shown - unread.len(),
        report.scenes().len(),
    ))?;
    let mut parts = Vec::new();
    for (reasons, one) in [(unread.len(), "image"), (lost.len(), "other part")] {
        parts.extend((reasons > 0).then(|| count(reasons as u32, one)));
    }
    parts.extend((!incomplete.is_empty()).then(|| "the statistics".to_owned()));
    let mut left_out = LeftOutReport::default();
    if !parts.is_empty() {
        let reasons = unread.into_iter().chain(lost).map(Error::new);
        let summary = format!("{} cannot be read: the pages lack what they say", parts.join(" and "));
        left_out.add(summary, incomplete.into_iter().chain(reasons));
    }
    left_out.annotations(&report.dataset().passed_over(&report.dataset().offers()));
    left_out.end(dataset, "`syntable validate` lists all that is wrong")
}

fn statistics(counted: &Counted) -> Option<&Statistics> {
    match counted {
        Counted::Done(statistics) => Some(statistics),
        _ => None,
    }
}

/// Images to show, ascending: those with the worst scores, the most occluded ones, and others at even distances.
pub fn choose(all: usize, most: usize, statistics: Option<&Statistics>, worst: &[usize]) -> Vec<usize> {
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

/// Where the report of a dataset lies if nothing is said: beside it, since what lies in the folder of a run belongs to the run.
fn beside(dataset: &Path) -> Result<PathBuf> {
    let whole = std::path::absolute(dataset).map_err(|error| Error::io(dataset, &error))?;
    let folder = &dataset_folder(&whole);
    let Some(name) = folder.file_name() else {
        return Err(Error::new("its folder has no name").in_file(dataset).help("choose one for the report with --out"));
    };
    // Of the folder of a writer: beside the whole run.
    if let Some(run) = run_of(folder)?.filter(|run| run != folder) {
        let inner = folder.strip_prefix(&run).unwrap_or(folder).iter();
        let names = run.file_name().into_iter().chain(inner).map(|name| name.to_string_lossy());
        let names: Vec<_> = names.collect();
        return Ok(run.with_file_name(format!("{}-report", names.join("-"))));
    }
    let mut named = name.to_owned();
    named.push("-report");
    let is_named = dataset.is_dir() && dataset.file_name().is_some();
    Ok(if is_named { dataset.with_file_name(named) } else { folder.with_file_name(named) })
}

/// Refuses a folder in which no report can be made.
fn check_out(out: &Path, overwrite: bool) -> Result<()> {
    let whole = std::path::absolute(out).map_err(|error| Error::io(out, &error))?;
    if let Some(run) = whole.parent().map_or(Ok(None), run_of)? {
        return Err(Error::new(format!("it lies in the folder of a run, {}", run.display()))
            .in_file(out)
            .help("choose a folder beside it: files of a run are compared with its journal")
            .of_request());
    }
    let refuse = |what: &str, help: &str| {
        // A report that was killed at its very end is whole, and has left something beside it.
        let _ = durable::mend(out);
        Err(Error::new(what).in_file(out).help(help).of_request())
    };
    match durable::standing(out)? {
        Standing::Made(listing) if listing.made_by == MADE_BY => match overwrite {
            true => listing.check(out).and_then(|()| durable::mend(out)),
            false => refuse("there is a report", "--overwrite replaces it"),
        },
        Standing::Made(_) | Standing::Other => {
            refuse("it is there, and no report", "choose another folder with --out; nothing was touched")
        }
        Standing::Free => durable::mend(out),
    }
}

/// Writes all files of a report into a folder.
///
/// # Errors
/// If one cannot be written. What of the dataset cannot be read is left out, see [`Report::unread`] and [`Report::lost`].
pub fn write(report: &Report, draft: &Draft, (pool, reporter): (&Pool, &dyn Reporter)) -> Result<()> {
    report.gather_licenses();
    let mut edition = Some(Hasher::new("edition of a report"));
    let mut add = |digest: Digest| edition = edition.take().map(|it| it.digest(digest));
    let of_file = |path: &str, bytes: &[u8]| Hasher::new("a file").text(path).bytes(bytes).finish();
    // Images say whether their scene is shown in space.
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
    each((pool, reporter), "showed", report.images(), &image, &mut |_, digest| add(digest))?;
    let (pages, others): (Vec<String>, Vec<String>) =
        report.other_paths().into_iter().partition(|path| path.ends_with(".html"));
    for path in others {
        if let Some(bytes) = report.file(&path)? {
            draft.write(&path, &bytes)?;
            add(of_file(&path, &bytes));
        }
    }
    // Pages name the others with what they hold, so that a browser takes none of an earlier report.
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
        // Of the worst ones, at most one half.
        assert_eq!(choose(100, 4, None, &[77, 3, 50]), [0, 3, 50, 77]);
        // As many as there are to be, whatever was taken before.
        for (all, most) in (2..20).flat_map(|all| (1..all).map(move |most| (all, most))) {
            let shown = choose(all, most, None, &[all - 1, 0, all / 2]);
            assert!(shown.len() == most && shown.is_sorted(), "{most} of {all}: {shown:?}");
        }
    }
}
