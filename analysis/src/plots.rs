//! `plots.toml`: the figures of a report, their sizes and file formats.

use std::collections::BTreeSet;
use std::path::Path;

use serde::Deserialize;

use crate::Error;
use crate::fields::Field;
use crate::figures::{self, FigureSpec, Format, Kind, Quantity, Several};
use crate::run::LEGS;

/// The built-in `plots.toml`.
pub const DEFAULT: &str = include_str!("plots.toml");

/// Valid widths of a figure, mm.
const WIDTHS_MM: std::ops::RangeInclusive<f64> = 60.0..=400.0;
/// Valid font sizes, points.
const FONTS_PT: std::ops::RangeInclusive<f64> = 4.0..=24.0;
/// Valid resolutions of a bitmap, dots per inch.
const DPI: std::ops::RangeInclusive<f64> = 48.0..=1200.0;

/// Figures and file formats.
#[derive(Clone, Debug, PartialEq)]
pub struct Plots {
    /// Figures in the order of the report.
    pub figures: Vec<FigureSpec>,
    /// File formats of each figure.
    pub formats: Vec<Format>,
    /// Resolution of bitmaps, dots per inch.
    pub png_dpi: f64,
}

impl Default for Plots {
    fn default() -> Self {
        Self::parse(DEFAULT, "built-in plots").expect("a test parses the built-in text")
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
    kind: Option<String>,
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
    /// Parses the text of a `plots.toml`; `name` is its name in error messages.
    ///
    /// # Errors
    /// [`Error::Choices`] with the key, the value found and the values expected.
    pub fn parse(text: &str, name: &str) -> Result<Self, Error> {
        let failed = |problem: String| Error::Choices { file: name.to_owned(), problem };
        let file: File = toml::from_str(text).map_err(|e| failed(e.to_string().trim_end().to_owned()))?;
        let mut names = BTreeSet::new();
        let mut figures = Vec::new();
        for (number, entry) in file.figure.iter().enumerate() {
            let spec = entry.spec(&file).map_err(|problem| failed(format!("figure {}: {problem}", number + 1)))?;
            if !names.insert(spec.name.clone()) {
                let duplicate = format!("figure {}: name `{}` is used twice; set key `name`", number + 1, spec.name);
                return Err(failed(duplicate));
            }
            figures.push(spec);
        }
        let png_dpi = within("png_dpi", file.png_dpi.unwrap_or(288.0), DPI).map_err(failed)?;
        let mut formats = file.formats.unwrap_or_else(|| vec![Format::Svg, Format::Pdf, Format::Png]);
        formats.dedup();
        Ok(Self { figures, formats, png_dpi })
    }

    /// Reads a `plots.toml`.
    ///
    /// # Errors
    /// As [`Plots::parse`], or [`Error::ReadFile`].
    pub fn read(path: &Path) -> Result<Self, Error> {
        let text = replay::read_text(path).map_err(|source| Error::ReadFile { path: path.to_owned(), source })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Fields of all figures.
    pub fn fields(&self) -> Vec<Field> {
        self.figures.iter().flat_map(|spec| spec.fields.iter().cloned()).collect()
    }

    /// The same figures with another choice for several logs.
    #[must_use]
    pub fn with_several(mut self, several: Several) -> Self {
        self.figures.iter_mut().for_each(|spec| spec.several = several);
        self
    }
}

impl Entry {
    fn spec(&self, file: &File) -> Result<FigureSpec, String> {
        let fields: &'static Kind = &figures::FIELDS;
        let kind = match (&self.kind, self.fields.is_empty()) {
            (Some(name), has_no_fields) => {
                let kind = kind_named(name)?;
                if (kind == fields) == has_no_fields {
                    return Err(format!(
                        "key `fields` is required with kind `fields` and not allowed with another kind, found kind `{name}`"
                    ));
                }
                kind
            }
            (None, false) => fields,
            (None, true) => return Err("key `kind` (or `fields`) is missing".to_owned()),
        };
        let mut spec = FigureSpec::new(kind);
        if let Some(name) = &self.name {
            let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
            if name.is_empty() || name.starts_with('.') || !name.chars().all(plain) {
                return Err(format!(
                    "name = `{name}`, expected a file name of letters, digits, `_`, `-` and `.` that does not start with `.`"
                ));
            }
            spec.name.clone_from(name);
        }
        spec.title.clone_from(&self.title);
        spec.width_mm = within("width_mm", self.width_mm.or(file.width_mm).unwrap_or(spec.width_mm), WIDTHS_MM)?;
        spec.font_pt = within("font_pt", self.font_pt.or(file.font_pt).unwrap_or(spec.font_pt), FONTS_PT)?;
        spec.window_s = match (self.from_s, self.to_s) {
            (None, None) => None,
            (Some(from), Some(to)) if from < to && from.is_finite() && to.is_finite() => Some((from, to)),
            (from, to) => {
                return Err(format!("from_s = {from:?}, to_s = {to:?}, expected two finite values, from_s < to_s"));
            }
        };
        if let Some(legs) = &self.legs {
            let place = |leg: &String| {
                let found = LEGS.iter().position(|name| name == leg);
                found.ok_or_else(|| format!("legs: found `{leg}`, expected {}", LEGS.join(", ")))
            };
            spec.legs = legs.iter().map(place).collect::<Result<_, _>>()?;
            if spec.legs.is_empty() {
                return Err("legs: found an empty list, expected at least one leg".to_owned());
            }
        }
        spec.joints.clone_from(&self.joints);
        spec.quantity = self.quantity.unwrap_or_default();
        spec.several = self.several.unwrap_or(file.several);
        let field = |text: &String| {
            Field::parse(text)
                .ok_or_else(|| format!("fields: found `{text}`, expected CHANNEL.field such as ROBOT_STATE.q[3]"))
        };
        spec.fields = self.fields.iter().map(field).collect::<Result<_, _>>()?;
        spec.label.clone_from(&self.label);
        Ok(spec)
    }
}

fn kind_named(name: &str) -> Result<&'static Kind, String> {
    let kinds = || figures::KINDS.iter().copied();
    let names = || kinds().map(|kind| kind.name).collect::<Vec<_>>().join(", ");
    kinds().find(|kind| kind.name == name).ok_or_else(|| format!("kind: found `{name}`, expected {}", names()))
}

fn within(key: &str, value: f64, range: std::ops::RangeInclusive<f64>) -> Result<f64, String> {
    let ends = (range.start(), range.end());
    if range.contains(&value) { Ok(value) } else { Err(format!("{key} = {value}, expected {} to {}", ends.0, ends.1)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_plots_parse() {
        let plots = Plots::default();
        assert_eq!(plots.figures.len(), 15);
        assert_eq!(plots.figures[0], FigureSpec::new(&figures::BASE_TRACKING));
        assert_eq!(plots.formats.len(), 3);
    }

    #[test]
    fn errors_name_the_key_and_the_value_found() {
        for (text, part) in [
            ("[[figure]]\nkind = \"gait\"\ncolour = 3", "unknown field `colour`"),
            ("[[figure]]\nkind = \"gate\"", "figure 1: kind: found `gate`"),
            ("widht_mm = 88\n[[figure]]\nkind = \"gait\"", "unknown field `widht_mm`"),
            ("width_mm = 5\n[[figure]]\nkind = \"gait\"", "figure 1: width_mm = 5, expected 60 to 400"),
            ("[[figure]]\nkind = \"gait\"\nlegs = [\"FL\"]", "found `FL`, expected LF, RF, LH, RH"),
            ("[[figure]]\nfields = [\"q\"]", "found `q`, expected CHANNEL.field"),
            ("[[figure]]\nkind = \"gait\"\nfields = [\"A.b\"]", "found kind `gait`"),
            ("[[figure]]\nkind = \"fields\"", "found kind `fields`"),
            ("[[figure]]\nkind = \"gait\"\nfrom_s = 2", "from_s"),
            ("[[figure]]\nkind = \"gait\"\nname = \"../x\"", "../x"),
            ("[[figure]]\nkind = \"gait\"\n[[figure]]\nkind = \"gait\"", "figure 2: name `gait`"),
        ] {
            let error = Plots::parse(text, "my.toml").unwrap_err().to_string();
            assert!(error.starts_with("my.toml: ") && error.contains(part), "{text}: {error}");
        }
    }
}
