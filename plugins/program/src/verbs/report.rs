//! `syntable report`.

use super::arguments;
use std::path::PathBuf;
use syntable_cli::clap::{Arg, ArgAction, ArgMatches, Command, value_parser};
use syntable_cli::{Console, Ends, Exit, Message, Verb, amount, ended, on_signals};
use syntable_model::registry::Registry;
use syntable_report::report::make::{ReportOptions, make};
use syntable_runtime::images::ImageWork;
use syntable_runtime::run::progress::count;
use syntable_runtime::workers::Pool;

syntable_cli::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

fn command() -> Command {
    let flag = |name: &'static str| Arg::new(name).long(name);
    Command::new("report")
        .about("Make web pages about a dataset: card, statistics, images with labels, occlusion graphs, scenes in 3-D")
        .arg(arguments::dataset())
        .arg(flag("out").short('o').value_name("DIR").value_parser(value_parser!(PathBuf)).help(
            "Folder of the report. Default: the dataset's folder with the suffix `-report`. Open its index.html",
        ))
        .arg(flag("overwrite").action(ArgAction::SetTrue).help("Replace the report in the folder"))
        .arg(arguments::format())
        .arg(arguments::trust_paths())
        .arg(arguments::image_folder())
        .arg(arguments::scores())
        .arg(flag("images").value_name("N").value_parser(amount).default_value("500").help(
            "Maximum images in the report, or `all`: the most occluded images, and others at even intervals. An image takes \
             about 0.1 MB. The statistics always cover all images",
        ))
        .arg(
            flag("scenes")
                .value_name("N")
                .value_parser(amount)
                .default_value("6")
                .help("Maximum scenes in 3-D, or `all`: the first scenes that the writer `gltf` wrote"),
        )
        .arg(flag("labels-only").action(ArgAction::SetTrue).help(
            "Read only labels, which is faster. Omits brightness, depth and near-duplicate views",
        ))
        .arg(arguments::threads("Worker threads. Default: all cores. The report does not depend on their number"))
        .after_help(
            "Examples:
  syntable report data                             data-report/index.html
  syntable report data --out pages --images all    with every image
  syntable report data --scores scores.json        with the worst predictions (see `syntable eval --save`)
  syntable report coco/annotations.json --out pages --format coco",
        )
}

fn run(console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let path = |name: &str| arguments.get_one::<PathBuf>(name).cloned();
    let number = |name: &str| arguments.get_one::<usize>(name).copied().unwrap_or(usize::MAX);
    let Some(dataset) = path("dataset") else { return Ok(()) };
    let options = ReportOptions {
        dataset: arguments::source(&dataset, arguments)?,
        format: arguments.get_one::<String>("format").cloned(),
        out: path("out"),
        overwrite: arguments.get_flag("overwrite"),
        scores: path("scores"),
        images: number("images"),
        scenes: number("scenes"),
        labels_only: arguments.get_flag("labels-only"),
    };
    let (pool, stop) = (
        Pool::new(arguments::threads_of(arguments)).map_err(Exit::stopped)?,
        on_signals(console, Ends::Work("the output stays as it was"))?,
    );
    let work = ImageWork { workers: &pool, reporter: console.reporter(), stop: &stop };
    let made = make(registry, &options, &work).map_err(|error| ended(&stop, error))?;
    made.notes.into_iter().for_each(|note| console.say(&Message::Warning(note)));
    let others = match made.images_not_chosen {
        0 => String::new(),
        others => format!("; --images all adds the other {others}"),
    };
    console.print(&format!(
        "{}, read as {}: {} of {} images with labels, {} in 3-D{others}\n",
        made.index.display(),
        made.format,
        made.images,
        made.all_images,
        count(made.scenes as u32, "scene"),
    ))?;
    Exit::if_left_out(made.left_out, &dataset, "`syntable validate` lists all faults")
}
