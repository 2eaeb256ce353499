//! A progress bar on standard error, where a person sees it and a pipe does not.

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Parts into which a bar is divided.
const STEPS: u64 = 1000;

/// A bar that goes from 0 to 1; silent where standard error is no terminal.
pub struct Progress(ProgressBar);

impl Progress {
    /// A bar that says what is being done.
    pub fn new(what: impl Into<std::borrow::Cow<'static, str>>) -> Self {
        let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{msg:<28} {bar:40} {percent:>3} % {elapsed:>4}, {eta:>4} left")
            .expect("the template is a constant that parses");
        bar.set_style(style);
        bar.set_message(what);
        Progress(bar)
    }

    /// Shows that `part` of the work, 0 to 1, is done.
    pub fn set(&self, part: f64) {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited to 0..=1000")]
        self.0.set_position((part.clamp(0.0, 1.0) * STEPS as f64) as u64);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
