//! `extends`, `remove`, `[set]` and `--set`: merges several texts into one tree whose values keep their spans.
//!
//! Every file is read and parsed once. Tables are merged before any stage sees them. The child wins, option by option:
//!
//! - `[dataset]` and stage tables: option by option. A table or array *inside* an option is replaced as a whole, so that
//!   `{ choice = [..] }` never mixes with an inherited `{ uniform = [..] }`;
//! - a stage to which the child gives another `kind`, in its table or by `[set]` or `--set`, keeps those inherited options
//!   that the new kind has, too. A pool keeps none: they say what is in other assets;
//! - `[[place]]` and `[[lights]]` are replaced as a whole when the child gives any;
//! - `remove = ["write.npy"]` removes inherited values, before the child's own are added;
//! - `[set]` reaches anywhere, by paths as in `--set`: `place.objects.count = 5` or `"lights[0].count" = 5`.

use super::Source;
use super::builtin::{self, Builtin};
use super::code::Code;
use super::diagnostic::DiagnosticBuilder;
use super::key_path;
use super::overrides::Overrides;
use super::parse;
use super::schema::{KindSchema, Schemas};
use super::source::{SourceFile, Sources, Span};
use super::suggest::{did_you_mean, listing};
use super::variables::{self, PathRules};
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};
use syntable_model::options::{DisplayPath, Step};
use syntable_model::registry::{RecipeValue, Shape, Slot};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// Maximum length of a chain of `extends`: a longer one is taken for a circle whose paths differ each time.
const MAX_DEPTH: usize = 32;

/// Name of the pseudo-file of overrides.
pub(crate) const SET: &str = "<--set>";

/// All texts of a recipe, parsed, and which extends which.
pub(crate) struct Graph<'a> {
    nodes: Vec<Node<'a>>,
    root: Option<usize>,
    overrides: Vec<Override<'a>>,
    /// Errors of syntax.
    syntax: Vec<DiagnosticBuilder>,
    damage: Damage,
    sources: &'a Sources,
    schemas: &'a Schemas,
}

/// Extent of the damage by syntax errors.
#[derive(Debug, Clone, Default)]
pub(crate) struct Damage {
    /// Whether keys may have been lost, so that a key cannot be said to be missing.
    pub keys_lost: bool,
    /// Bytes that are read as something else than they are.
    pub misread: Vec<Span>,
}

struct Node<'a> {
    file: &'a SourceFile,
    /// The file's table, without `extends`.
    table: DeTable<'a>,
    /// Nodes that it extends, in order.
    bases: Vec<usize>,
    /// Normalized path, by which the same file is recognized.
    identity: Option<PathBuf>,
}

/// One `--set PATH=VALUE`.
struct Override<'a> {
    path: &'a str,
    path_at: usize,
    value: &'a str,
    value_at: usize,
}

/// Reads and parses a recipe and all that it extends.
pub(crate) fn gather<'a>(
    source: Source,
    overrides: &Overrides,
    sources: &'a Sources,
    schemas: &'a Schemas,
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Graph<'a> {
    let name = source.path.as_ref().map_or_else(|| source.name.clone(), |path| path.display().to_string());
    let folder = source.path.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
    let file = sources.add(name, variables::join(&overrides.current_folder, &folder.to_string_lossy()), source.text);
    let identity = match source.path {
        Some(path) => Some(identity(&overrides.current_folder.join(path))),
        None => source.name.starts_with(builtin::PREFIX).then(|| PathBuf::from(&source.name)),
    };
    let mut reader =
        TreeReader { overrides, sources, nodes: Vec::new(), syntax: Vec::new(), damage: Damage::default() };
    let root = reader.visit(file, identity, &mut Vec::new(), diagnostics);
    let TreeReader { nodes, syntax, damage, .. } = reader;
    Graph { nodes, root, overrides: read_overrides(overrides, sources), syntax, damage, sources, schemas }
}

/// Adds the overrides as a pseudo-file of lines `path=value`.
fn read_overrides<'a>(overrides: &Overrides, sources: &'a Sources) -> Vec<Override<'a>> {
    if overrides.set.is_empty() {
        return Vec::new();
    }
    let text: String = overrides.set.iter().map(|(path, value)| format!("{path}={value}\n")).collect();
    let file = sources.add(SET.to_owned(), overrides.current_folder.clone(), text);
    let mut at = 0;
    let lines = overrides.set.iter().map(|(path, value)| {
        let value_start = at + path.len() + 1;
        let end = value_start + value.len();
        let (path, value) = (&file.text()[at..value_start - 1], &file.text()[value_start..end]);
        let line = Override { path, path_at: file.start() + at, value, value_at: file.start() + value_start };
        at = end + 1;
        line
    });
    lines.collect()
}

