//! Checks, dataset formats and verbs with state, which a program adds at run time.

use std::path::Path;
use std::sync::Arc;
use syntable_cli::clap::{ArgMatches, Command};
use syntable_cli::{CliVerb, Console, Exit, Program};
use syntable_model::check::{LabelCheck, LabelFault};
use syntable_model::prelude::*;
use syntable_model::product::standard::VISIBLE_MASK;
use syntable_model::reader::{DatasetFormat, Opened, Source};
use syntable_model::registry::Registry;

/// Reports objects that cover fewer pixels as faults.
struct LeastPixels(u32);

impl LabelCheck for LeastPixels {
    fn name(&self) -> &'static str {
        "least_pixels"
    }
    fn doc(&self) -> &str {
        "Every object has as many visible pixels as the program demands."
    }
    fn reads(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK]
    }
    fn faults(&self, products: &Products) -> Result<Vec<LabelFault>> {
        let small = products.get(VISIBLE_MASK)?.iter().filter(|(_, mask)| (1..self.0).contains(&mask.area()));
        let fault = |(id, mask): (InstanceId, &Mask)| {
            LabelFault::of(id, format!("it has {} pixels, fewer than {}", mask.area(), self.0))
        };
        Ok(small.map(fault).collect())
    }
}

/// A format with a custom name, for files that contain the path of a dataset.
struct Pointer {
    extension: String,
    target: Arc<dyn DatasetFormat>,
}

impl DatasetFormat for Pointer {
    fn name(&self) -> &'static str {
        "pointer"
    }
    fn doc(&self) -> &str {
        "A text file with the path of a dataset."
    }
    fn looks_like(&self, path: &Path) -> bool {
        path.is_file() && path.extension().is_some_and(|extension| extension == self.extension.as_str())
    }
    fn read(&self, source: &Source) -> Result<Opened> {
        let text = std::fs::read_to_string(&source.path).map_err(|error| Error::io(&source.path, &error))?;
        self.target.read(&source.at(Path::new(text.trim())))
    }
    fn owner(&self) -> &str {
        "outside"
    }
}

/// Prints the settings with which the program was started.
struct Settings(Vec<String>);

impl CliVerb for Settings {
    fn command(&self) -> Command {
        Command::new("settings").about("Print the settings of this program")
    }
    fn run(&self, console: &Console, _: &Registry, _: &ArgMatches) -> Result<(), Exit> {
        console.print(&format!("{}\n", self.0.join("\n")))
    }
    fn owner(&self) -> &str {
        "outside"
    }
}

/// The program with all linked crates and with these additions.
///
/// # Errors
/// If two crates register the same name.
pub fn program() -> Result<Program, String> {
    let least: u32 = std::env::var("LEAST_PIXELS").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    let registry = Registry::linked()?;
    let target = registry.formats().iter().find(|format| format.name() == "box_table").cloned();
    let target = target.ok_or("no crate reads box_table")?;
    let registry = registry
        .with_checks([Arc::new(LeastPixels(least)) as Arc<dyn LabelCheck>])?
        .with_formats([Arc::new(Pointer { extension: "pointer".into(), target }) as Arc<dyn DatasetFormat>])?;
    let settings = vec![format!("least_pixels = {least}")];
    Ok(Program::linked()?.with_registry(registry).with_verb(Arc::new(Settings(settings))))
}
