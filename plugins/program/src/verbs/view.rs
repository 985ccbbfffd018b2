//! `syntable view`.

use super::arguments;
use std::path::PathBuf;
use std::thread;
use syntable_cli::clap::{ArgMatches, Command};
use syntable_cli::{Console, Ends, Exit, Verb, on_signals};
use syntable_model::registry::Registry;
use syntable_report::view::Viewer;
use syntable_runtime::workers::Pool;

syntable_cli::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

fn command() -> Command {
    Command::new("view")
        .about("Show a dataset in the browser: the pages of `syntable report`, made on request")
        .arg(arguments::dataset())
        .arg(arguments::port())
        .arg(arguments::format())
        .arg(arguments::trust_paths())
        .arg(arguments::image_folder())
        .arg(arguments::scores())
        .arg(arguments::threads("Worker threads for the statistics. Default: all cores"))
        .after_help(
            "The command writes no files. The address contains a token that gives access to the pages: keep it secret. Ctrl-C ends the command.

Examples:
  syntable view data
  syntable view data --port 8000
  syntable view data --scores scores.json          with predictions",
        )
}

fn run(console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let Some(dataset) = arguments.get_one::<PathBuf>("dataset") else { return Ok(()) };
    let format = arguments.get_one::<String>("format").map(String::as_str);
    let port = arguments.get_one::<u16>("port").copied().unwrap_or(0);
    let scores = arguments.get_one::<PathBuf>("scores").map(PathBuf::as_path);
    let source = arguments::source(dataset, arguments)?;
    let viewer = Viewer::open(registry, &source, format, scores, port).map_err(Exit::stopped)?;
    let (stop, pool) =
        (on_signals(console, Ends::Service)?, Pool::new(arguments::threads_of(arguments)).map_err(Exit::stopped)?);
    console.print(&format!("{}\n", viewer.url()))?;
    let serving = stop.clone();
    // When the process ends, the remaining statistics and slow browsers do not matter.
    thread::spawn(move || viewer.run(&pool, &serving));
    stop.wait();
    Ok(())
}
