//! Dataset format `box_table`: rectangles in a table, `boxes.csv`.

use std::collections::BTreeMap;
use std::path::Path;
use syntable_model::files::read_small;
use syntable_model::prelude::*;
use syntable_model::product::standard::VISIBLE_MASK;
use syntable_model::reader::{Format, ImageRef, ImageSource, Opened, ReadImage, Source};
use syntable_model::register_format;
use syntable_model::scene::{SceneId, ViewId};

/// The only file of a dataset: a line of headings, then `image,width,height,left,top,right,bottom` for each object, in
/// pixels.
const FILE: &str = "boxes.csv";

register_format!(Format::new(
    "box_table",
    "A table of rectangles, `boxes.csv`, taken for visible masks.",
    |path| path.join(FILE).is_file(),
    open,
));

/// Reads all data that needs no image: here, the whole table.
fn open(source: &Source) -> Result<Opened> {
    // The folder resolves names, so that none leads outside the dataset.
    let path = source.folder(&source.path)?.file(FILE)?;
    let bytes = read_small(&path).map_err(|error| Error::io(&path, &error))?;
    let images = parse(&String::from_utf8_lossy(&bytes)).map_err(|error| error.in_file(&path))?;
    let info = DatasetInfo {
        name: name_of(&source.path),
        scenes: images.len() as u32,
        views_per_scene: 1,
        ..DatasetInfo::default()
    };
    // Each image is a scene of its own with one view.
    let of_image = |(number, name): (u32, &String)| ImageRef {
        scene: SceneId(number),
        view: ViewId(0),
        name: name.clone(),
        id: None,
    };
    let listed = (0..).zip(images.keys()).map(of_image).collect();
    Ok(Opened::new(info, listed, keys![VISIBLE_MASK], Table(images.into_values().collect())))
}

/// An image of the table: its width and height, and left, top, right and bottom of each object.
struct Image {
    size: [u32; 2],
    boxes: Vec<[u32; 4]>,
}

/// Images by name.
fn parse(text: &str) -> Result<BTreeMap<String, Image>> {
    let mut images: BTreeMap<String, Image> = BTreeMap::new();
    for (index, line) in text.lines().enumerate().skip(1).filter(|(_, line)| !line.trim().is_empty()) {
        let mut fields = line.split(',').map(str::trim);
        let name = fields.next().unwrap_or_default();
        let numbers: Vec<u32> = fields.map_while(|field| field.parse().ok()).collect();
        match numbers[..] {
            [width @ 1..=16384, height @ 1..=16384, left, top, right, bottom] => {
                let image = images.entry(name.to_owned());
                let image = image.or_insert_with(|| Image { size: [width, height], boxes: Vec::new() });
                image.boxes.push([left, top, right, bottom]);
            }
            _ => {
                let message = format!("line {} is not image,width,height,left,top,right,bottom", index + 1);
                return Err(Error::new(message).help("numbers are whole pixels; images have up to 16384 × 16384"));
            }
        }
    }
    Ok(images)
}

fn name_of(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Makes the masks of an image on request.
struct Table(Vec<Image>);

impl ImageSource for Table {
    fn read(&self, image: usize, wants: &[KeyId]) -> Result<ReadImage> {
        let Image { size: [width, height], boxes } = &self.0[image];
        let mut products = Products::new();
        if wants.contains(&VISIBLE_MASK.id()) {
            let mask = |&[left, top, right, bottom]: &[u32; 4]| {
                Mask::from_fn(*width, *height, |x, y| (left..right).contains(&x) && (top..bottom).contains(&y))
            };
            let masks: PerInstance<Mask> = (1..).map(InstanceId).zip(boxes.iter().map(mask)).collect();
            products.put(VISIBLE_MASK, masks)?;
        }
        Ok(ReadImage::new([*width, *height], products))
    }
}
