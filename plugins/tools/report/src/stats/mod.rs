//! Statistics of datasets: Table 1 of the SynTable paper, distributions, near-duplicate views, and distances between
//! datasets.
//!
//! | module | holds |
//! | --- | --- |
//! | [`image`] | the numbers of an image |
//! | [`quantity`] | quantities with their units and bins |
//! | [`distribution`] | values of a quantity |
//! | [`duplicates`] | views that look almost the same |
//! | [`distance`] | distances between distributions |
//! | [`table`] | the statistics as text, JSON and CSV |
//!
//! A view counts the objects with a visible pixel. Annotated objects without one have a separate count, and no other
//! number includes them. All numbers follow from the dataset's masks, so a dataset has the same numbers in every format
//! that keeps masks.

mod appearance;
pub mod distance;
pub mod distribution;
pub mod duplicates;
pub mod image;
mod options;
pub mod quantity;
mod statistics;
pub mod table;

use distribution::{Binning, Distribution, bin};
use duplicates::{Duplicates, Thumbnail};
use image::{ImageInputs, ImageTally, tally};
pub use image::{ImageRow, LayerCounts, OcclusionRow};
pub use options::{Edges, StatisticsOptions};
use quantity::Quantity;
pub use statistics::{AssetCount, DatasetStatistics, Totals};
use std::collections::BTreeMap;
use syntable_model::context::Workers;
use syntable_model::error::{Error, Result};
use syntable_model::left_out::LeftOut;
use syntable_model::product::standard::{
    AMODAL_MASK, DEPTH, OBJECT_INFO, OBJECT_NAME, OCCLUSION_ORDER, RGB, VISIBLE_MASK,
};
use syntable_model::reader::{OpenDataset, Source};
use syntable_model::registry::Registry;
use syntable_model::stage::DatasetInfo;
use syntable_runtime::images::{ImageWork, each};
use syntable_runtime::left_out::LeftOutReport;
use syntable_runtime::run::progress::Event;
use table::Described;

/// Number of images from which comparing all pairs takes noticeable time.
const MANY_IMAGES: usize = 5000;

impl DatasetStatistics {
    /// The values of a quantity, if the dataset has any.
    pub fn distribution(&self, quantity: Quantity) -> Option<&Distribution> {
        self.distributions.iter().find(|it| it.quantity() == quantity)
    }
}

/// Rebins the histograms of several datasets to the same bins.
pub fn bin_alike(all: &mut [&mut DatasetStatistics], binning: Binning) {
    for quantity in Quantity::ALL {
        let of = all.iter_mut().flat_map(|it| &mut it.distributions).filter(|it| it.quantity() == quantity);
        bin(&mut of.collect::<Vec<_>>(), binning);
    }
}

/// Counts the content of a dataset. The numbers do not depend on threads. For each image, memory holds its [`ImageRow`]
/// and, unless images are omitted, 256 bytes for near-duplicates.
///
/// # Errors
/// If the dataset has no image, an image cannot be read, or the work was stopped.
pub fn of(dataset: &OpenDataset, options: &StatisticsOptions, work: &ImageWork) -> Result<DatasetStatistics> {
    if dataset.images.is_empty() {
        return Err(Error::new("the dataset has no image"));
    }
    let wanted = ImageInputs::of(dataset, options);
    if options.edges == Edges::Stored && !wanted.has(&OCCLUSION_ORDER.id()) {
        return Err(Error::new("the dataset has no `occlusion_order`")
            .help("set `options.edges` to another rule, which computes the order from masks"));
    }
    let has_names = wanted.has(&OBJECT_INFO.id()) || wanted.has(&OBJECT_NAME.id());
    let mut collected = RunningStatistics { has_names, ..RunningStatistics::default() };
    let image = |image: usize| tally(dataset, image, &wanted, options);
    each(work, "counted", dataset.images.len(), &image, &mut |_, it| collected.add(it))?;
    let duplicates = wanted.has(&RGB.id()).then(|| {
        if dataset.images.len() > MANY_IMAGES {
            work.reporter.event(&Event::Working { step: "comparing views with each other".to_owned() });
        }
        collected.near_duplicates(options.levels, work.workers)
    });
    let mut statistics = collected.finish(&dataset.info, duplicates);
    statistics.unknown = unknown(&statistics, dataset, &wanted, options);
    statistics.caveats = dataset.caveats(&wanted.keys);
    let not_objects = dataset.not_objects(&wanted.keys);
    statistics.left_out = LeftOut::sum(not_objects.into_iter().chain(statistics.left_out));
    bin_alike(&mut [&mut statistics], options.binning);
    Ok(statistics)
}

