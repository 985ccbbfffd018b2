//! Scores as text, JSON and CSV, in percent.

use crate::measure::{Measures, Tally};
use crate::{Convention, categories, coco, strata};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;
use syntable_formats::scores::{MetricScores, ScoreTable};

/// An image that was scored.
pub struct EvaluatedImage {
    /// Number of labeled objects.
    pub objects: usize,
    /// Number of predictions with sufficient scores.
    pub predictions: usize,
    /// Tallies of the metrics.
    pub tally: Tally,
}

/// A score of the dataset.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// Its name, in snake case.
    pub name: String,
    /// Value as a fraction; `None` if it is undefined.
    pub value: Option<f64>,
    /// Confidence interval, if requested.
    pub interval: Option<[f64; 2]>,
}

/// A dataset that was scored.
pub struct EvaluationTable<'a> {
    /// Its images, in order.
    pub images: &'a [EvaluatedImage],
    /// How images were combined.
    pub convention: Convention,
    /// The metrics.
    pub measures: &'a Measures,
    /// Their scores.
    pub scores: Vec<Score>,
    /// Whether intervals were requested.
    pub has_intervals: bool,
    /// Suffixes for categories in names of scores, if scores by category were requested.
    pub categories: Vec<String>,
}

/// Scores side by side.
struct ScoreBlock {
    /// Headings above the column headings, with the number of columns that each spans.
    above: Vec<(&'static str, usize)>,
    /// Heading of the labels of rows.
    what: &'static str,
    headings: Vec<String>,
    /// Label of each row, and names of its scores.
    rows: Vec<(String, Vec<String>)>,
    /// Whether rows without a score are left out.
    is_sparse: bool,
}

/// Scores of occlusion: name and heading.
const OCCLUSION: [(&str, &str); 7] = [
    ("acc_o", "ACC_O"),
    ("f_o", "F_O"),
    ("acc_oo", "ACC_OO"),
    ("acc_oo_release", "ACC_OO (release)"),
    ("edge_p", "edge P"),
    ("edge_r", "edge R"),
    ("edge_f1", "edge F1"),
];

/// Minimum width of a column.
const COLUMN: usize = 6;

/// The scores with a fixed place in tables; other scores follow in a list.
fn blocks(words: &[String]) -> Vec<ScoreBlock> {
    let columns = ["overlap_p", "overlap_r", "overlap_f", "boundary_p", "boundary_r", "boundary_f", "f75"];
    let row = |kind: &str, columns: &[&str]| {
        let rate = kind.strip_prefix("occluded_").map(|rate| rate.replace('_', "–"));
        let label = rate.unwrap_or_else(|| kind.replace('_', " "));
        (label, columns.iter().map(|column| format!("{kind}_{column}")).collect())
    };
    let owned = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect::<Vec<String>>();
    let (kinds, scores) = coco::names();
    let heading = |score: &str| format!("{}{}", score[..2].to_uppercase(), &score[2..]);
    let of_categories = |kind: &str| scores.map(|score| format!("{}_{kind}_{score}", categories::MEAN)).to_vec();
    vec![
        ScoreBlock {
            above: vec![("overlap", 3), ("boundary", 3)],
            what: "masks",
            headings: owned(&["P", "R", "F", "P", "R", "F", "F@.75"]),
            rows: ["amodal", "visible", "invisible"].map(|kind| row(kind, &columns)).to_vec(),
            is_sparse: false,
        },
        ScoreBlock {
            above: Vec::new(),
            is_sparse: false,
            what: "",
            headings: OCCLUSION.iter().map(|it| it.1.to_owned()).collect(),
            rows: vec![(String::new(), OCCLUSION.iter().map(|it| it.0.to_owned()).collect())],
        },
        ScoreBlock {
            above: Vec::new(),
            is_sparse: false,
            what: "shapes",
            headings: scores.map(heading).to_vec(),
            rows: kinds.iter().map(|kind| row(kind, &scores)).collect(),
        },
        ScoreBlock {
            above: Vec::new(),
            is_sparse: false,
            what: "by category",
            headings: scores.map(heading).to_vec(),
            rows: kinds.iter().map(|kind| (row(kind, &scores).0, of_categories(kind))).collect(),
        },
        ScoreBlock {
            above: vec![("AP", kinds.len())],
            is_sparse: true,
            what: "category",
            headings: kinds.map(|kind| kind.replace('_', " ")).to_vec(),
            rows: words
                .iter()
                .map(|word| (word.clone(), kinds.map(|kind| format!("{word}_{kind}_ap")).to_vec()))
                .collect(),
        },
        ScoreBlock {
            above: Vec::new(),
            is_sparse: false,
            what: "occluded, %",
            headings: owned(&["share", "amodal F", "visible F", "F@.75"]),
            rows: strata::bins().iter().map(|bin| row(bin, &strata::SCORES)).collect(),
        },
    ]
}

impl EvaluationTable<'_> {
    fn sum(&self, of: fn(&EvaluatedImage) -> usize) -> usize {
        self.images.iter().map(of).sum()
    }

    fn score(&self, name: &str) -> Option<&Score> {
        self.scores.iter().find(|it| it.name == name)
    }

    /// A score in percent with one decimal, or a dash.
    fn cell(&self, name: &str) -> String {
        let value = self.score(name).and_then(|it| it.value);
        value.map_or_else(|| "-".to_owned(), |value| format!("{:.1}", 100.0 * value))
    }

