//! The Cartesian server: requests and their answers, limits, determinism.
#![allow(clippy::unwrap_used, missing_docs)]
#![allow(non_snake_case, reason = "names carry frames")]

use controller::cartesian::StackFile;
use controller::math::{Rng, log, quaternion};
use controller::model::{BaseState, Kinematics, UrdfTree, capsules, closest_points, joints_between};
use controller::params::apply_overrides;
use controller::trajectory::TaskReference;
use controller::{Controller, Outbox};
use lcmtypes::{
    CartesianState, ComponentInfo, ControllerTick, Message, OperatorCommand, RequestReply, RobotCommand, RobotState,
    RunInfo, TaskReply, TaskRequest, TaskStatus, TaskWaypoint, TickInput, channels,
};

const URDF: &str = include_str!("../../robots/coman/coman.urdf");
const PARAMS: &str = include_str!("../../robots/coman/coman.toml");
const STACK: &str = include_str!("../../stacks/coman_hands.toml");

fn info(stack: &str) -> RunInfo {
    let set = [("cartesian_ik.stack".to_owned(), toml::Value::String(stack.to_owned()).to_string())];
    let component = ComponentInfo::new("cartesian_ik", &apply_overrides(PARAMS, &set).unwrap());
    RunInfo { urdf: URDF.to_owned(), ..RunInfo::default() }.with_component(component)
}

/// A controller, and a robot whose joints follow their references at once.
struct Server {
    controller: Box<dyn Controller>,
    input: TickInput,
    out: Outbox,
    next_id: i64,
    /// Whether scratch memory is filled with NaN before each tick.
    poisons: bool,
}

impl Server {
    fn new(stack: &str) -> Self {
        let controller = controller::load_controller(&info(stack)).unwrap();
        let mut input = TickInput { state: RobotState::zeros(29, 1, 4), ..TickInput::default() };
        input.op.mode = OperatorCommand::MODE_STAND;
        let nominal: Vec<f64> = toml::from_str::<toml::Table>(PARAMS).unwrap()["robot"]["postures"]["nominal"]
            .as_table()
            .map(|posture| joints().iter().map(|joint| posture[joint.as_str()].as_float().unwrap()).collect())
            .unwrap();
        input.state.q = nominal;
        input.state.q_WI_wxyz[0] = [1.0, 0.0, 0.0, 0.0];
        Server { controller, input, out: Outbox::new(), next_id: 1, poisons: false }
    }

    fn request(&mut self, mut request: TaskRequest) -> i64 {
        (request.sender_id, request.request_id) = (7, self.next_id);
        self.next_id += 1;
        self.send(&request);
        request.request_id
    }

    fn send(&mut self, request: &TaskRequest) {
        let mut request = request.clone();
        request.n = i32::try_from(request.poses.len()).unwrap();
        request.m = i32::try_from(request.values.len()).unwrap();
        let mut bytes = Vec::new();
        request.encode(&mut bytes).unwrap();
        assert!(self.controller.receive(&self.input, channels::TASK_REQUEST, &bytes));
    }

    /// A tick of 1 ms.
    fn step(&mut self) {
        if self.poisons {
            self.controller.poison_workspace();
        }
        self.controller.step(&self.input, &mut self.out);
        let command = self.command();
        if command.mode == RobotCommand::MODE_TORQUE {
            self.input.state.q = command.q_des;
        }
        self.input.tick += 1;
        self.input.t_ns += 1_000_000;
        self.input.state.t_ns = self.input.t_ns;
    }

    fn command(&self) -> RobotCommand {
        RobotCommand::decode(self.out.get(channels::ROBOT_COMMAND).unwrap()).unwrap()
    }

    fn answers(&self) -> Vec<(i64, i8)> {
        let reply = self.out.get(channels::TASK_REPLY).map(|bytes| TaskReply::decode(bytes).unwrap());
        reply.map_or_else(Vec::new, |reply| {
            reply.answers.iter().map(|answer| (answer.request_id, answer.code)).collect()
        })
    }

