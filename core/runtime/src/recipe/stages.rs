//! The stage tables of a recipe: from tables to stages.

use super::check::{Checker, Reference};
use super::code::Code;
use super::diagnostic::Draft;
use super::extend::{SET, list_ids};
use super::key_path::{self, Shown, Step, is_bare};
use super::overrides::Overrides;
use super::pool::PoolOptions;
use super::schema::{Schemas, class_of};
use super::source::{NOWHERE, Sources, Span};
use super::suggest::{did_you_mean, listing};
use super::variables;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::error::ConfigError;
use syntable_model::registry::{ConstructError, Constructed, Entry, RecipeValue, Registry, Shape, Slot, Stage};
use syntable_model::scene::AssetClass;
use toml::Spanned;
use toml::de::{DeTable, DeValue, ValueDeserializer};

/// What the stage tables of one recipe need to become stages.
pub(crate) struct Loader<'l> {
    pub registry: &'l Registry,
    pub schemas: &'l Schemas,
    pub overrides: &'l Overrides<'l>,
    pub sources: &'l Sources,
}

/// A stage that was built.
pub(crate) struct BuiltStage<'l> {
    pub slot: Slot,
    pub id: String,
    pub entry: &'l Entry,
    /// The stage; taken by the plan if it makes products from products.
    pub stage: Option<Stage>,
    /// All options, paths in portable form.
    pub options: toml::Table,
    /// Place of the table's header.
    pub header: Span,
    /// The products that it names, with their places.
    pub products: Vec<(String, Span)>,
}

/// All stages that could be built.
pub(crate) struct Built<'l> {
    pub stages: Vec<BuiltStage<'l>>,
    /// Options of the pools, by id.
    pub pools: BTreeMap<String, PoolOptions>,
}

/// A table that is to become a stage.
struct StageTable<'a> {
    slot: Slot,
    id: String,
    /// Place of the id in a keyed slot or of `id` in a list; none if there is no such text.
    id_span: Option<Span>,
    header: Span,
    table: DeTable<'a>,
}

/// What is known of the recipe's names when references are checked.
#[derive(Default)]
struct Names {
    /// Class of each pool; none if its table is broken.
    pools: BTreeMap<String, (Option<AssetClass>, Span)>,
    used: BTreeSet<String>,
    /// Names that the recipe says.
    references: Vec<Reference>,
    /// Names that are defaults of a kind.
    implied: Vec<(&'static str, Reference)>,
    /// Whether a stage that may draw from pools could not be read.
    unread: bool,
}

impl Names {
    /// All names, those that are defaults with the kind that has them.
    fn all(&self) -> impl Iterator<Item = (Option<&'static str>, &Reference)> {
        let said = self.references.iter().map(|reference| (None, reference));
        said.chain(self.implied.iter().map(|(kind, reference)| (Some(*kind), reference)))
    }
}

impl<'l> Loader<'l> {
    /// Builds all stages of the tree and tells all that is wrong.
    pub fn build(&self, tree: &mut DeTable, drafts: &mut Vec<Draft>) -> Built<'l> {
        let mut built = Built { stages: Vec::new(), pools: BTreeMap::new() };
        let mut names = Names::default();
        let mut failed = BTreeSet::new();
        for slot in Slot::ALL {
            let Some(tables) = self.tables(slot, tree, drafts) else {
                names.unread |= matches!(slot, Slot::Place | Slot::Lights);
                failed.insert(slot);
                continue;
            };
            for table in tables {
                if !self.stage(table, &mut built, &mut names, drafts) {
                    failed.insert(slot);
                }
            }
        }
        self.check_pools(&names, drafts);
        built
    }