struct TreeReader<'r, 'a> {
    overrides: &'r Overrides<'r>,
    sources: &'a Sources,
    nodes: Vec<Node<'a>>,
    syntax: Vec<DiagnosticBuilder>,
    damage: Damage,
}

impl<'a> TreeReader<'_, 'a> {
    /// Parses a file and visits what it extends. `parents` leads from the root to this file.
    fn visit(
        &mut self,
        file: &'a SourceFile,
        identity: Option<PathBuf>,
        parents: &mut Vec<usize>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<usize> {
        let mut parsed = parse::parse_file(file);
        self.damage.keys_lost |= parsed.keys_lost;
        self.damage.misread.extend(parsed.misread);
        self.syntax.extend(parsed.errors);
        let extends = parsed.table.remove("extends");
        let index = self.nodes.len();
        self.nodes.push(Node { file, table: parsed.table, bases: Vec::new(), identity });
        parents.push(index);
        for (text, span) in extends.map_or_else(Vec::new, |value| strings(&value, "extends", diagnostics)) {
            let base = self.base(&text, &span, file, parents, diagnostics);
            self.nodes[index].bases.extend(base);
        }
        parents.pop();
        Some(index)
    }

    fn base(
        &mut self,
        text: &str,
        span: &Span,
        file: &SourceFile,
        parents: &mut Vec<usize>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<usize> {
        let overrides = self.overrides;
        let embedded = builtin::name_of(text, file.name());
        let path = match &embedded {
            Some(name) => PathBuf::from(format!("{}{name}", builtin::PREFIX)),
            None => {
                let (folder, rules) = (&overrides.current_folder, &PathRules::default());
                let resolved = variables::resolve(text, span, file, folder, overrides.variable, rules);
                resolved.map_err(|diagnostic| diagnostics.push(diagnostic)).ok()?.path
            }
        };
        let identity = identity(&path);
        let known = self.nodes.iter().position(|node| node.identity.as_ref() == Some(&identity));
        if let Some(circle) = known.and_then(|known| parents.iter().position(|&node| node == known)) {
            let mut chain: Vec<&str> = parents[circle..].iter().map(|&node| self.nodes[node].file.name()).collect();
            chain.push(chain[0]);
            diagnostics.push(
                DiagnosticBuilder::error(Code::Extends, span.clone(), "recipes extend each other in a circle")
                    .label("this closes the circle")
                    .help(chain.join(" → ")),
            );
            return None;
        }
        if known.is_some() {
            return known;
        }
        let refuse = |message: String| DiagnosticBuilder::error(Code::Extends, span.clone(), message);
        if parents.len() >= MAX_DEPTH {
            diagnostics.push(refuse(format!("more than {MAX_DEPTH} recipes extend one another")));
            return None;
        }
        if let Some(name) = embedded {
            return match Builtin::find(&name) {
                Ok(builtin) => {
                    let source = builtin.source();
                    let base = self.sources.add(source.name, overrides.current_folder.clone(), source.text);
                    self.visit(base, Some(identity), parents, diagnostics)
                }
                Err(error) => {
                    let refused = refuse(error.message().to_owned());
                    diagnostics.push(match error.help_text() {
                        Some(help) => refused.help(help),
                        None => refused,
                    });
                    None
                }
            };
        }
        match (overrides.read)(&path) {
            Ok(content) => {
                let folder = path.parent().unwrap_or(Path::new("")).to_owned();
                let base = self.sources.add(near_name(file, text, &path), folder, content);
                self.visit(base, Some(identity), parents, diagnostics)
            }
            Err(error) => {
                let error = error.to_string().to_lowercase();
                diagnostics.push(
                    refuse(format!("cannot read the extended recipe `{text}`: {error}"))
                        .help(format!("looked for {}", path.display())),
                );
                None
            }
        }
    }
}

impl<'a> Graph<'a> {
    /// Merges all tables into one, and reports the extent of the damage by syntax errors.
    pub fn merge(self, diagnostics: &mut Vec<DiagnosticBuilder>) -> (DeTable<'a>, Damage) {
        let mut merged = vec![None; self.nodes.len()];
        let mut tree = self.root.map_or_else(DeTable::new, |root| self.node(root, &mut merged, diagnostics));
        for line in &self.overrides {
            let value = match parse::parse_value(line.value, line.value_at) {
                Ok(value) => value,
                Err(diagnostic) => {
                    diagnostics.push(diagnostic);
                    continue;
                }
            };
            if line.path == "remove" {
                for (path, span) in strings(&value, "remove", diagnostics) {
                    diagnostics.extend(remove(&mut tree, &path, &span).err());
                }
                continue;
            }
            let help = match line.path.split(['.', '[']).next() {
                Some("extends") => Some("write a recipe with `extends`, a list of both, and run that"),
                Some("set") => Some("leave `set.` out: --set takes the paths of [set]"),
                _ => None,
            };
            let path_span = line.path_at..line.path_at + line.path.len();
            let result = match help {
                Some(help) => Err(DiagnosticBuilder::error(
                    Code::BadOverride,
                    path_span,
                    format!("`{}` cannot be set from the command line", line.path),
                )
                .help(help)),
                None => read_path(line.path, line.path_at).and_then(|steps| self.set(&mut tree, &steps, value)),
            };
            diagnostics.extend(result.err());
        }
        diagnostics.extend(self.syntax);
        (tree, self.damage)
    }

    /// The table of a node with all that it extends. `merged` keeps it: several recipes can extend one.
    fn node(
        &self,
        index: usize,
        merged: &mut [Option<DeTable<'a>>],
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> DeTable<'a> {
        if let Some(tree) = &merged[index] {
            return tree.clone();
        }
        let mut own = self.nodes[index].table.clone();
        let (removals, sets) = (own.remove("remove"), own.remove("set"));
        let bases = &self.nodes[index].bases;
        let bases = bases.iter().map(|&base| self.node(base, merged, diagnostics));
        let mut tree = bases.reduce(|one, other| self.merge_trees(one, other)).unwrap_or_default();
        let removals = removals.map_or_else(Vec::new, |value| strings(&value, "remove", diagnostics));
        for (path, span) in removals {
            diagnostics.extend(remove(&mut tree, &path, &span).err());
        }
        tree = self.merge_trees(tree, own);
        match sets.map(|sets| (sets.span(), sets.into_inner())) {
            Some((_, DeValue::Table(sets))) => {
                self.put(&mut tree, (index, &[]), sets, &mut Vec::new(), diagnostics);
            }
            Some((span, _)) => diagnostics.push(wrong_type(span, "set", "a table of paths and values")),
            None => {}
        }
        merged[index] = Some(tree.clone());
        tree
    }

    /// Puts the values of `[set]` into a tree. Their paths are quoted keys, dotted keys, or both, below `parents`; `seen`
    /// has those that were set before.
    fn put(
        &self,
        tree: &mut DeTable<'a>,
        (node, parents): (usize, &[(Step, Span)]),
        sets: DeTable<'a>,
        seen: &mut Vec<(Vec<Step>, Span)>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) {
        let file = &self.nodes[node].file;
        for (key, value) in sets {
            let span = key.span();
            // A quoted key starts a byte before its text.
            let quote = usize::from(span.len() > key.get_ref().len());
            let steps = match read_path(key.get_ref(), span.start + quote) {
                Ok(steps) => parents.iter().cloned().chain(steps).collect::<Vec<_>>(),
                Err(diagnostic) => {
                    diagnostics.push(diagnostic);
                    continue;
                }
            };
            // A table in braces is a value; one that dots or a header made is a part of the path.
            let value_span = value.span();
            let inline = file.text()[value_span.start - file.start()..].starts_with('{');
            match value.into_inner() {
                DeValue::Table(inner) if !inline => self.put(tree, (node, &steps), inner, seen, diagnostics),
                other => {
                    let place = by_index(tree, &steps);
                    diagnostics.extend(set_before(&place, &display(&steps), &span, seen));
                    seen.push((place, span));
                    diagnostics.extend(self.set(tree, &steps, Spanned::new(value_span, other)).err());
                }
            }
        }
    }

    /// Puts a value at a path. A stage that gets another kind so loses what it has of the old one.
    fn set(
        &self,
        tree: &mut DeTable<'a>,
        steps: &[(Step, Span)],
        value: RecipeValue<'a>,
    ) -> Result<(), DiagnosticBuilder> {
        let kind = value.get_ref().as_str().map(str::to_owned);
        if let (Some(kind), Some((slot, id))) = (kind, stage_of_kind(steps))
            && let Ok(Cursor::Value(stage)) = enter_all(tree, &steps[..steps.len() - 1])
            && kind_of(stage, &id).is_none_or(|old| old != kind)
            && let DeValue::Table(options) = stage.get_mut()
        {
            let file = |span: &Span| self.sources.file_of(span).map(|file| file.start());
            let given = file(&value.span());
            // What is written beside the new kind is a mistake if the kind has no such option.
            let beside = |name: &Span| file(name) == given;
            let keeps = |name: &str| ["id", "kind"].contains(&name) || self.carries(slot, &kind, name);
            let old = std::mem::replace(options, DeTable::new());
            *options = old.into_iter().filter(|(name, _)| beside(&name.span()) || keeps(name.get_ref())).collect();
        }
        set(tree, steps, value)
    }

    /// Whether a stage that gets this kind keeps an option of the kind that it had.
    fn carries(&self, slot: Slot, kind: &str, option: &str) -> bool {
        let has = |kind: &KindSchema| kind.options["properties"].get(option).is_some();
        slot != Slot::Assets && self.schemas.kind(slot, kind).is_some_and(has)
    }

    /// Merges a child's tables over its base's.
    fn merge_trees(&self, mut base: DeTable<'a>, child: DeTable<'a>) -> DeTable<'a> {
        for (key, value) in child {
            let merged = match base.remove(key.get_ref().as_ref()) {
                None => value,
                Some(old) => {
                    let slot = Slot::ALL.into_iter().find(|slot| slot.name() == key.get_ref().as_ref());
                    match slot.map(|slot| (slot, slot.shape())) {
                        Some((slot, Shape::One)) => self.merge_stages(slot, "", old, value),
                        Some((_, Shape::List)) => value,
                        Some((slot, _)) => {
                            merge_tables(old, value, &|id, old, new| self.merge_stages(slot, id, old, new))
                        }
                        None if key.get_ref() == "dataset" => merge_tables(old, value, &|_, _, new| new),
                        None => value,
                    }
                }
            };
            base.insert(key, merged);
        }
        base
    }

    /// Merges two stage tables. Of another kind the new one gets those options that it has, too.
    fn merge_stages(&self, slot: Slot, id: &str, mut old: RecipeValue<'a>, new: RecipeValue<'a>) -> RecipeValue<'a> {
        let own_kind = new.get_ref().as_table().and_then(|table| table.get("kind"));
        if let Some(kind) = own_kind.and_then(|kind| kind.get_ref().as_str())
            && kind_of(&old, id).is_none_or(|old| old != kind)
            && let DeValue::Table(options) = old.get_mut()
        {
            let all = std::mem::replace(options, DeTable::new());
            *options = all.into_iter().filter(|(name, _)| self.carries(slot, kind, name.get_ref())).collect();
        }
        merge_tables(old, new, &|_, _, new| new)
    }
}

