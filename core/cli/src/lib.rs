//! The command line of SynTable. Only this crate prints. Every verb parses arguments and calls a function of the
//! library.

mod flags;
mod outputs;
mod progress;
mod signals;
mod verb;
mod verbs;

pub use clap;
pub use outputs::check_outputs;
pub use signals::{ended, on_signals};
pub use syntable_model::inventory;
pub use syntable_recipe::message::Message;
pub use verb::{CliVerb, Topic, Verb};
pub use verbs::list::products;

use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};
use progress::{Human, JsonLines};
use std::collections::BTreeMap;
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use syntable_recipe::{Diagnostic, Overrides, Recipe, RecipeRequest, Report, Source};
use syntable_runtime::left_out::LeftOutReport;
use syntable_runtime::run::progress::Reporter;
use verbs::{check, convert, doctor, list, merge, new, run, validate, verify};

/// Generates synthetic datasets for unseen-object amodal instance segmentation.
#[derive(Parser)]
#[command(
    name = "syntable",
    version,
    after_help = "Examples:
  syntable run --out data                        a small dataset from embedded objects
  syntable run recipe.toml --out data            a dataset from your own recipe
  syntable run recipe.toml --out data            the same command: resumes where it stopped
  syntable check recipe.toml                     all mistakes in a recipe
  syntable list products                         all labels and images that stages provide

Exit codes:
  0  done
  1  stopped; finished work is kept, and the same command continues
  2  wrong recipe, option, folder, asset or output file; the same command fails again
  3  done, but incomplete; standard error lists failed scenes, unreadable images, and parts of labels that a format cannot store. verify: a file is missing or damaged. validate: labels are wrong
  130, 143  stopped by SIGINT or SIGTERM; finished work is kept, and the same command continues.
            view, preview --watch and --serve: 0, since a signal is the usual end"
)]
struct Cli {
    #[command(subcommand)]
    verb: BuiltIn,
    /// Log format on standard error: human-readable, or one JSON object per line.
    #[arg(long, global = true, value_enum, default_value_t = LogFormat::Human)]
    log_format: LogFormat,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum LogFormat {
    Human,
    Json,
}

#[derive(Subcommand)]
enum BuiltIn {
    /// Make the dataset of a recipe, or continue it.
    #[command(after_help = "Examples:
  syntable run --out data                              builtin:quickstart
  syntable run builtin:window-room --out data          another built-in recipe
  syntable run recipe.toml --out data --scenes 0..10   its first ten scenes
  syntable run recipe.toml --out data --set render.samples_per_pixel=16 --seed 3
  syntable run data/recipe.toml --out again            the same dataset again")]
    Run(run::RunArgs),
    /// Compare every file of a dataset with its journal: list missing, damaged and foreign files.
    #[command(after_help = "Example:
  syntable verify data                        then: syntable run recipe.toml --out data --repair")]
    Verify(verify::VerifyArgs),
    /// Merge separately made parts of a dataset into one, as if one run had made it.
    #[command(after_help = "Example:
  syntable run recipe.toml --out part-0 --scenes 0..100
  syntable run recipe.toml --out part-1 --scenes 100..200     on another machine
  syntable merge data part-0 part-1")]
    Merge(merge::MergeArgs),
    /// Check the labels of a dataset in any readable format: masks, rates, boxes, order, depth, poses, files.
    #[command(after_help = "Examples:
  syntable validate data                      a table of checks; exit code 3 if a check fails
  syntable validate release --json            all results, for programs")]
    Validate(validate::ValidateArgs),
    /// Write a dataset in other formats.
    #[command(after_help = "Examples:
  syntable convert data --to coco --out coco
  syntable convert data --to coco,npz --out both --set 'coco.masks=\"visible\"'")]
    Convert(convert::ConvertArgs),
    /// Check a recipe without running it, or inspect one asset.
    #[command(after_help = "Examples:
  syntable check recipe.toml
  syntable check --asset models/mug/model.obj")]
    Check(check::CheckArgs),
    /// Show the products that a recipe computes, their writers, and their cost.
    #[command(after_help = "Example:
  syntable plan recipe.toml --set write.png.include='[\"rgb\", \"depth\"]'")]
    Plan(RecipeArgs),
    /// List the kinds of stages, the options of a kind, or the products, recipes and file formats of this binary.
    #[command(after_help = "Examples:
  syntable list              all kinds
  syntable list lights       the kinds of one slot
  syntable list products     all products
  syntable list drop_box     the options of a kind: types, limits, defaults
  syntable list lights.sun   the same, if several slots have a kind with this name
  syntable list recipes      the built-in recipes
  syntable list formats      all readable mesh and image formats")]
    List(list::ListArgs),
    /// Print the JSON Schema of recipes, with the kinds of all linked plugins.
    #[command(after_help = "Example:
  syntable schema > recipe.schema.json     first line of a recipe: #:schema ./recipe.schema.json")]
    Schema,
    /// Create a recipe or a plugin.
    New(new::NewArgs),
    /// Show threads, memory, instruction sets and cache of this machine, and the linked plugins.
    Doctor,
    /// Print a completion script for a shell.
    #[command(after_help = "Example:
  syntable completions bash > ~/.local/share/bash-completion/completions/syntable")]
    Completions {
        /// The shell.
        shell: clap_complete::Shell,
    },
}

/// A recipe and changes to it, shared by all verbs that take one: [`Args::augment_args`] adds them to a command.
#[derive(Debug, Clone, Args)]
pub struct RecipeArgs {
    /// Recipe file, or `builtin:NAME` for a built-in recipe (see `syntable list recipes`). Default:
    /// `builtin:quickstart`.
    pub recipe: Option<PathBuf>,
    /// Set a key: `a.b=value`, `place[2].count=5`. The value is TOML; a bare word is text.
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Seed of all random numbers: short for `--set dataset.seed=N`.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Views per scene: short for `--set dataset.views_per_scene=N`.
    #[arg(long)]
    pub views: Option<u32>,
}

/// End of a verb with an exit code other than 0.
pub struct Exit {
    /// The exit code of the process.
    pub code: u8,
    /// Messages to print.
    pub messages: Vec<Message>,
}

impl Exit {
    /// The recipe, an option or an asset is wrong, and the verb made nothing.
    pub fn wrong(error: Error) -> Self {
        Self { code: 2, messages: vec![Message::Error(error)] }
    }

