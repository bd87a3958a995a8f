//! A cage that another one is to be like: its sections as chains between leaves and branches.
//!
//! Everything is read off the faces. Rings of corners cut the cage into patches: a cap closes a chain,
//! a strip joins two neighbours of one, and what joins others is a branch. Linear in the faces.

use super::regrowth;
use super::skin::Skin;
use super::symmetry::image;
use crate::error::CagingError;
use crate::mesh::Polygons;
use crate::points::{first_unusable, Point};
use std::collections::HashMap;

/// A generated cage whose sections, vertices and faces another one takes over.
#[derive(Debug, Clone)]
pub struct Template {
    /// Section after section, `#C by 3`, where the new skin is.
    pub vertices: Vec<Point>,
    /// Outward.
    pub faces: Polygons,
    /// Vertices of a section.
    pub corners: usize,
}

/// Where a chain ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// At a cap.
    Leaf,
    /// At a branch.
    Branch(usize),
}

/// Sections in a row: what is a part of the skeleton on another skin.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Chain {
    /// The first section, and how many there are.
    pub(crate) first: usize,
    pub(crate) count: usize,
    pub(crate) ends: [End; 2],
}

/// A template, understood. Unit space of the new skin.
#[derive(Debug, Clone)]
pub(crate) struct Pattern {
    /// Vertices of a section.
    pub(crate) count: usize,
    pub(crate) vertices: Vec<Point>,
    pub(crate) faces: Vec<Vec<u32>>,
    pub(crate) chains: Vec<Chain>,
    /// The middle of each branch.
    pub(crate) branches: Vec<Point>,
}

impl Chain {
    pub(crate) fn sections(&self) -> std::ops::Range<usize> {
        self.first..self.first + self.count
    }

    /// Sections that close nothing.
    pub(crate) fn bending(&self) -> std::ops::Range<usize> {
        let [from, to] = self.ends.map(|end| usize::from(end == End::Leaf));
        self.first + from..(self.first + self.count - to).max(self.first + from)
    }
}

impl Template {
    /// In the space of `skin`, to have so many `corners`.
    pub(crate) fn read(&self, skin: &Skin, corners: usize) -> Result<Pattern, CagingError> {
        let (vertices, count) = (&self.vertices, self.corners);
        if count != corners {
            return Err(CagingError::OtherCorners { wanted: count, found: corners });
        }
        let whole = count >= 3 && !vertices.is_empty() && vertices.len() % count == 0;
        if !whole || first_unusable(vertices).is_some() {
            return Err(CagingError::NoSections);
        }
        let vertices: Vec<Point> = vertices.iter().map(|p| skin.space.enter(p)).collect();
        let faces = regrowth::faces(&self.faces, &vertices).ok_or(CagingError::NoSections)?;
        Pattern::new(vertices, faces, count).ok_or(CagingError::NoSections)
    }
}

