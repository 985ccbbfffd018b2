//! Statistics as text, JSON and CSV.

use super::distance::{DistributionDistance, distances};
use super::distribution::Distribution;
use super::image::ImageRow;
use super::quantity::Quantity;
use super::statistics::{AssetCount, DatasetStatistics};
use serde::Serialize;
use std::fmt::Write as _;
use syntable_runtime::run::progress::count;

/// A dataset with the name that the user gave.
#[derive(Debug, Clone, Serialize)]
pub struct Described {
    /// Its path.
    pub dataset: String,
    /// Format of the dataset.
    pub format: &'static str,
    /// The statistics.
    #[serde(flatten)]
    pub statistics: DatasetStatistics,
}

/// Distances of a dataset from the first one.
#[derive(Debug, Clone, Serialize)]
pub struct Apart {
    /// Path of the first dataset.
    pub from: String,
    /// Path of the other dataset.
    pub to: String,
    /// Distances of quantities that both datasets have.
    pub quantities: Vec<DistributionDistance>,
}

/// Distances of all datasets from the first one. Their histograms have the same bins.
pub fn apart(all: &[Described]) -> Vec<Apart> {
    let Some((first, others)) = all.split_first() else { return Vec::new() };
    let of = |other: &Described| Apart {
        from: first.dataset.clone(),
        to: other.dataset.clone(),
        quantities: distances(&first.statistics, &other.statistics),
    };
    others.iter().map(of).collect()
}

/// Number of most frequent and of least frequent assets to list.
const ASSETS: usize = 5;
/// Length of a bar for all values, in characters.
const BAR: f64 = 40.0;
/// Maximum number of listed groups of near-duplicates.
const GROUPS: usize = 5;

/// All statistics as a JSON object.
pub fn json(all: &[Described]) -> String {
    #[derive(Serialize)]
    struct StatisticsJson<'a> {
        datasets: &'a [Described],
        distances: Vec<Apart>,
    }
    let mut text =
        serde_json::to_string_pretty(&StatisticsJson { datasets: all, distances: apart(all) }).expect("plain data");
    text.push('\n');
    text
}

/// All statistics as tables.
pub fn text(all: &[Described]) -> String {
    let mut out = table_1(all);
    out += &quantities(all);
    Quantity::ALL.into_iter().for_each(|quantity| out += &histogram(all, quantity));
    out += &layers(all);
    for of in apart(all) {
        out += &distances_text(&of);
    }
    for it in all {
        out += &notes(it);
    }
    out
}

/// Aligns rows of cells in columns: the first column to the left, the others to the right.
fn columns(rows: &[Vec<String>]) -> String {
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..rows.iter().map(Vec::len).max().unwrap_or(0)).map(width).collect();
    let mut out = String::new();
    for row in rows {
        let cells = row.iter().zip(&widths).enumerate();
        let cells = cells.map(|(column, (cell, width))| match column {
            0 => format!("{cell:width$}"),
            _ => format!("{cell:>width$}"),
        });
        let _ = writeln!(out, "{}", cells.collect::<Vec<_>>().join("  ").trim_end());
    }
    out
}

fn known(value: Option<u64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| value.to_string())
}

fn percent(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{:.2}%", 100.0 * value))
}

/// A row of text cells.
fn cells<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.map(str::to_owned).to_vec()
}

fn table_1(all: &[Described]) -> String {
    let mut rows =
        vec![cells(["dataset", "#images", "#objects", "#scenes", "#VI", "#OI", "avg. OR", "mean OR", "of occluded"])];
    for it in all {
        let of = &it.statistics.totals;
        rows.push(vec![
            it.dataset.clone(),
            of.images.to_string(),
            known(of.objects),
            of.scenes.to_string(),
            known(of.visible_instances),
            known(of.occluded_instances),
            percent(of.average_occlusion_rate),
            percent(of.mean_occlusion_rate),
            percent(of.mean_occlusion_rate_of_occluded),
        ]);
    }
    columns(&rows) + TABLE_1_TERMS
}

/// The abbreviations of the paper's table.
const TABLE_1_TERMS: &str = "#VI visible instances, #OI occluded ones; avg. OR hidden share of all amodal pixels; mean OR mean \
                             occlusion rate of the instances, and of the occluded ones\n";

/// Number of decimals that distinguish the steps of a quantity, at most three.
fn decimals(quantity: Quantity) -> usize {
    match quantity.about().step {
        step if step >= 1.0 => 0,
        step if step >= 0.01 => 2,
        _ => 3,
    }
}

/// A quantity with its unit.
fn title(quantity: Quantity) -> String {
    let about = quantity.about();
    if about.unit.is_empty() { about.title.to_owned() } else { format!("{}, {}", about.title, about.unit) }
}

