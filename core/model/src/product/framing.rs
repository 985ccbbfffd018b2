//! Framing: what part of a scene a rendered product shows, how finely, at which moment, and with which bodies.

use crate::scene::View;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// How a rendered product is framed: the image, or another canvas, sub-pixels, moment or choice of bodies.
///
/// In code, keys have methods for it: `COVERAGE.on_canvas(3)`. In recipes, framing is text behind the name of the product:
/// `coverage (canvas 3, next view)`. [`Display`](fmt::Display) and [`FromStr`] convert between the two.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Framing {
    canvas: u32,
    subpixels: u32,
    moment: ViewMoment,
    part: Option<ScenePart>,
}

/// A moment relative to a view: the camera and the [moment](crate::scene::View::moment) of one of the views of its scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum ViewMoment {
    /// The view itself.
    #[default]
    Own,
    /// The next view of the scene. The last view is its own next view.
    Next,
}

/// A part of a scene that is rendered without the bodies in front of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum ScenePart {
    /// Each object in a window of its own, without background: an [`Atlas`](crate::stage::Atlas).
    Objects(Lighting),
    /// The image without objects and distractors: supports, room, fixtures and background. `InScene` keeps their shadows.
    Furniture(Lighting),
    /// Objects and distractors where nothing hides them, without background: camera rays end without light at all other bodies.
    /// The radiance is premultiplied by [`OPACITY`](crate::product::standard::OPACITY).
    Foreground,
    /// The image without any body: lights and sky.
    Background,
}

impl ScenePart {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Objects(Lighting::Alone),
        Self::Objects(Lighting::InScene),
        Self::Furniture(Lighting::Alone),
        Self::Furniture(Lighting::InScene),
        Self::Foreground,
        Self::Background,
    ];

    const fn words(self) -> &'static str {
        match self {
            Self::Objects(Lighting::Alone) => "objects alone",
            Self::Objects(Lighting::InScene) => "objects in scene",
            Self::Furniture(Lighting::Alone) => "furniture alone",
            Self::Furniture(Lighting::InScene) => "furniture in scene",
            Self::Foreground => "foreground in scene",
            Self::Background => "background alone",
        }
    }
}

/// Light on a part of a scene that is rendered without the bodies in front of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Lighting {
    /// The lights of the view, without any other body.
    Alone,
    /// The light of the whole scene: others cast shadows on it and reflect light to it.
    InScene,
}

impl Lighting {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Alone, Self::InScene];
}

/// Maximum of [`Framing::canvas`].
pub const MAX_CANVAS: u32 = 9;

/// Maximum of [`Framing::subpixels`].
pub const MAX_SUBPIXELS: u32 = 8;

impl Framing {
    /// The framing of the image.
    pub const IMAGE: Self = Self { canvas: 1, subpixels: 1, moment: ViewMoment::Own, part: None };

    /// A canvas around the image.
    ///
    /// # Panics
    /// At compile time for constants: if the number is even or above [`MAX_CANVAS`], or for a [part](Self::of_part).
    pub const fn on_canvas(self, canvas: u32) -> Self {
        assert!(is_canvas(canvas), "a canvas is 1, 3, 5, 7 or 9 times as wide and high as the image");
        assert!(self.part.is_none(), "images of parts of a scene have no canvas");
        Self { canvas, ..self }
    }

    /// Several pixels per pixel of the image.
    ///
    /// # Panics
    /// At compile time for constants: if the number is 0 or above [`MAX_SUBPIXELS`], or for a [part](Self::of_part).
    pub const fn in_subpixels(self, subpixels: u32) -> Self {
        assert!(is_subpixels(subpixels), "a pixel has 1 to 8 sub-pixels along each edge");
        assert!(self.part.is_none(), "images of parts of a scene have no sub-pixels");
        Self { subpixels, ..self }
    }

