//! An item: an object, or a stack of objects, that is put down at one place.

use super::options::Arrange;
use crate::footprint::Footprint;
use crate::objects::{DrawnObject, DrawnObjects};
use syntable_model::geometry::{UnitQuaternion, Vector3};
use syntable_model::prelude::*;
use syntable_model::scene::BodyDraft;

/// Height at which an object starts above what carries it, meters.
pub const START_M: f64 = 0.001;

/// The center of mass of an object is at least this far inside the outline of the top that carries it, meters.
const STACK_MARGIN_M: f64 = 0.004;

/// Maximum number of assets that are drawn for the next object of a stack.
const MAX_DRAWS: u32 = 8;

/// An object, or a stack of objects, with its lowest point at height 0 and the center of its footprint at the origin.
pub struct Item {
    /// The objects and their poses, the lowest first.
    members: Vec<(DrawnObject, Pose)>,
    /// The outline of all of them.
    pub footprint: Footprint,
}

/// The items of a scene, drawn one after another.
pub struct Items<'a> {
    options: &'a Arrange,
    context: &'a Context<'a>,
    drawn: DrawnObjects<'a, 'a>,
    /// Number of the next object.
    next: usize,
    /// Number after the last object.
    end: usize,
}

impl<'a> Items<'a> {
    pub fn new(options: &'a Arrange, context: &'a Context<'a>) -> Result<Self> {
        let drawn = options.options().draw(context)?;
        Ok(Self { options, context, end: drawn.count(), drawn, next: 0 })
    }

    /// Maximum number of objects.
    pub fn count(&self) -> usize {
        self.drawn.count()
    }

    /// Whether all objects were drawn.
    pub fn is_done(&self) -> bool {
        self.next >= self.end
    }

    /// Ends at a fair part of the remaining objects, if `sites` supports share them.
    pub fn share(&mut self, sites: usize) {
        self.end = self.next + (self.drawn.count() - self.next).div_ceil(sites);
    }

    /// Number of the next object, to go back to.
    pub fn mark(&self) -> usize {
        self.next
    }

    /// Goes back, so that objects without a place do not count.
    pub fn rewind(&mut self, mark: usize) {
        self.next = mark;
    }

    /// Draws the next object.
    pub fn draw(&mut self) -> Result<DrawnObject> {
        let object = self.drawn.object(self.next)?;
        self.next += 1;
        Ok(object)
    }

    /// Draws a further object of a row: a copy, if the objects of a row are alike.
    pub fn draw_like(&mut self, first: &DrawnObject) -> Result<DrawnObject> {
        if !self.options.alike {
            return self.draw();
        }
        self.next += 1;
        Ok(first.clone())
    }

    /// Draws the item whose lowest object is given, for a place that turns by `yaw` radians. A stack ends at `max_height` meters.
    /// `place` gives random numbers.
    pub fn item(&mut self, first: &DrawnObject, yaw: f64, max_height: f64, place: &Stream) -> Result<Item> {
        let height = self.options.stack.draw(&mut place.child("stack"));
        let yaw = yaw + self.options.yaw(&mut place.child("yaw"));
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        let mut members = vec![(first.clone(), self.resting(first, &turn, &place.child("pose")))];
        for level in 1..height {
            if self.is_done() {
                break;
            }
            let stream = place.child("level").at(level as u64);
            let Some(pair) = self.next_member(first, &members, &turn, max_height, &stream)? else { break };
            members.push(pair);
        }
        let corners = members.iter().map(|(object, pose)| self.shape(object).footprint(pose));
        let all = corners.reduce(|all, next| {
            let points = [all.outline, next.outline].concat();
            let outline = syntable_convex::convex_outline(points);
            Footprint { outline, low: all.low.min(next.low), high: all.high.max(next.high) }
        });
        let footprint = all.unwrap_or(Footprint { outline: Vec::new(), low: 0.0, high: 0.0 });
        Ok(Item { members, footprint })
    }

    /// The next object of a stack and its pose; none if the stack carries no other.
    fn next_member(
        &mut self,
        first: &DrawnObject,
        members: &[(DrawnObject, Pose)],
        turn: &UnitQuaternion<f64>,
        max_height: f64,
        stream: &Stream,
    ) -> Result<Option<(DrawnObject, Pose)>> {
        let Some((below, pose_below)) = members.last() else { return Ok(None) };
        let top = self.shape(below).top(pose_below);
        let middle = center(&top);
        for attempt in 0..MAX_DRAWS {
            if self.is_done() {
                return Ok(None);
            }
            let object = if self.options.alike { first.clone() } else { self.drawn.object(self.next)? };
            let pose = self.resting(&object, turn, &stream.child("pose"));
            let shift = Vector3::new(middle[0], middle[1], top.high + START_M);
            let pose = Pose::from_parts((pose.translation.vector + shift).into(), pose.rotation);
            let mass = pose * object.object.mass.center;
            let is_carried = top.contains([mass.x, mass.y], STACK_MARGIN_M);
            if is_carried && self.shape(&object).footprint(&pose).high <= max_height {
                self.next += 1;
                return Ok(Some((object, pose)));
            }
            if self.options.alike || attempt + 1 == MAX_DRAWS {
                return Ok(None);
            }
            // This object is left out: the next one may fit.
            self.next += 1;
        }
        Ok(None)
    }

    /// A pose in which an object rests, with its lowest point at height 0 and the center of its footprint at the origin.
    fn resting(&self, drawn: &DrawnObject, turn: &UnitQuaternion<f64>, stream: &Stream) -> Pose {
        let shape = self.shape(drawn);
        let pose = self.options.pose.draw(&mut stream.child("kind"));
        let rotation = turn * pose.draw(shape.of_asset(), &mut stream.child("side"));
        let footprint = shape.footprint(&Pose::from_parts(Vector3::zeros().into(), rotation));
        let [x, y] = center(&footprint);
        Pose::from_parts(Vector3::new(-x, -y, -footprint.low).into(), rotation)
    }

    fn shape(&self, drawn: &DrawnObject) -> crate::resting::ResizedShape {
        self.options.shapes.of(&drawn.object, self.context.cache)
    }

    /// The bodies of an item at a place.
    pub fn bodies(&self, item: &Item, [x, y, z]: [f64; 3]) -> Result<Vec<BodyDraft>> {
        let at =
            |pose: &Pose| Pose::from_parts((pose.translation.vector + Vector3::new(x, y, z)).into(), pose.rotation);
        item.members.iter().map(|(drawn, pose)| self.drawn.body(drawn, at(pose))).collect()
    }
}

/// Center of the bounding rectangle of a footprint.
fn center(footprint: &Footprint) -> [f64; 2] {
    [0, 1].map(|axis| {
        let along = footprint.outline.iter().map(|p| p[axis]);
        let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        if low <= high { (low + high) / 2.0 } else { 0.0 }
    })
}
