//! Supports: the named places of a scene that carry objects.

use crate::error::{Error, Result};
use crate::geometry::Point3;
use crate::names::SupportName;
use serde::Serialize;
use std::sync::Arc;

/// A level, axis-aligned rectangle in the world. Read it through its methods: other outlines may follow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Region {
    center: [f64; 3],
    size: [f64; 2],
}

impl Region {
    /// A rectangle around a center, with extents along world x and y, meters.
    pub fn rectangle(center: [f64; 3], size: [f64; 2]) -> Self {
        Self { center, size }
    }

    /// Center, in the world, meters.
    pub fn center(&self) -> Point3<f64> {
        self.center.into()
    }

    /// Height above the floor, z = 0, meters.
    pub fn height(&self) -> f64 {
        self.center[2]
    }

    /// Extents of the bounding rectangle along world x (the paper's w) and y (the paper's l), meters.
    pub fn size(&self) -> [f64; 2] {
        self.size
    }

    /// `max(w/2, l/2)`: the length that the paper's view radii are multiples of, meters.
    pub fn half_extent(&self) -> f64 {
        self.size[0].max(self.size[1]) / 2.0
    }

    /// The region with its extents multiplied by a factor, around the same center.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { size: self.size.map(|edge| factor * edge), ..*self }
    }

    /// Whether a point is at or above the height of the region, and within its outline seen from above.
    pub fn column_contains(&self, p: &Point3<f64>) -> bool {
        let inside = |axis: usize| (p[axis] - self.center[axis]).abs() <= self.size[axis] / 2.0;
        p.z >= self.center[2] && inside(0) && inside(1)
    }
}

/// A named place that carries objects: a tabletop, the inside of a bin, a shelf board, an area of the floor.
///
/// It is a region and the space above it, not a body: the bodies that hold the objects up have
/// [`Role::Support`](super::Role::Support), or are parts of the room. Stages use it as follows.
///
/// - Placers drop objects in the space above it, and the settler decides by it whether an object is still there.
/// - Views look at its center, and their distances can be multiples of its size.
/// - Illuminances of lights apply at its center, and the room is what surrounds its center.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Support {
    /// Name in recipes and messages, unique in the scene: `table`, `bin`.
    pub name: Arc<str>,
    /// Where objects come to rest. Recesses and rims of the bodies below may deviate from its height.
    pub surface: Region,
    /// Height of the space above the surface that belongs to the support, meters, such as the distance to the next shelf
    /// board. If none, the space ends at the ceiling.
    pub clear_height_m: Option<f64>,
}

impl Support {
    /// A support whose space ends at the ceiling.
    pub fn new(name: impl Into<Arc<str>>, surface: Region) -> Self {
        Self { name: name.into(), surface, clear_height_m: None }
    }

    /// The same with a space of limited height, meters.
    #[must_use]
    pub fn with_clear_height(self, meters: f64) -> Self {
        Self { clear_height_m: Some(meters), ..self }
    }

    /// Center of the surface, in the world, meters.
    pub fn center(&self) -> Point3<f64> {
        self.surface.center()
    }

    /// Height of the surface above the floor, meters.
    pub fn height(&self) -> f64 {
        self.surface.height()
    }

    /// Height at which the space of the support ends, meters above the floor; none if only a ceiling ends it.
    pub fn top(&self) -> Option<f64> {
        Some(self.height() + self.clear_height_m?)
    }
}

/// The supports of a scene, in the order in which placers added them. The first is the main one, which stages use if the
/// recipe names none.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Supports(Vec<Support>);

impl Supports {
    /// Adds a support.
    ///
    /// # Errors
    /// If another support has the name, or the region or the clear height is not a finite, positive size.
    pub fn add(&mut self, support: Support) -> Result<()> {
        let Support { name, surface, clear_height_m } = &support;
        if self.iter().any(|other| other.name == *name) {
            let help = "give each placer's support a name of its own";
            return Err(Error::new(format!("the scene already has a support `{name}`")).help(help));
        }
        let sizes = surface.size.iter().chain(clear_height_m);
        if !(surface.center.iter().all(|x| x.is_finite()) && sizes.into_iter().all(|x| x.is_finite() && *x > 0.0)) {
            return Err(Error::new(format!("the region of the support `{name}` has no size: {support:?}")));
        }
        self.0.push(support);
        Ok(())
    }

    /// All of them, the main one first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Support> {
        self.0.iter()
    }

    /// The first support.
    pub fn main(&self) -> Option<&Support> {
        self.0.first()
    }

    /// The support that a recipe names, or the main one if it names none.
    ///
    /// # Errors
    /// If the scene has no such support. The error is permanent and lists the supports.
    pub fn get(&self, name: Option<&SupportName>) -> Result<&Support> {
        let found = match name {
            Some(name) => self.iter().find(|support| *support.name == *name.as_str()),
            None => self.main(),
        };
        found.ok_or_else(|| match (name, self.0.is_empty()) {
            (Some(name), false) => {
                let names: Vec<String> = self.iter().map(|support| format!("`{}`", support.name)).collect();
                let error = Error::new(format!("the scene has no support `{}`", name.as_str()));
                error.help(format!("its supports are {}", names.join(", ")))
            }
            _ => {
                let error = Error::new("the scene has no support: no placer has set a surface for objects");
                error.help("place a table first: [[place]] kind = \"table\"; or give a `room` a `support`")
            }
        })
    }
}

/// A scene's only support.
impl From<Support> for Supports {
    fn from(support: Support) -> Self {
        Self(vec![support])
    }
}

/// Where a body is dropped.
#[derive(Debug, Clone, PartialEq)]
pub struct DropZone {
    /// The support that the body is dropped on.
    pub support: Support,
    /// Region at the height of the support's surface. The body starts above it, and starts above it again if necessary.
    pub area: Region,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shelf() -> Supports {
        let mut supports = Supports::default();
        for (name, height) in [("lower", 0.4), ("upper", 0.8)] {
            let surface = Region::rectangle([0.0, 0.0, height], [1.0, 0.3]);
            supports.add(Support::new(name, surface).with_clear_height(0.35)).expect("new");
        }
        supports
    }

    #[test]
    fn the_first_support_is_the_default_and_unknown_names_list_the_others() {
        let shelf = shelf();
        assert_eq!(&*shelf.get(None).expect("there").name, "lower");
        assert_eq!(shelf.get(Some(&"upper".into())).expect("there").top(), Some(0.8 + 0.35));
        let error = shelf.get(Some(&"bin".into())).expect_err("unknown");
        assert_eq!(error.without_help(), "the scene has no support `bin`");
        assert_eq!(error.help_text(), Some("its supports are `lower`, `upper`"));
        assert!(Supports::default().get(None).is_err() && Supports::default().get(Some(&"bin".into())).is_err());
    }

    #[test]
    fn names_are_unique_and_regions_have_a_size() {
        let mut shelf = shelf();
        let add = |shelf: &mut Supports, name: &str, size| {
            shelf.add(Support::new(name, Region::rectangle([0.0; 3], size))).is_ok()
        };
        assert!(!add(&mut shelf, "upper", [1.0, 1.0]) && !add(&mut shelf, "flat", [1.0, 0.0]));
        assert!(!add(&mut shelf, "vast", [f64::INFINITY, 1.0]) && add(&mut shelf, "floor", [1.0, 1.0]));
    }
}
