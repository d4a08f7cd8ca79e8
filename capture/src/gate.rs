use std::collections::BTreeMap;

use demeter_frame::{CameraId, Frame, Rgb};
use image::imageops;
use serde::{Deserialize, Serialize};

use crate::order::Order;
use crate::{Counts, DecodeError, Lens, LensWatch, Reason, decode};

/// What the gate asks of an image. Luma runs from 0 to 255.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GateConfig {
    /// Least variance of the luma's 4-neighbour Laplacian (the focus measure of Pech-Pacheco et al. 2000, LAPV), in
    /// luma squared.
    pub min_sharpness: f64,
    /// Least share of pixels brighter than luma 32.
    pub min_lit: f64,
    /// Largest share of pixels at luma 250 or above.
    pub max_white: f64,
}

impl Default for GateConfig {
    /// Sharpness was measured on 86 real photos (tests/gate_photos.rs: field rows, maize in a cabinet, a potted plant):
    /// 38 to 4445 as taken, 0.8 to 6.8 after a Gaussian blur of 3 pixels; 15 lies midway on a log scale. The shares are
    /// guesses that those photos keep: at least 0.038 of their pixels are lit, at most 0.58 white.
    fn default() -> Self {
        Self { min_sharpness: 15.0, min_lit: 0.01, max_white: 0.8 }
    }
}

/// Luma above which a pixel counts as lit (a guess): the networks see little in anything darker.
const LIT: u8 = 32;

/// Luma from which a pixel counts as white; JPEG noise keeps a clipped area just under 255.
const WHITE: u8 = 250;

/// The gate's word on one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Worth the networks' time.
    Pass,
    /// Counted and dropped.
    Refuse(Reason),
}

/// Why [`Gate::admit`] let a frame go no further.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// The bytes are no image.
    #[error(transparent)]
    Damaged(#[from] DecodeError),
    /// The image, or its place in time, is no use.
    #[error("the frame is refused: {0}")]
    Judged(Reason),
}

impl Refusal {
    /// The counter this went to.
    #[must_use]
    pub fn reason(&self) -> Reason {
        match self {
            Self::Damaged(error) => error.reason(),
            Self::Judged(reason) => *reason,
        }
    }
}

/// Refuses frames that would waste the networks' time or harm a plant, and counts why.
///
/// The verdict depends on the configuration and the frames before, never on a clock.
#[derive(Debug, Default)]
pub struct Gate {
    config: GateConfig,
    cameras: BTreeMap<CameraId, Memory>,
    counts: Counts,
}

#[derive(Debug, Default)]
struct Memory {
    order: Order,
    bytes: Option<blake3::Hash>,
    lens: LensWatch,
}

impl Gate {
    /// A gate that has seen nothing.
    #[must_use]
    pub fn new(config: GateConfig) -> Self {
        Self { config, ..Self::default() }
    }

    /// Puts the frame in order, decodes it and looks at it: the whole gate in one call.
    ///
    /// # Errors
    /// [`Refusal`], already counted.
    pub fn admit(&mut self, frame: &Frame) -> Result<Rgb, Refusal> {
        let admitted = self.arrival(frame).map_err(Refusal::Judged).and_then(|()| {
            let rgb = decode(frame)?;
            self.watch(frame, &rgb);
            look(&self.config, &rgb).map_err(Refusal::Judged)?;
            Ok(rgb)
        });
        self.tally(admitted.as_ref().err().map(Refusal::reason));
        admitted
    }

    /// The same for a frame that was decoded elsewhere into `rgb`.
    pub fn judge(&mut self, frame: &Frame, rgb: &Rgb) -> Verdict {
        self.watch(frame, rgb);
        let refused = self.arrival(frame).and_then(|()| look(&self.config, rgb)).err();
        self.tally(refused);
        refused.map_or(Verdict::Pass, Verdict::Refuse)
    }

    /// Counts a frame that was lost before it came here ([`SourceError::reason`](crate::SourceError::reason)).
    pub fn count(&mut self, reason: Reason) {
        self.counts.refuse(reason);
    }

    /// What happened so far.
    #[must_use]
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// The lenses that the pictures say are not clear.
    #[must_use]
    pub fn bad_lenses(&self) -> Vec<(CameraId, Lens)> {
        let states = self.cameras.iter().map(|(id, memory)| (id.clone(), memory.lens.state()));
        states.filter(|(_, lens)| *lens != Lens::Clear).collect()
    }

    /// Dirt costs no frame: the parts of the picture beside it are as good as ever. It is said once.
    fn watch(&mut self, frame: &Frame, rgb: &Rgb) {
        let lens = &mut self.cameras.entry(frame.camera.clone()).or_default().lens;
        if lens.is_due(frame.stamp.mono_ns)
            && let Some(news) = lens.see(frame.stamp.mono_ns, rgb)
        {
            tracing::warn!("camera {}: {news}", frame.camera);
        }
    }

    fn tally(&mut self, refused: Option<Reason>) {
        match refused {
            None => self.counts.passed += 1,
            Some(reason) => self.counts.refuse(reason),
        }
    }

    /// Order and sameness need the bytes only.
    fn arrival(&mut self, frame: &Frame) -> Result<(), Reason> {
        let memory = self.cameras.entry(frame.camera.clone()).or_default();
        memory.order.advance(frame)?;
        // An empty frame is empty, not a duplicate of the empty one before.
        let bytes = (!frame.bytes.is_empty()).then(|| blake3::hash(&frame.bytes));
        let same = bytes.is_some() && bytes == memory.bytes;
        memory.bytes = bytes;
        if same { Err(Reason::Duplicate) } else { Ok(()) }
    }
}

/// Exposure before sharpness: a black image is also without detail, but the lamp is at fault, not the lens.
fn look(config: &GateConfig, rgb: &Rgb) -> Result<(), Reason> {
    let luma = imageops::grayscale(rgb);
    let share = |pick: fn(u8) -> bool| luma.iter().filter(|&&v| pick(v)).count() as f64 / luma.len().max(1) as f64;
    if share(|v| v > LIT) < config.min_lit {
        Err(Reason::Underexposed)
    } else if share(|v| v >= WHITE) > config.max_white {
        Err(Reason::Overexposed)
    } else if sharpness(&luma) < config.min_sharpness {
        Err(Reason::Blurred)
    } else {
        Ok(())
    }
}

/// Variance of the 4-neighbour Laplacian over the inner pixels, in exact integers until the end; 0 under 3 x 3.
fn sharpness(luma: &image::GrayImage) -> f64 {
    let width = luma.width() as usize;
    let rows: Vec<&[u8]> = luma.chunks_exact(width.max(1)).collect();
    let (mut sum, mut squares, mut count) = (0i64, 0i64, 0i64);
    for three in rows.windows(3) {
        let (above, below) = (&three[0][1..], &three[2][1..]);
        for ((row, &up), &down) in three[1].windows(3).zip(above).zip(below) {
            let [left, here, right] = [row[0], row[1], row[2]].map(i32::from);
            let laplacian = i32::from(up) + i32::from(down) + left + right - 4 * here;
            sum += i64::from(laplacian);
            squares += i64::from(laplacian * laplacian);
            count += 1;
        }
    }
    let count = count.max(1) as f64;
    squares as f64 / count - (sum as f64 / count).powi(2)
}
