//! What has to be computed: the writers' wants, closed over their providers.
//!
//! A product comes from the renderer, from an annotator of the recipe, or else from the one registered annotator that
//! provides it, with its defaults. Gaps, ambiguities and cycles are errors before anything runs.

use crate::recipe::Recipe;
use std::fmt::Write as _;
use syntable_model::error::Error;
use syntable_model::product::{KeyId, Scope};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::stage::{Annotator, Renderer};

/// An annotator that runs, and what of it is wanted.
pub struct Step {
    /// Its id: `annotate.<id>`.
    pub id: String,
    /// The annotator.
    pub annotator: Box<dyn Annotator>,
    /// Whether the recipe names it; otherwise it runs with its defaults.
    pub explicit: bool,
}

/// One line of the plan: a product and where it comes from.
#[derive(Debug, Clone)]
pub struct Line {
    /// The product.
    pub key: KeyId,
    /// `render` or `annotate.<id>`.
    pub provider: String,
    /// Ids of the writers and annotators that read it.
    pub wanted_by: Vec<String>,
}

/// What a run computes, in order.
pub struct Plan {
    /// Products that the renderer makes for every view.
    pub rendered: Vec<KeyId>,
    /// Annotators that run once a scene, each after those it depends on.
    pub per_scene: Vec<Step>,
    /// Annotators that run once a view, each after those it depends on.
    pub per_view: Vec<Step>,
    /// Everything that is computed, in the order in which it becomes known.
    pub lines: Vec<Line>,
    /// Things worth knowing, such as an annotator that nobody needs.
    pub notes: Vec<Error>,
}

/// An annotator that could run.
struct Candidate {
    id: String,
    annotator: Option<Box<dyn Annotator>>,
    provides: Vec<KeyId>,
    reads: Vec<KeyId>,
    explicit: bool,
}

impl Plan {
    /// Plans a recipe, whose annotators it takes. All errors are given at once.
    pub fn new(registry: &Registry, recipe: &mut Recipe) -> Result<Self, Vec<Error>> {
        let wants: Vec<(String, String)> = recipe
            .write
            .iter()
            .flat_map(|(id, writer)| writer.reads().into_iter().map(move |name| (name, format!("write.{id}"))))
            .collect();
        Self::of(registry, &*recipe.render, std::mem::take(&mut recipe.annotate), wants)
    }

    /// Plans for a renderer, the recipe's annotators, and (product, wanted by) pairs.
    pub fn of(
        registry: &Registry,
        renderer: &dyn Renderer,
        annotators: Vec<(String, Box<dyn Annotator>)>,
        wants: Vec<(String, String)>,
    ) -> Result<Self, Vec<Error>> {
        let mut candidates: Vec<Candidate> =
            annotators.into_iter().map(|(id, annotator)| Candidate::new(id, annotator, true)).collect();
        // An annotator that the recipe sets up replaces the defaults of every kind that provides the same.
        let explicit: Vec<KeyId> = candidates.iter().flat_map(|candidate| candidate.provides.clone()).collect();
        for entry in registry.of_slot(Slot::Annotate) {
            if let Ok(constructed) = entry.construct_str("")
                && let Stage::Annotate(annotator) = constructed.stage
                && !annotator.provides().iter().any(|key| explicit.iter().any(|other| other.name == key.name))
            {
                candidates.push(Candidate::new(entry.kind.to_owned(), annotator, false));
            }
        }
        let mut planner = Planner { offers: renderer.offers(), candidates, lines: Vec::new(), errors: Vec::new() };
        for (name, by) in &wants {
            planner.want(name, by, &mut Vec::new());
        }
        planner.finish()
    }

    /// The plan as a table for people.
    pub fn table(&self, renderer: &dyn Renderer) -> String {
        let mut rows = vec![["product", "provider", "per", "wanted by"].map(str::to_owned)];
        rows.extend(self.lines.iter().map(|line| {
            let per = match line.key.scope {
                Scope::Scene => "scene",
                Scope::View => "view",
            };
            [line.key.name.to_owned(), line.provider.clone(), per.to_owned(), line.wanted_by.join(", ")]
        }));
        let mut out = table(&rows);
        let _ = writeln!(out, "\nrender: {}", renderer.cost());
        out
    }
}

/// Columns aligned by their widest cell.
pub fn table<const N: usize>(rows: &[[String; N]]) -> String {
    let widths: [usize; N] = std::array::from_fn(|i| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0));
    rows.iter().fold(String::new(), |mut out, row| {
        let line: Vec<String> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        let _ = writeln!(out, "{}", line.join("  ").trim_end());
        out
    })
}

