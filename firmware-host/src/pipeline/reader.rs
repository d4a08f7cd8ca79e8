//! The first stage: frames from a source, through the gate.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;

use demeter_capture::{Counts, Gate, GateConfig, Source, SourceError};
use demeter_frame::{Frame, Rgb};

use crate::error::chain;

/// What leaves the stage, in the order of the source.
pub(super) enum Arrival {
    /// A frame that passed, with its pixels.
    Frame(Frame, Rgb),
    /// A frame that did not.
    Refused {
        /// Which, when it is known.
        frame: Option<(String, u64)>,
        /// The counter's name.
        reason: &'static str,
        /// One line.
        message: String,
    },
}

/// Reads to the end of the source, until it is told to stop or nobody listens; gives the gate's counts and why the source ended early.
pub(super) fn read(source: &mut dyn Source, stop: &AtomicBool, to: &SyncSender<Arrival>) -> (Counts, Option<String>) {
    let mut gate = Gate::new(GateConfig::default());
    while !stop.load(Ordering::Relaxed) {
        let arrival = match source.next() {
            Ok(None) => return (gate.counts().clone(), None),
            Ok(Some(frame)) => match gate.admit(&frame) {
                Ok(rgb) => Arrival::Frame(frame, rgb),
                Err(refusal) => Arrival::Refused {
                    frame: Some((frame.camera.0.clone(), frame.seq)),
                    reason: refusal.reason().name(),
                    message: chain(&refusal),
                },
            },
            Err(error @ SourceError::Lost { .. }) => return (gate.counts().clone(), Some(chain(&error))),
            Err(SourceError::Frame(error)) => {
                gate.count(error.reason());
                Arrival::Refused { frame: None, reason: error.reason().name(), message: chain(&error) }
            }
        };
        if to.send(arrival).is_err() {
            break;
        }
    }
    (gate.counts().clone(), None)
}
