//! The writer `exec`.

use crate::answer::Answer;
use crate::message::Message;
use crate::program::{Processes, Program, check_names};
use std::sync::Arc;
use syntable_formats::encode::json_shard::{for_each_line, push_line};
use syntable_formats::encode::kind::accepts;
use syntable_formats::record_arrays;
use syntable_model::prelude::*;

/// Files from a program in any language.
///
/// The program gets the products that the recipe names in `include`, and answers with files. Its answers must depend on nothing
/// but its messages. The book's chapter
/// [Programs as stages](https://github.com/syntable/syntable/blob/main/book/src/programs.md) describes the messages.
///
/// # Behavior
///
/// The processes start with the first view and end with the run. A process that ends or gives no answer in time is replaced. The
/// program has no need to write files itself: files outside its answers belong to no dataset, and a run that is interrupted leaves
/// them behind.
///
/// # Output
///
/// The files of the answers, at the paths that the program names.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExecWriter {
    /// The program.
    pub program: Program,
    /// Products that it gets.
    #[schemars(length(min = 1))]
    pub include: Vec<ProductName>,
    /// Whether it gets a message at the end of the run, for files that cover many scenes.
    #[serde(default)]
    pub finish: bool,
}

impl Config for ExecWriter {
    type Stage = dyn Writer;
    const KIND: &'static str = "exec";
    const EXAMPLE: &'static str = r#"include = ["rgb"]
program = { file = "${PROGRAMS}/ppm.sh" }"#;

    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        check_names("include", self.include.iter().map(ProductName::as_str))?;
        let names: Vec<String> = self.include.iter().map(|name| name.as_str().to_owned()).collect();
        let processes = Processes::new(self.program, &names, &[]);
        let processes = processes.map_err(|error| ConfigError::new("program", error.to_string()))?;
        Ok(Box::new(ProgramWriter { include: self.include, finish: self.finish, processes: Arc::new(processes) }))
    }
}

register!(ExecWriter);

struct ProgramWriter {
    include: Vec<ProductName>,
    finish: bool,
    processes: Arc<Processes>,
}

impl Writer for ProgramWriter {
    fn reads(&self) -> Vec<Input> {
        Input::included(&self.include, Accepts::when(|key| accepts(key, record_arrays::check)))
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        let processes = Arc::clone(&self.processes);
        Ok(Box::new(ProgramSceneWriter { processes, output, records: Vec::new(), keeps_records: self.finish }))
    }

    fn finish(&self, cx: &DatasetContext, _: &Products, finish: &Finish) -> Result<()> {
        if !self.finish {
            return Ok(());
        }
        let mut records: Vec<String> = Vec::new();
        for_each_line(finish, |_, line| {
            let record =
                serde_json::from_str(line).map_err(|error| Error::new(format!("a record is damaged: {error}")))?;
            records.push(record);
            Ok(())
        })?;
        let scenes: Vec<u64> = finish.scenes().iter().map(|scene| scene.0.into()).collect();
        let message = Message::new("finish")
            .text("name", &cx.dataset.name)
            .integers("scenes", &scenes, true)
            .bytes("records", serde_json::Value::from(records).to_string().into_bytes());
        for (path, bytes) in self.processes.ask(message, cx.workers, cx.log)?.files()? {
            finish.write(&path, |file| file.write_all(&bytes).map_err(|error| Error::io(&path, &error)))?;
        }
        Ok(())
    }
}

struct ProgramSceneWriter {
    processes: Arc<Processes>,
    output: Output,
    /// Lines of JSON.
    records: Vec<u8>,
    keeps_records: bool,
}

impl SceneWriter for ProgramSceneWriter {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        let stream = Stream::root(cx.dataset.seed).child(&cx.dataset.name).child("write.exec").child(self.output.id());
        let (message, _) = Message::new("view").of_view(cx, &stream).products(cx.size, products)?;
        let mut answer: Answer = self.processes.ask(message, cx.workers, cx.log)?;
        match answer.take_record() {
            Some(record) if self.keeps_records => push_line(&mut self.records, &record)?,
            Some(_) => {
                return Err(Error::new("the answer has a record, and no `finish` gets it").help("set finish = true"));
            }
            None => {}
        }
        answer.files()?.iter().try_for_each(|(path, bytes)| self.output.write(path, bytes))
    }

    fn close(self: Box<Self>, _: &ImagesContext, _: &Products) -> Result<()> {
        if self.keeps_records { self.output.write_shard(&self.records) } else { Ok(()) }
    }
}
