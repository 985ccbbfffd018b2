//! What has to be computed: the writers' wants, closed over their providers.
//!
//! A product comes from the renderer, the denoiser, a sensor or an annotator of the recipe, or else from the one
//! registered sensor or annotator that provides it, with its defaults. Gaps, ambiguities and cycles are errors before
//! anything runs.

use crate::recipe::Recipe;
use std::fmt::Write as _;
use syntable_model::error::Error;
use syntable_model::product::standard::{DENOISER, RADIANCE, RADIANCE_NOISY};
use syntable_model::product::{KeyId, Scope};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::stage::{Annotator, Denoiser, Renderer, Sensor};

/// Makes products from products.
pub enum Maker {
    /// With random numbers, once a view.
    Sensor(Box<dyn Sensor>),
    /// Without, once a view or once a scene.
    Annotator(Box<dyn Annotator>),
}

impl Maker {
    /// The products that it reads.
    pub fn reads(&self) -> Vec<KeyId> {
        match self {
            Self::Sensor(sensor) => sensor.reads(),
            Self::Annotator(annotator) => annotator.reads(),
        }
    }

    /// The products that it provides.
    pub fn provides(&self) -> Vec<KeyId> {
        match self {
            Self::Sensor(sensor) => sensor.provides(),
            Self::Annotator(annotator) => annotator.provides(),
        }
    }

    fn slot(&self) -> Slot {
        match self {
            Self::Sensor(_) => Slot::Sensor,
            Self::Annotator(_) => Slot::Annotate,
        }
    }
}

/// A sensor or annotator that runs.
pub struct Step {
    /// `sensor.<id>` or `annotate.<id>`.
    pub stage: String,
    /// What runs.
    pub maker: Maker,
    /// Whether the recipe names it; otherwise it runs with its defaults.
    pub explicit: bool,
}

/// One line of the plan: a product and where it comes from.
#[derive(Debug, Clone)]
pub struct Line {
    /// The product.
    pub key: KeyId,
    /// `render`, `denoise`, `sensor.<id>` or `annotate.<id>`.
    pub provider: String,
    /// Ids of the writers and annotators that read it.
    pub wanted_by: Vec<String>,
}

/// What a run computes, in order.
pub struct Plan {
    /// Products that the renderer makes for every view.
    pub rendered: Vec<KeyId>,
    /// Whether the denoiser runs on what was rendered.
    pub denoised: bool,
    /// Whether somebody wants to know which denoiser ran.
    pub denoiser_wanted: bool,
    /// Annotators that run once a scene, each after those it depends on.
    pub per_scene: Vec<Step>,
    /// Sensors and annotators that run once a view, each after those it depends on.
    pub per_view: Vec<Step>,
    /// Everything that is computed, in the order in which it becomes known.
    pub lines: Vec<Line>,
    /// Things worth knowing, such as an annotator that nobody needs.
    pub notes: Vec<Error>,
}

/// A sensor or annotator that could run.
struct Candidate {
    stage: String,
    maker: Option<Maker>,
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
        let sensors = std::mem::take(&mut recipe.sensor).into_iter().map(|(id, sensor)| (id, Maker::Sensor(sensor)));
        let annotators = std::mem::take(&mut recipe.annotate).into_iter();
        let makers = sensors.chain(annotators.map(|(id, annotator)| (id, Maker::Annotator(annotator)))).collect();
        Self::of(registry, &*recipe.render, recipe.denoise.as_deref(), makers, wants)
    }

    /// Plans for a renderer, a denoiser, the recipe's sensors and annotators, and (product, wanted by) pairs.
    pub fn of(
        registry: &Registry,
        renderer: &dyn Renderer,
        denoiser: Option<&dyn Denoiser>,
        makers: Vec<(String, Maker)>,
        wants: Vec<(String, String)>,
    ) -> Result<Self, Vec<Error>> {
        let mut candidates: Vec<Candidate> =
            makers.into_iter().map(|(id, maker)| Candidate::new(&id, maker, true)).collect();
        // What the recipe sets up replaces the defaults of every kind that provides the same.
        let explicit: Vec<KeyId> = candidates.iter().flat_map(|candidate| candidate.provides.clone()).collect();
        for entry in registry.of_slot(Slot::Sensor).chain(registry.of_slot(Slot::Annotate)) {
            let maker = match entry.construct_str("").map(|constructed| constructed.stage) {
                Ok(Stage::Sensor(sensor)) => Maker::Sensor(sensor),
                Ok(Stage::Annotate(annotator)) => Maker::Annotator(annotator),
                _ => continue,
            };
            if !maker.provides().iter().any(|key| explicit.iter().any(|other| other.name == key.name)) {
                candidates.push(Candidate::new(entry.kind, maker, false));
            }
        }
        let guides = denoiser.map(|denoiser| denoiser.guides());
        let mut planner =
            Planner { offers: renderer.offers(), guides, candidates, lines: Vec::new(), errors: Vec::new() };
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
    fn new(id: &str, maker: Maker, explicit: bool) -> Self {
        let (provides, reads) = (maker.provides(), maker.reads());
        Self { stage: format!("{}.{id}", maker.slot()), maker: Some(maker), provides, reads, explicit }
    }
}

struct Planner {
    offers: Vec<KeyId>,
    /// What the denoiser reads beside the picture; none if there is no denoiser.
    guides: Option<Vec<KeyId>>,
    candidates: Vec<Candidate>,
    lines: Vec<Line>,
    errors: Vec<Error>,
}

