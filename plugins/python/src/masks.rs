//! Binary masks, unpacked on request.

use crate::errors::exception;
use numpy::ndarray::{Array2, Array3, ArrayView2};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use syntable_model::error::Error;
use syntable_model::product::{self, Plane};

/// A binary mask of an image, run-length encoded.
#[pyclass(frozen, eq, module = "syntable", name = "Mask")]
#[derive(Clone, PartialEq, Eq)]
pub struct Mask(pub product::Mask);

/// Sets the pixels of a mask among the values of an image, row by row.
fn fill(mask: &product::Mask, image: &mut [bool]) {
    let width = mask.width() as usize;
    for (x, rows) in mask.segments() {
        for y in rows {
            image[y as usize * width + x as usize] = true;
        }
    }
}

/// Masks as an array of bool: masks × height × width. A missing mask has no pixel.
pub fn stack<'py>(
    py: Python<'py>,
    masks: &[Option<&product::Mask>],
    [width, height]: [u32; 2],
) -> PyResult<Bound<'py, PyArray3<bool>>> {
    let shape = (masks.len(), height as usize, width as usize);
    let mut pixels = Array3::from_elem(shape, false);
    py.detach(|| {
        for (mask, mut image) in masks.iter().zip(pixels.outer_iter_mut()) {
            if let (Some(mask), Some(image)) = (mask, image.as_slice_mut()) {
                fill(mask, image);
            }
        }
    });
    Ok(pixels.into_pyarray(py))
}

/// The masks of a boolean array of three axes: masks × height × width.
#[pyfunction]
pub fn masks_of(array: &Bound<'_, PyAny>) -> PyResult<Vec<Mask>> {
    let found: PyReadonlyArray3<'_, bool> =
        array.extract().map_err(|_| not_boolean(array, "masks × height × width"))?;
    found.as_array().outer_iter().map(|mask| of_array(array.py(), &mask)).collect()
}

fn not_boolean(array: &Bound<'_, PyAny>, axes: &str) -> PyErr {
    let text = |name: &str| array.getattr(name).and_then(|it| Ok(it.str()?.to_string()));
    let what = match (text("dtype"), text("shape")) {
        (Ok(dtype), Ok(shape)) => format!("an array of {dtype} with the shape {shape}"),
        _ => array.get_type().name().map_or_else(|_| "another object".to_owned(), |name| format!("a {name}")),
    };
    PyTypeError::new_err(format!("a mask is a boolean NumPy array of {axes}, such as `array > 0`, not {what}"))
}

fn of_array(py: Python<'_>, array: &ArrayView2<'_, bool>) -> PyResult<Mask> {
    let (height, width) = array.dim();
    let size = [width, height].map(u32::try_from);
    let ([Ok(columns), Ok(rows)], true) = (size, width.checked_mul(height).is_some_and(|n| n < 1 << 32)) else {
        return Err(exception(py, &Error::new("the array is too large for a mask")));
    };
    let pixels = Plane::from_vec(columns, rows, array.iter().copied().collect());
    Ok(Mask(product::Mask::from_plane(&pixels)))
}

#[pymethods]
impl Mask {
    /// The mask of a boolean array of two axes.
    #[new]
    fn new(array: &Bound<'_, PyAny>) -> PyResult<Self> {
        let found: PyReadonlyArray2<'_, bool> = array.extract().map_err(|_| not_boolean(array, "height × width"))?;
        of_array(array.py(), &found.as_array())
    }

    /// The mask of COCO's runs: a dict with `size` (height, width) and `counts`, compressed or not.
    #[staticmethod]
    fn from_rle(py: Python<'_>, rle: &Bound<'_, PyDict>) -> PyResult<Self> {
        let missing = |key: &str| PyValueError::new_err(format!("the runs of a mask have no `{key}`"));
        let size = rle.get_item("size")?.ok_or_else(|| missing("size"))?;
        let [height, width]: [u32; 2] = size.extract().map_err(|_| {
            PyValueError::new_err(format!("`size` of the runs of a mask is height and width, two integers, not {size}"))
        })?;
        let counts = rle.get_item("counts")?.ok_or_else(|| missing("counts"))?;
        let mask = if let Ok(text) = counts.extract::<String>() {
            product::Mask::from_coco(width, height, &text)
        } else if let Ok(bytes) = counts.extract::<Vec<u8>>()
            && counts.is_instance_of::<pyo3::types::PyBytes>()
        {
            product::Mask::from_coco(width, height, &String::from_utf8_lossy(&bytes))
        } else {
            let runs: Vec<u32> = counts.extract().map_err(|_| {
                PyTypeError::new_err("`counts` of the runs of a mask is text, bytes, or a list of integers from 0")
            })?;
            product::Mask::from_counts(width, height, &runs)
        };
        mask.map(Self).map_err(|error| exception(py, &Error::new(error.to_string())))
    }

    /// Height and width, px.
    #[getter]
    fn shape(&self) -> (u32, u32) {
        (self.0.height(), self.0.width())
    }

    /// Number of pixels.
    #[getter]
    fn area(&self) -> u32 {
        self.0.area()
    }

    /// Bounding box: x, y, width, height, px.
    #[getter]
    fn r#box(&self) -> (i32, i32, i32, i32) {
        let found = self.0.bbox();
        (found.x, found.y, found.width, found.height)
    }

    /// The mask as an array of bool: height × width.
    fn array<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<bool>>> {
        let shape = (self.0.height() as usize, self.0.width() as usize);
        let mut pixels = Array2::from_elem(shape, false);
        pixels.as_slice_mut().into_iter().for_each(|image| fill(&self.0, image));
        Ok(pixels.into_pyarray(py))
    }

    /// The same, for `numpy.asarray`.
    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        // Every call makes a new array.
        let _ = copy;
        let array = self.array(py)?.into_any();
        match dtype {
            Some(dtype) => array.call_method1("astype", (dtype,)),
            None => Ok(array),
        }
    }

    fn __repr__(&self) -> String {
        format!("Mask({} of {} × {} pixels)", self.0.area(), self.0.width(), self.0.height())
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyDict>,))> {
        let from_rle = py.get_type::<Self>().getattr("from_rle")?;
        Ok((from_rle, (self.rle(py)?,)))
    }

    /// The mask as runs of COCO: a dict with `size` (height, width) and compressed `counts`.
    fn rle<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("size", [self.0.height(), self.0.width()])?;
        dict.set_item("counts", self.0.to_coco())?;
        Ok(dict)
    }
}
