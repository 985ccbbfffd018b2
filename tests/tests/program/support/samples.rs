//! Samples of the writers' output: the files of a tiny dataset, in a few lines.

use super::{files, gallery, ok, syntable};
use serde_json::Value;
use std::fmt::Write as _;

/// Maximum width of a line of a sample, characters.
const WIDTH: usize = 100;

/// Maximum number of lines of a JSON file of a sample; other text gets a sixth of it.
const LINES: usize = 30;

/// Runs a recipe of one small scene with a writer's table. Returns its files as Markdown: names and first lines.
pub fn of(writer: &str) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let (recipe, data) = (folder.path().join("recipe.toml"), folder.path().join("data"));
    let base = gallery::recipe_folder().join("base.toml");
    let text = format!(
        "extends = {base:?}\nremove = [\"write.png\", \"denoise\"]\n\n[dataset]\nname = \"sample\"\n\n[set]\n\
         camera.resolution = [64, 48]\nrender.samples_per_pixel = 1\nplace.objects.count = 2\n\n{writer}"
    );
    std::fs::write(&recipe, text).expect("writable");
    ok(syntable().arg("run").arg(&recipe).arg("--out").arg(&data));
    let mut written = files(&data);
    // The files of the run itself.
    written.retain(|name, _| name != "recipe.toml" && !name.starts_with(".syntable"));
    let widest = written.keys().map(String::len).max().expect("it writes files");
    let mut sample = "```text\n".to_owned();
    for (name, bytes) in &written {
        let _ = writeln!(sample, "{name:widest$}  {}", describe(name, bytes));
    }
    sample += "```\n";
    let texts: Vec<(&String, &str)> =
        written.iter().filter_map(|(name, bytes)| Some((name, std::str::from_utf8(bytes).ok()?))).collect();
    for (name, text) in &texts {
        let structured = name.ends_with(".json") || name.ends_with(".jsonl");
        let most = if structured { LINES } else { LINES / 6 };
        let (language, mut lines) = match name.rsplit_once('.').map_or("", |(_, extension)| extension) {
            "json" => ("json", pretty(text, most)),
            "jsonl" => ("json", pretty(text.lines().next().unwrap_or_default(), most)),
            "toml" => ("toml", text.lines().map(cut).collect()),
            _ => ("text", text.lines().map(cut).collect()),
        };
        if lines.len() > most {
            lines.truncate(most - 1);
            lines.push("…".to_owned());
        }
        let _ = write!(sample, "\n`{name}`:\n\n```{language}\n{}\n```\n", lines.join("\n"));
    }
    sample
}

/// Description of a file, from its first bytes.
fn describe(name: &str, bytes: &[u8]) -> String {
    let known = match name.rsplit_once('.').map_or("", |(_, extension)| extension) {
        "png" => describe_png(bytes),
        "npy" => describe_npy(bytes),
        "exr" => describe_exr(bytes),
        "glb" => describe_glb(bytes),
        _ => None,
    };
    known.unwrap_or_else(|| match std::str::from_utf8(bytes) {
        Ok(text) => format!("text, {} line{}", text.lines().count(), if text.lines().count() == 1 { "" } else { "s" }),
        Err(_) => format!("{} bytes", bytes.len()),
    })
}

fn describe_png(bytes: &[u8]) -> Option<String> {
    let reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().ok()?;
    let info = reader.info();
    let bits = info.bit_depth as u8;
    let color = match info.color_type {
        png::ColorType::Grayscale => "gray",
        png::ColorType::Rgb => "RGB",
        png::ColorType::Rgba => "RGBA",
        png::ColorType::GrayscaleAlpha => "gray with alpha",
        png::ColorType::Indexed => "indexed",
    };
    Some(format!("{} × {} pixels, {bits}-bit {color}", info.width, info.height))
}

