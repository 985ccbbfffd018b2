//! Text files of any format, from a template.

mod budget;
mod engine;
mod fault;
mod guard;
mod names;

pub use engine::CheckedTemplate;
pub use fault::TemplateFault;

use names::ValueShape;
use serde_json::{Map, Value as Json, json};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};
use syntable_formats::encode::json_shard;
use syntable_formats::include::Included;
use syntable_formats::json::of_product;
use syntable_model::files::read_small;
use syntable_model::prelude::*;
use syntable_model::product::Scope;
use syntable_model::stage::DAMAGED;

/// Writes text files of any format from a [Tera](https://keats.github.io/tera/docs) template.
///
/// # Behavior
///
/// The template is rendered once per view, scene or dataset. It sees:
///
/// - each included product under its name, as JSON: masks are COCO's compressed run lengths with their size, arrays are
///   nested lists, values per instance are keyed by the id;
/// - `scene.id` and `view.id`, counted from 0;
/// - `views` with `per = "scene"`: the views of the scene, each with `view.id` and its products;
/// - `scenes` with `per = "dataset"`: the scenes, each with `scene.id`, its products and `views`;
/// - `dataset`: `name`, `seed`, `scenes`, `views_per_scene` and `program`;
/// - `writer`: the id of this writer.
///
/// The filter `pad` adds leading zeros: `{{ scene.id | pad(width=6) }}`. The function `range` returns at most 1000000
/// numbers, and the text of a file has at most 1 GiB. Values of variables and texts of macros have at most 64 MiB each,
/// and loops at most 50 million iterations per file.
///
/// `syntable check` finds variables that no file of this kind has, the fields of `scene`, `view`, `views`, `scenes` and
/// `dataset` among them, unless the template itself asks for them with `if`, `is defined` or `default`. Mistakes that
/// depend on data, such as fields of a product or a filter on its values, appear when the first scene is written.
///
/// # Output
///
/// One text file per view, scene or dataset, at `path`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TextTemplate {
    /// Products that the template uses.
    #[serde(default)]
    pub include: Included,
    /// Scope of a file.
    #[serde(default)]
    pub per: TemplateFilePer,
    /// The template: its text, or `{ file = "labels.tera" }`.
    pub template: TemplateSource,
    /// Template of the file's path, relative to the dataset. If left out: `{id}/{scene:06}_{view:04}.txt` per view,
    /// `{id}/{scene:06}.txt` per scene, `{id}.txt` for the dataset.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
}

/// Location of the template.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum TemplateSource {
    /// In the recipe: the text itself.
    Text(String),
    /// In a file.
    File(TemplateFile),
}

/// A file with a template.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TemplateFile {
    /// Path of the file, UTF-8 text.
    #[schemars(extend("x-syntable-ref" = "file"))]
    pub file: AssetPath,
}

/// Scope of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TemplateFilePer {
    /// One view.
    #[default]
    View,
    /// One scene with all its views.
    Scene,
    /// The dataset. The included products of all scenes are held in memory, at most 512 MiB as JSON.
    Dataset,
}

/// Maximum size of the included products of all scenes, bytes of JSON.
const LARGEST_DATASET: usize = 512 << 20;

impl Config for TextTemplate {
    type Stage = dyn Writer;
    const KIND: &'static str = "template";
    const RENAMED: &'static [(&'static str, &'static str)] = &[("template_file", "template.file")];
    const EXAMPLE: &'static str = r#"include = ["visible_box"]
per = "view"
path = "boxes/{{ scene.id | pad(width=6) }}_{{ view.id | pad(width=4) }}.csv"
template = """
{% for id, box in visible_box %}{{ id }},{{ box | join(sep=",") }}
{% endfor %}""""#;

    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        self.include.check_free(&["dataset", "scene", "view", "scenes", "views", "writer"])?;
        let invalid = |key: &str, fault: TemplateFault| {
            let line = fault.line.map_or(String::new(), |line| format!("line {line} of the template: "));
            ConfigError::new(key, format!("{line}{}", fault.message))
        };
        let (of, shape) = (self.per.words(), self.shape());
        let path = CheckedTemplate::checked(self.path.as_deref().unwrap_or(self.per.default_path()), of, &shape);
        let path = path.map_err(|fault| invalid("path", fault))?;
        let body = match &self.template {
            TemplateSource::Text(text) => {
                let body = CheckedTemplate::checked(text, of, &shape).map_err(|fault| invalid("template", fault))?;
                OnceLock::from(Ok(body))
            }
            TemplateSource::File(_) => OnceLock::new(),
        };
        Ok(Box::new(TemplateWriter(Arc::new(Templates { config: self, path, body }))))
    }
}

