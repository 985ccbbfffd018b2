//! The tables of each slot, and the kind of each table.

use crate::merge::edit::list_ids;
use crate::tables::check;
use crate::tables::loader::Loader;
use crate::text::code::{Code, OF_PLUGIN};
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{NOWHERE, SET, Span};
use crate::text::suggest::{did_you_mean, listing};
use std::collections::BTreeMap;
use syntable_model::registry::{Entry, Shape, Slot};
use syntable_toml_schema::is_bare;
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// Maximum number of characters of an id, which is a part of file names.
pub(crate) const LONGEST_ID: usize = 100;

/// Whether a stage can have this id.
pub(crate) fn is_id(id: &str) -> bool {
    is_bare(id) && id.len() <= LONGEST_ID
}

/// The table of a stage.
pub(crate) struct StageTable<'a> {
    pub slot: Slot,
    pub id: String,
    /// Bytes of the id in a keyed slot or of `id` in a list; none if the file does not give it.
    pub id_span: Option<Span>,
    pub header: Span,
    pub table: DeTable<'a>,
    /// Whether it is one of the alternatives of a stage. Its id is a path then.
    pub is_alternative: bool,
}

impl StageTable<'_> {
    /// Its name in messages and in the list of files: `render`, `place.objects`.
    pub fn name(&self) -> String {
        self.slot.stage_name(&self.id)
    }

    /// Bytes of the id, or of the table where the recipe does not give one.
    fn id_place(&self) -> Span {
        self.id_span.clone().unwrap_or_else(|| self.header.clone())
    }

    /// Refuses an id that file names cannot contain.
    pub fn bad_id(&self) -> Option<DiagnosticBuilder> {
        // An id that the recipe does not give is made from the kind, which may be missing.
        let is_kind = self.id_span.is_none() && self.id.is_empty();
        if self.slot.shape() == Shape::One || self.is_alternative || is_kind || is_id(&self.id) {
            return None;
        }
        let message = match self.id.is_empty() {
            true => "an id cannot be empty".to_owned(),
            false => format!("\"{}\" cannot be an id", self.id),
        };
        let diagnostic = DiagnosticBuilder::error(Code::BadId, self.id_place(), message);
        Some(diagnostic.label(format!("an id has letters, digits, `_` and `-`, at most {LONGEST_ID}")))
    }
}

