//! `procedural_furniture`: shelves, racks, drawers and conveyors that carry objects.

use crate::family::HouseholdModel;
use crate::household::carrier;
use crate::joinery::{FRAME, Joinery, TEXELS, TOP, TRIM};
use crate::material::{LICENSE, MaterialCache, MaterialFamily, SurfaceFinish, hsv};
use crate::shape::{SlotMapping, extrude};
use crate::variants::{check_families, parse_name, variant_catalog};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog, Region, SupportArea, Walls};

/// A family of furniture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FurnitureFamily {
    /// A belt between two rails, on legs. The belt carries objects.
    Conveyor,
    /// A cabinet with one drawer pulled out. The open part of the drawer carries objects.
    Drawer,
    /// Shelves of metal on four posts, open on all sides. Each shelf carries objects.
    Rack,
    /// A bookcase or cupboard without doors: boards between two uprights. Each board carries objects.
    Shelf,
}

impl FurnitureFamily {
    const ALL: [Self; 4] = [Self::Conveyor, Self::Drawer, Self::Rack, Self::Shelf];

    fn name(self) -> &'static str {
        match self {
            Self::Conveyor => "conveyor",
            Self::Drawer => "drawer",
            Self::Rack => "rack",
            Self::Shelf => "shelf",
        }
    }
}

/// Procedural furniture that carries objects: shelves, racks, drawers and conveyors of random sizes, with exact collision parts. The
/// kind `support` of `[[place]]` makes supports of them. No download is needed.
///
/// Names are `<family>_<variant>`, such as `shelf_0002`. The front is −y.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProceduralFurniture {
    /// Families to include; all by default.
    #[schemars(length(min = 1))]
    families: Vec<FurnitureFamily>,
    /// Number of variants of each family.
    #[schemars(range(min = 1, max = 10000))]
    variants_per_family: u32,
    /// Width of shelves, racks and drawers, and length of conveyors, along x, meters, 0.2 to 5.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = WIDTH_M[0], "maximum" = WIDTH_M[1]))]
    width_m: Option<Dist>,
    /// Depth, along y, meters, 0.1 to 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = DEPTH_M[0], "maximum" = DEPTH_M[1]))]
    depth_m: Option<Dist>,
    /// Number of boards of shelves and racks that carry objects, 1 to 12.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = BOARDS[0], "maximum" = BOARDS[1]))]
    boards: Option<IntDist>,
    /// Clear height above each board of shelves and racks, meters, 0.05 to 2. Above the top board of a rack it is open.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = CLEAR_M[0], "maximum" = CLEAR_M[1]))]
    clear_height_m: Option<Dist>,
    /// Seed of all variants.
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    seed: u64,
}

const WIDTH_M: [f64; 2] = [0.2, 5.0];
const DEPTH_M: [f64; 2] = [0.1, 2.0];
const BOARDS: [i64; 2] = [1, 12];
const CLEAR_M: [f64; 2] = [0.05, 2.0];

impl Default for ProceduralFurniture {
    fn default() -> Self {
        Self {
            families: FurnitureFamily::ALL.to_vec(),
            variants_per_family: 8,
            width_m: None,
            depth_m: None,
            boards: None,
            clear_height_m: None,
            seed: 0,
        }
    }
}

impl Config for ProceduralFurniture {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "procedural_furniture";
    const EXAMPLE: &'static str =
        "families = [\"shelf\"]                        # all by default\nboards = { integers = [3, 5] }\nwidth_m = 0.9";

    fn build(mut self) -> Result<Box<dyn AssetSource>, ConfigError> {
        check_families("families", &mut self.families, FurnitureFamily::name)?;
        for (key, dist, [low, high]) in [
            ("width_m", &self.width_m, WIDTH_M),
            ("depth_m", &self.depth_m, DEPTH_M),
            ("clear_height_m", &self.clear_height_m, CLEAR_M),
        ] {
            dist.as_ref().map_or(Ok(()), |dist| dist.within(key, low, high))?;
        }
        self.boards.as_ref().map_or(Ok(()), |boards| boards.within("boards", BOARDS[0], BOARDS[1]))?;
        let materials = MaterialCache::new(Stream::root(self.seed).child("furniture surfaces"), TEXELS);
        Ok(Box::new(FurnitureSource { config: self, materials }))
    }
}
register!(ProceduralFurniture);

