//! Reads the texts of a recipe: the recipe itself, all that it extends, and overrides.

use crate::merge::overrides::Overrides;
use crate::merge::variables::{self, PathRules};
use crate::schema::kinds::Schemas;
use crate::tables::alternatives::{MIXTURE, WEIGHT};
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::origin::{self, Builtin, Source};
use crate::text::parse;
use crate::text::source::{SET, SourceFile, Sources, Span};
use std::path::{Component, Path, PathBuf};
use syntable_model::registry::RecipeValue;
use toml::de::{DeTable, DeValue};

/// Maximum length of a chain of `extends`. A longer chain counts as a circle whose paths differ each time.
const MAX_DEPTH: usize = 32;

/// All parsed texts of a recipe, and which text extends which.
pub(crate) struct Graph<'a> {
    pub nodes: Vec<GraphNode<'a>>,
    pub root: Option<usize>,
    pub overrides: Vec<Override<'a>>,
    /// Overrides inside the components of a mixture, each with the component.
    pub of_components: Vec<(&'a str, Override<'a>)>,
    /// Errors of syntax.
    pub syntax: Vec<DiagnosticBuilder>,
    pub damage: Damage,
    pub sources: &'a Sources,
    pub schemas: &'a Schemas,
}

/// Extent of the damage by syntax errors.
#[derive(Debug, Clone, Default)]
pub(crate) struct Damage {
    /// Whether keys may have been lost, so that no key can be reported as missing.
    pub keys_lost: bool,
    /// Bytes that the parser misreads.
    pub misread: Vec<Span>,
}

impl Damage {
    /// Adds the damage of other texts.
    pub fn add(&mut self, other: Self) {
        self.keys_lost |= other.keys_lost;
        self.misread.extend(other.misread);
    }
}

/// A text of a recipe.
pub(crate) struct GraphNode<'a> {
    pub file: &'a SourceFile,
    /// The file's table, without `extends`.
    pub table: DeTable<'a>,
    /// Nodes that it extends, in order.
    pub bases: Vec<usize>,
    /// Normalized path, which identifies the file.
    identity: Option<PathBuf>,
}

/// One `--set PATH=VALUE`.
#[derive(Clone, Copy)]
pub(crate) struct Override<'a> {
    pub path: &'a str,
    pub path_at: usize,
    pub value: &'a str,
    pub value_at: usize,
}

impl<'a> Override<'a> {
    /// The component of a mixture that it changes, and its form inside the component.
    fn in_component(&self) -> Option<(&'a str, Self)> {
        let rest = self.path.strip_prefix(MIXTURE)?.strip_prefix('.')?;
        let (component, path) = rest.split_once('.').filter(|(_, path)| ![WEIGHT, "extends"].contains(path))?;
        let path_at = self.path_at + self.path.len() - path.len();
        Some((component, Self { path, path_at, ..*self }))
    }
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
        None => source.name.starts_with(origin::PREFIX).then(|| PathBuf::from(&source.name)),
    };
    let mut reader =
        TreeReader { overrides, sources, nodes: Vec::new(), syntax: Vec::new(), damage: Damage::default() };
    let root = reader.visit(file, identity, &mut Vec::new(), diagnostics);
    let TreeReader { nodes, syntax, damage, .. } = reader;
    let (mut of_recipe, mut of_components) = (Vec::new(), Vec::new());
    for line in read_overrides(overrides, sources) {
        match line.in_component() {
            Some(line) => of_components.push(line),
            None => of_recipe.push(line),
        }
    }
    Graph { nodes, root, overrides: of_recipe, of_components, syntax, damage, sources, schemas }
}

/// Reads and parses what a component of a mixture extends. The component is a table of the recipe at `header`.
pub(crate) fn gather_component<'a>(
    (header, mut table): (&Span, DeTable<'a>),
    lines: Vec<Override<'a>>,
    overrides: &Overrides,
    (sources, schemas): (&'a Sources, &'a Schemas),
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Graph<'a> {
    let mut reader =
        TreeReader { overrides, sources, nodes: Vec::new(), syntax: Vec::new(), damage: Damage::default() };
    let own = sources.file_of(header).or_else(|| sources.root()).map(|file| &**file);
    let root = own.map(|file| {
        let extends = table.remove("extends");
        reader.nodes.push(GraphNode { file, table, bases: Vec::new(), identity: None });
        for (text, span) in extends.map_or_else(Vec::new, |value| strings(&value, "extends", diagnostics)) {
            // An inherited table names recipes relative to its own file.
            let file = sources.file_of(&span).map_or(file, |file| &**file);
            let base = reader.base(&text, &span, file, &mut vec![0], diagnostics);
            reader.nodes[0].bases.extend(base);
        }
        0
    });
    let TreeReader { nodes, syntax, damage, .. } = reader;
    Graph { nodes, root, overrides: lines, of_components: Vec::new(), syntax, damage, sources, schemas }
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
    nodes: Vec<GraphNode<'a>>,
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
        self.nodes.push(GraphNode { file, table: parsed.table, bases: Vec::new(), identity });
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
        let embedded = origin::name_of(text, file.name());
        let path = match &embedded {
            Some(name) => PathBuf::from(format!("{}{name}", origin::PREFIX)),
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

/// Reads a string, or an array of strings.
pub(crate) fn strings(value: &RecipeValue, key: &str, diagnostics: &mut Vec<DiagnosticBuilder>) -> Vec<(String, Span)> {
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

/// The diagnostic for a key whose value has the wrong type.
pub(crate) fn wrong_type(span: Span, key: &str, wanted: &str) -> DiagnosticBuilder {
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

/// Normalizes a path lexically, so that each file has a single path.
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
