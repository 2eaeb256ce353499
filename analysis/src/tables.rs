//! Tables of a report as text and CSV, with the published figures beside the measured ones.

use std::fmt::Write as _;

use crate::metrics::{Metrics, Reference};
use crate::run::LEGS;
use crate::stats::{Distribution, ErrorStats};

/// Mean and standard deviation of an error as a source prints them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Mean; the source does not say whether of the error or of its absolute value.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
}

impl Published {
    /// `sqrt(mean² + std²)`, the same in both readings of the mean.
    pub fn rms(&self) -> f64 {
        self.mean.hypot(self.std)
    }
}

/// One line of the tracking table.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackingRow {
    /// Quantity, such as `roll` or `LF x`.
    pub name: String,
    /// Its unit.
    pub unit: &'static str,
    /// What the log gives.
    pub measured: Option<ErrorStats>,
    /// Table 3 of Raiola et al. 2020 (HyQ in simulation, flat ground, crawl then trot).
    pub published: Option<Published>,
}

impl TrackingRow {
    /// Measured rms over the published one: at most 1 is as good.
    pub fn rms_ratio(&self) -> Option<f64> {
        Some(self.measured?.rms / self.published?.rms())
    }
}

/// The table prints two of the four feet.
fn published(name: &str) -> Option<Published> {
    let (mean, std) = match name {
        "roll" => (0.0050, 0.0145),
        "pitch" => (0.0072, 0.0187),
        "yaw" => (0.0017, 0.0043),
        "height" => (0.0071, 0.0145),
        "RH x" => (0.0303, 0.0186),
        "RH y" => (0.0203, 0.0128),
        "RH z" => (0.0016, 0.0027),
        "LF x" => (0.0235, 0.0152),
        "LF y" => (0.0202, 0.0201),
        "LF z" => (0.0006, 0.0022),
        _ => return None,
    };
    Some(Published { mean, std })
}

/// Base first, then the feet in the order LF RF LH RH.
pub fn tracking_rows(metrics: &Metrics) -> Vec<TrackingRow> {
    let tracking = &metrics.tracking;
    let base = [
        ("roll", "rad", tracking.roll),
        ("pitch", "rad", tracking.pitch),
        ("yaw", "rad", tracking.yaw),
        ("height", "m", tracking.height),
    ];
    let feet = tracking.feet.iter().zip(LEGS).flat_map(|(foot, leg)| {
        [("x", foot.x), ("y", foot.y), ("z", foot.z)].map(|(axis, stats)| (format!("{leg} {axis}"), "m", stats))
    });
    let rows = base.into_iter().map(|(name, unit, stats)| (name.to_owned(), unit, stats)).chain(feet);
    rows.map(|(name, unit, measured)| TrackingRow { published: published(&name), name, unit, measured }).collect()
}

/// What the errors are: a line above the table.
pub fn tracking_heading(metrics: &Metrics) -> &'static str {
    match metrics.measured_against {
        Reference::GroundTruth => "Tracking error: reference - ground truth",
        Reference::Estimate => "Tracking error: reference - estimate (the log holds no ground truth)",
    }
}

/// The tracking table for a terminal, ending in a newline.
pub fn tracking_text(metrics: &Metrics) -> String {
    let mut text = format!("{}; published: Raiola et al. 2020, Table 3\n", tracking_heading(metrics));
    let _ = writeln!(
        text,
        "{:<14}{:>9}{:>9}{:>9}{:>9}{:>9}   |{:>9}{:>9}{:>9}{:>8}",
        "", "mean", "std", "rms", "mean|e|", "max|e|", "mean", "std", "rms", "ratio"
    );
    for row in tracking_rows(metrics) {
        let _ = write!(text, "{:<14}", format!("{} [{}]", row.name, row.unit));
        match row.measured {
            Some(e) => {
                for value in [e.mean, e.std, e.rms, e.mean_abs, e.max_abs] {
                    let _ = write!(text, "{:>9}", fixed(value));
                }
            }
            None => text.push_str(&format!("{:>9}", "-").repeat(5)),
        }
        if let Some(p) = row.published {
            let _ = write!(text, "   |{:>9.4}{:>9.4}{:>9.4}", p.mean, p.std, p.rms());
        }
        if let Some(ratio) = row.rms_ratio() {
            let _ = write!(text, "{ratio:>8.2}");
        }
        text.push('\n');
    }
    text
}

/// Four decimals; what rounds to zero has no sign.
pub(crate) fn fixed(value: f64) -> String {
    let text = format!("{value:.4}");
    if text == "-0.0000" { "0.0000".to_owned() } else { text }
}

/// The tracking table as CSV with a header; absent values are empty.
pub fn tracking_csv(metrics: &Metrics) -> String {
    let mut text =
        "quantity,unit,count,mean,std,rms,mean_abs,max_abs,published_mean,published_std,published_rms,rms_ratio\n"
            .to_owned();
    let cell = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v}"));
    for row in tracking_rows(metrics) {
        let m = row.measured;
        let p = row.published;
        let numbers = [
            m.map(|e| e.mean),
            m.map(|e| e.std),
            m.map(|e| e.rms),
            m.map(|e| e.mean_abs),
            m.map(|e| e.max_abs),
            p.map(|p| p.mean),
            p.map(|p| p.std),
            p.map(|p| (p.rms() * 1e6).round() / 1e6),
            row.rms_ratio(),
        ];
        let count = m.map_or(String::new(), |e| e.count.to_string());
        let _ = writeln!(text, "{},{},{count},{}", row.name, row.unit, numbers.map(cell).join(","));
    }
    text
}

