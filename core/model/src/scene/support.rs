//! Supports: the named places of a scene that carry objects.

use crate::error::{Error, Result};
use crate::geometry::{Point3, Pose, Vector3};
use crate::names::SupportName;
use serde::Serialize;
use std::sync::Arc;

/// A level rectangle in the world. Read it through its methods: other outlines may follow.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Region {
    center: [f64; 3],
    size: [f64; 2],
    /// Turn of its edges against the world axes, about z, radians.
    yaw: f64,
}

impl Region {
    /// A rectangle around a center, with extents along world x and y, meters.
    pub fn rectangle(center: [f64; 3], size: [f64; 2]) -> Self {
        Self { center, size, yaw: 0.0 }
    }

    /// The rectangle after a rigid motion. Its edges turn about the vertical, and it stays level.
    pub fn moved(&self, pose: &Pose) -> Self {
        let (center, edge) = (pose * self.center(), pose * self.direction(0));
        let yaw = if edge.y == 0.0 && edge.x > 0.0 { 0.0 } else { libm::atan2(edge.y, edge.x) };
        Self { center: center.into(), yaw, ..*self }
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
        if self.yaw == 0.0 {
            return self.size;
        }
        let edges = [0, 1].map(|edge| self.direction(edge) * self.size[edge]);
        [0, 1].map(|axis| edges.iter().map(|edge| edge[axis].abs()).sum())
    }

    /// Lengths of its own two edges, meters. The first one is along world x, turned by [`yaw`](Self::yaw).
    pub fn edges(&self) -> [f64; 2] {
        self.size
    }

    /// Turn of the first edge against world x about world z, radians.
    pub fn yaw(&self) -> f64 {
        self.yaw
    }

    /// `max(w/2, l/2)`: the length that the paper's view radii are multiples of, meters.
    pub fn half_extent(&self) -> f64 {
        let [w, l] = self.size();
        w.max(l) / 2.0
    }

    /// The region with its extents multiplied by a factor, around the same center.
    pub fn scaled(&self, factor: f64) -> Self {
        Self { size: self.size.map(|edge| factor * edge), ..*self }
    }

    /// The region with each edge moved outwards by some meters, or inwards if negative. Edges do not cross.
    pub fn grown(&self, meters: f64) -> Self {
        Self { size: self.size.map(|edge| (edge + 2.0 * meters).max(0.0)), ..*self }
    }

    /// The point of the region at distances from its center along its first and second edge, meters.
    pub fn point(&self, along: [f64; 2]) -> Point3<f64> {
        if self.yaw == 0.0 {
            return Point3::new(self.center[0] + along[0], self.center[1] + along[1], self.center[2]);
        }
        self.center() + self.direction(0) * along[0] + self.direction(1) * along[1]
    }

    /// Distances of a point from the center along the first and second edge, meters: the inverse of [`point`](Self::point).
    pub fn along(&self, p: &Point3<f64>) -> [f64; 2] {
        let from_center = p - self.center();
        [0, 1].map(|edge| if self.yaw == 0.0 { from_center[edge] } else { self.direction(edge).dot(&from_center) })
    }

    /// Whether a point is at or above the height of the region, and within its outline seen from above.
    pub fn column_contains(&self, p: &Point3<f64>) -> bool {
        let along = self.along(p);
        p.z >= self.center[2] && (0..2).all(|edge| along[edge].abs() <= self.size[edge] / 2.0)
    }

    /// Direction of an edge.
    fn direction(&self, edge: usize) -> Vector3<f64> {
        let (sin, cos) = (libm::sin(self.yaw), libm::cos(self.yaw));
        if edge == 0 { Vector3::new(cos, sin, 0.0) } else { Vector3::new(-sin, cos, 0.0) }
    }
}

/// Walls around a support, such as the sides of a bin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Walls {
    /// Height of their upper edge above the surface, meters.
    pub height_m: f64,
    /// Distance by which they lean outwards between the surface and the upper edge, meters.
    pub draft_m: f64,
}

impl Walls {
    /// The same, larger by a factor.
    fn scaled(self, factor: f64) -> Self {
        Self { height_m: self.height_m * factor, draft_m: self.draft_m * factor }
    }
}

