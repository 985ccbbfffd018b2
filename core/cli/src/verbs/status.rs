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
use syntable_runtime::run::{DatasetStatus, Progress};

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
        let mut rows: Vec<[String; 3]> = found.datasets.iter().map(row).collect();
        rows.extend(
            found.missing_shards.iter().map(|shard| [format!("shard {shard}"), "no folder".into(), String::new()]),
        );
        if rows.len() > 1 {
            rows.push(["all".into(), String::new(), text_of(&found.total)]);
        }
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default();
        let (first, second) = (width(0), width(1));
        let line = |[name, state, text]: &[String; 3]| {
            format!("{name:first$}  {state:second$}  {text}").trim_end().to_owned() + "\n"
        };
        console.print(&rows.iter().map(line).collect::<String>())?;
    }
    let mut messages = Vec::new();
    for DatasetStatus { dataset, faults, .. } in &found.datasets {
        messages.extend(faults.iter().map(|fault| {
            let help = "a run with --repair makes the scene of a damaged line again";
            Message::Error(Error::new(format!("the journal is damaged: {fault}")).in_file(dataset).help(help))
        }));
    }
    let is_whole = found.datasets.iter().all(|dataset| dataset.finished) && found.total.done == found.total.scenes;
    if is_whole && messages.is_empty() { Ok(()) } else { Err(Exit { code: 3, messages }) }
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
