//! Checks the claims of the pages that a program can verify: links lead to targets, recipes are valid, commands exist.

use crate::support::{fails, ok, root, syntable, text};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use syntable_cli as cli;
use syntable_model::dist::{Dist, IntDist};
use syntable_program as _;

/// All Markdown files below a folder.
fn pages_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("readable") {
        let path = entry.expect("readable").path();
        if path.is_dir() {
            found.extend(pages_below(&path));
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// The pages of the book, and the pages next to code and recipes.
fn all() -> Vec<PathBuf> {
    let mut pages = pages_below(&root().join("book/src"));
    pages.extend([root().join("README.md"), root().join("recipes/syntable-sim/README.md")]);
    pages
}

/// The handwritten pages: all except the generated reference.
fn written() -> Vec<PathBuf> {
    let mut pages = all();
    pages.retain(|page| !page.starts_with(root().join("book/src/reference")));
    assert!(pages.len() >= 15, "{pages:?}");
    pages
}

fn read(page: &Path) -> String {
    fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()))
}

/// Path relative to the root of the checkout.
fn name(page: &Path) -> String {
    page.strip_prefix(root()).expect("below").display().to_string()
}

/// The fenced blocks of a language.
fn fences(text: &str, language: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut open: Option<(bool, String)> = None;
    for line in text.lines() {
        match (&mut open, line.strip_prefix("```")) {
            (None, Some(info)) => open = Some((info == language, String::new())),
            (Some(_), Some(_)) => found.extend(open.take().filter(|(mine, _)| *mine).map(|(_, block)| block)),
            (Some((_, block)), None) => *block += &format!("{line}\n"),
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "a block is not closed");
    found
}

/// A page without its code.
fn prose(text: &str) -> String {
    let outside: Vec<&str> = text.split("```").step_by(2).collect();
    outside.concat().split('`').step_by(2).collect()
}

/// Targets of links and images.
fn targets(text: &str) -> Vec<String> {
    let prose = prose(text);
    let ends = prose.split("](").skip(1).map(|rest| rest.split(')').next().unwrap_or_default().to_owned());
    ends.collect()
}

/// The anchors of headings.
fn anchors(text: &str) -> BTreeSet<String> {
    let outside: Vec<&str> = text.split("```").step_by(2).collect();
    let headings = outside.concat();
    let headings = headings.lines().filter(|line| line.starts_with('#'));
    let slug = |heading: &str| {
        let kept = heading.trim_start_matches('#').trim().to_lowercase();
        kept.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c)).collect::<String>().replace(' ', "-")
    };
    headings.map(slug).collect()
}

#[test]
fn every_page_is_in_the_summary() {
    let source = root().join("book/src");
    let listed: BTreeSet<PathBuf> =
        targets(&read(&source.join("SUMMARY.md"))).into_iter().map(|target| source.join(target)).collect();
    for page in pages_below(&source) {
        assert!(page.ends_with("SUMMARY.md") || listed.contains(&page), "{} is not in SUMMARY.md", name(&page));
    }
}

#[test]
fn links_lead_somewhere() {
    let mut seen = 0;
    let mut broken = Vec::new();
    for page in all() {
        let text = read(&page);
        for target in targets(&text) {
            seen += 1;
            let (path, anchor) = target.split_once('#').map_or((&target[..], None), |(path, a)| (path, Some(a)));
            let file = match path.strip_prefix("https://github.com/syntable/syntable/blob/main/") {
                Some(ours) => root().join(ours),
                None if path.starts_with("https://") => continue,
                None if path.is_empty() => page.clone(),
                None => page.parent().expect("in a folder").join(path),
            };
            if !file.exists() || anchor.is_some_and(|anchor| !anchors(&read(&file)).contains(anchor)) {
                broken.push(format!("{}: {target}", name(&page)));
            }
        }
    }
    assert!(seen > 60, "{seen} links found");
    assert!(broken.is_empty(), "{} links lead nowhere:\n{}", broken.len(), broken.join("\n"));
}

