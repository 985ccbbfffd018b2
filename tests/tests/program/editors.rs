//! The schema completes, hovers and validates in the language servers of editors: taplo (Helix, Neovim and others), its
//! build for Node (VS Code's Even Better TOML), and tombi (VS Code, Zed, Neovim).
//!
//! The tests run the real servers, with limits of memory and time: a schema in another form once sent taplo into an
//! endless loop. `--nocapture` prints the answers of each server.

use crate::support::language_server::Server;
use crate::support::{root, skip};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;
use syntable_model::registry::{Entry, Registry, Slot};
use syntable_program as _;
use syntable_recipe::{BUILTINS, Builtin, Overrides};
use syntable_testing::tools::skip_slow_tool;

/// Starts all installed servers.
fn servers(folder: &Path) -> Vec<Server> {
    let node = root().join("tests/taplo_server.cjs");
    let node = node.to_str().expect("UTF-8");
    // Node reserves gigabytes of address space for the memory of a module, which cannot grow beyond 4 GiB.
    let known: [(&str, &[&str], u64); 3] = [
        ("taplo", &["taplo", "lsp", "stdio"], 4 << 10),
        ("Even Better TOML", &["node", node], 64 << 10),
        ("tombi", &["tombi", "lsp"], 4 << 10),
    ];
    let mut found = Vec::new();
    for (name, command, mebibytes) in known {
        match Server::start(name, command, mebibytes, folder) {
            Some(server) => found.push(server),
            None => {
                let skip = if name == "taplo" { skip_slow_tool } else { skip };
                skip(&format!("the language server of {name} (`{}`)", command.join(" ")));
            }
        }
    }
    found
}

/// Servers that complete and show the options of all kinds of a slot, not only of the kind that `kind` names: taplo
/// does not evaluate conditions, and includes every member of an `anyOf`.
const TAKES_ALL_KINDS: [&str; 2] = ["taplo", "Even Better TOML"];

/// Servers that show the documentation of an element for the key of its list: taplo treats the key as a part of the
/// element.
const SHOWS_ELEMENTS: [&str; 2] = TAKES_ALL_KINDS;

/// Servers that mark the header, or every line, of a table for an unknown option: older taplo.
const MARKS_WHOLE_TABLES: [&str; 1] = ["Even Better TOML"];

/// One row of the printed table: the place, and the answer of each server.
#[derive(Default)]
struct Table(BTreeMap<String, Vec<String>>);

impl Table {
    fn add(&mut self, place: &str, server: &Server, said: &str) {
        let said: String = said.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(100).collect();
        self.0.entry(place.to_owned()).or_default().push(format!("  {:17} {said}", server.name));
    }
}

impl Drop for Table {
    fn drop(&mut self) {
        for (place, said) in &self.0 {
            println!("{place}\n{}", said.join("\n"));
        }
    }
}

fn workspace() -> (tempfile::TempDir, Value) {
    let folder = tempfile::tempdir().expect("a folder");
    let registry = Registry::linked().expect("no clash");
    std::fs::write(folder.path().join("recipe.schema.json"), syntable_recipe::schema_text(&registry))
        .expect("writable");
    (folder, syntable_recipe::schema(&registry))
}

fn labels(found: &[(String, String)]) -> Vec<&str> {
    found.iter().map(|(label, _)| label.as_str()).collect()
}

/// A separate document for each question.
struct Documents<'f>(&'f Path, usize);

impl Documents<'_> {
    fn uri(&mut self) -> String {
        self.1 += 1;
        format!("file://{}/{}.toml", self.0.display(), self.1)
    }
}

const DIRECTIVE: &str = "#:schema ./recipe.schema.json\n";

