//! Paths in recipes: `${NAME}` and the base of relative paths.

use crate::text::code::Code;
use crate::text::diagnostic::DiagnosticBuilder;
use crate::text::source::{SET, SourceFile, Span};
use std::path::{Component, Path, PathBuf};
use syntable_model::store::is_url;

/// A resolved path, and its form for the resolved recipe.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Resolved {
    /// The path to open, or a URL.
    pub path: PathBuf,
    /// The path as it was written, `${NAME}` kept; relative to the recipe's folder if a recipe that it extends names it.
    pub portable: String,
}

/// Where the recipe is, for paths in the resolved recipe.
#[derive(Debug, Clone, Default)]
pub(crate) struct PathRules {
    /// Folder of the recipe, or the current folder.
    pub home: PathBuf,
    /// Whether the recipe is a resolved one, which may be in a dataset, far from the files that it names. A relative
    /// path that does not exist from its own folder then counts from the current folder.
    pub resolved: bool,
}

/// Resolves a path given in `file` at `span`.
pub(crate) fn resolve(
    text: &str,
    span: &Span,
    file: &SourceFile,
    current_folder: &Path,
    variable: &dyn Fn(&str) -> Option<String>,
    rules: &PathRules,
) -> Result<Resolved, DiagnosticBuilder> {
    let expanded = expand(text, span, variable)?;
    if Path::new(&expanded).is_absolute() || is_url(&expanded) {
        return Ok(Resolved { path: expanded.into(), portable: text.to_owned() });
    }
    if text.starts_with("${") {
        // A relative path in a variable counts from the current folder.
        return Ok(Resolved { path: join(current_folder, &expanded), portable: text.to_owned() });
    }
    let path = join(file.folder(), &expanded);
    let elsewhere = join(current_folder, &expanded);
    let path = if rules.resolved && !path.exists() && elsewhere.exists() { elsewhere } else { path };
    let of_recipe = file.folder() == rules.home || file.name() == SET;
    let portable = match of_recipe {
        true => text.to_owned(),
        false => relative(&rules.home, &join(file.folder(), text)).to_string_lossy().into_owned(),
    };
    Ok(Resolved { path, portable })
}

/// A path to `to` from a folder, by their text alone; `to` itself if they have no common root.
fn relative(from: &Path, to: &Path) -> PathBuf {
    let (from, to) = (normal(from), normal(to));
    let common = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if common == 0 {
        return to.iter().collect();
    }
    let up = std::iter::repeat_n(Component::ParentDir, from.len() - common);
    up.chain(to[common..].iter().copied()).collect()
}

/// The components of a path without `.`, and without `..` where a name precedes it.
fn normal(path: &Path) -> Vec<Component<'_>> {
    path.components().fold(Vec::new(), |mut parts, part| {
        match (part, parts.last()) {
            (Component::CurDir, _) => {}
            (Component::ParentDir, Some(Component::Normal(_))) => {
                parts.pop();
            }
            _ => parts.push(part),
        }
        parts
    })
}

