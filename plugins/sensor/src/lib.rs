//! Sensors: what real cameras make of what was rendered.
//!
//! | kind | provides |
//! | --- | --- |
//! | [`rgb_camera`](rgb::RgbCamera) | the 8-bit picture and what made it: exposure, lens errors, noise, tone curve, JPEG |
//! | [`depth_camera`](depth::DepthCamera) | depth as a RealSense L515 or D435 or an Azure Kinect measures it |
//!
//! From the bottom up: `grid` spreads rows of pixels over threads and filters them; [`rgb`] and [`depth`] hold one
//! effect a file.
//!
//! **Invariants.** A picture is a pure function of the site, of the products that a sensor declares to read and of its
//! stream. Every row of pixels has a stream of its own, so that threads only decide when it is computed. What was
//! rendered is never changed: labels and clean depth stay as they are.

pub mod depth;
mod grid;
pub mod rgb;

use syntable_model::prelude::*;

/// The view of a site: sensors run once a view.
fn view<'a>(site: &Site<'a>) -> Result<&'a View> {
    site.view.ok_or_else(|| Error::new("a product of a view was asked for without a view"))
}
