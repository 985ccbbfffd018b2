//! The writers of one scene, with the files that they make.

use crate::run::dataset::manifest::Written;
use crate::run::making::losses::{Losses, StageLog};
use crate::run::making::times::Times;
use std::sync::Arc;
use syntable_model::error::Result;
use syntable_model::product::Products;
use syntable_model::stage::{Input, Output, SceneWriter, Subject, Writer};
use syntable_model::store::StoreFolder;

/// The scene writers of a recipe, each with the names of the products that it reads.
pub struct Writers<'m, S: Subject>(Vec<Writing<'m, S>>);

struct Writing<'m, S: Subject> {
    stage: String,
    reads: Vec<String>,
    writer: Box<dyn SceneWriter<S>>,
    output: Output,
    times: &'m Times,
    losses: Arc<Losses>,
}

impl<'m, S: Subject> Writers<'m, S> {
    /// Starts the files of a scene in a folder.
    pub fn start(
        writers: impl IntoIterator<Item = &'m (String, Box<dyn Writer<S>>)>,
        cx: &S::Scene<'_>,
        staged: &StoreFolder,
        (times, losses): (&'m Times, &Arc<Losses>),
    ) -> Result<Self> {
        let start = |(id, writer): &'m (String, Box<dyn Writer<S>>)| {
            let (stage, output) = (format!("write.{id}"), Output::new(staged, id, S::images(cx).scene_id));
            let log = StageLog { log: S::images(cx).log, losses, stage: &stage };
            let scene_writer = times.of(&stage, || writer.scene(&S::scene_with_log(cx, &log), output.clone()))?;
            let losses = Arc::clone(losses);
            Ok(Writing { stage, reads: Input::names(&writer.reads()), writer: scene_writer, output, times, losses })
        };
        writers.into_iter().map(start).collect::<Result<_>>().map(Self)
    }

    /// Writes a view.
    pub fn view(&mut self, cx: &S::View<'_>, products: &Products) -> Result<()> {
        self.view_of(cx, |reads| Ok(products.only(reads)))
    }

    /// Writes a view. Each writer gets the products that `lend` returns for the names that it reads.
    pub fn view_of(&mut self, cx: &S::View<'_>, lend: impl Fn(&[String]) -> Result<Products>) -> Result<()> {
        self.0.iter_mut().try_for_each(|Writing { stage, reads, writer, times, losses, .. }| {
            let log = StageLog { log: S::image(cx).log, losses, stage };
            let lent = lend(reads)?;
            times.of(stage, || writer.view(&S::view_with_log(cx, &log), &lent))
        })
    }

    /// Ends the files of the scene. Returns them by writer.
    pub fn close(self, cx: &S::Scene<'_>, products: &Products) -> Result<Written> {
        let close = |Writing { stage, reads, writer, output, times, losses }: Writing<'m, S>| {
            let log = StageLog { log: S::images(cx).log, losses: &losses, stage: &stage };
            times.of(&stage, || writer.close(&S::scene_with_log(cx, &log), &products.only(&reads)))?;
            Ok((output.id().to_owned(), output.files()))
        };
        self.0.into_iter().map(close).collect()
    }
}
