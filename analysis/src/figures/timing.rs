//! Duration of ticks and of their quadratic programs: over the run, and as a histogram on the same axis.

use super::canvas::{Align, Drawing, Stroke};
use super::panel::{Frame, Labels, Panel, Range};
use super::style::{
    BLUE, BOTTOM_MARGIN, LEFT_MARGIN, Mark, PAGE_WIDTH, REFERENCE_LINE, RIGHT_MARGIN, TEXT, TICK_EM, TOP_MARGIN,
    VERMILLION, legend, pale,
};
use super::{Figure, Lacking, series, times, whole};
use crate::metrics::{qp_us, tick_us};
use crate::run::Run;
use crate::stats::Distribution;

const NAME: &str = "timing";
const TITLE: &str = "Duration of ticks";
const HEIGHT: f64 = 230.0;
const HISTOGRAM_WIDTH: f64 = 150.0;
const GAP: f64 = 18.0;
const BINS: usize = 80;
/// Width over which samples are summed up by median and maximum.
const STRETCH: f64 = 2.0;

const TICK_LINE: Stroke = Stroke { color: BLUE, width: 1.1 };
const PALE_LINE: Stroke = Stroke { color: pale(BLUE, 0.35), width: 1.1 };
const QP_LINE: Stroke = Stroke { color: VERMILLION, width: 1.1 };

pub(super) fn draw(run: &Run) -> Result<Figure, Lacking> {
    if !run.has("TIMING") {
        return Err(Lacking { name: NAME, title: TITLE, needs: "TIMING" });
    }
    // A clock that did not move between two stamps has no logarithm: such samples are not drawn.
    let positive = |us: f64| (us > 0.0).then_some(us);
    let ticks = series(&run.ticks, |t| t.timing.as_ref().map(tick_us).and_then(positive));
    let qps = series(&run.ticks, |t| t.timing.as_ref().map(qp_us).and_then(positive));
    let deadline_us = if run.period_s() > 0.0 { run.period_s() * 1e6 } else { 1000.0 };
    let (Some(tick_spread), qp_spread) =
        (Distribution::of(ticks.iter().copied()), Distribution::of(qps.iter().copied()))
    else {
        return Err(Lacking { name: NAME, title: TITLE, needs: "TIMING with durations above zero" });
    };
    let least = qp_spread.map_or(tick_spread.min, |qp| qp.min.min(tick_spread.min));
    let us = Range { min: 0.8 * least, max: 1.25 * tick_spread.max.max(deadline_us) };

    let mut drawing = Drawing::new(PAGE_WIDTH, TOP_MARGIN + HEIGHT + BOTTOM_MARGIN);
    let width = drawing.width() - LEFT_MARGIN - RIGHT_MARGIN - HISTOGRAM_WIDTH - GAP;
    let frame = Frame { left: LEFT_MARGIN, top: TOP_MARGIN, width, height: HEIGHT };
    let time = whole(run);
    let over_time = Panel::new(frame, time, us).logarithmic();
    let xs = times(&run.ticks);
    over_time.grid(&mut drawing);
    let series =
        [(&ticks, TICK_LINE), (&qps, QP_LINE)].map(|(us, stroke)| (over_time.median_and_max(&xs, us, STRETCH), stroke));
    for ([_, largest], stroke) in &series {
        drawing.line(largest.clone(), Stroke { color: pale(stroke.color, 0.35), width: 0.6 });
    }
    for ([median, _], stroke) in series {
        drawing.line(median, stroke);
    }
    over_time.dashed(&mut drawing, &[time.min, time.max], &[deadline_us; 2], REFERENCE_LINE);
    over_time.axes(&mut drawing, Labels { x: Some("time [s]"), y: Some("duration [µs]") });

    let shares = [&ticks, &qps].map(|samples| histogram(samples, us));
    let most = shares.iter().flatten().copied().fold(1.0, f64::max);
    let frame = Frame { left: LEFT_MARGIN + width + GAP, width: HISTOGRAM_WIDTH, ..frame };
    let histograms = Panel::new(frame, Range { min: 0.0, max: 1.08 * most }, us).logarithmic();
    histograms.grid(&mut drawing);
    for (share, stroke) in shares.iter().zip([TICK_LINE, QP_LINE]) {
        drawing.line(outline(&histograms, share, us), stroke);
    }
    histograms.dashed(&mut drawing, &[0.0, 1.08 * most], &[deadline_us; 2], REFERENCE_LINE);
    histograms.axes(&mut drawing, Labels { x: Some("share of ticks [%]"), y: None });
    let right = frame.left + frame.width;
    for (k, (name, spread)) in [("tick", Some(tick_spread)), ("QP", qp_spread)].into_iter().enumerate() {
        if let Some(spread) = spread {
            let text = format!("{name}: p50 {:.0}, p99 {:.0} µs", spread.p50, spread.p99);
            drawing.text((right, TOP_MARGIN - 13.0 + 11.0 * k as f64), text, TICK_EM, Align::Right, TEXT);
        }
    }
    let deadline = format!("control period, {deadline_us:.0} µs");
    let entries = [
        ("tick", Mark::Line(TICK_LINE)),
        ("QP", Mark::Line(QP_LINE)),
        ("pale: largest", Mark::Line(PALE_LINE)),
        (&*deadline, Mark::Dashed(REFERENCE_LINE)),
    ];
    legend(&mut drawing, LEFT_MARGIN, 14.0, &entries);
    let caption = "Wall-clock time of each tick and of its quadratic program, on a logarithmic axis: median and largest over short stretches of \
                   the run, and histogram.".to_owned();
    Ok(Figure { name: NAME, title: TITLE, caption, drawing })
}

/// Share of the samples in each of `BINS` logarithmic bins, %.
fn histogram(samples: &[f64], range: Range) -> Vec<f64> {
    let mut counts = vec![0.0; BINS];
    let finite: Vec<f64> = samples.iter().copied().filter(|us| us.is_finite()).collect();
    for us in &finite {
        let place = (us / range.min).ln() / (range.max / range.min).ln() * BINS as f64;
        counts[(place.max(0.0) as usize).min(BINS - 1)] += 100.0 / finite.len() as f64;
    }
    counts
}

/// The steps of a histogram that lies on its side.
fn outline(panel: &Panel, shares: &[f64], range: Range) -> Vec<(f64, f64)> {
    let edge = |k: usize| range.min * (range.max / range.min).powf(k as f64 / BINS as f64);
    let filled = |k: usize| shares[k] > 0.0;
    let Some((first, last)) = (0..BINS).find(|&k| filled(k)).zip((0..BINS).rev().find(|&k| filled(k))) else {
        return Vec::new();
    };
    let mut points = vec![panel.at(0.0, edge(first))];
    points.extend((first..=last).flat_map(|k| [panel.at(shares[k], edge(k)), panel.at(shares[k], edge(k + 1))]));
    points.push(panel.at(0.0, edge(last + 1)));
    points
}
