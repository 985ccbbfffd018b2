//! Keypoints: named points of an object, in a JSON file beside its mesh.
//!
//! `mug.keypoints.json` belongs to `mug.obj`:
//!
//! ```json
//! {"keypoints": [{"name": "handle", "point": [0.06, 0.0, 0.05]}, {"name": "rim", "point": [0.0, 0.0, 0.1]}]}
//! ```

use serde_json::Value;
use std::path::Path;
use syntable_mesh::root::{AssetRoot, exists};
use syntable_mesh::text::shorten;
use syntable_model::error::{Error, Result};
use syntable_model::geometry::Point3;
use syntable_model::scene::{Keypoint, Object};

/// Suffix of the file, instead of the mesh's extension.
const EXTENSION: &str = "keypoints.json";

/// Maximum number of points of an object.
const MAX_POINTS: usize = 1000;

/// A point is at most this far from the box of the mesh, as a multiple of the box's diagonal.
const MAX_DISTANCE: f64 = 1.0;

/// Adds the keypoints next to an object's mesh, a path relative to the root. Without keypoints, the object stays
/// unchanged.
pub fn with_keypoints(object: Object, root: &AssetRoot, mesh: &Path) -> Result<Object> {
    let file = mesh.with_extension(EXTENSION);
    if !exists(&root.folder().join(&file))? {
        return Ok(object);
    }
    let path = root.locate(&file)?;
    let keypoints = parse(&root.read(&path)?, &object).map_err(|error| error.in_file(&path))?;
    Ok(object.with_keypoints(keypoints))
}

fn parse(bytes: &[u8], object: &Object) -> Result<Vec<Keypoint>> {
    let json: Value = serde_json::from_slice(bytes)
        .map_err(|error| Error::new(format!("invalid JSON: {error}")).at_line(error.line().max(1)))?;
    let points = field(&json, "", "keypoints", &["keypoints"])?;
    let points = points.as_array().ok_or_else(|| wrong("keypoints", points, "is not a list of points"))?;
    if points.len() > MAX_POINTS {
        return Err(Error::new(format!("`keypoints` has {} points, more than {MAX_POINTS}", points.len())));
    }
    let mut keypoints: Vec<Keypoint> = Vec::with_capacity(points.len());
    for (i, point) in points.iter().enumerate() {
        let keypoint = keypoint(point, &format!("keypoints[{i}]"), object)?;
        if keypoints.iter().any(|other| other.name == keypoint.name) {
            let name = shorten(&keypoint.name);
            return Err(Error::new(format!("`keypoints[{i}].name`: two points have the name `{name}`")));
        }
        keypoints.push(keypoint);
    }
    Ok(keypoints)
}

fn keypoint(json: &Value, at: &str, object: &Object) -> Result<Keypoint> {
    const FIELDS: [&str; 2] = ["name", "point"];
    let name = field(json, at, "name", &FIELDS)?;
    let text = name.as_str().filter(|name| !name.trim().is_empty());
    let text = text.ok_or_else(|| wrong(&format!("{at}.name"), name, "is not a name"))?;
    let point = field(json, at, "point", &FIELDS)?;
    let numbers: Option<Vec<f64>> = point.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
    let numbers: Option<[f64; 3]> = numbers.and_then(|numbers| numbers.try_into().ok());
    let key = format!("{at}.point");
    let found = Point3::from(numbers.ok_or_else(|| wrong(&key, point, "is not a point of three numbers x, y, z"))?);
    let bounds = object.mesh.bounds();
    let beyond = |axis: usize| (bounds.min[axis] - found[axis]).max(found[axis] - bounds.max[axis]).max(0.0);
    let distance = (0..3).map(|axis| beyond(axis) * beyond(axis)).sum::<f64>().sqrt();
    // False for a non-finite distance, too.
    if distance <= MAX_DISTANCE * bounds.diagonal() {
        return Ok(Keypoint { name: text.to_owned(), point: found });
    }
    Err(wrong(&key, point, &format!("is far from the object, whose box is {:.3?} to {:.3?}", bounds.min, bounds.max))
        .help("write points in the frame and unit of the mesh, z up"))
}

/// A field of a table that must have only these fields.
fn field<'a>(json: &'a Value, at: &str, name: &str, fields: &[&str]) -> Result<&'a Value> {
    let shown = if at.is_empty() { "the file" } else { at };
    let table = json.as_object().ok_or_else(|| wrong(shown, json, "is not a table"))?;
    if let Some(other) = table.keys().find(|key| !fields.contains(&key.as_str())) {
        let message = format!("`{shown}` has an unknown field `{}`", shorten(other));
        return Err(Error::new(message).help(format!("fields are `{}`", fields.join("`, `"))));
    }
    table.get(name).ok_or_else(|| Error::new(format!("`{shown}` has no `{name}`")))
}

fn wrong(key: &str, value: &Value, why: &str) -> Error {
    Error::new(format!("`{key}` = {} {why}", shorten(&value.to_string())))
        .help(r#"write {"keypoints": [{"name": "handle", "point": [0.06, 0.0, 0.05]}]}"#)
}