/// Values of the header, a Python dictionary: `{'descr': '<f4', 'fortran_order': False, 'shape': (48, 64), }`.
fn describe_npy(bytes: &[u8]) -> Option<String> {
    let header = String::from_utf8_lossy(bytes.get(10..)?.split(|byte| *byte == b'\n').next()?).into_owned();
    let after = |key: &str, end: &str| {
        let rest = header.split_once(key)?.1;
        Some(rest.split_once(end)?.0.to_owned())
    };
    Some(format!("dtype {}, shape ({})", after("'descr': '", "'")?, after("'shape': (", ")")?))
}

/// The channels and the data window of an OpenEXR file: after 8 bytes, attributes follow with name, type, size and
/// value.
fn describe_exr(bytes: &[u8]) -> Option<String> {
    fn text<'b>(rest: &mut &'b [u8]) -> Option<&'b str> {
        let end = rest.iter().position(|byte| *byte == 0)?;
        let (text, after) = rest.split_at(end);
        *rest = &after[1..];
        std::str::from_utf8(text).ok()
    }
    let number = |bytes: &[u8]| Some(i32::from_le_bytes(bytes.get(..4)?.try_into().ok()?));
    let mut rest = bytes.get(8..)?;
    let (mut channels, mut size) = (Vec::new(), None);
    loop {
        let name = text(&mut rest)?;
        if name.is_empty() {
            break;
        }
        text(&mut rest)?;
        let length = usize::try_from(number(rest)?).ok()?;
        let mut value = rest.get(4..4 + length)?;
        rest = &rest[4 + length..];
        match name {
            "channels" => {
                while let Some(channel) = text(&mut value).filter(|channel| !channel.is_empty()) {
                    let kind = ["32-bit integer", "16-bit float", "32-bit float"]
                        .get(usize::try_from(number(value)?).ok()?)?;
                    channels.push((channel, *kind));
                    value = value.get(16..)?;
                }
            }
            "dataWindow" => {
                size =
                    Some((number(&value[8..])? - number(value)? + 1, number(&value[12..])? - number(&value[4..])? + 1))
            }
            _ => {}
        }
    }
    let (width, height) = size?;
    let names: Vec<&str> = channels.iter().map(|(name, _)| *name).collect();
    Some(format!("{width} × {height} pixels, {} {}", channels.first()?.1, names.join(" ")))
}

/// Content of the JSON chunk of a binary glTF file, which follows 20 bytes.
fn describe_glb(bytes: &[u8]) -> Option<String> {
    let length = usize::try_from(u32::from_le_bytes(bytes.get(12..16)?.try_into().ok()?)).ok()?;
    let json: Value = serde_json::from_slice(bytes.get(20..20 + length)?).ok()?;
    let count = |key: &str| json[key].as_array().map_or(0, Vec::len);
    let counts = ["nodes", "meshes", "materials", "textures", "cameras"].map(|key| format!("{key}: {}", count(key)));
    Some(format!("glTF {}; {}", json["asset"]["version"].as_str()?, counts.join(", ")))
}

fn cut(line: &str) -> String {
    if line.chars().count() <= WIDTH {
        return line.to_owned();
    }
    line.chars().take(WIDTH - 1).chain(['…']).collect()
}

/// Level of detail of a JSON file.
#[derive(Clone, Copy)]
struct Detail {
    /// Levels below which a value takes one line.
    depth: usize,
    /// Maximum number of fields of a table; the outermost table shows all.
    fields: usize,
}

/// JSON in lines, with long numbers, strings and lists shortened, and with as much detail as fits into `most` lines.
fn pretty(text: &str, most: usize) -> Vec<String> {
    let value: Value = serde_json::from_str(text).expect("the writer writes JSON");
    let fields = std::iter::once(usize::MAX).chain((3..=20).rev());
    let details = fields.flat_map(|fields| [5, 4, 3].map(|depth| Detail { depth, fields }));
    let mut tries = details.map(|detail| {
        let mut lines = vec![String::new()];
        print(&value, 0, detail, &mut lines);
        lines
    });
    tries.find(|lines| lines.len() <= most).expect("it can be shown in a few lines")
}

