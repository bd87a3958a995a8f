//! Products on every path, against sums in double precision.

use super::{Apart, Panels, Precision, Product, Step, Steps, FRAMES, PANEL};
use crate::fixtures::{self, random::Random};
use crate::progress::unwatched;
use crate::rows::Rows;
use crate::simd::Path;

/// Rows that sum to 1, some of their numbers negative, as those of Φ.
fn coordinates(rows: usize, columns: usize, random: &mut Random) -> Rows {
    let mut matrix = Rows::zeros(rows, columns);
    for i in 0..rows {
        matrix.row_mut(i).iter_mut().for_each(|x| *x = random.between(-0.2, 1.0));
        let sum: f64 = matrix.row(i).iter().sum::<f64>() + 0.3;
        matrix.row_mut(i).iter_mut().for_each(|x| *x /= sum);
        matrix.row_mut(i)[0] += 0.3 / sum;
    }
    matrix
}

fn packed(matrix: &Rows, precision: Precision) -> Panels {
    unwatched(|part| Panels::new(matrix, precision, part))
}

fn points(count: usize, random: &mut Random) -> Vec<[f32; 3]> {
    (0..count).map(|_| random.point().map(|x| x as f32).into()).collect()
}

fn steps<const F: usize>(columns: usize, random: &mut Random) -> Vec<Step<F>> {
    let by = |random: &mut Random| -> [f32; 3] { random.point().map(|x| x as f32).into() };
    (0..columns).map(|column| Step { column, by: std::array::from_fn(|_| by(random)) }).collect()
}

fn all<const F: usize>(moved: &[Step<F>]) -> Steps<F> {
    let mut steps = Steps::default();
    steps.set(moved.iter().copied());
    steps
}

/// The largest error of a coordinate.
fn error(matrix: &Rows, product: &Product, steps: &[Step], found: &[[f32; 3]]) -> f64 {
    let from = product.from.points();
    let exact = |i: usize, d: usize| {
        let terms = steps.iter().map(|step| matrix.row(i)[step.column] * f64::from(step.by[0][d]));
        let part = product.mask.map_or(1.0, |mask| f64::from(mask[i]));
        let offset = product.offsets.map_or(0.0, |offsets| f64::from(offsets[i][d]));
        f64::from(from[i][d]) + part * terms.sum::<f64>() + offset
    };
    let errors = (0..3 * found.len()).map(|n| (f64::from(found[n / 3][n % 3]) - exact(n / 3, n % 3)).abs());
    errors.fold(0.0, f64::max)
}

#[test]
fn every_path_agrees_with_the_sums() {
    let mut random = Random::new(1);
    for rows in [1, 5, 31, PANEL, 33, 64, 100, 1001] {
        for columns in [1, 2, 12, 79] {
            let matrix = coordinates(rows, columns, &mut random);
            let panels = packed(&matrix, Precision::Single);
            let (from, offsets) = (points(rows, &mut random), points(rows, &mut random));
            let mask: Vec<f32> = (0..rows).map(|_| random.unit() as f32).collect();
            let steps = steps(columns, &mut random);
            for path in Path::available() {
                for (mask, offsets) in [(None, None), (Some(&mask), None), (Some(&mask), Some(&offsets))] {
                    let product = Product {
                        path,
                        from: &Apart::new(&from),
                        mask: mask.map(|mask| &mask[..]),
                        offsets: offsets.map(|offsets| &offsets[..]),
                    };
                    let mut out = vec![[f32::NAN; 3]; rows];
                    panels.write(&product, &mut all(&steps), &mut out);
                    let error = error(&matrix, &product, &steps, &out);
                    assert!(error <= 1e-6, "{} {rows} by {columns}: {error:e}", path.name());
                }
            }
        }
    }
}

#[test]
fn no_movement_is_exact() {
    let mut random = Random::new(2);
    let panels = packed(&coordinates(77, 9, &mut random), Precision::Single);
    let from = points(77, &mut random);
    for path in Path::available() {
        let mut out = vec![[f32::NAN; 3]; 77];
        panels.write(
            &Product { path, from: &Apart::new(&from), mask: None, offsets: None },
            &mut Steps::default(),
            &mut out,
        );
        assert_eq!(out, from);
    }
}

