//! Every public URDF that Pinocchio reads is read with the same mass matrix.
//!
//! The expected values and the rule of the configuration are from `scripts/urdf_fixtures.py`. The files have many licences and are not part of this
//! repository: `scripts/setup.sh` fetches them.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

use nalgebra::{DMatrix, DVector};
use robot_model::*;
use serde::Deserialize;
use std::path::Path;

/// Largest difference of an entry of a product, relative to its largest entry.
const TOLERANCE: f64 = 1e-9;

#[derive(Deserialize)]
struct Fixture {
    robots: Vec<Expected>,
}

#[derive(Deserialize)]
struct Expected {
    file: String,
    joints: usize,
    floating: bool,
    /// `M x` for two vectors.
    times: [Vec<f64>; 2],
}

/// Pinocchio reads these files, this crate refuses them.
const REFUSED: [&str; 0] = [];

#[test]
fn public_urdfs_have_the_mass_matrix_of_pinocchio() {
    let Fixture { robots } = serde_json::from_str(include_str!("data/public_urdfs.json")).unwrap();
    let of_data = robots.iter().filter(|robot| robot.file.starts_with("example-robot-data/"));
    assert_eq!((robots.len(), of_data.count()), (156, 68));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../robots");
    let mut refused = Vec::new();
    for robot in &robots {
        let bytes = std::fs::read(folder.join(&robot.file));
        let bytes =
            bytes.unwrap_or_else(|error| panic!("target/robots/{}: {error}; run scripts/fetch_robots.sh", robot.file));
        match mass_matrix_of(&String::from_utf8_lossy(&bytes), robot) {
            Ok(M) => compare(robot, &M),
            Err(error) => {
                println!("{error}");
                refused.push(robot.file.as_str());
            }
        }
    }
    assert_eq!(refused, REFUSED);
}

fn mass_matrix_of(text: &str, robot: &Expected) -> Result<DMatrix<f64>, ModelError> {
    let base = if robot.floating { Base::Floating } else { Base::Fixed };
    let model = Model::new(&UrdfTree::parse(text, &robot.file)?, base)?;
    assert_eq!(model.nj(), robot.joints, "{}", robot.file);
    let q: Vec<f64> = (0..model.nj()).map(|i| 0.1 + 0.07 * (i % 11) as f64).collect();
    let mut kin = Kinematics::new(&model);
    kin.update(&model, &BaseState::identity(), &q, &vec![0.0; model.nj()]);
    let mut M = DMatrix::zeros(model.nv(), model.nv());
    mass_matrix(&model, &kin, &mut M);
    Ok(M)
}

fn compare(robot: &Expected, M: &DMatrix<f64>) {
    for (expected, factor) in robot.times.iter().zip([37, 53]) {
        let x = DVector::from_fn(M.ncols(), |k, _| (factor * k % 101) as f64 / 100.0 - 0.5);
        let found = M * x;
        assert_eq!(found.len(), expected.len(), "{}", robot.file);
        let scale = expected.iter().fold(0.0_f64, |scale, x| scale.max(x.abs()));
        for (row, (found, expected)) in found.iter().zip(expected).enumerate() {
            let off = (found - expected).abs();
            assert!(off <= TOLERANCE * scale, "{}: row {row}: found {found}, expected {expected}", robot.file);
        }
    }
}
