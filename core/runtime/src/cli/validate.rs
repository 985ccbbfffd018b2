//! `syntable validate`.

use super::{Console, Exit, Message};
use crate::run::progress::count;
use crate::validate::{Validated, validate as validate_dataset};
use crate::workers;
use clap::Args;
use std::path::PathBuf;
use syntable_model::error::Error;
use syntable_model::reader;

/// Number of faults that are listed for people.
const SHOWN: usize = 30;

#[derive(Args)]
pub(super) struct ValidateArgs {
    /// Folder of the dataset, or its annotation file where there are several.
    dataset: PathBuf,
    /// Its format (see `syntable list formats`); the one that it looks like if left out.
    #[arg(long)]
    format: Option<String>,
    #[arg(long, help = super::TRUST_PATHS)]
    trust_paths: bool,
    /// Print all that was found as one JSON object.
    #[arg(long)]
    json: bool,
}

pub(super) fn validate(console: &Console, args: &ValidateArgs) -> Result<(), Exit> {
    let named = reader::Source::new(&args.dataset).trusting(args.trust_paths);
    let (format, found_at) = reader::find(&named, args.format.as_deref()).map_err(Exit::stopped)?;
    let found = match (format.open)(&found_at) {
        Ok(dataset) => validate_dataset(&*dataset, workers::available()).map_err(Exit::stopped)?,
        Err(error) if error.is_transient() => return Err(Exit::stopped(error)),
        // A dataset that cannot be opened is one with a fault.
        Err(error) => Validated::unreadable(found_at.path.display().to_string(), &error),
    };
    if args.json {
        let mut text = serde_json::to_string_pretty(&found).expect("plain data");
        text.push('\n');
        console.print(&text)?;
    } else {
        let width = found.checks.iter().map(|it| it.check.len()).max().unwrap_or(0);
        let mut out = format!("{:width$}  images  faults\n", "check");
        for it in &found.checks {
            let images = it.images.map_or_else(|| "-".to_owned(), |images| images.to_string());
            out += &format!("{:width$}  {images:>6}  {:>6}\n", it.check, it.faults);
        }
        for fault in found.some_of_each(SHOWN) {
            out += &format!("\n{}: {}\n  {}\n", fault.check, fault.place, fault.message);
        }
        if found.faults.len() > SHOWN {
            out += &format!("\nand {} more; --json lists all\n", found.faults.len() - SHOWN);
        }
        out += &format!(
            "\n{}, read as {}: {}\n",
            count(found.images, "image"),
            format.name,
            match found.faults.len() {
                0 => "no fault".to_owned(),
                faults => count(faults as u32, "fault"),
            }
        );
        console.print(&out)?;
    }
    if found.is_sound() {
        return Ok(());
    }
    let error = Error::new(format!("{} found", count(found.faults.len() as u32, "fault"))).in_file(&args.dataset);
    Err(Exit { code: 3, messages: vec![Message::Error(error)] })
}