impl TextTemplate {
    /// The shape of the contexts, as known before a run. A product may belong to the view, the scene or the dataset.
    fn shape(&self) -> BTreeMap<String, ValueShape> {
        let products = || self.include.names().map(|name| (name.to_owned(), ValueShape::Any));
        let own = |fields: Vec<(&str, ValueShape)>| {
            let fields = fields.into_iter().map(|(name, shape)| (name.to_owned(), shape));
            products().chain(fields).collect::<BTreeMap<_, _>>()
        };
        let id = || ValueShape::record([("id", ValueShape::Scalar)]);
        let views = || ValueShape::list(ValueShape::Record(own(vec![("view", id())])));
        let mut context = own(match self.per {
            TemplateFilePer::View => vec![("scene", id()), ("view", id())],
            TemplateFilePer::Scene => vec![("scene", id()), ("views", views())],
            TemplateFilePer::Dataset => {
                vec![("scenes", ValueShape::list(ValueShape::Record(own(vec![("scene", id()), ("views", views())]))))]
            }
        });
        let dataset = DATASET_FIELDS.map(|name| (name, ValueShape::Scalar));
        context
            .extend([("dataset".to_owned(), ValueShape::record(dataset)), ("writer".to_owned(), ValueShape::Scalar)]);
        context
    }
}

/// The fields of `dataset`.
const DATASET_FIELDS: [&str; 5] = ["name", "seed", "scenes", "views_per_scene", "program"];

impl TemplateFilePer {
    /// Scope of a context, for messages.
    fn words(self) -> &'static str {
        match self {
            Self::View => "a file per view",
            Self::Scene => "a file per scene",
            Self::Dataset => "the file of the dataset",
        }
    }

    fn default_path(self) -> &'static str {
        match self {
            Self::View => "{{ writer }}/{{ scene.id | pad(width=6) }}_{{ view.id | pad(width=4) }}.txt",
            Self::Scene => "{{ writer }}/{{ scene.id | pad(width=6) }}.txt",
            Self::Dataset => "{{ writer }}.txt",
        }
    }
}

/// The templates, shared by all scenes.
struct Templates {
    config: TextTemplate,
    path: CheckedTemplate,
    /// Parsed on first use if the template is in a file.
    body: OnceLock<Result<CheckedTemplate>>,
}

impl Templates {
    fn body(&self) -> Result<&CheckedTemplate> {
        let body = self.body.get_or_init(|| {
            let (name, text) = match &self.config.template {
                TemplateSource::Text(text) => ("`template`".to_owned(), text.clone()),
                TemplateSource::File(TemplateFile { file }) => {
                    let help = "`template.file` counts from the recipe's folder";
                    let bytes = read_small(file.path()).map_err(|error| Error::io(file.path(), &error).help(help))?;
                    let text = String::from_utf8(bytes)
                        .map_err(|_| Error::new("the template is not UTF-8").in_file(file.path()))?;
                    (file.path().display().to_string(), text)
                }
            };
            let config = &self.config;
            CheckedTemplate::checked(&text, config.per.words(), &config.shape())
                .map_err(|fault| fault.into_error(&name))
        });
        body.as_ref().map_err(Clone::clone)
    }

    /// Renders path and text.
    fn render(&self, context: &Json) -> Result<(String, String)> {
        let path = self.path(context)?;
        let name = match &self.config.template {
            TemplateSource::Text(_) => "`template`".to_owned(),
            TemplateSource::File(TemplateFile { file }) => file.path().display().to_string(),
        };
        let text = self.body()?.render(context).map_err(|fault| {
            fault.into_error(&name).help("products that a template uses must be listed in `include`")
        })?;
        Ok((path, text))
    }

    /// Renders the path.
    fn path(&self, context: &Json) -> Result<String> {
        let path = self.path.render(context).map_err(|fault| {
            fault.into_error("`path`").help("a path can use scene.id, view.id, dataset, writer, and included products")
        })?;
        Ok(path.trim().to_owned())
    }

    /// The fields that every context has.
    fn context(&self, dataset: &DatasetInfo, writer: &str) -> Map<String, Json> {
        let values: [Json; DATASET_FIELDS.len()] = [
            dataset.name.as_str().into(),
            dataset.seed.into(),
            dataset.scenes.into(),
            dataset.views_per_scene.into(),
            dataset.program.as_str().into(),
        ];
        let fields = DATASET_FIELDS.map(str::to_owned).into_iter().zip(values);
        let dataset = Json::from(fields.collect::<Map<_, _>>());
        Map::from_iter([("dataset".to_owned(), dataset), ("writer".to_owned(), writer.into())])
    }
}

struct TemplateWriter(Arc<Templates>);

impl Writer for TemplateWriter {
    fn reads(&self) -> Vec<Input> {
        self.0.config.include.inputs(Accepts::Any)
    }

