//! Merges parts of a dataset, made elsewhere from one recipe, into one dataset.

use crate::paths::whole;
use crate::run::dataset::folder::{Folder, catalog_path};
use crate::run::dataset::foreign;
use crate::run::dataset::journal::{Entries, Journal, SceneLine};
use crate::run::dataset::layout;
use crate::run::dataset::manifest::Stamp;
use crate::run::decisions::growth;
use crate::run::decisions::inputs;
use crate::run::finish;
use crate::run::options::MergeOptions;
use crate::run::outcome::{RunOutcome, stopping};
use crate::run::progress::{Event, Guarded, Reporter, Warnings, count};
use crate::run::scene_range::ranges;
use crate::run::shard::{Shard, WantedScenes};
use crate::run::stop::Stop;
use crate::workers::Pool;
use parking_lot::Mutex;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;
use syntable_model::context::{Log, Workers};
use syntable_model::error::{Error, Result};
use syntable_model::files::{DatasetPath, RESERVED};
use syntable_model::registry::{Registry, Slot};
use syntable_model::store::{Kind, StoreFolder};
use syntable_model::words::SHOWN;
use syntable_recipe::{Lock, Overrides, Recipe, Source, lock_of, with_devices, without_lock};

/// An open part.
struct MergePart {
    folder: Folder,
    shard: Option<Shard>,
    entries: Entries,
    recipe: String,
}

impl MergePart {
    /// Its folder, for messages.
    fn name(&self) -> String {
        self.folder.name().display().to_string()
    }
}

/// Merges the scenes of several parts into a dataset, which is new or was begun by an earlier call. A part is a dataset, or
/// a folder of datasets such as the shards of a job. The result equals the dataset of one run, byte for byte. The parts
/// stay unchanged: their files are hard links where the file system allows it, else copies. After an error, the same call
/// continues.
///
/// # Errors
/// If parts have different recipes, inputs or devices, were made by different versions of the program, are the same shard,
/// or have different scenes of one number; if shards are missing; if a file cannot be read or written.
pub fn merge<P: Clone + Into<StoreFolder>>(
    registry: &Registry,
    out: impl Into<StoreFolder>,
    parts: &[P],
    options: &MergeOptions,
    reporter: &dyn Reporter,
) -> Result<RunOutcome> {
    let MergeOptions { threads, allow_code, partial, mixed_devices, stop } = options;
    let start = Instant::now();
    let reporter = &Guarded(reporter);
    let named: Vec<StoreFolder> = parts.iter().cloned().map(Into::into).collect();
    let (out, parts) = (out.into(), named.iter().map(datasets_in).collect::<Result<Vec<_>>>()?.concat());
    is_apart(&out, &parts)?;
    let parts: Vec<MergePart> = parts.into_iter().map(open).collect::<Result<_>>()?;
    let Some(first) = parts.first() else {
        return Err(Error::new("no part to merge"));
    };
    for part in &parts[1..] {
        same_recipe(first, part)?;
    }
    let mut inputs = PartInputs::default();
    parts.iter().try_for_each(|part| inputs.add(part))?;
    let recipe = load(registry, &first.recipe)?;
    recipe.trusted_of(Slot::Write, *allow_code)?;
    ready(&recipe)?;
    let log = Warnings(reporter);
    let folder = Folder::open(&out)?;
    folder.recover()?;
    let mut journal = folder.journal()?;
    let recipe_of_target = if folder.is_empty(&journal)? { None } else { Some(recipe_of(&folder, "dataset")?) };
    let begun = MergePart {
        entries: journal.entries().clone(),
        recipe: recipe_of_target.clone().unwrap_or_default(),
        shard: folder.shard()?,
        folder,
    };
    if recipe_of_target.is_some() {
        same_recipe(&begun, first)?;
        inputs.add(&begun)?;
    }
    let devices = devices(std::iter::once(&begun).chain(&parts), (*mixed_devices).then_some(&log))?;
    let resolved = with_devices(&first.recipe, &devices);
    // Parts that contradict each other leave the dataset as it was.
    let chosen = choose(&begun, &parts)?;
    distinct_shards(&parts)?;
    if !partial {
        let has = |scene: u32| begun.entries.contains(scene);
        all_shards(&parts, recipe.dataset.scenes, &has)?;
    }
    begun.folder.set_shard(None)?;
    begun.folder.set_recipe(&resolved)?;
    reporter.event(&Event::Started {
        out: out.name().display().to_string(),
        scenes: (begun.entries.len() + chosen.len()) as u32,
        views_per_scene: recipe.dataset.views_per_scene,
        resumed: begun.entries.len() as u32,
        images: chosen.iter().map(|(line, _)| u64::from(line.views())).sum(),
        threads: *threads,
    });
    parts.iter().try_for_each(|part| journal.add_assets(part.entries.assets()))?;
    let (journal, pool) = (Mutex::new(journal), Pool::new(*threads)?);
    adopt_all(&begun.folder, &chosen, &journal, &pool, stop)?;
    catalogs(&begun.folder, &first.folder).map_err(stopping)?;
    let journal = journal.into_inner();
    let lacks: Vec<u32> = (0..recipe.dataset.scenes).filter(|scene| !journal.entries().contains(*scene)).collect();
    let told = BTreeSet::new();
    let none = WantedScenes::of_range(0..0);
    let end = || finish::end(&recipe, reporter, &pool, &begun.folder, journal, &resolved, (false, &none, &told));
    let outcome = pool.install(end).map_err(stopping)?;
    let missing = lacks.len() as u32;
    if missing > 0 {
        let all = count(recipe.dataset.scenes, "scene");
        let message = format!("no part has {missing} of the recipe's {all}: {}", ranges(lacks.into_iter()));
        let help = "merge parts with these scenes into the same folder, or make the scenes with `syntable run`, the recipe and `options.out`";
        log.warn(&Error::new(message).help(help));
    }
    let before: u32 = begun.entries.iter().map(|line| line.views()).sum();
    reporter.event(&Event::Finished {
        out: out.name().display().to_string(),
        scenes: outcome.scenes,
        failed: outcome.failed,
        images: outcome.images,
        made: outcome.images.saturating_sub(before),
        grown: 0,
        seconds: start.elapsed().as_secs_f64(),
    });
    Ok(RunOutcome { missing, ..outcome })
}

