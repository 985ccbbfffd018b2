//! The places that items are put on.

use super::item::{Item, Items, START_M};
use super::options::Arrange;
use crate::bearing::{Bearing, holds};
use crate::footprint::Footprint;
use syntable_model::prelude::*;
use syntable_model::scene::{BodyDraft, DropZone, Region, Role};

/// Distance of objects from the walls around a support and from the space of the next one, meters.
const WALL_GAP_M: f64 = 0.003;

/// The supports of a step, the bodies around them, and the bodies that were put down so far.
pub struct Sites {
    sites: Vec<Site>,
    /// Footprints of the bodies that block places.
    taken: Vec<Footprint>,
    /// The bodies that were put down.
    pub placed: Vec<(BodyDraft, DropZone)>,
}

/// One support.
pub struct Site {
    zone: DropZone,
    bearing: Bearing,
    /// The area that is used.
    pub area: Region,
    /// Maximum height of an item, meters; infinite under the open sky.
    pub height: f64,
    /// Numbers of the `taken` bodies that are part of the support itself.
    own: Vec<usize>,
}

impl Sites {
    pub fn new(options: &Arrange, scene: &SceneBuilder, context: &Context) -> Result<Self> {
        let supports = scene.supports.group(options.support.as_ref())?;
        let mut taken = Vec::new();
        let mut furniture = Vec::new();
        for (_, body) in scene.bodies().filter(|(_, body)| body.role != Role::Room) {
            let shape = options.shapes.of(&body.object, context.cache);
            if body.role == Role::Support {
                furniture.push((taken.len(), body.world_bounds()));
            }
            taken.push(shape.footprint(&body.world_from_body));
        }
        let site = |support: &syntable_model::scene::Support| {
            let is_walled = support.walls.is_some();
            let surface = if is_walled { support.surface.grown(-WALL_GAP_M) } else { support.surface };
            let end = scene.space_top(support).unwrap_or(f64::INFINITY);
            Site {
                bearing: Bearing::of(support, scene),
                area: surface.scaled(options.area_factor),
                height: end - support.height() - WALL_GAP_M - START_M,
                own: furniture.iter().filter(|(_, bounds)| holds(bounds, support)).map(|(number, _)| *number).collect(),
                zone: DropZone { starts_at_rest: true, ..DropZone::on(support.clone()) },
            }
        };
        Ok(Self { sites: supports.into_iter().map(site).collect(), taken, placed: Vec::new() })
    }

    /// The supports, in order.
    pub fn all(&self) -> &[Site] {
        &self.sites
    }

    /// Draws a support by its area.
    pub fn draw(&self, stream: &mut Stream) -> usize {
        let area = |site: &Site| site.area.edges().iter().product::<f64>();
        stream.pick_by_weight(self.sites.iter().map(area)).unwrap_or(self.sites.len() - 1)
    }

    /// Puts an item down with its center at distances from the center of a support along its edges, at least `gap` meters from other
    /// bodies. Returns whether the place was free.
    pub fn put(&mut self, items: &Items, item: &Item, site: usize, along: [f64; 2], gap: f64) -> Result<bool> {
        let Site { area, bearing, height, own, zone } = &self.sites[site];
        let at = area.point(along);
        if item.footprint.high > *height {
            return Ok(false);
        }
        let footprint = item.footprint.moved([at.x, at.y, at.z]);
        if !footprint.is_within(area) {
            return Ok(false);
        }
        let Some(ground) = bearing.height(&footprint) else { return Ok(false) };
        let z = ground + START_M;
        let footprint = item.footprint.moved([at.x, at.y, z]);
        let blocks = |(number, other): (usize, &Footprint)| !own.contains(&number) && footprint.is_near(other, gap);
        if self.taken.iter().enumerate().any(blocks) {
            return Ok(false);
        }
        let bodies = items.bodies(item, [at.x, at.y, z])?;
        self.placed.extend(bodies.into_iter().map(|body| (body, zone.clone())));
        self.taken.push(footprint);
        Ok(true)
    }
}
