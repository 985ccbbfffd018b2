//! The subject of a writer: images, or scenes.

use crate::context::{ImageContext, ImagesContext, Log, SceneContext, ViewContext};

/// The subject of a writer, [`Images`] or [`Scenes`]. It sets the contexts that the writer gets.
pub trait Subject: 'static {
    /// The context of each view.
    type View<'a>: Copy;
    /// The context of each scene.
    type Scene<'a>: Copy;
    /// The image of a view's context.
    fn image<'s, 'a>(cx: &'s Self::View<'a>) -> &'s ImageContext<'a>;
    /// The images of a scene's context.
    fn images<'s, 'a>(cx: &'s Self::Scene<'a>) -> &'s ImagesContext<'a>;
    /// A view's context with another log.
    fn view_with_log<'s>(cx: &'s Self::View<'_>, log: &'s dyn Log) -> Self::View<'s>;
    /// A scene's context with another log.
    fn scene_with_log<'s>(cx: &'s Self::Scene<'_>, log: &'s dyn Log) -> Self::Scene<'s>;
}

/// Images with their labels, from scenes that the program made or datasets that it read.
pub enum Images {}

impl Subject for Images {
    type View<'a> = ImageContext<'a>;
    type Scene<'a> = ImagesContext<'a>;

    fn image<'s, 'a>(cx: &'s Self::View<'a>) -> &'s ImageContext<'a> {
        cx
    }

    fn images<'s, 'a>(cx: &'s Self::Scene<'a>) -> &'s ImagesContext<'a> {
        cx
    }

    fn view_with_log<'s>(cx: &'s ImageContext<'_>, log: &'s dyn Log) -> ImageContext<'s> {
        cx.with_log(log)
    }

    fn scene_with_log<'s>(cx: &'s ImagesContext<'_>, log: &'s dyn Log) -> ImagesContext<'s> {
        cx.with_log(log)
    }
}

/// Scenes that the program made: bodies, materials, cameras and lights.
pub enum Scenes {}

impl Subject for Scenes {
    type View<'a> = ViewContext<'a>;
    type Scene<'a> = SceneContext<'a>;

    fn image<'s, 'a>(cx: &'s Self::View<'a>) -> &'s ImageContext<'a> {
        cx
    }

    fn images<'s, 'a>(cx: &'s Self::Scene<'a>) -> &'s ImagesContext<'a> {
        cx
    }

    fn view_with_log<'s>(cx: &'s ViewContext<'_>, log: &'s dyn Log) -> ViewContext<'s> {
        cx.with_log(log)
    }

    fn scene_with_log<'s>(cx: &'s SceneContext<'_>, log: &'s dyn Log) -> SceneContext<'s> {
        cx.with_log(log)
    }
}