/// Copies scenes of parts into the dataset, several at once. After an error or a stop, the scenes in work still end.
fn adopt_all(
    folder: &Folder,
    chosen: &[(SceneLine, &MergePart)],
    journal: &Mutex<Journal>,
    workers: &dyn Workers,
    stop: &Stop,
) -> Result<()> {
    let done = AtomicU32::new(0);
    // The first error in the order of scenes.
    let failure: Mutex<Option<(u32, Error)>> = Mutex::new(None);
    workers.run(chosen.len(), &|index| {
        if stop.requested().is_some() || failure.lock().is_some() {
            return;
        }
        let (line, part) = chosen[index];
        match folder.adopt(&part.folder, &line.entry(), journal) {
            Ok(()) => drop(done.fetch_add(1, Ordering::Relaxed)),
            Err(error) => {
                let mut failure = failure.lock();
                if failure.as_ref().is_none_or(|(scene, _)| line.scene < *scene) {
                    *failure = Some((line.scene, error));
                }
            }
        }
    });
    if let Some((scene, error)) = failure.into_inner() {
        return Err(stopping(error).context(format!("scene {scene}")));
    }
    let (done, all) = (done.into_inner(), chosen.len() as u32);
    match stop.requested() {
        Some(reason) if done < all => {
            let message = format!("stopped by {reason}: {done} of {} are merged", count(all, "scene"));
            Err(Error::stopped(message).help("the same command continues from there"))
        }
        _ => Ok(()),
    }
}

/// Refuses a dataset that is also named as a part, since it would be opened twice, and folders inside each other, since
/// the files of one would be foreign to the other.
fn is_apart(out: &StoreFolder, parts: &[StoreFolder]) -> Result<()> {
    let out = plain(out);
    for part in parts {
        let there = plain(part);
        match (out.contains(&there), there.contains(&out)) {
            (true, true) => {
                return Err(Error::new("this folder is both the output and a part")
                    .in_file(part.name())
                    .help(format!(
                        "to merge the other parts into it, leave out the part `{}`: its scenes are kept; else name another output folder",
                        part.name().display()
                    )));
            }
            (false, false) => {}
            _ => {
                return Err(Error::new("output folder and part overlap")
                    .in_file(part.name())
                    .help("choose an output folder beside the parts"));
            }
        }
    }
    Ok(())
}

