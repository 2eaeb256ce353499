//! A10: the stack compared with closed-form impedance control at random configurations.

use crate::bench::Bench;
use crate::experiment::Experiment;
use crate::impedance;
use crate::row::Row;
use controller::params::Params;
use controller::quadruped::robot::Robot;
use drivers::robot_files::RobotFiles;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A10",
    title: "the stack compared with closed-form impedance control, at random configurations",
    published: "appendix A, eqs. (4), (10), (17), no number",
    robot: "hyq",
    seeds: 1,
    minutes: 0.1,
    run,
};

fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let (files, params) = RobotFiles::find_with_params(bench.robot())?;
    let robot = Robot::new(&files.urdf, &Params::from_toml(&params, bench.robot())?.robot)?;
    let errors = impedance::errors(&robot, 50, 10)?;
    let row = |what: &str, value| Row::info(format!("{what}, largest relative error"), value, "").at_most(1e-8);
    Ok(vec![
        row("A(4), joint impedance", errors.joint),
        row("A(10), Cartesian impedance", errors.cartesian),
        row("A(17), task over posture", errors.null_space),
    ])
}
