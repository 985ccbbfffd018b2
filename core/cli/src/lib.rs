//! The command line of SynTable. Only this crate prints. Every verb parses arguments and calls a function of the
//! library.

mod arguments;
mod console;
mod exit;
mod flags;
mod outputs;
mod progress;
mod shell;
mod signals;
mod verb;
mod verbs;

pub use arguments::{IMAGE_FOLDER, RecipeArgs, RecipeChanges, TRUST_PATHS, amount, threads};
pub use clap;
pub use console::Console;
pub use exit::Exit;
pub use flags::{with_flags, with_options};
pub use outputs::{OutputFile, check_outputs};
pub use signals::{Ends, ended, on_signals};
pub use syntable_model::inventory;
pub use syntable_recipe::message::Message;
pub use verb::{CliVerb, Topic, Verb};
pub use verbs::list::products;

use clap::error::{ContextKind, ContextValue};
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use console::LogFormat;
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::Write;
use std::process::ExitCode;
use std::sync::Arc;
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use verbs::{check, convert, doctor, list, merge, new, plan, run, status, validate, verify};

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
    /// Python file or module with stages, such as `my_stages.py`. Can be given several times.
    #[arg(long, global = true, hide = true, value_name = "FILE")]
    plugin: Vec<String>,
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
    /// Show how far datasets are: scenes that are done, failed or missing, pace, and time left. Exit code 3 until all is done.
    #[command(after_help = "Examples:
  syntable status data
  syntable status data/mine.shards --json     the shards of a job, for programs")]
    Status(status::StatusArgs),
    /// Merge separately made parts of a dataset into one, as if one run had made it.
    #[command(after_help = "Example:
  syntable run recipe.toml --out data --shard 0/2
  syntable run recipe.toml --out data --shard 1/2             on another machine
  syntable merge data data.shards")]
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
    #[command(after_help = "Examples:
  syntable plan recipe.toml --set write.png.include='[\"rgb\", \"depth\"]'
  syntable plan recipe.toml --time            how long all scenes take on this machine")]
    Plan(plan::PlanArgs),
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
        Err(clash) => refused(clash).into(),
    }
}

/// A program with a command line: a registry, and verbs in addition to the verbs of this crate.
pub struct Program {
    registry: Registry,
    verbs: Vec<Arc<dyn CliVerb>>,
    loads_plugins: bool,
}

impl Program {
    /// Everything that the linked crates register.
    ///
    /// # Errors
    /// If two crates register one name.
    pub fn linked() -> Result<Self, String> {
        Ok(Self { registry: Registry::linked()?, verbs: verb::linked(), loads_plugins: false })
    }

    /// The program with another registry, such as the linked one with kinds that have state of the program.
    pub fn with_registry(self, registry: Registry) -> Self {
        Self { registry, ..self }
    }

    /// The program whose caller loads the values of `--plugin` before it runs a command line. Other programs refuse the option.
    pub fn with_plugins(self) -> Self {
        Self { loads_plugins: true, ..self }
    }

    /// The program with another verb.
    pub fn with_verb(mut self, verb: Arc<dyn CliVerb>) -> Self {
        self.verbs.push(verb);
        self
    }

    /// Runs the command line of this process.
    pub fn run(self) -> ExitCode {
        self.run_with(std::env::args_os()).into()
    }

    /// Runs a command line, with the program's name first. Returns the exit code.
    pub fn run_with(self, arguments: impl IntoIterator<Item = OsString>) -> u8 {
        let arguments: Vec<OsString> = arguments.into_iter().collect();
        let (mut command, verbs) = match command(&self.verbs) {
            Ok(found) => found,
            Err(clash) => return refused(clash),
        };
        if self.loads_plugins {
            command = command.mut_arg(PLUGIN, |argument| argument.hide(false));
        }
        let matches = match command.try_get_matches_from_mut(&arguments) {
            Ok(matches) => matches,
            // Help and version are results, too.
            Err(page) if !page.use_stderr() => return ended_with(&Console::new(LogFormat::Human), page_printed(&page)),
            Err(error) => return not_understood(&with_verb(error)),
        };
        let format = matches.get_one::<LogFormat>("log_format").copied().unwrap_or(LogFormat::Human);
        let console = Console::new(format).called(arguments.first());
        if let Some(plugin) = plugins(&matches).first().filter(|_| !self.loads_plugins) {
            return ended_with(&console, Err(no_plugins(plugin)));
        }
        let added = matches.subcommand().and_then(|(name, arguments)| Some((verbs.get(name)?, arguments)));
        let done = match added {
            Some((verb, arguments)) => verb.run(&console, &self.registry, arguments),
            None => match Cli::from_arg_matches(&matches) {
                Ok(cli) => run_verb(&console, cli.verb, &self.registry, command),
                Err(error) => return not_understood(&error),
            },
        };
        ended_with(&console, done)
    }
}