impl<'r> Loader<'_, 'r> {
    /// The tables of a slot; none if the section is missing or broken.
    pub fn tables<'a>(
        &self,
        slot: Slot,
        tree: &mut DeTable<'a>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<Vec<StageTable<'a>>> {
        let Some(value) = tree.remove(slot.name()) else {
            return self.missing(slot, diagnostics);
        };
        let header = value.span();
        let found = check::type_of(&value);
        match (slot.shape(), value.into_inner()) {
            (Shape::One, DeValue::Table(table)) => Some(vec![StageTable {
                slot,
                id: slot.name().to_owned(),
                id_span: None,
                header,
                table,
                is_alternative: false,
            }]),
            (Shape::List, DeValue::Array(items)) if items.is_empty() && slot == Slot::Place => {
                self.missing(slot, diagnostics)
            }
            (Shape::List, DeValue::Array(items)) => Some(list_tables(slot, items, diagnostics)),
            (Shape::Keyed, DeValue::Table(entries)) if entries.is_empty() && slot == Slot::Write => {
                self.missing(slot, diagnostics)
            }
            (Shape::Keyed, DeValue::Table(entries)) => Some(self.keyed_tables(slot, entries, diagnostics)),
            (shape, _) => {
                let (wanted, write) = match shape {
                    Shape::One => ("a table", format!("write [{slot}] and its options below")),
                    Shape::List => ("an array of tables", format!("write [[{slot}]], once for every step")),
                    _ => ("a table of tables", format!("write [{slot}.<id>], once for every id")),
                };
                let message = format!("`{slot}` must be {wanted}");
                let diagnostic = DiagnosticBuilder::error(Code::WrongType, header, message);
                diagnostics.push(diagnostic.label(format!("this is {found}")).help(write));
                None
            }
        }
    }

    /// The tables of a keyed slot, such as `[write.<id>]`.
    fn keyed_tables<'a>(
        &self,
        slot: Slot,
        entries: DeTable<'a>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Vec<StageTable<'a>> {
        let mut tables = Vec::new();
        for (key, value) in entries {
            let (id_span, header) = (key.span(), value.span());
            let id = key.into_inner().into_owned();
            let wrong =
                |span: Span| DiagnosticBuilder::error(Code::WrongType, span, format!("`{slot}.{id}` must be a table"));
            match value.into_inner() {
                DeValue::Table(table) => {
                    let id_span = Some(id_span);
                    tables.push(StageTable { slot, id, id_span, header, table, is_alternative: false });
                }
                DeValue::Array(_) => {
                    let help = format!("write [{slot}.{id}] with single brackets");
                    diagnostics.push(wrong(header).label("this is an array").help(help));
                }
                _ => {
                    let kinds = self.registry.of_slot(slot).map(|entry| entry.kind);
                    let label = format!("options belong under [{slot}.<id>]");
                    diagnostics
                        .push(wrong(id_span).label(label).help(format!("ids that are kinds: {}", listing(kinds))));
                }
            }
        }
        tables
    }

    /// The kinds that a slot has when a recipe leaves it out.
    fn default_kinds(&self, slot: Slot) -> impl Iterator<Item = &'static str> {
        let kinds = slot.spec().default_kinds;
        let usable =
            move |kind: &&str| self.registry.find(slot, kind).is_some_and(|entry| entry.construct_str("").is_ok());
        kinds.iter().copied().filter(usable)
    }

    /// The tables that replace a missing section.
    fn missing<'a>(&self, slot: Slot, diagnostics: &mut Vec<DiagnosticBuilder>) -> Option<Vec<StageTable<'a>>> {
        let tables: Vec<StageTable> = self
            .default_kinds(slot)
            .map(|kind| {
                let mut table = DeTable::new();
                table.insert(Spanned::new(NOWHERE, "kind".into()), Spanned::new(NOWHERE, DeValue::String(kind.into())));
                let id = if slot.shape() == Shape::One { slot.name() } else { kind };
                let (id, header) = (id.to_owned(), NOWHERE);
                StageTable { slot, id, id_span: None, header, table, is_alternative: false }
            })
            .collect();
        if !tables.is_empty() || slot.spec().optional {
            return Some(tables);
        }
        let kinds: Vec<&str> = self.registry.of_slot(slot).map(|entry| entry.kind).collect();
        let header = slot.header("<id>");
        let example = match slot.shape() {
            Shape::Keyed => slot.header(kinds.first().unwrap_or(&"<id>")),
            _ => format!("{header} with kind = …"),
        };
        diagnostics.push(
            DiagnosticBuilder::error(Code::MissingSection, NOWHERE, format!("a recipe needs `{header}`"))
                .help(lower(slot.doc()))
                .help(format!("add {example}; kinds are {}", listing(kinds))),
        );
        None
    }

    /// Takes `kind` off a table and finds its entry.
    pub fn kind(&self, given: &mut StageTable, diagnostics: &mut Vec<DiagnosticBuilder>) -> Option<&'r Entry> {
        let slot = given.slot;
        let kinds = || self.registry.of_slot(slot).map(|entry| entry.kind);
        let keyed = slot.shape() == Shape::Keyed;
        let is_id = !given.table.contains_key("kind");
        let (kind, span) = match given.table.remove("kind") {
            Some(value) => match value.get_ref() {
                DeValue::String(kind) => (kind.clone().into_owned(), value.span()),
                _ => {
                    diagnostics.push(DiagnosticBuilder::error(
                        Code::WrongType,
                        value.span(),
                        "`kind` must be a string",
                    ));
                    return None;
                }
            },
            None if keyed => (given.id.clone(), given.id_place()),
            // A section that only overrides mention has its default kind, too.
            None if (slot.has_default_kind()
                || self.sources.file_of(&given.header).is_some_and(|file| file.name() == SET))
                && self.default_kinds(slot).next().is_some() =>
            {
                (self.default_kinds(slot).next().unwrap_or_default().to_owned(), given.header.clone())
            }
            None => {
                let header = slot.header("<id>");
                let diagnostic = DiagnosticBuilder::error(
                    Code::MissingKey,
                    given.header.clone(),
                    format!("`{header}` needs a `kind`"),
                );
                diagnostics.push(diagnostic.label("add `kind = …`").help(format!("kinds are {}", listing(kinds()))));
                return None;
            }
        };
        let Some(entry) = self.registry.find(slot, &kind) else {
            if let Some(diagnostic) = self.renamed.kind(slot, &kind, is_id, &span) {
                diagnostics.push(diagnostic);
                return None;
            }
            let mut diagnostic =
                DiagnosticBuilder::error(Code::UnknownKind, span.clone(), format!("`{slot}` has no kind `{kind}`"))
                    .label(did_you_mean(&kind, kinds()))
                    .help(format!("linked plugins register {}", listing(kinds())));
            let elsewhere = Slot::ALL.into_iter().find(|other| self.registry.find(*other, &kind).is_some());
            if let Some(other) = elsewhere {
                diagnostic = diagnostic.help(format!("`{kind}` is a kind of `{other}`"));
            } else if keyed && Some(&span) == given.id_span.as_ref() {
                diagnostic =
                    diagnostic.help(format!("to call the table `{}` as you like, add `kind = …` to it", given.id));
            } else {
                diagnostic = diagnostic.help(OF_PLUGIN);
            }
            diagnostics.push(diagnostic);
            return None;
        };
        if keyed && given.id != kind && self.registry.find(slot, &given.id).is_some() {
            let id = &given.id;
            diagnostics.push(
                DiagnosticBuilder::error(
                    Code::BadId,
                    span,
                    format!("`{slot}.{id}` is of kind `{kind}`, but `{id}` is a kind itself"),
                )
                .also(given.id_place(), "the id")
                .help(format!("call the table otherwise, for instance [{slot}.my_{id}]")),
            );
            return None;
        }
        Some(entry)
    }
}