impl Candidate {
    fn new(id: String, annotator: Box<dyn Annotator>, explicit: bool) -> Self {
        let (provides, reads) = (annotator.provides(), annotator.reads());
        Self { id, annotator: Some(annotator), provides, reads, explicit }
    }
}

struct Planner {
    offers: Vec<KeyId>,
    candidates: Vec<Candidate>,
    lines: Vec<Line>,
    errors: Vec<Error>,
}

impl Planner {
    /// Wants a product, and first all that its provider reads. `path` holds the annotators on the way here.
    fn want(&mut self, name: &str, by: &str, path: &mut Vec<usize>) {
        if let Some(line) = self.lines.iter_mut().find(|line| line.key.name == name) {
            if !line.wanted_by.iter().any(|other| other == by) {
                line.wanted_by.push(by.to_owned());
            }
            return;
        }
        let offered = self.offers.iter().find(|key| key.name == name).copied();
        let of_name = |candidate: &Candidate| candidate.provides.iter().any(|key| key.name == name);
        let found: Vec<usize> = (0..self.candidates.len()).filter(|&i| of_name(&self.candidates[i])).collect();
        match (offered, found.as_slice()) {
            (Some(key), []) => self.lines.push(Line { key, provider: "render".into(), wanted_by: vec![by.into()] }),
            (None, &[index]) => self.provide(index, name, by, path),
            (None, []) => self.fail(self.unknown(name, by)),
            (offered, several) => {
                let mut names: Vec<String> =
                    several.iter().map(|&i| format!("annotate.{}", self.candidates[i].id)).collect();
                names.extend(offered.map(|_| "render".to_owned()));
                self.fail(
                    Error::new(format!("product `{name}` has several providers: {}", names.join(", ")))
                        .help("keep one of them; name the one you want in an [annotate.<id>] table"),
                );
            }
        }
    }

    fn provide(&mut self, index: usize, name: &str, by: &str, path: &mut Vec<usize>) {
        if path.contains(&index) {
            let chain: Vec<&str> = path.iter().chain([&index]).map(|&i| self.candidates[i].id.as_str()).collect();
            return self.fail(Error::new(format!("annotators need each other in a circle: {}", chain.join(" → "))));
        }
        let candidate = &self.candidates[index];
        let (id, reads, provides) =
            (format!("annotate.{}", candidate.id), candidate.reads.clone(), candidate.provides.clone());
        let scope = provides.first().map_or(Scope::View, |key| key.scope);
        path.push(index);
        for read in reads {
            if scope == Scope::Scene && read.scope == Scope::View {
                self.fail(Error::new(format!("{id} works once a scene but reads `{}` of every view", read.name)));
            }
            self.want(read.name, &id, path);
            if let Some(line) = self.lines.iter().find(|line| line.key.name == read.name)
                && line.key.type_id() != read.type_id()
            {
                let (theirs, ours) = (line.key.type_name(), read.type_name());
                self.fail(Error::new(format!(
                    "{id} reads `{}` as {ours}, but {} provides {theirs}",
                    read.name, line.provider
                )));
            }
        }
        path.pop();
        if let Some(&key) = provides.iter().find(|key| key.name == name) {
            self.lines.push(Line { key, provider: id, wanted_by: vec![by.into()] });
        }
    }

    fn unknown(&self, name: &str, by: &str) -> Error {
        let mut known: Vec<&str> = self
            .offers
            .iter()
            .chain(self.candidates.iter().flat_map(|candidate| &candidate.provides))
            .map(|key| key.name)
            .collect();
        known.sort_unstable();
        let near = known.iter().min_by_key(|other| strsim::damerau_levenshtein(other, name));
        let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
        Error::new(format!("{by} wants product `{name}`, which nothing provides")).help(format!(
            "{hint}provided by linked plugins: {}; if a plugin of yours provides it, check that its crate is named in your binary's main.rs",
            known.join(", ")
        ))
    }

    fn fail(&mut self, error: Error) {
        if !self.errors.contains(&error) {
            self.errors.push(error);
        }
    }

