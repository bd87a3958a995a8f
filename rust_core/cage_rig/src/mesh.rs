//! Polygon meshes as they are handed in, and the triangles that stand for them.
//!
//! A polygon of what a bind computes is always split the same way, wherever its corner list starts: quads
//! by their valid or else shorter diagonal (equal ones: the diagonal with the smallest vertex), larger
//! polygons by clipping ears in their best-fit plane. A skin that is to be enclosed as it is seen has its
//! quads split as Blender draws them. Cost: linear in corners, quadratic within a polygon.

use crate::points::Point;

/// Faces as one list of corners (vertex indices) and the number of corners of each face.
/// Indices are as the user gave them: whoever takes a `Polygons` checks them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Polygons {
    /// Vertex indices, face after face.
    pub corners: Vec<i64>,
    /// Corners of each face; they sum to the length of `corners`.
    pub sizes: Vec<usize>,
}

impl Polygons {
    /// A triangle mesh.
    pub fn from_triangles<I: Copy + Into<i64>>(triangles: &[[I; 3]]) -> Self {
        let corners = triangles.iter().flatten().map(|&i| i.into()).collect();
        Self { corners, sizes: vec![3; triangles.len()] }
    }

    /// Number of faces.
    pub fn len(&self) -> usize {
        self.sizes.len()
    }

    /// True without faces.
    pub fn is_empty(&self) -> bool {
        self.sizes.is_empty()
    }

    /// The corner list of each face.
    pub fn iter(&self) -> impl Iterator<Item = &[i64]> {
        let mut rest = self.corners.as_slice();
        self.sizes.iter().map(move |&size| {
            let (face, tail) = rest.split_at(size);
            rest = tail;
            face
        })
    }
}

/// What is wrong with a face, before anything is known about the whole mesh.
pub(crate) enum FaceFault {
    FewCorners { face: usize, corners: usize },
    BadIndex { face: usize, vertex: i64 },
}

/// A triangle and the polygon it came from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Piece {
    pub(crate) corners: [u32; 3],
    pub(crate) face: usize,
}

/// Which diagonal splits a quad.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Diagonal {
    /// The valid or else shorter one.
    Shorter,
    /// That of its first corner, but where the quad is folded there.
    First,
}

/// Splits every face into triangles of the same orientation. `vertices`: `#V by 3`.
pub(crate) fn triangulate(vertices: &[Point], faces: &Polygons) -> Result<Vec<Piece>, FaceFault> {
    split(vertices, faces, Diagonal::Shorter)
}

/// The same with quads as Blender draws them.
pub(crate) fn triangulate_as_drawn(vertices: &[Point], faces: &Polygons) -> Result<Vec<Piece>, FaceFault> {
    split(vertices, faces, Diagonal::First)
}

fn split(vertices: &[Point], faces: &Polygons, diagonal: Diagonal) -> Result<Vec<Piece>, FaceFault> {
    let mut pieces = Vec::with_capacity(faces.corners.len().saturating_sub(2 * faces.len()));
    for (face, corners) in faces.iter().enumerate() {
        if corners.len() < 3 {
            return Err(FaceFault::FewCorners { face, corners: corners.len() });
        }
        if let Some(&vertex) = corners.iter().find(|&&v| v < 0 || v >= vertices.len() as i64) {
            return Err(FaceFault::BadIndex { face, vertex });
        }
        let drawn = diagonal == Diagonal::First && corners.len() == 4;
        let smallest = (0..corners.len()).min_by_key(|&i| corners[i]).unwrap_or(0);
        let first = if drawn { 0 } else { smallest };
        let polygon: Vec<u32> =
            (0..corners.len()).map(|i| corners[(first + i) % corners.len()] as u32).collect();
        let mut add = |corners: [u32; 3]| pieces.push(Piece { corners, face });
        match polygon[..] {
            [a, b, c] => add([a, b, c]),
            [a, b, c, d] => {
                let [p, q, r, s] = [a, b, c, d].map(|v| vertices[v as usize]);
                let at_first = if drawn { !is_folded(p, q, r, s) } else { splits_at_first(p, q, r, s) };
                if at_first {
                    [[a, b, c], [a, c, d]].into_iter().for_each(&mut add);
                } else {
                    [[a, b, d], [b, c, d]].into_iter().for_each(&mut add);
                }
            }
            _ => clip_ears(vertices, polygon, &mut add),
        }
    }
    Ok(pieces)
}

