//! The first stage: frames from a source, through the gate.

use demeter_capture::{Counts, Gate, GateConfig, Source, SourceError};
use demeter_frame::{Frame, Rgb};
use tokio::sync::mpsc::Sender;

use super::Run;
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

/// Reads to the end of the source, until it is told to stop or nobody listens; gives the gate's counts and why the source
/// ended early.
///
/// A recording waits for whoever is slow. A camera does not: while the queue is full its frames are dropped before they
/// are decoded, so those that pass lie as evenly along the way as the box can take them, and each plant is still seen
/// from the middle of the picture.
pub(super) fn read(run: &Run<'_>, source: &mut dyn Source, to: &Sender<Arrival>) -> (Counts, Option<String>) {
    let mut gate = Gate::new(GateConfig::default());
    while !run.control.stopping() {
        let next = source.next();
        let working = run.control.reader.work();
        // This is the only sender, so room that is seen here is still there below.
        let crowded = run.live && to.capacity() == 0;
        let arrival = match next {
            Ok(None) => return (gate.counts().clone(), None),
            Ok(Some(_)) if crowded => {
                run.control.drop_frame();
                continue;
            }
            Ok(Some(frame)) => match gate.admit(&frame) {
                Ok(rgb) => {
                    run.control.views.show(&frame);
                    Arrival::Frame(frame, rgb)
                }
                Err(refusal) => Arrival::Refused {
                    frame: Some((frame.camera.0.clone(), frame.seq)),
                    reason: refusal.reason().name(),
                    message: chain(&refusal),
                },
            },
            Err(SourceError::Quiet) => continue,
            Err(error) => match error.reason() {
                Some(reason) => {
                    gate.count(reason);
                    Arrival::Refused { frame: None, reason: reason.name(), message: chain(&error) }
                }
                None => return (gate.counts().clone(), Some(chain(&error))),
            },
        };
        run.control.show_lenses(gate.bad_lenses());
        drop(working);
        if to.blocking_send(arrival).is_err() {
            break;
        }
    }
    (gate.counts().clone(), None)
}
