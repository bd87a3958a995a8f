//! Errors: facts about the input that the user can act on, each with its numbers.
//!
//! One enum for each thing a user brings (cage, skin, weights, skeleton, pose). They are raised
//! where input enters; an edit that returns one has changed nothing.

use crate::points::Point;
use crate::progress::Cancelled;
use thiserror::Error;

/// Anything that can be wrong with what was handed in.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// The cage cannot enclose anything.
    #[error(transparent)]
    Cage(#[from] CageError),
    /// The skin mesh is malformed.
    #[error(transparent)]
    Skin(#[from] SkinError),
    /// The skin weights are malformed.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The skeleton is malformed.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// An edit cannot be carried out.
    #[error(transparent)]
    Pose(#[from] PoseError),
    /// Whoever asked for the work wants it no more.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// No cage can be generated.
    #[error(transparent)]
    Caging(#[from] CagingError),
    /// An argument names no member of a family.
    #[error("there is no {family} named {name:?}; known: {known}")]
    UnknownName {
        /// What was looked up ("skinning method", "coordinates").
        family: &'static str,
        /// The name given.
        name: String,
        /// The names that exist, comma separated.
        known: String,
    },
    /// A precomputed matrix or list has the wrong size.
    #[error("{argument} must have {expected} {unit}, found {found}")]
    Size {
        /// The argument's name.
        argument: &'static str,
        /// What is counted ("rows", "columns", "entries").
        unit: &'static str,
        /// How many there must be.
        expected: usize,
        /// How many there are.
        found: usize,
    },
    /// A number is NaN, infinite, or beyond [`crate::LARGEST`].
    #[error("{argument} has a value that is not finite or beyond 1e12 in row {row}")]
    NotFinite {
        /// The argument's name.
        argument: &'static str,
        /// The first such row.
        row: usize,
    },
    /// A matrix moves nothing.
    #[error("{argument} is zero everywhere, so the cage would move nothing")]
    AllZero {
        /// The argument's name.
        argument: &'static str,
    },
    /// An option is out of its range.
    #[error("option {option} must be {expected}, found {found}")]
    Option {
        /// The option's name.
        option: &'static str,
        /// The range in words.
        expected: &'static str,
        /// The value given.
        found: f64,
    },
}

/// Why a mesh cannot serve as a cage. Faces are counted as the caller gave them.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs)] // every field is the number that its message prints
pub enum CageError {
    #[error("the cage has {vertices} vertices and {faces} faces; a closed cage needs at least 4 of each")]
    TooSmall { vertices: usize, faces: usize },
    #[error("cage face {face} has {corners} corners; a face needs at least 3")]
    FewCorners { face: usize, corners: usize },
    #[error("cage face {face} uses vertex {vertex}, but the cage has {vertices} vertices")]
    BadIndex { face: usize, vertex: i64, vertices: usize },
    #[error("cage face {face} uses vertex {vertex} twice")]
    RepeatedCorner { face: usize, vertex: usize },
    #[error("cage vertex {vertex} has a coordinate that is not finite or beyond 1e12")]
    NotFinite { vertex: usize },
    #[error("cage vertex {vertex} belongs to no face")]
    UnusedVertex { vertex: usize },
    #[error("cage vertices {first} and {second} are at the same place")]
    CoincidentVertices { first: usize, second: usize },
    #[error("cage face {face} has no area")]
    DegenerateFace { face: usize },
    #[error("the cage is open: edge {a}-{b} belongs to face {face} only")]
    OpenEdge { a: usize, b: usize, face: usize },
    #[error("the cage is not manifold: edge {a}-{b} belongs to {count} faces")]
    NonManifoldEdge { a: usize, b: usize, count: usize },
    #[error("the cage is not manifold: its faces meet at vertex {vertex} in {fans} separate fans")]
    NonManifoldVertex { vertex: usize, fans: usize },
    #[error("cage face {face} is flipped against its neighbours ({count} flipped in all)")]
    FlippedFace { face: usize, count: usize },
    #[error("the cage has one side only: no orientation of its faces agrees at edge {a}-{b}")]
    NotOrientable { a: usize, b: usize },
    #[error("the part of the cage that holds face {face} is inside out against the rest")]
    InsideOutPart { face: usize },
    #[error("the cage encloses no volume")]
    NoVolume,
    #[error("there is no cage vertex {vertex}; the cage has {vertices} vertices")]
    NoSuchVertex { vertex: i64, vertices: usize },
}

/// Why a mesh cannot serve as a skin.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs)]
pub enum SkinError {
    #[error("the skin has no vertices")]
    Empty,
    #[error("skin face {face} has {corners} corners; a face needs at least 3")]
    FewCorners { face: usize, corners: usize },
    #[error("skin face {face} uses vertex {vertex}, but the skin has {vertices} vertices")]
    BadIndex { face: usize, vertex: i64, vertices: usize },
    #[error("the offsets of the rest skin have {found} rows; the skin has {expected} vertices")]
    OffsetCount { expected: usize, found: usize },
    #[error("row {row} of the offsets of the rest skin is not finite or beyond 1e12")]
    OffsetNotFinite { row: usize },
    #[error("the cage encloses no vertex of the skin; the cage and the skin must be at the same place")]
    OutOfReach,
    #[error("the mask of the skin has {found} entries; the skin has {expected} vertices")]
    MaskCount { expected: usize, found: usize },
    #[error("entry {row} of the mask of the skin is {found}; a mask is from 0 to 1")]
    MaskRange { row: usize, found: f32 },
    #[error("anchor {vertex} is not a skin vertex (there are {vertices})")]
    BadAnchor { vertex: i64, vertices: usize },
    #[error("anchor {vertex} is listed twice")]
    RepeatedAnchor { vertex: usize },
}

/// Why weights cannot bind a skin to joints.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs)]
pub enum WeightsError {
    #[error("the weight of vertex {vertex} for joint {joint} is negative ({weight})")]
    Negative { vertex: usize, joint: usize, weight: f64 },
    #[error("the weight of vertex {vertex} for joint {joint} is not a finite number up to 1e12")]
    NotFinite { vertex: usize, joint: usize },
    #[error("vertex {vertex} has a weight for joint {joint}, but there are {joints} joints")]
    BadJoint { vertex: usize, joint: i64, joints: usize },
    #[error("the weights have {found} rows; the skin has {expected} vertices")]
    RowCount { expected: usize, found: usize },
    #[error("the weights have {found} columns; the skeleton has {expected} joints")]
    ColumnCount { expected: usize, found: usize },
    #[error("indptr must start at 0, never fall, and end at the number of weights ({data}); entry {entry} breaks this")]
    BadIndptr { entry: usize, data: usize },
    #[error("there are {indices} joint indices for {data} weights")]
    Lengths { indices: usize, data: usize },
}

/// Why joints and parents are no skeleton.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs)]
pub enum SkeletonError {
    #[error("the skeleton has no joints")]
    Empty,
    #[error("there are {parents} parents for {joints} joints")]
    ParentCount { joints: usize, parents: usize },
    #[error("joint {joint} has parent {parent}, but there are {joints} joints (-1 marks a root)")]
    BadParent { joint: usize, parent: i64, joints: usize },
    #[error("joint {joint} is its own ancestor")]
    Cycle { joint: usize },
    #[error("joint {joint} has a coordinate that is not finite or beyond 1e12")]
    NotFinite { joint: usize },
}

/// Why an edit cannot be carried out. The rig is as it was before.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs)]
pub enum PoseError {
    #[error("there are {found} transforms; the skeleton has {expected} joints")]
    TransformCount { expected: usize, found: usize },
    #[error("the transform of joint {joint} has a value that is not finite or beyond 1e12")]
    TransformNotFinite { joint: usize },
    #[error("the transform of joint {joint} is not affine: its last row must be 0 0 0 1")]
    NotAffine { joint: usize },
    #[error("there are {found} rows for the frames to fill; they have {expected}")]
    FrameRows { expected: usize, found: usize },
    #[error("there are {found} rest joints; the skeleton has {expected} joints")]
    JointCount { expected: usize, found: usize },
    #[error("rest joint {joint} has a coordinate that is not finite or beyond 1e12")]
    JointNotFinite { joint: usize },
    #[error("the edited cage has {found} vertices; the bound one has {expected}")]
    CageCount { expected: usize, found: usize },
    #[error("vertex {vertex} of the edited cage has a coordinate that is not finite or beyond 1e12")]
    CageNotFinite { vertex: usize },
    #[error("in this pose the posed cage cannot be edited: a bone is squashed flat, so no rest cage gives the wanted one (pivot ratio {pivot_ratio:.1e})")]
    Singular { pivot_ratio: f64 },
    #[error("in this pose the posed cage cannot be edited: the closest rest cage misses the wanted one by {miss:.1e} of the size")]
    Unreachable { miss: f64 },
}

/// Why no cage was generated. Each fault names its place where it has one.
#[derive(Debug, Clone, PartialEq, Error)]
#[allow(missing_docs)]
pub enum CagingError {
    #[error("the skin has no faces to put a cage around")]
    SkinEmpty,
    #[error("skin face {face} has {corners} corners; a face needs at least 3")]
    FewCorners { face: usize, corners: usize },
    #[error("skin face {face} uses vertex {vertex}, but the skin has {vertices} vertices")]
    BadIndex { face: usize, vertex: i64, vertices: usize },
    #[error("skin vertex {vertex} has a coordinate that is not finite or beyond 1e12")]
    SkinNotFinite { vertex: usize },
    #[error("the skin is open at edge {a}-{b}, near {}; close it, or cage a voxel-remeshed copy", at(.place))]
    OpenSkin { a: usize, b: usize, place: Point },
    #[error("the skin is not manifold: edge {a}-{b}, near {}, belongs to {count} faces; a voxel-remeshed copy can be caged", at(.place))]
    NonManifoldSkin { a: usize, b: usize, count: usize, place: Point },
    #[error("the faces of the skin have no common orientation near {}", at(.place))]
    NotOrientable { place: Point },
    #[error("the skin encloses no volume")]
    NoVolume,
    #[error("the skeleton has no nodes or no edges")]
    SkeletonEmpty,
    #[error("skeleton node {node} has a coordinate that is not finite or beyond 1e12")]
    NodeNotFinite { node: usize },
    #[error("skeleton edge {edge} names node {node}, but there are {nodes} nodes")]
    BadEdge { edge: usize, node: i64, nodes: usize },
    #[error("no part of the skeleton is inside the skin")]
    SkeletonOutside,
    #[error("bending node {row} has a coordinate that is not finite or beyond 1e12")]
    BendingNotFinite { row: usize },
    #[error("the skeleton is too short for a cage: it has {sections} cross sections and needs at least 2")]
    TooFewSections { sections: usize },
    #[error("no cross section was found at control node {node}, near {}; move it along its bone", at(.place))]
    NoSection { node: usize, place: Point },
    #[error("the cage crosses itself before it starts to grow, near control node {node} at {}; move that node or its neighbours apart", at(.place))]
    NoStart { node: usize, place: Point },
    #[error("the cage can't grow around the skin near control node {node} at {}: a bending node is needed there", at(.place))]
    Stuck { node: usize, place: Point },
    #[error("the cage was refused by the final check near control node {node} at {}: {fault}; a bending node is needed there", at(.place))]
    NotValid { node: usize, place: Point, fault: &'static str },
    #[error("the cage to be like has no cross sections that its faces join")]
    NoSections,
    #[error("the cage to be like has {wanted} corners in a cross section, not {found}")]
    OtherCorners { wanted: usize, found: usize },
    #[error("nothing here is like the part of the other cage at its cross section {section}")]
    Unlike { section: usize },
    #[error("the other cage has {wanted} cross sections from number {section} on, with these nodes there are {found}")]
    OtherNodes { section: usize, wanted: usize, found: usize },
    #[error("the rough cage can't be fitted: {0}")]
    Rough(#[from] CageError),
    #[error("the rough cage crosses itself at vertex {vertex}, near {}; pull its faces apart there", at(.place))]
    RoughCrosses { vertex: usize, place: Point },
    #[error("the rough cage leaves out the middle of the skin near skeleton node {node} at {}; bring its faces around it", at(.place))]
    RoughMisses { node: usize, place: Point },
    #[error("the rough cage can't be drawn around the skin near skeleton node {node} at {}: it needs more faces there", at(.place))]
    RoughStuck { node: usize, place: Point },
    #[error("option {name} is {value}; it must be between {low} and {high}")]
    Option { name: &'static str, value: f64, low: f64, high: f64 },
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl CagingError {
    /// Whether skin and skeleton were sound and the cage in between failed.
    pub(crate) fn is_of_growth(&self) -> bool {
        matches!(
            self,
            Self::NoStart { .. } | Self::Stuck { .. } | Self::NotValid { .. } | Self::NoSection { .. }
        )
    }

    /// The section of a cage to be like that has no counterpart.
    pub fn section(&self) -> Option<usize> {
        match self {
            Self::Unlike { section } | Self::OtherNodes { section, .. } => Some(*section),
            _ => None,
        }
    }

    /// Where it is: the control or skeleton node, if one is meant, and a point in the skin's space.
    pub fn place(&self) -> (Option<usize>, Option<Point>) {
        match self {
            Self::NoSection { node, place }
            | Self::NoStart { node, place }
            | Self::Stuck { node, place }
            | Self::RoughMisses { node, place }
            | Self::RoughStuck { node, place }
            | Self::NotValid { node, place, .. } => (Some(*node), Some(*place)),
            Self::OpenSkin { place, .. }
            | Self::NonManifoldSkin { place, .. }
            | Self::RoughCrosses { place, .. }
            | Self::NotOrientable { place } => (None, Some(*place)),
            Self::NodeNotFinite { node } => (Some(*node), None),
            _ => (None, None),
        }
    }
}

fn at(place: &Point) -> String {
    format!("({:.4}, {:.4}, {:.4})", place.x, place.y, place.z)
}
