//! Scene data for every renderer, on any device.
//!
//! [`PreparedScene`] turns a frozen scene into tables: [shading meshes](ShadingMesh), [materials](MaterialTable) with
//! numbered textures, placed bodies and [emissive triangles](EmissiveBody). [`LightTable`] checks and converts the
//! lights of a view, [`EnvironmentDistribution`] holds the light of an environment map for importance sampling,
//! [`Sampler`] provides the low-discrepancy numbers of paths, and [`labels`] the policy of all label renderers. A
//! [`SceneCache`] keeps data of single assets between scenes. [`RayScene`] answers questions about a scene before it is
//! rendered.
//!
//! Tables are vectors of plain structs that refer to each other by index, so a GPU renderer can pack each into its own
//! layout. The methods that read a table are the reference for shaders, and the code of the CPU renderer.
//!
//! **Units and frames.** Meters; radiance in nits, linear Rec. 709; meshes in the body frame, everything else in the
//! world frame. Texture coordinates have v upwards.
//!
//! **Invariant.** Every table is a pure function of the scene. Threads and caches change nothing.

mod cache;
mod emitter;
mod environment;
pub mod labels;
mod light;
mod mapping;
mod material;
mod mesh;
mod rays;
pub mod sampler;
mod scene;
mod texture;
mod tree;

pub use cache::{AssetCache, SceneCache};
pub use emitter::{EmissiveBody, EmissiveTriangle, EmitterPoint};
pub use environment::EnvironmentDistribution;
pub use light::{
    AreaLight, ConeLight, DiskLight, DistantLight, LightTable, NO_WINDOW, PlacedEnvironment, PlacedMap,
    ProjectedEnvironment, RectLight, SphereLight, WindowPattern,
};
pub use mapping::{BoxSide, Mapping, TextureCoordinates, UvAffine};
pub use material::{
    AlphaMode, ColorInput, FINEST, Material, MaterialLayers, MaterialTable, NO_LAYERS, NO_TEXTURE, NormalInput,
    PANE_ROUGHNESS, ScalarInput, TextureBinding,
};
pub use mesh::{ShadingMesh, ShadingTriangle, VertexTangents, is_mirrored, pack_unit, unpack_unit};
pub use rays::{RayMesh, RayScene};
pub use sampler::{SAMPLER_WGSL, SOBOL_PAIRS, SampleOrder, Sampler};
pub use scene::{PreparedBody, PreparedScene, SurfacePoint};
pub use texture::{MipLevel, MipTexture, decoding};
pub use tree::{BinaryNode, BinaryTree, Bounds, TreeNode};
