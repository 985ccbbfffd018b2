//! `procedural_interior`: the furnishings of a lived-in room, for the background of a photograph.
//!
//! A [`Piece`] is a furnishing under construction; each file models the families of one group. Standing
//! families have their back at +y and their lowest point on the floor; hanging ones are flat, with their back at +y.

mod boards;
mod cabinets;
mod couches;
mod cupboards;
mod drapery;
mod electronics;
mod footwear;
mod kitchens;
mod lamps;
mod luggage;
mod openings;
mod piece;
mod plants;
mod rugs;
mod seats;
mod solids;
mod stuff;
mod technical;
mod tones;
mod walls;

use crate::household::carrier;
use crate::material::{LICENSE, MaterialCache};
use crate::photograph_folder::PhotographFolder;
use crate::variants::{check_families, parse_name, variant_catalog};
use piece::Piece;
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};

/// Texels along the edge of the surfaces that furnishings share.
const TEXELS: usize = 512;

/// A family of furnishings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum InteriorFamily {
    /// Armchairs with cushions, some with a throw. Stands.
    Armchair,
    /// Beds with a headboard, a duvet and pillows. Stands.
    Bed,
    /// Venetian, roller and pleated blinds; most in front of a window. Hangs.
    Blind,
    /// A cable that winds over the floor, with a plug and a power strip or a power brick.
    Cable,
    /// Stacks of closed and open cardboard boxes. Stands.
    CardboardBoxes,
    /// Dining chairs, shell chairs, office chairs and stools. Stands.
    Chair,
    /// Wall clocks. Hangs.
    Clock,
    /// Rails with hooks, and coats on some of them. Hangs.
    CoatRack,
    /// Closed cabinets: sideboards, dressers, wardrobes, kitchen units and refrigerators. Stands.
    Cupboard,
    /// Curtains on a rod, long or short; some in front of a window. Hangs.
    Curtain,
    /// One to three loose cushions, lying.
    Cushion,
    /// Desks with a monitor and a keyboard, or with a laptop. Stands.
    Desk,
    /// Closed doors in their frames. Stands.
    Door,
    /// Computer keyboards, lying.
    Keyboard,
    /// Floor lamps, and table lamps on a small table; half of them are lit. Stands.
    Lamp,
    /// Open laptops; half of their screens are lit.
    Laptop,
    /// Loudspeaker boxes, tall ones and small ones. Stands.
    Loudspeaker,
    /// Mirrors, round or rectangular. Hangs.
    Mirror,
    /// Boards with pinned papers. Hangs.
    NoticeBoard,
    /// Pot plants: palms, rosettes, upright blades, large leaves and bushes. Stands.
    Plant,
    /// Panel and column radiators with their pipes. Stands.
    Radiator,
    /// Rugs, round or rectangular, some with a border or fringes; lying.
    Rug,
    /// Monitors and televisions on their stands; half of them are lit.
    Screen,
    /// Pairs of shoes, low or ankle-high, on the floor.
    Shoes,
    /// Wall sockets and switches. Hangs.
    Socket,
    /// Sofas of two or three seats, with loose cushions. Stands.
    Sofa,
    /// Suitcases and backpacks. Stands.
    Suitcase,
    /// Framed prints, canvases and posters, single or in groups. Hangs.
    WallArt,
    /// Waste bins, open or with a lid. Stands.
    WasteBin,
    /// Whiteboards with writing, pens and magnets. Hangs.
    Whiteboard,
    /// Windows with a view of the outdoors, by day or dark at night. Hangs.
    Window,
}

impl InteriorFamily {
    /// All families, sorted by name.
    const ALL: [Self; 31] = [
        Self::Armchair,
        Self::Bed,
        Self::Blind,
        Self::Cable,
        Self::CardboardBoxes,
        Self::Chair,
        Self::Clock,
        Self::CoatRack,
        Self::Cupboard,
        Self::Curtain,
        Self::Cushion,
        Self::Desk,
        Self::Door,
        Self::Keyboard,
        Self::Lamp,
        Self::Laptop,
        Self::Loudspeaker,
        Self::Mirror,
        Self::NoticeBoard,
        Self::Plant,
        Self::Radiator,
        Self::Rug,
        Self::Screen,
        Self::Shoes,
        Self::Socket,
        Self::Sofa,
        Self::Suitcase,
        Self::WallArt,
        Self::WasteBin,
        Self::Whiteboard,
        Self::Window,
    ];

