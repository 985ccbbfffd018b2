//! Converts a dataset of any format to other formats, given names of writer kinds and options.

use crate::left_out::LeftOutReport;
use crate::run::progress::{Reporter, count};
use crate::run::stop::Stop;
use crate::run::{Converted, check_images, check_place, convert_dataset, products_of};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use syntable_model::error::{Error, Result};
use syntable_model::reader::Source;
use syntable_model::registry::{ConstructError, Entry, Registry, Slot, Stage};
use syntable_model::stage::{InputNeed, Writer};
use syntable_model::store::StoreFolder;
use syntable_model::words::SHOWN;

/// Source, target formats and options of a conversion.
pub struct ConvertOptions {
    /// Folder of the dataset, or its annotation file if the folder has several.
    pub dataset: PathBuf,
    /// Format of the dataset; `None` detects it.
    pub format: Option<String>,
    /// Whether to read files outside the dataset's folder that the dataset refers to.
    pub trust_paths: bool,
    /// Folder of the dataset's images; `None` finds it by the layout of the format.
    pub image_folder: Option<PathBuf>,
    /// Kinds of writers, each at most once.
    pub to: Vec<String>,
    /// Options of writers as `KIND.KEY=VALUE`, with the value in TOML.
    pub set: Vec<String>,
    /// Output folder, of this machine or of another store: new, or empty.
    pub out: StoreFolder,
    /// Number of threads.
    pub threads: usize,
    /// Ends the conversion early on request.
    pub stop: Stop,
}

impl ConvertOptions {
    /// Converts a dataset with writers of these kinds and their default options.
    pub fn new(dataset: impl Into<PathBuf>, to: &[&str], out: impl Into<StoreFolder>) -> Self {
        Self {
            dataset: dataset.into(),
            format: None,
            trust_paths: false,
            image_folder: None,
            to: to.iter().map(|kind| (*kind).to_owned()).collect(),
            set: Vec::new(),
            out: out.into(),
            threads: crate::workers::available(),
            stop: Stop::default(),
        }
    }
}

/// Result of a finished conversion.
pub struct Conversion {
    /// Format of the source dataset.
    pub format: &'static str,
    /// Number of written images, and the data that the result omits.
    pub converted: Converted,
    /// Products that lists such as `include` name by default and that the dataset lacks. The lists were shortened.
    pub shortened: BTreeSet<String>,
}

/// Converts a dataset.
///
/// # Errors
/// If the request is invalid, the dataset cannot be opened, or nothing can be written. Unreadable images are not
/// errors: [`Conversion::left_out`] lists them.
pub fn convert(registry: &Registry, options: &ConvertOptions, reporter: &dyn Reporter) -> Result<Conversion> {
    let writers = asked_writers(registry, options)?;
    if let Some(folder) = options.out.local() {
        check_place(&folder, &options.dataset)?;
    }
    let named = Source::at_name(&options.dataset, options.image_folder.as_deref())?.trusting(options.trust_paths);
    let (format, dataset) = registry.open_dataset(&named, options.format.as_deref())?;
    check_images(&dataset, &options.dataset)?;
    let has = products_of(registry, &dataset);
    let mut shortened = BTreeSet::new();
    writers.iter().try_for_each(|writer| writer.check_given(&has))?;
    let writers = writers.into_iter().map(|writer| writer.without_missing(&has, &mut shortened));
    let writers = writers.collect::<Result<Vec<_>>>()?;
    let how = (options.threads, &options.stop);
    let converted = convert_dataset(registry, &dataset, &writers, &options.out, how, reporter)?;
    Ok(Conversion { format: format.name(), converted, shortened })
}

impl Conversion {
    /// Products that the formats can store and the dataset lacks.
    pub fn lacking(&self) -> BTreeSet<&str> {
        self.shortened.iter().chain(&self.converted.lacking).map(String::as_str).collect()
    }