/// A recipe of a page: unchanged if it is complete, otherwise on top of the quickstart recipe.
fn whole(block: &str) -> String {
    let base = root().join("recipes/quickstart.toml").display().to_string();
    let table: toml::Table = block.parse().unwrap_or_else(|error| panic!("not TOML: {error}\n{block}"));
    match (table.contains_key("extends"), table.contains_key("dataset")) {
        (true, _) => block.replace("recipes/quickstart.toml", &base),
        (false, true) => block.to_owned(),
        // Its own steps replace the steps of the base: a table and objects are added.
        (false, false) if table.contains_key("place") && !block.contains("drop_box") => {
            let step = |kind: &str, pool: &str| format!("[[place]]\nkind = \"{kind}\"\nfrom = [\"{pool}\"]\n\n");
            let steps = [step("table", "tables"), step("drop_box", "objects")].concat();
            format!("extends = \"{base}\"\n\n{block}\n{steps}")
        }
        (false, false) => format!("extends = \"{base}\"\n\n{block}"),
    }
}

fn check_distribution(line: &str) {
    let table: toml::Table = line.parse().unwrap_or_else(|error| panic!("{line}: {error}"));
    for value in table.into_iter().map(|(_, value)| value) {
        let sound = value.clone().try_into::<Dist>().is_ok() || value.try_into::<IntDist>().is_ok();
        assert!(sound, "{line}: not a distribution");
    }
}

#[test]
fn recipes_are_sound() {
    let folder = tempfile::tempdir().expect("a folder");
    let programs = root().join("plugins/stages/exec/examples");
    for program in ["darkness.py", "ppm.sh"] {
        fs::copy(programs.join(program), folder.path().join(program)).expect("the program of a recipe");
    }
    let mut seen = 0;
    for page in written() {
        // These options belong to a plugin that the stock program lacks. `third_party.rs` checks them with a program
        // that has it.
        if page.ends_with("plugins.md") {
            continue;
        }
        for block in fences(&read(&page), "toml") {
            seen += 1;
            // A block of single options, one per line, shows possible values: all are distributions.
            if !block.lines().any(|line| line.starts_with('[')) {
                block.lines().for_each(check_distribution);
                continue;
            }
            let recipe = folder.path().join("recipe.toml");
            fs::write(&recipe, whole(&block)).expect("writable");
            // Asset folders do not exist on every machine; everything except their content is checked without them.
            let verb = if block.contains("${") { "plan" } else { "check" };
            let mut command = syntable();
            command.arg(verb).arg(&recipe).env("ASSETS", "/assets").env("OIDN_LIBRARY", "/lib/libOpenImageDenoise.so");
            let said = ok(&mut command);
            let sound = verb == "plan" || said.contains("no errors; ");
            assert!(sound && !said.contains("warning"), "{}\n{block}\n{said}", name(&page));
        }
    }
    assert!(seen >= 15, "{seen} recipes found");
}

/// The words into which a shell would split a command.
fn words(command: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
    for c in command.chars() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None, '\'' | '"') => quote = Some(c),
            (None, ' ') => words.extend(Some(std::mem::take(&mut word)).filter(|word| !word.is_empty())),
            (None, '#' | '>') if word.is_empty() => break,
            _ => word.push(c),
        }
    }
    words.extend(Some(word).filter(|word| !word.is_empty()));
    words
}

/// Arguments of the program in a command; none if the command runs another program.
fn arguments(command: &str) -> Option<Vec<String>> {
    let words = words(command);
    let first: Vec<&str> = words.iter().map(String::as_str).collect();
    match first[..] {
        ["cargo", "run", "--release", "--", ..] => Some(words[4..].to_vec()),
        ["syntable", ..] => Some(words[1..].to_vec()),
        _ => None,
    }
}

/// The program accepts the arguments, the files that they name exist, and the options that they set are known.
fn check_command(page: &str, arguments: &[String]) {
    let line: Vec<String> = std::iter::once("syntable".to_owned()).chain(arguments.iter().cloned()).collect();
    cli::understands(&line).unwrap_or_else(|error| panic!("{page}: {line:?}\n{error}"));
    for named in arguments.iter().filter(|word| word.starts_with("recipes/")) {
        assert!(root().join(named).exists(), "{page} names {named}");
    }
    match arguments[0].as_str() {
        "list" => drop(ok(syntable().args(arguments))),
        "run" | "plan" | "check" if arguments.iter().any(|word| word == "--set") => {
            let mut plan = syntable();
            plan.args(["plan", "recipes/quickstart.toml"]);
            for pair in arguments.windows(2).filter(|pair| ["--set", "--seed", "--views"].contains(&pair[0].as_str())) {
                plan.args(pair);
            }
            ok(&mut plan);
        }
        _ => {}
    }
}

