//! A mixture: several recipes whose scenes make one dataset. Each component is a recipe without `[dataset]` and writers.

use crate::merge::graph::{Damage, Override, gather_component};
use crate::tables::alternatives::{MIXTURE, OF_MIXTURE, SHARED, WEIGHT};
use crate::tables::check;
use crate::tables::loader::Loader;
use crate::tables::one_of::weight_of;
use crate::tables::sections;
use crate::tables::slot_tables::{LONGEST_ID, is_id};
use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{NOWHERE, Span};
use crate::text::suggest::{did_you_mean, listing};
use syntable_model::registry::{RecipeValue, Slot};
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// Keys of a component besides its slots.
const KEYS: [&str; 4] = [WEIGHT, "extends", "remove", "set"];

/// The stages of a recipe, or of a component of a mixture, that make its scenes.
pub(crate) struct ComponentTree<'a> {
    /// Its name; empty in a recipe that is no mixture.
    pub id: String,
    pub weight: f64,
    /// Bytes of its table.
    pub header: Span,
    /// Its slots, and the writers of the recipe.
    pub tree: DeTable<'a>,
}

impl<'a> ComponentTree<'a> {
    /// A recipe that is no mixture.
    pub fn only(tree: DeTable<'a>) -> Self {
        Self { id: String::new(), weight: 1.0, header: NOWHERE, tree }
    }
}

impl Loader<'_, '_> {
    /// The components of a mixture. A recipe that is no mixture is its only component.
    pub fn components<'a>(
        &'a self,
        mut tree: DeTable<'a>,
        lines: Vec<(&'a str, Override<'a>)>,
        damage: &mut Damage,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Vec<ComponentTree<'a>> {
        let mixture = tree.remove(MIXTURE);
        let components = mixture.map_or_else(Vec::new, |mixture| entries(mixture, diagnostics));
        for (id, line) in &lines {
            if !components.iter().any(|(other, _)| other.get_ref() == id) {
                let span = line.path_at - id.len() - 1..line.path_at - 1;
                let ids = components.iter().map(|(id, _)| id.get_ref().as_str());
                let diagnostic =
                    DiagnosticBuilder::error(Code::BadOverride, span, format!("`{MIXTURE}` has no `{id}`"));
                diagnostics.push(diagnostic.label(did_you_mean(id, ids)));
            }
        }
        if components.is_empty() {
            return vec![ComponentTree::only(tree)];
        }
        diagnostics.extend(beside(&tree));
        let (shared, lines): (Vec<_>, Vec<_>) =
            lines.into_iter().partition(|(_, line)| of_mixture(line.path).is_some());
        diagnostics.extend(shared.iter().filter_map(|(_, line)| shared_override(line)));
        let of = |id: &str| lines.iter().filter(|(other, _)| *other == id).map(|(_, line)| *line).collect();
        let components: Vec<ComponentTree> = components
            .into_iter()
            .filter_map(|(id, table)| {
                let lines = of(id.get_ref());
                self.component((id, table), &tree, lines, damage, diagnostics)
            })
            .collect();
        if let Some(first) = components.first()
            && components.iter().all(|component| component.weight == 0.0)
        {
            let message = "no component has a weight above 0";
            diagnostics.push(DiagnosticBuilder::error(Code::InvalidValue, first.header.clone(), message));
        }
        components
    }

    fn component<'a>(
        &'a self,
        (id, value): (Spanned<String>, RecipeValue<'a>),
        recipe: &DeTable<'a>,
        lines: Vec<Override<'a>>,
        damage: &mut Damage,
        diagnostics: &mut Vec<DiagnosticBuilder>,
    ) -> Option<ComponentTree<'a>> {
        let (header, id_span, id) = (value.span(), id.span(), id.into_inner());
        if !is_id(&id) {
            let diagnostic = DiagnosticBuilder::error(Code::BadId, id_span, format!("\"{id}\" cannot be an id"));
            diagnostics.push(diagnostic.label(format!("an id has letters, digits, `_` and `-`, at most {LONGEST_ID}")));
            return None;
        }
        let found = check::type_of(&value);
        let DeValue::Table(mut own) = value.into_inner() else {
            let message = format!("`{MIXTURE}.{id}` must be a table");
            let diagnostic =
                DiagnosticBuilder::error(Code::WrongType, header, message).label(format!("this is {found}"));
            diagnostics.push(diagnostic.help(format!("write [{MIXTURE}.{id}] with `extends`")));
            return None;
        };
        diagnostics.extend(take_foreign(&mut own));
        diagnostics.extend(take_shared_sets(&mut own));
        let weight = own.remove(WEIGHT).map_or(Some(1.0), |weight| weight_of(&weight, diagnostics));
        let before = diagnostics.len();
        let graph = gather_component((&header, own), lines, self.overrides, (self.sources, self.schemas), diagnostics);
        damage.keys_lost |= diagnostics.len() > before;
        let (mut tree, own_damage) = graph.merge(diagnostics);
        damage.add(own_damage);
        if let Some((key, _)) = tree.remove_entry(MIXTURE) {
            let message = format!("`{MIXTURE}.{id}` is a mixture itself");
            let diagnostic = DiagnosticBuilder::error(Code::Extends, key.span(), message);
            let help = format!("write its components into the [{MIXTURE}] of the recipe");
            diagnostics.push(diagnostic.label("this makes it one").also(header.clone(), "used here").help(help));
        }
        for section in OF_MIXTURE {
            tree.remove(section);
        }
        sections::unknown(&tree, self.schemas, diagnostics);
        if let Some(writers) = recipe.get(SHARED.name()) {
            tree.insert(Spanned::new(writers.span(), SHARED.name().into()), writers.clone());
        }
        Some(ComponentTree { id, weight: weight?, header, tree })
    }
}

