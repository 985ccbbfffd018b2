//! COCO's instance annotations.

use crate::Extra;
use crate::segmentation::Segmentation;
use serde::de::{Error as _, MapAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::Value as Json;
use std::fmt;
use std::marker::PhantomData;
use syntable_model::stage::DatasetInfo;

/// Name and origin of a dataset. Reading refuses nothing: a missing field or a field of another type is empty, a number becomes
/// text, and a year in text becomes a number.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
pub struct CocoInfo {
    /// Name or description of the dataset.
    pub description: String,
    /// Home page.
    pub url: String,
    /// Version of the dataset.
    pub version: String,
    /// Year of release; 0 if unknown.
    pub year: i64,
    /// Author, or the program that wrote it.
    pub contributor: String,
    /// Date in any form.
    pub date_created: String,
    /// Other fields.
    #[serde(flatten)]
    pub extra: Extra,
}

impl<'de> Deserialize<'de> for CocoInfo {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Json::Object(mut fields) = Json::deserialize(deserializer)? else { return Ok(Self::default()) };
        let mut text = |name: &str| fields.remove(name).and_then(|json| text_of(&json)).unwrap_or_default();
        Ok(Self {
            description: text("description"),
            url: text("url"),
            version: text("version"),
            year: text("year").trim().parse().unwrap_or_default(),
            contributor: text("contributor"),
            date_created: text("date_created"),
            extra: fields.into_iter().collect(),
        })
    }
}

/// A license of images.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct License {
    /// Unique in the file.
    pub id: u64,
    /// Name of the license.
    pub name: String,
    /// Its text.
    #[serde(default)]
    pub url: String,
    /// Fields that this type does not know.
    #[serde(flatten)]
    pub extra: Extra,
}

impl License {
    /// The license of all images that this program renders.
    pub fn of_assets() -> Self {
        Self { id: 1, name: "licenses of the assets".into(), ..Self::default() }
    }
}

/// A category of objects.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Category {
    /// Unique in the file.
    #[serde(deserialize_with = "id")]
    pub id: u64,
    /// Such as `mug`. Read from text and numbers.
    #[serde(deserialize_with = "text")]
    pub name: String,
    /// Such as `kitchen`; empty if the file has none. Read from text and numbers.
    #[serde(default, deserialize_with = "text")]
    pub supercategory: String,
    /// Fields that this type does not know.
    #[serde(flatten)]
    pub extra: Extra,
}

/// Field of a category in panoptic annotations: 1 for countable objects, 0 for background ("stuff").
pub const IS_THING: &str = "isthing";

/// The categories of a dataset.
pub fn categories(dataset: &DatasetInfo) -> Vec<Category> {
    let category = |(id, name): (u32, &str)| {
        let supercategory = dataset.supercategory(id).unwrap_or_default().to_owned();
        Category { id: id.into(), name: name.into(), supercategory, ..Category::default() }
    };
    dataset.categories().map(category).collect()
}

/// An image.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct CocoImage {
    /// Unique in the file.
    #[serde(deserialize_with = "id")]
    pub id: u64,
    /// Path of the image, relative to the image folder of the dataset. Empty in files that have only `coco_url`, such as LVIS;
    /// see [`CocoImage::file`].
    #[serde(default, deserialize_with = "text")]
    pub file_name: String,
    /// Width, px.
    #[serde(deserialize_with = "pixels")]
    pub width: u32,
    /// Height, px.
    #[serde(deserialize_with = "pixels")]
    pub height: u32,
    /// Id of the image's license; a number in most files.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub license: Option<Json>,
    /// Date in any form.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date_captured: Option<Json>,
    /// Address of the image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coco_url: Option<Json>,
    /// Address of the original image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub flickr_url: Option<Json>,
    /// Other fields.
    #[serde(flatten)]
    pub extra: Extra,
}

impl CocoImage {
    /// Path of the image, relative to the image folder of the dataset: `file_name`, or the last two parts of `coco_url`, as
    /// LVIS' own tools take it (`val2017/000000317999.jpg`). None if both are missing.
    pub fn file(&self) -> Option<String> {
        if !self.file_name.is_empty() {
            return Some(self.file_name.clone());
        }
        let mut parts = self.coco_url.as_ref()?.as_str()?.rsplit('/').filter(|part| !part.is_empty());
        let (name, folder) = (parts.next()?, parts.next()?);
        Some(format!("{folder}/{name}"))
    }
}

/// An object in an image, with the fields `E` of a format.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CocoAnnotation<E = Extra> {
    /// Unique in the file.
    pub id: u64,
    /// The image's id.
    pub image_id: u64,
    /// The category's id.
    pub category_id: u64,
    /// The mask; missing in files of boxes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub segmentation: Option<Segmentation>,
    /// Area of the mask, px². Evaluation sorts objects into small, medium and large by it. Some tools do not write it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub area: Option<f64>,
    /// `[x, y, width, height]`, px; (0, 0) is the top left corner of the image. Some tools do not write it beside a mask.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bbox: Option<[f64; 4]>,
    /// 1 for a crowd of objects, which evaluation ignores; 0 for a single object. Read from numbers and booleans;
    /// `null` is 0.
    pub iscrowd: u8,
    /// Fields beyond these.
    #[serde(flatten)]
    pub extra: E,
}

