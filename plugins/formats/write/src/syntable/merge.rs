//! Merges the shards of the scenes into the annotation file.

use super::record::DATE;
use super::{Compat, SynTable};
use syntable_formats::coco::{Category, CocoInfo, License};
use syntable_formats::dataset::{DatasetWriter, JsonLayout};
use syntable_formats::read::SUPERCATEGORY;
use syntable_formats::shard::{self, ShardLine, for_each_line};
use syntable_formats::syntable::SCENES;
use syntable_model::prelude::*;

/// Writes the annotation file.
pub fn annotations(config: &SynTable, dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
    let path = config.path(&config.annotation_file);
    let syntable_1 = config.compat == Compat::Syntable1;
    finish.write(&path, |out| {
        let layout = if syntable_1 { JsonLayout::Indented } else { JsonLayout::Lines };
        let mut file = DatasetWriter::new(out, &path, layout)?;
        let categories: Vec<Category> = match config.compat {
            Compat::Coco => dataset.categories().map(|it| category(dataset, it)).collect(),
            Compat::Syntable1 => vec![category(dataset, DatasetInfo::OBJECT)],
        };
        file.header(&info(dataset, syntable_1), &[License::of_assets()], &categories)?;
        shard::merge(dataset, finish, &mut file, |annotations| match config.compat {
            Compat::Syntable1 => annotations,
            Compat::Coco => usize::from(annotations > 0 || !config.skip_empty_images),
        })?;
        if !syntable_1 {
            file.list(SCENES, |scenes| {
                for_each_line(dataset, finish, |_, line| match line {
                    ShardLine::Scene(record) => scenes.raw(record),
                    _ => Ok(()),
                })
            })?;
        }
        file.finish()
    })
}

fn info(dataset: &DatasetInfo, syntable_1: bool) -> CocoInfo {
    CocoInfo {
        description: dataset.name.clone(),
        url: "nil".into(),
        version: "0.1.0".into(),
        year: if syntable_1 { 2022 } else { 1970 },
        contributor: dataset.program.clone(),
        date_created: DATE.into(),
        ..CocoInfo::default()
    }
}

fn category(dataset: &DatasetInfo, (id, name): (u32, &str)) -> Category {
    let supercategory = dataset.supercategory(id).unwrap_or(SUPERCATEGORY).to_owned();
    Category { id: id.into(), name: name.into(), supercategory, ..Category::default() }
}
