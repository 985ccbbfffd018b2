//! `extends`, `remove`, `[set]` and `--set`: several texts become one tree, and every value remembers its place.
//!
//! The texts are merged as tables, before any stage sees them. The child wins, and it wins at a definite depth:
//!
//! - `[dataset]` and stage tables: option by option. A table or array *inside* an option is replaced as a whole, so that
//!   `{ choice = [..] }` never mixes with an inherited `{ uniform = [..] }`;
//! - a stage table to which the child gives another `kind` is replaced as a whole, since its options are others;
//! - `[[place]]` and `[[lights]]` are replaced as a whole when the child gives any;
//! - `remove = ["write.npy"]` takes inherited values away, before the child's own are added;
//! - `[set]` reaches anywhere, by paths as in `--set`: `place.objects.count = 5` or `"lights[0].count" = 5`.

use super::code::Code;
use super::diagnostic::Draft;
use super::key_path::{self, Shown, Step};
use super::overrides::Overrides;
use super::parse;
use super::source::{SourceFile, Sources, Span};
use super::suggest::{did_you_mean, listing};
use super::{Source, variables};
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;
use syntable_model::registry::{RecipeValue, Shape, Slot};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

/// Files deeper than this are taken for a circle that names itself differently each time.
const DEEPEST: usize = 32;

/// The name of the pseudo-file of overrides.
pub(crate) const SET: &str = "<--set>";

/// All texts of a recipe, and which extends which.
pub(crate) struct Graph {
    nodes: Vec<Node>,
    root: Option<usize>,
    sets: Option<Sets>,
}

/// What syntax errors made of the texts.
#[derive(Default)]
pub(crate) struct Damage {
    /// Keys may have been swallowed, so that a missing key proves nothing.
    pub lossy: bool,
    /// Places that are read as something else than they are.
    pub adrift: Vec<Span>,
}

struct Node {
    file: Arc<SourceFile>,
    /// Nodes that it extends, in order.
    bases: Vec<usize>,
    /// The path by which it is known again.
    identity: Option<PathBuf>,
}

struct Sets {
    file: Arc<SourceFile>,
    /// Bytes of path and value of each override.
    entries: Vec<(Range<usize>, Range<usize>)>,
}

/// Reads a recipe and all that it extends.
pub(crate) fn gather(source: Source, overrides: &Overrides, sources: &mut Sources, drafts: &mut Vec<Draft>) -> Graph {
    let mut graph = Graph { nodes: Vec::new(), root: None, sets: None };
    let name = source.path.as_ref().map_or_else(|| source.name.clone(), |path| path.display().to_string());
    let folder = source.path.as_deref().and_then(Path::parent).unwrap_or(Path::new(""));
    let file = sources.add(name, variables::join(&overrides.current_folder, &folder.to_string_lossy()), source.text);
    let identity = source.path.map(|path| identity(&overrides.current_folder.join(path)));
    graph.root = graph.visit(file, identity, &mut Vec::new(), overrides, sources, drafts);
    if !overrides.set.is_empty() {
        let (mut text, mut entries) = (String::new(), Vec::new());
        for (path, value) in &overrides.set {
            let path_start = text.len();
            text += path;
            text.push('=');
            let value_start = text.len();
            text += value;
            entries.push((path_start..value_start - 1, value_start..text.len()));
            text.push('\n');
        }
        let file = sources.add(SET.to_owned(), overrides.current_folder.clone(), text);
        graph.sets = Some(Sets { file, entries });
    }
    graph
}

impl Graph {
    fn visit(
        &mut self,
        file: Arc<SourceFile>,
        identity: Option<PathBuf>,
        above: &mut Vec<usize>,
        overrides: &Overrides,
        sources: &mut Sources,
        drafts: &mut Vec<Draft>,
    ) -> Option<usize> {
        let index = self.nodes.len();
        self.nodes.push(Node { file: Arc::clone(&file), bases: Vec::new(), identity });
        above.push(index);
        for (text, span) in extended(&file, drafts) {
            let base = self.base(&text, &span, &file, above, overrides, sources, drafts);
            self.nodes[index].bases.extend(base);
        }
        above.pop();
        Some(index)
    }