    fn state(&self) -> CartesianState {
        let mut bytes = Vec::new();
        self.controller.snapshot(&mut bytes);
        CartesianState::decode(&bytes).unwrap()
    }

    /// The next TASK_STATUS.
    fn status(&mut self) -> TaskStatus {
        for _ in 0..40 {
            self.step();
            if let Some(bytes) = self.out.get(channels::TASK_STATUS) {
                return TaskStatus::decode(bytes).unwrap();
            }
        }
        panic!("no status in 40 ticks");
    }
}

fn joints() -> Vec<String> {
    let tree = controller::model::UrdfTree::parse(URDF, "coman.urdf").unwrap();
    let robot = controller::params::Params::from_toml(PARAMS, "coman.toml").unwrap().robot;
    robot.description(&tree).unwrap().model(&tree).unwrap().joints.into_iter().map(|joint| joint.name).collect()
}

fn request(task: &str, operation: i8) -> TaskRequest {
    TaskRequest { task: task.to_owned(), operation, ..TaskRequest::default() }
}

fn pose(position: [f64; 3], q_wxyz: [f64; 4], time: f64) -> TaskWaypoint {
    TaskWaypoint { time, position, q_wxyz }
}

const UPRIGHT: [f64; 4] = [1.0, 0.0, 0.0, 0.0];

#[test]
fn bad_requests_are_refused_with_a_code_and_change_nothing() {
    let mut server = Server::new(STACK);
    server.step();
    let (unknown, range, wrong) =
        (RequestReply::CODE_UNKNOWN_NAME, RequestReply::CODE_OUT_OF_RANGE, RequestReply::CODE_WRONG_STATE);
    let hand = |operation| request("left_hand", operation);
    let with_poses = |operation, poses: Vec<TaskWaypoint>| TaskRequest { poses, ..hand(operation) };
    let with_values = |operation, values: Vec<f64>| TaskRequest { values, ..hand(operation) };
    let nan = f64::NAN;
    let bad = [
        (request("no_such", TaskRequest::RESET), unknown),
        (hand(99), range),
        (with_poses(TaskRequest::POSE, vec![]), range),
        (with_poses(TaskRequest::POSE, vec![pose([nan, 0.0, 0.0], UPRIGHT, 0.0)]), range),
        (with_poses(TaskRequest::POSE, vec![pose([0.0; 3], [1.0, 1.0, 0.0, 0.0], 0.0)]), range),
        (with_poses(TaskRequest::POSE, vec![pose([0.0; 3], [nan; 4], 0.0)]), range),
        (with_poses(TaskRequest::WAYPOINTS, vec![]), range),
        (with_poses(TaskRequest::WAYPOINTS, vec![pose([0.0; 3], UPRIGHT, 0.0)]), range),
        (with_poses(TaskRequest::WAYPOINTS, vec![pose([0.0; 3], UPRIGHT, 1.0), pose([0.0; 3], UPRIGHT, 1.0)]), range),
        (with_poses(TaskRequest::WAYPOINTS, vec![pose([0.0; 3], UPRIGHT, nan)]), range),
        (with_poses(TaskRequest::WAYPOINTS, vec![pose([0.0; 3], UPRIGHT, 1.0); 33]), range),
        (with_values(TaskRequest::VELOCITY, vec![0.0; 6]), wrong),
        (with_values(TaskRequest::MODE, vec![2.0]), range),
        (with_values(TaskRequest::ACTIVATE, vec![0.5]), range),
        (with_values(TaskRequest::WEIGHT, vec![-1.0]), range),
        (with_values(TaskRequest::WEIGHT, vec![1.0; 5]), range),
        (with_values(TaskRequest::GAIN, vec![nan]), range),
        (with_values(TaskRequest::LIMITS, vec![1.0, 1.0, 0.0, 1.0]), range),
        (with_values(TaskRequest::LIMITS, vec![1.0; 5]), range),
        (with_values(TaskRequest::LIMITS, vec![1.0, 1.0, 1.0, 1.0, 1.0, nan]), range),
        (TaskRequest { name: "no_such_link".to_owned(), ..hand(TaskRequest::BASE_LINK) }, unknown),
        (TaskRequest { name: "LSoftHand".to_owned(), ..hand(TaskRequest::BASE_LINK) }, range),
        (TaskRequest { name: "l_hand_upper_right_link".to_owned(), ..hand(TaskRequest::BASE_LINK) }, range),
        (TaskRequest { name: "Waist".to_owned(), ..request("com", TaskRequest::BASE_LINK) }, wrong),
        (with_values(TaskRequest::POSTURE, vec![]), wrong),
        (TaskRequest { poses: vec![pose([0.0; 3], UPRIGHT, 0.0)], ..request("posture", TaskRequest::POSE) }, wrong),
        (TaskRequest { name: "no_such".to_owned(), ..request("posture", TaskRequest::POSTURE) }, unknown),
    ];
    for (bad, code) in bad {
        let mut quiet = Server::new(STACK);
        quiet.step();
        quiet.step();
        let mut server = Server::new(STACK);
        server.step();
        let id = server.request(bad.clone());
        server.step();
        assert_eq!(server.answers(), [(id, code)], "{bad:?}");
        let (mut found, expected) = (server.state(), quiet.state());
        found.answered.clone_from(&expected.answered);
        assert_eq!(found, expected, "{bad:?}");
    }
    // Before the first tick, and with an emergency stop, the controller does not control the robot.
    let mut server = Server::new(STACK);
    let id = server.request(hand(TaskRequest::RESET));
    server.step();
    assert_eq!(server.answers(), [(id, wrong)]);
}