/// Statistics of datasets, side by side.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// The datasets, in the order in which they were named. Their histograms have the same bins.
    pub datasets: Vec<Described>,
    /// Unreadable and omitted data.
    pub left_out: LeftOutReport,
}

/// Opens datasets and counts their content. [`table`] shows the numbers as text, JSON and CSV.
///
/// # Errors
/// If a dataset cannot be opened, has no image or an unreadable one, or the work was stopped.
pub fn compare(
    registry: &Registry,
    sources: &[Source],
    format: Option<&str>,
    options: &StatisticsOptions,
    work: &ImageWork,
) -> Result<Comparison> {
    let mut compared = Comparison { datasets: Vec::new(), left_out: LeftOutReport::default() };
    for source in sources {
        let (format, dataset) = registry.open_dataset(source, format)?;
        compared.left_out.unlisted(&dataset);
        let statistics = of(&dataset, options, work).map_err(|error| error.in_file(&source.path))?;
        compared.left_out.annotations(&statistics.left_out);
        let path = source.name().display().to_string();
        compared.datasets.push(Described { dataset: path, format: format.name(), statistics });
    }
    bin_alike(&mut compared.datasets.iter_mut().map(|it| &mut it.statistics).collect::<Vec<_>>(), options.binning);
    Ok(compared)
}

/// Unknown numbers of a dataset, with reasons.
fn unknown(
    of: &DatasetStatistics,
    dataset: &OpenDataset,
    wanted: &ImageInputs,
    options: &StatisticsOptions,
) -> Vec<String> {
    let offers = &dataset.offers;
    let says = |quantity| of.distribution(quantity).is_some();
    let is_empty = of.totals.visible_instances.is_none_or(|count| count == 0);
    let lacks = [
        (!wanted.has(&VISIBLE_MASK.id()), "objects have no masks: areas, occlusion and its order are unknown"),
        (
            wanted.has(&VISIBLE_MASK.id()) && !wanted.has(&AMODAL_MASK.id()),
            "objects have no amodal masks: occlusion and its order are unknown, areas are areas of visible masks",
        ),
        (of.assets.is_none(), "objects have no names: their number and their frequencies are unknown"),
        (!is_empty && !says(Quantity::ObjectSize), "objects have no boxes in space: sizes in meters are unknown"),
        (!is_empty && !says(Quantity::ObjectDistance), "objects have no poses: distances from the camera are unknown"),
        (!options.labels_only && !offers.contains(&DEPTH.id()), "the dataset has no depth images"),
        (
            !options.labels_only && !offers.contains(&RGB.id()),
            "the dataset has no color images: brightness and look are unknown",
        ),
        (options.labels_only, "images were not read: brightness, look, depth and near-duplicate views are unknown"),
    ];
    lacks.into_iter().filter(|it| it.0).map(|it| it.1.to_owned()).collect()
}

/// Statistics accumulated so far.
#[derive(Default)]
struct RunningStatistics {
    images: Vec<ImageRow>,
    thumbnails: Vec<Thumbnail>,
    distributions: BTreeMap<Quantity, Distribution>,
    assets: BTreeMap<String, (AssetCount, u32)>,
    categories: BTreeMap<u32, u64>,
    rates: f64,
    has_names: bool,
    left_out: Vec<LeftOut>,
}

impl RunningStatistics {
    /// Adds the next image.
    fn add(&mut self, tally: ImageTally) {
        let scene = tally.row.scene;
        self.left_out.extend(tally.left_out.into_iter().filter(|it| it.of > 0));
        tally.values.into_iter().for_each(|(quantity, value)| self.of(quantity).add(value));
        if let Some(depths) = tally.depths {
            let counts = depths.near.into_iter().enumerate().filter(|it| it.1 > 0).chain(depths.far);
            let counts = counts.map(|(steps, count)| (steps as u64, count));
            self.of(Quantity::Depth).add_counts(counts, depths.sum, depths.range);
        }
        let mut names: BTreeMap<String, u64> = BTreeMap::new();
        tally.assets.into_iter().for_each(|name| *names.entry(name).or_default() += 1);
        for (name, instances) in names {
            let (count, last) = self
                .assets
                .entry(name.clone())
                .or_insert_with(|| (AssetCount { name, instances: 0, views: 0, scenes: 0 }, scene));
            // Images are ordered by scene.
            count.scenes += u64::from(count.views == 0 || *last != scene);
            (count.instances, count.views, *last) = (count.instances + instances, count.views + 1, scene);
        }
        tally.categories.into_iter().for_each(|category| *self.categories.entry(category).or_default() += 1);
        self.rates += tally.rates;
        self.thumbnails.extend(tally.thumbnail);
        self.images.push(tally.row);
    }

