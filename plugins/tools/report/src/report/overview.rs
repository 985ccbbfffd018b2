//! Content of the overview: the dataset's card, its statistics, selected views, failed scenes, times.

use super::plot::{grouped, histogram};
use super::record::{DatasetRecord, PoolView};
use super::scored::{ReportScores, TableView};
use super::{DatasetReport, StatisticsProgress, image_path};
use crate::stats::{DatasetStatistics, ImageRow};
use serde::Serialize;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::error::Result;
use syntable_model::product::standard::{AMODAL_MASK, DEPTH, OCCLUSION_ORDER, RGB, VISIBLE_MASK};
use syntable_runtime::run::making::times::Worked;
use syntable_runtime::run::progress::count;

/// Number of views in a row of images.
pub const MOST_OCCLUDED: usize = 12;
/// Maximum number of images with the worst scores.
pub const MOST_WORST: usize = 24;
/// Maximum number of listed faults.
const FAULTS: usize = 24;

/// Data of the template `index.html`.
#[derive(Serialize)]
pub struct Overview {
    facts: Vec<Fact>,
    cells: Vec<Fact>,
    plots: Vec<String>,
    /// Progress of the statistics as a sentence, or the reason why they are missing.
    counting: Option<String>,
    is_counting: bool,
    unknown: Vec<String>,
    pools: Vec<PoolView>,
    recipe: String,
    sample: Vec<ImageCard>,
    occluded: Vec<ImageCard>,
    /// Images with unreadable parts.
    unread: Vec<Unread>,
    faults: Vec<FaultRow>,
    more_faults: usize,
    checked: usize,
    failed: Vec<SceneRow>,
    /// Other unreadable data.
    damaged: Vec<String>,
    scores: Option<ScoresView>,
    has_journal: bool,
    stages: Vec<StageRow>,
    devices: Vec<String>,
    made_in: String,
    left_out: Option<String>,
}

/// A name and its value.
#[derive(Serialize)]
struct Fact {
    name: String,
    value: String,
}

/// Scores of predictions, and the worst images.
#[derive(Serialize)]
struct ScoresView {
    says: String,
    tables: Vec<TableView>,
    ranked_by: String,
    worst: Vec<ImageCard>,
    /// Number of worst images in the file.
    all_worst: usize,
}

/// An image that links to its page.
#[derive(Serialize)]
struct ImageCard {
    place: usize,
    /// Labels that are switched on on that page.
    on: &'static str,
    image: Option<String>,
    name: String,
    says: String,
}

#[derive(Serialize)]
struct FaultRow {
    place: Option<usize>,
    name: String,
    check: String,
    message: String,
}

/// An image with unreadable parts.
#[derive(Serialize)]
struct Unread {
    place: usize,
    name: String,
    reasons: String,
}

/// A scene that failed, or that needed more than one attempt.
#[derive(Serialize)]
struct SceneRow {
    scene: u32,
    attempts: u32,
    outcome: &'static str,
    errors: Vec<String>,
}

#[derive(Serialize)]
struct StageRow {
    name: String,
    calls: String,
    seconds: String,
    mean_ms: String,
    percent: f64,
}

/// Collects the content of the overview.
pub fn of(report: &DatasetReport) -> Result<Overview> {
    let record = &report.record;
    let counted = report.statistics.lock();
    let (statistics, counting, is_counting) = match &*counted {
        StatisticsProgress::Done(statistics) => (Some(&**statistics), None, false),
        StatisticsProgress::Working(text) => (None, Some(text.clone()), true),
        StatisticsProgress::Failed(text) => (None, Some(text.clone()), false),
    };
    let faults = faults(report);
    let failed = record.journal.iter().filter(|line| line.failed() || line.attempt() > 0).map(|line| SceneRow {
        scene: line.scene,
        attempts: line.attempt() + 1,
        outcome: if line.failed() { "failed" } else { "made" },
        errors: line.entry().errors,
    });
    let devices: BTreeSet<String> = record.times.iter().flat_map(|run| run.devices.clone()).collect();
    let (shown, all) = (report.shown.len(), report.dataset.images.len());
    let left_out = (shown < all).then(|| {
        format!(
            "Images and labels of {} of {} views are in this report: the most occluded ones, and others at even intervals. The numbers cover all views.",
            grouped(&shown.to_string()),
            grouped(&all.to_string())
        )
    });
    Ok(Overview {
        facts: facts(report, &devices),
        cells: statistics.map(cells).unwrap_or_default(),
        plots: statistics.map(plots).unwrap_or_default(),
        counting,
        is_counting,
        unknown: statistics.map(|it| it.unknown.iter().chain(&it.caveats).cloned().collect()).unwrap_or_default(),
        pools: report.licenses.get().map(|(licenses, _)| record.pools(licenses)).unwrap_or_default(),
        damaged: report.lost(),
        unread: unread(report),
        scores: report.scored.as_ref().map(|scored| scores(report, scored)),
        recipe: record.recipe.clone(),
        sample: sample(report),
        occluded: statistics.map(|statistics| occluded(report, statistics)).unwrap_or_default(),
        more_faults: faults.len().saturating_sub(FAULTS),
        faults: faults.into_iter().take(FAULTS).collect(),
        checked: report.faults.lock().len(),
        failed: failed.collect(),
        has_journal: !record.journal.is_empty(),
        stages: stages(report),
        devices: devices.into_iter().collect(),
        made_in: {
            let seconds: f64 = record.times.iter().map(|run| run.seconds).sum();
            format!("{} in {}", count(record.times.iter().map(|run| run.scenes).sum(), "scene"), span(seconds))
        },
        left_out,
    })
}

