//! What a replay found, in words.

use controller::dump::Quantity;
use replay::engine::{Deviation, Divergence, Index, ReplayReport, WhatIf, lines};

/// Stretches of missing ticks that are listed.
const GAPS_LISTED: usize = 8;

/// The report in words: first what is not as it was when the log was written. `joints`: names, URDF order.
pub fn text(report: &ReplayReport, joints: &[String]) -> String {
    let ReplayReport { ticks, messages_compared, real_time_factor, wall_seconds, .. } = report;
    let mut text = deviations(&report.deviations);
    text += &match &report.first_divergence {
        None if report.identical => format!("identical: {ticks} ticks"),
        None => format!("nothing to compare: {ticks} ticks, and the log holds none of their outputs"),
        Some(divergence) => divergence_text(divergence),
    };
    text += &format!(
        "\n{messages_compared} messages compared, {wall_seconds:.1} s ({real_time_factor:.1} times real time)"
    );
    let mut note = |n: u64, what: &str| {
        if n > 0 {
            text += &format!("\n{n} {what}");
        }
    };
    note(report.messages_different, "messages differ");
    note(report.unverifiable_ticks, "ticks have no output in the log");
    note(report.missing_input_ticks, "ticks have no input in the log");
    note(report.skipped_ticks, "ticks were not computed: the state before them is unknown");
    note(report.late_messages, "messages were too late or came twice");
    note(report.damaged, "stretches of the log are damaged");
    note(u64::from(report.cut), "cut: the log stops inside a record");
    if !report.missing_ticks.is_empty() {
        let one =
            |(first, last): &(i64, i64)| if first == last { first.to_string() } else { format!("{first} to {last}") };
        let listed: Vec<String> = report.missing_ticks.iter().take(GAPS_LISTED).map(one).collect();
        let more = if report.missing_ticks.len() > GAPS_LISTED { ", …" } else { "" };
        text += &format!("\nmissing, not different: ticks {}{more}", listed.join(", "));
    }
    if let Some(what_if) = &report.what_if {
        text += &format!("\n{}", what_if_text(what_if, joints));
    }
    text + &report.first_divergence.as_ref().map(inputs).unwrap_or_default()
}

/// One line for all of the build, one for each parameter.
fn deviations(found: &[Deviation]) -> String {
    let mut text = String::new();
    for Deviation { what, log, here } in found {
        let shown = |value: &str| if value.is_empty() { "absent".to_owned() } else { value.to_owned() };
        text += &format!("not as in the log: {what}: {} there, {} here\n", shown(log), shown(here));
    }
    text
}

fn what_if_text(what_if: &WhatIf, joints: &[String]) -> String {
    let WhatIf { bound, ticks, tau_difference_max, tau_difference_rms, qp_failed_ticks, .. } = what_if;
    let how_far = match &what_if.departure {
        Some(departure) => {
            let t_s = departure.t_s;
            let joint = joints.get(departure.joint).cloned().unwrap_or_else(|| format!("joint {}", departure.joint));
            format!(
                "what if: from tick {} (t = {t_s:.3} s) on, {joint} by {:+.1} N m, the command leaves the recorded one by more than {bound} N m:\n\
                 the robot would have moved otherwise, and what follows answers inputs that would not have come",
                departure.tick, departure.by
            )
        }
        None => format!("what if: the command stays within {bound} N m of the recorded one"),
    };
    let late = match what_if.changes_not_reached {
        0 => String::new(),
        n => format!("\n{n} of the changes come behind the end of what was replayed"),
    };
    format!(
        "{how_far}\n{ticks} ticks before that: torques differ by {tau_difference_max:.3} N m at most, {tau_difference_rms:.3} N m rms; \
         {qp_failed_ticks} without a solution{late}"
    )
}

/// Where record and replay part, in words.
pub fn divergence_text(d: &Divergence) -> String {
    let agreed = d.last_agreed_tick.map_or("none".to_owned(), |tick| tick.to_string());
    let t_s = d.t_s;
    let also: Vec<String> =
        d.also.iter().map(|f| format!("{} {}", f.channel, field(&f.field, &f.index, f.ulp))).collect();
    let also = if also.is_empty() { String::new() } else { format!("\n  so do {}", also.join("; ")) };
    format!(
        "differs from tick {} (t = {t_s:.3} s) on, first in stage {}: {} {}\n  recorded {}\n  replayed {}{also}\n  last tick that agreed: {agreed}",
        d.tick,
        d.stage,
        d.channel,
        field(&d.field, &d.index, d.ulp),
        d.recorded,
        d.replayed
    )
}

/// A field with its index, and how far apart its values are.
fn field(name: &str, index: &Option<Index>, ulp: Option<u64>) -> String {
    let index = match index {
        None => String::new(),
        Some(index) => {
            serde_json::to_string(index).map_or(String::new(), |i| format!("[{}]", i.trim_matches(['[', ']'])))
        }
    };
    let ulp = ulp.map_or(String::new(), |ulp| format!(", {ulp} ulp apart"));
    format!("{name}{index}{ulp}")
}

/// What the stage that differs was computed from.
fn inputs(d: &Divergence) -> String {
    if d.inputs == Quantity::group() {
        return String::new();
    }
    let lines: Vec<String> = lines(&d.inputs).into_iter().map(|line| format!("  {line}")).collect();
    format!("\ninputs of stage {} (all of the tick: --break {}):\n{}", d.stage, d.tick, lines.join("\n"))
}
