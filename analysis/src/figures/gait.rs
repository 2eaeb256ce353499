//! Gait diagram: commanded stance, estimated and true contact of each leg. For several logs, commanded stance of each log.

use super::chart::{Chart, Layer, Plot, Section};
use super::figure_spec::{FigureSpec, Named, window_text};
use super::style::{BLUE, FRAME, Mark, RUN_COLORS, VERMILLION};
use super::trace::Timeline;
use crate::run::{LEGS, Run, Tick};

/// Height of the row of a leg, and of a bar.
const ROW: f64 = 40.0;
const BAR: f64 = 8.0;

type Holds = fn(&Tick, usize) -> bool;

/// Name and color of a bar, and the condition in which it is drawn.
struct Bar<'a> {
    name: String,
    color: super::canvas::RGBAColor,
    holds: Holds,
    timeline: &'a Timeline<'a>,
}

pub(super) fn chart(runs: &[(Named, &Run)], spec: &FigureSpec) -> Result<Chart, String> {
    if let Some((name, _)) = runs.iter().find(|(_, run)| !run.has("LEG_STATE")) {
        return Err(if runs.len() == 1 { "LEG_STATE".to_owned() } else { format!("LEG_STATE in {}", name.0) });
    }
    let window = runs.first().map(|(_, run)| spec.detail(run)).ok_or("a log")?;
    let timelines: Vec<Timeline> = runs.iter().map(|(_, run)| Timeline::new(run, window)).collect();
    let stands: Holds = |t, leg| t.stands(leg) == Some(true);
    let bars: Vec<Bar> = if let ([(_, run)], [timeline]) = (runs, &timelines[..]) {
        let kinds: [(&str, &str, Holds, _); 3] = [
            ("LEG_STATE", "commanded stance", stands, FRAME.color),
            (
                "CONTACT_ESTIMATE",
                "estimated contact",
                |t, leg| t.contact.as_ref().is_some_and(|c| c.contact[leg]),
                VERMILLION,
            ),
            ("GROUND_TRUTH", "true contact", |t, leg| t.truth.as_ref().is_some_and(|w| w.contact[leg]), BLUE),
        ];
        let known = kinds.into_iter().filter(|(channel, ..)| run.has(channel));
        known.map(|(_, name, holds, color)| Bar { name: name.to_owned(), color, holds, timeline }).collect()
    } else {
        let of_run = |(k, (timeline, (name, _))): (usize, (_, &(Named, &Run)))| Bar {
            name: format!("stance, {}", name.0),
            color: RUN_COLORS[k % RUN_COLORS.len()],
            holds: stands,
            timeline,
        };
        timelines.iter().zip(runs).enumerate().map(of_run).collect()
    };
    let row = ROW.max(bars.len() as f64 * (BAR + 2.0) + 8.0);
    let height = row * spec.legs.len() as f64;
    let mut layers = Vec::new();
    for (place, &leg) in spec.legs.iter().enumerate() {
        let first = place as f64 * row + 0.5 * (row - bars.len() as f64 * (BAR + 2.0) + 2.0);
        for (k, bar) in bars.iter().enumerate() {
            let spans = bar.timeline.spans(|tick| (bar.holds)(tick, leg));
            layers.push(Layer::Bars(spans, ((first + k as f64 * (BAR + 2.0)) / height, BAR / height), bar.color));
        }
    }
    let rows = spec.legs.iter().map(|&leg| LEGS[leg].to_owned()).collect();
    let plot = Plot { x: window, height, rows, layers, ..Plot::default() };
    let caption = format!("Commanded stance, estimated contact and true contact of each leg, {}.", window_text(window));
    let legend = bars.into_iter().map(|bar| (bar.name, Mark::Fill(bar.color))).collect();
    Ok(Chart { caption, sections: vec![Section::column(vec![plot])], legend })
}