    #[expect(clippy::too_many_arguments, reason = "one step of a recursion over all of them")]
    fn base(
        &mut self,
        text: &str,
        span: &Span,
        file: &SourceFile,
        above: &mut Vec<usize>,
        overrides: &Overrides,
        sources: &mut Sources,
        drafts: &mut Vec<Draft>,
    ) -> Option<usize> {
        let resolved = variables::resolve(text, span, file, &overrides.current_folder, overrides.variable);
        let path = resolved.map_err(|draft| drafts.push(draft)).ok()?.path;
        let identity = identity(&path);
        let known = self.nodes.iter().position(|node| node.identity.as_ref() == Some(&identity));
        if let Some(circle) = known.and_then(|known| above.iter().position(|&node| node == known)) {
            let mut chain: Vec<&str> = above[circle..].iter().map(|&node| self.nodes[node].file.name()).collect();
            chain.push(chain[0]);
            drafts.push(
                Draft::error(Code::Extends, span.clone(), "recipes extend each other in a circle")
                    .label("this closes the circle")
                    .help(chain.join(" → ")),
            );
            return None;
        }
        if known.is_some() {
            return known;
        }
        let refuse = |message: String| Draft::error(Code::Extends, span.clone(), message);
        if above.len() >= DEEPEST {
            drafts.push(refuse(format!("more than {DEEPEST} recipes extend one another")));
            return None;
        }
        let name = near_name(file, text, &path);
        match (overrides.read)(&path) {
            Ok(content) => {
                let folder = path.parent().unwrap_or(Path::new("")).to_owned();
                let base = sources.add(name, folder, content);
                self.visit(base, Some(identity), above, overrides, sources, drafts)
            }
            Err(error) => {
                let error = error.to_string().to_lowercase();
                drafts.push(
                    refuse(format!("cannot read the extended recipe `{text}`: {error}"))
                        .help(format!("looked for {}", path.display())),
                );
                None
            }
        }
    }

    /// The merged tree, and what syntax errors made of it.
    pub fn merge<'a>(&'a self, drafts: &mut Vec<Draft>) -> (DeTable<'a>, Damage) {
        let mut damage = Damage::default();
        let parsed: Vec<DeTable> = self
            .nodes
            .iter()
            .map(|node| {
                let parsed = parse::parse_file(&node.file);
                damage.lossy |= parsed.lossy;
                damage.adrift.extend(parsed.adrift_from.map(|from| from..node.file.span().end + 1));
                drafts.extend(parsed.errors);
                parsed.table
            })
            .collect();
        let mut tree = self.root.map_or_else(DeTable::new, |root| self.node(root, &parsed, drafts));
        for (path, value) in self.sets.iter().flat_map(|sets| &sets.entries) {
            let file = &self.sets.as_ref().expect("an override comes from a set").file;
            let (path, value) = (path.clone(), value.clone());
            let at = |range: &Range<usize>| file.start() + range.start;
            let set = parse::parse_value(&file.text()[value.clone()], at(&value))
                .and_then(|parsed| set(&mut tree, &read_path(&file.text()[path.clone()], at(&path))?, parsed));
            drafts.extend(set.err());
        }
        (tree, damage)
    }

    fn node<'a>(&'a self, index: usize, parsed: &[DeTable<'a>], drafts: &mut Vec<Draft>) -> DeTable<'a> {
        let mut own = parsed[index].clone();
        own.remove("extends");
        let (removals, sets) = (own.remove("remove"), own.remove("set"));
        let bases = &self.nodes[index].bases;
        let mut tree = bases.iter().map(|&base| self.node(base, parsed, drafts)).reduce(merge).unwrap_or_default();
        let removals = removals.map_or_else(Vec::new, |value| texts(&value, "remove", drafts));
        for (path, span) in removals {
            drafts.extend(remove(&mut tree, &path, &span).err());
        }
        tree = merge(tree, own);
        match sets.map(|sets| (sets.span(), sets.into_inner())) {
            Some((_, DeValue::Table(sets))) => self.put(&mut tree, index, &[], sets, drafts),
            Some((span, _)) => drafts.push(wrong_type(span, "set", "a table of paths and values")),
            None => {}
        }
        tree
    }

    /// Puts the values of `[set]` into a tree. Their paths are quoted keys, dotted keys, or both.
    fn put<'a>(
        &'a self,
        tree: &mut DeTable<'a>,
        node: usize,
        way: &[(Step, Span)],
        sets: DeTable<'a>,
        drafts: &mut Vec<Draft>,
    ) {
        let file = &self.nodes[node].file;
        for (key, value) in sets {
            let span = key.span();
            // A quoted key starts a byte before its text.
            let quote = usize::from(span.len() > key.get_ref().len());
            let steps = match read_path(key.get_ref(), span.start + quote) {
                Ok(steps) => way.iter().cloned().chain(steps).collect::<Vec<_>>(),
                Err(draft) => {
                    drafts.push(draft);
                    continue;
                }
            };
            // A table in braces is a value; one that dots or a header made is a part of the path.
            let value_span = value.span();
            let inline = file.text()[value_span.start - file.start()..].starts_with('{');
            match value.into_inner() {
                DeValue::Table(inner) if !inline => self.put(tree, node, &steps, inner, drafts),
                other => drafts.extend(set(tree, &steps, Spanned::new(value_span, other)).err()),
            }
        }
    }
}

