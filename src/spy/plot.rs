//! The plot page: selected fields over time.

use super::curve::{Curve, bounds, range};
use super::screen_data::ScreenData;
use super::state::State;
use super::table;
use super::view::{cut, dim_style, first_shown, ruled};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, GraphType, Paragraph};

/// Colors of the curves, used in turn.
const COLORS: [Color; 6] = [Color::Cyan, Color::Yellow, Color::Green, Color::Magenta, Color::Blue, Color::Red];
/// Columns of a curve's name in the list below the plot.
const NAME: usize = 36;

/// Draws the curves and, below them, a legend with the values.
pub fn draw(frame: &mut Frame, area: Rect, screen_data: &ScreenData, state: &State) {
    if screen_data.curves.is_empty() {
        let text = "no field selected: press 1, select a channel, Enter, select a number, p";
        frame.render_widget(Paragraph::new(text).style(dim_style()), area);
        return;
    }
    let listed = (screen_data.curves.len() as u16).min(area.height / 3);
    let [plot, list] = Layout::vertical([Constraint::Min(4), Constraint::Length(listed)]).areas(area);
    let points: Vec<Vec<(f64, f64)>> = screen_data
        .curves
        .iter()
        .map(|curve| {
            let thinned = curve.thinned(state.span_s, usize::from(plot.width) * 2);
            if state.is_normalised { normalised(thinned) } else { thinned }
        })
        .collect();
    let dataset = |(place, points)| {
        let style = Style::new().fg(color(place));
        Dataset::default().marker(Marker::Braille).graph_type(GraphType::Line).style(style).data(points)
    };
    let y = bounds(range(points.iter().flatten().map(|(_, value)| *value)));
    let label = |x: f64| Span::styled(table::number(x), dim_style());
    let y_labels = if state.is_normalised {
        ["min", "", "max"].map(Span::raw)
    } else {
        [y[0], y[0].midpoint(y[1]), y[1]].map(label)
    };
    let x_labels = [-state.span_s, -state.span_s / 2.0, 0.0].map(|t| Span::styled(format!("{t} s"), dim_style()));
    let chart = Chart::new(points.iter().map(Vec::as_slice).enumerate().map(dataset).collect())
        .block(ruled("+ - time span   z normalise   p remove"))
        .x_axis(Axis::default().bounds([-state.span_s, 0.0]).labels(x_labels).style(dim_style()))
        .y_axis(Axis::default().bounds(y).labels(y_labels).style(dim_style()));
    frame.render_widget(chart, plot);
    let name = |(place, curve): (usize, &Curve)| {
        let at = if place == state.curve { Modifier::REVERSED } else { Modifier::empty() };
        let range = curve.range(state.span_s);
        let [last, low, high] =
            [curve.last(), range.map(|r| r.0), range.map(|r| r.1)].map(|x| x.map_or("-".to_owned(), table::number));
        let name = cut(&format!("{} {}", curve.channel, curve.path), NAME);
        let text = format!("{name:<NAME$} {last:>10}  from {low} to {high}");
        Line::styled(text, Style::new().fg(color(place)).add_modifier(at))
    };
    let from = first_shown(state.curve, screen_data.curves.len(), listed.into());
    let lines: Vec<Line> = screen_data.curves.iter().enumerate().map(name).skip(from).collect();
    frame.render_widget(Paragraph::new(lines), list);
}

fn color(place: usize) -> Color {
    COLORS[place % COLORS.len()]
}

/// Values scaled to 0..1.
fn normalised(mut points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    let (low, high) = range(points.iter().map(|(_, value)| *value)).unwrap_or_default();
    let part = |value: f64| if high > low { (value - low) / (high - low) } else { 0.5 };
    points.iter_mut().for_each(|(_, value)| *value = part(*value));
    points
}