#[test]
fn a_request_that_is_sent_again_is_answered_again_and_carried_out_once() {
    let mut server = Server::new(STACK);
    server.step();
    let relative = TaskRequest {
        sender_id: 3,
        request_id: 1,
        relative: true,
        poses: vec![pose([0.01, 0.0, 0.0], UPRIGHT, 0.0)],
        ..request("com", TaskRequest::POSE)
    };
    server.send(&relative);
    server.step();
    // Without limits, the reference of the tick in which the request was carried out is the goal.
    let reference = server.state().tasks[0].reference.clone();
    server.send(&relative);
    server.step();
    assert_eq!(
        (server.answers(), &server.state().tasks[0].reference),
        (vec![(1, RequestReply::CODE_DONE)], &reference)
    );
}

#[test]
fn a_task_that_is_not_active_has_no_rows_and_starts_again_at_its_pose() {
    let mut server = Server::new(STACK);
    server.step();
    let rows = |status: &TaskStatus| status.levels.iter().map(|level| level.rows).collect::<Vec<_>>();
    assert_eq!(rows(&server.status()), [3, 12, 29]);
    server.request(TaskRequest { values: vec![0.0], ..request("left_hand", TaskRequest::ACTIVATE) });
    server.request(TaskRequest { values: vec![0.0], ..request("com", TaskRequest::ACTIVATE) });
    assert_eq!(rows(&server.status()), [0, 6, 29]);
    let right = TaskRequest {
        poses: vec![pose([0.1, -0.1, 0.1], UPRIGHT, 1.0)],
        relative: true,
        ..request("right_hand", TaskRequest::WAYPOINTS)
    };
    server.request(right);
    (0..1500).for_each(|_| server.step());
    let before = server.command().q_des;
    server.request(TaskRequest { values: vec![1.0], ..request("left_hand", TaskRequest::ACTIVATE) });
    server.step();
    let step = server.command().q_des.iter().zip(&before).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(step < 1e-4, "{step}");
}

