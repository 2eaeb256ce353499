//! A robot's files: found by name or path, and read.

use crate::{DriverError, shipped};
use controller::params::{Params, ParamsError, add_gaits, apply_overrides, key_values};
use robot_model::{RobotDescription, UrdfTree};
use std::path::{Path, PathBuf};

/// A robot's files, read.
#[derive(Clone, Debug)]
pub struct RobotFiles {
    /// Text of the URDF.
    pub urdf: String,
    /// Path of the URDF.
    pub urdf_path: PathBuf,
    /// All parameters as TOML, defaults included; `None` if only a URDF was given.
    pub params: Option<String>,
    /// Path and text of the TOML file, as it is; `None` if only a URDF was given.
    pub toml: Option<(PathBuf, String)>,
    /// All files that were read.
    pub read: Vec<PathBuf>,
}

impl RobotFiles {
    /// Finds a robot by name (`robots/NAME/NAME.toml` below one of [`shipped::folders`]), TOML file or URDF file.
    ///
    /// # Errors
    /// - [`DriverError::UnknownRobot`], [`DriverError::Read`]
    /// - [`DriverError::Params`]: the TOML file is invalid.
    pub fn find(robot: &str) -> Result<Self, DriverError> {
        let path = Path::new(robot);
        match path.extension().and_then(|e| e.to_str()) {
            Some("urdf" | "xml") => Ok(RobotFiles {
                urdf: read_urdf(path)?,
                urdf_path: path.to_owned(),
                params: None,
                toml: None,
                read: vec![path.to_owned()],
            }),
            Some("toml") => Self::with_params(path),
            _ => Self::with_params(&by_name(robot)?),
        }
    }

    /// Same as [`RobotFiles::find`], for a robot that must have parameters; the second value is their TOML text.
    ///
    /// # Errors
    /// [`DriverError::UrdfAlone`] if `robot` is a URDF file; else as [`RobotFiles::find`].
    pub fn find_with_params(robot: &str) -> Result<(Self, String), DriverError> {
        let mut files = Self::find(robot)?;
        match files.params.take() {
            Some(params) => Ok((files, params)),
            None => Err(DriverError::UrdfAlone { path: robot.into() }),
        }
    }

    /// Same as [`RobotFiles::find_with_params`], with changed parameters: first those of a preset, then further gaits, then `set`.
    ///
    /// - `preset`: name of a TOML file beside the robot's, with the parameters to change.
    /// - `gaits`: gait files, each with `[gait.NAME]` tables.
    /// - `set`: parameters to change, each `KEY=VALUE`.
    ///
    /// # Errors
    /// [`DriverError::UnknownPreset`], [`DriverError::ParamsFile`] for a wrong preset or gait file; else as [`RobotFiles::find_with_params`] and
    /// [`with_overrides`].
    pub fn find_changed(
        robot: &str,
        preset: Option<&str>,
        gaits: &[PathBuf],
        set: &[String],
    ) -> Result<(Self, String), DriverError> {
        let (mut files, mut params) = Self::find_with_params(robot)?;
        if let Some(name) = preset {
            let path = preset_file(robot, name)?;
            let file = path.display().to_string();
            let table: toml::Table = toml::from_str(&read(&path)?)
                .map_err(|e| ParamsError::Parse { source_name: file.clone(), error: e.to_string() })?;
            params = apply_overrides(&params, &key_values(&table))
                .map_err(|source| DriverError::ParamsFile { file, source })?;
            files.read.push(path);
        }
        files.read.extend(gaits.iter().cloned());
        for path in gaits {
            let file = path.display().to_string();
            params = add_gaits(&params, &read(path)?, &file).map_err(|source| in_file(source, file))?;
        }
        Ok((files, with_overrides(&params, set)?))
    }

    fn with_params(path: &Path) -> Result<Self, DriverError> {
        let text = read(path)?;
        let params = parse_params(&text, path)?;
        let urdf_path = path.with_file_name(&params.robot.urdf);
        let files = vec![path.to_owned(), urdf_path.clone()];
        Ok(RobotFiles {
            urdf: read_urdf(&urdf_path)?,
            urdf_path,
            params: Some(params.to_toml()),
            toml: Some((path.to_owned(), text)),
            read: files,
        })
    }

    /// The description of the robot; `None` if only a URDF was given.
    ///
    /// # Errors
    /// [`DriverError::Description`]
    pub fn description(&self, tree: &UrdfTree) -> Result<Option<RobotDescription>, DriverError> {
        let read =
            |(path, text): &(PathBuf, String)| RobotDescription::from_toml(text, &path.display().to_string(), tree);
        Ok(self.toml.as_ref().map(read).transpose()?)
    }

    /// The URDF as a checked tree.
    ///
    /// # Errors
    /// [`DriverError::Urdf`]
    pub fn tree(&self) -> Result<UrdfTree, DriverError> {
        Ok(UrdfTree::parse(&self.urdf, &self.urdf_path.display().to_string())?)
    }
}

