//! The topics of a recording.

use quadfrog::recording::topic::Topic;

#[test]
fn topics_are_found_by_name_and_by_number() {
    for &topic in Topic::ALL {
        assert_eq!(Topic::from_name(topic.name()), Some(topic));
        assert_eq!(Topic::ALL[topic as usize], topic);
    }
}