/// Ten thousand ticks with random requests, unreachable targets among them: joints stay within their limits of position, velocity and acceleration, references
/// of poses are continuous in the world, and memory of earlier ticks changes no bit.
#[test]
fn references_are_continuous_and_limits_hold_under_random_requests() {
    let mut rng = Rng::new(9, "requests");
    let (mut server, mut twin) = (Server::new(STACK), Server::new(STACK));
    twin.poisons = true;
    server.step();
    twin.step();
    let tree = controller::model::UrdfTree::parse(URDF, "coman.urdf").unwrap();
    let robot = controller::params::Params::from_toml(PARAMS, "coman.toml").unwrap().robot.description(&tree).unwrap();
    let model = robot.model(&tree).unwrap();
    let mut last = server.command();
    let (mut done, mut refused) = (0, 0);
    for tick in 0..10_000 {
        if tick % 50 == 0 {
            let task = ["left_hand", "right_hand", "com"][usize::try_from(rng.next_u64() % 3).unwrap()];
            let mut random = |scale: f64| [0; 3].map(|_| rng.uniform(-scale, scale));
            let (near, far, turn) = (random(0.1), random(3.0), random(1.0));
            let turned = quaternion::from_rotation_vector(turn);
            let made = match rng.next_u64() % 7 {
                0 => TaskRequest {
                    poses: vec![pose(near, turned, 0.0)],
                    relative: true,
                    ..request(task, TaskRequest::POSE)
                },
                1 => TaskRequest { poses: vec![pose(far, turned, 0.0)], ..request(task, TaskRequest::POSE) },
                2 => TaskRequest {
                    poses: vec![pose(near, turned, 0.3)],
                    relative: true,
                    ..request(task, TaskRequest::WAYPOINTS)
                },
                3 => TaskRequest {
                    values: vec![f64::from(u8::from(rng.next_u64().is_multiple_of(2)))],
                    ..request(task, TaskRequest::MODE)
                },
                4 => TaskRequest { values: [near, turn].concat(), ..request(task, TaskRequest::VELOCITY) },
                5 => {
                    let link = ["world", "DWYTorso", "Waist"][usize::try_from(rng.next_u64() % 3).unwrap()];
                    TaskRequest { name: link.to_owned(), ..request(task, TaskRequest::BASE_LINK) }
                }
                _ => TaskRequest {
                    values: vec![f64::from(u8::from(!rng.next_u64().is_multiple_of(4)))],
                    ..request(task, TaskRequest::ACTIVATE)
                },
            };
            server.request(made.clone());
            twin.request(made);
        }
        server.step();
        twin.step();
        for (_, code) in server.answers() {
            if code == RequestReply::CODE_DONE { done += 1 } else { refused += 1 }
        }
        let command = server.command();
        assert_eq!(command, twin.command(), "tick {tick}");
        for (j, joint) in model.joints.iter().enumerate() {
            let step = command.q_des[j] - last.q_des[j];
            assert!(step.abs() <= joint.velocity * 1e-3 + 1e-9, "{}: {step}", joint.name);
            assert!((joint.lower - 1e-9..=joint.upper + 1e-9).contains(&command.q_des[j]), "{}", joint.name);
            assert!((command.qd_des[j] - last.qd_des[j]).abs() <= 20.0 * 1e-3 + 1e-9, "{}", joint.name);
        }
        last = command;
        let status = ControllerTick::decode(server.out.get(channels::CONTROLLER_TICK).unwrap()).unwrap();
        assert_eq!((status.mode, status.fault), (ControllerTick::MODE_STANCE, 0), "tick {tick}");
    }
    assert!(done > 100 && refused > 10, "{done} {refused}");
}

