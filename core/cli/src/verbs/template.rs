//! Templates of `syntable new plugin`: one per slot, and one for every other kind of extension.
//!
//! A template is the folder of a crate that compiles under the name of its example. The workspace compiles and tests
//! these files as parts of `tests/third-party`, and the book shows them.

use syntable_model::registry::Slot;

/// A template of a crate.
pub(super) struct CrateTemplate {
    /// Value of `--slot`: a slot of recipes, or another kind of extension.
    pub slot: &'static str,
    /// Name of the crate and of its addition, in the files: in snake case, in camel case and in capitals.
    pub example: &'static str,
    /// The addition, for the list of templates.
    pub doc: &'static str,
    /// Files by their path in the crate.
    pub files: &'static [(&'static str, &'static str)],
    /// Crates that the library needs.
    crates: &'static [Crate],
    /// Additional crates for the tests.
    test_crates: &'static [Crate],
    /// Whether the tests make samples of `recipe.toml`.
    has_recipe: bool,
    /// Arguments of the program that demonstrate the plugin.
    pub show: &'static str,
}

/// A crate that plugins depend on.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Crate {
    Cli,
    Evaluate,
    Mesh,
    Model,
    Program,
    Schemars,
    Serde,
    Syntable,
    Tempfile,
}

use Crate::{Cli, Evaluate, Mesh, Model, Program, Schemars, Serde, Syntable, Tempfile};

impl Crate {
    const ALL: [Self; 9] = [Cli, Evaluate, Mesh, Model, Program, Schemars, Serde, Syntable, Tempfile];

