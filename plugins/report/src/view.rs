//! `syntable view`: the pages of a dataset, made when a browser asks for them.

use crate::arguments;
use crate::report::scored::Scored;
use crate::report::{Counted, Report, Shown};
use crate::serve::{Changes, Request, Response, Server, content_type};
use crate::stats::{self, Options};
use std::path::{Path, PathBuf};
use std::thread;
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use syntable_runtime::clap::{ArgMatches, Command};
use syntable_runtime::cli::{Console, Exit, Verb};
use syntable_runtime::run::progress::{Event, Reporter};
use syntable_runtime::run::stop::Stop;
use syntable_runtime::workers::Pool;

syntable_runtime::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

fn command() -> Command {
    Command::new("view")
        .about("Show a dataset in the browser: the pages of `syntable report`, made when they are asked for")
        .arg(arguments::dataset())
        .arg(arguments::port())
        .arg(arguments::format())
        .arg(arguments::trust_paths())
        .arg(arguments::scores())
        .arg(arguments::threads("Threads that count the statistics; all cores if left out"))
        .after_help(
            "Nothing is written. The address has a token, without which nobody can read the pages: keep it to yourself. Ctrl-C ends it.

Examples:
  syntable view data
  syntable view data --port 8000
  syntable view data --scores scores.json          with predictions",
        )
}

fn run(console: &Console, _: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let Some(dataset) = arguments.get_one::<PathBuf>("dataset") else { return Ok(()) };
    let format = arguments.get_one::<String>("format").map(String::as_str);
    let port = arguments.get_one::<u16>("port").copied().unwrap_or(0);
    let all = |of: &dyn syntable_model::reader::DatasetReader| Shown {
        images: (0..of.images().len()).collect(),
        scenes: None,
    };
    let mut report = Report::open(&arguments::source(dataset, arguments), format, all).map_err(Exit::stopped)?;
    if let Some(file) = arguments.get_one::<PathBuf>("scores") {
        let scored = Scored::open(file, report.dataset()).map_err(Exit::stopped)?;
        report = report.with_scores(scored);
    }
    let server = Server::bind(port).map_err(Exit::stopped)?;
    let stop =
        Stop::on_signals().map_err(|error| Exit::stopped(Error::new(format!("signals cannot be handled: {error}"))))?;
    let pool = Pool::new(arguments::threads_of(arguments)).map_err(Exit::stopped)?;
    console.print(&format!("{}\n", server.url()))?;
    thread::scope(|scope| {
        // What is left of the count when the server stops is not waited for: the process ends.
        let count = || {
            let told = Told(&report);
            report.gather_licenses();
            let counted = match stats::of(report.dataset(), &Options::default(), (&pool, &told)) {
                Ok(statistics) => Counted::Done(Box::new(statistics)),
                Err(error) => Counted::Failed(error.in_file(Path::new(dataset)).to_string()),
            };
            report.put_statistics(counted);
        };
        scope.spawn(count);
        server.run(&stop, &Changes::default(), &|request| answer(&report, request));
        // Nor for a browser that takes no more of an answer.
        if stop.requested().is_some() {
            std::process::exit(0);
        }
    });
    Ok(())
}

/// Keeps how far the statistics are for the page that waits for them.
struct Told<'a>(&'a Report);

impl Reporter for Told<'_> {
    fn event(&self, event: &Event) {
        if let Event::Working { step } = event {
            self.0.put_statistics(Counted::Working(step.clone()));
        }
    }
}

/// The file that a request asks for.
pub fn answer(report: &Report, request: &Request) -> Response {
    let path = request.path.trim_start_matches('/');
    let path = if path.is_empty() { "index.html" } else { path };
    match report.file(path) {
        Ok(Some(bytes)) => Response::bytes(content_type(path.rsplit('.').next().unwrap_or_default()), bytes),
        Ok(None) => Response::missing(),
        Err(error) => Response::failed(500, format!("{error}\n")),
    }
}
