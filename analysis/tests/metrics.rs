//! Metrics of synthetic runs with known errors: see `common`.

#![allow(clippy::unwrap_used, reason = "a test stops at the first error")]

mod common;

use analysis::metrics::{Metrics, Reference, orientation_error};
use analysis::stats::ErrorStats;
use analysis::{Error, Run};
use common::{
    EFFORT, FOOT_ERROR, FORCE_ERROR, HEIGHT_ERROR, JOINT_ERROR, JOINT_TORQUE, JOINT_VELOCITY, MASS, Plan, RPY_ERROR,
    SPEED, TOUCHDOWN_DELAY, YAW_RATE, late_by_two_from, scratch, write,
};
use lcmtypes::ControllerTick;

fn run_of(name: &str, plan: &Plan) -> Run {
    let path = scratch(name).join("run.lcmlog");
    write(&path, plan);
    Run::read(&path, &mut |_| ()).unwrap()
}

/// Asserts a constant error with this mean. The tolerance of 1e-12 covers rounding of angle differences and rotations.
fn assert_constant(stats: Option<ErrorStats>, expected: f64, what: &str) {
    let e = stats.unwrap_or_else(|| panic!("{what} is missing"));
    let close = |a: f64, b: f64| (a - b).abs() < 1e-12;
    assert!(close(e.mean, expected) && e.std < 1e-12, "{what}: {e:?}, expected mean {expected}");
    assert!(close(e.rms, expected.abs()) && close(e.mean_abs, expected.abs()), "{what}: {e:?}");
}

#[test]
fn constant_errors_of_base_and_feet_are_measured() {
    let metrics = Metrics::of(&run_of("constant_errors", &Plan::default()));
    assert_eq!(metrics.measured_against, Reference::GroundTruth);
    let tracking = &metrics.tracking;
    assert_constant(tracking.roll, RPY_ERROR[0], "roll");
    assert_constant(tracking.pitch, RPY_ERROR[1], "pitch");
    assert_constant(tracking.yaw, RPY_ERROR[2], "yaw");
    assert_constant(tracking.height, HEIGHT_ERROR, "height");
    assert_eq!(tracking.roll.unwrap().count, 4000);
    for foot in &tracking.feet {
        assert_constant(foot.x, FOOT_ERROR[0], foot.leg);
        assert_constant(foot.y, FOOT_ERROR[1], foot.leg);
        assert_constant(foot.z, FOOT_ERROR[2], foot.leg);
        // 3 s of walk are 5 strides with one swing of 250 ticks each.
        assert_eq!(foot.x.unwrap().count, 5 * 250, "{}", foot.leg);
    }
}

/// The angle of `Rz(a) Ry(b)` is 2 acos(cos(a/2) cos(b/2)).
#[test]
fn the_orientation_error_is_the_angle_between_reference_and_measurement() {
    let (a, b): (f64, f64) = (0.3, -0.2);
    let mut tick = run_of("orientation_error", &Plan { ticks: 1, ..Plan::default() }).ticks.remove(0);
    let base = tick.base.as_mut().unwrap();
    (base.rpy_des, base.rpy_est) = ([0.0, b, a], [0.0; 3]);
    tick.truth.as_mut().unwrap().rpy = [0.0, b, a - 0.1];
    let expected = 2.0 * ((0.5 * a).cos() * (0.5 * b).cos()).acos();
    let error = |against| orientation_error(&tick, against).unwrap();
    assert!((error(Reference::Estimate) - expected).abs() < 1e-12, "{}", error(Reference::Estimate));
    // Two orientations that differ by a rotation about the vertical.
    assert!((error(Reference::GroundTruth) - 0.1).abs() < 1e-12, "{}", error(Reference::GroundTruth));
    tick.truth = None;
    assert_eq!(orientation_error(&tick, Reference::GroundTruth), None);
}

#[test]
fn contact_flags_and_touchdown_delays_are_measured() {
    let contact = Metrics::of(&run_of("contact", &Plan::default())).contact.unwrap();
    for leg in &contact.legs {
        // The flag is late by TOUCHDOWN_DELAY ticks in each of 5 swings, and correct in all other ticks.
        assert_eq!((leg.true_missed, leg.none_found), (5 * TOUCHDOWN_DELAY as u64, 0), "{}", leg.leg);
        assert_eq!(leg.none_none, 5 * (250 - TOUCHDOWN_DELAY as u64));
        assert_eq!(leg.true_found, 4000 - 5 * 250);
        assert_eq!((leg.touchdowns.count, leg.touchdowns.false_count), (5, 0));
        assert_constant(leg.force_error_contact_n, FORCE_ERROR, leg.leg);
        assert_constant(leg.force_error_air_n, -3.0, leg.leg);
    }
    let delay = contact.touchdowns.delay_ms.unwrap();
    assert_eq!(delay.count, 20);
    assert!((delay.mean - TOUCHDOWN_DELAY as f64).abs() < 1e-9 && (delay.max - delay.min).abs() < 1e-9, "{delay:?}");
}