fn quantities(all: &[Described]) -> String {
    let several = all.len() > 1;
    let mut heading = cells(["quantity"]);
    if several {
        heading.push("dataset".to_owned());
    }
    heading.extend(cells(["N", "mean", "median", "least", "greatest"]));
    let mut rows = vec![heading];
    for quantity in Quantity::ALL {
        let mut first = title(quantity);
        for (it, of) in of_all(all, quantity) {
            let (decimals, mut row) = (decimals(quantity), vec![std::mem::take(&mut first)]);
            if several {
                row.push(it.dataset.clone());
            }
            let value = |value: Option<f64>, more: usize| {
                value.map_or_else(|| "-".to_owned(), |value| format!("{value:.*}", decimals + more))
            };
            let (low, high) = of.range().map(|[low, high]| (low, high)).unzip();
            let is_whole = usize::from(decimals == 0);
            row.extend([of.n().to_string(), value(of.mean(), 2 * is_whole), value(of.median(), 0)]);
            row.extend([value(low, 0), value(high, 0)]);
            rows.push(row);
        }
    }
    if rows.len() > 1 { format!("\n{}", columns(&rows)) } else { String::new() }
}

/// The datasets that have values of a quantity.
fn of_all(all: &[Described], quantity: Quantity) -> impl Iterator<Item = (&Described, &Distribution)> {
    all.iter().filter_map(move |it| Some((it, it.statistics.distribution(quantity)?)))
}

/// A histogram in percent with a column for each dataset; for a single dataset, with bars.
fn histogram(all: &[Described], quantity: Quantity) -> String {
    let of: Vec<(&Described, &Distribution)> = of_all(all, quantity).collect();
    let Some((_, first)) = of.first() else { return String::new() };
    let mut rows = vec![vec![format!("{}: %", title(quantity))]];
    rows[0].extend(of.iter().map(|(it, _)| if all.len() > 1 { it.dataset.clone() } else { String::new() }));
    let part = |count: u64, of: &Distribution| count as f64 / of.n().max(1) as f64;
    let counts: Vec<Vec<u64>> = of.iter().map(|(_, of)| of.histogram()).collect();
    let mut bars = vec![String::new()];
    for (bin, label) in labels(quantity, first.edges()).into_iter().enumerate() {
        let parts: Vec<f64> = of.iter().zip(&counts).map(|((_, of), counts)| part(counts[bin], of)).collect();
        bars.push("█".repeat(if all.len() > 1 { 0 } else { (BAR * parts[0]).round() as usize }));
        rows.push(std::iter::once(label).chain(parts.iter().map(|part| format!("{:.1}", 100.0 * part))).collect());
    }
    let lines = columns(&rows).lines().zip(bars).fold(String::new(), |mut out, (line, bar)| {
        let _ = writeln!(out, "{}", format!("{line}  {bar}").trim_end());
        out
    });
    format!("\n{lines}")
}

/// Names of bins: their values if these are integers, otherwise their edges.
fn labels(quantity: Quantity, edges: &[f64]) -> Vec<String> {
    let has_values = quantity.about().step >= 1.0 && edges.iter().all(|edge| edge.fract() == 0.0);
    let of = |ends: &[f64]| match (ends, has_values) {
        ([low, high], true) if high - low <= 1.0 => format!("{low}"),
        ([low, high], true) => format!("{low}–{}", high - 1.0),
        ([low, high], false) => format!("{}–{}", short(*low), short(*high)),
        _ => String::new(),
    };
    edges.windows(2).map(of).collect()
}

