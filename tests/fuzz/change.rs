//! Changes to the bytes of a part: of any, of the words of a text, of the values of JSON.

use crate::common::prelude::*;
/// Kind, where, from where, with what; all are taken modulo what there is.
pub type Change = (u8, u32, u32, u64);

const NUMBERS: &str = "0 -0.0 1 -1 2 3 255 256 65535 65536 2147483647 2147483648 4294967295 4294967296 -2147483649 \
     18446744073709551615 18446744073709551616 1e-320 1e-30 1e30 3.5e38 1e308 1e999 nan -inf";
const WORDS: [&str; 20] = [
    "",
    "..",
    "../../x",
    "/etc/passwd",
    "a\\b",
    "\u{0}",
    "\u{202e}",
    "\n",
    "\"",
    "'",
    "[",
    "]",
    "{",
    "}",
    "=",
    ",",
    "#",
    "true",
    "null",
    "property list uchar int x",
];

fn number_of(value: u64) -> &'static str {
    let all: Vec<&str> = NUMBERS.split(' ').collect();
    all[value as usize % all.len()]
}

pub fn changed(bytes: Vec<u8>, change: &Change) -> Vec<u8> {
    let kind = change.0;
    match String::from_utf8(bytes) {
        Ok(text) if kind >= 96 => match serde_json::from_str::<Value>(&text) {
            Ok(value) if kind >= 160 => changed_json(value, change).to_string().into_bytes(),
            _ => changed_text(&text, change).into_bytes(),
        },
        Ok(text) => changed_bytes(text.into_bytes(), change),
        Err(fault) => changed_bytes(fault.into_bytes(), change),
    }
}

fn put(bytes: &mut [u8], at: usize, new: &[u8]) {
    bytes.iter_mut().skip(at).zip(new).for_each(|(byte, new)| *byte = *new);
}

fn changed_bytes(mut bytes: Vec<u8>, &(kind, at, from, value): &Change) -> Vec<u8> {
    let n = bytes.len();
    if n == 0 {
        return value.to_le_bytes().to_vec();
    }
    let (at, from) = (at as usize % n, from as usize % n);
    let range = from..(from + 1 + value as usize % 64).min(n);
    let copy = bytes[range.clone()].to_vec();
    let words = [0u32, 1, 0x7f, 0xff, 0xffff, 0x1_0000, 0x7fff_ffff, 0x8000_0000, 0xffff_fffe, 0xffff_ffff];
    let floats = [0.0f32, -1.0, 1e-45, 1e-30, 1e30, f32::MAX, f32::INFINITY, f32::NEG_INFINITY, f32::NAN];
    let (word, float) = (words[value as usize % words.len()], floats[value as usize % floats.len()]);
    let aligned = at & !3;
    match kind % 12 {
        0 => bytes[at] ^= 1 << (value % 8),
        1 => bytes[at] = value as u8,
        2 => put(&mut bytes, at, &word.to_le_bytes()),
        3 => put(&mut bytes, aligned, &word.to_le_bytes()),
        4 => put(&mut bytes, aligned, &float.to_le_bytes()),
        5 => put(&mut bytes, at & !7, &f64::from(float).to_le_bytes()),
        6 => put(&mut bytes, at, &u64::from(word).wrapping_mul(0x1_0000_0001).to_le_bytes()),
        7 => drop(bytes.drain(range)),
        8 => drop(bytes.splice(at..at, copy)),
        9 => bytes.truncate(at),
        10 => put(&mut bytes, at, &copy),
        _ => bytes[at] = bytes[at].wrapping_add(if value % 2 == 0 { 1 } else { 255 }),
    }
    bytes
}

fn is_number(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_digit() || c == '-' || c == '.')
}

fn words(text: &str) -> Vec<&str> {
    let mut all = Vec::new();
    let mut rest = text;
    let is_inner = |c: char| c.is_alphanumeric() || "_.-+".contains(c);
    while let Some(first) = rest.chars().next() {
        let n =
            if is_inner(first) { rest.find(|c: char| !is_inner(c)).unwrap_or(rest.len()) } else { first.len_utf8() };
        let (word, behind) = rest.split_at(n);
        all.push(word);
        rest = behind;
    }
    all
}

fn changed_text(text: &str, &(kind, at, from, value): &Change) -> String {
    let pick = |n: usize, by: u32| by as usize % n.max(1);
    let number = number_of(value);
    if kind % 4 == 3 {
        let mut lines: Vec<&str> = text.split('\n').collect();
        let (at, from) = (pick(lines.len(), at), pick(lines.len(), from));
        match value % 4 {
            0 => drop(lines.remove(at)),
            1 => lines.insert(at, lines[from]),
            2 => lines.swap(at, from),
            _ => (0..1 + value as usize % 50).for_each(|_| lines.insert(at, lines[from])),
        }
        return lines.join("\n");
    }
    let mut words = words(text);
    let numbers: Vec<usize> = (0..words.len()).filter(|i| is_number(words[*i])).collect();
    let (place, other) = (pick(words.len(), at), pick(words.len(), from));
    match (kind % 4, numbers.is_empty() || words.is_empty()) {
        (_, true) if words.is_empty() => return number.to_owned(),
        (0 | 1, false) => words[numbers[pick(numbers.len(), at)]] = number,
        _ if value % 3 == 0 => words[place] = WORDS[value as usize % WORDS.len()],
        _ if value % 3 == 1 => words[place] = words[other],
        _ => words.insert(place, WORDS[value as usize % WORDS.len()]),
    }
    words.concat()
}

fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(items) => items.iter().map(count).sum(),
        Value::Object(fields) => fields.values().map(count).sum(),
        _ => 0,
    }
}

/// The value of number `at`, in the order of the text.
fn nth<'a>(value: &'a mut Value, at: &mut usize) -> Option<&'a mut Value> {
    if *at == 0 {
        return Some(value);
    }
    *at -= 1;
    match value {
        Value::Array(items) => items.iter_mut().find_map(|item| nth(item, at)),
        Value::Object(fields) => fields.values_mut().find_map(|item| nth(item, at)),
        _ => None,
    }
}

fn changed_json(mut whole: Value, &(kind, at, from, value): &Change) -> Value {
    let n = count(&whole);
    let copy = nth(&mut whole, &mut (from as usize % n)).cloned().unwrap_or_default();
    let Some(place) = nth(&mut whole, &mut (at as usize % n)) else { return whole };
    let number: f64 = number_of(value).parse().unwrap_or_default();
    match (kind % 8, &mut *place) {
        (0, Value::Array(items)) if !items.is_empty() => drop(items.remove(value as usize % items.len())),
        (0, Value::Object(fields)) if !fields.is_empty() => {
            let key = fields.keys().nth(value as usize % fields.len()).cloned().unwrap_or_default();
            fields.remove(&key);
        }
        (1, Value::Array(items)) => (0..1 + value % 40).for_each(|_| items.push(copy.clone())),
        (1, Value::Object(fields)) => drop(fields.insert(WORDS[value as usize % WORDS.len()].to_owned(), copy)),
        (2 | 3, _) => *place = serde_json::json!(number),
        (4, _) => *place = serde_json::json!(number as i64),
        (5, _) => *place = serde_json::json!(WORDS[value as usize % WORDS.len()]),
        (6, _) => {
            *place = [Value::Null, Value::Bool(true), serde_json::json!([]), serde_json::json!({})][value as usize % 4]
                .clone()
        }
        _ => *place = copy,
    }
    whole
}
