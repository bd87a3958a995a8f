//! What centers of rotation cost: `cargo bench -p cage_rig --bench skinning`. Frames: see `frames.rs`.
//!
//! - centers: 119,802 vertices under 98 bones, 44 cage vertices; as large as the paper's largest rig. The plain
//!   integral, here of some vertices, takes minutes and says how far off the bins are.
//!
//! Lines that begin with `row` are for the table of `make bench`.
#![allow(clippy::print_stdout, missing_docs)]

use cage_rig::skinning::centers::{centers, CenterOptions};
use cage_rig::skinning::PackedWeights;
use cage_rig::{unwatched, Point, Rows, SkinWeights};
use std::time::Instant;

/// A bumpy tube along x with its weights, four bones a vertex.
struct Snake {
    skin: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    weights: SkinWeights,
}

fn snake(rings: usize, around: usize, joints: usize) -> Snake {
    let count = rings * around;
    let (mut skin, mut starts, mut indices, mut data) = (Vec::new(), vec![0], Vec::new(), Vec::new());
    for i in 0..count {
        let x = (i / around) as f64 / rings as f64 * (joints - 1) as f64;
        let turn = (i % around) as f64 / around as f64 * std::f64::consts::TAU;
        let radius = 0.8 + 0.2 * (3.0 * x).sin();
        skin.push([x as f32, (radius * turn.cos()) as f32, (radius * turn.sin()) as f32]);
        let place = x + 0.15 * turn.cos() + 0.1 * (2.0 * turn + x).sin();
        let first = (place.floor() as i64 - 1).clamp(0, joints as i64 - 4);
        for j in first..first + 4 {
            indices.push(j);
            data.push((-1.5 * (place - j as f64).powi(2)).exp() + 1e-4);
        }
        starts.push(data.len() as i64);
    }
    let quads = (0..count - around).map(|i| (i as u32, (i - i % around + (i + 1) % around) as u32));
    let a = around as u32;
    let triangles = quads.flat_map(|(i, next)| [[i, next, next + a], [i, next + a, i + a]]).collect();
    let weights = SkinWeights::from_compressed(joints, &starts, &indices, &data).expect("valid weights");
    Snake { skin, triangles, weights }
}

fn integrate() {
    let (joints, cage) = (98, 44);
    let snake = snake(1461, 82, joints + 1);
    let count = snake.skin.len();
    let weights = PackedWeights::new(&snake.weights);
    let positions = snake.skin.iter().flatten().map(|&x| f64::from(x)).collect();
    let positions = Rows::from_vec(count, 3, positions).expect("three a vertex");
    let mut coords = Rows::zeros(count, cage);
    (0..count).for_each(|i| coords.row_mut(i).fill(1.0 / cage as f64));
    let run = |values: &Rows, bins| {
        let options = CenterOptions { bins, ..CenterOptions::default() };
        let start = Instant::now();
        let found =
            unwatched(|part| centers(&snake.skin, &snake.triangles, &weights, values, &options, part));
        (found, start.elapsed().as_secs_f64())
    };
    for bins in [16, 32, 64, 128] {
        let seconds = (0..3).map(|_| run(&coords, bins).1).fold(f64::INFINITY, f64::min);
        let (found, _) = run(&positions, bins);
        let sampled = (0..40).map(|k| k * (count / 40) + 7);
        let errors: Vec<f64> = sampled.map(|i| error(&snake, found.row(i), i)).collect();
        let mean = errors.iter().sum::<f64>() / 40.0;
        let worst = errors.iter().copied().fold(0.0, f64::max);
        println!(
            "centers {count} vertices, {bins} bins: {seconds:.2} s, error {mean:.1e} mean, {worst:.1e} worst"
        );
        if bins == CenterOptions::default().bins {
            assert!(worst <= 5e-3);
            let (why, time) = ("once, when a method first needs them", seconds * 1e3);
            println!("row\tcenters of rotation: {count} vertices, {joints} bones\t{why}\t{time}\t-\t-\t-");
        }
    }
}

/// How far `found` is from the plain integral, over the spread of what moves alike.
fn error(snake: &Snake, found: &[f64], vertex: usize) -> f64 {
    let own = snake.weights.row(vertex);
    let (mut total, mut first, mut second) = (0.0, Point::zeros(), 0.0);
    for corners in &snake.triangles {
        let [a, b, c] = corners.map(|v| Point::from(snake.skin[v as usize].map(f64::from)));
        let area = (b - a).cross(&(c - a)).norm() / 2.0;
        let middle = (a + b + c) / 3.0;
        let rows = corners.map(|v| snake.weights.row(v as usize));
        let mean = |j: u32| {
            rows.iter().flat_map(|r| r.iter()).filter(|(k, _)| *k == j).map(|(_, w)| w).sum::<f64>() / 3.0
        };
        let means: Vec<f64> = own.iter().map(|(j, _)| mean(*j)).collect();
        for j in 0..own.len() {
            for k in j + 1..own.len() {
                let apart = (own[j].1 * means[k] - own[k].1 * means[j]) / 0.1;
                let share = own[j].1 * own[k].1 * means[j] * means[k] * (-apart * apart).exp() * area;
                total += share;
                first += share * middle;
                second += share * middle.norm_squared();
            }
        }
    }
    let p = first / total;
    (Point::from_row_slice(found) - p).norm() / (second / total - p.norm_squared()).sqrt()
}

fn main() {
    integrate();
}
