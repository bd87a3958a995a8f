//! How every method goes over the skin: blend rows of numbers, then move vertices by them.
//!
//! A method keeps a row of numbers for each bone, or for each pair of bones that meet at a vertex. Per
//! block of vertices the rows are blended by the weights, one row at a time, and then turned in
//! registers, so that what moves the vertices works on one vertex a lane. Everything in between stays in
//! the first cache.

use super::frame_weights::{Entries, FrameWeights, Weights};
use super::vectors::Three;
use super::SkinningInput;
use crate::simd::{Kernel, Lanes};
use crate::threads;

/// Vertices of a block.
const BLOCK: usize = 32;
/// Below this many vertices one thread is faster than two; each further one needs as many.
const PARALLEL_FROM: usize = 16_384;
/// Vertices that one thread takes at a time.
const SHARE: usize = 1024;

/// A row of numbers: groups of four.
pub(super) type Row<const GROUPS: usize> = [[f32; 4]; GROUPS];

/// What a method does with blended rows.
pub(super) trait Mover<const GROUPS: usize>: Copy + Sync {
    /// Rows stand for pairs of bones instead of bones.
    const PAIRS: bool;
    /// Vertices turn about centers.
    const CENTERS: bool;

    /// The vertices of one vector from `v`, their centers `p` and their rows.
    fn moved<L: Lanes>(lanes: L, rows: &[Row<GROUPS>], v: Three<L>, p: Three<L>) -> Three<L>;
}

/// Writes every vertex moved by `table`, in threads where that pays.
pub(super) fn each_vertex<const GROUPS: usize, M: Mover<GROUPS>>(
    _: M,
    table: &[Row<GROUPS>],
    input: &SkinningInput,
    posed: &mut [[f32; 3]],
) {
    let share = |(index, out): (usize, &mut [[f32; 3]])| {
        let pass =
            Pass::<GROUPS, M> { table, input, first: index * SHARE, out, mover: std::marker::PhantomData };
        input.path.run(pass);
    };
    let vertices = posed.len();
    if vertices < PARALLEL_FROM {
        posed.chunks_mut(SHARE).enumerate().for_each(share);
    } else {
        threads::each(posed.chunks_mut(SHARE).enumerate(), vertices / PARALLEL_FROM, share);
    }
}

struct Pass<'a, const GROUPS: usize, M> {
    table: &'a [Row<GROUPS>],
    input: &'a SkinningInput<'a>,
    first: usize,
    out: &'a mut [[f32; 3]],
    mover: std::marker::PhantomData<M>,
}

impl<const GROUPS: usize, M: Mover<GROUPS>> Kernel for Pass<'_, GROUPS, M> {
    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let lanes = lanes.short();
        let mut rows = [[[0.0f32; 4]; GROUPS]; BLOCK];
        for (block, out) in self.out.chunks_mut(BLOCK).enumerate() {
            let first = self.first + block * BLOCK;
            blend_block::<_, GROUPS, M>(lanes, self.table, self.input.weights, first, &mut rows[..out.len()]);
            move_block::<_, GROUPS, M>(lanes, self.input, first, &rows, out);
        }
    }
}

#[inline(always)]
fn blend_block<L: Lanes, const GROUPS: usize, M: Mover<GROUPS>>(
    lanes: L,
    table: &[Row<GROUPS>],
    weights: &FrameWeights,
    first: usize,
    rows: &mut [Row<GROUPS>],
) {
    let (entries, parts) = weights.quads(M::PAIRS);
    if weights.several(first).is_none() {
        let quads = entries[first..].chunks_exact(1).zip(parts[first..].chunks_exact(1));
        for (row, (entries, parts)) in rows.iter_mut().zip(quads) {
            blend(lanes, table, entries, parts, row);
        }
        return;
    }
    for (i, row) in rows.iter_mut().enumerate() {
        let of = weights.several(first + i).unwrap_or_default();
        blend(lanes, table, &entries[of.clone()], &parts[of], row);
    }
}

/// Writes the sum of the rows that the `entries` of quads name, by their weights.
#[inline(always)]
fn blend<L: Lanes, const GROUPS: usize>(
    lanes: L,
    table: &[Row<GROUPS>],
    entries: &[Entries],
    parts: &[Weights],
    row: &mut Row<GROUPS>,
) {
    // A row is up to eight vectors; those beyond it are never made.
    let vectors = GROUPS * 4 / L::F32_LANES;
    let mut sums = [lanes.splat_f32s(0.0); 8];
    for (entries, parts) in entries.iter().zip(parts) {
        for (entry, weight) in entries.iter().zip(parts) {
            let numbers = L::as_simd_f32s(table[*entry as usize].as_flattened()).0;
            let weight = lanes.splat_f32s(*weight);
            for v in 0..vectors {
                sums[v] = lanes.fused(weight, numbers[v], sums[v]);
            }
        }
    }
    let row = L::as_mut_simd_f32s(row.as_flattened_mut()).0;
    row.copy_from_slice(&sums[..vectors]);
}

#[inline(always)]
fn move_block<L: Lanes, const GROUPS: usize, M: Mover<GROUPS>>(
    lanes: L,
    input: &SkinningInput,
    first: usize,
    rows: &[Row<GROUPS>; BLOCK],
    out: &mut [[f32; 3]],
) {
    let count = out.len();
    let rest = &input.rest_skin[first..][..count];
    let centers = if M::CENTERS { &input.centers[first..][..count] } else { rest };
    if count == BLOCK {
        move_whole::<_, GROUPS, M>(lanes, rest, centers, rows, out);
        return;
    }
    let mut padded = [[[0.0f32; 3]; BLOCK]; 3];
    padded[0][..count].copy_from_slice(rest);
    padded[1][..count].copy_from_slice(centers);
    let [rest, centers, moved] = &mut padded;
    move_whole::<_, GROUPS, M>(lanes, rest, centers, rows, moved);
    out.copy_from_slice(&moved[..count]);
}

#[inline(always)]
fn move_whole<L: Lanes, const GROUPS: usize, M: Mover<GROUPS>>(
    lanes: L,
    rest: &[[f32; 3]],
    centers: &[[f32; 3]],
    rows: &[Row<GROUPS>; BLOCK],
    out: &mut [[f32; 3]],
) {
    let (rest, centers, out) = (rest.as_flattened(), centers.as_flattened(), out.as_flattened_mut());
    for at in (0..BLOCK).step_by(L::F32_LANES) {
        let v = lanes.load_points(&rest[3 * at..]);
        let p = if M::CENTERS { lanes.load_points(&centers[3 * at..]) } else { v };
        let rows = &rows[at..at + L::F32_LANES];
        let moved = M::moved(lanes, rows, v, p);
        lanes.store_points(&mut out[3 * at..], moved);
    }
}
