use crate::settings::Constants;
use std::collections::BTreeMap;

/// The values by which a scene is rendered, by name, as files say it.
pub type Own = BTreeMap<String, String>;

pub fn own(constants: &Constants, background: [f32; 3]) -> Own {
    let numbers = [
        ("alpha_max", constants.alpha_max),
        ("alpha_min", constants.alpha_min),
        ("blur", constants.blur),
        ("near", constants.near),
        ("t_min", constants.t_min),
    ];
    let mut own: Own = numbers.map(|(name, value)| (name.to_owned(), value.to_string())).into();
    own.insert("background".to_owned(), background.map(|part| part.to_string()).join(" "));
    own
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
        let usual = Constants::default();
        let mut wrong = Vec::new();
        let mut number = |name: &'static str, usual: f32, is_one: &dyn Fn(f32) -> bool| {
            let Some(text) = own.get(name) else { return usual };
            let value = text.parse().ok().filter(|value| is_one(*value));
            value.unwrap_or_else(|| {
                wrong.push((name, text));
                usual
            })
        };
        let is_part = |value: f32| value > 0.0 && value < 1.0;
        let is_length = |value: f32| value > 0.0 && value.is_finite();
        let constants = Constants {
            alpha_max: number("alpha_max", usual.alpha_max, &|value| is_part(value) && value > 0.5),
            alpha_min: number("alpha_min", usual.alpha_min, &|value| is_part(value) && value < 0.5),
            blur: number("blur", usual.blur, &is_length),
            near: number("near", usual.near, &is_length),
            t_min: number("t_min", usual.t_min, &|value| value == 0.0 || is_part(value)),
            ..usual
        };
        let background = own.get("background").and_then(|text| {
            let parts = text.split(' ').map(|part| part.parse().ok()).collect::<Option<Vec<f32>>>();
            let parts = parts.and_then(|parts| <[f32; 3]>::try_from(parts).ok());
            let parts = parts.filter(|parts| parts.iter().all(|part| part.is_finite()));
            if parts.is_none() {
                wrong.push(("background", text));
            }
            parts
        });
        let note = |(name, text): (&str, &String)| {
            format!("its `{name}` is `{}`, which cannot be; the usual one is taken", text.escape_debug())
        };
        Rendering { constants, background, notes: wrong.into_iter().map(note).collect() }
    }
}

pub fn list(own: &Own) -> String {
    own.iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ")
}