/// Each joint starts 0.2 rad outside its limits: every solve succeeds, and each joint returns at its velocity limit.
#[test]
fn joints_outside_their_limits_return_at_their_velocity_limits() {
    let stack = "formula = \"posture << joint_limits\"\n[task.posture]\ntype = \"posture\"\n";
    let tree = controller::model::UrdfTree::parse(URDF, "coman.urdf").unwrap();
    let robot = controller::params::Params::from_toml(PARAMS, "coman.toml").unwrap().robot.description(&tree).unwrap();
    let model = robot.model(&tree).unwrap();
    let mut server = Server::new(stack);
    server.input.state.q = model.joints.iter().map(|joint| joint.upper + 0.2).collect();
    // The checks of the input allow 0.1 rad outside: start from the state instead.
    let mut state = server.state();
    state.mode = ControllerTick::MODE_STANCE;
    state.q = server.input.state.q.clone();
    let mut bytes = Vec::new();
    state.encode(&mut bytes).unwrap();
    server.controller.restore(&bytes).unwrap();
    server.input.state.q = model.joints.iter().map(|joint| joint.upper).collect();
    server.step();
    let mut before = state.q;
    for tick in 0..400 {
        server.controller.step(&server.input, &mut server.out);
        server.input.tick += 1;
        server.input.t_ns += 1_000_000;
        server.input.state.t_ns = server.input.t_ns;
        let command = server.command();
        for (j, joint) in model.joints.iter().enumerate() {
            let rate = (command.q_des[j] - before[j]) / 1e-3;
            assert!(rate.abs() <= joint.velocity + 1e-6, "tick {tick} {}: {rate}", joint.name);
            if before[j] > joint.upper + joint.velocity * 1e-3 {
                let is_full = (rate + joint.velocity).abs() < 1e-6 || tick == 0;
                assert!(is_full, "tick {tick} {}: {rate}, {}", joint.name, joint.velocity);
            }
        }
        before = command.q_des;
    }
    assert!(before.iter().zip(&model.joints).all(|(q, joint)| *q <= joint.upper + 1e-9));
}

#[test]
fn another_stack_keeps_the_model_state_and_the_references_of_its_tasks() {
    let mut server = Server::new(STACK);
    server.step();
    let moved = TaskRequest {
        poses: vec![pose([0.05, 0.0, 0.05], UPRIGHT, 0.0)],
        relative: true,
        ..request("left_hand", TaskRequest::POSE)
    };
    server.request(moved);
    (0..100).for_each(|_| server.step());
    let before = server.state();
    let other = STACK
        .replace("left_hand + right_hand / posture", "right_hand / left_hand / posture")
        .replace("gain = 1.0", "gain = 2.0");
    let mut next = Server::new(&other);
    let mut bytes = Vec::new();
    server.controller.snapshot(&mut bytes);
    next.controller.restore(&bytes).unwrap();
    let after = next.state();
    assert_eq!((&after.q, &after.v, after.p_WB), (&before.q, &before.v, before.p_WB));
    let of = |state: &CartesianState, name: &str| state.tasks.iter().find(|task| task.name == name).unwrap().clone();
    assert_eq!(of(&after, "left_hand"), of(&before, "left_hand"));
    assert_eq!(of(&after, "posture").gain, 2.0);
    next.input = server.input.clone();
    let last = server.command();
    next.step();
    let step = next.command().q_des.iter().zip(&last.q_des).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(step < 2e-3, "{step}");
}

#[test]
fn a_snapshot_continues_with_the_same_bits() {
    let mut server = Server::new(STACK);
    server.step();
    let waypoints = TaskRequest {
        poses: vec![pose([0.1, 0.0, 0.1], UPRIGHT, 0.2), pose([0.0; 3], UPRIGHT, 0.5)],
        relative: true,
        ..request("left_hand", TaskRequest::WAYPOINTS)
    };
    server.request(waypoints);
    (0..100).for_each(|_| server.step());
    let mut other = Server::new(STACK);
    let mut bytes = Vec::new();
    server.controller.snapshot(&mut bytes);
    other.controller.restore(&bytes).unwrap();
    other.input = server.input.clone();
    for tick in 0..600 {
        server.step();
        other.step();
        let messages = |out: &Outbox| out.iter().map(|(channel, bytes)| (channel, bytes.to_vec())).collect::<Vec<_>>();
        assert_eq!(messages(&server.out), messages(&other.out), "tick {tick}");
    }
}

