//! Any text format, by a template.

mod engine;

pub use engine::{Fault, Template};

use crate::files::{products, shard, view};
use crate::jsonl::json as encode;
use serde_json::{Map, Value as Json, json};
use std::path::Path;
use std::sync::{Arc, OnceLock};
use syntable_model::prelude::*;

/// Text files by a [Tera](https://keats.github.io/tera/docs) template, one per view, scene or dataset.
///
/// The template sees each included product under its name, as JSON (masks as COCO runs with their size, arrays as
/// nested lists, values of instances keyed by the id), and `scene.id`, `view.id`, `dataset` (`name`, `seed`, `scenes`,
/// `views_per_scene`, `program`) and `writer` (its id). Per scene, `views` lists the views with their products; per
/// dataset, `scenes` lists the scenes with theirs. `{{ scene.id | pad(width=6) }}` writes zeros in front.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TextTemplate {
    /// The products that the template uses.
    pub include: Vec<ProductName>,
    /// What a file is about.
    pub per: FilePer,
    /// The template itself. Give this or `template_file`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub template: Option<String>,
    /// A file that holds the template. Give this or `template`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub template_file: Option<AssetPath>,
    /// Template of the file's path, relative to the dataset. If it is not given: `{{ writer }}/000000_0000.txt` with
    /// the numbers of scene and view, `{{ writer }}/000000.txt` with the scene's, or `{{ writer }}.txt`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<String>,
}

/// What a file is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FilePer {
    /// One view.
    #[default]
    View,
    /// One scene with all its views.
    Scene,
    /// All scenes. The included products of the whole dataset are held in memory, so include small ones.
    Dataset,
}

/// What a template of the whole dataset may hold, as JSON text.
const LARGEST_DATASET: usize = 512 << 20;

impl Config for TextTemplate {
    type Stage = dyn Writer;
    const KIND: &'static str = "template";
    const EXAMPLE: &'static str = r#"include = ["visible_box"]
per = "view"
path = "boxes/{{ scene.id | pad(width=6) }}_{{ view.id | pad(width=4) }}.csv"
template = """
{% for id, box in visible_box %}{{ id }},{{ box | join(sep=",") }}
{% endfor %}""""#;

    fn build(self) -> Result<Box<dyn Writer>, Invalid> {
        products::check_unique(&self.include)?;
        products::check_free(&self.include, &["dataset", "scene", "view", "scenes", "views", "writer"])?;
        let invalid = |key: &str, fault: Fault| {
            let line = fault.line.map_or(String::new(), |line| format!("line {line} of the template: "));
            Invalid::new(key, format!("{line}{}", fault.message))
        };
        let path = Template::new(self.path.as_deref().unwrap_or(self.per.default_path()));
        let path = path.map_err(|fault| invalid("path", fault))?;
        let body = OnceLock::new();
        match (&self.template, &self.template_file) {
            (Some(text), None) => {
                let template = Template::new(text).map_err(|fault| invalid("template", fault))?;
                body.get_or_init(|| Ok(template));
            }
            (None, Some(_)) => {}
            (None, None) => return Err(Invalid::new("", "neither `template` nor `template_file` is given")),
            (Some(_), Some(_)) => {
                return Err(Invalid::new("template", "`template` and `template_file` are both given"));
            }
        }
        Ok(Box::new(TemplateWriter(Arc::new(Templates { config: self, path, body }))))
    }
}

impl FilePer {
    fn default_path(self) -> &'static str {
        match self {
            Self::View => "{{ writer }}/{{ scene.id | pad(width=6) }}_{{ view.id | pad(width=4) }}.txt",
            Self::Scene => "{{ writer }}/{{ scene.id | pad(width=6) }}.txt",
            Self::Dataset => "{{ writer }}.txt",
        }
    }
}

/// The templates, shared by the scenes that are being written.
struct Templates {
    config: TextTemplate,
    path: Template,
    /// Parsed when it is first used, if it is in a file.
    body: OnceLock<Result<Template>>,
}

