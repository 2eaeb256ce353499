//! The digest of all parameters, by which a replay notices that a parameter change is missing in a log.

use crate::digest::Digest;

/// Digest of the keys and values of a parameter text. Order, spacing and comments of the text do not matter. Keys that the text omits do not
/// count, so a log keeps its digest when a later revision adds a parameter with a default.
///
/// - `text`: valid TOML; any other text has the digest of an empty one.
pub fn parameters_digest(text: &str) -> i64 {
    let mut digest = Digest::default();
    table(&mut digest, &text.parse().unwrap_or_default());
    digest.finish()
}

fn table(digest: &mut Digest, table: &toml::Table) {
    let mut entries: Vec<_> = table.iter().collect();
    entries.sort_by_key(|(key, _)| *key);
    digest.word(entries.len() as u64);
    for (key, entry) in entries {
        bytes(digest, key);
        value(digest, entry);
    }
}

/// Every value begins with a word for its type: 1, 1.0 and "1" differ, and so do a table and an array.
fn value(digest: &mut Digest, value: &toml::Value) {
    use toml::Value;
    let mut of_type = |number: u64| digest.word(number);
    match value {
        Value::String(text) => {
            of_type(1);
            bytes(digest, text);
        }
        Value::Integer(number) => {
            of_type(2);
            digest.word(number.cast_unsigned());
        }
        Value::Float(number) => {
            of_type(3);
            digest.f64(*number);
        }
        Value::Boolean(flag) => {
            of_type(4);
            digest.word(u64::from(*flag));
        }
        Value::Datetime(time) => {
            of_type(5);
            bytes(digest, &time.to_string());
        }
        Value::Array(values) => {
            of_type(6);
            digest.word(values.len() as u64);
            values.iter().for_each(|element| self::value(digest, element));
        }
        Value::Table(inner) => {
            of_type(7);
            table(digest, inner);
        }
    }
}

fn bytes(digest: &mut Digest, text: &str) {
    digest.word(text.len() as u64);
    text.bytes().for_each(|byte| digest.word(u64::from(byte)));
}

#[cfg(test)]
mod tests {
    use super::parameters_digest;

    #[test]
    fn every_value_counts_and_the_layout_does_not() {
        let text = "[a]\nx = 1.0\nname = \"p\"\n[b]\ny = [1, 2]\non = true\n";
        let same = "# comment\nb = { on = true, y = [1,2] }\n[a]\nname = 'p'\nx = 1.0\n";
        assert_eq!(parameters_digest(text), parameters_digest(same));
        for (old, new) in [
            ("1.0", "1.5"),
            ("\"p\"", "\"q\""),
            ("[1, 2]", "[2, 1]"),
            ("true", "false"),
            ("y =", "z ="),
            ("1.0", "1"),
            ("1.0", "\"1\""),
            ("true", "1"),
        ] {
            assert_ne!(parameters_digest(text), parameters_digest(&text.replace(old, new)), "{old}");
        }
    }
}
