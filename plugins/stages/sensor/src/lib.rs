//! Sensors: simulate how real cameras record rendered images.
//!
//! | kind | provides |
//! | --- | --- |
//! | [`rgb_camera`](rgb_camera::RgbCamera) | the 8-bit image, and the settings of exposure, lens errors, noise, tone curve and JPEG |
//! | [`appearance`](appearance::Appearance) | an annotator: color and opacity of objects without their occluders,
//! developed like the image |
//! | [`depth_camera`](depth_camera::DepthCamera) | depth as a RealSense L515 or D435 or an Azure Kinect measures it |
//!
//! `image_filter` computes and filters images row by row on several threads; [`rgb_camera`] and [`depth_camera`] hold
//! one effect per file.
//!
//! **Invariants.** An output is a pure function of the view, of the products that the sensor declares to read and of
//! its random stream. Every row of pixels has a stream of its own, so results do not depend on threads. Logarithms,
//! exponentials and angles come from `libm`, so results do not depend on the system either. Rendered products are never
//! changed: labels and clean depth stay as they are.

pub mod appearance;
pub mod depth_camera;
mod image_filter;
pub mod rgb_camera;