impl Planner {
    /// Wants a product, and first all that its provider reads. `path` holds the makers on the way here.
    fn want(&mut self, name: &str, by: &str, path: &mut Vec<usize>) {
        if let Some(line) = self.lines.iter_mut().find(|line| line.key.name == name) {
            if !line.wanted_by.iter().any(|other| other == by) {
                line.wanted_by.push(by.to_owned());
            }
            return;
        }
        if self.of_denoiser(name, by, path) {
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
                let mut names: Vec<String> = several.iter().map(|&i| self.candidates[i].stage.clone()).collect();
                names.extend(offered.map(|_| "render".to_owned()));
                self.fail(
                    Error::new(format!("product `{name}` has several providers: {}", names.join(", ")))
                        .help("keep one of them; name the one you want in a [sensor.<id>] or [annotate.<id>] table"),
                );
            }
        }
    }

    /// Wants a product that is the denoiser's affair; false if it is not.
    fn of_denoiser(&mut self, name: &str, by: &str, path: &mut Vec<usize>) -> bool {
        let line = |key: KeyId, provider: &str| Line { key, provider: provider.into(), wanted_by: vec![by.into()] };
        let Some(guides) = self.guides.clone() else {
            if name == DENOISER.name() {
                self.lines.push(line(DENOISER.id(), "denoise"));
            }
            return name == DENOISER.name();
        };
        if !self.offers.iter().any(|key| key.name == RADIANCE.name()) {
            return false;
        }
        if name == RADIANCE_NOISY.name() {
            self.lines.push(line(RADIANCE_NOISY.id(), "render"));
        } else if name == RADIANCE.name() {
            self.want(RADIANCE_NOISY.name(), "denoise", path);
            for guide in guides {
                if !self.offers.iter().any(|key| key.name == guide.name) {
                    self.fail(
                        Error::new(format!("the denoiser needs `{}`, which the renderer does not offer", guide.name))
                            .help("choose another [denoise] or another [render]"),
                    );
                }
                self.want(guide.name, "denoise", path);
            }
            self.lines.push(line(RADIANCE.id(), "denoise"));
        } else if name == DENOISER.name() {
            self.want(RADIANCE.name(), "denoise", path);
            self.lines.push(line(DENOISER.id(), "denoise"));
        } else {
            return false;
        }
        true
    }

    fn provide(&mut self, index: usize, name: &str, by: &str, path: &mut Vec<usize>) {
        if path.contains(&index) {
            let chain: Vec<&str> = path.iter().chain([&index]).map(|&i| self.candidates[i].stage.as_str()).collect();
            return self.fail(Error::new(format!("stages need each other in a circle: {}", chain.join(" → "))));
        }
        let candidate = &self.candidates[index];
        let (id, reads, provides) = (candidate.stage.clone(), candidate.reads.clone(), candidate.provides.clone());
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
        let of_denoiser =
            |name: &str| self.lines.iter().any(|line| line.provider == "denoise" && line.key.name == name);
        // What the denoiser calls the noisy picture is the picture to the renderer.
        let as_rendered = |line: &Line| match line.key.name == RADIANCE_NOISY.name() {
            true => RADIANCE.id(),
            false => line.key,
        };
        let mut plan = Plan {
            rendered: self.lines.iter().filter(|line| line.provider == "render").map(as_rendered).collect(),
            denoised: of_denoiser(RADIANCE.name()),
            denoiser_wanted: of_denoiser(DENOISER.name()),
            per_scene: Vec::new(),
            per_view: Vec::new(),
            lines: Vec::new(),
            notes: Vec::new(),
        };
        plan.lines = self.lines;
        // Lines stand in dependency order, so the first line of a maker is when it has to run.
        for line in &plan.lines {
            let Some(candidate) = self.candidates.iter_mut().find(|candidate| line.provider == candidate.stage) else {
                continue;
            };
            if let Some(maker) = candidate.maker.take() {
                let scope = match &maker {
                    Maker::Sensor(_) => Scope::View,
                    Maker::Annotator(annotator) => annotator.scope(),
                };
                let step = Step { stage: candidate.stage.clone(), maker, explicit: candidate.explicit };
                match scope {
                    Scope::Scene => plan.per_scene.push(step),
                    Scope::View => plan.per_view.push(step),
                }
            }
        }
        for candidate in self.candidates.iter().filter(|candidate| candidate.explicit && candidate.maker.is_some()) {
            let names: Vec<&str> = candidate.provides.iter().map(|key| key.name).collect();
            plan.notes.push(
                Error::new(format!("{} is not computed: no writer wants it", candidate.stage))
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
                ((*id).to_owned(), Maker::Annotator(Box::new(Step1(reads.to_vec(), provides.to_vec()))))
            })
            .collect();
        let wants = wants.iter().map(|name| ((*name).to_owned(), "write.w".to_owned())).collect();
        let plan = Plan::of(&Registry::default(), &Offers(vec![PIXELS.id()]), None, annotators, wants);
        match (plan, expected) {
            (Ok(plan), Ok(expected)) => {
                let steps =
                    plan.per_scene.iter().chain(&plan.per_view).map(|step| step.stage.trim_start_matches("annotate."));
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
        check(
            &[("x", &[B.id()], &[A.id()]), ("y", &[A.id()], &[B.id()])],
            &["a"],
            Err("annotate.x → annotate.y → annotate.x"),
        );
        check(&[("x", &[WRONG_PIXELS.id()], &[A.id()])], &["a"], Err("as PerInstance<f64>"));
        check(&[("x", &[PIXELS.id()], &[S.id()])], &["s"], Err("works once a scene"));
    }
}
