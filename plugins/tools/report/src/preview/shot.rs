//! A view in a preview: its cell on the sheet and, for the page, its images and objects.

use super::cell;
use crate::report::image::{ImageObject, OcclusionGraphView, objects_of};
use crate::report::pixels;
use serde::Serialize;
use std::time::Duration;
use syntable_formats::draw::DrawColor;
use syntable_formats::encode::png::PngImage;
use syntable_model::digest::Digest;
use syntable_model::error::Result;
use syntable_model::prelude::*;
use syntable_model::product::Plane;
use syntable_model::product::standard::{
    AMODAL_BOX, AMODAL_MASK, CATEGORY_ID, DEPTH, NORMAL, OBJECT_NAME, OCCLUSION_MASK, OCCLUSION_ORDER, OCCLUSION_RATE,
    RGB, VISIBLE_BOX, VISIBLE_MASK,
};
use syntable_model::stage::DatasetInfo;

/// A rendered view.
#[derive(Debug, PartialEq)]
pub struct Shot {
    /// The view on the contact sheet.
    pub cell: Plane<DrawColor>,
    /// Content for the page.
    pub details: Option<ShotDetails>,
}

/// Images and labels of a view, for the page.
#[derive(Debug, PartialEq)]
pub struct ShotDetails {
    /// Digest of everything that determines the view: its name in addresses.
    pub key: String,
    color: Plane<DrawColor>,
    depth: Option<Plane<DrawColor>>,
    normal: Option<Plane<DrawColor>>,
    /// Objects of the view.
    pub labels: ShotLabels,
    /// Time that rendering took, s.
    pub seconds: f64,
}

/// Objects of a view, in the form of a report's images.
#[derive(Debug, PartialEq, Serialize)]
pub struct ShotLabels {
    /// Width and height, px.
    pub size: [u32; 2],
    /// Minimum and maximum depth, m.
    pub depth_m: Option<[f32; 2]>,
    /// Objects in the order of their ids.
    pub objects: Vec<ImageObject>,
    /// Occlusion graph; `None` without an occlusion order.
    pub graph: Option<OcclusionGraphView>,
}

/// Products for the page. A recipe may be unable to provide a group.
pub fn groups() -> [Vec<Input>; 6] {
    [
        vec![Input::of(VISIBLE_MASK), Input::of(AMODAL_MASK), Input::of(OCCLUSION_MASK), Input::of(OCCLUSION_RATE)],
        vec![Input::of(OCCLUSION_ORDER)],
        vec![Input::of(VISIBLE_BOX), Input::of(AMODAL_BOX)],
        vec![Input::of(CATEGORY_ID), Input::of(OBJECT_NAME)],
        vec![Input::of(DEPTH)],
        vec![Input::of(NORMAL)],
    ]
}

impl Shot {
    /// A view from its products. `details` is the key for the page and the rendering time.
    pub fn of(
        products: &Products,
        labels: bool,
        info: &DatasetInfo,
        details: Option<(&Digest, Duration)>,
    ) -> Result<Self> {
        let cell = cell::cell(products, labels)?;
        let details = details.map(|(key, time)| {
            let color = products.get(RGB)?.clone();
            let depth = products.optional(DEPTH)?;
            let (objects, graph) = objects_of(products, products.contains(&VISIBLE_MASK.id()), info)?;
            let size = [color.width(), color.height()];
            Ok(ShotDetails {
                key: key.to_string().chars().filter(char::is_ascii_hexdigit).take(24).collect(),
                labels: ShotLabels { size, depth_m: depth.and_then(pixels::range), objects, graph },
                depth: depth.map(pixels::colored),
                normal: products.optional(NORMAL)?.map(normals),
                color,
                seconds: time.as_secs_f64(),
            })
        });
        Ok(Self { cell, details: details.transpose()? })
    }

    /// Number of pixels in memory.
    pub fn pixels(&self) -> usize {
        let of = |plane: &Plane<DrawColor>| plane.data().len();
        let of_page = self.details.as_ref().map_or(0, |details| {
            of(&details.color) + details.depth.as_ref().map_or(0, of) + details.normal.as_ref().map_or(0, of)
        });
        of(&self.cell) + of_page
    }
}

impl ShotDetails {
    /// An image of the view by its name, as PNG: `color`, `depth` or `normal`.
    pub fn png(&self, name: &str) -> Option<Result<Vec<u8>>> {
        let plane = match name {
            "color" => Some(&self.color),
            "depth" => self.depth.as_ref(),
            "normal" => self.normal.as_ref(),
            _ => None,
        };
        plane.map(|plane| PngImage::rgb(plane).encode_with(&[]))
    }

    /// Names of the images.
    pub fn images(&self) -> Vec<&'static str> {
        let all = [("color", true), ("depth", self.depth.is_some()), ("normal", self.normal.is_some())];
        all.into_iter().filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect()
    }
}

/// Normals in colors: x, y and z from -1 to 1 are red, green and blue. Pixels without a surface are black.
fn normals(normal: &Plane<[f32; 3]>) -> Plane<DrawColor> {
    normal.map(|axes| match axes {
        [0.0, 0.0, 0.0] => [0; 3],
        axes => axes.map(|axis| (127.5 * (axis.clamp(-1.0, 1.0) + 1.0)).round() as u8),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_point_to_their_colors() {
        let plane = Plane::from_vec(4, 1, vec![[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0; 3], [0.0, 0.0, 1.0]]);
        assert_eq!(normals(&plane).data(), [[255, 128, 128], [128, 0, 128], [0; 3], [128, 128, 255]]);
    }
}
