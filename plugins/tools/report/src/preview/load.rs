//! Loads a recipe with a preview's changes: few samples, denoised, with the displayed products.

use super::choice::Choice;
use super::watch::WatchedFiles;
use super::{cell, shot};
use std::borrow::Cow;
use std::cell::RefCell;
use std::path::Path;
use std::time::SystemTime;
use syntable_model::context::Log;
use syntable_model::error::Error;
use syntable_model::registry::{Registry, Slot};
use syntable_model::stage::Input;
use syntable_recipe::message::Message;
use syntable_recipe::{Diagnostic, Overrides, Recipe, RecipeRequest, components_of};
use syntable_runtime::check::load_naming_all;

/// The preview's denoiser for recipes without one.
const DENOISER: &str = "guided";
/// The kind of `denoise` in recipes without a denoiser.
const NO_DENOISER: &str = "none";

/// Changes of a preview to a recipe.
#[derive(Debug, Clone)]
pub struct Wishes {
    /// The recipe and the user's own changes.
    pub recipe: RecipeRequest,
    /// Maximum number of samples per pixel.
    pub samples: u32,
    /// Whether labels are shown next to the images.
    pub labels: bool,
    /// Whether a page shows the views with all labels that the recipe can provide.
    pub page: bool,
    /// Whether to run code that the recipe brings: native libraries and programs.
    pub allow_code: bool,
    /// Wording of messages on the sheet and the page.
    pub wording: Wording,
}

/// How a preview renders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quality {
    /// With few samples, denoised.
    Quick,
    /// As the recipe states.
    Final,
}

/// Adapts a message of the library to its readers: a command line prints flags for options.
pub type Wording = fn(&str) -> Cow<'_, str>;

/// A recipe with its warnings, or all errors in it; and the files that were read.
pub struct LoadedRecipe {
    /// The recipe.
    pub recipe: Result<(Recipe, Vec<Diagnostic>), Vec<Message>>,
    /// The recipe's files, as they were read.
    pub files: WatchedFiles,
    /// Names of the displayed products.
    pub products: Vec<String>,
}

/// Loads the recipe with inputs of the page, and with further changes in the form of `--set`.
type Load<'a> = &'a dyn Fn(&[Input], &[(String, String)]) -> LoadedRecipe;

impl Wishes {
    /// Loads the recipe with the choice of the page's user.
    pub fn load(&self, registry: &Registry, choice: &Choice, quality: Quality, log: &dyn Log) -> LoadedRecipe {
        let since = SystemTime::now();
        let needed = cell::inputs(self.labels);
        let load = |inputs: &[Input], more: &[(String, String)]| self.load_with(registry, choice, inputs, more, log);
        let mut inputs = needed.clone();
        let mut loaded = if self.page {
            shot::groups().into_iter().for_each(|group| extend(&mut inputs, group));
            let all = load(&inputs, &[]);
            let basic = if all.recipe.is_err() { load(&needed, &[]) } else { all };
            if basic.recipe.is_ok() && basic.products.len() < inputs.len() {
                inputs = self.provided(needed, &load);
            }
            basic
        } else {
            load(&inputs, &[])
        };
        if let Ok((recipe, _)) = &loaded.recipe {
            let more = self.changes(registry, recipe, choice, quality);
            if !more.is_empty() || loaded.products.len() < inputs.len() {
                loaded = load(&inputs, &more);
            }
        }
        if let Ok((recipe, _)) = &loaded.recipe {
            recipe.files.iter().for_each(|(_, path)| loaded.files.add(path, since));
            if let Err(error) = recipe.trusted(self.allow_code) {
                loaded.recipe = Err(vec![Message::Error(error)]);
            }
        }
        loaded
    }

    /// The needed inputs, and the groups of inputs for the page that the recipe can provide.
    fn provided(&self, needed: Vec<Input>, load: Load) -> Vec<Input> {
        shot::groups().into_iter().fold(needed, |inputs, group| {
            let mut more = inputs.clone();
            extend(&mut more, group);
            if load(&more, &[]).recipe.is_ok() { more } else { inputs }
        })
    }

