//! The supervisor and its board over drivers that fail on purpose: faults that no real device makes on demand.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use demeter_frame::{CameraId, PixelFormat};

use super::driver::{Driver, Layout, Shot, Stream};
use super::supervisor::Patience;
use super::*;
use crate::{Positions, Reason, Source, SourceError};

/// What a made-up camera does next.
#[derive(Clone, Copy, Debug)]
enum Act {
    /// Gives a frame that it counts as this.
    Frame(u32),
    Damaged(u32),
    /// As a frame, of 5 MB.
    Large(u32),
    /// Gives nothing any more.
    Hang,
    /// Says that it is gone.
    Vanish,
    Panic,
}

/// A camera that goes through one list of acts each time it is opened, and then has gone for good.
struct Actor(Mutex<VecDeque<Vec<Act>>>);
struct Playing(VecDeque<Act>);

impl Driver for Arc<Actor> {
    fn open(&self) -> Result<Box<dyn Stream>, CameraFault> {
        match self.0.lock().unwrap().pop_front() {
            Some(acts) => Ok(Box::new(Playing(acts.into()))),
            None => Err(CameraFault::Missing { expected: "here".into(), found: String::new() }),
        }
    }
}

impl Stream for Playing {
    fn layout(&self) -> Layout {
        Layout { format: PixelFormat::Grey, width: 2, height: 1, stride: 2 }
    }

    fn grab(&mut self, wait: Duration) -> Result<Option<Shot>, CameraFault> {
        let shot = |count, damaged| Shot { count, mono_ns: monotonic_ns(), bytes: [1, 2].into(), damaged };
        match self.0.front().copied() {
            Some(Act::Hang) => {
                std::thread::sleep(wait);
                Ok(None)
            }
            Some(Act::Panic) => panic!("as asked for"),
            Some(Act::Vanish) | None => {
                Err(CameraFault::Refused { what: "fetching", source: std::io::ErrorKind::NotFound.into() })
            }
            Some(Act::Frame(count)) => {
                self.0.pop_front();
                std::thread::sleep(Duration::from_millis(2));
                Ok(Some(shot(count, false)))
            }
            Some(Act::Large(count)) => {
                self.0.pop_front();
                Ok(Some(Shot { bytes: vec![0; 5 << 20].into(), ..shot(count, false) }))
            }
            Some(Act::Damaged(count)) => {
                self.0.pop_front();
                Ok(Some(shot(count, true)))
            }
        }
    }
}

fn settings(id: &str) -> CameraSettings {
    CameraSettings {
        id: CameraId(id.into()),
        device: format!("port-of-{id}"),
        backend: Backend::V4l2,
        mode: Mode { format: PixelFormat::Grey, width: 2, height: 1, rate: 1000.0 },
        controls: Controls::default(),
        mount: Some(Mount { height: 1.0, pitch: 0.0, speed: Speed::Given(1.0) }),
        smear: None,
    }
}

fn open(cameras: &[(&str, Vec<Vec<Act>>)]) -> Cameras {
    let actors: BTreeMap<String, Arc<Actor>> =
        cameras.iter().map(|(id, acts)| ((*id).to_owned(), Arc::new(Actor(Mutex::new(acts.clone().into()))))).collect();
    let settings: Vec<_> = cameras.iter().map(|(id, _)| settings(id)).collect();
    let millis = Duration::from_millis;
    let patience =
        Patience { first: millis(20), stall: millis(20), absent: millis(5), retry: millis(1), longest: millis(5) };
    Cameras::with(&settings, &Positions::default(), |settings| Box::new(actors[&settings.id.0].clone()), patience)
        .unwrap()
}

/// What comes until all is quiet: camera and number of each frame, and the reasons of those lost.
fn drain(cameras: &mut Cameras) -> (Vec<(String, u64)>, Vec<Reason>) {
    let (mut frames, mut lost) = (Vec::new(), Vec::new());
    loop {
        match cameras.next() {
            Ok(Some(frame)) => frames.push((frame.camera.0, frame.seq)),
            Err(SourceError::Quiet) => return (frames, lost),
            Err(error) => lost.push(error.reason().unwrap()),
            Ok(None) => unreachable!("nobody stops it"),
        }
    }
}

