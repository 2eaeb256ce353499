//! A log of a synthetic trot with known errors.
//!
//! Diagonal pairs (LF RH, then RF LH) swing for 0.25 s alternately; a stride is 0.6 s. The robot stands for 1 s, then walks forward along a curve, so that
//! confused frames give wrong results. All errors are constant, so that means are known and deviations are 0.

#![allow(clippy::unwrap_used, reason = "a test stops at the first error")]
#![allow(dead_code, reason = "each test binary uses a part")]
#![allow(non_snake_case, reason = "names of quantities carry frames")]

use std::path::Path;

use lcmtypes::{
    BaseTracking, ComponentInfo, ContactEstimate, ControllerInput, ControllerTick, Event, GroundTruth, LegState,
    Message, OperatorCommand, RobotCommand, RobotState, RunInfo, Timing, WbcSolution, channels,
};
use replay::log::LogWriter;

/// Reference − truth of roll, pitch, yaw, rad.
pub const RPY_ERROR: [f64; 3] = [0.004, -0.006, 0.002];
/// Reference − truth of the height, m.
pub const HEIGHT_ERROR: f64 = 0.007;
/// Reference − truth of every swing foot in H, m.
pub const FOOT_ERROR: [f64; 3] = [0.02, -0.01, 0.001];
/// Estimated − true normal force in contact, N.
pub const FORCE_ERROR: f64 = 12.0;
/// Ticks from true contact to the stance that the controller enters, and to its contact flag.
pub const TOUCHDOWN_DELAY: i64 = 4;
/// Forward speed, m/s, and yaw rate, rad/s, of the walk. The commanded speed is 0.02 m/s higher.
pub const SPEED: f64 = 0.3;
pub const YAW_RATE: f64 = 0.2;
/// First tick of the walk.
pub const WALK: i64 = 1000;

/// Measured velocity, rad/s, and torque, N m, of every joint; commanded − measured position, rad.
pub const JOINT_VELOCITY: f64 = 0.5;
pub const JOINT_TORQUE: f64 = -20.0;
pub const JOINT_ERROR: f64 = 0.03;
/// Mass, kg, and torque limit, N m, of the robot in the log.
pub const MASS: f64 = 80.0;
pub const EFFORT: f64 = 160.0;

const STRIDE: i64 = 600;
const SWING: i64 = 250;
const HEIGHT: f64 = 0.55;
const HIPS: [[f64; 2]; 4] = [[0.37, 0.33], [0.37, -0.33], [-0.37, 0.33], [-0.37, -0.33]];

/// Content of the log.
pub struct Plan {
    pub ticks: i64,
    /// Channels that are not written.
    pub without: &'static [&'static str],
    /// Ticks without messages.
    pub gap: std::ops::Range<i64>,
    /// Ticks without ground truth.
    pub truth_gap: std::ops::Range<i64>,
    /// Time of the ground truth after its tick, ns.
    pub truth_late_ns: i64,
    /// Tick at which the robot falls on its side. The fault of the controller follows 10 ticks later.
    pub fall: i64,
    /// Seed in RUN_INFO.
    pub seed: i64,
    /// Number of joints.
    pub joints: usize,
    /// Tick whose robot state was lost: the tick used the previous state.
    pub stale: i64,
    /// A live run: deadlines of 1 ms, wake-ups alternately 10 µs early and late.
    pub live: bool,
    /// URDF in RUN_INFO; empty: a robot with `joints` joints.
    pub urdf: &'static str,
}

impl Default for Plan {
    fn default() -> Self {
        Self {
            ticks: 4000,
            without: &[],
            gap: 0..0,
            truth_gap: 0..0,
            truth_late_ns: 0,
            fall: i64::MAX,
            seed: 7,
            joints: 12,
            stale: -1,
            live: false,
            urdf: "",
        }
    }
}

/// Ticks since lift-off of a leg; `None` in stance.
fn swing_ticks(leg: usize, tick: i64) -> Option<i64> {
    let offset = if leg == 0 || leg == 3 { 0 } else { STRIDE / 2 };
    let phase = tick - WALK - offset;
    Some(phase).filter(|phase| *phase >= 0).map(|phase| phase % STRIDE).filter(|t| *t < SWING)
}