    fn name(self) -> &'static str {
        match self {
            Cli => "syntable-cli",
            Evaluate => "syntable-evaluate",
            Mesh => "syntable-mesh",
            Model => "syntable-model",
            Program => "syntable-program",
            Schemars => "schemars",
            Serde => "serde",
            Syntable => "syntable",
            Tempfile => "tempfile",
        }
    }

    /// Folder of the crate in the sources of the program, or version and features of a third-party crate.
    fn place(self) -> Result<&'static str, &'static str> {
        match self {
            Cli => Ok("core/cli"),
            Evaluate => Ok("plugins/tools/evaluate"),
            Mesh => Ok("core/lib/mesh"),
            Model => Ok("core/model"),
            Program => Ok("plugins/program"),
            Syntable => Ok("plugins/standard"),
            Schemars => Err(r#"{ version = "1", default-features = false, features = ["derive", "std"] }"#),
            Serde => Err(r#"{ version = "1", features = ["derive"] }"#),
            Tempfile => Err(r#""3""#),
        }
    }
}

/// Names of the crates that a plugin may depend on, as Rust writes them.
pub(super) fn crates() -> impl Iterator<Item = String> {
    Crate::ALL.into_iter().map(|it| it.name().replace('-', "_"))
}

/// The files of a template: the files of every template, and further ones by name.
macro_rules! files {
    ($folder:literal $(, $more:literal)*) => {
        &[
            ("src/lib.rs", include_str!(concat!("scaffold/plugins/", $folder, "/src/lib.rs"))),
            ("tests/plugin.rs", include_str!(concat!("scaffold/plugins/", $folder, "/tests/plugin.rs"))),
            $(($more, include_str!(concat!("scaffold/plugins/", $folder, "/", $more)))),*
        ]
    };
}

/// A stage with a recipe.
macro_rules! stage {
    ($slot:literal, $example:literal, $doc:literal $(, crates: $crates:expr)? $(, tests: $tests:expr)?) => {
        CrateTemplate {
            slot: $slot,
            example: $example,
            doc: $doc,
            files: files!($slot, "recipe.toml"),
            crates: first!($($crates,)? &[Model, Program, Schemars, Serde]),
            test_crates: first!($($tests,)? &[]),
            has_recipe: true,
            show: "run recipe.toml --out data",
        }
    };
}

/// Any other extension, without a recipe.
macro_rules! other {
    ($slot:literal, $example:literal, $doc:literal, [$($file:literal),*], $crates:expr, $tests:expr, $show:literal) => {
        CrateTemplate {
            slot: $slot,
            example: $example,
            doc: $doc,
            files: files!($slot $(, $file)*),
            crates: $crates,
            test_crates: $tests,
            has_recipe: false,
            show: $show,
        }
    };
}

/// The given value, or else the default.
macro_rules! first {
    ($given:expr, $default:expr) => {
        $given
    };
    ($default:expr) => {
        $default
    };
}

/// All templates: the slots in the order of the pipeline, then the rest.
pub(super) const TEMPLATES: &[CrateTemplate] = &[
    stage!("assets", "plain_cubes", "a source of assets", crates: &[Mesh, Model, Program, Schemars, Serde]),
    stage!("place", "object_tower", "a placer of bodies"),
    stage!("settle", "straight_drop", "a settler of bodies"),
    stage!("camera", "square_camera", "a camera model"),
    stage!("views", "top_view", "a sampler of camera poses"),
    stage!("lights", "head_light", "a sampler of lights"),
    stage!("render", "first_hit", "a renderer of depth and ids"),
    stage!("denoise", "box_filter", "a denoiser"),
    stage!("sensor", "dead_pixels", "a simulated sensor"),
    stage!("annotate", "visible_area", "an annotator of images"),
    stage!("write", "area_table", "a writer of files", tests: &[Tempfile]),
    other!(
        "mesh-format",
        "off_mesh",
        "a reader of meshes",
        ["sample.off"],
        &[Mesh, Model, Program],
        &[Tempfile],
        "check --asset sample.off"
    ),
    other!(
        "image-format",
        "plain_ppm",
        "a reader of textures",
        ["sample.ppm"],
        &[Mesh, Model, Program],
        &[],
        "check --asset sample.ppm"
    ),
    other!(
        "dataset-format",
        "box_table",
        "a reader of datasets",
        ["sample/boxes.csv"],
        &[Model, Program],
        &[Tempfile],
        "validate sample"
    ),
    other!(
        "check",
        "sane_sizes",
        "a check of labels",
        [],
        &[Model, Program],
        &[],
        "run builtin:quickstart --out data && cargo run --release -- validate data"
    ),
    other!("metric", "count_error", "a metric of predictions", [], &[Evaluate, Program], &[], "list metrics"),
    other!("verb", "slot_kinds", "a verb of the command line", [], &[Cli, Model, Program], &[], "@NAME@ write"),
    other!("topic", "linked_crates", "a topic of `list`", [], &[Cli, Model, Program], &[], "list @NAME@"),
];

const MANIFEST: &str = include_str!("scaffold/plugin.toml");
const MAIN: &str = include_str!("scaffold/plugin_main.rs.txt");
const SAMPLES: &str = include_str!("scaffold/plugin_samples.rs");
const RULES: &str = include_str!("scaffold/plugin_rules.rs");

impl CrateTemplate {
    /// The template for a value of `--slot`.
    pub fn find(slot: &str) -> Option<&'static Self> {
        TEMPLATES.iter().find(|template| template.slot == slot)
    }

    /// The slot of the template's stage, if it has one.
    pub fn stage(&self) -> Option<Slot> {
        Slot::ALL.into_iter().find(|slot| slot.name() == self.slot)
    }

    /// The files of a crate with this name. `dependency` returns the value of a dependency on a crate of the program,
    /// by its folder.
    ///
    /// # Errors
    /// Errors of `dependency`.
    pub fn crate_files<E>(
        &self,
        name: &str,
        dependency: impl Fn(&str) -> Result<String, E>,
    ) -> Result<Vec<(&'static str, String)>, E> {
        let lines = |crates: &mut dyn Iterator<Item = Crate>| -> Result<String, E> {
            crates
                .map(|it| {
                    let value = it.place().map_or_else(|version| Ok(version.to_owned()), &dependency)?;
                    Ok(format!("{} = {value}\n", it.name()))
                })
                .collect()
        };
        let needed = lines(&mut self.crates.iter().copied())?;
        let for_tests = lines(&mut std::iter::once(Syntable).chain(self.test_crates.iter().copied()))?;
        let manifest = MANIFEST
            .replace("@NAME@", name)
            .replace("@DEPENDENCIES@\n", &(needed + "\n"))
            .replace("@DEV_DEPENDENCIES@\n", &for_tests);
        let main = MAIN.replace("@NAME@", name);
        let own = self.files.iter().map(|(path, text)| {
            let more = match *path {
                "tests/plugin.rs" if self.has_recipe => format!("\n{SAMPLES}\n{RULES}"),
                "tests/plugin.rs" => format!("\n{RULES}"),
                _ => String::new(),
            };
            (*path, self.renamed(text, name) + &more)
        });
        Ok([("Cargo.toml", manifest), ("src/main.rs", main)].into_iter().chain(own).collect())
    }

    /// A text with another name instead of the example's name.
    pub fn renamed(&self, text: &str, name: &str) -> String {
        text.replace(self.example, name)
            .replace(&camel_case(self.example), &camel_case(name))
            .replace(&self.example.to_uppercase(), &name.to_uppercase())
            .replace("@NAME@", name)
    }
}

/// A name in the form of types.
fn camel_case(name: &str) -> String {
    name.split('_')
        .filter_map(|word| word.split_at_checked(1))
        .map(|(first, rest)| first.to_uppercase() + rest)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_slot_has_a_template() {
        for slot in Slot::ALL {
            assert!(CrateTemplate::find(slot.name()).is_some_and(|template| template.stage() == Some(slot)), "{slot}");
        }
    }

    #[test]
    fn no_text_keeps_the_name_of_the_example() {
        for template in TEMPLATES {
            let files = template.crate_files("other_thing", |_| Ok::<_, ()>(String::new())).expect("made");
            for (path, text) in files {
                let lower = text.to_lowercase();
                assert!(!lower.contains(template.example), "{}/{path}", template.slot);
                assert!(!text.contains(&camel_case(template.example)), "{}/{path}", template.slot);
                assert!(!text.contains("@NAME@") && !text.contains("DEPENDENCIES@"), "{}/{path}", template.slot);
            }
        }
    }
}