/// The tables of a slot that is a list, such as `[[place]]`.
fn list_tables<'a>(slot: Slot, items: DeArray<'a>, diagnostics: &mut Vec<DiagnosticBuilder>) -> Vec<StageTable<'a>> {
    let ids = list_ids(&items);
    let mut seen: BTreeMap<String, Span> = BTreeMap::new();
    let mut tables = Vec::new();
    for (item, id) in items.into_iter().zip(ids) {
        let (header, found) = (item.span(), check::type_of(&item));
        let DeValue::Table(mut table) = item.into_inner() else {
            let message = format!("an element of `{slot}` must be a table");
            diagnostics
                .push(DiagnosticBuilder::error(Code::WrongType, header, message).label(format!("this is {found}")));
            continue;
        };
        let id_value = table.remove("id");
        if let Some(other) = id_value.as_ref().filter(|id| !id.get_ref().is_str()) {
            diagnostics.push(DiagnosticBuilder::error(Code::WrongType, other.span(), "`id` must be a string"));
        }
        let id_span = id_value.map(|id| id.span());
        if let Some(span) = &id_span
            && let Some(first) = seen.insert(id.clone(), span.clone())
        {
            let message = format!("two steps of `{slot}` have the id `{id}`");
            diagnostics.push(
                DiagnosticBuilder::error(Code::BadId, span.clone(), message)
                    .label("again here")
                    .also(first, "first given here")
                    .help("ids seed the steps' random streams, so each step needs its own"),
            );
        }
        tables.push(StageTable { slot, id, id_span, header, table, is_alternative: false });
    }
    tables
}

fn lower(sentence: &str) -> String {
    let mut letters = sentence.trim_end_matches('.').chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}
