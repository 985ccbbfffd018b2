//! `procedural_tables`: tables of six designs.

use crate::family::HouseholdModel;
use crate::household::object;
use crate::joinery::{FRAME, Joinery, TEXELS, TOP, TRIM};
use crate::material::{LICENSE, MaterialCache, MaterialFamily};
use crate::shape::{Lathe, Profile, SlotMapping, rounded_box};
use crate::variants::{check_families, parse_name, variant_catalog};
use std::ops::{Deref, DerefMut};
use syntable_model::prelude::*;
use syntable_model::scene::{Asset, AssetClass, Catalog};

/// A design of table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TableDesign {
    /// Low, with a shelf under the top.
    Coffee,
    /// A top on two blocks of drawers.
    Desk,
    /// A top on a frame with four legs.
    FourLeg,
    /// A top on two frames of square metal tube.
    Industrial,
    /// A round top on one column.
    Pedestal,
    /// A top on two trestles.
    Trestle,
}

impl TableDesign {
    const ALL: [Self; 6] = [Self::Coffee, Self::Desk, Self::FourLeg, Self::Industrial, Self::Pedestal, Self::Trestle];

    fn name(self) -> &'static str {
        match self {
            Self::Coffee => "coffee",
            Self::Desk => "desk",
            Self::FourLeg => "four_leg",
            Self::Industrial => "industrial",
            Self::Pedestal => "pedestal",
            Self::Trestle => "trestle",
        }
    }
}

/// Procedural tables: six designs of random size (tops of 0.7 to 1.8 m, heights of 0.38 to 0.8 m), surfaces
/// and exact collision parts. No download is needed.
///
/// Names are `<design>_<variant>`, such as `pedestal_0002`. The top is the highest part, level, and its outline is
/// the bounding box's in x and y (for round tops, the box around the circle).
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ProceduralTables {
    /// Designs to include; all by default.
    #[schemars(length(min = 1))]
    designs: Vec<TableDesign>,
    /// Number of variants of each design.
    #[schemars(range(min = 1, max = 10000))]
    variants_per_design: u32,
    /// Seed of all variants.
    #[schemars(range(max = 9_223_372_036_854_775_807_u64))]
    seed: u64,
}

impl Default for ProceduralTables {
    fn default() -> Self {
        Self { designs: TableDesign::ALL.to_vec(), variants_per_design: 8, seed: 0 }
    }
}

impl Config for ProceduralTables {
    type Stage = dyn AssetSource;
    const KIND: &'static str = "procedural_tables";
    const EXAMPLE: &'static str =
        "designs = [\"four_leg\", \"pedestal\", \"desk\"]  # all by default\nvariants_per_design = 8";

    fn build(mut self) -> Result<Box<dyn AssetSource>, ConfigError> {
        check_families("designs", &mut self.designs, TableDesign::name)?;
        let materials = MaterialCache::new(Stream::root(self.seed).child("table surfaces"), TEXELS);
        Ok(Box::new(TableSource { config: self, materials }))
    }
}
register!(ProceduralTables);

struct TableSource {
    config: ProceduralTables,
    materials: MaterialCache,
}

impl AssetSource for TableSource {
    fn class(&self) -> AssetClass {
        AssetClass::Object
    }

    fn license(&self) -> Option<&str> {
        Some(LICENSE)
    }

    fn catalog(&self, _: &dyn Log) -> Result<Catalog> {
        Ok(variant_catalog(self.config.designs.iter().map(|design| design.name()), self.config.variants_per_design))
    }

    fn load(&self, name: &str, _: &dyn Log) -> Result<Asset> {
        let (design, variant) =
            parse_name(name, &self.config.designs, |design| design.name(), self.config.variants_per_design)?;
        let stream = Stream::root(self.config.seed).child("tables").child(design.name()).at(u64::from(variant));
        let model = TabletopBuilder::new(&stream, &self.materials).table(design);
        object(name, "table", model).map(Asset::from)
    }
}

struct TabletopBuilder(Joinery);

impl Deref for TabletopBuilder {
    type Target = Joinery;
    fn deref(&self) -> &Joinery {
        &self.0
    }
}

impl DerefMut for TabletopBuilder {
    fn deref_mut(&mut self) -> &mut Joinery {
        &mut self.0
    }
}

