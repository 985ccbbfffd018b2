//! Scores as text, JSON and CSV, in percent.

use crate::{Convention, Ratio};
use serde_json::{Map, Value, json};
use std::fmt::Write as _;

/// An image that was scored.
#[derive(Debug, Clone)]
pub struct Scored {
    /// Number of labeled objects.
    pub objects: usize,
    /// Number of predictions.
    pub predictions: usize,
    /// Its scores.
    pub ratios: Vec<Ratio>,
}

/// A dataset that was scored.
#[derive(Debug)]
pub struct Table<'a> {
    /// Its images, in order.
    pub images: &'a [Scored],
    /// How they were combined.
    pub convention: Convention,
    /// The scores by name, as fractions.
    pub scores: Vec<(&'static str, Option<f64>)>,
}

/// Scores of a kind of masks, as columns.
const COLUMNS: [&str; 7] = ["overlap_p", "overlap_r", "overlap_f", "boundary_p", "boundary_r", "boundary_f", "f75"];
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

impl Table<'_> {
    fn sum(&self, of: fn(&Scored) -> usize) -> usize {
        self.images.iter().map(of).sum()
    }

    /// A score in percent with one decimal, or a dash.
    fn cell(&self, name: &str) -> String {
        let value = self.scores.iter().find(|it| it.0 == name).and_then(|it| it.1);
        value.map_or_else(|| "-".to_owned(), |value| format!("{:.1}", 100.0 * value))
    }

    /// The table as text, laid out as in the paper.
    pub fn text(&self) -> String {
        let mut out = format!("{:9}  {:^22}  {:^22}", "", "overlap", "boundary").trim_end().to_owned();
        let _ = write!(out, "\n{:9}", "masks");
        for heading in ["P", "R", "F", "P", "R", "F", "F@.75"] {
            let _ = write!(out, "  {heading:>6}");
        }
        for kind in ["amodal", "visible", "invisible"] {
            let _ = write!(out, "\n{kind:9}");
            for column in COLUMNS {
                let _ = write!(out, "  {:>6}", self.cell(&format!("{kind}_{column}")));
            }
        }
        out += "\n\n";
        let columns: Vec<String> = OCCLUSION.iter().map(|(_, heading)| format!("{heading:>6}")).collect();
        let cells = OCCLUSION.iter().zip(&columns).map(|((name, _), heading)| {
            let width = heading.chars().count();
            format!("{:>width$}", self.cell(name))
        });
        let cells: Vec<String> = cells.collect();
        let _ = writeln!(out, "{}\n{}", columns.join("  "), cells.join("  "));
        let (objects, predictions) = (self.sum(|it| it.objects), self.sum(|it| it.predictions));
        let _ = writeln!(
            out,
            "\npercent; images: {}, objects: {objects}, predictions: {predictions}, convention: {}",
            self.images.len(),
            self.convention.name()
        );
        out
    }

    /// All of it as a JSON object.
    pub fn json(&self) -> Value {
        let percent = |value: &Option<f64>| value.map_or(Value::Null, |value| json!(100.0 * value));
        let scores: Map<String, Value> =
            self.scores.iter().map(|(name, value)| ((*name).to_owned(), percent(value))).collect();
        json!({
            "images": self.images.len(),
            "objects": self.sum(|it| it.objects),
            "predictions": self.sum(|it| it.predictions),
            "convention": self.convention.name(),
            "scores": scores,
        })
    }

    /// A line for each image, named by `name`. A score is empty where nothing was to be counted.
    pub fn csv<'n>(&self, name: impl Fn(usize) -> &'n str) -> String {
        let mut out = "image,objects,predictions".to_owned();
        self.scores.iter().for_each(|(name, _)| out += &format!(",{name}"));
        for (index, image) in self.images.iter().enumerate() {
            let quoted = format!("\"{}\"", name(index).replace('"', "\"\""));
            let _ = write!(out, "\n{quoted},{},{}", image.objects, image.predictions);
            for ratio in &image.ratios {
                out.push(',');
                if ratio.whole > 0.0 {
                    let _ = write!(out, "{}", 100.0 * ratio.part / ratio.whole);
                }
            }
        }
        out.push('\n');
        out
    }
}