    fn scene(&self, cx: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        // Reports a file that cannot be read or parsed before anything is rendered.
        self.0.body()?;
        let context = self.0.context(cx.dataset, output.id());
        let scene = Map::from_iter([("scene".to_owned(), json!({ "id": cx.scene_id.0 }))]);
        Ok(Box::new(TemplateScene { templates: self.0.clone(), output, context, scene, views: Vec::new() }))
    }

    fn ready(&self) -> Result<()> {
        self.0.body().map(drop)
    }

    fn paths(&self, of: &FileOf) -> Result<Vec<String>> {
        let config = &self.0.config;
        let covers = match (of.scene, of.view) {
            (Some(_), Some(_)) => TemplateFilePer::View,
            (Some(_), None) => TemplateFilePer::Scene,
            _ => TemplateFilePer::Dataset,
        };
        // A path that depends on products is not known before the run.
        let text = config.path.as_deref().unwrap_or_default();
        if covers != config.per || config.include.names().any(|name| text.contains(name)) {
            return Ok(Vec::new());
        }
        let mut context = self.0.context(of.dataset, of.id);
        context.extend(of.scene.map(|scene| ("scene".to_owned(), json!({ "id": scene.0 }))));
        context.extend(of.view.map(|view| ("view".to_owned(), json!({ "id": view.0 }))));
        Ok(vec![self.0.path(&context.into())?])
    }

    fn finish_options(&self) -> &'static [&'static str] {
        match self.0.config.per {
            TemplateFilePer::Dataset => &["path", "template"],
            TemplateFilePer::View | TemplateFilePer::Scene => &[],
        }
    }

    fn finish(&self, cx: &DatasetContext, products: &Products, finish: &Finish) -> Result<()> {
        if self.0.config.per != TemplateFilePer::Dataset {
            return Ok(());
        }
        let (mut scenes, mut size) = (Vec::<Json>::new(), 0);
        json_shard::for_each_line(finish, |scene, line| {
            size += line.len();
            if size > LARGEST_DATASET {
                return Err(Error::new(format!("the included products are more than {} MiB", LARGEST_DATASET >> 20))
                    .help("include fewer or smaller products, or write one file per scene"));
            }
            let read = serde_json::from_str(line).map_err(|error| {
                Error::new(format!("the shard of scene {} is not JSON: {error}", scene.0)).help(DAMAGED)
            });
            scenes.push(read?);
            Ok(())
        })?;
        let mut context = self.0.context(cx.dataset, finish.id());
        context.insert("scenes".to_owned(), scenes.into());
        for (name, _) in self.0.config.include.of_scope(products, Scope::Dataset) {
            context.insert(name.to_owned(), of_product(products, name)?);
        }
        let (path, text) = self.0.render(&context.into())?;
        finish.write(&path, |out| out.write_all(text.as_bytes()).map_err(|error| Error::io(&path, &error)))
    }
}

struct TemplateScene {
    templates: Arc<Templates>,
    output: Output,
    /// The fields that every context has.
    context: Map<String, Json>,
    /// The scene's own fields.
    scene: Map<String, Json>,
    /// The views so far; empty if every view has its own file.
    views: Vec<Json>,
}

impl SceneWriter for TemplateScene {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let per_view = self.templates.config.per == TemplateFilePer::View;
        let mut record = Map::from_iter([("view".to_owned(), json!({ "id": cx.view_id.0 }))]);
        let include = &self.templates.config.include;
        for (name, _) in include.of_scope(products, Scope::View) {
            record.insert(name.to_owned(), of_product(products, name)?);
        }
        for (name, _) in include.of_scope(products, Scope::Scene) {
            self.scene.insert(name.to_owned(), of_product(products, name)?);
        }
        if !per_view {
            self.views.push(record.into());
            return Ok(());
        }
        let context = self.context.iter().chain(&self.scene).map(|(key, value)| (key.clone(), value.clone()));
        record.extend(context);
        let (path, text) = self.templates.render(&record.into())?;
        self.output.write(&path, text.as_bytes())
    }

    fn close(mut self: Box<Self>, _: &ImagesContext, products: &Products) -> Result<()> {
        for (name, _) in self.templates.config.include.of_scope(products, Scope::Scene) {
            self.scene.insert(name.to_owned(), of_product(products, name)?);
        }
        self.scene.insert("views".to_owned(), self.views.into());
        match self.templates.config.per {
            TemplateFilePer::View => Ok(()),
            TemplateFilePer::Scene => {
                self.context.extend(self.scene);
                let (path, text) = self.templates.render(&self.context.into())?;
                self.output.write(&path, text.as_bytes())
            }
            TemplateFilePer::Dataset => {
                let mut line = Vec::new();
                json_shard::push_line(&mut line, &self.scene)?;
                self.output.write_shard(&line)
            }
        }
    }
}

register!(TextTemplate);
