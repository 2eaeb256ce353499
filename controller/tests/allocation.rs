//! A tick does not allocate.
//!
//! Exception: with the reference solver, Clarabel 0.11 makes [`PER_SOLVE`] allocations per solve, for the names of its timers. The test asserts
//! this number, so that a new version or a second solve is noticed.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, non_snake_case, clippy::unwrap_used, missing_docs)]
#![allow(unsafe_code, reason = "a global allocator that counts; it forwards every call to the system allocator")]

mod common;

use common::{Puppet, hyq, hyq_with, tick_of, wbc_of};
use controller::model::Pose;
use controller::quadruped::Quadruped;
use controller::trajectory::{AxesReference, Limits, Mode, PoseGoal, PoseLimits, TaskReference, Waypoint};
use controller::{Component, Delivery, Outbox};
use lcmtypes::{
    ComponentInfo, ControllerTick, JointReference, Message, OperatorCommand, RobotCommand, RobotState, RunInfo,
    Running, TaskRequest, TaskStatus, TaskWaypoint, TickInput, WbcSolution, channels,
};
use nalgebra::Vector6;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// Allocations of one solve by Clarabel.
const PER_SOLVE: u64 = 1;
/// Ticks before counting starts.
const WARM_UP: i64 = 20;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

fn count() {
    COUNT.with(|c| c.set(c.get() + 1));
}

// SAFETY: every call is forwarded to the system allocator with the same arguments. The counter is a thread-local cell with a constant initial
// value and no destructor, so counting does not allocate.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller guarantees the same conditions.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, ptr: *mut u8, layout: Layout) {
        // SAFETY: the caller guarantees the same conditions.
        unsafe { System.dealloc(ptr, layout) }
    }

    unsafe fn realloc(&self, ptr: *mut u8, layout: Layout, new_size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller guarantees the same conditions.
        unsafe { System.realloc(ptr, layout, new_size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(f: impl FnOnce()) -> u64 {
    let before = COUNT.with(Cell::get);
    f();
    COUNT.with(Cell::get) - before
}

/// Every tick after the warm-up: CONTROLLER_TICK, WBC_SOLUTION and the number of allocations.
fn counted(controller: Quadruped, ticks: i64, edit: impl Fn(&mut Puppet)) -> Vec<(ControllerTick, WbcSolution, u64)> {
    let (mut puppet, mut out) = (Puppet::new(3), Outbox::new());
    let (mut component, mut delivery) = (Component::new(Box::new(controller)), Delivery::new(0));
    let mut counted = Vec::new();
    for tick in 0..ticks {
        edit(&mut puppet);
        let n = allocations(|| {
            delivery.begin(puppet.input.t_ns, puppet.input.tick);
            let TickInput { state, op, t_op_ns, .. } = &puppet.input;
            assert!(delivery.put(channels::ROBOT_STATE, puppet.input.t_ns, state).unwrap());
            assert!(delivery.put(channels::OPERATOR_COMMAND, *t_op_ns, op).unwrap());
            component.step(delivery.input(), &mut out);
        });
        assert_eq!(out.get(channels::CONTROLLER_SNAPSHOT).is_some(), tick % 1000 == 0);
        counted.push((tick_of(&out), wbc_of(&out), n));
        puppet.react(&out);
    }
    let counted = counted.split_off(usize::try_from(WARM_UP).unwrap());
    assert!(!counted.is_empty(), "no tick after the warm-up");
    counted
}

#[test]
fn the_counter_counts_allocations() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1)))), 1);
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1u8; 100]))), 1);
    assert_eq!(allocations(|| ()), 0);
}

/// The overrides for the reference solver.
const CLARABEL: (&str, &str) = ("qp.solver", "\"clarabel\"");

#[test]
fn standing_and_walking_allocate_nothing() {
    // Includes tick 1000, which publishes a snapshot.
    let ticks = counted(hyq(), 1100, |_| ());
    for mode in [ControllerTick::MODE_STANCE, ControllerTick::MODE_WALK] {
        assert!(ticks.iter().any(|(tick, ..)| tick.mode == mode));
    }
    for (tick, wbc, n) in ticks {
        assert_eq!(wbc.status, WbcSolution::STATUS_SOLVED);
        assert_eq!(n, 0, "allocations in tick {}, mode {}", tick.tick, tick.mode);
    }
}

