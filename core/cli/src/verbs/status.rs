//! `syntable status`.

use crate::console::Console;
use crate::exit::Exit;
use clap::Args;
use std::path::PathBuf;
use std::time::Duration;
use syntable_model::error::Error;
use syntable_model::store::StoreFolder;
use syntable_recipe::message::Message;
use syntable_runtime::run;
use syntable_runtime::run::progress::{clock, count};
use syntable_runtime::run::{DatasetStatus, Progress, Status};

#[derive(Args)]
pub(crate) struct StatusArgs {
    /// Folders or URLs of datasets, or of shards such as `data/mine.shards`.
    #[arg(required = true)]
    datasets: Vec<PathBuf>,
    /// Print one JSON object for programs.
    #[arg(long)]
    json: bool,
}

pub(crate) fn status(console: &Console, args: &StatusArgs) -> Result<(), Exit> {
    let named = args.datasets.iter().map(StoreFolder::at).collect::<Result<Vec<_>, _>>().map_err(Exit::stopped)?;
    let found = run::status(&named).map_err(Exit::stopped)?;
    if args.json {
        let text =
            serde_json::to_string_pretty(&found).map_err(|error| Exit::stopped(Error::new(error.to_string())))?;
        console.print(&format!("{text}\n"))?;
    } else {
        let rows = rows(&found);
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default();
        let (first, second) = (width(0), width(1));
        let line = |[name, state, text]: &[String; 3]| {
            format!("{name:first$}  {state:second$}  {text}").trim_end().to_owned() + "\n"
        };
        console.print(&rows.iter().map(line).collect::<String>())?;
    }
    let mut messages = Vec::new();
    for DatasetStatus { dataset, faults, running, finished, progress, .. } in &found.datasets {
        if !running && !finished && progress.scenes > 0 && progress.missing == 0 {
            let help = "start the same run again; a suspended worker must continue or be killed";
            messages.push(Message::Error(
                Error::new("all scenes are made, but the run has not ended").in_file(dataset).help(help),
            ));
        }
        messages.extend(faults.iter().map(|fault| {
            let help = "a run with --repair makes the scene of a damaged line again";
            Message::Error(Error::new(format!("the journal is damaged: {fault}")).in_file(dataset).help(help))
        }));
    }
    if is_whole(&found) && messages.is_empty() { Ok(()) } else { Err(Exit { code: 3, messages }) }
}

fn is_whole(found: &Status) -> bool {
    found.datasets.iter().all(|dataset| dataset.finished) && found.total.done == found.total.scenes
}

/// Missing shards that have a row each. `--json` has all.
const SHOWN: usize = 100;

/// The rows of the table: name, state, and counts.
fn rows(found: &Status) -> Vec<[String; 3]> {
    let mut rows: Vec<[String; 3]> = found.datasets.iter().map(row).collect();
    let missing = found.missing_shards.iter().take(SHOWN);
    rows.extend(missing.map(|shard| [format!("shard {shard}"), "no folder".into(), String::new()]));
    let more = found.missing_shards.len().saturating_sub(SHOWN);
    if more > 0 {
        rows.push([format!("{more} more shards"), "no folder".into(), String::new()]);
    }
    match (&mut *rows, &*found.datasets) {
        // The other shards are elsewhere.
        ([[_, _, text]], [DatasetStatus { shard: Some(shard), .. }]) => *text = format!("shard {shard}: {text}"),
        ([_], _) => {}
        _ => rows.push(["all".into(), String::new(), text_of(&found.total)]),
    }
    rows
}

fn row(dataset: &DatasetStatus) -> [String; 3] {
    let state = match dataset {
        DatasetStatus { running: true, .. } => "running",
        DatasetStatus { finished: true, .. } => "finished",
        _ => "stopped",
    };
    [dataset.dataset.display().to_string(), state.to_owned(), text_of(&dataset.progress)]
}

fn text_of(progress: &Progress) -> String {
    let mut text = format!("{} of {} done", progress.done, count(progress.scenes, "scene"));
    for (number, what) in [(progress.failed, "failed"), (progress.missing, "missing")] {
        if number > 0 {
            text += &format!(", {number} {what}");
        }
    }
    text += &format!(", {}", count(u32::try_from(progress.images).unwrap_or(u32::MAX), "image"));
    if let Some(pace) = progress.scenes_per_hour {
        text += &format!(", {pace:.0} scenes/h");
    }
    if let Some(left) = progress.left_s.and_then(|left| Duration::try_from_secs_f64(left).ok()) {
        text += &format!(", {} left", clock(left));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finished_shard_alone_is_done() {
        let progress = Progress { scenes: 8, done: 8, images: 40, ..Progress::default() };
        let one = DatasetStatus {
            dataset: "mine.shards/1-of-3".into(),
            shard: Some("1/3".into()),
            running: false,
            finished: true,
            progress,
            faults: Vec::new(),
        };
        let mut found = Status { datasets: vec![one.clone()], missing_shards: Vec::new(), total: progress };
        assert_eq!(rows(&found), [["mine.shards/1-of-3", "finished", "shard 1/3: 8 of 8 scenes done, 40 images"]]);
        assert!(is_whole(&found));
        found.missing_shards = vec!["0/3".into(), "2/3".into()];
        found.total = Progress { scenes: 24, missing: 16, ..progress };
        let rows = rows(&found);
        assert_eq!((rows[0][2].as_str(), rows[1][0].as_str()), ("8 of 8 scenes done, 40 images", "shard 0/3"));
        assert!(rows.len() == 4 && rows[3][0] == "all" && !is_whole(&found));
    }
}
