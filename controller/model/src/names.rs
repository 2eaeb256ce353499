//! Names of links, joints and other parts: their largest length, and names similar to one that does not exist.

/// Largest length of a name, bytes.
pub(super) const MAX_NAME: usize = 200;

/// At most three names similar to `wanted`, the most similar first; ties keep the order of `names`. None for a name that is longer than any name may be:
/// the comparison takes the product of the two lengths.
pub fn near_names<'a>(wanted: &str, names: impl Iterator<Item = &'a str>) -> Vec<String> {
    if wanted.len() > MAX_NAME {
        return Vec::new();
    }
    let wanted = wanted.to_lowercase();
    let mut ranked: Vec<(usize, &str)> = names
        .filter_map(|name| {
            let lower = name.to_lowercase();
            let distance = edit_distance(&wanted, &lower);
            let part = !wanted.is_empty() && lower.contains(&wanted);
            let close = distance <= 1 + wanted.len().max(lower.len()) / 3;
            (part || close).then_some((distance, name))
        })
        .collect();
    ranked.sort_by_key(|(distance, _)| *distance);
    ranked.into_iter().take(3).map(|(_, name)| name.to_owned()).collect()
}

/// The part of a message that lists similar names.
pub fn near_list(near: &[String]) -> String {
    if near.is_empty() { String::new() } else { format!("; near: {}", near.join(", ")) }
}

/// Levenshtein distance of two names.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, ca) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &cb) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(ca != cb);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn similar_names_are_ranked_and_others_left_out() {
        let names = ["lf_haa_joint", "rf_haa_joint", "lf_foot", "trunk"];
        assert_eq!(near_names("LF_haa_jont", names.into_iter()), ["lf_haa_joint", "rf_haa_joint"]);
        assert_eq!(near_names("lf_haa", names.into_iter()), ["lf_haa_joint"]);
        assert!(near_names("wheel", names.into_iter()).is_empty());
        let longest = "n".repeat(MAX_NAME);
        assert_eq!(near_names(&longest, [&*longest].into_iter()), [&*longest]);
        let longer = longest + "n";
        assert!(near_names(&longer, [&*longer].into_iter()).is_empty());
        assert_eq!(edit_distance("kitten", "sitting"), 3);
    }
}
