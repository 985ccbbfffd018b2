//! A small scene, and random label planes as a renderer could produce them.

#![allow(dead_code)]

use std::sync::Arc;
use syntable_model::context::{Collected, DatasetContext, SceneContext, Serial, ViewContext};
use syntable_model::digest::Digest;
use syntable_model::geometry::{Point3, Vector3, look_at};
use syntable_model::prelude::*;
use syntable_model::product::standard::COVERAGE_BEFORE_SUPPORT;
use syntable_model::product::{BitPlane, Key, Plane};
use syntable_model::registry::{Registry, Slot, Stage};
use syntable_model::scene::{
    AssetRef, BodyDraft, Camera, Exposure, Intrinsics, MassOrigin, MassProperties, Material, Mesh, MeshData, Moment,
    Motion, Object, Region, Role, SceneId, SettleReport, SourceModel, Support, ViewId,
};
use syntable_model::stage::DatasetInfo;

/// The stage of a kind with these options.
pub fn stage(kind: &str, options: &str) -> Stage {
    use syntable_annotate as _;
    let registry = Registry::linked().expect("kinds are unique");
    let entry = registry.find(Slot::Annotate, kind).expect("a registered kind");
    entry.construct_str(options).expect("good options").stage
}

/// An annotator of views or images.
pub fn annotator(kind: &str, options: &str) -> Box<dyn ViewAnnotator> {
    match stage(kind, options) {
        Stage::AnnotateImage(annotator) => Box::new(OfImages(annotator)),
        Stage::AnnotateView(annotator) => annotator,
        _ => panic!("`{kind}` does not annotate views"),
    }
}

/// An annotator of images, for views.
struct OfImages(Box<dyn ImageAnnotator>);

impl ViewAnnotator for OfImages {
    fn reads(&self) -> Vec<KeyId> {
        self.0.reads()
    }
    fn provides(&self) -> Vec<KeyId> {
        self.0.provides()
    }
    fn annotate(&self, cx: &ViewContext, products: &mut Products) -> Result<()> {
        self.0.annotate(cx, products)
    }
}

/// A scene of `objects` tetrahedra above a table, and a view of it.
pub struct World {
    pub dataset: DatasetInfo,
    pub scene: Scene,
    pub view: View,
    pub log: Collected,
}

impl World {
    pub fn new(objects: usize) -> Self {
        Self::of(Self::tetrahedron(), objects)
    }

    pub fn tetrahedron() -> Object {
        let mesh = Mesh::new(MeshData {
            positions: vec![[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
            ..Default::default()
        })
        .expect("sound");
        Object {
            name: "tetra".into(),
            category: "solid".into(),
            mass: MassProperties::of_mesh(&mesh, 0.25, MassOrigin::Known),
            mesh: Arc::new(mesh),
            materials: vec![Arc::new(Material::plain("gray", [0.5; 3], 0.5))],
            collision: None,
            keypoints: Vec::new(),
            support_areas: Vec::new(),
            restitution: None,
            model: SourceModel::default(),
            friction: 0.5,
            license: "CC0-1.0".into(),
            digest: Digest::of(b"tetra"),
        }
    }

    /// A world with other objects.
    pub fn of(object: Object, objects: usize) -> Self {
        let object = Arc::new(object);
        let mut builder = SceneBuilder::new(SceneId(3), 1);
        builder.supports = Support::new("table", Region::rectangle([0.0, 0.0, 0.7], [1.0, 0.8])).into();
        let asset = AssetRef { pool: "pool".into(), name: "tetra".into() };
        let mut add = |role, x: f64| {
            let pose = Pose::translation(x, 0.0, 0.7);
            builder.add(BodyDraft::new(asset.clone(), object.clone(), pose, role, Motion::Dynamic))
        };
        add(Role::Support, 0.0);
        let handles: Vec<_> = (0..objects + 1).map(|i| add(Role::Object, 0.01 * i as f64)).collect();
        // The first object is removed, so that spawn numbers and ids differ.
        builder.remove(handles[0]);
        let scene = builder.freeze(SettleReport::default()).expect("a scene");
        let eye = Point3::new(1.0, 0.0, 1.5);
        let view = View {
            moment: Moment::START,
            id: ViewId(2),
            camera: Camera::pinhole(
                Intrinsics { width: 8, height: 6, fx: 7.0, fy: 7.5, cx: 4.0, cy: 3.0 },
                look_at(eye, Point3::new(0.0, 0.0, 0.7), Vector3::z()),
            ),
            exposure: Exposure::Auto { compensation_ev: 0.0 },
            lights: Vec::new(),
            rig: None,
        };
        let dataset = DatasetInfo {
            name: "test".into(),
            seed: 1,
            scenes: 4,
            views_per_scene: 5,
            recipe: String::new(),
            program: "test".into(),
            classes: Vec::new(),
            own_categories: Vec::new(),
            label_surface: LabelSurface::First,
        };
        Self { dataset, scene, view, log: Collected::default() }
    }

    pub fn of_scene(&self) -> SceneContext<'_> {
        DatasetContext::new(&self.dataset, &Serial, &self.log).scene(&self.scene)
    }

    pub fn of_view(&self) -> ViewContext<'_> {
        self.of_scene().view(&self.view)
    }
}

