//! Verbs that crates add to the command line, such as an evaluation or a conversion.

use crate::console::Console;
use crate::exit::Exit;
use clap::{ArgMatches, Command};
use std::collections::BTreeMap;
use std::sync::Arc;
use syntable_model::inventory;
use syntable_model::registry::Registry;

/// A verb of the command line. Crates register a [`Verb`]; a program can add one with state
/// ([`Program::with_verb`](crate::Program::with_verb)).
pub trait CliVerb: Send + Sync {
    /// Name, help, arguments and examples.
    fn command(&self) -> Command;
    /// Runs the verb. It passes results to [`Console::print`] and messages to [`Console::say`].
    ///
    /// # Errors
    /// Ends the program with the exit code of the error.
    fn run(&self, console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit>;
    /// The crate or program that provides the verb, for messages.
    fn owner(&self) -> &str;
}

/// A verb of a crate, without state. Registered with [`register_verb!`](crate::register_verb).
///
/// ```
/// use syntable_cli::{Console, Exit, Verb};
/// use syntable_cli::clap::{ArgMatches, Command};
/// use syntable_model::registry::Registry;
///
/// fn command() -> Command {
///     Command::new("kinds").about("Print the number of registered kinds")
/// }
///
/// fn run(console: &Console, registry: &Registry, _: &ArgMatches) -> Result<(), Exit> {
///     console.print(&format!("{}\n", registry.entries().len()))
/// }
///
/// syntable_cli::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });
/// # fn main() {}
/// ```
#[derive(Clone, Copy)]
pub struct Verb {
    /// Name, help, arguments and examples.
    pub command: fn() -> Command,
    /// Runs the verb. It passes results to [`Console::print`] and messages to [`Console::say`].
    pub run: fn(&Console, &Registry, &ArgMatches) -> Result<(), Exit>,
    /// Crate that registers it.
    pub crate_name: &'static str,
}

inventory::collect!(Verb);

impl CliVerb for Verb {
    fn command(&self) -> Command {
        (self.command)()
    }

    fn run(&self, console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
        (self.run)(console, registry, arguments)
    }

    fn owner(&self) -> &str {
        self.crate_name
    }
}

/// Registers verbs.
#[macro_export]
macro_rules! register_verb {
    ($($verb:expr),+ $(,)?) => {$(
        $crate::inventory::submit! { $verb }
    )+};
}

/// A list of `syntable list` that a crate adds, such as the metrics of an evaluation. Registered with
/// [`register_topic!`](crate::register_topic).
#[derive(Clone, Copy)]
pub struct Topic {
    /// Name of the list, as in `syntable list metrics`.
    pub name: &'static str,
    /// Rows of a table, headings first: name, crate, description.
    pub rows: fn() -> syntable_model::error::Result<Vec<[String; 3]>>,
}

inventory::collect!(Topic);

/// Registers topics of `syntable list`.
#[macro_export]
macro_rules! register_topic {
    ($($topic:expr),+ $(,)?) => {$(
        $crate::inventory::submit! { $topic }
    )+};
}

/// The topics of all linked crates, by name.
pub(crate) fn topics() -> Vec<Topic> {
    let mut topics: Vec<Topic> = inventory::iter::<Topic>.into_iter().copied().collect();
    topics.sort_by_key(|topic| topic.name);
    topics
}

/// The verbs of all linked crates.
pub(crate) fn linked() -> Vec<Arc<dyn CliVerb>> {
    inventory::iter::<Verb>.into_iter().map(|verb| Arc::new(*verb) as _).collect()
}

/// The verbs by name.
///
/// # Errors
/// Names both crates if a verb has the name of another verb or of a verb of `own`.
pub(crate) fn by_name(verbs: &[Arc<dyn CliVerb>], own: &Command) -> Result<BTreeMap<String, Arc<dyn CliVerb>>, String> {
    let mut sorted: Vec<(String, &Arc<dyn CliVerb>)> =
        verbs.iter().map(|verb| (verb.command().get_name().to_owned(), verb)).collect();
    sorted.sort_by(|(a, one), (b, other)| (a, one.owner()).cmp(&(b, other.owner())));
    for (index, (name, verb)) in sorted.iter().enumerate() {
        let other = match sorted.get(index + 1) {
            Some((next, other)) if next == name => other.owner(),
            _ if own.find_subcommand(name).is_some() => env!("CARGO_PKG_NAME"),
            _ => continue,
        };
        return Err(format!(
            "two crates register the verb `{name}`: {} and {other}; link one of them only",
            verb.owner()
        ));
    }
    Ok(sorted.into_iter().map(|(name, verb)| (name, Arc::clone(verb))).collect())
}
