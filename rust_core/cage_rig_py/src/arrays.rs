//! Arrays at the door: any layout of float32 or float64 (integers of any width for indices) in,
//! fresh float64 arrays out. What does not fit is refused by the argument's name, with the shape
//! and type expected and found.

use crate::errors::ArrayError;
use cage_rig::{Matrix3, Point, Polygons, Rows, SkinWeights, Transform};
use numpy::ndarray::{ArrayView1, ArrayView2, ArrayViewMutD, Dimension};
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArray3, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods,
    PyReadwriteArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// Numbers in row-major order and their shape.
struct Block<T> {
    data: Vec<T>,
    shape: Vec<usize>,
}

/// An expected shape: `None` stands for any length, named in the message.
pub(crate) type Shape<'a> = &'a [(&'a str, Option<usize>)];

/// `argument` as an aligned array of native byte order and expected shape.
fn array<'py>(
    value: &Bound<'py, PyAny>,
    argument: &str,
    types: &str,
    shape: Shape,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let array = match value.cast::<PyUntypedArray>() {
        Ok(array) => array.clone(),
        Err(_) => {
            value.py().import("numpy")?.call_method1("asarray", (value,))?.cast_into::<PyUntypedArray>()?
        }
    };
    let lengths_fit =
        || array.shape().iter().zip(shape).all(|(found, (_, wanted))| wanted.is_none_or(|w| w == *found));
    let found = array.dtype();
    let type_fits = match types {
        INTEGERS => matches!(found.kind(), b'i' | b'u'),
        _ => found.kind() == b'f' && matches!(found.itemsize(), 4 | 8),
    };
    let native = found.is_native_byteorder() != Some(false);
    if array.ndim() != shape.len() || !lengths_fit() || !type_fits || !native {
        return Err(refuse(argument, types, shape, &array));
    }
    if array.getattr("flags")?.getattr("aligned")?.extract()? {
        return Ok(array);
    }
    Ok(array.call_method0("copy")?.cast_into::<PyUntypedArray>()?)
}

const FLOATS: &str = "float32 or float64";
const INTEGERS: &str = "integers";

fn refuse(argument: &str, types: &str, shape: Shape, found: &Bound<'_, PyUntypedArray>) -> PyErr {
    let wanted: Vec<String> = shape
        .iter()
        .map(|(name, length)| length.map_or_else(|| (*name).to_owned(), |l| l.to_string()))
        .collect();
    let found_shape: Vec<String> = found.shape().iter().map(ToString::to_string).collect();
    let (wanted, found_shape) = (wanted.join(", "), found_shape.join(", "));
    let dtype = found.dtype();
    ArrayError::new_err(format!("{argument} must be ({wanted}) of {types}, found ({found_shape}) of {dtype}"))
}

fn floats(value: &Bound<'_, PyAny>, argument: &str, shape: Shape) -> PyResult<Block<f64>> {
    let array = array(value, argument, FLOATS, shape)?;
    let data = match array.cast::<PyArrayDyn<f64>>() {
        Ok(doubles) => doubles.try_readonly()?.as_array().iter().copied().collect(),
        Err(_) => array
            .cast::<PyArrayDyn<f32>>()?
            .try_readonly()?
            .as_array()
            .iter()
            .map(|x| f64::from(*x))
            .collect(),
    };
    Ok(Block { data, shape: array.shape().to_vec() })
}

fn finite_floats(value: &Bound<'_, PyAny>, argument: &str, shape: Shape) -> PyResult<Block<f64>> {
    let block = floats(value, argument, shape)?;
    let width: usize = block.shape[1..].iter().product();
    block.data.iter().enumerate().try_for_each(|(at, x)| usable(*x, argument, at / width.max(1)))?;
    Ok(block)
}

fn usable(x: f64, argument: &str, row: usize) -> PyResult<()> {
    if x.abs() <= cage_rig::LARGEST {
        return Ok(());
    }
    Err(ArrayError::new_err(format!("{argument} has a value that is not finite or beyond 1e12 in row {row}")))
}

/// Integers of any width, one list.
pub(crate) fn integers(value: &Bound<'_, PyAny>, argument: &str) -> PyResult<Vec<i64>> {
    Ok(integer_block(value, argument, &[("n", None)])?.data)
}

fn integer_block(value: &Bound<'_, PyAny>, argument: &str, shape: Shape) -> PyResult<Block<i64>> {
    let array = array(value, argument, INTEGERS, shape)?;
    let wide = array.call_method1("astype", ("int64",))?.cast_into::<PyArrayDyn<i64>>()?;
    let data = wide.try_readonly()?.as_array().iter().copied().collect();
    Ok(Block { data, shape: array.shape().to_vec() })
}

/// Pairs of indices, `n by 2`.
pub(crate) fn pairs(value: &Bound<'_, PyAny>, argument: &str) -> PyResult<Vec<[i64; 2]>> {
    let block = integer_block(value, argument, &[("#E", None), ("2", Some(2))])?;
    Ok(block.data.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect())
}

/// One number for each of `rows`, in the frame's single precision.
pub(crate) fn singles(
    value: &Bound<'_, PyAny>,
    argument: &str,
    rows: (&str, Option<usize>),
) -> PyResult<Vec<f32>> {
    Ok(floats(value, argument, &[rows])?.data.into_iter().map(|x| x as f32).collect())
}

/// Points, `n by 3`; `rows` is what the first length is called.
pub(crate) fn points(
    value: &Bound<'_, PyAny>,
    argument: &str,
    rows: (&str, Option<usize>),
) -> PyResult<Vec<Point>> {
    let block = finite_floats(value, argument, &[rows, ("3", Some(3))])?;
    Ok(block.data.chunks_exact(3).map(Point::from_column_slice).collect())
}

/// A dense matrix.
pub(crate) fn matrix(
    value: &Bound<'_, PyAny>,
    argument: &str,
    shape: [(&str, Option<usize>); 2],
) -> PyResult<Rows> {
    rows_of(finite_floats(value, argument, &shape)?, argument)
}

fn rows_of(block: Block<f64>, argument: &str) -> PyResult<Rows> {
    Rows::from_vec(block.shape[0], block.shape[1], block.data)
        .ok_or_else(|| ArrayError::new_err(format!("{argument} has an impossible shape")))
}

/// Transforms, `#J by 4 by 4`, acting on columns.
pub(crate) fn transforms(value: &Bound<'_, PyAny>, joints: usize) -> PyResult<Vec<Transform>> {
    matrices(value, "transforms", Some(joints))
}

/// Affine matrices of bones, `#J by 4 by 4`, acting on columns.
pub(crate) fn matrices(
    value: &Bound<'_, PyAny>,
    argument: &str,
    joints: Option<usize>,
) -> PyResult<Vec<Transform>> {
    let block = finite_floats(value, argument, &[("#J", joints), ("4", Some(4)), ("4", Some(4))])?;
    affine(&block, block.shape[0])
}

/// Transforms of frames, `#F by #J by 4 by 4`, frame by frame.
pub(crate) fn transforms_of_frames(value: &Bound<'_, PyAny>, joints: usize) -> PyResult<Vec<Transform>> {
    let shape = [("#F", None), ("#J", Some(joints)), ("4", Some(4)), ("4", Some(4))];
    affine(&finite_floats(value, "transforms", &shape)?, joints)
}

fn affine(block: &Block<f64>, joints: usize) -> PyResult<Vec<Transform>> {
    block.data.chunks_exact(16).enumerate().map(|(at, m)| transform(m, at % joints)).collect()
}

fn transform(m: &[f64], joint: usize) -> PyResult<Transform> {
    // Single-precision inverses leave some rounding here.
    if m[12..].iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(found, wanted)| (found - wanted).abs() > 1e-5) {
        return Err(crate::errors::raise(cage_rig::PoseError::NotAffine { joint }));
    }
    let linear = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    Ok(Transform { linear, translation: Point::new(m[3], m[7], m[11]) })
}