/// A level area of an object that carries other objects, in its body frame: the bottom of a bin, a board of a shelf.
#[derive(Debug, Clone, PartialEq)]
pub struct SupportArea {
    /// Where the carried objects come to rest.
    pub surface: Region,
    /// Height of the space above the surface that belongs to it, meters. If none, the object leaves the space open.
    pub clear_height_m: Option<f64>,
    /// Walls of the object around it.
    pub walls: Option<Walls>,
}

impl SupportArea {
    /// The area of an object that is moved and scaled: `p ↦ (p + offset) · factor`.
    pub fn transformed(self, offset: Vector3<f64>, factor: f64) -> Self {
        let Region { size, yaw, .. } = self.surface;
        let center = (self.surface.center() + offset).coords * factor;
        Self {
            surface: Region { center: center.into(), size: size.map(|edge| edge * factor), yaw },
            clear_height_m: self.clear_height_m.map(|height| height * factor),
            walls: self.walls.map(|walls| walls.scaled(factor)),
        }
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
    /// Walls around it, of a container.
    pub walls: Option<Walls>,
}

impl Support {
    /// A support whose space ends at the ceiling.
    pub fn new(name: impl Into<Arc<str>>, surface: Region) -> Self {
        Self { name: name.into(), surface, clear_height_m: None, walls: None }
    }

    /// The support on an area of an object at a pose.
    pub fn of_area(name: impl Into<Arc<str>>, area: &SupportArea, world_from_object: &Pose) -> Self {
        let SupportArea { surface, clear_height_m, walls } = area;
        let (clear_height_m, walls) = (*clear_height_m, *walls);
        Self { name: name.into(), surface: surface.moved(world_from_object), clear_height_m, walls }
    }

    /// The same with a space of limited height, meters.
    #[must_use]
    pub fn with_clear_height(self, meters: f64) -> Self {
        Self { clear_height_m: Some(meters), ..self }
    }

    /// The same between walls.
    #[must_use]
    pub fn with_walls(self, walls: Walls) -> Self {
        Self { walls: Some(walls), ..self }
    }

    /// Center of the surface, in the world, meters.
    pub fn center(&self) -> Point3<f64> {
        self.surface.center()
    }