    /// The scores as text, laid out as in the paper. With intervals, a list of all scores.
    pub fn text(&self) -> String {
        let mut out = String::new();
        let blocks = blocks(&self.categories);
        let is_placed = |name: &String| blocks.iter().flat_map(|it| &it.rows).any(|row| row.1.contains(name));
        let mut listed: Vec<&Score> = self.scores.iter().collect();
        if !self.has_intervals {
            blocks.iter().for_each(|block| out += &self.block(block));
            listed.retain(|score| !is_placed(&score.name));
        }
        let width = listed.iter().map(|score| score.name.len()).max().unwrap_or(0);
        for score in &listed {
            let _ = write!(out, "{:width$}  {:>COLUMN$}", score.name, self.cell(&score.name));
            if let Some([low, high]) = score.interval {
                let _ = write!(out, "  [{:.1}, {:.1}]", 100.0 * low, 100.0 * high);
            }
            out.push('\n');
        }
        let (objects, predictions) = (self.sum(|it| it.objects), self.sum(|it| it.predictions));
        let _ = writeln!(
            out,
            "{}percent; images: {}, objects: {objects}, predictions: {predictions}, convention: {}",
            if listed.is_empty() { "" } else { "\n" },
            self.images.len(),
            self.convention.name()
        );
        out
    }

    /// The rows of a block that have scores.
    fn rows<'b>(&self, block: &'b ScoreBlock) -> Vec<&'b (String, Vec<String>)> {
        let has = |name: &String| self.score(name).is_some_and(|it| !block.is_sparse || it.value.is_some());
        block.rows.iter().filter(|(_, names)| names.iter().any(has)).collect()
    }

    /// All tables, in percent.
    pub fn tables(&self) -> Vec<ScoreTable> {
        let percent = |name: &String| Some(100.0 * self.score(name)?.value?);
        let table = |block: &ScoreBlock| {
            let above = block.above.iter().flat_map(|&(above, count)| std::iter::repeat_n(above, count));
            let headings = block.headings.iter().zip(above.map(Some).chain(std::iter::repeat(None)));
            let headings =
                headings.map(|(it, above)| above.map_or_else(|| it.clone(), |above| format!("{above} {it}")));
            let rows = self.rows(block).into_iter();
            ScoreTable {
                headings: std::iter::once(block.what.to_owned()).chain(headings).collect(),
                rows: rows.map(|(label, names)| (label.clone(), names.iter().map(percent).collect())).collect(),
            }
        };
        blocks(&self.categories).iter().map(table).filter(|table| !table.rows.is_empty()).collect()
    }

    /// A table of the defined scores of a block.
    fn block(&self, block: &ScoreBlock) -> String {
        let rows = self.rows(block);
        if rows.is_empty() {
            return String::new();
        }
        let labels = rows.iter().map(|row| row.0.as_str()).chain([block.what]);
        let label = labels.map(|text| text.chars().count()).max().unwrap_or(0);
        let gap = if label == 0 { "" } else { "  " };
        let mut out = String::new();
        if !block.above.is_empty() {
            let mut headings = block.headings.iter();
            let cells = block.above.iter().map(|&(above, count)| {
                let widths = headings.by_ref().take(count).map(|it| it.chars().count().max(COLUMN));
                format!("{above:^0$}", widths.sum::<usize>() + 2 * (count - 1))
            });
            out += format!("{:label$}{gap}{}", "", cells.collect::<Vec<_>>().join("  ")).trim_end();
            out.push('\n');
        }
        let mut line = |first: &str, cells: Vec<String>| {
            let cells = cells.iter().zip(&block.headings).map(|(cell, heading)| {
                let width = heading.chars().count().max(COLUMN);
                format!("{cell:>width$}")
            });
            let _ = writeln!(out, "{first:label$}{gap}{}", cells.collect::<Vec<_>>().join("  "));
        };
        line(block.what, block.headings.clone());
        rows.iter().for_each(|(first, names)| line(first, names.iter().map(|name| self.cell(name)).collect()));
        out.push('\n');
        out
    }

    /// All scores in the form of a saved file, without images.
    pub fn saved(&self) -> MetricScores {
        MetricScores {
            images: self.images.len(),
            objects: self.sum(|it| it.objects),
            predictions: self.sum(|it| it.predictions),
            convention: self.convention.name().to_owned(),
            scores: self.scores.iter().map(|it| (it.name.clone(), it.value.map(|value| 100.0 * value))).collect(),
            tables: self.tables(),
            ..MetricScores::default()
        }
    }

    /// All scores as a JSON object.
    pub fn json(&self) -> Value {
        let scores =
            self.scores.iter().map(|it| (it.name.clone(), it.value.map_or(Value::Null, |value| json!(100.0 * value))));
        let mut out = json!({
            "images": self.images.len(),
            "objects": self.sum(|it| it.objects),
            "predictions": self.sum(|it| it.predictions),
            "convention": self.convention.name(),
            "scores": scores.collect::<Map<String, Value>>(),
        });
        if self.has_intervals {
            let intervals = self.scores.iter().map(|it| {
                (it.name.clone(), it.interval.map_or(Value::Null, |ends| json!(ends.map(|end| 100.0 * end))))
            });
            out["intervals"] = Value::Object(intervals.collect());
        }
        out
    }

    /// A line per image, with its name from `name`. An undefined score is empty.
    pub fn csv<'n>(&self, name: impl Fn(usize) -> &'n str) -> String {
        let mut out = "image,objects,predictions".to_owned();
        self.scores.iter().for_each(|score| out += &format!(",{}", score.name));
        for (index, image) in self.images.iter().enumerate() {
            let quoted = format!("\"{}\"", name(index).replace('"', "\"\""));
            let _ = write!(out, "\n{quoted},{},{}", image.objects, image.predictions);
            for value in self.measures.values(&[&image.tally]) {
                out.push(',');
                if let Some(value) = value {
                    let _ = write!(out, "{}", 100.0 * value);
                }
            }
        }
        out.push('\n');
        out
    }
}