/// Durations as rows of `(name, distribution in µs)`: the tick, then its stages.
pub fn timing_rows(metrics: &Metrics) -> Vec<(&'static str, Distribution)> {
    let Some(timing) = &metrics.timing else { return Vec::new() };
    let stages = timing.stages.iter().filter_map(|stage| Some((stage.stage, stage.us?)));
    timing.tick_us.map(|tick| ("tick", tick)).into_iter().chain(stages).collect()
}

/// The timing table for a terminal, ending in a newline; empty without TIMING.
pub fn timing_text(metrics: &Metrics) -> String {
    let rows = timing_rows(metrics);
    if rows.is_empty() {
        return String::new();
    }
    let mut text = format!("{:<14}{:>9}{:>9}{:>9}{:>9}{:>9}\n", "Time [us]", "mean", "p50", "p99", "p99.9", "max");
    for (name, d) in rows {
        let _ = writeln!(text, "{name:<14}{:>9.1}{:>9.1}{:>9.1}{:>9.1}{:>9.1}", d.mean, d.p50, d.p99, d.p999, d.max);
    }
    text
}

/// A few lines on how the run went: robot, length, way, falls, speed, contact, QP. Pairs of what and how much.
pub fn summary_rows(metrics: &Metrics) -> Vec<(&'static str, String)> {
    let (run, way, safety) = (&metrics.run, &metrics.locomotion, &metrics.safety);
    let or_unknown = |text: &str| if text.is_empty() { "not in the log".to_owned() } else { text.to_owned() };
    let mut rows = vec![
        ("robot", or_unknown(&run.robot)),
        ("controller", or_unknown(&run.controller)),
        (
            "scenario",
            if run.scenario.is_empty() { "none".to_owned() } else { format!("{}, seed {}", run.scenario, run.seed) },
        ),
        ("revision", or_unknown(&run.revision) + if run.dirty { ", with uncommitted changes" } else { "" }),
        ("duration", format!("{:.2} s, {} ticks of {:.3} ms", run.duration_s, run.ticks, run.period_s * 1e3)),
    ];
    if let Some((distance, path)) = way.distance_m.zip(way.path_m) {
        rows.push(("distance", format!("{distance:.2} m from start to end, {path:.2} m along the path")));
    }
    if let Some([x, y]) = way.commanded_velocity {
        let realised =
            way.true_velocity.map_or(String::new(), |[x, y]| format!(", realised {x:.3} forward, {y:.3} leftward"));
        rows.push((
            "mean velocity",
            format!("commanded {x:.3} forward, {y:.3} leftward{realised} m/s, over {:.1} s of walking", way.walking_s),
        ));
    }
    rows.push(("fell", safety.fell_at_s.map_or("no".to_owned(), |t| format!("yes, at {t:.2} s"))));
    if let Some((height, tilt)) = safety.min_height_m.zip(safety.max_tilt_rad) {
        rows.push(("extremes", format!("base height at least {height:.3} m, tilt at most {tilt:.3} rad")));
    }
    for fault in &safety.faults {
        rows.push((
            "fault",
            format!("{} at {:.3} s (tick {}), value {}", fault.fault, fault.t_s, fault.tick, fault.value),
        ));
    }
    if let Some(ticks) = safety.clamped_ticks {
        rows.push(("limited torques", format!("in {ticks} ticks")));
    }
    if let Some(contact) = &metrics.contact {
        let downs = &contact.touchdowns;
        let delay = downs.delay_ms.map_or(String::new(), |d| {
            format!(", judged {:.1} ms after contact (median; 99 %: {:.1} ms)", d.p50, d.p99)
        });
        rows.push(("touchdowns", format!("{}, {} false{delay}", downs.count, downs.false_count)));
    }
    if let Some(qp) = &metrics.qp {
        let bad = qp.status.failed + qp.status.infeasible;
        let spread = qp
            .iterations
            .map_or(String::new(), |d| format!("{:.1} iterations (p99 {:.0}, most {:.0}), ", d.mean, d.p99, d.max));
        rows.push(("QP", format!("{spread}{} almost solved, {bad} failed", qp.status.almost_solved)));
    }
    if let Some(timing) = &metrics.timing {
        let deadlines = match timing.with_deadline {
            0 => format!("none set (lockstep); {} ticks took longer than the period", timing.longer_than_period),
            n => format!("{} of {n} missed", timing.missed_deadlines),
        };
        rows.push(("deadlines", deadlines));
    }
    rows
}

/// Summary, tracking and timing for a terminal: what `tables.txt` holds.
pub fn text(metrics: &Metrics) -> String {
    let mut text = String::new();
    for (name, value) in summary_rows(metrics) {
        let _ = writeln!(text, "{name:<16}{value}");
    }
    for note in &metrics.notes {
        let _ = writeln!(text, "{:<16}{note}", "note");
    }
    if !metrics.missing_channels.is_empty() {
        let _ = writeln!(text, "{:<16}{}", "not in the log", metrics.missing_channels.join(", "));
    }
    format!("{text}\n{}\n{}", tracking_text(metrics), timing_text(metrics))
}

#[cfg(test)]
mod tests {
    #[test]
    fn zero_has_no_sign() {
        assert_eq!([-0.00004, -0.00006, 0.1].map(super::fixed), ["0.0000", "-0.0001", "0.1000"]);
    }
}
