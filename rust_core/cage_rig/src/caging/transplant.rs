//! The vertices and faces of an earlier cage under the sections of an edit.
//!
//! The earlier faces stay: a strip between two sections is cut where new ones come in, so that the
//! surface, which crosses nothing, is where it was; the two strips of a section that was removed
//! become one. Linear in the faces, for each section that comes or goes.

use super::control_nodes::ControlNode;
use super::lineage::Lineage;
use super::sections::Section;
use super::tubes::{Axis, Scaffold, BEYOND};
use crate::points::Point;

/// A cage as rings of as many vertices each, section after section, and faces that join them.
#[derive(Debug, Clone)]
pub(crate) struct Rings {
    /// Vertices of a ring.
    pub(crate) count: usize,
    pub(crate) vertices: Vec<Point>,
    /// Outward.
    pub(crate) faces: Vec<Vec<u32>>,
    /// For each arc of the skeleton its sections in order.
    pub(crate) chains: Vec<Vec<usize>>,
}

/// The faces between two rings, as quads that leave the surface as it is.
struct Strip {
    faces: Vec<usize>,
    /// Two neighbours of the one ring, then the opposite two of the other.
    quads: Vec<[u32; 4]>,
}

/// Between two others: a vertex of a section that goes.
pub(crate) type Link = (u32, [u32; 2]);

impl Rings {
    pub(crate) fn new(
        vertices: Vec<Point>,
        faces: Vec<Vec<u32>>,
        nodes: &[ControlNode],
        count: usize,
    ) -> Self {
        let arcs = nodes.iter().map(|n| n.arc + 1).max().unwrap_or(0);
        let mut chains = vec![Vec::new(); arcs];
        for (at, node) in nodes.iter().enumerate() {
            chains[node.arc].push(at);
        }
        Self { count, vertices, faces, chains }
    }

    pub(crate) fn owner(&self, vertex: u32) -> usize {
        vertex as usize / self.count
    }

    fn on(&self, section: usize, k: usize) -> u32 {
        (section * self.count + k % self.count) as u32
    }

    /// The strip from ring `a` to ring `b`; `None` where other faces join them. Two triangles may stand
    /// for a quad, also where the strip can be read in two ways.
    fn strip(&self, a: usize, b: usize) -> Option<Strip> {
        let joins = |face: &&Vec<u32>| {
            let owners = |s: usize| face.iter().any(|v| self.owner(*v) == s);
            owners(a) && owners(b)
        };
        let (faces, found): (Vec<usize>, Vec<&Vec<u32>>) =
            self.faces.iter().enumerate().filter(|(_, face)| joins(face)).unzip();
        if found.iter().map(|face| face.len() - 2).sum::<usize>() != 2 * self.count {
            return None;
        }
        let quad = |k: usize, turn: usize| {
            [self.on(a, k), self.on(a, k + 1), self.on(b, k + 1 + turn), self.on(b, k + turn)]
        };
        let fits = |turn: &usize| {
            let within =
                |face: &&Vec<u32>| (0..self.count).any(|k| face.iter().all(|v| quad(k, *turn).contains(v)));
            found.iter().all(within)
        };
        let length = |turn: usize| {
            let edge = |k: usize| (self.at(self.on(a, k)) - self.at(self.on(b, k + turn))).norm_squared();
            (0..self.count).map(edge).sum::<f64>()
        };
        let turn = (0..self.count).filter(fits).min_by(|s, t| length(*s).total_cmp(&length(*t)))?;
        let (p, q) = (self.on(a, 0), self.on(a, 1));
        let goes =
            |face: &&Vec<u32>| (0..face.len()).any(|k| (face[k], face[(k + 1) % face.len()]) == (p, q));
        let forward = found.iter().any(goes);
        let outward = |k: usize| {
            let [p, q, r, s] = quad(k, turn);
            if forward {
                [p, q, r, s]
            } else {
                [q, p, s, r]
            }
        };
        Some(Strip { faces, quads: (0..self.count).map(outward).collect() })
    }

    fn at(&self, vertex: u32) -> &Point {
        &self.vertices[vertex as usize]
    }

