//! Contact estimate compared with ground truth: confusion matrices, and delays of touchdowns.

use super::chart::{Chart, Layer, Plot, Section};
use super::figure_spec::{FigureSpec, Named};
use super::panel::Range;
use super::style::{BLUE, Mark, TEXT, VERMILLION, pale};
use super::trace::run_stroke;
use crate::metrics::{ContactMetrics, touchdown_delays_ms};
use crate::run::{LEGS, Run};

/// True contact and estimated flag of each cell of a confusion matrix.
const CELLS: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];
/// Range of the histogram of delays, ms. The outermost bins contain all delays outside.
const DELAYS: (i32, i32) = (-10, 30);

pub(super) fn chart(runs: &[(Named, &Run)], _: &FigureSpec) -> Result<Chart, String> {
    let mut sections = Vec::new();
    let mut delays = Vec::new();
    for (name, run) in runs {
        let contact = ContactMetrics::of(run).ok_or("GROUND_TRUTH and CONTACT_ESTIMATE")?;
        let heading = |leg: &str| if runs.len() == 1 { leg.to_owned() } else { format!("{leg}, {}", name.0) };
        let plots = contact.legs.iter().map(|leg| {
            let counts = [[leg.none_none, leg.none_found], [leg.true_missed, leg.true_found]];
            confusion(counts, heading(leg.leg), &leg.touchdowns)
        });
        sections.push(Section { columns: vec![1.0; LEGS.len()], plots: plots.collect(), shared_x: false });
        delays
            .push((0..LEGS.len()).flat_map(|leg| touchdown_delays_ms(&run.ticks, leg)).flatten().collect::<Vec<f64>>());
    }
    sections.push(Section::column(vec![histogram(&delays)]));
    let mut legend = vec![
        ("flag equals true contact".to_owned(), Mark::Fill(pale(BLUE, 0.45))),
        ("flag differs".to_owned(), Mark::Fill(pale(VERMILLION, 0.45))),
    ];
    if runs.len() > 1 {
        legend.extend(runs.iter().enumerate().map(|(k, (name, _))| (name.0.clone(), Mark::Line(run_stroke(k)))));
    }
    let caption = "Fraction of ticks by true contact (rows) and estimated contact flag (columns), with the number of touchdowns that were detected without contact \
                   (false) or more than 20 ms late (missed). Below: time from first true contact to its detection; the outermost bins contain all delays outside."
        .to_owned();
    Ok(Chart { caption, sections, legend })
}

fn confusion(counts: [[u64; 2]; 2], heading: String, downs: &crate::metrics::Touchdowns) -> Plot {
    let total = counts.iter().flatten().sum::<u64>().max(1) as f64;
    let mut layers = Vec::new();
    for (truth, flag) in CELLS {
        let share = counts[truth][flag] as f64 / total;
        let (x, y) = (flag as f64, truth as f64);
        let color = if truth == flag { BLUE } else { VERMILLION };
        // A wrong flag in 0.1 % of the ticks must be visible.
        let opacity = if share > 0.0 { 0.1 + 0.5 * share.powf(0.3) } else { 0.03 };
        layers.push(Layer::Box((x + 0.03, y + 0.03), (x + 0.97, y + 0.97), pale(color, opacity)));
        layers.push(Layer::Text((x + 0.5, y + 0.5), format!("{:.2} %", 100.0 * share), TEXT));
    }
    let range = Range { min: 0.0, max: 2.0 };
    Plot {
        heading: Some(heading),
        x_label: format!("{} false, {} missed of {}", downs.false_count, downs.missed_count, downs.count),
        x: range,
        y: range,
        categories: Some(["no flag".to_owned(), "flag".to_owned()]),
        height: 74.0,
        rows: vec!["contact".to_owned(), "air".to_owned()],
        layers,
        ..Plot::default()
    }
}

fn histogram(delays: &[Vec<f64>]) -> Plot {
    let bins = (DELAYS.1 - DELAYS.0) as usize;
    let mut layers = vec![];
    let mut most: f64 = 1.0;
    for (k, delays) in delays.iter().enumerate() {
        let mut shares = vec![0.0; bins];
        for delay in delays {
            let bin = (delay - f64::from(DELAYS.0)).floor().clamp(0.0, bins as f64 - 1.0) as usize;
            shares[bin] += 100.0 / delays.len() as f64;
        }
        most = shares.iter().copied().fold(most, f64::max);
        let edge = |bin: usize| f64::from(DELAYS.0) + bin as f64;
        let mut outline = vec![(edge(0), 0.0)];
        outline.extend((0..bins).flat_map(|b| [(edge(b), shares[b]), (edge(b + 1), shares[b])]));
        outline.push((edge(bins), 0.0));
        layers.push(Layer::Path(outline, run_stroke(k)));
    }
    Plot {
        x_label: "delay of detection [ms]".to_owned(),
        y_label: "touchdowns [%]".to_owned(),
        x: Range { min: f64::from(DELAYS.0), max: f64::from(DELAYS.1) },
        y: Range { min: 0.0, max: 1.1 * most },
        height: 110.0,
        layers,
        ..Plot::default()
    }
}
