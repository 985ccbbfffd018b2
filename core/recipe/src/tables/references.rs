//! References in options: files, libraries, products, supports and pools.

use crate::merge::variables;
use crate::schema::kinds::KindSchema;
use crate::tables::loader::Loader;
use crate::tables::refusals::first_key;
use crate::tables::slot_tables::StageTable;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{NOWHERE, SET, Span};
use crate::text::suggest::{did_you_mean, listing};
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syntable_model::names::{ObjectPool, PoolName, SupportName};
use syntable_model::pools::ObjectPools;
use syntable_model::registry::{Entry, RecipeValue};
use syntable_model::scene::AssetClass;
use syntable_model::store::is_url;
use syntable_toml_schema::{DisplayPath, Reference, Step, plain_members};
use toml::de::{DeTable, DeValue};

/// An option of a stage that names pools.
#[derive(Debug, Clone, PartialEq)]
pub struct Draw {
    /// The stage and its option, such as `place.drop_box.from`.
    pub option: String,
    /// The pools, whatever the class of their assets.
    pub pools: ObjectPools,
}

/// The names of pools in a recipe: the pools that it has, and the pools that its stages draw from.
#[derive(Default)]
pub(crate) struct PoolNames {
    /// Class of each pool; none if its table is broken.
    pub pools: BTreeMap<String, (Option<AssetClass>, Span)>,
    /// The names that stages refer to, each with the kind whose default it is if the recipe does not give it.
    references: Vec<(Option<&'static str>, Reference)>,
    /// Whether a stage that may draw from pools could not be read.
    pub unread: bool,
}

impl PoolNames {
    /// Adds a name in the options of a stage; `kind` if the name is a default of that kind.
    fn add(&mut self, kind: Option<&'static str>, reference: Reference) {
        self.references.push((kind, reference));
    }

    /// Names that the recipe gives, then names that are defaults.
    fn all(&self) -> impl Iterator<Item = &(Option<&'static str>, Reference)> {
        let given = |given: bool| self.references.iter().filter(move |(kind, _)| kind.is_none() == given);
        given(true).chain(given(false))
    }
}

/// The kinds of references of strings in options: the values of the schema keyword
/// [`REFERENCE`](syntable_toml_schema::REFERENCE).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum ReferenceKind {
    /// A file or a folder.
    Path,
    /// A file whose content the stage reads.
    File,
    /// A native library.
    Library,
    /// A program.
    Program,
    /// A product.
    Product,
    /// A support of the scene.
    Support,
    /// A pool of objects.
    ObjectPool,
    /// A pool of another class.
    OtherPool,
}

impl ReferenceKind {
    fn of(reference: &Reference) -> Self {
        match reference.what.as_str() {
            "path" => Self::Path,
            "file" => Self::File,
            "library" => Self::Library,
            "program" => Self::Program,
            "product" => Self::Product,
            SupportName::REFERENCE => Self::Support,
            ObjectPool::REFERENCE => Self::ObjectPool,
            _ => Self::OtherPool,
        }
    }
}

/// The references in the options of one stage.
#[derive(Default)]
pub(crate) struct StageReferences {
    /// Products, with their bytes.
    pub products: Vec<(String, Span)>,
    /// Supports, with their bytes.
    pub supports: Vec<(String, Span)>,
    /// Pools of objects.
    pub object_pools: BTreeSet<String>,
    /// Paths by their option.
    pub paths: Vec<(Vec<Step>, variables::Resolved)>,
    /// Options with code that the recipe brings: native libraries that a file of the recipe names by a path next to itself, and all
    /// programs, whose arguments may be code, too.
    pub code: Vec<Vec<Step>>,
    /// Whether a path does not exist. The stage is built nevertheless.
    pub absent: bool,
    /// Options with a name that is refused.
    pub wrong: BTreeSet<String>,
}

impl StageReferences {
    /// Adds a product or a pool; `kind` if it is a default of that kind.
    fn add(&mut self, kind: Option<&'static str>, reference: Reference, names: &mut PoolNames) {
        match ReferenceKind::of(&reference) {
            ReferenceKind::Product => self.products.push((reference.text, reference.span)),
            ReferenceKind::ObjectPool => {
                self.object_pools.insert(reference.text.clone());
                names.add(kind, reference);
            }
            ReferenceKind::OtherPool => names.add(kind, reference),
            ReferenceKind::Support if kind.is_none() => self.supports.push((reference.text, reference.span)),
            _ => {}
        }
    }
}

