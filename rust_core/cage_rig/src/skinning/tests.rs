//! What every skinning method must do, by being in the table.

use super::naive::ORACLES;
use super::{method, FrameWeights, Scratch, SkinningInput, SkinningMethod, METHODS};
use crate::fixtures::{self, arm, random, Fixture};
use crate::points::{to_f32, Matrix3, Point, Transform};
use crate::rows::Rows;
use crate::simd::Path;
use crate::skinning::lbs::pose_steps_into;
use crate::weights::SkinWeights;

/// The frame path must stay this near to double precision, relative to the size.
const FRAME: f64 = 2e-6;
/// The paths of different processors must stay this near to each other.
const PATHS: f64 = 1e-6;

fn weights(fixture: &Fixture) -> SkinWeights {
    SkinWeights::from_dense(&fixture.weights).expect("valid weights")
}

/// Any centers will do: what methods promise does not depend on them.
fn centers(fixture: &Fixture) -> Vec<Point> {
    fixtures::nudged(&fixture.skin, 0.1 * fixture.size(), 11)
}

fn posed(method: &SkinningMethod, fixture: &Fixture, transforms: &[Transform]) -> Vec<[f32; 3]> {
    posed_about(method, fixture, transforms, &centers(fixture))
}

/// On the fastest path; the others must agree.
fn posed_about(
    method: &SkinningMethod,
    fixture: &Fixture,
    transforms: &[Transform],
    centers: &[Point],
) -> Vec<[f32; 3]> {
    let weights = FrameWeights::new(&weights(fixture));
    let (rest, centers) = (to_f32(&fixture.skin), to_f32(centers));
    let on = |path| {
        let mut out = vec![[f32::NAN; 3]; rest.len()];
        let input =
            SkinningInput { path, transforms, weights: &weights, rest_skin: &rest, centers: &centers };
        (method.pose)(&input, &mut Scratch::default(), &mut out);
        out
    };
    let found = on(Path::default());
    let exact = fixtures::points(&found);
    let size = size(fixture, &exact);
    for path in Path::available() {
        let apart = fixtures::distance(&fixtures::points(&on(path)), &exact);
        assert!(apart <= PATHS * size, "{} {} {}: {apart:e}", method.name, path.name(), fixture.name);
    }
    found
}

/// The project's fixtures and some random ones (forests, empty rows, one bone, many).
fn rigs() -> Vec<Fixture> {
    let mut rigs = fixtures::all();
    for seed in 0..12 {
        let (skin_vertices, joints) = ([60, 2, 7, 8, 33, 95][seed as usize % 6], 1 + 3 * seed as usize);
        rigs.push(random::rig(random::Recipe { skin_vertices, joints, cage_level: 0, seed }));
    }
    rigs
}

/// Frame against oracle, relative to the size of the posed skin.
fn frame_error(method: &SkinningMethod, fixture: &Fixture, transforms: &[Transform]) -> f64 {
    let oracle = ORACLES.iter().find(|(name, _)| *name == method.name).expect("every method has an oracle").1;
    let expected = oracle(transforms, &normalised(fixture), &fixture.skin, &centers(fixture));
    let frame = fixtures::points(&posed(method, fixture, transforms));
    fixtures::distance(&frame, &expected) / size(fixture, &expected)
}

/// What tolerances are relative to: the skin at rest or posed, whichever is larger.
fn size(fixture: &Fixture, posed: &[Point]) -> f64 {
    let alone = if posed.len() == 1 { crate::bounding_diagonal(&fixture.cage) } else { 0.0 };
    fixture.size().max(crate::bounding_diagonal(posed)).max(alone)
}

/// The reflection x ↦ c − x along the first axis.
fn mirror() -> Transform {
    let linear = Matrix3::from_diagonal(&Point::new(-1.0, 1.0, 1.0));
    Transform { linear, translation: Point::new(0.4, 0.0, 0.0) }
}

fn normalised(fixture: &Fixture) -> Rows {
    super::naive::normalised(&fixture.weights)
}

#[test]
fn identity_pose_leaves_the_rest_pose() {
    for method in METHODS {
        for fixture in rigs() {
            let identity = vec![Transform::identity(); fixture.joints.len()];
            assert_eq!(posed(method, &fixture, &identity), to_f32(&fixture.skin), "{}", fixture.name);
        }
    }
}

