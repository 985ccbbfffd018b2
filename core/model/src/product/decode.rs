//! Products from their generic encoding, as files store it.
//!
//! Files keep less of a value than [`Value`] does. JSON has masks as run lengths, instances as decimal keys, and null
//! for numbers that are not finite. Arrays may have integers of another width.

use super::{
    BBox, DType, Form, Mask, ObjectImage, ObjectImages, OcclusionOrder, PerInstance, Pixel, Plane, Tensor, Value,
};
use crate::scene::InstanceId;
use std::any::{Any, TypeId};
use std::borrow::Cow;
use std::collections::BTreeMap;

/// The value of a product in a file, with the facts that the file lacks.
#[derive(Debug, Clone, Copy)]
pub struct Stored<'a> {
    /// The value.
    pub value: &'a Value,
    /// The annotated instances, in the order of the rows of matrices.
    pub ids: &'a [InstanceId],
    /// The number that null means.
    pub missing: f64,
}

impl<'a> Stored<'a> {
    fn with(self, value: &'a Value) -> Self {
        Self { value, ..self }
    }

    /// The value in a form: nested lists become an array if the product is an array, and arrays become numbers or lists
    /// if it is one of these. None for a value of another form, where the form tells.
    pub(super) fn of_form(self, form: &Form) -> Option<Cow<'a, Value>> {
        match (form, self.value) {
            (Form::Tensor(dtype), Value::List(_)) => {
                let (mut shape, mut bytes) = (Vec::new(), Vec::new());
                self.flatten(self.value, 0, *dtype, &mut shape, &mut bytes)?;
                let axes = vec![Cow::Borrowed("axis"); shape.len()];
                Some(Cow::Owned(Value::Tensor(Tensor { dtype: *dtype, axes, shape, bytes })))
            }
            (Form::List, Value::Tensor(tensor)) => Some(Cow::Owned(tensor.lists())),
            (Form::PerInstance(one), Value::PerInstance(each)) if **one == Form::List => {
                let list = |value: &Value| match value {
                    Value::Tensor(tensor) => tensor.lists(),
                    value => value.clone(),
                };
                Some(Cow::Owned(Value::PerInstance(each.iter().map(|(id, value)| (*id, list(value))).collect())))
            }
            (Form::Bool | Form::Int | Form::Float, Value::Tensor(tensor)) => {
                let value = tensor.shape.is_empty().then(|| tensor.element(0))?;
                Stored { value: &value, ..self }.number_of_form(form).map(Cow::Owned)
            }
            (Form::Bool | Form::Int | Form::Float, _) => self.number_of_form(form).map(Cow::Owned),
            (Form::Text, value) if !matches!(value, Value::Text(_)) => None,
            (_, value) => Some(Cow::Borrowed(value)),
        }
    }

    /// A number or a truth value in its form.
    fn number_of_form(self, form: &Form) -> Option<Value> {
        match (form, self.value) {
            (Form::Bool, Value::Bool(_)) | (Form::Float, Value::Float(_)) => Some(self.value.clone()),
            (Form::Int, Value::Int(_) | Value::Uint(_)) => Some(self.value.clone()),
            (Form::Float, Value::Int(value)) => Some(Value::Float(*value as f64)),
            (Form::Float, Value::Uint(value)) => Some(Value::Float(*value as f64)),
            // JSON has no infinite numbers.
            (Form::Float, Value::Null) => Some(Value::Float(self.missing)),
            _ => None,
        }
    }

    /// A plane of pixels.
    pub(super) fn plane<P: Pixel>(self) -> Option<Plane<P>> {
        let channels = P::CHANNELS.unwrap_or(1);
        let tensor = self.tensor(P::DTYPE, 2 + usize::from(P::CHANNELS.is_some()))?;
        let (&height, &width) = (tensor.shape.first()?, tensor.shape.get(1)?);
        if tensor.shape.get(2).is_some_and(|found| *found != channels) {
            return None;
        }
        let size = [width, height].map(|edge| u32::try_from(edge).ok());
        let pixels = tensor.bytes.chunks_exact(P::DTYPE.size() * channels).map(P::read);
        Some(Plane::from_vec(size[0]?, size[1]?, pixels.collect()))
    }

    /// A mask: run lengths, or an image that is nonzero inside the mask.
    pub(super) fn mask(self) -> Option<Mask> {
        match self.value {
            Value::Mask(mask) => Some(mask.clone()),
            Value::Record(_) => {
                let size: [u32; 2] = self.field("size")?.integers()?;
                // The number of pixels must fit in 32 bits.
                size[0].checked_mul(size[1])?;
                match self.field("counts")?.value {
                    Value::Text(counts) => Mask::from_coco(size[1], size[0], counts).ok(),
                    Value::List(counts) => {
                        let counts: Option<Vec<u32>> =
                            counts.iter().map(|it| u32::try_from(integer(it)?).ok()).collect();
                        Mask::from_counts(size[1], size[0], &counts?).ok()
                    }
                    _ => None,
                }
            }
            Value::Tensor(tensor) if tensor.shape.len() == 2 && tensor.dtype.size() == 1 => {
                let size = [tensor.shape[1], tensor.shape[0]].map(|edge| u32::try_from(edge).ok());
                let set = tensor.bytes.iter().map(|byte| *byte != 0).collect();
                Some(Mask::from_plane(&Plane::from_vec(size[0]?, size[1]?, set)))
            }
            _ => None,
        }
    }

    /// A value of each instance, for the types of [`PerInstance`] that can be decoded.
    pub(super) fn per_instance<T: 'static>(self) -> Option<PerInstance<T>> {
        let each = self.instances()?;
        each.into_iter().map(|(id, value)| Some((id, one(self.with(value))?))).collect()
    }

    /// An image of each instance.
    pub(super) fn object_images<P: Pixel>(self) -> Option<ObjectImages<P>> {
        let mut images: Option<ObjectImages<P>> = None;
        // Every image is whole, so the value around it does not matter.
        let around = P::read(&vec![0; P::DTYPE.size() * P::CHANNELS.unwrap_or(1)]);
        for (id, value) in self.instances()? {
            let pixels = self.with(value).plane::<P>()?;
            let size = [pixels.width(), pixels.height()];
            let images = images.get_or_insert_with(|| ObjectImages::within(around, size[0], size[1]));
            if images.size() != size {
                return None;
            }
            images.insert(id, ObjectImage { x: 0, y: 0, pixels });
        }
        // Without instances, the size of the images is unknown.
        Some(images.unwrap_or_else(|| ObjectImages::within(around, 0, 0)))
    }

    /// A matrix of the annotated instances.
    pub(super) fn order(self) -> Option<OcclusionOrder> {
        let tensor = self.tensor(DType::U8, 2).or_else(|| self.tensor(DType::Bool, 2))?;
        let n = self.ids.len();
        // Without instances, JSON has an empty list without a second axis.
        if tensor.shape != [n, n] && !(n == 0 && tensor.bytes.is_empty()) {
            return None;
        }
        let mut order = OcclusionOrder::new(self.ids.to_vec());
        let set = (0..n * n).filter(|&at| tensor.bytes[at] != 0);
        set.for_each(|at| order.set(at / n, at % n));
        Some(order)
    }

    fn instances(self) -> Option<BTreeMap<InstanceId, &'a Value>> {
        match self.value {
            Value::PerInstance(each) => Some(each.iter().map(|(id, value)| (*id, value)).collect()),
            Value::Record(fields) => {
                // 0 is not an instance.
                let id = |text: &str| text.parse().ok().filter(|id| *id > 0).map(InstanceId);
                fields.iter().map(|(text, value)| Some((id(text)?, value))).collect()
            }
            _ => None,
        }
    }

    fn number(self) -> Option<f64> {
        match self.value {
            Value::Float(value) => Some(*value),
            Value::Null => Some(self.missing),
            Value::Tensor(tensor) if tensor.shape.is_empty() => self.with(&tensor.element(0)).number(),
            value => integer(value).map(|value| value as f64),
        }
    }

    /// `N` integers.
    fn integers<T: TryFrom<i128>, const N: usize>(self) -> Option<[T; N]> {
        let numbers: Vec<T> = match self.value {
            Value::List(values) => values.iter().map(|it| T::try_from(integer(it)?).ok()).collect::<Option<_>>()?,
            Value::Tensor(tensor) if tensor.shape.len() == 1 => {
                let elements = (0..tensor.shape[0]).map(|at| tensor.element(at));
                elements.map(|it| T::try_from(integer(&it)?).ok()).collect::<Option<_>>()?
            }
            _ => return None,
        };
        numbers.try_into().ok()
    }

    fn field(self, name: &str) -> Option<Self> {
        let Value::Record(fields) = self.value else { return None };
        fields.iter().find(|(field, _)| field == name).map(|(_, value)| self.with(value))
    }

    /// An array of elements of a type, of that many axes.
    fn tensor(self, dtype: DType, axes: usize) -> Option<Tensor> {
        let (mut shape, mut bytes) = (Vec::new(), Vec::new());
        match self.value {
            Value::Tensor(tensor) if tensor.dtype == dtype => {
                return (tensor.shape.len() == axes).then(|| tensor.clone());
            }
            Value::Tensor(tensor) => {
                shape.clone_from(&tensor.shape);
                let count = tensor.shape.iter().product::<usize>();
                (0..count).try_for_each(|at| self.element(&tensor.element(at), dtype, &mut bytes))?;
            }
            value => self.flatten(value, 0, dtype, &mut shape, &mut bytes)?,
        }
        // An empty list has no further axes.
        let is_whole = shape.len() == axes || (shape.len() < axes && shape.contains(&0));
        shape.resize(axes, 0);
        is_whole.then(|| Tensor { dtype, axes: vec![Cow::Borrowed("axis"); axes], shape, bytes })
    }

    /// Appends the elements of nested lists. All lists of one depth must be as long as the first one.
    fn flatten(
        self,
        value: &Value,
        depth: usize,
        dtype: DType,
        shape: &mut Vec<usize>,
        bytes: &mut Vec<u8>,
    ) -> Option<()> {
        let Value::List(values) = value else {
            return if depth == shape.len() { self.element(value, dtype, bytes) } else { None };
        };
        match shape.get(depth) {
            None if bytes.is_empty() => shape.push(values.len()),
            Some(length) if *length == values.len() => {}
            _ => return None,
        }
        values.iter().try_for_each(|value| self.flatten(value, depth + 1, dtype, shape, bytes))
    }

    /// Appends a number as an element of a type, if the type can hold it.
    fn element(self, value: &Value, dtype: DType, bytes: &mut Vec<u8>) -> Option<()> {
        macro_rules! push {
            ($t:ty) => {
                bytes.extend(<$t>::try_from(integer(value)?).ok()?.to_le_bytes())
            };
        }
        match dtype {
            DType::Bool => bytes.push(u8::from(match value {
                Value::Bool(value) => *value,
                value => integer(value)? != 0,
            })),
            DType::U8 => push!(u8),
            DType::U16 => push!(u16),
            DType::U32 => push!(u32),
            DType::U64 => push!(u64),
            DType::I8 => push!(i8),
            DType::I16 => push!(i16),
            DType::I32 => push!(i32),
            DType::I64 => push!(i64),
            DType::F16 => bytes.extend(half::f16::from_f64(self.with(value).number()?).to_le_bytes()),
            DType::F32 => bytes.extend((self.with(value).number()? as f32).to_le_bytes()),
            DType::F64 => bytes.extend(self.with(value).number()?.to_le_bytes()),
        }
        Some(())
    }
}

