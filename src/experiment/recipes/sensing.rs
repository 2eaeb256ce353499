//! A5, A7, A8: what sensors, drives and the unknown place of the base do to the controller.

use super::falls;
use crate::experiment::bench::{Bench, Spec, count, mean};
use crate::experiment::states::{Led, States};
use crate::experiment::table::Row;
use crate::progress::Progress;
use analysis::Run;
use analysis::stats::ErrorStats;
use controller::math::{log, rotation_of_rpy};
use controller::quadruped::estimation::BasePlace;
use drivers::Rng;
use nalgebra::Vector3;

/// Orientation errors of the trot under noise, lag, torque error and push. "2 Hz" may be the frequency of strides or of swings: both are run.
pub fn real_robot(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    // Strides at 2 Hz: T_sw = (1 - 0.55) 0.5 s.
    for (name, frequency, judged) in [("2 Hz strides", "4.444", true), ("2 Hz swings", "2.0", false)] {
        let spec = |seed| {
            let spec = Spec::of("noisy_trot").named(format!("noisy_trot_{}", name.replace(' ', "_")));
            spec.set("gait.trot.swing_frequency", frequency).seed(seed)
        };
        let samples = bench.all_with(name, bench.seeds().map(spec).collect(), orientation_error)?;
        let of = |value: fn(&ErrorStats) -> f64| mean(samples.iter().filter_map(|s| s.found.as_ref()).map(value));
        let noted = |what: &str, value| Row::noted(format!("{name}: orientation error, {what}"), value, "rad");
        let mut errors = vec![
            noted("mean", of(|e| e.mean)).published(0.0101),
            noted("std", of(|e| e.std)).published(0.0102),
            noted("largest", of(|e| e.max_abs)),
        ];
        let mut fallen = falls(&format!("{name}: "), &samples);
        if judged {
            errors = errors
                .into_iter()
                .map(|row| match row.published {
                    Some(limit) => row.at_most(limit),
                    None => row,
                })
                .collect();
        } else {
            fallen = Row { wanted: String::new(), pass: None, ..fallen };
        }
        rows.extend(errors);
        rows.push(fallen);
    }
    Ok(rows)
}

/// Angle between the reference and the true orientation of the base, rad, while it balances.
fn orientation_error(run: &Run) -> Option<ErrorStats> {
    ErrorStats::of(run.ticks.iter().filter(|tick| tick.balances()).filter_map(|tick| {
        let (base, truth) = (tick.base.as_ref()?, tick.truth.as_ref()?);
        Some(log(&(rotation_of_rpy(base.rpy_des) * rotation_of_rpy(truth.rpy).transpose())).norm())
    }))
}

/// The controller of a log is led through its inputs three times: the base at the origin and at rest, where it truly was, and anywhere.
pub fn base_place(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let sample = bench.one(Spec::of("rough_trot"))?;
    let states = States::read(&sample.log)?;
    let mut led = (0..3).map(|_| states.controller(&[]).map(Led::new)).collect::<anyhow::Result<Vec<_>>>()?;
    let mut rng = Rng::new(7, "base place");
    let bar = Progress::new("three controllers");
    let (mut ticks, mut largest, mut off) = (0, 0.0_f64, [0.0_f64; 2]);
    for (i, (input, true_place)) in states.ticks.iter().enumerate() {
        let mut random = |size: f64| Vector3::from_fn(|_, _| rng.uniform(-size, size));
        let places = [BasePlace::default(), *true_place, BasePlace { p_WB: random(10.0), v_WB: random(2.0) }];
        let mut torques = Vec::with_capacity(3);
        for (led, place) in led.iter_mut().zip(places) {
            led.controller.take_base_to_be(place);
            torques.push(led.torques(input)?.map(<[f64]>::to_vec));
        }
        if let [Some(rest), Some(truth), Some(anywhere)] = &torques[..] {
            ticks += 1;
            for j in 0..rest.len() {
                largest = largest.max(rest[j].abs());
                off[0] = off[0].max((truth[j] - anywhere[j]).abs());
                off[1] = off[1].max((rest[j] - anywhere[j]).abs());
            }
        }
        bar.set(count(i) / count(states.ticks.len()));
    }
    drop(bar);
    Ok(vec![
        Row::noted("ticks compared, 12 torques each", count(ticks), "").at_least(1.0),
        Row::noted("largest torque", largest, "N m"),
        Row::noted("largest difference, true against random", off[0], "N m").at_most(1e-9),
        Row::noted("largest difference, none against random", off[1], "N m").at_most(1e-9),
    ])
}

/// Estimate less truth.
pub fn height(bench: &Bench) -> anyhow::Result<Vec<Row>> {
    let ramp = Spec::of("flat_trot")
        .named("ramp")
        .with("duration_s", "14.0")
        .with("terrain", "{ kind = \"slope\", angle_rad = 0.1745, flat_radius_m = 0.8, extent_m = [12.0, 4.0] }")
        .with(
            "operator",
            "[{ t_s = 0.0, mode = \"stand\" }, { t_s = 1.0, mode = \"walk\" }, { t_s = 2.0, v_x = 0.25 }, { t_s = 13.0, mode = \"stand\", v_x = 0.0 }]",
        );
    let specs = vec![Spec::of("flat_trot"), Spec::of("flat_crawl"), ramp];
    let names = ["flat, trot", "flat, crawl", "ramp, trot"];
    let samples = bench.all_with("heights", specs, |run: &Run| {
        ErrorStats::of(run.ticks.iter().filter(|tick| tick.balances()).filter_map(|tick| {
            let estimate = tick.base.as_ref()?.height_est;
            Some(1e3 * (estimate - tick.true_height()?))
        }))
    })?;
    let mut rows = vec![falls("", &samples)];
    for (name, sample) in names.iter().zip(&samples) {
        let of = |value: fn(&ErrorStats) -> f64| sample.found.as_ref().map_or(f64::NAN, value);
        let std = Row::noted(format!("{name}: estimate - truth, std"), of(|e| e.std), "mm");
        rows.push(if name.starts_with("flat") { std.at_most(5.0) } else { std });
        rows.push(Row::noted(format!("{name}: estimate - truth, mean"), of(|e| e.mean), "mm"));
        rows.push(Row::noted(format!("{name}: estimate - truth, largest"), of(|e| e.max_abs), "mm"));
    }
    Ok(rows)
}
