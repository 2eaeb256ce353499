//! `plots.toml`: which figures a report draws, and how they look on paper.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Deserialize;

use crate::Error;
use crate::fields::Field;
use crate::figures::{FigureSpec, Format, Kind, Quantity, Several};
use crate::run::LEGS;

/// The built-in list, as text.
pub const DEFAULT: &str = include_str!("plots.toml");

/// Widths that a figure may have, mm.
const WIDTHS_MM: std::ops::RangeInclusive<f64> = 60.0..=400.0;
/// Sizes that words may have, points.
const FONTS_PT: std::ops::RangeInclusive<f64> = 4.0..=24.0;
/// Densities that a bitmap may have, dots per inch.
const DPI: std::ops::RangeInclusive<f64> = 48.0..=1200.0;

/// Figures and their files.
#[derive(Clone, Debug, PartialEq)]
pub struct Plots {
    /// Figures, in the order of the report.
    pub figures: Vec<FigureSpec>,
    /// Files of each.
    pub formats: Vec<Format>,
    /// Density of bitmaps, dots per inch.
    pub png_dpi: f64,
}

impl Default for Plots {
    fn default() -> Self {
        Self::parse(DEFAULT, "built-in plots").expect("the built-in text parses: a test reads it")
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    width_mm: Option<f64>,
    font_pt: Option<f64>,
    formats: Option<Vec<Format>>,
    png_dpi: Option<f64>,
    #[serde(default)]
    several: Several,
    figure: Vec<Entry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    kind: Option<Kind>,
    name: Option<String>,
    title: Option<String>,
    width_mm: Option<f64>,
    font_pt: Option<f64>,
    from_s: Option<f64>,
    to_s: Option<f64>,
    legs: Option<Vec<String>>,
    #[serde(default)]
    joints: Vec<String>,
    quantity: Option<Quantity>,
    several: Option<Several>,
    #[serde(default)]
    fields: Vec<String>,
    #[serde(default)]
    label: String,
}

impl Plots {
    /// Reads the text of a `plots.toml`; `name` is what errors call it.
    ///
    /// # Errors
    /// [`Error::Choices`] names the key, what was found and what was expected.
    pub fn parse(text: &str, name: &str) -> Result<Self, Error> {
        let failed = |problem: String| Error::Choices { file: name.to_owned(), problem };
        let file: File = toml::from_str(text).map_err(|e| failed(e.to_string().trim_end().to_owned()))?;
        let mut names = BTreeSet::new();
        let mut figures = Vec::new();
        for (number, entry) in file.figure.iter().enumerate() {
            let ask = entry.ask(&file).map_err(|problem| failed(format!("figure {}: {problem}", number + 1)))?;
            if !names.insert(ask.name.clone()) {
                let twice =
                    format!("figure {}: the name `{}` is taken; give it another with `name`", number + 1, ask.name);
                return Err(failed(twice));
            }
            figures.push(ask);
        }
        let png_dpi = within("png_dpi", file.png_dpi.unwrap_or(288.0), DPI).map_err(failed)?;
        let mut formats = file.formats.unwrap_or_else(|| vec![Format::Svg, Format::Pdf, Format::Png]);
        formats.dedup();
        Ok(Self { figures, formats, png_dpi })
    }

    /// Reads a file.
    ///
    /// # Errors
    /// As [`Plots::parse`], or [`Error::ReadFile`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|source| Error::ReadFile { path: path.to_owned(), source })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Every field that a figure shows.
    pub fn fields(&self) -> Vec<Field> {
        self.figures.iter().flat_map(|ask| ask.fields.iter().cloned()).collect()
    }

