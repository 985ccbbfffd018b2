//! Arguments that several verbs have.

use std::path::{Path, PathBuf};
use syntable_cli::clap::{Arg, ArgAction, ArgMatches, value_parser};
use syntable_cli::{Exit, IMAGE_FOLDER, TRUST_PATHS};
use syntable_model::reader::Source;

/// The dataset.
pub fn dataset() -> Arg {
    Arg::new("dataset")
        .value_name("DATASET")
        .required(true)
        .value_parser(value_parser!(PathBuf))
        .help("Folder of a dataset in any readable format, or its annotation file")
}

/// `--format` of the dataset.
pub fn format() -> Arg {
    Arg::new("format")
        .long("format")
        .value_name("FORMAT")
        .help("Format of the dataset (see `syntable list formats`). Default: detected")
}

/// `--trust-paths` of the dataset.
pub fn trust_paths() -> Arg {
    Arg::new("trust-paths").long("trust-paths").action(ArgAction::SetTrue).help(TRUST_PATHS)
}

/// `--image-folder` of the dataset.
pub fn image_folder() -> Arg {
    Arg::new("image-folder")
        .long("image-folder")
        .value_name("DIR")
        .value_parser(value_parser!(PathBuf))
        .help(IMAGE_FOLDER)
}

/// The dataset at a path or a URL, with the requested folder of images and access to files outside.
pub fn source(path: &Path, arguments: &ArgMatches) -> Result<Source, Exit> {
    let image_folder = arguments.get_one::<PathBuf>("image-folder").map(PathBuf::as_path);
    let source = Source::at_name(path, image_folder).map_err(Exit::stopped)?;
    Ok(source.trusting(arguments.get_flag("trust-paths")))
}

/// `--scores` of predictions.
pub fn scores() -> Arg {
    Arg::new("scores")
        .long("scores")
        .value_name("FILE")
        .value_parser(value_parser!(PathBuf))
        .help("Show the scores of predictions, and the worst images, from a file of `syntable eval --save FILE`")
}

/// `--threads`.
pub fn threads(help: &'static str) -> Arg {
    Arg::new("threads").long("threads").value_name("N").value_parser(value_parser!(u16).range(1..=1024)).help(help)
}

/// The requested number of threads, or else the number of cores.
pub fn threads_of(arguments: &ArgMatches) -> usize {
    syntable_cli::threads(arguments.get_one("threads").copied())
}

/// `--port` of a server.
pub fn port() -> Arg {
    Arg::new("port")
        .long("port")
        .value_name("PORT")
        .value_parser(value_parser!(u16))
        .default_value("0")
        .help("Port of the loopback address; 0 for any free port")
}
