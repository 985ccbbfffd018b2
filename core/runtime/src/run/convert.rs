//! Conversion of datasets between formats.
//!
//! A reader offers products like a renderer. Annotators whose inputs are products alone derive the products that
//! writers read.

use crate::images::ImageProgress;
use crate::paths::{root_of, run_above};
use crate::run::conversion_target::ConversionTarget;
use crate::run::dataset::loss::Loss;
use crate::run::making::losses::{DatasetLender, Losses};
use crate::run::making::stages::annotate_image;
use crate::run::making::times::Times;
use crate::run::making::writers::Writers;
use crate::run::progress::{Guarded, Reporter, Warnings, count};
use crate::run::stop::Stop;
use crate::workers::Pool;
use parking_lot::Mutex;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use syntable_model::check::LabelCheck;
use syntable_model::context::{DatasetContext, ImageContext};
use syntable_model::error::{Error, Result};
use syntable_model::left_out::LeftOut;
use syntable_model::product::standard::{AMODAL_MASK, COVERAGE, VISIBLE_BOX, VISIBLE_IDS, VISIBLE_MASK};
use syntable_model::product::{BBox, KeyId, Mask, Products, Scope};
use syntable_model::reader::{DatasetFault, OpenDataset, ReadImage};
use syntable_model::registry::Registry;
use syntable_model::rule;
use syntable_model::scene::{InstanceId, SceneId};
use syntable_model::stage::{Finish, ImageAnnotator, Input, InputNeed, ProductGroup, Writer};
use syntable_model::store::StoreFolder;
use syntable_recipe::plan::{self, Candidate, Implied, Offers, Plan, PlanFault, Producer};

/// Result of a conversion.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Converted {
    /// Number of scenes of the dataset.
    pub scenes: u32,
    /// Number of written images.
    pub images: u32,
    /// Products of the dataset that no writer reads. They are lost.
    pub lost: Vec<String>,
    /// Optional inputs of writers that the dataset lacks.
    pub lacking: Vec<String>,
    /// Differences in meaning between the products of the dataset and the same products of a run.
    pub caveats: Vec<String>,
    /// Number of faults that reading found in data that was kept; `syntable validate` lists all faults.
    pub faults: u32,
    /// Data that stages omitted from images: pixels, outlines, objects.
    pub losses: Vec<Loss>,
    /// Objects without pixels, by image, if a writer omitted such objects.
    pub without_pixels: Vec<String>,
    /// Annotations of the dataset that the reader did not turn into objects.
    pub not_objects: Vec<LeftOut>,
    /// Label fields that no product holds, such as keypoints. They are lost.
    pub not_kept: Vec<LeftOut>,
    /// Unreadable images, which the result omits, with reasons, in order.
    pub left_out: Vec<String>,
    /// Unreadable or missing files that hide images from the dataset's list, with reasons.
    pub not_listed: Vec<String>,
    /// Unreadable files beside images, such as meshes, which the result omits, with reasons.
    pub parts_left_out: Vec<String>,
}

/// Refuses a dataset without images, unless its format omits images without objects. `place` is the dataset's path.
///
/// # Errors
/// Names the file that hides the images, if opening the dataset found one.
pub fn check_images(dataset: &OpenDataset, place: &Path) -> Result<()> {
    match dataset.faults.first() {
        _ if !dataset.images.is_empty() => Ok(()),
        Some(first) => {
            let why = format!("no image can be read: {first}");
            Err(Error::new(why).help("`syntable validate` lists all faults"))
        }
        None if dataset.lists_all_images => Err(Error::new("the dataset has no image").in_file(place)),
        None => Ok(()),
    }
}

