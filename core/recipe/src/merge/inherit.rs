//! `extends`, `remove`, `[set]` and `--set`: merges several texts into one tree whose values keep their spans.
//!
//! Every file is read and parsed once. Tables are merged before any stage sees them. The child wins, option by option:
//!
//! - `[dataset]` and stage tables: option by option. A table or array *inside* an option is replaced as a whole, so that
//!   `{ choice = [..] }` never mixes with an inherited `{ uniform = [..] }`;
//! - a stage to which the child gives another `kind`, in its table or by `[set]` or `--set`, keeps the inherited
//!   options that the new kind also has. A pool keeps none, because its options describe other assets;
//! - `[[place]]` and `[[lights]]` are replaced as a whole when the child gives any;
//! - `[mixture.<id>]`: section by section, as recipes;
//! - `remove = ["write.npy"]` removes inherited values, before the child's own are added;
//! - `[set]` reaches anywhere, by paths as in `--set`: `place.objects.count = 5` or `"lights[0].count" = 5`.

use crate::merge::edit::{Position, by_index, display, list_ids, read_path, remove, set};
use crate::merge::graph::{Damage, Graph, GraphNode, strings, wrong_type};
use crate::schema::kinds::KindSchema;
use crate::tables::alternatives::MIXTURE;
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::parse;
use crate::text::source::Span;
use syntable_model::registry::{RecipeValue, Shape, Slot};
use syntable_toml_schema::{DisplayPath, Step};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

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

    /// The table of a node with all that it extends. `merged` keeps it, because several recipes can extend it.
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
                self.put(&mut tree, &[], sets, &mut Vec::new(), diagnostics);
            }
            Some((span, _)) => diagnostics.push(wrong_type(span, "set", "a table of paths and values")),
            None => {}
        }
        merged[index] = Some(tree.clone());
        tree
    }

    /// Puts the values of `[set]` into a tree. Their paths are quoted keys, dotted keys, or both, below `parents`;
    /// `seen` has the places that were set before.
    fn put(
        &self,
        tree: &mut DeTable<'a>,
        parents: &[(Step, Span)],
        sets: DeTable<'a>,
        seen: &mut Vec<(Vec<Step>, Span)>,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) {
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
            // A table in braces is a value. A table made by dots or by a header is a part of the path.
            let value_span = value.span();
            let file = self.sources.file_of(&value_span);
            let inline = file.is_some_and(|file| file.text()[value_span.start - file.start()..].starts_with('{'));
            match value.into_inner() {
                DeValue::Table(inner) if !inline => self.put(tree, &steps, inner, seen, diagnostics),
                other => {
                    let place = by_index(tree, &steps);
                    diagnostics.extend(set_before(&place, &display(&steps), &span, seen));
                    seen.push((place, span));
                    diagnostics.extend(self.set(tree, &steps, Spanned::new(value_span, other)).err());
                }
            }
        }
    }

    /// Puts a value at a path. A stage whose kind changes loses the options that it had for the old kind only.
    fn set(
        &self,
        tree: &mut DeTable<'a>,
        steps: &[(Step, Span)],
        value: RecipeValue<'a>,
    ) -> Result<(), DiagnosticBuilder> {
        let kind = value.get_ref().as_str().map(str::to_owned);
        if let (Some(kind), Some((slot, id))) = (kind, stage_of_kind(steps))
            && let Ok(Position::Table(options)) = Position::of_path(tree, &steps[..steps.len() - 1])
            && kind_of(options, &id).is_none_or(|old| old != kind)
        {
            let file = |span: &Span| self.sources.file_of(span).map(|file| file.start());
            let given = file(&value.span());
            // An option that is written beside the new kind is a mistake if the kind does not have it.
            let beside = |name: &Span| file(name) == given;
            let keeps = |name: &str| ["id", "kind"].contains(&name) || self.carries(slot, &kind, name);
            let old = std::mem::replace(options, DeTable::new());
            *options = old.into_iter().filter(|(name, _)| beside(&name.span()) || keeps(name.get_ref())).collect();
        }
        set(tree, steps, value).map_err(|diagnostic| match self.replaced_list(steps) {
            Some((header, file)) => diagnostic.help(format!(
                "the recipe's own {header} replaces all steps of {file}: repeat the steps there, or change single steps \
                 by [set] alone"
            )),
            None => diagnostic,
        })
    }

    /// The header of a list that a path leads into, and the file whose list has the step of the path's id. A recipe that
    /// extends this file and has such a list itself replaces the file's list.
    fn replaced_list(&self, steps: &[(Step, Span)]) -> Option<(String, &str)> {
        let [(Step::Key(first), _), (Step::Key(id), _), ..] = steps else { return None };
        let slot = Slot::ALL.into_iter().find(|slot| slot.name() == first && slot.shape() == Shape::List)?;
        let has_id = |node: &&GraphNode| match node.table.get(slot.name()).map(Spanned::get_ref) {
            Some(DeValue::Array(items)) => list_ids(items).contains(id),
            _ => false,
        };
        Some((slot.header(""), self.nodes.iter().find(has_id)?.file.name()))
    }

    /// Whether a stage that gets this kind keeps an option of its former kind.
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
                        None if key.get_ref() == MIXTURE => {
                            merge_tables(old, value, &|_, old, new| self.merge_components(old, new))
                        }
                        None => value,
                    }
                }
            };
            base.insert(key, merged);
        }
        base
    }

    /// Merges the tables of a component of a mixture, which have the sections of a recipe.
    fn merge_components(&self, old: RecipeValue<'a>, new: RecipeValue<'a>) -> RecipeValue<'a> {
        let span = new.span();
        match (old.into_inner(), new.into_inner()) {
            (DeValue::Table(old), DeValue::Table(new)) => {
                Spanned::new(span, DeValue::Table(self.merge_trees(old, new)))
            }
            (_, new) => Spanned::new(span, new),
        }
    }

    /// Merges two stage tables. If the kind changes, the new table inherits only options that the new kind also has.
    fn merge_stages(&self, slot: Slot, id: &str, mut old: RecipeValue<'a>, new: RecipeValue<'a>) -> RecipeValue<'a> {
        let own_kind = new.get_ref().as_table().and_then(|table| table.get("kind"));
        if let Some(kind) = own_kind.and_then(|kind| kind.get_ref().as_str())
            && let DeValue::Table(options) = old.get_mut()
            && kind_of(options, id).is_none_or(|old| old != kind)
        {
            let all = std::mem::replace(options, DeTable::new());
            *options = all.into_iter().filter(|(name, _)| self.carries(slot, kind, name.get_ref())).collect();
        }
        merge_tables(old, new, &|_, _, new| new)
    }
}

/// The kind of a stage table: its `kind`, or else its id.
fn kind_of(stage: &DeTable, id: &str) -> Option<String> {
    let stated = stage.get("kind").and_then(|kind| kind.get_ref().as_str());
    stated.or_else(|| Some(id).filter(|id| !id.is_empty())).map(str::to_owned)
}

/// The slot of the stage whose `kind` is at a path, and its id if the key of a table gives the id.
fn stage_of_kind(steps: &[(Step, Span)]) -> Option<(Slot, String)> {
    let ((Step::Key(first), _), (Step::Key(last), _)) = (steps.first()?, steps.last()?) else { return None };
    let slot = Slot::ALL.into_iter().find(|slot| slot.name() == first).filter(|_| last == "kind")?;
    match (slot.shape(), steps) {
        (Shape::One, [_, _]) | (Shape::List, [_, _, _]) => Some((slot, String::new())),
        (Shape::Keyed, [_, (Step::Key(id), _), _]) => Some((slot, id.clone())),
        _ => None,
    }
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
