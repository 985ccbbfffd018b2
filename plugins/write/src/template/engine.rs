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

/// A fault of a template, and its line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Line of the template, from 1, if it is known.
    pub line: Option<usize>,
    /// The message, on one line.
    pub message: String,
}

/// The only template's name in Tera.
const NAME: &str = "template";

impl Template {
    /// Parses a template. Nothing is escaped: the text need not be HTML.
    pub fn new(text: &str) -> Result<Self, Fault> {
        super::guard::check(text)?;
        let mut tera = Tera::default();
        // The same recipe gives the same files, whoever runs it and wherever.
        tera.register_function("get_env", |_: &HashMap<String, Json>| {
            Err(tera::Error::msg("templates do not read the environment: there is no function `get_env`"))
        });
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

/// `{{ number | pad(width = 6) }}`: an integer with leading zeros, for file names.
fn pad(value: &Json, arguments: &HashMap<String, Json>) -> tera::Result<Json> {
    let width = match arguments.get("width").map(Json::as_u64) {
        None => 4,
        Some(Some(width @ 0..=64)) => width as usize,
        Some(_) => return Err(tera::Error::msg("`pad` takes a width between 0 and 64")),
    };
    match value.as_u64() {
        Some(number) => Ok(format!("{number:0width$}").into()),
        None => Err(tera::Error::msg(format!("`pad` takes an integer of at least 0, not {value}"))),
    }
}

impl Fault {
    fn of(error: &tera::Error, text: &str) -> Self {
        // The outermost message only says that rendering or parsing failed.
        let mut messages = Vec::new();
        let mut cause = error.source();
        while let Some(inner) = cause {
            messages.push(inner.to_string());
            cause = inner.source();
        }
        let message = if messages.is_empty() { error.to_string() } else { messages.join(": ") };
        let (line, message) = locate(&message, text);
        Self { line, message }
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

/// The line that a message of Tera is about, and the message on one line without its drawing of the place. Tera's errors
/// have no position, so its words are parsed here and nowhere else.
fn locate(message: &str, text: &str) -> (Option<usize>, String) {
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    // The parser draws the line between ` --> 3:14` and `  = `, which starts the message.
    let parser = message.split_once("--> ").and_then(|(_, rest)| {
        let line = rest.split_once(':')?.0.trim().parse().ok()?;
        Some((line, rest.split_once("\n  = ")?.1))
    });
    if let Some((line, message)) = parser {
        return (Some(line), one_line(message));
    }
    // The renderer quotes what it does not know. The line is the first that contains a quoted name.
    let quoted = message.split(['`', '\'']).skip(1).step_by(2).filter(|quoted| !quoted.is_empty() && *quoted != NAME);
    let mut lines = quoted.filter_map(|quoted| text.lines().position(|line| line.contains(quoted)));
    (lines.next().map(|line| line + 1), one_line(&message.replace(&format!(" while rendering '{NAME}'"), "")))
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
        // The fault is where the parser stops: at the word after the unclosed bracket.
        let syntax = fault("one\ntwo {{ a\nthree");
        assert_eq!(syntax.line, Some(3), "{syntax:?}");
        assert!(syntax.message.starts_with("expected "), "{syntax:?}");
        let tag = fault("one\n\n\n{% if %}");
        assert_eq!(tag.line, Some(4), "{tag:?}");
        let unknown = fault("one\ntwo\n{{ b.c }}");
        assert_eq!(unknown.line, Some(3), "{unknown:?}");
        assert!(unknown.message.contains("`b.c`"), "{unknown:?}");
        let filter = fault("one\n{{ a | nothing }}");
        assert_eq!(filter.line, Some(2), "{filter:?}");
        assert!(filter.message.contains("nothing"), "{filter:?}");
        assert!(fault("{{ f | pad }}").message.contains("`pad` takes an integer of at least 0, not 0.5"));
    }

    #[test]
    fn templates_do_not_read_the_environment() {
        let fault = fault("{{ get_env(name=\"PATH\") }}");
        assert!(fault.message.contains("there is no function `get_env`"), "{fault:?}");
    }

    #[test]
    fn numbers_are_padded_and_nothing_is_escaped() {
        let template = Template::new("{{ a | pad(width=6) }} {{ a | pad }} {{ t }}").expect("parses");
        assert_eq!(template.render(&json!({ "a": 42, "t": "<&>" })).expect("renders"), "000042 0042 <&>");
    }
}
