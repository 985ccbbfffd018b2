//! Verb `slot_kinds`: prints the registered kinds of a slot.

use syntable_cli::clap::{Arg, ArgMatches, Command};
use syntable_cli::{Console, Exit, Verb};
use syntable_model::error::Error;
use syntable_model::registry::Registry;

/// Name, help and arguments of the verb.
pub fn command() -> Command {
    Command::new("slot_kinds").about("Print the kinds of a slot, one per line").arg(Arg::new("slot").required(true))
}

/// The registered kinds of a slot, such as `settle`.
pub fn kinds_of(registry: &Registry, slot: &str) -> Vec<&'static str> {
    registry.entries().iter().filter(|entry| entry.slot.name() == slot).map(|entry| entry.kind).collect()
}

fn run(console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let slot = arguments.get_one::<String>("slot").map_or("", String::as_str);
    let kinds = kinds_of(registry, slot);
    if kinds.is_empty() {
        return Err(Exit::wrong(Error::new(format!("no kind takes the slot `{slot}`")).help("try write or annotate")));
    }
    console.print(&format!("{}\n", kinds.join("\n")))
}

syntable_cli::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });
