//! Tera, with errors that include the line.

use super::budget;
use super::fault::TemplateFault;
use super::names::{self, Unknown, ValueShape};
use serde_json::Value as Json;
use std::collections::{BTreeMap, HashMap};
use std::error::Error as _;
use std::io::{self, Write};
use syntable_model::error::{Error, Result};
use syntable_model::limits::{TEMPLATE_RANGE, TEMPLATE_TEXT};
use syntable_model::panics::unwound;
use syntable_model::words::listing;
use tera::{Context, Tera};

/// A parsed template.
pub struct CheckedTemplate {
    tera: Tera,
    text: String,
}

/// Name of the only template in Tera.
const NAME: &str = "template";

impl CheckedTemplate {
    /// Parses a template. No output is escaped, since it need not be HTML.
    pub fn new(text: &str) -> Result<Self, TemplateFault> {
        super::guard::check(text)?;
        let mut tera = Tera::default();
        // A recipe produces the same files for every user and on every machine.
        tera.register_function("get_env", |_: &HashMap<String, Json>| {
            Err(tera::Error::msg("templates cannot read the environment: the function `get_env` does not exist"))
        });
        tera.register_function("range", range);
        tera.autoescape_on(Vec::new());
        tera.register_filter("pad", pad);
        tera.add_raw_template(NAME, text).map_err(|error| TemplateFault::of(&error, text))?;
        Ok(Self { tera, text: text.to_owned() })
    }

    /// The same template with limits, which are enforced during rendering.
    fn limited(mut self) -> Result<Self, TemplateFault> {
        budget::limit(&mut self.tera, NAME).map_err(|error| TemplateFault::of(&error, &self.text))?;
        Ok(self)
    }

    /// Parses a template whose contexts have this shape, and refuses variables that no context has. `of` names the
    /// context in messages: `a file per view`.
    pub fn checked(text: &str, of: &str, context: &BTreeMap<String, ValueShape>) -> Result<Self, TemplateFault> {
        let template = Self::new(text)?;
        match template.unknown(context) {
            Some(unknown) => Err(TemplateFault::of_unknown(&unknown, of, text)),
            None => template.limited(),
        }
    }

    fn unknown(&self, context: &BTreeMap<String, ValueShape>) -> Option<Unknown> {
        let parsed = self.tera.get_template(NAME).ok()?;
        let macros: BTreeMap<_, _> = parsed.macros.iter().collect();
        names::unknown(&parsed.ast, &macros.into_values().collect::<Vec<_>>(), context)
    }

    /// Renders the template with the fields of an object.
    pub fn render(&self, context: &Json) -> Result<String, TemplateFault> {
        self.render_at_most(context, TEMPLATE_TEXT.most as usize, 1)
    }

    fn render_at_most(&self, context: &Json, most: usize, divisor: u64) -> Result<String, TemplateFault> {
        let context = Context::from_value(context.clone()).map_err(|error| TemplateFault::of(&error, &self.text))?;
        let mut text = Bounded { bytes: Vec::new(), most };
        budget::start(divisor);
        // Tera panics on numbers that JSON cannot represent.
        let rendered = unwound(|| Ok(self.tera.render_to(NAME, &context, &mut text)));
        rendered
            .map_err(|panic| TemplateFault { line: None, message: panic.to_string() })?
            .map_err(|error| TemplateFault::of(&error, &self.text))?;
        String::from_utf8(text.bytes).map_err(|error| TemplateFault { line: None, message: error.to_string() })
    }
}