/// Writes a dataset with these writers into a folder, which must be new or empty. On this machine, the folder appears
/// when all files are complete. After an error, no file remains. Unreadable images are omitted. If no image is
/// readable, the conversion fails.
pub fn convert_dataset(
    registry: &Registry,
    dataset: &OpenDataset,
    writers: &[(String, Box<dyn Writer>)],
    out: &StoreFolder,
    (threads, stop): (usize, &Stop),
    reporter: &dyn Reporter,
) -> Result<Converted> {
    let guarded = Guarded(reporter);
    let log = Warnings(&guarded);
    let ConversionPlan { plan, lacking } = resolve(registry, dataset, writers)?;
    let target = ConversionTarget::begin(out)?;
    let part = target.files();
    let pool = Pool::new(threads)?;
    let cx = DatasetContext::new(&dataset.info, &pool, &log);
    let at_end = DatasetLender::new(cx);
    let (faults, unread, missing) = (AtomicU32::new(0), Mutex::new(BTreeMap::new()), Mutex::default());
    let losses = Arc::new(Losses::default());
    let work = ConversionWalk {
        dataset,
        writers,
        plan: &plan,
        part: &part,
        stop,
        cx,
        at_end: &at_end,
        checks: registry.checks(),
        faults: &faults,
        losses: &losses,
        progress: &ImageProgress::new(&guarded, "converted", dataset.images.len()),
        unread: &unread,
        missing: &missing,
    };
    let scenes = work.scenes().and_then(|scenes| work.finish(&scenes).map(|()| scenes))?;
    target.publish()?;
    let unread = unread.into_inner();
    let Missing { annotations, parts, without_pixels } = missing.into_inner();
    let not_objects = not_objects(dataset, writers, &plan);
    let read: Vec<String> = plan.entries.iter().map(|entry| entry.key.to_string()).collect();
    let is_read = |key: &KeyId| read.contains(&key.to_string());
    let alike = &dataset.alike;
    let said_otherwise = |key: &KeyId| alike.iter().any(|pair| pair.contains(key) && pair.iter().any(is_read));
    let inputs: Vec<Input> = writers.iter().flat_map(|(_, writer)| writer.reads()).collect();
    let of = |key: &KeyId, is_stored: bool| inputs.iter().any(|it| it.is_stored == is_stored && key.is(&it.product));
    let is_kept = |key: &KeyId| is_read(key) && (of(key, true) || !of(key, false));
    let stored = dataset.offers.iter().filter(|key| !dataset.is_derived(key));
    let lost = stored.filter(|key| !is_kept(key) && !said_otherwise(key)).map(|key| key.to_string());
    let losses: Vec<Loss> = losses.all().into_iter().chain(at_end.losses()).collect();
    let are_left_out = losses.iter().any(|loss| LeftOut::is_without_pixels(&loss.what));
    let without_pixels = without_pixels.into_values().filter(|_| are_left_out).flatten();
    Ok(Converted {
        without_pixels: without_pixels.collect(),
        scenes: scenes.len() as u32,
        images: (dataset.images.len() - unread.len()) as u32,
        lost: lost.collect(),
        lacking,
        caveats: dataset.caveats(&plan.rendered),
        faults: faults.into_inner() + dataset.faults.iter().filter(|fault| !fault.is_lost).count() as u32,
        losses,
        not_objects: LeftOut::sum(not_objects.into_iter().chain(annotations.into_values().flatten())),
        not_kept: dataset.not_kept(&plan.rendered).into_iter().filter(|it| it.count > 0).collect(),
        left_out: unread.into_values().map(|error| error.to_string()).collect(),
        not_listed: not_listed(dataset),
        parts_left_out: parts.into_iter().collect(),
    })
}

/// Annotations that some writer does not get as objects. A product that makes up for the missing mask of an object counts only for
/// the writers that read it.
fn not_objects(dataset: &OpenDataset, writers: &[(String, Box<dyn Writer>)], plan: &Plan) -> Vec<LeftOut> {
    let mut all: Vec<LeftOut> = Vec::new();
    let is_of_some = |key: &KeyId, input: &Input| input.need == InputNeed::IfStored && key.is(&input.product);
    for (_, writer) in writers {
        let own = writer.reads();
        let is_of_others = |key: &KeyId| {
            let mut others = writers.iter().flat_map(|(_, writer)| writer.reads());
            !own.iter().any(|input| key.is(&input.product)) && others.any(|input| is_of_some(key, &input))
        };
        let reads: Vec<KeyId> = plan.rendered.iter().copied().filter(|key| !is_of_others(key)).collect();
        let found = dataset.not_objects(&reads);
        all.extend(found.into_iter().filter(|it| !all.iter().any(|other| other.what == it.what)).collect::<Vec<_>>());
    }
    all
}

