//! A loaded recipe, and facts about its run that are known beforehand.

use crate::component::Component;
use crate::one_of::{Chosen, OneOf};
use crate::own_code::OwnCode;
use crate::plan::memory;
use crate::resolved::without_lock;
use crate::tables::alternatives::MIXTURE;
use crate::tables::dataset::{Dataset, Lock};
use crate::tables::pool::Pool;
use crate::writer_paths::{bad_paths, unready};
use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use syntable_model::check::LabelCheck;
use syntable_model::context::Log;
use syntable_model::digest::{Digest, Hasher};
use syntable_model::error::{Error, Result};
use syntable_model::mirror::{DatasetFile, Mirror};
use syntable_model::random::Stream;
use syntable_model::registry::Slot;
use syntable_model::scene::CatalogEntry;
use syntable_model::stage::{Companions, DatasetInfo, Scenes, Writer};

/// A loaded recipe, ready to be planned and run.
pub struct Recipe {
    /// Name, seed and size of the dataset.
    pub dataset: Dataset,
    /// The pools of all components, by name.
    pub assets: BTreeMap<String, Pool>,
    /// The components of a mixture, or the only component. Each makes scenes.
    pub components: OneOf<Component>,
    /// The writers, by id.
    pub write: Vec<(String, Box<dyn Writer<Scenes>>)>,
    /// The whole recipe as TOML: every default filled in, every kind named, nothing inherited, with the versions that
    /// made it. Loading it gives the same text.
    pub resolved: String,
    /// The required inputs; empty unless the recipe is a resolved one.
    pub lock: Lock,
    /// Files that options of stages name, by the option; assets and libraries are left out. Their content matters.
    pub files: Vec<(String, PathBuf)>,
    /// Statements that must hold in every view.
    pub checks: Vec<Arc<dyn LabelCheck>>,
    /// The folder of the recipe's file, if it has one.
    pub folder: Option<PathBuf>,
    /// Kinds that were chosen for this machine, for users: one line each.
    pub choices: Vec<String>,
    /// Tables whose kind represents others and has not chosen one yet. Such a recipe can be planned, but not run.
    pub undecided: Vec<String>,
    /// Code by the author of the recipe.
    pub code: Vec<OwnCode>,
    /// Mirrors of assets and files at URLs, which stages read as long as the recipe lasts.
    pub mirrors: Vec<Arc<Mirror>>,
}

impl Recipe {
    /// Finds mistakes that would end a run: all of them are permanent. Native libraries are loaded; see
    /// [`trusted`](Self::trusted).
    pub fn ready(&self, allow_code: bool) -> Result<()> {
        self.trusted(allow_code)?;
        for (_, component) in self.components.weights().filter(|(weight, _)| *weight > 0.0) {
            component.plan.ready()?;
            let devices = component.render.devices();
            devices.map_err(|error| error.context(component.table(Slot::Render.name())))?;
        }
        self.checked()
    }

    /// Refuses a recipe that brings code of its own, unless it is allowed.
    pub fn trusted(&self, allow_code: bool) -> Result<()> {
        self.refuse_code(allow_code, |_| true)
    }

    /// Like [`trusted`](Self::trusted), for the code of one slot.
    pub fn trusted_of(&self, slot: Slot, allow_code: bool) -> Result<()> {
        self.refuse_code(allow_code, |of| of == slot)
    }

    fn refuse_code(&self, allow_code: bool, runs: impl Fn(Slot) -> bool) -> Result<()> {
        let code: Vec<&str> =
            self.code.iter().filter(|code| runs(code.slot) && !allow_code).map(|code| &*code.shown).collect();
        if code.is_empty() {
            return Ok(());
        }
        let error = Error::new(format!("the recipe brings code of its own: {}", code.join("; ")));
        let help = "code runs with your permissions: allow it with `options.allow_code` if you trust it; for a library, you can also name your own with ${NAME} or `options.set`";
        Err(error.help(help))
    }

    /// Refuses images that do not fit in this machine's memory. If the camera does not state the size of its images,
    /// the size is unknown before a view.
    pub fn fits(&self) -> Result<()> {
        let Some(installed) = memory::installed() else { return Ok(()) };
        let fits = |component: &Component| match component.resolution {
            Some(size) => memory::fits(&component.plan, size, installed),
            None => Ok(()),
        };
        self.components.all().try_for_each(fits)
    }

    fn checked(&self) -> Result<()> {
        let writers: Vec<(&str, &dyn Writer<Scenes>)> =
            self.write.iter().map(|(id, writer)| (id.as_str(), &**writer)).collect();
        let mistakes = writers.iter().filter_map(|writer| unready(*writer));
        // Components agree on the products that writers read.
        let plan = &self.components.first().plan;
        let mut mistakes = mistakes.chain(bad_paths(&self.dataset_info(), &writers, Some(plan)));
        mistakes.next().map_or(Ok(()), |(_, error)| Err(error))
    }

    /// The labeled objects that placers have themselves instead of drawing them from a pool, each with its step's id.
    pub fn own_objects(&self) -> Vec<(&str, CatalogEntry)> {
        let steps = self.components.all().flat_map(|component| &component.place);
        let steps =
            steps.flat_map(|(id, placers)| placers.all().map(move |placer| (id.as_str(), placer.own_objects())));
        steps.flat_map(|(id, own)| own.into_iter().map(move |entry| (id, entry))).collect()
    }

    /// The component that makes a scene, with its index. It depends on the number of the scene, and on the name and the seed of
    /// the dataset.
    pub fn component_of(&self, scene: u32) -> (usize, &Component) {
        let stream = Stream::root(self.dataset.seed).child(&self.dataset.name).child(MIXTURE).at(u64::from(scene));
        let Chosen { stage, alternative, .. } = self.components.draw(stream);
        (alternative.unwrap_or_default() as usize, stage)
    }