/// The kind that a stage table has: what it says, or its id.
fn kind_of(stage: &RecipeValue, id: &str) -> Option<String> {
    let table = stage.get_ref().as_table()?;
    let said = table.get("kind").and_then(|kind| kind.get_ref().as_str());
    said.or_else(|| Some(id).filter(|id| !id.is_empty())).map(str::to_owned)
}

/// The slot of the stage whose `kind` is at a path, and its id if a table's key gives that.
fn stage_of_kind(steps: &[(Step, Span)]) -> Option<(Slot, String)> {
    let ((Step::Key(first), _), (Step::Key(last), _)) = (steps.first()?, steps.last()?) else { return None };
    let slot = Slot::ALL.into_iter().find(|slot| slot.name() == first).filter(|_| last == "kind")?;
    match (slot.shape(), steps) {
        (Shape::One, [_, _]) | (Shape::List, [_, _, _]) => Some((slot, String::new())),
        (Shape::Keyed, [_, (Step::Key(id), _), _]) => Some((slot, id.clone())),
        _ => None,
    }
}

/// Reads a string, or an array of strings.
fn strings(value: &RecipeValue, key: &str, diagnostics: &mut Vec<DiagnosticBuilder>) -> Vec<(String, Span)> {
    match value.get_ref() {
        DeValue::String(text) => vec![(text.clone().into_owned(), value.span())],
        DeValue::Array(items) => items
            .iter()
            .flat_map(|item| match item.get_ref() {
                DeValue::String(text) => Some((text.clone().into_owned(), item.span())),
                _ => {
                    diagnostics.push(wrong_type(item.span(), key, "a string or an array of strings"));
                    None
                }
            })
            .collect(),
        _ => {
            diagnostics.push(wrong_type(value.span(), key, "a string or an array of strings"));
            Vec::new()
        }
    }
}

