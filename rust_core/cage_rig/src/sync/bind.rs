//! Bind: everything that is computed once, from the three meshes at rest.
//!
//! Φ, Ψ, anchors, the factors of CageUp and the packed frame arrays. Cost: `#M · #C` with a large
//! constant for Φ, `#M · #C²` for the anchors. What had to be done is told in a [`Report`].

use super::cage_updater::CageUpdater;
use super::joint_coordinates::{joint_coordinates, SkinAtRest};
use super::maxvol::{maxvol, ratio_of, MaxVol, MaxVolOptions};
use super::reach::reach;
use super::rest_centers::RestCenters;
use super::rest_skin::RestSkin;
use super::skeleton_updater::SkeletonUpdater;
use super::stages::Stages;
use crate::cage::Cage;
use crate::coordinates::CoordinateKind;
use crate::error::{Error, SkinError, WeightsError};
use crate::mesh::{triangulate, FaceFault, Polygons};
use crate::panels::Precision;
use crate::points::{bounding_diagonal, first_unusable, Point};
use crate::progress::{Cancelled, Part};
use crate::rows::Rows;
use crate::simd::Path;
use crate::skeleton::Skeleton;
use crate::skinning::centers::{centers, CenterOptions};
use crate::skinning::{FrameWeights, PackedWeights, SkinningMethod};
use crate::weights::SkinWeights;
use std::collections::HashSet;

/// What is bound. All in rig space.
#[derive(Debug, Clone)]
pub struct BindInput {
    /// M₀, `#M by 3`.
    pub skin_vertices: Vec<Point>,
    /// Faces of the skin, open or closed; may be empty.
    pub skin_faces: Polygons,
    /// Ω, `#M by #J`.
    pub skin_weights: SkinWeights,
    /// a₀ and the hierarchy.
    pub skeleton: Skeleton,
    /// C₀ and its faces.
    pub cage: Cage,
    /// How bones move the skin, to begin with.
    pub method: &'static SkinningMethod,
    /// How the cage moves the skin.
    pub coordinates: &'static CoordinateKind,
    /// What is already known and need not be computed.
    pub known: Known,
    /// Limits and exponents.
    pub options: BindOptions,
}

/// Results of an earlier bind, taken as they are.
#[derive(Debug, Clone, Default)]
pub struct Known {
    /// min(`#M`, `#C`) skin vertices.
    pub anchors: Option<Vec<i64>>,
    /// Φ, `#M by #C`.
    pub cage_coords: Option<Rows>,
    /// Ψ, `#J by #C`.
    pub joint_coords: Option<Rows>,
    /// Λ, `#M by #C`: taken by methods that turn about centers, whichever is chosen first.
    pub center_coords: Option<Rows>,
}

/// Limits and exponents of a bind.
#[derive(Debug, Clone, Copy)]
pub struct BindOptions {
    /// When the choice of anchors is good enough.
    pub maxvol: MaxVolOptions,
    /// s of Eq. (9); 0.1 as in the paper.
    pub locality_exponent: f64,
    /// τ of CageUp, relative to the largest singular value of Φ̃. Measured: cages that fit (the Arm,
    /// the biped) have no singular value below ten times the default; a biped cage inflated by 3 % of
    /// the height goes to 1e-4, and Eq. (8) throws it off by more than the height.
    pub min_singular: f64,
    /// How centers of rotation are integrated, when a method needs them.
    pub centers: CenterOptions,
    /// Outside the cage its effect falls to nothing over this many mean cage edges.
    pub falloff: f64,
    /// The instructions that frames use; the fastest that the processor has.
    pub path: Path,
    /// How frames keep Φ and Λ; single precision.
    pub precision: Precision,
}

impl Default for BindOptions {
    fn default() -> Self {
        Self {
            maxvol: MaxVolOptions::default(),
            locality_exponent: 0.1,
            min_singular: 5e-3,
            centers: CenterOptions::default(),
            falloff: 1.0,
            path: Path::default(),
            precision: Precision::default(),
        }
    }
}