#[test]
fn any_number_of_vertices_and_influences_agrees_with_the_oracle() {
    let mut random = random::Random::new(12);
    for influences in 0..=12 {
        for count in [1, 2, 5, 31, 32, 33, 64, 100] {
            let mut fixture = random::rig(random::Recipe {
                skin_vertices: count,
                joints: 14,
                cage_level: 0,
                seed: influences as u64,
            });
            for i in 0..count {
                fixture.weights.row_mut(i).fill(0.0);
                // Every vertex its own number, up to so many.
                for k in 0..influences * (i + 1) / count {
                    fixture.weights.row_mut(i)[(3 * k + i) % 14] = random.between(0.01, 1.0);
                }
            }
            let pose = random::pose(&fixture, 2.0, 4);
            for method in METHODS {
                let error = frame_error(method, &fixture, &pose);
                assert!(error <= FRAME, "{} {influences} {count}: {error:e}", method.name);
            }
        }
    }
}

#[test]
fn one_rigid_motion_for_all_bones_moves_weighted_vertices_rigidly() {
    for method in METHODS {
        for fixture in rigs() {
            let motion = fixtures::turn(Point::new(0.3, 0.2, 0.1), Point::new(1.0, 2.0, 3.0), 2.0);
            let moved = fixtures::points(&posed(method, &fixture, &vec![motion; fixture.joints.len()]));
            let weights = weights(&fixture);
            for (i, v) in fixture.skin.iter().enumerate() {
                let wanted = if weights.row(i).is_empty() { *v } else { motion.apply(v) };
                assert!((moved[i] - wanted).norm() <= FRAME * fixture.size(), "{} {i}", fixture.name);
            }
        }
    }
}

#[test]
fn every_method_agrees_with_its_oracle_to_frame_precision() {
    for method in METHODS {
        for fixture in rigs() {
            for (pose, what) in [
                (fixtures::lively_pose(&fixture, 1.0), "lively"),
                (random::pose(&fixture, 3.1, 5), "random"),
                (fixtures::compose_all(&mirror(), &random::pose(&fixture, 2.0, 6)), "mirrored"),
            ] {
                let error = frame_error(method, &fixture, &pose);
                assert!(error <= FRAME, "{} {} {what}: {error:e}", method.name, fixture.name);
            }
        }
    }
}

#[test]
fn vertices_of_one_bone_go_where_the_bone_takes_them() {
    for method in METHODS {
        for mut fixture in rigs() {
            let joints = fixture.joints.len();
            for i in 0..fixture.skin.len() {
                fixture.weights.row_mut(i).fill(0.0);
                fixture.weights.row_mut(i)[i % joints] = 0.7;
            }
            let pose = fixtures::compose_all(&mirror(), &random::pose(&fixture, 3.1, 7));
            let moved = fixtures::points(&posed(method, &fixture, &pose));
            let wanted: Vec<Point> =
                fixture.skin.iter().enumerate().map(|(i, v)| pose[i % joints].apply(v)).collect();
            let size = fixture.size().max(crate::bounding_diagonal(&wanted));
            assert!(fixtures::distance(&moved, &wanted) <= FRAME * size, "{} {}", method.name, fixture.name);
        }
    }
}

#[test]
fn one_affine_map_for_all_bones_moves_weighted_vertices_by_it() {
    let linear = fixtures::rotation(Point::new(1.0, 2.0, 3.0), 2.0)
        * Matrix3::new(1.2, 0.3, 0.0, 0.3, 0.8, 0.1, 0.0, 0.1, 1.5);
    let map = Transform { linear, translation: Point::new(0.3, 0.2, 0.1) };
    for method in METHODS {
        for fixture in rigs() {
            let moved = fixtures::points(&posed(method, &fixture, &vec![map; fixture.joints.len()]));
            for (i, v) in
                fixture.skin.iter().enumerate().filter(|(i, _)| !weights(&fixture).row(*i).is_empty())
            {
                assert!((moved[i] - map.apply(v)).norm() <= 2.0 * FRAME * fixture.size(), "{}", method.name);
            }
        }
    }
}

#[test]
fn bones_that_only_scale_and_move_blend_linearly() {
    for method in METHODS {
        for fixture in rigs() {
            let mut random = random::Random::new(8);
            let pose: Vec<Transform> = (0..fixture.joints.len())
                .map(|_| Transform {
                    linear: Matrix3::from_diagonal(&(Point::repeat(1.0) + random.point() * 0.5)),
                    translation: random.point() * 0.2,
                })
                .collect();
            let expected = super::naive::lbs(&pose, &normalised(&fixture), &fixture.skin);
            let found = fixtures::points(&posed(method, &fixture, &pose));
            assert!(fixtures::distance(&found, &expected) <= 2.0 * FRAME * fixture.size(), "{}", method.name);
        }
    }
}

