//! A small tree of XML elements, read without recursion and within limits, so that hostile text costs bounded time and memory.
//!
//! Namespaces are not resolved: `drake:acceleration` is a name like any other, bound or not, as in the parsers of other URDF readers.
//! Entities other than the five of XML and character references are errors.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// Largest length of a text, bytes.
pub(crate) const MAX_BYTES: usize = 16 << 20;
/// Largest number of elements inside each other.
pub(crate) const MAX_DEPTH: usize = 64;
/// Largest number of elements.
pub(crate) const MAX_ELEMENTS: usize = 200_000;
/// Largest number of attributes of an element: the time of the check that each occurs once grows with its square.
const MAX_ATTRIBUTES: usize = 100;

/// Why a text is not read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct XmlError {
    /// Line, from 1.
    pub(crate) line: usize,
    /// What was found and what was expected.
    pub(crate) reason: String,
}

/// The elements of a text in the order of their start tags; 0 is the outermost.
#[derive(Debug)]
pub(crate) struct Document {
    elements: Vec<Node>,
}

#[derive(Debug)]
struct Node {
    name: String,
    attributes: Vec<(String, String)>,
    children: Vec<usize>,
    line: usize,
}

/// One element of a document.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Element<'d> {
    document: &'d Document,
    node: &'d Node,
}

impl Document {
    /// Reads a text with exactly one outermost element. Text between elements, comments and processing instructions are dropped,
    /// and a byte order mark.
    ///
    /// # Errors
    /// Text that is not well-formed, or exceeds a limit: [`MAX_BYTES`], [`MAX_DEPTH`], [`MAX_ELEMENTS`].
    pub(crate) fn parse(text: &str) -> Result<Self, XmlError> {
        let fail = |line, reason| Err(XmlError { line, reason });
        if text.len() > MAX_BYTES {
            return fail(1, format!("the text has {} bytes, expected at most {MAX_BYTES}", text.len()));
        }
        let mut reader = Reader::from_str(text);
        let mut elements: Vec<Node> = Vec::new();
        // Elements that are open.
        let mut open: Vec<usize> = Vec::new();
        let (mut next_line, mut counted) = (1, 0);
        loop {
            // The line on which the event begins.
            let line = next_line;
            let event = reader.read_event();
            let position = usize::try_from(reader.buffer_position()).map_or(text.len(), |at| at.min(text.len()));
            next_line +=
                text.as_bytes().get(counted..position).map_or(0, |bytes| bytes.iter().filter(|b| **b == b'\n').count());
            counted = position.max(counted);
            let (start, is_empty) = match event {
                Ok(Event::Start(start)) => (start, false),
                Ok(Event::Empty(start)) => (start, true),
                Ok(Event::End(_)) => {
                    open.pop();
                    continue;
                }
                Ok(Event::Text(content)) if open.is_empty() && !content.iter().all(u8::is_ascii_whitespace) => {
                    return fail(line, "text outside of the outermost element".to_owned());
                }
                Ok(Event::Eof) if !open.is_empty() => {
                    return fail(line, format!("{} has no end", elements[open[open.len() - 1]].described()));
                }
                Ok(Event::Eof) if elements.is_empty() => return fail(line, "no element found".to_owned()),
                Ok(Event::Eof) => return Ok(Document { elements }),
                Ok(_) => continue,
                Err(error) => {
                    let inside = open.last().map(|&last| format!(", in {}", elements[last].described()));
                    return fail(line, format!("{error}{}", inside.unwrap_or_default()));
                }
            };
            let number = elements.len();
            match open.last() {
                Some(&parent) => elements[parent].children.push(number),
                None if number > 0 => return fail(line, "a second outermost element".to_owned()),
                None => {}
            }
            if number == MAX_ELEMENTS {
                return fail(line, format!("more than {MAX_ELEMENTS} elements"));
            }
            if open.len() == MAX_DEPTH {
                return fail(line, format!("more than {MAX_DEPTH} elements inside each other"));
            }
            elements.push(node(&start, line).map_err(|reason| XmlError { line, reason })?);
            if !is_empty {
                open.push(number);
            }
        }
    }

    /// The outermost element.
    pub(crate) fn root(&self) -> Element<'_> {
        Element { document: self, node: &self.elements[0] }
    }
}

impl Node {
    /// `<link name="knee"> of line 7`.
    fn described(&self) -> String {
        let Node { name, attributes, line, .. } = self;
        let named = attributes.iter().find(|(key, _)| key == "name");
        let named = named.map(|(_, value)| format!(" name=\"{}\"", value.chars().take(40).collect::<String>()));
        format!("<{name}{}> of line {line}", named.unwrap_or_default())
    }
}