/// What a bind found and did.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Report {
    /// The cage came inside out and was turned.
    pub cage_turned: bool,
    /// Joints outside the convex hull of the cage.
    pub joints_outside_hull: Vec<usize>,
    /// Joints whose bone has no weights, or blends with no other: plain cage coordinates.
    pub unweighted_joints: Vec<usize>,
    /// Skin vertices without weights, not moved by the skeleton.
    pub unweighted_vertices: usize,
    /// Skin vertices outside the cage, which it moves less.
    pub vertices_outside: usize,
    /// Those of them that are too far outside to be moved by it at all.
    pub vertices_out_of_reach: usize,
    /// max |Φ Φ̃⁻¹|.
    pub anchor_max_ratio: f64,
    /// Swaps MaxVol made.
    pub anchor_swaps: usize,
    /// Largest over smallest singular value of Φ̃.
    pub anchor_condition: f64,
    /// Directions of the posed cage that are attenuated toward the skinned cage.
    pub regularised: usize,
    /// max |Ψ C₀ − a₀|.
    pub joint_error_max: f64,
    /// max |Φ C₀ − M₀|.
    pub coordinate_error_max: f64,
}

/// Everything computed at bind; never changes.
#[derive(Debug, Clone)]
pub struct Binding {
    pub(super) cage: Cage,
    pub(super) cage_coords: Rows,
    pub(super) center_coords: Option<Rows>,
    /// How much of the cage's movement each vertex takes part in; none: all of it.
    pub(super) reach: Option<Vec<f32>>,
    pub(super) anchors: Vec<usize>,
    pub(super) rest_skin: RestSkin,
    pub(super) frame_weights: FrameWeights,
    pub(super) path: Path,
    packed_weights: PackedWeights,
    skin_triangles: Vec<[u32; 3]>,
    center_options: CenterOptions,
    pub(super) cage_updater: CageUpdater,
    pub(super) skeleton_updater: SkeletonUpdater,
    pub(super) report: Report,
    pub(super) size: f64,
}

impl Binding {
    /// Computes what is not known.
    pub fn new(input: BindInput, stages: &Stages) -> Result<Self, Error> {
        check_options(&input.options)?;
        let triangles = check_skin(&input)?;
        let BindInput { skin_vertices: skin, skin_weights: weights, skeleton, cage, known, options, .. } =
            input;
        let (rows, columns, joints) = (skin.len(), cage.vertices().len(), skeleton.len());

        stages.coordinates.begin("cage coordinates")?;
        let cage_coords = match checked(known.cage_coords, "cage_coords", rows, columns)? {
            Some(coords) if (0..rows).all(|i| coords.row(i).iter().all(|x| *x == 0.0)) => {
                return Err(Error::AllZero { argument: "cage_coords" })
            }
            Some(coords) => coords,
            None => (input.coordinates.compute)(&cage, &skin, &stages.coordinates)?,
        };
        let center_coords = checked(known.center_coords, "center_coords", rows, columns)?;
        let reach = reach(&cage, &skin, options.falloff, &stages.reach)?;
        if reach.iter().all(|part| *part == 0.0) {
            return Err(SkinError::OutOfReach.into());
        }
        stages.anchors.begin("anchors of the posed cage")?;
        let chosen = match known.anchors {
            Some(anchors) => given_anchors(&anchors, &cage_coords, &stages.anchors)?,
            None => choose_anchors(&cage_coords, &reach, &options.maxvol, &stages.anchors)?,
        };
        let mut report = Report {
            cage_turned: cage.turned(),
            unweighted_vertices: (0..rows).filter(|&i| weights.row(i).is_empty()).count(),
            vertices_outside: reach.iter().filter(|part| **part < 1.0).count(),
            vertices_out_of_reach: reach.iter().filter(|part| **part == 0.0).count(),
            anchor_max_ratio: chosen.ratio,
            anchor_swaps: chosen.swaps,
            coordinate_error_max: largest_miss(&cage_coords, cage.vertices(), &skin),
            ..Report::default()
        };
        let at_rest = SkinAtRest {
            vertices: &skin,
            triangles: &triangles,
            weights: &weights,
            cage_coords: &cage_coords,
            reach: &reach,
        };
        stages.joints.begin("joint coordinates")?;
        let joint_coords = match checked(known.joint_coords, "joint_coords", joints, columns)? {
            Some(coords) => coords,
            None => {
                let exponent = options.locality_exponent;
                let found = joint_coordinates(&cage, &at_rest, skeleton.joints(), exponent, &stages.joints)?;
                report.joints_outside_hull = found.outside_hull;
                report.unweighted_joints = found.without_locality;
                found.coords
            }
        };
        report.joint_error_max = largest_miss(&joint_coords, cage.vertices(), skeleton.joints());
        stages.posed_cage.begin("posed cage")?;
        let limit = options.min_singular;
        let cage_updater =
            CageUpdater::new(&chosen.rows, &at_rest, cage.vertices(), limit, &stages.posed_cage)?;
        report.anchor_condition = cage_updater.condition();
        report.regularised = cage_updater.attenuated();
        stages.frame.begin("what every frame needs")?;
        Ok(Self {
            center_coords,
            reach: (report.vertices_outside > 0).then(|| reach.iter().map(|part| *part as f32).collect()),
            anchors: chosen.rows,
            rest_skin: RestSkin::new(&skin, cage.vertices(), &cage_coords, options.precision, &stages.frame)?,
            frame_weights: FrameWeights::new(&weights),
            path: options.path,
            packed_weights: PackedWeights::new(&weights),
            skin_triangles: triangles,
            center_options: options.centers,
            cage_updater,
            skeleton_updater: SkeletonUpdater::new(skeleton, joint_coords),
            report,
            size: bounding_diagonal(&skin),
            cage_coords,
            cage,
        })
    }

