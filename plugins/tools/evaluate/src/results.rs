//! Result files of detectors: a JSON list of predictions, one object each.
//!
//! Memory holds only the position of each prediction in the file, its image and its score.

use crate::coco::MOST;
use crate::masked_object::{DetectedMasks, MaskedObject, Occluded};
use crate::names::ImageNames;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use syntable_formats::coco;
use syntable_formats::segmentation::Segmentation;
use syntable_model::error::{Error, Result};
use syntable_model::mirror::DatasetFile;
use syntable_model::reader::OpenDataset;

/// A prediction. Keys other than these and the keys of [`PredictionHead`], such as `bbox`, are ignored.
#[derive(Debug, Deserialize)]
struct Prediction {
    /// Visible mask.
    segmentation: Segmentation,
    /// Amodal mask. Without it, the union of the visible mask and the occlusion mask.
    amodal_segmentation: Option<Segmentation>,
    /// Occlusion mask. Without it, the amodal mask minus the visible mask.
    occlusion_segmentation: Option<Segmentation>,
    /// Whether the object is occluded, if the detector states it; otherwise this is derived from the masks.
    occluded: Option<bool>,
}

/// Part of a prediction that stays in memory.
#[derive(Debug, Deserialize)]
struct PredictionHead {
    /// The image: its `id` in the annotation file of the ground truth, or its name.
    image_id: ImageId,
    /// Confidence of the detector.
    score: f64,
    /// Its category: the `id` in the annotation file of the ground truth.
    #[serde(default, deserialize_with = "category")]
    category_id: Option<u64>,
}

/// An id, or none for other values: only some scores need it.
fn category<'de, D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Option<u64>, D::Error> {
    Ok(coco::id(serde_json::Value::deserialize(deserializer)?).ok())
}

#[derive(Debug, Clone)]
enum ImageId {
    Number(u64),
    Name(String),
}

/// Predictions of an image by descending score, as rankings need them: the number of those with at least the score
/// `least`, and all places to read. Of the others, rankings over all categories and by category need the first [`MOST`].
/// If scores are equal, the earlier prediction comes first.
pub(crate) fn ranked<T>(
    places: &[T],
    least: f64,
    score: impl Fn(&T) -> f64,
    category: impl Fn(&T) -> Option<u32>,
) -> (usize, Vec<&T>) {
    let kept = places.partition_point(|place| score(place) >= least);
    let mut ranks: BTreeMap<Option<u32>, usize> = BTreeMap::new();
    let mut is_ranked = |(index, place): &(usize, &T)| {
        let rank = ranks.entry(category(place)).or_default();
        *rank += 1;
        *index < kept.max(MOST) || *rank <= MOST
    };
    (kept, places.iter().enumerate().filter(|it| is_ranked(it)).map(|it| it.1).collect())
}

impl<'de> Deserialize<'de> for ImageId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        match serde_json::Value::deserialize(deserializer)? {
            serde_json::Value::String(name) => Ok(Self::Name(name)),
            id => coco::id(&id).map(Self::Number).map_err(|_| {
                D::Error::custom(format!("`image_id` is {id}, which is neither an id nor the name of an image"))
            }),
        }
    }
}

/// Position of a prediction in the file.
#[derive(Debug, Clone, Copy)]
struct PredictionLocation {
    start: u64,
    length: usize,
    line: usize,
    score: f64,
    /// Id of its category in the ground truth, if known.
    category: Option<u32>,
}

/// A result file.
#[derive(Debug)]
pub struct ResultFile {
    path: PathBuf,
    /// Minimum score of predictions.
    least: f64,
    /// Predictions of each image of the ground truth, by descending score. If scores are equal, the earlier prediction
    /// comes first.
    places: Vec<Vec<PredictionLocation>>,
}

impl ResultFile {
    /// Whether a file is a JSON list.
    pub fn is_one(path: &Path) -> bool {
        let Ok(file) = DatasetFile::open(path) else { return false };
        let first = BufReader::new(file).bytes().map_while(Result::ok).find(|byte| !byte.is_ascii_whitespace());
        path.is_file() && first == Some(b'[')
    }

    /// Opens a file with predictions for these images of a dataset. Predictions with a score below `least` are kept
    /// separately.
    ///
    /// # Errors
    /// If the file is not a list of predictions, or a prediction belongs to no image of the dataset.
    pub fn open(path: &Path, least: f64, truth: &Path, dataset: &OpenDataset) -> Result<Self> {
        let images = &dataset.images;
        let mut places: Vec<Vec<PredictionLocation>> = vec![Vec::new(); images.len()];
        let names = ImageNames::of(images.iter().map(|it| it.name.as_str()));
        let numbers: BTreeMap<u64, usize> =
            images.iter().enumerate().filter_map(|(number, image)| Some((image.id?, number))).collect();
        elements(path, &mut |start, line, bytes| {
            let head: PredictionHead = parse(path, line, bytes)?;
            let wrong =
                |message: String, help: &str| Error::new(message).in_file(path).at_line(line).help(help.to_owned());
            if !head.score.is_finite() {
                return Err(wrong(format!("the score {} is not a number", head.score), "leave the prediction out"));
            }
            let image = match &head.image_id {
                ImageId::Name(name) => names.find(name),
                ImageId::Number(id) => numbers.get(id).copied(),
            };
            let Some(image) = image else {
                let id = match &head.image_id {
                    ImageId::Name(name) => format!("\"{name}\""),
                    ImageId::Number(id) => id.to_string(),
                };
                let example = images.first().map_or(String::new(), |image| format!(", such as \"{}\"", image.name));
                let help = format!(
                    "`image_id` is the `id` of an image in the annotation file of the ground truth, or its name{example}"
                );
                return Err(wrong(format!("`image_id` {id} is not an image of {}", truth.display()), &help));
            };
            let category = head.category_id.and_then(|own| dataset.category(own));
            places[image].push(PredictionLocation { start, length: bytes.len(), line, score: head.score, category });
            Ok(())
        })?;
        places.iter_mut().for_each(|of| of.sort_by(|a, b| b.score.total_cmp(&a.score)));
        Ok(Self { path: path.to_owned(), least, places })
    }

