//! Whole images, compared with closed forms or brute force, and the choice of a renderer.

mod auto;
mod components;
mod estimators;
mod glass;
mod ground;
mod guides;
mod images;
mod label_scenes;
mod light_transport;
mod materials;
mod optics;
mod support;
mod windows;