/// Writes the log in the format of the extension.
pub fn write(path: &Path, plan: &Plan) {
    let mut log = LogWriter::create(path).unwrap();
    let mut put = |channel: &str, t_ns: i64, message: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = Vec::new();
        message(&mut bytes);
        if !plan.without.contains(&channel) {
            log.write(channel, t_ns, &bytes).unwrap();
        }
    };
    let mut component = ComponentInfo::new("quadruped", "[wbc]\nfriction = 0.7\n");
    (component.n_stages, component.stages) = (6, channels::Stage::NAMES.map(str::to_owned).to_vec());
    let info = RunInfo {
        robot: "hyq".into(),
        scenario_name: "synthetic <trot> & more".into(),
        seed: plan.seed,
        run_id: plan.seed - Plan::default().seed,
        revision: "0123abc".into(),
        toolchain: "rustc".into(),
        realtime: "lockstep".into(),
        urdf: if plan.urdf.is_empty() { urdf(plan.joints) } else { plan.urdf.into() },
        ..RunInfo::default()
    }
    .with_component(component);
    put("RUN_INFO", 0, &|out| info.encode(out).unwrap());
    let mut position = [0.0_f64, 0.0];
    for tick in 0..plan.ticks {
        let t_ns = tick * 1_000_000;
        let walking = tick >= WALK;
        let yaw = if walking { YAW_RATE * (tick - WALK) as f64 * 1e-3 } else { 0.0 };
        let speed = if walking { SPEED } else { 0.0 };
        position = [position[0] + 1e-3 * speed * yaw.cos(), position[1] + 1e-3 * speed * yaw.sin()];
        if plan.gap.contains(&tick) {
            continue;
        }
        if tick == WALK {
            let event =
                Event { t_ns, tick, source: "scenario".into(), text: "walk <forward>".into(), ..Event::default() };
            put("EVENT", t_ns, &|out| event.encode(out).unwrap());
        }
        let now = Moment { tick, t_ns, yaw, speed, position, fall: plan.fall, joints: plan.joints, live: plan.live };
        put("CONTROLLER_INPUT", t_ns, &|out| {
            now.input(if tick == plan.stale { tick - 1 } else { tick }).encode(out).unwrap()
        });
        put("ROBOT_COMMAND", t_ns, &|out| now.command().encode(out).unwrap());
        put("BASE_TRACKING", t_ns, &|out| now.base().encode(out).unwrap());
        put("LEG_STATE", t_ns, &|out| now.legs().encode(out).unwrap());
        put("CONTACT_ESTIMATE", t_ns, &|out| now.contact().encode(out).unwrap());
        put("WBC_SOLUTION", t_ns, &|out| now.wbc().encode(out).unwrap());
        put("CONTROLLER_TICK", t_ns, &|out| now.status().encode(out).unwrap());
        if !plan.truth_gap.contains(&tick) {
            let truth = GroundTruth { t_ns: t_ns + plan.truth_late_ns, ..now.truth() };
            put("GROUND_TRUTH", t_ns, &|out| truth.encode(out).unwrap());
        }
        put("TIMING", t_ns, &|out| now.timing().encode(out).unwrap());
    }
    log.finish().unwrap();
}

struct Moment {
    tick: i64,
    t_ns: i64,
    yaw: f64,
    speed: f64,
    position: [f64; 2],
    fall: i64,
    joints: usize,
    live: bool,
}

/// Inertia of the base, kg m².
const INERTIA: &str = "<inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/>";

/// A URDF with one thigh of 0.5 m per joint below the base, in the order of the legs.
fn urdf(joints: usize) -> String {
    let mut text = format!(
        "<robot name=\"sticks\"><link name=\"base\"><inertial><mass value=\"{MASS}\"/>{INERTIA}</inertial></link>"
    );
    for k in 0..joints {
        let [x, y] = HIPS[k % 4];
        text += &format!(
            "<joint name=\"j{k}\" type=\"revolute\"><origin xyz=\"{x} {y} 0\"/><parent link=\"base\"/><child link=\"l{k}\"/><axis xyz=\"0 1 0\"/>\
             <limit effort=\"{EFFORT}\" velocity=\"9\"/></joint><link name=\"l{k}\"/>\
             <joint name=\"f{k}\" type=\"fixed\"><origin xyz=\"0 0 -0.5\"/><parent link=\"l{k}\"/><child link=\"t{k}\"/></joint><link name=\"t{k}\"/>"
        );
    }
    text + "</robot>"
}

impl Moment {
    fn t_s(&self) -> f64 {
        self.t_ns as f64 * 1e-9
    }

    /// Small, smooth tilts of reference and ground truth.
    fn rpy(&self) -> [f64; 3] {
        let t = self.t_s();
        [0.05 * (1.3 * t).sin(), 0.08 * (0.9 * t).sin(), self.yaw]
    }

