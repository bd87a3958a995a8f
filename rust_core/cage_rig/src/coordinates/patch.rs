//! A triangle mesh in pieces that fit a cache, for mean value weights of many points.
//!
//! A piece has its own vertices, and edges that its faces share; what belongs to two pieces is worked
//! on in both. Edges run from their lower vertex, so that every piece finds the same numbers for them.

use super::degenerate::Seen;
use crate::points::Point;

/// Faces of a piece: with their vertices and edges they fit the second cache.
const FACES: usize = 512;
const NONE: u32 = u32::MAX;

/// Some faces with area, and what they stand on.
pub(super) struct Patch {
    /// Vertices of the mesh; edges and faces count in this list.
    pub(super) vertices: Vec<u32>,
    pub(super) edges: Vec<Edge>,
    pub(super) faces: Vec<Face>,
}

/// From the lower vertex to the higher one.
pub(super) struct Edge {
    pub(super) ends: [u32; 2],
    pub(super) step: Point,
}

/// Side k runs between the two other corners, along edge `edges[k]` (`signs[k]` is −1 when against it).
pub(super) struct Face {
    pub(super) corners: [u32; 3],
    pub(super) edges: [u32; 3],
    pub(super) signs: [f64; 3],
    /// As long as twice the area.
    pub(super) normal: Point,
    /// The longest side, squared.
    pub(super) long: f64,
}

/// What one point sees of a face.
pub(super) enum Sight {
    /// The weights of the corners.
    Weights([f64; 3]),
    /// The face is seen edge-on and has no weight.
    Nothing,
    /// The point lies on it, or on one of its sides or corners.
    Touched,
}

/// Cuts a mesh into pieces, in the order of its faces; those of no more than `least_area` (twice) are left out.
pub(super) fn patches(vertices: &[Point], triangles: &[[u32; 3]], least_area: f64) -> Vec<Patch> {
    let mut local = vec![NONE; vertices.len()];
    triangles.chunks(FACES).map(|faces| Patch::new(vertices, faces, least_area, &mut local)).collect()
}

impl Patch {
    /// `local` is `NONE` for all vertices, before and after.
    fn new(vertices: &[Point], triangles: &[[u32; 3]], least_area: f64, local: &mut [u32]) -> Self {
        let mut patch = Self { vertices: Vec::new(), edges: Vec::new(), faces: Vec::new() };
        // Edges of the same lower vertex are a chain.
        let (mut first, mut next): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
        for triangle in triangles {
            let [a, b, c] = triangle.map(|v| vertices[v as usize]);
            let normal = (b - a).cross(&(c - a));
            if normal.norm() <= least_area {
                continue;
            }
            for &v in triangle {
                if local[v as usize] == NONE {
                    local[v as usize] = patch.vertices.len() as u32;
                    patch.vertices.push(v);
                    first.push(NONE);
                }
            }
            let corners = triangle.map(|v| local[v as usize]);
            let long = (b - a).norm_squared().max((c - b).norm_squared()).max((a - c).norm_squared());
            let mut face = Face { corners, edges: [0; 3], signs: [1.0; 3], normal, long };
            for k in 0..3 {
                let ahead = triangle[(k + 1) % 3] < triangle[(k + 2) % 3];
                let (from, to) = (corners[(k + 1) % 3], corners[(k + 2) % 3]);
                let ends = if ahead { [from, to] } else { [to, from] };
                let chain = &mut first[ends[0] as usize];
                let mut edge = *chain;
                while edge != NONE && patch.edges[edge as usize].ends != ends {
                    edge = next[edge as usize];
                }
                if edge == NONE {
                    edge = patch.edges.len() as u32;
                    next.push(std::mem::replace(chain, edge));
                    let [low, high] = ends.map(|v| vertices[patch.vertices[v as usize] as usize]);
                    patch.edges.push(Edge { ends, step: high - low });
                }
                face.edges[k] = edge;
                face.signs[k] = if ahead { 1.0 } else { -1.0 };
            }
            patch.faces.push(face);
        }
        patch.vertices.iter().for_each(|v| local[*v as usize] = NONE);
        patch
    }

