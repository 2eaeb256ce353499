//! Stacks of tasks in the controller: invalid stacks, strict priorities, levels without solution.
#![allow(non_snake_case, clippy::unwrap_used, missing_docs)]

mod common;

use common::{Puppet, URDF, command_of, hyq_with, params_with, run_with_puppet, standing, wbc_of};
use controller::params::{Params, ParamsError};
use controller::qp::QpStatus;
use controller::quadruped::Quadruped;
use controller::quadruped::estimation::Estimate;
use controller::quadruped::reference::References;
use controller::quadruped::robot::Robot;
use controller::quadruped::state::State;
use controller::quadruped::trunk::TrunkReference;
use controller::quadruped::wbc::Wbc;
use controller::stack::{S1, S3};
use controller::{Controller, Outbox};
use lcmtypes::{OperatorCommand, WbcSolution};
use nalgebra::{DVector, Matrix3, Vector3};
use test_support::replace_once;

const UNDER: &str = "<< base_dynamics << friction << joint_acceleration << force_bounds";

fn with_formula(tasks: &str) -> Quadruped {
    // A Cartesian task does not follow the ground inclination; the trunk task does.
    hyq_with(&[("stack.formula", &format!("{tasks} {UNDER}")), ("terrain.estimator", "false")])
}

/// User-defined tasks as in a robot file.
const TASKS: &str = r#"
[terrain]
estimator = false

[stack.tasks.lean]
type = "cartesian"
link = "trunk"
kp = [0.0, 0.0, 0.0, 1000.0, 1000.0, 1000.0]
kd = [0.0, 0.0, 0.0, 100.0, 100.0, 100.0]

[stack.tasks.still]
type = "cartesian"
link = "trunk"
relative_to = "trunk"
kp = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
kd = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]

[stack.tasks.span]
type = "cartesian"
link = "rf_foot"
relative_to = "lf_foot"
kp = [300.0, 300.0, 300.0, 0.0, 0.0, 0.0]
kd = [20.0, 20.0, 20.0, 0.0, 0.0, 0.0]
"#;

fn loaded(tasks: &str, formula: &str) -> Result<Quadruped, String> {
    let text = format!("{}\n[stack]\nformula = \"{formula} {UNDER}\"\n{tasks}", common::PARAMS);
    Quadruped::new(URDF, &text).map_err(|e| e.to_string())
}

#[test]
fn an_invalid_stack_is_rejected_with_the_name_of_the_entry() {
    for (formula, expected) in [
        (
            "contact / trnk",
            "column 11: unknown task \"trnk\", known: contact, trunk, posture, relative_feet, swing, cone_center, internal_forces, lean, span, still",
        ),
        ("contact / trunk[3]", "column 11: row 3 of trunk, expected 0 to 2"),
        // The orientation of the trunk twice: the second task has no effect.
        ("contact / trunk / lean[3,4,5] + posture", "column 19: lean on level 3"),
        // A link does not move relative to itself.
        ("10 still + contact", "column 4: still on level 1"),
    ] {
        let error = loaded(TASKS, formula).err().unwrap();
        assert!(error.contains(expected), "{formula}: {error}");
    }
    for (from, to, expected) in [
        ("\"rf_foot\"", "\"rf_fot\"", "stack.tasks.span.link: robot \"hyq\" has no link \"rf_fot\""),
        ("\"lf_foot\"", "\"x\"", "stack.tasks.span.relative_to: robot \"hyq\" has no link \"x\""),
        ("tasks.lean", "tasks.trunk", "stack.tasks.trunk:"),
        ("tasks.lean", "tasks.le-an", "stack.tasks.le-an:"),
        ("[300.0, 300.0", "[300.0, -1.0", "stack.tasks.span.kp: found -1"),
        ("kd = [20.0, 20.0,", "kd = [", "found 4 elements, expected 6"),
        ("\"cartesian\"\nlink = \"rf", "\"carthesian\"\nlink = \"rf", "unknown variant `carthesian`"),
        ("relative_to = \"lf", "relativ_to = \"lf", "unknown field `relativ_to`"),
    ] {
        let error = loaded(&replace_once(TASKS, from, to), "contact / posture").err().unwrap();
        assert!(error.contains(expected), "{to}: {error}");
    }
    let overrides = [("stack.formula".to_owned(), "contact &".to_owned())];
    let error = controller::params::apply_overrides(common::PARAMS, &overrides).unwrap_err();
    assert!(matches!(error, ParamsError::Stack(_)), "{error}");
}