fn facts(report: &DatasetReport, devices: &BTreeSet<String>) -> Vec<Fact> {
    let (record, info) = (&report.record, &report.dataset.info);
    let images = &report.dataset.images;
    let scenes: BTreeSet<u32> = images.iter().map(|image| image.scene.0).collect();
    let offers = &report.dataset.offers;
    let has = [
        (RGB.id(), "color"),
        (VISIBLE_MASK.id(), "visible masks"),
        (AMODAL_MASK.id(), "amodal masks"),
        (OCCLUSION_ORDER.id(), "occlusion order"),
        (DEPTH.id(), "depth"),
    ];
    let has: Vec<&str> = has.into_iter().filter(|(key, _)| offers.contains(key)).map(|(_, name)| name).collect();
    let not_known = || "not recorded".to_owned();
    let mut facts = vec![
        ("Images", grouped(&images.len().to_string())),
        ("Scenes", grouped(&scenes.len().to_string())),
        ("Labels", has.join(", ")),
        ("Format", report.format.to_owned()),
        ("Seed", record.value(&["dataset", "seed"]).unwrap_or_else(not_known)),
        ("Made by", Some(info.program.clone()).filter(|it| !it.is_empty()).unwrap_or_else(not_known)),
    ];
    if !record.recipe.is_empty() {
        let all = |keys: &[&str]| Some(record.values(keys).join("; ")).filter(|values| !values.is_empty());
        if let Some(components) = components(record) {
            facts.push(("Components", components));
        }
        let samples = all(&["render", "samples_per_pixel"]).map(|it| format!(", {it} samples per pixel"));
        let renderer = all(&["render", "kind"]).unwrap_or_else(not_known);
        facts.push(("Renderer", format!("{renderer}{}", samples.unwrap_or_default())));
        facts.push(("Denoiser", all(&["denoise", "kind"]).unwrap_or_else(not_known)));
        let devices: Vec<&str> = devices.iter().map(String::as_str).collect();
        facts.push(("Devices", if devices.is_empty() { not_known() } else { devices.join("; ") }));
        let sizes: Vec<String> = record
            .values(&["camera", "resolution"])
            .iter()
            .map(|size| format!("{} px", size.trim_matches(['[', ']']).replace(", ", " × ")))
            .collect();
        if !sizes.is_empty() {
            facts.push(("Resolution", sizes.join("; ")));
        }
    }
    facts.into_iter().map(|(name, value)| Fact { name: name.to_owned(), value }).collect()
}

/// The components of a mixture with their numbers of scenes; none if the recipe is no mixture.
fn components(record: &DatasetRecord) -> Option<String> {
    let mut scenes: BTreeMap<&str, u32> = BTreeMap::new();
    for line in record.journal.made().filter(|line| !line.component().is_empty()) {
        *scenes.entry(line.component()).or_default() += 1;
    }
    let words = scenes.iter().map(|(component, scenes)| format!("{component}: {}", count(*scenes, "scene")));
    Some(words.collect::<Vec<_>>().join("; ")).filter(|words| !words.is_empty())
}

/// The row of Table 1, and related numbers.
fn cells(of: &DatasetStatistics) -> Vec<Fact> {
    let whole = |number: u64| grouped(&number.to_string());
    let maybe = |number: Option<u64>| number.map_or_else(|| "–".to_owned(), whole);
    let percent = |rate: Option<f64>| rate.map_or_else(|| "–".to_owned(), |rate| format!("{:.1} %", 100.0 * rate));
    let totals = &of.totals;
    [
        ("Images", whole(totals.images)),
        ("Objects", maybe(totals.objects)),
        ("Scenes", whole(totals.scenes)),
        ("Visible instances", maybe(totals.visible_instances)),
        ("Occluded instances", maybe(totals.occluded_instances)),
        ("Average occlusion rate", percent(totals.average_occlusion_rate)),
        ("Views with cycles", maybe(totals.cyclic_views)),
    ]
    .into_iter()
    .map(|(name, value)| Fact { name: name.to_owned(), value })
    .collect()
}

fn plots(of: &DatasetStatistics) -> Vec<String> {
    of.distributions.iter().enumerate().map(|(number, it)| histogram(it, number)).filter(|it| !it.is_empty()).collect()
}

