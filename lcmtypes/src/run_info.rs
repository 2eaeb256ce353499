//! Access to the components of a [`RunInfo`]; the first one commands the robot.

use crate::{ComponentInfo, RunInfo};

/// Kind of a component that is no controller of this project: any program that publishes on its channels.
pub const EXTERNAL: &str = "external";

impl ComponentInfo {
    /// A component that runs in every base tick on the real-time thread, named by the first word of its kind, without joints and stages.
    pub fn new(kind: &str, params: &str) -> Self {
        let name = kind.split('(').next().unwrap_or_default().to_owned();
        let (kind, params) = (kind.to_owned(), params.to_owned());
        ComponentInfo { name, kind, params, period_ticks: 1, runs: "rt".to_owned(), ..Default::default() }
    }
}

impl RunInfo {
    /// Kind of the first component, such as `quadruped`; empty if there is none.
    pub fn controller(&self) -> &str {
        self.components.first().map_or("", |component| &component.kind)
    }

    /// Name of the first component; empty if there is none.
    pub fn component(&self) -> &str {
        self.components.first().map_or("", |component| &component.name)
    }

    /// Parameters of the first component, as TOML; empty if there is none.
    pub fn params(&self) -> &str {
        self.components.first().map_or("", |component| &component.params)
    }

    /// Names of the stages of the first component, in the order of `controller_tick_t.digest`.
    pub fn stages(&self) -> &[String] {
        self.components.first().map_or(&[], |component| &component.stages)
    }

    /// The same run with other parameters of its first component.
    #[must_use]
    pub fn with_params(mut self, params: String) -> Self {
        match self.components.first_mut() {
            Some(first) => first.params = params,
            None => self = self.with_component(ComponentInfo::new("", &params)),
        }
        self
    }

    /// Index of a component by name.
    pub fn find_component(&self, name: &str) -> Option<usize> {
        self.components.iter().position(|component| component.name == name)
    }

    /// The same run as a component sees it: for the first one the run itself, for any other one that component alone. Empty if there is no such index.
    #[must_use]
    pub fn of_component(&self, index: usize) -> Self {
        let mut info = self.clone();
        if index > 0 {
            info.components = info.components.into_iter().skip(index).take(1).collect();
            info.n_components = i32::try_from(info.components.len()).expect("one at most");
        }
        info
    }

    /// The same run with `component` as the only component.
    #[must_use]
    pub fn with_component(mut self, component: ComponentInfo) -> Self {
        (self.n_components, self.components) = (1, vec![component]);
        self
    }
}