/// What a file extends, with spans. Mistakes of the key are told here, once.
fn extended(file: &SourceFile, drafts: &mut Vec<Draft>) -> Vec<(String, Span)> {
    let parsed = parse::parse_file(file);
    parsed.table.get("extends").map_or_else(Vec::new, |value| texts(value, "extends", drafts))
}

/// A text, or several in an array.
fn texts(value: &RecipeValue, key: &str, drafts: &mut Vec<Draft>) -> Vec<(String, Span)> {
    match value.get_ref() {
        DeValue::String(text) => vec![(text.clone().into_owned(), value.span())],
        DeValue::Array(items) => items
            .iter()
            .flat_map(|item| match item.get_ref() {
                DeValue::String(text) => Some((text.clone().into_owned(), item.span())),
                _ => {
                    drafts.push(wrong_type(item.span(), key, "a text or an array of texts"));
                    None
                }
            })
            .collect(),
        _ => {
            drafts.push(wrong_type(value.span(), key, "a text or an array of texts"));
            Vec::new()
        }
    }
}

fn wrong_type(span: Span, key: &str, wanted: &str) -> Draft {
    Draft::error(Code::WrongType, span, format!("`{key}` must be {wanted}"))
}

/// The path of a base for people: beside the file that names it, as that file was called.
fn near_name(file: &SourceFile, text: &str, path: &Path) -> String {
    if text.starts_with("${") || Path::new(text).is_absolute() {
        return path.display().to_string();
    }
    let folder = Path::new(file.name()).parent().unwrap_or(Path::new(""));
    let name: PathBuf = folder.join(text).components().collect();
    name.display().to_string()
}

/// A path without `.` and `..`, so that one file has one.
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

/// Merges a child's tables over its base's.
fn merge<'a>(mut base: DeTable<'a>, child: DeTable<'a>) -> DeTable<'a> {
    for (key, value) in child {
        let merged = match base.remove(key.get_ref().as_ref()) {
            None => value,
            Some(old) => {
                let slot = Slot::ALL.into_iter().find(|slot| slot.name() == key.get_ref().as_ref());
                match slot.map(Slot::shape) {
                    Some(Shape::Keyed) => merge_tables(old, value, &merge_stage),
                    Some(Shape::One) => merge_stage("", old, value),
                    Some(Shape::List) => value,
                    None if key.get_ref() == "dataset" => merge_tables(old, value, &|_, _, new| new),
                    None => value,
                }
            }
        };
        base.insert(key, merged);
    }
    base
}

