//! The codes of diagnostics, each with its explanation.

use serde::{Serialize, Serializer};
use std::fmt;

/// Help for a kind or a product that no linked plugin has.
pub(crate) const OF_PLUGIN: &str =
    "if a plugin provides it, name its crate in your binary's main.rs, or pass its Python file with --plugin";

macro_rules! codes {
    ($($(#[doc = $doc:literal])+ $name:ident = $text:literal, $title:literal, $explanation:literal, $help:literal;)*) => {
        /// Kind of mistake. Codes never change their meaning.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Code {
            $($(#[doc = $doc])+ $name,)*
        }

        impl Code {
            /// All codes, ascending.
            pub const ALL: &'static [Self] = &[$(Self::$name),*];

            /// `D0001` and so on.
            pub fn text(self) -> &'static str {
                match self {
                    $(Self::$name => $text,)*
                }
            }

            /// The mistake in a few words.
            pub fn title(self) -> &'static str {
                match self {
                    $(Self::$name => $title,)*
                }
            }

            /// Explanation of the mistake: a paragraph of Markdown.
            pub fn explain(self) -> &'static str {
                match self {
                    $(Self::$name => $explanation,)*
                }
            }

            /// How to fix it: a paragraph of Markdown.
            pub fn help_text(self) -> &'static str {
                match self {
                    $(Self::$name => $help,)*
                }
            }
        }
    };
}