impl Templates {
    fn body(&self) -> Result<&Template> {
        let body = self.body.get_or_init(|| {
            // A template that is not inline is in a file: `build` has seen to it.
            let path = self.config.template_file.as_ref().map_or(Path::new(""), AssetPath::path);
            let text = std::fs::read_to_string(path).map_err(|error| Error::io(path, &error))?;
            Template::new(&text).map_err(|fault| fault.into_error(&path.display().to_string()))
        });
        body.as_ref().map_err(Clone::clone)
    }

    /// The path and the text for a context.
    fn render(&self, context: &Json) -> Result<(String, String)> {
        let path = self.path.render(context).map_err(|fault| fault.into_error("`path`"))?;
        let name = match &self.config.template_file {
            Some(file) => file.path().display().to_string(),
            None => "`template`".to_owned(),
        };
        let text = self.body()?.render(context).map_err(|fault| {
            fault.into_error(&name).help("products that a template uses must be named in `include`")
        })?;
        Ok((path.trim().to_owned(), text))
    }

    /// The fields that every context has.
    fn context(&self, dataset: &DatasetInfo, writer: &str) -> Map<String, Json> {
        let dataset = json!({
            "name": dataset.name,
            "seed": dataset.seed,
            "scenes": dataset.scenes,
            "views_per_scene": dataset.views_per_scene,
            "program": dataset.program,
        });
        Map::from_iter([("dataset".to_owned(), dataset), ("writer".to_owned(), writer.into())])
    }
}

struct TemplateWriter(Arc<Templates>);

impl Writer for TemplateWriter {
    fn reads(&self) -> Vec<String> {
        products::names(&self.0.config.include)
    }

    fn scene(&self, site: &Site, output: Output) -> Result<Box<dyn SceneWriter>> {
        // A file that cannot be read or parsed is found before anything is rendered.
        self.0.body()?;
        let context = self.0.context(site.dataset, output.id());
        let scene = Map::from_iter([("scene".to_owned(), json!({ "id": site.scene.id.0 }))]);
        Ok(Box::new(TemplateScene { templates: self.0.clone(), output, context, scene, views: Vec::new() }))
    }

    fn finish(&self, dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
        if self.0.config.per != FilePer::Dataset {
            return Ok(());
        }
        let (mut scenes, mut size) = (Vec::<Json>::new(), 0);
        shard::for_each_line(finish, |scene, line| {
            size += line.len();
            if size > LARGEST_DATASET {
                return Err(Error::new(format!("the included products are more than {} MiB", LARGEST_DATASET >> 20))
                    .help("include fewer or smaller products, or write one file per scene"));
            }
            let read = serde_json::from_str(line).map_err(|error| {
                Error::new(format!("the shard of scene {} is not JSON: {error}", scene.0))
                    .help("the dataset is damaged; run again with --overwrite")
            });
            scenes.push(read?);
            Ok(())
        })?;
        let mut context = self.0.context(dataset, finish.id());
        context.insert("scenes".to_owned(), scenes.into());
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
    /// The views so far, unless every view has its own file.
    views: Vec<Json>,
}

impl SceneWriter for TemplateScene {
    fn view(&mut self, site: &Site, frame: &Frame) -> Result<()> {
        let per_view = self.templates.config.per == FilePer::View;
        let mut record = Map::from_iter([("view".to_owned(), json!({ "id": view(site)?.id.0 }))]);
        for name in &self.templates.config.include {
            let value = encode(frame, name.as_str())?;
            if products::of_scene(frame, name.as_str()) {
                self.scene.insert(name.as_str().to_owned(), value);
            } else {
                record.insert(name.as_str().to_owned(), value);
            }
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

    fn close(mut self: Box<Self>) -> Result<()> {
        self.scene.insert("views".to_owned(), self.views.into());
        match self.templates.config.per {
            FilePer::View => Ok(()),
            FilePer::Scene => {
                self.context.extend(self.scene);
                let (path, text) = self.templates.render(&self.context.into())?;
                self.output.write(&path, text.as_bytes())
            }
            FilePer::Dataset => {
                let mut line = Vec::new();
                shard::push_line(&mut line, &self.scene)?;
                self.output.write_shard(&line)
            }
        }
    }
}

register!(TextTemplate);