#[test]
fn a_hierarchy_allocates_only_in_clarabel() {
    let s3 = ("stack.formula", controller::stack::S3);
    for (overrides, expected) in [(&[s3][..], 0), (&[s3, CLARABEL], 3 * PER_SOLVE)] {
        for (tick, wbc, n) in counted(hyq_with(overrides), 300, |_| ()) {
            assert_eq!((wbc.status, wbc.n_levels), (WbcSolution::STATUS_SOLVED, 3));
            assert_eq!(n, expected, "allocations in tick {}, mode {}", tick.tick, tick.mode);
        }
    }
}

#[test]
fn the_further_tasks_allocate_nothing() {
    let constraints = controller::stack::S1.split_once("<<").unwrap().1;
    let formula =
        format!("1e6 relative_feet + 1e3 trunk + swing + posture + cone_center / internal_forces <<{constraints}");
    for (tick, wbc, n) in counted(hyq_with(&[("stack.formula", &formula)]), 600, |_| ()) {
        assert_eq!((wbc.status, n), (WbcSolution::STATUS_SOLVED, 0), "tick {}, mode {}", tick.tick, tick.mode);
    }
}

#[test]
fn the_safe_state_allocates_nothing() {
    let ticks = counted(hyq(), 1100, |puppet| {
        if puppet.input.tick >= WARM_UP {
            puppet.input.op = OperatorCommand { mode: OperatorCommand::MODE_DAMPING, ..Default::default() };
        }
    });
    for (tick, _, n) in ticks {
        assert_eq!((tick.mode, n), (ControllerTick::MODE_DAMPING, 0), "tick {}", tick.tick);
    }
}

#[test]
fn a_bad_input_and_a_failed_solve_allocate_nothing_more() {
    let bad = counted(hyq(), 60, |puppet| {
        if puppet.input.tick == 55 {
            puppet.input.state.q[3] = f64::NAN;
        }
    });
    assert!(bad.iter().all(|(.., n)| *n == 0), "{bad:?}");

    let never = [("wbc.max_iterations", "1"), ("safety.max_qp_failures", "50")];
    let starved = counted(hyq_with(&[never[0], never[1], CLARABEL]), 50, |_| ());
    for (tick, wbc, n) in starved {
        assert_eq!((wbc.status, n), (WbcSolution::STATUS_FAILED, PER_SOLVE), "tick {}", tick.tick);
    }
    // The active-set solver fails when the robot is pushed and a second row is violated.
    let pushed = counted(hyq_with(&never), 300, |puppet| {
        if puppet.input.tick > 100 {
            puppet.input.state.w_WI_I[0][0] += 3.0;
        }
    });
    assert!(pushed.iter().any(|(_, wbc, _)| wbc.status == WbcSolution::STATUS_FAILED));
    assert!(pushed.iter().all(|(.., n)| *n == 0));
}