    /// Feet in H. In swing the foot rises by 0.1 m; in the last `TOUCHDOWN_DELAY` ticks of the swing it is on the ground.
    fn p_BF_H(&self, leg: usize) -> [f64; 3] {
        let [x, y] = HIPS[leg];
        let share = swing_ticks(leg, self.tick).map_or(0.0, |t| (t as f64 / (SWING - TOUCHDOWN_DELAY) as f64).min(1.0));
        [x + 0.05 * share, y, 0.1 * (std::f64::consts::PI * share).sin() - HEIGHT]
    }

    fn touches(&self, leg: usize) -> bool {
        swing_ticks(leg, self.tick).is_none_or(|t| t >= SWING - TOUCHDOWN_DELAY)
    }

    fn force(&self, leg: usize) -> f64 {
        let feet = (0..4).filter(|&k| self.touches(k)).count() as f64;
        if self.touches(leg) { 850.0 / feet + 20.0 * (9.0 * self.t_s()).sin() } else { 0.0 }
    }

    fn base(&self) -> BaseTracking {
        let rpy = self.rpy();
        BaseTracking {
            t_ns: self.t_ns,
            tick: self.tick,
            rpy_des: std::array::from_fn(|k| rpy[k] + RPY_ERROR[k]),
            rpy_est: std::array::from_fn(|k| rpy[k] + 0.5 * RPY_ERROR[k]),
            height_des: HEIGHT + HEIGHT_ERROR,
            height_est: HEIGHT + 0.002,
            v_H_des: [if self.speed > 0.0 { self.speed + 0.02 } else { 0.0 }, 0.0],
            yaw_rate_des: if self.speed > 0.0 { YAW_RATE } else { 0.0 },
            ..BaseTracking::default()
        }
    }

    fn q(&self) -> Vec<f64> {
        (0..self.joints).map(|k| 0.2 * (2.0 * self.t_s() + k as f64).sin()).collect()
    }

    fn input(&self, seq: i64) -> ControllerInput {
        let n = self.joints;
        let state = RobotState {
            t_ns: self.t_ns,
            seq,
            q: self.q(),
            qd: vec![JOINT_VELOCITY; n],
            tau: vec![JOINT_TORQUE; n],
            ..RobotState::zeros(n, 1, 0)
        };
        let mut input = ControllerInput { t_ns: self.t_ns, tick: self.tick, ..ControllerInput::default() };
        input.deliver(channels::ROBOT_STATE, self.t_ns, &state).unwrap();
        input.deliver(channels::OPERATOR_COMMAND, self.t_ns, &OperatorCommand::default()).unwrap();
        input
    }

    fn command(&self) -> RobotCommand {
        let n = self.joints;
        let q_des = self.q().iter().map(|q| q + JOINT_ERROR).collect();
        RobotCommand {
            t_ns: self.t_ns,
            tick: self.tick,
            mode: RobotCommand::MODE_TORQUE,
            tau: vec![JOINT_TORQUE; n],
            q_des,
            qd_des: vec![JOINT_VELOCITY; n],
            ..RobotCommand::zeros(n)
        }
    }

    fn legs(&self) -> LegState {
        let state = std::array::from_fn(|leg| match swing_ticks(leg, self.tick) {
            None => LegState::STATE_STANCE,
            Some(t) if t < SWING / 2 => LegState::STATE_SWING_UP,
            Some(_) => LegState::STATE_SWING_DOWN,
        });
        let p: [[f64; 3]; 4] = std::array::from_fn(|leg| self.p_BF_H(leg));
        LegState {
            t_ns: self.t_ns,
            tick: self.tick,
            state,
            p_BF_H_des: p.map(|p| std::array::from_fn(|k| p[k] + FOOT_ERROR[k])),
            p_BF_H_est: p.map(|p| std::array::from_fn(|k| p[k] + 0.5 * FOOT_ERROR[k])),
            ..LegState::default()
        }
    }

    fn contact(&self) -> ContactEstimate {
        let f_normal: [f64; 4] =
            std::array::from_fn(|leg| self.force(leg) + if self.touches(leg) { FORCE_ERROR } else { -3.0 });
        ContactEstimate {
            t_ns: self.t_ns,
            tick: self.tick,
            n_contacts: 4,
            f_F_W: f_normal.map(|f| [0.0, 0.0, f]).to_vec(),
            f_normal: f_normal.to_vec(),
            contact: (0..4).map(|leg| i8::from(swing_ticks(leg, self.tick).is_none())).collect(),
            height: HEIGHT,
            n_W: [0.0, 0.0, 1.0],
        }
    }

