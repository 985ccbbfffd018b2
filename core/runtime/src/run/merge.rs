//! One dataset of parts that were made elsewhere, from one recipe.

use crate::paths::whole;
use crate::recipe::{self, Overrides, Recipe, Source, lock_of, with_devices, without_lock};
use crate::run::dataset::folder::{Folder, catalog_path};
use crate::run::dataset::foreign;
use crate::run::dataset::journal::{Journal, JournalEntry};
use crate::run::dataset::layout;
use crate::run::dataset::manifest::{FileState, Manifest, Stamp, Written};
use crate::run::decisions::growth;
use crate::run::decisions::inputs;
use crate::run::finish;
use crate::run::progress::{Event, Guarded, Reporter, Warnings, count};
use crate::run::stop::Stop;
use crate::run::{Outcome, ranges, stopping};
use crate::workers::Pool;
use parking_lot::Mutex;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Instant;
use syntable_model::context::Log;
use syntable_model::error::{Error, Result};
use syntable_model::files::{DatasetPath, RESERVED};
use syntable_model::registry::Registry;
use syntable_model::store::StoreFolder;

/// A part, open.
struct MergePart {
    folder: Folder,
    entries: BTreeMap<u32, JournalEntry>,
    recipe: String,
}

/// Puts the scenes of several parts into a dataset: new, or begun by an earlier call. The result is that of one run, byte
/// for byte. Parts are not changed; their files are linked where the file system can, else copied. An error leaves what was
/// done, and the same call goes on from there.
pub fn merge<P: Clone + Into<StoreFolder>>(
    registry: &Registry,
    out: impl Into<StoreFolder>,
    parts: &[P],
    threads: usize,
    stop: &Stop,
    reporter: &dyn Reporter,
) -> Result<Outcome> {
    let start = Instant::now();
    let reporter = &Guarded(reporter);
    let (out, parts) = (out.into(), parts.iter().cloned().map(Into::into).collect::<Vec<StoreFolder>>());
    is_apart(&out, &parts)?;
    let parts: Vec<MergePart> = parts.into_iter().map(open).collect::<Result<_>>()?;
    let Some(first) = parts.first() else {
        return Err(Error::new("there is no part to merge"));
    };
    for part in &parts[1..] {
        same_recipe(first, part)?;
    }
    let recipe = load(registry, &first.recipe)?;
    ready(&recipe)?;
    let log = Warnings(reporter);
    let folder = Folder::open(&out)?;
    folder.recover()?;
    let journal = folder.journal()?;
    let recipe_of_target = if folder.is_empty(&journal)? { None } else { Some(recipe_of(&folder, "dataset")?) };
    let begun =
        MergePart { entries: journal.entries().clone(), recipe: recipe_of_target.clone().unwrap_or_default(), folder };
    if recipe_of_target.is_some() {
        same_recipe(&begun, first)?;
    }
    let devices = devices(std::iter::once(&begun).chain(&parts), &log);
    let resolved = with_devices(&first.recipe, &devices);
    begun.folder.set_recipe(&resolved)?;
    let chosen = choose(&begun, &parts)?;
    reporter.event(&Event::Started {
        out: out.name().display().to_string(),
        scenes: (begun.entries.len() + chosen.len()) as u32,
        views_per_scene: recipe.dataset.views_per_scene,
        resumed: begun.entries.len() as u32,
        images: chosen.iter().map(|(entry, _)| u64::from(entry.views())).sum(),
        threads,
    });
    let journal = Mutex::new(journal);
    for (done, (entry, part)) in chosen.iter().enumerate() {
        if let Some(reason) = stop.requested() {
            let message =
                format!("stopped by {}: {done} of {} are merged", reason, count(chosen.len() as u32, "scene"));
            return Err(Error::stopped(message).help("the same command goes on from there"));
        }
        adopt(&begun.folder, &part.folder, entry, &journal)
            .map_err(|error| stopping(error).context(format!("scene {}", entry.scene)))?;
    }
    catalogs(&begun.folder, &first.folder).map_err(stopping)?;
    let journal = journal.into_inner();
    let lacks: Vec<u32> = (0..recipe.dataset.scenes).filter(|scene| !journal.entries().contains_key(scene)).collect();
    let outcome =
        finish::end(&recipe, reporter, &Pool::new(threads)?, &begun.folder, journal, &resolved, (false, &(0..0)))
            .map_err(stopping)?;
    let missing = lacks.len() as u32;
    if missing > 0 {
        let all = count(recipe.dataset.scenes, "scene");
        let message = format!("{missing} of {all} of the recipe are in no part: {}", ranges(lacks.into_iter()));
        let help = "merge the parts that have them into the same folder, or let `syntable run` with the recipe and --out make them";
        log.warn(&Error::new(message).help(help));
    }
    let before: u32 = begun.entries.values().map(JournalEntry::views).sum();
    reporter.event(&Event::Finished {
        out: out.name().display().to_string(),
        scenes: outcome.scenes,
        failed: outcome.failed,
        images: outcome.images,
        made: outcome.images.saturating_sub(before),
        grown: 0,
        seconds: start.elapsed().as_secs_f64(),
    });
    Ok(Outcome { missing, ..outcome })
}

