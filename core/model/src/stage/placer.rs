//! Puts bodies into a scene.

use crate::context::{Assets, Context, Log};
use crate::error::Result;
use crate::names::SupportName;
use crate::scene::{CatalogEntry, SceneBuilder};
use std::path::PathBuf;

/// Adds bodies, and what belongs to them such as supports, with their initial poses. Placers run in recipe order.
pub trait Placer: Send + Sync {
    /// Places the bodies of one scene.
    fn place(&self, scene: &mut SceneBuilder, context: &Context) -> Result<()>;
    /// The parts of the scene that it sets and needs, so that `check` finds steps that are missing, duplicate or in the
    /// wrong order. None if it does not declare them.
    fn parts(&self) -> Option<Vec<PartUse>> {
        None
    }
    /// Whether it may place bodies of [`Role::Object`](crate::scene::Role::Object): a scene needs one.
    fn places_objects(&self) -> bool {
        true
    }
    /// Whether objects that it places, and that labels describe, can differ in size from their assets.
    fn resizes_objects(&self) -> bool {
        false
    }
    /// The labeled objects that it has itself instead of drawing them from a pool: their names, their categories (empty for
    /// none), which get ids in annotation files, and their numbers.
    fn own_objects(&self) -> Vec<CatalogEntry> {
        Vec::new()
    }
    /// Finds mistakes that would end a run: files that are missing or cannot be read, names of assets that no pool has.
    /// `check`, previews and runs call it before the first scene, with the open pools as `assets`. It may keep the files that it
    /// reads for [`place`](Self::place).
    ///
    /// # Errors
    /// With the first mistake.
    fn ready(&self, assets: &dyn Assets, log: &dyn Log) -> Result<()> {
        let _ = (assets, log);
        Ok(())
    }
    /// The files of its options that name further files, and the files that it reads because of them: of a mesh, the files of
    /// its materials, images and buffers. `[lock]` covers both by one digest.
    ///
    /// # Errors
    /// If a file cannot be read.
    fn companions(&self, _log: &dyn Log) -> Result<Vec<Companions>> {
        Ok(Vec::new())
    }
}

/// A file of an option, and the files that a stage reads because of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Companions {
    /// The option's file.
    pub of: PathBuf,
    /// The further files.
    pub files: Vec<PathBuf>,
}

/// A part of a scene that one placer sets and others may need.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Part {
    /// The floor of a room or of the open ground, at z = 0.
    Floor,
    /// The walls of a room.
    Walls,
    /// The [support](crate::scene::Support) of a name.
    Support(String),
    /// The main support: the first that a step sets.
    MainSupport,
    /// The [cameras](crate::scene::RecordedCamera) of a recorded scene.
    RecordedCameras,
}

impl Part {
    /// The support that a recipe names, or the main one.
    pub fn support(name: Option<&SupportName>) -> Self {
        name.map_or(Self::MainSupport, |name| Self::Support(name.as_str().to_owned()))
    }
}

/// How a placer uses a part of the scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PartUse {
    /// It sets the part. At most one placer of a recipe does.
    Sets(Part),
    /// It needs the part, which an earlier step has set.
    Needs(Part),
}
