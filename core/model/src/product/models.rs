//! The shapes of a scene's assets.

use super::{DType, Form, Product, Tensor, Value};
use crate::scene::{Material, Mesh, Object, SourceModel, SymmetryAxis};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The model of each asset, by the asset's pool and name as in `object_info`.
#[derive(Debug, Clone, Default)]
pub struct ObjectModels(pub BTreeMap<String, ObjectModel>);

/// Shape, surface and number of an asset. Meters, object frame; symmetries are in the frame of the asset's file.
#[derive(Debug, Clone)]
pub struct ObjectModel {
    /// The shape.
    pub mesh: Arc<Mesh>,
    /// Materials by slot of the mesh; empty if they are not known.
    pub materials: Vec<Arc<Material>>,
    /// Number, origin and symmetries of the asset.
    pub source: SourceModel,
}

impl From<&Object> for ObjectModel {
    fn from(object: &Object) -> Self {
        let Object { mesh, materials, model, .. } = object;
        Self { mesh: Arc::clone(mesh), materials: materials.clone(), source: model.clone() }
    }
}

/// A list of records: `asset`, `obj_id`, `model_origin_m`, the known symmetries, `vertices_m` `[V, 3]` and `triangles`
/// `[T, 3]`, indices of vertices, counter-clockwise seen from outside. Materials are left out.
impl Product for ObjectModels {
    fn encode(&self) -> Value {
        let record = |(asset, model): (&String, &ObjectModel)| {
            let (data, source) = (model.mesh.data(), &model.source);
            let rows = |dtype, axes: &[&'static str], bytes: Vec<u8>| {
                Value::Tensor(Tensor::new(dtype, axes, vec![bytes.len() / (3 * dtype.size()), 3], bytes))
            };
            let vertices = data.positions.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
            let triangles = data.triangles.iter().flatten().flat_map(|index| index.to_le_bytes()).collect();
            let mut fields = vec![
                ("asset", asset.as_str().into()),
                ("obj_id", source.obj_id.map_or(Value::Null, Value::from)),
                ("model_origin_m", <[f64; 3]>::from(source.origin).into()),
            ];
            let symmetries = &source.symmetries;
            if !symmetries.discrete.is_empty() {
                fields.push(("symmetries_discrete_m", symmetries.discrete.clone().into()));
            }
            if !symmetries.continuous.is_empty() {
                let axis =
                    |it: &SymmetryAxis| Value::record([("axis", it.axis.into()), ("offset_m", it.offset_m.into())]);
                fields.push(("symmetries_continuous", Value::List(symmetries.continuous.iter().map(axis).collect())));
            }
            fields.push(("vertices_m", rows(DType::F32, &["vertex", "axis"], vertices)));
            fields.push(("triangles", rows(DType::U32, &["triangle", "corner"], triangles)));
            Value::record(fields)
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
    use crate::scene::{MeshData, Symmetries};

    #[test]
    fn models_are_records_of_arrays() {
        let data = MeshData {
            positions: vec![[0.0, 0.5, 0.25], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
            triangles: vec![[0, 2, 1]],
            ..MeshData::default()
        };
        let mesh = Arc::new(Mesh::new(data).expect("sound"));
        let source = SourceModel {
            obj_id: Some(5),
            symmetries: Symmetries {
                continuous: vec![SymmetryAxis { axis: [0.0, 0.0, 1.0], offset_m: [0.5, 0.0, 0.0] }],
                ..Symmetries::default()
            },
            ..SourceModel::default()
        };
        let model = ObjectModel { mesh, materials: Vec::new(), source };
        let models = ObjectModels([("pool/a".to_owned(), model)].into());
        assert_eq!(
            serde_json::to_string(&models.encode()).expect("serializes"),
            r#"[{"asset":"pool/a","obj_id":5,"model_origin_m":[0.0,0.0,0.0],"symmetries_continuous":[{"axis":[0.0,0.0,1.0],"offset_m":[0.5,0.0,0.0]}],"vertices_m":[[0.0,0.5,0.25],[1.0,0.0,0.0],[0.0,2.0,0.0]],"triangles":[[0,2,1]]}]"#
        );
    }
}
