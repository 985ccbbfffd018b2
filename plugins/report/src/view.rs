//! `syntable view`: the pages of a dataset, made when a browser asks for them.

use crate::report::{Counted, Report, Shown};
use crate::serve::{Changes, Request, Response, Server, content_type};
use crate::stats::{self, Options};
use std::path::{Path, PathBuf};
use std::thread;
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use syntable_runtime::clap::{Arg, ArgMatches, Command, value_parser};
use syntable_runtime::cli::{Console, Exit, Verb};
use syntable_runtime::run::progress::{Event, Reporter};
use syntable_runtime::run::stop::Stop;
use syntable_runtime::workers::{self, Pool};

syntable_runtime::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

fn command() -> Command {
    let flag = |name: &'static str| Arg::new(name).long(name);
    Command::new("view")
        .about("Show a dataset in the browser: the pages of `syntable report`, made when they are asked for")
        .arg(
            Arg::new("dataset")
                .value_name("DATASET")
                .required(true)
                .value_parser(value_parser!(PathBuf))
                .help("Folder of a dataset of any format that can be read, or its annotation file"),
        )
        .arg(
            flag("port")
                .value_name("PORT")
                .value_parser(value_parser!(u16))
                .default_value("0")
                .help("Port of the loopback address; 0 for any free one"),
        )
        .arg(
            flag("format")
                .value_name("FORMAT")
                .help("Format of the dataset (see `syntable list formats`); the one that it looks like if left out"),
        )
        .arg(
            flag("threads")
                .value_name("N")
                .value_parser(value_parser!(u16).range(1..=1024))
                .help("Threads that count the statistics; all cores if left out"),
        )
        .after_help(
            "Nothing is written, and nobody else can connect. Ctrl-C ends it.

Examples:
  syntable view data
  syntable view data --port 8000",
        )
}

fn run(console: &Console, _: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let Some(dataset) = arguments.get_one::<PathBuf>("dataset") else { return Ok(()) };
    let format = arguments.get_one::<String>("format").map(String::as_str);
    let threads = arguments.get_one::<u16>("threads").map_or_else(workers::available, |threads| usize::from(*threads));
    let port = arguments.get_one::<u16>("port").copied().unwrap_or(0);
    let all = |of: &dyn syntable_model::reader::DatasetReader| Shown {
        images: (0..of.images().len()).collect(),
        scenes: None,
    };
    let report = Report::open(dataset, format, all).map_err(Exit::stopped)?;
    let server = Server::bind(port).map_err(Exit::stopped)?;
    let stop =
        Stop::on_signals().map_err(|error| Exit::stopped(Error::new(format!("signals cannot be handled: {error}"))))?;
    let pool = Pool::new(threads).map_err(Exit::stopped)?;
    console.print(&format!("{}\n", server.url()))?;
    thread::scope(|scope| {
        // What is left of the count when the server stops is not waited for: the process ends.
        let count = || {
            let told = Told(&report);
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