/// In the table of every kind of every slot, all options of the kind complete, and the first one has its hover text.
#[test]
fn every_kind_completes_and_hovers() {
    let (folder, schema) = workspace();
    let registry = Registry::linked().expect("no clash");
    let mut table = Table::default();
    for server in &mut servers(folder.path()) {
        let mut documents = Documents(folder.path(), 0);
        for slot in Slot::ALL {
            for entry in registry.of_slot(slot) {
                let kind = entry.kind;
                let place = format!("{slot}.{kind}");
                let options = schema["definitions"][&place]["properties"].as_object().expect("options");
                let wanted: Vec<String> = options.keys().filter(|name| *name != "kind").cloned().collect();
                let header = format!("{}\nkind = \"{kind}\"\n", slot.header("mine"));
                let text = format!("{DIRECTIVE}{header}|\n");
                let found = server.completions(&documents.uri(), &text, &wanted);
                let offered = labels(&found);
                let missing: Vec<&String> =
                    wanted.iter().filter(|wanted| !offered.contains(&wanted.as_str())).collect();
                assert!(missing.is_empty(), "{}: {place} does not complete {missing:?}, but {offered:?}", server.name);
                if !TAKES_ALL_KINDS.contains(&server.name) {
                    let foreign = offered.iter().find(|label| **label != "$key" && !options.contains_key(**label));
                    assert_eq!(foreign, None, "{}: {place} completes an option of another kind", server.name);
                }
                table.add(&format!("{place} completes"), server, &offered.join(" "));

                let body = usual(entry, options);
                let of_list = |name: &str| body[name].is_array() && SHOWS_ELEMENTS.contains(&server.name);
                let Some(option) = body.keys().find(|name| !of_list(name)) else { continue };
                let meaning = options[option]["description"].as_str().expect("described");
                let meaning = meaning.lines().next().unwrap_or_default();
                // The first letter, a cursor, and the remaining letters.
                let cursor = format!("{}|{} =", &option[..1], &option[1..]);
                let body = format!("\n{body}").replacen(&format!("\n{option} ="), &format!("\n{cursor}"), 1);
                let text = format!("{DIRECTIVE}{header}{body}");
                let shown = server.hover(&documents.uri(), &text, meaning);
                assert!(shown.contains(meaning), "{}: {place}.{option} shows {shown:?}\n{text}", server.name);
                if !TAKES_ALL_KINDS.contains(&server.name) {
                    let once = shown.matches(meaning).count() == 1 && !shown.contains(slot.doc());
                    assert!(once, "{}: {place}.{option} shows more than its meaning: {shown:?}", server.name);
                }
                table.add(&format!("{place} hovers"), server, &shown);
            }
        }
    }
}

/// The usual options of a kind: the options of its example, or else the first option with a default. Only scalars and
/// arrays, which have their own lines.
fn usual(entry: &Entry, options: &serde_json::Map<String, Value>) -> toml::Table {
    let mut body: toml::Table = toml::from_str(entry.example).expect("an example is TOML");
    if body.is_empty() {
        let default = |(name, option): (&String, &Value)| {
            Some((name.clone(), toml::Value::try_from(option.get("default")?).ok()?))
        };
        body.extend(options.iter().find_map(default));
    }
    let on_a_line = |value: &toml::Value| !value.is_table();
    body.retain(|_, value| on_a_line(value) && value.as_array().is_none_or(|items| items.iter().all(on_a_line)));
    body
}

/// A position in a recipe, marked by `|`, the required completions there, and words of the first one's documentation.
type Completion = (&'static str, &'static str, &'static [&'static str], &'static str);