codes! {
    /// The text is not TOML.
    Syntax = "D0001", "the text is not TOML",
        "A recipe is a TOML file, and this place does not follow TOML's grammar: a quote or bracket is not closed, a \
         comma or an equals sign is missing, or a bare word stands where a value should be. The text after the mistake may be \
         misread, so keys on the same line are not checked, and missing keys are not reported until it is fixed.",
        "Fix the first mistake and check again; later ones often disappear with it. Strings need quotes, arrays `[ ]`, \
         inline tables `{ }`, and keys an `=`.";
    /// One key is given twice.
    DuplicateKey = "D0002", "a key is given twice",
        "TOML allows every key and every `[table]` header once, and so does `[set]` with every place of a recipe, however \
         its path is written. A second one does not override the first: the program could not know which of the two was \
         meant, so it refuses both.",
        "Keep one of the two. To run several stages of one kind, give `[[place]]` and `[[lights]]` one table each, and \
         `[assets.<id>]`, `[annotate.<id>]` and `[write.<id>]` different ids with a `kind`.";
    /// No option or section has this name.
    UnknownKey = "D0003", "no option has this name",
        "The section, or the kind of stage that the table chooses, has no option of this name. Unknown keys are errors, \
         because a misspelled option would otherwise be ignored silently and the dataset would be made with the default.",
        "Use the suggested name, or see the options with `syntable list <kind>` or in the reference. If the option \
         belongs to another kind, check the table's `kind`.";
    /// No linked plugin provides this product.
    UnknownProduct = "D0004", "no linked plugin provides this product",
        "Writers name the products that they write, such as `visible_mask`. A product must be offered by the recipe's \
         renderer or provided by a sensor or annotator, and no stage in this program does so.",
        "Use the suggested name, or see `syntable list products`. If a plugin of yours provides it, name that crate in \
         your binary's `main.rs` (`use my_plugin as _;`): a crate that is only listed in `Cargo.toml` is not linked. If \
         another renderer offers it, choose that one in `[render]`.";
    /// No linked plugin registers this kind.
    UnknownKind = "D0005", "no linked plugin registers this kind",
        "Every stage is chosen by its `kind`, and no plugin of this program registers one of this name for this section. \
         In `[assets]`, `[annotate]` and `[write]` the table's id is the kind unless `kind` says otherwise.",
        "Use the suggested kind, or see `syntable list`. If a plugin of yours registers it, name that crate in your \
         binary's `main.rs`. To call a table as you like, add `kind = \"…\"` to it.";
    /// No pool has this name, or it gives assets of another class.
    UnknownPool = "D0006", "no such pool of assets",
        "Stages draw objects and materials from pools by name, and a pool is an `[assets.<name>]` table. Either \
         no table has this name, or its source gives materials where objects are needed, or vice versa.",
        "Use the suggested name, or add the `[assets.<name>]` table.";
    /// The value has another type than the option.
    WrongType = "D0007", "the value has the wrong type",
        "The option takes another type of value than the one given: a number instead of a string, one value instead of \
         an array, and so on. Nothing is converted silently; `\"5\"` is a string and not a number.",
        "Write the value as the message says. Random options take a plain number or one table such as \
         `{ uniform = [0, 1] }`.";
    /// The value is outside the option's limits.
    OutOfRange = "D0008", "the value is outside its limits",
        "The option has limits, stated in the reference and in the schema: a smallest or largest value, or a number of \
         elements. The limits reject values that have no meaning or that would fail in the middle of a run.",
        "Choose a value within the limits. If the option's name ends in a unit, check that the value is in that unit.";
    /// A required option is not given.
    MissingKey = "D0009", "a required option is missing",
        "This option has no default, because no value suits everyone: a folder, a number of scenes, \
         a kind.",
        "Add the option; the message explains it.";
    /// A required section is not given.
    MissingSection = "D0010", "a required section is missing",
        "A recipe needs `[dataset]`, at least one `[[place]]` step and at least one `[write.<id>]` table. The sections \
         `[settle]`, `[camera]`, `[views]`, `[[lights]]` and `[render]` may be left out only if their default kind is \
         linked into this program.",
        "Add the section, or take it from another recipe by `extends = \"other.toml\"`. `syntable new recipe` writes a \
         whole one.";
    /// The stage refuses the value.
    InvalidValue = "D0011", "the stage refuses the value",
        "The value has the right type and is within its limits, but the stage cannot work with it: bounds in the wrong \
         order, options that contradict each other, numbers that do not fit together.",
        "Follow the message, which names the value and the accepted values.";
    /// The option does not offer this word.
    UnknownChoice = "D0012", "the option does not offer this choice",
        "The option takes one of a few words, and this is not one of them.",
        "Use one of the words that the message lists.";
    /// An id is taken, or misleads.
    BadId = "D0013", "the id cannot be used",
        "Ids name random streams, folders and pools. They must be unique within their section and consist of 1 to 100 \
         letters, digits, `_` and `-`. In `[assets]`, `[annotate]` and `[write]`, a table whose id is the name of one kind may not \
         be of another kind, because a `[write.png]` that writes no PNG would mislead every reader.",
        "Give the table another id.";
    /// A recipe that is extended cannot be used.
    Extends = "D0014", "the extended recipe cannot be used",
        "`extends` names another recipe file, relative to the file that says so, or a recipe of the program, such as \
         `builtin:quickstart`. The file cannot be read, is not UTF-8, or extends itself through others, or the program \
         has no recipe of the name.",
        "Check the path, which is relative to the folder of the recipe that names it. Break a circle by moving what the \
         recipes share into a file of its own.";
    /// An environment variable is not set.
    Variable = "D0015", "an environment variable is not set",
        "Paths may hold `${NAME}`, which is replaced by the environment variable NAME, so that a recipe works on every \
         machine. The variable is not set, is empty, or the `${…}` is not closed.",
        "Set it for the command (`NAME=/folder syntable run …`) or for the session (`export NAME=/folder`), or write a \
         path in its place, for instance by `--set`.";
    /// An override does not fit the recipe.
    BadOverride = "D0016", "the override does not fit the recipe",
        "`--set`, `[set]` and `remove` name a place in the recipe by a path such as `render.samples_per_pixel`, \
         `lights[0].count` or `place.objects.count`. The path is malformed, leads through something that is not a table, \
         or names something that is not there.",
        "Correct the path. Elements of lists are counted from 0, or named by their id; an element cannot be added.";
    /// The option does not apply to this class of assets.
    WrongClass = "D0017", "the option does not apply to this class of assets",
        "Scale, center, mass and density describe objects; this pool gives assets of another class.",
        "Remove the option, or move it to a pool of objects.";
    /// The recipe was resolved by other versions. A warning.
    LockMismatch = "D0018", "the recipe was resolved by other versions",
        "A resolved recipe records the versions of the program and of the plugins that made it. With other versions, the \
         same recipe may give another dataset.",
        "Install the recorded versions to repeat the dataset exactly, or remove `[lock]` to accept the new ones.";
    /// No stage draws from the pool. A warning.
    UnusedPool = "D0019", "no stage draws from this pool",
        "The pool is declared, but no stage names it, so none of its assets can appear in the dataset. Often a `from` \
         list has been forgotten.",
        "Name the pool in a stage, or remove its table.";
    /// The path holds `~` or `$NAME`. A warning.
    OddPath = "D0020", "the path is read literally",
        "`~` and `$NAME` are replaced by a shell, but not in a recipe, where they are ordinary characters.",
        "Write `${HOME}` for `~`, and `${NAME}` for `$NAME`.";
    /// The products that the writers read cannot be made.
    Plan = "D0021", "the products cannot be made",
        "The products that the writers read, and those that they are made from, cannot be provided: two \
         stages provide the same product, annotators need each other in a circle, or one reads a product as another \
         type than it is provided with.",
        "Keep one provider: if the recipe has several, remove all tables but one; if it has none, name the annotator \
         that you want in an `[annotate.<id>]` table. `syntable plan` shows which stage provides each product.";
    /// An option, kind or product has another name now.
    Renamed = "D0022", "the name has changed",
        "Earlier versions had an option, a kind or a product of this name; this version calls it otherwise. The old name \
         is an error rather than an alias, so that every recipe that runs agrees with the reference.",
        "Write the new name, which the message gives. The meaning and the unit of an option are in the reference, under \
         the new name.";
    /// A linked plugin registers a kind that cannot be used.
    Plugin = "D0023", "a linked plugin is faulty",
        "A plugin registers a kind of stage whose options cannot be checked: its schema uses a keyword that the program \
         does not know, or a source of assets has an option that every pool has. The recipe is not at fault.",
        "Report the message to the plugin's authors, or leave the plugin out of your binary's `main.rs`.";
    /// The writer cannot store this kind of value.
    NotStorable = "D0024", "the writer cannot store this kind of value",
        "Each writer stores some kinds of value: a PNG file has no channel for floating-point numbers, an array file no \
         place for records, a pose of BOP no place for the size of an object. The product is of a kind that this writer cannot \
         store, or a step of `[[place]]` varies the sizes of objects and the writer cannot store them.",
        "Write the product with another writer, as the message says; `syntable list products` shows the kind of each. For a \
         writer without sizes, remove `scale` from the step.";
    /// Nothing reads the products of the stage. A warning.
    IdleStage = "D0025", "nothing reads what the stage provides",
        "The recipe sets up a sensor, an annotator or a denoiser, but no writer includes what it provides, nor anything \
         that is made from it. The stage does not run.",
        "Include its product in a `[write.<id>]` table, or remove the stage's table.";
    /// Steps of `[[place]]` do not go together.
    Placers = "D0026", "steps of [[place]] do not go together",
        "A scene has supports, such as the tabletop that `table` sets, each with its own name, and one floor, which `room` \
         or `ground` sets. A step sets a part that another step has set, or needs a part that no earlier step sets, or no step places \
         objects that are annotated. Or a stage names a support that no step sets, or a light needs walls \
         that no step sets. Steps run in the order of the recipe.",
        "Remove one of two steps that set the same, or put the step that sets the part before those that need it. \
         Without objects, add a `drop_box`. Correct the name of a support: the message lists those that exist.";
    /// Few samples without a denoiser. A warning.
    Noise = "D0027", "the images are noisy",
        "The renderer follows few random paths per pixel, and no denoiser removes their noise. A network \
         trained on such images learns the noise as well.",
        "Add the section `[denoise]` with `kind = \"guided\"`, or raise `samples_per_pixel`. Noise falls with the square \
         root of the samples.";
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

impl Serialize for Code {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_count_from_one_and_are_explained() {
        for (index, code) in Code::ALL.iter().enumerate() {
            assert_eq!(code.text(), format!("D{:04}", index + 1));
            assert!(code.explain().len() > 60 && code.help_text().len() > 20, "{code}");
            assert!(!code.explain().contains("  "), "{code}: stray blanks");
        }
    }
}