/// Cages of frames, `#F by #C by 3`, or one for all of them, `#C by 3`.
pub(crate) fn cages(value: &Bound<'_, PyAny>, frames: usize, vertices: usize) -> PyResult<Vec<Point>> {
    let dimensions: usize = value.getattr("ndim").and_then(|ndim| ndim.extract()).unwrap_or(3);
    if dimensions == 2 {
        return points(value, "cages", ("#C", Some(vertices)));
    }
    let shape = [("#F", Some(frames)), ("#C", Some(vertices)), ("3", Some(3))];
    let block = finite_floats(value, "cages", &shape)?;
    Ok(block.data.chunks_exact(3).map(Point::from_column_slice).collect())
}

/// Faces: triangles `#F by 3`, or a pair (corner indices, face sizes).
pub(crate) fn polygons(value: &Bound<'_, PyAny>, argument: &str) -> PyResult<Polygons> {
    let Ok(pair) = value.cast::<PyTuple>() else {
        let block = integer_block(value, argument, &[("#F", None), ("3", Some(3))])?;
        return Ok(Polygons { sizes: vec![3; block.shape[0]], corners: block.data });
    };
    if pair.len() != 2 {
        let found = pair.len();
        return Err(ArrayError::new_err(format!(
            "{argument} must be an array (#F, 3) or a pair (corner indices, face sizes), found a tuple of {found}"
        )));
    }
    let corners = integers(&pair.get_item(0)?, &format!("{argument}[0] (corner indices)"))?;
    let sizes = integers(&pair.get_item(1)?, &format!("{argument}[1] (face sizes)"))?;
    let sizes: Vec<usize> = sizes.iter().filter_map(|&size| usize::try_from(size).ok()).collect();
    let total = sizes.iter().try_fold(0usize, |sum, &size| sum.checked_add(size));
    if total != Some(corners.len()) {
        let found = corners.len();
        return Err(ArrayError::new_err(format!(
            "the face sizes of {argument} must add up to its {found} corners"
        )));
    }
    Ok(Polygons { corners, sizes })
}