    /// Changes to a valid recipe, in the form of `--set`: chosen scenes beyond its last one and, for quick images, few
    /// samples. Renderers without samples stay unchanged.
    fn changes(
        &self,
        registry: &Registry,
        recipe: &Recipe,
        choice: &Choice,
        quality: Quality,
    ) -> Vec<(String, String)> {
        let mut changes = Vec::new();
        let end = choice.scenes(&(0..recipe.dataset.scenes)).map_or(0, |scenes| scenes.end);
        if end > recipe.dataset.scenes {
            changes.push(("dataset.scenes".to_owned(), end.to_string()));
        }
        if quality == Quality::Final {
            return changes;
        }
        let resolved: toml::Table = recipe.resolved.parse().unwrap_or_default();
        let is_there = registry.of_slot(Slot::Denoise).any(|entry| entry.kind == DENOISER);
        for ((_, tables), component) in components_of(&resolved).into_iter().zip(recipe.components.all()) {
            let option = |slot: Slot, option: &str| tables.get(slot.name()).and_then(|table| table.get(option));
            let samples = option(Slot::Render, "samples_per_pixel").and_then(toml::Value::as_integer);
            if samples.is_some_and(|samples| samples > i64::from(self.samples)) {
                changes.push((component.table("render.samples_per_pixel"), self.samples.to_string()));
            }
            if is_there && option(Slot::Denoise, "kind").and_then(toml::Value::as_str) == Some(NO_DENOISER) {
                changes.push((component.table("denoise.kind"), format!("{DENOISER:?}")));
            }
        }
        changes
    }

    fn load_with(
        &self,
        registry: &Registry,
        choice: &Choice,
        inputs: &[Input],
        more: &[(String, String)],
        log: &dyn Log,
    ) -> LoadedRecipe {
        let files = RefCell::new(WatchedFiles::default());
        let products = inputs.iter().map(|input| input.product.clone()).collect();
        if let Some(path) = &self.recipe.recipe {
            files.borrow_mut().expect(path);
        }
        let request = RecipeRequest {
            seed: choice.seed.or(self.recipe.seed),
            views: choice.views.or(self.recipe.views),
            ..self.recipe.clone()
        };
        let (source, mut base) = match request.read() {
            Ok(read) => read,
            Err(error) => return LoadedRecipe { recipe: Err(of_error(error)), files: files.into_inner(), products },
        };
        if let Some(path) = &source.path {
            files.borrow_mut().read(path, source.text.as_bytes());
        }
        base.set.extend(more.iter().cloned());
        base.wanted = inputs.to_vec();
        let read = |path: &Path| {
            let text = (base.read)(path);
            match &text {
                Ok(text) => files.borrow_mut().read(path, text.as_bytes()),
                Err(_) => files.borrow_mut().expect(path),
            }
            text
        };
        let overrides = Overrides { read: &read, ..base };
        let recipe = load_naming_all(registry, source, overrides.for_run(), log);
        LoadedRecipe { recipe: recipe.map_err(|report| report.messages()), files: files.into_inner(), products }
    }
}

/// Adds the inputs of other products.
fn extend(inputs: &mut Vec<Input>, others: Vec<Input>) {
    for other in others {
        if inputs.iter().all(|input| input.product != other.product) {
            inputs.push(other);
        }
    }
}

/// The messages as text for users, without colors.
pub fn said(messages: &[Message], wording: Wording) -> String {
    let text = |message: &Message| wording(message.render(false).trim_end()).into_owned();
    let lines: Vec<String> = messages.iter().map(text).collect();
    lines.join("\n\n")
}

/// The messages of an error.
pub fn of_error(error: Error) -> Vec<Message> {
    vec![Message::Error(error)]
}
