//! Keypoints of annotations.

use super::AmodalFields;
use serde_json::json;
use std::collections::BTreeMap;
use syntable_formats::Extra;
use syntable_formats::json::typed;
use syntable_model::prelude::*;
use syntable_model::product::standard::KEYPOINTS;

/// Offset from pixel coordinates with centers at half-integers to COCO's, with centers at integers.
const CENTER_PX: f64 = 0.5;

/// Checks the option `keypoints`.
pub fn check_names(names: &[String]) -> Result<(), ConfigError> {
    if names.iter().any(|name| name.trim().is_empty()) {
        return Err(
            ConfigError::new("keypoints", "a name is empty").help("write names of points of the objects' files")
        );
    }
    Ok(())
}

/// Checks the option `skeleton`.
pub fn check_skeleton(names: &[String], skeleton: &[[String; 2]]) -> Result<(), ConfigError> {
    let wrong = |i: usize, message: String| {
        ConfigError::new("skeleton", format!("`skeleton[{i}]`: {message}"))
            .help("each entry joins two names of `keypoints`, such as [\"base\", \"rim\"]")
    };
    skeleton.iter().enumerate().try_for_each(|(i, [a, b])| {
        match [a, b].into_iter().find(|name| !names.contains(name)) {
            Some(name) => Err(wrong(i, format!("`{name}` is not among the keypoints"))),
            None if a == b => Err(wrong(i, format!("`{a}` is joined to itself"))),
            None => Ok(()),
        }
    })
}

/// The fields of a category with keypoints. A limb of the skeleton is a pair of positions in the list of names, counted
/// from 1.
pub fn of_category(names: &[String], skeleton: &[[String; 2]]) -> Extra {
    let place = |name: &String| names.iter().position(|other| other == name).map_or(0, |place| place + 1);
    let limbs: Vec<[usize; 2]> = skeleton.iter().map(|limb| [place(&limb[0]), place(&limb[1])]).collect();
    Extra::from_iter([("keypoints".to_owned(), json!(names)), ("skeleton".to_owned(), json!(limbs))])
}

/// The keypoints of all objects of a view.
pub struct ObjectKeypoints(BTreeMap<InstanceId, Vec<KeypointEntry>>);

/// The fields of an entry of the product `keypoints` that the writer reads.
#[derive(Deserialize)]
struct KeypointEntry {
    name: String,
    uv_px: Option<[f64; 2]>,
    visibility: u8,
}

impl ObjectKeypoints {
    /// Reads the product.
    pub fn of(products: &Products) -> Result<Self> {
        let points = |(id, value): (InstanceId, &Value)| {
            let entries = typed::<Vec<KeypointEntry>>(value);
            let wrong = |error| Error::new(format!("instance {id} of `{}`: {error}", KEYPOINTS.name()));
            Ok((id, entries.map_err(wrong)?))
        };
        products.get(KEYPOINTS)?.iter().map(points).collect::<Result<_>>().map(Self)
    }

    /// Fills the fields of an object's annotation.
    pub fn fill(&self, id: InstanceId, names: &[String], fields: &mut AmodalFields) {
        let points = self.0.get(&id).map_or(&[][..], Vec::as_slice);
        let labeled = |name: &String| {
            let point = points.iter().find(|point| point.name == *name && point.visibility > 0)?;
            Some((point.uv_px?.map(|x| x - CENTER_PX), point.visibility))
        };
        let found: Vec<Option<([f64; 2], u8)>> = names.iter().map(labeled).collect();
        let triple = |found: &Option<([f64; 2], u8)>| match *found {
            Some(([x, y], visibility)) => [json!(x), json!(y), json!(visibility)],
            None => [json!(0), json!(0), json!(0)],
        };
        fields.keypoints = Some(found.iter().flat_map(triple).collect());
        fields.num_keypoints = Some(found.iter().flatten().count());
    }
}
