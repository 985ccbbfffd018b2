//! The families of procedural surfaces.

use super::layers::{add_clearcoat, add_sheen};
use super::{Bake, built, made, natural, textile, worktop, woven};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use syntable_model::random::Stream;
use syntable_model::scene::Material;

/// A family of procedural surface materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialFamily {
    /// Brick wall in running bond.
    Brick,
    /// Metal brushed in one direction.
    BrushedMetal,
    /// Plain brown or gray board with faint corrugation.
    Cardboard,
    /// Carpet pile with or without a pattern.
    Carpet,
    /// Glazed ceramic with speckles.
    Ceramic,
    /// Concrete with pits and stains.
    Concrete,
    /// Pressed granules of cork.
    Cork,
    /// Woven cloth: plain, twill or basket weave, with stripes or checks.
    Fabric,
    /// Granite grains.
    Granite,
    /// Knitwear: plain, ribbed, striped or with a jacquard.
    Knit,
    /// Paint under clear lacquer, as on cars and furniture; plain or with metallic flakes.
    Lacquer,
    /// Laminate panels with joints: plain, speckled or printed with wood.
    Laminate,
    /// Grained leather.
    Leather,
    /// Marble with veins.
    Marble,
    /// Plain metal with fine scratches.
    Metal,
    /// Rolled wall paint.
    PaintedWall,
    /// Paper: plain, laid, ruled or squared.
    Paper,
    /// Troweled plaster.
    Plaster,
    /// Plastic, smooth or finely grained.
    Plastic,
    /// Quilted cloth with stitched seams.
    Quilt,
    /// Leather panels with double seams.
    StitchedLeather,
    /// Table linen with checks, stripes, dots or flowers.
    Tablecloth,
    /// Tiles with grout.
    Tiles,
    /// One piece of wood, as in furniture.
    Timber,
    /// Cushions of woven cloth with piped seams.
    Upholstery,
    /// Velvet with a brushed pile.
    Velvet,
    /// Floor boards.
    Wood,
    /// A used worktop of wood or composite with scratches and stains.
    Worktop,
}

/// A surface of a scene, which selects families of suitable materials.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Surface {
    /// A floor indoors.
    Floor,
    /// A wall indoors.
    Wall,
    /// A ceiling.
    Ceiling,
    /// Pavement and other ground outdoors.
    Ground,
    /// A table with its legs.
    Table,
    /// An everyday object.
    Object,
}