/// Unreadable or missing files that hide images from the list of a dataset, with reasons.
pub fn not_listed(dataset: &OpenDataset) -> Vec<String> {
    let lost = dataset.faults.iter().filter(|fault| fault.is_lost);
    lost.map(DatasetFault::to_string).collect()
}

/// Names of the products that a dataset has or that annotators derive from them.
pub fn products_of(registry: &Registry, dataset: &OpenDataset) -> BTreeSet<String> {
    let offers = &dataset.offers;
    can_be_had(offers, &parts_of_all(registry, offers))
}

/// Refuses an output folder inside the source dataset or inside a run's folder: readers would take its files for a part
/// of that dataset, and the run would neither list nor keep them.
///
/// # Errors
/// Names both folders, and suggests another.
pub fn check_place(out: &Path, source: &Path) -> Result<()> {
    let absolute = std::path::absolute(out).map_err(|error| Error::io(out, &error))?;
    // The folder may be a link. A missing folder belongs to its first existing ancestor.
    let place = match absolute.canonicalize() {
        Ok(out) => out.parent().map(Path::to_owned),
        Err(_) => absolute.ancestors().skip(1).find_map(|above| above.canonicalize().ok()),
    };
    let Some(place) = place else { return Ok(()) };
    let in_dataset = root_of(source).filter(|root| place.starts_with(root)).map(|root| (root, "the source dataset"));
    let in_run = run_above(&place).map(|root| (root, "the folder of a run"));
    let Some((root, what)) = in_dataset.or(in_run) else { return Ok(()) };
    let beside = root.with_file_name(out.file_name().unwrap_or_default());
    Err(Error::new(format!("the output folder is inside {what}, {}", root.display()))
        .in_file(out)
        .help(format!("choose a folder outside, such as {}", beside.display())))
}

/// Derived products, and the products that writers do without.
struct ConversionPlan {
    plan: Plan,
    lacking: Vec<String>,
}

/// Plans how to derive the products that the writers read.
fn resolve(
    registry: &Registry,
    dataset: &OpenDataset,
    writers: &[(String, Box<dyn Writer>)],
) -> Result<ConversionPlan> {
    let offers = &dataset.offers;
    let parts = parts_of_all(registry, offers);
    let has = can_be_had(offers, &parts);
    let (mut wants, mut lacking) = (Vec::new(), BTreeSet::new());
    for (id, writer) in writers {
        let (without, reads): (Vec<Input>, Vec<Input>) = writer
            .reads()
            .into_iter()
            .partition(|input| input.need != InputNeed::Always && !has.contains(&input.product));
        // Only renderers know these products. Masks state what they are good for.
        let lacks = |product: &String| *product != *COVERAGE.name();
        let expected = without.into_iter().filter(|input| input.need != InputNeed::IfStored);
        lacking.extend(expected.map(|input| input.product).filter(lacks));
        wants.push((format!("write.{id}"), reads));
    }
    let candidate = |(stage, part): (String, AnnotatorGroup)| {
        let implied = part.implied.clone();
        Candidate { stage, producer: Producer::Image(Box::new(part)), implied }
    };
    let implied = parts.into_iter().map(candidate).collect();
    let plan = plan::resolve(Offers::Stored(offers.clone()), Vec::new(), implied, &wants).map_err(|errors| {
        let is_unknown = |error: &&plan::PlanError| error.fault == PlanFault::Unknown;
        let mut messages: Vec<String> = Vec::new();
        for (id, _) in writers {
            let stage = format!("write.{id}");
            let missing = errors.iter().filter(is_unknown).filter(|error| error.stage == stage);
            let missing: Vec<String> = missing.map(|error| format!("`{}`", error.product)).collect();
            if !missing.is_empty() {
                messages.push(format!("{stage} reads {}, which the dataset lacks", missing.join(", ")));
            }
        }
        messages.extend(errors.iter().filter(|error| !is_unknown(error)).map(|error| error.message.clone()));
        if messages.is_empty() {
            // Products that an annotator would derive from missing ones.
            messages.extend(
                errors
                    .iter()
                    .map(|error| format!("{} reads `{}`, which the dataset lacks", error.stage, error.product)),
            );
        }
        let has: Vec<String> = offers.iter().map(|key| format!("`{key}`")).collect();
        let mut help = format!("the dataset has {}", has.join(", "));
        // An entry such as `include[0]`.
        let named = errors.iter().filter(is_unknown).find_map(|error| {
            let option = error.option.as_ref()?.split('[').next().filter(|option| *option == "include")?;
            Some((error.stage.strip_prefix("write.")?, option))
        });
        // The writer may refuse the type of a product.
        let accepted = |kind: &str, option: &str| {
            let (_, writer) = writers.iter().find(|(id, _)| id == kind)?;
            let inputs = writer.reads();
            let mut inputs =
                inputs.iter().filter(|input| input.option.as_deref().is_some_and(|it| it.starts_with(option)));
            let accepts = &inputs.next()?.accepts;
            offers.iter().find(|key| accepts.check(key).is_ok()).map(KeyId::to_string)
        };
        if let Some(((kind, option), product)) = named.and_then(|named| Some((named, accepted(named.0, named.1)?))) {
            help += &format!("; choose among them, for instance with `options.set` '{kind}.{option}=[\"{product}\"]'");
        }
        Error::new(messages.join("; ")).help(help)
    })?;
    Ok(ConversionPlan { plan, lacking: lacking.into_iter().collect() })
}