    fn beside(&self, section: usize) -> Option<(usize, usize, [usize; 2])> {
        let (arc, k) = self
            .chains
            .iter()
            .enumerate()
            .find_map(|(arc, chain)| chain.iter().position(|s| *s == section).map(|k| (arc, k)))?;
        let chain = &self.chains[arc];
        Some((arc, k, [*chain.get(k.checked_sub(1)?)?, *chain.get(k + 1)?]))
    }

    /// The vertices of sections that go, each with its two neighbours along the arc; `None` where a
    /// section has not two.
    pub(crate) fn links(&self, gone: &[usize]) -> Option<Vec<Link>> {
        let mut found = Vec::new();
        for section in gone {
            let (_, _, ends) = self.beside(*section)?;
            let [before, after] = ends.map(|end| self.strip(*section, end));
            let opposite = |strip: &Strip, v: u32| {
                let near = |quad: &[u32; 4]| (0..2).find(|k| quad[*k] == v).map(|k| quad[3 - k]);
                strip.quads.iter().find_map(near)
            };
            let (before, after) = (before?, after?);
            for k in 0..self.count {
                let v = self.on(*section, k);
                found.push((v, [opposite(&before, v)?, opposite(&after, v)?]));
            }
        }
        Some(found)
    }

    fn replace(&mut self, gone: &[usize], new: Vec<Vec<u32>>) {
        let mut at = 0;
        self.faces.retain(|_| {
            at += 1;
            !gone.contains(&(at - 1))
        });
        self.faces.extend(new);
    }

    /// Without the faces of a section: one strip instead of two. Its vertices stay, unused.
    fn remove(&mut self, section: usize) -> Option<()> {
        let (arc, k, [before, after]) = self.beside(section)?;
        let (near, far) = (self.strip(before, section)?, self.strip(section, after)?);
        let beyond = |v: u32| {
            let opposite = |quad: &[u32; 4]| (0..2).find(|k| quad[*k] == v).map(|k| quad[3 - k]);
            far.quads.iter().find_map(opposite)
        };
        let joined = |[p, q, r, s]: &[u32; 4]| Some(vec![*p, *q, beyond(*r)?, beyond(*s)?]);
        let new = near.quads.iter().map(joined).collect::<Option<_>>()?;
        let gone: Vec<usize> = near.faces.iter().chain(&far.faces).copied().collect();
        if self
            .faces
            .iter()
            .enumerate()
            .any(|(at, face)| !gone.contains(&at) && face.iter().any(|v| self.owner(*v) == section))
        {
            return None;
        }
        self.replace(&gone, new);
        self.chains[arc].remove(k);
        Some(())
    }

    /// Puts rings, whose vertices are there but unused, between two neighbours, evenly.
    fn insert(&mut self, rings: &[usize], between: [usize; 2]) -> Option<()> {
        let Strip { faces, quads } = self.strip(between[0], between[1])?;
        let steps = (rings.len() + 1) as f64;
        let mut new = Vec::new();
        for [p, q, r, s] in quads {
            let mut last = [p, q];
            for (step, &ring) in rings.iter().enumerate() {
                let next = last.map(|v| self.on(ring, v as usize % self.count));
                for (v, (a, b)) in next.iter().zip([(p, s), (q, r)]) {
                    let place = self.at(a) + (self.at(b) - self.at(a)) * ((step + 1) as f64 / steps);
                    self.vertices[*v as usize] = place;
                }
                new.push(vec![last[0], last[1], next[1], next[0]]);
                last = next;
            }
            new.push(vec![last[0], last[1], r, s]);
        }
        self.replace(&faces, new);
        Some(())
    }
}

/// Faces for the sections of an edit.
pub(crate) struct Transplanted {
    pub(crate) scaffold: Scaffold,
    /// For each vertex the one of the earlier cage; none where it is new.
    pub(crate) origin: Vec<Option<usize>>,
    /// On the earlier cage.
    pub(crate) start: Vec<Point>,
    /// Where it was, or a little beyond its section.
    pub(crate) goal: Vec<Point>,
}

