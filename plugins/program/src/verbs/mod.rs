//! The verbs of evaluation, statistics, reports and previews: arguments, and what is printed.

mod arguments;
mod eval;
mod preview;
mod report;
mod stats;
mod view;
