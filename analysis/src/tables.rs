//! Tables of a report: tracking errors with published values, statistics of times, comparison of logs.

use crate::metrics::{Metrics, Reference};
use crate::numeric_table::{NumericTable, Row};
use crate::stats::{Distribution, ErrorStats, mean_and_std};
use crate::table::{Column, Table};

/// Published mean and standard deviation of an error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Published {
    /// Mean. The source does not define whether of the error or of the absolute error.
    pub mean: f64,
    /// Standard deviation.
    pub std: f64,
}

impl Published {
    /// `sqrt(mean² + std²)`, equal for both definitions of the mean.
    pub fn rms(&self) -> f64 {
        self.mean.hypot(self.std)
    }
}

/// One row of the tracking table.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackingRow {
    /// Name of the quantity, such as `roll` or `LF x`.
    pub name: String,
    /// Unit.
    pub unit: &'static str,
    /// Error in the log.
    pub measured: Option<ErrorStats>,
    /// The entry of [`PUBLISHED_TRACKING`], if there is one.
    pub published: Option<Published>,
}

impl TrackingRow {
    /// Measured rms / published rms; at most 1 if tracking is as good as published.
    pub fn rms_ratio(&self) -> Option<f64> {
        Some(self.measured?.rms / self.published?.rms())
    }
}

/// Tracking errors by name of the quantity: orientation in rad, height and feet in m. The source lists two of the four feet.
///
/// Source: Raiola et al. 2020, Table 3 (HyQ in simulation, flat ground, crawl then trot).
pub const PUBLISHED_TRACKING: [(&str, Published); 10] = [
    ("roll", Published { mean: 0.0050, std: 0.0145 }),
    ("pitch", Published { mean: 0.0072, std: 0.0187 }),
    ("yaw", Published { mean: 0.0017, std: 0.0043 }),
    ("height", Published { mean: 0.0071, std: 0.0145 }),
    ("RH x", Published { mean: 0.0303, std: 0.0186 }),
    ("RH y", Published { mean: 0.0203, std: 0.0128 }),
    ("RH z", Published { mean: 0.0016, std: 0.0027 }),
    ("LF x", Published { mean: 0.0235, std: 0.0152 }),
    ("LF y", Published { mean: 0.0202, std: 0.0201 }),
    ("LF z", Published { mean: 0.0006, std: 0.0022 }),
];

fn published(name: &str) -> Option<Published> {
    PUBLISHED_TRACKING.iter().find(|(quantity, _)| *quantity == name).map(|(_, published)| *published)
}

/// Rows of the base, then of the feet in the order LF RF LH RH.
pub fn tracking_rows(metrics: &Metrics) -> Vec<TrackingRow> {
    let tracking = &metrics.tracking;
    let base = [
        ("roll", "rad", tracking.roll),
        ("pitch", "rad", tracking.pitch),
        ("yaw", "rad", tracking.yaw),
        ("height", "m", tracking.height),
    ];
    let feet = tracking.feet.iter().flat_map(|foot| {
        [("x", foot.x), ("y", foot.y), ("z", foot.z)].map(|(axis, stats)| (format!("{} {axis}", foot.leg), "m", stats))
    });
    let rows = base.into_iter().map(|(name, unit, stats)| (name.to_owned(), unit, stats)).chain(feet);
    // A robot that is not a quadruped has rows for what was measured, and nothing was published about it.
    let is_quadruped = metrics.run.quadruped;
    rows.filter(|(_, _, measured)| is_quadruped || measured.is_some())
        .map(|(name, unit, measured)| TrackingRow {
            published: published(&name).filter(|_| is_quadruped),
            name,
            unit,
            measured,
        })
        .collect()
}

/// Definition of the errors, for the line above the table.
pub fn tracking_heading(metrics: &Metrics) -> &'static str {
    match metrics.measured_against {
        Reference::GroundTruth => "Tracking error: reference - ground truth",
        Reference::Estimate => "Tracking error: reference - estimate (the log holds no ground truth)",
    }
}