impl TabletopBuilder {
    fn new(stream: &Stream, materials: &MaterialCache) -> Self {
        use MaterialFamily::{BrushedMetal, Granite, Marble, Metal, Plastic, Timber};
        let tops = [Timber, Timber, Timber, Timber, Marble, Granite, Plastic];
        Self(Joinery::new(stream, materials, &tops, &[Timber, Timber, BrushedMetal, Metal, Plastic], 0.35))
    }

    fn table(mut self, design: TableDesign) -> HouseholdModel {
        match design {
            TableDesign::Coffee => self.coffee(),
            TableDesign::Desk => self.desk(),
            TableDesign::FourLeg => self.four_leg(),
            TableDesign::Industrial => self.industrial(),
            TableDesign::Pedestal => self.pedestal(),
            TableDesign::Trestle => self.trestle(),
        }
        self.0.finish(0.6)
    }

    /// A rectangular top with these half sizes. Returns the height of its underside.
    fn top(&mut self, [a, b]: [f64; 2], h: f64, thick: f64) -> f64 {
        self.board(TOP, [-a, -b, h - thick], [a, b, h]);
        h - thick
    }

    fn four_leg(&mut self) {
        let (a, b) = (self.uniform(0.45, 0.9), self.uniform(0.35, 0.5));
        let (h, thick) = (self.uniform(0.7, 0.78), self.uniform(0.02, 0.04));
        let under = self.top([a, b], h, thick);
        let edge = self.uniform(0.045, 0.075);
        let (x, y) = (a - edge / 2.0 - self.uniform(0.01, 0.06), b - edge / 2.0 - self.uniform(0.01, 0.05));
        self.legs(FRAME, [x, y], edge, under);
        // The apron between the legs.
        let (deep, thin) = (self.uniform(0.06, 0.1), 0.02);
        for side in [-1.0, 1.0] {
            let (yc, xc) = (side * y, side * x);
            self.board(FRAME, [-x, yc - thin / 2.0, under - deep], [x, yc + thin / 2.0, under]);
            self.board(FRAME, [xc - thin / 2.0, -y, under - deep], [xc + thin / 2.0, y, under]);
        }
    }

    fn coffee(&mut self) {
        let (a, b) = (self.uniform(0.4, 0.65), self.uniform(0.35, 0.42));
        let (h, thick) = (self.uniform(0.38, 0.48), self.uniform(0.02, 0.05));
        let under = self.top([a, b], h, thick);
        let edge = self.uniform(0.04, 0.07);
        let (x, y) = (a - edge / 2.0 - 0.01, b - edge / 2.0 - 0.01);
        self.legs(FRAME, [x, y], edge, under);
        let shelf = self.uniform(0.1, 0.16);
        self.board(FRAME, [-x, -y, shelf], [x, y, shelf + 0.018]);
    }

    fn desk(&mut self) {
        let (a, b) = (self.uniform(0.6, 0.85), self.uniform(0.35, 0.42));
        let (h, thick) = (self.uniform(0.71, 0.77), self.uniform(0.022, 0.035));
        let under = self.top([a, b], h, thick);
        let width = self.uniform(0.36, 0.46);
        let drawers = self.form.integer(2, 4);
        let second = self.form.chance(0.6);
        for side in [-1.0, 1.0] {
            let [x0, x1] = if side < 0.0 { [-a + 0.02, -a + width] } else { [a - width, a - 0.02] };
            if side > 0.0 && !second {
                // A plain panel on the other side.
                self.board(FRAME, [a - 0.05, -b + 0.03, 0.0], [a - 0.02, b - 0.03, under]);
                continue;
            }
            self.board(FRAME, [x0, -b + 0.035, 0.05], [x1, b - 0.02, under]);
            self.board(TRIM, [x0 + 0.02, -b + 0.06, 0.0], [x1 - 0.02, b - 0.05, 0.05]);
            let each = (under - 0.05) / drawers as f64;
            for i in 0..drawers {
                let z = 0.05 + each * i as f64;
                self.board(FRAME, [x0 + 0.008, -b + 0.02, z + 0.008], [x1 - 0.008, -b + 0.036, z + each - 0.008]);
                let x = 0.5 * (x0 + x1);
                self.board(
                    TRIM,
                    [x - 0.06, -b + 0.006, z + 0.6 * each],
                    [x + 0.06, -b + 0.021, z + 0.6 * each + 0.012],
                );
            }
        }
    }