/// Centauro with arms of another component: `hold` and `posture` are started and stopped a thousand times, alone and together, each time with the last
/// command; every command of the arms and a reference arrive too.
#[test]
fn a_thousand_starts_and_stops_of_centauro_allocate_nothing() {
    let (urdf, toml) =
        (include_str!("../../robots/centauro/centauro.urdf"), include_str!("../../robots/centauro/centauro.toml"));
    let params = controller::params::Params::from_toml(toml, "centauro.toml").unwrap().to_toml();
    let mut info = RunInfo { urdf: urdf.to_owned(), ..RunInfo::default() };
    let arms: Vec<String> = (1..=7).map(|k| format!("j_arm1_{k}")).collect();
    let other = ComponentInfo { name: "arms".to_owned(), joints: arms, ..ComponentInfo::new("posture", &params) };
    info.components = vec![ComponentInfo::new("sequence(hold, posture)", &params), other];
    let mut component = controller::load(&info).unwrap();
    let nj = 39;
    let description = controller::params::Params::from_toml(&params, "centauro").unwrap().robot;
    let tree = controller::model::UrdfTree::parse(urdf, "centauro.urdf").unwrap();
    let robot = description.description(&tree).unwrap();
    let nominal = robot.posture("nominal").unwrap();
    let mut state = RobotState::zeros(nj, 1, 0);
    state.q = robot.joints.iter().map(|joint| nominal[&joint.name]).collect();
    let sent = RobotCommand { mode: RobotCommand::MODE_TORQUE, ..RobotCommand::zeros(nj) };
    let reference =
        JointReference { n: 1, joints: vec!["j_arm2_4".to_owned()], q: vec![-1.5], ..JointReference::default() };
    let (mut out, mut delivery, mut last) = (Outbox::new(), Delivery::new(0), Vec::with_capacity(1 << 14));
    // Both together, each alone, none: in 2000 of 4000 ticks a controller starts or stops.
    let schedule = [1, 3, 2, 0];
    let (mut allocated, mut starts) = (0, 0);
    for tick in 0..4000 {
        let running = schedule[usize::try_from(tick % 4).unwrap()];
        let t_ns = tick * 1_000_000;
        let n = allocations(|| {
            state.t_ns = t_ns;
            delivery.begin(t_ns, tick);
            assert!(delivery.put(channels::RUNNING, t_ns, &Running { t_ns, running }).unwrap());
            assert!(delivery.put(channels::ROBOT_STATE, t_ns, &state).unwrap());
            assert!(delivery.put("arms/ROBOT_COMMAND", t_ns, &sent).unwrap());
            assert!(delivery.put("planner/JOINT_REFERENCE", t_ns, &reference).unwrap());
            if !last.is_empty() {
                delivery.put_newest(channels::ROBOT_COMMAND, t_ns, &last);
            }
            component.step(delivery.input(), &mut out);
            last.clear();
            last.extend_from_slice(out.get(channels::ROBOT_COMMAND).unwrap());
        });
        let status = tick_of(&out);
        let expected = if running == 0 { ControllerTick::FAULT_CONTROLLER } else { ControllerTick::FAULT_NONE };
        assert_eq!(status.fault, expected, "tick {tick}");
        starts += i32::from(running == 1 || running == 3);
        if tick >= WARM_UP {
            allocated += n;
        }
    }
    assert_eq!((starts, allocated), (2000, 0));
}

/// Commands, steps, snapshots and rejected commands of references.
#[test]
fn references_of_tasks_do_not_allocate() {
    let limits = Limits { v: 0.5, a: 2.0, j: 20.0 };
    let mut reference = TaskReference::new(&Pose::identity(), PoseLimits { linear: limits, angular: limits }).unwrap();
    let mut joints = AxesReference::new(&[0.0; 12], limits).unwrap();
    let mut numbers = [0.0; TaskReference::SIZE];
    let goal = PoseGoal { p: [0.1, 0.2, 0.3], q: [0.6, 0.8, 0.0, 0.0] };
    let invalid = PoseGoal { q: [0.0; 4], ..goal };
    let counted = allocations(|| {
        for mode in Mode::ALL {
            reference.set_mode(mode, &Pose::identity());
            for command in 0..3 {
                _ = (reference.set_pose(&goal), reference.set_velocity(&Vector6::from_element(0.1), 0));
                _ = reference.set_waypoints(&[
                    Waypoint { t: 0.2, pose: goal },
                    Waypoint { t: 0.4, pose: if command < 2 { invalid } else { goal } },
                ]);
                for tick in 0..100 {
                    _ = reference.update(0.001, tick * 1_000_000);
                }
                reference.write(&mut numbers);
                reference = TaskReference::read(&numbers).unwrap();
                reference.set_base_link(&Pose::identity());
            }
        }
        joints.set_goals(&[0.5; 12]).unwrap();
        (0..100).for_each(|_| joints.update(0.001));
    });
    assert_eq!(counted, 0);
}