    /// Images, files, annotations and parts of labels that the result omits.
    pub fn left_out(&self) -> LeftOutReport {
        let it = &self.converted;
        let mut report = LeftOutReport::default();
        let unreadable = [(&it.left_out, "image"), (&it.not_listed, "part"), (&it.parts_left_out, "file")];
        let unreadable: Vec<(&Vec<String>, &str)> = unreadable.into_iter().filter(|it| !it.0.is_empty()).collect();
        if !unreadable.is_empty() {
            let what: Vec<String> = unreadable.iter().map(|(reasons, one)| count(reasons.len() as u32, one)).collect();
            let reasons = unreadable.iter().flat_map(|(reasons, _)| reasons.iter().take(SHOWN));
            let reasons = reasons.map(|reason| Error::new(reason.clone()));
            report.add(format!("{} left out as unreadable", what.join(" and ")), reasons);
        }
        report.annotations(&it.not_objects);
        if !it.not_kept.is_empty() {
            let summary = format!("{} with labels not kept", count(it.not_kept.len() as u32, "field"));
            report.add(summary, it.not_kept.iter().map(|it| Error::new(it.to_string())));
        }
        if !it.without_pixels.is_empty() {
            let summary = format!("{} without pixels", count(it.without_pixels.len() as u32, "object"));
            report.add(summary, it.without_pixels.iter().take(SHOWN).map(|object| Error::new(object.clone())));
        }
        report.losses(&it.losses);
        report
    }
}

fn asked_writers<'a>(registry: &'a Registry, options: &ConvertOptions) -> Result<Vec<RequestedWriter<'a>>> {
    let ConvertOptions { to, set, .. } = options;
    let writers: Vec<_> = to.iter().map(|kind| RequestedWriter::new(registry, kind, set)).collect::<Result<_>>()?;
    if let Some(set) = set.iter().find(|set| !to.iter().any(|kind| option_of(set, kind).is_some())) {
        let kind = to.first().map_or("KIND", String::as_str);
        let (what, help) = match set.split_once('=') {
            None => ("the option or its value is missing", format!("write `{kind}.KEY=VALUE`")),
            Some((key, _)) if !key.contains('.') => {
                ("the name of a writer is missing", format!("write `{kind}.{set}`"))
            }
            Some(_) => ("no writer of `options.to` has this name", "write it as `KIND.KEY=VALUE`".to_owned()),
        };
        return Err(Error::new(format!("`options.set` {set}: {what}")).help(help).of_request());
    }
    if to.iter().collect::<BTreeSet<_>>().len() < to.len() {
        return Err(Error::new("`options.to` repeats a kind").help("name each once"));
    }
    Ok(writers)
}

/// The text after `KIND.` in an option for this kind.
fn option_of<'a>(set: &'a str, kind: &str) -> Option<&'a str> {
    set.strip_prefix(kind)?.strip_prefix('.')
}

/// A writer that [`ConvertOptions::to`] requests.
struct RequestedWriter<'a> {
    entry: &'a Entry,
    options: toml::Table,
    /// Names of the options that [`ConvertOptions::set`] sets.
    given: BTreeSet<String>,
    writer: Box<dyn Writer>,
}

impl<'a> RequestedWriter<'a> {
    fn new(registry: &'a Registry, kind: &str, set: &[String]) -> Result<Self> {
        Self::constructed(registry, kind, set).map_err(Error::of_request)
    }

    fn constructed(registry: &'a Registry, kind: &str, set: &[String]) -> Result<Self> {
        let Some(entry) = registry.find(Slot::Write, kind) else {
            let kinds: Vec<&str> = registry.of_slot(Slot::Write).map(|entry| entry.kind).collect();
            return Err(Error::new(format!("`options.to` {kind}: unknown kind of writer")).help(
                match syntable_recipe::nearest(kind, kinds.iter().copied()) {
                    Some(near) => format!("did you mean `{near}`? available kinds: {}", kinds.join(", ")),
                    None => format!("available kinds: {}", kinds.join(", ")),
                },
            ));
        };
        let given: Vec<&str> = set.iter().filter_map(|set| option_of(set, kind)).collect();
        let key = |option: &str| option.split(['=', '.']).next().unwrap_or_default().trim().to_owned();
        let text: String = given.iter().map(|option| format!("{option}\n")).collect();
        let listed = format!("`syntable list {kind}` shows the options");
        let refuse = |message: String| Error::new(message).help(listed.clone());
        let constructed = entry.construct_str(&text).map_err(|error| match error {
            ConstructError::Form(error) => refuse(format!("`options.set` {kind}: {}", error.message())),
            ConstructError::Invalid(invalid) => {
                // The text as given, with the value.
                let name = invalid.key.split(['.', '[']).next().unwrap_or_default();
                let as_given = given.iter().find(|option| key(option) == name).copied().unwrap_or(&invalid.key);
                let error = Error::new(format!("`options.set` {kind}.{as_given}: {}", invalid.message));
                error.help(invalid.help.as_ref().map_or_else(|| listed.clone(), |help| format!("{help}; {listed}")))
            }
        })?;
        let given = given.iter().map(|option| key(option)).collect();
        let writer = writer_of(entry, constructed.stage)?;
        Ok(Self { entry, options: constructed.options, given, writer })
    }

