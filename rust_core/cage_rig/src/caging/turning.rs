//! Sections turned by half a corner, where the cage comes out narrow.
//!
//! Where two limbs almost touch, a section's corners lie before and behind the place where the gap is
//! narrowest, and the faces that close the gap are as narrow. A corner at that place leaves the others
//! room: two sections that face each other with a corner each have wider faces beside it.

use super::report::{least_angle, NARROW};
use super::sections::Section;
use super::GeneratedCage;
use crate::points::Point;

/// Sections at the shortest sides of too narrow faces, and their mirror images.
pub(super) fn narrow(cage: &GeneratedCage) -> Vec<usize> {
    let report = &cage.report;
    if report.min_angle >= NARROW {
        return Vec::new();
    }
    let place = |v: usize| cage.vertices[v];
    let mut found = Vec::new();
    let mut from = 0;
    for size in &cage.faces.sizes {
        let face: Vec<usize> = cage.faces.corners[from..from + size].iter().map(|v| *v as usize).collect();
        from += size;
        for k in 1..size - 1 {
            let t = [face[0], face[k], face[k + 1]];
            if least_angle(t.map(place)) < NARROW {
                let side = |k: &usize| (place(t[*k]) - place(t[(k + 1) % 3])).norm();
                let shortest = (0..3).min_by(|a, b| side(a).total_cmp(&side(b))).unwrap_or(0);
                found.extend([t[shortest], t[(shortest + 1) % 3]]);
            }
        }
    }
    let images: Vec<usize> =
        report.mirror.iter().flat_map(|m| found.iter().map(|v| m[*v] as usize)).collect();
    found.extend(images);
    let mut sections: Vec<usize> = found.iter().map(|v| report.vertex_sections[*v]).collect();
    sections.sort_unstable();
    sections.dedup();
    sections
}

impl Section {
    /// With corners on the ring half way between those it has.
    pub(super) fn turned(&self) -> Self {
        let n = self.ring.len();
        let nearest = |p: &Point| {
            let apart = |k: &usize| (self.ring[*k] - p).norm();
            (0..n).min_by(|a, b| apart(a).total_cmp(&apart(b))).unwrap_or(0)
        };
        let places: Vec<usize> = self.corners.iter().map(nearest).collect();
        let between = |k: usize| {
            let (a, b) = (places[k], places[(k + 1) % places.len()]);
            self.ring[(a + ((b + n - a) % n) / 2) % n]
        };
        let corners: Vec<Point> = (0..places.len()).map(between).collect();
        let center = corners.iter().sum::<Point>() / corners.len() as f64;
        Self { ring: self.ring.clone(), corners, center }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_turned_by_half_a_corner_along_its_ring() {
        let place = |k: usize| {
            let (s, c) = (k as f64 * std::f64::consts::TAU / 20.0).sin_cos();
            Point::new(0.0, 2.0 * c, s)
        };
        let corners = [17, 3, 7, 13].map(place).to_vec();
        let section = Section { ring: (0..20).map(place).collect(), corners, center: Point::zeros() };
        let turned = section.turned();
        assert_eq!(turned.corners, [0, 5, 10, 15].map(place));
        assert!(turned.center.norm() < 1e-12);
    }
}
