//! The work to do: for each scene, all of it or its missing parts.

use crate::run::dataset::journal::{Journal, JournalEntry};
use crate::run::dataset::manifest::Manifest;
use crate::run::dataset::records::{self, OWNER};
use crate::run::decisions::growth::Growth;
use crate::run::shard::WantedScenes;
use std::collections::{BTreeMap, BTreeSet};
use syntable_model::stage::{DatasetInfo, Input, Scenes, Writer};
use syntable_recipe::plan::Plan;
use syntable_recipe::{Component, Recipe};

/// Parts of a scene to make.
pub struct Work<'a> {
    /// The component of the recipe that makes the scene.
    pub component: &'a Component,
    /// Information on the dataset, with the scene's number of views.
    pub dataset: DatasetInfo,
    /// Plan of the computation.
    pub plan: Plan,
    /// Writers of the scene.
    pub writers: Vec<&'a (String, Box<dyn Writer<Scenes>>)>,
}

/// A scene to make.
pub struct Task<'a> {
    /// Number of the scene.
    pub scene: u32,
    /// Whether the dataset has it.
    pub is_present: bool,
    /// Work for a new scene, or for a scene that is made again.
    pub whole: &'a Work<'a>,
    /// The existing scene and its missing parts, if only these are made.
    pub extend: Option<(&'a JournalEntry, &'a Work<'a>)>,
}

/// The work for each scene.
pub struct Todo {
    pub scenes: BTreeMap<u32, Job>,
    /// Whether the recipe adds stages to the recipe that made the existing scenes.
    pub adds: bool,
}

/// The work for a scene.
pub struct Job {
    /// Its journal line, if it is in the dataset, without the writers whose files are written again.
    pub present: Option<Box<JournalEntry>>,
    /// Its missing parts.
    pub lacks: Lacks,
}

impl Job {
    /// A scene keeps its number of views when the dataset grows.
    fn views(&self, recipe: &Recipe) -> u32 {
        self.present.as_ref().map_or(recipe.dataset.views_per_scene, |present| present.views())
    }
}

impl Todo {
    /// The work for `wanted` and damaged scenes.
    pub fn of(
        recipe: &Recipe,
        journal: &Journal,
        growth: Option<&Growth>,
        wanted: &WantedScenes,
        damaged: BTreeSet<u32>,
    ) -> Self {
        let recorded = records::names(&recipe.components.first().plan);
        let anew = growth.map(Growth::replaced).unwrap_or_default();
        let job = |scene: u32| {
            let Some(line) = journal.entries().get(scene) else { return Some(Job { present: None, lacks: None }) };
            let is_damaged = damaged.contains(&scene);
            let has = |id: &String| line.writers().contains(id) && !anew.contains(id);
            let lacks: Vec<String> = recipe.write.iter().map(|(id, _)| id).filter(|id| !has(id)).cloned().collect();
            let records = line.recorded() != recorded;
            let done = line.failed() || (lacks.is_empty() && !records);
            let present = || Some(Box::new(line.entry().without(&anew)));
            match (is_damaged, done) {
                (true, _) => Some(Job { present: present(), lacks: None }),
                (false, true) => None,
                (false, false) => Some(Job { present: present(), lacks: Some((lacks, records)) }),
            }
        };
        Self {
            scenes: wanted
                .iter()
                .chain(damaged.iter().copied())
                .filter_map(|scene| Some((scene, job(scene)?)))
                .collect(),
            adds: growth.is_some_and(|growth| growth.adds),
        }
    }

    /// Number of images to make.
    pub fn images(&self, recipe: &Recipe) -> u64 {
        self.scenes.values().map(|job| u64::from(job.views(recipe))).sum()
    }
}

/// The files of a scene that stay when it gets its missing parts. Files of writers that its line does not name go,
/// because the writers' options have changed or the writers are gone.
pub fn kept(files: &Manifest, entry: &JournalEntry, plan: &Plan) -> Manifest {
    files.only(|id| match id {
        OWNER => !plan.per_dataset.is_empty(),
        id => entry.writers().iter().any(|writer| writer == id),
    })
}

/// Missing parts of a scene: ids of writers, and whether its products must be recorded again; `None` if the whole scene
/// is made.
pub type Lacks = Option<(Vec<String>, bool)>;

/// Plans for scenes: for whole scenes, and for missing parts. Scenes with the same work share one.
pub struct Works<'a> {
    recipe: &'a Recipe,
    works: BTreeMap<(usize, u32, Lacks), Work<'a>>,
}

impl<'a> Works<'a> {
    pub fn new(recipe: &'a Recipe, todo: &Todo) -> Self {
        let mut all = Self { recipe, works: BTreeMap::new() };
        for (&scene, job) in &todo.scenes {
            let (index, component) = recipe.component_of(scene);
            for lacks in [None, job.lacks.clone()] {
                let views = job.views(recipe);
                let made = || work(recipe, component, views, lacks.as_ref());
                all.works.entry((index, views, lacks.clone())).or_insert_with(made);
            }
        }
        all
    }

    /// The task of a scene.
    pub fn task<'t>(&'t self, scene: u32, job: &'t Job) -> Task<'t> {
        let (component, _) = self.recipe.component_of(scene);
        let of = |lacks: &Lacks| &self.works[&(component, job.views(self.recipe), lacks.clone())];
        let extend = job.present.as_deref().filter(|_| job.lacks.is_some()).map(|present| (present, of(&job.lacks)));
        let is_present = job.present.as_ref().is_some_and(|present| !present.failed());
        Task { scene, is_present, whole: of(&None), extend }
    }
}

fn work<'a>(recipe: &'a Recipe, component: &'a Component, views: u32, lacks: Option<&(Vec<String>, bool)>) -> Work<'a> {
    let dataset = DatasetInfo { views_per_scene: views, ..recipe.info_of(component) };
    let Component { plan, render, .. } = component;
    let Some((lacks, records)) = lacks else {
        return Work { component, dataset, plan: plan.clone().on(&**render), writers: recipe.write.iter().collect() };
    };
    let writers: Vec<_> = recipe.write.iter().filter(|(id, _)| lacks.contains(id)).collect();
    let reads: Vec<String> = writers.iter().flat_map(|(_, writer)| Input::names(&writer.reads())).collect();
    let plan = plan.part(reads.iter().map(String::as_str), *records).on(&**render);
    Work { component, dataset, plan, writers }
}
