//! Progress on stderr, for people at a terminal only.

use std::env;

use indicatif::{ProgressBar, ProgressStyle};

/// A bar of `length` steps with a word on what is being done. Draws nothing unless stderr is a terminal.
pub(super) fn bar(length: usize, what: &'static str) -> ProgressBar {
    if is_dumb() {
        return ProgressBar::hidden();
    }
    // indicatif hides a bar by itself when stderr is no terminal.
    let bar = ProgressBar::new(length as u64).with_message(what);
    if let Ok(style) = ProgressStyle::with_template("{msg:12} {wide_bar} {pos}/{len} {elapsed}") {
        bar.set_style(style);
    }
    bar
}

/// A spinner for a stage whose length is not known.
pub(super) fn spinner(what: &'static str) -> ProgressBar {
    if is_dumb() {
        return ProgressBar::hidden();
    }
    let spinner = ProgressBar::new_spinner().with_message(what);
    spinner.enable_steady_tick(std::time::Duration::from_millis(100));
    spinner
}

/// A terminal that cannot go back to the beginning of a line.
fn is_dumb() -> bool {
    env::var_os("TERM").is_some_and(|term| term == "dumb")
}
