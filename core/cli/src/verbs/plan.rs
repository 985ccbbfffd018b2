//! `syntable plan`.

use crate::arguments::{RecipeArgs, threads};
use crate::console::Console;
use crate::exit::Exit;
use crate::signals::{Ends, ended, on_signals};
use clap::Args;
use std::collections::BTreeMap;
use std::time::Duration;
use syntable_model::registry::Registry;
use syntable_recipe::{Component, Recipe};
use syntable_runtime::cache::DiskCache;
use syntable_runtime::run::forecast::{Bound, Forecast, ForecastOptions, forecast};
use syntable_runtime::run::progress::{clock, count};

#[derive(Args)]
pub(crate) struct PlanArgs {
    #[command(flatten)]
    recipe: RecipeArgs,
    /// Also make the first scenes in memory, and estimate how long the whole run takes on this machine.
    #[arg(long)]
    time: bool,
    /// Number of scenes to measure, after one warm-up scene. Default: as many as ten seconds allow, but at least one.
    #[arg(long, value_name = "N", requires = "time", value_parser = clap::value_parser!(u32).range(1..))]
    scenes: Option<u32>,
    /// Worker threads of the run. Default: all cores.
    #[arg(long, requires = "time", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Run code that the recipe brings: native libraries and programs.
    #[arg(long, requires = "time")]
    allow_code: bool,
}

pub(crate) fn plan(console: &Console, registry: &Registry, args: &PlanArgs) -> Result<(), Exit> {
    if args.time {
        return plan_with_time(console, registry, args);
    }
    let recipe = console.load(registry, &args.recipe)?;
    console.print(&format!("{}time: not measured; `--time` makes a few scenes and estimates it\n", table(&recipe)))
}

fn plan_with_time(console: &Console, registry: &Registry, args: &PlanArgs) -> Result<(), Exit> {
    let recipe = console.load_for_run(registry, &args.recipe)?;
    recipe.ready(args.allow_code).map_err(Exit::wrong)?;
    console.print(&table(&recipe))?;
    let stop = on_signals(console, Ends::Work("no file was written"))?;
    let options = ForecastOptions {
        measured: args.scenes,
        threads: threads(args.threads),
        allow_code: args.allow_code,
        cache: DiskCache::of_user(),
        stop: stop.clone(),
    };
    let found = forecast(&recipe, &options, console.reporter()).map_err(|error| ended(&stop, error))?;
    console.print(&in_words(&found))
}

/// The products, their cost, and the disk space of the images.
fn table(recipe: &Recipe) -> String {
    let dataset = &recipe.dataset;
    let images = u64::from(dataset.scenes) * u64::from(dataset.views_per_scene);
    format!(
        "{}: {} × {} = {images} images\n{}{}",
        dataset.name,
        count(dataset.scenes, "scene"),
        count(dataset.views_per_scene, "view"),
        plans(recipe),
        disk(recipe, images)
    )
}

/// The plan of each component.
fn plans(recipe: &Recipe) -> String {
    let total: f64 = recipe.components.weights().map(|(weight, _)| weight).sum();
    let plan = |(weight, component): (f64, &Component)| {
        let of = match component.id.as_str() {
            "" => String::new(),
            id => format!("{id}: about {:.1} % of the scenes\n", 100.0 * weight / total),
        };
        format!("\n{of}{}", component.plan.table(&*component.render))
    };
    recipe.components.weights().map(plan).collect()
}

/// Upper bound on the size of the written images before rendering: the size of their uncompressed numbers.
fn disk(recipe: &Recipe, images: u64) -> String {
    let Some(bytes) = recipe.stored_bytes_per_view() else { return String::new() };
    format!(
        "disk: images take at most {} per view, {} in all, less with compression; masks and records, which follow \
         the number of objects, come on top\n",
        size(bytes),
        size(bytes.saturating_mul(images))
    )
}

fn size(bytes: u64) -> String {
    match bytes as f64 / f64::from(1 << 20) {
        mebibytes if mebibytes < 1024.0 => format!("{mebibytes:.1} MiB"),
        mebibytes => format!("{:.1} GiB", mebibytes / 1024.0),
    }
}

/// Number of stages that a forecast names.
const STAGES: usize = 4;

fn in_words(found: &Forecast) -> String {
    let pace = &found.pace;
    let whole = |seconds: f64| clock(Duration::from_secs_f64(seconds));
    let objects = match pace.objects {
        [one, other] if one == other => format!("with {}", count(one, "object")),
        [fewest, most] => format!("with {fewest} to {most} objects"),
    };
    let mut out = format!(
        "\ntime on this machine, with {}, from {} {objects}:\n",
        count(found.threads as u32, "thread"),
        count(pace.measured, "measured scene"),
    );
    let mut row = |name: &str, text: String| out += &format!("  {name:<7}{text}\n");
    let start = match pace.is_cold {
        true => "part of the only scene".into(),
        false if pace.start_s == 0.0 => "too short to measure".into(),
        false => seconds(pace.start_s),
    };
    row("start", start);
    row(
        "scene",
        format!(
            "{}, {} per view: {} images/h",
            seconds(pace.scene_s),
            seconds(pace.scene_s / f64::from(found.views_per_scene)),
            found.images_per_hour().round()
        ),
    );
    let [least, most] = pace.total_range_s.map(whole);
    let doubt = match pace.measured {
        1 => "from one scene only; --scenes 5 gives a better estimate".to_owned(),
        _ => format!("{least} if all were like the fastest, {most} like the slowest"),
    };
    row("total", format!("{} for {} ({doubt})", whole(pace.total_s), count(found.scenes, "scene")));
    if !found.unmeasured.is_empty() {
        let names = found.unmeasured.join(", ");
        row("rough", format!("too few scenes of {names} were measured: --scenes 20 gives a better estimate"));
    }
    row("disk", format!("{} per scene, {} in all", size(found.scene_bytes), size(found.total_bytes())));
    row("limit", format!("{}; time of a scene: {}", bound(pace.bound), shares(&pace.stages)));
    out
}

fn bound(bound: Bound) -> &'static str {
    match bound {
        Bound::Cores => "the cores of the processor",
        Bound::RenderDevice => "the device that renders",
        Bound::SceneSteps => "the sequential steps within a scene",
    }
}

/// The stages that take the most time of a scene, with their shares.
fn shares(stages: &BTreeMap<String, f64>) -> String {
    let all: f64 = stages.values().sum();
    let mut stages: Vec<(&String, f64)> = stages.iter().map(|(stage, seconds)| (stage, *seconds)).collect();
    stages.sort_by(|(_, one), (_, other)| other.total_cmp(one));
    let share = |(stage, seconds): &(&String, f64)| format!("{stage} {:.0} %", 100.0 * seconds / all.max(1e-9));
    stages.iter().take(STAGES).map(share).collect::<Vec<_>>().join(", ")
}

/// A short time, with two digits.
fn seconds(seconds: f64) -> String {
    match seconds {
        long if long >= 100.0 => clock(Duration::from_secs_f64(long)),
        long if long >= 10.0 => format!("{long:.0} s"),
        middle if middle >= 1.0 => format!("{middle:.1} s"),
        short if short >= 0.1 => format!("{short:.2} s"),
        short => format!("{:.1} ms", 1000.0 * short),
    }
}
