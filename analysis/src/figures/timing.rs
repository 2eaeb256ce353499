//! Durations by the wall clock: period and computation time over the run, and their distributions.

use std::rc::Rc;

use super::canvas::Stroke;
use super::chart::{Chart, Layer, Plot, Section};
use super::figure_spec::{FigureSpec, Named, whole};
use super::panel::Range;
use super::style::{BLUE, LEG_COLORS, Mark, REFERENCE_LINE, VERMILLION, pale};
use super::trace::{Timeline, run_stroke};
use crate::metrics::{period_us, qp_stage, stage_us, tick_us};
use crate::run::Run;
use crate::stats::Distribution;

const BINS: usize = 80;
const TICK_LINE: Stroke = Stroke { color: VERMILLION, width: 1.1 };
const PALE_LINE: Stroke = Stroke { color: pale(VERMILLION, 0.35), width: 1.1 };
const QP_LINE: Stroke = Stroke { color: LEG_COLORS[0], width: 1.1 };
const PERIOD_LINE: Stroke = Stroke { color: BLUE, width: 0.6 };

/// One quantity of a run: name, line style and samples in µs; NaN if missing.
struct Times {
    name: &'static str,
    stroke: Stroke,
    xs: Rc<[f64]>,
    us: Vec<f64>,
}

/// Computation time, time of the QP and, for a live run, period. Durations of 0 have no logarithm and are ignored.
fn times(run: &Run, window: Range) -> Result<Vec<Times>, String> {
    if !run.has("TIMING") {
        return Err("TIMING".to_owned());
    }
    let timeline = Timeline::new(run, window);
    let positive = |us: f64| (us > 0.0).then_some(us);
    let of_tick = |value: &dyn Fn(&lcmtypes::Timing) -> Option<f64>| {
        timeline.series(|t| t.timing.as_ref().and_then(value).and_then(positive))
    };
    let of_qp = qp_stage(run).map(|stage| of_tick(&|timing| stage_us(timing, stage)));
    let xs = timeline.xs();
    let mut all = vec![Times {
        name: "computation",
        stroke: TICK_LINE,
        xs: Rc::clone(&xs),
        us: of_tick(&|timing| Some(tick_us(timing))),
    }];
    all.extend(of_qp.map(|us| Times { name: "QP", stroke: QP_LINE, xs: Rc::clone(&xs), us }));
    if is_live(run) {
        let (at, us) = periods(timeline.ticks);
        all.insert(0, Times { name: "period", stroke: PERIOD_LINE, xs: at, us });
    }
    if all.iter().all(|times| times.us.iter().all(|us| us.is_nan())) {
        return Err("TIMING with durations above 0".to_owned());
    }
    Ok(all)
}

/// Times between the wake-ups of consecutive ticks, µs, at the time of the later tick.
fn periods(ticks: &[crate::run::Tick]) -> (Rc<[f64]>, Vec<f64>) {
    let pairs = ticks.windows(2).filter_map(|pair| {
        let us = period_us(pair[0].timing.as_ref()?, pair[1].timing.as_ref()?)?;
        (us > 0.0).then_some((pair[1].t_s, us))
    });
    let (xs, us): (Vec<f64>, Vec<f64>) = pairs.unzip();
    (xs.into(), us)
}

/// True if the run has deadlines; lockstep has none.
fn is_live(run: &Run) -> bool {
    run.ticks.iter().any(|tick| tick.timing.as_ref().is_some_and(|t| t.deadline_ns > 0))
}

fn deadline_us(run: &Run) -> f64 {
    if run.period_s() > 0.0 { run.period_s() * 1e6 } else { 1000.0 }
}

/// Range of all samples and the deadline, µs.
fn range<'a>(all: impl Iterator<Item = &'a Times>, deadline: f64) -> Range {
    let finite = all.flat_map(|times| times.us.iter().copied()).filter(|us| us.is_finite());
    let (least, most) = finite.fold((deadline, deadline), |(lo, hi), us| (lo.min(us), hi.max(us)));
    Range { min: 0.8 * least, max: 1.25 * most }
}