/// A value in one line.
fn short(value: &Value) -> String {
    match value {
        Value::String(text) if text.chars().count() > 48 => {
            let start: String = text.chars().take(40).collect();
            format!("{}…\"", Value::from(start).to_string().trim_end_matches('"'))
        }
        Value::Number(number) if number.is_f64() => {
            let text = number.to_string();
            let (digits, exponent) = text.find('e').map_or((&text[..], ""), |at| text.split_at(at));
            if digits.len() <= 8 { text } else { format!("{}…{exponent}", &digits[..6]) }
        }
        Value::Array(items) => {
            let mut shown: Vec<String> = items.iter().take(if items.len() > 6 { 3 } else { 6 }).map(short).collect();
            shown.extend((items.len() > 6).then(|| "…".to_owned()));
            format!("[{}]", shown.join(", "))
        }
        Value::Object(fields) if fields.is_empty() => "{}".to_owned(),
        Value::Object(fields) => {
            let shown: Vec<String> =
                fields.iter().map(|(key, value)| format!("{}: {}", Value::from(key.as_str()), short(value))).collect();
            format!("{{ {} }}", shown.join(", "))
        }
        other => other.to_string(),
    }
}

/// A value on one line of limited width: the first entry of a list of lists, or the entries that fit.
fn one_line(value: &Value, room: usize) -> String {
    let whole = short(value);
    if whole.chars().count() <= room {
        return whole;
    }
    if let Value::Array(items) = value
        && let Some(first @ Value::Array(_)) = items.first()
    {
        return format!("[{}, …]", one_line(first, room.saturating_sub(5)));
    }
    let start: String = whole.chars().take(room.saturating_sub(6)).collect();
    let start = start.rsplit_once(", ").map_or(&start[..], |(start, _)| start);
    format!("{start}, … {}", if value.is_array() { "]" } else { "}" })
}

/// Appends a value to the last line, or to separate lines if it does not fit. Only the first entry of a list of tables,
/// or of a table of tables by number, is shown.
fn print(value: &Value, depth: usize, detail: Detail, lines: &mut Vec<String>) {
    let last = |lines: &mut Vec<String>, text: &str| *lines.last_mut().expect("a line") += text;
    let room = WIDTH - 1 - lines.last().map_or(0, |line| line.chars().count());
    let flat = |value: &Value| !value.is_object() && !value.is_array();
    let plain = detail.fields < usize::MAX && value.as_object().is_some_and(|fields| fields.values().all(flat));
    let fits = depth > 0 && (plain || depth >= detail.depth || short(value).chars().count() <= room);
    let entries: Vec<(String, &Value)> = match value {
        Value::Array(items) if !fits && items.iter().all(Value::is_object) => {
            items.iter().map(|item| (String::new(), item)).collect()
        }
        Value::Object(fields) if !fits => {
            fields.iter().map(|(key, value)| (format!("{}: ", Value::from(key.as_str())), value)).collect()
        }
        _ => return last(lines, &one_line(value, room)),
    };
    let numbered = |key: &str| key.is_empty() || key.trim_matches(['"', ':', ' ']).parse::<u32>().is_ok();
    let alike = entries.len() > 1 && entries.iter().all(|(key, value)| value.is_object() && numbered(key));
    let shown = if alike { 1 } else { entries.len().min(if depth == 0 { usize::MAX } else { detail.fields }) };
    let indent = "  ".repeat(depth + 1);
    let brackets = if value.is_array() { ["[", "]"] } else { ["{", "}"] };
    last(lines, brackets[0]);
    for (n, (key, entry)) in entries.iter().take(shown).enumerate() {
        lines.push(format!("{indent}{key}"));
        print(entry, depth + 1, detail, lines);
        if n + 1 < entries.len() {
            last(lines, ",");
        }
    }
    if shown < entries.len() {
        lines.push(format!("{indent}…"));
    }
    lines.push(format!("{}{}", "  ".repeat(depth), brackets[1]));
}
