//! Flags of the core's settings: one for each row of their table.

use clap::{Arg, ArgMatches, Command, FromArgMatches, error::ErrorKind};
use croupier::unstable::learn::Learning;
use croupier::unstable::{MAX_PATH_LENGTH, SettingInfo, SettingRange};
use croupier::{SettingError, Settings, Strategy};
use croupier_host::render::RenderOptions;
use std::fmt::Write;

/// Most pixels of a picture that the program renders and writes.
const MAX_PIXELS: u64 = 1 << 30;

/// Settings given on the command line, with their texts.
#[derive(Debug)]
pub(crate) struct SettingsFlags {
    given: Vec<(&'static SettingInfo, String)>,
}

impl SettingsFlags {
    /// Options for the library: given settings, and defaults for the others.
    pub(crate) fn options(&self) -> Result<RenderOptions, SettingError> {
        let given = |name: &str| self.given.iter().find(|(row, _)| row.name == name).map(|(_, text)| text);
        let mut options = match given("rrs") {
            Some(text) => RenderOptions::new(Strategy::parse(text).map_err(SettingError::Strategy)?),
            None => RenderOptions::default(),
        };
        for (row, text) in &self.given {
            options.settings.set(row.name, text)?;
        }
        if given("shards").is_none() {
            options.fit_shards();
        }
        if given("guiding").is_none() && given("guide-bytes").is_none() {
            options.fit_guide();
        }
        Ok(options)
    }
}

/// Values that the program accepts: fewer than the core's where the core would cut a value without a word.
fn range(row: &SettingInfo) -> SettingRange {
    match row.name {
        "max-depth" => SettingRange::Integers { min: 1, max: MAX_PATH_LENGTH.into() },
        "size" => SettingRange::Size { max_pixels: MAX_PIXELS },
        _ => row.range,
    }
}

/// Checks the text of a setting.
fn check(row: &'static SettingInfo, text: &str) -> Result<String, String> {
    let mut settings = Settings::default();
    let narrowed = |s: &Settings| s.get(row.name).is_some_and(|value| range(row).contains(value));
    match settings.set(row.name, text) {
        Err(SettingError::Strategy(e)) => Err(e.to_string()),
        Ok(()) if row.from_scene && settings == Settings::default() || narrowed(&settings) => Ok(text.into()),
        _ => Err(format!("need {}", range(row))),
    }
}

/// Default of a setting in words.
fn default(row: &SettingInfo) -> String {
    let usual = RenderOptions::default().settings;
    match row.name {
        "shards" => format!("{}, as many as --cache-bytes has room for if that is fewer", usual.shards),
        "guide-bytes" => {
            let bytes = usual.get(row.name).map_or_else(String::new, |value| value.to_string());
            format!("{bytes}, at most a third of --cache-bytes")
        }
        "shadow-roulette" | "guiding" => {
            let strategies = Strategy::TABLE.iter().filter_map(|(name, _)| Strategy::parse(name).ok());
            let aware: Vec<_> = strategies.filter(Strategy::is_efficiency_aware).map(|s| s.name()).collect();
            let value = usual.get(row.name).map_or_else(String::new, |value| value.to_string());
            format!("{value} with {}", aware.join(" and "))
        }
        name => usual.get(name).map_or_else(String::new, |value| value.to_string()),
    }
}

fn arg(row: &'static SettingInfo) -> Arg {
    let is_flag = row.range == SettingRange::Flag;
    // the name alone stands for `true`
    let stands_alone = is_flag || matches!(row.range, SettingRange::Set(_));
    let mut help = row.help.to_string();
    // their names say it already
    if !is_flag && !matches!(row.range, SettingRange::Words(_) | SettingRange::Strategy) {
        let _ = write!(help, " ({})", range(row));
    }
    let _ = write!(help, " [default: {}]", default(row));
    let arg = Arg::new(row.name).long(row.name).value_name(row.value_name).allow_negative_numbers(true);
    let arg = arg.value_parser(move |text: &str| check(row, text)).help(help.clone());
    let arg = if stands_alone { arg.num_args(0..=1).require_equals(true).default_missing_value("true") } else { arg };
    let arg = if Learning::TABLE.contains(row) { arg.help_heading("Learning") } else { arg };
    match row.range {
        SettingRange::Strategy => arg.long_help(Strategy::TABLE.iter().fold(help, |mut help, (name, about)| {
            let _ = write!(help, "\n  {name}: {about}");
            help
        })),
        _ => arg,
    }
}

impl FromArgMatches for SettingsFlags {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let mut given = Vec::new();
        for row in Settings::TABLE {
            let text = matches.try_get_one::<String>(row.name);
            let text = text.map_err(|e| clap::Error::raw(ErrorKind::ValueValidation, e))?;
            given.extend(text.map(|text| (row, text.clone())));
        }
        Ok(Self { given })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl clap::Args for SettingsFlags {
    fn augment_args(command: Command) -> Command {
        command.args(Settings::TABLE.iter().map(arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}
