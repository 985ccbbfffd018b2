//! The types of this crate that are products: how each is encoded, and read back.

use super::decode::is_of_instances;
use super::{
    BBox, BitPlane, DType, Form, Mask, ObjectDepths, ObjectImages, OcclusionOrder, PerInstance, Pixel, Plane, Product,
    Stored, Tensor, Value,
};
use std::any::TypeId;

impl<P: Pixel> Product for Plane<P> {
    fn encode(&self) -> Value {
        let mut bytes = Vec::with_capacity(self.data().len() * P::DTYPE.size() * P::CHANNELS.unwrap_or(1));
        P::write_all(self.data(), &mut bytes);
        let size = [self.height() as usize, self.width() as usize];
        Value::Tensor(match P::CHANNELS {
            None => Tensor::new(P::DTYPE, &["y", "x"], size.to_vec(), bytes),
            Some(channels) => Tensor::new(P::DTYPE, &["y", "x", "channel"], vec![size[0], size[1], channels], bytes),
        })
    }

    fn form() -> Form {
        Form::Image { dtype: P::DTYPE, channels: P::CHANNELS }
    }

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.plane()
    }
}

impl Product for BitPlane {
    fn encode(&self) -> Value {
        let mut bytes = Vec::with_capacity(size_of_val(self.data()));
        u64::write_all(self.data(), &mut bytes);
        let shape = vec![self.height() as usize, self.width() as usize, self.words()];
        Value::Tensor(Tensor::new(DType::U64, &["y", "x", "word"], shape, bytes))
    }

    fn form() -> Form {
        Form::Tensor(DType::U64)
    }
}

impl<T: Clone + Into<Value> + Send + Sync + 'static> Product for PerInstance<T> {
    fn encode(&self) -> Value {
        Value::PerInstance(self.0.iter().map(|(&id, value)| (id, value.clone().into())).collect())
    }

    fn form() -> Form {
        Form::PerInstance(Box::new(form_of::<T>()))
    }

    fn is_decoded() -> bool {
        is_of_instances::<T>()
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.per_instance()
    }
}

/// The form of the value into which a standard type is converted.
fn form_of<T: 'static>() -> Form {
    let is = |id: TypeId| TypeId::of::<T>() == id;
    macro_rules! any_of {
        ($($t:ty),*) => { $(is(TypeId::of::<$t>()))||* };
    }
    if any_of!(Mask) {
        Form::Mask
    } else if any_of!(f64) {
        Form::Float
    } else if any_of!(u32, u64, i64) {
        Form::Int
    } else if any_of!(bool) {
        Form::Bool
    } else if any_of!(String, &'static str) {
        Form::Text
    } else if any_of!(BBox) {
        Form::Ints(4)
    } else {
        Form::Any
    }
}

impl<P: Pixel> From<Plane<P>> for Value {
    fn from(plane: Plane<P>) -> Self {
        plane.encode()
    }
}

impl Product for Mask {
    fn encode(&self) -> Value {
        Value::Mask(self.clone())
    }

    fn form() -> Form {
        Form::Mask
    }

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.mask()
    }
}

impl Product for Value {
    fn encode(&self) -> Value {
        self.clone()
    }

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        Some(stored.value.clone())
    }
}

/// A matrix `[M, M]` of booleans, axes `occluder` and `occludee`, instances in id order.
impl Product for OcclusionOrder {
    fn encode(&self) -> Value {
        let n = self.ids().len();
        let bytes = self.matrix().iter().map(|&bit| bit.into()).collect();
        Value::Tensor(Tensor::new(DType::Bool, &["occluder", "occludee"], vec![n, n], bytes))
    }

    fn form() -> Form {
        Form::Tensor(DType::Bool)
    }

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.order()
    }
}

impl Product for ObjectDepths {
    fn encode(&self) -> Value {
        let list = |dtype, axis, bytes: Vec<u8>| {
            let count = bytes.len() / DType::size(dtype);
            Value::Tensor(Tensor::new(dtype, &[axis], vec![count], bytes))
        };
        let starts = self.starts.iter().flat_map(|start| start.to_le_bytes()).collect();
        let ids = self.objects.iter().flat_map(|(id, _)| id.0.to_le_bytes()).collect();
        let depths = self.objects.iter().flat_map(|(_, depth)| depth.to_le_bytes()).collect();
        Value::record([
            ("starts", list(DType::U32, "pixel", starts)),
            ("ids", list(DType::U16, "hit", ids)),
            ("depths", list(DType::F32, "hit", depths)),
        ])
    }

    fn form() -> Form {
        Form::Record
    }
}

impl<P: Pixel> Product for ObjectImages<P> {
    fn encode(&self) -> Value {
        Value::PerInstance(self.iter().map(|(id, image)| (id, self.filled(image).encode())).collect())
    }

    fn form() -> Form {
        Form::PerInstance(Box::new(Plane::<P>::form()))
    }

    fn is_decoded() -> bool {
        true
    }

    fn decode(stored: Stored<'_>) -> Option<Self> {
        stored.object_images()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::InstanceId;
    use half::f16;

    #[test]
    fn numbers_keep_their_sign_and_size() {
        let element = |dtype, bytes: &[u8]| Tensor::new(dtype, &["i"], vec![1], bytes.to_vec()).element(0);
        assert_eq!(element(DType::U64, &[0xff; 8]), Value::Uint(u64::MAX));
        assert_eq!(element(DType::I8, &[0xff]), Value::Int(-1));
        assert_eq!(element(DType::I16, &[0, 0x80]), Value::Int(-32_768));
        // IEEE 754 binary16: 0x3555 is the nearest to one third.
        assert_eq!(element(DType::F16, &[0x55, 0x35]), Value::Float(0.333_251_953_125));
        let mut words = BitPlane::new(1, 1, 64);
        words.insert(0, 0, InstanceId(64));
        assert_eq!(serde_json::to_string(&words.encode()).expect("serializes"), "[[[9223372036854775808]]]");
    }

    #[test]
    fn forms_match_the_encodings() {
        assert_eq!(Plane::<[f16; 2]>::form(), Form::Image { dtype: DType::F16, channels: Some(2) });
        assert_eq!(PerInstance::<Mask>::form(), Form::PerInstance(Box::new(Form::Mask)));
        assert_eq!(PerInstance::<BBox>::form().to_string(), "list of 4 integers per instance");
        assert_eq!(Value::form(), Form::Any);
    }

    #[test]
    fn values_serialize_as_json() {
        let value = Value::record([
            ("plane", Plane::from_fn(2, 1, |x, _| [x as u8, 7]).encode()),
            ("mask", Mask::from_fn(2, 1, |x, _| x == 1).into()),
            ("box", BBox::from([1, 2, 3, 4]).into()),
            ("inf", f64::INFINITY.into()),
            ("each", PerInstance::from_iter([(InstanceId(3), 0.5)]).encode()),
        ]);
        assert_eq!(
            serde_json::to_string(&value).expect("serializes"),
            r#"{"plane":[[[0,7],[1,7]]],"mask":{"size":[1,2],"counts":"11"},"box":[1,2,3,4],"inf":null,"each":{"3":0.5}}"#
        );
    }
}
