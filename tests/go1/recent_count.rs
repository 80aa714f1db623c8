//! Event counts over the last five seconds.

use quadfrog::robot::recent_count::RecentCount;

fn pass(recent: &mut RecentCount, ms: u32, times: u32) {
    for _ in 0..ms {
        recent.advance();
        recent.add(times);
    }
}

#[test]
fn the_window_is_five_seconds() {
    let mut recent = RecentCount::default();
    pass(&mut recent, 7, 1);
    assert_eq!((recent.sum(), recent.span_ms()), (7, 7));
    pass(&mut recent, 4893, 0);
    assert_eq!((recent.sum(), recent.span_ms()), (7, 4900));
    pass(&mut recent, 200, 0);
    assert_eq!(recent.sum(), 0, "events older than five seconds do not count");
    assert!(recent.span_ms() <= 5000);
}

#[test]
fn the_last_second_is_ten_whole_blocks() {
    let mut recent = RecentCount::default();
    pass(&mut recent, 1100, 2);
    assert_eq!((recent.in_a_second(), recent.sum()), (2000, 2200));
    recent.take_back();
    assert_eq!(recent.sum(), 2199);
    // An event of the previous block is taken back in this one.
    let mut recent = RecentCount::default();
    pass(&mut recent, 100, 1);
    pass(&mut recent, 1, 0);
    recent.take_back();
    assert_eq!(recent.sum(), 99);
    pass(&mut recent, 10_000, 3);
    assert_eq!((recent.in_a_second(), recent.sum()), (3000, 3 * recent.span_ms()));
}

#[test]
fn the_last_second_holds_the_newest_event() {
    let mut recent = RecentCount::default();
    pass(&mut recent, 50, 0);
    assert_eq!(recent.last_second(), (0, 50));
    pass(&mut recent, 1, 1);
    assert_eq!(recent.last_second(), (1, 51));
    pass(&mut recent, 999, 0);
    assert_eq!(recent.last_second(), (1, 1050));
    pass(&mut recent, 100, 0);
    assert_eq!(recent.last_second(), (0, 1050));
}

#[test]
fn a_sum_saturates() {
    let mut recent = RecentCount::default();
    recent.advance();
    recent.add(u32::MAX);
    recent.add(5);
    assert_eq!(recent.sum(), u32::MAX);
    pass(&mut recent, 5100, 0);
    assert_eq!(recent.sum(), 0);
}