fn by_name(name: &str) -> Result<PathBuf, DriverError> {
    if let Some(path) = shipped::find(&Path::new("robots").join(name).join(format!("{name}.toml"))) {
        return Ok(path);
    }
    let folders = shipped::folders().into_iter().filter_map(|folder| std::fs::read_dir(folder.join("robots")).ok());
    let names = folders.flatten().filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut known: Vec<String> = names.collect();
    known.sort();
    known.dedup();
    Err(DriverError::UnknownRobot { name: name.to_owned(), known })
}

/// Finds a preset beside the TOML file of a robot. The folder contains one other TOML file, that of the robot.
fn preset_file(robot: &str, name: &str) -> Result<PathBuf, DriverError> {
    let own = if Path::new(robot).extension().is_some() { PathBuf::from(robot) } else { by_name(robot)? };
    let entries = std::fs::read_dir(own.with_file_name(".")).into_iter().flatten();
    let files = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let presets = files.filter(|file| own.file_name().is_none_or(|own| own != file.as_str()));
    let mut known: Vec<String> = presets.filter_map(|file| Some(file.strip_suffix(".toml")?.to_owned())).collect();
    known.sort();
    if known.iter().any(|preset| preset == name) {
        return Ok(own.with_file_name(format!("{name}.toml")));
    }
    Err(DriverError::UnknownPreset { robot: robot.to_owned(), name: name.to_owned(), known })
}

/// Finds a file that ships with the command, such as `scenarios/flat_trot.toml`; see [`shipped::folders`].
///
/// # Errors
/// [`DriverError::NotShipped`]
pub fn find_shipped(name: &str) -> Result<PathBuf, DriverError> {
    shipped::find(Path::new(name)).ok_or_else(|| DriverError::NotShipped {
        name: name.to_owned(),
        folders: shipped::folders().into_iter().skip(1).collect(),
    })
}

/// Sets parameters by `KEY=VALUE` in a complete TOML text.
///
/// # Errors
/// [`DriverError::Override`], or [`DriverError::Params`] for an unknown key or an invalid value.
pub fn with_overrides(params: &str, set: &[String]) -> Result<String, DriverError> {
    Ok(apply_overrides(params, &overrides(set)?)?)
}

/// Splits each `KEY=VALUE` into key and value. A value `@FILE` is the text of a file, as a TOML string.
///
/// # Errors
/// [`DriverError::Override`] for a text without `=`, key or value; [`DriverError::Read`] for a file that cannot be read.
pub fn overrides(set: &[String]) -> Result<Vec<(String, String)>, DriverError> {
    let split = |text: &String| {
        let parts = text.split_once('=').map(|(key, value)| (key.trim(), value.trim()));
        let filled = parts.filter(|(key, value)| !key.is_empty() && !value.is_empty());
        let (key, value) = filled.ok_or_else(|| DriverError::Override { text: text.clone() })?;
        let value = match value.strip_prefix('@') {
            None => value.to_owned(),
            Some(path) => {
                let path = shipped::find(Path::new(path)).unwrap_or_else(|| path.into());
                toml_line(&read(&path)?)
            }
        };
        Ok((key.to_owned(), value))
    };
    set.iter().map(split).collect()
}

/// A text as a TOML string in one line, as a `parameter_request_t` needs it.
pub fn toml_line(text: &str) -> String {
    let mut line = String::from("\"");
    for c in text.chars() {
        match c {
            '\n' => line += "\\n",
            '\t' => line += "\\t",
            '"' | '\\' => line.extend(['\\', c]),
            c if c.is_control() => line += &format!("\\u{:04X}", u32::from(c)),
            c => line.push(c),
        }
    }
    line + "\""
}

/// Parses parameters; every error names the file.
fn parse_params(text: &str, path: &Path) -> Result<Params, DriverError> {
    let file = path.display().to_string();
    Params::from_toml(text, &file).map_err(|source| in_file(source, file))
}

/// An error of a file, with its name.
fn in_file(source: ParamsError, file: String) -> DriverError {
    match source {
        // This text contains the file name already.
        ParamsError::Parse { .. } => source.into(),
        _ => DriverError::ParamsFile { file, source },
    }
}

/// Reads a URDF. Bytes that are not UTF-8, such as an accent of Latin-1 in a comment, become the replacement character.
///
/// # Errors
/// [`DriverError::Read`], with the path.
pub fn read_urdf(path: &Path) -> Result<String, DriverError> {
    replay::read_text_lossy(path).map_err(|source| DriverError::Read { path: path.to_owned(), source })
}

/// Reads a text file.
///
/// # Errors
/// [`DriverError::Read`], with the path.
pub fn read(path: &Path) -> Result<String, DriverError> {
    replay::read_text(path).map_err(|source| DriverError::Read { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::toml_line;

    #[test]
    fn a_text_in_one_line_reads_back() {
        for text in ["", "a = \"b\"\n\tc = 'd\\e'\r\n", "é\u{7f}\u{1}\u{301}"] {
            let line = toml_line(text);
            assert!(!line.contains('\n'));
            let table: toml::Table = format!("v = {line}").parse().unwrap();
            assert_eq!(table["v"].as_str(), Some(text));
        }
    }
}
