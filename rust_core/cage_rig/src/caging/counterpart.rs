//! Which arc of a skeleton is which chain of a template, and which way round.
//!
//! A chain and an arc that end alike (at a leaf or a branch) are compared by how far their lines are
//! apart; the nearest two go together first. Then branches must correspond too. Arcs that are left over
//! at leaves are left out of the skeleton. Quadratic in the arcs.

use super::report::SectionReport;
use super::skeleton::{Arc, CurveSkeleton, Junction};
use super::template::{Chain, End, Pattern};
use super::GeneratedCage;
use crate::error::CagingError;
use crate::points::Point;

/// For each arc of an arranged skeleton the number of the arc that it was, from 1, negative where it is turned.
pub(crate) type Arrangement = Vec<i64>;

/// No counterpart is farther away than this, relative to the size.
const FAR: f64 = 0.2;
/// No longer arc is given up to make two branching nodes one.
const SHORT: f64 = 0.1;

/// What a skeleton has for the chains of a template.
pub(crate) enum Match {
    /// All arcs, and how far they are from their chains on average.
    All(Arrangement, f64),
    /// The tip (a node of the input) of a leaf that the template lacks, and the section nearest to it.
    Left(usize, usize),
    /// A short arc between two branching nodes that are one in the template.
    Short(usize),
}

impl GeneratedCage {
    /// Generated along an arranged skeleton: says so, and counts arcs as they were.
    pub(super) fn arranged(mut self, arrangement: Option<&[i64]>) -> Self {
        if let Some(arrangement) = arrangement {
            as_before(&mut self.report.sections, arrangement);
            self.report.arrangement = Some(arrangement.to_vec());
        }
        self
    }
}

/// Sections count the arcs as they were.
pub(crate) fn as_before(sections: &mut [SectionReport], arrangement: &[i64]) {
    for section in sections {
        let own = arrangement.get(section.arc).map_or(1, |arc| arc.unsigned_abs());
        section.arc = own.saturating_sub(1) as usize;
    }
}

/// The arcs in the order and direction of an arrangement; `None` where it is of another skeleton.
pub(crate) fn rearranged(skeleton: &CurveSkeleton, arrangement: &[i64]) -> Option<CurveSkeleton> {
    let mut arcs = Vec::new();
    for (k, &own) in arrangement.iter().enumerate() {
        let number = usize::try_from(own.unsigned_abs()).ok()?;
        let is_new = arrangement[..k].iter().all(|other| other.unsigned_abs() != own.unsigned_abs());
        let mut arc = skeleton.arcs.get(number.checked_sub(1)?).filter(|_| is_new)?.clone();
        if own < 0 {
            arc.turn();
        }
        arcs.push(arc);
    }
    (arcs.len() == skeleton.arcs.len()).then(|| CurveSkeleton { arcs, ..skeleton.clone() })
}

/// Without an arc: its ends are one branching node, half way between.
pub(crate) fn contracted(mut skeleton: CurveSkeleton, arc: usize) -> CurveSkeleton {
    let Arc { ends: [one, other], .. } = skeleton.arcs.remove(arc);
    let [first, second] = [one, other].map(|end| skeleton.junctions[end].clone());
    skeleton.junctions[one].point = (first.point + second.point) * 0.5;
    skeleton.junctions[one].degree = (first.degree + second.degree).saturating_sub(2);
    for end in skeleton.arcs.iter_mut().flat_map(|arc| &mut arc.ends).filter(|end| **end == other) {
        *end = one;
    }
    skeleton
}

/// The arcs that take the place of the chains.
pub(crate) fn counterparts(skeleton: &CurveSkeleton, pattern: &Pattern) -> Result<Match, CagingError> {
    let chains = &pattern.chains;
    let mut pairs = Vec::new();
    for (c, chain) in chains.iter().enumerate() {
        for (a, arc) in skeleton.arcs.iter().enumerate() {
            for turned in [false, true] {
                if let Some(apart) = apart(skeleton, pattern, chain, (arc, turned)) {
                    pairs.push((apart, c, a, turned));
                }
            }
        }
    }
    pairs.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut of_chain = vec![None; chains.len()];
    let mut taken = vec![false; skeleton.arcs.len()];
    let mut sum = 0.0;
    for (apart, c, a, turned) in pairs {
        if of_chain[c].is_none() && !taken[a] {
            of_chain[c] = Some((a, turned));
            taken[a] = true;
            sum += apart;
        }
    }
    // A leaf that the template lacks may have cut an arc in two: it goes before anything is judged.
    let tip = |a: usize| {
        let tip = skeleton.arcs[a].ends.into_iter().find(|e| skeleton.junctions[*e].degree == 1)?;
        let Junction { point, node, .. } = &skeleton.junctions[tip];
        let apart = |s: &usize| (pattern.center(*s) - point).norm();
        let near = (0..pattern.sections()).min_by(|s, t| apart(s).total_cmp(&apart(t)))?;
        Some(Match::Left(*node, near))
    };
    if let Some(left) = (0..taken.len()).filter(|a| !taken[*a]).find_map(tip) {
        return Ok(left);
    }
    let is_short = |a: &usize| !taken[*a] && skeleton.arcs[*a].length() < SHORT;
    let of_branches = |a: &usize| skeleton.arcs[*a].ends[0] != skeleton.arcs[*a].ends[1];
    let short = (0..taken.len()).filter(is_short).find(of_branches);
    if let Some(short) = short.filter(|_| skeleton.arcs.len() > chains.len()) {
        return Ok(Match::Short(short));
    }
    let lacks = |c: usize| CagingError::Unlike { section: pattern.chains[c].first };
    let mut found: Vec<(usize, bool)> = Vec::new();
    for (c, pair) in of_chain.iter().enumerate() {
        found.push(pair.ok_or_else(|| lacks(c))?);
    }
    // Chains of one branch are arcs of one junction.
    let mut junction = vec![None; pattern.branches.len()];
    for (c, &(a, turned)) in found.iter().enumerate() {
        for (k, end) in chains[c].ends.iter().enumerate() {
            let End::Branch(branch) = end else { continue };
            let own = skeleton.arcs[a].ends[if turned { 1 - k } else { k }];
            if *junction[*branch].get_or_insert(own) != own {
                return Err(lacks(c));
            }
        }
    }
    if taken.contains(&false) {
        return Err(CagingError::Unlike { section: 0 });
    }
    let number = |(a, turned): &(usize, bool)| (*a as i64 + 1) * if *turned { -1 } else { 1 };
    Ok(Match::All(found.iter().map(number).collect(), sum / chains.len() as f64))
}

