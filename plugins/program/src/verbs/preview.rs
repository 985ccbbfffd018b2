//! `syntable preview`.

use std::path::PathBuf;
use syntable_cli::clap::{Arg, ArgAction, ArgMatches, Args, Command, FromArgMatches, value_parser};
use syntable_cli::{
    Console, Ends, Exit, Message, OutputFile, RecipeArgs, Verb, check_outputs, ended, on_signals, threads, with_flags,
};
use syntable_model::error::Error;
use syntable_model::registry::Registry;
use syntable_report::preview::{PassEnd, Preview, PreviewOptions};
use syntable_runtime::run::SceneRange;
use syntable_runtime::run::progress::count;

syntable_cli::register_verb!(Verb { command, run, crate_name: env!("CARGO_PKG_NAME") });

fn command() -> Command {
    let flag = |name: &'static str, help: &'static str| Arg::new(name).long(name).action(ArgAction::SetTrue).help(help);
    let number = |name: &'static str| Arg::new(name).long(name).value_name("N");
    RecipeArgs::augment_args(Command::new("preview"))
        .about("Render a few views of a few scenes quickly, on one contact sheet; --watch repeats it after every save")
        .arg(
            Arg::new("scenes")
                .long("scenes")
                .value_name("A..B")
                .value_parser(str::parse::<SceneRange>)
                .help("Scenes to show: `A..B` (without B), `A..`, `..B`, or one number. Default: the first two"),
        )
        .arg(
            number("samples")
                .default_value("4")
                .value_parser(value_parser!(u32).range(1..=1_048_576))
                .help("Maximum samples per pixel; images are denoised"),
        )
        .arg(
            number("width")
                .default_value("320")
                .value_parser(value_parser!(u32).range(16..=4096))
                .help("Maximum width of an image, px. Larger images are rendered with fewer pixels"),
        )
        .arg(flag(
            "labels",
            "Show labels next to the images: visible masks, and amodal outlines with the occluded parts",
        ))
        .arg(Arg::new("out").short('o').long("out").value_name("FILE").value_parser(value_parser!(PathBuf)).help(
            "PNG file of the sheet. Default: `<recipe>.preview.png` in the current folder, or no file with --serve",
        ))
        .arg(flag(
            "watch",
            "Keep running, and render the changes after every save of the recipe or of a file that it names",
        ))
        .arg(flag("serve", "Show the sheet in the browser, for you only, and update it after every save"))
        .arg(
            number("port")
                .default_value("0")
                .value_parser(value_parser!(u16))
                .requires("serve")
                .help("Port of --serve; 0 for any free port"),
        )
        .arg(
            number("threads")
                .value_parser(value_parser!(u16).range(1..=1024))
                .help("Worker threads. Default: all cores. The images do not depend on their number"),
        )
        .arg(flag("allow-code", "Run code that the recipe brings: native libraries and programs"))
        .after_help(
            "Examples:
  syntable preview recipe.toml                     recipe.preview.png
  syntable preview recipe.toml --watch --labels    the same with labels, again after every save
  syntable preview recipe.toml --serve             in the browser
  syntable preview recipe.toml --scenes 3..6 --views 4 --width 160",
        )
}

fn run(console: &Console, registry: &Registry, arguments: &ArgMatches) -> Result<(), Exit> {
    let recipe =
        RecipeArgs::from_arg_matches(arguments).map_err(|error| Exit::wrong(Error::new(error.to_string().trim())))?;
    let number = |name: &str| arguments.get_one::<u32>(name).copied().unwrap_or(1);
    let serve = arguments.get_flag("serve").then(|| arguments.get_one::<u16>("port").copied().unwrap_or_default());
    let out = arguments.get_one::<PathBuf>("out").cloned();
    let out = out.or_else(|| serve.is_none().then(|| PreviewOptions::default_out(recipe.recipe.as_deref())));
    let sheet = OutputFile { option: "--out", path: out.as_ref(), start: b"" };
    check_outputs(&[sheet], recipe.recipe.as_deref().as_slice(), false)?;
    if let Some(path) = out.as_ref().filter(|path| !path.extension().is_some_and(|it| it.eq_ignore_ascii_case("png"))) {
        let error = Error::new("--out names no PNG file, and the sheet is one").in_file(path);
        return Err(Exit::wrong(error.help(format!("name it {}", path.with_extension("png").display()))));
    }
    let options = PreviewOptions {
        recipe: recipe.request(),
        scenes: arguments.get_one::<SceneRange>("scenes").copied(),
        samples: number("samples"),
        width: number("width"),
        labels: arguments.get_flag("labels"),
        allow_code: arguments.get_flag("allow-code"),
        wording: with_flags,
        out,
        serve,
        threads: threads(arguments.get_one("threads").copied()),
    };
    let mut preview = Preview::new(registry, options, console.reporter()).map_err(Exit::stopped)?;
    let is_service = serve.is_some() || arguments.get_flag("watch");
    let ends = if is_service { Ends::Service } else { Ends::Work("the images so far are kept") };
    let stop = on_signals(console, ends)?;
    let places: String = preview.places().into_iter().map(|place| format!("{place}\n")).collect();
    if is_service {
        console.print(&places)?;
        // A signal is how it ends.
        return preview.watch(&stop).map_err(Exit::stopped);
    }
    match preview.once(&stop).map_err(Exit::stopped)? {
        PassEnd::Done { failed, is_lossy } => {
            console.print(&places)?;
            let failed = (failed > 0).then(|| format!("{} failed", count(failed, "scene")));
            let lossy = is_lossy.then(|| "stages omitted labels: see the warnings above".to_owned());
            let messages: Vec<Message> =
                failed.into_iter().chain(lossy).map(|what| Message::Error(Error::new(what))).collect();
            if messages.is_empty() { Ok(()) } else { Err(Exit { code: 3, messages }) }
        }
        PassEnd::Mistaken => Err(Exit { code: 2, messages: Vec::new() }),
        PassEnd::Stopped => {
            let reason = stop.requested().map(|reason| format!(" by {reason}")).unwrap_or_default();
            Err(ended(&stop, Error::new(format!("stopped{reason}"))))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_is_valid() {
        command().debug_assert();
    }
}