/// The bodies that the ray of every pixel hits, front to back, on an image with a margin. Id `objects + 1` is the
/// table.
pub struct Rays {
    pub width: i32,
    pub height: i32,
    pub margin: [i32; 2],
    pub objects: usize,
    hits: Vec<Vec<u16>>,
}

impl Rays {
    pub fn new(size: [i32; 2], margin: [i32; 2], objects: usize, mut hits: impl FnMut(i32, i32) -> Vec<u16>) -> Self {
        let [width, height] = size;
        let rows = -margin[1]..height + margin[1];
        let hits = rows.flat_map(|y| (-margin[0]..width + margin[0]).map(move |x| (x, y))).map(|(x, y)| hits(x, y));
        Self { width, height, margin, objects, hits: hits.collect() }
    }

    /// Random blobs: every body covers a random rectangle at a random depth, with random gaps; so does the table.
    pub fn random(size: [i32; 2], objects: usize, seed: u64) -> Self {
        let mut stream = Stream::root(seed);
        let margin = size;
        let bodies: Vec<([i32; 4], u32, u16)> = (1..=objects as u16 + 1)
            .map(|id| {
                let mut range = |length: i32| {
                    let a = stream.integer((-length).into(), (2 * length).into()) as i32;
                    (a, a + stream.integer(0, length.into()) as i32)
                };
                let ((x0, x1), (y0, y1)) = (range(size[0]), range(size[1]));
                ([x0, x1, y0, y1], stream.next_u32(), id)
            })
            .collect();
        // Holes and dents, so that columns have several runs and depth orders are not the same everywhere.
        let noise = |x: i32, y: i32, id: u16| {
            let mut pixel = Stream::root(seed ^ u64::from(id) << 40 ^ ((x + 999) as u64) << 20 ^ (y + 999) as u64);
            (pixel.chance(0.15), pixel.chance(0.1), pixel.next_u32())
        };
        Self::new(size, margin, objects, |x, y| {
            let mut here: Vec<(u32, u16)> = bodies
                .iter()
                .filter_map(|&([x0, x1, y0, y1], depth, id)| {
                    let (hole, moved, other) = noise(x, y, id);
                    let inside = (x0..x1).contains(&x) && (y0..y1).contains(&y) && !hole;
                    inside.then_some((if moved { other } else { depth }, id))
                })
                .collect();
            here.sort_unstable();
            here.into_iter().map(|(_, id)| id).collect()
        })
    }

    pub fn at(&self, x: i32, y: i32) -> &[u16] {
        let columns = self.width + 2 * self.margin[0];
        &self.hits[((y + self.margin[1]) * columns + x + self.margin[0]) as usize]
    }

    /// The objects at a pixel, at any depth or in front of the table only.
    pub fn cover(&self, x: i32, y: i32, before_support: bool) -> Vec<u16> {
        let object = |id: &u16| usize::from(*id) <= self.objects;
        let hits = self.at(x, y).iter().copied();
        if before_support { hits.take_while(object).collect() } else { hits.filter(object).collect() }
    }

    pub fn instance(&self) -> Plane<InstanceId> {
        Plane::from_fn(self.width as u32, self.height as u32, |x, y| {
            InstanceId(self.at(x as i32, y as i32).first().copied().unwrap_or(0))
        })
    }

    /// One of the products `coverage` and `coverage_before_support`, on the image or with the margin.
    pub fn coverage(&self, key: Key<BitPlane>) -> BitPlane {
        let before_support = key.name() == COVERAGE_BEFORE_SUPPORT.name();
        let [mx, my] = if key.id().framing.canvas() == 1 { [0, 0] } else { self.margin };
        let mut plane = BitPlane::new((self.width + 2 * mx) as u32, (self.height + 2 * my) as u32, self.objects);
        for y in -my..self.height + my {
            for x in -mx..self.width + mx {
                for id in self.cover(x, y, before_support) {
                    plane.insert((x + mx) as u32, (y + my) as u32, InstanceId(id));
                }
            }
        }
        plane
    }
}