/// `range(end = 5, start = 0, step_by = 1)`: the numbers from `start` to `end`, without `end`.
fn range(arguments: &HashMap<String, Json>) -> tera::Result<Json> {
    let number = |name: &str, default: Option<u64>| match (arguments.get(name), default) {
        (Some(value), _) => value.as_u64().ok_or_else(|| {
            tera::Error::msg(format!("`range` takes an integer of at least 0 for `{name}`, not {value}"))
        }),
        (None, Some(default)) => Ok(default),
        (None, None) => Err(tera::Error::msg(format!("`range` needs `{name}`"))),
    };
    let (start, end, step) = (number("start", Some(0))?, number("end", None)?, number("step_by", Some(1))?);
    if step == 0 {
        return Err(tera::Error::msg("`range` takes a `step_by` of at least 1"));
    }
    if start > end {
        return Err(tera::Error::msg(format!("`range` counts upwards: `start` is {start}, and `end` is {end}")));
    }
    let count = (end - start).div_ceil(step);
    if count > TEMPLATE_RANGE.most {
        let most = TEMPLATE_RANGE.most;
        let message = format!("`range` up to {end} gives {count} numbers, more than {most}: count in nested loops");
        return Err(tera::Error::msg(message));
    }
    budget::steps(count)?;
    Ok((0..count).map(|i| start + i * step).collect())
}

/// A text buffer with a maximum size, bytes.
struct Bounded {
    bytes: Vec<u8>,
    most: usize,
}

