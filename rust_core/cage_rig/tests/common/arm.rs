//! The reference rig of [CTL*20]: the authors' arm and what their prototype computes for it.
//!
//! Its files are not part of this repository. They are looked for in `CAGE_RIG_SHARED`, else beside
//! the repository; tests that need them say so and pass when they are not there.

use super::Fixture;
use cage_rig::{Matrix3, Point, Polygons, Rows, Transform};
use ndarray_npy::NpzReader;
use std::fs::File;
use std::path::PathBuf;

/// One file of reference arrays.
pub struct Reference(NpzReader<File>);

fn folder() -> Option<PathBuf> {
    let shared = std::env::var_os("CAGE_RIG_SHARED").map(PathBuf::from);
    let shared = shared.unwrap_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    let folder = shared.join("data/arm");
    folder.join("inputs.npz").is_file().then_some(folder)
}

/// True when the files are there; says why not otherwise.
pub fn is_here() -> bool {
    let here = folder().is_some();
    if !here {
        #[allow(clippy::print_stderr)] // a skipped test must be visible
        {
            eprintln!("SKIPPED: the reference rig is not here; set CAGE_RIG_SHARED to the folder that holds data/arm");
        }
    }
    here
}

/// Opens `name`.npz; call [`is_here`] first.
pub fn open(name: &str) -> Reference {
    let path = folder().expect("asked whether it is here").join(name).with_extension("npz");
    Reference(NpzReader::new(File::open(path).expect("the file opens")).expect("an npz file"))
}

impl Reference {
    /// All numbers of an array, row by row, and its shape.
    pub fn doubles(&mut self, name: &str) -> (Vec<f64>, Vec<usize>) {
        let array: ndarray::ArrayD<f64> = self.0.by_name(name).expect("the array is there");
        (array.iter().copied().collect(), array.shape().to_vec())
    }

    /// An array of indices.
    pub fn integers(&mut self, name: &str) -> Vec<i64> {
        let array: ndarray::ArrayD<i32> = self.0.by_name(name).expect("the array is there");
        array.iter().map(|&i| i64::from(i)).collect()
    }

    /// A matrix.
    pub fn rows(&mut self, name: &str) -> Rows {
        let (data, shape) = self.doubles(name);
        Rows::from_vec(shape[0], shape[1], data).expect("two dimensions")
    }

    /// Lists of points, one per leading index (`… by n by 3`).
    pub fn point_lists(&mut self, name: &str) -> Vec<Vec<Point>> {
        let (data, shape) = self.doubles(name);
        let count = shape[shape.len() - 2];
        data.chunks(3 * count).map(|list| list.chunks(3).map(Point::from_column_slice).collect()).collect()
    }

    /// One list of points.
    pub fn points(&mut self, name: &str) -> Vec<Point> {
        self.point_lists(name).remove(0)
    }

    /// Lists of transforms, one per pose.
    pub fn poses(&mut self, name: &str) -> Vec<Vec<Transform>> {
        let (data, shape) = self.doubles(name);
        let read = |m: &[f64]| Transform {
            linear: Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]),
            translation: Point::new(m[3], m[7], m[11]),
        };
        data.chunks(16 * shape[shape.len() - 3]).map(|pose| pose.chunks(16).map(read).collect()).collect()
    }
}

/// The arm; call [`is_here`] first.
pub fn fixture() -> Fixture {
    let mut inputs = open("inputs");
    let triangles = |flat: Vec<i64>| Polygons { sizes: vec![3; flat.len() / 3], corners: flat };
    Fixture {
        name: "arm",
        skin: inputs.points("V"),
        skin_faces: triangles(inputs.integers("F")),
        weights: inputs.rows("Omega"),
        joints: inputs.points("joints"),
        parents: inputs.integers("parents"),
        cage: inputs.points("C0"),
        cage_faces: triangles(inputs.integers("CF")),
    }
}

/// The anchors of the prototype.
pub fn anchors() -> Vec<i64> {
    open("inputs").integers("maxvol")
}