/// Period and computation time over the run, one panel per log, with histograms at the side. Source: Laurenzi 2020, Figure 4.2.
pub(super) fn over_time(runs: &[(Named, &Run)], spec: &FigureSpec) -> Result<Chart, String> {
    let mut sections = Vec::new();
    let (mut live, mut lockstep) = (false, false);
    for (name, run) in runs {
        let window = spec.whole(run);
        let all = times(run, window)?;
        let deadline = deadline_us(run);
        let us = range(all.iter(), deadline);
        let mut layers = Vec::new();
        for times in &all {
            let (xs, ys, stroke) = (Rc::clone(&times.xs), times.us.clone(), times.stroke);
            layers.push(match times.name {
                "period" => Layer::Line { xs, ys, stroke, dashed: false },
                _ => Layer::Spread { xs, ys, stroke },
            });
        }
        layers.push(Layer::Level(deadline, REFERENCE_LINE));
        let y_label = "time [µs]".to_owned();
        let heading = (runs.len() > 1).then(|| name.0.clone());
        let height = 200.0;
        let over_time = Plot {
            heading: heading.clone(),
            y_label: y_label.clone(),
            x: window,
            y: us,
            logarithmic: [false, true],
            height,
            layers,
            ..Plot::default()
        };
        let shares: Vec<(Vec<f64>, Stroke)> = all.iter().map(|t| (histogram(&t.us, us), t.stroke)).collect();
        let most = shares.iter().flat_map(|(share, _)| share).copied().fold(1.0, f64::max);
        let mut layers: Vec<Layer> =
            shares.into_iter().map(|(share, stroke)| Layer::Path(sideways(&share, us), stroke)).collect();
        layers.push(Layer::Level(deadline, REFERENCE_LINE));
        let sideways = Plot {
            heading,
            x_label: "share of ticks [%]".to_owned(),
            y_label,
            x: Range { min: 0.0, max: 1.08 * most },
            y: us,
            logarithmic: [false, true],
            height,
            layers,
            ..Plot::default()
        };
        sections.push(Section { columns: vec![0.7, 0.3], plots: vec![over_time, sideways], shared_x: false });
        *if is_live(run) { &mut live } else { &mut lockstep } = true;
    }
    let mut legend = Vec::new();
    if live {
        legend.push(("period, wake-up to wake-up".to_owned(), Mark::Line(PERIOD_LINE)));
    }
    legend.extend([
        ("computation: median".to_owned(), Mark::Line(TICK_LINE)),
        ("computation: maximum".to_owned(), Mark::Line(PALE_LINE)),
        ("QP".to_owned(), Mark::Line(QP_LINE)),
        ("control period".to_owned(), Mark::Dashed(REFERENCE_LINE)),
    ]);
    let remark = if lockstep { " A lockstep run has no wake-ups and no deadlines." } else { "" };
    let caption = format!(
        "Wall-clock time of each tick and of its quadratic program: median and maximum of short intervals, and histogram. Time axes are logarithmic.{remark}"
    );
    Ok(Chart { caption, sections, legend })
}

/// Histogram and complementary cumulative distribution of the durations, and jitter of the period. Several logs are overlaid.
pub(super) fn distribution(runs: &[(Named, &Run)], _: &FigureSpec) -> Result<Chart, String> {
    let all: Vec<Vec<Times>> = runs.iter().map(|(_, run)| times(run, whole(run))).collect::<Result<_, _>>()?;
    let deadline = runs.first().map_or(1000.0, |(_, run)| deadline_us(run));
    let us = range(all.iter().flatten(), deadline);
    let alone = runs.len() == 1;
    let (mut histograms, mut tails, mut legend, mut most) = (Vec::new(), Vec::new(), Vec::new(), 1.0_f64);
    let mut notes = Vec::new();
    for (k, ((name, _), times)) in runs.iter().zip(&all).enumerate() {
        // For several logs, only the computation time.
        for times in times.iter().filter(|t| alone || t.name == "computation") {
            let stroke = if alone { Stroke { width: 1.1, ..times.stroke } } else { run_stroke(k) };
            let share = histogram(&times.us, us);
            most = share.iter().copied().fold(most, f64::max);
            histograms.push(Layer::Path(sideways(&share, us).into_iter().map(|(x, y)| (y, x)).collect(), stroke));
            tails.push(Layer::Path(tail(&times.us), stroke));
            let label = if alone { times.name.to_owned() } else { format!("computation, {}", name.0) };
            if let Some(d) = Distribution::of(times.us.iter().copied()) {
                notes.push(format!(
                    "{label}: p50 {:.0}, p99 {:.0}, p99.9 {:.0}, max {:.0} µs",
                    d.p50, d.p99, d.p999, d.max
                ));
            }
            legend.push((label, Mark::Line(stroke)));
        }
    }
    legend.push((format!("control period, {deadline:.0} µs"), Mark::Dashed(REFERENCE_LINE)));
    for layers in [&mut histograms, &mut tails] {
        layers.push(Layer::Upright(deadline, REFERENCE_LINE));
    }
    let x_label = "time [µs]".to_owned();
    let plots = vec![
        Plot {
            y_label: "share of ticks [%]".to_owned(),
            x_label: x_label.clone(),
            x: us,
            y: Range { min: 0.0, max: 1.5 * most },
            logarithmic: [true, false],
            height: 130.0,
            layers: histograms,
            notes,
            ..Plot::default()
        },
        Plot {
            y_label: "share above [%]".to_owned(),
            x_label,
            x: us,
            y: Range { min: 100.0 / longest(&all), max: 100.0 },
            logarithmic: [true, true],
            height: 130.0,
            layers: tails,
            ..Plot::default()
        },
    ];
    let mut sections = vec![Section { columns: vec![1.0], plots, shared_x: true }];
    sections.extend(jitter(runs));
    let caption = "Histogram of durations. Below: fraction of ticks that took longer (complementary cumulative distribution), with logarithmic axes to show rare long \
                   ticks. For a live run also the deviation of the period from the control period."
        .to_owned();
    Ok(Chart { caption, sections, legend })
}

