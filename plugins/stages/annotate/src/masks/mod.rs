//! Masks, occlusion rates and occlusion order of a view.

mod sweep;

pub use sweep::{ObjectMasks, Sweep, area_outside, sweep};

use crate::CANVAS;
use syntable_model::prelude::*;
use syntable_model::product::standard::{
    AMODAL_MASK, COVERAGE, COVERAGE_BEFORE_SUPPORT, INSTANCE, LABEL_POLICY, OCCLUSION_MASK, OCCLUSION_ORDER,
    OCCLUSION_RATE, VISIBLE_MASK,
};
use syntable_model::product::{BitPlane, OcclusionOrder};

/// Visible, amodal and occlusion masks, occlusion rates and the occlusion order matrix (OOAM), all from one ray per
/// pixel center, so that the occlusion mask is exactly the amodal mask minus the visible mask.
///
/// An object without an amodal pixel in the image is never annotated. `label_policy` states these options in the
/// output. Its field `transparent` names the surface that labels show on transparent materials, the option
/// `blended_labels` of the renderer: `first`, `alpha_threshold` or `first_opaque`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Masks {
    /// How to treat the part of an object outside the image: `clip` (the default) ignores it; `extend` counts it as
    /// hidden in the occlusion rate, up to one image size beyond every edge. Masks end at the edges of the image either
    /// way.
    pub image_frame: ImageFrame,
    /// How to treat the part of an object behind table and room: with `occlude` (the default) it is hidden and part of
    /// the amodal mask; with `clip` it is not part of the object (SynTable's released program).
    pub table_and_room: TableAndRoom,
    /// Minimum number of visible pixels of an annotated object. 1 (the default), as in SynTable's released program, leaves
    /// out fully hidden objects, which no network can find; 0 keeps them.
    pub min_visible_px: u32,
    /// Maximum occlusion rate of an annotated object. 1 (the default) keeps all objects; SynTable's released program has
    /// 0.995.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_occlusion_rate: f64,
}

/// Treatment of the part of an object outside the image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ImageFrame {
    /// Ignored: only the part inside the image counts.
    Clip,
    /// Counted as hidden in the occlusion rate.
    Extend,
}

/// Treatment of the part of an object behind table and room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TableAndRoom {
    /// Hidden: it belongs to the amodal mask.
    Occlude,
    /// Cut off: it does not belong to the amodal mask.
    Clip,
}

impl TableAndRoom {
    /// The objects on each ray that belong to amodal masks.
    pub(crate) fn coverage(self) -> Key<BitPlane> {
        match self {
            Self::Occlude => COVERAGE,
            Self::Clip => COVERAGE_BEFORE_SUPPORT,
        }
    }
}

impl Default for Masks {
    fn default() -> Self {
        Self {
            image_frame: ImageFrame::Clip,
            table_and_room: TableAndRoom::Occlude,
            min_visible_px: 1,
            max_occlusion_rate: 1.0,
        }
    }
}

config!(Masks => dyn ViewAnnotator, "masks", "image_frame = \"clip\"\ntable_and_room = \"occlude\"\nmin_visible_px = 1");

impl ViewAnnotator for Masks {
    fn reads(&self) -> Vec<KeyId> {
        let mut keys = keys![INSTANCE, self.coverage()];
        if self.image_frame == ImageFrame::Extend {
            keys.push(self.coverage().on_canvas(CANVAS).id());
        }
        keys
    }

    fn provides(&self) -> Vec<KeyId> {
        keys![VISIBLE_MASK, AMODAL_MASK, OCCLUSION_MASK, OCCLUSION_RATE, OCCLUSION_ORDER, LABEL_POLICY]
    }

    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        let objects = cx.scene.objects().len();
        let coverage = products.get(self.coverage())?;
        check_objects(coverage, objects)?;
        let sweep = sweep(products.get(INSTANCE)?, coverage)?;
        let outside = match self.image_frame {
            ImageFrame::Clip => vec![0; objects],
            ImageFrame::Extend => {
                let canvas = products.get(self.coverage().on_canvas(CANVAS))?;
                check_objects(canvas, objects)?;
                area_outside(coverage, canvas)
            }
        };
        let rates: Vec<Option<f64>> =
            sweep.objects.iter().zip(outside).map(|(masks, outside)| self.occlusion_rate(masks, outside)).collect();

