//! Values of products as Python objects, and back.
//!
//! | value | Python |
//! | --- | --- |
//! | null, truth value, integer, number, text, bytes | `None`, `bool`, `int`, `float`, `str`, `bytes` |
//! | tensor | `numpy.ndarray`, which owns the bytes: they are moved, not copied |
//! | mask | [`Mask`] |
//! | list, record | `list`, `dict` |
//! | value per instance | `dict` from the instance's id to its value |

use crate::errors::exception;
use crate::masks::Mask;
use numpy::PyArray1;
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyDict, PyFloat, PyInt, PyList, PyString, PyTuple};
use std::collections::BTreeMap;
use syntable_model::product::{DType, Tensor, Value};
use syntable_model::scene::InstanceId;

/// A value as a Python object.
pub fn to_python<'py>(py: Python<'py>, value: Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Null => py.None().into_bound(py),
        Value::Bool(value) => PyBool::new(py, value).to_owned().into_any(),
        Value::Int(value) => value.into_pyobject(py)?.into_any(),
        Value::Uint(value) => value.into_pyobject(py)?.into_any(),
        Value::Float(value) => PyFloat::new(py, value).into_any(),
        Value::Text(value) => PyString::new(py, &value).into_any(),
        Value::Bytes(value) => PyBytes::new(py, &value).into_any(),
        Value::Tensor(tensor) => array(py, tensor)?,
        Value::Mask(mask) => Mask(mask).into_pyobject(py)?.into_any(),
        Value::List(values) => {
            let list = PyList::empty(py);
            values.into_iter().try_for_each(|value| list.append(to_python(py, value)?))?;
            list.into_any()
        }
        Value::Record(fields) => {
            let dict = PyDict::new(py);
            fields.into_iter().try_for_each(|(name, value)| dict.set_item(name, to_python(py, value)?))?;
            dict.into_any()
        }
        Value::PerInstance(each) => {
            let dict = PyDict::new(py);
            each.into_iter().try_for_each(|(id, value)| dict.set_item(id.0, to_python(py, value)?))?;
            dict.into_any()
        }
    })
}

/// A tensor as an array that owns its bytes.
pub fn array<'py>(py: Python<'py>, tensor: Tensor) -> PyResult<Bound<'py, PyAny>> {
    let Tensor { dtype, shape, bytes, .. } = tensor;
    if bytes.is_empty() {
        let numpy = py.import("numpy")?;
        return numpy.call_method1("empty", (PyTuple::new(py, shape)?, dtype.numpy()));
    }
    let bytes = PyArray1::from_vec(py, bytes);
    let typed = if dtype == DType::U8 { bytes.into_any() } else { bytes.call_method1("view", (dtype.numpy(),))? };
    typed.call_method1("reshape", (PyTuple::new(py, shape)?,))
}

/// A Python object as a value.
///
/// # Errors
/// If an object has no such value. The message names its place.
pub fn of_python(object: &Bound<'_, PyAny>) -> PyResult<Value> {
    of_part(object, 0)
}

/// How deep the parts of a value may be nested. Deeper values, and values that contain themselves, would exhaust the stack.
const DEPTH: usize = 100;

/// A part of a value, in as many others as `depth`.
fn of_part(object: &Bound<'_, PyAny>, depth: usize) -> PyResult<Value> {
    let py = object.py();
    if depth > DEPTH {
        Err(PyTypeError::new_err(format!("it is nested more than {DEPTH} deep; does it contain itself?")))
    } else if object.is_none() {
        Ok(Value::Null)
    } else if let Ok(value) = object.cast::<PyBool>() {
        Ok(Value::Bool(value.is_true()))
    } else if object.is_instance_of::<PyInt>() {
        integer(object)
    } else if let Ok(value) = object.cast::<PyFloat>() {
        Ok(Value::Float(value.value()))
    } else if let Ok(value) = object.cast::<PyString>() {
        Ok(Value::Text(value.to_str()?.to_owned()))
    } else if let Ok(value) = object.cast::<PyBytes>() {
        Ok(Value::Bytes(value.as_bytes().to_vec()))
    } else if let Ok(mask) = object.cast::<Mask>() {
        Ok(Value::Mask(mask.get().0.clone()))
    } else if let Ok(dict) = object.cast::<PyDict>() {
        of_dict(dict, depth + 1)
    } else if object.is_instance_of::<PyList>() || object.is_instance_of::<PyTuple>() {
        let mut values = Vec::new();
        for (index, value) in object.try_iter()?.enumerate() {
            values.push(of_part(&value?, depth + 1).map_err(|error| inside(py, &error, &format!("element {index}")))?);
        }
        Ok(Value::List(values))
    } else if object.hasattr("__array__")? {
        of_array(object)
    } else if object.hasattr("detach")? {
        // A tensor of PyTorch on a device, or with a gradient.
        of_array(&object.call_method0("detach")?.call_method0("cpu")?)
    } else {
        let kind = object.get_type().name()?;
        Err(PyTypeError::new_err(format!(
            "a {kind} is not a value of a product: return numbers, text, NumPy arrays, masks, lists or dicts"
        )))
    }
}

