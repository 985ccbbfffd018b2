//! Differences between a dataset's recipe and the recipe of a run: growth, or another dataset.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::registry::{Shape, Slot};
use syntable_model::stage::{Scenes, Writer};
use syntable_model::words::{and_more, first_of};
use syntable_recipe::plan::{Plan, Provider};
use syntable_recipe::{Recipe, split_key, without_lock};

/// Growth of a dataset.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Growth {
    /// Number of scenes, before and now.
    pub scenes: Option<[u32; 2]>,
    /// Number of views of new scenes, before and now.
    pub views: Option<[u32; 2]>,
    /// Ids of new writers.
    pub writers: Vec<String>,
    /// Changed options that only the end of a run reads.
    pub finish: Vec<String>,
    /// Whether the recipe has a new stage that provides or writes products.
    pub adds: bool,
    /// Ids of writers whose files are written again, because their options or their annotators' options have changed.
    pub rewritten: BTreeSet<String>,
    /// Ids of writers that left the recipe.
    pub gone: BTreeSet<String>,
}

/// A key with different values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Path of the key.
    pub key: String,
    /// Values before and now; `None` if the key is missing.
    pub values: [Option<String>; 2],
}

impl std::fmt::Display for Difference {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.values {
            [Some(before), Some(now)] => write!(f, "{}: {before} -> {now}", self.key),
            [Some(before), None] => write!(f, "{}: {before} -> nothing", self.key),
            [None, now] => write!(f, "{}: nothing -> {}", self.key, now.as_deref().unwrap_or("nothing")),
        }
    }
}

/// The keys in which two resolved recipes differ, without the locks of inputs.
pub fn differences(before: &str, now: &str) -> Vec<Difference> {
    let (mut before, mut now) = (keys_of(before), keys_of(now));
    let tables =
        [&before, &now].map(|keys| keys.keys().filter_map(|key| keyed_table(key)).map(str::to_owned).collect());
    let [had, has]: [BTreeSet<String>; 2] = tables;
    // A table that only one recipe has is one difference.
    for (keys, table) in had.difference(&has).map(|it| (0, it)).chain(has.difference(&had).map(|it| (1, it))) {
        let keys = if keys == 0 { &mut before } else { &mut now };
        let kind = keys.get(&format!("{table}.kind")).cloned().unwrap_or_default();
        keys.retain(|key, _| keyed_table(key) != Some(table));
        keys.insert(table.clone(), format!("{KIND}{kind}"));
    }
    let keys: BTreeSet<&String> = before.keys().chain(now.keys()).collect();
    let values = |key: &String| [before.get(key).cloned(), now.get(key).cloned()];
    let differing = keys.into_iter().filter(|key| before.get(*key) != now.get(*key));
    differing.map(|key| Difference { key: key.clone(), values: values(key) }).collect()
}

/// Start of the value that represents a whole table.
const KIND: &str = "kind ";

fn keys_of(text: &str) -> BTreeMap<String, String> {
    fn walk(path: &str, value: &toml::Value, keys: &mut BTreeMap<String, String>) {
        match value {
            toml::Value::Table(table) if !table.is_empty() => {
                for (key, value) in table {
                    let dot = if path.is_empty() { "" } else { "." };
                    walk(&format!("{path}{dot}{key}"), value, keys);
                }
            }
            toml::Value::Array(items) if items.iter().any(toml::Value::is_table) => {
                for (index, value) in items.iter().enumerate() {
                    walk(&format!("{path}[{index}]"), value, keys);
                }
            }
            value => {
                keys.insert(path.to_owned(), value.to_string());
            }
        }
    }
    let mut keys = BTreeMap::new();
    let table = toml::from_str::<toml::Table>(&without_lock(text)).unwrap_or_default();
    walk("", &toml::Value::Table(table), &mut keys);
    keys
}

/// Lists differences, one per line.
pub fn listing(differences: &[Difference]) -> String {
    let (first, more) = first_of(differences);
    let lines: String = first.iter().map(|it| format!("\n  {it}")).collect();
    if more == 0 { lines } else { format!("{lines}\n {}", and_more(more)) }
}

