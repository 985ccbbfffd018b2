//! Accessors: typed numbers in buffers, with every bound checked before anything is allocated.

use super::buffers::{Elements, GltfBuffers};
use super::items::get;
use crate::formats::within;
use gltf::json::accessor::{Accessor, ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root};
use syntable_model::error::{Error, Result};

/// Maximum number of elements of an accessor with sparse data only.
const MAX_ZEROS: u64 = 1 << 20;

/// Layout of elements in a view.
struct ElementLayout {
    component: ComponentType,
    normalized: bool,
    offset: usize,
    stride: usize,
    count: usize,
}

/// Reads vectors of `N` numbers: all elements, or the existing elements in `select`. Integers of a normalized accessor
/// become fractions.
pub fn vectors<const N: usize>(
    document: &Root,
    buffers: &mut GltfBuffers<'_>,
    index: Index<Accessor>,
    select: Option<&[u32]>,
    what: &str,
) -> Result<Vec<[f32; N]>> {
    let name = || format!("accessor {} ({what})", index.value());
    read(document, buffers, index, N, select, |layout, bytes, at| {
        std::array::from_fn(|i| number(layout, bytes, at + i * layout.component.size()) as f32)
    })
    .map_err(|error| within(error, name()))
}

/// Reads indices: unsigned integers.
pub fn indices(document: &Root, buffers: &mut GltfBuffers<'_>, index: Index<Accessor>) -> Result<Vec<u32>> {
    let name = || format!("accessor {} (indices)", index.value());
    let accessor = get(&document.accessors, index, "accessor")?;
    if !matches!(component(accessor)?, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
        return Err(within(Error::new("not unsigned integers"), name()));
    }
    read(document, buffers, index, 1, None, |layout, bytes, at| number(layout, bytes, at) as u32)
        .map_err(|error| within(error, name()))
}

/// Number of elements of an accessor. Checks that the buffer view holds them if each has the given number of
/// components.
pub fn count(document: &Root, buffers: &mut GltfBuffers<'_>, index: Index<Accessor>, components: usize) -> Result<u64> {
    let accessor = get(&document.accessors, index, "accessor")?;
    let count = buffers.count(index)?;
    let size = component(accessor)?.size() * components;
    if width(document, index)? != components {
        return Ok(count);
    }
    if let Some(Elements { bytes, offset, stride }) = buffers.elements(index)? {
        check_bounds(stride.unwrap_or(size).max(size), offset, count, size, bytes.len())
            .map_err(|error| within(error, format!("accessor {}", index.value())))?;
    } else if accessor.sparse.is_none() || count > MAX_ZEROS {
        return Err(within(without_data(count), format!("accessor {}", index.value())));
    }
    Ok(count)
}

fn without_data(count: u64) -> Error {
    Error::new(format!("{count} elements without data"))
}

/// Refuses elements that reach beyond the bytes of their view.
fn check_bounds(stride: usize, offset: u64, count: u64, size: usize, bytes: usize) -> Result<()> {
    let need = match count {
        0 => u128::from(offset),
        _ => u128::from(offset) + u128::from(count - 1) * stride as u128 + size as u128,
    };
    match need > bytes as u128 {
        true => Err(Error::new(format!("{count} elements need {need} bytes, but the buffer view has {bytes}"))),
        false => Ok(()),
    }
}

/// Number of components of an accessor: 4 for colors with alpha.
pub fn width(document: &Root, index: Index<Accessor>) -> Result<usize> {
    match get(&document.accessors, index, "accessor")?.type_ {
        Checked::Valid(Type::Scalar) => Ok(1),
        Checked::Valid(Type::Vec2) => Ok(2),
        Checked::Valid(Type::Vec3) => Ok(3),
        Checked::Valid(Type::Vec4) => Ok(4),
        Checked::Valid(Type::Mat4) => Ok(16),
        Checked::Valid(_) => Err(Error::new(format!("accessor {} has matrices, not vectors", index.value()))),
        Checked::Invalid => Err(Error::new(format!("accessor {} has an unknown type", index.value()))),
    }
}

/// Whether an accessor holds floats.
pub fn is_float(document: &Root, index: Index<Accessor>) -> Result<bool> {
    Ok(component(get(&document.accessors, index, "accessor")?)? == ComponentType::F32)
}

/// Whether integers of an accessor represent fractions.
pub fn is_normalized(document: &Root, index: Index<Accessor>) -> Result<bool> {
    Ok(get(&document.accessors, index, "accessor")?.normalized)
}

/// Size of one number of an accessor, bytes.
pub fn component_size(accessor: &Accessor) -> Result<usize> {
    component(accessor).map(|component| component.size())
}

/// Numbers in the type of an accessor.
pub fn bytes_of(accessor: &Accessor, numbers: &[f32]) -> Result<Vec<u8>> {
    fn all<const N: usize>(numbers: &[f32], bytes: impl Fn(f32) -> [u8; N]) -> Vec<u8> {
        numbers.iter().flat_map(|&x| bytes(x)).collect()
    }
    Ok(match component(accessor)? {
        ComponentType::I8 => all(numbers, |x| (x as i8).to_le_bytes()),
        ComponentType::U8 => all(numbers, |x| (x as u8).to_le_bytes()),
        ComponentType::I16 => all(numbers, |x| (x as i16).to_le_bytes()),
        ComponentType::U16 => all(numbers, |x| (x as u16).to_le_bytes()),
        ComponentType::U32 => all(numbers, |x| (x as u32).to_le_bytes()),
        ComponentType::F32 => all(numbers, f32::to_le_bytes),
    })
}

