//! Writer `area_table`: a table of visible pixels for each scene.

use syntable_model::prelude::*;
use syntable_model::product::standard::VISIBLE_MASK;

/// A CSV file for each scene, `{id}/{scene:06}.csv`: view, instance, visible pixels.
#[derive(Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AreaTable {
    /// Objects with fewer visible pixels are left out.
    min_pixels: u32,
}

impl Config for AreaTable {
    type Stage = dyn Writer;
    const KIND: &'static str = "area_table";
    const EXAMPLE: &'static str = "min_pixels = 16";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(Box::new(self))
    }
}

impl Writer for AreaTable {
    fn reads(&self) -> Vec<Input> {
        vec![Input::of(VISIBLE_MASK)]
    }

    fn scene(&self, _: &ImagesContext, output: Output) -> Result<Box<dyn SceneWriter>> {
        let table = "view,instance,pixels\n".to_owned();
        Ok(Box::new(SceneTable { output, min_pixels: self.min_pixels, table }))
    }
}
register!(AreaTable);

struct SceneTable {
    output: Output,
    min_pixels: u32,
    table: String,
}

impl SceneWriter for SceneTable {
    fn view(&mut self, cx: &ImageContext, products: &Products) -> Result<()> {
        for (id, mask) in products.get(VISIBLE_MASK)?.iter() {
            if mask.area() >= self.min_pixels {
                let (view, pixels) = (cx.view_id.0, mask.area());
                self.table += &format!("{view},{id},{pixels}\n");
            }
        }
        Ok(())
    }

    fn close(self: Box<Self>, cx: &ImagesContext, _: &Products) -> Result<()> {
        let path = format!("{}/{:06}.csv", self.output.id(), cx.scene_id.0);
        self.output.write(&path, self.table.as_bytes())
    }
}