/// How far an arc is from a chain; `None` where they end differently.
fn apart(
    skeleton: &CurveSkeleton,
    pattern: &Pattern,
    chain: &Chain,
    (arc, turned): (&Arc, bool),
) -> Option<f64> {
    let mut line: Vec<Point> = chain.sections().map(|s| pattern.center(s)).collect();
    let mut sum = 0.0;
    for k in 0..2 {
        let junction = &skeleton.junctions[arc.ends[if turned { 1 - k } else { k }]];
        match chain.ends[k] {
            End::Leaf if junction.degree == 1 => {
                let last = line[if k == 0 { 0 } else { line.len() - 1 }];
                sum += 0.5 * (junction.point - last).norm();
            }
            End::Branch(branch) if junction.degree > 1 => {
                let middle = pattern.branches[branch];
                sum += (junction.point - middle).norm();
                line.insert(if k == 0 { 0 } else { line.len() }, middle);
            }
            _ => return None,
        }
    }
    let centers: Vec<f64> = chain.sections().map(|s| arc.nearest(&pattern.center(s)).0).collect();
    sum += centers.iter().sum::<f64>() / centers.len() as f64;
    let samples = (1..=8).map(|k| arc.at(arc.length() * f64::from(k) / 9.0));
    sum += samples.map(|p| to_line(&p, &line)).sum::<f64>() / 8.0;
    (sum < 4.0 * FAR).then_some(sum)
}

/// Distance of a point from a polyline.
fn to_line(p: &Point, line: &[Point]) -> f64 {
    let to_piece = |piece: &[Point]| {
        let way = piece[1] - piece[0];
        let t = ((p - piece[0]).dot(&way) / way.norm_squared().max(1e-300)).clamp(0.0, 1.0);
        (piece[0] + way * t - p).norm()
    };
    let own = line.first().map_or(f64::INFINITY, |q| (p - q).norm());
    line.windows(2).map(to_piece).fold(own, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A letter H: two arcs at each of two branching nodes, and a short one between these.
    fn letter() -> CurveSkeleton {
        let junction =
            |x: f64, y: f64, degree| Junction { point: Point::new(x, y, 0.0), radius: 1.0, node: 0, degree };
        let junctions = vec![
            junction(0.0, 0.0, 3),
            junction(0.05, 0.0, 3),
            junction(0.0, 1.0, 1),
            junction(0.0, -1.0, 1),
            junction(0.05, 1.0, 1),
            junction(0.05, -1.0, 1),
        ];
        let arc = |ends: [usize; 2]| {
            let path: Vec<Point> = ends.map(|end| junctions[end].point).to_vec();
            let along = vec![0.0, (path[1] - path[0]).norm()];
            Arc { ends, path, along, radii: vec![1.0; 2], nodes: vec![None; 2] }
        };
        let arcs = [[0, 2], [3, 0], [0, 1], [1, 4], [1, 5]].map(arc).to_vec();
        CurveSkeleton { junctions, arcs, dropped: Vec::new() }
    }

    #[test]
    fn arcs_come_in_another_order_and_direction() {
        let found = rearranged(&letter(), &[3, -2, 5, 4, -1]).expect("every arc once");
        let ends: Vec<[usize; 2]> = found.arcs.iter().map(|arc| arc.ends).collect();
        assert_eq!(ends, [[0, 1], [0, 3], [1, 5], [1, 4], [2, 0]]);
        assert_eq!(found.arcs[1].path[0], letter().junctions[0].point);
        for wrong in
            [&[3, -2, 5, 4][..], &[3, 3, 5, 4, 1], &[3, -3, 5, 4, 1], &[6, 2, 5, 4, 1], &[0, 2, 5, 4, 1]]
        {
            assert!(rearranged(&letter(), wrong).is_none(), "{wrong:?}");
        }
    }

    #[test]
    fn two_branching_nodes_become_one() {
        let found = contracted(letter(), 2);
        assert_eq!(found.arcs.len(), 4);
        assert!(found.arcs.iter().all(|arc| arc.ends.contains(&0)));
        assert_eq!((found.junctions[0].degree, found.junctions[0].point.x), (4, 0.025));
    }
}
