//! The pages of a dataset, created when a browser requests them.

use crate::report::scored::ReportScores;
use crate::report::{DatasetReport, ReportSelection, StatisticsProgress};
use crate::serve::{Changes, Request, Response, Server, content_type};
use crate::stats::{self, StatisticsOptions};
use std::path::Path;
use std::thread;
use syntable_model::context::Workers;
use syntable_model::error::Result;
use syntable_model::reader::{OpenDataset, Source};
use syntable_model::registry::Registry;
use syntable_runtime::images::ImageWork;
use syntable_runtime::run::progress::{Event, Reporter};
use syntable_runtime::run::stop::Stop;

/// A dataset whose pages a local server shows. Writes no files.
pub struct Viewer {
    report: DatasetReport,
    server: Server,
}

impl Viewer {
    /// Opens a dataset, with scores of predictions if a file is given, and listens on a port of the loopback address; 0
    /// selects any free port.
    ///
    /// # Errors
    /// If the dataset or the file cannot be read, or the port is unavailable.
    pub fn open(
        registry: &Registry,
        source: &Source,
        format: Option<&str>,
        scores: Option<&Path>,
        port: u16,
    ) -> Result<Self> {
        let all = |of: &OpenDataset| ReportSelection { images: (0..of.images.len()).collect(), scenes: None };
        let mut report = DatasetReport::open(registry, source, format, all)?;
        if let Some(file) = scores {
            let scored = ReportScores::open(file, report.dataset())?;
            report = report.with_scores(scored);
        }
        Ok(Self { report, server: Server::bind(port)? })
    }

    /// Address of the first page. It gives access to all pages.
    pub fn url(&self) -> String {
        self.server.url()
    }

    /// Answers browsers until the work must stop, and counts the statistics meanwhile.
    pub fn run(&self, workers: &(dyn Workers + Sync), stop: &Stop) {
        thread::scope(|scope| {
            scope.spawn(|| self.count(workers, stop));
            self.server.run(stop, &Changes::default(), &|request| answer(&self.report, request));
        });
    }

    fn count(&self, workers: &dyn Workers, stop: &Stop) {
        let told = StatisticsReporter(&self.report);
        self.report.gather_licenses();
        let work = ImageWork { workers, reporter: &told, stop };
        let counted = match stats::of(self.report.dataset(), &StatisticsOptions::default(), &work) {
            Ok(statistics) => StatisticsProgress::Done(Box::new(statistics)),
            Err(error) => StatisticsProgress::Failed(error.in_file(self.report.path()).to_string()),
        };
        self.report.put_statistics(counted);
    }
}

/// Stores the progress of the statistics for the page that waits for them.
struct StatisticsReporter<'a>(&'a DatasetReport);

impl Reporter for StatisticsReporter<'_> {
    fn event(&self, event: &Event) {
        if let Event::Working { step } = event {
            self.0.put_statistics(StatisticsProgress::Working(step.clone()));
        }
    }
}

/// The file for a request.
pub fn answer(report: &DatasetReport, request: &Request) -> Response {
    let path = request.path.trim_start_matches('/');
    let path = if path.is_empty() { "index.html" } else { path };
    match report.file(path) {
        Ok(Some(bytes)) => Response::bytes(content_type(path.rsplit('.').next().unwrap_or_default()), bytes),
        Ok(None) => Response::missing(),
        Err(error) => Response::failed(500, format!("{error}\n")),
    }
}