/// The edge of a bin with at most four decimals.
fn short(edge: f64) -> String {
    let text = format!("{edge:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn layers(all: &[Described]) -> String {
    let mut rows = vec![cells(["layers, %", "top", "intermediate", "bottom", "edges", "mutual pairs", "cyclic views"])];
    for it in all {
        let (Some(layers), of) = (it.statistics.layers, &it.statistics.totals) else { continue };
        let whole = layers.counts().iter().sum::<u64>().max(1) as f64;
        let mut row = vec![it.dataset.clone()];
        row.extend(layers.counts().map(|part| format!("{:.1}", 100.0 * part as f64 / whole)));
        row.extend([of.edges, of.mutual_pairs, of.cyclic_views].map(known));
        rows.push(row);
    }
    if rows.len() > 1 { format!("\n{}", columns(&rows)) } else { String::new() }
}

fn distances_text(of: &Apart) -> String {
    let mut rows = vec![cells(["quantity", "Wasserstein-1", "Jensen-Shannon, bits"])];
    for it in &of.quantities {
        let about = Quantity::ALL.into_iter().find(|quantity| quantity.about().name == it.name);
        let title = about.map_or_else(|| it.name.to_owned(), title);
        let moved = it.wasserstein_1.map_or_else(|| "-".to_owned(), |value| format!("{value:.4}"));
        rows.push(vec![title, moved, format!("{:.4}", it.jensen_shannon)]);
    }
    format!("\ndistance of {} from {}\n{}", of.to, of.from, columns(&rows))
}

/// Further facts on a dataset, and unknown numbers.
fn notes(it: &Described) -> String {
    let of = &it.statistics;
    let mut out = format!("\n{}, read as {}\n", it.dataset, it.format);
    let mut say = |line: String| {
        let _ = writeln!(out, "  {line}");
    };
    if let Some(empty) = of.totals.empty_images.filter(|count| *count > 0) {
        say(format!("{} no object", shows(empty)));
    }
    if of.totals.hidden_instances > 0 {
        let hidden = of.totals.hidden_instances;
        say(format!("annotated objects without a visible pixel, not counted elsewhere: {hidden}"));
    }
    if of.totals.scenes == of.totals.images && of.totals.images > 1 {
        say("each image is a separate scene: the dataset has one view per scene, or its format has no scenes"
            .to_owned());
    }
    if let Some(found) = &of.near_duplicates {
        say(format!(
            "near-duplicate views (no cell of 16 × 16 differs by more than {} of 255): {} in {}, {} within a scene",
            found.levels,
            found.views,
            count(found.groups.len() as u32, "group"),
            found.groups_in_scene,
        ));
        for group in found.groups.iter().take(GROUPS) {
            let more = if group.len() > 3 { format!(" and {} more", group.len() - 3) } else { String::new() };
            say(format!("  {}{more}", group.iter().take(3).cloned().collect::<Vec<_>>().join(", ")));
        }
        if found.groups.len() > GROUPS {
            say("  the JSON output lists the others".to_owned());
        }
    }
    if let Some(assets) = of.assets.as_ref().filter(|assets| !assets.is_empty()) {
        let seen = |assets: &[AssetCount]| {
            assets.iter().map(|it| format!("{} {}", it.name, it.instances)).collect::<Vec<_>>().join(", ")
        };
        if assets.len() > 2 * ASSETS {
            say(format!("seen most: {}", seen(&assets[..ASSETS])));
            say(format!("seen least: {}", seen(&assets[assets.len() - ASSETS..])));
        } else {
            say(format!("seen: {}", seen(assets)));
        }
    }
    if !of.classes.is_empty() {
        let classes: Vec<String> = of.classes.iter().map(|(name, count)| format!("{name} {count}")).collect();
        say(format!("classes: {}", classes.join(", ")));
    }
    of.unknown.iter().chain(&of.caveats).for_each(|line| say(line.clone()));
    out
}

fn shows(images: u64) -> String {
    if images == 1 { "1 image shows".to_owned() } else { format!("{images} images show") }
}

/// Columns of the CSV file after the dataset: name and value.
type CsvColumn = (&'static str, fn(&ImageRow) -> String);

fn cell<T: ToString>(value: Option<T>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

const COLUMNS: &[CsvColumn] = &[
    ("image", |it| quoted(&it.name)),
    ("id", |it| cell(it.id)),
    ("scene", |it| it.scene.to_string()),
    ("view", |it| it.view.to_string()),
    ("objects", |it| cell(it.objects)),
    ("hidden_objects", |it| it.hidden_objects.to_string()),
    ("occluded", |it| cell(it.occlusion.map(|of| of.occluded))),
    ("occluded_px", |it| cell(it.occlusion.map(|of| of.occluded_px))),
    ("amodal_px", |it| cell(it.occlusion.map(|of| of.amodal_px))),
    ("occlusion_rate", |it| cell(it.occlusion.and_then(|of| of.rate))),
    ("mean_occlusion_rate", |it| cell(it.occlusion.and_then(|of| of.mean_rate))),
    ("max_occlusion_rate", |it| cell(it.occlusion.and_then(|of| of.max_rate))),
    ("edges", |it| cell(it.occlusion.map(|of| of.edges))),
    ("mutual_pairs", |it| cell(it.occlusion.map(|of| of.mutual_pairs))),
    ("cycles", |it| cell(it.occlusion.map(|of| of.cycles))),
    ("components", |it| cell(it.occlusion.map(|of| of.components))),
    ("largest_component", |it| cell(it.occlusion.map(|of| of.largest_component))),
    ("depth_layers", |it| cell(it.occlusion.map(|of| of.depth_layers))),
    ("top", |it| cell(it.occlusion.map(|of| of.layers.top))),
    ("intermediate", |it| cell(it.occlusion.map(|of| of.layers.intermediate))),
    ("bottom", |it| cell(it.occlusion.map(|of| of.layers.bottom))),
    ("mean_depth_m", |it| cell(it.mean_depth_m)),
    ("mean_distance_m", |it| cell(it.mean_distance_m)),
    ("brightness", |it| cell(it.brightness)),
    ("duplicates", |it| cell(it.duplicates)),
];

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// A line per image. Unknown values are empty.
pub fn csv(all: &[Described]) -> String {
    let mut out = "dataset".to_owned();
    COLUMNS.iter().for_each(|(name, _)| out += &format!(",{name}"));
    out.push('\n');
    for it in all {
        for row in &it.statistics.images {
            out += &quoted(&it.dataset);
            COLUMNS.iter().for_each(|(_, value)| out += &format!(",{}", value(row)));
            out.push('\n');
        }
    }
    out
}
