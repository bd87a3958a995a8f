//! The skin as an obstacle: closed, oriented, in a space of size 1.
//!
//! Vertices at one place are welded, duplicate and empty faces left out, flipped ones turned, all
//! of it told in [`Repairs`]. What is open or not manifold after that is refused by its place.
//! Coordinates are moved and scaled to a bounding diagonal of 1. Linear in the faces.

use super::symmetry::image;
use crate::error::CagingError;
use crate::geometry::bvh::Bvh;
use crate::mesh::{triangulate_as_drawn, FaceFault, Polygons};
use crate::points::{bounding_diagonal, first_unusable, Point};
use std::collections::HashMap;

/// A closed skin ready to be asked about inside, nearest points and boxes.
#[derive(Debug, Clone)]
pub struct Skin {
    /// Welded vertices, unit space.
    pub(crate) points: Vec<Point>,
    /// Triangles, outward.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The welded vertices as they were handed in.
    pub(crate) original: Vec<Point>,
    pub(crate) tree: Bvh,
    pub(crate) space: UnitSpace,
    /// What had to be done to the mesh.
    pub repairs: Repairs,
    /// The half with x < 0 counts as the mirror image of the other, so that no rounding on one side
    /// alone decides anything.
    pub(crate) symmetric: bool,
}

/// What was done to a skin before it could be used.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Vertices welded to another one at their place.
    pub welded: usize,
    /// Faces left out: twice the same, or without three distinct corners.
    pub left_out: usize,
    /// Faces turned to agree with the rest.
    pub turned: usize,
    /// The whole skin was inside out.
    pub inside_out: bool,
    /// Closed parts.
    pub parts: usize,
}

/// Moves and scales between the user's space and one where the skin has size 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UnitSpace {
    pub(crate) center: Point,
    pub(crate) size: f64,
}

impl UnitSpace {
    pub(crate) fn enter(&self, p: &Point) -> Point {
        (p - self.center) / self.size
    }

    pub(crate) fn leave(&self, p: &Point) -> Point {
        p * self.size + self.center
    }
}

impl Skin {
    /// Checks and repairs `vertices` (`#V by 3`) and `faces`.
    pub fn new(vertices: &[Point], faces: &Polygons) -> Result<Self, CagingError> {
        if faces.is_empty() || vertices.is_empty() {
            return Err(CagingError::SkinEmpty);
        }
        if let Some(vertex) = first_unusable(vertices) {
            return Err(CagingError::SkinNotFinite { vertex });
        }
        let pieces = triangulate_as_drawn(vertices, faces).map_err(|fault| match fault {
            FaceFault::FewCorners { face, corners } => CagingError::FewCorners { face, corners },
            FaceFault::BadIndex { face, vertex } => {
                CagingError::BadIndex { face, vertex, vertices: vertices.len() }
            }
        })?;
        let (low, high) = vertices.iter().fold((vertices[0], vertices[0]), |(l, h), p| (l.inf(p), h.sup(p)));
        let size = bounding_diagonal(vertices);
        if !(size > 0.0 && size.is_finite()) {
            return Err(CagingError::NoVolume);
        }
        let mut repairs = Repairs::default();
        let (points, place) = weld(vertices, &mut repairs);
        let mut seen = std::collections::HashSet::with_capacity(pieces.len());
        let mut triangles: Vec<[u32; 3]> = Vec::with_capacity(pieces.len());
        for piece in &pieces {
            let t = piece.corners.map(|v| place[v as usize]);
            let mut key = t;
            key.sort_unstable();
            if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] || !seen.insert(key) {
                repairs.left_out += 1;
            } else {
                triangles.push(t);
            }
        }
        if triangles.is_empty() {
            return Err(CagingError::SkinEmpty);
        }
        orient(&points, &mut triangles, &mut repairs)?;
        let space = UnitSpace { center: (low + high) * 0.5, size };
        let original = points;
        let points: Vec<Point> = original.iter().map(|p| space.enter(p)).collect();
        let tree = Bvh::new(&points, &triangles);
        Ok(Self { points, triangles, original, tree, space, repairs, symmetric: false })
    }

    /// Signed distance in unit space: positive inside.
    pub(crate) fn depth(&self, point: &Point) -> f64 {
        let distance = self.tree.nearest(&self.points, &self.folded(point)).map_or(0.0, |n| n.distance);
        if self.contains(point) {
            distance
        } else {
            -distance
        }
    }

    pub(crate) fn contains(&self, point: &Point) -> bool {
        self.tree.winding(&self.points, &self.folded(point)) > 0
    }

    /// Whether a symmetric skin is looked at on its other side for this point.
    pub(crate) fn is_image(&self, point: &Point) -> bool {
        self.symmetric && point.x < 0.0
    }

    fn folded(&self, point: &Point) -> Point {
        if self.is_image(point) {
            image(point)
        } else {
            *point
        }
    }

    /// Whether the segment from `a` to `b` stays inside, looked at in `steps` places.
    pub(crate) fn sees(&self, a: &Point, b: &Point, steps: usize) -> bool {
        (1..steps).all(|k| self.contains(&(a + (b - a) * (k as f64 / steps as f64))))
    }
}