    /// The camera and the moment of the next view.
    ///
    /// # Panics
    /// At compile time for constants: for a [part](Self::of_part).
    pub const fn of_next_view(self) -> Self {
        assert!(self.part.is_none(), "images of parts of a scene are of the view itself");
        Self { moment: ViewMoment::Next, ..self }
    }

    /// Each object in a window of its own, without the bodies in front of it.
    pub const fn of_objects(lighting: Lighting) -> Self {
        Self::of_part(ScenePart::Objects(lighting))
    }

    /// A part of the scene, without the bodies in front of it.
    pub const fn of_part(part: ScenePart) -> Self {
        Self { part: Some(part), ..Self::IMAGE }
    }

    /// Width and height of the canvas as a multiple of the image's, an odd number up to [`MAX_CANVAS`]. The image is in the
    /// center of the canvas, and both have the same pixels there.
    pub const fn canvas(&self) -> u32 {
        self.canvas
    }

    /// Number of pixels along each edge of one pixel of the image, up to [`MAX_SUBPIXELS`]: the camera takes an image that many
    /// times as wide and high.
    pub const fn subpixels(&self) -> u32 {
        self.subpixels
    }

    /// The view that gives the camera and the moment.
    pub const fn moment(&self) -> ViewMoment {
        self.moment
    }

    /// The light on each object, if the product is an [`Atlas`](crate::stage::Atlas) of windows around single objects.
    /// Camera rays then hit neither lights nor sky. `None` for all other framings.
    pub const fn objects(&self) -> Option<Lighting> {
        match self.part {
            Some(ScenePart::Objects(lighting)) => Some(lighting),
            _ => None,
        }
    }

    /// The part of the scene that the product shows; `None` for the scene as a whole.
    pub const fn part(&self) -> Option<ScenePart> {
        self.part
    }

    /// Pixels along an edge per pixel of the image along the same edge; objects count as one image.
    pub const fn pixels_per_edge(&self) -> u32 {
        self.canvas * self.subpixels
    }

    /// The view to render: this view or the next one, with as many pixels as the sub-pixels need.
    pub fn view(&self, view: &View, next: Option<&View>) -> View {
        let mut view = match self.moment {
            ViewMoment::Own => view,
            ViewMoment::Next => next.unwrap_or(view),
        }
        .clone();
        view.camera.intrinsics = view.camera.intrinsics.subdivided(self.subpixels);
        view
    }
}

const fn is_canvas(canvas: u32) -> bool {
    canvas % 2 == 1 && canvas <= MAX_CANVAS
}

const fn is_subpixels(subpixels: u32) -> bool {
    1 <= subpixels && subpixels <= MAX_SUBPIXELS
}

/// As `canvas 3, next view`, or `objects alone`. Empty for the image.
impl fmt::Display for Framing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { canvas, subpixels, moment, part } = *self;
        let words = [
            (canvas != 1).then(|| format!("canvas {canvas}")),
            (subpixels != 1).then(|| format!("subpixels {subpixels}")),
            match moment {
                ViewMoment::Own => None,
                ViewMoment::Next => Some("next view".to_owned()),
            },
            part.map(|part| part.words().to_owned()),
        ];
        f.write_str(&words.into_iter().flatten().collect::<Vec<_>>().join(", "))
    }
}

/// Why a text is not a framing.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum FramingError {
    /// A canvas of this size: it is even, 1 or above [`MAX_CANVAS`].
    Canvas(u32),
    /// This number of sub-pixels: it is 0, 1 or above [`MAX_SUBPIXELS`].
    Subpixels(u32),
    /// Words that are unknown, repeated, in another order, or do not go together.
    Words,
}