/// Refuses a dataset that is also named as a part, which would be opened twice, and one inside of a part, to which its files
/// would be foreign; and the reverse.
fn is_apart(out: &StoreFolder, parts: &[StoreFolder]) -> Result<()> {
    // Of a folder that does not exist yet, the first one above it that does tells where it will be.
    let plain = |folder: &StoreFolder| folder.local().map_or_else(|| folder.clone(), |path| whole(&path).into());
    let out = plain(out);
    for part in parts {
        let there = plain(part);
        match (out.contains(&there), there.contains(&out)) {
            (true, true) => {
                return Err(Error::new("it is named as the dataset to make, and as one of its parts")
                    .in_file(part.name())
                    .help(format!(
                        "leave out the part `{}` to put the others into it, which keeps its scenes, or name another folder first",
                        part.name().display()
                    )));
            }
            (false, false) => {}
            _ => {
                return Err(Error::new("the dataset to make and this part lie one in the other")
                    .in_file(part.name())
                    .help("name a folder beside the parts"));
            }
        }
    }
    Ok(())
}

/// The recipe of a folder that has scenes.
fn recipe_of(folder: &Folder, what: &str) -> Result<String> {
    folder.recipe_of_scenes()?.map_err(|lost| {
        Error::new(format!("the {what} {lost}"))
            .in_file(folder.name())
            .help("bring it back, or run with its recipe, --out and --repair")
    })
}

fn open(part: StoreFolder) -> Result<MergePart> {
    if !layout::is_dataset(&part)? {
        return Err(Error::new("there is no dataset").in_file(part.name()).help("name the folder that a run wrote"));
    }
    let folder = Folder::read(part)?;
    let entries = Journal::entries_of(folder.files())?;
    let recipe = recipe_of(&folder, "part")?;
    catalog_paths(&folder)?;
    Ok(MergePart { folder, entries, recipe })
}

/// Refuses parts of different recipes or of different inputs.
fn same_recipe(one: &MergePart, other: &MergePart) -> Result<()> {
    let folders = || format!("{} and {}", one.folder.name().display(), other.folder.name().display());
    let refuse = |message: String| Err(Error::new(message).help("make all parts with one recipe and the same assets"));
    let differences = growth::differences(&one.recipe, &other.recipe);
    if !differences.is_empty() {
        return refuse(format!("{} are of different recipes:{}\n ", folders(), growth::listing(&differences)));
    }
    let (locks, mut what) = ([lock_of(&one.recipe), lock_of(&other.recipe)], Vec::new());
    if let Some(pool) = differing(&locks[0].catalogs, &locks[1].catalogs).first() {
        let homes = [(one.folder.files(), &locks[0]), (other.folder.files(), &locks[1])];
        let how = inputs::difference(pool, homes).map(|how| format!("; from the first to the second: {how}"));
        let message = format!("the pool `{pool}` was not the same when {} were made", folders());
        return refuse(message + &how.unwrap_or_default());
    }
    what.extend(
        differing(&locks[0].files, &locks[1].files).into_iter().map(|option| format!("the file of `{option}`")),
    );
    what.extend(differing(&locks[0].assets, &locks[1].assets).into_iter().map(|asset| format!("the asset {asset}")));
    let [assets, others] = [one, other].map(|part| {
        let drawn = part.entries.values().flat_map(|entry| entry.assets.clone());
        drawn.collect::<BTreeMap<String, String>>()
    });
    what.extend(differing(&assets, &others).into_iter().map(|asset| format!("the asset {asset}")));
    match what.first() {
        Some(first) => refuse(format!("{first} was not the same when {} were made", folders())),
        None => Ok(()),
    }
}

/// The devices that rendered any part. Warns if parts were rendered on different ones.
fn devices<'p>(parts: impl Iterator<Item = &'p MergePart>, log: &dyn Log) -> BTreeSet<String> {
    let mut all: Vec<BTreeSet<String>> = parts.map(|part| lock_of(&part.recipe).devices).collect();
    all.retain(|devices| !devices.is_empty());
    if all.windows(2).any(|pair| pair[0] != pair[1]) {
        let names: BTreeSet<&str> = all.iter().flatten().map(String::as_str).collect();
        let names: Vec<&str> = names.into_iter().collect();
        log.warn(
            &Error::new(format!("the parts were not rendered on the same devices, but on {}", names.join(", ")))
                .help("images may differ by rounding; `cpu_path` gives the same bytes on every machine"),
        );
    }
    all.into_iter().flatten().collect()
}

/// Keys that both have, with different values.
fn differing<T: PartialEq>(one: &BTreeMap<String, T>, other: &BTreeMap<String, T>) -> Vec<String> {
    one.iter()
        .filter(|(key, value)| other.get(*key).is_some_and(|other| other != *value))
        .map(|(key, _)| key.clone())
        .collect()
}

