//! Progress bars on standard error; they are hidden if standard error is not a terminal.

use std::time::Duration;

pub use indicatif::ProgressBar;
use indicatif::{MultiProgress, ProgressDrawTarget, ProgressFinish, ProgressStyle};

/// Makes the progress bars of a command.
#[derive(Clone)]
pub struct Progress(MultiProgress);

impl Default for Progress {
    /// Makes bars on standard error, if that is a terminal.
    fn default() -> Self {
        Self(MultiProgress::with_draw_target(ProgressDrawTarget::stderr()))
    }
}

impl Progress {
    /// Makes no bars at all.
    pub fn hidden() -> Self {
        Self(MultiProgress::with_draw_target(ProgressDrawTarget::hidden()))
    }

    /// Makes a bar for `length` units of work, which is removed when it is dropped. Many threads may use it at once.
    pub fn bar(&self, label: &str, length: u64) -> ProgressBar {
        let bar = self.0.add(ProgressBar::new(length).with_finish(ProgressFinish::AndClear));
        let template = "{msg:24} {bar:32} {percent:>3}% {elapsed}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(label.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        bar
    }
}