const COMPLETIONS: [Completion; 20] = [
    ("the recipe", "|\n", &["dataset", "extends", "write"], "Name, seed and size of the dataset"),
    ("[dataset]", "[dataset]\n|\n", &["scenes", "seed", "views_per_scene"], "Number of scenes"),
    ("[dataset], half a word", "[dataset]\nsce|\n", &["scenes"], "Number of scenes"),
    ("kind of [[place]]", "[[place]]\nkind = \"|\"\n", &["\"drop_box\"", "\"room\""], "Draws objects and places them"),
    ("kind of [render]", "[render]\nkind = |\n", &["\"cpu_path\""], "Path tracing"),
    ("kind of [assets.mine]", "[assets.mine]\nkind = \"|\"\n", &["\"household\"", "\"mesh_folder\""], "objects"),
    ("[[place]], half a word", "[[place]]\nkind = \"drop_box\"\ncou|\n", &["count"], "Number of objects"),
    (
        "an enum",
        "[[place]]\nkind = \"drop_box\"\nrotation = |\n",
        &["\"uniform_so3\""],
        "Distribution of initial rotations",
    ),
    (
        "a distribution",
        "[[lights]]\nkind = \"sphere_lights\"\nsize_m = { | }\n",
        &["uniform", "normal", "choice"],
        "Uniform",
    ),
    (
        "a form",
        "[[lights]]\nkind = \"sphere_lights\"\nbrightness = { | }\n",
        &["illuminance_lx", "luminous_flux_lm"],
        "",
    ),
    ("a table in a table", "[sensor.rgb_camera.noise]\n|\n", &["iso", "read_noise_e"], "ISO sensitivity"),
    (
        "a table in a stage of a list",
        "[[place]]\nkind = \"drop_box\"\nmaterial = { | }\n",
        &["from", "probability"],
        "",
    ),
    ("the table of a kind", "[write.png]\n|\n", &["include", "depth_scale_mm"], "Products to write"),
    ("a header", "[write.|]\n", &["write.png"], "Writes images and masks as PNG files"),
    ("the first product", "[write.png]\ninclude = [|]\n", &["\"rgb\"", "\"depth\""], "Developed image"),
    (
        "a product in quotes",
        "[write.png]\ninclude = [\"|\"]\n",
        &["\"depth\"", "\"visible_mask\""],
        "Distance along the optical axis",
    ),
    (
        "the next product",
        "[write.mine]\nkind = \"exr\"\ninclude = [\"rgb\", \"|\"]\n",
        &["\"normal\"", "\"depth\""],
        "",
    ),
    ("inherited [render]", "extends = \"a.toml\"\n[render]\n|\n", &["samples_per_pixel", "kind"], "Paths per pixel"),
    ("inherited [camera]", "extends = \"a.toml\"\n[camera]\n|\n", &["resolution", "kind"], ""),
    ("inherited [assets.mine]", "extends = \"a.toml\"\n[assets.mine]\n|\n", &["root", "families", "kind"], "older"),
];

#[test]
fn places_in_recipes_complete() {
    let (folder, _) = workspace();
    let mut table = Table::default();
    for server in &mut servers(folder.path()) {
        let mut documents = Documents(folder.path(), 0);
        for (place, text, wanted, words) in COMPLETIONS {
            // tombi completes one word of a header at a time.
            let short = |label: &str| label.rsplit('.').next().unwrap_or(label).to_owned();
            let in_header = text.contains("|]\n") && text.starts_with('[') && !text.contains('=');
            let wanted: Vec<String> = match server.name {
                "tombi" if in_header => wanted.iter().map(|label| short(label)).collect(),
                _ => wanted.iter().map(|label| (*label).to_owned()).collect(),
            };
            let found = server.completions(&documents.uri(), &format!("{DIRECTIVE}{text}"), &wanted);
            for wanted in &wanted {
                let offered = labels(&found);
                assert!(offered.contains(&wanted.as_str()), "{}: {place}: no {wanted} in {offered:?}", server.name);
            }
            let documented = found.iter().any(|(label, shown)| *label == wanted[0] && shown.contains(words));
            assert!(documented, "{}: {place}: `{}` is not shown as {words:?}: {found:?}", server.name, wanted[0]);
            table.add(place, server, &labels(&found).join(" "));
        }
    }
}

/// Maximum processor time of a completion after a change of the recipe, its validation included, in seconds.
const COMPLETION_SECONDS: f64 = 0.3;

/// Maximum size of the schema, which `new recipe` writes beside every recipe, bytes.
const SCHEMA_BYTES: usize = 380_000;

