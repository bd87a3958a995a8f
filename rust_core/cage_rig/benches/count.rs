//! Work to be counted by valgrind, see `tests/bench/count.py`: `count SCENARIO REPEATS`, or nothing for the names.
//!
//! Instructions of many repeats less those of few are those of the work alone, on a noisy machine as on a quiet one.
//! Sizes are small: a counted instruction takes fifty times as long.
#![allow(clippy::print_stdout, missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;

use cage_rig::coordinates::mean_value;
use cage_rig::skinning::METHODS;
use cage_rig::sync::maxvol::{maxvol, MaxVolOptions};
use cage_rig::{unwatched, CoupledRig, Point, Transform};
use common::large::snake;
use common::random::Random;

const SCENARIOS: [&str; 10] =
    ["rest_skin", "keyed", "drag", "lbs", "dqs", "cor", "coordinates", "anchors", "first_edit", "next_edit"];
const JOINTS: usize = 24;

fn rig(method: usize) -> CoupledRig {
    let mut input = snake(100, 40, JOINTS, 20);
    input.method = &METHODS[method];
    CoupledRig::new(input).expect("a tube binds")
}

/// The upper half turned as one by `turn`: one joint is bent.
fn pose(rig: &CoupledRig, turn: f64) -> Vec<Transform> {
    let local = common::turn(rig.joints()[JOINTS / 2], Point::new(0.2, 0.1, 1.0), turn);
    (0..JOINTS).map(|j| if j < JOINTS / 2 { Transform::identity() } else { local }).collect()
}

/// The first vertices moved a little more: each by itself, so that no shapes make the cage up, or all alike.
fn moved<'a>(cage: &'a mut [Point], scenario: &str, random: &mut Random) -> &'a [Point] {
    let vertices = if scenario == "drag" { 1 } else { cage.len() };
    for c in cage.iter_mut().take(vertices) {
        c.y += if scenario == "keyed" { 1e-3 } else { random.between(5e-4, 2e-3) };
    }
    cage
}

fn run(scenario: &str, repeats: usize) {
    match scenario {
        "rest_skin" | "drag" | "keyed" => {
            let mut rig = rig(0);
            let mut cage = rig.rest_cage().to_vec();
            let mut random = Random::new(1);
            for _ in 0..repeats {
                rig.edit_rest_cage(moved(&mut cage, scenario, &mut random)).expect("a valid cage");
                assert!(rig.rest_skin()[0][0].is_finite());
            }
        }
        "lbs" | "dqs" | "cor" => {
            let index = METHODS.iter().position(|method| method.name == scenario).expect("a method");
            let mut rig = rig(index);
            for k in 0..repeats {
                let pose = pose(&rig, 0.1 + 0.1 * (k % 2) as f64);
                rig.pose(&pose, None).expect("a valid pose");
                assert!(rig.posed_skin()[0][0].is_finite());
            }
        }
        "coordinates" | "anchors" => {
            let input = snake(30, 20, JOINTS, 11);
            let coords =
                |_| unwatched(|part| mean_value::coordinates(&input.cage, &input.skin_vertices, part));
            if scenario == "coordinates" {
                (0..repeats).for_each(|k| assert!(coords(k).row(0)[0].is_finite()));
            } else {
                let coords = coords(0);
                let options = MaxVolOptions::default();
                (0..repeats)
                    .for_each(|_| assert!(unwatched(|part| maxvol(&coords, &options, part)).ratio <= 1.05));
            }
        }
        "first_edit" | "next_edit" => {
            let mut rig = rig(0);
            for k in 0..repeats {
                if scenario == "first_edit" || k == 0 {
                    let pose = pose(&rig, 0.1 + 0.1 * (k % 2) as f64);
                    rig.pose(&pose, None).expect("a valid pose");
                }
                let wanted: Vec<Point> = rig.posed_cage().iter().map(|c| c * 1.001).collect();
                rig.edit_posed_cage(&wanted).expect("a solvable pose");
            }
        }
        _ => SCENARIOS.iter().for_each(|name| println!("{name}")),
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|text| !text.starts_with("--")).collect();
    let repeats = arguments.get(1).and_then(|text| text.parse().ok()).unwrap_or(1);
    run(arguments.first().map_or("", String::as_str), repeats);
}
