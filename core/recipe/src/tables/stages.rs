//! Builds stages from the tables of a recipe.

use crate::merge::variables;
use crate::own_code::OwnCode;
use crate::schema::kinds::KindSchema;
use crate::tables::alternatives::{ONE_OF, has_alternatives};
use crate::tables::check;
use crate::tables::conditions::ViewOptions;
use crate::tables::loader::Loader;
use crate::tables::old_names::rename;
use crate::tables::pool::PoolOptions;
use crate::tables::references::{Draw, PoolNames, StageReferences, at, at_mut};
use crate::tables::refusals::SharedOptions;
use crate::tables::slot_tables::StageTable;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{NOWHERE, Span};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use syntable_model::error::Error;
use syntable_model::registry::{Choice, Constructed, Entry, Slot, Stage};
use syntable_toml_schema::{DisplayPath, Step};
use toml::de::DeTable;

/// A built stage.
pub(crate) struct BuiltStage<'r> {
    pub slot: Slot,
    pub id: String,
    pub entry: &'r Entry,
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
    /// Whether every path that it names exists.
    pub found: bool,
    /// Its alternatives with their weights. A stage with alternatives has no stage of its own.
    pub alternatives: Vec<(f64, BuiltStage<'r>)>,
}

impl<'r> BuiltStage<'r> {
    /// The stage or its alternatives.
    pub fn all(&self) -> impl Iterator<Item = &Self> {
        let only = self.alternatives.is_empty().then_some(self);
        only.into_iter().chain(self.alternatives.iter().map(|(_, stage)| stage))
    }
}

/// All stages that could be built.
#[derive(Default)]
pub(crate) struct Built<'r> {
    pub stages: Vec<BuiltStage<'r>>,
    /// Options of the pools, by id.
    pub pools: BTreeMap<String, PoolOptions>,
    /// Options of `[views]`, whatever its kind.
    pub views: ViewOptions,
    /// Paths that options of other stages name, by the option.
    pub files: Vec<(String, PathBuf)>,
    /// Which pools the stages draw from.
    pub draws: Vec<Draw>,
    /// Code that the recipe brings.
    pub code: Vec<OwnCode>,
    /// Kinds that were chosen, for users.
    pub choices: Vec<String>,
    /// Tables whose kind was not chosen yet.
    pub undecided: Vec<String>,
    /// Slots with a table that could not be built.
    pub failed: BTreeSet<Slot>,
}

impl Built<'_> {
    /// Keeps the options of a stage that all kinds of its slot share.
    fn add_shared(&mut self, id: &str, options: SharedOptions) {
        match options {
            SharedOptions::Pool(pool) => drop(self.pools.insert(id.to_owned(), *pool)),
            SharedOptions::Views(views) => self.views = views,
            SharedOptions::None => {}
        }
    }

    /// Keeps the code that the options of a stage bring: a library, or a program with all that it is called with.
    fn add_code(&mut self, given: &StageTable, code: &[Vec<Step>], options: &toml::Table) {
        for path in code {
            let whole = match path.split_last() {
                Some((_, above)) if !above.is_empty() => above,
                _ => path,
            };
            let value = at(options, whole).map_or_else(String::new, toml::Value::to_string);
            let name = |path| format!("{}.{}", given.name(), DisplayPath(path));
            self.code.push(OwnCode {
                slot: given.slot,
                option: name(path),
                shown: format!("{} = {value}", name(whole)),
            });
        }
    }

    /// Keeps the files that the options of a stage name, and writes paths into the options in portable form.
    fn add_paths(&mut self, given: &StageTable, paths: &[(Vec<Step>, variables::Resolved)], options: &mut toml::Table) {
        for (steps, path) in paths {
            // The catalog of a pool covers its folders and lists, and a denoiser's library is a program.
            if !matches!(given.slot, Slot::Assets | Slot::Denoise) {
                self.files.push((format!("{}.{}", given.name(), DisplayPath(steps)), path.path.clone()));
            }
            if let Some(toml::Value::String(text)) = at_mut(options, steps)
                && path.path.to_str() == Some(text.as_str())
            {
                text.clone_from(&path.portable);
            }
        }
    }
}

