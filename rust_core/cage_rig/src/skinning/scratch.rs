//! What a frame works with beside its input: kept from frame to frame, so that none allocates.

use super::blocks::Row;
use super::rotation::{matrix_of, rotation_of, Quaternion};
use crate::points::{Matrix3, Transform};
use std::ops::Range;

/// Scale and shear below this are rounding of single precision transforms.
const RIGID: f64 = 5e-7;
/// Rows start on cache lines.
const LINE: usize = 64;

/// The bones of a frame, as methods read them.
#[derive(Debug, Clone, Default)]
pub struct Scratch {
    turns: Vec<Turn>,
    bones: Vec<[f32; 4]>,
    pairs: Vec<[f32; 4]>,
}

/// L = R + rest: the rotation of a bone and what it does beside.
#[derive(Debug, Clone)]
pub(super) struct Turn {
    pub(super) quaternion: Quaternion,
    pub(super) rest: Matrix3,
}

impl Turn {
    fn new(linear: &Matrix3) -> Self {
        let quaternion = rotation_of(linear);
        Self { quaternion, rest: linear - matrix_of(quaternion) }
    }

    /// R.
    pub(super) fn matrix(&self) -> Matrix3 {
        matrix_of(self.quaternion)
    }
}

impl Scratch {
    /// One row of numbers for each bone, and for one after them that stands still.
    pub(super) fn table<const GROUPS: usize>(
        &mut self,
        transforms: &[Transform],
        row: impl Fn(&Transform) -> Row<GROUPS>,
    ) -> &[Row<GROUPS>] {
        let still = Transform::identity();
        let bone = |j: usize| row(transforms.get(j).unwrap_or(&still));
        fill(&mut self.bones, (0..transforms.len() + 1).map(bone))
    }

    /// Finds the rotations of `transforms` and of a bone after them that stands still. True if no bone
    /// scales or shears.
    pub(super) fn turn(&mut self, transforms: &[Transform]) -> bool {
        self.turns.clear();
        self.turns.extend(transforms.iter().map(|transform| Turn::new(&transform.linear)));
        self.turns.push(Turn::new(&Matrix3::identity()));
        self.turns.iter().all(|turn| turn.rest.amax() <= RIGID)
    }

    /// One row of numbers for each of `pairs` (pivot, bone) after [`Self::turn`]: that of the bone, with
    /// the sign in groups `signed` (of which the first is its quaternion) that is nearer to the pivot's.
    pub(super) fn paired<const GROUPS: usize>(
        &mut self,
        pairs: &[[u32; 2]],
        signed: Range<usize>,
        transforms: &[Transform],
        row: impl Fn(&Turn, &Transform) -> Row<GROUPS>,
    ) -> &[Row<GROUPS>] {
        let still = Transform::identity();
        let bone = |j: usize| row(&self.turns[j], transforms.get(j).unwrap_or(&still));
        let bones = fill(&mut self.bones, (0..transforms.len() + 1).map(bone));
        let quaternion = signed.start;
        let toward = |[pivot, joint]: &[u32; 2]| {
            let (pivot, mut row) = (&bones[*pivot as usize][quaternion], bones[*joint as usize]);
            let along: f32 = (0..4).map(|k| row[quaternion][k] * pivot[k]).sum();
            if along < 0.0 {
                row[signed.clone()].iter_mut().flatten().for_each(|x| *x = -*x);
            }
            row
        };
        fill(&mut self.pairs, pairs.iter().map(toward))
    }
}

/// Writes `rows` into `buffer`, from a cache line on.
fn fill<const GROUPS: usize>(
    buffer: &mut Vec<[f32; 4]>,
    rows: impl ExactSizeIterator<Item = Row<GROUPS>>,
) -> &[Row<GROUPS>] {
    let spare = LINE / size_of::<[f32; 4]>();
    let length = rows.len() * GROUPS;
    buffer.resize(length + spare, [0.0; 4]);
    let skipped = buffer.as_ptr().align_offset(LINE).min(spare);
    let table = buffer[skipped..][..length].as_chunks_mut().0;
    table.iter_mut().zip(rows).for_each(|(place, row)| *place = row);
    table
}