    /// The same figures with several logs drawn another way.
    #[must_use]
    pub fn with_several(mut self, several: Several) -> Self {
        self.figures.iter_mut().for_each(|ask| ask.several = several);
        self
    }
}

impl Entry {
    fn ask(&self, file: &File) -> Result<FigureSpec, String> {
        let kind = match (self.kind, self.fields.is_empty()) {
            (Some(Kind::Fields), true) => return Err("kind `fields` needs the key `fields`".to_owned()),
            (Some(kind), false) if kind != Kind::Fields => {
                return Err(format!("key `fields` belongs to kind `fields`, found kind `{}`", kind.name()));
            }
            (Some(kind), _) => kind,
            (None, false) => Kind::Fields,
            (None, true) => return Err("key `kind` (or `fields`) is missing".to_owned()),
        };
        let mut ask = FigureSpec::new(kind);
        if let Some(name) = &self.name {
            let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
            if name.is_empty() || name.starts_with('.') || !name.chars().all(plain) {
                return Err(format!("name = `{name}`, expected letters, digits, `_`, `-`, `.`: it is that of a file"));
            }
            ask.name.clone_from(name);
        }
        ask.title.clone_from(&self.title);
        ask.width_mm = within("width_mm", self.width_mm.or(file.width_mm).unwrap_or(ask.width_mm), WIDTHS_MM)?;
        ask.font_pt = within("font_pt", self.font_pt.or(file.font_pt).unwrap_or(ask.font_pt), FONTS_PT)?;
        ask.window_s = match (self.from_s, self.to_s) {
            (None, None) => None,
            (Some(from), Some(to)) if from < to && from.is_finite() && to.is_finite() => Some((from, to)),
            (from, to) => return Err(format!("from_s = {from:?}, to_s = {to:?}, expected both, the first less")),
        };
        if let Some(legs) = &self.legs {
            let place = |leg: &String| {
                let found = LEGS.iter().position(|name| name == leg);
                found.ok_or_else(|| format!("legs: found `{leg}`, expected {}", LEGS.join(", ")))
            };
            ask.legs = legs.iter().map(place).collect::<Result<_, _>>()?;
            if ask.legs.is_empty() {
                return Err("legs is empty, expected at least one".to_owned());
            }
        }
        ask.joints.clone_from(&self.joints);
        ask.quantity = self.quantity.unwrap_or_default();
        ask.several = self.several.unwrap_or(file.several);
        let field = |text: &String| {
            Field::parse(text)
                .ok_or_else(|| format!("fields: found `{text}`, expected CHANNEL.field, such as ROBOT_STATE.q[3]"))
        };
        ask.fields = self.fields.iter().map(field).collect::<Result<_, _>>()?;
        ask.label.clone_from(&self.label);
        Ok(ask)
    }
}

fn within(key: &str, value: f64, range: std::ops::RangeInclusive<f64>) -> Result<f64, String> {
    let ends = (range.start(), range.end());
    if range.contains(&value) { Ok(value) } else { Err(format!("{key} = {value}, expected {} to {}", ends.0, ends.1)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_list_holds_every_kind_but_those_that_need_a_choice() {
        let plots = Plots::default();
        assert_eq!(plots.figures.len(), 15);
        assert_eq!(plots.figures[0], FigureSpec::new(Kind::BaseTracking));
        assert_eq!(plots.formats.len(), 3);
    }

    #[test]
    fn mistakes_name_their_key() {
        for (text, part) in [
            ("[[figure]]\nkind = \"gait\"\ncolour = 3", "unknown field `colour`"),
            ("[[figure]]\nkind = \"gate\"", "unknown variant `gate`"),
            ("widht_mm = 88\n[[figure]]\nkind = \"gait\"", "unknown field `widht_mm`"),
            ("width_mm = 5\n[[figure]]\nkind = \"gait\"", "figure 1: width_mm = 5, expected 60 to 400"),
            ("[[figure]]\nkind = \"gait\"\nlegs = [\"FL\"]", "found `FL`, expected LF, RF, LH, RH"),
            ("[[figure]]\nfields = [\"q\"]", "found `q`, expected CHANNEL.field"),
            ("[[figure]]\nkind = \"gait\"\nfields = [\"A.b\"]", "found kind `gait`"),
            ("[[figure]]\nkind = \"fields\"", "needs the key `fields`"),
            ("[[figure]]\nkind = \"gait\"\nfrom_s = 2", "from_s"),
            ("[[figure]]\nkind = \"gait\"\nname = \"../x\"", "../x"),
            ("[[figure]]\nkind = \"gait\"\n[[figure]]\nkind = \"gait\"", "figure 2: the name `gait` is taken"),
        ] {
            let error = Plots::parse(text, "my.toml").unwrap_err().to_string();
            assert!(error.starts_with("my.toml: ") && error.contains(part), "{text}: {error}");
        }
    }
}