    fn of(&mut self, quantity: Quantity) -> &mut Distribution {
        self.distributions.entry(quantity).or_insert_with(|| Distribution::new(quantity))
    }

    /// Finds near-duplicate views, and marks them.
    fn near_duplicates(&mut self, levels: u8, workers: &dyn Workers) -> Duplicates {
        let groups = duplicates::groups(&self.thumbnails, levels, workers);
        let views: usize = groups.iter().map(Vec::len).sum();
        let is_in_scene =
            |group: &&Vec<usize>| group.iter().all(|image| self.images[*image].scene == self.images[group[0]].scene);
        let found = Duplicates {
            levels,
            views: views as u64,
            redundant: (views - groups.len()) as u64,
            groups_in_scene: groups.iter().filter(is_in_scene).count() as u64,
            groups: groups
                .iter()
                .map(|group| group.iter().map(|image| self.images[*image].name.clone()).collect())
                .collect(),
        };
        for (number, group) in (0..).zip(groups) {
            group.into_iter().for_each(|image| self.images[image].duplicates = Some(number));
        }
        found
    }

    fn finish(self, info: &DatasetInfo, near_duplicates: Option<Duplicates>) -> DatasetStatistics {
        let sum = |of: fn(&ImageRow) -> u64| self.images.iter().map(of).sum::<u64>();
        let occlusion = |of: fn(&OcclusionRow) -> u64| {
            // Either all images have the value or none.
            self.images.iter().map(|it| it.occlusion.as_ref().map(of)).sum::<Option<u64>>()
        };
        let ratio = |part: Option<f64>, whole: Option<u64>| {
            part.zip(whole.filter(|whole| *whole > 0)).map(|(part, whole)| part / whole as f64)
        };
        let (occluded, amodal_px) = (occlusion(|it| it.occluded.into()), occlusion(|it| it.amodal_px));
        let occluded_px = occlusion(|it| it.occluded_px);
        let objects = |of: fn(u32) -> u64| self.images.iter().map(|it| it.objects.map(of)).sum::<Option<u64>>();
        let visible_instances = objects(u64::from);
        let rates = occluded.map(|_| self.rates);
        let mut scenes: Vec<u32> = self.images.iter().map(|it| it.scene).collect();
        scenes.dedup();
        let layers = self.images.iter().map(|it| Some(it.occlusion?.layers)).reduce(|sum, of| {
            let mut sum = sum?;
            sum.add(of?);
            Some(sum)
        });
        let totals = Totals {
            images: self.images.len() as u64,
            empty_images: objects(|count| u64::from(count == 0)),
            objects: self.has_names.then_some(self.assets.len() as u64),
            scenes: scenes.len() as u64,
            visible_instances,
            occluded_instances: occluded,
            hidden_instances: sum(|it| it.hidden_objects.into()),
            amodal_px,
            occluded_px,
            average_occlusion_rate: ratio(occluded_px.map(|px| px as f64), amodal_px),
            mean_occlusion_rate: ratio(rates, visible_instances),
            mean_occlusion_rate_of_occluded: ratio(rates, occluded),
            edges: occlusion(|it| it.edges.into()),
            mutual_pairs: occlusion(|it| it.mutual_pairs.into()),
            cyclic_views: occlusion(|it| u64::from(it.cycles > 0)),
        };
        let mut assets: Vec<AssetCount> = self.assets.into_values().map(|it| it.0).collect();
        assets.sort_by(|a, b| b.instances.cmp(&a.instances).then_with(|| a.name.cmp(&b.name)));
        let class = |id: u32| Some(info.categories().find(|(other, _)| *other == id)?.1.to_owned());
        let classes = self.categories.into_iter().filter(|_| !info.classes.is_empty());
        DatasetStatistics {
            name: info.name.clone(),
            totals,
            layers: layers.flatten(),
            distributions: self.distributions.into_values().collect(),
            assets: self.has_names.then_some(assets),
            classes: classes.filter_map(|(id, count)| Some((class(id)?, count))).collect(),
            near_duplicates,
            unknown: Vec::new(),
            caveats: Vec::new(),
            left_out: self.left_out,
            images: self.images,
        }
    }
}