/// The scenes that are not merged yet, each with a part that has it. A scene in several parts must be the same in all.
fn choose<'p>(begun: &'p MergePart, parts: &'p [MergePart]) -> Result<Vec<(&'p JournalEntry, &'p MergePart)>> {
    let mut chosen: BTreeMap<u32, (&JournalEntry, &MergePart)> =
        begun.entries.iter().map(|(&scene, entry)| (scene, (entry, begun))).collect();
    for part in parts {
        for (&scene, entry) in &part.entries {
            match chosen.get(&scene) {
                Some((other, whose)) if *other != entry => {
                    let [one, two] = [whose, part].map(|part| part.folder.name().display().to_string());
                    return Err(Error::new(format!("scene {scene} is not the same in {one} and in {two}")).help(
                        "one of them is damaged, or was made by another program; `syntable verify` compares files",
                    ));
                }
                Some(_) => {}
                None => drop(chosen.insert(scene, (entry, part))),
            }
        }
    }
    Ok(chosen.into_values().filter(|(_, part)| !std::ptr::eq(*part, begun)).collect())
}

/// Puts a scene of a part into the dataset.
pub fn adopt(folder: &Folder, part: &Folder, entry: &JournalEntry, journal: &Mutex<Journal>) -> Result<()> {
    let files = part.files();
    let damaged = |path: &str| {
        Error::new("the part is damaged here")
            .in_file(files.name_of(path))
            .help("`syntable run --repair` with the part's recipe and folder makes the scene again")
    };
    let staged = folder.stage(entry.scene)?;
    let mut written = Written::new();
    if let Some(digest) = entry.manifest() {
        let path = layout::manifest(entry.scene);
        let Some((manifest, found)) = Manifest::read(files, &path)? else { return Err(damaged(&path)) };
        if found != digest {
            return Err(damaged(&path));
        }
        for (inside, stamp) in &manifest.files {
            match stamp.check_in(files, inside)? {
                FileState::Whole => {}
                FileState::Linked => {
                    return Err(Error::new("it is a link, or behind one, and links of a part are not followed")
                        .in_file(files.name_of(inside))
                        .help("put the file itself there, as `cp -rL` does"));
                }
                FileState::Missing | FileState::Damaged => return Err(damaged(inside)),
            }
            staged.copy(files, inside, inside)?;
        }
        written = manifest.writers;
    }
    let merged = folder.commit(entry.clone(), Manifest::default(), written, journal)?;
    if merged == *entry { Ok(()) } else { Err(damaged("")) }
}

fn catalogs(folder: &Folder, part: &Folder) -> Result<()> {
    let mut catalogs = BTreeMap::new();
    for (pool, path) in catalog_paths(part)? {
        let text = foreign::read(part.files(), &path)?;
        catalogs.extend(serde_json::from_slice(&text).ok().map(|catalog| (pool, catalog)));
    }
    folder.set_catalogs(&catalogs)
}

/// Where the names of the assets of each pool are that a part locks.
fn catalog_paths(part: &Folder) -> Result<Vec<(String, DatasetPath)>> {
    let pools = lock_of(&part.recipe()?.unwrap_or_default()).catalogs.into_keys();
    pools.map(|pool| catalog_path(part.files(), &pool).map(|path| (pool, path))).collect()
}

/// Refuses files that the end of a run reads and that are not what they were when the parts were made, and writers that
/// lack something. What only the scenes read may be elsewhere.
fn ready(recipe: &Recipe) -> Result<()> {
    let then = lock_of(&recipe.resolved).files;
    let (of_end, of_scenes): (Vec<_>, Vec<_>) =
        recipe.files.iter().partition(|(option, _)| growth::only_finish(recipe, option));
    for (option, path) in of_end {
        let help =
            "relative paths count from the current folder: merge in the folder of the recipe that made the parts";
        let found = Stamp::of_file(path).map_err(|error| error.help(help).context(option).of_request())?;
        // A part of somebody else could name any file of this machine, and would have the merged dataset tell what is in it.
        let Some(digest) = then.get(option) else {
            return Err(Error::new("the parts do not say what was in it")
                .in_file(path)
                .help(
                    "`[lock]` of a part's recipe.toml has a digest of each such file: bring the recipe back as it was",
                )
                .context(option));
        };
        if *digest != found.1.to_string() {
            return Err(Error::new("it is not what it was when the parts were made")
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

/// The recipe of the parts. Its assets are not needed, and neither is what the environment says of them; files that writers
/// read at the end count from the current folder.
fn load(registry: &Registry, text: &str) -> Result<Recipe> {
    let named =
        |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty()).or_else(|| Some(name.to_owned()));
    let overrides = Overrides { variable: &named, ..Overrides::of_process(Vec::new()) };
    let source = Source::embedded(RESERVED[1], without_lock(text));
    let (recipe, _) = recipe::load(registry, source, &overrides)
        .map_err(|report| Error::new(format!("the recipe of the parts cannot be read:\n{report}")))?;
    let differences = growth::differences(text, &recipe.resolved);
    if !differences.is_empty() {
        let message = format!("the parts were made by another program:{}\n ", growth::listing(&differences));
        return Err(Error::new(message).help("merge them with the program that made them"));
    }
    Ok(Recipe { resolved: text.to_owned(), ..recipe })
}
