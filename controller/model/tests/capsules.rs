//! Capsules around shapes, and distances of segments compared with Coal (`scripts/capsule_fixtures.py`) and with samples of both segments.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use nalgebra::Vector3;
use robot_model::math::{Rng, rotation_of_rpy};
use robot_model::*;
use serde_json::Value;

fn distance([a, b]: &[[Vector3<f64>; 2]; 2]) -> f64 {
    let [p, q] = closest_points(a, b);
    (q - p).norm()
}

#[test]
fn distances_are_those_of_coal() {
    let fixture: Value = serde_json::from_str(include_str!("data/capsules.json")).unwrap();
    let pairs = fixture["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 100);
    for pair in pairs {
        let number = |value: &Value| value.as_f64().unwrap();
        let point = |value: &Value| Vector3::new(number(&value[0]), number(&value[1]), number(&value[2]));
        let segments = ["a", "b"].map(|key| [point(&pair[key][0]), point(&pair[key][1])]);
        let found = distance(&segments) - number(&pair["radii"][0]) - number(&pair["radii"][1]);
        let expected = number(&pair["distance"]);
        // Coal iterates to about 1e-6 m.
        assert!((found - expected).abs() < 2e-6, "{found} {expected}");
    }
}

/// No sampled pair of points is nearer, and the points lie on the segments; parallel, crossing and touching segments and points included.
#[test]
fn no_sampled_points_are_nearer() {
    let mut rng = Rng::from_state(7);
    let mut point = || Vector3::from_fn(|_, _| rng.uniform(-1.0, 1.0));
    const N: i32 = 60;
    for trial in 0..300 {
        let [a, b] = [[point(), point()], [point(), point()]];
        let u = a[1] - a[0];
        let b = match trial % 6 {
            0 => [b[0], b[0] + u * 0.7],
            1 => [a[0] + u * 0.3, a[1] + u * 0.4],
            2 => [b[0], b[0]],
            3 => [b[0], b[0] + u + (b[1] - b[0]) * 1e-9],
            4 => [a[0] + u * 0.5 - (b[1] - b[0]), a[0] + u * 0.5 + (b[1] - b[0])],
            _ => b,
        };
        let a = if trial % 7 == 0 { [a[0], a[0]] } else { a };
        let best = distance(&[a, b]);
        assert!((best - distance(&[b, a])).abs() < 1e-12 && (best - distance(&[[a[1], a[0]], b])).abs() < 1e-12);
        let [p, q] = closest_points(&a, &b);
        for (p, segment) in [(p, a), (q, b)] {
            let there = (p - segment[0]).norm() + (segment[1] - p).norm();
            assert!((there - (segment[1] - segment[0]).norm()).abs() < 1e-12);
        }
        let mut nearest = f64::INFINITY;
        for (i, j) in (0..=N).flat_map(|i| (0..=N).map(move |j| (i, j))) {
            let (s, t) = (f64::from(i) / f64::from(N), f64::from(j) / f64::from(N));
            nearest = nearest.min((b[0] + (b[1] - b[0]) * t - a[0] - (a[1] - a[0]) * s).norm());
        }
        // A sample is at most half a step from each of the nearest points.
        let step = ((a[1] - a[0]).norm() + (b[1] - b[0]).norm()) / f64::from(2 * N);
        assert!(best <= nearest + 1e-12 && nearest <= best + step, "{trial}: {best} {nearest}");
    }
}

/// By hand: two unit segments that cross at a height of 0.3 m, and parallel ones at 0.5 m.
#[test]
fn crossing_and_parallel_segments_by_hand() {
    let [o, x, y] = [Vector3::zeros(), Vector3::x(), Vector3::y()];
    let up = Vector3::z() * 0.3;
    let [p, q] = closest_points(&[-x, x], &[-y + up, y + up]);
    assert_eq!((p, q), (o, up));
    assert_eq!(distance(&[[o, x], [y * 0.5, x * 2.0 + y * 0.5]]), 0.5);
}

/// Points of a shape lie in its capsule, and corners of a box and the rim of a cylinder on its surface.
#[test]
fn a_capsule_contains_its_shape_and_touches_it() {
    let mut rng = Rng::from_state(8);
    let X_LS = Pose { p: Vector3::new(0.1, -0.2, 0.3), R: rotation_of_rpy([0.3, -0.7, 2.0]) };
    let depth = |capsule: &Capsule, p: Vector3<f64>| {
        let p = X_LS.p + X_LS.R * p;
        capsule.radius - distance(&[capsule.ends, [p, p]])
    };
    for size in [[0.2, 0.5, 0.3], [0.9, 0.1, 0.2], [0.1, 0.2, 0.4]] {
        let capsule = Capsule::around(&Shape { X_LS, kind: ShapeKind::Box { size } }).unwrap();
        let mut least = f64::INFINITY;
        for corner in 0..8 {
            least = least
                .min(depth(&capsule, Vector3::from_fn(|k, _| if corner >> k & 1 == 1 { 0.5 } else { -0.5 } * size[k])));
        }
        assert!(least.abs() < 1e-12, "{least}");
    }
    let (radius, length) = (0.1, 0.5);
    let capsule = Capsule::around(&Shape { X_LS, kind: ShapeKind::Cylinder { radius, length } }).unwrap();
    for _ in 0..100 {
        let (angle, z) = (rng.uniform(-3.0, 3.0), [-0.25, 0.25][rng.next_u64() as usize % 2]);
        let rim = Vector3::new(radius * math::cos(angle), radius * math::sin(angle), z);
        assert!(depth(&capsule, rim).abs() < 1e-12 && depth(&capsule, rim * 0.7) > 0.0);
    }
    let sphere = Capsule::around(&Shape { X_LS, kind: ShapeKind::Sphere { radius } }).unwrap();
    assert_eq!((sphere.ends, sphere.radius), ([X_LS.p; 2], radius));
    let mesh = ShapeKind::Mesh { filename: "a.stl".into(), scale: [1.0; 3] };
    assert_eq!(Capsule::around(&Shape { X_LS, kind: mesh }), None);
}

#[test]
fn every_link_of_a_robot_with_shapes_has_capsules() {
    for (urdf, count) in [
        (include_str!("../../../robots/centauro/centauro.urdf"), 26),
        (include_str!("../../../robots/coman/coman.urdf"), 12),
    ] {
        let tree = UrdfTree::parse(urdf, "urdf").unwrap();
        let model = Model::new(&tree, Base::Floating).unwrap();
        let found = capsules(&tree, &model).unwrap();
        assert_eq!(found.len(), count);
        let shaped = tree.links.iter().filter(|link| !link.collisions.is_empty());
        assert!(shaped.map(|link| model.frame(&link.name).unwrap()).all(|at| found.iter().any(|(f, _)| *f == at)));
    }
    let tree = UrdfTree::parse(include_str!("../../../robots/coman/coman.urdf"), "urdf").unwrap();
    let other = UrdfTree::parse(include_str!("data/arm.urdf"), "urdf").unwrap();
    let error = capsules(&tree, &Model::new(&other, Base::Fixed).unwrap()).unwrap_err();
    assert!(matches!(error, ModelError::Unknown { what: "link", .. }));
}