fn wrong_type(span: Span, key: &str, wanted: &str) -> DiagnosticBuilder {
    DiagnosticBuilder::error(Code::WrongType, span, format!("`{key}` must be {wanted}"))
}

/// Displays the path of a base relative to how the file that names it was given.
fn near_name(file: &SourceFile, text: &str, path: &Path) -> String {
    if text.starts_with("${") || Path::new(text).is_absolute() {
        return path.display().to_string();
    }
    let folder = Path::new(file.name()).parent().unwrap_or(Path::new(""));
    let name: PathBuf = folder.join(text).components().collect();
    name.display().to_string()
}

/// Normalizes a path lexically, so that one file has one.
fn identity(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir if out.file_name().is_some() => {
                out.pop();
            }
            Component::CurDir => {}
            other => out.push(other),
        }
    }
    out
}

/// Merges two tables key by key; `both` decides where both have a key. The result has the span of the new one.
fn merge_tables<'a>(
    old: RecipeValue<'a>,
    new: RecipeValue<'a>,
    both: &dyn Fn(&str, RecipeValue<'a>, RecipeValue<'a>) -> RecipeValue<'a>,
) -> RecipeValue<'a> {
    let span = new.span();
    match (old.into_inner(), new.into_inner()) {
        (DeValue::Table(mut base), DeValue::Table(child)) => {
            for (key, value) in child {
                let value = match base.remove(key.get_ref().as_ref()) {
                    Some(old) => both(key.get_ref(), old, value),
                    None => value,
                };
                base.insert(key, value);
            }
            Spanned::new(span, DeValue::Table(base))
        }
        (_, new) => Spanned::new(span, new),
    }
}

