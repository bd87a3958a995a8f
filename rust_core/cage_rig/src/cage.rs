//! [`Cage`]: a closed surface that is known to enclose something.
//!
//! Coordinates of a cage with a hole or a flipped face come out wrong without any other symptom,
//! so everything is checked here once and refused by what and where. What is only inside out as
//! a whole is turned. Cost: linear in the faces.

use crate::error::CageError;
use crate::mesh::{triangulate, FaceFault, Piece, Polygons};
use crate::points::{bounding_diagonal, first_unusable, Point};
use std::collections::HashMap;

/// A closed, manifold triangle mesh with faces outward. Several closed parts are allowed.
#[derive(Debug, Clone)]
pub struct Cage {
    vertices: Vec<Point>,
    triangles: Vec<[u32; 3]>,
    turned: bool,
}

impl Cage {
    /// Checks `vertices` (`#C by 3`, rig space) and `faces`, splits polygons into triangles and
    /// turns the cage outward.
    pub fn new(vertices: Vec<Point>, faces: &Polygons) -> Result<Self, CageError> {
        check_vertices(&vertices, faces)?;
        let pieces = triangulate(&vertices, faces).map_err(|fault| match fault {
            FaceFault::FewCorners { face, corners } => CageError::FewCorners { face, corners },
            FaceFault::BadIndex { face, vertex } => {
                CageError::BadIndex { face, vertex, vertices: vertices.len() }
            }
        })?;
        check_faces(&vertices, faces, &pieces)?;
        let neighbours = check_edges(&pieces)?;
        check_fans(&pieces, vertices.len())?;
        let parts = check_orientation(&pieces, &neighbours)?;
        let turned = check_volume(&vertices, &pieces, &parts)?;
        let triangles = pieces.iter().map(|p| if turned { flipped(p.corners) } else { p.corners }).collect();
        Ok(Self { vertices, triangles, turned })
    }

    /// Vertices C₀, `#C by 3`, rig space.
    pub fn vertices(&self) -> &[Point] {
        &self.vertices
    }

    /// Triangles, outward.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Was the cage handed in inside out?
    pub fn turned(&self) -> bool {
        self.turned
    }
}

fn flipped([a, b, c]: [u32; 3]) -> [u32; 3] {
    [a, c, b]
}

fn check_vertices(vertices: &[Point], faces: &Polygons) -> Result<(), CageError> {
    if vertices.len() < 4 || faces.len() < 4 {
        return Err(CageError::TooSmall { vertices: vertices.len(), faces: faces.len() });
    }
    if let Some(vertex) = first_unusable(vertices) {
        return Err(CageError::NotFinite { vertex });
    }
    let mut places = HashMap::with_capacity(vertices.len());
    for (second, p) in vertices.iter().enumerate() {
        // Adding 0 makes −0 and 0 the same place.
        if let Some(first) = places.insert([p.x, p.y, p.z].map(|x| (x + 0.0).to_bits()), second) {
            return Err(CageError::CoincidentVertices { first, second });
        }
    }
    Ok(())
}

fn check_faces(vertices: &[Point], faces: &Polygons, pieces: &[Piece]) -> Result<(), CageError> {
    let mut used = vec![false; vertices.len()];
    for (face, corners) in faces.iter().enumerate() {
        for (i, &vertex) in corners.iter().enumerate() {
            if corners[..i].contains(&vertex) {
                return Err(CageError::RepeatedCorner { face, vertex: vertex as usize });
            }
            used[vertex as usize] = true;
        }
    }
    if let Some(vertex) = used.iter().position(|u| !u) {
        return Err(CageError::UnusedVertex { vertex });
    }
    let size = bounding_diagonal(vertices);
    for piece in pieces {
        let [a, b, c] = piece.corners.map(|v| vertices[v as usize]);
        let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
        // Twice the area is longest side times height: a height below rounding is no area.
        if (b - a).cross(&(c - a)).norm() <= 1e-13 * size * longest {
            return Err(CageError::DegenerateFace { face: piece.face });
        }
    }
    Ok(())
}

/// For each triangle side (corner k to k + 1): the triangle beyond, and whether it runs against us
/// as it should.
type Neighbours = Vec<[(usize, bool); 3]>;

