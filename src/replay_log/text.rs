//! The text that `hoof replay` prints.

use replay::engine::{
    ComponentReport, Deviation, Divergence, Index, MissingOutputs, OtherParameters, OtherType, ReplayReport, WhatIf,
    lines,
};
use replay::printable;

/// Ranges of missing ticks that are listed.
const GAPS_LISTED: usize = 8;

/// The report as text. Differences in build, parameters and types come first. `joints`: names, URDF order.
pub fn text(report: &ReplayReport, joints: &[String]) -> String {
    let ReplayReport { components, ticks, messages_compared, real_time_factor, wall_seconds, .. } = report;
    let mut text = deviations(&report.deviations);
    text += &match &report.first_divergence {
        None if report.identical && report.complete && components.len() > 1 => "identical: all components".to_owned(),
        None if report.identical && report.complete => format!("identical: {ticks} ticks"),
        None if report.identical => format!("identical as far as recorded, but incomplete: {ticks} ticks"),
        None => format!("nothing to compare: the log contains no output of the {ticks} ticks"),
        Some(divergence) => divergence_text(divergence),
    };
    text += &format!(
        "\n{messages_compared} messages compared, {wall_seconds:.1} s ({real_time_factor:.1} times real time)"
    );
    if components.len() > 1 {
        components.iter().for_each(|component| text += &format!("\n{}", component_text(component)));
    }
    let violations = &report.release_violations;
    if let Some(first) = &violations.first {
        text += &format!(
            "\n{} deliveries violate the latency of their component, first: {}",
            violations.count,
            first.text()
        );
    }
    let mut note = |n: u64, what: &str| {
        if n > 0 {
            text += &format!("\n{n} {what}");
        }
    };
    note(report.messages_different, "messages differ");
    note(report.unverifiable_ticks, "ticks have no output in the log");
    note(report.missing_input_ticks, "ticks have no input in the log");
    note(report.skipped_ticks, "ticks were not computed: the state before them is unknown");
    note(report.damaged, "damaged parts of the log");
    note(u64::from(report.cut), "cut: the log ends inside a record");
    note(report.account.foreign_messages, "messages of other runs were left out");
    let losses = report.missing_outputs.iter().map(MissingOutputs::text);
    let losses = losses.chain(report.other_parameters.iter().map(OtherParameters::text)).chain(report.account.text());
    losses.for_each(|line| text += &format!("\n{line}"));
    for OtherType { channel, type_name, found, expected, count, is_every_message } in &report.account.other_types {
        let origin = if *is_every_message { "of another version of" } else { "of another program, not of type" };
        text += &format!(
            "\nleft out: {count} messages on {} {origin} {type_name}: fingerprint {found:016x}, expected {expected:016x}",
            printable(channel)
        );
    }
    if !report.missing_ticks.is_empty() {
        let one =
            |(first, last): &(i64, i64)| if first == last { first.to_string() } else { format!("{first} to {last}") };
        let listed: Vec<String> = report.missing_ticks.iter().take(GAPS_LISTED).map(one).collect();
        let more = if report.missing_ticks.len() > GAPS_LISTED { ", …" } else { "" };
        text += &format!("\nticks without input: {}{more}", listed.join(", "));
    }
    if let Some(what_if) = &report.what_if {
        text += &format!("\n{}", what_if_text(what_if, joints));
    }
    text + &report.first_divergence.as_ref().map(inputs).unwrap_or_default()
}

/// One line for a component of a run with several.
fn component_text(component: &ComponentReport) -> String {
    let ComponentReport { ticks, late_results, .. } = component;
    let late = if *late_results > 0 { format!(", {late_results} late results") } else { String::new() };
    let verdict = match &component.first_divergence {
        _ if !component.replayed && component.complete => "not replayed".to_owned(),
        _ if !component.replayed => "not replayed: the log has no input of it".to_owned(),
        Some(first) => {
            format!("differs from its tick {} on: {} {}", first.tick, printable(&first.channel), first.field)
        }
        None if component.identical && component.complete => format!("identical: {ticks} ticks"),
        None if component.identical => format!("identical as far as recorded, but incomplete: {ticks} ticks"),
        None => format!("nothing to compare: the log contains no output of the {ticks} ticks"),
    };
    format!("component {}: {verdict}{late}", printable(&component.name))
}

/// One line for each difference between the log and this build.
fn deviations(found: &[Deviation]) -> String {
    let mut text = String::new();
    for Deviation { what, log, here } in found {
        let shown = |value: &str| if value.is_empty() { "absent".to_owned() } else { value.to_owned() };
        text += &format!("differs from the log: {what} is {}, the log has {}\n", shown(here), shown(log));
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
                "what if: not valid from tick {} (t = {t_s:.3} s): the torque of {joint} differs from the recorded one by {:+.1} N m, limit {bound} N m\n\
                 outputs after this tick use inputs that the changed robot would not have produced",
                departure.tick, departure.by
            )
        }
        None => format!("what if: valid, all torques stay within {bound} N m of the recorded ones"),
    };
    let late = match what_if.changes_not_reached {
        0 => String::new(),
        n => format!("\n{n} of the changes were not applied: their times are after the last replayed tick"),
    };
    format!(
        "{how_far}\n{ticks} valid ticks: largest torque difference {tau_difference_max:.3} N m, rms {tau_difference_rms:.3} N m; \
         {qp_failed_ticks} ticks without a QP solution{late}"
    )
}

/// The first difference between record and replay, as text.
pub fn divergence_text(d: &Divergence) -> String {
    let agreed = d.last_agreed_tick.map_or("none".to_owned(), |tick| tick.to_string());
    let t_s = d.t_s;
    let also: Vec<String> =
        d.also.iter().map(|f| format!("{} {}", f.channel, field(&f.field, &f.index, f.ulp))).collect();
    let also = if also.is_empty() { String::new() } else { format!("\n  also different: {}", also.join("; ")) };
    format!(
        "differs from tick {} (t = {t_s:.3} s) on, first in stage {}: {} {}\n  recorded {}\n  replayed {}{also}\n  last identical tick: {agreed}",
        d.tick,
        d.stage,
        d.channel,
        field(&d.field, &d.index, d.ulp),
        d.recorded,
        d.replayed
    )
}

/// A field with its index and the distance of its values.
fn field(name: &str, index: &Option<Index>, ulp: Option<u64>) -> String {
    let index = match index {
        None => String::new(),
        Some(index) => {
            serde_json::to_string(index).map_or(String::new(), |i| format!("[{}]", i.trim_matches(['[', ']'])))
        }
    };
    let ulp = ulp.map_or(String::new(), |ulp| format!(" ({ulp} ulp)"));
    format!("{name}{index}{ulp}")
}

/// The inputs of the first stage that differs.
fn inputs(d: &Divergence) -> String {
    if d.inputs.is_empty() {
        return String::new();
    }
    let lines: Vec<String> = lines(&d.inputs).into_iter().map(|line| format!("  {line}")).collect();
    format!("\ninputs of stage {} (all of the tick: --break {}):\n{}", d.stage, d.tick, lines.join("\n"))
}