    /// Refuses an option of [`ConvertOptions::set`] that requires a product that the dataset lacks.
    fn check_given(&self, has: &BTreeSet<String>) -> Result<()> {
        let reads = self.writer.reads();
        let lacking = reads.iter().filter(|input| input.need != InputNeed::Always && !has.contains(&input.product));
        let mut asked = lacking.filter_map(|input| Some((input.option.as_ref()?, &input.product)));
        let Some((option, product)) = asked.find(|(option, _)| self.given.contains(*option)) else { return Ok(()) };
        let kind = self.entry.kind;
        let value = self.options.get(option).map_or_else(String::new, |value| format!("={value}"));
        Err(Error::new(format!("`options.set` {kind}.{option}{value} needs `{product}`, which the dataset lacks"))
            .help(format!("leave the option out: `{kind}` then writes the products of the dataset")))
    }

    /// Removes the entries of lists such as `include` whose products the dataset lacks, and returns the writer with the
    /// removed products. A list that the caller set stays as it is, and so does a list that would become empty.
    fn without_missing(
        mut self,
        has: &BTreeSet<String>,
        lacking: &mut BTreeSet<String>,
    ) -> Result<(String, Box<dyn Writer>)> {
        let mut missing: BTreeMap<String, BTreeSet<usize>> = BTreeMap::new();
        let mut products: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for input in self.writer.reads().into_iter().filter(|input| !has.contains(&input.product)) {
            let Some((list, place)) = input.option.as_deref().and_then(entry_of) else { continue };
            if !self.given.contains(list) {
                missing.entry(list.to_owned()).or_default().insert(place);
                products.entry(list.to_owned()).or_default().insert(input.product);
            }
        }
        let kind = self.entry.kind.to_owned();
        let mut is_changed = false;
        for (list, places) in missing {
            let Some(toml::Value::Array(entries)) = self.options.get_mut(&list) else { continue };
            if places.len() < entries.len() {
                let mut place = 0..;
                entries.retain(|_| place.next().is_none_or(|place| !places.contains(&place)));
                lacking.extend(products.remove(&list).unwrap_or_default());
                is_changed = true;
            }
        }
        let suited = |writer: Box<dyn Writer>| writer.for_dataset(has).unwrap_or(writer);
        if !is_changed {
            return Ok((kind, suited(self.writer)));
        }
        let error = |what: String| Error::new(format!("`options.to` {kind}: {what}"));
        let text = toml::to_string(&self.options).map_err(|it| error(it.to_string()))?;
        let constructed = self.entry.construct_str(&text).map_err(|it| match it {
            ConstructError::Form(it) => error(it.message().to_owned()),
            ConstructError::Invalid(it) => error(it.message),
        })?;
        Ok((kind, suited(writer_of(self.entry, constructed.stage)?)))
    }
}

/// The name of a list and an index: `include[3]`.
fn entry_of(option: &str) -> Option<(&str, usize)> {
    let (list, place) = option.strip_suffix(']')?.split_once('[')?;
    Some((list, place.parse().ok()?))
}

/// The stage as a writer of images.
///
/// # Errors
/// If the writer writes scenes, which a dataset from files lacks.
fn writer_of(entry: &Entry, stage: Stage) -> Result<Box<dyn Writer>> {
    match stage {
        Stage::Write(writer) => Ok(writer),
        _ => Err(Error::new(format!(
            "`options.to` {}: this writer stores bodies, materials and lights of scenes; a dataset from files has only images and labels",
            entry.kind
        ))
        .help("add it to the recipe of a run instead")),
    }
}
