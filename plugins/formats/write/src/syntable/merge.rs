//! Merges the shards of the scenes into the annotation file.

use super::record::DATE;
use super::{Compat, SynTable};
use syntable_formats::coco::{Category, Info, License};
use syntable_formats::dataset::{DatasetWriter, Layout};
use syntable_formats::read::SUPERCATEGORY;
use syntable_formats::shard::{Line, for_each_line};
use syntable_formats::syntable::SCENES;
use syntable_model::prelude::*;

/// Writes the annotation file.
pub fn annotations(config: &SynTable, dataset: &DatasetInfo, finish: &Finish) -> Result<()> {
    let path = config.path(&config.annotation_file);
    let syntable_1 = config.compat == Compat::Syntable1;
    let skip_empty = config.skip_empty_images || syntable_1;
    finish.write(&path, |out| {
        let layout = if syntable_1 { Layout::Indented } else { Layout::Lines };
        let mut file = DatasetWriter::new(out, &path, layout)?;
        let categories: Vec<Category> = match config.compat {
            Compat::Coco => dataset.categories().map(|it| category(dataset, it)).collect(),
            Compat::Syntable1 => vec![category(dataset, DatasetInfo::OBJECT)],
        };
        file.header(&info(dataset, syntable_1), &[license()], &categories)?;
        file.images(|images| {
            for_each_line(dataset, finish, |image_id, line| match line {
                Line::Image { annotations, record } => {
                    let copies = if syntable_1 { annotations } else { usize::from(annotations > 0 || !skip_empty) };
                    (0..copies).try_for_each(|_| images.raw(&record.numbered(image_id)))
                }
                Line::Annotation(_) | Line::View(_) | Line::Scene(_) => Ok(()),
            })
        })?;
        let mut id = 0;
        file.annotations(|annotations| {
            for_each_line(dataset, finish, |image_id, line| match line {
                Line::Image { .. } | Line::View(_) | Line::Scene(_) => Ok(()),
                Line::Annotation(record) => {
                    id += 1;
                    annotations.raw(&record.numbered(id, image_id))
                }
            })
        })?;
        if !syntable_1 {
            file.list(SCENES, |scenes| {
                for_each_line(dataset, finish, |_, line| match line {
                    Line::Scene(record) => scenes.raw(record),
                    Line::Image { .. } | Line::Annotation(_) | Line::View(_) => Ok(()),
                })
            })?;
        }
        file.finish()
    })
}

fn info(dataset: &DatasetInfo, syntable_1: bool) -> Info {
    Info {
        description: dataset.name.clone(),
        url: "nil".into(),
        version: "0.1.0".into(),
        year: if syntable_1 { 2022 } else { 1970 },
        contributor: dataset.program.clone(),
        date_created: DATE.into(),
        ..Info::default()
    }
}

fn license() -> License {
    License { id: 1, name: "licenses of the assets".into(), ..License::default() }
}

fn category(dataset: &DatasetInfo, (id, name): (u32, &str)) -> Category {
    let supercategory = dataset.supercategory(id).unwrap_or(SUPERCATEGORY).to_owned();
    Category { id: id.into(), name: name.into(), supercategory, ..Category::default() }
}
