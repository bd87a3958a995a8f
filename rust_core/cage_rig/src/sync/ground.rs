//! What the rest shape stands on beside the rest cage: where the cage acts, what the visible skin
//! is offset by, and what a lower cage on the same character has done already.

use super::bind::Binding;
use super::reach::Surroundings;
use super::rest_skin::Confines;
use crate::points::{to_f32, Point};
use crate::progress::{unwatched, Cancelled, Part};

/// A lower cage's movement of what this rig was bound to.
#[derive(Debug, Clone, PartialEq)]
pub struct Carried {
    /// Of the cage vertices, `#C by 3`.
    pub cage: Vec<Point>,
    /// Of the joints, `#J by 3`.
    pub joints: Vec<Point>,
}

/// Masks, offsets and a lower cage's movement.
#[derive(Debug, Clone)]
pub(super) struct Ground {
    mask: Option<Vec<f32>>,
    shares: Vec<f64>,
    surroundings: Option<Surroundings>,
    offsets: Option<Vec<[f32; 3]>>,
    carried: Option<Carried>,
}

impl Ground {
    /// As bound: the cage acts where it reaches.
    pub fn new(binding: &Binding, part: &Part) -> Result<Self, Cancelled> {
        let joints = binding.skeleton_updater.skeleton().len();
        let mut ground =
            Self { mask: None, shares: vec![1.0; joints], surroundings: None, offsets: None, carried: None };
        if binding.reach.is_some() {
            ground.surroundings = Some(surroundings(binding, part)?);
            ground.set_mask(binding, None);
        }
        Ok(ground)
    }

    /// Confines the cage to `mask` (`#M`, 0 to 1; none: wherever it reaches). True if that is a change.
    pub fn set_mask(&mut self, binding: &Binding, mask: Option<&[f32]>) -> bool {
        let mask = match (mask, &binding.reach) {
            (Some(mask), Some(reach)) => Some(mask.iter().zip(reach).map(|(m, r)| m * r).collect()),
            (Some(mask), None) => Some(mask.to_vec()),
            (None, reach) => reach.clone(),
        };
        let mask = mask.filter(|mask: &Vec<f32>| mask.iter().any(|part| *part != 1.0));
        if mask == self.mask {
            return false;
        }
        self.shares = match &mask {
            None => vec![1.0; self.shares.len()],
            Some(mask) => self
                .surroundings
                .get_or_insert_with(|| unwatched(|part| surroundings(binding, part)))
                .joints(mask),
        };
        self.mask = mask;
        true
    }

    /// Offsets the visible skin by `offsets` (`#M by 3`). True if that is a change.
    pub fn set_offsets(&mut self, offsets: Option<&[Point]>) -> bool {
        let offsets = offsets.filter(|o| o.iter().any(|p| *p != Point::zeros())).map(to_f32);
        let changed = offsets != self.offsets;
        self.offsets = offsets;
        changed
    }

    /// Takes over what a lower cage does. True if that is a change.
    pub fn set_carried(&mut self, carried: Option<Carried>) -> bool {
        let changed = carried != self.carried;
        self.carried = carried;
        changed
    }

    /// Of the cage's movement, the part at each joint.
    pub fn shares(&self) -> &[f64] {
        &self.shares
    }

    /// Of the cage's movement, the part at each skin vertex; none: all of it.
    pub fn mask(&self) -> Option<&[f32]> {
        self.mask.as_deref()
    }

    /// What takes part in the rest skin beside the cage.
    pub fn confines<'a>(&'a self, binding: &Binding) -> Confines<'a> {
        let (mask, offsets) = (self.mask.as_deref(), self.offsets.as_deref());
        Confines { path: binding.path, mask, offsets }
    }

    /// The rest cage `cage` where the lower cage has carried it, `#C by 3`.
    pub fn cage(&self, cage: &[Point]) -> Vec<Point> {
        let mut carried = Vec::new();
        self.cage_into(cage, &mut carried);
        carried
    }

    /// The same, written into `out`.
    pub fn cage_into(&self, cage: &[Point], out: &mut Vec<Point>) {
        out.clear();
        out.extend_from_slice(cage);
        self.carried.iter().for_each(|carried| add(out, &carried.cage));
    }

    /// Rest joints of the rest cage `cage` (`#C by 3`), Eq. (13).
    pub fn joints(&self, binding: &Binding, cage: &[Point]) -> Vec<Point> {
        let mut joints = Vec::new();
        self.joints_into(binding, cage, &mut joints);
        joints
    }

    /// The same, written into `out`.
    pub fn joints_into(&self, binding: &Binding, cage: &[Point], out: &mut Vec<Point>) {
        binding.skeleton_updater.joints_into(cage, &self.shares, out);
        self.carried.iter().for_each(|carried| add(out, &carried.joints));
    }
}

fn surroundings(binding: &Binding, part: &Part) -> Result<Surroundings, Cancelled> {
    let joints = binding.skeleton_updater.skeleton().joints();
    Surroundings::new(&binding.rest_skin.at_bind(), joints, part)
}

fn add(sum: &mut [Point], other: &[Point]) {
    sum.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
}