/// Completions at the end of a table take little time in whole recipes, too.
#[test]
fn completions_are_fast_in_whole_recipes() {
    let (folder, _) = workspace();
    let schema = std::fs::metadata(folder.path().join("recipe.schema.json")).expect("written").len();
    assert!(schema < SCHEMA_BYTES as u64, "the schema has {schema} bytes");
    let registry = Registry::linked().expect("no clash");
    let quickstart = Builtin::find("quickstart").expect("a built-in recipe").source();
    let (recipe, _) = syntable_recipe::load(&registry, quickstart, &Overrides::of_process(Vec::new())).expect("valid");
    assert!(recipe.resolved.lines().count() >= 150, "{}", recipe.resolved);
    let shipped = BUILTINS.iter().map(|builtin| (builtin.name, builtin.text));
    let recipes: Vec<(&str, &str)> = shipped.chain([("quickstart, resolved", recipe.resolved.as_str())]).collect();
    let mut table = Table::default();
    for server in &mut servers(folder.path()) {
        let mut documents = Documents(folder.path(), 0);
        for (name, text) in &recipes {
            let body: String =
                text.lines().filter(|line| !line.starts_with("#:")).map(|line| format!("{line}\n")).collect();
            let text = format!("{DIRECTIVE}{body}\n[write.png]\n|\n");
            let wanted = ["include".to_owned()];
            // The first completion also reads the schema.
            let _ = server.completions(&documents.uri(), &text, &wanted);
            let mut completion = || {
                let start = server.cpu_seconds();
                let found = server.completions(&documents.uri(), &text, &wanted);
                assert!(labels(&found).contains(&"include"), "{}: {name}: {found:?}", server.name);
                server.cpu_seconds().zip(start).map(|(end, start)| end - start)
            };
            // A server may collect garbage meanwhile.
            let Some(seconds) = (0..3).filter_map(|_| completion()).reduce(f64::min) else { continue };
            assert!(seconds <= COMPLETION_SECONDS, "{}: {seconds:.2} s of CPU for a completion in {name}", server.name);
            table.add(name, server, &format!("{seconds:.2} s"));
        }
    }
}

/// A position in a recipe, marked by `|`, and words that must be shown there.
const HOVERS: [(&str, &str, &str); 11] = [
    ("[dataset]", "[data|set]\nscenes = 1\n", "Name, seed and size of the dataset"),
    ("an option of [dataset]", "[dataset]\nsce|nes = 1\n", "Number of scenes"),
    ("a section", "[ren|der]\nkind = \"cpu_path\"\n", "Renders images and per-pixel labels"),
    ("`kind` in a list", "[[place]]\nki|nd = \"drop_box\"\n", "Draws objects and places them"),
    ("the word of `kind`", "[[place]]\nkind = \"dro|p_box\"\n", "Draws objects and places them"),
    ("a number in a list", "[[place]]\nkind = \"drop_box\"\ncou|nt = 3\n", "Number of objects"),
    (
        "a word in a list",
        "[[place]]\nkind = \"drop_box\"\nrotation = \"unif|orm_yaw\"\n",
        "Distribution of initial rotations",
    ),
    (
        "a form",
        "[[lights]]\nkind = \"sphere_lights\"\nbrightness = { illumi|nance_lx = 3 }\n",
        "Unoccluded illuminance",
    ),
    ("a table in a table", "[sensor.rgb_camera.noise]\nis|o = 100\n", "ISO sensitivity"),
    ("a product", "[write.png]\ninclude = [\"rgb\", \"dep|th\"]\n", "Distance along the optical axis"),
    ("inherited [render]", "extends = \"a.toml\"\n[render]\nsamples|_per_pixel = 3\n", "Paths per pixel"),
];

#[test]
fn places_in_recipes_hover() {
    let (folder, _) = workspace();
    let mut table = Table::default();
    for server in &mut servers(folder.path()) {
        let mut documents = Documents(folder.path(), 0);
        for (place, text, words) in HOVERS {
            let shown = server.hover(&documents.uri(), &format!("{DIRECTIVE}{text}"), words);
            assert!(shown.contains(words), "{}: {place} shows {shown:?}", server.name);
            table.add(place, server, &shown);
        }
        // Only the word itself, not the meanings of all products.
        let product = format!("{DIRECTIVE}[write.png]\ninclude = [\"dep|th\"]\n");
        let shown = server.hover(&documents.uri(), &product, "Distance along the optical axis");
        assert!(!shown.contains("Amodal mask"), "{}: {shown}", server.name);
    }
}