#[test]
fn a_user_defined_task_equals_the_built_in_one() {
    // Orientation of the trunk link in the world, with the gains of the trunk task and level reference: the same task.
    let stand = |mut controller: Quadruped| {
        let (mut puppet, mut out) = (Puppet::new(4), Outbox::new());
        for _ in 0..50 {
            puppet.input.op = OperatorCommand { seq: -1, ..Default::default() };
            controller.step(&puppet.input, &mut out);
            puppet.react(&out);
        }
        DVector::from(command_of(&out).tau)
    };
    let built_in = stand(with_formula("contact / trunk / posture"));
    let own = stand(loaded(TASKS, "contact / lean[3,4,5] / posture").unwrap());
    assert!((&built_in - &own).norm() < 1e-4 * built_in.norm(), "{built_in} {own}");
    let without = stand(with_formula("contact / posture"));
    assert!((&built_in - &without).norm() > 1e-2 * built_in.norm());
}

/// Residuals of contact, trunk and posture, tick by tick, where everything was solved.
fn residuals(formula: &str) -> Vec<[f64; 3]> {
    let run = run_with_puppet(&mut with_formula(formula), 6, 400);
    let of_tick = |tick: &common::Messages| {
        let bytes = &tick.iter().find(|(channel, _)| *channel == lcmtypes::channels::WBC_SOLUTION).unwrap().1;
        let wbc: WbcSolution = lcmtypes::Message::decode(bytes).unwrap();
        assert_eq!(wbc.status, WbcSolution::STATUS_SOLVED, "tick {}", wbc.tick);
        wbc.residual
    };
    run.outputs.iter().map(of_tick).collect()
}

#[test]
fn no_level_changes_the_residuals_of_a_level_above() {
    let (alone, two, three) =
        (residuals("contact"), residuals("contact / trunk"), residuals("contact / trunk / posture"));
    let largest = |a: &[[f64; 3]], b: &[[f64; 3]], task: usize| {
        a.iter().zip(b).map(|(a, b)| (a[task] - b[task]).abs()).fold(0.0, f64::max)
    };
    // The puppet ignores the torques, so the inputs are the same in all three runs.
    assert!(largest(&alone, &two, 0) < 1e-4 && largest(&alone, &three, 0) < 1e-4);
    assert!(largest(&two, &three, 1) < 1e-3, "{}", largest(&two, &three, 1));
    // Each level has an effect.
    assert!(largest(&alone, &two, 1) > 0.1 && largest(&two, &three, 2) > 0.1);
}

#[test]
fn a_redundant_level_does_no_harm() {
    // Two tasks for the orientation of the trunk on different levels, and more posture rows than free directions.
    let text = "contact / trunk[0,1] / lean[3,4,5] + posture[0] / posture[1,2,3,4,5,6,7,8,9,10,11]";
    let mut controller = loaded(TASKS, text).unwrap();
    let (mut puppet, mut out) = (Puppet::new(4), Outbox::new());
    for _ in 0..400 {
        controller.step(&puppet.input, &mut out);
        let wbc = wbc_of(&out);
        assert_eq!((wbc.status, wbc.level, wbc.n_levels), (WbcSolution::STATUS_SOLVED, 3, 4), "tick {}", wbc.tick);
        puppet.react(&out);
    }
}