/// Compares the recipes of a dataset and of a run. `rewrite` permits writing the files of writers again. The error
/// explains why the run cannot continue the dataset.
pub fn growth(root: &Path, before: &str, recipe: &Recipe, rewrite: bool) -> Result<Growth> {
    let differences = differences(before, &recipe.resolved);
    let mut growth = Growth::default();
    let mut others = Vec::new();
    let (mut added, mut changed) = (BTreeSet::new(), BTreeSet::new());
    let had: BTreeSet<String> = keys_of(before).keys().filter_map(|key| table_of(key)).map(str::to_owned).collect();
    // A crate is used for the first time, or no longer, because a stage is new, gone or of another kind. Without one, another
    // crate provides a stage of the same kind.
    let has_kind = |side: usize| {
        move |Difference { key, values }: &Difference| {
            values[side].as_ref().is_some_and(|value| key.ends_with(".kind") || value.starts_with(KIND))
        }
    };
    let is_explained = [0, 1].map(|side| differences.iter().any(has_kind(side)));
    for difference in differences {
        let Difference { key, values } = &difference;
        let numbers = || -> Option<[u32; 2]> {
            let [before, now] = values;
            Some([before.as_ref()?.parse().ok()?, now.as_ref()?.parse().ok()?])
        };
        match key.as_str() {
            "dataset.scenes" if numbers().is_some() => growth.scenes = numbers(),
            "dataset.views_per_scene" if numbers().is_some() => growth.views = numbers(),
            key if key.starts_with("lock.plugins.")
                && (values[0].is_none() && is_explained[1] || values[1].is_none() && is_explained[0]) => {}
            key => match table_of(key) {
                Some(table) if !had.contains(table) => {
                    if let Some(id) = table.strip_prefix("write.") {
                        growth.writers.push(id.to_owned());
                    }
                    growth.adds = true;
                    added.insert(table.to_owned());
                }
                Some(_) if only_finish(recipe, key) => growth.finish.push(key.to_owned()),
                Some(table) if rewrite && may_change(table) => drop(changed.insert(table.to_owned())),
                _ => others.push(difference.clone()),
            },
        }
    }
    growth.writers.dedup();
    let fewer = |what: &str, [before, now]: [u32; 2], help: &str| {
        let message = format!("the dataset has {before} {what}, but the recipe has {now}");
        Err(Error::new(message).in_file(root).help(help))
    };
    if !others.is_empty() {
        let of_writers = others.iter().all(|other| table_of(&other.key).is_some_and(may_change));
        let help = match of_writers {
            true => {
                "to write the files of these writers again, or to remove them, run with `options.rewrite`; else choose another \
                 folder with `options.out`"
            }
            false => "choose another folder with `options.out`, or delete the old dataset with `options.overwrite`",
        };
        return Err(Error::new(format!("the folder has a dataset of another recipe:{}\n ", listing(&others)))
            .in_file(root)
            .help(help));
    }
    if let Some(numbers @ [before, now]) = growth.scenes
        && now < before
    {
        return fewer("scenes", numbers, "a dataset can only grow; to make some of its scenes, use `options.scenes`");
    }
    if let Some(numbers @ [before, now]) = growth.views
        && now < before
    {
        let help = "new scenes can have more views, not fewer; make another dataset with `options.out`";
        return fewer("views per scene", numbers, help);
    }
    growth.rewritten = changed.iter().filter_map(|table| Some(table.strip_prefix("write.")?.to_owned())).collect();
    added.append(&mut changed);
    for (id, stage) in disturbed(recipe, &growth, &added) {
        if !rewrite {
            return Err(Error::new(format!("[{stage}] is new and changes existing files of `write.{id}`"))
                .in_file(root)
                .help("to write these files again, run with `options.rewrite`; else choose another folder with `options.out`"));
        }
        growth.rewritten.insert(id);
    }
    growth.adds |= !growth.rewritten.is_empty();
    let is_there = |id: &String| recipe.write.iter().any(|(other, _)| other == id);
    (growth.rewritten, growth.gone) = growth.rewritten.into_iter().partition(is_there);
    Ok(growth)
}

/// Whether files can be written again after a change of this table: it is the table of a writer, or of an annotator
/// that only writers may read.
fn may_change(table: &str) -> bool {
    let (_, table) = split_key(table);
    [Slot::Write, Slot::Annotate]
        .iter()
        .any(|slot| table.strip_prefix(slot.name()).is_some_and(|id| id.starts_with('.')))
}

/// The table of a stage that has an id, such as `write.png`.
fn keyed_table(key: &str) -> Option<&str> {
    let (_, own) = split_key(key);
    let mut dots = own.match_indices('.').map(|(at, _)| at);
    let slot = &own[..dots.next()?];
    let end = dots.next().unwrap_or(own.len());
    let keyed = Slot::ALL.into_iter().any(|known| known.name() == slot && known.shape() == Shape::Keyed);
    keyed.then(|| &key[..key.len() - own.len() + end])
}

/// The table of a stage that provides or writes products.
fn table_of(key: &str) -> Option<&str> {
    keyed_table(key).filter(|table| !split_key(table).1.starts_with(Slot::Assets.name()))
}