impl MaterialFamily {
    /// The surfaces that can have materials of this family.
    pub fn surfaces(self) -> &'static [Surface] {
        use Surface::{Ceiling, Floor, Ground, Object, Table, Wall};
        match self {
            Self::Brick => &[Wall, Ground],
            Self::BrushedMetal | Self::Lacquer | Self::Metal | Self::Timber => &[Table, Object],
            Self::Carpet => &[Floor],
            Self::Concrete => &[Floor, Wall, Ceiling, Ground],
            Self::Cork => &[Floor, Wall, Object],
            Self::Granite => &[Floor, Ground, Table],
            Self::Laminate => &[Floor, Table, Object],
            Self::Marble => &[Floor, Table],
            Self::PaintedWall | Self::Plaster => &[Wall, Ceiling],
            Self::Tablecloth => &[Table, Object],
            Self::Tiles => &[Floor, Wall, Ground],
            Self::Wood => &[Floor, Ground],
            Self::Worktop => &[Table],
            Self::Cardboard
            | Self::Ceramic
            | Self::Fabric
            | Self::Knit
            | Self::Leather
            | Self::Paper
            | Self::Plastic
            | Self::Quilt
            | Self::StitchedLeather
            | Self::Upholstery
            | Self::Velvet => &[Object],
        }
    }

    /// All families, sorted by name.
    pub const ALL: [Self; 28] = [
        Self::Brick,
        Self::BrushedMetal,
        Self::Cardboard,
        Self::Carpet,
        Self::Ceramic,
        Self::Concrete,
        Self::Cork,
        Self::Fabric,
        Self::Granite,
        Self::Knit,
        Self::Lacquer,
        Self::Laminate,
        Self::Leather,
        Self::Marble,
        Self::Metal,
        Self::PaintedWall,
        Self::Paper,
        Self::Plaster,
        Self::Plastic,
        Self::Quilt,
        Self::StitchedLeather,
        Self::Tablecloth,
        Self::Tiles,
        Self::Timber,
        Self::Upholstery,
        Self::Velvet,
        Self::Wood,
        Self::Worktop,
    ];

    /// Name of the family in recipes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Brick => "brick",
            Self::BrushedMetal => "brushed_metal",
            Self::Cardboard => "cardboard",
            Self::Carpet => "carpet",
            Self::Ceramic => "ceramic",
            Self::Concrete => "concrete",
            Self::Cork => "cork",
            Self::Fabric => "fabric",
            Self::Granite => "granite",
            Self::Knit => "knit",
            Self::Lacquer => "lacquer",
            Self::Laminate => "laminate",
            Self::Leather => "leather",
            Self::Marble => "marble",
            Self::Metal => "metal",
            Self::PaintedWall => "painted_wall",
            Self::Paper => "paper",
            Self::Plaster => "plaster",
            Self::Plastic => "plastic",
            Self::Quilt => "quilt",
            Self::StitchedLeather => "stitched_leather",
            Self::Tablecloth => "tablecloth",
            Self::Tiles => "tiles",
            Self::Timber => "timber",
            Self::Upholstery => "upholstery",
            Self::Velvet => "velvet",
            Self::Wood => "wood",
            Self::Worktop => "worktop",
        }
    }

    /// Bakes one variant with textures of `size` texels.
    pub fn bake(self, stream: &Stream, size: usize, name: &str) -> Material {
        let bake: fn(&mut Stream, usize) -> Bake = match self {
            Self::Brick => built::brick,
            Self::BrushedMetal => made::brushed_metal,
            Self::Cardboard => made::cardboard,
            Self::Carpet => woven::carpet,
            Self::Ceramic => made::ceramic,
            Self::Concrete => built::concrete,
            Self::Cork => worktop::cork,
            Self::Fabric => woven::fabric,
            Self::Granite => natural::granite,
            Self::Knit => textile::knit,
            Self::Lacquer => made::lacquer,
            Self::Laminate => worktop::laminate,
            Self::Leather => natural::leather,
            Self::Marble => natural::marble,
            Self::Metal => made::metal,
            Self::PaintedWall => built::painted_wall,
            Self::Paper => made::paper,
            Self::Plaster => built::plaster,
            Self::Plastic => made::plastic,
            Self::Quilt => textile::quilt,
            Self::StitchedLeather => worktop::stitched_leather,
            Self::Tablecloth => textile::tablecloth,
            Self::Tiles => built::tiles,
            Self::Timber => natural::timber,
            Self::Upholstery => textile::upholstery,
            Self::Velvet => woven::velvet,
            Self::Wood => natural::boards,
            Self::Worktop => worktop::worktop,
        };
        let mut material = bake(&mut stream.clone(), size).material(name);
        add_layers(self, &mut material, &mut stream.child("coat"));
        material.with_digest()
    }
}

/// Adds the clearcoat or sheen of a family to a baked material.
fn add_layers(family: MaterialFamily, material: &mut Material, stream: &mut Stream) {
    match family {
        // Half of the furniture and a third of the floors have a clearcoat, satin or high gloss.
        MaterialFamily::Timber if stream.chance(0.5) => add_clearcoat(material, stream.uniform(0.04, 0.3), false),
        MaterialFamily::Wood if stream.chance(0.35) => add_clearcoat(material, stream.uniform(0.08, 0.35), true),
        MaterialFamily::Ceramic => add_clearcoat(material, stream.uniform(0.02, 0.12), true),
        MaterialFamily::Lacquer => add_clearcoat(material, stream.uniform(0.02, 0.08), false),
        MaterialFamily::Leather | MaterialFamily::StitchedLeather if stream.chance(0.2) => {
            add_clearcoat(material, stream.uniform(0.08, 0.25), true)
        }
        MaterialFamily::Fabric
        | MaterialFamily::Knit
        | MaterialFamily::Quilt
        | MaterialFamily::Tablecloth
        | MaterialFamily::Upholstery => {
            add_sheen(material, stream.uniform(0.15, 0.5), stream.uniform(0.3, 0.8), stream.uniform(0.35, 0.7));
        }
        MaterialFamily::Carpet => {
            add_sheen(material, stream.uniform(0.2, 0.5), stream.uniform(0.2, 0.6), stream.uniform(0.6, 0.9));
        }
        MaterialFamily::Velvet => {
            add_sheen(material, stream.uniform(0.6, 1.0), stream.uniform(0.15, 0.5), stream.uniform(0.2, 0.4));
        }
        _ => {}
    }
}
