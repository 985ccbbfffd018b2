//! The shapes of a scene's assets.

use super::{DType, Form, Product, Tensor, Value};
use crate::scene::Mesh;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The mesh of each asset, by the asset's pool and name as in `object_info`. Meters, object frame.
#[derive(Debug, Clone, Default)]
pub struct ObjectModels(pub BTreeMap<String, Arc<Mesh>>);

/// A list of records: `asset`, `vertices_m` `[V, 3]` and `triangles` `[T, 3]`, indices of vertices, counter-clockwise seen
/// from outside.
impl Product for ObjectModels {
    fn encode(&self) -> Value {
        let record = |(asset, mesh): (&String, &Arc<Mesh>)| {
            let data = mesh.data();
            let rows = |dtype, axes: &[&'static str], bytes: Vec<u8>| {
                Value::Tensor(Tensor::new(dtype, axes, vec![bytes.len() / (3 * dtype.size()), 3], bytes))
            };
            let vertices = data.positions.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
            let triangles = data.triangles.iter().flatten().flat_map(|index| index.to_le_bytes()).collect();
            Value::record([
                ("asset", asset.as_str().into()),
                ("vertices_m", rows(DType::F32, &["vertex", "axis"], vertices)),
                ("triangles", rows(DType::U32, &["triangle", "corner"], triangles)),
            ])
        };
        Value::List(self.0.iter().map(record).collect())
    }

    fn form() -> Form {
        Form::Records
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::MeshData;

    #[test]
    fn models_are_records_of_arrays() {
        let data = MeshData {
            positions: vec![[0.0, 0.5, 0.25], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
            triangles: vec![[0, 2, 1]],
            ..MeshData::default()
        };
        let mesh = Arc::new(Mesh::new(data).expect("sound"));
        let models = ObjectModels([("pool/a".to_owned(), mesh)].into());
        assert_eq!(
            serde_json::to_string(&models.encode()).expect("serializes"),
            r#"[{"asset":"pool/a","vertices_m":[[0.0,0.5,0.25],[1.0,0.0,0.0],[0.0,2.0,0.0]],"triangles":[[0,2,1]]}]"#
        );
    }
}