impl fmt::Display for FramingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Canvas(number) => {
                write!(f, "`canvas {number}` is out of range: a canvas is an odd number from 3 to {MAX_CANVAS}")
            }
            Self::Subpixels(number) => {
                write!(f, "`subpixels {number}` is out of range: a pixel has 2 to {MAX_SUBPIXELS} along each edge")
            }
            Self::Words => write!(
                f,
                "a rendered product may have `(canvas 3)`, up to {MAX_CANVAS}, `(subpixels 2)`, up to {MAX_SUBPIXELS}, and \
                 `(next view)`, in this order and joined by commas; a product with one value per pixel may have one of {} instead",
                ScenePart::ALL.map(|part| format!("`({})`", part.words())).join(", ")
            ),
        }
    }
}

impl std::error::Error for FramingError {}

impl FromStr for Framing {
    type Err = FramingError;

    fn from_str(text: &str) -> Result<Self, FramingError> {
        let mut framing = Self::IMAGE;
        for word in text.split(", ") {
            match word.split_once(' ') {
                Some(("canvas", number)) => match number.parse().map_err(|_| FramingError::Words)? {
                    canvas if is_canvas(canvas) && canvas != 1 => framing.canvas = canvas,
                    other => return Err(FramingError::Canvas(other)),
                },
                Some(("subpixels", number)) => match number.parse().map_err(|_| FramingError::Words)? {
                    subpixels if is_subpixels(subpixels) && subpixels != 1 => framing.subpixels = subpixels,
                    other => return Err(FramingError::Subpixels(other)),
                },
                Some(("next", "view")) => framing.moment = ViewMoment::Next,
                _ => {
                    let part = ScenePart::ALL.into_iter().find(|part| part.words() == word);
                    framing.part = Some(part.ok_or(FramingError::Words)?);
                }
            }
        }
        let goes_together = framing.part.is_none_or(|part| framing == Self::of_part(part));
        // Each framing has one spelling, since files are named by it.
        if goes_together && framing.to_string() == text { Ok(framing) } else { Err(FramingError::Words) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All framings.
    fn all() -> Vec<Framing> {
        let mut all = ScenePart::ALL.map(Framing::of_part).to_vec();
        for canvas in (1..=MAX_CANVAS).step_by(2) {
            for subpixels in 1..=MAX_SUBPIXELS {
                let framing = Framing::IMAGE.on_canvas(canvas).in_subpixels(subpixels);
                all.extend([framing, framing.of_next_view()]);
            }
        }
        all
    }

    #[test]
    fn each_framing_has_one_text() {
        let all = all();
        for framing in all.iter().filter(|framing| **framing != Framing::IMAGE) {
            assert_eq!(framing.to_string().parse(), Ok(*framing));
        }
        let texts: std::collections::BTreeSet<String> = all.iter().map(Framing::to_string).collect();
        assert_eq!(texts.len(), all.len());
        let text = Framing::IMAGE.on_canvas(3).in_subpixels(4).of_next_view().to_string();
        assert_eq!(text, "canvas 3, subpixels 4, next view");
        assert_eq!(Framing::of_objects(Lighting::InScene).to_string(), "objects in scene");
        assert_eq!(all.iter().min(), Some(&Framing::IMAGE), "the image is rendered first");
    }

    #[test]
    fn other_texts_are_refused_with_the_reason() {
        for (text, wanted) in [
            ("canvas 2", FramingError::Canvas(2)),
            ("canvas 1", FramingError::Canvas(1)),
            ("canvas 11, next view", FramingError::Canvas(11)),
            ("canvas 3, subpixels 9", FramingError::Subpixels(9)),
            ("subpixels 0", FramingError::Subpixels(0)),
        ] {
            assert_eq!(text.parse::<Framing>(), Err(wanted), "{text}");
        }
        for text in [
            "",
            "objects",
            "canvas 3, objects alone",
            "canvas 3, furniture alone",
            "background in scene",
            "next view, objects alone",
            "objects alone, objects in scene",
            "next view, subpixels 2",
            "next",
            "canvas +3",
            "canvas 03",
            "canvas three",
            "canvas 3, canvas 3",
            "canvas 3,next view",
            "before support",
        ] {
            assert_eq!(text.parse::<Framing>(), Err(FramingError::Words), "{text}");
        }
    }
}