/// Merges two stage tables, or takes the new one if it is of another kind.
fn merge_stage<'a>(id: &str, old: RecipeValue<'a>, new: RecipeValue<'a>) -> RecipeValue<'a> {
    let kind = |value: &RecipeValue<'a>| {
        let kind = value.get_ref().as_table().and_then(|table| table.get("kind"));
        kind.and_then(|kind| kind.get_ref().as_str().map(str::to_owned))
    };
    let old_kind = kind(&old).unwrap_or_else(|| id.to_owned());
    if kind(&new).is_some_and(|new| new != old_kind) {
        return new;
    }
    merge_tables(old, new, &|_, _, new| new)
}

/// Merges two tables key by key; `both` decides where both have a key. The result has the place of the new one.
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

/// The ids of the stages of a list: what their tables say, else their kind, with `_2`, `_3` … appended on repeats.
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

/// Puts a value at a path; tables on the way are made.
fn set<'a>(root: &mut DeTable<'a>, steps: &[(Step, Span)], value: RecipeValue<'a>) -> Result<(), Draft> {
    let (last, way) = steps.split_last().expect("a path has a step");
    let mut here = Here::Root(root);
    for (done, (step, span)) in way.iter().enumerate() {
        let make = matches!(steps[done + 1].0, Step::Key(_));
        here = here.enter(step, span, &steps[..done], make)?;
    }
    let (step, span) = last;
    match (here.table(), step) {
        (Ok(table), Step::Key(key)) => {
            table.remove(key.as_str());
            table.insert(Spanned::new(span.clone(), key.clone().into()), value);
            Ok(())
        }
        (Ok(_), Step::Index(_)) => Err(cannot(span, way, "is a table, not an array; name a key of it")),
        (Err(other), step) => {
            *other.element(step, span, way)? = value;
            Ok(())
        }
    }
}

/// Takes away what is at a path.
fn remove(root: &mut DeTable, path: &str, span: &Span) -> Result<(), Draft> {
    // The text may hold escapes, so steps cannot be told apart inside it: every mistake is told of the whole.
    let steps: Vec<(Step, Span)> =
        read_path(path, span.start)?.into_iter().map(|(step, _)| (step, span.clone())).collect();
    let (last, way) = steps.split_last().expect("a path has a step");
    let mut here = Here::Root(root);
    for (done, (step, span)) in way.iter().enumerate() {
        here = here.enter(step, span, &steps[..done], false)?;
    }
    match (here.table(), &last.0) {
        (Ok(table), Step::Key(key)) => {
            if table.remove(key.as_str()).is_none() {
                return Err(absent(span, &steps, key, table));
            }
            Ok(())
        }
        (Ok(_), Step::Index(_)) => Err(cannot(span, way, "is a table, not an array; name a key of it")),
        (Err(Here::Value(value)), step) => {
            let at = index_of(value, step, span, way)?;
            let DeValue::Array(items) = value.get_mut() else { unreachable!("an index is of an array") };
            let all = std::mem::replace(items, DeArray::new());
            *items = all.into_iter().enumerate().filter(|(i, _)| *i != at).map(|(_, item)| item).collect();
            Ok(())
        }
        (Err(Here::Root(_)), _) => unreachable!("the root is a table"),
    }
}

fn read_path(path: &str, at: usize) -> Result<Vec<(Step, Span)>, Draft> {
    let shift = |range: Range<usize>| range.start + at..range.end + at;
    match key_path::parse(path) {
        Ok(steps) => Ok(steps.into_iter().map(|(step, range)| (step, shift(range))).collect()),
        Err((message, range)) => {
            Err(Draft::error(Code::BadOverride, shift(range), format!("`{path}` is not the path of an option"))
                .label(message)
                .help("paths look like `render.samples_per_pixel`, `lights[0].count` or `place.objects.count`"))
        }
    }
}