    fn industrial(&mut self) {
        let (a, b) = (self.uniform(0.5, 0.9), self.uniform(0.35, 0.48));
        let (h, thick) = (self.uniform(0.7, 0.8), self.uniform(0.03, 0.05));
        let under = self.top([a, b], h, thick);
        let edge = self.uniform(0.035, 0.06);
        let (x, y) = (a - self.uniform(0.08, 0.16), b - edge / 2.0 - 0.02);
        self.legs(TRIM, [x, y], edge, under);
        for side in [-x, x] {
            self.board(TRIM, [side - edge / 2.0, -y, 0.0], [side + edge / 2.0, y, edge]);
            self.board(TRIM, [side - edge / 2.0, -y, under - edge], [side + edge / 2.0, y, under]);
        }
        self.board(TRIM, [-x, -edge / 2.0, under - edge], [x, edge / 2.0, under]);
    }

    fn pedestal(&mut self) {
        let (r, h) = (self.uniform(0.36, 0.6), self.uniform(0.7, 0.78));
        let thick = self.uniform(0.02, 0.04);
        let top = SlotMapping::fit(TOP);
        let disc = Profile::at(0.0, h - thick)
            .to(r, h - thick, top)
            .round(0.3 * thick)
            .to(r, h, top)
            .round(0.3 * thick)
            .to(0.0, h, top);
        self.join(TOP, Lathe::new(&disc).segments(96).solid());
        let (column, foot, low) = (self.uniform(0.03, 0.06), r * self.uniform(0.5, 0.68), self.uniform(0.02, 0.035));
        let under = h - thick;
        let mapping = SlotMapping::fit(FRAME);
        let stand = Profile::at(0.0, 0.0)
            .to(foot, 0.0, mapping)
            .to(foot, low, mapping)
            .round(0.01)
            .curve([0.4 * foot, low + 0.01], [column, 0.1], [column, 0.22], 8, mapping)
            .to(column, under - 0.06, mapping)
            .curve([column, under - 0.03], [1.5 * column, under - 0.02], [2.4 * column, under - 0.015], 4, mapping)
            .to(2.4 * column, under, mapping)
            .to(0.0, under, mapping);
        let bands = [[0.0, low], [low, 0.08], [0.08, 0.22], [0.22, under - 0.06], [under - 0.06, under]];
        self.join(FRAME, Lathe::new(&stand).segments(48).banded(&bands));
    }

    fn trestle(&mut self) {
        let (a, b) = (self.uniform(0.6, 0.9), self.uniform(0.35, 0.45));
        let (h, thick) = (self.uniform(0.7, 0.77), self.uniform(0.02, 0.035));
        let under = self.top([a, b], h, thick);
        let edge = self.uniform(0.035, 0.05);
        let x = a - self.uniform(0.18, 0.28);
        let (spread, reach) = (self.uniform(0.08, 0.13), b - 0.06);
        for side in [-x, x] {
            self.board(FRAME, [side - edge / 2.0, -reach, under - 1.3 * edge], [side + edge / 2.0, reach, under]);
            // Legs lean out in pairs; sheared boards stay on the floor.
            for lean in [-spread, spread] {
                for y in [-0.85 * reach, 0.85 * reach] {
                    let leg =
                        rounded_box([0.7 * edge, edge, under - 0.5 * edge], 0.003, 2, |_| SlotMapping::fit(FRAME));
                    let tall = under - 0.5 * edge;
                    let leg = leg.translated(side, y, 0.5 * tall).bent(|mut p| {
                        p.x += lean * (1.0 - p.z / tall);
                        p
                    });
                    self.join(FRAME, leg);
                }
            }
            let low = 0.3 * under;
            for lean in [-spread, spread] {
                let xc = side + lean * (1.0 - low / under);
                self.board(FRAME, [xc - 0.01, -0.85 * reach, low], [xc + 0.01, 0.85 * reach, low + 0.05]);
            }
        }
    }
}
