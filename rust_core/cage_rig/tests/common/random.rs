//! Random numbers and random rigs, the same for the same seed everywhere.

use super::{shapes, turn, Fixture};
use cage_rig::{Point, Polygons, Rows, Transform};

/// SplitMix64.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// In 0..1.
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    /// In the cube −1..1.
    pub fn point(&mut self) -> Point {
        Point::new(self.between(-1.0, 1.0), self.between(-1.0, 1.0), self.between(-1.0, 1.0))
    }
}

/// What a random rig is made of.
#[derive(Debug, Clone, Copy)]
pub struct Recipe {
    pub skin_vertices: usize,
    pub joints: usize,
    /// 0, 1 or 2: a cage of 12, 42 or 162 vertices.
    pub cage_level: usize,
    pub seed: u64,
}

/// Skin points anywhere in a bumpy cage; a forest in any order; weights with empty rows.
pub fn rig(recipe: Recipe) -> Fixture {
    let mut random = Random::new(recipe.seed);
    let (mut cage, cage_triangles) = shapes::icosphere(recipe.cage_level);
    cage.iter_mut().for_each(|c| *c *= random.between(1.2, 1.6));
    let inside = |random: &mut Random| random.point() * 0.55;
    let skin: Vec<Point> = (0..recipe.skin_vertices).map(|_| inside(&mut random)).collect();
    let triangles: Vec<[i64; 3]> = (2..skin.len() as i64).map(|i| [i - 2, i - 1, i]).collect();
    let joints: Vec<Point> = (0..recipe.joints).map(|_| inside(&mut random)).collect();
    let mut weights = Rows::zeros(skin.len(), recipe.joints);
    for i in 0..skin.len() {
        // One row in five is empty.
        let influences = if random.below(5) == 0 { 0 } else { 1 + random.below(4) };
        for _ in 0..influences {
            weights.row_mut(i)[random.below(recipe.joints)] = random.between(0.01, 2.0);
        }
    }
    Fixture {
        name: "random",
        skin,
        skin_faces: Polygons::from_triangles(&triangles),
        weights,
        parents: forest(recipe.joints, &mut random),
        joints,
        cage,
        cage_faces: Polygons::from_triangles(&cage_triangles),
    }
}

/// Parents of a random forest whose joints come in any order.
fn forest(count: usize, random: &mut Random) -> Vec<i64> {
    let mut order: Vec<usize> = (0..count).collect();
    (1..count).rev().for_each(|i| order.swap(i, random.below(i + 1)));
    let mut parents = vec![-1; count];
    for place in 1..count {
        if random.below(4) != 0 {
            parents[order[place]] = order[random.below(place)] as i64;
        }
    }
    parents
}

/// Turns by up to `angle`, scales by up to a fifth, moves by up to a tenth.
pub fn pose(fixture: &Fixture, angle: f64, seed: u64) -> Vec<Transform> {
    let mut random = Random::new(seed);
    let local: Vec<Transform> = fixture
        .joints
        .iter()
        .map(|a| {
            let mut local =
                turn(*a, random.point() + Point::new(0.0, 0.0, 2.0), random.between(-angle, angle));
            let scaled = local.linear * random.between(0.8, 1.2);
            local.translation += (local.linear - scaled) * a + random.point() * 0.1;
            local.linear = scaled;
            local
        })
        .collect();
    super::forward(fixture, &local)
}