/// Whether a key is an option of a writer that only the end of a run reads.
pub fn only_finish(recipe: &Recipe, key: &str) -> bool {
    let Some((table, id)) = table_of(key).and_then(|table| Some((table, table.strip_prefix("write.")?))) else {
        return false;
    };
    let Some((_, writer)) = recipe.write.iter().find(|(other, _)| other == id) else { return false };
    let option = key[table.len()..].trim_start_matches('.').split(['.', '[']).next().unwrap_or_default();
    writer.finish_options().contains(&option)
}

/// Unchanged writers that read a product of a new or changed stage, each with one such stage. Their existing files lack
/// its effect.
fn disturbed(recipe: &Recipe, growth: &Growth, changed: &BTreeSet<String>) -> Vec<(String, String)> {
    let stays = |id: &String| !growth.writers.contains(id) && !growth.rewritten.contains(id);
    let by = |writer: &dyn Writer<Scenes>| {
        let reads: Vec<String> = writer.reads().into_iter().map(|input| input.product).collect();
        recipe.components.all().find_map(|component| {
            let Plan { entries, .. } = component.plan.part(reads.iter().map(String::as_str), false);
            entries.into_iter().find_map(|entry| match entry.provider {
                Provider::Stage(stage) => Some(component.table(&stage)).filter(|table| changed.contains(table)),
                Provider::Renderer => None,
            })
        })
    };
    let writers = recipe.write.iter().filter(|(id, _)| stays(id));
    writers.filter_map(|(id, writer)| Some((id.clone(), by(&**writer)?))).collect()
}

impl Growth {
    /// Ids of writers whose files are written again or removed.
    pub fn replaced(&self) -> BTreeSet<String> {
        self.rewritten.union(&self.gone).cloned().collect()
    }

    /// Whether the recipe is the same.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// The growth in words.
    pub fn text(&self) -> String {
        let mut parts = Vec::new();
        if let Some([before, now]) = self.scenes {
            parts.push(format!("from {before} to {now} scenes"));
        }
        if let Some([before, now]) = self.views {
            parts.push(format!("from {before} to {now} views of new scenes"));
        }
        if !self.writers.is_empty() {
            let names: Vec<String> = self.writers.iter().map(|id| format!("`write.{id}`")).collect();
            parts.push(format!("by the files of {}, also for finished scenes", names.join(" and ")));
        }
        let mut sentences = Vec::new();
        for (writers, what) in [(&self.rewritten, "written again"), (&self.gone, "removed")] {
            if !writers.is_empty() {
                let names: Vec<String> = writers.iter().map(|id| format!("`write.{id}`")).collect();
                sentences.push(format!("the files of {} are {what}", names.join(" and ")));
            }
        }
        if !parts.is_empty() {
            sentences.push(format!("the dataset grows {}", parts.join("; ")));
        }
        if !self.finish.is_empty() {
            sentences.push(format!("the last step of writers runs again, with another {}", self.finish.join(", ")));
        }
        sentences.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differing_keys_are_listed_without_locked_inputs() {
        let before = "[dataset]\nscenes = 2\n[views]\nradius = 0.8\n[[place]]\nid = \"t\"\ncount = 3\n\
                      [lock]\nsyntable = \"1\"\n[lock.assets]\n\"a/b\" = \"1\"\n";
        let now = "[dataset]\nscenes = 2\n[views]\nradius = 1.0\n[[place]]\nid = \"t\"\ncount = 3\nmore = [1, 2]\n\
                   [lock]\nsyntable = \"1\"\n[lock.assets]\n\"a/b\" = \"2\"\n";
        let found = differences(before, now);
        assert_eq!(listing(&found), "\n  place[0].more: nothing -> [1, 2]\n  views.radius: 0.8 -> 1.0");
        assert_eq!(listing(&differences(now, before)[..1]), "\n  place[0].more: [1, 2] -> nothing");
        assert!(differences(before, before).is_empty());
        let more = format!("{before}[write.png]\nkind = \"png\"\ninclude = [\"rgb\"]\n");
        assert_eq!(listing(&differences(before, &more)), "\n  write.png: nothing -> kind \"png\"");
    }

    #[test]
    fn tables_of_keys() {
        for (key, table) in [
            ("write.png.include", Some("write.png")),
            ("annotate.masks.policy.frame", Some("annotate.masks")),
            ("sensor.rgb", Some("sensor.rgb")),
            ("views.radius", None),
            ("assets.mugs.root", None),
            ("dataset.scenes", None),
            ("write", None),
            ("mixture.a.annotate.masks.policy", Some("mixture.a.annotate.masks")),
            ("mixture.a.assets.mugs.root", None),
            ("mixture.a.views.radius", None),
            ("mixture.write.weight", None),
        ] {
            assert_eq!(table_of(key), table, "{key}");
        }
    }
}