    /// The weights of `face` at `point`, however the face is seen. What is nearer than `touch` is touched.
    pub(super) fn sight(&self, face: &Face, vertices: &[Point], point: &Point, touch: f64) -> Sight {
        let toward = face.corners.map(|v| vertices[self.vertices[v as usize] as usize] - point);
        let distances = toward.map(|t| t.norm());
        if distances.iter().any(|d| *d <= touch) {
            return Sight::Touched;
        }
        let directions: [Point; 3] = std::array::from_fn(|k| toward[k] / distances[k]);
        let mut crosses = [Point::zeros(); 3]; // u × u of the two other corners
        let (mut sines, mut angles) = ([0.0; 3], [0.0; 3]);
        let mut mean = Point::zeros();
        for k in 0..3 {
            let (mut from, mut to) = ((k + 1) % 3, (k + 2) % 3);
            if face.signs[k] < 0.0 {
                std::mem::swap(&mut from, &mut to);
            }
            let (start, end) = (directions[from], directions[to]);
            // Not u_a × u_b: the difference is exact where the two are close.
            let cosine = start.dot(&end);
            let cross = if cosine > 0.5 { start.cross(&(end - start)) } else { start.cross(&end) };
            let sine = cross.norm();
            let (near, far) = (distances[from], distances[to]);
            if cosine < 0.0 && sine * near * far <= touch * (near + far) {
                return Sight::Touched;
            }
            (crosses[k], sines[k], angles[k]) = (cross * face.signs[k], sine, sine.atan2(cosine));
            let ratio = if sine > 0.0 { angles[k] / sine } else { 1.0 };
            mean += crosses[k] * (0.5 * ratio);
        }
        // The determinant is most exact from the shortest side.
        let short = (0..3).min_by(|&i, &k| sines[i].total_cmp(&sines[k])).unwrap_or(0);
        let determinant = directions[short].dot(&crosses[short]);
        let height = determinant.abs() * distances[0] * distances[1] * distances[2] / face.normal.norm();
        // Cosines of the angles between the sides at each corner, up to a positive factor.
        let turns: [f64; 3] = std::array::from_fn(|k| -crosses[(k + 1) % 3].dot(&crosses[(k + 2) % 3]));
        if height <= touch {
            let beside = turns.iter().any(|&turn| turn > 0.0);
            return if beside { Sight::Nothing } else { Sight::Touched };
        }
        let seen = Seen { directions, angles, sines, turns, determinant };
        let components = seen
            .degenerate_components(short)
            .unwrap_or_else(|| crosses.map(|cross| mean.dot(&cross) / determinant));
        Sight::Weights(std::array::from_fn(|k| components[k] / distances[k]))
    }

    /// Writes the coordinates of a point that lies on a corner (`level` 0), a side (1) or a face (2) of
    /// this piece into `row`, one per vertex of the mesh. False if it lies on none.
    pub(super) fn place(
        &self,
        level: usize,
        vertices: &[Point],
        point: &Point,
        touch: f64,
        row: &mut [f64],
    ) -> bool {
        let vertex = |v: u32| self.vertices[v as usize] as usize;
        let distance = |v: u32| (vertices[vertex(v)] - point).norm();
        match level {
            0 => {
                let found = (0..self.vertices.len() as u32).find(|v| distance(*v) <= touch);
                found.inspect(|v| row[vertex(*v)] = 1.0).is_some()
            }
            1 => {
                let touches = |edge: &&Edge| {
                    let [near, far] = edge.ends.map(distance);
                    let toward = edge.ends.map(|v| vertices[vertex(v)] - point);
                    toward[0].dot(&toward[1]) < 0.0
                        && toward[0].cross(&toward[1]).norm() <= touch * (near + far)
                };
                let Some(edge) = self.edges.iter().find(touches) else { return false };
                let [near, far] = edge.ends.map(distance);
                row[vertex(edge.ends[0])] = far / (near + far);
                row[vertex(edge.ends[1])] = near / (near + far);
                true
            }
            _ => {
                let touched =
                    |face: &&Face| matches!(self.sight(face, vertices, point, touch), Sight::Touched);
                let Some(face) = self.faces.iter().find(touched) else { return false };
                // Barycentric coordinates, from the areas opposite the corners.
                let toward = face.corners.map(|v| vertices[vertex(v)] - point);
                let areas: [f64; 3] =
                    std::array::from_fn(|k| toward[(k + 1) % 3].cross(&toward[(k + 2) % 3]).norm());
                (0..3).for_each(|k| row[vertex(face.corners[k])] = areas[k] / areas.iter().sum::<f64>());
                true
            }
        }
    }
}