fn frames(from: u32, to: u32) -> Vec<Act> {
    (from..to).map(Act::Frame).collect()
}

#[test]
fn a_camera_that_fails_in_every_way_is_opened_again_and_the_other_loses_no_frame() {
    let with = |mut acts: Vec<Act>, last| {
        acts.push(last);
        acts
    };
    let bad = vec![
        with(frames(0, 5), Act::Hang),
        with(frames(0, 5), Act::Panic),
        with(frames(90, 95), Act::Vanish),
        vec![Act::Panic],
        vec![Act::Hang],
        frames(0, 5),
    ];
    let mut cameras = open(&[("bad", bad), ("good", vec![frames(0, 200)])]);
    let health = cameras.health();
    let (frames, lost) = drain(&mut cameras);
    let of = |id: &str| frames.iter().filter(|(camera, _)| camera == id).map(|(_, seq)| *seq).collect::<Vec<_>>();
    assert_eq!(of("good"), (0..200).collect::<Vec<_>>());
    assert_eq!(of("bad"), (0..20).collect::<Vec<_>>(), "numbers go on through reopenings");
    assert!(lost.is_empty());
    let found = health.read();
    let [bad, good] = &found[..] else { panic!("two cameras, {found:?}") };
    assert_eq!((bad.frames, bad.reopened, bad.state), (20, 3, CameraState::Lost));
    assert!(bad.last_error.as_ref().unwrap().contains("expected a camera at \"here\", found none at all"));
    assert_eq!((good.frames, good.reopened, good.missed, good.dropped), (200, 0, 0, 0));
}

#[test]
fn damaged_and_missing_frames_are_counted_apart() {
    let acts = vec![Act::Frame(0), Act::Damaged(1), Act::Frame(2), Act::Frame(5), Act::Damaged(6), Act::Hang];
    let mut cameras = open(&[("left", vec![acts])]);
    let (frames, lost) = drain(&mut cameras);
    assert_eq!(frames.iter().map(|(_, seq)| *seq).collect::<Vec<_>>(), [0, 2, 5]);
    assert_eq!(lost, [Reason::DamagedBuffer; 2]);
    let found = &cameras.health().read()[0];
    assert_eq!((found.frames, found.damaged, found.missed), (3, 2, 2));
    assert!(found.last_frame_age.is_some_and(|age| age > 0.0));
}

#[test]
fn frames_that_nobody_fetches_make_room_for_newer_ones_and_are_counted() {
    let small = [frames(0, 50), vec![Act::Hang]].concat();
    let large = [(0..10).map(Act::Large).collect(), vec![Act::Hang]].concat();
    // A second of them, or as many as fit into 16 MB.
    for (acts, kept) in [(small, 20..50), (large, 7..10)] {
        let came = kept.end;
        let mut cameras = open(&[("left", vec![acts])]);
        let health = cameras.health();
        let until = Instant::now() + Duration::from_secs(10);
        while health.read()[0].frames < came && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(5));
        }
        let (frames, _) = drain(&mut cameras);
        assert_eq!(health.read()[0].dropped, kept.start);
        assert_eq!(frames.iter().map(|(_, seq)| *seq).collect::<Vec<_>>(), kept.collect::<Vec<_>>());
    }
}

#[test]
fn closing_ends_the_threads_and_the_source() {
    let cameras = open(&[("left", vec![vec![Act::Hang]]), ("right", vec![])]);
    let health = cameras.health();
    let before = Instant::now();
    drop(cameras);
    assert!(before.elapsed() < Duration::from_secs(3), "nobody hangs, so nobody is waited for in vain");
    assert_eq!(health.read().len(), 2, "what was known stays readable");
}