impl Write for Bounded {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.bytes.len() + bytes.len() > self.most {
            let message = format!("the text is longer than {} bytes: write more and smaller files", self.most);
            return Err(io::Error::other(message));
        }
        self.bytes.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
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

impl TemplateFault {
    fn of(error: &tera::Error, text: &str) -> Self {
        // The outermost message only states that rendering or parsing failed.
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

    fn of_unknown(unknown: &Unknown, of: &str, text: &str) -> Self {
        let Unknown { variable, missing, parent, known } = unknown;
        let known = listing(known.iter().map(String::as_str));
        let message = match parent {
            None => format!("unknown variable `{missing}`: {of} has {known}; products must be listed in `include`"),
            Some(parent) => format!("unknown field `{missing}`: the fields of `{parent}` are {known}"),
        };
        Self { line: line_of(variable, text), message }
    }

    /// Converts the fault to an error in a file.
    pub fn into_error(self, file: &str) -> Error {
        let error = Error::new(self.message).in_file(file);
        match self.line {
            Some(line) => error.at_line(line),
            None => error,
        }
    }
}

/// The first line that contains a variable, from 1.
fn line_of(variable: &str, text: &str) -> Option<usize> {
    let part = |letter: char| letter.is_ascii_alphanumeric() || matches!(letter, '_' | '.');
    let whole = |&(at, _): &(usize, &str)| {
        !text[..at].ends_with(part) && !text[at + variable.len()..].starts_with(|c| part(c) || c == '[')
    };
    let (at, _) = text.match_indices(variable).find(whole)?;
    Some(text[..at].matches('\n').count() + 1)
}

/// The line that a message of Tera refers to, and the message on one line without the excerpt of the template. Tera's
/// errors have no position, so the text of its messages is parsed, in this function only.
fn locate(message: &str, text: &str) -> (Option<usize>, String) {
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    // The parser prints the excerpt between ` --> 3:14` and `  = `, after which the message begins.
    let parser = message.split_once("--> ").and_then(|(_, rest)| {
        let line = rest.split_once(':')?.0.trim().parse().ok()?;
        Some((line, rest.split_once("\n  = ")?.1))
    });
    if let Some((line, message)) = parser {
        return (Some(line), one_line(message));
    }
    // The renderer quotes unknown names. The line is the first that contains a quoted name.
    let quoted = message.split(['`', '\'']).skip(1).step_by(2).filter(|quoted| !quoted.is_empty() && *quoted != NAME);
    let mut lines = quoted.filter_map(|quoted| text.lines().position(|line| line.contains(quoted)));
    (lines.next().map(|line| line + 1), one_line(&message.replace(&format!(" while rendering '{NAME}'"), "")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn fault(text: &str) -> TemplateFault {
        let render = CheckedTemplate::new(text).and_then(|template| template.render(&json!({ "a": 1, "f": 0.5 })));
        render.expect_err("a fault")
    }

    #[test]
    fn faults_name_the_line() {
        // The parser reports the position where it stops: at the word after the unclosed bracket.
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
        assert!(fault.message.contains("the function `get_env` does not exist"), "{fault:?}");
    }

    #[test]
    fn numbers_are_padded_and_nothing_is_escaped() {
        let template = CheckedTemplate::new("{{ a | pad(width=6) }} {{ a | pad }} {{ t }}").expect("parses");
        assert_eq!(template.render(&json!({ "a": 42, "t": "<&>" })).expect("renders"), "000042 0042 <&>");
    }

    #[test]
    fn ranges_are_as_teras_up_to_a_limit() {
        let ours = |text: &str| CheckedTemplate::new(text).expect("parses").render(&json!({})).expect("renders");
        for arguments in
            ["end=4", "start=2, end=9", "end=10, step_by=3", "start=1, end=10, step_by=3", "start=5, end=5"]
        {
            let text = format!("{{% for i in range({arguments}) %}}{{{{ i }}}} {{% endfor %}}");
            let theirs = Tera::one_off(&text, &Context::new(), false).expect("renders");
            assert_eq!(ours(&text), theirs, "{arguments}");
        }
        assert_eq!(ours("{{ range(end=1000000) | length }}"), "1000000");
        assert_eq!(ours("{{ range(end=9223372036854775807, step_by=4611686018427387904) | length }}"), "2");
    }

    #[test]
    fn endless_ranges_are_refused() {
        for (arguments, says) in [
            ("end=100000000000", "`range` up to 100000000000 gives 100000000000 numbers, more than 1000000"),
            ("start=1, end=1000002", "gives 1000001 numbers, more than 1000000"),
            ("end=3, step_by=0", "`step_by` of at least 1"),
            ("start=3, end=2", "`start` is 3, and `end` is 2"),
            ("end=f", "an integer of at least 0 for `end`, not 0.5"),
            ("start=1", "`range` needs `end`"),
        ] {
            let fault = fault(&format!("one\n{{% for i in range({arguments}) %}}{{% endfor %}}"));
            assert!(fault.line == Some(2) && fault.message.contains(says), "{arguments}: {fault:?}");
        }
    }

    #[test]
    fn budgets_change_no_text() {
        let context =
            json!({ "a": 1, "f": 0.5, "t": "x<y", "list": [3, 1, 2], "of": { "k": [1], "l": [] }, "none": null });
        for text in [
            "{% set s = t ~ a ~ f ~ 'z' %}{{ s }}{{ s | upper | replace(from='X', to='yy') }}",
            "{{ t ~ t ~ t ~ t ~ t ~ t ~ t ~ t ~ t ~ t ~ t ~ t ~ t ~ t ~ t ~ a ~ t ~ f ~ 'q' ~ 7 }}",
            "{% for i in list %}{{ loop.index }}:{{ i * 2 }}{% if not loop.last %}, {% endif %}{% endfor %}",
            "{% for key, value in of %}{{ key }}={{ value | length }}{% for v in value %}[{{ v }}]{% else %}-{% endfor %};{% endfor %}",
            "{% for c in t %}({{ c }}){% endfor %}{% for x in [t, 'b', a] %}<{{ x }}>{% endfor %}",
            "{% macro m(x, y='d') %}{{ x }}{% for i in range(end=3) %}{{ i }}{{ y }}{% endfor %}{% endmacro %}{{ self::m(x=t) }}|{{ self::m(x=a, y=f) | upper }}",
            "{% filter upper %}{{ t }} plain {% for i in list %}{{ i }}{% endfor %}{% endfilter %}",
            "{{ missing | default(value='d') }}{{ none | default(value=list) | join(sep='-') }}{% if missing %}1{% else %}0{% endif %}",
            "{% if list | length > 2 and not missing %}{{ list | sort | first }}{% elif a in list %}x{% endif %}",
            "{% block b %}{{ t }}{% endblock %}{% set x = [a, t, f] %}{{ x }}{{ x | json_encode }}{% if a in list %}1{% endif %}{% if t is containing('x') %}2{% endif %}",
            "{% for i in list %}{% if i == 1 %}{% continue %}{% endif %}{{ i }}{% break %}{% endfor %}{{ f | round }}{{ 7 % 4 }}",
            "{% set_global g = 0 %}{% for i in list %}{% set_global g = g + i %}{% endfor %}{{ g }}{{ t | split(pat='<') | join(sep='+') }}",
        ] {
            let plain = CheckedTemplate::new(text).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
            let limited = CheckedTemplate::new(text).and_then(CheckedTemplate::limited).expect("parses");
            let want = plain.render(&context).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
            assert_eq!(limited.render(&context).unwrap_or_else(|fault| panic!("{text}: {fault:?}")), want, "{text}");
        }
    }

    #[test]
    fn templates_that_never_end_are_refused() {
        let doubling = "{% set_global s = 'xxxxxxxxxx' %}{% for i in range(end=60) %}{% set_global s = s ~ s %}{% endfor %}{{ s }}";
        let many = "{% set s = 'xxxxxxxxxx' %}".to_owned() + &"{% set s = s ~ s %}".repeat(40);
        let wide = "{% set s = 'xxxxxxxxxx' %}".to_owned()
            + &"{% set s = s ~ s ~ s ~ s ~ s ~ s ~ s ~ s ~ s ~ s ~ s ~ s ~ s %}".repeat(9);
        let list = "{% set_global s = [1, 2] %}{% for i in range(end=60) %}{% set_global s = [s, s] %}{% endfor %}";
        let replaced = "{% set_global s = 'aaaaaaaa' %}{% for i in range(end=60) %}{% set_global s = s | replace(from='a', to=s) %}{% endfor %}";
        let joined = "{% set_global s = 'aaaaaaaa' %}{% for i in range(end=60) %}{% set_global s = range(end=100) | join(sep=s) %}{% endfor %}";
        let section = "{% macro m() %}{% for i in range(end=1000) %}{% for j in range(end=1000) %}TEXT{% endfor %}{% endfor %}{% endmacro %}{{ self::m() }}".replace("TEXT", &"some text".repeat(1000));
        let filtered = "{% filter upper %}{% for i in range(end=1000) %}{{ t }}{{ t }}{{ t }}{% for j in range(end=9) %}TEXT{% endfor %}{% endfor %}{% endfilter %}".replace("TEXT", &"abcdefghijkl".repeat(1000));
        let letters = "{% set s = range(end=9000) | join(sep='abcdef') %}{% for c in s %}{% for d in s %}{% endfor %}{% endfor %}";
        let aliased = "{% set s = range(end=9000) | join(sep='abcdef') %}{% for x in [s] %}{% for c in x %}{% endfor %}{% endfor %}";
        for (text, says) in [
            (doubling, "one value that a template"),
            (many.as_str(), "one value that a template"),
            (wide.as_str(), "one value that a template"),
            (list, "one value that a template"),
            (replaced, "one value that a template"),
            (joined, "one value that a template"),
            (&section, "one value that a template"),
            (&filtered, "one value that a template"),
            (letters, "letter by letter"),
            (aliased, "letter by letter"),
        ] {
            let limited = CheckedTemplate::new(text).and_then(CheckedTemplate::limited).expect("parses");
            let fault = limited.render_at_most(&json!({ "t": "x" }), 1 << 20, 64).expect_err("refused");
            assert!(fault.message.contains(says), "{text}: {fault:?}");
        }
        for (text, says) in [
            ("{% for i in range(end=1000) %}{% for j in range(end=1000) %}{% endfor %}{% endfor %}", "turns of loops"),
            (
                "{% set s = range(end=2500) | join(sep='abcdef') %}{% for i in range(end=300) %}{% set t = s ~ i %}{% endfor %}",
                "all values",
            ),
        ] {
            let limited = CheckedTemplate::new(text).and_then(CheckedTemplate::limited).expect("parses");
            let fault = limited.render_at_most(&json!({}), 1 << 20, 1000).expect_err("refused");
            assert!(fault.message.contains(says), "{text}: {fault:?}");
        }
    }

    #[test]
    fn texts_that_a_loop_leaves_early_are_closed() {
        let context = json!({ "t": "x".repeat(10_000) });
        // In a section, Tera accepts these words only in the `else` of an empty loop.
        let section =
            "{% filter upper %}{{ t }}{% for j in range(end=0) %}{% else %}{% WORD %}{% endfor %}{% endfilter %}";
        let after = "{% for i in range(end=100) %}{% set s = t ~ i %}{% endfor %}";
        for text in [
            format!("{{% for i in range(end=100) %}}{section}{{% endfor %}}"),
            format!("{{% for i in range(end=1) %}}{section}{{% endfor %}}{after}"),
            // Nested sections, and a loop that ends in the `else` of a nested loop.
            format!("{{% for i in range(end=1) %}}{{% filter trim %}}{section}{{% endfilter %}}{{% endfor %}}{after}"),
            format!(
                "{{% for i in range(end=1) %}}{{% for k in range(end=0) %}}{{% else %}}{section}{{% endfor %}}{{% endfor %}}{after}"
            ),
            format!(
                "{{% macro m(t) %}}{{% for i in [1, 2] %}}{section}{{% endfor %}}{{% endmacro %}}{{% for i in range(end=50) %}}{{{{ self::m(t=t) }}}}{{% endfor %}}"
            ),
        ] {
            for word in ["break", "continue"] {
                let text = text.replace("WORD", word);
                let limited = CheckedTemplate::new(&text).and_then(CheckedTemplate::limited).expect("parses");
                // The limits are then 64 KiB for a value and 4 MiB for all values together.
                limited.render_at_most(&context, 4 << 20, 1024).unwrap_or_else(|fault| panic!("{text}: {fault:?}"));
            }
        }
        // A section around a loop stays open, and a section that is too long is refused in every iteration.
        for text in [
            "{% filter upper %}{% for i in range(end=9) %}{{ t }}{% continue %}{% endfor %}{% endfilter %}",
            "{% for i in range(end=2) %}{% filter upper %}{% for j in range(end=9) %}{{ t }}{% break %}{% endfor %}{% for j in range(end=9) %}{{ t }}{% endfor %}{% endfilter %}{% endfor %}",
        ] {
            let limited = CheckedTemplate::new(text).and_then(CheckedTemplate::limited).expect("parses");
            let fault = limited.render_at_most(&context, 4 << 20, 1024).expect_err("refused");
            assert!(fault.message.contains("one value that a template"), "{text}: {fault:?}");
        }
    }

    #[test]
    fn templates_do_not_call_what_counts_them() {
        for (text, name) in [
            ("one\n{{ __close() }}", "__close"),
            ("one\n{% if __open() == '' %}{% endif %}", "__open"),
            ("one\n{{ 'a' ~ __leave(loop_number=0) }}", "__leave"),
            ("one\n{{ 'a' | upper | __made }}", "__made"),
            ("one\n{% filter __made %}a{% endfilter %}", "__made"),
        ] {
            let fault = CheckedTemplate::checked(text, "a file", &BTreeMap::new()).err().expect("refused");
            assert!(fault.line == Some(2) && fault.message.contains(&format!("`{name}`")), "{text}: {fault:?}");
        }
    }

    #[test]
    fn calls_without_end_of_macros_are_counted() {
        let mut text = "{% macro m0() %}{% endmacro %}".to_owned();
        for depth in 1..60 {
            let call = format!("{{{{ self::m{}() }}}}", depth - 1);
            text += &format!("{{% macro m{depth}() %}}{call}{call}{{% endmacro %}}");
        }
        text += "{{ self::m59() }}";
        let limited = CheckedTemplate::new(&text).and_then(CheckedTemplate::limited).expect("parses");
        let fault = limited.render_at_most(&json!({}), 1 << 20, 1000).expect_err("refused");
        assert!(fault.message.contains("turns of loops and calls of macros"), "{fault:?}");
    }

    #[test]
    fn text_is_bounded() {
        let template = CheckedTemplate::new("one\n{% for i in range(end=9) %}ab{% endfor %}").expect("parses");
        let render = |most| template.render_at_most(&json!({}), most, 1);
        assert_eq!(render(22).expect("fits"), format!("one\n{}", "ab".repeat(9)));
        let fault = render(21).expect_err("too long");
        assert!(fault.message.contains("longer than 21 bytes"), "{fault:?}");
    }
}