/// Recipes, and the line of their mistake; 0 for valid recipes.
const DIAGNOSTICS: [(&str, u64); 18] = [
    ("extends = \"a.toml\"\n[[place]]\nkind = \"dropbox\"\n", 4),
    ("extends = \"a.toml\"\n[[place]]\nkind = \"drop_box\"\ncuont = 3\n", 5),
    ("extends = \"a.toml\"\n[[place]]\nkind = \"drop_box\"\ncount = -3\n", 5),
    ("extends = \"a.toml\"\n[[place]]\nkind = \"drop_box\"\ncount = { integers = [-3, 5] }\n", 5),
    ("extends = \"a.toml\"\n[[place]]\nkind = \"drop_box\"\ncount = { integers = [1, 5] }\n", 0),
    ("extends = \"a.toml\"\n[[lights]]\nkind = \"sphere_lights\"\ntemperature_k = -100\n", 5),
    ("extends = \"a.toml\"\n[[lights]]\nkind = \"sphere_lights\"\ntemperature_k = { uniform = [100, 5000] }\n", 5),
    ("extends = \"a.toml\"\n[[lights]]\nkind = \"sphere_lights\"\ntemperature_k = { uniform = [2000, 5000] }\n", 0),
    ("extends = \"a.toml\"\n[[lights]]\nkind = \"sphere_lights\"\ntemperature_k = {}\n", 5),
    ("extends = \"a.toml\"\n[render]\nsamples_per_pixel = \"many\"\n", 4),
    ("extends = \"a.toml\"\n[render]\nsamples = 3\n", 4),
    ("extends = \"a.toml\"\n[render]\nsamples_per_pixel = 3\n", 0),
    ("extends = \"a.toml\"\n[assets.mine]\nvariants_per_family = 3\n", 0),
    ("extends = \"a.toml\"\n[assets.mine]\nvariants = 3\n", 4),
    ("extends = \"a.toml\"\n[write.png]\ninclude = [\"rgb\", \"coverage (canvas 3)\", \"of_a_plugin\"]\n", 0),
    ("extends = \"a.toml\"\n[write.png]\ninclude = \"rgb\"\n", 4),
    ("extends = \"a.toml\"\n[write.png]\ninclude = []\n", 4),
    ("extends = \"a.toml\"\n[write.mine]\nkind = \"png\"\nincludes = [\"rgb\"]\n", 5),
];

#[test]
fn mistakes_are_shown_at_their_lines() {
    let (folder, _) = workspace();
    for server in &mut servers(folder.path()) {
        let mut documents = Documents(folder.path(), 0);
        for (text, line) in DIAGNOSTICS {
            let found = server.diagnostics(&documents.uri(), &format!("{DIRECTIVE}{text}"), line > 0);
            let mut lines: Vec<u64> = found.iter().map(|(line, _)| *line).collect();
            lines.dedup();
            let unknown = found.iter().any(|(_, message)| message.starts_with("Additional properties"));
            if unknown && MARKS_WHOLE_TABLES.contains(&server.name) {
                let header = 3;
                assert!(
                    lines.iter().all(|found| (header..=line).contains(found)),
                    "{}: {found:?}\n{text}",
                    server.name
                );
                lines = vec![line];
            }
            let wanted: Vec<u64> = Some(line).filter(|line| *line > 0).into_iter().collect();
            assert_eq!(lines, wanted, "{}: {found:?}\n{text}", server.name);
        }
        let quickstart = std::fs::read_to_string(root().join("recipes/quickstart.toml")).expect("there");
        let body: String = quickstart.lines().skip(1).map(|line| format!("{line}\n")).collect();
        let found = server.diagnostics(&documents.uri(), &format!("{DIRECTIVE}{body}"), false);
        assert!(found.is_empty(), "{}: {found:?}", server.name);
    }
}