struct FurnitureSource {
    config: ProceduralFurniture,
    materials: MaterialCache,
}

impl AssetSource for FurnitureSource {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn license(&self) -> Option<&str> {
        Some(LICENSE)
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        let families = self.config.families.iter().map(|family| family.name());
        Ok(variant_catalog(families, self.config.variants_per_family))
    }

    fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
        let (family, variant) =
            parse_name(name, &self.config.families, |family| family.name(), self.config.variants_per_family)?;
        let stream = Stream::root(self.config.seed).child("furniture").child(family.name()).at(u64::from(variant));
        let builder = Builder::new(family, &self.config, &stream, &self.materials);
        let (model, areas) = match family {
            FurnitureFamily::Conveyor => builder.conveyor(&stream),
            FurnitureFamily::Drawer => builder.drawer(),
            FurnitureFamily::Rack => builder.rack(),
            FurnitureFamily::Shelf => builder.shelf(),
        };
        carrier(name, family.name(), model, areas).map(Asset::from)
    }
}

/// A piece of furniture under construction.
struct Builder<'c> {
    config: &'c ProceduralFurniture,
    joinery: Joinery,
    sizes: Stream,
}

impl<'c> Builder<'c> {
    fn new(
        family: FurnitureFamily,
        config: &'c ProceduralFurniture,
        stream: &Stream,
        materials: &MaterialCache,
    ) -> Self {
        use MaterialFamily::{BrushedMetal, Lacquer, Metal, PaintedWall, Plastic, Timber};
        let (tops, frames, same): (&[_], &[_], _) = match family {
            FurnitureFamily::Conveyor => (&[Plastic], &[BrushedMetal, Metal, Plastic], 0.0),
            FurnitureFamily::Rack => (&[Metal, BrushedMetal, Plastic, Timber], &[Metal, BrushedMetal, Plastic], 0.4),
            _ => (&[Timber, Timber, Timber, Lacquer, PaintedWall], &[Timber, Timber, Lacquer], 0.75),
        };
        Self {
            config,
            joinery: Joinery::new(stream, materials, tops, frames, same).with_top_round(0.0015),
            sizes: stream.child("sizes"),
        }
    }

    fn draw(&self, option: &Option<Dist>, range: [f64; 2], name: &str) -> f64 {
        option.as_ref().unwrap_or(&Dist::Uniform(range[0], range[1])).draw(&mut self.sizes.child(name))
    }

    fn boards(&self, range: [i64; 2]) -> usize {
        let boards = self.config.boards.as_ref();
        let drawn = boards.unwrap_or(&IntDist::Integers(range[0], range[1])).draw(&mut self.sizes.child("boards"));
        drawn as usize
    }

    /// Clear heights, the lowest first.
    fn clear_heights(&self, boards: usize, range: [f64; 2]) -> Vec<f64> {
        let default = Dist::Uniform(range[0], range[1]);
        let dist = self.config.clear_height_m.as_ref().unwrap_or(&default);
        let stream = self.sizes.child("clear");
        // Most shelves are even. A drawn height holds for all boards, or for each its own.
        let is_even = stream.child("even").chance(0.6);
        (0..boards).map(|board| dist.draw(&mut stream.at(if is_even { 0 } else { board as u64 }))).collect()
    }

    fn shelf(mut self) -> (HouseholdModel, Vec<SupportArea>) {
        let width = self.draw(&self.config.width_m, [0.6, 1.1], "width");
        let depth = self.draw(&self.config.depth_m, [0.25, 0.42], "depth");
        let (a, b) = (width / 2.0, depth / 2.0);
        let heights = self.clear_heights(self.boards([3, 5]), [0.26, 0.4]);
        let joinery = &mut self.joinery;
        let (thick, plinth) = (joinery.uniform(0.016, 0.028), joinery.uniform(0.04, 0.1));
        let mut z = plinth;
        let mut areas = Vec::new();
        for clear in &heights {
            joinery.board(TOP, [-a, -b, z], [a, b, z + thick]);
            let surface = Region::rectangle([0.0, 0.0, z + thick], [width, depth]);
            areas.push(SupportArea { surface, clear_height_m: Some(*clear), walls: None });
            z += thick + clear;
        }
        let top = z + thick;
        joinery.board(TOP, [-a, -b, z], [a, b, top]);
        for side in [-1.0, 1.0] {
            let [x0, x1] = [side * a, side * (a + thick)];
            joinery.board(FRAME, [x0.min(x1), -b, 0.0], [x0.max(x1), b, top]);
        }
        if joinery.form.chance(0.75) {
            joinery.board(FRAME, [-a, b - 0.008, 0.02], [a, b, top - 0.002]);
            for area in &mut areas {
                let height = area.surface.height();
                area.surface = Region::rectangle([0.0, -0.004, height], [width, depth - 0.008]);
            }
        }
        joinery.board(FRAME, [-a, -b + 0.03, 0.0], [a, -b + 0.045, plinth]);
        (self.joinery.finish(0.5), areas)
    }