    /// Pools of labeled objects of all components.
    pub fn labeled_pools(&self) -> BTreeSet<String> {
        self.components.all().flat_map(|component| component.labeled_pools.iter().cloned()).collect()
    }

    /// Bytes of the images that writers store of each view, before compression, at most; none if the size of images is not known
    /// before a view. Masks and records, whose size follows the number of objects, come on top.
    pub fn stored_bytes_per_view(&self) -> Option<u64> {
        let of_component = |component: &Component| {
            let [width, height] = component.resolution?;
            let bytes = component.plan.entries.iter().map(|entry| {
                let writers = entry.wanted_by.iter().filter(|stage| stage.starts_with("write.")).count() as u64;
                writers * memory::bytes_per_pixel(&entry.key)
            });
            Some(u64::from(width) * u64::from(height) * bytes.sum::<u64>())
        };
        self.components.all().map(of_component).try_fold(0, |most, bytes| Some(bytes?.max(most)))
    }

    /// Digests of the files that options name, by option. The digest of a folder is the digest of the names in it.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn file_digests(&self) -> Result<BTreeMap<String, String>> {
        self.digests_with(&BTreeMap::new())
    }

    /// Digests of the files that options name, by option, for `[lock]`. The digest of a file that names others, such as a mesh
    /// and its images, covers them. The digest of a folder is the digest of the names in it.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn input_digests(&self, log: &dyn Log) -> Result<BTreeMap<String, String>> {
        self.digests_with(&self.companions(log)?)
    }

    fn digests_with(&self, companions: &BTreeMap<PathBuf, BTreeSet<PathBuf>>) -> Result<BTreeMap<String, String>> {
        let digest = |(option, path): &(String, PathBuf)| {
            let digest = if path.is_dir() { listing(path) } else { digest_of(path, companions.get(path)) };
            let in_option = |error: Error| match error.io_kind() {
                Some(ErrorKind::NotFound) => error.of_request().context(option),
                _ => error.context(option),
            };
            Ok((option.clone(), digest.map_err(in_option)?.to_string()))
        };
        self.files.iter().map(digest).collect()
    }

    /// The files that placers read because the files of their options name them, by the option's file.
    fn companions(&self, log: &dyn Log) -> Result<BTreeMap<PathBuf, BTreeSet<PathBuf>>> {
        let mut all: BTreeMap<PathBuf, BTreeSet<PathBuf>> = BTreeMap::new();
        for (id, placers) in self.components.all().flat_map(|component| &component.place) {
            for placer in placers.all() {
                let found = placer.companions(log).map_err(|error| error.context(format!("place.{id}")))?;
                found.into_iter().for_each(|Companions { of, files }| all.entry(of).or_default().extend(files));
            }
        }
        Ok(all)
    }

    /// Information on the dataset that stages may use.
    pub fn dataset_info(&self) -> DatasetInfo {
        let of_pools = self.assets.values().flat_map(|pool| pool.options.classes.keys().cloned());
        let of_placers = self.own_objects().into_iter().map(|(_, entry)| entry.category);
        let classes: BTreeSet<String> = of_pools.chain(of_placers.filter(|category| !category.is_empty())).collect();
        DatasetInfo {
            name: self.dataset.name.clone(),
            seed: self.dataset.seed,
            scenes: self.dataset.scenes,
            views_per_scene: self.dataset.views_per_scene,
            recipe: without_lock(&self.resolved),
            program: concat!("syntable ", env!("CARGO_PKG_VERSION")).to_owned(),
            classes: classes.into_iter().filter(|class| *class != DatasetInfo::OBJECT.1).collect(),
            own_categories: Vec::new(),
            label_surface: self.components.first().render.label_surface(),
        }
    }

    /// Information on the dataset for stages that work on the scenes of a component.
    pub fn info_of(&self, component: &Component) -> DatasetInfo {
        DatasetInfo { label_surface: component.render.label_surface(), ..self.dataset_info() }
    }
}

/// The digest of the names in a folder, without hidden ones: stages draw files from folders.
fn listing(folder: &Path) -> Result<Digest> {
    let entries = std::fs::read_dir(folder).and_then(|entries| entries.collect::<std::io::Result<Vec<_>>>());
    let entries = entries.map_err(|error| Error::io(folder, &error))?;
    let mut names: Vec<String> = entries.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.retain(|name| !name.starts_with('.'));
    names.sort();
    Ok(names.iter().fold(Hasher::new("names in a folder"), |hasher, name| hasher.text(name)).finish())
}

/// The digest of a file, and of the files that belong to it: their names and contents.
fn digest_of(path: &Path, companions: Option<&BTreeSet<PathBuf>>) -> Result<Digest> {
    let of_file = |path: &Path| {
        let read = DatasetFile::open(path).and_then(Digest::of_reader);
        read.map(|(digest, _)| digest).map_err(|error| Error::io(path, &error))
    };
    let digest = of_file(path)?;
    let Some(companions) = companions.filter(|companions| !companions.is_empty()) else { return Ok(digest) };
    let folder = path.parent().unwrap_or(Path::new(""));
    companions
        .iter()
        .try_fold(Hasher::new("file with companions").digest(digest), |hasher, companion| {
            let name = companion.strip_prefix(folder).unwrap_or(companion).to_string_lossy().replace('\\', "/");
            Ok(hasher.text(&name).digest(of_file(companion)?))
        })
        .map(Hasher::finish)
}
