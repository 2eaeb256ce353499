//! Feeds the inputs of logs of another revision to this build and compares the torques with the recorded ones, which are those of that revision.
//! Messages are read by the types in the log, so it need not have the types of this build. `scripts/compare_revisions.sh` calls it.
//!
//! usage: `compare_revisions LOG...`; prints one line for each log. Exit code 1 if a torque differs by more than 1e-9 of the joint's effort limit.

#![allow(non_snake_case, reason = "fields of messages carry frames")]

use controller::handover::{Parameters, take_over};
use controller::{Component, Delivery, Outbox};
use lcm_idl::Value;
use lcmtypes::{
    ComponentInfo, ControllerInput, Message, OperatorCommand, ParameterChange, RobotCommand, RobotState, RunInfo,
    Running, channels,
};
use replay::log::{ItemRef, LogReader, Types};
use std::error::Error;
use std::path::Path;
use std::process::ExitCode;

/// Largest difference of a torque, as a fraction of the effort limit.
const LIMIT: f64 = 1e-9;

fn main() -> Result<ExitCode, Box<dyn Error>> {
    println!("{:<20} {:>7} {:>9} {:>15} {:>22}", "log", "ticks", "torques", "differing bits", "largest |dtau|/effort");
    let mut passed = true;
    for log in std::env::args_os().skip(1) {
        let path = Path::new(&log);
        let Compared { ticks, torques, bits, largest } =
            compare(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        println!("{name:<20} {ticks:>7} {torques:>9} {bits:>15} {largest:>22.1e}");
        passed &= ticks > 0 && largest <= LIMIT;
    }
    Ok(ExitCode::from(u8::from(!passed)))
}

#[derive(Default)]
struct Compared {
    ticks: u64,
    torques: u64,
    bits: u64,
    /// NaN counts as infinite.
    largest: f64,
}

/// The run of a log, computed again by this build.
struct Run {
    component: Component,
    parameters: Parameters,
    efforts: Vec<f64>,
    delivery: Delivery,
    out: Outbox,
    /// What was delivered last.
    running: Option<i64>,
    op: Option<(i64, OperatorCommand)>,
}

fn compare(log: &Path) -> Result<Compared, Box<dyn Error>> {
    let (mut types, mut run, mut compared) = (Types::default(), None::<Run>, Compared::default());
    let mut reader = LogReader::open(log)?;
    while let Some(item) = reader.read()? {
        let ItemRef::Event(event) = item else { return Err("the log is damaged or cut".into()) };
        types.learn(&event);
        let decoded = || -> Result<Value, Box<dyn Error>> {
            let ty = types.of_message(event.channel, event.data).ok_or("a message of unknown type")?;
            Ok(ty.decode(event.data)?)
        };
        match (&**event.channel, &mut run) {
            (channels::RUN_INFO, None) => run = Some(Run::new(&run_info(&decoded()?)?)?),
            (channels::PARAMETER_CHANGE, Some(run)) => run.change(&ParameterChange::decode(event.data)?)?,
            (channels::CONTROLLER_INPUT, Some(run)) => {
                match ControllerInput::decode(event.data) {
                    Ok(input) => run.component.step(&input, &mut run.out),
                    Err(_) => run.step(&decoded()?)?,
                }
                compared.ticks += 1;
            }
            (channels::ROBOT_COMMAND, Some(run)) => {
                let recorded = RobotCommand::decode(event.data)?;
                let replayed = RobotCommand::decode(run.out.get(channels::ROBOT_COMMAND).ok_or("no command")?)?;
                if (recorded.tick, recorded.mode, recorded.nj) != (replayed.tick, replayed.mode, replayed.nj) {
                    return Err(
                        format!("tick {}: mode {}, recorded {}", recorded.tick, replayed.mode, recorded.mode).into()
                    );
                }
                for ((a, b), effort) in recorded.tau.iter().zip(&replayed.tau).zip(&run.efforts) {
                    let difference = (a - b).abs() / effort;
                    compared.torques += 1;
                    compared.bits += u64::from((a.to_bits() ^ b.to_bits()).count_ones());
                    compared.largest =
                        compared.largest.max(if difference.is_nan() { f64::INFINITY } else { difference });
                }
            }
            _ => {}
        }
    }
    Ok(compared)
}

impl Run {
    fn new(info: &RunInfo) -> Result<Self, Box<dyn Error>> {
        let tree = controller::model::UrdfTree::parse(&info.urdf, "RUN_INFO")?;
        let joints = controller::model::Model::new(&tree, controller::model::Base::Floating)?.joints;
        Ok(Run {
            component: controller::load(info)?,
            parameters: Parameters::new(info),
            efforts: joints.iter().map(|joint| joint.effort).collect(),
            delivery: Delivery::new(info.run_id),
            out: Outbox::new(),
            running: None,
            op: None,
        })
    }

    fn change(&mut self, change: &ParameterChange) -> Result<(), Box<dyn Error>> {
        self.parameters = self.parameters.with(&change.key, &change.value)?;
        let mut next = self.parameters.build()?;
        take_over(&self.component, &mut next, &mut Vec::new())?;
        self.component = next;
        Ok(())
    }

    /// A tick of an input that holds state and operator command themselves.
    fn step(&mut self, input: &Value) -> Result<(), Box<dyn Error>> {
        let t_ns = integer(input, "t_ns")?;
        self.delivery.begin(t_ns, integer(input, "tick")?);
        let running = integer(input, "running")?;
        if self.running.replace(running) != Some(running) {
            self.delivery.put(channels::RUNNING, t_ns, &Running { t_ns, running })?;
        }
        let op = (integer(input, "t_op_ns")?, operator_command(input.get("op").ok_or("no op")?)?);
        if op.1.seq >= 0 && self.op.as_ref() != Some(&op) {
            self.delivery.put(channels::OPERATOR_COMMAND, op.0, &op.1)?;
            self.op = Some(op);
        }
        let state = robot_state(input.get("state").ok_or("no state")?)?;
        self.delivery.put(channels::ROBOT_STATE, t_ns, &state)?;
        self.component.step(self.delivery.input(), &mut self.out);
        Ok(())
    }
}

/// The first component, in the types of this build.
fn run_info(value: &Value) -> Result<RunInfo, Box<dyn Error>> {
    let text = |path: &str| value.get(path).and_then(Value::as_str).map(str::to_owned);
    let kind = text("controller").or_else(|| text("components[0].kind")).ok_or("no controller")?;
    let params = text("params").or_else(|| text("components[0].params")).ok_or("no parameters")?;
    let (urdf, robot) = (text("urdf").ok_or("no URDF")?, text("robot").ok_or("no robot")?);
    let info = RunInfo { run_id: integer(value, "run_id")?, urdf, robot, ..RunInfo::default() };
    Ok(info.with_component(ComponentInfo::new(&kind, &params)))
}

fn robot_state(value: &Value) -> Result<RobotState, Box<dyn Error>> {
    let (q, qd, tau) = (numbers(value, "q")?, numbers(value, "qd")?, numbers(value, "tau")?);
    Ok(RobotState {
        t_ns: integer(value, "t_ns")?,
        seq: integer(value, "seq")?,
        sender_id: integer(value, "sender_id")?,
        q_WI_wxyz: vec![array(value, "q_WI_wxyz")?],
        w_WI_I: vec![array(value, "w_WI_I")?],
        a_I: vec![array(value, "a_I")?],
        q: q.clone(),
        qd,
        tau,
        ..RobotState::zeros(q.len(), 1, 0)
    })
}

fn operator_command(value: &Value) -> Result<OperatorCommand, Box<dyn Error>> {
    let number =
        |path: &str| value.get(path).and_then(Value::as_f64).ok_or_else(|| format!("op.{path}: expected a number"));
    Ok(OperatorCommand {
        t_ns: integer(value, "t_ns")?,
        seq: integer(value, "seq")?,
        sender_id: integer(value, "sender_id")?,
        t_mode_ns: integer(value, "t_mode_ns")?,
        mode: i8::try_from(integer(value, "mode")?)?,
        gait: i8::try_from(integer(value, "gait")?)?,
        v_H: array(value, "v_H")?,
        yaw_rate: number("yaw_rate")?,
        roll: number("roll")?,
        pitch: number("pitch")?,
        height_offset: number("height_offset")?,
        swing_frequency: number("swing_frequency")?,
        duty: number("duty")?,
        step_height: number("step_height")?,
    })
}

fn integer(value: &Value, path: &str) -> Result<i64, String> {
    value.get(path).and_then(Value::as_i64).ok_or_else(|| format!("{path} is no integer"))
}

fn numbers(value: &Value, path: &str) -> Result<Vec<f64>, String> {
    let items = value.get(path).and_then(Value::as_array).ok_or_else(|| format!("{path} is no array"))?;
    items.iter().map(|item| item.as_f64().ok_or_else(|| format!("{path} holds no numbers"))).collect()
}

fn array<const N: usize>(value: &Value, path: &str) -> Result<[f64; N], String> {
    numbers(value, path)?.try_into().map_err(|_| format!("{path} does not have {N} numbers"))
}