    fn rack(mut self) -> (HouseholdModel, Vec<SupportArea>) {
        let width = self.draw(&self.config.width_m, [0.7, 1.2], "width");
        let depth = self.draw(&self.config.depth_m, [0.35, 0.5], "depth");
        let (a, b) = (width / 2.0, depth / 2.0);
        let heights = self.clear_heights(self.boards([3, 4]), [0.3, 0.45]);
        let joinery = &mut self.joinery;
        let (post, lip) = (joinery.uniform(0.025, 0.035), joinery.uniform(0.025, 0.04));
        let mut z = joinery.uniform(0.08, 0.16);
        let mut areas = Vec::new();
        for (number, clear) in heights.iter().enumerate() {
            joinery.board(TOP, [-a, -b, z], [a, b, z + 0.006]);
            for side in [-1.0, 1.0] {
                let [y0, y1] = [side * b, side * (b - 0.003)];
                joinery.board(TOP, [-a, y0.min(y1), z + 0.006 - lip], [a, y0.max(y1), z + 0.001]);
                let [x0, x1] = [side * a, side * (a - 0.003)];
                joinery.board(TOP, [x0.min(x1), -b, z + 0.006 - lip], [x0.max(x1), b, z + 0.001]);
            }
            let is_top = number + 1 == heights.len();
            let surface = Region::rectangle([0.0, 0.0, z + 0.006], [width, depth]);
            let clear_height_m = (!is_top).then_some(*clear);
            areas.push(SupportArea { surface, clear_height_m, walls: None });
            // The lip of the next board is above the clear height.
            z += if is_top { 0.006 } else { clear + lip };
        }
        for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
            let [x0, x1] = [a, a + post].map(|at| x * at);
            let [y0, y1] = [b - post, b].map(|at| y * at);
            joinery.board(FRAME, [x0.min(x1), y0.min(y1), 0.0], [x0.max(x1), y0.max(y1), z + 0.04]);
        }
        (self.joinery.finish(0.4), areas)
    }

    fn drawer(mut self) -> (HouseholdModel, Vec<SupportArea>) {
        let width = self.draw(&self.config.width_m, [0.4, 0.8], "width");
        let depth = self.draw(&self.config.depth_m, [0.4, 0.55], "depth");
        let (a, b) = (width / 2.0, depth / 2.0);
        let joinery = &mut self.joinery;
        let thick = joinery.uniform(0.015, 0.022);
        let drawers = joinery.form.integer(2, 4);
        let front_height = joinery.uniform(0.14, 0.2);
        let plinth = joinery.uniform(0.03, 0.08);
        let top = plinth + front_height * drawers as f64 + thick;
        for side in [-1.0, 1.0] {
            let [x0, x1] = [side * a, side * (a - thick)];
            joinery.board(FRAME, [x0.min(x1), -b, 0.0], [x0.max(x1), b, top]);
        }
        joinery.board(FRAME, [-a + thick, b - thick, 0.0], [a - thick, b, top]);
        joinery.board(TOP, [-a - 0.005, -b - thick, top], [a + 0.005, b + 0.005, top + thick]);
        joinery.board(FRAME, [-a + thick, -b + 0.03, 0.0], [a - thick, -b + 0.045, plinth]);
        // The top drawer is open; the others are closed.
        let open = joinery.uniform(0.55, 0.8) * (depth - 2.0 * thick);
        let half = a - thick - 0.004;
        let mut areas = Vec::new();
        for number in 0..drawers {
            let is_open = number + 1 == drawers;
            let z = plinth + front_height * number as f64;
            let shift = if is_open { -open } else { 0.0 };
            let front = -b + shift;
            joinery.board(TOP, [-a + 0.002, front - thick, z + 0.002], [a - 0.002, front, z + front_height - 0.002]);
            let pull = z + 0.65 * front_height;
            joinery.board(TRIM, [-0.06, front - thick - 0.022, pull], [0.06, front - thick - 0.012, pull + 0.012]);
            for x in [-0.05, 0.04] {
                joinery.board(TRIM, [x, front - thick - 0.016, pull + 0.001], [x + 0.01, front - thick, pull + 0.011]);
            }
            if !is_open {
                continue;
            }
            let (low, high) = (z + 0.02, z + 0.8 * front_height);
            let back = front + depth - 2.0 * thick;
            joinery.board(FRAME, [-half, front, low], [half, back, low + 0.008]);
            for side in [-1.0, 1.0] {
                let [x0, x1] = [side * half, side * (half - 0.012)];
                joinery.board(FRAME, [x0.min(x1), front, low], [x0.max(x1), back, high]);
            }
            joinery.board(FRAME, [-half + 0.012, back - 0.012, low], [half - 0.012, back, high]);
            // Objects fall in where the cabinet does not cover the drawer.
            let free = open - thick;
            let surface = Region::rectangle([0.0, front + free / 2.0, low + 0.008], [2.0 * (half - 0.012), free]);
            let walls = Walls { height_m: high - low - 0.008, draft_m: 0.0 };
            areas.push(SupportArea { surface, clear_height_m: None, walls: Some(walls) });
        }
        (self.joinery.finish(0.5), areas)
    }

    fn conveyor(mut self, stream: &Stream) -> (HouseholdModel, Vec<SupportArea>) {
        let length = self.draw(&self.config.width_m, [1.2, 2.0], "width");
        let width = self.draw(&self.config.depth_m, [0.35, 0.6], "depth");
        let (a, b) = (length / 2.0, width / 2.0);
        let rubber = hsv(stream.child("belt").uniform(0.0, 1.0), 0.1, stream.child("belt dark").uniform(0.04, 0.14));
        self.joinery.set_material(TOP, SurfaceFinish::plain(rubber, 0.75, 0.0).named("rubber"));
        let joinery = &mut self.joinery;
        let (height, radius) = (joinery.uniform(0.6, 0.85), joinery.uniform(0.03, 0.05));
        // The belt runs over two drums: a section with round ends in the x-z plane, extruded along y.
        let arc = |sign: f64| {
            (0..=12).map(move |step| {
                let angle = std::f64::consts::PI * (f64::from(step) / 12.0 - 0.5);
                [sign * (a - radius + radius * libm::cos(angle)), sign * radius * libm::sin(angle)]
            })
        };
        let section: Vec<[f64; 2]> = arc(1.0).chain(arc(-1.0)).collect();
        let belt = extrude(&section, [-b, b], 0.0, SlotMapping::tile(TOP, 0.3), SlotMapping::tile(TOP, 0.3));
        // Extruded along z: z becomes −y, and y becomes z.
        joinery.join(TOP, belt.rotated(0, 90.0).translated(0.0, 0.0, height - radius));
        let (rail, lip) = (joinery.uniform(0.02, 0.03), joinery.uniform(0.015, 0.05));
        for side in [-1.0, 1.0] {
            let [y0, y1] = [side * (b + 0.003), side * (b + 0.003 + rail)];
            joinery.board(FRAME, [-a, y0.min(y1), height - 2.4 * radius], [a, y0.max(y1), height + lip]);
        }
        let under = height - 2.4 * radius;
        joinery.legs(FRAME, [a - 0.12, b - 0.01], 0.05, under + 0.01);
        for x in [-a + 0.12, a - 0.12] {
            joinery.board(FRAME, [x - 0.02, -b, 0.18], [x + 0.02, b, 0.22]);
        }
        let surface = Region::rectangle([0.0, 0.0, height], [length - 2.0 * radius, width]);
        let walls = Walls { height_m: lip, draft_m: 0.0 };
        (self.joinery.finish(0.7), vec![SupportArea { surface, clear_height_m: None, walls: Some(walls) }])
    }
}