    /// Work stopped early, and finished work is kept. A permanent error is an error of the request, as in
    /// [`wrong`](Self::wrong).
    pub fn stopped(error: Error) -> Self {
        let code = if error.is_permanent() { 2 } else { 1 };
        Self { code, messages: vec![Message::Error(error)] }
    }

    /// Exit code 1 for a result that cannot be printed. A closed pipe is not an error.
    fn if_not_printed(error: &std::io::Error) -> Result<(), Self> {
        match error.kind() {
            std::io::ErrorKind::BrokenPipe => Ok(()),
            _ => Err(Self::stopped(Error::io("standard output", error))),
        }
    }

    /// Exit code 3 with the data that a verb omitted from its result. `file` and `help` tell the reader where to look.
    ///
    /// # Errors
    /// If the verb omitted anything.
    pub fn if_left_out(left_out: LeftOutReport, file: &Path, help: &str) -> Result<(), Self> {
        match left_out.messages(file, help) {
            messages if messages.is_empty() => Ok(()),
            messages => Err(Self { code: 3, messages }),
        }
    }
}

/// Help of `--trust-paths`, a flag of all verbs that read datasets.
pub const TRUST_PATHS: &str =
    "Also read files outside the dataset's folder if its paths or links lead there. Only for datasets that you trust";

/// The requested number of threads, or else the number of cores.
pub fn threads(asked: Option<u16>) -> usize {
    asked.map_or_else(syntable_runtime::workers::available, usize::from)
}

/// Parses a number from 1 on, or `all`.
pub fn amount(text: &str) -> std::result::Result<usize, String> {
    match text {
        "all" => Ok(usize::MAX),
        _ => text.parse().ok().filter(|number| *number > 0).ok_or_else(|| "a number from 1 on, or `all`".to_owned()),
    }
}

/// Runs the command line of this process with all linked plugins.
///
/// The whole `main.rs` of a binary with plugins of its own:
///
/// ```ignore
/// use my_annotators as _; // naming the crate is what links it
///
/// fn main() -> std::process::ExitCode {
///     syntable_program::main()
/// }
/// ```
pub fn main() -> ExitCode {
    match Program::linked() {
        Ok(program) => program.run(),
        Err(clash) => refused(clash),
    }
}

/// A program with a command line: a registry, and verbs in addition to the verbs of this crate.
pub struct Program {
    registry: Registry,
    verbs: Vec<Arc<dyn CliVerb>>,
}

impl Program {
    /// Everything that the linked crates register.
    ///
    /// # Errors
    /// If two crates register one name.
    pub fn linked() -> Result<Self, String> {
        Ok(Self { registry: Registry::linked()?, verbs: verb::linked() })
    }