    /// Outline of the space above the support: the surface, or the opening between its walls.
    pub fn outline(&self) -> Region {
        self.walls.map_or(self.surface, |walls| self.surface.grown(walls.draft_m))
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
pub struct Supports {
    all: Vec<Support>,
    /// Names that only some scenes have, see [`may_add`](Supports::may_add).
    #[serde(skip)]
    by_chance: Vec<Arc<str>>,
}

impl Supports {
    /// Adds a support.
    ///
    /// # Errors
    /// If another support has the name, or the region, the clear height or the walls are not of a finite, positive size.
    pub fn add(&mut self, support: Support) -> Result<()> {
        let Support { name, surface, clear_height_m, walls } = &support;
        if self.iter().any(|other| other.name == *name) {
            let help = "give each placer's support a name of its own";
            return Err(Error::new(format!("the scene already has a support `{name}`")).help(help));
        }
        let sizes = surface.size.iter().chain(clear_height_m);
        if !(surface.center.iter().all(|x| x.is_finite()) && sizes.into_iter().all(|x| x.is_finite() && *x > 0.0)) {
            return Err(Error::new(format!("the region of the support `{name}` has no size: {support:?}")));
        }
        if let Some(Walls { height_m, draft_m }) = walls
            && !(height_m.is_finite() && *height_m > 0.0 && draft_m.is_finite() && *draft_m >= 0.0)
        {
            return Err(Error::new(format!("the walls of the support `{name}` have no size: {walls:?}")));
        }
        self.all.push(support);
        Ok(())
    }

    /// States that random numbers decide whether the scene has supports of a name. If it has none, [`get`](Self::get) and
    /// [`group`](Self::group) fail by chance, and the scene is tried again.
    pub fn may_add(&mut self, name: impl Into<Arc<str>>) {
        self.by_chance.push(name.into());
    }

    /// All of them, the main one first.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Support> {
        self.all.iter()
    }

    /// The first support.
    pub fn main(&self) -> Option<&Support> {
        self.all.first()
    }

    /// The support that a recipe names, or the main one if it names none. The name of a [group](Self::group) means its first
    /// member.
    ///
    /// # Errors
    /// If the scene has no such support. The error lists the supports. It is permanent, unless the scene [may have](Self::may_add) one,
    /// or only fewer supports of the group.
    pub fn get(&self, name: Option<&SupportName>) -> Result<&Support> {
        self.group(name).map(|group| group[0])
    }

    /// The supports that a recipe names: the one with the name, or else all whose names start with the name and a slash, such as
    /// `shelf/1` and `shelf/2` for `shelf`. Without a name, the main support. Never empty.
    ///
    /// # Errors
    /// See [`get`](Self::get).
    pub fn group(&self, name: Option<&SupportName>) -> Result<Vec<&Support>> {
        let found: Vec<&Support> = match name {
            Some(name) => match self.iter().find(|support| *support.name == *name.as_str()) {
                Some(exactly) => vec![exactly],
                None => self.iter().filter(|support| is_in_group(&support.name, name.as_str())).collect(),
            },
            None => self.main().into_iter().collect(),
        };
        if !found.is_empty() {
            return Ok(found);
        }
        let error = match (name, self.all.is_empty()) {
            (Some(name), false) => {
                let names: Vec<String> = self.iter().map(|support| format!("`{}`", support.name)).collect();
                let error = Error::new(format!("the scene has no support `{}`", name.as_str()));
                error.help(format!("its supports are {}", names.join(", ")))
            }
            _ => {
                let error = Error::new("the scene has no support: no placer has set a surface for objects");
                error.help("place a table first: [[place]] kind = \"table\"; or give a `room` a `support`")
            }
        };
        let Some(name) = name.map(SupportName::as_str) else {
            return Err(if self.by_chance.is_empty() { error } else { error.by_chance() });
        };
        // A recipe may name a group, or a member of it. Groups differ in size between scenes.
        let may_be = |it: &Arc<str>| is_in_group(it, name) || is_in_group(name, it);
        let group = name.rsplit_once('/').map(|(group, _)| group);
        let has_group = group.is_some_and(|group| self.iter().any(|support| is_in_group(&support.name, group)));
        Err(if has_group || self.by_chance.iter().any(may_be) { error.by_chance() } else { error })
    }
}

/// Whether a support belongs to the supports that a recipe calls by a name.
pub fn is_in_group(support: &str, name: &str) -> bool {
    support.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// A scene's only support.
impl From<Support> for Supports {
    fn from(support: Support) -> Self {
        Self { all: vec![support], ..Self::default() }
    }
}

/// Where a body is dropped.
#[derive(Debug, Clone, PartialEq)]
pub struct DropZone {
    /// The support that the body is dropped on.
    pub support: Support,
    /// Region at the height of the support's surface. The body starts above it, and starts above it again if necessary.
    pub area: Region,
    /// Mean height of the pile over the area at which the support is full, meters above its surface. The settler pours the bodies
    /// with a level one after another, and takes out the remaining ones.
    pub full_at_m: Option<f64>,
    /// Whether the body starts where it is to rest. Such a body is not poured.
    pub starts_at_rest: bool,
}

impl DropZone {
    /// The whole surface of a support.
    pub fn on(support: Support) -> Self {
        Self { area: support.surface, support, full_at_m: None, starts_at_rest: false }
    }
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
    fn a_name_means_the_supports_that_it_begins() {
        let mut shelf = shelf();
        for name in ["bins/1", "bins/2/1", "bins2"] {
            shelf.add(Support::new(name, Region::rectangle([0.0; 3], [1.0, 1.0]))).expect("new");
        }
        let names = |name: &str| -> Vec<String> {
            let group = shelf.group(Some(&name.into())).expect("there");
            group.iter().map(|support| support.name.to_string()).collect()
        };
        assert_eq!(names("bins"), ["bins/1", "bins/2/1"]);
        assert_eq!(names("bins/2"), ["bins/2/1"]);
        assert_eq!(&*shelf.get(Some(&"bins".into())).expect("there").name, "bins/1");
        assert!(shelf.group(Some(&"bin".into())).is_err_and(|error| !error.is_unlucky()));
        assert!(
            shelf.group(Some(&"bins/3".into())).is_err_and(|error| error.is_unlucky()),
            "another scene may have three"
        );
        // A support of the very name is meant alone.
        shelf.add(Support::new("bins", Region::rectangle([0.0; 3], [1.0, 1.0]))).expect("new");
        let group = shelf.group(Some(&"bins".into())).expect("there");
        assert_eq!(group.iter().map(|support| &*support.name).collect::<Vec<_>>(), ["bins"]);
    }

    #[test]
    fn supports_that_only_some_scenes_have_are_missing_by_chance() {
        let is_unlucky = |supports: &Supports, name: Option<&str>| {
            let name = name.map(SupportName::from);
            supports.get(name.as_ref()).expect_err("missing").is_unlucky()
        };
        let mut supports = Supports::default();
        assert!(!is_unlucky(&supports, None) && !is_unlucky(&supports, Some("rack")));
        supports.may_add("rack");
        assert!(
            is_unlucky(&supports, None) && is_unlucky(&supports, Some("rack")) && is_unlucky(&supports, Some("rack/1"))
        );
        assert!(!is_unlucky(&supports, Some("racks")));
        supports.add(Support::new("table", Region::rectangle([0.0; 3], [1.0, 1.0]))).expect("new");
        assert!(is_unlucky(&supports, Some("rack")) && supports.get(None).is_ok());
    }

    #[test]
    fn a_region_turns_with_its_object() {
        let turn = crate::geometry::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 30.0_f64.to_radians());
        let pose = Pose::from_parts(Vector3::new(1.0, 2.0, 0.5).into(), turn);
        let area = SupportArea {
            surface: Region::rectangle([0.1, 0.0, 0.02], [0.6, 0.4]),
            clear_height_m: None,
            walls: Some(Walls { height_m: 0.2, draft_m: 0.01 }),
        };
        let support = Support::of_area("bin", &area, &pose);
        let region = support.surface;
        assert!((region.center() - pose * Point3::new(0.1, 0.0, 0.02)).norm() < 1e-12);
        // Corners of the object's rectangle are corners of the region, and its bounding rectangle contains them.
        let [w, l] = region.size();
        for [x, y] in [[-0.3, -0.2], [0.3, -0.2], [0.3, 0.2], [-0.3, 0.2]] {
            let corner = pose * Point3::new(0.1 + x, y, 0.02);
            let [u, v] = region.along(&corner);
            assert!((u - x).abs() < 1e-12 && (v - y).abs() < 1e-12 && (region.point([u, v]) - corner).norm() < 1e-12);
            let from_center = corner - region.center();
            assert!(from_center.x.abs() <= w / 2.0 + 1e-12 && from_center.y.abs() <= l / 2.0 + 1e-12);
            let inside = region.center() + from_center * 0.999 + Vector3::z() * 0.1;
            let outside = region.center() + from_center * 1.001 + Vector3::z() * 0.1;
            assert!(region.column_contains(&inside) && !region.column_contains(&outside));
            assert!(support.outline().column_contains(&outside));
        }
        let [sin, cos] = [0.5, 0.75_f64.sqrt()];
        assert!((w - (0.6 * cos + 0.4 * sin)).abs() < 1e-12 && (l - (0.6 * sin + 0.4 * cos)).abs() < 1e-12);
    }

    #[test]
    fn names_are_unique_and_regions_have_a_size() {
        let mut shelf = shelf();
        let add = |shelf: &mut Supports, name: &str, size| {
            shelf.add(Support::new(name, Region::rectangle([0.0; 3], size))).is_ok()
        };
        assert!(!add(&mut shelf, "upper", [1.0, 1.0]) && !add(&mut shelf, "flat", [1.0, 0.0]));
        assert!(!add(&mut shelf, "vast", [f64::INFINITY, 1.0]) && add(&mut shelf, "floor", [1.0, 1.0]));
        let bin = Support::new("bin", Region::rectangle([0.0; 3], [1.0, 1.0]));
        assert!(shelf.add(bin.clone().with_walls(Walls { height_m: f64::NAN, draft_m: 0.0 })).is_err());
        assert!(shelf.add(bin.with_walls(Walls { height_m: 0.1, draft_m: 0.0 })).is_ok());
    }
}