/// The ids of the stages of a list: `id` where given, else the kind, with `_2`, `_3` … appended on repeats.
pub(crate) fn list_ids(items: &DeArray) -> Vec<String> {
    let text = |item: &RecipeValue, key: &str| {
        let value = item.get_ref().as_table().and_then(|table| table.get(key));
        value.and_then(|value| value.get_ref().as_str().map(str::to_owned))
    };
    let mut taken: BTreeSet<String> = items.iter().filter_map(|item| text(item, "id")).collect();
    items
        .iter()
        .map(|item| {
            text(item, "id").unwrap_or_else(|| {
                let kind = text(item, "kind").unwrap_or_default();
                let mut numbered = std::iter::once(kind.clone()).chain((2..).map(|n: u64| format!("{kind}_{n}")));
                let id = numbered.find(|id| !taken.contains(id)).expect("there are more numbers than stages");
                taken.insert(id.clone());
                id
            })
        })
        .collect()
}

/// A path with the elements of lists by index, so that each place has one.
fn by_index(tree: &DeTable, steps: &[(Step, Span)]) -> Vec<Step> {
    let mut place: Vec<Step> = steps.iter().map(|(step, _)| step.clone()).collect();
    let Some(Step::Key(first)) = place.first() else { return place };
    let mut value = tree.get(first.as_str());
    for step in &mut place[1..] {
        value = match (value.map(Spanned::get_ref), &*step) {
            (Some(DeValue::Table(table)), Step::Key(key)) => table.get(key.as_str()),
            (Some(DeValue::Array(items)), Step::Index(index)) => items.get(*index),
            (Some(DeValue::Array(items)), Step::Key(id)) => {
                match list_ids(items).iter().position(|other| other == id) {
                    Some(index) => {
                        *step = Step::Index(index);
                        items.get(index)
                    }
                    None => None,
                }
            }
            _ => None,
        };
    }
    place
}