#[test]
fn commands_exist() {
    let mut seen = 0;
    for page in written() {
        for block in fences(&read(&page), "console") {
            for line in block.lines().filter_map(|line| line.strip_prefix("$ ")) {
                for arguments in line.split(" && ").filter_map(arguments) {
                    seen += 1;
                    check_command(&name(&page), &arguments);
                }
            }
        }
    }
    assert!(seen >= 10, "{seen} commands found");
}

#[test]
fn examples_of_the_help_exist() {
    let mut seen = 0;
    for (page, help) in cli::help_pages() {
        for line in help.lines().filter_map(|line| line.strip_prefix("  syntable ")) {
            let command = format!("syntable {}", line.split("  ").next().unwrap_or_default());
            for arguments in command.split(" && ").filter_map(arguments) {
                seen += 1;
                check_command(&page, &arguments);
            }
        }
    }
    assert!(seen >= 12, "{seen} examples found");
}

#[test]
fn a_mistake_looks_as_the_tutorial_shows() {
    let folder = tempfile::tempdir().expect("a folder");
    ok(syntable().args(["new", "recipe"]).arg(folder.path().join("my.toml")));
    let recipe = read(&folder.path().join("my.toml")).replace("\nsamples_per_pixel", "\nsampels_per_pixel");
    fs::write(folder.path().join("my.toml"), recipe).expect("writable");
    let said = fails(syntable().current_dir(folder.path()).args(["check", "my.toml"]), 2);
    let page = read(&root().join("book/src/tutorial.md"));
    let shown = fences(&page, "text");
    assert!(said.starts_with(&shown[0]), "{said}");
}

#[test]
fn recipes_of_the_diagnostics_fail_and_are_mended() {
    // Standard output and standard error of a verb. The asset folders of these recipes do not exist; `plan` does not
    // need them.
    let say = |verb: &str, recipe: &Path| {
        let mut command = syntable();
        command.arg(verb).arg(recipe).env_remove("SCANS").env("HOME", "/home/me");
        text(&command.output().expect("the program starts"))
    };
    let mut seen = 0;
    for entry in fs::read_dir(root().join("tests/fixtures/diagnostics")).expect("readable") {
        let failing = entry.expect("readable").path();
        let code = failing.file_stem().and_then(|stem| stem.to_str()).expect("a name").to_owned();
        if code.ends_with(".fixed") {
            continue;
        }
        seen += 1;
        let said = say("check", &failing);
        assert!(said.contains(&format!("[{code}]")), "{}\n{said}", name(&failing));
        let mended = failing.with_file_name(format!("{code}.fixed.toml"));
        let said = say("plan", &mended);
        assert!(!said.contains("[D0"), "{}\n{said}", name(&mended));
    }
    assert!(seen >= 20, "{seen} failing recipes");
}

#[test]
fn the_page_on_plugins_shows_every_template() {
    let page = root().join("book/src/plugins.md");
    let text = read(&page);
    let included: BTreeSet<PathBuf> = text
        .split("{{#include ")
        .skip(1)
        .map(|rest| page.with_file_name(rest.split("}}").next().unwrap_or_default()).canonicalize().expect("a file"))
        .collect();
    let folder = root().join("core/cli/src/verbs/scaffold/plugins");
    let mut seen = 0;
    for template in fs::read_dir(folder).expect("there").map(|entry| entry.expect("readable").path()) {
        seen += 1;
        let source = template.join("src/lib.rs").canonicalize().expect("a library");
        assert!(included.contains(&source), "{} is not on the page", source.display());
        assert!(text.contains(&format!("`{}`", name(&template).rsplit('/').next().unwrap_or_default())));
    }
    assert!(seen >= 18, "{seen} templates");
}