#[test]
fn speed_is_along_the_heading_and_distance_along_the_path() {
    let metrics = Metrics::of(&run_of("speed", &Plan::default()));
    let way = &metrics.locomotion;
    let close = |a: f64, b: f64, tolerance: f64| assert!((a - b).abs() < tolerance, "{a}, expected {b}");
    close(way.walking_s, 3.0, 1e-9);
    close(way.commanded_velocity.unwrap()[0], SPEED + 0.02, 1e-12);
    close(way.true_velocity.unwrap()[0], SPEED, 1e-12);
    close(way.true_velocity.unwrap()[1], 0.0, 1e-12);
    close(way.true_yaw_rate.unwrap(), YAW_RATE, 1e-12);
    // 3 s at 0.3 m/s along an arc of 0.6 rad: the chord is 2 r sin(0.3) with r = 1.5 m. Steps of 1 ms: 1e-3 m.
    close(way.path_m.unwrap(), 0.9, 1e-3);
    close(way.displacement_m.unwrap(), 3.0 * 0.3_f64.sin(), 1e-3);
    // Sampled once per second: three chords of 0.2 rad.
    close(way.distance_m.unwrap(), 3.0 * 3.0 * 0.1_f64.sin(), 1e-3);
    assert!(!metrics.safety.fell && metrics.safety.faults.is_empty());
    // Pairs of feet swing with a height of 0.1 m: at the apex the base is 0.55 m − 0.05 m above the mean of all four feet.
    close(metrics.safety.min_height_m.unwrap(), 0.5, 1e-4);
    assert_eq!((metrics.safety.clamped_ticks, metrics.safety.clamped_torques), (Some(4), Some(8)));
}

#[test]
fn durations_and_qp_results_are_counted() {
    let metrics = Metrics::of(&run_of("timing", &Plan::default()));
    let timing = metrics.timing.unwrap();
    let tick = timing.tick_us.unwrap();
    assert_eq!((tick.min, tick.max, timing.longer_than_period), (200.0, 1500.0, 1));
    // The 20 durations are equally frequent: half of them are at most 209 µs, and 99 % at most the largest.
    assert_eq!((tick.p50, tick.p99), (209.0, 219.0));
    assert_eq!((timing.with_deadline, timing.missed_deadlines), (0, 0));
    assert_eq!(timing.period_error_us, None, "lockstep has no jitter");
    let qp = metrics.qp.unwrap();
    assert_eq!((qp.status.solved, qp.iterations.unwrap().max, qp.size[0]), (4000, 12.0, 30));
}

#[test]
fn without_ground_truth_errors_are_relative_to_estimates() {
    let plan = Plan { without: &["GROUND_TRUTH"], ..Plan::default() };
    let metrics = Metrics::of(&run_of("no_truth", &plan));
    assert_eq!(metrics.measured_against, Reference::Estimate);
    assert_eq!(metrics.missing_channels, ["GROUND_TRUTH"]);
    assert_constant(metrics.tracking.roll, 0.5 * RPY_ERROR[0], "roll");
    assert_constant(metrics.tracking.feet[3].x, 0.5 * FOOT_ERROR[0], "RH x");
    assert!(metrics.contact.is_none() && metrics.locomotion.true_velocity.is_none());
}

#[test]
fn a_gap_does_not_change_the_errors() {
    let run = run_of("gap", &Plan { gap: 2000..2200, ..Plan::default() });
    assert_eq!(run.ticks.len(), 3800);
    let metrics = Metrics::of(&run);
    assert_constant(metrics.tracking.height, HEIGHT_ERROR, "height");
    assert_constant(metrics.tracking.feet[0].y, FOOT_ERROR[1], "LF y");
}

#[test]
fn ground_truth_is_joined_within_half_a_period() {
    let run = run_of("late_truth", &Plan { truth_late_ns: 300_000, truth_gap: 1500..1510, ..Plan::default() });
    for tick in &run.ticks {
        let found = tick.truth.as_ref().map(|truth| truth.t_ns - tick.t_ns);
        let expected = if (1500..1510).contains(&(tick.t_ns / 1_000_000)) { None } else { Some(300_000) };
        assert_eq!(found, expected, "at {} s", tick.t_s);
    }
    let later = run_of("later_truth", &Plan { truth_late_ns: 700_000, ..Plan::default() });
    assert!(later.ticks[0].truth.is_none(), "0.7 ms away is not this tick");
    assert_eq!(later.ticks[1].truth.as_ref().unwrap().t_ns, 700_000, "nearest to the next tick");
}

/// A low base is a fall in the modes STANCE and WALK only.
#[test]
fn a_low_base_is_a_fall_only_in_stance_and_walk() {
    let fell = |name: &str, mode: i8| {
        let mut run = run_of(name, &Plan { ticks: 300, ..Plan::default() });
        for tick in &mut run.ticks[100..200] {
            tick.status.as_mut().unwrap().mode = mode;
            tick.truth.as_mut().unwrap().p_WB[2] = 0.1;
        }
        Metrics::of(&run).safety.fell_at_s
    };
    use ControllerTick as T;
    let low = [T::MODE_IDLE, T::MODE_STAND_UP, T::MODE_SIT, T::MODE_DAMPING].map(|mode| fell("low", mode));
    assert_eq!((low, [T::MODE_STANCE, T::MODE_WALK].map(|mode| fell("low", mode))), ([None; 4], [Some(0.1); 2]));
}