/// The diagnostic for a place that `[set]` sets twice, or sets as a part and then as a whole.
fn set_before(place: &[Step], path: &str, span: &Span, seen: &[(Vec<Step>, Span)]) -> Option<DiagnosticBuilder> {
    let (other, other_span) = seen.iter().find(|(other, _)| other.starts_with(place))?;
    let mut spans = [other_span, span];
    spans.sort_by_key(|span| span.start);
    let [first, second] = spans;
    let message = match other.len() == place.len() {
        true => format!("`{path}` is set twice"),
        false => format!("`{}` is set, and `{path}` as a whole", DisplayPath(other)),
    };
    let diagnostic = DiagnosticBuilder::error(Code::DuplicateKey, second.clone(), message);
    Some(diagnostic.label("again here; keep one of them").also(first.clone(), "first set here"))
}

/// Puts a value at a path; missing tables along it are created.
fn set<'a>(root: &mut DeTable<'a>, steps: &[(Step, Span)], value: RecipeValue<'a>) -> Result<(), DiagnosticBuilder> {
    let (last, parents) = steps.split_last().expect("a path has a step");
    let mut cursor = Cursor::Root(root);
    for (done, (step, span)) in parents.iter().enumerate() {
        let make = matches!(steps[done + 1].0, Step::Key(_));
        cursor = cursor.enter(step, span, &steps[..done], make)?;
    }
    let (step, span) = last;
    match (cursor.table(), step) {
        (Ok(table), Step::Key(key)) => {
            table.remove(key.as_str());
            table.insert(Spanned::new(span.clone(), key.clone().into()), value);
            Ok(())
        }
        (Ok(_), Step::Index(_)) => Err(cannot(span, parents, "is a table, not an array; name a key of it")),
        (Err(other), step) => {
            *other.element(step, span, parents)? = value;
            Ok(())
        }
    }
}

/// Removes the value at a path.
fn remove(root: &mut DeTable, path: &str, span: &Span) -> Result<(), DiagnosticBuilder> {
    // The string may hold escapes, so steps have no bytes of their own: mistakes mark the whole string.
    let steps: Vec<(Step, Span)> =
        read_path(path, span.start)?.into_iter().map(|(step, _)| (step, span.clone())).collect();
    let (last, parents) = steps.split_last().expect("a path has a step");
    match (enter_all(root, parents)?.table(), &last.0) {
        (Ok(table), Step::Key(key)) => {
            if table.remove(key.as_str()).is_none() {
                return Err(absent(span, &steps, key, table));
            }
            Ok(())
        }
        (Ok(_), Step::Index(_)) => Err(cannot(span, parents, "is a table, not an array; name a key of it")),
        (Err(Cursor::Value(value)), step) => {
            let at = index_of(value, step, span, parents)?;
            let DeValue::Array(items) = value.get_mut() else { unreachable!("an index is of an array") };
            let all = std::mem::replace(items, DeArray::new());
            *items = all.into_iter().enumerate().filter(|(i, _)| *i != at).map(|(_, item)| item).collect();
            Ok(())
        }
        (Err(Cursor::Root(_)), _) => unreachable!("the root is a table"),
    }
}

/// The position at the end of a path that is there.
fn enter_all<'t, 'a>(root: &'t mut DeTable<'a>, steps: &[(Step, Span)]) -> Result<Cursor<'t, 'a>, DiagnosticBuilder> {
    let mut cursor = Cursor::Root(root);
    for (done, (step, span)) in steps.iter().enumerate() {
        cursor = cursor.enter(step, span, &steps[..done], false)?;
    }
    Ok(cursor)
}

fn read_path(path: &str, at: usize) -> Result<Vec<(Step, Span)>, DiagnosticBuilder> {
    let shift = |range: Range<usize>| range.start + at..range.end + at;
    match key_path::parse(path) {
        Ok(steps) => Ok(steps.into_iter().map(|(step, range)| (step, shift(range))).collect()),
        Err((message, range)) => Err(DiagnosticBuilder::error(
            Code::BadOverride,
            shift(range),
            format!("`{path}` is not the path of an option"),
        )
        .label(message)
        .help("paths look like `render.samples_per_pixel`, `lights[0].count` or `place.objects.count`")),
    }
}

/// A position on a path through a tree.
enum Cursor<'t, 'a> {
    Root(&'t mut DeTable<'a>),
    Value(&'t mut RecipeValue<'a>),
}