/// Restores a snapshot that was changed into a server with the same stack, and into one with another stack. Returns whether each was restored; one that was
/// refused must have changed nothing.
fn restored(edit: impl Fn(&mut CartesianState)) -> [bool; 2] {
    let mut server = Server::new(STACK);
    server.step();
    let mut state = server.state();
    edit(&mut state);
    let mut bytes = Vec::new();
    state.encode(&mut bytes).unwrap();
    [STACK.to_owned(), STACK.replace("gain = 1.0", "gain = 2.0")].map(|stack| {
        let mut other = Server::new(&stack);
        other.step();
        let before = other.state();
        let is_restored = other.controller.restore(&bytes).is_ok();
        assert!(is_restored || other.state() == before);
        is_restored
    })
}

#[test]
fn a_snapshot_with_invalid_numbers_is_refused_and_changes_nothing() {
    let (hand, posture) = (1, 3);
    let limits = TaskReference::SIZE - 6;
    assert_eq!(restored(|_| ()), [true; 2]);
    for (task, number, wrong) in [
        (hand, 0, 2.0),
        (hand, 1, 33.0),
        (hand, 4, f64::NAN),
        (hand, 13, 2.0),
        (hand, limits, 0.0),
        (posture, 0, f64::INFINITY),
        (posture, 3, f64::NAN),
        (posture, 4 * 29 + 2, -1.0),
    ] {
        let found = restored(|state| state.tasks[task].reference[number] = wrong);
        assert_eq!(found, [false; 2], "task {task}, number {number}: {wrong}");
    }
    assert_eq!(restored(|state| state.tasks[hand].gain = f64::NAN), [false; 2]);
    assert_eq!(restored(|state| state.tasks[hand].weights[5] = f64::NAN), [false; 2]);
    // In another stack, a task of another size starts at its present pose.
    let shorten = |state: &mut CartesianState| {
        state.tasks[hand].reference.pop();
        state.tasks[hand].n_reference -= 1;
    };
    assert_eq!(restored(shorten), [false, true]);
}

/// Limits of a request and of a stack file. The position on an axis is number 4 + 3 axis of the reference; velocity and acceleration follow it.
#[test]
fn limits_of_jerk_are_optional_and_hold() {
    let limits = TaskReference::SIZE - 6;
    let (inf, dt) = (f64::INFINITY, 1e-3);
    let mut server = Server::new(STACK);
    server.step();
    assert_eq!(server.state().tasks[1].reference[limits..], [0.2, 1.0, inf, 1.0, 5.0, inf]);
    let of_hand = |values: &[f64]| TaskRequest { values: values.to_vec(), ..request("left_hand", TaskRequest::LIMITS) };
    server.request(of_hand(&[0.2, 1.0, 1.5, 5.0, 10.0, 50.0]));
    let raised = |task: &str| TaskRequest {
        poses: vec![pose([0.0, 0.0, 0.01], UPRIGHT, 0.0)],
        relative: true,
        ..request(task, TaskRequest::POSE)
    };
    server.request(raised("left_hand"));
    server.request(raised("com"));
    let before = server.state();
    server.step();
    assert_eq!(server.state().tasks[1].reference[limits..], [0.2, 1.0, 10.0, 1.5, 5.0, 50.0]);
    // Without limits, as of the centre of mass, the reference is the goal at once, at rest.
    let from = before.tasks[0].reference[10];
    assert_eq!(server.state().tasks[0].reference[10..13], [from + 0.01, 0.0, 0.0]);
    let start = before.tasks[1].reference[10];
    let mut last = before.tasks[1].reference[10..13].to_vec();
    // From rest over 1 cm the jerk decides: 4 ∛(0.01/20) s = 0.317 s.
    for _ in 0..320 {
        let now = server.state().tasks[1].reference[10..13].to_vec();
        assert!((now[2] - last[2]).abs() <= 10.0 * dt * (1.0 + 1e-9), "{last:?} {now:?}");
        last = now;
        server.step();
    }
    assert_eq!(last, [start + 0.01, 0.0, 0.0]);
    server.request(of_hand(&[0.2, 1.0, 1.5, 5.0]));
    server.step();
    assert_eq!(server.state().tasks[1].reference[limits..], [0.2, 1.0, inf, 1.5, 5.0, inf]);
    let with_jerk = STACK.replacen("acceleration = 1.0,", "acceleration = 1.0, jerk = 3.0, angular_jerk = 4.0,", 1);
    let server = Server::new(&with_jerk);
    assert_eq!(server.state().tasks[1].reference[limits..], [0.2, 1.0, 3.0, 1.0, 5.0, 4.0]);
    let error = StackFile::parse(&with_jerk.replace("jerk = 3.0", "jerk = 0.0")).unwrap_err();
    assert!(error.to_string().contains("task.left_hand.limits.jerk"), "{error}");
}