/// Centauro's Cartesian server under requests of all kinds, refused ones among them, with infeasible constraints for a while: no tick allocates.
#[test]
fn requests_to_a_cartesian_server_allocate_nothing() {
    let (urdf, toml) =
        (include_str!("../../robots/centauro/centauro.urdf"), include_str!("../../robots/centauro/centauro.toml"));
    let stack = toml::Value::String(include_str!("../../stacks/centauro_hands.toml").to_owned()).to_string();
    let set = [("cartesian_ik.stack".to_owned(), stack)];
    let params = controller::params::apply_overrides(toml, &set).unwrap();
    let info = RunInfo { urdf: urdf.to_owned(), ..RunInfo::default() };
    let mut component = controller::load(&info.with_component(ComponentInfo::new("cartesian_ik", &params))).unwrap();
    let tree = controller::model::UrdfTree::parse(urdf, "centauro.urdf").unwrap();
    let robot = controller::params::Params::from_toml(toml, "centauro").unwrap().robot.description(&tree).unwrap();
    let nominal = robot.posture("nominal").unwrap();
    let mut state = RobotState::zeros(39, 1, 2);
    state.q = robot.joints.iter().map(|joint| nominal[&joint.name]).collect();
    state.q_WI_wxyz[0] = [1.0, 0.0, 0.0, 0.0];
    let request = |operation: i8, task: &str, values: Vec<f64>, poses: Vec<TaskWaypoint>| TaskRequest {
        operation,
        task: task.to_owned(),
        relative: true,
        n: i32::try_from(poses.len()).unwrap(),
        poses,
        m: i32::try_from(values.len()).unwrap(),
        values,
        ..TaskRequest::default()
    };
    let pose = |time: f64, x: f64| TaskWaypoint { time, position: [x, 0.0, 0.1], q_wxyz: [1.0, 0.0, 0.0, 0.0] };
    let ways: Vec<_> = (1..=32).map(|k| pose(0.1 * f64::from(k), 0.01)).collect();
    let mut requests = [
        request(TaskRequest::WAYPOINTS, "left_hand", vec![], ways),
        request(TaskRequest::POSE, "right_hand", vec![], vec![pose(0.0, 0.05)]),
        // A wheel that is lifted far away contradicts the limits of the joints.
        request(TaskRequest::POSE, "wheel_1", vec![], vec![pose(0.0, 3.0)]),
        request(TaskRequest::RESET, "wheel_1", vec![], vec![]),
        request(TaskRequest::WEIGHT, "left_hand", vec![2.0], vec![]),
        request(TaskRequest::ACTIVATE, "left_hand", vec![0.0], vec![]),
        request(TaskRequest::ACTIVATE, "left_hand", vec![1.0], vec![]),
        request(TaskRequest::LIMITS, "left_hand", vec![0.3, 1.5, 1.0, 5.0, 30.0, 100.0], vec![]),
        request(TaskRequest::MODE, "right_hand", vec![1.0], vec![]),
        request(TaskRequest::VELOCITY, "right_hand", vec![0.0, 0.0, -0.1, 0.0, 0.1, 0.0], vec![]),
        request(TaskRequest::MODE, "right_hand", vec![0.0], vec![]),
        request(TaskRequest::GAIN, "no_such_task", vec![-1.0], vec![]),
        request(TaskRequest::VELOCITY, "left_hand", vec![f64::NAN; 6], vec![]),
    ];
    let (mut out, mut delivery, mut relaxed) = (Outbox::new(), Delivery::new(0), 0);
    for tick in 0..2000_i64 {
        let t_ns = tick * 1_000_000;
        let at = usize::try_from(tick / 20).unwrap() % requests.len();
        (requests[at].sender_id, requests[at].request_id) = (5, tick);
        let n = allocations(|| {
            state.t_ns = t_ns;
            delivery.begin(t_ns, tick);
            assert!(delivery.put(channels::ROBOT_STATE, t_ns, &state).unwrap());
            if tick % 20 == 7 {
                assert!(delivery.put(channels::TASK_REQUEST, t_ns, &requests[at]).unwrap());
            }
            component.step(delivery.input(), &mut out);
        });
        // The first round of requests makes the memory of the delivery large enough.
        assert!(n == 0 || tick < 300, "tick {tick}: {n} allocations");
        relaxed +=
            out.get(channels::TASK_STATUS).map_or(0, |bytes| i32::from(TaskStatus::decode(bytes).unwrap().relaxed));
        assert_eq!(tick_of(&out).mode, ControllerTick::MODE_STANCE, "tick {tick}");
    }
    assert!(relaxed > 0);
}