    /// The tables of a slot; none if the section is missing or broken.
    fn tables<'a>(&self, slot: Slot, tree: &mut DeTable<'a>, drafts: &mut Vec<Draft>) -> Option<Vec<StageTable<'a>>> {
        let Some(value) = tree.remove(slot.name()) else {
            return self.missing(slot, drafts);
        };
        let span = value.span();
        let wrong = |found: &DeValue| {
            let (wanted, write) = match slot.shape() {
                Shape::One => ("a table", format!("write [{slot}] and its options below")),
                Shape::List => ("an array of tables", format!("write [[{slot}]], once for every step")),
                Shape::Keyed => ("a table of tables", format!("write [{slot}.<id>], once for every id")),
            };
            Draft::error(Code::WrongType, span.clone(), format!("`{slot}` must be {wanted}"))
                .label(format!("this is {}", super::check::found(found)))
                .help(write)
        };
        match (slot.shape(), value.into_inner()) {
            (Shape::One, DeValue::Table(table)) => {
                let id = slot.name().to_owned();
                Some(vec![StageTable { slot, id, id_span: None, header: span.clone(), table }])
            }
            (Shape::List, DeValue::Array(items)) => {
                if items.is_empty() && slot == Slot::Place {
                    return self.missing(slot, drafts);
                }
                let ids = list_ids(&items);
                let mut seen: BTreeMap<String, Span> = BTreeMap::new();
                let mut tables = Vec::new();
                for (item, id) in items.into_iter().zip(ids) {
                    let header = item.span();
                    match item.into_inner() {
                        DeValue::Table(mut table) => {
                            let id_value = table.remove("id");
                            if let Some(other) = id_value.as_ref().filter(|id| !id.get_ref().is_str()) {
                                drafts.push(Draft::error(Code::WrongType, other.span(), "`id` must be a text"));
                            }
                            let id_span = id_value.map(|id| id.span());
                            if let Some(span) = &id_span
                                && let Some(first) = seen.insert(id.clone(), span.clone())
                            {
                                let message = format!("two steps of `{slot}` have the id `{id}`");
                                drafts.push(
                                    Draft::error(Code::BadId, span.clone(), message)
                                        .label("again here")
                                        .also(first, "first given here")
                                        .help("ids name the steps' random numbers, so each has its own"),
                                );
                            }
                            tables.push(StageTable { slot, id, id_span, header, table });
                        }
                        other => drafts.push(
                            Draft::error(Code::WrongType, header, format!("an element of `{slot}` must be a table"))
                                .label(format!("this is {}", super::check::found(&other))),
                        ),
                    }
                }
                Some(tables)
            }
            (Shape::Keyed, DeValue::Table(entries)) => {
                if entries.is_empty() && slot == Slot::Write {
                    return self.missing(slot, drafts);
                }
                let mut tables = Vec::new();
                for (key, value) in entries {
                    let (id_span, header) = (Some(key.span()), value.span());
                    let id = key.into_inner().into_owned();
                    match value.into_inner() {
                        DeValue::Table(table) => tables.push(StageTable { slot, id, id_span, header, table }),
                        DeValue::Array(_) => drafts.push(
                            Draft::error(Code::WrongType, header, format!("`{slot}.{id}` must be a table"))
                                .label("this is an array")
                                .help(format!("write [{slot}.{id}] with single brackets")),
                        ),
                        _ => {
                            let kinds = self.registry.of_slot(slot).map(|entry| entry.kind);
                            drafts.push(
                                Draft::error(
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
            (_, other) => {
                drafts.push(wrong(&other));
                None
            }
        }
    }

    /// The kinds that a slot has when a recipe leaves it out.
    fn default_kinds(&self, slot: Slot) -> impl Iterator<Item = &'static str> {
        let kinds = slot.spec().default_kinds;
        let usable =
            move |kind: &&str| self.registry.find(slot, kind).is_some_and(|entry| entry.construct_str("").is_ok());
        kinds.iter().copied().filter(usable)
    }

    /// What stands for a section that is not there.
    fn missing<'a>(&self, slot: Slot, drafts: &mut Vec<Draft>) -> Option<Vec<StageTable<'a>>> {
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
        let (header, example) = match slot.shape() {
            Shape::One => (format!("[{slot}]"), format!("[{slot}] with kind = …")),
            Shape::List => (format!("[[{slot}]]"), format!("[[{slot}]] with kind = …")),
            Shape::Keyed => (format!("[{slot}.<id>]"), format!("[{slot}.{}]", kinds.first().unwrap_or(&"<id>"))),
        };
        drafts.push(
            Draft::error(Code::MissingSection, NOWHERE, format!("a recipe needs `{header}`"))
                .help(lower(slot.doc()))
                .help(format!("add {example}; kinds are {}", listing(kinds))),
        );
        None
    }

    /// Builds one stage; false if it could not be built.
    fn stage(&self, mut given: StageTable, built: &mut Built<'l>, names: &mut Names, drafts: &mut Vec<Draft>) -> bool {
        let slot = given.slot;
        if slot == Slot::Assets {
            let span = given.id_span.clone().unwrap_or(NOWHERE);
            names.pools.insert(given.id.clone(), (None, span));
        }
        if slot.shape() != Shape::One && !is_bare(&given.id) && !given.id.is_empty() {
            let span = given.id_span.clone().unwrap_or_else(|| given.header.clone());
            drafts.push(
                Draft::error(Code::BadId, span, format!("\"{}\" cannot be an id", given.id))
                    .label("an id has letters, digits, `_` and `-`"),
            );
        }
        let Some(entry) = self.kind(&mut given, drafts) else {
            names.unread = true;
            return false;
        };
        let Some(schema) = self.schemas.kind(slot, entry.kind) else { return false };
        let found =
            Checker { definitions: &self.schemas.definitions }.options(entry.kind, &given.table, &given.header, schema);
        let mut ok = found.drafts.is_empty();
        drafts.extend(found.drafts.into_iter().map(|draft| self.of_other_kind(draft, &given, entry)));
        let said: Vec<(Vec<Step>, String)> =
            found.references.iter().map(|reference| (reference.path.clone(), reference.text.clone())).collect();
        let header_span = given.header.clone();
        let mut paths = Vec::new();
        let mut products = Vec::new();
        for reference in found.references {
            match reference.what.as_str() {
                "path" => match self.path(&reference, &mut given.table, drafts) {
                    Some(path) => paths.push((reference.path, path)),
                    None => ok = false,
                },
                what => {
                    if what == "product" {
                        products.push((reference.text.clone(), reference.span.clone()));
                    } else {
                        names.used.insert(reference.text.clone());
                    }
                    names.references.push(reference);
                }
            }
        }
        let for_objects = |name: &str| {
            slot == Slot::Assets
                && !PoolOptions::applies(name, AssetClass::Material)
                && self.schemas.pool_options(entry.kind).any(|option| option == name)
        };
        let object_only: Vec<(String, Span)> = given
            .table
            .keys()
            .filter(|key| for_objects(key.get_ref()))
            .map(|key| (key.get_ref().clone().into_owned(), key.span()))
            .collect();
        let constructed = if ok { self.construct(entry, &given, built, drafts) } else { None };
        let class = match constructed.as_ref().map(|constructed| &constructed.stage) {
            Some(Stage::Assets(source)) => Some(source.class()),
            _ if slot == Slot::Assets => class_of(entry),
            _ => None,
        };
        if slot == Slot::Assets
            && let Some(pool) = names.pools.get_mut(&given.id)
        {
            pool.0 = class;
        }
        if let Some(class) = class.filter(|class| *class != AssetClass::Object) {
            for (option, span) in &object_only {
                ok = false;
                drafts.push(
                    Draft::error(Code::WrongClass, span.clone(), format!("`{option}` applies to objects only"))
                        .label(format!("`{}` gives {class}s", entry.kind)),
                );
            }
        }
        let Some(Constructed { stage, mut options }) = constructed else { return false };
        if slot == Slot::Assets
            && let Some(pool) = built.pools.get(&given.id)
        {
            let pool = toml::Table::try_from(pool).unwrap_or_default();
            let class = class.unwrap_or(AssetClass::Object);
            let of_pool = |name: &str| self.schemas.pool_options(entry.kind).any(|option| option == name);
            options.extend(pool.into_iter().filter(|(name, _)| of_pool(name) && PoolOptions::applies(name, class)));
        }
        for reference in self.implied(entry, &options, schema, &said, &header_span) {
            if reference.what == "product" {
                products.push((reference.text.clone(), reference.span.clone()));
            } else {
                names.used.insert(reference.text.clone());
            }
            names.implied.push((entry.kind, reference));
        }
        for (way, path) in paths {
            if let Some(toml::Value::String(text)) = at_mut(&mut options, &way)
                && path.path.to_str() == Some(text.as_str())
            {
                *text = path.portable;
            }
        }
        let (id, header) = (given.id, given.header);
        built.stages.push(BuiltStage { slot, id, entry, stage: Some(stage), options, header, products });
        ok
    }

    /// Says of an unknown option which kind has it, if the same slot has such a kind.
    fn of_other_kind(&self, draft: Draft, given: &StageTable, entry: &Entry) -> Draft {
        if draft.code != Code::UnknownKey || !draft.marks[0].1.is_empty() {
            return draft;
        }
        let Some(key) = given.table.keys().find(|key| key.span() == *draft.span()) else { return draft };
        let of_slot = self.schemas.kinds.iter().filter(|(slot, kind, _)| *slot == given.slot && *kind != entry.kind);
        let mut having = of_slot.filter(|(_, _, schema)| schema["properties"].get(key.get_ref().as_ref()).is_some());
        match having.next() {
            Some((_, kind, _)) => draft.label(format!("this is an option of the kind `{kind}`")),
            None => draft,
        }
    }

    /// The names among a stage's defaults, which are nowhere in the recipe: they are told of at the table's header.
    fn implied(
        &self,
        entry: &Entry,
        options: &toml::Table,
        schema: &serde_json::Value,
        given: &[(Vec<Step>, String)],
        header: &Span,
    ) -> Vec<Reference> {
        let text = options.to_string();
        let Ok(table) = DeTable::parse(&text) else { return Vec::new() };
        let checker = Checker { definitions: &self.schemas.definitions };
        let found = checker.options(entry.kind, table.get_ref(), header, schema).references;
        // A single name may be written back as an array of one, so the way to it may differ below its option.
        let said = |reference: &Reference| {
            given.iter().any(|(path, text)| path.first() == reference.path.first() && *text == reference.text)
        };
        let implied = found.into_iter().filter(|reference| reference.what != "path" && !said(reference));
        implied.map(|reference| Reference { span: header.clone(), ..reference }).collect()
    }

    /// Takes `kind` off a table and finds its entry.
    fn kind(&self, given: &mut StageTable, drafts: &mut Vec<Draft>) -> Option<&'l Entry> {
        let slot = given.slot;
        let kinds = || self.registry.of_slot(slot).map(|entry| entry.kind);
        let keyed = slot.shape() == Shape::Keyed;
        let (kind, span) = match given.table.remove("kind") {
            Some(value) => match value.get_ref() {
                DeValue::String(kind) => (kind.clone().into_owned(), value.span()),
                _ => {
                    drafts.push(Draft::error(Code::WrongType, value.span(), "`kind` must be a text"));
                    return None;
                }
            },
            None if keyed => (given.id.clone(), given.id_span.clone().unwrap_or_else(|| given.header.clone())),
            None if self.sources.file_of(&given.header).is_some_and(|file| file.name() == SET)
                && self.default_kinds(slot).next().is_some() =>
            {
                // Only an override speaks of this section, which is there with its default kind all the same.
                (self.default_kinds(slot).next().unwrap_or_default().to_owned(), given.header.clone())
            }
            None => {
                let header = if slot.shape() == Shape::List { format!("[[{slot}]]") } else { format!("[{slot}]") };
                let draft = Draft::error(Code::MissingKey, given.header.clone(), format!("`{header}` needs a `kind`"));
                drafts.push(draft.label("add `kind = …`").help(format!("kinds are {}", listing(kinds()))));
                return None;
            }
        };
        let Some(entry) = self.registry.find(slot, &kind) else {
            let mut draft = Draft::error(Code::UnknownKind, span.clone(), format!("`{slot}` has no kind `{kind}`"))
                .label(did_you_mean(&kind, kinds()))
                .help(format!("linked plugins register {}", listing(kinds())));
            let elsewhere = Slot::ALL.into_iter().find(|other| self.registry.find(*other, &kind).is_some());
            if let Some(other) = elsewhere {
                draft = draft.help(format!("`{kind}` is a kind of `{other}`"));
            } else if keyed && Some(&span) == given.id_span.as_ref() {
                draft = draft.help(format!("to call the table `{}` as you like, add `kind = …` to it", given.id));
            } else {
                draft = draft
                    .help("if a plugin of yours registers it, check that its crate is named in your binary's main.rs");
            }
            drafts.push(draft);
            return None;
        };
        if keyed && given.id != kind && self.registry.find(slot, &given.id).is_some() {
            let id = &given.id;
            drafts.push(
                Draft::error(
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
    fn path(&self, reference: &Reference, table: &mut DeTable, drafts: &mut Vec<Draft>) -> Option<variables::Resolved> {
        let file = self.sources.file_of(&reference.span)?;
        drafts.extend(variables::odd(&reference.text, &reference.span));
        let (folder, variable) = (&self.overrides.current_folder, self.overrides.variable);
        let resolved = variables::resolve(&reference.text, &reference.span, file, folder, variable);
        let resolved = resolved.map_err(|draft| drafts.push(draft)).ok()?;
        let value = recipe_at_mut(table, &reference.path)?;
        let Some(text) = resolved.path.to_str() else {
            let message = format!("the path {} is not UTF-8 text", resolved.path.display());
            drafts.push(Draft::error(Code::InvalidValue, reference.span.clone(), message));
            return None;
        };
        *value.get_mut() = DeValue::String(text.to_owned().into());
        Some(resolved)
    }

    /// Lets the kind build its stage, and a pool its options.
    fn construct(
        &self,
        entry: &Entry,
        given: &StageTable,
        built: &mut Built<'l>,
        drafts: &mut Vec<Draft>,
    ) -> Option<Constructed> {
        let header = &given.header;
        let mut table = given.table.clone();
        let mut ok = true;
        if given.slot == Slot::Assets {
            let mut own = DeTable::new();
            for name in self.schemas.pool_options(entry.kind) {
                if let Some((key, value)) = table.remove_entry(name) {
                    own.insert(key, value);
                }
            }
            let spanned = Spanned::new(header.clone(), DeValue::Table(own));
            match PoolOptions::deserialize(ValueDeserializer::from(spanned)) {
                Ok(options) => {
                    if let Err(invalid) = options.validate() {
                        ok = false;
                        drafts.push(refused(invalid, given));
                    }
                    built.pools.insert(given.id.clone(), options);
                }
                Err(error) => {
                    ok = false;
                    drafts.push(malformed(&error, header));
                }
            }
        }
        match entry.construct(Spanned::new(header.clone(), DeValue::Table(table))) {
            Ok(constructed) => Some(constructed).filter(|_| ok),
            Err(ConstructError::Form(error)) => {
                drafts.push(malformed(&error, header));
                None
            }
            Err(ConstructError::Invalid(invalid)) => {
                drafts.push(refused(invalid, given));
                None
            }
        }
    }

    /// Every pool that a stage names must be there and give the right class; every pool should be named.
    fn check_pools(&self, names: &Names, drafts: &mut Vec<Draft>) {
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
                    let mut draft = Draft::error(Code::UnknownPool, reference.span.clone(), message);
                    draft = match kind {
                        Some(kind) => draft.label(default_of(kind, reference)),
                        None => draft.label(did_you_mean(name, of_class())),
                    };
                    draft = match of_class().next() {
                        Some(_) => draft.help(format!("pools of {class}s: {}", listing(of_class()))),
                        None => draft.help(format!("add [assets.{name}] with a kind that gives {class}s")),
                    };
                    drafts.push(draft);
                }
                Some((Some(found), declared)) if found.to_string() != class => {
                    let message = format!("pool `{name}` gives {found}s, but {class}s are wanted");
                    let draft = Draft::error(Code::UnknownPool, reference.span.clone(), message)
                        .label(format!("{class}s are wanted here"))
                        .also(declared.clone(), format!("gives {found}s"));
                    drafts.push(match of_class().next() {
                        Some(_) => draft.help(format!("pools of {class}s: {}", listing(of_class()))),
                        None => draft,
                    });
                }
                _ => {}
            }
        }
        for (id, (_, span)) in &names.pools {
            if !names.used.contains(id) && !names.unread {
                drafts.push(
                    Draft::warning(Code::UnusedPool, span.clone(), format!("nothing draws from the pool `{id}`"))
                        .label("never named"),
                );
            }
        }
    }
}

fn default_of(kind: &str, reference: &Reference) -> String {
    format!("`{kind}` has it as the default of `{}`", Shown(&reference.path))
}

/// The draft for a table that is not of the form of the options, where the schema did not tell.
fn malformed(error: &toml::de::Error, header: &Span) -> Draft {
    Draft::error(Code::InvalidValue, error.span().unwrap_or(header.clone()), error.message().trim_end())
}

/// The draft for a value that a stage refuses.
fn refused(invalid: ConfigError, given: &StageTable) -> Draft {
    let steps = key_path::steps(&invalid.key);
    let (span, whole) = place(&given.table, &steps).unwrap_or((given.header.clone(), false));
    let draft = Draft::error(Code::InvalidValue, span, invalid.message);
    let draft = if whole || steps.is_empty() {
        draft
    } else {
        draft.label(format!("about `{}`, which has its default", invalid.key))
    };
    match invalid.help {
        Some(help) => draft.help(help),
        None => draft,
    }
}

/// The place of the value at a path, or of the nearest value around it, and whether it is the value itself.
fn place(table: &DeTable, steps: &[Step]) -> Option<(Span, bool)> {
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
            None => return Some((value.span(), true)),
        }
    }
    Some((value.span(), true))
}

fn recipe_at_mut<'t, 'a>(table: &'t mut DeTable<'a>, way: &[Step]) -> Option<&'t mut RecipeValue<'a>> {
    let [Step::Key(first), rest @ ..] = way else { return None };
    rest.iter().try_fold(table.get_mut(first.as_str())?, |value, step| match (value.get_mut(), step) {
        (DeValue::Table(table), Step::Key(key)) => table.get_mut(key.as_str()),
        (DeValue::Array(items), Step::Index(index)) => items.get_mut(*index),
        _ => None,
    })
}

fn at_mut<'t>(table: &'t mut toml::Table, way: &[Step]) -> Option<&'t mut toml::Value> {
    let [Step::Key(first), rest @ ..] = way else { return None };
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
