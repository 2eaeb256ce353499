//! The controllers of a run whose parameters change on the way.

use super::{Change, Load, Options, Replay, When};
use crate::Error;
use controller::Controller;
use controller::params::apply_overrides;
use lcmtypes::{ParameterChange, RunInfo};
use std::collections::VecDeque;
use std::path::Path;
use std::sync::Arc;

/// Builds the controller that a run had, or would have had, at a place in its log.
#[derive(Clone)]
pub(super) struct Builder<'b> {
    path: &'b Path,
    load: &'b Load<'b>,
    /// The run's description, with all that is to be other from the beginning on.
    pub info: Arc<RunInfo>,
    /// Keys that are to be other than they were, from the beginning on.
    held: Arc<[String]>,
}

impl<'b> Builder<'b> {
    /// For a log, with what is to be other.
    ///
    /// # Errors
    /// [`Error::Load`]: a parameter that does not exist, or has another value than it may have.
    pub fn new(replay: &'b Replay<'b>, options: &Options) -> Result<Self, Error> {
        let held = options.set.iter().map(|(key, _)| key.clone()).collect();
        Ok(Builder { path: &replay.path, load: &*replay.load, info: Arc::new(replay.changed(options)?), held })
    }

    /// The controller after changes, in the order in which they came.
    ///
    /// # Errors
    /// [`Error::Load`].
    pub fn build(&self, changes: &[ParameterChange]) -> Result<Box<dyn Controller>, Error> {
        let wrong = |source| Error::Load { path: self.path.into(), source: Box::new(source) };
        if changes.is_empty() {
            return (self.load)(&self.info).map_err(wrong);
        }
        let set: Vec<_> = changes.iter().map(|change| (change.key.clone(), change.value.clone())).collect();
        let params = apply_overrides(&self.info.params, &set).map_err(|source| wrong(source.into()))?;
        (self.load)(&RunInfo { params, ..RunInfo::clone(&self.info) }).map_err(wrong)
    }

    /// Whether a change in the log is followed: what is asked to be other stays so.
    pub fn follows(&self, change: &ParameterChange) -> bool {
        !self.held.contains(&change.key)
    }

    /// What is to change on the way, in the order of time. Each of the controllers can be built.
    ///
    /// # Errors
    /// As [`Builder::build`].
    pub fn later(&self, changes: &[Change]) -> Result<Later, Error> {
        let change = |change: &Change| ParameterChange {
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

    /// What an error says of the state of a tick.
    pub fn restore_error(&self, tick: i64, source: controller::RestoreError) -> Error {
        Error::Restore { path: self.path.into(), tick, source: source.into() }
    }
}

/// What a what-if replay changes on the way, in the order of time.
pub(super) type Later = VecDeque<(When, ParameterChange)>;