/// Deviation of the period from the control period, of live runs.
fn jitter(runs: &[(Named, &Run)]) -> Option<Section> {
    let mut layers = Vec::new();
    let (mut widest, mut notes) = (10.0_f64, Vec::new());
    let each: Vec<(usize, Vec<f64>)> = runs
        .iter()
        .enumerate()
        .filter(|(_, (_, run))| is_live(run))
        .map(|(k, (_, run))| (k, periods(&run.ticks).1.into_iter().map(|us| us - deadline_us(run)).collect()))
        .collect();
    for (_, errors) in &each {
        let sizes = Distribution::of(errors.iter().map(|e: &f64| e.abs()));
        widest = sizes.map_or(widest, |d| widest.max(1.2 * d.p999));
    }
    // Empty bins are drawn at half a sample.
    let least = 50.0 / each.iter().map(|(_, errors)| errors.len()).max().unwrap_or(1).max(1) as f64;
    for (k, errors) in &each {
        let mut shares = vec![0.0; BINS];
        for error in errors {
            let bin = ((error + widest) / (2.0 * widest) * BINS as f64).clamp(0.0, BINS as f64 - 1.0) as usize;
            shares[bin] += 100.0 / errors.len() as f64;
        }
        let edge = |bin: usize| -widest + 2.0 * widest * bin as f64 / BINS as f64;
        layers.push(Layer::Path(
            (0..BINS).flat_map(|b| [edge(b), edge(b + 1)].map(|at| (at, shares[b].max(least)))).collect(),
            run_stroke(*k),
        ));
        if let Some(d) = Distribution::of(errors.iter().copied()) {
            notes.push(format!("{}: std {:.1} µs", runs[*k].0.0, d.std));
        }
    }
    let plot = Plot {
        x_label: "period - control period [µs]; the outermost bins contain all values outside".to_owned(),
        y_label: "share of ticks [%]".to_owned(),
        x: Range { min: -widest, max: widest },
        y: Range { min: least, max: 100.0 },
        logarithmic: [false, true],
        height: 110.0,
        layers,
        notes,
        ..Plot::default()
    };
    (!each.is_empty()).then(|| Section::column(vec![plot]))
}

/// Fraction of the samples in each of `BINS` logarithmic bins, %.
fn histogram(samples: &[f64], range: Range) -> Vec<f64> {
    let mut counts = vec![0.0; BINS];
    let finite = || samples.iter().filter(|us| us.is_finite());
    let total = finite().count() as f64;
    for us in finite() {
        let place = (us / range.min).ln() / (range.max / range.min).ln() * BINS as f64;
        counts[(place.max(0.0) as usize).min(BINS - 1)] += 100.0 / total;
    }
    counts
}

/// Outline of a histogram with time on the vertical axis: points of fraction and time.
fn sideways(shares: &[f64], range: Range) -> Vec<(f64, f64)> {
    let edge = |k: usize| range.min * (range.max / range.min).powf(k as f64 / BINS as f64);
    let filled = |k: usize| shares[k] > 0.0;
    let Some((first, last)) = (0..BINS).find(|&k| filled(k)).zip((0..BINS).rev().find(|&k| filled(k))) else {
        return Vec::new();
    };
    let mut points = vec![(0.0, edge(first))];
    points.extend((first..=last).flat_map(|k| [(shares[k], edge(k)), (shares[k], edge(k + 1))]));
    points.push((0.0, edge(last + 1)));
    points
}

/// Complementary cumulative distribution: time, and fraction of samples above it in %. About 1000 points, denser towards the end.
fn tail(samples: &[f64]) -> Vec<(f64, f64)> {
    let mut sorted: Vec<f64> = samples.iter().copied().filter(|us| us.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    let mut points = Vec::new();
    let mut above = n;
    while above > 0 {
        points.push((sorted[n - above], 100.0 * above as f64 / n as f64));
        above -= (above / 100).max(1);
    }
    points
}

fn longest(all: &[Vec<Times>]) -> f64 {
    all.iter().flatten().map(|times| times.us.len()).max().unwrap_or(1).max(10) as f64
}
