//! Plots of the ledger.

mod canvas;
mod curves;
mod marks;
mod points;

pub(super) use canvas::{Figure, series_of};
pub(super) use curves::LEVEL;

use super::ledger::Ledger;
use std::error::Error;

/// Every figure for which the ledger has numbers. Names of those of a scene end in its number.
pub(super) fn all(ledger: &Ledger) -> Result<Vec<Figure>, Box<dyn Error>> {
    let mut figures = Vec::new();
    for (n, scene) in ledger.scenes.iter().enumerate() {
        figures.extend(curves::errors(&format!("error-{n}"), scene)?);
        figures.extend(curves::times(&format!("times-{n}"), scene)?);
        figures.extend(marks::knobs(&format!("settings-{n}"), scene)?);
        figures.extend(curves::depths(&format!("depth-{n}"), scene)?);
    }
    figures.extend(points::reliability(ledger)?);
    figures.extend(points::forecasts(ledger)?);
    figures.extend(points::functions(ledger)?);
    figures.extend(points::primitives(ledger)?);
    for group in ["scattering", "lights", "media"] {
        figures.extend(marks::components(group, &ledger.components)?);
        figures.extend(marks::twins(group, &ledger.components)?);
    }
    Ok(figures)
}