/// A folder by its path without links. A missing folder belongs to its first existing ancestor.
fn plain(folder: &StoreFolder) -> StoreFolder {
    folder.local().map_or_else(|| folder.clone(), |path| whole(&path).into())
}

fn is_same_folder(one: &StoreFolder, other: &StoreFolder) -> bool {
    let (one, other) = (plain(one), plain(other));
    one.contains(&other) && other.contains(&one)
}

/// A dataset, or the datasets in a folder, such as the shards of a job, by name.
///
/// # Errors
/// If the folder cannot be read.
pub fn datasets_in(named: &StoreFolder) -> Result<Vec<StoreFolder>> {
    if layout::is_dataset(named)? {
        return Ok(vec![named.clone()]);
    }
    let mut names: Vec<String> =
        named.list("")?.into_iter().filter(|(_, kind)| *kind == Kind::Folder).map(|(name, _)| name).collect();
    names.sort_unstable();
    let mut found = Vec::new();
    for name in names {
        let Ok(name) = DatasetPath::new(name) else { continue };
        let inside = named.inner(&name);
        if layout::is_dataset(&inside)? {
            found.push(inside);
        }
    }
    // A folder without datasets is an error of its own.
    Ok(if found.is_empty() { vec![named.clone()] } else { found })
}

/// Refuses shards that come twice.
fn distinct_shards(parts: &[MergePart]) -> Result<()> {
    let mut found: BTreeMap<Shard, &MergePart> = BTreeMap::new();
    for (shard, part) in parts.iter().filter_map(|part| Some((part.shard?, part))) {
        if let Some(other) = found.insert(shard, part) {
            let (one, two) = (other.name(), part.name());
            let message = match is_same_folder(other.folder.files(), part.folder.files()) {
                true if one == two => format!("the part {one} is given twice"),
                true => format!("the parts {one} and {two} are the same folder"),
                false => format!("{one} and {two} are both shard {shard}"),
            };
            return Err(Error::new(message).help("name each shard once"));
        }
    }
    Ok(())
}

/// Refuses shards of different divisions, and missing shards with scenes that the dataset lacks.
fn all_shards(parts: &[MergePart], scenes: u32, has: &dyn Fn(u32) -> bool) -> Result<()> {
    let shards = || parts.iter().filter_map(|part| Some((part.shard?, part)));
    let Some((one, first)) = shards().next() else { return Ok(()) };
    if let Some((shard, part)) = shards().find(|(shard, _)| shard.count != one.count) {
        let message = format!("{} is shard {one}, and {} is shard {shard}", first.name(), part.name());
        return Err(Error::new(message).help("merge shards of one division"));
    }
    let found: BTreeSet<u32> = shards().map(|(shard, _)| shard.index).collect();
    let lacks = |index: &u32| {
        let shard = Shard { index: *index, count: one.count };
        !found.contains(index) && shard.scenes(scenes).any(|scene| !has(scene))
    };
    let missing: Vec<u32> = (0..one.count.min(scenes)).filter(lacks).collect();
    if missing.is_empty() {
        return Ok(());
    }
    let shown = missing.iter().take(SHOWN).map(|&index| Shard { index, count: one.count }.to_string());
    let more = missing.len().saturating_sub(SHOWN);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    let (shards, verb) = if missing.len() == 1 { ("shard", "is") } else { ("shards", "are") };
    Err(Error::new(format!("{shards} {}{more} {verb} missing", shown.collect::<Vec<_>>().join(", ")))
        .help("name the folders of all shards; `options.partial` merges the shards that exist"))
}

/// The recipe of a folder with scenes.
fn recipe_of(folder: &Folder, what: &str) -> Result<String> {
    folder.recipe_of_scenes()?.map_err(|lost| {
        Error::new(format!("the {what} {lost}"))
            .in_file(folder.name())
            .help("restore the file, or run with its recipe, `options.out` and `options.repair`")
    })
}

fn open(part: StoreFolder) -> Result<MergePart> {
    if !layout::is_dataset(&part)? {
        return Err(Error::new("no dataset in this folder")
            .in_file(part.name())
            .help("name the output folder of a run"));
    }
    let folder = Folder::read(part)?;
    let entries = Journal::entries_of(folder.files())?;
    let recipe = recipe_of(&folder, "part")?;
    catalog_paths(&folder)?;
    let shard = folder.shard()?;
    Ok(MergePart { folder, shard, entries, recipe })
}

