//! The keys in which a study's configuration differs from the defaults.

use quadfrog::report::configuration::{ChangedKey, differences};

#[test]
fn changed_added_and_left_out_keys_are_listed_with_both_values() {
    let file = |text: &str| vec![("control.toml".to_owned(), text.to_owned())];
    let defaults = file("a = 1\n[tasks.forward]\nkp = 400.0\nkd = 8.0\nold = true");
    let own = file("a = 1\n[tasks.forward]\nkp = 500.0\nkd = 8.0\nnew = [1, 2]");
    let row = |key: &str, default: &str, value: &str| ChangedKey {
        key: format!("control.toml: tasks.forward.{key}"),
        default: default.into(),
        value: value.into(),
    };
    let expected = [row("kp", "400.0", "500.0"), row("new", "", "[1, 2]"), row("old", "true", "")];
    assert_eq!(differences(&defaults, &own), expected);
    assert!(differences(&own, &own).is_empty());
}
