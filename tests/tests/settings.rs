//! The table of settings: every row is readable, writable, checked and described.

use croupier::unstable::learn::{ControlVariate, Learning, Objective, PixelEstimator};
use croupier::unstable::rrs::{Norm, ParseError};
use croupier::unstable::{SettingRange, SettingValue};
use croupier::{Plan, Scene, SettingError, Settings, SettingsError, Strategy};
use croupier_tests::scenes::{blob, cornell};

fn of_a_scene() -> Settings {
    let blob = blob(&cornell([8, 6]));
    Settings::for_scene(&Scene::from_bytes(&blob).unwrap())
}

/// Texts that a setting accepts and such that it refuses, by its range alone.
fn texts(range: SettingRange) -> (Vec<String>, Vec<String>) {
    let owned = |texts: &[&str]| texts.iter().map(|t| t.to_string()).collect::<Vec<_>>();
    let (good, bad) = match range {
        SettingRange::Flag => (owned(&["true", "false"]), owned(&["yes", "1"])),
        SettingRange::Integers { min, max } => {
            let below = min.checked_sub(1).map(|n| n.to_string()).unwrap_or("-1".into());
            let above = max.checked_add(1).map(|n| n.to_string()).unwrap_or("18446744073709551616".into());
            (vec![max.to_string(), min.to_string()], vec![below, above, "1.5".into(), "1e3".into()])
        }
        SettingRange::Bytes => (
            owned(&["1", "1023", "1536", "24MiB", "1GiB", "3KiB", "0"]),
            owned(&["KiB", "24MB", "24 MiB", "1.5MiB", "99999999999999999999", "18446744073709551615KiB"]),
        ),
        SettingRange::Numbers { min, max } => {
            (vec![min.to_string(), max.to_string()], vec![min.next_down().to_string(), max.next_up().to_string()])
        }
        SettingRange::Positive => (owned(&["1e-30", "7", "1234567.5"]), owned(&["0", "-5", "inf", "1e-60"])),
        SettingRange::Pair { first: [a, b], second: [c, d] } => (
            vec![format!("{a}:{c}"), format!("{b}:{d}")],
            vec![format!("{}:{c}", a.next_down()), format!("{}:{d}", b.next_up()), format!("{b}:{}", c.next_down())]
                .into_iter()
                .chain([format!("{a}:{}", d.next_up()), a.to_string(), format!("{a}:{c}:{d}"), ":".into()])
                .chain([format!("nan:{c}"), format!("{a}:nan")])
                .collect(),
        ),
        SettingRange::Size { max_pixels } => (
            owned(&["1x1", "640x480", "3X5"]),
            vec!["0x5".into(), "5x0".into(), "640".into(), "x".into(), "4294967296x1".into()]
                .into_iter()
                .chain(max_pixels.checked_add(1).filter(|n| *n <= u64::from(u32::MAX)).map(|n| format!("{n}x1")))
                .collect(),
        ),
        SettingRange::Words(words) => (owned(words), owned(&["both", "Mean"])),
        SettingRange::WordsOrNumber(words) => {
            (owned(&[words, &["0.25", "-1", "3e-9"]].concat()), owned(&["on", "inf", "-inf"]))
        }
        SettingRange::Set(words) => {
            let all = words.join(",");
            (
                vec!["albedo".into(), "normal,direct".into(), all, "true".into(), "false".into()],
                owned(&["albedo,", "Depth", "1"]),
            )
        }
        SettingRange::Strategy => {
            let names = Strategy::TABLE.iter().map(|t| t.0).filter(|name| *name != "fixed");
            let more = ["fixed:2.5", "classic:7", "classic:5:relative", "threshold:0.01", "throughput:mean:0.1:1:3"];
            let more = more.into_iter().chain(["winners:2:0.5", "albedo:product", "ear:plain", "bolin-meyer:plain"]);
            (names.chain(more).map(String::from).collect(), owned(&["fixed", "fixed:0.01", "magic", "ears:bold"]))
        }
        other => panic!("no texts for {other:?}"),
    };
    (good, [bad, owned(&["", "nan", " ", "true false"])].concat())
}

/// Killed by: a field that `set` or `get` takes for another, a text that loses digits or options, a setting that is
/// changed though its text is refused, a range that is not looked at.
#[test]
fn every_setting_is_set_and_shown_by_name() {
    let base = of_a_scene();
    for row in Settings::TABLE {
        let (good, bad) = texts(row.range);
        let mut values = Vec::new();
        for text in &good {
            let mut s = base;
            s.set(row.name, text).unwrap_or_else(|e| panic!("{} {text}: {e}", row.name));
            let value = s.get(row.name).unwrap();
            assert!(row.range.contains(value) && !values.contains(&value), "{} {text}: {value:?}", row.name);
            values.push(value);
            // nothing else has changed, and the value's own text gives it back
            for other in Settings::TABLE.iter().filter(|other| other.name != row.name) {
                assert_eq!(s.get(other.name), base.get(other.name), "{} by {}", other.name, row.name);
            }
            let mut again = base;
            again.set(row.name, &value.to_string()).unwrap();
            assert_eq!(again, s, "{} {text}: {value}", row.name);
        }
        for text in &bad {
            let mut s = base;
            let e = s.set(row.name, text).expect_err(&format!("{} {text:?}", row.name));
            assert_eq!(s, base);
            match e {
                SettingError::Strategy(e) => assert!(row.name == "rrs" && e == Strategy::parse(text).unwrap_err()),
                e => assert_eq!(e, SettingError::Value(row)),
            }
        }
    }
    let mut s = base;
    for name in ["", "Ring", "max_depth", "learning", "--ring"] {
        assert_eq!((s.set(name, "1"), s.get(name)), (Err(SettingError::Name), None), "{name}");
    }
    assert_eq!(s.set("rrs", "magic"), Err(SettingError::Strategy(ParseError::Name)));
}

