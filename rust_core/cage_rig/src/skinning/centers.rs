//! Centers of rotation: for every vertex the middle of the skin that moves like it.
//!
//! Based on [LH16], Eq. (5) of [CTL*20]: p_i = ∫ s(ω_i, ω_x) x dx / ∫ s(ω_i, ω_x) dx, with
//! s(a, b) = Σ_{j<k} a_j a_k b_j b_k exp(−(a_j b_k − a_k b_j)² / σ²), integrated over triangles by
//! their area, mean weights and mean position. Kept as a matrix, Λ = Φ_CoR Φ: integrated are rows
//! of Φ in place of positions. A vertex of one bone, of none, or without area has itself as center:
//! its row of Φ.
//!
//! s sums over pairs of bones, and for a pair only the triangle's two weights count. So triangles
//! are gathered by pair, then in square bins of those two weights, each standing for its triangles by
//! mean, variance and how values lean with the weights. Cost: bins of its pairs per vertex.
//!
//! | bins | error on the Arm | and on a snake | seconds for the snake |
//! | --- | --- | --- | --- |
//! | 16 | 0.19 %, 0.8 % | 0.02 %, 0.08 % | 2.4 |
//! | 32 | 0.04 %, 0.27 % | 0.005 %, 0.01 % | 3.6 |
//! | 64 | 0.01 %, 0.04 % | 0.002 %, 0.006 % | 6.0 |
//!
//! Errors (mean, worst) are against the plain integral, over the standard deviation of what moves
//! alike. The snake has 119,802 vertices, 98 bones and 44 cage vertices; two busy cores.

use super::PackedWeights;
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

/// How centers are integrated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CenterOptions {
    /// σ of the kernel; 0.1 as in [LH16].
    pub sigma: f64,
    /// Bins per unit of weight, see the table above; 0 takes every triangle for itself, exact and slow.
    pub bins: u32,
}

impl Default for CenterOptions {
    fn default() -> Self {
        Self { sigma: 0.1, bins: 32 }
    }
}

/// With bins, influences of a triangle or vertex beyond the largest of this many are left out.
const INFLUENCES: usize = 8;
/// Sources that together are less than this part of the integral are left out.
const NEGLIGIBLE: f64 = 1e-7;
/// Vertices that one thread works on at a time.
const CHUNK: usize = 256;

/// Integrates `values` (`#M by k`: Φ for Λ, or positions for the centers themselves) around every
/// vertex. `positions`: M₀ (`#M by 3`), for the areas; `triangles`: of the skin.
pub fn centers(
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    weights: &PackedWeights,
    values: &Rows,
    options: &CenterOptions,
    part: &Part,
) -> Result<Rows, Cancelled> {
    let [gathering, integrating] = part.split([1.0, 7.0]);
    let sources = Sources::new(positions, triangles, weights, values, options, &gathering)?;
    let width = values.columns();
    let vertices = integrating.count(values.len());
    let mut out = values.clone();
    let most = options.most_influences();
    out.as_mut_slice().par_chunks_mut(CHUNK * width.max(1)).enumerate().try_for_each_init(
        Vec::new,
        |scratch, (chunk, rows)| {
            for (i, row) in rows.chunks_exact_mut(width).enumerate() {
                let influences = largest(weights.row(CHUNK * chunk + i).iter().copied(), most);
                sources.integrate(&influences, options.sigma, scratch, row);
            }
            vertices.step(rows.len() / width)
        },
    )?;
    Ok(out)
}

impl CenterOptions {
    fn most_influences(&self) -> usize {
        if self.bins == 0 {
            usize::MAX
        } else {
            INFLUENCES
        }
    }
}

/// Triangles that one thread looks at at a time.
const SEEN_AT_ONCE: usize = 4096;

/// A triangle seen by one pair of its bones.
#[derive(Clone, Copy)]
struct Entry {
    pair: (u32, u32),
    bin: (u32, u32),
    triangle: u32,
    /// The two weights.
    weights: [f64; 2],
}

/// A bin of a pair, or one of its triangles.
struct Source {
    /// b_j, b_k, in the mean.
    weights: [f64; 2],
    /// Their variances and covariance within the bin.
    spread: [f64; 3],
    /// b_j b_k, where the target is not weighted by it already.
    factor: f64,
    /// Row of `values` and entry of `masses`.
    target: u32,
}

/// All there is to integrate over.
struct Sources {
    pairs: HashMap<(u32, u32), Range<usize>>,
    list: Vec<Source>,
    /// ∫ dx of a target.
    masses: Vec<f64>,
    /// Of a target, one after the other: ∫ value dx, ∫ value (b_j − mean) dx, ∫ value (b_k − mean) dx.
    values: Rows,
}

/// What a source adds to the integral of a vertex: multiples of the three parts of its target.
struct Term {
    target: usize,
    parts: [f64; 3],
}