#[test]
fn moving_the_whole_scene_moves_the_result() {
    // T_j seen from elsewhere, G T_j G⁻¹: no method may depend on where the origin is.
    let scene = fixtures::turn(Point::new(0.5, -0.3, 0.2), Point::new(1.0, -2.0, 0.5), 1.1);
    let back = fixtures::turn(Point::new(0.5, -0.3, 0.2), Point::new(1.0, -2.0, 0.5), -1.1);
    for method in METHODS {
        for fixture in rigs() {
            let pose = random::pose(&fixture, 2.5, 3);
            let there: Vec<Transform> =
                pose.iter().map(|t| fixtures::compose(&scene, &fixtures::compose(t, &back))).collect();
            let moved =
                Fixture { skin: fixture.skin.iter().map(|v| scene.apply(v)).collect(), ..fixture.clone() };
            let here = fixtures::points(&posed(method, &fixture, &pose));
            let expected: Vec<Point> = here.iter().map(|v| scene.apply(v)).collect();
            let centers: Vec<Point> = centers(&fixture).iter().map(|p| scene.apply(p)).collect();
            let found = fixtures::points(&posed_about(method, &moved, &there, &centers));
            let size = fixture.size().max(crate::bounding_diagonal(&expected));
            assert!(fixtures::distance(&found, &expected) <= 2.0 * FRAME * size, "{}", method.name);
        }
    }
}

#[test]
fn the_order_of_the_bones_does_not_matter() {
    for method in METHODS {
        for fixture in rigs() {
            let joints = fixture.joints.len();
            let order: Vec<usize> = (0..joints).rev().collect();
            let mut weights = fixture.weights.clone();
            for i in 0..fixture.skin.len() {
                (0..joints).for_each(|j| weights.row_mut(i)[j] = fixture.weights.row(i)[order[j]]);
            }
            let shuffled = Fixture { weights, ..fixture.clone() };
            let pose = random::pose(&fixture, 3.1, 9);
            let turned: Vec<Transform> = order.iter().map(|&j| pose[j]).collect();
            let (a, b) = (posed(method, &fixture, &pose), posed(method, &shuffled, &turned));
            let (a, b) = (fixtures::points(&a), fixtures::points(&b));
            let size = fixture.size().max(crate::bounding_diagonal(&a));
            assert!(fixtures::distance(&a, &b) <= FRAME * size, "{} {}", method.name, fixture.name);
        }
    }
}

#[test]
fn bones_turned_to_either_side_of_half_a_turn_meet_in_between() {
    // 175° and 185° are 10° apart, though their quaternions may point away from each other; so are
    // 350° and 0°. Methods that blend rotations keep the length of what they turn.
    let v = Point::new(0.0, 1.0, 0.0);
    for method in METHODS.iter().filter(|method| method.name != "lbs") {
        for (a, b) in [(175.0, 185.0), (350.0, 0.0), (350.0, 10.0), (-170.0, 170.0), (90.0, 355.0)] {
            let angle = |degrees: f64| degrees.to_radians();
            let pose = [angle(a), angle(b)].map(|angle| fixtures::turn(Point::zeros(), Point::x(), angle));
            let fixture = Fixture {
                skin: vec![v],
                weights: Rows::from_vec(1, 2, vec![0.5, 0.5]).expect("one row"),
                ..fixtures::shapes::bar()
            };
            let found = fixtures::points(&posed_about(method, &fixture, &pose, &[Point::zeros()]))[0];
            let turned = pose.map(|t| t.apply(&v));
            let between = (turned[0] + turned[1]).normalize();
            assert!((found - between).norm() < 1e-6, "{} {a} {b}: {found}", method.name);
        }
    }
}

#[test]
fn a_squashed_bone_gives_finite_numbers() {
    for method in METHODS {
        let fixture = fixtures::shapes::bar();
        for squash in [Matrix3::zeros(), Matrix3::from_diagonal(&Point::new(1.0, 0.0, 1.0))] {
            let mut pose = fixtures::lively_pose(&fixture, 1.0);
            pose[1].linear = squash;
            assert!(
                posed(method, &fixture, &pose).iter().flatten().all(|x| x.is_finite()),
                "{}",
                method.name
            );
        }
    }
}