/// The option that names stages in Python.
const PLUGIN: &str = "plugin";

/// The values of `--plugin`, before the verb or after it.
fn plugins(matches: &clap::ArgMatches) -> Vec<&String> {
    matches.get_many(PLUGIN).into_iter().flatten().collect()
}

/// The end of a program that has no Python.
fn no_plugins(plugin: &str) -> Exit {
    let error = Error::new(format!("`--plugin {plugin}`: this program has no Python to load it with"));
    Exit::wrong(
        error.help("use the `syntable` of the Python package, or write the stages in Rust: `syntable new plugin`"),
    )
}

/// Runs a verb of this crate. `command` is the whole command line.
fn run_verb(console: &Console, verb: BuiltIn, registry: &Registry, mut command: clap::Command) -> Result<(), Exit> {
    match verb {
        BuiltIn::Run(args) => run::run(console, registry, &args, &command),
        BuiltIn::Verify(args) => verify::verify(console, &args),
        BuiltIn::Status(args) => status::status(console, &args),
        BuiltIn::Merge(args) => merge::merge(console, registry, &args),
        BuiltIn::Validate(args) => validate::validate(console, registry, &args),
        BuiltIn::Convert(args) => convert::convert(console, registry, args),
        BuiltIn::Check(args) => check::check(console, registry, &args),
        BuiltIn::Plan(args) => plan::plan(console, registry, &args),
        BuiltIn::List(args) => list::list(console, registry, &args),
        BuiltIn::Schema => console.print(&syntable_recipe::schema_text(registry)),
        BuiltIn::New(args) => new::new(console, registry, &args, &command),
        BuiltIn::Doctor => doctor::doctor(console, registry),
        BuiltIn::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut command, "syntable", &mut script);
            console.print(&String::from_utf8_lossy(&script))
        }
    }
}

/// Prints the messages of a finished verb, and returns its exit code.
fn ended_with(console: &Console, done: Result<(), Exit>) -> u8 {
    match done {
        Ok(()) => 0,
        Err(Exit { code, messages }) => {
            messages.iter().for_each(|message| console.say(message));
            code
        }
    }
}

/// Prints the error of the parser, and returns the exit code.
fn not_understood(error: &clap::Error) -> u8 {
    // Without standard error, no reader is left.
    let _ = error.print();
    u8::try_from(error.exit_code()).unwrap_or(2)
}

/// Ends a program whose crates clash. Returns the exit code.
pub fn refused(clash: String) -> u8 {
    Console::new(LogFormat::Human).say(&Message::Error(Error::new(clash)));
    2
}

/// Words for a verb that users try, and the verb.
const WORDS: [(&str, &[&str]); 8] = [
    (
        "run",
        &["generate", "gen", "render", "make", "build", "create", "start", "simulate", "resume", "continue", "repair"],
    ),
    ("convert", &["export", "transform", "translate"]),
    ("merge", &["join", "combine", "concat"]),
    ("stats", &["statistics", "info", "describe", "inspect"]),
    ("eval", &["evaluate", "score", "metrics"]),
    ("view", &["show", "serve", "browse", "open", "visualize"]),
    ("check", &["lint", "test"]),
    ("new", &["init", "template"]),
];

/// An error of the parser that names the verb for an unknown word. The parser itself finds only misspelled verbs.
fn with_verb(mut error: clap::Error) -> clap::Error {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else { return error };
    let meant = WORDS.iter().find(|(_, words)| words.contains(&word.as_str()));
    if let Some((verb, _)) = meant {
        let tip = format!("did you mean `syntable {verb}`?");
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_valid() {
        Cli::command().debug_assert();
    }

    #[test]
    fn verbs_of_other_tools_are_understood() {
        for (verb, words) in WORDS {
            for word in words {
                let error = with_verb(Cli::command().try_get_matches_from(["syntable", word]).expect_err("unknown"));
                let said = error.to_string();
                assert!(said.contains(&format!("tip: did you mean `syntable {verb}`?")), "{said}");
            }
        }
        let error = with_verb(Cli::command().try_get_matches_from(["syntable", "xyzzy"]).expect_err("unknown"));
        assert!(!error.to_string().contains("did you mean"), "{error}");
    }

    #[test]
    fn a_program_without_python_refuses_plugins() {
        let program = Program { registry: Registry::default(), verbs: Vec::new(), loads_plugins: false };
        let words = ["syntable", "list", "recipes", "--plugin", "a.py"].map(OsString::from);
        let matches = Cli::command().try_get_matches_from(words.clone()).expect("the option is known");
        assert_eq!(plugins(&matches), ["a.py"]);
        assert_eq!(program.run_with(words), 2);
        let Exit { messages, .. } = no_plugins("a.py");
        let Some(Message::Error(error)) = messages.first() else { panic!("an error") };
        assert!(error.to_string().contains("`--plugin a.py`") && error.help_text().is_some(), "{error}");
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
