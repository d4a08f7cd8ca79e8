//! Live runs beside recordings: cameras do not wait for a box that is slower than they are, and a full disk makes plants
//! wait instead of losing them.
#![allow(clippy::unwrap_used)]

mod common;

use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use common::{Bench, bench, row};
use demeter::clock::SystemClock;
use demeter::config::ModelsConfig;
use demeter::eye::Eye;
use demeter::pipeline::{self, Control, Outcome, Run};

/// Two plants in eight frames that are there at once, run with what `control` says.
fn run(bench: &Bench, control: &Control, live: bool) -> Outcome {
    let (mut source, manifest) = row(&bench.species, 2, "live");
    let mut eye = Eye::open(&ModelsConfig::default(), NonZeroUsize::MIN).unwrap();
    let clock = SystemClock::new();
    let run = Run { manifest: &manifest, species: &bench.species, store: &bench.store, control, clock: &clock, live };
    pipeline::run(&run, &mut source, &mut eye, |_| {}).unwrap()
}

#[test]
fn frames_are_dropped_and_counted_live_and_never_out_of_a_recording() {
    for live in [true, false] {
        let (bench, control) = (bench(), Control::default());
        control.slow_down(16);
        let outcome = run(&bench, &control, live);
        assert_eq!(outcome.frames + control.dropped(), 8, "each frame is worked or counted: {outcome:?}");
        assert_eq!(control.dropped() > 0, live, "{} dropped", control.dropped());
        let noted = "SELECT detail ->> 'dropped' FROM events WHERE kind = 'run_finished'";
        assert_eq!(bench.number(noted) as u64, control.dropped());
    }
}

#[test]
fn plants_wait_while_the_disk_is_full_and_are_stored_when_there_is_room() {
    let (bench, control) = (bench(), Control::default());
    control.storage_full(true);
    std::thread::scope(|scope| {
        let running = scope.spawn(|| run(&bench, &control, false));
        // Long enough for both to be fitted where they did not wait.
        std::thread::sleep(Duration::from_secs(5));
        assert!(!running.is_finished());
        assert_eq!(control.keeper.busy(Instant::now()), None, "a stage that waits for room is alive");
        assert_eq!(bench.rows(), [0; 5]);
        control.storage_full(false);
        assert_eq!(running.join().unwrap().plants, 2);
    });
}

#[test]
fn a_stop_leaves_plants_that_wait_for_room_out_whole() {
    let (bench, control) = (bench(), Control::default());
    control.storage_full(true);
    control.stop(Duration::ZERO);
    let outcome = run(&bench, &control, true);
    assert_eq!((outcome.plants, bench.rows()), (0, [0; 5]));
}
