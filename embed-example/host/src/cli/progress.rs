//! Progress on stderr; nothing is shown where stderr is no terminal.

use super::signals;
use croupier_host::bake::Stage;
use croupier_host::render::{Observer, Progress, Target};
use indicatif::{ProgressBar, ProgressStyle};
use std::time::Duration;

/// Steps of the bar of a render.
const STEPS: u64 = 1000;

fn styled(bar: ProgressBar, template: &str) -> ProgressBar {
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = bar.with_style(style.progress_chars("=> "));
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

/// Stage and elapsed time of baking, whose end cannot be predicted. Disappears when dropped.
pub(crate) struct Baking(ProgressBar);

impl Baking {
    pub(crate) fn start() -> Self {
        Self(styled(ProgressBar::new_spinner(), "baking {spinner} {elapsed}  {msg}"))
    }

    /// Shows that `stage` begins or ends.
    pub(crate) fn show(&self, stage: Stage) {
        self.0.set_message(stage.name());
    }
}

impl Drop for Baking {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// What is measured, and the share that is done. Disappears when dropped.
pub(crate) struct Measuring(ProgressBar);

impl Measuring {
    pub(crate) fn start() -> Self {
        Self(styled(ProgressBar::new(STEPS), "measuring [{bar:30}] {percent:>3} %  {elapsed}  {msg}"))
    }

    /// Shows what is measured, and the share of everything that is done.
    pub(crate) fn show(&self, what: &str, share: f64) {
        self.0.set_message(what.to_owned());
        self.0.set_position((share * STEPS as f64) as u64);
    }
}

impl Drop for Measuring {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

/// Progress bar of a render with its error estimate and the time left, with an interval where it is predicted. Ends the render on a signal.
pub(crate) struct Rendering {
    bar: ProgressBar,
    target: Target,
}

impl Rendering {
    pub(crate) fn start(target: Target) -> Self {
        Self { bar: styled(ProgressBar::new(STEPS), "rendering [{bar:30}] {percent:>3} %  {msg}"), target }
    }
}

impl Observer for Rendering {
    fn progress(&self, p: &Progress) {
        let left = p.seconds_left(self.target);
        self.bar.set_message(message(p, left, p.seconds_left_interval(self.target)));
        if let Some(left) = left.filter(|left| p.seconds + left > 0.0) {
            self.bar.set_position((p.seconds / (p.seconds + left) * STEPS as f64) as u64);
        }
    }

    fn stop(&self) -> bool {
        signals::received().is_some()
    }
}

impl Drop for Rendering {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn message(p: &Progress, left: Option<f64>, interval: Option<[f64; 2]>) -> String {
    let error = p.relmse_estimate.map_or_else(|| "?".into(), |e| format!("{e:.2e}"));
    let left = left.map_or_else(|| "?".into(), duration);
    let speed = p.rays as f64 / p.seconds.max(1e-3) * 1e-6;
    let interval = interval.map_or(String::new(), |i| format!(" ({} to {})", duration(i[0]), duration(i[1])));
    format!("{:.0} spp, relMSE {error}, {speed:.1} Mrays/s, {left} left{interval}", p.spp)
}

/// Duration as in `42 s`, `3:05 min`, `2:07 h`.
fn duration(seconds: f64) -> String {
    let s = seconds.ceil() as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{}:{:02} min", s / 60, s % 60),
        _ => format!("{}:{:02} h", s / 3600, s % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use croupier_host::drive::Forecast;

    /// Killed by: an error that falls as 1 / sqrt(work), a time left of NaN at the start.
    #[test]
    fn time_left() {
        let mut p = Progress { spp: 16.0, rays: 1_000_000, seconds: 10.0, relmse_estimate: Some(0.04), forecast: None };
        assert_eq!(p.seconds_left(Target::Spp(64)), Some(30.0));
        assert_eq!(p.seconds_left(Target::Seconds(12.5)), Some(2.5));
        assert_eq!(p.seconds_left(Target::Rays(4_000_000)), Some(30.0));
        let left = p.seconds_left(Target::Error(0.01)).unwrap();
        assert!((left - 30.0).abs() < 1e-9, "{left}");
        assert_eq!(p.seconds_left(Target::Error(0.1)), Some(0.0));
        assert_eq!(message(&p, Some(185.0), None), "16 spp, relMSE 4.00e-2, 0.1 Mrays/s, 3:05 min left");
        assert_eq!(p.seconds_left_interval(Target::Error(0.01)), None);
        p.forecast = Some(Forecast { seconds: 70.0, interval: [55.0, 100.0] });
        assert_eq!(p.seconds_left(Target::Error(0.01)), Some(60.0));
        let interval = p.seconds_left_interval(Target::Error(0.01));
        assert!(message(&p, Some(60.0), interval).ends_with("1:00 min left (45 s to 1:30 min)"));
        assert_eq!(p.seconds_left_interval(Target::Spp(64)), None);
        let nothing = Progress::default();
        for target in [Target::Spp(4), Target::Rays(4), Target::Error(0.1)] {
            assert_eq!(nothing.seconds_left(target), None);
        }
        assert_eq!(message(&nothing, None, None), "0 spp, relMSE ?, 0.0 Mrays/s, ? left");
        assert_eq!([duration(0.2), duration(59.0), duration(7620.0)], ["1 s", "59 s", "2:07 h"]);
    }
}
