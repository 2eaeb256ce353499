//! Times complete ticks, from the decoded input to the encoded outputs, and their stages, on the inputs of a log.

use crate::inputs::{Run, Stack};
use crate::sample::{Samples, most_allocations};
use anyhow::{Context, Result, ensure};
use controller::{Controller, Outbox, Probe, Stage};
use lcmtypes::{ControllerTick, Message, channels};
use std::path::Path;
use std::time::Instant;

/// Ticks before timing starts: the robot stands and the gait starts.
const WARM_UP: usize = 300;

/// Records the time at which each stage is done.
struct StageTimes([Option<Instant>; Stage::ALL.len()]);

impl Probe for StageTimes {
    fn stage_done(&mut self, stage: usize) {
        self.0[stage] = Some(Instant::now());
    }
}

/// Times the ticks of a log with a stack of tasks. Ticks and stages are timed in separate passes, because the probe reads the clock.
pub fn time(log: &Path, stack: Stack, passes: usize) -> Result<()> {
    let run = Run::read(log)?;
    ensure!(run.inputs.len() > WARM_UP, "{}: {} ticks, expected more than {WARM_UP}", log.display(), run.inputs.len());
    let timed = (run.inputs.len() - WARM_UP) * passes;
    let mut outbox = Outbox::new();

    let mut whole = Samples::new(timed);
    for _ in 0..passes {
        let mut controller = run.controller(stack)?;
        for (tick, input) in run.inputs.iter().enumerate() {
            if tick < WARM_UP {
                controller.step(input, &mut outbox);
            } else {
                whole.time(|| controller.step(input, &mut outbox));
            }
        }
        must_operate(log, &outbox)?;
    }
    let mut line = whole.line("tick");
    let mut controller = run.controller(stack)?;
    for input in &run.inputs[..WARM_UP] {
        controller.step(input, &mut outbox);
    }
    let rest = &run.inputs[WARM_UP..];
    line.allocations = Some(most_allocations(rest.len(), |i| controller.step(&rest[i], &mut outbox)));
    line.print()?;

    let mut stages: Vec<Samples> = Stage::ALL.iter().map(|_| Samples::new(timed)).collect();
    for _ in 0..passes {
        let mut controller = run.controller(stack)?;
        for (tick, input) in run.inputs.iter().enumerate() {
            let mut times = StageTimes([None; Stage::ALL.len()]);
            let mut begin = Instant::now();
            controller.step_probed(input, &mut outbox, &mut times);
            if tick < WARM_UP {
                continue;
            }
            for (samples, end) in stages.iter_mut().zip(times.0) {
                let end = end.context("a stage was not computed: the controller does not operate")?;
                samples.add(begin, end);
                begin = end;
            }
        }
    }
    for (stage, samples) in Stage::ALL.iter().zip(stages) {
        samples.line(&format!("stage {}", stage.name())).print()?;
    }
    Ok(())
}

/// Fails if the controller is in damping, whose ticks are short.
fn must_operate(log: &Path, outbox: &Outbox) -> Result<()> {
    let bytes = outbox.get(channels::CONTROLLER_TICK).context("the controller published no CONTROLLER_TICK")?;
    let ControllerTick { tick, mode, fault, .. } = ControllerTick::decode(bytes)?;
    ensure!(mode != ControllerTick::MODE_DAMPING, "{}: damping in tick {tick}, fault {fault}", log.display());
    Ok(())
}