impl Pattern {
    /// `None` where the faces don't have the sides of every section.
    pub(crate) fn new(vertices: Vec<Point>, faces: Vec<Vec<u32>>, count: usize) -> Option<Self> {
        let sections = vertices.len() / count;
        let mut at_edge: HashMap<(u32, u32), usize> = HashMap::new();
        for (at, face) in faces.iter().enumerate() {
            for k in 0..face.len() {
                if at_edge.insert((face[k], face[(k + 1) % face.len()]), at).is_some() {
                    return None;
                }
            }
        }
        let patch = patches(&faces, &at_edge, count)?;
        // A ring's sides are forward in the faces after it, and backward in those before it.
        let mut beside = Vec::new();
        for section in 0..sections {
            let corner = |k: usize| (section * count + k % count) as u32;
            let of_side = |k: usize, ends: (usize, usize)| {
                at_edge.get(&(corner(k + ends.0), corner(k + ends.1))).map(|f| patch[*f])
            };
            let (before, after) = (of_side(0, (1, 0))?, of_side(0, (0, 1))?);
            let same =
                (0..count).all(|k| of_side(k, (1, 0)) == Some(before) && of_side(k, (0, 1)) == Some(after));
            beside.push(Some((before, after)).filter(|_| same && before != after)?);
        }
        let patches = patch.iter().max()? + 1;
        let mut members = vec![Vec::new(); patches];
        for (section, (before, after)) in beside.iter().enumerate() {
            members[*before].push(section);
            members[*after].push(section);
        }
        let joined = |s: usize| {
            s + 1 < sections && beside[s].1 == beside[s + 1].0 && members[beside[s].1] == [s, s + 1]
        };
        let center = |s: usize| center(&vertices[s * count..][..count]);
        let mut number = HashMap::new();
        let mut branches = Vec::new();
        let mut end = |patch: usize| {
            if members[patch].len() == 1 {
                return End::Leaf;
            }
            End::Branch(*number.entry(patch).or_insert_with(|| {
                let around = &members[patch];
                branches.push(around.iter().map(|s| center(*s)).sum::<Point>() / around.len() as f64);
                branches.len() - 1
            }))
        };
        let mut chains = Vec::new();
        let mut first = 0;
        while first < sections {
            let mut last = first;
            while joined(last) {
                last += 1;
            }
            let ends = [end(beside[first].0), end(beside[last].1)];
            chains.push(Chain { first, count: last + 1 - first, ends });
            first = last + 1;
        }
        Some(Self { count, vertices, faces, chains, branches })
    }

    /// Faces without sections.
    pub(crate) fn loose(vertices: Vec<Point>, faces: Vec<Vec<u32>>) -> Self {
        Self { count: 1, vertices, faces, chains: Vec::new(), branches: Vec::new() }
    }

    pub(crate) fn sections(&self) -> usize {
        self.vertices.len() / self.count
    }

    pub(crate) fn section(&self, section: usize) -> &[Point] {
        &self.vertices[section * self.count..][..self.count]
    }

    pub(crate) fn center(&self, section: usize) -> Point {
        center(self.section(section))
    }

    /// The faces cut into triangles: fans, as whoever wrote the cage has checked them.
    pub(crate) fn triangles(&self) -> Vec<[u32; 3]> {
        let fan = |face: &Vec<u32>| {
            (1..face.len() - 1).map(|k| [face[0], face[k], face[k + 1]]).collect::<Vec<_>>()
        };
        self.faces.iter().flat_map(fan).collect()
    }

    pub(crate) fn polygons(&self) -> Polygons {
        let corners = self.faces.iter().flatten().map(|v| i64::from(*v)).collect();
        Polygons { corners, sizes: self.faces.iter().map(Vec::len).collect() }
    }

    pub(crate) fn quads(&self) -> Vec<[u32; 4]> {
        self.faces.iter().filter_map(|face| face[..].try_into().ok()).collect()
    }

    /// At another place and of another size.
    pub(crate) fn moved(&self, (scale, shift): (f64, Point)) -> Self {
        let put = |points: &[Point]| points.iter().map(|p| p * scale + shift).collect();
        Self { vertices: put(&self.vertices), branches: put(&self.branches), ..self.clone() }
    }

    /// Brings every vertex to where its partner has its image.
    pub(crate) fn even_out(&mut self, mirror: &[u32]) {
        let old = self.vertices.clone();
        for (p, m) in self.vertices.iter_mut().zip(mirror) {
            *p = (*p + image(&old[*m as usize])) * 0.5;
        }
    }

