//! What frames cost, against the limits of the machine: `cargo bench -p cage_rig --bench frames`.
//!
//! Every figure is the least of many rounds in which a scenario, what it is compared with and both limits take turns,
//! so that all see the same machine. One thread, but where threads are named. What they answer is checked.
//!
//! - product: M = M₀ + Φ(C − C₀) for a coarse character, whose Φ stays in the caches, up to one that is bound by memory;
//!   then a drag of one and of five cage vertices, a cage between two keys, 16-bit weights, and four frames at once as
//!   bakes make them.
//! - skinning: 40,000 vertices of four bones each, rigid or scaled, on every path.
//! - frame: from transforms to posed skin and cage, as an add-on waits for it, alone and with threads.
//!
//! Lines that begin with `row` are for the table of `make bench`.
#![allow(clippy::print_stdout, missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;

use cage_rig::simd::Path;
use cage_rig::skinning::{FrameWeights, Scratch, SkinningInput, METHODS};
use cage_rig::sync::{BindInput, Frame};
use cage_rig::{CoupledRig, Matrix3, Point, Precision, Transform};
use common::large::snake;
use common::random::Random;
use pulp::{Arch, Simd, WithSimd};
use std::hint::black_box;
use std::time::Instant;

/// Rings, vertices around and rings of the cage: as many vertices as characters of [CTL*20] have.
const CHARACTERS: [(usize, usize, usize); 5] =
    [(50, 42, 20), (100, 75, 22), (400, 104, 17), (400, 104, 48), (1461, 82, 11)];
const JOINTS: usize = 60;

/// Reads all of it.
struct Read<'a>(&'a [f32]);

impl WithSimd for Read<'_> {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f32 {
        let mut sums = [simd.splat_f32s(0.0); 8];
        for numbers in S::as_simd_f32s(self.0).0.chunks_exact(8) {
            for k in 0..8 {
                sums[k] = simd.add_f32s(sums[k], numbers[k]);
            }
        }
        sums.iter().map(|sum| simd.reduce_sum_f32s(*sum)).sum()
    }
}

/// Multiplies and adds as fast as can be, so many times.
struct MultiplyAdds(usize);

impl WithSimd for MultiplyAdds {
    type Output = (f32, usize);

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> (f32, usize) {
        let (a, b) = (simd.splat_f32s(0.999), simd.splat_f32s(1e-3));
        let mut sums = [b; 12];
        for _ in 0..self.0 {
            for sum in &mut sums {
                *sum = simd.mul_add_f32s(*sum, a, b);
            }
        }
        (sums.iter().map(|sum| simd.reduce_sum_f32s(*sum)).sum(), 12 * S::F32_LANES * self.0)
    }
}

/// The least time of some work.
#[derive(Clone, Copy)]
struct Least(f64);

impl Least {
    fn of<T>(&mut self, work: impl FnOnce() -> T) {
        let start = Instant::now();
        black_box(work());
        self.0 = self.0.min(start.elapsed().as_secs_f64());
    }
}

fn pose(scaled: bool, share: f64) -> Vec<Transform> {
    let turn = |j: usize| {
        let (sin, cos) = (0.4 * share * (j as f64).sin()).sin_cos();
        let linear = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
        let linear = if scaled { linear * 1.1 } else { linear };
        let place = Point::new(j as f64, 0.0, 0.0);
        Transform { linear, translation: place - linear * place }
    };
    (0..JOINTS).map(turn).collect()
}

fn input((rings, around, cage_rings): (usize, usize, usize)) -> BindInput {
    let mut input = snake(rings, around, JOINTS, cage_rings);
    input.method = &METHODS[0];
    input
}

/// The same cage with its first vertices moved a little more, each by itself: no shapes make it up.
fn dragged<'a>(cage: &'a mut [Point], vertices: usize, random: &mut Random) -> &'a [Point] {
    cage.iter_mut().take(vertices).for_each(|c| c.y += random.between(5e-5, 2e-4));
    cage
}

/// The cage on a line between two keys.
fn keyed<'a>(cage: &'a mut [Point], bound: &[Point], part: f64) -> &'a [Point] {
    cage.iter_mut().zip(bound).for_each(|(c, c0)| *c = c0 * (1.0 + 0.1 * part));
    cage
}

/// How far the rest skin of `rig` is from M₀ + Φ(C − C₀) in 64 bits at worst, and how far that moves at most, both in
/// parts of the size. `rest`: M₀.
fn off(rig: &mut CoupledRig, rest: &[Point]) -> (f64, f64) {
    let found = rig.rest_skin().to_vec();
    let moved: Vec<Point> = rig.rest_cage().iter().zip(rig.cage().vertices()).map(|(c, c0)| c - c0).collect();
    let (mut miss, mut most) = (0.0, 0.0);
    for (i, (found, rest)) in found.iter().zip(rest).enumerate() {
        let step = rig.cage_coords().combine(i, &moved);
        miss = f64::max(miss, (Point::from(found.map(f64::from)) - rest - step).norm());
        most = f64::max(most, step.norm());
    }
    (miss / rig.size(), most / rig.size())
}