#[test]
fn chosen_columns_are_those_of_the_matrix() {
    let mut random = Random::new(3);
    let matrix = coordinates(70, 10, &mut random);
    let from = points(70, &mut random);
    let product = Product { path: Path::default(), from: &Apart::new(&from), mask: None, offsets: None };
    for precision in [Precision::Single, Precision::Half] {
        let panels = packed(&matrix, precision);
        let moved: Vec<Step> =
            steps(10, &mut random).into_iter().filter(|s| [2, 7].contains(&s.column)).collect();
        let alone: Vec<Step> =
            moved.iter().enumerate().map(|(column, step)| Step { column, ..*step }).collect();
        let mut out = [from.clone(), from.clone()];
        panels.write(&product, &mut all(&moved), &mut out[0]);
        panels.select(&[2, 7]).write(&product, &mut all(&alone), &mut out[1]);
        assert_eq!(out[0], out[1]);
    }
}

#[test]
fn threads_and_several_frames_change_no_bit() {
    let mut random = Random::new(4);
    let (rows, columns) = (20_011, 60);
    let matrix = coordinates(rows, columns, &mut random);
    let from = points(rows, &mut random);
    let steps = steps::<FRAMES>(columns, &mut random);
    for precision in [Precision::Single, Precision::Half] {
        let panels = packed(&matrix, precision);
        for path in Path::available() {
            let product = Product { path, from: &Apart::new(&from), mask: None, offsets: None };
            let mut frames = vec![from.clone(); FRAMES];
            let [a, b, c, d] = &mut frames[..] else { unreachable!("four frames") };
            panels.write_frames(&product, &mut all(&steps), [a, b, c, d]);
            for (f, frame) in frames.iter().enumerate() {
                let alone: Vec<Step> =
                    steps.iter().map(|s| Step { column: s.column, by: [s.by[f]] }).collect();
                let mut out = from.clone();
                panels.write(&product, &mut all(&alone), &mut out);
                assert!(out == *frame, "{} frame {f}", path.name());
                // The first rows alone are too few for threads.
                panels.write(&product, &mut all(&alone), &mut out[..640]);
                assert!(out[..640] == frame[..640], "{} frame {f}", path.name());
            }
        }
    }
}

#[test]
fn sixteen_bits_keep_displacements_and_what_moves_as_a_whole() {
    let mut random = Random::new(5);
    let mut matrices: Vec<Rows> = [8, 44, 200].map(|c| coordinates(1000, c, &mut random)).into();
    matrices.extend(fixtures::all().iter().map(|fixture| fixture.rig().cage_coords().clone()));
    for matrix in matrices {
        let (rows, columns) = (matrix.len(), matrix.columns());
        let panels = packed(&matrix, Precision::Half);
        let from = vec![[0.0; 3]; rows];
        let mut out = from.clone();
        let whole: Vec<Step> = (0..columns).map(|column| Step { column, by: [[1.0, -2.0, 0.5]] }).collect();
        for path in Path::available() {
            let product = Product { path, from: &Apart::new(&from), mask: None, offsets: None };
            panels.write(&product, &mut all(&whole), &mut out);
            let far = error(&matrix, &product, &whole, &out);
            assert!(far <= 2e-5 * 2.0, "{far:e}");
            for _ in 0..20 {
                let steps = steps(columns, &mut random);
                panels.write(&product, &mut all(&steps), &mut out);
                let far = error(&matrix, &product, &steps, &out);
                assert!(far <= 2e-4 * 3f64.sqrt(), "{} columns: {far:e}", columns);
            }
        }
    }
}

#[test]
fn sixteen_bits_never_overflow() {
    let mut random = Random::new(6);
    let (rows, columns) = (64, 300);
    let mut matrix = Rows::zeros(rows, columns);
    for i in 0..rows {
        matrix.row_mut(i).iter_mut().for_each(|x| *x = random.between(-1.0, 1.0));
    }
    let panels = packed(&matrix, Precision::Half);
    let from = vec![[0.0; 3]; rows];
    for i in 0..rows {
        // The largest sum that this row can have, and the least.
        let along = |column: usize| matrix.row(i)[column].signum() as f32;
        let steps: Vec<Step> =
            (0..columns).map(|column| Step { column, by: [[along(column), -along(column), 0.0]] }).collect();
        let largest: f64 = matrix.row(i).iter().map(|x| x.abs()).sum();
        for path in Path::available() {
            let product = Product { path, from: &Apart::new(&from), mask: None, offsets: None };
            let mut out = from.clone();
            panels.write(&product, &mut all(&steps), &mut out);
            let far = error(&matrix, &product, &steps, &out);
            // Coarser than coordinates, whose rows sum to 1; a sum that left its bits would be off by more than itself.
            assert!(far <= 1e-3 * largest, "{}: {far:e} of {largest}", path.name());
        }
    }
}
