//! HyQ stands for one second. A good first example to run.
//!
//! ```text
//! cargo run --release -p controller --example stand
//! ```
//! The example has no simulator. The sensor values are those of a level robot with its weight on all feet whose joints follow their
//! references; the controller computes the torques that keep it there. With `cargo run ... --example stand -- 0.01` the base is rolled by
//! 0.01 rad to the right, and the forces change to push it upright.
#![allow(non_snake_case, reason = "names carry frames: see ARCHITECTURE.md")]
#![expect(clippy::disallowed_methods, reason = "an example reads its command line")]

use controller::math::{Rx, quaternion};
use controller::model::GRAVITY;
use controller::quadruped::Quadruped;
use controller::quadruped::estimation::Estimate;
use controller::quadruped::leg::Leg;
use controller::quadruped::robot::Robot;
use controller::{Controller, Outbox};
use lcmtypes::{ContactEstimate, ControllerTick, Message, RobotCommand, RobotState, TickInput, WbcSolution, channels};
use nalgebra::Vector3;

const URDF: &str = include_str!("../../robots/hyq/hyq.urdf");
const PARAMS: &str = include_str!("../../robots/hyq/hyq.toml");

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let roll: f64 = std::env::args().nth(1).map_or(Ok(0.0), |text| text.parse())?;
    let mut controller = Quadruped::new(URDF, PARAMS)?;
    let mut input = standing(controller.robot(), roll);
    let mut out = Outbox::new();
    let mut command = RobotCommand::default();
    for tick in 0..1000 {
        (input.t_ns, input.tick) = (tick * 1_000_000, tick);
        (input.state.t_ns, input.state.seq) = (input.t_ns, tick);
        controller.step(&input, &mut out);
        command = RobotCommand::decode(out.get(channels::ROBOT_COMMAND).ok_or("no command")?)?;
        input.state.q.clone_from(&command.q_des);
        input.state.qd.clone_from(&command.qd_des);
        carry_weight(controller.robot(), &mut input);
    }

    let tick = ControllerTick::decode(out.get(channels::CONTROLLER_TICK).ok_or("no tick")?)?;
    if tick.mode != ControllerTick::MODE_STANCE {
        return Err(format!(
            "the controller is in mode {}, expected STANCE: fault {}, value {}",
            tick.mode, tick.fault, tick.fault_value
        )
        .into());
    }
    let wbc = WbcSolution::decode(out.get(channels::WBC_SOLUTION).ok_or("no solution")?)?;
    let contact = ContactEstimate::decode(out.get(channels::CONTACT_ESTIMATE).ok_or("no contact estimate")?)?;
    print_tables(controller.robot(), &command, &wbc, &contact);
    Ok(())
}

/// Sensor values in the nominal posture with the base rolled by `roll` rad.
fn standing(robot: &Robot, roll: f64) -> TickInput {
    let mut input = TickInput::default();
    input.op.seq = -1;
    let state = &mut input.state;
    *state = RobotState::zeros(robot.nj(), 1, 0);
    state.q.clone_from(&robot.q_nominal);
    // The IMU axes differ from those of the base.
    let R_WI = Rx(roll) * robot.R_IB.transpose();
    state.q_WI_wxyz[0] = quaternion::from_rotation(&R_WI);
    state.a_I[0] = (R_WI.transpose() * Vector3::z() * GRAVITY).into();
    carry_weight(robot, &mut input);
    input
}

/// Writes the joint torques for a quarter of the weight on each foot: `tau = h - Jᵀ F`.
fn carry_weight(robot: &Robot, input: &mut TickInput) {
    let mut estimate = Estimate::new(robot);
    estimate.update(robot, &input.state);
    let f_F_W = Vector3::z() * (0.25 * robot.mass() * GRAVITY);
    for leg in Leg::ALL {
        for joint in robot.legs[leg].joints {
            input.state.tau[joint] = estimate.h[6 + joint] - estimate.contacts[leg].J.column(6 + joint).dot(&f_F_W);
        }
    }
}

fn print_tables(robot: &Robot, command: &RobotCommand, wbc: &WbcSolution, contact: &ContactEstimate) {
    println!("HyQ, {:.1} kg, after one second. Forces of the ground on the feet, N, z up:\n", robot.mass());
    println!("  foot  measured z  contact   desired x         y         z");
    for (i, leg) in Leg::ALL.into_iter().enumerate() {
        let ([x, y, z], contact_text) = (wbc.f_F_W[i], if contact.contact[i] == 1 { "yes" } else { "no" });
        println!("  {:<4}  {:>10.1}  {contact_text:<7}  {x:>10.1} {y:>9.1} {z:>9.1}", leg.name(), contact.f_F_W[i][2]);
    }
    let sum: f64 = wbc.f_F_W.iter().map(|f| f[2]).sum();
    println!("  sum of z {sum:.1} N, weight {:.1} N\n", robot.mass() * GRAVITY);

    println!("Torques, N m:\n\n  leg        HAA       HFE       KFE");
    for leg in Leg::ALL {
        let [haa, hfe, kfe] = robot.legs[leg].joints.map(|joint| command.tau[joint]);
        println!("  {:<4} {haa:>9.2} {hfe:>9.2} {kfe:>9.2}", leg.name());
    }
    println!("\nThe quadratic program: {} variables, {} iterations.", wbc.n_var, wbc.iterations);
}