    fn wbc(&self) -> WbcSolution {
        WbcSolution {
            t_ns: self.t_ns,
            tick: self.tick,
            status: WbcSolution::STATUS_SOLVED,
            iterations: 10 + (self.tick % 3) as i32,
            n_var: 30,
            n_clamped: i32::from(self.tick % 1000 == 500) * 2,
            n_contacts: 4,
            f_F_W: vec![[0.0; 3]; 4],
            tau_F_W: vec![[0.0; 3]; 4],
            ..WbcSolution::default()
        }
    }

    fn status(&self) -> ControllerTick {
        let mode = if self.tick >= WALK { ControllerTick::MODE_WALK } else { ControllerTick::MODE_STANCE };
        let tilted = ControllerTick {
            fault: ControllerTick::FAULT_TILT,
            fault_index: -1,
            fault_value: 0.7,
            ..ControllerTick::default()
        };
        let status = if self.tick >= self.fall.saturating_add(10) { tilted } else { ControllerTick::default() };
        ControllerTick { t_ns: self.t_ns, tick: self.tick, mode, ..status }
    }

    fn truth(&self) -> GroundTruth {
        let [x, y] = self.position;
        let (sin, cos) = self.yaw.sin_cos();
        let p_WF = (0..4)
            .map(|leg| {
                let [px, py, pz] = self.p_BF_H(leg);
                [x + cos * px - sin * py, y + sin * px + cos * py, HEIGHT + pz]
            })
            .collect();
        GroundTruth {
            t_ns: self.t_ns,
            p_WB: [x, y, HEIGHT],
            q_WB_wxyz: quaternion(if self.tick < self.fall { self.rpy() } else { [0.7, 0.0, self.yaw] }),
            v_WB: [self.speed * cos, self.speed * sin, 0.0],
            w_WB_W: [0.0, 0.0, if self.speed > 0.0 { YAW_RATE } else { 0.0 }],
            n_contacts: 4,
            p_WF,
            v_WF: vec![[0.0; 3]; 4],
            f_F_W: (0..4).map(|leg| [0.0, 0.0, self.force(leg)]).collect(),
            tau_F_W: vec![[0.0; 3]; 4],
            contact: (0..4).map(|leg| i8::from(self.touches(leg))).collect(),
            f_push_W: [0.0, if (3000..3300).contains(&self.tick) { 60.0 } else { 0.0 }, 0.0],
            ..GroundTruth::default()
        }
    }

    /// Ticks of 200 to 219 µs, one of 1500 µs. The QP takes half of the time.
    fn timing(&self) -> Timing {
        let tick_ns = if self.tick == 777 { 1_500_000 } else { 200_000 + 1000 * (self.tick * 7 % 20) };
        let late_ns = if self.live { 10_000 * (self.tick % 2 * 2 - 1) } else { 0 };
        let start_ns = 5_000_000_000 + self.tick * 1_000_000 + late_ns;
        Timing {
            t_ns: self.t_ns,
            tick: self.tick,
            wake_ns: start_ns - 5_000,
            start_ns,
            end_ns: start_ns + tick_ns,
            deadline_ns: if self.live { start_ns - late_ns + 1_000_000 } else { 0 },
            n_stages: 6,
            stage_ns: vec![1_000, tick_ns / 8, tick_ns / 16, tick_ns / 4, tick_ns / 2, 2_000],
            ..Timing::default()
        }
    }
}

/// Unit quaternion `w x y z` of `Rz(yaw) Ry(pitch) Rx(roll)`: the product of three half-angle quaternions.
fn quaternion([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    let (sr, cr) = (0.5 * roll).sin_cos();
    let (sp, cp) = (0.5 * pitch).sin_cos();
    let (sy, cy) = (0.5 * yaw).sin_cos();
    [cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy]
}

/// Changes a live run so that the controller wakes up two periods late for a tick and skips the ticks before it.
pub fn late_by_two_from(run: &mut analysis::Run, tick: usize) {
    for tick in &mut run.ticks[tick..] {
        (tick.t_ns, tick.t_s) = (tick.t_ns + 2_000_000, tick.t_s + 0.002);
        let Timing { wake_ns, start_ns, end_ns, deadline_ns, .. } = tick.timing.as_mut().unwrap();
        [wake_ns, start_ns, end_ns, deadline_ns].into_iter().for_each(|t_ns| *t_ns += 2_000_000);
    }
}

/// An empty folder for a test.
pub fn scratch(name: &str) -> std::path::PathBuf {
    let dir = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&dir);
    std::fs::create_dir_all(&dir).unwrap();
    dir
}
