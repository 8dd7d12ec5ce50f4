//! How a scene is rendered, as files say it.

use crate::settings::Constants;
use std::collections::BTreeMap;

/// The values by which a scene is rendered, by name.
pub type Own = BTreeMap<String, String>;

pub fn own(constants: &Constants, background: [f32; 3]) -> Own {
    let Constants { alpha_max, alpha_min, blur, near, t_min, .. } = constants;
    let text = |value: &f32| value.to_string();
    [
        ("alpha_max", text(alpha_max)),
        ("alpha_min", text(alpha_min)),
        ("background", background.map(|part| part.to_string()).join(" ")),
        ("blur", text(blur)),
        ("near", text(near)),
        ("t_min", text(t_min)),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

/// The values that differ from the defaults.
pub fn unusual(constants: &Constants, background: Option<[f32; 3]>) -> Own {
    let usual = own(&Constants::default(), [0.0; 3]);
    let mut own = own(constants, background.unwrap_or_default());
    own.retain(|name, value| usual.get(name) != Some(value));
    own
}

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rendering {
    /// Defaults for absent and impossible values.
    pub constants: Constants,
    /// RGB, where the file has a valid one.
    pub background: Option<[f32; 3]>,
    /// A sentence for each impossible value, without the file's name.
    pub notes: Vec<String>,
}

impl Rendering {
    /// Parses the values of [`own`].
    pub fn of(own: &Own) -> Self {
        let mut notes = Vec::new();
        let mut wrong = |name: &str, text: &str| {
            let text = text.escape_debug();
            notes.push(format!("its `{name}` is `{text}`, which cannot be; the usual one is taken"));
        };
        let mut number = |name: &str, usual: f32, is_one: &dyn Fn(f32) -> bool| {
            let Some(text) = own.get(name) else { return usual };
            text.parse().ok().filter(|value| is_one(*value)).unwrap_or_else(|| {
                wrong(name, text);
                usual
            })
        };
        let is_length = |value: f32| value > 0.0 && value.is_finite();
        let usual = Constants::default();
        let constants = Constants {
            alpha_max: number("alpha_max", usual.alpha_max, &|value| value > 0.5 && value < 1.0),
            alpha_min: number("alpha_min", usual.alpha_min, &|value| value > 0.0 && value < 0.5),
            blur: number("blur", usual.blur, &is_length),
            near: number("near", usual.near, &is_length),
            t_min: number("t_min", usual.t_min, &|value| (0.0..1.0).contains(&value)),
            ..usual
        };
        let background = own.get("background").and_then(|text| {
            let parts = text.split(' ').map(|part| part.parse().ok().filter(|part: &f32| part.is_finite()));
            let parts = parts.collect::<Option<Vec<f32>>>().and_then(|parts| parts.try_into().ok());
            if parts.is_none() {
                wrong("background", text);
            }
            parts
        });
        Rendering { constants, background, notes }
    }
}

pub fn list(own: &Own) -> String {
    own.iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
}
