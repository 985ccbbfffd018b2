//! Names of products, with the parameters of those that a renderer makes.

use crate::scene::View;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Name of a product.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Name {
    /// What recipes and files call it: snake_case, unique among all plugins.
    pub base: &'static str,
    /// How it is rendered.
    pub parameters: RenderParameters,
}

/// How a product is rendered, where a stage needs it otherwise than as the image: `COVERAGE.on_canvas(3)` in code,
/// `coverage (canvas 3)` in a recipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct RenderParameters {
    /// Edges of the canvas over those of the image, an odd number up to [`MAX_CANVAS`]. The image lies in the center of
    /// the canvas, and both have the same pixels there.
    pub canvas: u32,
    /// Whether what a ray meets behind the first support or room part is left out; for sets of objects such as
    /// [`COVERAGE`](super::standard::COVERAGE), which look behind surfaces.
    pub before_support: bool,
    /// Pixels along either edge of what is one pixel of the image, up to [`MAX_SUBPIXELS`]: the camera with an image that
    /// many times as wide and high.
    pub subpixels: u32,
    /// When it is rendered, and by which camera.
    pub moment: ViewMoment,
    /// If not the image: every object by itself, without what occludes it, in an
    /// [`Atlas`](crate::stage::Atlas) of windows around the objects. Camera rays then meet neither lights nor sky.
    pub objects: Option<Lighting>,
}

/// A moment relative to a view: the camera and the [moment](crate::scene::View::moment) of one of the views of its scene.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum ViewMoment {
    /// Those of the view itself.
    #[default]
    Own,
    /// Those of the view that follows in the scene; for the last view, its own.
    Next,
}

impl ViewMoment {
    /// The view of this moment, given a view and the one that follows.
    pub fn of<'v>(self, view: &'v View, next: Option<&'v View>) -> &'v View {
        match self {
            Self::Own => view,
            Self::Next => next.unwrap_or(view),
        }
    }

    const fn is_own(self) -> bool {
        matches!(self, Self::Own)
    }
}

/// Light on an object that is shown without what occludes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Lighting {
    /// The lights of the view, as if there were no other body.
    Alone,
    /// That of the whole scene: others cast shadows on it and reflect light to it.
    InScene,
}

impl Lighting {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Alone, Self::InScene];

    /// How names of products say it.
    const fn words(self) -> &'static str {
        match self {
            Self::Alone => "objects alone",
            Self::InScene => "objects in scene",
        }
    }
}

/// Maximum of [`RenderParameters::canvas`].
pub const MAX_CANVAS: u32 = 9;

/// Maximum of [`RenderParameters::subpixels`].
pub const MAX_SUBPIXELS: u32 = 8;

impl RenderParameters {
    /// Those of the image.
    pub const IMAGE: Self =
        Self { canvas: 1, before_support: false, subpixels: 1, moment: ViewMoment::Own, objects: None };

    const fn is_valid(&self) -> bool {
        let of_image = self.canvas == 1 && !self.before_support && self.subpixels == 1 && self.moment.is_own();
        let is_canvas = self.canvas % 2 == 1 && self.canvas <= MAX_CANVAS;
        let is_divided = 1 <= self.subpixels && self.subpixels <= MAX_SUBPIXELS;
        is_canvas && is_divided && (self.objects.is_none() || of_image)
    }

    /// Those that concern the camera, its window and what it shows alone.
    pub const fn framing(self) -> Self {
        Self { before_support: false, ..self }
    }
}

impl Name {
    /// The name of a product of the image, of the scene or of the dataset.
    pub const fn new(base: &'static str) -> Self {
        Self { base, parameters: RenderParameters::IMAGE }
    }

    /// The same with other parameters. Panics, at compile time for constants, if the canvas is even or too large, or if
    /// there are too many sub-pixels or none, or if objects have other parameters, too.
    pub const fn with(self, parameters: RenderParameters) -> Self {
        assert!(
            parameters.is_valid(),
            "a canvas is 1, 3, 5, 7 or 9 times as wide and high as the image, of 1 to 8 sub-pixels; objects have none"
        );
        Self { base: self.base, parameters }
    }

