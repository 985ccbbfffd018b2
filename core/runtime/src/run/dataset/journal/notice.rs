//! Anomalies of scenes and views.

use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// An anomaly of a scene, which may be intended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Notice {
    /// All images are black.
    Black,
    /// All images are white: at least 99 % of their pixels are overexposed.
    White,
    /// No view has a light, and no material emits any.
    Unlit,
    /// No object has a visible pixel in any view.
    Unlabeled,
    /// The camera of every view is outside the room, and the scene is black or unlabeled.
    Outside,
}

impl Notice {
    /// The notices to report of all notices of a scene: the others are causes of these.
    pub fn reported(all: &BTreeSet<Self>) -> impl Iterator<Item = Self> {
        let is_cause = |notice: Self| match notice {
            Self::Outside => true,
            Self::Unlit | Self::Unlabeled => all.contains(&Self::Black),
            Self::Black | Self::White => false,
        };
        all.iter().copied().filter(move |&notice| !is_cause(notice))
    }

    /// Message about a scene with these notices.
    pub fn text(self, all: &BTreeSet<Self>) -> &'static str {
        match self {
            Self::Black if all.contains(&Self::Unlabeled) => "all images are black, and no object is labeled",
            Self::Black => "all images are black",
            Self::White => "all images are white",
            Self::Unlit => "no light: no view has a light, and no material emits light",
            Self::Unlabeled => "no object is labeled in any view",
            Self::Outside => "the camera is outside the room in every view",
        }
    }

    /// Message about one of several views.
    pub fn text_of_view(self) -> &'static str {
        match self {
            Self::Black => "the image is black",
            Self::White => "the image is white",
            Self::Unlit => "no light",
            Self::Unlabeled => "no object is labeled",
            Self::Outside => "the camera is outside the room",
        }
    }

    /// Remedy if some views have it.
    pub fn help_of_view(self) -> &'static str {
        match self {
            Self::Black | Self::Unlit => {
                "the camera may be outside the room or inside an object: check [views], the sizes in [[place]] and \
                 [[lights]]"
            }
            Self::White => "the view is overexposed: check the intensity of [[lights]] and the exposure in [camera]",
            Self::Unlabeled | Self::Outside => {
                "the camera may be outside the room, look past the objects or be behind an object: check [views] and \
                 the sizes in [[place]]"
            }
        }
    }

    /// Whether a few such views may be intended: a camera may look past all objects, but a black image always has a
    /// cause.
    pub fn may_be_meant(self) -> bool {
        self == Self::Unlabeled
    }

    /// The cause that is certain or most likely with these notices of a scene, and the remedy.
    pub fn help(self, all: &BTreeSet<Self>) -> &'static str {
        let has = |notice: Self| all.contains(&notice);
        match self {
            Self::Black | Self::Unlit if has(Self::Unlit) => {
                "no light: no view has a light, and no material emits light; add a [[lights]] table, or raise a `count` \
                 that is 0"
            }
            Self::Black | Self::Unlabeled | Self::Outside if has(Self::Outside) => {
                "the camera is outside the room in every view: check [views] and the size of the room in [[place]]"
            }
            Self::Black if has(Self::Unlabeled) => {
                "the camera may be behind a wall or inside an object: check [views] and the sizes in [[place]]"
            }
            Self::Black => {
                "the light may be too weak or hidden: check [[lights]], the exposure in [camera], and objects right in \
                 front of the camera"
            }
            Self::White => "lower the intensity of [[lights]], or check the exposure in [camera]",
            Self::Unlit => "add a [[lights]] table",
            Self::Unlabeled | Self::Outside => {
                "the objects are outside the views or hidden, or have fewer visible pixels than `annotate.masks.min_visible_px`: check \
                 [views], and bodies that may hide the table"
            }
        }
    }
}
