//! The text of a resolved recipe: every default filled in, nothing inherited, and the versions that made it.

use super::key_path::is_bare;
use std::collections::BTreeMap;
use std::fmt::Write;
use syntable_model::registry::{Shape, Slot};
use toml::{Table, Value};

/// One stage of a resolved recipe.
pub(crate) struct ResolvedStage {
    pub slot: Slot,
    pub id: String,
    pub kind: &'static str,
    pub options: Table,
    /// Name and version of the crate that registered the kind.
    pub plugin: (&'static str, &'static str),
}

/// Writes a resolved recipe. Stages come slot by slot; keyed ones by id.
pub(crate) fn write(dataset: &Table, stages: &[ResolvedStage], assets: &BTreeMap<String, String>) -> String {
    let version = env!("CARGO_PKG_VERSION");
    let mut text = format!(
        "# Resolved by syntable {version}: every default is filled in. Running this file again gives the same dataset.\n"
    );
    section(&mut text, "[dataset]", dataset);
    let mut ordered: Vec<&ResolvedStage> = stages.iter().collect();
    ordered.sort_by_key(|stage| (stage.slot, (stage.slot.shape() == Shape::Keyed).then_some(&stage.id)));
    for slot in Slot::ALL {
        let mut of_slot = ordered.iter().filter(|stage| stage.slot == slot).peekable();
        if of_slot.peek().is_none() && slot.shape() == Shape::List {
            // An empty list is something else than a missing one, which has a default.
            text.insert_str(text.find("\n[dataset]").unwrap_or(text.len()), &format!("\n{slot} = []\n"));
        }
        for stage in of_slot {
            let mut table = Table::new();
            let header = match slot.shape() {
                Shape::One => format!("[{slot}]"),
                Shape::List => {
                    table.insert("id".into(), stage.id.clone().into());
                    format!("[[{slot}]]")
                }
                Shape::Keyed => format!("[{slot}.{}]", key(&stage.id)),
            };
            table.insert("kind".into(), stage.kind.into());
            table.extend(stage.options.clone());
            section(&mut text, &header, &table);
        }
    }
    let lock = Table::from_iter([("syntable".to_owned(), Value::from(version))]);
    section(&mut text, "[lock]", &lock);
    let plugins: BTreeMap<&str, &str> = stages.iter().map(|stage| stage.plugin).collect();
    let plugins: Table = plugins.into_iter().map(|(name, version)| (name.to_owned(), version.into())).collect();
    section(&mut text, "[lock.plugins]", &plugins);
    with_asset_digests(&text, assets)
}

/// A resolved recipe with the digests of its assets, by `pool/name`. Digests that it holds already are kept, unless
/// they are given anew.
pub fn with_asset_digests(resolved: &str, digests: &BTreeMap<String, String>) -> String {
    const HEADER: &str = "\n[lock.assets]\n";
    let (body, old) = match resolved.rfind(HEADER) {
        Some(at) => (&resolved[..at], toml::from_str::<BTreeMap<String, String>>(&resolved[at + HEADER.len()..])),
        None => (resolved, Ok(BTreeMap::new())),
    };
    let mut all = old.unwrap_or_default();
    all.extend(digests.iter().map(|(asset, digest)| (asset.clone(), digest.clone())));
    let mut text = body.to_owned();
    if !all.is_empty() {
        let table: Table = all.into_iter().map(|(asset, digest)| (asset, digest.into())).collect();
        section(&mut text, "[lock.assets]", &table);
    }
    text
}

fn section(text: &mut String, header: &str, table: &Table) {
    let _ = writeln!(text, "\n{header}");
    for (name, value) in table {
        let _ = writeln!(text, "{} = {}", key(name), inline(value));
    }
}

fn key(name: &str) -> String {
    if is_bare(name) { name.to_owned() } else { basic_string(name) }
}

/// A value on one line.
fn inline(value: &Value) -> String {
    match value {
        Value::String(text) if text.contains(['\n', '\r']) => basic_string(text),
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(inline).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Table(table) if table.is_empty() => "{}".to_owned(),
        Value::Table(table) => {
            let entries: Vec<String> =
                table.iter().map(|(name, value)| format!("{} = {}", key(name), inline(value))).collect();
            format!("{{ {} }}", entries.join(", "))
        }
        Value::Float(number) => float(*number),
        other => other.to_string(),
    }
}

fn basic_string(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' => out.push_str("\\\""),
            '\\' => out.push_str("\\\\"),
            '\n' => out.push_str("\\n"),
            '\r' => out.push_str("\\r"),
            '\t' => out.push_str("\\t"),
            c if c.is_control() => {
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

/// A number that reads back as the same bits, with an exponent where digits would be many.
fn float(number: f64) -> String {
    if !number.is_finite() {
        return Value::Float(number).to_string();
    }
    let magnitude = number.abs();
    if number != 0.0 && !(1e-4..1e16).contains(&magnitude) { format!("{number:e}") } else { format!("{number:?}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_read_back() {
        for text in [
            r#"a = "x\"y'\\z\n\u0001""#,
            "a = [1e-9, 1e300, -0.0, 0.1, 15.0, 123456.789]",
            r#"a = { "b c" = [{ d = 1 }, {}], e = true }"#,
            "a = 1979-05-27T07:32:00Z",
            "a = '''\nx\r\n\ty'''",
        ] {
            let table: Table = toml::from_str(text).expect("valid");
            let mut written = String::new();
            section(&mut written, "[t]", &table);
            let read: Table = toml::from_str(&written).unwrap_or_else(|error| panic!("{written}\n{error}"));
            assert_eq!(read["t"], Value::Table(table), "{written}");
        }
    }

    #[test]
    fn digests_are_added_and_kept() {
        let map = |pairs: &[(&str, &str)]| -> BTreeMap<String, String> {
            pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect()
        };
        let one = with_asset_digests("[dataset]\n", &map(&[("p/b", "22")]));
        assert_eq!(one, "[dataset]\n\n[lock.assets]\n\"p/b\" = \"22\"\n");
        let two = with_asset_digests(&one, &map(&[("p/a", "11")]));
        assert_eq!(two, "[dataset]\n\n[lock.assets]\n\"p/a\" = \"11\"\n\"p/b\" = \"22\"\n");
        assert_eq!(with_asset_digests(&two, &map(&[])), two);
    }
}
