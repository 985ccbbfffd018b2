//! Output of results and messages.

use crate::arguments::RecipeArgs;
use crate::exit::Exit;
use crate::progress::{Human, JsonLines};
use clap::ValueEnum;
use std::ffi::OsString;
use std::io::{IsTerminal, Write};
use std::path::Path;
use std::sync::Arc;
use syntable_model::registry::Registry;
use syntable_recipe::message::Message;
use syntable_recipe::{Diagnostic, Recipe, Report};
use syntable_runtime::run::progress::Reporter;

/// Form of messages on standard error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogFormat {
    Human,
    Json,
}

/// Output of results and messages. Nothing else prints.
pub struct Console {
    reporter: Arc<dyn Reporter>,
    format: LogFormat,
    /// The program as the user called it.
    program: String,
}

impl Console {
    pub(crate) fn new(format: LogFormat) -> Self {
        let reporter: Arc<dyn Reporter> = match format {
            LogFormat::Json => Arc::<JsonLines>::default(),
            LogFormat::Human => Arc::new(Human::new(std::io::stderr().is_terminal())),
        };
        Self { reporter, format, program: "syntable".to_owned() }
    }

    /// The same, for messages that name commands. A program that is not on the path of the shell has a path as its name.
    pub(crate) fn called(self, program: Option<&OsString>) -> Self {
        let path = program.map(Path::new).filter(|path| path.components().count() > 1);
        Self { program: path.map_or(self.program, |path| path.display().to_string()), ..self }
    }

    /// Shows the events of a run.
    pub fn reporter(&self) -> &dyn Reporter {
        &*self.reporter
    }

    /// The same for another thread.
    pub(crate) fn shared_reporter(&self) -> Arc<dyn Reporter> {
        Arc::clone(&self.reporter)
    }

    /// Number of columns of the terminal; `None` if results do not go to a terminal.
    pub fn width(&self) -> Option<usize> {
        terminal_size::terminal_size_of(std::io::stdout()).map(|(width, _)| usize::from(width.0).max(40))
    }

    /// Prints a result. A closed pipe is not an error.
    pub fn print(&self, text: &str) -> Result<(), Exit> {
        let mut out = std::io::stdout();
        match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
            Err(error) => Exit::if_not_printed(&error),
            Ok(()) => Ok(()),
        }
    }

    /// Prints the path of a dataset for people. Programs read it from the last event.
    pub(crate) fn print_place(&self, place: &Path) -> Result<(), Exit> {
        match self.format {
            LogFormat::Human => self.print(&format!("{}\n", place.display())),
            LogFormat::Json => Ok(()),
        }
    }

    /// Names the next steps, for people: verbs of the program with their arguments, each with what it does.
    pub(crate) fn suggest(&self, steps: &[(String, &str)]) {
        let steps: Vec<_> = steps.iter().map(|(step, what)| (format!("{} {step}", self.program), what)).collect();
        let width = steps.iter().map(|(step, _)| step.chars().count()).max().unwrap_or(0);
        for ((step, what), start) in steps.iter().zip(std::iter::once("next:").chain(std::iter::repeat("     "))) {
            if self.format == LogFormat::Human {
                let _ = writeln!(std::io::stderr(), "{start} {step:width$}   {what}");
            }
        }
    }

    /// Prints a message: a diagnostic with the line underlined, or one JSON object.
    pub fn say(&self, message: &Message) {
        self.reporter.message(message);
    }

    /// Loads and plans a recipe with its changes. Prints warnings, and returns errors.
    pub(crate) fn load(&self, registry: &Registry, args: &RecipeArgs) -> Result<Recipe, Exit> {
        let (source, overrides) = args.read()?;
        self.loaded(syntable_recipe::load(registry, source, &overrides))
    }

    /// Like [`load`](Self::load), but replaces placeholder kinds by kinds that this machine supports.
    pub(crate) fn load_for_run(&self, registry: &Registry, args: &RecipeArgs) -> Result<Recipe, Exit> {
        let (source, overrides) = args.read()?;
        self.loaded(syntable_recipe::load(registry, source, &overrides.for_run()))
    }

    /// Prints the warnings of a loaded recipe, or returns the errors of one that cannot run.
    pub(crate) fn loaded(&self, loaded: Result<(Recipe, Vec<Diagnostic>), Report>) -> Result<Recipe, Exit> {
        match loaded {
            Ok((recipe, warnings)) => {
                warnings.into_iter().for_each(|warning| self.say(&Message::Diagnostic(warning)));
                Ok(recipe)
            }
            Err(report) => {
                let messages = match self.format {
                    LogFormat::Human => report.messages(),
                    // Each line is one error. Programs need no line with their number.
                    LogFormat::Json => report.mistakes().collect(),
                };
                // A store of assets that does not answer is no mistake of the recipe.
                let is_mistake = report.iter().any(Diagnostic::is_error)
                    || report.other.as_ref().is_none_or(|error| !error.is_transient());
                Err(Exit { code: if is_mistake { 2 } else { 1 }, messages })
            }
        }
    }
}
