//! Bodies that are parts of one mechanism: a drawer in its cabinet, the links of a robot's arm.

use super::{BodyHandle, InstanceId};
use crate::error::{Error, Result};
use crate::geometry::{Pose, Vector3};
use std::collections::BTreeMap;

/// A tree of links, each a body, with joints between them. The bodies have the poses that the scene gives them; the
/// joints describe how they can move. In a scene under construction the bodies are handles, in a frozen scene ids.
#[derive(Debug, Clone, PartialEq)]
pub struct Articulation<Body = InstanceId> {
    /// Name, for messages and files.
    pub name: String,
    /// The links. The first is the base; each other link comes after its parent.
    pub links: Vec<Link<Body>>,
}

/// A link of an articulation.
#[derive(Debug, Clone, PartialEq)]
pub struct Link<Body = InstanceId> {
    /// Name, unique in the articulation.
    pub name: String,
    /// The body.
    pub body: Body,
    /// The joint to the parent; none for the base.
    pub joint: Option<Joint>,
}

/// A joint between a link and its parent.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Number of the parent among the links.
    pub parent: usize,
    /// How the link can move.
    pub kind: JointKind,
    /// Frame of the joint in the frame of the parent's body.
    pub parent_from_joint: Pose,
    /// Unit vector in the frame of the joint, along or about which the link moves.
    pub axis: Vector3<f64>,
    /// Smallest and largest position, radians or meters; none if the joint has no limit.
    pub limits: Option<[f64; 2]>,
    /// Position of the joint in the scene, radians or meters.
    pub position: f64,
}

/// How a joint lets a link move. Kinds may be added: treat an unknown one as fixed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum JointKind {
    /// Not at all.
    Fixed,
    /// About the axis, radians.
    Revolute,
    /// Along the axis, meters.
    Prismatic,
}

impl Articulation<BodyHandle> {
    /// The articulation of a frozen scene. `ids` has the ids of the bodies that are in the scene.
    pub(super) fn frozen(self, ids: &BTreeMap<BodyHandle, InstanceId>) -> Result<Articulation> {
        let Self { name, links } = self;
        let wrong = |what: String| Error::new(what).context(format!("the articulation `{name}`"));
        let mut frozen: Vec<Link> = Vec::with_capacity(links.len());
        for Link { name: link, body, joint } in links {
            let Some(&id) = ids.get(&body) else {
                // A settler may remove a link that moves; another attempt may keep it.
                let error = Error::new(format!("its link `{link}` was removed from the scene"));
                return Err(error.context(format!("the articulation `{name}`")));
            };
            if frozen.iter().any(|other| other.name == link || other.body == id) {
                return Err(wrong(format!("two links have the name `{link}`, or its body")));
            }
            match &joint {
                None if !frozen.is_empty() => return Err(wrong(format!("its link `{link}` has no joint"))),
                Some(joint) if joint.parent >= frozen.len() => {
                    return Err(wrong(format!("its link `{link}` comes before its parent")));
                }
                Some(joint) if !joint.is_sound() => {
                    return Err(wrong(format!("the joint of its link `{link}` is not sound: {joint:?}")));
                }
                _ => {}
            }
            frozen.push(Link { name: link, body: id, joint });
        }
        if frozen.is_empty() {
            return Err(wrong("it has no link".to_owned()));
        }
        Ok(Articulation { name, links: frozen })
    }
}

impl Joint {
    /// Whether the axis is a unit vector, and the position is within the limits.
    fn is_sound(&self) -> bool {
        let is_unit = (self.axis.norm() - 1.0).abs() < 1e-6;
        let is_within = |[low, high]: [f64; 2]| (low..=high).contains(&self.position);
        is_unit && self.position.is_finite() && self.limits.is_none_or(is_within)
    }
}