        // Object i has the instance id i + 1; `kept` is ascending, and so is the order matrix.
        let kept: Vec<usize> = (0..objects).filter(|&object| rates[object].is_some()).collect();
        let id = |object: usize| InstanceId(object as u16 + 1);
        let mut order = OcclusionOrder::new(kept.iter().map(|&object| id(object)).collect());
        for (row, &i) in kept.iter().enumerate() {
            for (column, &j) in kept.iter().enumerate() {
                if sweep.occludes(i, j) {
                    order.set(row, column);
                }
            }
        }
        let (mut visible, mut amodal, mut occlusion) =
            (PerInstance::default(), PerInstance::default(), PerInstance::default());
        for (object, masks) in sweep.objects.into_iter().enumerate().filter(|(object, _)| rates[*object].is_some()) {
            visible.0.insert(id(object), masks.visible);
            amodal.0.insert(id(object), masks.amodal);
            occlusion.0.insert(id(object), masks.occlusion);
        }
        products.put(VISIBLE_MASK, visible)?;
        products.put(AMODAL_MASK, amodal)?;
        products.put(OCCLUSION_MASK, occlusion)?;
        products.put(OCCLUSION_RATE, (0..).map(id).zip(rates).filter_map(|(id, rate)| Some((id, rate?))).collect())?;
        products.put(OCCLUSION_ORDER, order)?;
        products.put(LABEL_POLICY, self.policy(cx.dataset.label_surface))
    }
}

impl Masks {
    fn coverage(&self) -> Key<BitPlane> {
        self.table_and_room.coverage()
    }

    /// Fraction of an object's amodal area that is hidden: `1 − |V| / (|A| + outside)`. `None` if the object is not
    /// annotated.
    fn occlusion_rate(&self, masks: &ObjectMasks, outside: u64) -> Option<f64> {
        let (visible, amodal) = (u64::from(masks.visible.area()), u64::from(masks.amodal.area()));
        if amodal == 0 || visible < u64::from(self.min_visible_px) {
            return None;
        }
        let whole = amodal + outside;
        let rate = (whole - visible) as f64 / whole as f64;
        (rate <= self.max_occlusion_rate).then_some(rate)
    }

    fn policy(&self, surface: LabelSurface) -> Value {
        let (frame, rate) = match self.image_frame {
            ImageFrame::Clip => ("clip", "occlusion rate = occlusion area / amodal area, both within the image"),
            ImageFrame::Extend => (
                "extend",
                "occlusion rate = 1 - visible area / whole area, the whole area counting amodal pixels up to one \
                 image size beyond every edge",
            ),
        };
        let (support, amodal) = match self.table_and_room {
            TableAndRoom::Occlude => ("occlude", "what table and room hide of an object is in its amodal mask"),
            TableAndRoom::Clip => ("clip", "what table and room hide of an object is not in its amodal mask"),
        };
        let statement = format!(
            "masks are taken at pixel centers and end at the image's edges; {}; {amodal}; occlusion mask = amodal minus \
             visible; {rate}; objects with no amodal pixel in the image, with fewer than {} visible pixels or with a \
             rate above {} are not annotated",
            surface.statement(),
            self.min_visible_px,
            self.max_occlusion_rate
        );
        Value::record([
            ("image_frame", frame.into()),
            ("table_and_room", support.into()),
            ("transparent", surface.name().into()),
            ("min_visible_px", self.min_visible_px.into()),
            ("max_occlusion_rate", self.max_occlusion_rate.into()),
            ("statement", statement.into()),
        ])
    }
}

fn check_objects(coverage: &BitPlane, objects: usize) -> Result<()> {
    if coverage.objects() == objects {
        return Ok(());
    }
    Err(Error::new(format!("the coverage plane has {} objects, the scene {objects}", coverage.objects())))
}

register!(Masks);