/// A place on the way along a path.
enum Here<'t, 'a> {
    Root(&'t mut DeTable<'a>),
    Value(&'t mut RecipeValue<'a>),
}

impl<'t, 'a> Here<'t, 'a> {
    /// The table that is here, or what else is.
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

    /// One step on. `way` is what was walked before.
    fn enter(self, step: &Step, span: &Span, way: &[(Step, Span)], make: bool) -> Result<Self, Draft> {
        match (self.table(), step) {
            (Ok(table), Step::Key(key)) => {
                if !table.contains_key(key.as_str()) {
                    if !make {
                        let all: Vec<(Step, Span)> =
                            way.iter().cloned().chain([(step.clone(), span.clone())]).collect();
                        return Err(absent(span, &all, key, table));
                    }
                    let empty = Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
                    table.insert(Spanned::new(span.clone(), key.clone().into()), empty);
                }
                Ok(Self::Value(table.get_mut(key.as_str()).expect("it is there or was made")))
            }
            (Ok(_), Step::Index(_)) => Err(cannot(span, way, "is a table, not an array; name a key of it")),
            (Err(other), step) => other.element(step, span, way).map(Self::Value),
        }
    }

    fn element(self, step: &Step, span: &Span, way: &[(Step, Span)]) -> Result<&'t mut RecipeValue<'a>, Draft> {
        let Self::Value(value) = self else { unreachable!("the root is a table") };
        let at = index_of(value, step, span, way)?;
        match value.get_mut() {
            DeValue::Array(items) => Ok(items.get_mut(at).expect("the index was checked")),
            _ => unreachable!("an index is of an array"),
        }
    }
}

/// The index that a step means in an array: itself, or that of the stage with this id.
fn index_of(value: &RecipeValue, step: &Step, span: &Span, way: &[(Step, Span)]) -> Result<usize, Draft> {
    let DeValue::Array(items) = value.get_ref() else {
        let message = format!("is {}, so there is nothing inside it", super::check::found(value.get_ref()));
        return Err(cannot(span, way, &message));
    };
    match step {
        Step::Index(index) if *index < items.len() => Ok(*index),
        Step::Index(_) if items.is_empty() => Err(cannot(span, way, "is empty")),
        Step::Index(_) => {
            let plural = if items.len() == 1 { "" } else { "s" };
            let message = format!("has {} element{plural}; the last is [{}]", items.len(), items.len() - 1);
            Err(cannot(span, way, &message))
        }
        Step::Key(key) => {
            let all_tables = items.iter().all(|item| item.get_ref().is_table());
            let ids = if all_tables { list_ids(items) } else { Vec::new() };
            ids.iter().position(|id| id == key).ok_or_else(|| {
                let names: Vec<&str> = ids.iter().map(String::as_str).filter(|id| !id.is_empty()).collect();
                let draft = cannot(span, way, &format!("has no element `{key}`"))
                    .label(did_you_mean(key, names.iter().copied()));
                if names.is_empty() {
                    draft.help("name its elements by index: [0], [1], …")
                } else {
                    draft.help(format!("its elements are {}; or name one by index: [0]", listing(names)))
                }
            })
        }
    }
}

fn cannot(span: &Span, way: &[(Step, Span)], message: &str) -> Draft {
    Draft::error(Code::BadOverride, span.clone(), format!("`{}` {message}", shown(way)))
}

fn absent(span: &Span, steps: &[(Step, Span)], key: &str, table: &DeTable) -> Draft {
    let keys: Vec<&str> = table.keys().map(|key| key.get_ref().as_ref()).collect();
    let path = shown(steps);
    Draft::error(Code::BadOverride, span.clone(), format!("there is no `{path}`"))
        .label(did_you_mean(key, keys.iter().copied()))
        .help(format!("there is {}", listing(keys)))
}

fn shown(steps: &[(Step, Span)]) -> String {
    let steps: Vec<Step> = steps.iter().map(|(step, _)| step.clone()).collect();
    Shown(&steps).to_string()
}
