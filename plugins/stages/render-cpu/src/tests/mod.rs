//! Whole images against what can be worked out on paper or by brute force.

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