fn node(start: &BytesStart, line: usize) -> Result<Node, String> {
    let name = String::from_utf8_lossy(start.name().as_ref()).into_owned();
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        let attribute = attribute.map_err(|error| format!("<{name}>: {error}"))?;
        if attributes.len() == MAX_ATTRIBUTES {
            return Err(format!("<{name}>: more than {MAX_ATTRIBUTES} attributes"));
        }
        let key = String::from_utf8_lossy(attribute.key.as_ref()).into_owned();
        let value = attribute.unescape_value().map_err(|error| format!("<{name} {key}>: {error}"))?;
        attributes.push((key, value.into_owned()));
    }
    Ok(Node { name, attributes, children: Vec::new(), line })
}

impl<'d> Element<'d> {
    /// Name of the element, with its prefix.
    pub(crate) fn name(self) -> &'d str {
        &self.node.name
    }

    /// Line on which its start tag begins, from 1.
    pub(crate) fn line(self) -> usize {
        self.node.line
    }

    /// Value of an attribute.
    pub(crate) fn attribute(self, name: &str) -> Option<&'d str> {
        self.node.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The elements directly inside.
    pub(crate) fn children(self) -> impl Iterator<Item = Element<'d>> {
        let Element { document, node } = self;
        node.children.iter().map(move |&child| Element { document, node: &document.elements[child] })
    }

    /// The first element of a name directly inside.
    pub(crate) fn child(self, name: &str) -> Option<Element<'d>> {
        self.children().find(|child| child.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_attributes_and_lines_are_read() {
        let text =
            "<?xml version=\"1.0\"?><!-- <no> -->\n<a x='1' p:y=\"&lt;2\">\n <b/><c>text<b z=\"3\"/></c>\n</a>\n";
        let document = Document::parse(text).unwrap();
        let a = document.root();
        assert_eq!((a.name(), a.attribute("x"), a.attribute("p:y"), a.line()), ("a", Some("1"), Some("<2"), 2));
        assert_eq!(a.children().map(Element::name).collect::<Vec<_>>(), ["b", "c"]);
        let c = a.child("c").unwrap();
        assert_eq!((c.line(), c.child("b").unwrap().attribute("z"), c.attribute("z")), (3, Some("3"), None));
    }

    #[test]
    fn malformed_text_is_an_error_with_its_line() {
        for (text, line) in [
            ("", 1),
            ("no", 1),
            ("<a>\n<b>\n</a>", 3),
            ("<a>\n<b/>", 2),
            ("<a/>\n<b/>", 2),
            ("<a\n x=\"1\" x=\"2\"/>", 1),
            ("<a>\n<b c=\"&bad;\"/></a>", 2),
            ("<a>\n<b c=1/></a>", 2),
        ] {
            assert_eq!(Document::parse(text).map(|_| ()).unwrap_err().line, line, "{text}");
        }
    }

    #[test]
    fn a_missing_end_names_the_element() {
        for text in ["<a><b name=\"knee\">", "<a>\n<b name=\"knee\"></c></a>"] {
            let reason = Document::parse(text).unwrap_err().reason;
            assert!(reason.contains("<b name=\"knee\">"), "{reason}");
        }
    }

    #[test]
    fn nesting_and_number_of_elements_are_limited() {
        let nested = |n| format!("{}{}", "<a>\n".repeat(n), "</a>".repeat(n));
        assert!(Document::parse(&nested(MAX_DEPTH)).is_ok());
        assert_eq!(Document::parse(&nested(MAX_DEPTH + 1)).unwrap_err().line, MAX_DEPTH + 1);
        assert!(Document::parse(&nested(100_000)).is_err());
        let flat = |n| format!("<a>{}</a>", "<b/>".repeat(n));
        assert!(Document::parse(&flat(MAX_ELEMENTS - 1)).is_ok());
        assert!(Document::parse(&flat(MAX_ELEMENTS)).is_err());
        assert!(Document::parse(&" ".repeat(MAX_BYTES + 1)).is_err());
        let attributes = |n| format!("<a{}/>", (0..n).map(|i| format!(" a{i}=\"\"")).collect::<String>());
        assert!(Document::parse(&attributes(MAX_ATTRIBUTES)).is_ok());
        assert!(Document::parse(&attributes(MAX_ATTRIBUTES + 1)).is_err());
    }
}
