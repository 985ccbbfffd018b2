//! Objects that a step draws from pools: which ones, and how bodies differ from their assets.

use crate::variation::{Variation, resized};
use std::sync::Arc;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetRef, BodyDraft, MassOrigin, Motion, Object, Role, Topology};

/// Limits of the number of objects. With labels, the minimum is one object.
pub const COUNT: [i64; 2] = [0, 10_000];

/// Limits of `friction`.
pub const FRICTION: [f64; 2] = [0.0, 10.0];

/// Limits of `restitution`.
pub const RESTITUTION: [f64; 2] = [0.0, 1.0];

/// Limits of `density_kg_m3`.
pub const DENSITY_KG_M3: [f64; 2] = [1.0, 30_000.0];

/// The options of a placer that draws objects from pools.
#[derive(Clone, Copy)]
pub struct ObjectOptions<'o> {
    /// Pools to draw from.
    pub from: &'o ObjectPools,
    /// Number of objects.
    pub count: &'o IntDist,
    /// Whether the same asset can occur more than once in a scene.
    pub with_replacement: bool,
    /// Differences from the asset.
    pub variation: Variation<'o>,
    /// Whether the objects are labeled.
    pub annotated: bool,
    /// Whether the objects stay where they are placed.
    pub fixed: bool,
    /// Coulomb friction coefficient, instead of the asset's.
    pub friction: Option<&'o Dist>,
    /// Coefficient of restitution, instead of the asset's.
    pub restitution: Option<&'o Dist>,
    /// Density, instead of the asset's.
    pub density_kg_m3: Option<&'o Dist>,
}

/// An object that was drawn, at its size.
#[derive(Clone)]
pub struct DrawnObject {
    /// Its asset.
    pub asset: AssetRef,
    /// The object.
    pub object: Arc<Object>,
    /// Random numbers of the object.
    pub stream: Stream,
}

/// The objects of a scene: drawn one by one, or all at once if no asset may occur twice.
pub struct DrawnObjects<'c, 'o> {
    options: ObjectOptions<'o>,
    context: &'c Context<'c>,
    count: usize,
    once: Option<Vec<(AssetRef, Arc<Object>)>>,
}

impl<'o> ObjectOptions<'o> {
    /// Refuses values outside of their limits.
    pub fn check(&self) -> Result<(), ConfigError> {
        self.count.within("count", i64::from(self.annotated), COUNT[1])?;
        self.variation.check()?;
        let within = |key: &str, dist: Option<&Dist>, [low, high]: [f64; 2]| {
            dist.map_or(Ok(()), |dist| dist.within(key, low, high))
        };
        within("friction", self.friction, FRICTION)?;
        within("restitution", self.restitution, RESTITUTION)?;
        within("density_kg_m3", self.density_kg_m3, DENSITY_KG_M3)
    }

    /// Draws the number of objects of a scene, and the objects if no asset may occur twice.
    pub fn draw<'c>(self, context: &'c Context<'c>) -> Result<DrawnObjects<'c, 'o>> {
        let count = self.count.draw(&mut context.stream.child("count")) as usize;
        let materials = self.variation.material.map_or(0, |_| count);
        context.assets.expect(if self.with_replacement { count + materials } else { count });
        let once = if self.with_replacement { None } else { Some(self.distinct(count, context)?) };
        if once.is_some() {
            context.assets.expect(materials);
        }
        let count = once.as_ref().map_or(count, Vec::len);
        Ok(DrawnObjects { options: self, context, count, once })
    }

    /// Draws distinct objects. Assets that cannot be loaded are skipped.
    fn distinct(&self, count: usize, context: &Context) -> Result<Vec<(AssetRef, Arc<Object>)>> {
        let all = context.assets.drawn_order(self.from, &mut context.stream.child("order"))?;
        let max_count = self.count.range().1;
        if max_count > all.len() as i64 {
            let message = format!("`count` can become {max_count}, but its pools have {} assets", all.len());
            return Err(Error::new(message).help("set with_replacement = true, or a smaller count"));
        }
        let mut drawn = Vec::new();
        let mut last = None;
        for asset in all {
            if drawn.len() == count {
                break;
            }
            match context.assets.get(&asset).and_then(Asset::into_object) {
                Ok(object) => drawn.push((asset, object)),
                Err(error) => last = Some(error),
            }
        }
        match last {
            Some(error) if drawn.is_empty() => Err(error.context("no asset can be used; the last one")),
            Some(error) if drawn.len() < count => {
                let message = format!("only {} of {count} objects can be drawn without replacement", drawn.len());
                context.log.warn(&Error::new(message).help(format!("the others are bad; the last one: {error}")));
                Ok(drawn)
            }
            _ => Ok(drawn),
        }
    }
}

impl DrawnObjects<'_, '_> {
    /// Number of objects.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Object `k`.
    pub fn object(&self, k: usize) -> Result<DrawnObject> {
        let stream = self.context.stream.child("object").at(k as u64);
        let (asset, object) = match &self.once {
            Some(drawn) => drawn[k].clone(),
            None => self.context.assets.draw_object(self.options.from, &mut stream.child("asset"))?,
        };
        let factor = self.options.variation.factor(&stream);
        let object = resized(object, factor).map_err(|error| error.context(asset.to_string()))?;
        Ok(DrawnObject { asset, object, stream })
    }

    /// The body of an object at a pose.
    pub fn body(&self, drawn: &DrawnObject, world_from_body: Pose) -> Result<BodyDraft> {
        let DrawnObject { asset, object, stream } = drawn;
        let ObjectOptions { annotated, fixed, friction, restitution, density_kg_m3, .. } = self.options;
        let role = if annotated { Role::Object } else { Role::Distractor };
        let motion = if fixed { Motion::Fixed } else { Motion::Dynamic };
        let body = BodyDraft::new(asset.clone(), Arc::clone(object), world_from_body, role, motion);
        let body = self.options.variation.painted(body, self.context.assets, stream)?;
        let draw = |dist: &Dist, name: &str| dist.draw(&mut stream.child(name));
        let mass = match density_kg_m3 {
            Some(dist) => {
                let kg = draw(dist, "density") * Topology::of(&object.mesh).solid_volume();
                // An open mesh encloses no volume. It keeps its mass.
                if kg > 0.0 { body.mass.with_kg(kg, MassOrigin::Known) } else { body.mass }
            }
            None => body.mass,
        };
        Ok(BodyDraft {
            mass,
            friction: friction.map_or(body.friction, |dist| draw(dist, "friction")),
            restitution: restitution.map(|dist| draw(dist, "restitution")).or(body.restitution),
            ..body
        })
    }
}