/// A group of products that an annotator provides.
struct AnnotatorGroup {
    annotator: Arc<dyn ImageAnnotator>,
    implied: Option<Implied>,
    group: ProductGroup,
}

impl ImageAnnotator for AnnotatorGroup {
    fn reads(&self) -> Vec<KeyId> {
        self.group.reads.clone()
    }

    fn provides(&self) -> Vec<KeyId> {
        self.group.provides.clone()
    }

    fn annotate(&self, cx: &ImageContext, products: &mut Products) -> Result<()> {
        // The annotator does not see its other inputs.
        let lent = products.only(&self.annotator.reads());
        let mut filled = lent.clone();
        self.annotator.annotate(cx, &mut filled)?;
        products.extend(filled.without(&lent))
    }
}

/// The groups of all annotators; see [`parts_of`].
fn parts_of_all(registry: &Registry, offers: &[KeyId]) -> Vec<(String, AnnotatorGroup)> {
    plan::registered(registry).into_iter().flat_map(|candidate| parts_of(candidate, offers)).collect()
}

/// The groups of an annotator whose only inputs are products, without the groups that the dataset has.
fn parts_of(candidate: Candidate, offers: &[KeyId]) -> Vec<(String, AnnotatorGroup)> {
    let Producer::Image(annotator) = candidate.producer else { return Vec::new() };
    let annotator: Arc<dyn ImageAnnotator> = annotator.into();
    let groups = annotator.groups();
    let is_whole = groups.len() == 1;
    let is_new = |group: &ProductGroup| {
        !group.provides.iter().any(|key| offers.iter().any(|it| it.product_id() == key.product_id()))
    };
    let part = |group: ProductGroup| {
        let names: Vec<String> = group.provides.iter().map(|key| key.to_string()).collect();
        let stage = &candidate.stage;
        let stage = if is_whole { stage.clone() } else { format!("{stage} ({})", names.join(", ")) };
        (stage, AnnotatorGroup { annotator: Arc::clone(&annotator), implied: candidate.implied.clone(), group })
    };
    groups.into_iter().filter(is_new).map(part).collect()
}

/// Names of the products that a dataset has or that follow from them.
fn can_be_had(offers: &[KeyId], parts: &[(String, AnnotatorGroup)]) -> BTreeSet<String> {
    let name = |key: &KeyId| key.to_string();
    let mut has: BTreeSet<String> = offers.iter().map(name).collect();
    loop {
        let groups = parts.iter().map(|(_, part)| &part.group);
        let made = groups.filter(|group| group.reads.iter().all(|key| has.contains(&name(key))));
        let new: Vec<String> =
            made.flat_map(|group| &group.provides).map(name).filter(|it| !has.contains(it)).collect();
        if new.is_empty() {
            return has;
        }
        has.extend(new);
    }
}

struct ConversionWalk<'a> {
    dataset: &'a OpenDataset,
    writers: &'a [(String, Box<dyn Writer>)],
    plan: &'a Plan,
    part: &'a StoreFolder,
    stop: &'a Stop,
    cx: DatasetContext<'a>,
    at_end: &'a DatasetLender<'a>,
    checks: &'a [Arc<dyn LabelCheck>],
    /// Number of faults in images: faults of their records, and faults that the checks found.
    faults: &'a AtomicU32,
    losses: &'a Arc<Losses>,
    progress: &'a ImageProgress<'a>,
    /// Reasons why images could not be read.
    unread: &'a Mutex<BTreeMap<usize, Error>>,
    missing: &'a Mutex<Missing>,
}

