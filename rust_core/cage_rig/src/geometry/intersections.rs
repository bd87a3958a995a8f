//! Do two triangles touch? Exact, with every degenerate case counted as touching.
//!
//! Segments against triangles by the sides of exact predicates; what lies in one plane is looked
//! at along the axis that sees the triangle best. Constant cost a pair.

use super::predicates::{side, turn};
use crate::points::Point;

/// Whether two triangles with no common corner share a point.
pub fn triangles_touch(a: [&Point; 3], b: [&Point; 3]) -> bool {
    if all_on_one_side(a, b) || all_on_one_side(b, a) {
        return false;
    }
    (0..3).any(|k| segment_touches(a[k], a[(k + 1) % 3], b) || segment_touches(b[k], b[(k + 1) % 3], a))
}

/// Whether two triangles of one mesh share a point beyond their common corners.
pub fn neighbours_touch(vertices: &[Point], a: [u32; 3], b: [u32; 3]) -> bool {
    let at = |v: u32| &vertices[v as usize];
    let shared: Vec<u32> = a.iter().copied().filter(|v| b.contains(v)).collect();
    let points = |t: [u32; 3]| t.map(at);
    match shared[..] {
        [] => triangles_touch(points(a), points(b)),
        [v] => {
            let opposite = |t: [u32; 3]| {
                let k = t.iter().position(|w| *w == v).unwrap_or(0);
                (at(t[(k + 1) % 3]), at(t[(k + 2) % 3]))
            };
            let ((p, q), (r, s)) = (opposite(a), opposite(b));
            segment_touches(p, q, points(b)) || segment_touches(r, s, points(a))
        }
        [v, w] => {
            let other = |t: [u32; 3]| t.iter().copied().find(|x| *x != v && *x != w).map(at);
            let (Some(p), Some(q)) = (other(a), other(b)) else { return true };
            side(at(v), at(w), p, q) == 0 && {
                let drop = widest([at(v), at(w), p]);
                let flat = |x: &Point| flatten(x, drop);
                turn(flat(at(v)), flat(at(w)), flat(p)) * turn(flat(at(v)), flat(at(w)), flat(q)) >= 0
            }
        }
        _ => true,
    }
}

/// Whether the closed segment `p` `q` touches the closed triangle.
pub fn segment_touches(p: &Point, q: &Point, [a, b, c]: [&Point; 3]) -> bool {
    let (from, to) = (side(a, b, c, p), side(a, b, c, q));
    if from == 0 && to == 0 {
        return touches_in_plane(p, q, [a, b, c]);
    }
    if from * to > 0 {
        return false;
    }
    let around = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
    around.iter().all(|s| *s >= 0) || around.iter().all(|s| *s <= 0)
}

fn all_on_one_side([a, b, c]: [&Point; 3], other: [&Point; 3]) -> bool {
    let sides = other.map(|p| side(a, b, c, p));
    sides.iter().all(|s| *s > 0) || sides.iter().all(|s| *s < 0)
}

fn touches_in_plane(p: &Point, q: &Point, triangle: [&Point; 3]) -> bool {
    let drop = widest(triangle);
    let [a, b, c] = triangle.map(|x| flatten(x, drop));
    let (p, q) = (flatten(p, drop), flatten(q, drop));
    let holds = |x: [f64; 2]| {
        let turns = [turn(a, b, x), turn(b, c, x), turn(c, a, x)];
        turns.iter().all(|t| *t >= 0) || turns.iter().all(|t| *t <= 0)
    };
    holds(p) || holds(q) || [(a, b), (b, c), (c, a)].iter().any(|(r, s)| segments_touch(p, q, *r, *s))
}

fn segments_touch(p: [f64; 2], q: [f64; 2], r: [f64; 2], s: [f64; 2]) -> bool {
    let boxes = (0..2).all(|k| p[k].min(q[k]) <= r[k].max(s[k]) && r[k].min(s[k]) <= p[k].max(q[k]));
    boxes && turn(p, q, r) * turn(p, q, s) <= 0 && turn(r, s, p) * turn(r, s, q) <= 0
}

/// The axis along which the triangle looks largest.
fn widest([a, b, c]: [&Point; 3]) -> usize {
    (b - a).cross(&(c - a)).iamax()
}

fn flatten(p: &Point, drop: usize) -> [f64; 2] {
    [p[(drop + 1) % 3], p[(drop + 2) % 3]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::random::Random;

    fn refs(t: &[Point; 3]) -> [&Point; 3] {
        [&t[0], &t[1], &t[2]]
    }

    #[test]
    fn a_pierced_triangle_touches_and_a_lifted_one_does_not() {
        let flat = [Point::zeros(), Point::new(4.0, 0.0, 0.0), Point::new(0.0, 4.0, 0.0)];
        let pin = [Point::new(1.0, 1.0, -1.0), Point::new(1.0, 1.0, 1.0), Point::new(1.0, 2.0, 1.0)];
        assert!(triangles_touch(refs(&flat), refs(&pin)));
        let lifted = pin.map(|p| p + Point::new(0.0, 0.0, 1.0 + 1e-15));
        assert!(!triangles_touch(refs(&flat), refs(&lifted)));
        let resting = pin.map(|p| p + Point::new(0.0, 0.0, 1.0));
        assert!(triangles_touch(refs(&flat), refs(&resting)));
    }

    #[test]
    fn the_answer_does_not_depend_on_order() {
        let mut random = Random::new(5);
        let mut touching = 0;
        for _ in 0..2000 {
            let a: [Point; 3] = [0; 3].map(|_| random.point());
            let b: [Point; 3] = [0; 3].map(|_| random.point());
            let found = triangles_touch(refs(&a), refs(&b));
            touching += usize::from(found);
            assert_eq!(found, triangles_touch(refs(&b), refs(&a)));
            assert_eq!(found, triangles_touch([&a[1], &a[0], &a[2]], [&b[2], &b[1], &b[0]]));
        }
        assert!(touching > 100);
    }

    #[test]
    fn neighbours_across_an_edge_touch_only_when_folded_flat() {
        let vertices = [
            Point::zeros(),
            Point::x(),
            Point::y(),
            Point::new(1.0, -1.0, 0.0),
            Point::new(0.2, 0.3, 0.0),
            Point::new(0.2, 0.3, 1e-12),
        ];
        assert!(!neighbours_touch(&vertices, [0, 1, 2], [1, 0, 3]));
        assert!(neighbours_touch(&vertices, [0, 1, 2], [1, 0, 4]));
        assert!(!neighbours_touch(&vertices, [0, 1, 2], [1, 0, 5]));
    }
}