/// A triangle of a target and its three masses, as of `Sources::values`.
type Member = (usize, [f64; 3]);

impl Sources {
    fn new(
        positions: &[[f32; 3]],
        triangles: &[[u32; 3]],
        weights: &PackedWeights,
        values: &Rows,
        options: &CenterOptions,
        part: &Part,
    ) -> Result<Self, Cancelled> {
        let [seeing, binning, summing] = part.split([1.0, 2.0, 6.0]);
        let areas: Vec<f64> = triangles.iter().map(|corners| area(positions, corners)).collect();
        let seen = see(triangles, &areas, weights, options, &seeing)?;
        let entries = binning.count(seen.values().map(Vec::len).sum());
        let binned = seen
            .into_par_iter()
            .map(|(pair, mut group)| {
                group.par_sort_unstable_by_key(|entry| (entry.bin, entry.triangle));
                entries.step(group.len())?;
                Ok((pair, sources_of(&group, &areas, options.bins)))
            })
            .collect::<Result<Vec<_>, Cancelled>>()?;
        let (mut pairs, mut list, mut targets) = (HashMap::new(), Vec::new(), Vec::new());
        for (pair, found) in binned {
            pairs.insert(pair, list.len()..list.len() + found.len());
            for (mut source, members) in found {
                if options.bins > 0 {
                    source.target = targets.len() as u32;
                    targets.push(members);
                }
                list.push(source);
            }
        }
        if options.bins == 0 {
            targets = areas.iter().enumerate().map(|(t, area)| vec![(t, [*area, 0.0, 0.0])]).collect();
        }
        let values = sums(&targets, triangles, values, &summing)?;
        let masses =
            targets.iter().map(|members| members.iter().map(|(_, masses)| masses[0]).sum()).collect();
        Ok(Self { pairs, list, masses, values })
    }

    /// Writes the value at the center of a vertex; leaves it where there is nothing to integrate.
    fn integrate(&self, influences: &[(u32, f64)], sigma: f64, terms: &mut Vec<Term>, row: &mut [f64]) {
        terms.clear();
        for (pair, weights) in pairs(influences) {
            let sources = self.pairs.get(&pair).map_or(&[][..], |range| &self.list[range.clone()]);
            terms.extend(sources.iter().map(|source| source.term(weights, sigma * sigma)));
        }
        let mass = |term: &Term| term.parts[0] * self.masses[term.target];
        let total: f64 = terms.iter().map(mass).sum();
        if total <= 0.0 {
            return;
        }
        let least = NEGLIGIBLE * total / terms.len() as f64;
        terms.retain(|term| mass(term) >= least);
        let kept: f64 = terms.iter().map(mass).sum();
        row.fill(0.0);
        for term in terms.iter() {
            let values = self.values.row(term.target).chunks_exact(row.len());
            for (part, value) in term.parts.iter().zip(values).filter(|(part, _)| **part != 0.0) {
                add(row, part / kept, value);
            }
        }
    }
}

impl Source {
    /// The kernel of a vertex whose two weights are `a` and `b`. Within the bin a b_k − b b_j is taken
    /// as normally distributed for the mean of the kernel, and the kernel as a line for the values.
    fn term(&self, [a, b]: [f64; 2], variance: f64) -> Term {
        let apart = a * self.weights[1] - b * self.weights[0];
        let [jj, kk, jk] = self.spread;
        let widened = variance + 2.0 * (a * a * kk + b * b * jj - 2.0 * a * b * jk).max(0.0);
        let share = a * b * self.factor * (variance / widened).sqrt() * (-apart * apart / widened).exp();
        let slope = -2.0 * apart / widened * share;
        Term { target: self.target as usize, parts: [share, -b * slope, a * slope] }
    }
}

fn add(sum: &mut [f64], factor: f64, values: &[f64]) {
    sum.iter_mut().zip(values).for_each(|(sum, x)| *sum += factor * x);
}

/// Every triangle as the pairs of its bones see it, by pair.
fn see(
    triangles: &[[u32; 3]],
    areas: &[f64],
    weights: &PackedWeights,
    options: &CenterOptions,
    part: &Part,
) -> Result<BTreeMap<(u32, u32), Vec<Entry>>, Cancelled> {
    let count = part.count(triangles.len());
    let chunks = triangles.par_chunks(SEEN_AT_ONCE).enumerate().map(|(chunk, corners)| {
        let mut entries = Vec::new();
        for (k, corners) in corners.iter().enumerate() {
            let triangle = SEEN_AT_ONCE * chunk + k;
            if areas[triangle] > 0.0 {
                let influences = corners.iter().flat_map(|&v| weights.row(v as usize));
                let mean = largest(influences.map(|&(j, w)| (j, w / 3.0)), options.most_influences());
                entries
                    .extend(pairs(&mean).map(|(pair, weights)| entry(pair, weights, triangle, options.bins)));
            }
        }
        entries.sort_unstable_by_key(|entry| (entry.pair, entry.bin, entry.triangle));
        count.step(corners.len())?;
        Ok(entries)
    });
    let mut seen: BTreeMap<_, Vec<Entry>> = BTreeMap::new();
    for entries in chunks.collect::<Result<Vec<_>, Cancelled>>()? {
        part.check()?;
        for group in entries.chunk_by(|a, b| a.pair == b.pair) {
            seen.entry(group[0].pair).or_default().extend_from_slice(group);
        }
    }
    Ok(seen)
}