/// Skin weights: `#M by #J`, or a triple (indptr, indices, data).
pub(crate) fn weights(value: &Bound<'_, PyAny>, vertices: usize, joints: usize) -> PyResult<SkinWeights> {
    use crate::errors::OrRaise;
    let Ok(triple) = value.cast::<PyTuple>() else {
        let block = floats(value, "skin_weights", &[("#M", Some(vertices)), ("#J", Some(joints))])?;
        return SkinWeights::from_dense(&rows_of(block, "skin_weights")?).or_raise();
    };
    if triple.len() != 3 {
        let found = triple.len();
        return Err(ArrayError::new_err(format!(
            "skin_weights must be an array (#M, #J) or a triple (indptr, indices, data), found a tuple of {found}"
        )));
    }
    let indptr = integers(&triple.get_item(0)?, "skin_weights[0] (indptr)")?;
    let indices = integers(&triple.get_item(1)?, "skin_weights[1] (indices)")?;
    let data = floats(&triple.get_item(2)?, "skin_weights[2] (data)", &[("n", None)])?;
    SkinWeights::from_compressed(joints, &indptr, &indices, &data.data).or_raise()
}

/// A fresh `n by 3` array.
pub(crate) fn from_points<'py>(py: Python<'py>, points: &[Point]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    PyArray1::from_vec(py, flat).reshape([points.len(), 3])
}

/// A fresh `n by 4 by 4` array, acting on columns.
pub(crate) fn from_transforms<'py>(
    py: Python<'py>,
    transforms: &[Transform],
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let mut flat = Vec::with_capacity(16 * transforms.len());
    for Transform { linear, translation } in transforms {
        for row in 0..3 {
            flat.extend([linear[(row, 0)], linear[(row, 1)], linear[(row, 2)], translation[row]]);
        }
        flat.extend([0.0, 0.0, 0.0, 1.0]);
    }
    PyArray1::from_vec(py, flat).reshape([transforms.len(), 4, 4])
}

/// A fresh `n by 3` array from frame numbers.
pub(crate) fn from_frame<'py>(py: Python<'py>, points: &[[f32; 3]]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = points.iter().flatten().map(|x| f64::from(*x)).collect();
    PyArray1::from_vec(py, flat).reshape([points.len(), 3])
}

/// A fresh matrix.
pub(crate) fn from_rows<'py>(py: Python<'py>, rows: &Rows) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_slice(py, rows.as_slice()).reshape([rows.len(), rows.columns()])
}

/// An array of float32 and exactly this shape that is kept, for frames to read from or to write to.
pub(crate) fn kept<D: Dimension>(
    value: &Bound<'_, PyAny>,
    argument: &str,
    shape: Shape,
) -> PyResult<Py<PyArray<f32, D>>> {
    let found = array(value, argument, FLOATS, shape)?;
    match found.cast::<PyArray<f32, D>>() {
        Ok(single) if found.is(value) => Ok(single.clone().unbind()),
        _ => Err(refuse(argument, "float32", shape, &found)),
    }
}

/// Points of a kept array, `n by 3`.
pub(crate) fn kept_points(
    array: &Bound<'_, PyArray2<f32>>,
    argument: &str,
    each: impl Fn(Point, usize) -> Point,
) -> PyResult<Vec<Point>> {
    let array = array.try_readonly()?;
    let read = |(row, p): (usize, ArrayView1<f32>)| {
        let point = Point::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
        point.iter().try_for_each(|x| usable(*x, argument, row))?;
        Ok(each(point, row))
    };
    array.as_array().outer_iter().enumerate().map(read).collect()
}