#[test]
fn when_a_lower_level_fails_the_level_above_gives_the_command() {
    // Enough iterations for some levels, not for all; which level fails depends on the tick and on the order.
    let mut seen = [0; 3];
    for (formula, iterations) in [
        ("trunk / contact / posture", 8),
        ("contact / trunk / posture", 9),
        ("trunk[2] / posture[0,1,2] / contact", 10),
    ] {
        let mut controller = hyq_with(&[
            ("stack.formula", &format!("{formula} {UNDER}")),
            ("wbc.max_iterations", &iterations.to_string()),
            ("safety.max_qp_failures", "50"),
        ]);
        let (mut puppet, mut out) = (Puppet::new(7), Outbox::new());
        for _ in 0..300 {
            controller.step(&puppet.input, &mut out);
            let wbc = wbc_of(&out);
            let good = wbc
                .level_status
                .iter()
                .take_while(|s| [WbcSolution::STATUS_SOLVED, WbcSolution::STATUS_ALMOST_SOLVED].contains(s))
                .count();
            if good < 3 && wbc.status == WbcSolution::STATUS_FAILED {
                seen[good] += 1;
                assert_eq!(wbc.level, i32::try_from(good).unwrap() - 1);
                assert_eq!(wbc.level_status[good], WbcSolution::STATUS_FAILED);
                assert!(wbc.level_status[good + 1..].iter().all(|s| *s == WbcSolution::STATUS_NOT_RUN));
                assert_eq!(
                    controller.state().qp_failures > 0,
                    good == 0,
                    "with a solution of a level above, the tick is no failure"
                );
                // The solution of any level satisfies the constraints.
                assert!(good == 0 || wbc.base_residual < 1e-4, "{}", wbc.base_residual);
            }
            puppet.react(&out);
        }
    }
    assert!(seen.iter().all(|n| *n > 0), "failures by level: {seen:?}");
}

#[test]
fn an_infeasible_program_is_explained_by_the_names_of_its_constraints() {
    // The active-set solver has the constraints of all levels in one program; only with Clarabel can one level be changed.
    for (formula, solver, tampered) in
        [(S1, "active_set", 0), (S3, "active_set", 0), (S1, "clarabel", 0), (S3, "clarabel", 0), (S3, "clarabel", 1)]
    {
        let overrides = [("stack.formula", formula), ("qp.solver", &format!("\"{solver}\""))];
        let params = Params::from_toml(&params_with(&overrides), "hyq.toml").unwrap();
        let robot = Robot::new(URDF, &params.robot).unwrap();
        let (mut estimate, mut references) = (Estimate::new(&robot), References::new(&robot));
        let (mut wbc, mut state) = (Wbc::new(&robot, &params).unwrap(), State::new(robot.nj()));
        let input = standing(&robot);
        estimate.update(&robot, &input.state);
        references.qd_des.fill(0.0);
        state.q_des.clone_from(&robot.q_nominal);
        let trunk = TrunkReference { R_WB: Matrix3::identity(), w_WB_W: Vector3::zeros() };
        wbc.build(&robot, &params, &input.state, &estimate, &trunk, &references, &state);
        wbc.solve(&estimate, &state);
        assert_eq!((wbc.info.status, wbc.explain(&robot)), (QpStatus::Solved, None));

        // The normal force of LH is at least 20 N by its row, and at most 15 N by its bound.
        let bound = robot.model.nv() + 8;
        wbc.stack.levels[tampered].qp.upper[bound] = 0.15;
        wbc.solve(&estimate, &state);
        assert_eq!((wbc.info.status, wbc.solved()), (QpStatus::Infeasible, tampered > 0));
        let (level, found) = wbc.explain(&robot).unwrap();
        let mut names: Vec<&str> = found.iter().map(|v| v.name.as_str()).collect();
        names.sort_unstable();
        assert_eq!((level, names), (tampered, vec!["normal force of LH", "upper bound of force z of LH"]));
        // The difference of 5 N is shared by the two.
        assert!(found.iter().all(|v| (v.by - 0.025).abs() < 1e-5), "{found:?}");
    }
}