impl<'r> Loader<'_, 'r> {
    /// Builds all stages of the tree and reports all mistakes.
    pub fn build(&self, tree: &mut DeTable, diagnostics: &mut Vec<DiagnosticBuilder>) -> Built<'r> {
        let (mut built, mut names) = (Built::default(), PoolNames::default());
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

    /// Builds one stage; false if it could not be built.
    pub(crate) fn stage(
        &self,
        mut given: StageTable,
        built: &mut Built<'r>,
        names: &mut PoolNames,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> bool {
        if has_alternatives(given.slot)
            && let Some(value) = given.table.remove(ONE_OF)
        {
            return self.one_of(given, value, built, names, diagnostics);
        }
        let is_pool = given.slot == Slot::Assets;
        if is_pool {
            names.pools.insert(given.id.clone(), (None, given.id_span.clone().unwrap_or(NOWHERE)));
        }
        diagnostics.extend(given.bad_id());
        let Some(entry) = self.kind(&mut given, diagnostics) else {
            names.unread = true;
            return false;
        };
        let Some(entry) = self.chosen(entry, &given, built, diagnostics) else { return false };
        let Some(kind) = self.schemas.kind(given.slot, entry.kind) else { return false };
        let (checked, valid) = self.reported(entry, kind, &mut given, diagnostics);
        let in_recipe: Vec<(Vec<Step>, String)> =
            checked.references.iter().map(|reference| (reference.path.clone(), reference.text.clone())).collect();
        let mut references = self.references(checked.references, &mut given, names, diagnostics);
        let slot = given.slot;
        let ok = valid && references.wrong.is_empty();
        let constructed = if ok {
            self.construct(entry, &given, diagnostics)
        } else {
            // Mistakes in the other options are reported at the same time.
            let wrong = checked.wrong.union(&references.wrong).cloned().collect();
            self.refusals(entry, &given, &wrong, diagnostics);
            None
        };
        if let Some((class, _)) = names.pools.get_mut(&given.id).filter(|_| is_pool) {
            *class = kind.class;
        }
        let Some((Constructed { stage, mut options }, shared)) = constructed else { return false };
        let of_kind = |name: &str| kind.options["properties"].get(name).is_some();
        options.extend(shared.table().into_iter().filter(|(name, _)| of_kind(name)));
        built.add_shared(&given.id, shared);
        built.draws.extend(self.draws(&given, entry, &options, &kind.options));
        self.add_defaults((entry, kind), &options, &in_recipe, &given.header, (&mut references, names));
        built.add_paths(&given, &references.paths, &mut options);
        built.add_code(&given, &references.code, &options);
        let StageReferences { products, supports, object_pools, absent, .. } = references;
        let (id, header, stage) = (given.id, given.header, Some(stage.of_scenes()));
        let found = !absent;
        built.stages.push(BuiltStage {
            slot,
            id,
            entry,
            stage,
            options,
            header,
            products,
            supports,
            object_pools,
            found,
            alternatives: Vec::new(),
        });
        true
    }

    /// Validates the options of a table under their present names, and reports mistakes. Returns whether the options are valid.
    fn reported(
        &self,
        entry: &Entry,
        kind: &KindSchema,
        given: &mut StageTable,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> (check::Checked, bool) {
        let mut checked = self.checked(entry, kind, given);
        if !checked.renamed.is_empty() {
            diagnostics.extend(checked.diagnostics.into_iter().filter(|found| found.code == Code::Renamed));
            checked.renamed.iter().for_each(|(old, new)| rename(&mut given.table, old, new));
            checked = self.checked(entry, kind, given);
        }
        let found = std::mem::take(&mut checked.diagnostics);
        let valid = found.is_empty();
        diagnostics.extend(found.into_iter().map(|diagnostic| self.of_another_kind(diagnostic, given, kind)));
        (checked, valid)
    }

    /// Validates the options of a table against the schema of its kind.
    fn checked(&self, entry: &Entry, kind: &KindSchema, given: &StageTable) -> check::Checked {
        let pool_renamed = if given.slot == Slot::Assets { self.renamed.pool } else { &[] };
        let renamed = [entry.renamed, pool_renamed];
        check::options(self.schemas.validator(), entry.kind, &given.table, &given.header, &kind.options, &renamed)
    }

    /// The kind that replaces another kind on this machine.
    fn chosen(
        &self,
        entry: &'r Entry,
        given: &StageTable,
        built: &mut Built<'r>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<&'r Entry> {
        let Some(choose) = entry.choose else { return Some(entry) };
        let (slot, table) = (given.slot, given.name());
        if !self.overrides.choose {
            built.undecided.push(table);
            return Some(entry);
        }
        let unknown = |kind: &str| Error::new(format!("it means `{kind}`, which no plugin registers"));
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
}