#[test]
fn a_hand_reaches_a_pose() {
    let mut server = Server::new(STACK);
    server.step();
    let start = server.status().tasks.iter().find(|task| task.name == "left_hand").unwrap().actual.clone();
    let turn = quaternion::from_rotation_vector([0.1, 0.0, 0.2]);
    let turned = quaternion::product(turn, start[3..7].try_into().unwrap());
    let target = pose([start[0] + 0.02, start[1] + 0.03, start[2] + 0.05], turned, 0.0);
    server.request(TaskRequest { poses: vec![target.clone()], ..request("left_hand", TaskRequest::POSE) });
    (0..6000).for_each(|_| server.step());
    let status = server.status();
    let hand = status.tasks.iter().find(|task| task.name == "left_hand").unwrap();
    let square = |x: f64| x * x;
    let error = (0..3).fold(0.0, |sum, k| sum + square(hand.actual[k] - target.position[k])).sqrt();
    let actual: [f64; 4] = hand.actual[3..7].try_into().unwrap();
    let turn = log(&(quaternion::to_rotation(actual) * quaternion::to_rotation(target.q_wxyz).transpose())).norm();
    assert!(error < 1e-3 && turn < 1e-2, "{error} {turn} {hand:?}");
}

/// Every type of task, and self-collision: the stack of COMAN with a gaze, angular momentum, small torques and manipulability.
const EVERY_TYPE: &str = "formula = \"com / left_hand + right_hand + eyes / 1e-3 momentum + effort + 1e-2 reach + 1e-2 posture + 1e-4 rest << joint_limits << self_collision << left_sole << right_sole\"\n\
    regularization = 1e-5\n\
    [self_collision]\nmargin = 0.01\nthreshold = 0.1\npairs = 8\n\
    [limits]\nvelocity = 0.3\nacceleration = 20.0\n\
    [task.com]\ntype = \"com\"\n\
    [task.left_hand]\ntype = \"cartesian\"\nlink = \"LSoftHand\"\nlimits = { velocity = 0.2, acceleration = 1.0, jerk = 10.0 }\n\
    [task.right_hand]\ntype = \"cartesian\"\nlink = \"RSoftHand\"\nlimits = { velocity = 0.2, acceleration = 1.0 }\n\
    [task.eyes]\ntype = \"gaze\"\nlink = \"gaze\"\naxis = [1.0, 0.0, 0.0]\nlimits = { velocity = 0.5, acceleration = 5.0 }\n\
    [task.momentum]\ntype = \"angular_momentum\"\n\
    [task.effort]\ntype = \"minimum_effort\"\ngain = 1e-4\n\
    [task.reach]\ntype = \"manipulability\"\nlink = \"LSoftHand\"\nbase_link = \"DWYTorso\"\ngain = 1.0\n\
    [task.posture]\ntype = \"posture\"\ngain = 1.0\n\
    [task.rest]\ntype = \"minimum_velocity\"\n\
    [task.left_sole]\ntype = \"cartesian\"\nlink = \"l_sole\"\ngain = 50.0\n\
    [task.right_sole]\ntype = \"cartesian\"\nlink = \"r_sole\"\ngain = 50.0\n";