    /// From left to right.
    fn span(&self) -> (f64, f64) {
        self.vertices
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p.x), high.max(p.x)))
    }

    /// Whether its middle is about on the plane of symmetry.
    pub(crate) fn is_in_middle(&self) -> bool {
        let (low, high) = self.span();
        (low + high).abs() < 0.02
    }

    /// For each vertex its mirror image, about its own middle; `None` where one has none.
    pub(crate) fn mirror(&self) -> Option<Vec<u32>> {
        let (low, high) = self.span();
        let partner = |p: &Point| Point::new(low + high - p.x, p.y, p.z);
        let of_point = |p: &Point| {
            let apart = |v: &usize| (self.vertices[*v] - partner(p)).norm();
            let nearest = (0..self.vertices.len()).min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
            (apart(&nearest) < MIRRORED).then_some(nearest as u32)
        };
        let found: Vec<u32> = self.vertices.iter().map(of_point).collect::<Option<_>>()?;
        (0..found.len()).all(|v| found[found[v] as usize] as usize == v).then_some(found)
    }
}

/// How far a vertex may be from the image of its partner, relative to the size.
const MIRRORED: f64 = 1e-4;

pub(crate) fn center(ring: &[Point]) -> Point {
    ring.iter().sum::<Point>() / ring.len() as f64
}

/// The patch of each face; `None` where the faces aren't closed.
fn patches(faces: &[Vec<u32>], at_edge: &HashMap<(u32, u32), usize>, count: usize) -> Option<Vec<usize>> {
    let is_side = |a: u32, b: u32| {
        let (a, b) = (a as usize, b as usize);
        a / count == b / count && [1, count - 1].contains(&((a + count - b) % count))
    };
    let mut patch = vec![usize::MAX; faces.len()];
    let mut found = 0;
    for start in 0..faces.len() {
        if patch[start] != usize::MAX {
            continue;
        }
        let mut stack = vec![start];
        patch[start] = found;
        while let Some(at) = stack.pop() {
            let face = &faces[at];
            for k in 0..face.len() {
                let (a, b) = (face[k], face[(k + 1) % face.len()]);
                let other = *at_edge.get(&(b, a))?;
                if !is_side(a, b) && patch[other] == usize::MAX {
                    patch[other] = found;
                    stack.push(other);
                }
            }
        }
        found += 1;
    }
    Some(patch)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tube of rings of three corners, closed by caps.
    fn tube(rings: u32) -> (Vec<Point>, Vec<Vec<u32>>) {
        let vertices = (0..3 * rings).map(|v| Point::new(f64::from(v / 3), f64::from(v % 3), 0.0)).collect();
        let last = 3 * (rings - 1);
        let mut faces = vec![vec![2, 1, 0], vec![last, last + 1, last + 2]];
        for ring in 0..rings - 1 {
            for k in 0..3 {
                let (a, b) = (3 * ring + k, 3 * ring + (k + 1) % 3);
                faces.push(vec![a, b, b + 3, a + 3]);
            }
        }
        (vertices, faces)
    }

    #[test]
    fn chains_are_read_off_the_faces() {
        let (vertices, faces) = tube(4);
        let found = Pattern::new(vertices.clone(), faces.clone(), 3).expect("a tube");
        assert_eq!(found.chains, [Chain { first: 0, count: 4, ends: [End::Leaf, End::Leaf] }]);
        assert_eq!(found.chains[0].bending(), 1..3);
        assert!(found.branches.is_empty());
        assert_eq!((found.quads().len(), found.triangles().len()), (9, 20));
        assert!(Pattern::new(vertices.clone(), faces[1..].to_vec(), 3).is_none(), "open");
        assert!(Pattern::new(vertices, faces, 2).is_none(), "rings of two have other sides");
    }

    #[test]
    fn a_mirror_image_is_found_about_its_own_middle() {
        let (mut vertices, faces) = tube(2);
        vertices.iter_mut().for_each(|p| p.x += 7.0);
        let mut found = Pattern::new(vertices, faces, 3).expect("a tube");
        let mirror = found.mirror().expect("symmetric");
        assert_eq!(mirror, [3, 4, 5, 0, 1, 2]);
        found.even_out(&mirror);
        assert!((found.vertices[0].x + 0.5).abs() < 1e-12 && (found.vertices[3].x - 0.5).abs() < 1e-12);
        found.vertices[1].y += 0.01;
        assert_eq!(found.mirror(), None);
    }
}