impl Loader<'_, '_> {
    /// The references in the options of a stage. Paths are put into the table in the form in which they are opened.
    pub fn references(
        &self,
        references: Vec<Reference>,
        given: &mut StageTable,
        names: &mut PoolNames,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> StageReferences {
        // An option can be a path and also a file, a library or a program.
        let of_kind = |kind: ReferenceKind| -> BTreeSet<Vec<Step>> {
            let found = references.iter().filter(|reference| ReferenceKind::of(reference) == kind);
            found.map(|reference| reference.path.clone()).collect()
        };
        let paths = of_kind(ReferenceKind::Path);
        let (files, programs) = (of_kind(ReferenceKind::File), of_kind(ReferenceKind::Program));
        let libraries = of_kind(ReferenceKind::Library);
        let mut found = StageReferences::default();
        for reference in references {
            match ReferenceKind::of(&reference) {
                ReferenceKind::File if paths.contains(&reference.path) => {}
                ReferenceKind::Path | ReferenceKind::File => {
                    let Some(path) = self.path(&reference, &mut given.table, diagnostics) else {
                        found.wrong.extend(first_key(&reference.path));
                        continue;
                    };
                    // The stage reports a missing library, because it knows where to get the library.
                    if !libraries.contains(&reference.path) && !(self.overrides.exists)(&path.path) {
                        diagnostics.push(self.absent(&reference, &path.path));
                        found.absent = true;
                    } else if (files.contains(&reference.path) || programs.contains(&reference.path))
                        && path.path.is_dir()
                    {
                        diagnostics.push(folder_for_file(&reference, &path.path));
                        found.absent = true;
                    }
                    found.paths.push((reference.path, path));
                }
                ReferenceKind::Library => {
                    let typed = self.sources.file_of(&reference.span).is_none_or(|file| file.name() == SET);
                    if !typed && !reference.text.starts_with("${") && Path::new(&reference.text).is_relative() {
                        found.code.push(reference.path);
                    }
                }
                ReferenceKind::Program => found.code.push(reference.path),
                ReferenceKind::Product => match self.renamed.product(&reference.text, &reference.span) {
                    Some((diagnostic, new)) => {
                        diagnostics.push(diagnostic);
                        match recipe_at_mut(&mut given.table, &reference.path).map(RecipeValue::get_mut) {
                            // The product under its new name, so that the old name hides no other mistake.
                            Some(value @ DeValue::String(_)) => {
                                *value = DeValue::String(new.clone().into());
                                found.add(None, Reference { text: new, ..reference }, names);
                            }
                            _ => found.wrong.extend(first_key(&reference.path)),
                        }
                    }
                    None => found.add(None, reference, names),
                },
                _ => found.add(None, reference, names),
            }
        }
        found
    }

    /// Adds the names among a stage's defaults, which have no place in the recipe: they are reported at the table's
    /// header. `given` are the names that the recipe gives, with their options.
    pub fn add_defaults(
        &self,
        (entry, kind): (&Entry, &KindSchema),
        options: &toml::Table,
        given: &[(Vec<Step>, String)],
        header: &Span,
        (found, names): (&mut StageReferences, &mut PoolNames),
    ) {
        let outcome = self.schemas.validator().table(entry.kind, plain_members(options), NOWHERE, &kind.options);
        // A single name may be written back as an array of one, so its path may differ below its option.
        let is_given = |reference: &Reference| {
            given.iter().any(|(path, text)| path.first() == reference.path.first() && *text == reference.text)
        };
        for reference in outcome.references.into_iter().filter(|reference| !is_given(reference)) {
            found.add(Some(entry.kind), Reference { span: header.clone(), ..reference }, names);
        }
    }

    /// The options of a stage that name pools, each with the pools.
    pub fn draws(
        &self,
        given: &StageTable,
        entry: &Entry,
        options: &toml::Table,
        schema: &serde_json::Value,
    ) -> Vec<Draw> {
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
            let option = format!("{}.{}", given.name(), DisplayPath(path));
            let pools = at(options, path).and_then(|value| ObjectPools::deserialize(value.clone()).ok());
            if let Some(pools) = pools.filter(|_| draws.iter().all(|draw| draw.option != option)) {
                draws.push(Draw { option, pools });
            }
        }
        draws
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
        let resolved = self.downloaded(resolved, &reference.span, diagnostics)?;
        let value = recipe_at_mut(table, &reference.path)?;
        let Some(text) = resolved.path.to_str() else {
            let message = format!("the path {} is not UTF-8", resolved.path.display());
            diagnostics.push(DiagnosticBuilder::error(Code::InvalidValue, reference.span.clone(), message));
            return None;
        };
        *value.get_mut() = DeValue::String(text.to_owned().into());
        Some(resolved)
    }