    /// Name of the family in recipes, and what models it.
    fn entry(self) -> (&'static str, fn(&mut Piece)) {
        match self {
            Self::Armchair => ("armchair", couches::armchair),
            Self::Bed => ("bed", couches::bed),
            Self::Blind => ("blind", drapery::blind),
            Self::Cable => ("cable", technical::cable),
            Self::CardboardBoxes => ("cardboard_boxes", stuff::cardboard_boxes),
            Self::Chair => ("chair", seats::chair),
            Self::Clock => ("clock", walls::clock),
            Self::CoatRack => ("coat_rack", luggage::coat_rack),
            Self::Cupboard => ("cupboard", cupboards::cupboard),
            Self::Curtain => ("curtain", drapery::curtain),
            Self::Cushion => ("cushion", couches::cushion),
            Self::Desk => ("desk", electronics::desk),
            Self::Door => ("door", openings::door),
            Self::Keyboard => ("keyboard", electronics::keyboard),
            Self::Lamp => ("lamp", lamps::lamp),
            Self::Laptop => ("laptop", electronics::laptop),
            Self::Loudspeaker => ("loudspeaker", electronics::loudspeaker),
            Self::Mirror => ("mirror", walls::mirror),
            Self::NoticeBoard => ("notice_board", boards::notice_board),
            Self::Plant => ("plant", plants::plant),
            Self::Radiator => ("radiator", technical::radiator),
            Self::Rug => ("rug", rugs::rug),
            Self::Screen => ("screen", electronics::screen),
            Self::Shoes => ("shoes", footwear::shoes),
            Self::Socket => ("socket", technical::socket),
            Self::Sofa => ("sofa", couches::sofa),
            Self::Suitcase => ("suitcase", luggage::suitcase),
            Self::WallArt => ("wall_art", walls::wall_art),
            Self::WasteBin => ("waste_bin", stuff::waste_bin),
            Self::Whiteboard => ("whiteboard", boards::whiteboard),
            Self::Window => ("window", openings::window),
        }
    }

    fn name(self) -> &'static str {
        self.entry().0
    }
}

/// Procedural furnishings of lived-in rooms: cupboards, seats, curtains, lamps, plants, wall art and more, of real sizes,
/// for the background. Some lamps, screens and windows emit light. No download is needed.
///
/// Names are `<family>_<variant>`, such as `curtain_0002`. The front is −y. A variant depends on seed, family and number
/// alone.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProceduralInterior {
    /// Families to include; all by default.
    #[schemars(length(min = 1))]
    families: Vec<InteriorFamily>,
    /// Number of variants of each family.
    #[schemars(range(min = 1, max = 10000))]
    variants_per_family: u32,
    /// Seed of all variants.
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    seed: u64,
    /// Folder of JPEG and PNG files. Most wall art, and many screens, then show whole ones. Of more than 128 files,
    /// evenly spaced ones are read.
    #[serde(skip_serializing_if = "Option::is_none")]
    photographs: Option<AssetPath>,
}

impl Default for ProceduralInterior {
    fn default() -> Self {
        Self { families: InteriorFamily::ALL.to_vec(), variants_per_family: 8, seed: 0, photographs: None }
    }
}

impl Config for ProceduralInterior {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "procedural_interior";
    const EXAMPLE: &'static str =
        "families = [\"cupboard\", \"curtain\", \"plant\", \"wall_art\"]  # all by default\nvariants_per_family = 12";

    fn build(mut self) -> Result<Box<dyn AssetSource>, ConfigError> {
        check_families("families", &mut self.families, InteriorFamily::name)?;
        let materials = MaterialCache::new(Stream::root(self.seed).child("interior surfaces"), TEXELS);
        let photographs = PhotographFolder::new(self.photographs.take());
        Ok(Box::new(InteriorSource { config: self, materials, photographs }))
    }
}
register!(ProceduralInterior);

struct InteriorSource {
    config: ProceduralInterior,
    materials: MaterialCache,
    photographs: PhotographFolder,
}

impl AssetSource for InteriorSource {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn license(&self) -> Option<&str> {
        // Photographs have licenses of their own.
        (!self.photographs.is_set()).then_some(LICENSE)
    }

    fn limit(&mut self, limits: AssetLimits) {
        self.photographs.limit(limits);
    }

    fn catalog(&self, log: &dyn Log) -> Result<Catalog> {
        self.photographs.photographs(log)?;
        let families = self.config.families.iter().map(|family| family.name());
        Ok(variant_catalog(families, self.config.variants_per_family))
    }

    fn load(&self, name: &str, log: &dyn Log) -> Result<Asset> {
        let (family, variant) =
            parse_name(name, &self.config.families, |family| family.name(), self.config.variants_per_family)?;
        let (category, model) = family.entry();
        let stream = Stream::root(self.config.seed).child("interior").child(category).at(u64::from(variant));
        let mut piece = Piece::new(&stream, &self.materials, self.photographs.photographs(log)?);
        model(&mut piece);
        let (model, areas) = piece.finish();
        let mut object = carrier(name, category, model, areas)?;
        if self.photographs.is_set() {
            object.license.clear();
        }
        Ok(Asset::from(object))
    }
}
