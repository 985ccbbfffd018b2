//! Builds the stage of a table, and reports every option that it refuses.

use crate::tables::conditions::ViewOptions;
use crate::tables::loader::Loader;
use crate::tables::pool::PoolOptions;
use crate::tables::slot_tables::StageTable;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::key_path;
use crate::text::source::Span;
use serde::Deserialize;
use std::collections::BTreeSet;
use syntable_model::error::ConfigError;
use syntable_model::registry::{ConstructError, Constructed, Entry, RecipeValue, Slot};
use syntable_toml_schema::Step;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

impl Loader<'_, '_> {
    /// Builds the stage, and the options that all tables of its slot share.
    pub fn construct(
        &self,
        entry: &Entry,
        given: &StageTable,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<(Constructed, SharedOptions)> {
        let table = |own| Spanned::new(given.header.clone(), DeValue::Table(self.split(given, own)));
        let shared = SharedOptions::read(given.slot, table(false));
        match shared.and_then(|shared| Ok((entry.construct_validated(table(true))?, shared))) {
            Ok(built) => Some(built),
            Err(_) => {
                self.refusals(entry, given, &BTreeSet::new(), diagnostics);
                None
            }
        }
    }

    /// Reports the options that a stage refuses, and the refused options that all tables of its slot share. Options that
    /// are known to be wrong are left out.
    pub fn refusals(
        &self,
        entry: &Entry,
        given: &StageTable,
        wrong: &BTreeSet<String>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) {
        let own = self.split(given, true);
        refusals(&|table| entry.construct_validated(table).map(drop), given, own, wrong.clone(), diagnostics);
        let shared = self.split(given, false);
        refusals(&|table| SharedOptions::read(given.slot, table).map(drop), given, shared, wrong.clone(), diagnostics);
    }

    /// The options of the stage itself, or the options that all tables of its slot share.
    fn split<'a>(&self, given: &StageTable<'a>, own: bool) -> DeTable<'a> {
        let is_shared = |name: &str| self.schemas.is_shared_option(given.slot, name);
        given.table.clone().into_iter().filter(|(key, _)| is_shared(key.get_ref()) != own).collect()
    }
}

/// The options that all tables of a slot share.
pub(crate) enum SharedOptions {
    None,
    Pool(Box<PoolOptions>),
    Views(ViewOptions),
}

impl SharedOptions {
    /// Reads and checks the options.
    fn read(slot: Slot, table: RecipeValue) -> Result<Self, ConstructError> {
        match slot {
            Slot::Assets => {
                let mut options =
                    PoolOptions::deserialize(ValueDeserializer::from(table)).map_err(ConstructError::Form)?;
                options.validate().map_err(ConstructError::Invalid)?;
                options.state_defaults();
                Ok(Self::Pool(Box::new(options)))
            }
            Slot::Views => {
                let options = ViewOptions::deserialize(ValueDeserializer::from(table)).map_err(ConstructError::Form)?;
                options.validate().map_err(ConstructError::Invalid)?;
                Ok(Self::Views(options))
            }
            _ => Ok(Self::None),
        }
    }

    /// All options with their defaults.
    pub fn table(&self) -> toml::Table {
        let table = match self {
            Self::None => Ok(toml::Table::new()),
            Self::Pool(options) => toml::Table::try_from(options),
            Self::Views(options) => toml::Table::try_from(options),
        };
        table.unwrap_or_default()
    }
}

/// Reports the options that a stage refuses, one after the other, without options that are known to be `wrong`. If some
/// are wrong, a refusal may follow from them: it is left out if it concerns an option that is not given, or mentions a
/// wrong one.
fn refusals(
    build: &dyn Fn(RecipeValue) -> Result<(), ConstructError>,
    given: &StageTable,
    mut rest: DeTable,
    mut wrong: BTreeSet<String>,
    diagnostics: &mut Vec<DiagnosticBuilder>,
) {
    wrong.iter().for_each(|option| drop(rest.remove(option.as_str())));
    while let Err(error) = build(Spanned::new(given.header.clone(), DeValue::Table(rest.clone()))) {
        let (option, said) = match &error {
            // A value that cannot be read is wrong, whatever the other values are.
            ConstructError::Form(error) => (error.span().and_then(|span| option_at(&rest, &span)), String::new()),
            ConstructError::Invalid(invalid) => {
                let said = format!("{} {}", invalid.message, invalid.help.as_deref().unwrap_or_default());
                (first_key(&key_path::steps(&invalid.key)), said)
            }
        };
        let option = option.filter(|option| rest.remove(option.as_str()).is_some());
        let mut words = said.split(|letter: char| !letter.is_alphanumeric() && letter != '_');
        let follows = !wrong.is_empty() && option.is_none() || words.any(|word| wrong.contains(word));
        if !follows {
            diagnostics.push(refusal(error, given));
        }
        match option {
            Some(option) => drop(wrong.insert(option)),
            None => break,
        }
    }
}

/// The option that a path leads into.
pub(crate) fn first_key(path: &[Step]) -> Option<String> {
    match path.first()? {
        Step::Key(option) => Some(option.clone()),
        Step::Index(_) => None,
    }
}

/// The option whose value has these bytes.
fn option_at(table: &DeTable, span: &Span) -> Option<String> {
    let within = |outer: Span| outer.start <= span.start && span.end <= outer.end;
    table.iter().find(|(_, value)| within(value.span())).map(|(key, _)| key.get_ref().clone().into_owned())
}

/// The diagnostic for options that a stage refuses.
fn refusal(error: ConstructError, given: &StageTable) -> DiagnosticBuilder {
    match error {
        ConstructError::Form(error) => malformed(&error, &given.header),
        ConstructError::Invalid(invalid) => refused(invalid, given),
    }
}

/// The diagnostic for a table that passes the schema but cannot be read.
fn malformed(error: &toml::de::Error, header: &Span) -> DiagnosticBuilder {
    DiagnosticBuilder::error(Code::InvalidValue, error.span().unwrap_or(header.clone()), error.message().trim_end())
}

/// The diagnostic for a value that a stage refuses.
fn refused(invalid: ConfigError, given: &StageTable) -> DiagnosticBuilder {
    let steps = key_path::steps(&invalid.key);
    let span = place(&given.table, &steps);
    let is_default = span.is_none() && !steps.is_empty();
    let diagnostic =
        DiagnosticBuilder::error(Code::InvalidValue, span.unwrap_or(given.header.clone()), invalid.message);
    let diagnostic = if is_default {
        diagnostic.label(format!("about `{}`, which has its default", invalid.key))
    } else {
        diagnostic
    };
    match invalid.help {
        Some(help) => diagnostic.help(help),
        None => diagnostic,
    }
}

/// Bytes of the value at a path, or of the nearest value around it; none if the table has not even the first key.
fn place(table: &DeTable, steps: &[Step]) -> Option<Span> {
    let [Step::Key(first), rest @ ..] = steps else { return None };
    let mut value = table.get(first.as_str())?;
    for step in rest {
        let next = match (value.get_ref(), step) {
            (DeValue::Table(table), Step::Key(key)) => table.get(key.as_str()),
            (DeValue::Array(items), Step::Index(index)) => items.get(*index),
            _ => None,
        };
        match next {
            Some(next) => value = next,
            None => break,
        }
    }
    Some(value.span())
}