/// Smallest distance of two capsules while each hand is sent beyond the place of the other one, of the pairs that are at least 10 mm apart in the nominal posture.
/// Every solve must succeed.
fn nearest_links(stack: &str) -> f64 {
    let tree = UrdfTree::parse(URDF, "coman.urdf").unwrap();
    let robot = controller::params::Params::from_toml(PARAMS, "coman.toml").unwrap().robot.description(&tree).unwrap();
    let model = robot.model(&tree).unwrap();
    let capsules = capsules(&tree, &model).unwrap();
    let mut kin = Kinematics::new(&model);
    let mut distances = |q: &[f64]| -> Vec<f64> {
        kin.update(&model, &BaseState::identity(), q, &vec![0.0; model.nj()]);
        let placed: Vec<_> = capsules
            .iter()
            .map(|(link, capsule)| {
                let (p, R) = (kin.p_WF(&model, *link), kin.R_WF(&model, *link));
                (*link, capsule.ends.map(|end| p + R * end), capsule.radius)
            })
            .collect();
        let mut found = Vec::new();
        for (k, (link, a, radius)) in placed.iter().enumerate() {
            for (other, b, other_radius) in &placed[..k] {
                let [up, down] = joints_between(&model, *link, Some(*other));
                if up.len() + down.len() >= 2 {
                    let [p, q] = closest_points(a, b);
                    found.push((p - q).norm() - radius - other_radius);
                }
            }
        }
        found
    };
    let mut server = Server::new(stack);
    let nominal = distances(&server.input.state.q.clone());
    server.step();
    for (task, y) in [("left_hand", -0.4), ("right_hand", 0.4)] {
        let beyond = TaskRequest {
            poses: vec![pose([-0.1, y, 0.0], UPRIGHT, 0.0)],
            relative: true,
            ..request(task, TaskRequest::POSE)
        };
        server.request(beyond);
    }
    let mut nearest = f64::INFINITY;
    for _ in 0..5000 {
        server.step();
        let tick = ControllerTick::decode(server.out.get(channels::CONTROLLER_TICK).unwrap()).unwrap();
        assert_eq!(tick.fault, 0, "tick {}", tick.tick);
        let now = distances(&server.command().q_des);
        nearest = now
            .iter()
            .zip(&nominal)
            .filter(|(_, nominal)| **nominal > 0.01)
            .map(|(now, _)| *now)
            .fold(nearest, f64::min);
    }
    nearest
}

#[test]
fn links_stop_at_the_margin_of_self_collision() {
    let with = nearest_links(EVERY_TYPE);
    let without = nearest_links(&EVERY_TYPE.replace(" << self_collision", ""));
    assert!(with > 0.01 - 1e-3 && without < 0.0, "{with} {without}");
}

#[test]
fn tasks_of_every_type_have_their_rows() {
    let mut server = Server::new(EVERY_TYPE);
    server.step();
    let status = server.status();
    let levels: Vec<_> = status.levels.iter().map(|level| (level.rows, level.status)).collect();
    assert_eq!(levels, [(3, 0), (14, 0), (3 + 29 + 7 + 29 + 29, 0)]);
    // The eyes turn to a point 45 degrees to the left.
    let before = status.tasks.iter().find(|task| task.name == "eyes").unwrap().clone();
    let look = TaskRequest {
        poses: vec![pose([0.0, 0.2, 0.0], UPRIGHT, 0.0)],
        relative: true,
        ..request("eyes", TaskRequest::POSE)
    };
    server.request(look);
    (0..4000).for_each(|_| server.step());
    let after = server.status().tasks.iter().find(|task| task.name == "eyes").unwrap().clone();
    assert!(after.actual[1] - before.actual[1] > 0.1, "{before:?} {after:?}");
}
