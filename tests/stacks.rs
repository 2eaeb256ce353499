//! The weighted stack compared with the hierarchical one on the states of a golden log. Raiola et al. 2020, footnote 10: with weights that
//! differ by a factor of a thousand and more, the weighted stack behaves like the hierarchical one.
#![allow(clippy::unwrap_used, missing_docs)]

mod common;

use common::{events, messages};
use controller::Outbox;
use controller::params::apply_overrides;
use controller::stack::S3;
use lcmtypes::channels::{CONTROLLER_INPUT, CONTROLLER_SNAPSHOT, ROBOT_COMMAND, RUN_INFO};
use lcmtypes::{ControllerInput, Message, RobotCommand, RunInfo};
use std::path::Path;

/// Compared ticks, counted from the log's second snapshot: stance on four feet, and swings of both pairs.
const TICKS: [usize; 8] = [0, 40, 120, 200, 310, 450, 600, 800];

/// Computes the torques of a tick from the same input and state with another stack.
struct Probe {
    info: RunInfo,
    /// State before each tick, and its input.
    states: Vec<(Vec<u8>, ControllerInput)>,
}

impl Probe {
    fn new(log: &Path) -> Self {
        let info: RunInfo = messages(log, RUN_INFO).remove(0);
        let inputs: Vec<ControllerInput> = messages(log, CONTROLLER_INPUT);
        let snapshots: Vec<_> = events(log).into_iter().filter(|e| *e.channel == *CONTROLLER_SNAPSHOT).collect();
        let mut controller = controller::load(&info).unwrap();
        controller.restore(&snapshots[1].data).unwrap();
        let (mut out, mut states) = (Outbox::new(), Vec::new());
        for (tick, input) in inputs[1001..].iter().enumerate() {
            if TICKS.contains(&tick) {
                let mut state = Vec::new();
                controller.snapshot(&mut state);
                states.push((state, input.clone()));
            }
            controller.step(input, &mut out);
        }
        assert_eq!(states.len(), TICKS.len());
        Probe { info, states }
    }

    fn torques(&self, formula: &str) -> Vec<Vec<f64>> {
        let set = [("stack.formula".to_owned(), formula.to_owned())];
        let info = self.info.clone().with_params(apply_overrides(self.info.params(), &set).unwrap());
        let torques = |(state, input): &(Vec<u8>, ControllerInput)| {
            let (mut controller, mut out) = (controller::load(&info).unwrap(), Outbox::new());
            controller.restore(state).unwrap();
            controller.step(input, &mut out);
            RobotCommand::decode(out.get(ROBOT_COMMAND).unwrap()).unwrap().tau
        };
        self.states.iter().map(torques).collect()
    }
}

fn norm(x: impl Iterator<Item = f64>) -> f64 {
    x.map(|x| x * x).sum::<f64>().sqrt()
}

#[test]
fn weighted_stack_converges_to_the_hierarchical_one_with_the_ratio_of_weights() {
    let probe = Probe::new(Path::new("logs/golden/rough_trot.mcap"));
    let under = S3.split_once("<<").unwrap().1;
    let hard = probe.torques(S3);
    // The largest weight is the square of the ratio; weights are at most 1e9.
    let ratios = [1.0, 10.0, 100.0, 1e3, 1e4_f64];
    let distances: Vec<Vec<f64>> = ratios
        .iter()
        .map(|ratio| {
            let soft = probe.torques(&format!("{:e} contact + {ratio:e} trunk + posture << {under}", ratio * ratio));
            let distance = |(soft, hard): (&Vec<f64>, &Vec<f64>)| {
                norm(soft.iter().zip(hard).map(|(a, b)| a - b)) / norm(hard.iter().copied())
            };
            soft.iter().zip(&hard).map(distance).collect()
        })
        .collect();
    for (tick, at) in TICKS.iter().enumerate() {
        let of_tick: Vec<f64> = distances.iter().map(|d| d[tick]).collect();
        assert!(of_tick[3] < 0.05, "tick {at}: at a ratio of 1000 the torques differ by {}", of_tick[3]);
        assert!(of_tick.windows(2).all(|d| d[1] < d[0]), "tick {at}: {of_tick:?}");
    }
}