/// Decoders of the values of instances, by type.
macro_rules! of_types {
    ($($type:ty => $decode:expr,)+) => {
        /// Whether values of instances of this type can be decoded from files.
        pub(super) fn is_of_instances<T: 'static>() -> bool {
            $(TypeId::of::<T>() == TypeId::of::<$type>())||+
        }

        fn one<T: 'static>(stored: Stored<'_>) -> Option<T> {
            $(if TypeId::of::<T>() == TypeId::of::<$type>() {
                let decode: fn(Stored<'_>) -> Option<$type> = $decode;
                let found: Box<dyn Any> = Box::new(decode(stored)?);
                return found.downcast().ok().map(|found| *found);
            })+
            None
        }
    };
}

of_types! {
    Mask => |it| it.mask(),
    f64 => |it| it.number(),
    u32 => |it| u32::try_from(integer(it.value)?).ok(),
    u64 => |it| u64::try_from(integer(it.value)?).ok(),
    i64 => |it| i64::try_from(integer(it.value)?).ok(),
    bool => |it| if let Value::Bool(value) = it.value { Some(*value) } else { None },
    String => |it| if let Value::Text(value) = it.value { Some(value.clone()) } else { None },
    BBox => |it| it.integers::<i32, 4>().map(BBox::from),
    Value => |it| Some(it.value.clone()),
}