/// Warns about `~` and `$NAME`, which only a shell replaces.
pub(crate) fn odd(text: &str, span: &Span) -> Option<DiagnosticBuilder> {
    let warn = |message: String, label: String| {
        Some(DiagnosticBuilder::warning(Code::OddPath, span.clone(), message).label(label))
    };
    if text == "~" || text.starts_with("~/") {
        return warn("`~` is not replaced in a recipe".into(), format!("write \"${{HOME}}{}\"", &text[1..]));
    }
    let at = text
        .match_indices('$')
        .map(|(at, _)| at)
        .find(|at| text[at + 1..].starts_with(|c: char| c.is_ascii_alphabetic() || c == '_'))?;
    let rest = &text[at + 1..];
    let name = &rest[..rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_')).unwrap_or(rest.len())];
    warn(format!("`${name}` is not replaced in a recipe"), format!("write `${{{name}}}`"))
}

fn expand(text: &str, span: &Span, variable: &dyn Fn(&str) -> Option<String>) -> Result<String, DiagnosticBuilder> {
    let mut out = String::new();
    let mut rest = text;
    while let Some(at) = rest.find("${") {
        out += &rest[..at];
        let inner = &rest[at + 2..];
        let Some(length) = inner.find('}') else {
            return Err(DiagnosticBuilder::error(
                Code::Variable,
                span.clone(),
                format!("`${{` is not closed in \"{text}\""),
            )
            .label("write `${NAME}`"));
        };
        let name = &inner[..length];
        if name.is_empty()
            || name.starts_with(|c: char| c.is_ascii_digit())
            || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        {
            return Err(DiagnosticBuilder::error(
                Code::Variable,
                span.clone(),
                format!("`${{{name}}}` is not the name of an environment variable"),
            )
            .label("names have letters, digits and `_`"));
        }
        match variable(name) {
            Some(value) if !value.is_empty() => out += &value,
            found => {
                let state = if found.is_some() { "empty" } else { "not set" };
                return Err(DiagnosticBuilder::error(
                    Code::Variable,
                    span.clone(),
                    format!("the environment variable `{name}` is {state}"),
                )
                .label("needed here")
                .help(format!("set it for one command: {name}=/path/to/folder syntable …"))
                .help(format!("or for the session: export {name}=/path/to/folder")));
            }
        }
        rest = &inner[length + 1..];
    }
    Ok(out + rest)
}

/// Joins `folder` and `path`, without `.` components.
pub(crate) fn join(folder: &Path, path: &str) -> PathBuf {
    folder.join(path).components().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::text::source::Sources;

    fn check(text: &str, expected: Result<(&str, &str), &str>) {
        check_from("/home/r", text, expected);
    }

    /// Resolves a path of a recipe in /home/r that is extended by one in `home`.
    fn check_from(home: &str, text: &str, expected: Result<(&str, &str), &str>) {
        let sources = Sources::default();
        let file = sources.add("r".into(), "/home/r".into(), String::new());
        let variable = |name: &str| match name {
            "ASSETS" => Some("/data".to_owned()),
            "LOCAL" => Some("../assets".to_owned()),
            "EMPTY" => Some(String::new()),
            _ => None,
        };
        let rules = PathRules { home: home.into(), resolved: false };
        let got = resolve(text, &(1..1), file, Path::new("/work"), &variable, &rules);
        match (got, expected) {
            (Ok(got), Ok((path, portable))) => {
                assert_eq!((got.path.to_str(), got.portable.as_str()), (Some(path), portable), "{text}");
            }
            (Err(got), Err(message)) => assert_eq!(got.message, message),
            (got, _) => panic!("{text}: {got:?}"),
        }
    }

    #[test]
    fn resolves() {
        check("${ASSETS}/gso", Ok(("/data/gso", "${ASSETS}/gso")));
        check("${LOCAL}/gso", Ok(("/work/../assets/gso", "${LOCAL}/gso")));
        check("./a/./b.txt", Ok(("/home/r/a/b.txt", "./a/./b.txt")));
        check("../x_${ASSETS}", Ok(("/home/r/../x_/data", "../x_${ASSETS}")));
        check_from("/home/other", "a/b.txt", Ok(("/home/r/a/b.txt", "../r/a/b.txt")));
        check_from("/home/r/deep/er", "../a", Ok(("/home/r/../a", "../../../a")));
        check_from("/home/r/deep", "a", Ok(("/home/r/a", "../a")));
        check_from("/home", "a", Ok(("/home/r/a", "r/a")));
        check("/abs", Ok(("/abs", "/abs")));
        check("${NOPE}/a", Err("the environment variable `NOPE` is not set"));
        check("${EMPTY}/a", Err("the environment variable `EMPTY` is empty"));
        check("${ASSETS", Err("`${` is not closed in \"${ASSETS\""));
        check("${A B}", Err("`${A B}` is not the name of an environment variable"));
    }

    #[test]
    fn a_resolved_recipe_may_be_far_from_what_it_names() {
        let folder = tempfile::tempdir().expect("a folder");
        let (data, work) = (folder.path().join("data"), folder.path().join("work"));
        for path in ["data/here", "work/here", "work/there"] {
            std::fs::create_dir_all(folder.path().join(path)).expect("writable");
        }
        let sources = Sources::default();
        let file = sources.add("recipe.toml".into(), data.clone(), String::new());
        let path = |text: &str, resolved: bool| {
            let rules = PathRules { home: data.clone(), resolved };
            resolve(text, &(1..1), file, &work, &|_| None, &rules).expect("no variable").path
        };
        assert_eq!((path("here", true), path("there", true)), (data.join("here"), work.join("there")));
        assert_eq!((path("there", false), path("nowhere", true)), (data.join("there"), data.join("nowhere")));
    }

    #[test]
    fn warns_of_shell_habits() {
        let odd = |text: &str| odd(text, &(1..1)).map(|diagnostic| diagnostic.marks[0].1.clone());
        assert_eq!(odd("~/data"), Some("write \"${HOME}/data\"".into()));
        assert_eq!(odd("$ASSETS/x"), Some("write `${ASSETS}`".into()));
        assert_eq!(odd("${ASSETS}/x~"), None);
    }
}
