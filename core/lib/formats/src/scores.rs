//! Scores of predictions, and the images with the lowest scores with their predictions: the file that `syntable eval
//! --save` writes, and that `report` and `view` show.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::BufReader;
use std::path::Path;
use syntable_model::error::{Error, Result};
use syntable_model::mirror::DatasetFile;
use syntable_model::product::Mask;

/// Scores of a dataset, in percent. A score with nothing to count is `None`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MetricScores {
    /// Number of images.
    pub images: usize,
    /// Number of labeled objects.
    pub objects: usize,
    /// Number of predictions that count.
    pub predictions: usize,
    /// How the scores of images are combined.
    pub convention: String,
    /// All scores by name.
    pub scores: BTreeMap<String, Option<f64>>,
    /// Tables of scores for people.
    pub tables: Vec<ScoreTable>,
    /// Name of the score that ranks the worst images.
    pub ranked_by: String,
    /// The images with the lowest of these scores, lowest first; equal scores in the order of the dataset.
    pub worst: Vec<ScoredImage>,
}

/// A table of scores.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ScoreTable {
    /// Heading of the column of labels, then headings of the scores.
    pub headings: Vec<String>,
    /// Label of each row, and its scores.
    pub rows: Vec<(String, Vec<Option<f64>>)>,
}

/// An image with its scores and its predictions.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ScoredImage {
    /// Name of the image in the ground truth.
    pub name: String,
    /// Width and height of its masks, px.
    pub size: [u32; 2],
    /// Its scores by name, without scores that have nothing to count.
    pub scores: BTreeMap<String, f64>,
    /// The predictions that count, by descending confidence.
    pub predictions: Vec<PredictedObject>,
}

/// A prediction. Masks are run lengths as in COCO files.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PredictedObject {
    /// Confidence, if the detector states it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub score: Option<f64>,
    /// Id of the labeled object that it was matched with; none if no object was left, or if it shares no pixel with its
    /// match.
    pub object: Option<u16>,
    /// F-measure of the predicted and the labeled amodal mask, percent.
    pub amodal_f: f64,
    /// F-measure of the visible masks, percent.
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
    /// If the file cannot be read, or is not a file of scores.
    pub fn read(path: &Path) -> Result<Self> {
        let file = DatasetFile::open(path).map_err(|error| Error::io(path, &error).of_request())?;
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
    /// The error of the first mask whose size differs from the image.
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