/// Does diagonal p–r (p holds the smallest index) split the quad p q r s, rather than q–s?
fn splits_at_first(p: Point, q: Point, r: Point, s: Point) -> bool {
    let normal = (r - p).cross(&(s - q));
    let turns = |a: Point, b: Point, c: Point| (b - a).cross(&(c - a)).dot(&normal) > 0.0;
    let first = turns(p, q, r) && turns(p, r, s);
    let second = turns(p, q, s) && turns(q, r, s);
    if first != second {
        return first;
    }
    (r - p).norm() <= (s - q).norm() * (1.0 + 1e-9)
}

/// Do the two triangles beside diagonal p–r of the quad p q r s face away from each other?
fn is_folded(p: Point, q: Point, r: Point, s: Point) -> bool {
    let diagonal = r - p;
    (q - p).cross(&diagonal).dot(&diagonal.cross(&(s - p))) < 0.0
}

/// Cuts corners off until a triangle is left. A polygon that crosses itself has no ear at some
/// point: its next corner is cut then, so that the triangles always close the same boundary.
fn clip_ears(vertices: &[Point], mut polygon: Vec<u32>, add: &mut impl FnMut([u32; 3])) {
    let flat = flatten(vertices, &polygon);
    let mut places: Vec<usize> = (0..polygon.len()).collect();
    let mut at = 0;
    while polygon.len() > 3 {
        let n = polygon.len();
        let ear = (0..n).map(|k| (at + k) % n).find(|&i| is_ear(&flat, &places, i)).unwrap_or(at % n);
        add([polygon[(ear + n - 1) % n], polygon[ear], polygon[(ear + 1) % n]]);
        polygon.remove(ear);
        places.remove(ear);
        at = ear;
    }
    add([polygon[0], polygon[1], polygon[2]]);
}

/// The polygon in its best-fit plane, turning left. The normal is Newell's.
fn flatten(vertices: &[Point], polygon: &[u32]) -> Vec<[f64; 2]> {
    let corner = |i: usize| vertices[polygon[i % polygon.len()] as usize];
    let normal: Point =
        (1..polygon.len()).map(|i| (corner(i) - corner(0)).cross(&(corner(i + 1) - corner(0)))).sum();
    let longest = normal.iamax();
    let (u, v) = ((longest + 1) % 3, (longest + 2) % 3);
    let sign = normal[longest].signum();
    (0..polygon.len()).map(|i| [sign * corner(i)[u], corner(i)[v]]).collect()
}

