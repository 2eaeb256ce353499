//! Information that the XML reader does not give: the element that it rejects, and whether a joint has a `<limit>` at all.

/// The first top-level `<link>` or `<joint>` that cannot be read on its own, and the reason.
pub(super) fn first_bad_element(text: &str) -> Option<(String, String)> {
    top_level_elements(text).into_iter().find_map(|element| {
        let error = urdf_rs::read_from_string(&format!("<robot name=\"one\">{element}</robot>")).err()?;
        Some((describe(element), error.to_string()))
    })
}

/// Whether the joint of that name has a `<limit>`. The XML reader fills a missing one with zeros.
pub(super) fn has_limit(text: &str, joint: &str) -> bool {
    let wanted = format!("joint \"{joint}\"");
    let elements = top_level_elements(text);
    let element = elements.into_iter().find(|element| describe(element) == wanted);
    element.is_some_and(|element| tags(element).iter().any(|(start, _)| is_tag(&element[*start..], "<limit")))
}

/// The text of each `<link>…</link>` and `<joint>…</joint>` directly in `<robot>`.
fn top_level_elements(text: &str) -> Vec<&str> {
    let mut elements = Vec::new();
    let (mut depth, mut first) = (0_usize, 0);
    for (start, end) in tags(text) {
        let tag = &text[start..end];
        if tag.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else {
            if depth == 1 {
                first = start;
            }
            if !tag.ends_with("/>") {
                depth += 1;
                continue;
            }
        }
        let element = &text[first..end];
        if depth == 1 && (is_tag(element, "<link") || is_tag(element, "<joint")) {
            elements.push(element);
        }
    }
    elements
}

/// Start and end of every opening or closing tag, without comments, CDATA and declarations.
fn tags(text: &str) -> Vec<(usize, usize)> {
    let mut tags = Vec::new();
    let mut at = 0;
    while let Some(start) = text[at..].find('<').map(|i| at + i) {
        let rest = &text[start..];
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("<!", ">")];
        let skipped = skipped.iter().find(|(head, _)| rest.starts_with(head));
        let tail = skipped.map_or(">", |(_, tail)| tail);
        let Some(end) = rest.find(tail).map(|i| start + i + tail.len()) else { break };
        if skipped.is_none() {
            tags.push((start, end));
        }
        at = end;
    }
    tags
}

fn is_tag(text: &str, tag: &str) -> bool {
    let ends = |c: char| c.is_whitespace() || c == '>' || c == '/';
    text.strip_prefix(tag).is_some_and(|rest| rest.starts_with(ends))
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
    fn element_is_found_after_comments_and_nested_joints() {
        let text = r#"<?xml version="1.0"?><!-- <link name="no"> --><robot name="r">
            <transmission name="t"><joint name="inside"/></transmission>
            <link name="a"/><link name="b"><visual/></link></robot>"#;
        assert_eq!(top_level_elements(text), [r#"<link name="a"/>"#, r#"<link name="b"><visual/></link>"#]);
        assert!(!has_limit(text, "inside"));
        let (element, _) = first_bad_element(text).expect("a visual needs a geometry");
        assert_eq!(element, "link \"b\"");
    }
}
