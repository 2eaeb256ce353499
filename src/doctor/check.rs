//! One check of `hoof doctor`.

use analysis::table::{Column, Table};
use serde::Serialize;

/// Result of a check, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "UPPERCASE")]
pub enum Level {
    Ok,
    Warn,
    Fail,
}

impl Level {
    pub fn label(self) -> &'static str {
        match self {
            Level::Ok => "OK",
            Level::Warn => "WARN",
            Level::Fail => "FAIL",
        }
    }
}

/// One check and its result.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    pub name: &'static str,
    pub level: Level,
    pub found: String,
    /// Command that fixes the problem; `mend` in JSON.
    #[serde(rename = "mend", skip_serializing_if = "Option::is_none")]
    pub fix: Option<String>,
}

impl Check {
    pub fn ok(name: &'static str, found: impl Into<String>) -> Self {
        Check { name, level: Level::Ok, found: found.into(), fix: None }
    }

    pub fn warn(name: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Check { name, level: Level::Warn, found: found.into(), fix: Some(fix.into()) }
    }

    pub fn fail(name: &'static str, found: impl Into<String>, fix: impl Into<String>) -> Self {
        Check { name, level: Level::Fail, found: found.into(), fix: Some(fix.into()) }
    }
}

/// The checks as a table; the row below a check that is not good has the command that fixes it.
pub fn table(checks: &[Check]) -> Table {
    let mut table = Table::new([Column::left(""), Column::left(""), Column::left("")]);
    for Check { name, level, found, fix } in checks {
        table.row([level.label(), name, found.as_str()]);
        if let Some(fix) = fix {
            table.row(["", "", &format!("-> {fix}")]);
        }
    }
    table
}
