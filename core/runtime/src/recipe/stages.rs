//! Builds stages from the tables of a recipe.

use super::check;
use super::code::Code;
use super::diagnostic::DiagnosticBuilder;
use super::inherit::{SET, list_ids};
use super::key_path;
use super::overrides::Overrides;
use super::pool::PoolOptions;
use super::renamed::RenamedNames;
use super::schema::{KindSchema, Schemas};
use super::source::{NOWHERE, Sources, Span};
use super::suggest::{did_you_mean, listing};
use super::variables::{self, PathRules};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use syntable_model::error::{ConfigError, Error};
use syntable_model::names::{ObjectPool, PoolName, SupportName};
use syntable_model::options::{DisplayPath, Reference, Step, is_bare, plain_members};
use syntable_model::pools::ObjectPools;
use syntable_model::registry::{Choice, ConstructError, Constructed, Entry, RecipeValue, Registry, Shape, Slot, Stage};
use syntable_model::scene::AssetClass;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// Builds the stages of one recipe.
pub(crate) struct Loader<'l> {
    pub registry: &'l Registry,
    pub schemas: &'l Schemas,
    pub overrides: &'l Overrides<'l>,
    pub sources: &'l Sources,
    pub renamed: &'l RenamedNames<'l>,
    pub paths: PathRules,
}

/// A built stage.
pub(crate) struct BuiltStage<'l> {
    pub slot: Slot,
    pub id: String,
    pub entry: &'l Entry,
    /// The stage; taken by the plan if it makes products from products.
    pub stage: Option<Stage>,
    /// All options, paths in portable form.
    pub options: toml::Table,
    /// Bytes of the table's header.
    pub header: Span,
    /// Products that it names, with their bytes.
    pub products: Vec<(String, Span)>,
    /// Supports that it names, with their bytes.
    pub supports: Vec<(String, Span)>,
    /// Pools of objects that it draws from.
    pub object_pools: BTreeSet<String>,
    /// Whether there is something at every path that it names.
    pub found: bool,
}

/// An option of a stage that names pools.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    /// The stage and its option, such as `place.drop_box.from`.
    pub option: String,
    /// The pools, whatever the class of their assets.
    pub pools: ObjectPools,
}

/// All stages that could be built.
pub(crate) struct Built<'l> {
    pub stages: Vec<BuiltStage<'l>>,
    /// Options of the pools, by id.
    pub pools: BTreeMap<String, PoolOptions>,
    /// Paths that options of other stages name, by the option.
    pub files: Vec<(String, PathBuf)>,
    /// Which pools the stages draw from.
    pub draws: Vec<Draw>,
    /// Native libraries that the recipe names by a path beside itself, such as `denoise: library = "oidn.so"`.
    pub libraries: Vec<String>,
    /// Kinds that were chosen, for people.
    pub choices: Vec<String>,
    /// Tables whose kind was not chosen yet.
    pub undecided: Vec<String>,
    /// Slots with a table that could not be built.
    pub failed: BTreeSet<Slot>,
}

/// The table of a stage.
struct StageTable<'a> {
    slot: Slot,
    id: String,
    /// Bytes of the id in a keyed slot or of `id` in a list; none if the file does not give it.
    id_span: Option<Span>,
    header: Span,
    table: DeTable<'a>,
}