impl<'t, 'a> Cursor<'t, 'a> {
    /// The table at this position, or the position if there is none.
    fn table(self) -> Result<&'t mut DeTable<'a>, Self> {
        match self {
            Self::Root(table) => Ok(table),
            Self::Value(value) if !value.get_ref().is_table() => Err(Self::Value(value)),
            Self::Value(value) => match value.get_mut() {
                DeValue::Table(table) => Ok(table),
                _ => unreachable!("a table was seen"),
            },
        }
    }

    /// Takes one step. `parents` holds the steps before it.
    fn enter(self, step: &Step, span: &Span, parents: &[(Step, Span)], make: bool) -> Result<Self, DiagnosticBuilder> {
        match (self.table(), step) {
            (Ok(table), Step::Key(key)) => {
                if !table.contains_key(key.as_str()) {
                    if !make {
                        let all: Vec<(Step, Span)> =
                            parents.iter().cloned().chain([(step.clone(), span.clone())]).collect();
                        return Err(absent(span, &all, key, table));
                    }
                    let empty = Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
                    table.insert(Spanned::new(span.clone(), key.clone().into()), empty);
                }
                Ok(Self::Value(table.get_mut(key.as_str()).expect("it is there or was made")))
            }
            (Ok(_), Step::Index(_)) => Err(cannot(span, parents, "is a table, not an array; name a key of it")),
            (Err(other), step) => other.element(step, span, parents).map(Self::Value),
        }
    }

    fn element(
        self,
        step: &Step,
        span: &Span,
        parents: &[(Step, Span)],
    ) -> Result<&'t mut RecipeValue<'a>, DiagnosticBuilder> {
        let Self::Value(value) = self else { unreachable!("the root is a table") };
        let at = index_of(value, step, span, parents)?;
        match value.get_mut() {
            DeValue::Array(items) => Ok(items.get_mut(at).expect("the index was checked")),
            _ => unreachable!("an index is of an array"),
        }
    }
}

/// The index of a step in an array: the index itself, or that of the stage with this id.
fn index_of(
    value: &RecipeValue,
    step: &Step,
    span: &Span,
    parents: &[(Step, Span)],
) -> Result<usize, DiagnosticBuilder> {
    let DeValue::Array(items) = value.get_ref() else {
        let message = format!("is {}, so there is nothing inside it", super::check::type_of(value));
        return Err(cannot(span, parents, &message));
    };
    match step {
        Step::Index(index) if *index < items.len() => Ok(*index),
        Step::Index(_) if items.is_empty() => Err(cannot(span, parents, "is empty")),
        Step::Index(_) => {
            let plural = if items.len() == 1 { "" } else { "s" };
            let message = format!("has {} element{plural}; the last is [{}]", items.len(), items.len() - 1);
            Err(cannot(span, parents, &message))
        }
        Step::Key(key) => {
            let all_tables = items.iter().all(|item| item.get_ref().is_table());
            let ids = if all_tables { list_ids(items) } else { Vec::new() };
            ids.iter().position(|id| id == key).ok_or_else(|| {
                let names: Vec<&str> = ids.iter().map(String::as_str).filter(|id| !id.is_empty()).collect();
                let diagnostic = cannot(span, parents, &format!("has no element `{key}`"))
                    .label(did_you_mean(key, names.iter().copied()));
                if names.is_empty() {
                    diagnostic.help("name its elements by index: [0], [1], …")
                } else {
                    diagnostic.help(format!("its elements are {}; or name one by index: [0]", listing(names)))
                }
            })
        }
    }
}

fn cannot(span: &Span, parents: &[(Step, Span)], message: &str) -> DiagnosticBuilder {
    DiagnosticBuilder::error(Code::BadOverride, span.clone(), format!("`{}` {message}", display(parents)))
}

fn absent(span: &Span, steps: &[(Step, Span)], key: &str, table: &DeTable) -> DiagnosticBuilder {
    let keys: Vec<&str> = table.keys().map(|key| key.get_ref().as_ref()).collect();
    let path = display(steps);
    DiagnosticBuilder::error(Code::BadOverride, span.clone(), format!("there is no `{path}`"))
        .label(did_you_mean(key, keys.iter().copied()))
        .help(format!("there is {}", listing(keys)))
}

fn display(steps: &[(Step, Span)]) -> String {
    let steps: Vec<Step> = steps.iter().map(|(step, _)| step.clone()).collect();
    DisplayPath(&steps).to_string()
}