#[test]
fn a_fall_and_its_fault_have_their_times() {
    let safety = Metrics::of(&run_of("fall", &Plan { fall: 2500, ..Plan::default() })).safety;
    assert_eq!((safety.fell, safety.fell_at_s), (true, Some(2.5)));
    assert!((safety.max_tilt_rad.unwrap() - 0.7).abs() < 1e-12);
    let [fault] = safety.faults.as_slice() else { panic!("expected one fault, found {:?}", safety.faults) };
    assert_eq!((fault.fault.as_str(), fault.tick, fault.t_s, fault.value), ("tilt", 2510, 2.51, 0.7));
}

#[test]
fn the_first_of_two_runs_in_one_log_is_measured() {
    let dir = scratch("two_runs");
    let [first, second, both] = ["first", "second", "both"].map(|name| dir.join(format!("{name}.lcmlog")));
    write(&first, &Plan { ticks: 300, ..Plan::default() });
    write(&second, &Plan { ticks: 500, seed: 8, ..Plan::default() });
    let joined = [std::fs::read(&first).unwrap(), std::fs::read(&second).unwrap()].concat();
    std::fs::write(&both, joined).unwrap();
    let run = Run::read(&both, &mut |_| ()).unwrap();
    assert_eq!((run.ticks.len(), run.info.as_ref().unwrap().seed), (300, 7));
    assert!(run.notes[0].contains("another run"), "{:?}", run.notes);
}

#[test]
fn a_log_without_ticks_is_an_error() {
    let path = scratch("nothing").join("run.mcap");
    write(&path, &Plan { ticks: 0, ..Plan::default() });
    match Run::read(&path, &mut |_| ()) {
        Err(Error::NothingToReport { messages: 1, .. }) => {}
        other => panic!("expected NothingToReport, found {other:?}"),
    }
}

#[test]
fn metrics_json_has_its_keys() {
    let metrics = Metrics::of(&run_of("json", &Plan { ticks: 2000, ..Plan::default() }));
    let json: serde_json::Value = serde_json::from_str(&metrics.to_json()).unwrap();
    for path in [
        "/schema",
        "/run/robot",
        "/run/duration_s",
        "/measured_against",
        "/tracking/roll/rms",
        "/tracking/feet/3/leg",
        "/tracking/feet/3/x/mean_abs",
        "/contact/legs/0/accuracy",
        "/contact/touchdowns/delay_ms/p50",
        "/locomotion/distance_m",
        "/safety/fell",
        "/timing/tick_us/p99",
        "/timing/missed_deadlines",
        "/qp/iterations/mean",
        "/qp/status/solved",
    ] {
        assert!(json.pointer(path).is_some_and(|v| !v.is_null()), "{path} is missing from {json:#}");
    }
}

#[test]
fn joint_errors_and_power_are_measured() {
    let metrics = Metrics::of(&run_of("energy", &Plan { joints: 14, ..Plan::default() }));
    let energy = metrics.energy.unwrap();
    assert_eq!(energy.joints.len(), 14);
    for joint in &energy.joints {
        // Joint signals are f32: 24 bits of at most 0.25 rad.
        let e = joint.position.unwrap();
        assert!((e.mean - JOINT_ERROR).abs() < 1e-7 && e.std < 1e-7, "{}: {e:?}", joint.joint);
        assert_eq!(joint.torque.unwrap().max_abs, -JOINT_TORQUE);
    }
    // Torque and velocity have opposite signs: the joints absorb 14 × 10 W and do no positive work.
    assert_eq!((energy.mean_power_w, energy.mean_positive_power_w), (14.0 * JOINT_TORQUE * JOINT_VELOCITY, 0.0));
    assert_eq!((energy.max_torque_use, energy.cost_of_transport), (Some(-JOINT_TORQUE / EFFORT), Some(0.0)));
    assert_eq!(run_of("mass", &Plan { ticks: 10, ..Plan::default() }).robot.unwrap().mass_kg(), MASS);
}

#[test]
fn a_live_run_has_jitter_and_deadlines() {
    let timing = Metrics::of(&run_of("live", &Plan { live: true, ..Plan::default() })).timing.unwrap();
    // Wake-ups are alternately 10 µs early and late, so periods are alternately 20 µs too long and too short.
    let jitter = timing.period_error_us.unwrap();
    assert!((jitter.std - 20.0).abs() < 0.01 && jitter.max == 20.0 && jitter.min == -20.0, "{jitter:?}");
    // One tick takes 1.5 ms.
    assert_eq!((timing.with_deadline, timing.missed_deadlines, timing.left_out), (4000, 1, 0));
    let mut run = run_of("live_late", &Plan { live: true, ..Plan::default() });
    late_by_two_from(&mut run, 2000);
    let timing = Metrics::of(&run).timing.unwrap();
    assert_eq!((timing.missed_deadlines, timing.left_out), (1, 2));
}