/// Names in the recipe, collected for the check of references.
#[derive(Default)]
struct Names {
    /// Class of each pool; none if its table is broken.
    pools: BTreeMap<String, (Option<AssetClass>, Span)>,
    used: BTreeSet<String>,
    /// Names that the recipe gives.
    references: Vec<Reference>,
    /// Names that are defaults of a kind.
    implied: Vec<(&'static str, Reference)>,
    /// Whether a stage that may draw from pools could not be read.
    unread: bool,
}

impl Names {
    /// All names; a default comes with the kind that has it.
    fn all(&self) -> impl Iterator<Item = (Option<&'static str>, &Reference)> {
        let said = self.references.iter().map(|reference| (None, reference));
        said.chain(self.implied.iter().map(|(kind, reference)| (Some(*kind), reference)))
    }
}

/// Maximum number of characters of an id, which is a part of file names.
const LONGEST_ID: usize = 100;

/// Whether a stage can have this id.
fn is_id(id: &str) -> bool {
    is_bare(id) && id.len() <= LONGEST_ID
}

impl<'l> Loader<'l> {
    /// Builds all stages of the tree and reports all mistakes.
    pub fn build(&self, tree: &mut DeTable, diagnostics: &mut Vec<DiagnosticBuilder>) -> Built<'l> {
        let mut built = Built {
            stages: Vec::new(),
            pools: BTreeMap::new(),
            files: Vec::new(),
            draws: Vec::new(),
            libraries: Vec::new(),
            choices: Vec::new(),
            undecided: Vec::new(),
            failed: BTreeSet::new(),
        };
        let mut names = Names::default();
        for slot in Slot::ALL {
            let Some(tables) = self.tables(slot, tree, diagnostics) else {
                names.unread |= matches!(slot, Slot::Place | Slot::Lights);
                built.failed.insert(slot);
                continue;
            };
            for table in tables {
                if !self.stage(table, &mut built, &mut names, diagnostics) {
                    built.failed.insert(slot);
                }
            }
        }
        self.check_pools(&names, diagnostics);
        built
    }