    /// The program with another registry, such as the linked one with kinds that have state of the program.
    pub fn with_registry(self, registry: Registry) -> Self {
        Self { registry, ..self }
    }

    /// The program with another verb.
    pub fn with_verb(mut self, verb: Arc<dyn CliVerb>) -> Self {
        self.verbs.push(verb);
        self
    }

    /// Runs the command line of this process.
    pub fn run(self) -> ExitCode {
        let (command, verbs) = match command(&self.verbs) {
            Ok(found) => found,
            Err(clash) => return refused(clash),
        };
        let matches = match command.try_get_matches() {
            Ok(matches) => matches,
            // Help and version are results, too.
            Err(page) if !page.use_stderr() => return ended_with(&Console::new(LogFormat::Human), page_printed(&page)),
            Err(error) => error.exit(),
        };
        let format = matches.get_one::<LogFormat>("log_format").copied().unwrap_or(LogFormat::Human);
        let console = Console::new(format);
        let added = matches.subcommand().and_then(|(name, arguments)| Some((verbs.get(name)?, arguments)));
        let done = match added {
            Some((verb, arguments)) => verb.run(&console, &self.registry, arguments),
            None => match Cli::from_arg_matches(&matches) {
                Ok(cli) => console.verb(cli.verb, &self.registry),
                Err(error) => error.exit(),
            },
        };
        ended_with(&console, done)
    }
}

/// Prints the messages of a finished verb, and returns its exit code.
fn ended_with(console: &Console, done: Result<(), Exit>) -> ExitCode {
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(Exit { code, messages }) => {
            messages.iter().for_each(|message| console.say(message));
            ExitCode::from(code)
        }
    }
}

/// Ends a program whose crates clash.
fn refused(clash: String) -> ExitCode {
    Console::new(LogFormat::Human).say(&Message::Error(Error::new(clash)));
    ExitCode::from(2)
}

/// Prints a page of help, or the version.
fn page_printed(page: &clap::Error) -> Result<(), Exit> {
    let printed = page.print().and_then(|()| std::io::stdout().flush());
    printed.or_else(|error| Exit::if_not_printed(&error))
}

/// Verbs by name.
type Verbs = BTreeMap<String, Arc<dyn CliVerb>>;

/// The whole command line: the verbs of this crate, and the given ones.
fn command(verbs: &[Arc<dyn CliVerb>]) -> Result<(clap::Command, Verbs), String> {
    let mut command = Cli::command();
    command.build();
    let verbs = verb::by_name(verbs, &command)?;
    let command = verbs.values().fold(Cli::command(), |command, verb| command.subcommand(verb.command()));
    Ok((command, verbs))
}

/// The command line with the verbs of the linked crates, or without them if they clash.
fn whole() -> clap::Command {
    command(&verb::linked()).map_or_else(|_| Cli::command(), |(command, _)| command)
}

/// Help of the program as text, verb by verb, for the reference page.
pub fn help_pages() -> Vec<(String, String)> {
    let mut root = whole().term_width(100);
    root.build();
    let mut pages = vec![("syntable".to_owned(), root.render_long_help().to_string())];
    for verb in root.get_subcommands_mut().filter(|verb| verb.get_name() != "help") {
        pages.push((format!("syntable {}", verb.get_name()), verb.render_long_help().to_string()));
    }
    pages
}

/// Parses a command line, with the program's name first. The error is the message of the parser.
pub fn understands(words: &[String]) -> Result<(), String> {
    whole().try_get_matches_from(words).map(drop).map_err(|error| error.to_string())
}