/// Adds the place of a value to its error.
fn inside(py: Python<'_>, error: &PyErr, place: &str) -> PyErr {
    if error.is_instance_of::<PyTypeError>(py) || error.is_instance_of::<PyOverflowError>(py) {
        return PyTypeError::new_err(format!("{place}: {}", error.value(py)));
    }
    error.clone_ref(py)
}

fn integer(object: &Bound<'_, PyAny>) -> PyResult<Value> {
    if let Ok(value) = object.extract::<i64>() {
        return Ok(Value::Int(value));
    }
    let value = object.extract::<u64>();
    value.map(Value::Uint).map_err(|_| PyOverflowError::new_err("the integer does not fit into 64 bits"))
}

/// A dict whose keys are ids of instances, or else names of fields.
fn of_dict(dict: &Bound<'_, PyDict>, depth: usize) -> PyResult<Value> {
    let py = dict.py();
    let is_number = |key: &Bound<'_, PyAny>| key.is_instance_of::<PyInt>() || key.hasattr("__index__").unwrap_or(false);
    let is_per_instance = !dict.is_empty() && dict.keys().iter().all(|key| is_number(&key));
    let (mut each, mut fields) = (BTreeMap::new(), Vec::new());
    for (key, value) in dict {
        let value = of_part(&value, depth).map_err(|error| inside(py, &error, &format!("key {key}")))?;
        if is_per_instance {
            let id = key.extract::<u16>().ok().filter(|id| *id > 0);
            let id =
                id.ok_or_else(|| PyTypeError::new_err(format!("{key} is not the id of an object: ids begin at 1")))?;
            each.insert(InstanceId(id), value);
        } else if let Ok(name) = key.cast::<PyString>() {
            fields.push((name.to_str()?.to_owned(), value));
        } else {
            return Err(PyTypeError::new_err(format!(
                "{key} is neither the name of a field nor the id of an object, as the other keys are"
            )));
        }
    }
    Ok(if is_per_instance { Value::PerInstance(each) } else { Value::Record(fields) })
}

/// An array as a tensor; an array without axes as its number.
fn of_array(object: &Bound<'_, PyAny>) -> PyResult<Value> {
    let py = object.py();
    let array = py.import("numpy")?.call_method1("ascontiguousarray", (object,))?;
    // `ascontiguousarray` gives at least one axis.
    if object.getattr("ndim").and_then(|ndim| ndim.extract::<usize>()).is_ok_and(|ndim| ndim == 0) {
        return of_python(&array.call_method0("item")?);
    }
    let tensor = tensor(&array)?;
    Ok(Value::Tensor(tensor))
}

/// A contiguous array as a tensor.
pub fn tensor(array: &Bound<'_, PyAny>) -> PyResult<Tensor> {
    let name: String = array.getattr("dtype")?.getattr("name")?.extract()?;
    let Some(dtype) = DType::ALL.into_iter().find(|dtype| dtype.numpy() == name) else {
        let known = DType::ALL.map(DType::numpy);
        return Err(PyTypeError::new_err(format!(
            "an array of {name} is not a value of a product: use {}",
            known.join(", ")
        )));
    };
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    let bytes = array.call_method0("tobytes")?.cast_into::<PyBytes>()?;
    let axes = shape.iter().map(|_| "axis".into()).collect();
    Ok(Tensor { dtype, axes, shape, bytes: bytes.as_bytes().to_vec() })
}

/// A JSON value as a Python object.
pub fn of_json<'py>(py: Python<'py>, value: &serde_json::Value) -> PyResult<Bound<'py, PyAny>> {
    let value = Value::of(value).map_err(|error| exception(py, &error))?;
    to_python(py, value)
}