/// The faces of `old`, its vertices eased for sections to go, under the sections `now`; `earlier`: its
/// vertices as they were. `None` where a section has no strips to be removed from or put into.
pub(crate) fn transplant(
    mut old: Rings,
    earlier: &[Point],
    (nodes, now): (&[ControlNode], &[Section]),
    lineage: &Lineage,
) -> Option<Transplanted> {
    let count = old.count;
    for section in &lineage.gone {
        old.remove(*section)?;
    }
    // The earlier rings in the new order, with room for those that come.
    let mut child = vec![None; earlier.len() / count];
    let mut origin = vec![None; count * now.len()];
    let mut start = vec![Point::zeros(); count * now.len()];
    for (i, from) in lineage.origin.iter().enumerate() {
        let Some(from) = *from else { continue };
        child[from] = Some(i);
        for k in 0..count {
            origin[i * count + k] = Some(from * count + k);
            start[i * count + k] = old.vertices[from * count + k];
        }
    }
    let renamed = |v: &u32| Some((child[old.owner(*v)]? * count + *v as usize % count) as u32);
    let faces = old.faces.iter().map(|face| face.iter().map(renamed).collect());
    let faces: Vec<Vec<u32>> = faces.collect::<Option<_>>()?;
    let mut rings = Rings::new(start, faces, nodes, count);
    for chain in rings.chains.clone() {
        let placed: Vec<usize> = (0..chain.len()).filter(|k| lineage.origin[chain[*k]].is_some()).collect();
        let inner = placed.first().zip(placed.last());
        if inner.is_some_and(|(first, last)| *first > 0 || *last + 1 < chain.len()) {
            return None;
        }
        for pair in placed.windows(2).filter(|pair| pair[1] > pair[0] + 1) {
            rings.insert(&chain[pair[0] + 1..pair[1]], [chain[pair[0]], chain[pair[1]]])?;
        }
    }
    let Rings { vertices: start, faces: polygons, .. } = rings;
    let place = |v: usize| {
        let section = &now[v / count];
        let turn = turn(&start[v / count * count..][..count], &section.corners);
        section.center + (section.corners[(v % count + turn) % count] - section.center) * BEYOND
    };
    let home = |v: usize| origin[v].filter(|_| lineage.same[v / count]).map(|old| earlier[old]);
    let goal = (0..start.len()).map(|v| home(v).unwrap_or_else(|| place(v))).collect();
    let scaffold = Scaffold {
        corners: start.clone(),
        start: start.clone(),
        owner: (0..start.len()).map(|v| v / count).collect(),
        centers: now.iter().map(|s| s.center).collect(),
        polygons,
        axis: Axis::default(),
    };
    Some(Transplanted { scaffold, origin, start, goal })
}