/// Omitted parts of images that were read.
#[derive(Default)]
struct Missing {
    /// Annotations that are not objects, by image.
    annotations: BTreeMap<usize, Vec<LeftOut>>,
    /// Reasons for missing parts of products, without repetition.
    parts: BTreeSet<String>,
    /// Objects without pixels, by image.
    without_pixels: BTreeMap<usize, Vec<String>>,
}

impl Missing {
    fn add(&mut self, image: usize, left_out: Vec<LeftOut>, unread: Vec<Error>, without_pixels: Vec<String>) {
        if !left_out.is_empty() {
            self.annotations.insert(image, left_out);
        }
        if !without_pixels.is_empty() {
            self.without_pixels.insert(image, without_pixels);
        }
        self.parts.extend(unread.into_iter().map(|error| error.to_string()));
    }
}

impl ConversionWalk<'_> {
    /// Writes all scenes, and returns them in order.
    fn scenes(&self) -> Result<Vec<SceneId>> {
        let mut images: BTreeMap<SceneId, Vec<usize>> = BTreeMap::new();
        for (index, image) in self.dataset.images.iter().enumerate() {
            images.entry(image.scene).or_default().push(index);
        }
        let scenes: Vec<(SceneId, Vec<usize>)> = images.into_iter().collect();
        let failure: Mutex<Option<(usize, Error)>> = Mutex::new(None);
        let written = Mutex::new(BTreeSet::new());
        self.cx.workers.run(scenes.len(), &|index| {
            if failure.lock().as_ref().is_some_and(|(first, _)| *first < index) {
                return;
            }
            match self.scene(scenes[index].0, &scenes[index].1) {
                Ok(true) => drop(written.lock().insert(scenes[index].0)),
                Ok(false) => {}
                Err(error) => {
                    let mut failure = failure.lock();
                    // Reports only the error of the first failing scene.
                    if failure.as_ref().is_none_or(|(first, _)| index < *first) {
                        *failure = Some((index, error));
                    }
                }
            }
        });
        if let Some((index, error)) = failure.into_inner() {
            return Err(error.context(format!("scene {}", scenes[index].0.0)));
        }
        let written = written.into_inner();
        match self.unread.lock().values().next() {
            Some(first) if written.is_empty() => Err(first.clone().context("no image can be read").of_request()),
            _ => Ok(written.into_iter().collect()),
        }
    }

    /// Writes the readable images of a scene. Returns whether it has any.
    fn scene(&self, id: SceneId, images: &[usize]) -> Result<bool> {
        let (cx, times) = (self.cx.images(id), Times::default());
        let (mut writers, mut of_scene) = (None, Products::new());
        for &image in images {
            if let Some(reason) = self.stop.requested() {
                return Err(Error::stopped(format!("stopped by {reason}")));
            }
            self.progress.one_more();
            let of = |error: Error| error.context(self.dataset.images[image].name.clone());
            let (read, faults) = match self.dataset.read_with_faults(image, &self.plan.rendered) {
                Ok(read) => read,
                Err(error) => {
                    self.unread.lock().insert(image, of(error));
                    continue;
                }
            };
            let ReadImage { size, mut products, left_out, unread } = read;
            let cx_of_view = cx.image(self.dataset.images[image].view, size);
            annotate_image(&times, self.losses, self.plan, &cx_of_view, &mut products).map_err(of)?;
            self.faults.fetch_add(faults.len() as u32, Ordering::Relaxed);
            let name = &self.dataset.images[image].name;
            let empty =
                objects_without_pixels(&faults, &products).into_iter().map(|object| format!("{name}: {object}"));
            self.missing.lock().add(image, left_out, unread, empty.collect());
            for check in self.checks {
                let found = self.dataset.label_faults(image, &**check, &products).map_err(of)?;
                self.faults.fetch_add(found.len() as u32, Ordering::Relaxed);
            }
            if writers.is_none() {
                writers = Some(Writers::start(self.writers, &cx, self.part, (&times, self.losses))?);
            }
            if let Some(writers) = &mut writers {
                writers.view_of(&cx_of_view, |reads| lent(&products, reads)).map_err(of)?;
            }
            let known: Vec<KeyId> = products.keys().into_iter().filter(|key| key.scope == Scope::Scene).collect();
            of_scene = products.only(&known);
        }
        writers.map_or(Ok(false), |writers| writers.close(&cx, &of_scene).map(|_| true))
    }

    fn finish(&self, scenes: &[SceneId]) -> Result<()> {
        self.writers.iter().try_for_each(|(id, writer)| {
            let products = Products::new().only(&Input::names(&writer.reads()));
            let reads = self.plan.read_by(&writer.reads());
            let finish = Finish::new(self.part, id, scenes.to_vec()).reading(reads).staged(self.part);
            let finished = self.at_end.lend(&format!("write.{id}"), |cx| writer.finish(cx, &products, &finish));
            finished.map_err(|error| error.context(id.clone()))
        })
    }
}

