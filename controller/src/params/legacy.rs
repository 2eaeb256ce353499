//! Parameters as older logs have them, so that these logs still replay.

use std::borrow::Cow;

/// The weights of the one stack there was, `wbc.weight_*`, become the formula that says the same; any other text stays as it is.
pub(super) fn migrate(text: &str) -> Cow<'_, str> {
    if !text.contains("weight_contact") {
        return Cow::Borrowed(text);
    }
    migrated(text).map_or(Cow::Borrowed(text), Cow::Owned)
}

/// `None` for what was never written so: errors are those of the text itself then.
fn migrated(text: &str) -> Option<String> {
    let mut table: toml::Table = text.parse().ok()?;
    if table.contains_key("stack") {
        return None;
    }
    let wbc = table.get_mut("wbc")?.as_table_mut()?;
    let mut weight = |task: &str| Some(format!("{:?} {task}", wbc.remove(&format!("weight_{task}"))?.as_float()?));
    let tasks = [weight("contact")?, weight("trunk")?, weight("posture")?].join(" + ");
    let formula = format!("{tasks} << base_dynamics << friction << joint_acceleration << force_bounds");
    let stack = toml::Table::from_iter([("formula".to_owned(), formula.into())]);
    table.insert("stack".to_owned(), stack.into());
    toml::to_string(&table).ok()
}

#[cfg(test)]
mod tests {
    use super::super::Params;
    use crate::stack::Formula;

    const ROBOT: &str = r#"
        [robot]
        name = "box"
        urdf = "box.urdf"
        feet = ["a", "b", "c", "d"]
        foot_radius = 0.02
        imu_link = "imu"
        posture = {}
        [wbc]
        weight_contact = 1234567.8900000001
        weight_trunk = 1e3
    "#;

    #[test]
    fn the_weights_of_older_logs_stand_in_the_formula_to_the_last_bit() {
        let params = Params::from_toml(&format!("{ROBOT}\nweight_posture = 0.1"), "log").unwrap();
        let formula = Formula::parse(&params.stack.formula).unwrap();
        let terms: Vec<_> = formula.levels[0].iter().map(|t| (t.task.as_str(), t.weight)).collect();
        assert_eq!(terms, [("contact", 1_234_567.890_000_000_1), ("trunk", 1e3), ("posture", 0.1)]);
        assert_eq!(formula.constraints.len(), 4);
    }

    #[test]
    fn what_no_log_ever_held_is_refused_with_the_name_of_the_key() {
        let error = Params::from_toml(ROBOT, "robot.toml").unwrap_err().to_string();
        assert!(error.contains("weight_contact"), "{error}");
    }
}
