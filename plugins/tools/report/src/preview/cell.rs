//! The image of a view on the contact sheet.

use syntable_formats::draw::{self, BACKGROUND, DrawColor};
use syntable_model::error::Result;
use syntable_model::prelude::*;
use syntable_model::product::Plane;
use syntable_model::product::standard::{AMODAL_MASK, OCCLUSION_MASK, RGB, VISIBLE_MASK};

/// Distance of images from each other and from the border, px.
pub const GAP: u32 = 6;

/// Products that cells are drawn from.
pub fn inputs(labels: bool) -> Vec<Input> {
    let masks = || [Input::of(VISIBLE_MASK), Input::of(AMODAL_MASK), Input::of(OCCLUSION_MASK)];
    std::iter::once(Input::of(RGB)).chain(labels.then(masks).into_iter().flatten()).collect()
}

/// Draws a view: the image and, with `labels`, next to it visible masks and amodal outlines with occluded parts.
pub fn cell(products: &Products, labels: bool) -> Result<Plane<DrawColor>> {
    let rgb = products.get(RGB)?;
    if !labels {
        return Ok(rgb.clone());
    }
    let visible = draw::visible(rgb, products.get(VISIBLE_MASK)?);
    let occlusion = draw::occlusion(rgb, products.get(AMODAL_MASK)?, products.get(OCCLUSION_MASK)?, 1);
    let [width, step] = [rgb.width(), rgb.width() + GAP];
    let mut cell = Plane::from_fn(2 * step + width, rgb.height(), |_, _| BACKGROUND);
    for (x, panel) in [(0, rgb), (step, &visible), (2 * step, &occlusion)] {
        draw::paste(&mut cell, panel, x, 0);
    }
    Ok(cell)
}