/// Refuses parts of different recipes.
fn same_recipe(one: &MergePart, other: &MergePart) -> Result<()> {
    match growth::differences(&one.recipe, &other.recipe) {
        differences if differences.is_empty() => Ok(()),
        differences => {
            let folders = [one, other].map(|part| part.folder.name().display().to_string()).join(" and ");
            let message = format!("{folders} have different recipes:{}\n ", growth::listing(&differences));
            Err(Error::new(message)
                .help("make all parts from one recipe; a recipe with [mixture] makes one dataset of several recipes"))
        }
    }
}

fn refused(message: String) -> Result<()> {
    Err(Error::new(message).help("make all parts from one recipe and the same assets"))
}

/// An input of a part, by name.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum PartInput {
    Catalog(String),
    File(String),
    Asset(String),
}

impl MergePart {
    /// The inputs that made the part, with digests.
    fn inputs(&self) -> impl Iterator<Item = (PartInput, String)> {
        let Lock { catalogs, files, assets, .. } = lock_of(&self.recipe);
        let catalogs = catalogs
            .into_iter()
            .map(|(pool, lock)| (PartInput::Catalog(pool), format!("{} {}", lock.assets, lock.digest)));
        let files = files.into_iter().map(|(option, digest)| (PartInput::File(option), digest));
        let drawn = self.entries.assets().clone();
        let assets = assets.into_iter().chain(drawn).map(|(asset, digest)| (PartInput::Asset(asset), digest));
        catalogs.chain(files).chain(assets)
    }
}

/// The inputs of all parts: each with its digest and the first part that has it.
#[derive(Default)]
struct PartInputs<'p>(BTreeMap<PartInput, (String, &'p MergePart)>);

impl<'p> PartInputs<'p> {
    /// Adds the inputs of a part. Refuses one that differed when another part was made.
    fn add(&mut self, part: &'p MergePart) -> Result<()> {
        for (input, digest) in part.inputs() {
            match self.0.entry(input) {
                Entry::Vacant(entry) => drop(entry.insert((digest, part))),
                Entry::Occupied(entry) if entry.get().0 == digest => {}
                Entry::Occupied(entry) => return differed(entry.key(), entry.get().1, part),
            }
        }
        Ok(())
    }
}

fn differed(input: &PartInput, one: &MergePart, other: &MergePart) -> Result<()> {
    let folders = [one, other].map(|part| part.folder.name().display().to_string()).join(" and ");
    match input {
        PartInput::Catalog(pool) => {
            let locks = [one, other].map(|part| lock_of(&part.recipe));
            let homes = [(one.folder.files(), &locks[0]), (other.folder.files(), &locks[1])];
            let how = inputs::difference(pool, homes).map(|how| format!("; from the first to the second: {how}"));
            let message = format!("the pool `{pool}` differed when {folders} were made");
            refused(message + &how.unwrap_or_default())
        }
        PartInput::File(option) => refused(format!("the file of `{option}` differed when {folders} were made")),
        PartInput::Asset(asset) => refused(format!("the asset {asset} differed when {folders} were made")),
    }
}

/// The devices that rendered the parts. Refuses different devices, or warns about them with a log.
fn devices<'p>(parts: impl Iterator<Item = &'p MergePart>, log: Option<&dyn Log>) -> Result<BTreeSet<String>> {
    let mut all: Vec<BTreeSet<String>> = parts.map(|part| lock_of(&part.recipe).devices).collect();
    all.retain(|devices| !devices.is_empty());
    if all.windows(2).any(|pair| pair[0] != pair[1]) {
        let names: BTreeSet<&str> = all.iter().flatten().map(String::as_str).collect();
        let names: Vec<&str> = names.into_iter().collect();
        let error = Error::new(format!("different devices rendered the parts: {}", names.join(", ")));
        let help = "images may differ by rounding; `cpu_path` gives the same bytes on every machine";
        match log {
            Some(log) => log.warn(&error.help(help)),
            None => return Err(error.help(format!("{help}; `options.mixed_devices` merges them"))),
        }
    }
    Ok(all.into_iter().flatten().collect())
}

