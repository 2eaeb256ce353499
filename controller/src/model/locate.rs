//! Which element of a URDF the XML reader stumbled over: its own errors name neither element nor line.

/// Describes the first top-level `<link>` or `<joint>` that cannot be read alone, with the reason.
pub(super) fn first_bad_element(text: &str) -> Option<(String, String)> {
    top_level_elements(text).into_iter().find_map(|element| {
        let error = urdf_rs::read_from_string(&format!("<robot name=\"one\">{element}</robot>")).err()?;
        Some((describe(element), error.to_string()))
    })
}

/// The text of each `<link>…</link>` and `<joint>…</joint>` that stands directly in `<robot>`.
fn top_level_elements(text: &str) -> Vec<&str> {
    let mut elements = Vec::new();
    let (mut depth, mut start, mut at) = (0_usize, 0, 0);
    while let Some(open) = text[at..].find('<').map(|i| at + i) {
        let rest = &text[open..];
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("<!", ">")]
            .iter()
            .find(|(head, _)| rest.starts_with(head));
        let tail = skipped.map_or(">", |(_, tail)| tail);
        let Some(end) = rest.find(tail).map(|i| open + i + tail.len()) else {
            break;
        };
        at = end;
        if skipped.is_some() {
            continue;
        }
        if rest.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else {
            if depth == 1 {
                start = open;
            }
            if !text[open..end].ends_with("/>") {
                depth += 1;
                continue;
            }
        }
        if depth == 1 && is_link_or_joint(&text[start..end]) {
            elements.push(&text[start..end]);
        }
    }
    elements
}

fn is_link_or_joint(element: &str) -> bool {
    ["<link", "<joint"].iter().any(|tag| {
        element
            .strip_prefix(tag)
            .is_some_and(|rest| rest.starts_with(|c: char| c.is_whitespace() || c == '>' || c == '/'))
    })
}

/// `joint "knee"` for `<joint name="knee" …`.
fn describe(element: &str) -> String {
    let kind = if element.starts_with("<link") { "link" } else { "joint" };
    let tag = element.split('>').next().unwrap_or_default();
    let name = ["name=\"", "name='"].iter().find_map(|key| tag.split_once(key)?.1.split(['"', '\'']).next());
    match name {
        Some(name) => format!("{kind} \"{name}\""),
        None => format!("a {kind} without a name"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_the_element_behind_comments_and_nested_joints() {
        let text = r#"<?xml version="1.0"?><!-- <link name="no"> --><robot name="r">
            <transmission name="t"><joint name="inside"/></transmission>
            <link name="a"/><link name="b"><visual/></link></robot>"#;
        assert_eq!(top_level_elements(text), [r#"<link name="a"/>"#, r#"<link name="b"><visual/></link>"#]);
        let (element, _) = first_bad_element(text).expect("a visual needs a geometry");
        assert_eq!(element, "link \"b\"");
    }
}