/// The rest skin is right to the rounding of 32 bits, and `part` of what the cage moves it by.
fn check(rig: &mut CoupledRig, rest: &[Point], part: f64) {
    let (miss, most) = off(rig, rest);
    assert!(miss < 1e-6 + part * most, "off by {miss:e} of the size where {most} is moved");
}

fn product(character: (usize, usize, usize)) {
    let rest = input(character).skin_vertices;
    let mut rig = CoupledRig::new(input(character)).expect("it binds");
    let mut half = input(character);
    half.options.precision = Precision::Half;
    half.known.cage_coords = Some(rig.cage_coords().clone());
    let mut half = CoupledRig::new(half).expect("it binds");
    let (rows, columns) = (rig.cage_coords().len(), rig.cage_coords().columns());
    let (mut cage, arch, memory) = (rig.rest_cage().to_vec(), Arch::new(), vec![1.0f32; rows * columns]);
    let (still, mut posed) = (pose(false, 1.0), vec![[0.0f32; 3]; 4 * rows]);
    let mut least = [Least(f64::INFINITY); 10];
    let (bound, mut line, mut random) = (cage.clone(), cage.clone(), Random::new(1));
    let operations = arch.dispatch(MultiplyAdds(10_000)).1;
    for round in 0..(4_000_000_000 / (rows * columns * 40)).clamp(60, 1000) {
        least[0].of(|| arch.dispatch(Read(black_box(&memory))));
        least[1].of(|| arch.dispatch(MultiplyAdds(black_box(10_000))));
        for (at, moved) in [(2, columns), (3, 1), (4, 5)] {
            // The first step of a drag copies its columns, and what comes after others finds the caches full of theirs.
            for _ in 0..3 {
                rig.edit_rest_cage(dragged(&mut cage, moved, &mut random)).expect("a valid cage");
                least[at].of(|| rig.rest_skin()[0]);
            }
            if round == 0 {
                check(&mut rig, &rest, 0.0);
            }
        }
        // Seen, known, and read twice.
        for k in 1..5 {
            rig.edit_rest_cage(keyed(&mut line, &bound, f64::from(k))).expect("a valid cage");
            least[9].of(|| rig.rest_skin()[0]);
        }
        if round == 0 {
            check(&mut rig, &rest, 0.0);
        }
        for _ in 0..3 {
            half.edit_rest_cage(dragged(&mut cage, columns, &mut random)).expect("a valid cage");
            least[5].of(|| half.rest_skin()[0]);
        }
        if round == 0 {
            check(&mut half, &rest, 2e-4);
        }
        let cages: Vec<Vec<Point>> =
            (0..4).map(|_| dragged(&mut cage, columns, &mut random).to_vec()).collect();
        let frames: Vec<Frame> = cages.iter().map(|cage| (&cage[..], &still[..])).collect();
        let same: Vec<Frame> = (0..4).map(|_| frames[0]).collect();
        for _ in 0..3 {
            least[6].of(|| rig.posed_skins(&frames, None, &mut posed));
        }
        if round == 0 {
            let mut alone = vec![[0.0f32; 3]; rows];
            for (frame, together) in frames.chunks(1).zip(posed.chunks(rows)) {
                rig.posed_skins(frame, None, &mut alone).expect("a valid frame");
                let miss = alone.iter().flatten().zip(together.iter().flatten()).map(|(a, b)| (a - b).abs());
                assert!(
                    miss.fold(0.0, f32::max) < 1e-6 * rig.size() as f32,
                    "four frames are not four frames"
                );
            }
        }
        for _ in 0..3 {
            least[7].of(|| rig.posed_skins(&same, None, &mut posed));
            least[8].of(|| rig.posed_skins(&frames[..1], None, &mut posed[..rows]));
        }
    }
    let [read, peak, whole, one, five, halves, four, four_same, single, keyed] = least.map(|least| least.0);
    let (bytes, multiplies) = ((4 * rows * columns) as f64, (3 * rows * columns) as f64);
    println!(
        "product {rows} by {columns}: {:.4} ms; {:.1} GB/s of weights, {:.0} % of reading them alone; {:.0} % of peak \
         multiply-adds",
        whole * 1e3,
        bytes / whole / 1e9,
        100.0 * read / whole,
        100.0 * multiplies / whole * peak / operations as f64,
    );
    let size = format!("{rows} vertices, cage of {columns}");
    let limit = read / whole;
    println!(
        "row\trest skin, one thread: {size}\tall that a moved cage costs\t{}\t-\t-\t{limit}",
        whole * 1e3
    );
    for (what, why, time) in [
        ("drag of one cage vertex", "one column of Φ instead of all", one),
        ("drag of five cage vertices", "five columns of Φ instead of all", five),
        ("cage between two keys", "a shape that it was seen in instead of Φ", keyed),
        ("16-bit weights", "half as much to read where Φ fits no cache", halves),
    ] {
        let (time, whole) = (time * 1e3, whole * 1e3);
        println!("row\t{what}, one thread: {size}\t{why}\t{time}\t{whole}\tthe whole product in 32 bits\t-");
    }
    // Four frames of one cage have one product, and four skinnings each.
    let together = (four - four_same) + whole;
    for (what, time, peer, beside) in [
        ("product of one of four frames at once", together / 4.0, whole, "the product of a frame alone"),
        ("one of four frames at once", four / 4.0, single, "a frame alone"),
    ] {
        let (time, peer) = (time * 1e3, peer * 1e3);
        println!("row\t{what}, one thread: {size}\tbakes read Φ once for four\t{time}\t{peer}\t{beside}\t-");
    }
    println!(
        "  drag of one {:.1}, of five {:.1}, keyed {:.1} times cheaper; 16 bits {:.2} times; four at once: product {:.2}, posed {:.2} times",
        whole / one,
        whole / five,
        whole / keyed,
        whole / halves,
        4.0 * whole / together,
        4.0 * single / four,
    );
}