fn component(accessor: &Accessor) -> Result<ComponentType> {
    match accessor.component_type {
        Checked::Valid(component) => Ok(component.0),
        Checked::Invalid => Err(Error::new("an unknown type of number")),
    }
}

fn read<T: Clone + Zero>(
    document: &Root,
    buffers: &mut GltfBuffers<'_>,
    index: Index<Accessor>,
    components: usize,
    select: Option<&[u32]>,
    element: impl Fn(&ElementLayout, &[u8], usize) -> T,
) -> Result<Vec<T>> {
    let accessor = get(&document.accessors, index, "accessor")?;
    if width(document, index)? != components {
        return Err(Error::new(format!("{} numbers per element instead of {components}", width(document, index)?)));
    }
    let component = component(accessor)?;
    let size = component.size() * components;
    let layout = |stride: Option<usize>, offset: u64, count: u64, bytes: usize| -> Result<ElementLayout> {
        let stride = stride.unwrap_or(size).max(size);
        check_bounds(stride, offset, count, size, bytes)?;
        let (offset, count) = (offset as usize, count as usize);
        Ok(ElementLayout { component, normalized: accessor.normalized, offset, stride, count })
    };
    let count = buffers.count(index)?;
    // A sparse accessor is read as a whole before elements are selected.
    let part = select.filter(|_| accessor.sparse.is_none());
    let wanted = part.map_or(count, |part| part.len() as u64).saturating_mul(size_of::<T>() as u64);
    let budget = buffers.budget();
    let mut values: Vec<T> = match buffers.elements(index)? {
        Some(Elements { bytes, offset, stride }) => {
            let layout = layout(stride, offset, count, bytes.len())?;
            budget.bytes(wanted)?;
            let at = |i: usize| element(&layout, bytes, layout.offset + i * layout.stride);
            match part {
                Some(part) => part.iter().filter(|&&i| (i as usize) < layout.count).map(|&i| at(i as usize)).collect(),
                None => (0..layout.count).map(at).collect(),
            }
        }
        None if accessor.sparse.is_some() && count <= MAX_ZEROS => {
            budget.bytes(wanted)?;
            vec![T::zero(); count as usize]
        }
        None => return Err(without_data(count)),
    };
    if let Some(sparse) = &accessor.sparse {
        let (bytes, _) = buffers.view(sparse.values.buffer_view)?;
        let part = layout(None, sparse.values.byte_offset.0, sparse.count.0, bytes.len())?;
        let new: Vec<T> = (0..part.count).map(|i| element(&part, bytes, part.offset + i * part.stride)).collect();
        let Checked::Valid(kind) = sparse.indices.component_type else {
            return Err(Error::new("sparse indices of an unknown type"));
        };
        let (bytes, _) = buffers.view(sparse.indices.buffer_view)?;
        let size = kind.0.size();
        let offset = sparse.indices.byte_offset.0;
        if u128::from(offset) + new.len() as u128 * size as u128 > bytes.len() as u128 {
            return Err(Error::new(format!("{} sparse indices need more than {} bytes", new.len(), bytes.len())));
        }
        let at = ElementLayout {
            component: kind.0,
            normalized: false,
            offset: offset as usize,
            stride: size,
            count: new.len(),
        };
        for (i, value) in new.into_iter().enumerate() {
            let target = number(&at, bytes, at.offset + i * at.stride) as usize;
            let count = values.len();
            *values
                .get_mut(target)
                .ok_or_else(|| Error::new(format!("sparse index {target} of {count} elements")))? = value;
        }
        if let Some(select) = select {
            return Ok(select.iter().filter_map(|&i| values.get(i as usize).cloned()).collect());
        }
    }
    Ok(values)
}

/// Zeros to start a sparse accessor from.
trait Zero {
    fn zero() -> Self;
}
impl<const N: usize> Zero for [f32; N] {
    fn zero() -> Self {
        [0.0; N]
    }
}
impl Zero for u32 {
    fn zero() -> Self {
        0
    }
}

/// Reads one number; the caller has checked the bounds.
fn number(layout: &ElementLayout, bytes: &[u8], at: usize) -> f64 {
    macro_rules! number {
        ($type:ty, $size:literal) => {
            f64::from(<$type>::from_le_bytes(std::array::from_fn::<u8, $size, _>(|i| bytes[at + i])))
        };
    }
    let (value, one) = match layout.component {
        ComponentType::I8 => (number!(i8, 1), 127.0),
        ComponentType::U8 => (number!(u8, 1), 255.0),
        ComponentType::I16 => (number!(i16, 2), 32_767.0),
        ComponentType::U16 => (number!(u16, 2), 65_535.0),
        ComponentType::U32 => (number!(u32, 4), 4_294_967_295.0),
        ComponentType::F32 => (number!(f32, 4), 1.0),
    };
    if layout.normalized && layout.component != ComponentType::F32 { (value / one).max(-1.0) } else { value }
}