#[test]
fn what_the_weights_lack_to_one_stands_still() {
    // A row of half a bone blends as if an unmoved bone had the other half.
    let fixture = fixtures::shapes::bar();
    let pose = random::pose(&fixture, 2.5, 2);
    let mut partial = Rows::zeros(fixture.skin.len(), 3);
    let mut complete = Rows::zeros(fixture.skin.len(), 4);
    for i in 0..fixture.skin.len() {
        for (j, weight) in [(0, 0.45), (1, 0.35)] {
            partial.row_mut(i)[j] = weight;
            complete.row_mut(i)[j] = weight;
        }
        complete.row_mut(i)[3] = 0.2;
    }
    let packed = |rows: &Rows| FrameWeights::new(&SkinWeights::from_blended(rows));
    let still = [pose.clone(), vec![Transform::identity()]].concat();
    let (rest, centers) = (to_f32(&fixture.skin), to_f32(&centers(&fixture)));
    for method in METHODS {
        let mut out = [rest.clone(), rest.clone()];
        for (out, (weights, transforms)) in out.iter_mut().zip([(&partial, &pose), (&complete, &still)]) {
            let weights = packed(weights);
            let path = Path::default();
            let input =
                SkinningInput { path, transforms, weights: &weights, rest_skin: &rest, centers: &centers };
            (method.pose)(&input, &mut Scratch::default(), out);
        }
        let [a, b] = out.map(|out| fixtures::points(&out));
        assert!(fixtures::distance(&a, &b) <= FRAME * fixture.size(), "{}", method.name);
    }
}

#[test]
fn numbers_and_names_are_what_files_have() {
    let table: Vec<_> = METHODS.iter().map(|method| (method.number, method.name)).collect();
    assert_eq!(table, [(0, "lbs"), (1, "dqs"), (2, "cor")]);
}

#[test]
fn many_vertices_go_through_threads_to_the_same_result() {
    let fixture = fixtures::random::rig(fixtures::random::Recipe {
        skin_vertices: 20_000,
        joints: 7,
        cage_level: 0,
        seed: 9,
    });
    let pose = fixtures::lively_pose(&fixture, 1.0);
    for method in METHODS {
        let centers = centers(&fixture);
        let whole = posed_about(method, &fixture, &pose, &centers);
        let part = Fixture {
            skin: fixture.skin[15_000..].to_vec(),
            weights: fixture.weights.select(&(15_000..20_000).collect::<Vec<_>>()),
            ..fixture.clone()
        };
        assert_eq!(posed_about(method, &part, &pose, &centers[15_000..]), whole[15_000..]);
    }
}

#[test]
fn double_precision_blending_equals_the_oracle() {
    for fixture in fixtures::all() {
        let pose = fixtures::lively_pose(&fixture, 1.5);
        let expected = super::naive::lbs(&pose, &normalised(&fixture), &fixture.skin);
        let mut steps = Vec::new();
        pose_steps_into(&pose, &weights(&fixture), &fixture.skin, &mut steps);
        let found: Vec<Point> = fixture.skin.iter().zip(&steps).map(|(v, step)| v + step).collect();
        assert!(fixtures::distance(&found, &expected) <= 1e-13 * fixture.size(), "{}", fixture.name);
    }
}

#[test]
fn an_unknown_method_is_refused_with_the_known_ones() {
    let message = method("ragdoll").map(|_| ()).expect_err("there is none").to_string();
    assert!(message.contains("ragdoll") && message.contains("lbs, dqs, cor"), "{message}");
}

#[test]
fn every_method_equals_the_reference_poses_of_the_arm() {
    if !arm::is_here() {
        return;
    }
    let fixture = arm::fixture();
    let mut poses = arm::open("poses");
    let transforms = poses.poses("T_skin");
    assert_eq!(transforms.len(), 8);
    let centers = arm::open("bind").rows("Lambda").times(&fixture.cage);
    for (method, (name, oracle)) in METHODS.iter().zip(ORACLES) {
        let reference = poses.point_lists(&format!("Mp_{name}"));
        for (pose, expected) in transforms.iter().zip(&reference) {
            let exact = oracle(pose, &normalised(&fixture), &fixture.skin, &centers);
            assert!(fixtures::distance(&exact, expected) <= 1e-9);
            let frame = fixtures::points(&posed_about(method, &fixture, pose, &centers));
            assert!(fixtures::distance(&frame, expected) <= FRAME * fixture.size());
        }
    }
}