/// The objects of an image without pixels: in the words of the reader if it names them, else by id.
fn objects_without_pixels(faults: &[DatasetFault], products: &Products) -> Vec<String> {
    let named = faults.iter().filter(|fault| fault.rule == rule::OBJECTS_HAVE_PIXELS);
    let named: Vec<String> = named.map(DatasetFault::to_string).collect();
    if !named.is_empty() {
        return named;
    }
    let masks = [VISIBLE_MASK, AMODAL_MASK].map(|key| products.optional(key).ok().flatten());
    let masks = || masks.iter().flatten();
    let ids: BTreeSet<InstanceId> = masks().flat_map(|masks| masks.iter().map(|(id, _)| id)).collect();
    let is_empty = |id: &InstanceId| masks().filter_map(|masks| masks.get(*id)).all(Mask::is_empty);
    ids.into_iter().filter(is_empty).map(|id| format!("instance {id} has no pixels")).collect()
}

/// The products that a writer gets for an image. A writer that reads the plane of ids, and not the masks behind it,
/// gets the boxes of the objects' pixels in that plane: where masks overlap, these are smaller.
fn lent(products: &Products, reads: &[String]) -> Result<Products> {
    let reads_it = |name: &str| reads.iter().any(|read| read == name);
    let is_painted = products.contains(VISIBLE_MASK.name()) && reads_it(VISIBLE_IDS.name());
    if !is_painted || reads_it(VISIBLE_MASK.name()) || !reads_it(VISIBLE_BOX.name()) {
        return Ok(products.only(reads));
    }
    let (masks, ids) = (products.get(VISIBLE_MASK)?, products.get(VISIBLE_IDS)?);
    // First and last column, first and last row.
    let mut edges: BTreeMap<InstanceId, [i32; 4]> = BTreeMap::new();
    for (y, row) in (0..).zip(ids.data().chunks(ids.width() as usize)) {
        for (x, id) in (0..).zip(row).filter(|(_, id)| **id != InstanceId::default()) {
            let [left, right, top, bottom] = edges.entry(*id).or_insert([x, x, y, y]);
            (*left, *right, *top, *bottom) = ((*left).min(x), (*right).max(x), (*top).min(y), (*bottom).max(y));
        }
    }
    let painted = |id: InstanceId| match edges.get(&id) {
        Some([left, right, top, bottom]) => {
            BBox { x: *left, y: *top, width: right - left + 1, height: bottom - top + 1 }
        }
        None => BBox::default(),
    };
    // A box that differs from the mask's box comes from the dataset, and stays unchanged.
    let of_mask = |id: InstanceId, own: &BBox| masks.get(id).is_some_and(|mask| mask.bbox() == *own);
    let boxes = products.get(VISIBLE_BOX)?.map(|id, own| if of_mask(id, own) { painted(id) } else { *own });
    let others: Vec<&str> = reads.iter().map(String::as_str).filter(|name| *name != VISIBLE_BOX.name()).collect();
    let mut lent = products.only(&others);
    lent.put(VISIBLE_BOX, boxes)?;
    Ok(lent)
}

impl Converted {
    /// The written scenes and images in words.
    pub fn text(&self) -> String {
        format!("{} of {} written", count(self.images, "image"), count(self.scenes, "scene"))
    }
}
