//! Contact sheets: views, masks and occlusion side by side.

use syntable_formats::draw::legend::{Legend, LegendSample};
use syntable_formats::draw::{self, DrawCanvas};
use syntable_formats::encode::png::PngImage;
use syntable_formats::writer::ImageWriter;
use syntable_model::prelude::*;
use syntable_model::product::Plane;
use syntable_model::product::standard::{AMODAL_MASK, DEPTH, OCCLUSION_MASK, RGB, VISIBLE_MASK};

/// Writes contact sheets, to check images and labels at a glance.
///
/// # Behavior
///
/// Each view is a row of panels. Every instance has its own color, the same in all panels and views of a scene. A legend
/// below explains the panels, if the sheet is wide enough.
///
/// # Output
///
/// `{id}/{scene:06}_{sheet:02}.png`: 8-bit RGB, up to `views_per_sheet` rows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ContactSheet {
    /// Panels of a row, from left to right.
    #[schemars(length(min = 1, max = 16))]
    pub panels: Vec<Panel>,
    /// Width of a panel, px. Images are scaled down to it, never up.
    #[schemars(range(min = 16, max = 4096))]
    pub panel_width_px: u32,
    /// Maximum number of rows of a sheet; a scene with more views has several sheets.
    #[schemars(range(min = 1, max = 64))]
    pub views_per_sheet: u32,
}

/// Content of a panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Panel {
    /// The exposed image.
    Rgb,
    /// Visible masks over the image in gray.
    Visible,
    /// Outlines of the amodal masks, with the occluded parts filled.
    Occlusion,
    /// Inverse depth: near is bright.
    Depth,
}

impl Default for ContactSheet {
    fn default() -> Self {
        Self { panels: vec![Panel::Rgb, Panel::Visible, Panel::Occlusion], panel_width_px: 320, views_per_sheet: 8 }
    }
}

impl Config for ContactSheet {
    type Stage = dyn Writer;
    const KIND: &'static str = "contact_sheet";
    const EXAMPLE: &'static str = "panels = [\"rgb\", \"visible\", \"occlusion\"]\npanel_width_px = 320";
    fn build(self) -> Result<Box<dyn Writer>, ConfigError> {
        Ok(self.boxed())
    }
}

impl ImageWriter for ContactSheet {
    type Scene = SheetRows;

    fn reads(&self) -> Vec<Input> {
        let mut inputs = Vec::new();
        for panel in &self.panels {
            inputs.extend(match panel {
                Panel::Rgb => vec![Input::of(RGB)],
                Panel::Visible => vec![Input::of(RGB), Input::of(VISIBLE_MASK)],
                Panel::Occlusion => vec![Input::of(RGB), Input::of(AMODAL_MASK), Input::of(OCCLUSION_MASK)],
                Panel::Depth => vec![Input::of(DEPTH)],
            });
        }
        inputs
    }

    fn view(&self, sheet: &mut SheetRows, cx: &ImageContext, products: &Products, output: &Output) -> Result<()> {
        let [image_width, _] = cx.size;
        let width = self.panel_width_px.min(image_width);
        let panels =
            self.panels.iter().map(|panel| Ok(draw::shrink(&panel.draw(products, image_width, width)?, width)));
        let panels = panels.collect::<Result<Vec<_>>>()?;
        sheet.rows.push(DrawCanvas::beside(&panels));
        if sheet.rows.len() as u32 == self.views_per_sheet {
            sheet.write(&self.panels, cx.scene_id.0, output)?;
        }
        Ok(())
    }

    fn close(&self, mut sheet: SheetRows, cx: &ImagesContext, _: &Products, output: &Output) -> Result<()> {
        if sheet.rows.is_empty() { Ok(()) } else { sheet.write(&self.panels, cx.scene_id.0, output) }
    }

    fn paths(&self, of: &FileOf) -> Vec<String> {
        let (Some(scene), None) = (of.scene, of.view) else { return Vec::new() };
        let sheets = of.dataset.views_per_scene.div_ceil(self.views_per_sheet).min(MOST_PATHS);
        (0..sheets).map(|sheet| sheet_path(of.id, scene.0, sheet)).collect()
    }
}

/// Maximum number of sheets per scene whose paths are announced before a run.
const MOST_PATHS: u32 = 100;

fn sheet_path(id: &str, scene: u32, sheet: u32) -> String {
    format!("{id}/{scene:06}_{sheet:02}.png")
}

/// The state of a scene between its views.
#[derive(Default)]
pub struct SheetRows {
    /// Number of sheets written so far.
    written: u32,
    /// Rows of the current sheet.
    rows: Vec<DrawCanvas>,
}

impl SheetRows {
    fn write(&mut self, panels: &[Panel], scene: u32, output: &Output) -> Result<()> {
        let rows = DrawCanvas::below(&std::mem::take(&mut self.rows));
        let legend = Legend::new(&legend(panels), rows.width());
        let mut sheet = rows.taller(legend.height());
        legend.draw(&mut sheet, rows.height());
        let path = sheet_path(output.id(), scene, self.written);
        self.written += 1;
        PngImage::rgb(&sheet).write(output, &path)
    }
}

/// The texts of a sheet's legend.
fn legend(panels: &[Panel]) -> Vec<(LegendSample, &'static str)> {
    let rows = (LegendSample::None, "A row is a view. From left to right:");
    std::iter::once(rows).chain(panels.iter().flat_map(|panel| panel.legend()).copied()).collect()
}

impl Panel {
    /// The texts about the panel in the legend.
    fn legend(self) -> &'static [(LegendSample, &'static str)] {
        match self {
            Self::Rgb => &[(LegendSample::None, "the image")],
            Self::Visible => &[(LegendSample::Filled, "visible masks by object")],
            Self::Occlusion => &[(LegendSample::Outlined, "amodal outlines"), (LegendSample::Filled, "occluded parts")],
            Self::Depth => &[(LegendSample::None, "depth, near is bright")],
        }
    }

    /// Draws the panel at full size, to be shrunk to `shown` columns.
    fn draw(self, products: &Products, width: u32, shown: u32) -> Result<Plane<[u8; 3]>> {
        // Lines of this width are one pixel wide after the panel is shrunk.
        let line = width.div_ceil(shown.max(1));
        match self {
            Self::Rgb => products.get(RGB).cloned(),
            Self::Visible => Ok(draw::visible(products.get(RGB)?, products.get(VISIBLE_MASK)?)),
            Self::Occlusion => {
                let [amodal, occluded] = [products.get(AMODAL_MASK)?, products.get(OCCLUSION_MASK)?];
                Ok(draw::occlusion(products.get(RGB)?, amodal, occluded, line))
            }
            Self::Depth => Ok(crate::syntable::inverse_depth(products.get(DEPTH)?).map(|&v| [v; 3])),
        }
    }
}

register!(ContactSheet);
