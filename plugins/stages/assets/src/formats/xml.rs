//! XML documents within limits, and the elements and attributes of a document.

use roxmltree::{Document, Node};
use std::collections::BTreeMap;
use std::str::FromStr;
use syntable_mesh::limits::Budget;
use syntable_mesh::text::shorten;
use syntable_model::error::{Error, Result};

/// Memory of a node or an attribute of a parsed document, bytes.
const NODE_BYTES: u64 = 100;

/// The text of a document.
pub fn text(bytes: Vec<u8>, budget: &Budget) -> Result<String> {
    // Every element and attribute has one of these letters.
    let nodes = bytes.iter().filter(|&&byte| matches!(byte, b'<' | b'=')).count() as u64;
    budget.bytes(nodes * NODE_BYTES)?;
    let utf_16 = |pair: fn([u8; 2]) -> u16| {
        let units = bytes[2..].chunks_exact(2).map(|unit| pair([unit[0], unit[1]]));
        char::decode_utf16(units).map(|letter| letter.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    let text: String = match bytes.as_slice() {
        [0xff, 0xfe, ..] => utf_16(u16::from_le_bytes),
        [0xfe, 0xff, ..] => utf_16(u16::from_be_bytes),
        // Names in other encodings lose letters, but numbers are ASCII.
        _ => String::from_utf8(bytes).unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned()),
    };
    // The declaration must be at the start, but some programs write an empty line before it.
    Ok(text.trim_start_matches('\u{feff}').trim_start().to_owned())
}

/// Parses a document, which may not declare entities.
pub fn parse(text: &str) -> Result<Document<'_>> {
    Document::parse(text)
        .map_err(|error| Error::new(format!("invalid XML: {error}")).at_line(error.pos().row.max(1) as usize))
}

/// The children with a name, whatever their namespace.
pub fn children<'a, 'd: 'a>(of: Node<'a, 'd>, name: &'a str) -> impl Iterator<Item = Node<'a, 'd>> {
    of.children().filter(move |child| child.is_element() && child.tag_name().name() == name)
}

/// The first child with a name.
pub fn only<'a, 'd>(of: Node<'a, 'd>, name: &str) -> Option<Node<'a, 'd>> {
    of.children().find(|child| child.is_element() && child.tag_name().name() == name)
}

/// Elements by their ids. Programs give one id to elements of several names.
pub type ById<'a, 'd> = BTreeMap<&'a str, Vec<Node<'a, 'd>>>;

/// The elements with ids.
pub fn by_id<'a, 'd>(document: &'a Document<'d>) -> ById<'a, 'd> {
    let mut ids = ById::new();
    for node in document.descendants() {
        if let Some(id) = attribute(node, "id") {
            ids.entry(id).or_default().push(node);
        }
    }
    ids
}

/// The element of a name that a reference such as `#id` names.
pub fn target<'a, 'd>(ids: &ById<'a, 'd>, name: &str, reference: &str) -> Option<Node<'a, 'd>> {
    let nodes = ids.get(reference.trim().trim_start_matches('#'))?;
    nodes.iter().find(|node| node.tag_name().name() == name).copied()
}

/// All text of an element.
fn all_text(of: Node) -> String {
    of.children().filter(Node::is_text).filter_map(|text| text.text()).collect()
}

fn parsed<T: FromStr>(of: Node, what: &str) -> Result<Vec<T>> {
    let text = all_text(of);
    let all = text.split_whitespace().map(|word| {
        word.parse().map_err(|_| {
            Error::new(format!("`{}` in `<{}>` is not {what}", shorten(word), of.tag_name().name())).at_line(line(of))
        })
    });
    all.collect()
}

/// The numbers that an element holds.
pub fn numbers(of: Node) -> Result<Vec<f32>> {
    parsed(of, "a number")
}

/// The indices that an element holds.
pub fn indices(of: Node) -> Result<Vec<usize>> {
    parsed(of, "an index")
}

/// The numbers of an element that holds exactly `N`.
pub fn array<const N: usize>(of: Node) -> Result<[f64; N]> {
    let numbers: Vec<f64> = parsed(of, "a number")?;
    let count = numbers.len();
    numbers.try_into().map_err(|_| {
        Error::new(format!("`<{}>` has {count} numbers instead of {N}", of.tag_name().name())).at_line(line(of))
    })
}

fn line(of: Node) -> usize {
    of.document().text_pos_at(of.range().start).row as usize
}

/// An attribute, whatever its namespace.
pub fn attribute<'a>(of: Node<'a, '_>, name: &str) -> Option<&'a str> {
    of.attributes().find(|attribute| attribute.name() == name).map(|attribute| attribute.value())
}

/// The finite numbers of an attribute; `None` if it is missing.
pub fn vector<const N: usize, T: FromStr + Copy + Into<f64>>(of: Node, name: &str) -> Result<Option<[T; N]>> {
    let Some(text) = attribute(of, name) else { return Ok(None) };
    let numbers: Option<Vec<T>> = text.split_whitespace().map(|word| word.parse().ok()).collect();
    let numbers = numbers.and_then(|numbers| <[T; N]>::try_from(numbers).ok());
    let finite = numbers.filter(|numbers| numbers.iter().all(|&x| x.into().is_finite()));
    finite
        .map(Some)
        .ok_or_else(|| Error::new(format!("`{name}` = `{}` is not {N} numbers", shorten(text))).at_line(line(of)))
}