/// Affine matrices of a kept array, `n by 4 by 4`.
pub(crate) fn kept_matrices(array: &Bound<'_, PyArray3<f32>>, argument: &str) -> PyResult<Vec<Transform>> {
    let array = array.try_readonly()?;
    let read = |(row, m): (usize, ArrayView2<f32>)| {
        let m: [f64; 16] = std::array::from_fn(|k| f64::from(m[[k / 4, k % 4]]));
        m.iter().try_for_each(|x| usable(*x, argument, row))?;
        transform(&m, row)
    };
    array.as_array().outer_iter().enumerate().map(read).collect()
}

/// A writable array of the caller's, `n by 3` or flat.
pub(crate) enum Out<'py> {
    /// float32.
    Single(PyReadwriteArrayDyn<'py, f32>),
    /// float64.
    Double(PyReadwriteArrayDyn<'py, f64>),
}

impl<'py> Out<'py> {
    /// Takes `value`, whose type must be float32 or float64 and which must be writable.
    pub(crate) fn new(value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let found = value.cast::<PyUntypedArray>().map_err(|_| {
            ArrayError::new_err("out must be an array (n, 3) of float32 or float64 to write to")
        })?;
        let shape: Shape = if found.ndim() == 1 { &[("3n", None)] } else { &[("n", None), ("3", Some(3))] };
        let fits = found.shape().last().is_some_and(|last| last % 3 == 0);
        let aligned: bool = found.getattr("flags")?.getattr("aligned")?.extract()?;
        if !fits || !aligned {
            return Err(refuse("out", FLOATS, shape, found));
        }
        array(value, "out", FLOATS, shape)?;
        let held = |_| ArrayError::new_err("out must be writable and not in use elsewhere");
        match found.cast::<PyArrayDyn<f32>>() {
            Ok(single) => Ok(Self::Single(single.try_readwrite().map_err(held)?)),
            Err(_) => Ok(Self::Double(found.cast::<PyArrayDyn<f64>>()?.try_readwrite().map_err(held)?)),
        }
    }

    /// Its view, which may cross threads.
    pub(crate) fn view(&mut self) -> OutView<'_> {
        match self {
            Self::Single(array) => OutView::Single(array.as_array_mut()),
            Self::Double(array) => OutView::Double(array.as_array_mut()),
        }
    }
}

/// A view of an [`Out`], usable without the GIL.
pub(crate) enum OutView<'a> {
    /// float32.
    Single(ArrayViewMutD<'a, f32>),
    /// float64.
    Double(ArrayViewMutD<'a, f64>),
}

impl OutView<'_> {
    /// Writes `points[start..]` until the array is full, as they are where it is float32 too.
    pub(crate) fn write_singles(self, points: &[[f32; 3]], start: usize) -> PyResult<()> {
        if let Self::Single(mut view) = self {
            let rows = view.len() / 3;
            let source = start.checked_add(rows).and_then(|end| points.get(start..end));
            if let (Some(out), Some(source)) = (view.as_slice_mut(), source) {
                out.copy_from_slice(source.as_flattened());
                return Ok(());
            }
            return Self::Single(view).write(points, start);
        }
        self.write(points, start)
    }

    /// Writes `points[start..]` until the array is full.
    pub(crate) fn write<T: Into<f64> + Copy>(self, points: &[[T; 3]], start: usize) -> PyResult<()> {
        match self {
            Self::Single(view) => fill(view, points, start, |x| x.into() as f32),
            Self::Double(view) => fill(view, points, start, Into::into),
        }
    }
}

fn fill<T: Element, S: Copy>(
    mut view: ArrayViewMutD<'_, T>,
    points: &[[S; 3]],
    start: usize,
    convert: impl Fn(S) -> T,
) -> PyResult<()> {
    let rows = view.len() / 3;
    let source = start.checked_add(rows).and_then(|end| points.get(start..end)).ok_or_else(|| {
        let all = points.len();
        ArrayError::new_err(format!(
            "out has {rows} rows to fill from row {start} on, but there are {all} rows"
        ))
    })?;
    let numbers = source.iter().flatten();
    match view.as_slice_mut() {
        Some(slice) => slice.iter_mut().zip(numbers).for_each(|(out, x)| *out = convert(*x)),
        None => view.iter_mut().zip(numbers).for_each(|(out, x)| *out = convert(*x)),
    }
    Ok(())
}