    fn finish(mut self) -> Result<Plan, Vec<Error>> {
        if !self.errors.is_empty() {
            return Err(self.errors);
        }
        let mut plan = Plan {
            rendered: self.lines.iter().filter(|line| line.provider == "render").map(|line| line.key).collect(),
            per_scene: Vec::new(),
            per_view: Vec::new(),
            lines: std::mem::take(&mut self.lines),
            notes: Vec::new(),
        };
        // Lines stand in dependency order, so the first line of an annotator is when it has to run.
        for line in &plan.lines {
            let Some(candidate) =
                self.candidates.iter_mut().find(|candidate| line.provider == format!("annotate.{}", candidate.id))
            else {
                continue;
            };
            if let Some(annotator) = candidate.annotator.take() {
                let scope = annotator.scope();
                let step = Step { id: candidate.id.clone(), annotator, explicit: candidate.explicit };
                match scope {
                    Scope::Scene => plan.per_scene.push(step),
                    Scope::View => plan.per_view.push(step),
                }
            }
        }
        for candidate in self.candidates.iter().filter(|candidate| candidate.explicit && candidate.annotator.is_some())
        {
            let names: Vec<&str> = candidate.provides.iter().map(|key| key.name).collect();
            plan.notes.push(
                Error::new(format!("annotate.{} is not computed: no writer wants it", candidate.id))
                    .help(format!("include {} in a [write.<id>] table", names.join(" or "))),
            );
        }
        Ok(plan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use syntable_model::error::Result;
    use syntable_model::product::{Frame, Key, PerInstance};
    use syntable_model::stage::{RenderSession, Site};

    const PIXELS: Key<PerInstance<u32>> = Key::view("pixels", "");
    const WRONG_PIXELS: Key<PerInstance<f64>> = Key::view("pixels", "");
    const A: Key<PerInstance<u32>> = Key::view("a", "");
    const B: Key<PerInstance<u32>> = Key::view("b", "");
    const S: Key<PerInstance<u32>> = Key::scene("s", "");

    struct Offers(Vec<KeyId>);
    impl Renderer for Offers {
        fn offers(&self) -> Vec<KeyId> {
            self.0.clone()
        }
        fn open(&self, _: usize) -> Result<Box<dyn RenderSession>> {
            Err(Error::new("only planned with"))
        }
        fn cost(&self) -> String {
            "nothing".into()
        }
    }

    struct Step1(Vec<KeyId>, Vec<KeyId>);
    impl Annotator for Step1 {
        fn reads(&self) -> Vec<KeyId> {
            self.0.clone()
        }
        fn provides(&self) -> Vec<KeyId> {
            self.1.clone()
        }
        fn annotate(&self, _: &Site, _: &mut Frame) -> Result<()> {
            Ok(())
        }
    }

    /// Plans annotators (id, reads, provides) for wants; gives the order of providers, or the errors.
    fn check(annotators: &[(&str, &[KeyId], &[KeyId])], wants: &[&str], expected: std::result::Result<&[&str], &str>) {
        let annotators = annotators
            .iter()
            .map(|(id, reads, provides)| {
                ((*id).to_owned(), Box::new(Step1(reads.to_vec(), provides.to_vec())) as Box<dyn Annotator>)
            })
            .collect();
        let wants = wants.iter().map(|name| ((*name).to_owned(), "write.w".to_owned())).collect();
        let plan = Plan::of(&Registry::default(), &Offers(vec![PIXELS.id()]), annotators, wants);
        match (plan, expected) {
            (Ok(plan), Ok(expected)) => {
                let steps = plan.per_scene.iter().chain(&plan.per_view).map(|step| step.id.as_str());
                assert_eq!(steps.collect::<Vec<_>>(), expected);
            }
            (Err(errors), Err(expected)) => {
                let text: Vec<String> = errors.iter().map(Error::to_string).collect();
                assert!(text.iter().any(|error| error.contains(expected)), "{text:?}");
            }
            (Ok(_), Err(expected)) => panic!("planned, but wanted: {expected}"),
            (Err(errors), Ok(_)) => panic!("{errors:?}"),
        }
    }

    #[test]
    fn providers_run_before_readers_and_only_if_wanted() {
        let all: &[(&str, &[KeyId], &[KeyId])] =
            &[("second", &[A.id()], &[B.id()]), ("first", &[PIXELS.id()], &[A.id()]), ("scene", &[], &[S.id()])];
        check(all, &["b"], Ok(&["first", "second"]));
        check(all, &["b", "s"], Ok(&["scene", "first", "second"]));
        check(all, &["pixels"], Ok(&[]));
    }

    #[test]
    fn gaps_ambiguities_and_cycles_are_refused() {
        check(&[], &["pixel"], Err("did you mean `pixels`?"));
        check(&[("x", &[], &[A.id()]), ("y", &[], &[A.id()])], &["a"], Err("annotate.x, annotate.y"));
        check(&[("x", &[], &[PIXELS.id()])], &["pixels"], Err("annotate.x, render"));
        check(&[("x", &[B.id()], &[A.id()]), ("y", &[A.id()], &[B.id()])], &["a"], Err("x → y → x"));
        check(&[("x", &[WRONG_PIXELS.id()], &[A.id()])], &["a"], Err("as PerInstance<f64>"));
        check(&[("x", &[PIXELS.id()], &[S.id()])], &["s"], Err("works once a scene"));
    }
}