    /// Frames keep Φ so from now on.
    pub(super) fn repack(&mut self, precision: Precision) {
        self.rest_skin.repack(&self.cage_coords, precision);
    }

    /// Centers of rotation under Λ = Φ_CoR Φ, `#M by #C`.
    pub(super) fn integrate_centers(&self, part: &Part) -> Result<RestCenters, Cancelled> {
        part.begin("centers of rotation")?;
        let [integrating, packing] = part.split([30.0, 1.0]);
        let (skin, weights) = (self.rest_skin.at_bind(), &self.packed_weights);
        let integrate = |values: &Rows| {
            centers(&skin, &self.skin_triangles, weights, values, &self.center_options, &integrating)
        };
        let Some(reach) = &self.reach else {
            return self.given_centers(integrate(&self.cage_coords)?, &packing);
        };
        // What the cage does not reach stays: Φ_CoR (reach Φ), and p₀ = Φ_CoR M₀ beside it.
        let columns = self.cage_coords.columns();
        let mut values = Rows::zeros(skin.len(), columns + 3);
        for (i, part) in reach.iter().enumerate() {
            let (coords, place) = values.row_mut(i).split_at_mut(columns);
            coords.iter_mut().zip(self.cage_coords.row(i)).for_each(|(x, phi)| *x = phi * f64::from(*part));
            place.iter_mut().zip(skin[i]).for_each(|(x, v)| *x = v.into());
        }
        let found = integrate(&values)?;
        let at_bind: Vec<Point> =
            (0..skin.len()).map(|i| Point::from_row_slice(&found.row(i)[columns..])).collect();
        let mut coords = Rows::zeros(skin.len(), columns);
        (0..skin.len()).for_each(|i| coords.row_mut(i).copy_from_slice(&found.row(i)[..columns]));
        RestCenters::new(coords, &at_bind, self.cage.vertices(), self.rest_skin.precision(), &packing)
    }

    /// Centers of rotation p₀ = Λ C₀ under a given Λ (`coords`, `#M by #C`).
    pub(super) fn given_centers(&self, coords: Rows, part: &Part) -> Result<RestCenters, Cancelled> {
        let cage = self.cage.vertices();
        let at_bind = coords.times(cage);
        RestCenters::new(coords, &at_bind, cage, self.rest_skin.precision(), part)
    }
}

fn check_options(options: &BindOptions) -> Result<(), Error> {
    let fail = |option, expected, found| Err(Error::Option { option, expected, found });
    if options.maxvol.max_ratio.is_nan() || options.maxvol.max_ratio < 1.0 {
        return fail("max_anchor_ratio", "at least 1", options.maxvol.max_ratio);
    }
    if !(options.locality_exponent > 0.0 && options.locality_exponent < 1.0) {
        return fail("locality_exponent", "between 0 and 1", options.locality_exponent);
    }
    if !(options.min_singular >= 0.0 && options.min_singular < 1.0) {
        return fail("min_singular", "at least 0 and below 1", options.min_singular);
    }
    if !(options.falloff > 0.0 && options.falloff.is_finite()) {
        return fail("falloff", "above 0", options.falloff);
    }
    if !(options.centers.sigma > 0.0 && options.centers.sigma.is_finite()) {
        return fail("center_sigma", "above 0", options.centers.sigma);
    }
    Ok(())
}