fn entry(pair: (u32, u32), weights: [f64; 2], triangle: usize, bins: u32) -> Entry {
    let [a, b] = weights.map(|w| (w * f64::from(bins)) as u32);
    Entry { pair, bin: (a, b), triangle: triangle as u32, weights }
}

/// The sources of a pair: its bins, each with what it gathers, or its triangles, whose targets are known.
fn sources_of(group: &[Entry], areas: &[f64], bins: u32) -> Vec<(Source, Vec<Member>)> {
    if bins == 0 {
        return group.iter().map(source_of_triangle).collect();
    }
    group.chunk_by(|a, b| a.bin == b.bin).map(|bin| source_of_bin(bin, areas)).collect()
}

fn source_of_triangle(entry: &Entry) -> (Source, Vec<Member>) {
    let factor = entry.weights[0] * entry.weights[1];
    let source = Source { weights: entry.weights, spread: [0.0; 3], factor, target: entry.triangle };
    (source, Vec::new())
}

/// One source for a whole bin, and what it gathers: triangles with their mass area b_j b_k.
fn source_of_bin(group: &[Entry], areas: &[f64]) -> (Source, Vec<Member>) {
    let mass = |e: &Entry| areas[e.triangle as usize] * e.weights[0] * e.weights[1];
    let total: f64 = group.iter().map(mass).sum();
    let mean = |of: &dyn Fn(&Entry) -> f64| group.iter().map(|e| mass(e) * of(e)).sum::<f64>() / total;
    let weights = [0, 1].map(|k| mean(&|e| e.weights[k]));
    let off = |e: &Entry| [e.weights[0] - weights[0], e.weights[1] - weights[1]];
    let spread = [(0, 0), (1, 1), (0, 1)].map(|(k, l)| mean(&|e| off(e)[k] * off(e)[l]));
    let member = |e: &Entry| {
        let (mass, [j, k]) = (mass(e), off(e));
        (e.triangle as usize, [mass, mass * j, mass * k])
    };
    let source = Source { weights, spread, factor: 1.0, target: 0 };
    (source, group.iter().map(member).collect())
}

/// What each target gathers of `values`, as of [`Sources::values`].
fn sums(
    targets: &[Vec<Member>],
    triangles: &[[u32; 3]],
    values: &Rows,
    part: &Part,
) -> Result<Rows, Cancelled> {
    let width = values.columns().max(1);
    let mut sums = Rows::zeros(targets.len(), 3 * values.columns());
    let count = part.count(targets.iter().map(Vec::len).sum());
    sums.as_mut_slice().par_chunks_mut(3 * width).zip(targets).try_for_each(|(parts, members)| {
        for (triangle, masses) in members {
            for &corner in &triangles[*triangle] {
                for (part, mass) in parts.chunks_exact_mut(width).zip(masses) {
                    add(part, mass / 3.0, values.row(corner as usize));
                }
            }
        }
        count.step(members.len())
    })?;
    Ok(sums)
}

fn area(positions: &[[f32; 3]], corners: &[u32; 3]) -> f64 {
    let [a, b, c] = corners.map(|v| nalgebra::Vector3::from(positions[v as usize].map(f64::from)));
    (b - a).cross(&(c - a)).norm() / 2.0
}

/// The `most` largest influences, those of the same joint added up, by joint.
fn largest(influences: impl Iterator<Item = (u32, f32)>, most: usize) -> Vec<(u32, f64)> {
    let mut sums: Vec<(u32, f64)> = Vec::new();
    for (joint, weight) in influences {
        match sums.iter_mut().find(|(j, _)| *j == joint) {
            Some((_, sum)) => *sum += f64::from(weight),
            None => sums.push((joint, f64::from(weight))),
        }
    }
    sums.sort_unstable_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    sums.truncate(most);
    sums.sort_unstable_by_key(|(joint, _)| *joint);
    sums
}

/// Every pair of bones and their two weights.
fn pairs(influences: &[(u32, f64)]) -> impl Iterator<Item = ((u32, u32), [f64; 2])> + '_ {
    let pair = |a: &(u32, f64), b: &(u32, f64)| ((a.0, b.0), [a.1, b.1]);
    influences.iter().enumerate().flat_map(move |(k, a)| influences[k + 1..].iter().map(move |b| pair(a, b)))
}