    /// The name that a text means: that of this product, with or without parameters in parentheses.
    pub fn parse(self, text: &str) -> Option<Self> {
        let rest = text.strip_prefix(self.base)?;
        let mut parameters = RenderParameters::IMAGE;
        if !rest.is_empty() {
            for word in rest.strip_prefix(" (")?.strip_suffix(')')?.split(", ") {
                match word.split_once(' ') {
                    Some(("canvas", canvas)) => parameters.canvas = canvas.parse().ok()?,
                    Some(("before", "support")) => parameters.before_support = true,
                    Some(("subpixels", subpixels)) => parameters.subpixels = subpixels.parse().ok()?,
                    Some(("next", "view")) => parameters.moment = ViewMoment::Next,
                    _ => {
                        let lighting = Lighting::ALL.into_iter().find(|lighting| lighting.words() == word)?;
                        parameters.objects = Some(lighting);
                    }
                }
            }
        }
        let name = Self { base: self.base, parameters };
        // Each name has one spelling.
        let spelling = name.to_string();
        (parameters.is_valid() && spelling == text).then_some(name)
    }
}

/// As `coverage`, `coverage (canvas 3, before support)`, or `radiance (objects alone)`.
impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let RenderParameters { canvas, before_support, subpixels, moment, objects } = self.parameters;
        let words = [
            (canvas != 1).then(|| format!("canvas {canvas}")),
            before_support.then(|| "before support".to_owned()),
            (subpixels != 1).then(|| format!("subpixels {subpixels}")),
            match moment {
                ViewMoment::Own => None,
                ViewMoment::Next => Some("next view".to_owned()),
            },
            objects.map(|lighting| lighting.words().to_owned()),
        ];
        let words: Vec<String> = words.into_iter().flatten().collect();
        f.write_str(self.base)?;
        if words.is_empty() { Ok(()) } else { write!(f, " ({})", words.join(", ")) }
    }
}

impl PartialEq<str> for Name {
    fn eq(&self, other: &str) -> bool {
        self.parse(other) == Some(*self)
    }
}

impl PartialEq<String> for Name {
    fn eq(&self, other: &String) -> bool {
        self == other.as_str()
    }
}

impl PartialEq<&str> for Name {
    fn eq(&self, other: &&str) -> bool {
        self == *other
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        let coverage = Name::new("coverage");
        for canvas in [1, 3, MAX_CANVAS] {
            let both = [ViewMoment::Own, ViewMoment::Next];
            for (before_support, moment) in [false, true].into_iter().flat_map(|cut| both.map(|moment| (cut, moment))) {
                for subpixels in [1, 2, MAX_SUBPIXELS] {
                    let parameters = RenderParameters { canvas, before_support, subpixels, moment, objects: None };
                    let name = coverage.with(parameters);
                    assert_eq!(coverage.parse(&name.to_string()), Some(name));
                    assert!(name == *name.to_string() && (name == "coverage") == (name == coverage));
                }
            }
        }
        let moment = ViewMoment::Next;
        let all = RenderParameters { canvas: 3, before_support: true, subpixels: 4, moment, objects: None };
        assert_eq!(coverage.with(all).to_string(), "coverage (canvas 3, before support, subpixels 4, next view)");
        let radiance = Name::new("radiance");
        for (text, lighting) in
            [("radiance (objects alone)", Lighting::Alone), ("radiance (objects in scene)", Lighting::InScene)]
        {
            let name = radiance.with(RenderParameters { objects: Some(lighting), ..RenderParameters::IMAGE });
            assert_eq!((radiance.parse(text), name.to_string()), (Some(name), text.to_owned()));
        }
        for wrong in [
            "coverage (objects)",
            "coverage (canvas 3, objects alone)",
            "coverage (before support, objects alone)",
            "coverage (objects alone, objects in scene)",
            "coverag",
            "coverage2",
            "coverage (canvas 2)",
            "coverage (canvas 11)",
            "coverage ()",
            "coverage (canvas 1)",
            "coverage (subpixels 0)",
            "coverage (subpixels 9)",
            "coverage (subpixels 1)",
            "coverage (next view, subpixels 2)",
            "coverage (next)",
            "coverage (canvas +3)",
            "coverage (canvas 3, canvas 3)",
            "coverage (before support, canvas 3)",
            "coverage (canvas 3",
        ] {
            assert_eq!(coverage.parse(wrong), None, "{wrong}");
        }
    }
}
