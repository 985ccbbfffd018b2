//! Tera, with errors that name the line.

use serde_json::Value as Json;
use std::collections::HashMap;
use std::error::Error as _;
use syntable_model::error::{Error, Result};
use tera::{Context, Tera};

/// A parsed template.
pub struct Template {
    tera: Tera,
    text: String,
}

/// What is wrong with a template, and in which of its lines.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// From 1.
    pub line: Option<usize>,
    /// The message.
    pub message: String,
}

/// The only template's name in Tera.
const NAME: &str = "template";

impl Template {
    /// Parses a template. Nothing is escaped: what is written need not be HTML.
    pub fn new(text: &str) -> Result<Self, Fault> {
        let mut tera = Tera::default();
        tera.autoescape_on(Vec::new());
        tera.register_filter("pad", pad);
        tera.add_raw_template(NAME, text).map_err(|error| Fault::of(&error, text))?;
        Ok(Self { tera, text: text.to_owned() })
    }

    /// Renders the template with the fields of an object.
    pub fn render(&self, context: &Json) -> Result<String, Fault> {
        let context = Context::from_value(context.clone()).map_err(|error| Fault::of(&error, &self.text))?;
        self.tera.render(NAME, &context).map_err(|error| Fault::of(&error, &self.text))
    }
}

/// `{{ number | pad(width = 6) }}`: a whole number with zeros in front, as file names want it.
fn pad(value: &Json, arguments: &HashMap<String, Json>) -> tera::Result<Json> {
    let width = match arguments.get("width").map(Json::as_u64) {
        None => 4,
        Some(Some(width @ 0..=64)) => width as usize,
        Some(_) => return Err(tera::Error::msg("`pad` takes a width between 0 and 64")),
    };
    match value.as_u64() {
        Some(number) => Ok(format!("{number:0width$}").into()),
        None => Err(tera::Error::msg(format!("`pad` takes a whole number, not {value}"))),
    }
}

impl Fault {
    fn of(error: &tera::Error, text: &str) -> Self {
        // The outermost message says only that rendering or parsing failed.
        let mut messages = Vec::new();
        let mut cause = error.source();
        while let Some(inner) = cause {
            messages.push(inner.to_string());
            cause = inner.source();
        }
        if messages.is_empty() {
            messages.push(error.to_string());
        }
        let all = messages.join(": ");
        let line = parser_line(&all).or_else(|| line_of_quoted(&all, text));
        // The parser draws the line and its neighbours; what it says stands behind `=`.
        let message = match all.rsplit_once("\n  = ").or_else(|| all.rsplit_once("= ")) {
            Some((_, said)) if parser_line(&all).is_some() => said.trim().to_owned(),
            _ => all.replace(&format!(" while rendering '{NAME}'"), ""),
        };
        Self { line, message: message.split_whitespace().collect::<Vec<_>>().join(" ") }
    }

    /// As an error of a file.
    pub fn into_error(self, file: &str) -> Error {
        let error = Error::new(self.message).in_file(file);
        match self.line {
            Some(line) => error.at_line(line),
            None => error,
        }
    }
}

/// The line in the parser's ` --> 3:14`.
fn parser_line(message: &str) -> Option<usize> {
    let (_, place) = message.split_once("--> ")?;
    place.split_once(':')?.0.trim().parse().ok()
}

/// The line of the text that holds what the message quotes. Rendering does not say where it was; a name that is not
/// known is most often written once.
fn line_of_quoted(message: &str, text: &str) -> Option<usize> {
    let quoted = message.split(['`', '\'']).skip(1).step_by(2).filter(|quoted| !quoted.is_empty() && *quoted != NAME);
    quoted.filter_map(|quoted| text.lines().position(|line| line.contains(quoted))).next().map(|line| line + 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn fault(text: &str) -> Fault {
        let render = Template::new(text).and_then(|template| template.render(&json!({ "a": 1, "f": 0.5 })));
        render.expect_err("a fault")
    }

    #[test]
    fn faults_name_the_line() {
        let syntax = fault("one\ntwo {{ a\nthree");
        assert!(matches!(syntax.line, Some(2 | 3)), "{syntax:?}");
        assert!(syntax.message.contains("expected"), "{syntax:?}");
        let unknown = fault("one\ntwo\n{{ b.c }}");
        assert_eq!(unknown.line, Some(3), "{unknown:?}");
        assert!(unknown.message.contains("`b.c`"), "{unknown:?}");
        let filter = fault("one\n{{ a | nothing }}");
        assert_eq!(filter.line, Some(2), "{filter:?}");
        assert!(filter.message.contains("nothing"), "{filter:?}");
        assert!(fault("{{ f | pad }}").message.contains("`pad` takes a whole number, not 0.5"));
    }

    #[test]
    fn numbers_are_padded_and_nothing_is_escaped() {
        let template = Template::new("{{ a | pad(width=6) }} {{ a | pad }} {{ t }}").expect("parses");
        assert_eq!(template.render(&json!({ "a": 42, "t": "<&>" })).expect("renders"), "000042 0042 <&>");
    }
}
