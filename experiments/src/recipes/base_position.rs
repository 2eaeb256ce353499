//! A7: the torques do not depend on the position and linear velocity of the base.

use crate::bench::{Bench, RunSpec, count};
use crate::experiment::Experiment;
use crate::row::Row;
use crate::states::{OpenLoop, States};
use controller::math::Rng;
use controller::quadruped::estimation::AssumedBase;
use nalgebra::Vector3;

pub(super) const EXPERIMENT: Experiment = Experiment {
    id: "A7",
    title: "torques with true and with random base positions and velocities",
    published: "x_b = 0 and its rate = 0 change nothing (section 2.4.1)",
    robot: "hyq",
    seeds: 1,
    minutes: 1.0,
    run,
};

/// Steps the controller of a log through its inputs three times: with the base at rest at the origin, at its true position and
/// velocity, and at random ones.
fn run(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let sample = bench.one(RunSpec::of("rough_trot"))?;
    let states = States::read(&sample.log)?;
    let open_loop = |_| states.controller(&[]).map(OpenLoop::new);
    let mut controllers = (0..3).map(open_loop).collect::<anyhow::Result<Vec<_>>>()?;
    let mut rng = Rng::new(7, "base place");
    let bar = bench.bar("three controllers");
    let (mut ticks, mut largest, mut off) = (0, 0.0_f64, [0.0_f64; 2]);
    for (i, (input, true_place)) in states.ticks.iter().enumerate() {
        let mut random = |size: f64| Vector3::from_fn(|_, _| rng.uniform(-size, size));
        let places = [AssumedBase::default(), *true_place, AssumedBase { p_WB: random(10.0), v_WB: random(2.0) }];
        let mut torques = Vec::with_capacity(3);
        for (open_loop, place) in controllers.iter_mut().zip(places) {
            open_loop.controller.assume_base(place);
            torques.push(open_loop.torques(input)?.map(<[f64]>::to_vec));
        }
        if let [Some(at_origin), Some(at_truth), Some(at_random)] = &torques[..] {
            ticks += 1;
            for j in 0..at_origin.len() {
                largest = largest.max(at_origin[j].abs());
                off[0] = off[0].max((at_truth[j] - at_random[j]).abs());
                off[1] = off[1].max((at_origin[j] - at_random[j]).abs());
            }
        }
        bar(count(i) / count(states.ticks.len()));
    }
    Ok(vec![
        Row::info("ticks compared, 12 torques each", count(ticks), "").at_least(1.0),
        Row::info("largest torque", largest, "N m"),
        Row::info("largest difference, true against random", off[0], "N m").at_most(1e-9),
        Row::info("largest difference, none against random", off[1], "N m").at_most(1e-9),
    ])
}