/// A value that is a whole number.
fn integer(value: &Value) -> Option<i128> {
    match value {
        Value::Int(value) => Some((*value).into()),
        Value::Uint(value) => Some((*value).into()),
        // Floats beyond 2⁵³ skip integers.
        Value::Float(value) if value.fract() == 0.0 && value.abs() <= 9_007_199_254_740_992.0 => Some(*value as i128),
        Value::Tensor(tensor) if tensor.shape.is_empty() => integer(&tensor.element(0)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::product::Product;

    const IDS: [InstanceId; 2] = [InstanceId(2), InstanceId(7)];

    /// The value after a round trip through JSON.
    fn through_json(value: &Value) -> Value {
        fn of(json: serde_json::Value) -> Value {
            use serde_json::Value as Json;
            match json {
                Json::Null => Value::Null,
                Json::Bool(value) => value.into(),
                Json::Number(number) => number.as_i64().map_or_else(
                    || number.as_u64().map_or_else(|| number.as_f64().expect("a number").into(), Value::from),
                    Value::from,
                ),
                Json::String(text) => text.into(),
                Json::Array(values) => Value::List(values.into_iter().map(of).collect()),
                Json::Object(fields) => Value::Record(fields.into_iter().map(|(name, it)| (name, of(it))).collect()),
            }
        }
        of(serde_json::to_value(value).expect("serializes"))
    }

    fn back<T: Product>(value: &Value) -> Option<T> {
        T::decode(Stored { value, ids: &IDS, missing: f64::INFINITY })
    }

    /// Asserts that a product comes back from its encoding, and from the encoding after a round trip through JSON.
    #[track_caller]
    fn comes_back<T: Product + PartialEq + std::fmt::Debug>(product: &T) {
        assert!(T::is_decoded());
        let value = product.encode();
        assert_eq!(back::<T>(&value).as_ref(), Some(product));
        assert_eq!(back::<T>(&through_json(&value)).as_ref(), Some(product));
    }

    #[test]
    fn products_come_back() {
        let mask = |k: u32| Mask::from_fn(5, 3, |x, y| (x + y) % k == 0);
        comes_back(&mask(2));
        comes_back(&PerInstance::from_iter(IDS.map(|id| (id, mask(id.0.into())))));
        comes_back(&PerInstance::from_iter([(IDS[0], 0.25), (IDS[1], 1.0)]));
        comes_back(&PerInstance::from_iter([(IDS[0], 3_u32)]));
        comes_back(&PerInstance::from_iter([(IDS[1], BBox::from([-1, 2, 3, 4]))]));
        comes_back(&PerInstance::from_iter([(IDS[1], "a mug".to_owned())]));
        comes_back(&PerInstance::<f64>::default());
        comes_back(&Plane::from_fn(3, 2, |x, y| [x as u8, y as u8, 7]));
        comes_back(&Plane::from_fn(3, 2, |x, y| if x == y { f32::INFINITY } else { 0.1 * x as f32 }));
        comes_back(&Plane::from_fn(4, 2, |x, _| InstanceId(x as u16 * 300)));
        let image = |id: InstanceId| ObjectImage {
            x: 0,
            y: 0,
            pixels: Plane::from_fn(3, 2, |x, y| x as f32 + y as f32 / f32::from(id.0)),
        };
        let mut images = ObjectImages::new(3, 2);
        IDS.into_iter().for_each(|id| images.insert(id, image(id)));
        comes_back(&images);
        let mut order = OcclusionOrder::new(IDS.to_vec());
        order.set(1, 0);
        comes_back(&order);
    }

    #[test]
    fn arrays_may_have_wider_or_narrower_numbers() {
        let ids = Plane::from_fn(3, 2, |x, y| InstanceId((x + y) as u16));
        let narrow = ids.map(|id| id.0 as u8).encode();
        assert_eq!(back::<Plane<InstanceId>>(&narrow), Some(ids));
        let large = Plane::from_fn(3, 2, |_, _| 300_u16).encode();
        assert_eq!(back::<Plane<u8>>(&large), None);
        assert_eq!(back::<Mask>(&Plane::from_fn(2, 1, |x, _| 255 * x as u8).encode()).map(|it| it.area()), Some(1));
    }

    #[test]
    fn what_is_of_another_type_does_not() {
        assert_eq!(back::<Mask>(&Value::from(3_i64)), None);
        assert_eq!(back::<OcclusionOrder>(&Value::from([[true]])), None, "of one instance");
        assert_eq!(back::<PerInstance<BBox>>(&Value::record([("2", Value::from([1_i64, 2, 3]))])), None);
        assert_eq!(back::<PerInstance<u32>>(&Value::record([("2", Value::from(-1_i64))])), None);
        assert_eq!(back::<PerInstance<f64>>(&Value::record([("mug", Value::from(1.0))])), None);
        assert_eq!(back::<Plane<u8>>(&Value::from(vec![vec![1_i64, 2], vec![3]])), None, "rows of different lengths");
        assert_eq!(
            back::<Plane<u8>>(&Value::List(vec![Value::List(vec![Value::List(Vec::new())])])),
            None,
            "an axis too many"
        );
        assert_eq!(back::<Plane<u8>>(&Value::List(Vec::new())).map(|it| it.width()), Some(0));
        let sizes = [("1", Value::List(Vec::new())), ("2", Value::List(vec![Value::from([1.0])]))];
        assert!(back::<ObjectImages<f32>>(&Value::record(sizes)).is_none(), "images of two sizes");
        assert_eq!(back::<PerInstance<f64>>(&Value::record([("0", 1.0.into())])), None, "0 is no instance");
        let none = back::<ObjectImages<f32>>(&Value::record([]));
        assert_eq!(none.map(|images| images.iter().count()), Some(0));
        let damaged = Value::record([("size", [2_i64, 2].into()), ("counts", "zz".into())]);
        assert_eq!(back::<Mask>(&damaged), None);
    }
}