/// Output of results and messages. Nothing else prints.
pub struct Console {
    reporter: Box<dyn Reporter>,
    format: LogFormat,
}

impl Console {
    fn new(format: LogFormat) -> Self {
        let reporter: Box<dyn Reporter> = match format {
            LogFormat::Json => Box::<JsonLines>::default(),
            LogFormat::Human => Box::new(Human::new(std::io::stderr().is_terminal())),
        };
        Self { reporter, format }
    }

    /// Shows the events of a run.
    pub fn reporter(&self) -> &dyn Reporter {
        &*self.reporter
    }

    fn verb(&self, verb: BuiltIn, registry: &Registry) -> Result<(), Exit> {
        match verb {
            BuiltIn::Run(args) => run::run(self, registry, &args),
            BuiltIn::Verify(args) => verify::verify(self, &args),
            BuiltIn::Merge(args) => merge::merge(self, registry, &args),
            BuiltIn::Validate(args) => validate::validate(self, registry, &args),
            BuiltIn::Convert(args) => convert::convert(self, registry, args),
            BuiltIn::Check(args) => check::check(self, registry, &args),
            BuiltIn::Plan(args) => run::plan(self, registry, &args),
            BuiltIn::List(args) => list::list(self, registry, &args),
            BuiltIn::Schema => self.print(&syntable_recipe::schema_text(registry)),
            BuiltIn::New(args) => new::new(self, registry, &args),
            BuiltIn::Doctor => doctor::doctor(self, registry),
            BuiltIn::Completions { shell } => {
                let mut script = Vec::new();
                clap_complete::generate(shell, &mut whole(), "syntable", &mut script);
                self.print(&String::from_utf8_lossy(&script))
            }
        }
    }

    /// Number of columns of the terminal; `None` if results do not go to a terminal.
    pub fn width(&self) -> Option<usize> {
        terminal_size::terminal_size_of(std::io::stdout()).map(|(width, _)| usize::from(width.0).max(40))
    }

    /// Prints a result. A closed pipe is not an error.
    pub fn print(&self, text: &str) -> Result<(), Exit> {
        match std::io::stdout().write_all(text.as_bytes()) {
            Err(error) => Exit::if_not_printed(&error),
            Ok(()) => Ok(()),
        }
    }

    /// Prints a message: a diagnostic with the line underlined, or one JSON object.
    pub fn say(&self, message: &Message) {
        self.reporter.message(message);
    }

    /// Loads and plans a recipe with its changes. Prints warnings, and returns errors.
    fn load(&self, registry: &Registry, args: &RecipeArgs) -> Result<Recipe, Exit> {
        let (source, overrides) = args.read()?;
        self.loaded(syntable_recipe::load(registry, source, &overrides))
    }

    /// Like [`load`](Self::load), but replaces placeholder kinds by kinds that this machine supports.
    fn load_for_run(&self, registry: &Registry, args: &RecipeArgs) -> Result<Recipe, Exit> {
        let (source, overrides) = args.read()?;
        self.loaded(syntable_recipe::load(registry, source, &overrides.for_run()))
    }

    /// Prints the warnings of a loaded recipe, or returns the errors of one that cannot run.
    fn loaded(&self, loaded: Result<(Recipe, Vec<Diagnostic>), Report>) -> Result<Recipe, Exit> {
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
                Err(Exit { code: 2, messages })
            }
        }
    }
}

impl RecipeArgs {
    /// The recipe and its changes as an argument of library functions.
    pub fn request(&self) -> RecipeRequest {
        let Self { recipe, set, seed, views } = self.clone();
        RecipeRequest { recipe, set, seed, views }
    }

    /// The text of the recipe, and its changes.
    pub fn read(&self) -> Result<(Source, Overrides<'static>), Exit> {
        self.request().read().map_err(Exit::wrong)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_verb_has_a_help_page() {
        let pages = help_pages();
        for verb in [
            "run",
            "verify",
            "merge",
            "validate",
            "convert",
            "check",
            "plan",
            "list",
            "schema",
            "new",
            "doctor",
            "completions",
        ] {
            assert!(pages.iter().any(|(name, _)| name == &format!("syntable {verb}")), "{verb}");
        }
    }
}
