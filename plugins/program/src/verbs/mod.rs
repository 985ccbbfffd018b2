//! The verbs of evaluation, statistics, reports and previews: arguments and printed results.

mod arguments;
mod eval;
mod preview;
mod report;
mod stats;
mod view;
