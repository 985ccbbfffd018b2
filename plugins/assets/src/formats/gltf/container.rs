//! The outer layer: GLB chunks, JSON text, version.

use gltf::json::Root;
use serde::Deserialize;
use syntable_model::error::{Error, Result};

/// Maximum nesting of the JSON text; glTF needs about ten levels.
const MAX_DEPTH: usize = 100;

/// Parses a file in memory: the document, and the binary chunk of a GLB.
pub fn open(bytes: &[u8]) -> Result<(Root, Option<&[u8]>)> {
    let (text, binary) = if bytes.starts_with(b"glTF") { split(bytes)? } else { (bytes, None) };
    check_depth(text)?;
    check_version(text)?;
    let document = serde_json::from_slice(text).map_err(json_error)?;
    Ok((document, binary))
}

/// The JSON and the binary chunk of a GLB.
fn split(bytes: &[u8]) -> Result<(&[u8], Option<&[u8]>)> {
    let wrong = |message: String| Error::new(format!("not a valid GLB: {message}"));
    let number = |at: usize| -> Result<u32> {
        let word = bytes.get(at..at + 4).and_then(|word| word.try_into().ok());
        word.map(u32::from_le_bytes).ok_or_else(|| wrong(format!("it ends after {} bytes", bytes.len())))
    };
    match number(4)? {
        2 => {}
        1 => return Err(version_error("1")),
        other => return Err(wrong(format!("container version {other}"))),
    }
    let length = number(8)? as usize;
    if length > bytes.len() {
        return Err(wrong(format!("its header says {length} bytes, but the file has {}", bytes.len()))
            .help("the file is cut short"));
    }
    let chunk = |at: usize| -> Result<(&[u8], u32)> {
        let (size, kind) = (number(at)? as usize, number(at + 4)?);
        let left = length.saturating_sub(at + 8);
        if size > left {
            return Err(wrong(format!("a chunk of {size} bytes, but {left} are left")).at_byte(at as u64));
        }
        Ok((&bytes[at + 8..at + 8 + size], kind))
    };
    let (json, kind) = chunk(12)?;
    if kind != u32::from_le_bytes(*b"JSON") {
        return Err(wrong("its first chunk is not JSON".into()).at_byte(12));
    }
    let next = 20 + json.len();
    let binary = if next + 8 <= length { Some(chunk(next)?).filter(|(_, kind)| *kind == 0x004e_4942) } else { None };
    Ok((json, binary.map(|(bytes, _)| bytes)))
}

fn check_version(text: &[u8]) -> Result<()> {
    #[derive(Deserialize)]
    struct Head {
        asset: Option<Asset>,
    }
    #[derive(Deserialize)]
    #[serde(rename_all = "camelCase")]
    struct Asset {
        version: Option<String>,
        min_version: Option<String>,
    }
    let head: Head = serde_json::from_slice(text).map_err(json_error)?;
    let asset = head.asset.ok_or_else(|| Error::new("not a glTF file: it has no `asset`"))?;
    let version = asset.version.unwrap_or_else(|| "1.0".into());
    if !version.starts_with("2.") {
        return Err(version_error(&version));
    }
    match asset.min_version {
        Some(version) if version != "2.0" => Err(version_error(&version)),
        _ => Ok(()),
    }
}

fn version_error(version: &str) -> Error {
    let version = syntable_mesh::text::shorten(version);
    Error::new(format!("glTF version `{version}` is not read; 2.0 is")).help("convert it to glTF 2.0")
}

fn json_error(error: serde_json::Error) -> Error {
    // The library's message ends with the position; the line is reported separately.
    let message = format!("not sound glTF JSON: {error}");
    if error.line() > 0 { Error::new(message).at_line(error.line()) } else { Error::new(message) }
}

/// Refuses JSON that is nested too deeply for recursive parsers.
fn check_depth(text: &[u8]) -> Result<()> {
    let (mut depth, mut quoted, mut escaped) = (0_usize, false, false);
    for (at, &byte) in text.iter().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if quoted => escaped = true,
            b'"' => quoted = !quoted,
            b'[' | b'{' if !quoted => {
                depth += 1;
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
    Ok(())
}