    /// The path itself, or the path on this machine for a URL.
    fn downloaded(
        &self,
        resolved: variables::Resolved,
        span: &Span,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<variables::Resolved> {
        let Some(url) = resolved.path.to_str().filter(|path| self.overrides.opens_urls && is_url(path)) else {
            return Some(resolved);
        };
        match self.remote.path(url) {
            Ok(path) => Some(variables::Resolved { path: path?, ..resolved }),
            Err(error) => {
                let diagnostic = DiagnosticBuilder::error(Code::InvalidValue, span.clone(), error.without_help());
                diagnostics.push(error.help_text().into_iter().fold(diagnostic, DiagnosticBuilder::help));
                None
            }
        }
    }

    /// The diagnostic for a path that does not exist. It names the folder from which the path counts.
    fn absent(&self, reference: &Reference, path: &Path) -> DiagnosticBuilder {
        let message = format!("{} does not exist", path.display());
        let diagnostic = DiagnosticBuilder::error(Code::InvalidValue, reference.span.clone(), message);
        let is_set = self.sources.file_of(&reference.span).is_some_and(|file| file.name() == SET);
        match reference.text.strip_prefix("${").and_then(|rest| rest.split_once('}')) {
            Some((name, _)) => diagnostic.label(format!("`{name}` is an environment variable")),
            None if Path::new(&reference.text).is_absolute() => diagnostic,
            None if is_set => diagnostic.label("relative paths of --set start from the current folder"),
            None => diagnostic.label("relative paths start from the folder of the recipe that names them"),
        }
    }

    /// Every pool that a stage names must exist and give the right class; every pool should be named.
    pub fn check_pools(&self, names: &PoolNames, diagnostics: &mut Vec<DiagnosticBuilder>) {
        for (kind, reference) in names.all() {
            let Some(class) = reference.what.strip_prefix("pool:") else { continue };
            let name = &reference.text;
            let of_class = || {
                let gives = move |found: &Option<AssetClass>| found.is_none_or(|found| found.to_string() == class);
                names.pools.iter().filter(move |(_, (found, _))| gives(found)).map(|(id, _)| id.as_str())
            };
            match names.pools.get(name) {
                None => {
                    let message = format!("unknown pool `{name}`");
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
        let used: BTreeSet<&str> = names.all().map(|(_, reference)| reference.text.as_str()).collect();
        for (id, (_, span)) in &names.pools {
            // A recipe that extends another recipe need not draw from all of its pools.
            let own = self.sources.file_of(span).is_some_and(|file| file.is_root());
            if own && !used.contains(id.as_str()) && !names.unread {
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

fn default_of(kind: &str, reference: &Reference) -> String {
    format!("`{kind}` has it as the default of `{}`", DisplayPath(&reference.path))
}

/// The diagnostic for a folder instead of a file.
fn folder_for_file(reference: &Reference, path: &Path) -> DiagnosticBuilder {
    let message = format!("`{}` names a file, but {} is a folder", DisplayPath(&reference.path), path.display());
    DiagnosticBuilder::error(Code::InvalidValue, reference.span.clone(), message).label("name a file in it")
}

/// The value at a path.
pub(crate) fn recipe_at_mut<'t, 'a>(table: &'t mut DeTable<'a>, path: &[Step]) -> Option<&'t mut RecipeValue<'a>> {
    let [Step::Key(first), rest @ ..] = path else { return None };
    rest.iter().try_fold(table.get_mut(first.as_str())?, |value, step| match (value.get_mut(), step) {
        (DeValue::Table(table), Step::Key(key)) => table.get_mut(key.as_str()),
        (DeValue::Array(items), Step::Index(index)) => items.get_mut(*index),
        _ => None,
    })
}

pub(crate) fn at<'t>(table: &'t toml::Table, path: &[Step]) -> Option<&'t toml::Value> {
    let [Step::Key(first), rest @ ..] = path else { return None };
    rest.iter().try_fold(table.get(first)?, |value, step| match step {
        Step::Key(key) => value.get(key),
        Step::Index(index) => value.get(index),
    })
}

pub(crate) fn at_mut<'t>(table: &'t mut toml::Table, path: &[Step]) -> Option<&'t mut toml::Value> {
    let [Step::Key(first), rest @ ..] = path else { return None };
    rest.iter().try_fold(table.get_mut(first)?, |value, step| match (value, step) {
        (toml::Value::Table(table), Step::Key(key)) => table.get_mut(key),
        (toml::Value::Array(items), Step::Index(index)) => items.get_mut(*index),
        _ => None,
    })
}
