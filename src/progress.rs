//! A progress bar on standard error.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// Resolution of a bar.
const STEPS: u64 = 1000;

/// A progress bar, removed when dropped. Shows nothing if standard error is not a terminal.
pub struct Progress(ProgressBar);

impl Progress {
    /// A bar with a title.
    pub fn new(title: impl Into<std::borrow::Cow<'static, str>>) -> Self {
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{msg:<28} {bar:40} {percent:>3} % {elapsed:>4}, {left:>4} left")
            .expect("the template is a constant that parses")
            // The estimate is rounded up: work that goes on does not show 0 s left.
            .with_key("left", |state: &ProgressState, out: &mut dyn std::fmt::Write| {
                let left = if state.fraction() < 1.0 { state.eta().as_secs().max(1) } else { 0 };
                // A failing formatter only leaves the estimate out.
                let _ = write!(out, "{left}s");
            });
        bar.set_style(style);
        bar.set_message(title);
        Progress(bar)
    }

    /// Sets the completed fraction of the work, 0 to 1.
    pub fn set(&self, fraction: f64) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 0..=1000")]
        self.0.set_position((fraction.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
