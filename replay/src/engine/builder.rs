//! Builds the controllers of a run whose parameters change.

use super::{Load, Options, TimedOverride, When};
use crate::Error;
use controller::params::{apply_changes, parameters_digest};
use controller::{Component, LoadError};
use lcmtypes::{ParameterChange, RunInfo};
use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

/// Builds the controller of a run for the parameters at a place in its log.
#[derive(Clone)]
pub(super) struct Builder<'b> {
    path: &'b Path,
    load: &'b Load<'b>,
    /// RUN_INFO with all overrides that hold from the start.
    pub info: Arc<RunInfo>,
    /// Overridden keys; changes of them in the log are ignored.
    pub overridden: Arc<[String]>,
    /// Parameters or robot differ from the log.
    pub is_what_if: bool,
}

impl<'b> Builder<'b> {
    /// A builder for the log at `path`. `info` is its RUN_INFO with the overrides of `options`.
    pub fn new(path: &'b Path, load: &'b Load<'b>, info: RunInfo, options: &Options) -> Self {
        let overridden = options.set.iter().map(|(key, _)| key.clone()).collect();
        Builder { path, load, info: Arc::new(info), overridden, is_what_if: options.is_what_if() }
    }

    /// Builds the controller after parameter changes, in order.
    ///
    /// # Errors
    /// [`Error::Load`].
    pub fn build(&self, changes: &[ParameterChange]) -> Result<Component, Error> {
        if changes.is_empty() {
            return (self.load)(&self.info).map_err(|source| self.wrong(source));
        }
        let params = self.parameters(changes)?;
        (self.load)(&RunInfo::clone(&self.info).with_params(params)).map_err(|source| self.wrong(source))
    }

    /// Names of the stages of a tick.
    pub fn stages(&self) -> &[String] {
        self.info.stages()
    }

    /// Digest of the parameters after parameter changes, as in `controller_tick_t`.
    ///
    /// # Errors
    /// [`Error::Load`] for a change that this build rejects.
    pub fn digest(&self, changes: &[ParameterChange]) -> Result<i64, Error> {
        Ok(parameters_digest(&self.parameters(changes)?))
    }

    fn parameters(&self, changes: &[ParameterChange]) -> Result<String, Error> {
        let set: Vec<_> = changes.iter().map(|change| (change.key.clone(), change.value.clone())).collect();
        if set.is_empty() {
            return Ok(self.info.params().to_owned());
        }
        apply_changes(self.info.params(), &set).map_err(|source| self.wrong(source.into()))
    }

    fn wrong(&self, source: LoadError) -> Error {
        Error::Load { path: self.path.into(), source: Box::new(source) }
    }

    /// Whether a change in the log applies: overridden keys keep their override.
    pub fn applies(&self, change: &ParameterChange) -> bool {
        !self.overridden.contains(&change.key)
    }

    /// The timed overrides as parameter changes. Checks that each controller can be built.
    ///
    /// # Errors
    /// As [`Builder::build`].
    pub fn timed_overrides(&self, changes: &[TimedOverride]) -> Result<PendingOverrides, Error> {
        let change = |change: &TimedOverride| ParameterChange {
            key: change.key.clone(),
            value: change.value.clone(),
            ..ParameterChange::default()
        };
        let all: Vec<_> = changes.iter().map(change).collect();
        for count in 1..=all.len() {
            self.build(&all[..count])?;
        }
        Ok(changes.iter().map(|change| change.when).zip(all).collect())
    }

    /// [`Error::Restore`] for a snapshot of this log.
    pub fn restore_error(&self, tick: i64, source: controller::RestoreError) -> Error {
        Error::Restore { path: self.path.into(), tick, source: source.into() }
    }
}

/// Timed overrides that are not applied yet, in the order of time.
pub(super) type PendingOverrides = VecDeque<(When, ParameterChange)>;