/// The tracking table, with the published values and the ratio in the last four columns.
pub fn tracking(metrics: &Metrics) -> NumericTable {
    let head = ["", "mean", "std", "rms", "mean|e|", "max|e|", "publ. mean", "publ. std", "publ. rms", "ratio"];
    let rows = tracking_rows(metrics).into_iter().map(|row| {
        let (m, p) = (row.measured, row.published);
        let values = vec![
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
        let ratio_last = [4, 4, 4, 4, 4, 4, 4, 4, 2].to_vec();
        Row { decimals: ratio_last, ..Row::new(row.name, row.unit, 4, values) }
    });
    let source = if metrics.run.quadruped { "; published: Raiola et al. 2020, Table 3" } else { "" };
    let caption = format!("{}{source}", tracking_heading(metrics));
    NumericTable { caption, head: head.map(str::to_owned).to_vec(), rows: rows.collect() }
}

/// The tracking table with its caption for a terminal, ending in a newline; empty if nothing was tracked.
pub fn tracking_text(metrics: &Metrics) -> String {
    let table = tracking(metrics);
    if table.rows.is_empty() {
        return String::new();
    }
    format!("{}\n{}", table.caption, table.text())
}

/// Statistics of times: the tick and its stages; for a live run also latency after wake-up and period.
pub fn timing(metrics: &Metrics) -> NumericTable {
    let row = |name: String, d: Distribution| {
        let values = [d.mean, d.std, d.p50, d.p99, d.p999, d.max].map(Some).to_vec();
        Row::new(name, "µs", 1, values)
    };
    let mut rows = Vec::new();
    if let Some(timing) = &metrics.timing {
        rows.extend(timing.tick_us.map(|d| row("tick".to_owned(), d)));
        rows.extend(timing.stages.iter().filter_map(|s| Some(row(s.stage.to_owned(), s.us?))));
        // A lockstep run has no wake-ups.
        if timing.period_error_us.is_some() {
            rows.extend(timing.start_latency_us.map(|d| row("wake-up to start".to_owned(), d)));
            rows.extend(timing.period_error_us.map(|d| row("period - control period".to_owned(), d)));
        }
    }
    let head = ["", "mean", "std", "p50", "p99", "p99.9", "max"].map(str::to_owned).to_vec();
    NumericTable { caption: "Durations by the wall clock".to_owned(), head, rows }
}

/// Metrics of several logs side by side, with mean and standard deviation over the logs.
pub fn comparison(runs: &[(String, &Metrics)]) -> NumericTable {
    let mut rows = Vec::new();
    let mut add = |name: &str, unit: &str, decimals: usize, value: &dyn Fn(&Metrics) -> Option<f64>| {
        let each: Vec<Option<f64>> = runs.iter().map(|(_, metrics)| value(metrics)).collect();
        let known: Vec<f64> = each.iter().flatten().copied().collect();
        let (mean, std) = mean_and_std(&known).unzip();
        if !known.is_empty() {
            rows.push(Row::new(name, unit, decimals, each.into_iter().chain([mean, std]).collect()));
        }
    };
    add("fell at", "s", 3, &|m| m.safety.fell_at_s);
    add("duration", "s", 2, &|m| Some(m.run.duration_s));
    add("distance walked", "m", 3, &|m| m.locomotion.distance_m);
    add("forward speed", "m/s", 4, &|m| m.locomotion.true_velocity.map(|v| v[0]));
    let quantities = runs.first().map(|(_, m)| tracking_rows(m)).unwrap_or_default();
    for (k, TrackingRow { name, unit, .. }) in quantities.iter().enumerate() {
        add(&format!("{name} error, rms"), unit, 4, &|m| tracking_rows(m)[k].measured.map(|e| e.rms));
    }
    let touchdowns = |m: &Metrics| m.contact.as_ref().map(|c| c.touchdowns.clone());
    add("touchdown delay, median", "ms", 1, &|m| touchdowns(m)?.delay_ms.map(|d| d.p50));
    add("false touchdowns", "", 0, &|m| touchdowns(m).map(|t| t.false_count as f64));
    add("missed touchdowns", "", 0, &|m| touchdowns(m).map(|t| t.missed_count as f64));
    add("slip, all feet", "m", 3, &|m| m.slip.as_ref().map(|feet| feet.iter().map(|f| f.travel_m).sum()));
    add("positive power", "W", 1, &|m| m.energy.as_ref().map(|e| e.mean_positive_power_w));
    add("cost of transport", "", 3, &|m| m.energy.as_ref().and_then(|e| e.cost_of_transport));
    let tick = |m: &Metrics| m.timing.as_ref().and_then(|t| t.tick_us);
    add("tick, median", "µs", 1, &|m| tick(m).map(|d| d.p50));
    add("tick, p99", "µs", 1, &|m| tick(m).map(|d| d.p99));
    add("tick, largest", "µs", 1, &|m| tick(m).map(|d| d.max));
    let deadlines = |m: &Metrics| m.timing.as_ref().filter(|t| t.with_deadline > 0).map(|t| t.missed_deadlines as f64);
    add("missed deadlines", "", 0, &deadlines);
    let head = std::iter::once("").chain(runs.iter().map(|(name, _)| name.as_str())).chain(["mean", "std"]);
    NumericTable { caption: "Comparison of the logs".to_owned(), head: head.map(str::to_owned).collect(), rows }
}

/// Summary of a run as pairs of name and text: robot, duration, distance walked, falls, speed, contact, QP.
pub fn summary_rows(metrics: &Metrics) -> Vec<(&'static str, String)> {
    let (run, locomotion, safety) = (&metrics.run, &metrics.locomotion, &metrics.safety);
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
    if let Some((distance, displacement)) = locomotion.distance_m.zip(locomotion.displacement_m) {
        rows.push(("distance walked", format!("{distance:.2} m ({displacement:.2} m from start to end)")));
    }
    if let Some([x, y]) = locomotion.commanded_velocity {
        let measured = locomotion
            .true_velocity
            .map_or(String::new(), |[x, y]| format!(", measured {x:.3} forward, {y:.3} leftward"));
        rows.push((
            "mean velocity",
            format!(
                "commanded {x:.3} forward, {y:.3} leftward{measured} m/s, in {:.1} s of walking",
                locomotion.walking_s
            ),
        ));
    }
    rows.push(("fell", safety.fell_at_s.map_or("no".to_owned(), |t| format!("yes, at {t:.2} s"))));
    if let Some((height, tilt)) = safety.min_height_m.zip(safety.max_tilt_rad) {
        rows.push(("extremes", format!("lowest base height {height:.3} m, largest tilt {tilt:.3} rad")));
    }
    for fault in &safety.faults {
        rows.push((
            "fault",
            format!("{} at {:.3} s (tick {}), value {}", fault.fault, fault.t_s, fault.tick, fault.value),
        ));
    }
    if let Some(ticks) = safety.clamped_ticks {
        rows.push(("clamped torques", format!("in {ticks} ticks")));
    }
    if let Some(contact) = &metrics.contact {
        let downs = &contact.touchdowns;
        let delay = downs.delay_ms.map_or(String::new(), |d| {
            format!(", detected {:.1} ms after contact (median; p99 {:.1} ms)", d.p50, d.p99)
        });
        let missed = downs.missed_count;
        rows.push(("touchdowns", format!("{}, {} false, {missed} missed{delay}", downs.count, downs.false_count)));
    }
    if let Some(energy) = &metrics.energy {
        let transport = energy.cost_of_transport.map_or(String::new(), |c| format!(", cost of transport {c:.3}"));
        let (watts, joules) = (energy.mean_positive_power_w, energy.positive_work_j);
        rows.push(("positive work", format!("{joules:.0} J, mean {watts:.1} W{transport}")));
    }
    if let Some(feet) = &metrics.slip {
        let each: Vec<String> = feet.iter().map(|foot| format!("{} {:.3}", foot.leg, foot.travel_m)).collect();
        rows.push(("slip", format!("{} m along the ground", each.join(", "))));
    }
    if let Some(qp) = &metrics.qp {
        let bad = qp.status.failed + qp.status.infeasible;
        let spread = qp
            .iterations
            .map_or(String::new(), |d| format!("{:.1} iterations (p99 {:.0}, max {:.0}), ", d.mean, d.p99, d.max));
        rows.push(("QP", format!("{spread}{} almost solved, {bad} failed", qp.status.almost_solved)));
    }
    if let Some(timing) = &metrics.timing {
        let deadlines = match timing.with_deadline {
            0 => format!("none (lockstep); {} ticks took longer than the period", timing.longer_than_period),
            n => format!("{} of {n} missed, {} ticks skipped", timing.missed_deadlines, timing.left_out),
        };
        rows.push(("deadlines", deadlines));
    }
    rows
}

/// Summary, tracking and timing for a terminal, as in `tables.txt`.
pub fn text(metrics: &Metrics) -> String {
    let mut summary = Table::new([Column::left(""), Column::left("")]);
    for (name, value) in summary_rows(metrics) {
        summary.row([name.to_owned(), value]);
    }
    for note in &metrics.notes {
        summary.row(["note", note]);
    }
    if !metrics.missing_channels.is_empty() {
        summary.row(["not in the log".to_owned(), metrics.missing_channels.join(", ")]);
    }
    let mut text = format!("{summary}\n\n{}", tracking_text(metrics));
    let times = timing(metrics);
    if !times.rows.is_empty() {
        text += &format!("\n{}\n{}", times.caption, times.text());
    }
    text
}