/// The fields of annotations that COCO does not have, read one by one: with `flatten`, all of them would be held in memory as
/// trees before any of them is read.
pub trait FurtherFields: Default {
    /// Reads the value of a field.
    ///
    /// # Errors
    /// If the annotation has the field twice, or its value is no JSON.
    fn read<'de, A: MapAccess<'de>>(&mut self, name: String, fields: &mut A) -> Result<(), A::Error>;
}

impl FurtherFields for Extra {
    fn read<'de, A: MapAccess<'de>>(&mut self, name: String, fields: &mut A) -> Result<(), A::Error> {
        self.insert(name, fields.next_value()?);
        Ok(())
    }
}

impl<'de, E: FurtherFields> Deserialize<'de> for CocoAnnotation<E> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(AnnotationVisitor(PhantomData))
    }
}

struct AnnotationVisitor<E>(PhantomData<E>);

/// A value of a field that must not occur twice.
fn once<'de, T: Deserialize<'de>, A: MapAccess<'de>>(
    known: &mut Option<T>,
    name: &'static str,
    fields: &mut A,
) -> Result<(), A::Error> {
    match known.replace(fields.next_value()?) {
        None => Ok(()),
        Some(_) => Err(A::Error::duplicate_field(name)),
    }
}

/// An id, see [`id`].
#[derive(Deserialize)]
#[serde(transparent)]
struct ReadId(#[serde(deserialize_with = "id")] u64);

/// A flag, see [`flag`].
#[derive(Deserialize)]
#[serde(transparent)]
struct ReadFlag(#[serde(deserialize_with = "flag")] u8);

impl<'de, E: FurtherFields> Visitor<'de> for AnnotationVisitor<E> {
    type Value = CocoAnnotation<E>;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("struct CocoAnnotation")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut fields: A) -> Result<Self::Value, A::Error> {
        let [mut id, mut image, mut category]: [Option<ReadId>; 3] = Default::default();
        let (mut segmentation, mut area, mut bbox, mut iscrowd) = (None, None, None, None::<ReadFlag>);
        let mut extra = E::default();
        while let Some(name) = fields.next_key::<String>()? {
            match name.as_str() {
                "id" => once(&mut id, "id", &mut fields)?,
                "image_id" => once(&mut image, "image_id", &mut fields)?,
                "category_id" => once(&mut category, "category_id", &mut fields)?,
                "segmentation" => once(&mut segmentation, "segmentation", &mut fields)?,
                "area" => once(&mut area, "area", &mut fields)?,
                "bbox" => once(&mut bbox, "bbox", &mut fields)?,
                "iscrowd" => once(&mut iscrowd, "iscrowd", &mut fields)?,
                _ => extra.read(name, &mut fields)?,
            }
        }
        let needed = |id: Option<ReadId>, name| id.map(|id| id.0).ok_or_else(|| A::Error::missing_field(name));
        Ok(CocoAnnotation {
            id: needed(id, "id")?,
            image_id: needed(image, "image_id")?,
            category_id: needed(category, "category_id")?,
            segmentation: segmentation.flatten(),
            area: area.flatten(),
            bbox: bbox.flatten(),
            iscrowd: iscrowd.map_or(0, |flag| flag.0),
            extra,
        })
    }
}

/// An id. Some tools write whole numbers as floats, such as `1.0`.
pub fn id<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
    deserializer.deserialize_any(Id)
}

struct Id;

/// The smallest number from which floats no longer distinguish neighboring ids.
const UNCLEAR: f64 = 9_007_199_254_740_992.0;

impl Visitor<'_> for Id {
    type Value = u64;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("an id: a whole number from 0 on")
    }

    fn visit_u64<E: serde::de::Error>(self, id: u64) -> Result<u64, E> {
        Ok(id)
    }

    fn visit_i64<E: serde::de::Error>(self, id: i64) -> Result<u64, E> {
        id.try_into().map_err(|_| E::invalid_value(Unexpected::Signed(id), &self))
    }

    fn visit_f64<E: serde::de::Error>(self, id: f64) -> Result<u64, E> {
        if (0.0..UNCLEAR).contains(&id) && id.fract() == 0.0 {
            Ok(id as u64)
        } else {
            Err(E::invalid_value(Unexpected::Float(id), &self))
        }
    }
}

/// Text of a string, a number or a flag; none of other values.
fn text_of(json: &Json) -> Option<String> {
    match json {
        Json::String(text) => Some(text.clone()),
        Json::Number(_) | Json::Bool(_) => Some(json.to_string()),
        _ => None,
    }
}

/// Text that some tools write as a number or as `null`.
fn text<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let json = Json::deserialize(deserializer)?;
    let is_missing = json.is_null();
    let wrong = || D::Error::invalid_type(Unexpected::Other("a list or an object"), &"text");
    text_of(&json).or_else(|| is_missing.then(String::new)).ok_or_else(wrong)
}

/// A number of pixels. Some tools write whole numbers as floats, such as `640.0`.
fn pixels<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    let number = deserializer.deserialize_any(Id)?;
    u32::try_from(number).map_err(|_| D::Error::invalid_value(Unexpected::Unsigned(number), &"a number of pixels"))
}

/// A flag that some tools write as a boolean.
fn flag<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u8, D::Error> {
    match Json::deserialize(deserializer)? {
        Json::Null => Ok(0),
        Json::Bool(flag) => Ok(flag.into()),
        Json::Number(number) if number.as_u64().is_some_and(|flag| flag < 2) => {
            Ok(u8::from(number.as_u64() == Some(1)))
        }
        other => Err(D::Error::invalid_value(Unexpected::Other(&other.to_string()), &"0, 1, true or false")),
    }
}
