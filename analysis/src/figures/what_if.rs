//! Torques of what-if replays compared with the record. Curves are gray after the tick from which the recorded inputs are no longer valid for the changed controller.

use super::Figure;
use super::canvas::{RGBAColor, Stroke};
use super::chart::{Chart, Layer, Plot, Section};
use super::panel::Range;
use super::style::{BLACK, BLUE, LEG_COLORS, Mark, TRUE_LINE, VERMILLION, pale};
use replay::engine::{Sample, WhatIf};

const PANEL_HEIGHT: f64 = 150.0;
/// Longest interval shown, s; of a longer log, the interval around the first departure.
const SHOWN_S: f64 = 4.0;
/// Fraction of the interval before the departure.
const BEFORE: f64 = 0.75;
const COLORS: [RGBAColor; 6] = [VERMILLION, BLUE, LEG_COLORS[0], LEG_COLORS[1], LEG_COLORS[2], LEG_COLORS[3]];
const GREY_LINE: Stroke = Stroke { color: RGBAColor(0xB8, 0xB8, 0xB8, 1.0), width: 0.9 };
const BOUND: Stroke = Stroke { color: BLACK, width: 0.8 };
const RECORDED: Stroke = Stroke { color: BLACK, ..TRUE_LINE };
/// Background of the interval in which no curve is valid.
const INVALID: RGBAColor = pale(BLACK, 0.06);

/// Draws replays of one log, each with its name. Upper panel: recorded and replayed torque of the joint that departs first, or else differs most. Lower panel:
/// largest difference of any joint, with the bound.
pub fn what_if(replays: &[(String, &WhatIf)]) -> Figure {
    let samples = replays.iter().map(|(_, what_if)| &what_if.samples).find(|samples| !samples.is_empty());
    let departures = || replays.iter().filter_map(|(_, what_if)| what_if.departure);
    let first = departures().min_by_key(|departure| departure.t_ns);
    let last = departures().max_by_key(|departure| departure.t_ns);
    let all_depart = replays.iter().all(|(_, what_if)| what_if.departure.is_some());
    let joint = first.map_or_else(|| largest(replays), |departure| departure.joint);

    let begin = samples.and_then(|samples| samples.first()).map_or(0.0, |sample| sample.t_s);
    let end = samples.and_then(|samples| samples.last()).map_or(0.0, |sample| sample.t_s);
    let middle = first.map_or(begin, |departure| departure.t_s);
    let from = (middle - BEFORE * SHOWN_S).clamp(begin, (end - SHOWN_S).max(begin));
    let time = Range { min: from, max: (from + SHOWN_S).min(end).max(from + 1e-3) };

    let torque = |of: &[f32]| of.get(joint).map_or(f64::NAN, |tau| f64::from(*tau));
    let difference = |sample: &Sample| {
        sample.replayed.iter().zip(&sample.recorded).map(|(a, b)| f64::from((a - b).abs())).fold(f64::NAN, f64::max)
    };
    let curve = |what_if: &WhatIf, value: &dyn Fn(&Sample) -> f64| -> (Vec<f64>, Vec<f64>) {
        let shown = what_if.samples.iter().filter(|sample| (time.min..=time.max).contains(&sample.t_s));
        shown.map(|sample| (sample.t_s, value(sample))).unzip()
    };
    let recorded = samples.zip(replays.first()).map(|(_, (_, what_if))| curve(what_if, &|s| torque(&s.recorded)));
    let values: [&dyn Fn(&Sample) -> f64; 2] = [&|sample| torque(&sample.replayed), &difference];
    let bound = replays.first().map_or(0.0, |(_, what_if)| what_if.bound);
    let line = |xs: &[f64], ys: &[f64], stroke| Layer::Line { xs: xs.into(), ys: ys.to_vec(), stroke, dashed: false };
    let mut plots = Vec::new();
    for (row, value) in values.into_iter().enumerate() {
        let curves: Vec<(Vec<f64>, Vec<f64>)> = replays.iter().map(|(_, what_if)| curve(what_if, value)).collect();
        let mut seen: Vec<f64> = curves.iter().flat_map(|(_, ys)| ys.iter().copied()).collect();
        match (row, &recorded) {
            (0, Some((_, ys))) => seen.extend(ys),
            (0, None) => {}
            // Differences far above the bound are cut off.
            _ => seen = seen.into_iter().map(|y| y.min(4.0 * bound)).chain([0.0, bound]).collect(),
        }
        let mut layers = Vec::new();
        if let (Some(last), true) = (last, all_depart) {
            layers.push(Layer::Shade(vec![(last.t_s, time.max)], INVALID));
        }
        if let (0, Some((xs, ys))) = (row, &recorded) {
            layers.push(line(xs, ys, RECORDED));
        }
        for (k, ((_, what_if), (xs, ys))) in replays.iter().zip(&curves).enumerate() {
            let departure_s = what_if.departure.map_or(f64::INFINITY, |departure| departure.t_s);
            let split = xs.partition_point(|x| *x <= departure_s);
            layers.push(line(&xs[split..], &ys[split..], GREY_LINE));
            layers.push(line(&xs[..split], &ys[..split], stroke_of(k)));
        }
        if row == 1 {
            layers.push(Layer::Level(bound, BOUND));
        }
        let y_label = [format!("torque of joint {joint} [N m]"), "largest difference [N m]".to_owned()][row].clone();
        let y = Range::covering(&seen, 1.0);
        plots.push(Plot { y_label, x: time, y, height: PANEL_HEIGHT, layers, ..Plot::default() });
    }
    let mut legend = vec![("recorded".to_owned(), Mark::Line(RECORDED))];
    legend.extend(replays.iter().enumerate().map(|(k, (name, _))| (name.clone(), Mark::Line(stroke_of(k)))));
    if first.is_some() {
        legend.push(("no longer valid".to_owned(), Mark::Line(GREY_LINE)));
    }
    legend.push(("bound".to_owned(), Mark::Dashed(BOUND)));
    let caption = format!(
        "Torque of joint {joint} (URDF order): recorded, and replayed with other parameters on the same inputs. Gray: a torque has differed from the record by \
         more than the bound, so the recorded inputs are no longer valid for the changed controller."
    );
    Figure::of_chart("what_if", "What if", &Chart { caption, sections: vec![Section::column(plots)], legend })
}

fn stroke_of(k: usize) -> Stroke {
    Stroke { color: COLORS[k % COLORS.len()], width: 1.0 }
}

/// The joint with the largest difference of torque.
fn largest(replays: &[(String, &WhatIf)]) -> usize {
    let mut most = (0.0, 0);
    for sample in replays.iter().flat_map(|(_, what_if)| &what_if.samples) {
        for (joint, (a, b)) in sample.replayed.iter().zip(&sample.recorded).enumerate() {
            if (a - b).abs() > most.0 {
                most = ((a - b).abs(), joint);
            }
        }
    }
    most.1
}