fn skinning() {
    let input = input((400, 100, 17));
    let weights = FrameWeights::new(&input.skin_weights);
    let rest: Vec<[f32; 3]> = input.skin_vertices.iter().map(|v| (*v).map(|x| x as f32).into()).collect();
    let (mut posed, mut scratch) = (rest.clone(), Scratch::default());
    for path in Path::available() {
        for (what, transforms) in [("rigid", pose(false, 1.0)), ("scaled", pose(true, 1.0))] {
            let figures = METHODS.iter().map(|method| {
                let (transforms, rest_skin) = (&transforms[..], &rest[..]);
                let input =
                    SkinningInput { path, transforms, weights: &weights, rest_skin, centers: rest_skin };
                let mut least = Least(f64::INFINITY);
                (0..400).for_each(|_| least.of(|| (method.pose)(&input, &mut scratch, &mut posed)));
                assert!(posed.iter().flatten().all(|x| x.is_finite()));
                if Some(path.name()) == Path::available().last().map(|path| path.name()) && what == "rigid" {
                    let (count, name, time) = (rest.len(), method.name, least.0 * 1e3);
                    println!("row\t{name}, one thread: {count} vertices of 4 bones\tbones that move alone\t{time}\t-\t-\t-");
                }
                format!("{} {:.1}", method.name, least.0 * 1e9 / rest.len() as f64)
            });
            let figures: Vec<String> = figures.collect();
            println!("skinning {} {what}, ns per vertex: {}", path.name(), figures.join(", "));
        }
    }
}

fn frames(character: (usize, usize, usize)) {
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    let mut rig = CoupledRig::new(input(character)).expect("it binds");
    let (rows, columns) = (rig.cage_coords().len(), rig.rest_cage().len());
    let poses = [pose(false, 1.0), pose(false, 0.7)];
    let (mut cage, mut least) = (rig.rest_cage().to_vec(), [Least(f64::INFINITY); 4]);
    let mut random = Random::new(2);
    for _ in 0..300 {
        let mut frame = |at: usize, moved: usize| {
            let cage = dragged(&mut cage, moved, &mut random);
            least[at].of(|| {
                rig.play(cage, &poses[at % 2], None).expect("a valid frame");
                rig.posed_skin();
                rig.posed_cage()[0]
            });
            assert!(rig.posed_skin().iter().flatten().all(|x| x.is_finite()));
        };
        single.install(|| frame(0, 0));
        frame(1, 0);
        single.install(|| frame(2, columns));
        frame(3, columns);
    }
    let [bones, bones_threads, both, both_threads] = least.map(|least| least.0 * 1e3);
    println!(
        "row\tframe, threads: {rows} vertices, cage of {columns}\tfrom transforms to posed skin and cage\t{both_threads}\t\
         {both}\tone thread\t-"
    );
    println!(
        "frame {rows} by {columns}, ms: bones {bones:.3}, with threads {bones_threads:.3}; bones and cage {both:.3}, with \
         threads {both_threads:.3}"
    );
}

fn main() {
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool");
    single.install(|| {
        CHARACTERS.into_iter().for_each(product);
        skinning();
    });
    CHARACTERS.into_iter().for_each(frames);
}