    /// The tables of a slot; none if the section is missing or broken.
    fn tables<'a>(
        &self,
        slot: Slot,
        tree: &mut DeTable<'a>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<Vec<StageTable<'a>>> {
        let Some(value) = tree.remove(slot.name()) else {
            return self.missing(slot, diagnostics);
        };
        let span = value.span();
        let wrong = |found: &RecipeValue| {
            let (wanted, write) = match slot.shape() {
                Shape::One => ("a table", format!("write [{slot}] and its options below")),
                Shape::List => ("an array of tables", format!("write [[{slot}]], once for every step")),
                _ => ("a table of tables", format!("write [{slot}.<id>], once for every id")),
            };
            DiagnosticBuilder::error(Code::WrongType, span.clone(), format!("`{slot}` must be {wanted}"))
                .label(format!("this is {}", check::type_of(found)))
                .help(write)
        };
        let fits = match slot.shape() {
            Shape::List => value.get_ref().is_array(),
            _ => value.get_ref().is_table(),
        };
        if !fits {
            diagnostics.push(wrong(&value));
            return None;
        }
        match (slot.shape(), value.into_inner()) {
            (Shape::One, DeValue::Table(table)) => {
                let id = slot.name().to_owned();
                Some(vec![StageTable { slot, id, id_span: None, header: span.clone(), table }])
            }
            (Shape::List, DeValue::Array(items)) => {
                if items.is_empty() && slot == Slot::Place {
                    return self.missing(slot, diagnostics);
                }
                let ids = list_ids(&items);
                let mut seen: BTreeMap<String, Span> = BTreeMap::new();
                let mut tables = Vec::new();
                for (item, id) in items.into_iter().zip(ids) {
                    let header = item.span();
                    let found = check::type_of(&item);
                    match item.into_inner() {
                        DeValue::Table(mut table) => {
                            let id_value = table.remove("id");
                            if let Some(other) = id_value.as_ref().filter(|id| !id.get_ref().is_str()) {
                                diagnostics.push(DiagnosticBuilder::error(
                                    Code::WrongType,
                                    other.span(),
                                    "`id` must be a string",
                                ));
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
                            tables.push(StageTable { slot, id, id_span, header, table });
                        }
                        _ => diagnostics.push(
                            DiagnosticBuilder::error(
                                Code::WrongType,
                                header,
                                format!("an element of `{slot}` must be a table"),
                            )
                            .label(format!("this is {found}")),
                        ),
                    }
                }
                Some(tables)
            }
            (Shape::Keyed, DeValue::Table(entries)) => {
                if entries.is_empty() && slot == Slot::Write {
                    return self.missing(slot, diagnostics);
                }
                let mut tables = Vec::new();
                for (key, value) in entries {
                    let (id_span, header) = (Some(key.span()), value.span());
                    let id = key.into_inner().into_owned();
                    match value.into_inner() {
                        DeValue::Table(table) => tables.push(StageTable { slot, id, id_span, header, table }),
                        DeValue::Array(_) => diagnostics.push(
                            DiagnosticBuilder::error(Code::WrongType, header, format!("`{slot}.{id}` must be a table"))
                                .label("this is an array")
                                .help(format!("write [{slot}.{id}] with single brackets")),
                        ),
                        _ => {
                            let kinds = self.registry.of_slot(slot).map(|entry| entry.kind);
                            diagnostics.push(
                                DiagnosticBuilder::error(
                                    Code::WrongType,
                                    id_span.unwrap_or(header),
                                    format!("`{slot}.{id}` must be a table"),
                                )
                                .label(format!("options belong under [{slot}.<id>]"))
                                .help(format!("ids that are kinds: {}", listing(kinds))),
                            );
                        }
                    }
                }
                Some(tables)
            }
            _ => None,
        }
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
                StageTable { slot, id: id.to_owned(), id_span: None, header: NOWHERE, table }
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

    /// Builds one stage; false if it could not be built.
    fn stage(
        &self,
        mut given: StageTable,
        built: &mut Built<'l>,
        names: &mut Names,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> bool {
        let slot = given.slot;
        if slot == Slot::Assets {
            let span = given.id_span.clone().unwrap_or(NOWHERE);
            names.pools.insert(given.id.clone(), (None, span));
        }
        // An id that the recipe does not give is made from the kind, which may be missing.
        let is_kind = given.id_span.is_none() && given.id.is_empty();
        if slot.shape() != Shape::One && !is_kind && !is_id(&given.id) {
            let span = given.id_span.clone().unwrap_or_else(|| given.header.clone());
            let message = match given.id.is_empty() {
                true => "an id cannot be empty".to_owned(),
                false => format!("\"{}\" cannot be an id", given.id),
            };
            diagnostics.push(
                DiagnosticBuilder::error(Code::BadId, span, message)
                    .label(format!("an id has letters, digits, `_` and `-`, at most {LONGEST_ID}")),
            );
        }
        let Some(entry) = self.kind(&mut given, diagnostics) else {
            names.unread = true;
            return false;
        };
        let Some(entry) = self.chosen(entry, &given, built, diagnostics) else { return false };
        let Some(kind) = self.schemas.kind(slot, entry.kind) else { return false };
        let pool_renamed = if slot == Slot::Assets { self.renamed.pool } else { &[] };
        let renamed = [entry.renamed, pool_renamed];
        let checked =
            check::options(self.schemas.validator(), entry.kind, &given.table, &given.header, &kind.options, &renamed);
        let (mut ok, mut found) = (checked.diagnostics.is_empty(), true);
        diagnostics
            .extend(checked.diagnostics.into_iter().map(|diagnostic| self.of_another_kind(diagnostic, &given, kind)));
        let said: Vec<(Vec<Step>, String)> =
            checked.references.iter().map(|reference| (reference.path.clone(), reference.text.clone())).collect();
        let header_span = given.header.clone();
        let mut paths = Vec::new();
        let (mut products, mut supports) = (Vec::new(), Vec::new());
        let mut object_pools = BTreeSet::new();
        let (mut libraries, mut files, mut checked_paths) = (Vec::new(), Vec::new(), Vec::new());
        for reference in &checked.references {
            match reference.what.as_str() {
                "library" => libraries.push(reference.path.clone()),
                "file" => files.push(reference.path.clone()),
                "path" => checked_paths.push(reference.path.clone()),
                _ => {}
            }
        }
        let mut wrong = checked.wrong;
        for reference in checked.references {
            match reference.what.as_str() {
                // A file may be a reference of its own, beside that to its path.
                "file" if checked_paths.contains(&reference.path) => {}
                "path" | "file" => match self.path(&reference, &mut given.table, diagnostics) {
                    Some(path) => {
                        // Whether a library is there is for the stage to say, which knows where to get it.
                        if !libraries.contains(&reference.path) && !(self.overrides.exists)(&path.path) {
                            diagnostics.push(self.absent(&reference, &path.path));
                            found = false;
                        } else if files.contains(&reference.path) && path.path.is_dir() {
                            diagnostics.push(folder_for_file(&reference, &path.path));
                            found = false;
                        }
                        paths.push((reference.path, path));
                    }
                    None => {
                        ok = false;
                        wrong.extend(first_key(&reference.path));
                    }
                },
                "library" => {
                    let typed = self.sources.file_of(&reference.span).is_none_or(|file| file.name() == SET);
                    if !typed && !reference.text.starts_with("${") && Path::new(&reference.text).is_relative() {
                        let option = DisplayPath(&reference.path);
                        built.libraries.push(format!("{slot}: {option} = {:?}", reference.text));
                    }
                }
                SupportName::REFERENCE => supports.push((reference.text, reference.span)),
                what => {
                    if what == "product"
                        && let Some(diagnostic) = self.renamed.product(&reference.text, &reference.span)
                    {
                        diagnostics.push(diagnostic);
                        ok = false;
                        wrong.extend(first_key(&reference.path));
                        continue;
                    }
                    if what == ObjectPool::REFERENCE {
                        object_pools.insert(reference.text.clone());
                    }
                    if what == "product" {
                        products.push((reference.text.clone(), reference.span.clone()));
                    } else {
                        names.used.insert(reference.text.clone());
                    }
                    names.references.push(reference);
                }
            }
        }
        let constructed = if ok {
            self.construct(entry, &given, built, diagnostics)
        } else {
            // Mistakes among the other options do not wait until these are mended.
            self.refusals(entry, &given, &wrong, diagnostics);
            None
        };
        if slot == Slot::Assets
            && let Some((class, _)) = names.pools.get_mut(&given.id)
        {
            *class = kind.class;
        }
        let Some(Constructed { stage, mut options }) = constructed else { return false };
        if let Some(pool) = built.pools.get(&given.id).filter(|_| slot == Slot::Assets) {
            let pool = toml::Table::try_from(pool).unwrap_or_default();
            options.extend(pool.into_iter().filter(|(name, _)| kind.options["properties"].get(name).is_some()));
        }
        built.draws.extend(self.draws(&given, entry, &options, &kind.options));
        for reference in self.implied(entry, &options, &kind.options, &said, &header_span) {
            if reference.what == ObjectPool::REFERENCE {
                object_pools.insert(reference.text.clone());
            }
            if reference.what == "product" {
                products.push((reference.text.clone(), reference.span.clone()));
            } else {
                names.used.insert(reference.text.clone());
            }
            names.implied.push((entry.kind, reference));
        }
        for (steps, path) in paths {
            // The catalog of a pool says what its folders and lists amount to, and a denoiser's library is a program.
            if !matches!(slot, Slot::Assets | Slot::Denoise) {
                let table = slot.stage_name(&given.id);
                built.files.push((format!("{table}.{}", DisplayPath(&steps)), path.path.clone()));
            }
            if let Some(toml::Value::String(text)) = at_mut(&mut options, &steps)
                && path.path.to_str() == Some(text.as_str())
            {
                *text = path.portable;
            }
        }
        let (id, header) = (given.id, given.header);
        let stage = Some(stage.of_scenes());
        let of_table = BuiltStage { slot, id, entry, stage, options, header, products, supports, object_pools, found };
        built.stages.push(of_table);
        ok
    }

    /// The kind that another one stands for on this machine.
    fn chosen(
        &self,
        entry: &'l Entry,
        given: &StageTable,
        built: &mut Built<'l>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<&'l Entry> {
        let Some(choose) = entry.choose else { return Some(entry) };
        let slot = given.slot;
        let table = slot.stage_name(&given.id);
        if !self.overrides.choose {
            built.undecided.push(table);
            return Some(entry);
        }
        let unknown = |kind: &str| Error::new(format!("it stands for `{kind}`, which no plugin registers"));
        let chosen = choose(self.registry).and_then(|Choice { kind, reason }| {
            built.choices.push(format!("[{table}] `{}` is `{kind}` here: {reason}", entry.kind));
            self.registry.find(slot, kind).ok_or_else(|| unknown(kind))
        });
        let refused = |error: Error| {
            let message = format!("`{}`: {}", entry.kind, error.without_help());
            let diagnostic = DiagnosticBuilder::error(Code::InvalidValue, given.header.clone(), message);
            error.help_text().into_iter().fold(diagnostic, |diagnostic, help| diagnostic.help(help))
        };
        chosen.map_err(|error| diagnostics.push(refused(error))).ok()
    }

    /// Explains an unknown option that another kind of the slot has, or that pools of another class have.
    fn of_another_kind(
        &self,
        diagnostic: DiagnosticBuilder,
        given: &StageTable,
        kind: &KindSchema,
    ) -> DiagnosticBuilder {
        if diagnostic.code != Code::UnknownKey {
            return diagnostic;
        }
        let Some(key) = given.table.keys().find(|key| key.span() == *diagnostic.span()) else { return diagnostic };
        let key = key.get_ref().as_ref();
        if let Some(class) = kind.class.filter(|_| self.schemas.is_pool_option(key)) {
            return DiagnosticBuilder::error(
                Code::WrongClass,
                diagnostic.span().clone(),
                format!("`{key}` applies to objects only"),
            )
            .label(format!("`{}` gives {class}s", kind.kind));
        }
        let has_suggestion = !diagnostic.marks[0].1.is_empty();
        let mut others = self.schemas.kinds.iter().filter(|other| other.slot == given.slot && other.kind != kind.kind);
        match others.find(|other| other.options["properties"].get(key).is_some()).filter(|_| !has_suggestion) {
            Some(other) => diagnostic.label(format!("this is an option of the kind `{}`", other.kind)),
            None => diagnostic,
        }
    }

    /// The options of a stage that name pools, each with the pools.
    fn draws(&self, given: &StageTable, entry: &Entry, options: &toml::Table, schema: &serde_json::Value) -> Vec<Draw> {
        let outcome = self.schemas.validator().table(entry.kind, plain_members(options), NOWHERE, schema);
        let is_pool = |reference: &&Reference| reference.what.starts_with("pool:");
        let mut draws: Vec<Draw> = Vec::new();
        for reference in outcome.references.iter().filter(is_pool) {
            let Some((last, above)) = reference.path.split_last() else { continue };
            // A name in a list, or a name with a weight, is a part of its option.
            let is_part = match (last, at(options, above)) {
                (Step::Index(_), _) => true,
                (Step::Key(_), Some(toml::Value::Table(weights))) => {
                    weights.get(reference.text.as_str()).is_some_and(|weight| !weight.is_str())
                }
                _ => false,
            };
            let path = if is_part { above } else { &reference.path };
            let stage = given.slot.stage_name(&given.id);
            let option = format!("{stage}.{}", DisplayPath(path));
            let pools = at(options, path).and_then(|value| ObjectPools::deserialize(value.clone()).ok());
            if let Some(pools) = pools.filter(|_| draws.iter().all(|draw| draw.option != option)) {
                draws.push(Draw { option, pools });
            }
        }
        draws
    }

    /// The names among a stage's defaults, which are nowhere in the recipe: they are reported at the table's header.
    fn implied(
        &self,
        entry: &Entry,
        options: &toml::Table,
        schema: &serde_json::Value,
        given: &[(Vec<Step>, String)],
        header: &Span,
    ) -> Vec<Reference> {
        let outcome = self.schemas.validator().table(entry.kind, plain_members(options), NOWHERE, schema);
        // A single name may be written back as an array of one, so its path may differ below its option.
        let said = |reference: &Reference| {
            given.iter().any(|(path, text)| path.first() == reference.path.first() && *text == reference.text)
        };
        let implied = outcome.references.into_iter().filter(|reference| reference.what != "path" && !said(reference));
        implied.map(|reference| Reference { span: header.clone(), ..reference }).collect()
    }

    /// Takes `kind` off a table and finds its entry.
    fn kind(&self, given: &mut StageTable, diagnostics: &mut Vec<DiagnosticBuilder>) -> Option<&'l Entry> {
        let slot = given.slot;
        let kinds = || self.registry.of_slot(slot).map(|entry| entry.kind);
        let keyed = slot.shape() == Shape::Keyed;
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
            None if keyed => (given.id.clone(), given.id_span.clone().unwrap_or_else(|| given.header.clone())),
            None if self.sources.file_of(&given.header).is_some_and(|file| file.name() == SET)
                && self.default_kinds(slot).next().is_some() =>
            {
                // Only overrides mention this section, so it has its default kind.
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
            if let Some(diagnostic) = self.renamed.kind(slot, &kind, &span) {
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
                diagnostic = diagnostic
                    .help("if a plugin of yours registers it, check that its crate is named in your binary's main.rs");
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
                .also(given.id_span.clone().unwrap_or_else(|| given.header.clone()), "the id")
                .help(format!("call the table otherwise, for instance [{slot}.my_{id}]")),
            );
            return None;
        }
        Some(entry)
    }

    /// Resolves a path and puts it back into the table.
    fn path(
        &self,
        reference: &Reference,
        table: &mut DeTable,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<variables::Resolved> {
        let file = self.sources.file_of(&reference.span)?;
        diagnostics.extend(variables::odd(&reference.text, &reference.span));
        let (folder, variable) = (&self.overrides.current_folder, self.overrides.variable);
        let resolved = variables::resolve(&reference.text, &reference.span, file, folder, variable, &self.paths);
        let resolved = resolved.map_err(|diagnostic| diagnostics.push(diagnostic)).ok()?;
        let value = recipe_at_mut(table, &reference.path)?;
        let Some(text) = resolved.path.to_str() else {
            let message = format!("the path {} is not UTF-8", resolved.path.display());
            diagnostics.push(DiagnosticBuilder::error(Code::InvalidValue, reference.span.clone(), message));
            return None;
        };
        *value.get_mut() = DeValue::String(text.to_owned().into());
        Some(resolved)
    }

    /// The diagnostic for a path at which there is nothing. It says from where the path counts.
    fn absent(&self, reference: &Reference, path: &Path) -> DiagnosticBuilder {
        let message = format!("there is no file or folder {}", path.display());
        let diagnostic = DiagnosticBuilder::error(Code::InvalidValue, reference.span.clone(), message);
        let is_set = self.sources.file_of(&reference.span).is_some_and(|file| file.name() == SET);
        match reference.text.strip_prefix("${").and_then(|rest| rest.split_once('}')) {
            Some((name, _)) => diagnostic.label(format!("`{name}` is an environment variable")),
            None if Path::new(&reference.text).is_absolute() => diagnostic,
            None if is_set => diagnostic.label("relative paths of --set start from the current folder"),
            None => diagnostic.label("relative paths start from the folder of the recipe that names them"),
        }
    }

    /// Builds the stage, and the options of its pool if it is a source of assets.
    fn construct(
        &self,
        entry: &Entry,
        given: &StageTable,
        built: &mut Built<'l>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<Constructed> {
        let table = |own| Spanned::new(given.header.clone(), DeValue::Table(self.split(given, own)));
        let options = match given.slot {
            Slot::Assets => pool_options(table(false)).map(Some),
            _ => Ok(None),
        };
        match options.and_then(|options| Ok((options, entry.construct_validated(table(true))?))) {
            Ok((options, constructed)) => {
                built.pools.extend(options.map(|options| (given.id.clone(), options)));
                Some(constructed)
            }
            Err(_) => {
                self.refusals(entry, given, &BTreeSet::new(), diagnostics);
                None
            }
        }
    }

    /// Reports what a stage, and the pool of a source of assets, refuse of their options beside those that are known to be
    /// wrong.
    fn refusals(
        &self,
        entry: &Entry,
        given: &StageTable,
        wrong: &BTreeSet<String>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) {
        let own = self.split(given, true);
        refusals(&|table| entry.construct_validated(table).map(drop), given, own, wrong.clone(), diagnostics);
        if given.slot == Slot::Assets {
            let pool = self.split(given, false);
            refusals(&|table| pool_options(table).map(drop), given, pool, wrong.clone(), diagnostics);
        }
    }

    /// The options of the stage itself, or those of its pool.
    fn split<'a>(&self, given: &StageTable<'a>, own: bool) -> DeTable<'a> {
        let of_pool = |name: &str| given.slot == Slot::Assets && self.schemas.is_pool_option(name);
        given.table.clone().into_iter().filter(|(key, _)| of_pool(key.get_ref()) != own).collect()
    }

    /// Every pool that a stage names must be there and give the right class; every pool should be named.
    fn check_pools(&self, names: &Names, diagnostics: &mut Vec<DiagnosticBuilder>) {
        for (kind, reference) in names.all() {
            let Some(class) = reference.what.strip_prefix("pool:") else { continue };
            let name = &reference.text;
            let of_class = || {
                let gives = move |found: &Option<AssetClass>| found.is_none_or(|found| found.to_string() == class);
                names.pools.iter().filter(move |(_, (found, _))| gives(found)).map(|(id, _)| id.as_str())
            };
            match names.pools.get(name) {
                None => {
                    let message = format!("there is no pool `{name}`");
                    let mut diagnostic = DiagnosticBuilder::error(Code::UnknownPool, reference.span.clone(), message);
                    diagnostic = match kind {
                        Some(kind) => diagnostic.label(default_of(kind, reference)),
                        None => diagnostic.label(did_you_mean(name, of_class())),
                    };
                    diagnostic = match of_class().next() {
                        Some(_) => diagnostic.help(format!("pools of {class}s: {}", listing(of_class()))),
                        None => diagnostic.help(format!("add [assets.{name}] with a kind that gives {class}s")),
                    };
                    diagnostics.push(diagnostic);
                }
                Some((Some(found), declared)) if found.to_string() != class => {
                    let message = format!("pool `{name}` gives {found}s, but {class}s are needed");
                    let diagnostic = DiagnosticBuilder::error(Code::UnknownPool, reference.span.clone(), message)
                        .label(format!("{class}s are needed here"))
                        .also(declared.clone(), format!("gives {found}s"));
                    diagnostics.push(match of_class().next() {
                        Some(_) => diagnostic.help(format!("pools of {class}s: {}", listing(of_class()))),
                        None => diagnostic,
                    });
                }
                _ => {}
            }
        }
        for (id, (_, span)) in &names.pools {
            // A recipe that extends another one need not draw from all of its pools.
            let own = self.sources.file_of(span).is_some_and(|file| file.is_root());
            if own && !names.used.contains(id) && !names.unread {
                diagnostics.push(
                    DiagnosticBuilder::warning(
                        Code::UnusedPool,
                        span.clone(),
                        format!("no stage draws from the pool `{id}`"),
                    )
                    .label("never named"),
                );
            }
        }
    }
}

/// Reads and checks the options of a pool.
fn pool_options(table: RecipeValue) -> Result<PoolOptions, ConstructError> {
    let mut options = PoolOptions::deserialize(ValueDeserializer::from(table)).map_err(ConstructError::Form)?;
    options.validate().map_err(ConstructError::Invalid)?;
    options.state_defaults();
    Ok(options)
}

/// Reports what a stage refuses of its options beside those that are known to be `wrong`, one after the other. If there are
/// wrong ones, what is about an option that is not given, or speaks of a wrong one, may follow from them and is left out.
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
            // A value that cannot be read is wrong whatever the others are.
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
fn first_key(path: &[Step]) -> Option<String> {
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

fn default_of(kind: &str, reference: &Reference) -> String {
    format!("`{kind}` has it as the default of `{}`", DisplayPath(&reference.path))
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

/// The diagnostic for a folder in place of a file.
fn folder_for_file(reference: &Reference, path: &Path) -> DiagnosticBuilder {
    let message = format!("`{}` names a file, but {} is a folder", DisplayPath(&reference.path), path.display());
    DiagnosticBuilder::error(Code::InvalidValue, reference.span.clone(), message).label("name a file in it")
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

fn recipe_at_mut<'t, 'a>(table: &'t mut DeTable<'a>, path: &[Step]) -> Option<&'t mut RecipeValue<'a>> {
    let [Step::Key(first), rest @ ..] = path else { return None };
    rest.iter().try_fold(table.get_mut(first.as_str())?, |value, step| match (value.get_mut(), step) {
        (DeValue::Table(table), Step::Key(key)) => table.get_mut(key.as_str()),
        (DeValue::Array(items), Step::Index(index)) => items.get_mut(*index),
        _ => None,
    })
}

fn at<'t>(table: &'t toml::Table, path: &[Step]) -> Option<&'t toml::Value> {
    let [Step::Key(first), rest @ ..] = path else { return None };
    rest.iter().try_fold(table.get(first)?, |value, step| match step {
        Step::Key(key) => value.get(key),
        Step::Index(index) => value.get(index),
    })
}

fn at_mut<'t>(table: &'t mut toml::Table, path: &[Step]) -> Option<&'t mut toml::Value> {
    let [Step::Key(first), rest @ ..] = path else { return None };
    rest.iter().try_fold(table.get_mut(first)?, |value, step| match (value, step) {
        (toml::Value::Table(table), Step::Key(key)) => table.get_mut(key),
        (toml::Value::Array(items), Step::Index(index)) => items.get_mut(*index),
        _ => None,
    })
}

fn lower(sentence: &str) -> String {
    let mut letters = sentence.trim_end_matches('.').chars();
    letters.next().map_or_else(String::new, |first| first.to_lowercase().chain(letters).collect())
}
