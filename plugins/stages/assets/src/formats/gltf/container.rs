//! The outer layer: GLB chunks, JSON text, version.

use gltf::json::Root;
use serde_json::Value;
use syntable_mesh::limits::Budget;
use syntable_mesh::text::shorten;
use syntable_model::error::{Error, Result};

/// Maximum nesting of the JSON text; glTF needs about ten levels.
const MAX_DEPTH: usize = 100;
/// Memory of a parsed value of the JSON text, bytes: a table's key and value.
const VALUE_BYTES: u64 = 100;

/// A parsed file.
pub struct GltfFile<'a> {
    /// The document, without animations and `extras`.
    pub document: Root,
    /// The binary chunk of a GLB.
    pub binary: Option<&'a [u8]>,
    /// Whether the file has animations.
    pub animated: bool,
}

/// Parses a file in memory.
pub fn open<'a>(bytes: &'a [u8], budget: &Budget) -> Result<GltfFile<'a>> {
    let (text, binary) = if bytes.starts_with(b"glTF") { split(bytes)? } else { (bytes, None) };
    let values = check_depth(text)?;
    budget.bytes(text.len() as u64 + values * VALUE_BYTES)?;
    let mut json: Value = serde_json::from_slice(text).map_err(|error| {
        // The library's message ends with the position; the line is reported separately.
        let message = Error::new(format!("invalid glTF JSON: {error}"));
        if error.line() > 0 { message.at_line(error.line()) } else { message }
    })?;
    check_version(&json)?;
    let animated = tidy(&mut json);
    let document = serde_path_to_error::deserialize(json).map_err(|error| {
        let (path, inner) = (error.path().to_string(), error.inner());
        Error::new(format!("invalid glTF JSON: `{}`: {inner}", shorten(&path)))
    })?;
    Ok(GltfFile { document, binary, animated })
}

/// Removes valid JSON that does not affect a static object and that the library would refuse: `extras`, which may have
/// any type, and animations, whose pointers need no node. Adds `nodes` to scenes without any. Returns whether the file
/// has animations.
fn tidy(json: &mut Value) -> bool {
    fn without_extras(value: &mut Value) {
        match value {
            Value::Object(table) => {
                table.retain(|key, _| key != "extras");
                table.values_mut().for_each(without_extras);
            }
            Value::Array(items) => items.iter_mut().for_each(without_extras),
            _ => {}
        }
    }
    without_extras(json);
    let Value::Object(root) = json else { return false };
    let animated = root.get("animations").and_then(Value::as_array).is_some_and(|all| !all.is_empty());
    root.retain(|key, _| key != "animations");
    for scene in root.get_mut("scenes").and_then(Value::as_array_mut).into_iter().flatten() {
        if let Value::Object(scene) = scene {
            scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
        }
    }
    animated
}

/// The JSON and the binary chunk of a GLB.
fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    let wrong = |message: String| Error::new(format!("not a valid GLB: {message}"));
    let number = |at: usize| -> Result<u32> {
        let word = bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
        word.map(u32::from_le_bytes).ok_or_else(|| wrong(format!("the file ends after {} bytes", bytes.len())))
    };
    match number(4)? {
        2 => {}
        1 => return Err(version_error("1")),
        other => return Err(wrong(format!("container version {other}"))),
    }
    let length = number(8)? as usize;
    if length > bytes.len() {
        return Err(wrong(format!("the header states {length} bytes, but the file has {}", bytes.len()))
            .help("the file is cut short"));
    }
    let chunk = |at: usize| -> Result<(&[u8], u32)> {
        let (size, kind) = (number(at)? as usize, number(at + 4)?);
        let left = length.saturating_sub(at + 8);
        if size > left {
            return Err(wrong(format!("a chunk has {size} bytes, but only {left} are left")).at_byte(at as u64));
        }
        Ok((&bytes[at + 8..at + 8 + size], kind))
    };
    let (json, kind) = chunk(12)?;
    if kind != u32::from_le_bytes(*b"JSON") {
        return Err(wrong("the first chunk is not JSON".into()).at_byte(12));
    }
    let next = 20 + json.len();
    let binary = if next + 8 <= length { Some(chunk(next)?).filter(|(_, kind)| *kind == 0x004e_4942) } else { None };
    Ok((json, binary.map(|(bytes, _)| bytes)))
}

fn check_version(json: &Value) -> Result<()> {
    let asset = json.get("asset").ok_or_else(|| Error::new("not a glTF file: `asset` is missing"))?;
    let version = asset.get("version").and_then(Value::as_str).unwrap_or("1.0");
    if !version.starts_with("2.") {
        return Err(version_error(version));
    }
    match asset.get("minVersion").and_then(Value::as_str) {
        Some(version) if version != "2.0" => Err(version_error(version)),
        _ => Ok(()),
    }
}

fn version_error(version: &str) -> Error {
    let version = shorten(version);
    Error::new(format!("glTF version `{version}` is not supported, only 2.0")).help("convert it to glTF 2.0")
}

/// Refuses JSON that is nested too deeply for recursive parsers. Returns an upper bound of the number of its values.
fn check_depth(text: &[u8]) -> Result<u64> {
    let (mut depth, mut quoted, mut escaped) = (0_usize, false, false);
    let mut values = 1;
    for (at, &byte) in text.iter().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if quoted => escaped = true,
            b'"' => quoted = !quoted,
            b',' if !quoted => values += 1,
            b'[' | b'{' if !quoted => {
                depth += 1;
                values += 1;
                if depth > MAX_DEPTH {
                    return Err(
                        Error::new(format!("the JSON is nested more than {MAX_DEPTH} levels deep")).at_byte(at as u64)
                    );
                }
            }
            b']' | b'}' if !quoted => depth = depth.saturating_sub(1),
            _ => {}
        }
    }
    Ok(values)
}
