//! The annotator `exec`.

use crate::message::Message;
use crate::program::{Processes, Program, check_names};
use std::collections::BTreeMap;
use syntable_formats::encode::kind::ValueKind;
use syntable_formats::record_arrays;
use syntable_model::prelude::*;
use syntable_model::product::DeclaredProduct;

/// Products of each view from a program in any language.
///
/// The program gets the products that the recipe names in `reads`, and answers with the products of `provides`. Its answers must
/// depend on nothing but its messages. The book's chapter
/// [Programs as stages](https://github.com/syntable/syntable/blob/main/book/src/programs.md) describes the messages.
///
/// # Behavior
///
/// The processes start with the first view and end with the run. A process that ends or gives no answer in time is replaced. An
/// answer without a product, or with an array of another type or shape, ends the run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExecAnnotator {
    /// The program.
    pub program: Program,
    /// Products that it gets.
    #[schemars(length(min = 1))]
    pub reads: Vec<ProductName>,
    /// Products that it makes, by name.
    #[schemars(length(min = 1))]
    pub provides: BTreeMap<String, DeclaredProduct>,
}

impl Config for ExecAnnotator {
    type Stage = dyn ImageAnnotator;
    const KIND: &'static str = "exec";
    const EXAMPLE: &'static str = r#"reads = ["rgb", "visible_mask"]
program = { file = "${PROGRAMS}/darkness.py", interpreter = ["python3"] }
provides.darkness = { form = "float per object", doc = "Share of dark pixels." }"#;

    fn build(self) -> Result<Box<dyn ImageAnnotator>, ConfigError> {
        let names = || self.provides.keys().map(String::as_str);
        check_names("reads", self.reads.iter().map(ProductName::as_str))?;
        check_names("provides", names())?;
        let mut reads = Vec::new();
        for (i, name) in self.reads.iter().enumerate() {
            let option = format!("reads[{i}]");
            let key = KeyId::named(name.as_str());
            let key = key.ok_or_else(|| ConfigError::new(&option, format!("`{}` is no product", name.as_str())))?;
            record_arrays::check(&ValueKind::of_key(&key)).map_err(|reason| ConfigError::new(&option, reason))?;
            reads.push(key);
        }
        let mut provides = Vec::new();
        for (name, product) in &self.provides {
            let option = format!("provides.{name}");
            provides.push(product.key(name).map_err(|error| ConfigError::new(&option, error.to_string()))?);
        }
        let stream = names().collect::<Vec<_>>().join(",");
        let text = |keys: &[KeyId]| keys.iter().map(KeyId::to_string).collect::<Vec<_>>();
        let processes = Processes::new(self.program, &text(&reads), &text(&provides));
        let processes = processes.map_err(|error| ConfigError::new("program", error.to_string()))?;
        Ok(Box::new(Annotator { reads, provides, stream, processes }))
    }
}

register!(ExecAnnotator);

/// Name of the random numbers of all such stages.
const STREAM: &str = "annotate.exec";

struct Annotator {
    reads: Vec<KeyId>,
    provides: Vec<KeyId>,
    /// Name of its random numbers.
    stream: String,
    processes: Processes,
}

impl ImageAnnotator for Annotator {
    fn reads(&self) -> Vec<KeyId> {
        self.reads.clone()
    }

    fn provides(&self) -> Vec<KeyId> {
        self.provides.clone()
    }

    fn annotate(&self, cx: &ImageContext, products: &mut Products) -> Result<()> {
        let stream = Stream::root(cx.dataset.seed).child(&cx.dataset.name).child(STREAM).child(&self.stream);
        let message = Message::new("view").of_view(cx, &stream);
        let (message, ids) = message.products(cx.size, &products.only(&self.reads))?;
        let answer = self.processes.ask(message, cx.workers, cx.log)?;
        answer.put(&self.provides, ids, cx.size, products)
    }
}
