//! Refuses templates that would exhaust the stack, since a stack overflow cannot be reported as an error.

use super::fault::TemplateFault;
use std::collections::{BTreeMap, BTreeSet};

/// Maximum nesting of brackets in an expression, and of blocks.
const DEEPEST: usize = 64;

/// Refuses templates that include other templates, since none exist, and templates that nest too deeply for Tera's
/// recursive parser and renderer.
pub fn check(text: &str) -> Result<(), TemplateFault> {
    let mut blocks: usize = 0;
    let mut depth: usize = 0;
    let mut negations: usize = 0;
    let mut within: Option<&str> = None;
    let mut calls: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    let mut rest = text;
    while let Some(at) = rest.find("{%").into_iter().chain(rest.find("{{")).min() {
        let is_tag = rest[at..].starts_with("{%");
        let inner = &rest[at + 2..];
        let end = inner.find(if is_tag { "%}" } else { "}}" }).unwrap_or(inner.len());
        let line = text[..text.len() - rest.len() + at].matches('\n').count() + 1;
        let refuse = |message: &str| Err(TemplateFault { line: Some(line), message: message.to_owned() });
        let expression = &inner[..end];
        if is_tag {
            let mut words = expression.trim_start_matches('-').split_whitespace();
            match words.next().unwrap_or_default() {
                "include" | "extends" | "import" => {
                    return refuse("a template stands alone: it cannot include, extend or import other templates");
                }
                "macro" => {
                    within = words.next().map(|name| name.split('(').next().unwrap_or(name));
                    blocks += 1;
                }
                "if" | "for" | "filter" | "block" | "raw" => blocks += 1,
                word if word.starts_with("end") => {
                    blocks = blocks.saturating_sub(1);
                    if word == "endmacro" {
                        within = None;
                    }
                }
                _ => {}
            }
        }
        for (start, letter) in expression.char_indices() {
            match letter {
                '(' | '[' | '{' => depth += 1,
                ')' | ']' | '}' => depth = depth.saturating_sub(1),
                'n' if expression[start..].starts_with("not ") => negations += 1,
                _ => {}
            }
            if depth > DEEPEST || negations > DEEPEST || blocks > DEEPEST {
                return refuse(&format!("more than {DEEPEST} brackets, blocks or negations are nested"));
            }
        }
        (depth, negations) = (0, 0);
        if let Some(name) = within {
            let called =
                expression.split("self::").skip(1).map(|call| call.split('(').next().unwrap_or_default().trim());
            calls.entry(name).or_default().extend(called);
        }
        rest = &inner[end..];
    }
    match calls.keys().find(|name| reaches_itself(name, &calls)) {
        Some(name) => {
            Err(TemplateFault { line: None, message: format!("the macro `{name}` calls itself without end") })
        }
        None => Ok(()),
    }
}

fn reaches_itself(name: &str, calls: &BTreeMap<&str, BTreeSet<&str>>) -> bool {
    let mut seen = BTreeSet::new();
    let mut open = vec![name];
    while let Some(next) = open.pop() {
        for &called in calls.get(next).into_iter().flatten() {
            if called == name {
                return true;
            }
            if seen.insert(called) {
                open.push(called);
            }
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_never_ends_is_refused() {
        let message = |text: &str| check(text).err().map(|fault| fault.message);
        for text in ["{% include \"template\" %}", "{%- extends 'template' -%}", "{% import \"template\" as t %}"] {
            assert!(message(text).is_some_and(|message| message.contains("stands alone")), "{text}");
        }
        let parentheses = format!("{{{{ {}1{} }}}}", "(".repeat(20_000), ")".repeat(20_000));
        let negations = format!("{{% if {}true %}}{{% endif %}}", "not ".repeat(20_000));
        let blocks = format!("{}{}", "{% if a %}".repeat(20_000), "{% endif %}".repeat(20_000));
        for text in [&parentheses, &negations, &blocks] {
            assert!(message(text).is_some_and(|message| message.contains("nested")));
        }
        let circle = "{% macro a() %}{{ self::b() }}{% endmacro %}{% macro b() %}{{ self::a() }}{% endmacro %}";
        assert!(message(circle).is_some_and(|message| message.contains("calls itself")));
    }

    #[test]
    fn ordinary_templates_pass() {
        for text in [
            "plain",
            "{% for id, box in visible_box %}{{ id }},{{ box | join(sep=\",\") }}\n{% endfor %}",
            "{% macro a(x) %}{{ x }}{% endmacro %}{% macro b() %}{{ self::a(x=1) }}{% endmacro %}{{ self::b() }}",
        ] {
            assert_eq!(check(text), Ok(()), "{text}");
        }
        let many = "{% if not a and not b %}{{ (1 + 2) * (3 + [4][0]) }}{% endif %}".repeat(1000);
        assert_eq!(check(&many), Ok(()));
    }
}
