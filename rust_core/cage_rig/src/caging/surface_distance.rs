//! Distances along the edges of a surface.

use super::symmetry;
use crate::points::Point;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Vertices that stand for all of the surface.
const SAMPLES: usize = 40;
/// Rounds of smoothing of a distance, which runs along edges, before it is cut.
const SMOOTHING: usize = 20;

/// The vertices that each is joined to.
pub(super) fn neighbours(count: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut found = vec![Vec::new(); count];
    for t in triangles {
        for k in 0..3 {
            found[t[k] as usize].push(t[(k + 1) % 3]);
        }
    }
    found
}

/// Distances along edges from the nearest of the vertices `starts`; infinite on other parts of the
/// surface.
pub(super) fn along_edges(points: &[Point], around: &[Vec<u32>], starts: &[usize]) -> Vec<f64> {
    let mut best = vec![f64::INFINITY; points.len()];
    let mut heap: BinaryHeap<_> = starts.iter().map(|start| Reverse((0_u64, *start))).collect();
    starts.iter().for_each(|start| best[*start] = 0.0);
    while let Some(Reverse((bits, v))) = heap.pop() {
        if f64::from_bits(bits) > best[v] {
            continue;
        }
        for w in around[v].iter().map(|w| *w as usize) {
            let length = best[v] + (points[w] - points[v]).norm();
            if length < best[w] {
                best[w] = length;
                // Distances are not negative, so their bits are in order.
                heap.push(Reverse((length.to_bits(), w)));
            }
        }
    }
    best
}

fn farthest(distance: &[f64]) -> usize {
    let finite = (0..distance.len()).filter(|v| distance[*v].is_finite());
    finite.max_by(|a, b| distance[*a].total_cmp(&distance[*b]).then(b.cmp(a))).unwrap_or(0)
}

/// A far end of the largest part, on a symmetric skin also its mirror image unless that is at the
/// other end.
pub(super) fn far_ends(points: &[Point], around: &[Vec<u32>], symmetric: bool) -> Vec<usize> {
    let mut seen = vec![false; points.len()];
    let mut largest = (0, 0);
    for start in (0..points.len()).filter(|v| !around[*v].is_empty()) {
        if !seen[start] {
            let of_part = along_edges(points, around, &[start]);
            let count = of_part.iter().filter(|d| d.is_finite()).count();
            seen.iter_mut().zip(&of_part).for_each(|(s, d)| *s |= d.is_finite());
            largest = largest.max((count, start));
        }
    }
    let reached = along_edges(points, around, &[largest.1]);
    let mut ends = vec![farthest(&reached)];
    if symmetric {
        ends.extend(nearest_to_image(points, &reached, ends[0]));
        let first = along_edges(points, around, &ends[..1]);
        let far = first[farthest(&first)];
        ends.retain(|v| first[*v] < 0.5 * far);
    }
    ends
}

/// The vertex where the mirror image of vertex `of` is, among those that are `reached`.
fn nearest_to_image(points: &[Point], reached: &[f64], of: usize) -> Option<usize> {
    let image = symmetry::image(&points[of]);
    let apart = |v: usize| (points[v] - image).norm_squared();
    let part = (0..points.len()).filter(|v| reached[*v].is_finite());
    part.min_by(|a, b| apart(*a).total_cmp(&apart(*b)))
}

/// The mean distance from vertices all over the part of `ends`, those farthest from all before them (on
/// a symmetric skin with their images), less the least one; infinite elsewhere.
pub(super) fn mean_distance(
    points: &[Point],
    around: &[Vec<u32>],
    ends: &[usize],
    symmetric: bool,
) -> Vec<f64> {
    let mut nearest = vec![f64::INFINITY; points.len()];
    let mut sum = vec![0.0; points.len()];
    let (mut next, mut count) = (ends.to_vec(), 0);
    while count < SAMPLES {
        for start in &next {
            let distance = along_edges(points, around, &[*start]);
            sum.iter_mut().zip(&distance).for_each(|(sum, d)| *sum += d);
            nearest.iter_mut().zip(&distance).for_each(|(least, d)| *least = least.min(*d));
        }
        count += next.len();
        next = vec![farthest(&nearest)];
        if symmetric {
            next.extend(nearest_to_image(points, &nearest, next[0]).filter(|v| *v != next[0]));
        }
    }
    let least = sum.iter().copied().fold(f64::INFINITY, f64::min);
    sum.iter().map(|sum| (sum - least) / count as f64).collect()
}

/// Evens out a distance that runs along edges.
pub(super) fn smooth(distance: &mut [f64], around: &[Vec<u32>]) {
    for _ in 0..SMOOTHING {
        let old = distance.to_vec();
        for (v, near) in around.iter().enumerate().filter(|(_, near)| !near.is_empty()) {
            let sum: f64 = near.iter().map(|w| old[*w as usize]).sum();
            distance[v] = 0.5 * (old[v] + sum / near.len() as f64);
        }
    }
}