fn check_edges(pieces: &[Piece]) -> Result<Neighbours, CageError> {
    let mut edges: HashMap<(u32, u32), Vec<(usize, usize)>> = HashMap::with_capacity(pieces.len() * 3 / 2);
    for (at, piece) in pieces.iter().enumerate() {
        for side in 0..3 {
            let (a, b) = (piece.corners[side], piece.corners[(side + 1) % 3]);
            edges.entry((a.min(b), a.max(b))).or_default().push((at, side));
        }
    }
    let mut neighbours = vec![[(0, true); 3]; pieces.len()];
    let mut faults: Vec<((u32, u32), CageError)> = Vec::new();
    for (&(a, b), sides) in &edges {
        let (a_index, b_index) = (a as usize, b as usize);
        match sides[..] {
            [(at, side), (other, other_side)] => {
                let agrees = pieces[at].corners[side] != pieces[other].corners[other_side];
                neighbours[at][side] = (other, agrees);
                neighbours[other][other_side] = (at, agrees);
            }
            [(at, _)] => {
                faults.push(((a, b), CageError::OpenEdge { a: a_index, b: b_index, face: pieces[at].face }));
            }
            _ => {
                let fault = CageError::NonManifoldEdge { a: a_index, b: b_index, count: sides.len() };
                faults.push(((a, b), fault));
            }
        }
    }
    // The first edge by index is named, so that the same cage always gets the same message.
    faults.into_iter().min_by_key(|(edge, _)| *edge).map_or(Ok(neighbours), |(_, fault)| Err(fault))
}

/// The triangles around each vertex must form one closed fan. Walks do not need orientation.
fn check_fans(pieces: &[Piece], vertices: usize) -> Result<(), CageError> {
    let mut around = vec![Vec::new(); vertices];
    for piece in pieces {
        for k in 0..3 {
            let [v, a, b] = [0, 1, 2].map(|i| piece.corners[(k + i) % 3]);
            around[v as usize].push((a, b));
        }
    }
    for (vertex, mut spokes) in around.into_iter().enumerate() {
        let mut fans = 0;
        while let Some((first, mut end)) = spokes.pop() {
            fans += 1;
            while end != first {
                let Some(next) = spokes.iter().position(|&(a, b)| a == end || b == end) else { break };
                let (a, b) = spokes.swap_remove(next);
                end = if a == end { b } else { a };
            }
        }
        if fans > 1 {
            return Err(CageError::NonManifoldVertex { vertex, fans });
        }
    }
    Ok(())
}

/// Walks each part from neighbour to neighbour; returns the part of each triangle. Where the walk
/// finds faces that run the other way, the fewer ones are the flipped ones.
fn check_orientation(pieces: &[Piece], neighbours: &Neighbours) -> Result<Vec<usize>, CageError> {
    let mut state: Vec<Option<(usize, bool)>> = vec![None; pieces.len()];
    let mut parts = 0;
    for start in 0..pieces.len() {
        if state[start].is_some() {
            continue;
        }
        state[start] = Some((parts, false));
        let mut part = vec![start];
        let mut next = 0;
        while let Some(&at) = part.get(next) {
            next += 1;
            let flip = state[at].is_some_and(|(_, flip)| flip);
            for (side, &(other, agrees)) in neighbours[at].iter().enumerate() {
                let wanted = flip == agrees;
                match state[other] {
                    None => {
                        state[other] = Some((parts, wanted));
                        part.push(other);
                    }
                    Some((_, found)) if found != wanted => {
                        let (a, b) =
                            (pieces[at].corners[side] as usize, pieces[at].corners[(side + 1) % 3] as usize);
                        return Err(CageError::NotOrientable { a: a.min(b), b: a.max(b) });
                    }
                    Some(_) => {}
                }
            }
        }
        refuse_flipped(pieces, &state, &part)?;
        parts += 1;
    }
    Ok(state.into_iter().map(|s| s.map_or(0, |(part, _)| part)).collect())
}

fn refuse_flipped(
    pieces: &[Piece],
    state: &[Option<(usize, bool)>],
    part: &[usize],
) -> Result<(), CageError> {
    let faces_with = |flip: bool| {
        let mut faces: Vec<usize> = part
            .iter()
            .filter(|&&t| state[t].is_some_and(|s| s.1 == flip))
            .map(|&t| pieces[t].face)
            .collect();
        faces.sort_unstable();
        faces.dedup();
        faces
    };
    let (ahead, against) = (faces_with(false), faces_with(true));
    let fewer = if against.len() <= ahead.len() { against } else { ahead };
    fewer.first().map_or(Ok(()), |&face| Err(CageError::FlippedFace { face, count: fewer.len() }))
}

/// Returns whether the cage as a whole is inside out.
fn check_volume(vertices: &[Point], pieces: &[Piece], parts: &[usize]) -> Result<bool, CageError> {
    let middle = vertices.iter().sum::<Point>() / vertices.len() as f64;
    let count = parts.iter().max().map_or(0, |last| last + 1);
    let mut volumes = vec![0.0; count];
    for (piece, &part) in pieces.iter().zip(parts) {
        let [a, b, c] = piece.corners.map(|v| vertices[v as usize] - middle);
        volumes[part] += a.dot(&b.cross(&c)) / 6.0;
    }
    let total: f64 = volumes.iter().sum();
    if volumes.iter().any(|v| v.abs() <= 1e-12 * bounding_diagonal(vertices).powi(3)) {
        return Err(CageError::NoVolume);
    }
    match parts.iter().position(|&part| (volumes[part] < 0.0) != (total < 0.0)) {
        Some(odd) => Err(CageError::InsideOutPart { face: pieces[odd].face }),
        None => Ok(total < 0.0),
    }
}