fn is_ear(flat: &[[f64; 2]], places: &[usize], at: usize) -> bool {
    let n = places.len();
    let [a, b, c] = [flat[places[(at + n - 1) % n]], flat[places[at]], flat[places[(at + 1) % n]]];
    let turn =
        |p: [f64; 2], q: [f64; 2], r: [f64; 2]| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
    let inside = |p: [f64; 2]| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
    turn(a, b, c) > 0.0 && (2..n - 1).all(|k| !inside(flat[places[(at + k) % n]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(points: &[[f64; 3]], faces: &[&[i64]]) -> Vec<[u32; 3]> {
        let vertices: Vec<Point> = points.iter().map(|p| Point::from(*p)).collect();
        let polygons = Polygons { corners: faces.concat(), sizes: faces.iter().map(|f| f.len()).collect() };
        let pieces = triangulate(&vertices, &polygons).ok().expect("valid faces");
        pieces.iter().map(|p| p.corners).collect()
    }

    fn rotations(polygon: &[i64]) -> Vec<Vec<i64>> {
        (0..polygon.len()).map(|k| [&polygon[k..], &polygon[..k]].concat()).collect()
    }

    #[test]
    fn a_quad_splits_the_same_wherever_its_corners_start() {
        let quads: [[[f64; 3]; 4]; 3] = [
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            [[0.0, 0.0, 0.0], [2.0, 0.0, 0.3], [2.0, 1.0, 0.0], [0.4, 1.0, 0.1]],
            [[0.0, 0.0, 0.0], [0.9, 0.1, 0.0], [1.0, 1.0, 0.0], [0.1, 0.9, 0.0]],
        ];
        for points in quads {
            let all: Vec<_> = rotations(&[0, 1, 2, 3]).iter().map(|r| pieces(&points, &[r])).collect();
            assert!(all.iter().all(|t| *t == all[0]));
        }
    }

    #[test]
    fn equal_diagonals_are_settled_by_the_smallest_vertex() {
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(pieces(&square, &[&[2, 3, 0, 1]]), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn a_concave_quad_splits_inside() {
        let dart = [[0.0, 0.0, 0.0], [3.0, -2.0, 0.0], [1.0, 0.0, 0.0], [3.0, 2.0, 0.0]];
        assert_eq!(pieces(&dart, &[&[0, 1, 2, 3]]), [[0, 1, 2], [0, 2, 3]]);
        let turned = [dart[1], dart[2], dart[3], dart[0]];
        assert_eq!(pieces(&turned, &[&[0, 1, 2, 3]]), [[0, 1, 3], [1, 2, 3]]);
    }

    #[test]
    fn quads_are_drawn_by_the_diagonal_of_their_first_corner_but_where_they_are_folded_there() {
        let bent = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.4], [1.2, 1.0, 0.0], [0.0, 1.0, 0.4]];
        let dart = [[0.0, 0.0, 0.0], [3.0, -2.0, 0.0], [1.0, 0.0, 0.0], [3.0, 2.0, 0.0]];
        let drawn = |points: &[[f64; 3]; 4], face: [i64; 4]| {
            let vertices: Vec<Point> = points.iter().map(|p| Point::from(*p)).collect();
            let polygons = Polygons { corners: face.to_vec(), sizes: vec![4] };
            let pieces = triangulate_as_drawn(&vertices, &polygons).ok().expect("a valid face");
            pieces.iter().map(|p| p.corners).collect::<Vec<_>>()
        };
        assert_eq!(drawn(&bent, [2, 3, 0, 1]), [[2, 3, 0], [2, 0, 1]]);
        assert_eq!(drawn(&bent, [1, 2, 3, 0]), [[1, 2, 3], [1, 3, 0]]);
        assert_eq!(drawn(&dart, [0, 1, 2, 3]), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(drawn(&dart, [1, 2, 3, 0]), [[1, 2, 0], [2, 3, 0]]);
    }

    #[test]
    fn a_comb_is_covered_exactly_once_wherever_its_corners_start() {
        let comb =
            [[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [3, 1], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]];
        let points: Vec<[f64; 3]> = comb.iter().map(|&[x, y]| [x as f64, y as f64, 0.2 * x as f64]).collect();
        let cover = pieces(&points, &[&(0..12).collect::<Vec<_>>()]);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| points[i as usize]);
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2.0
        };
        assert_eq!(cover.len(), 10);
        assert!(cover.iter().all(|t| area(t) >= 0.0));
        assert!((cover.iter().map(area).sum::<f64>() - 11.0).abs() < 1e-12);
        for rotation in rotations(&(0..12).collect::<Vec<_>>()) {
            assert_eq!(pieces(&points, &[&rotation]), cover);
        }
    }

    #[test]
    fn a_polygon_that_crosses_itself_still_ends() {
        let star: Vec<[f64; 3]> = (0..5)
            .map(|k| (k as f64 * 0.8 * std::f64::consts::PI).sin_cos())
            .map(|(s, c)| [c, s, 0.0])
            .collect();
        assert_eq!(pieces(&star, &[&[0, 1, 2, 3, 4]]).len(), 3);
    }
}