/// How far a ring is turned against another, in corners, apart from where they are.
fn turn(ring: &[Point], other: &[Point]) -> usize {
    let n = ring.len();
    let center = |ring: &[Point]| ring.iter().sum::<Point>() / n as f64;
    let shift = center(other) - center(ring);
    let cost =
        |turn: usize| (0..n).map(|k| (other[(k + turn) % n] - ring[k] - shift).norm_squared()).sum::<f64>();
    (0..n).min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::caging::control_nodes::NodeKind;

    /// Four rings of four around the x axis; the second strip turned by one corner, and of triangles.
    fn tube() -> Rings {
        let corners = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)];
        let turned = [0, 0, 3, 3];
        let vertex = |v: usize| {
            let (y, z) = corners[(v % 4 + turned[v / 4]) % 4];
            Point::new((v / 4) as f64, y, z)
        };
        let quad = |a: usize, k: usize, turn: usize| {
            let b = a + 1;
            [a * 4 + k, a * 4 + (k + 1) % 4, b * 4 + (k + 1 + turn) % 4, b * 4 + (k + turn) % 4]
                .map(|v| v as u32)
        };
        let mut faces = vec![vec![3, 2, 1, 0], vec![12, 13, 14, 15]];
        for k in 0..4 {
            faces.push(quad(0, k, 0).to_vec());
            let [p, q, r, s] = quad(1, k, 1);
            faces.extend([vec![p, q, r], vec![p, r, s]]);
            faces.push(quad(2, k, 0).to_vec());
        }
        Rings::new((0..16).map(vertex).collect(), faces, &nodes(4), 4)
    }

    fn nodes(count: usize) -> Vec<ControlNode> {
        let node = |x: usize| {
            let point = Point::x() * x as f64;
            let kind = NodeKind::Bending;
            ControlNode { kind, arc: 0, place: point, point, direction: Point::x(), radius: 0.5, node: 0 }
        };
        (0..count).map(node).collect()
    }

    fn section(x: f64) -> Section {
        let corners: Vec<Point> =
            [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(y, z)| Point::new(x, y, z)).to_vec();
        Section { ring: corners.clone(), corners, center: Point::x() * x }
    }

    fn volume(points: &[Point], faces: &[Vec<u32>]) -> f64 {
        let of_face = |face: &Vec<u32>| -> f64 {
            let at = |k: usize| points[face[k] as usize];
            (1..face.len() - 1).map(|k| at(0).dot(&at(k).cross(&at(k + 1))) / 6.0).sum()
        };
        faces.iter().map(of_face).sum()
    }

    fn edited(origin: &[Option<usize>], gone: &[usize], places: &[f64]) -> Option<Transplanted> {
        let sections: Vec<Section> = places.iter().map(|x| section(*x)).collect();
        let same = origin.iter().map(Option::is_some).collect();
        let lineage = Lineage { origin: origin.to_vec(), same, gone: gone.to_vec() };
        let old = tube();
        let earlier = old.vertices.clone();
        transplant(old, &earlier, (&nodes(places.len()), &sections), &lineage)
    }

    #[test]
    fn a_strip_is_found_whatever_way_it_is_turned_and_split() {
        let tube = tube();
        let strip = tube.strip(1, 2).expect("eight triangles");
        for [p, q, r, s] in strip.quads {
            let along = |a: u32, b: u32| (tube.at(a) - tube.at(b)).yz().norm() < 1e-12;
            assert!(along(p, s) && along(q, r));
        }
        assert!(tube.strip(0, 2).is_none(), "no face joins them");
    }

    #[test]
    fn a_new_ring_lies_on_the_surface() {
        let made =
            edited(&[Some(0), Some(1), None, None, Some(2), Some(3)], &[], &[0.0, 1.0, 1.2, 1.6, 2.0, 3.0]);
        let made = made.expect("a strip");
        assert_eq!(made.scaffold.polygons.len(), 2 + 5 * 4);
        assert!((volume(&made.start, &made.scaffold.polygons) - 12.0).abs() < 1e-12);
        for (v, p) in made.start[8..16].iter().enumerate() {
            let x = if v < 4 { 4.0 / 3.0 } else { 5.0 / 3.0 };
            assert!((p.x - x).abs() < 1e-12 && (p.y.abs(), p.z.abs()) == (1.0, 1.0), "{p}");
            assert!((made.goal[8 + v].yz() - p.yz() * BEYOND).norm() < 1e-12, "its own corner, not another");
        }
        assert!(made.origin[8..16].iter().all(Option::is_none));
        assert_eq!(made.goal[16..], tube().vertices[8..], "what stays has its place as goal");
    }

    #[test]
    fn a_ring_that_goes_leaves_one_strip() {
        let made = edited(&[Some(0), Some(2), Some(3)], &[1], &[0.0, 2.0, 3.0]).expect("two strips");
        assert_eq!(made.scaffold.polygons.len(), 2 + 2 * 4);
        assert!((volume(&made.start, &made.scaffold.polygons) - 12.0).abs() < 1e-12);
        assert!(edited(&[Some(1), Some(2), Some(3)], &[0], &[1.0, 2.0, 3.0]).is_none(), "it has a cap");
        let links = tube().links(&[1]).expect("two neighbours");
        let between = |(v, [a, b]): &Link| {
            let tube = tube();
            (tube.at(*a) - tube.at(*v)).yz().norm() + (tube.at(*b) - tube.at(*v)).yz().norm() < 1e-12
        };
        assert!(links.len() == 4 && links.iter().all(between));
    }
}