fn weld(vertices: &[Point], repairs: &mut Repairs) -> (Vec<Point>, Vec<u32>) {
    let mut places = HashMap::with_capacity(vertices.len());
    let mut points = Vec::with_capacity(vertices.len());
    let place = vertices
        .iter()
        .map(|p| {
            *places.entry([p.x, p.y, p.z].map(|x| (x + 0.0).to_bits())).or_insert_with(|| {
                points.push(*p);
                points.len() as u32 - 1
            })
        })
        .collect();
    repairs.welded = vertices.len() - points.len();
    (points, place)
}

/// Turns faces to agree with their neighbours, and each closed part outward.
fn orient(points: &[Point], triangles: &mut [[u32; 3]], repairs: &mut Repairs) -> Result<(), CagingError> {
    let neighbours = neighbours(points, triangles)?;
    let mut part = vec![usize::MAX; triangles.len()];
    let mut flip = vec![false; triangles.len()];
    let mut volumes = Vec::new();
    for start in 0..triangles.len() {
        if part[start] != usize::MAX {
            continue;
        }
        let (mut stack, mut volume, mut flipped, mut count) = (vec![start], 0.0, 0, 0);
        part[start] = volumes.len();
        while let Some(at) = stack.pop() {
            let [a, b, c] = triangles[at].map(|v| points[v as usize] - points[0]);
            volume += if flip[at] { -1.0 } else { 1.0 } * a.dot(&b.cross(&c)) / 6.0;
            (flipped, count) = (flipped + usize::from(flip[at]), count + 1);
            for &(next, agrees) in &neighbours[at] {
                let required = flip[at] == agrees;
                if part[next] == usize::MAX {
                    part[next] = volumes.len();
                    flip[next] = required;
                    stack.push(next);
                } else if flip[next] != required {
                    return Err(CagingError::NotOrientable { place: points[triangles[at][0] as usize] });
                }
            }
        }
        volumes.push((volume, flipped, count));
    }
    if volumes.iter().all(|(volume, ..)| *volume == 0.0) {
        return Err(CagingError::NoVolume);
    }
    repairs.parts = volumes.len();
    for (at, t) in triangles.iter_mut().enumerate() {
        if flip[at] != (volumes[part[at]].0 < 0.0) {
            t.swap(1, 2);
            repairs.turned += 1;
        }
    }
    repairs.inside_out = repairs.turned == triangles.len();
    if repairs.inside_out {
        repairs.turned = 0;
    }
    Ok(())
}

/// Across each side: the triangle there and whether its direction agrees with ours.
fn neighbours(points: &[Point], triangles: &[[u32; 3]]) -> Result<Vec<[(usize, bool); 3]>, CagingError> {
    let mut edges: HashMap<(u32, u32), Vec<(usize, usize)>> = HashMap::with_capacity(triangles.len() * 3 / 2);
    for (at, t) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.entry((a.min(b), a.max(b))).or_default().push((at, k));
        }
    }
    let mut found = vec![[(0, true); 3]; triangles.len()];
    let mut fault: Option<(u32, u32, usize)> = None;
    for (&(a, b), sides) in &edges {
        if let [(s, j), (t, k)] = sides[..] {
            let agrees = triangles[s][j] != triangles[t][k];
            found[s][j] = (t, agrees);
            found[t][k] = (s, agrees);
        } else if fault.is_none_or(|(x, y, _)| (a, b) < (x, y)) {
            fault = Some((a, b, sides.len()));
        }
    }
    let Some((a, b, count)) = fault else { return Ok(found) };
    let place = (points[a as usize] + points[b as usize]) * 0.5;
    let (a, b) = (a as usize, b as usize);
    Err(if count == 1 {
        CagingError::OpenSkin { a, b, place }
    } else {
        CagingError::NonManifoldSkin { a, b, count, place }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::shapes::icosphere;

    #[test]
    fn flipped_doubled_and_unwelded_faces_are_put_right() {
        let (vertices, triangles) = icosphere(1);
        let mut loose = Vec::new();
        let mut faces: Vec<[i64; 3]> = Vec::new();
        for t in &triangles {
            let first = loose.len() as i64;
            loose.extend(t.map(|v| vertices[v as usize]));
            faces.push([first, first + 1, first + 2]);
        }
        faces[3].swap(0, 1);
        faces.push(faces[5]);
        let skin = Skin::new(&loose, &Polygons::from_triangles(&faces)).expect("repaired");
        assert_eq!(skin.points.len(), vertices.len());
        assert_eq!((skin.repairs.turned, skin.repairs.left_out, skin.repairs.parts), (1, 1, 1));
        assert!(skin.contains(&skin.space.enter(&Point::zeros())));
        assert!((skin.depth(&Point::zeros()) * skin.space.size - 0.9).abs() < 0.1);
    }

    #[test]
    fn a_hole_is_named_by_its_edge() {
        let (vertices, mut triangles) = icosphere(1);
        triangles.pop();
        let found = Skin::new(&vertices, &Polygons::from_triangles(&triangles));
        assert!(matches!(found, Err(CagingError::OpenSkin { .. })), "{found:?}");
    }
}