/// Images by the pixel-weighted occlusion rate, most occluded first, by their index in the dataset.
pub fn by_occlusion(statistics: &DatasetStatistics) -> Vec<(usize, f64)> {
    let rate = |(index, row): (usize, &ImageRow)| Some((index, row.occlusion.as_ref()?.rate?));
    let mut rates: Vec<(usize, f64)> = statistics.images.iter().enumerate().filter_map(rate).collect();
    rates.sort_by(|a, b| b.1.partial_cmp(&a.1).unwrap_or(Ordering::Equal).then(a.0.cmp(&b.0)));
    rates
}

fn occluded(report: &DatasetReport, statistics: &DatasetStatistics) -> Vec<ImageCard> {
    let shown = by_occlusion(statistics).into_iter().filter(|(_, rate)| *rate > 0.0);
    let place = |(image, rate): (usize, f64)| {
        let place = report.shown.binary_search(&image).ok()?;
        Some(card(report, place, format!("{:.0} % hidden", 100.0 * rate)))
    };
    shown.filter_map(place).take(MOST_OCCLUDED).collect()
}

fn card(report: &DatasetReport, place: usize, says: String) -> ImageCard {
    let image = &report.dataset.images[report.shown[place]];
    let row = report.rows[place].lock();
    let has_image = row.as_ref().map_or_else(|| report.dataset.offers.contains(&RGB.id()), |row| row.has_image);
    let base = image.name.rsplit('/').next().unwrap_or_default();
    let image = has_image.then(|| report.addressed(image_path("image", place)));
    ImageCard { place, on: "", image, name: base.to_owned(), says }
}

/// The scores, and the worst images among the shown ones.
fn scores(report: &DatasetReport, scored: &ReportScores) -> ScoresView {
    let worst = scored.images().iter().filter_map(|image| {
        let place = report.shown.binary_search(image).ok()?;
        let says = scored.rank(*image).map_or_else(String::new, |score| format!("{score:.1}"));
        Some(ImageCard { on: "predicted", ..card(report, place, says) })
    });
    ScoresView {
        says: scored.says(),
        tables: scored.tables(),
        ranked_by: scored.ranked_by().to_owned(),
        worst: worst.take(MOST_WORST).collect(),
        all_worst: scored.images().len(),
    }
}

/// A sample of images at even intervals.
fn sample(report: &DatasetReport) -> Vec<ImageCard> {
    let count = report.shown.len().min(6);
    (0..count)
        .map(|number| {
            let place = number * report.shown.len() / count;
            let image = &report.dataset.images[report.shown[place]];
            card(report, place, format!("scene {}, view {}", image.scene.0, image.view.0))
        })
        .collect()
}

fn unread(report: &DatasetReport) -> Vec<Unread> {
    let unread = report.unread_by_place().into_iter();
    let name = |place: usize| report.dataset.images[report.shown[place]].name.clone();
    unread.map(|(place, reasons)| Unread { place, name: name(place), reasons: reasons.join("; ") }).collect()
}

/// Faults of the shown images that were checked, and of the dataset.
fn faults(report: &DatasetReport) -> Vec<FaultRow> {
    let of_dataset = report.dataset.all_faults().iter().map(|fault| {
        let [name, message] = fault.place_and_text(&report.dataset.images);
        FaultRow { place: None, name, check: fault.rule.to_owned(), message }
    });
    let of_images = report.faults.lock();
    let of_images = of_images.iter().flat_map(|(place, faults)| {
        let name = &report.dataset.images[report.shown[*place]].name;
        faults.iter().map(move |[check, message]| FaultRow {
            place: Some(*place),
            name: name.clone(),
            check: check.clone(),
            message: message.clone(),
        })
    });
    of_dataset.chain(of_images).collect()
}

/// The work of stages in all runs of the dataset, longest first.
fn stages(report: &DatasetReport) -> Vec<StageRow> {
    let mut sums: BTreeMap<&str, Worked> = BTreeMap::new();
    for (stage, worked) in report.record.times.iter().flat_map(|run| &run.stages) {
        let sum = sums.entry(stage).or_default();
        (sum.calls, sum.seconds) = (sum.calls + worked.calls, sum.seconds + worked.seconds);
    }
    let all: f64 = sums.values().map(|it| it.seconds).sum();
    let mut stages: Vec<(&str, Worked)> = sums.into_iter().collect();
    stages.sort_by(|a, b| b.1.seconds.partial_cmp(&a.1.seconds).unwrap_or(Ordering::Equal).then(a.0.cmp(b.0)));
    let row = |(name, it): (&str, Worked)| StageRow {
        name: name.to_owned(),
        calls: grouped(&it.calls.to_string()),
        seconds: format!("{:.1}", it.seconds),
        mean_ms: format!("{:.1}", 1000.0 * it.seconds / it.calls.max(1) as f64),
        percent: (1000.0 * it.seconds / all.max(1e-12)).round() / 10.0,
    };
    stages.into_iter().map(row).collect()
}

/// A duration as text for users.
fn span(seconds: f64) -> String {
    match seconds {
        it if it < 60.0 => format!("{it:.1} s"),
        it if it < 3600.0 => format!("{:.0} min {:02.0} s", (it / 60.0).floor(), it % 60.0),
        it => format!("{:.0} h {:02.0} min", (it / 3600.0).floor(), (it % 3600.0 / 60.0).floor()),
    }
}