/// The tables of the components, sorted by id.
fn entries<'a>(
    mixture: RecipeValue<'a>,
    diagnostics: &mut Vec<DiagnosticBuilder>,
) -> Vec<(Spanned<String>, RecipeValue<'a>)> {
    let (span, found) = (mixture.span(), check::type_of(&mixture));
    let help = format!("write [{MIXTURE}.<id>] with `extends` and `{WEIGHT}`, once for every component");
    match mixture.into_inner() {
        DeValue::Table(table) if !table.is_empty() => {
            let entry =
                |(id, value): (Spanned<DeString>, _)| (Spanned::new(id.span(), id.into_inner().into_owned()), value);
            let mut entries: Vec<_> = table.into_iter().map(entry).collect();
            entries.sort_by(|(a, _), (b, _)| a.get_ref().cmp(b.get_ref()));
            entries
        }
        DeValue::Table(_) => {
            let diagnostic =
                DiagnosticBuilder::error(Code::InvalidValue, span, format!("`{MIXTURE}` needs a component"));
            diagnostics.push(diagnostic.help(help));
            Vec::new()
        }
        _ => {
            let diagnostic =
                DiagnosticBuilder::error(Code::WrongType, span, format!("`{MIXTURE}` must be a table of tables"));
            diagnostics.push(diagnostic.label(format!("this is {found}")).help(help));
            Vec::new()
        }
    }
}

/// Refuses stages beside a mixture that only its components can have.
fn beside(tree: &DeTable) -> Vec<DiagnosticBuilder> {
    let of_components = Slot::ALL.into_iter().filter(|slot| *slot != SHARED);
    let found = of_components.filter_map(|slot| Some((slot, tree.get_key_value(slot.name())?.0.span())));
    let diagnostic = |(slot, span): (Slot, Span)| {
        let message = format!("`{slot}` beside `{MIXTURE}`");
        let diagnostic = DiagnosticBuilder::error(Code::UnknownKey, span, message);
        diagnostic.label("belongs to a component").help(format!("write it below [{MIXTURE}.<id>], for each component"))
    };
    found.map(diagnostic).collect()
}

/// Removes and refuses the sections in the table of a component that it cannot have.
fn take_foreign(own: &mut DeTable) -> Vec<DiagnosticBuilder> {
    let of_slots = || Slot::ALL.into_iter().map(Slot::name).filter(|name| !OF_MIXTURE.contains(name));
    let known = || KEYS.into_iter().chain(of_slots());
    let unknown = own.keys().filter(|key| !known().any(|known| known == key.get_ref()));
    let unknown: Vec<(String, Span)> = unknown.map(|key| (key.get_ref().to_string(), key.span())).collect();
    let diagnostic = |(name, span): (String, Span)| {
        own.remove(name.as_str());
        let message = format!("a component of a mixture has no `{name}`");
        let label = match OF_MIXTURE.contains(&name.as_str()) {
            true => format!("write [{name}] once, for all components"),
            false => did_you_mean(&name, known()),
        };
        let diagnostic = DiagnosticBuilder::error(Code::UnknownKey, span, message).label(label);
        diagnostic.help(format!("its keys are {}", listing(known())))
    };
    unknown.into_iter().map(diagnostic).collect()
}

/// The section that a path leads into, if the mixture has it instead of its components.
fn of_mixture(path: &str) -> Option<&'static str> {
    let section = path.split(['.', '[']).next()?;
    OF_MIXTURE.into_iter().find(|other| *other == section)
}

/// Refuses `--set` of a section that a component does not have.
fn shared_override(line: &Override) -> Option<DiagnosticBuilder> {
    let (section, path) = (of_mixture(line.path)?, line.path);
    Some(not_in_component(section, line.path_at..line.path_at + path.len()).help(format!("use `--set {path}`")))
}

/// Removes and refuses paths in `[set]` of a component that lead into sections that it does not have.
fn take_shared_sets(own: &mut DeTable) -> Vec<DiagnosticBuilder> {
    let Some(DeValue::Table(sets)) = own.get_mut("set").map(Spanned::get_mut) else { return Vec::new() };
    let shared =
        sets.keys().filter_map(|key| Some((key.get_ref().to_string(), key.span(), of_mixture(key.get_ref())?)));
    let shared: Vec<(String, Span, &str)> = shared.collect();
    let diagnostic = |(path, span, section): (String, Span, &str)| {
        sets.remove(path.as_str());
        not_in_component(section, span)
            .help(format!("write `{path}` under [set] of the recipe, outside of `{MIXTURE}`"))
    };
    shared.into_iter().map(diagnostic).collect()
}

fn not_in_component(section: &str, span: Span) -> DiagnosticBuilder {
    let message = format!("a component of a mixture has no `{section}`");
    DiagnosticBuilder::error(Code::BadOverride, span, message).label(format!("`{section}` belongs to the mixture"))
}