/// Killed by: a name that two settings share or that is no flag, a row without help, a default out of its own range.
#[test]
fn every_setting_is_described() {
    let base = of_a_scene();
    assert!(Plan::new(&base).is_ok());
    for (i, row) in Settings::TABLE.iter().enumerate() {
        let name = row.name;
        assert!(name.chars().all(|c| c.is_ascii_lowercase() || c == '-') && name.len() > 2, "{name}");
        assert!(Settings::TABLE[..i].iter().all(|other| other.name != name), "{name} twice");
        assert!(row.help.len() > 20 && !row.help.ends_with('.') && !row.help.contains('\n'), "{name}: {}", row.help);
        assert!(!row.value_name.is_empty() && !row.range.to_string().is_empty());
        let default = base.get(name).unwrap();
        assert!(row.range.contains(default), "{name} {default}");
        assert_eq!(row.from_scene, Settings::default().get(name) == Some(SettingValue::FromScene), "{name}");
    }
    // those of learning are among them
    assert!(Learning::TABLE.iter().all(|row| Settings::TABLE.contains(row)) && Learning::TABLE.len() >= 9);
}

/// Killed by: a range that is checked for texts only, an error about another setting or with another value.
#[test]
fn fields_out_of_range_are_named() {
    let base = of_a_scene();
    let refused = |change: &dyn Fn(&mut Settings)| {
        let mut s = base;
        change(&mut s);
        match Plan::new(&s) {
            Err(SettingsError::Range { setting, value }) => format!("{} {value}", setting.name),
            other => panic!("{other:?}"),
        }
    };
    let l = |change: fn(&mut Learning)| refused(&move |s| change(&mut s.learning));
    assert_eq!(refused(&|s| s.control_variate = ControlVariate::Number(f32::INFINITY)), "control-variate inf");
    assert_eq!(refused(&|s| s.control_variate = ControlVariate::Number(f32::NAN)), "control-variate NaN");
    assert_eq!(refused(&|s| s.max_depth = 0), "max-depth 0");
    assert_eq!(l(|l| l.ledger = 0), "ledger 0");
    assert_eq!(l(|l| l.factors = [0.5, 0.75]), "factors 0.5:0.75");
    assert_eq!(l(|l| l.subdivide_count = f32::INFINITY), "subdivide-count inf");
}

/// Killed by: a value of the scene that replaces the caller's, or one that is forgotten.
#[test]
fn the_scene_fills_in_what_is_left_open() {
    let blob = blob(&cornell([8, 6]));
    let scene = Scene::from_bytes(&blob).unwrap();
    let open = Settings { seed: 3, ..Settings::default() };
    assert!(matches!(Plan::new(&open), Err(SettingsError::Range { setting, .. }) if setting.name == "size"));
    let own = Settings { size: [8, 6], max_depth: scene.info.max_depth, ..open };
    assert_eq!(open.with_scene(&scene), own);
    let mut chosen = own;
    chosen.set("size", "5x7").unwrap();
    chosen.set("max-depth", "3").unwrap();
    assert_eq!(chosen.with_scene(&scene), Settings { size: [5, 7], max_depth: 3, ..own });
    chosen.set("size", "scene").unwrap();
    chosen.set("max-depth", "scene").unwrap();
    assert_eq!(chosen.with_scene(&scene), own);
    assert_eq!(
        chosen.set("seed", "scene").unwrap_err().to_string(),
        "seed: need a whole number from 0 to 18446744073709551615"
    );
}

/// Killed by: a suffix that counts in thousands, names that stand for another value, words where a number belongs.
#[test]
fn texts_stand_for_these_values() {
    let mut s = of_a_scene();
    for (name, text) in [
        ("cache-bytes", "3MiB"),
        ("objective", "absolute"),
        ("norm", "luminance"),
        ("pixel-estimator", "blocks"),
        ("control-variate", "-0.5"),
        ("factors", "0.5:2"),
        ("size", "640x480"),
        ("rrs", "classic:7:relative"),
        ("seed", "18446744073709551615"),
    ] {
        s.set(name, text).unwrap();
    }
    let l = s.learning;
    assert_eq!((l.cache_bytes, l.objective, l.norm), (3 << 20, Objective::Absolute, Norm::Luminance));
    assert_eq!((l.pixel_estimator, l.factors), (PixelEstimator::Blocks, [0.5, 2.0]));
    assert_eq!((s.control_variate, s.size, s.seed), (ControlVariate::Number(-0.5), [640, 480], u64::MAX));
    assert_eq!(s.strategy, Strategy::parse("classic:7:relative").unwrap());
    s.set("control-variate", "cached").unwrap();
    assert_eq!(s.control_variate, ControlVariate::Cached);
    for (value, text) in [(0, "0"), (1 << 10, "1KiB"), (1025, "1025"), (3 << 19, "1536KiB"), (5 << 30, "5GiB")] {
        assert_eq!(SettingValue::Bytes(value).to_string(), text);
    }
}

/// Strategies whose options are the default are their name. Killed by: options left out that matter.
#[test]
fn strategies_are_written_as_they_are_read() {
    for text in ["classic", "classic:7", "classic:5:relative", "ears", "ears:plain", "winners", "winners:2:0.5"] {
        assert_eq!(Strategy::parse(text).unwrap().to_string(), text);
    }
    for (text, short) in [("classic:5", "classic"), ("winners:1:3", "winners"), ("throughput:max", "throughput")] {
        assert_eq!(Strategy::parse(text).unwrap().to_string(), short);
    }
    assert_eq!(Strategy::parse("throughput::0.25").unwrap().to_string(), "throughput:max:0.25:0.95:1");
}
