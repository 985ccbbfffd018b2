//! Scores of predictions, and the images with the lowest ones with what was predicted of them: the file that
//! `syntable eval --save` writes, and that `report` and `view` show.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::product::Mask;

/// Scores of a dataset, in percent. Those of which nothing was to be counted are none.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MetricScores {
    /// Number of images.
    pub images: usize,
    /// Number of labeled objects.
    pub objects: usize,
    /// Number of predictions that count.
    pub predictions: usize,
    /// How images were combined.
    pub convention: String,
    /// All scores by name.
    pub scores: BTreeMap<String, Option<f64>>,
    /// Scores side by side, for people.
    pub tables: Vec<ScoreTable>,
    /// Name of the score by which images are the worst.
    pub ranked_by: String,
    /// The images with the lowest such scores, lowest first; of equal ones, in the order of the dataset.
    pub worst: Vec<ScoredImage>,
}

/// Scores side by side.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ScoreTable {
    /// Heading of the labels of rows, then those of scores.
    pub headings: Vec<String>,
    /// Label of each row, and its scores.
    pub rows: Vec<(String, Vec<Option<f64>>)>,
}

/// An image with its scores and its predictions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ScoredImage {
    /// What the ground truth calls it.
    pub name: String,
    /// Width and height of its masks, px.
    pub size: [u32; 2],
    /// Its scores by name; those of which nothing was to be counted are left out.
    pub scores: BTreeMap<String, f64>,
    /// The predictions that count, by falling confidence.
    pub predictions: Vec<PredictedObject>,
}

/// A prediction. Masks are run lengths as in COCO files.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PredictedObject {
    /// Confidence, if the detector says it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<f64>,
    /// Id of the labeled object that it stands for; none if it has no pixel of the one that it was matched with, or none was left.
    pub object: Option<u16>,
    /// F of the amodal masks, of both, in percent.
    pub amodal_f: f64,
    /// F of the visible masks.
    pub visible_f: f64,
    /// Whether it counts as occluded.
    pub occluded: bool,
    /// Visible mask.
    pub visible: String,
    /// Amodal mask.
    pub amodal: String,
    /// Occlusion mask; none if it is empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hidden: Option<String>,
}

impl MetricScores {
    /// Reads a file of scores.
    ///
    /// # Errors
    /// If it cannot be read, or is no such file.
    pub fn read(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|error| Error::io(path, &error).of_request())?;
        let wrong = |what: String| Error::new(what).in_file(path).help("`syntable eval --save FILE` writes it again");
        let scores: Self = serde_json::from_reader(BufReader::new(file))
            .map_err(|error| wrong(format!("it is no file of scores: {error}")))?;
        for image in &scores.worst {
            if let Some(what) = image.damage() {
                return Err(wrong(format!("image \"{}\": {what}", image.name)));
            }
        }
        Ok(scores)
    }

    /// The text of a file of scores.
    pub fn text(&self) -> String {
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }
}

impl ScoredImage {
    /// The first mask that is none of the size of the image.
    fn damage(&self) -> Option<String> {
        let [width, height] = self.size;
        self.predictions.iter().enumerate().find_map(|(number, it)| {
            let masks = [("visible", Some(&it.visible)), ("amodal", Some(&it.amodal)), ("hidden", it.hidden.as_ref())];
            masks.into_iter().find_map(|(name, mask)| {
                let error = Mask::from_coco(width, height, mask?).err()?;
                Some(format!("`{name}` of prediction {}, {width} × {height} pixels: {error}", number + 1))
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_that_were_edited_are_refused() {
        let mask = Mask::from_fn(4, 3, |x, y| x > y).to_coco();
        let object = PredictedObject { visible: mask.clone(), amodal: mask, ..PredictedObject::default() };
        let image = ScoredImage { name: "a.png".into(), size: [4, 3], predictions: vec![object], ..Default::default() };
        let scores = MetricScores { images: 1, worst: vec![image], ..MetricScores::default() };
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("scores.json");
        let read = |scores: &MetricScores| {
            std::fs::write(&path, scores.text()).expect("writable");
            MetricScores::read(&path)
        };
        assert_eq!(read(&scores).expect("sound"), scores);
        let with = |change: &dyn Fn(&mut ScoredImage)| {
            let mut changed = scores.clone();
            change(&mut changed.worst[0]);
            read(&changed).expect_err("damaged").to_string()
        };
        for damage in [
            with(&|it| it.predictions[0].amodal = "~~".into()),
            with(&|it| it.predictions[0].hidden = Some("7777".into())),
            with(&|it| it.size = [3, 3]),
        ] {
            assert!(damage.contains("image \"a.png\"") && damage.contains("of prediction 1"), "{damage}");
        }
    }
}
