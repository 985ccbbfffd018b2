//! Cameras, view samplers and light samplers.
