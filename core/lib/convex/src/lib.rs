//! Robust convex hulls, penetration depth and contact manifolds for [`parry3d`] shapes.
//!
//! Rigid bodies made from scanned meshes push collision code to its limits: hulls of thousands of nearly coplanar
//! points, parts thinner than a millimeter, a sphere that grazes a tabletop a thousand times its size. This crate
//! replaces the steps in which rounding errors turn into visible failures, and leaves the rest to parry:
//!
//! - [`ConvexHull`]: convex hull of points snapped to a fine grid, computed with integer orientation tests. It never
//!   fails on finite input: flat and tiny inputs are thickened, and hulls of many points are simplified.
//! - [`penetration_depth`] and [`minimum_translation`]: the expanding polytope algorithm (EPA; van den Bergen, GDC
//!   2001) on an integer grid. With rounded arithmetic, a sphere that grazes a slab can come out decimeters deep.
//! - [`PolyhedronContacts`]: contact manifolds by clipping whole faces against each other, as a query dispatcher in
//!   front of parry's own. Parry uses four vertices of each face, so a can rests on a sliver of its round bottom, tilts
//!   and never falls asleep.
//! - [`stable_poses`]: the poses in which a body rests on a plane, with their probabilities.
//! - [`Polyhedron`] and [`Wall`]: shapes whose bounding boxes cost the engine little.
//!
//! **Accuracy.** A hull vertex is an input point rounded to the grid. No input point is outside the plane of a face by
//! more than [`HullOptions::tolerance`], unless [`HullOptions::max_vertices`] was reached. Penetration depth is exact
//! up to 10⁻⁵ times the extent of the two shapes. The tests compare both with parry, and with exhaustive search, which
//! is exact where parry is not.
//!
//! **Determinism.** Results depend on the input alone, and are the same on every platform if parry is built with
//! `enhanced-determinism`.
//!
//! **Units.** Lengths are in the unit of the input, except where an option says otherwise.

mod depth;
mod hull;
mod manifold;
mod outline;
mod polytope;
mod shapes;
mod stable;

pub use depth::{MinimumTranslation, minimum_translation, penetration_depth, separation_along};
pub use hull::{ConvexHull, HullOptions};
pub use manifold::{ContactPoint, Contacts, PolyhedronContacts, polyhedron_contacts};
pub use outline::{convex_outline, outline_area};
pub use shapes::{Polyhedron, Wall};
pub use stable::{STABLE_VERSION, StablePose, stable_poses};

/// Version of the hull algorithm: part of the key of cached hulls.
///
/// The version rises whenever the same points and options give a different hull; a test pins the hulls of this version.
pub const HULL_VERSION: u32 = 1;