/// Checks that skin, weights and joints fit; returns the skin's triangles.
fn check_skin(input: &BindInput) -> Result<Vec<[u32; 3]>, Error> {
    let vertices = input.skin_vertices.len();
    if vertices == 0 {
        return Err(SkinError::Empty.into());
    }
    if let Some(row) = first_unusable(&input.skin_vertices) {
        return Err(Error::NotFinite { argument: "skin_vertices", row });
    }
    if input.skin_weights.len() != vertices {
        return Err(WeightsError::RowCount { expected: vertices, found: input.skin_weights.len() }.into());
    }
    if input.skin_weights.joints() != input.skeleton.len() {
        let (expected, found) = (input.skeleton.len(), input.skin_weights.joints());
        return Err(WeightsError::ColumnCount { expected, found }.into());
    }
    let pieces = triangulate(&input.skin_vertices, &input.skin_faces).map_err(|fault| match fault {
        FaceFault::FewCorners { face, corners } => SkinError::FewCorners { face, corners },
        FaceFault::BadIndex { face, vertex } => SkinError::BadIndex { face, vertex, vertices },
    })?;
    Ok(pieces.iter().map(|piece| piece.corners).collect())
}

fn checked(
    given: Option<Rows>,
    argument: &'static str,
    rows: usize,
    columns: usize,
) -> Result<Option<Rows>, Error> {
    let Some(given) = given else { return Ok(None) };
    if given.columns() != columns {
        return Err(Error::Size { argument, unit: "columns", expected: columns, found: given.columns() });
    }
    if given.len() != rows {
        return Err(Error::Size { argument, unit: "rows", expected: rows, found: given.len() });
    }
    match given.first_unusable() {
        Some(row) => Err(Error::NotFinite { argument, row }),
        None => Ok(Some(given)),
    }
}

/// Anchors among the skin that the cage moves wholly, or mostly where that is too little: far outside,
/// coordinates are large and would be chosen first.
fn choose_anchors(
    cage_coords: &Rows,
    reach: &[f64],
    options: &MaxVolOptions,
    part: &Part,
) -> Result<MaxVol, Cancelled> {
    for least in [1.0, 0.5, f64::MIN_POSITIVE] {
        let within: Vec<usize> = (0..reach.len()).filter(|&i| reach[i] >= least).collect();
        if within.len() == reach.len() {
            break;
        }
        if within.len() >= cage_coords.columns() {
            let mut chosen = maxvol(&cage_coords.select(&within), options, part)?;
            chosen.rows.iter_mut().for_each(|row| *row = within[*row]);
            return Ok(chosen);
        }
    }
    maxvol(cage_coords, options, part)
}

fn given_anchors(anchors: &[i64], cage_coords: &Rows, part: &Part) -> Result<MaxVol, Error> {
    let vertices = cage_coords.len();
    let wanted = vertices.min(cage_coords.columns());
    if anchors.len() != wanted {
        return Err(Error::Size {
            argument: "anchors",
            unit: "entries",
            expected: wanted,
            found: anchors.len(),
        });
    }
    let mut seen = HashSet::with_capacity(wanted);
    let mut rows = Vec::with_capacity(wanted);
    for &vertex in anchors {
        let row = usize::try_from(vertex).ok().filter(|&v| v < vertices);
        let row = row.ok_or(SkinError::BadAnchor { vertex, vertices })?;
        if !seen.insert(row) {
            return Err(SkinError::RepeatedAnchor { vertex: row }.into());
        }
        rows.push(row);
    }
    let ratio = if wanted == vertices { 1.0 } else { ratio_of(cage_coords, &rows, part)? };
    Ok(MaxVol { rows, ratio, swaps: 0 })
}

fn largest_miss(coords: &Rows, cage: &[Point], points: &[Point]) -> f64 {
    let found = coords.times(cage);
    found.iter().zip(points).map(|(f, p)| (f - p).norm()).fold(0.0, f64::max)
}