/// The scenes that are not merged yet, each with a part that has it. All parts with a scene must agree on it.
fn choose<'p>(begun: &'p MergePart, parts: &'p [MergePart]) -> Result<Vec<(SceneLine<'p>, &'p MergePart)>> {
    let mut chosen: BTreeMap<u32, &MergePart> = begun.entries.scenes().map(|scene| (scene, begun)).collect();
    let entry_of = |part: &MergePart, scene| part.entries.get(scene).map(|line| line.entry());
    for part in parts {
        for scene in part.entries.scenes() {
            match chosen.get(&scene) {
                Some(whose) if entry_of(whose, scene) != entry_of(part, scene) => {
                    let [one, two] = [whose, part].map(|part| part.folder.name().display().to_string());
                    return Err(Error::new(format!("scene {scene} differs between {one} and {two}")).help(
                        "one of them is damaged or comes from another version; `syntable verify` compares the files of each",
                    ));
                }
                Some(_) => {}
                None => drop(chosen.insert(scene, part)),
            }
        }
    }
    let new = chosen.into_iter().filter(|(_, part)| !std::ptr::eq(*part, begun));
    Ok(new.filter_map(|(scene, part)| Some((part.entries.get(scene)?, part))).collect())
}

fn catalogs(folder: &Folder, part: &Folder) -> Result<()> {
    let mut catalogs = BTreeMap::new();
    for (pool, path) in catalog_paths(part)? {
        let text = foreign::read(part.files(), &path)?;
        catalogs.extend(serde_json::from_slice(&text).ok().map(|catalog| (pool, catalog)));
    }
    folder.set_catalogs(&catalogs)
}

/// Files with the assets' names of each pool that a part locks.
fn catalog_paths(part: &Folder) -> Result<Vec<(String, DatasetPath)>> {
    let pools = lock_of(&part.recipe()?.unwrap_or_default()).catalogs.into_keys();
    pools.map(|pool| catalog_path(part.files(), &pool).map(|path| (pool, path))).collect()
}

/// Whether an option names the program of a writer, which may run at the end.
fn is_writers_code(recipe: &Recipe, option: &str) -> bool {
    recipe.code.iter().any(|code| code.slot == Slot::Write && code.option == option)
}

/// Refuses changed files that the end of a run reads, and writers with unmet needs. Files that only scenes read may be
/// elsewhere.
fn ready(recipe: &Recipe) -> Result<()> {
    let then = lock_of(&recipe.resolved).files;
    let (of_end, of_scenes): (Vec<_>, Vec<_>) = recipe
        .files
        .iter()
        .partition(|(option, _)| growth::only_finish(recipe, option) || is_writers_code(recipe, option));
    for (option, path) in of_end {
        let help =
            "relative paths count from the current folder: merge in the folder of the recipe that made the parts";
        let found = Stamp::of_file(path).map_err(|error| error.help(help).context(option).of_request())?;
        // A part from another person could name any file of this machine, and the merged dataset would reveal its
        // content.
        let Some(digest) = then.get(option) else {
            return Err(Error::new("the parts have no digest of this file")
                .in_file(path)
                .help("restore `[lock]` in the recipe.toml of the parts, which has a digest of each such file")
                .context(option));
        };
        if *digest != found.1.to_string() {
            return Err(Error::new("the file has changed since the parts were made")
                .in_file(path)
                .help(help)
                .context(option));
        }
    }
    for (id, writer) in &recipe.write {
        let table = format!("write.{id}.");
        if !of_scenes.iter().any(|(option, _)| option.starts_with(&table)) {
            writer.ready().map_err(|error| error.context(format!("write.{id}")))?;
        }
    }
    Ok(())
}

/// Loads the recipe of the parts. It needs neither their assets nor environment variables. Paths of files that writers
/// read at the end are relative to the current folder.
fn load(registry: &Registry, text: &str) -> Result<Recipe> {
    let named =
        |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty()).or_else(|| Some(name.to_owned()));
    let overrides = Overrides { variable: &named, opens_urls: false, ..Overrides::of_process(Vec::new()) };
    let source = Source::embedded(RESERVED[1], without_lock(text));
    let (recipe, _) = syntable_recipe::load(registry, source, &overrides)
        .map_err(|report| Error::new(format!("the recipe of the parts cannot be read:\n{report}")))?;
    let differences = growth::differences(text, &recipe.resolved);
    if !differences.is_empty() {
        let message = format!("another version of the program made the parts:{}\n ", growth::listing(&differences));
        return Err(Error::new(message).help("merge them with that version"));
    }
    Ok(Recipe { resolved: text.to_owned(), ..recipe })
}