    /// Predictions for an image with `[width, height]` pixels: predictions with sufficient scores, and predictions with
    /// lower scores for rankings, over all categories or by category.
    ///
    /// # Errors
    /// If the file cannot be read, or a mask is damaged or of another size.
    pub fn instances(&self, image: usize, size: [u32; 2], occluded: Occluded) -> Result<[Vec<MaskedObject>; 2]> {
        let fail = |error: std::io::Error| Error::io(&self.path, &error);
        let mut file = DatasetFile::open(&self.path).map_err(fail)?;
        let read = |place: &PredictionLocation| {
            let mut bytes = vec![0; place.length];
            file.seek(SeekFrom::Start(place.start)).and_then(|_| file.read_exact(&mut bytes)).map_err(fail)?;
            let prediction: Prediction = parse(&self.path, place.line, &bytes)?;
            let instance =
                prediction.instance(size, occluded).map_err(|error| error.in_file(&self.path).at_line(place.line))?;
            Ok(MaskedObject { score: Some(place.score), category: place.category, ..instance })
        };
        let (kept, places) = ranked(&self.places[image], self.least, |place| place.score, |place| place.category);
        let mut likely = places.into_iter().map(read).collect::<Result<Vec<_>>>()?;
        let unlikely = likely.split_off(kept);
        Ok([likely, unlikely])
    }
}

impl Prediction {
    fn instance(&self, [width, height]: [u32; 2], occluded: Occluded) -> Result<MaskedObject> {
        let decode = |key: &str, of: &Segmentation| {
            let named = |error: Error| {
                let help = error.help_text().unwrap_or("predict masks with the size of the image").to_owned();
                Error::new(format!("`{key}` of an image {width} × {height}: {}", error.message())).help(help)
            };
            of.decode(width, height).map_err(named)
        };
        let visible = decode("segmentation", &self.segmentation)?;
        let optional = |key, of: &Option<Segmentation>| of.as_ref().map(|it| decode(key, it)).transpose();
        let amodal = optional("amodal_segmentation", &self.amodal_segmentation)?;
        let occlusion = optional("occlusion_segmentation", &self.occlusion_segmentation)?;
        Ok(DetectedMasks { visible, amodal, occlusion, is_occluded: self.occluded }.object(occluded))
    }
}

fn parse<T: for<'de> Deserialize<'de>>(path: &Path, line: usize, bytes: &[u8]) -> Result<T> {
    serde_json::from_slice(bytes).map_err(|error| {
        let text = error.to_string();
        let what = text.split(" at line ").next().unwrap_or_default();
        Error::new(format!("not a prediction: {what}"))
            .in_file(path)
            .at_line(line)
            .help("a prediction is an object with `image_id`, `score` and `segmentation`")
    })
}

/// Receives an element of a JSON list: its first byte, its line and its text.
type ElementVisitor<'a> = &'a mut dyn FnMut(u64, usize, &[u8]) -> Result<()>;

/// Passes each element of a JSON list to `each`.
fn elements(path: &Path, each: ElementVisitor) -> Result<()> {
    let fail = |error: std::io::Error| Error::io(path, &error);
    let mut file = BufReader::new(DatasetFile::open(path).map_err(fail)?);
    let (mut depth, mut in_text, mut is_escaped) = (0_usize, false, false);
    let (mut element, mut begin) = (Vec::new(), (0, 1));
    let (mut position, mut line) = (0_u64, 1);
    loop {
        let bytes = file.fill_buf().map_err(fail)?;
        if bytes.is_empty() {
            let cut = || Error::new("the list of predictions ends early").in_file(path).at_line(line);
            return if depth == 0 { Ok(()) } else { Err(cut().help("write the file again")) };
        }
        for &byte in bytes {
            let is_between = depth == 1 && !in_text && (byte == b',' || byte == b']');
            if is_between && !element.is_empty() {
                each(begin.0, begin.1, &element)?;
                element.clear();
            } else if depth > 0 && !is_between && !(element.is_empty() && byte.is_ascii_whitespace()) {
                if element.is_empty() {
                    begin = (position, line);
                }
                element.push(byte);
            }
            match byte {
                _ if is_escaped => is_escaped = false,
                b'\\' if in_text => is_escaped = true,
                b'"' => in_text = !in_text,
                b'[' | b'{' if !in_text => depth += 1,
                b']' | b'}' if !in_text => depth = depth.saturating_sub(1),
                _ => {}
            }
            position += 1;
            line += usize::from(byte == b'\n');
        }
        let length = bytes.len();
        file.consume(length);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_may_be_whole_floats() {
        let head = |ids: &str| serde_json::from_str::<PredictionHead>(&format!("{{{ids}, \"score\": 0.5}}"));
        let both = head(r#""image_id": 3.0, "category_id": 7.0"#).expect("ids");
        assert!(matches!(both.image_id, ImageId::Number(3)) && both.category_id == Some(7));
        let named = head(r#""image_id": "a.png", "category_id": "mug""#).expect("a name");
        assert!(matches!(&named.image_id, ImageId::Name(name) if name == "a.png") && named.category_id.is_none());
        assert_eq!(head(r#""image_id": 3"#).expect("an id").category_id, None);
        let error = head(r#""image_id": 3.5"#).expect_err("no id").to_string();
        assert!(error.contains("`image_id` is 3.5, which is neither an id"), "{error}");
    }
}
