//! Keys and strings in TOML text.

/// A TOML key, quoted if it must be.
pub(crate) fn toml_key(name: &str) -> String {
    let bare = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c));
    if bare { name.to_owned() } else { quoted(name) }
}

/// A basic string: the only form that is valid for any key. Names have no control characters.
pub(crate) fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

#[cfg(test)]
mod tests {
    use super::toml_key;

    #[test]
    fn any_name_is_a_key() {
        for name in ["a_1", "", "l'r \"q\" \\ .#=[x]", "左前", "'' \"\""] {
            let table: toml::Table = format!("{} = 1", toml_key(name)).parse().unwrap();
            assert_eq!(table.keys().collect::<Vec<_>>(), [name]);
        }
    }
}
