//! Which plant along the row an observation belongs to.

use glam::DVec2;

/// A track ends when the rig has gone this far since it was last seen, metres: a plant that is hidden or missed for that
/// long has left the picture (a guess for cameras that see 1 m of row).
const PASSED_M: f64 = 0.5;
/// Most tracks open at once; the one unseen for longest is closed for a new one. A picture holds far fewer plants.
const MAX_OPEN: usize = 256;

/// How much less a distance along the line of sight counts than one across it: a plant's direction is seen to a pixel,
/// its depth is a network's word (a guess).
const DEPTH_DOUBT: f64 = 3.0;

/// How far from a track's position an observation may lie across the line of sight, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gate(pub f64);

impl Gate {
    /// Half the distance between plants as sown; without one 0.08 m, half of maize's usual 0.16 m.
    #[must_use]
    pub fn of_spacing(spacing_m: Option<f64>) -> Self {
        Self(spacing_m.unwrap_or(0.16) / 2.0)
    }
}

/// What makes one view of a plant better than another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// The whole plant is in the picture.
    pub whole: bool,
    /// How many pixels it has.
    pub pixels: usize,
    /// How far from the picture's middle it is, 0 to 1 (a corner).
    pub off_centre: f64,
}

impl Quality {
    /// Whole plants before cut ones, then size, of which a corner costs half: lenses and networks are worse there.
    fn score(&self) -> (bool, f64) {
        (self.whole, self.pixels as f64 * (1.0 - 0.5 * self.off_centre))
    }

    fn beats(&self, other: &Self) -> bool {
        let ((whole, score), (other_whole, other_score)) = (self.score(), other.score());
        (whole, score) > (other_whole, other_score)
    }
}

/// A plant seen in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Observation<T> {
    /// Where it stands on the ground, metres.
    pub position: DVec2,
    /// Where the camera stood, metres.
    pub camera: DVec2,
    /// How well it is seen.
    pub quality: Quality,
    /// What is kept of the best view.
    pub view: T,
}

impl<T> Observation<T> {
    /// Distance to a place on the ground, metres across the line of sight.
    fn distance(&self, place: DVec2) -> f64 {
        let sight = (self.position - self.camera).normalize_or_zero();
        let away = place - self.position;
        let along = away.dot(sight);
        DVec2::new((away - sight * along).length(), along / DEPTH_DOUBT).length()
    }
}

/// A plant that the rig has passed; `F` names a frame, `T` is what is kept of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct Closed<F, T> {
    /// Its number in the session, 1 and up: in the order of closing, and of opening where several close at once.
    pub number: u64,
    /// Mean of the observed positions, each as heavy as it has pixels, metres.
    pub position: DVec2,
    /// The frames it was seen in, in order.
    pub frames: Vec<F>,
    /// The frame of the best view.
    pub best_frame: F,
    /// The best view.
    pub best: T,
}

#[derive(Clone, Debug)]
struct Track<F, T> {
    /// Sum of positions, each as heavy as it has pixels, and of those weights.
    sum: DVec2,
    weight: f64,
    frames: Vec<F>,
    last_seen: f64,
    best: (Quality, F, T),
}

impl<F: Clone + PartialEq, T> Track<F, T> {
    fn open(frame: &F, travelled: f64, observation: Observation<T>) -> Self {
        let Observation { position, quality, view, .. } = observation;
        let weight = quality.pixels.max(1) as f64;
        let frames = vec![frame.clone()];
        Self { sum: position * weight, weight, frames, last_seen: travelled, best: (quality, frame.clone(), view) }
    }

    fn add(&mut self, frame: &F, travelled: f64, observation: Observation<T>) {
        let Observation { position, quality, view, .. } = observation;
        let weight = quality.pixels.max(1) as f64;
        self.sum += position * weight;
        self.weight += weight;
        self.last_seen = travelled;
        // Two pieces of one plant in one picture are one sight of it.
        if self.frames.last() != Some(frame) {
            self.frames.push(frame.clone());
        }
        if quality.beats(&self.best.0) {
            self.best = (quality, frame.clone(), view);
        }
    }

    fn position(&self) -> DVec2 {
        self.sum / self.weight
    }
}

/// Collects observations into plants while a rig drives along.
///
/// Every observation belongs to exactly one track; the order in which one frame's observations are given does not
/// matter.
#[derive(Clone, Debug)]
pub struct Tracker<F, T> {
    gate: Gate,
    open: Vec<Track<F, T>>,
    closed: u64,
}

impl<F: Clone + PartialEq, T> Tracker<F, T> {
    /// A tracker that has seen nothing.
    #[must_use]
    pub fn new(gate: Gate) -> Self {
        Self { gate, open: Vec::new(), closed: 0 }
    }

    /// Takes the plants of one frame, seen when the rig had gone `travelled` metres in all, and gives those the rig has
    /// passed. Observations whose position is not finite cannot be placed and are given back.
    pub fn frame(
        &mut self,
        frame: &F,
        travelled: f64,
        observations: Vec<Observation<T>>,
    ) -> (Vec<Closed<F, T>>, Vec<Observation<T>>) {
        let (mut seen, lost): (Vec<_>, Vec<_>) = observations.into_iter().partition(|o| o.position.is_finite());
        // The largest first: two plants never stand within the gate, so what lies there is a piece of the larger.
        let place = |o: &Observation<T>| (o.position.x, o.position.y);
        seen.sort_by(|a, b| {
            let ((ax, ay), (bx, by)) = (place(a), place(b));
            b.quality.pixels.cmp(&a.quality.pixels).then(ax.total_cmp(&bx)).then(ay.total_cmp(&by))
        });
        for observation in seen {
            let distance = |track: &Track<F, T>| observation.distance(track.position());
            let near = (0..self.open.len()).filter(|&t| distance(&self.open[t]) <= self.gate.0);
            match near.min_by(|&a, &b| distance(&self.open[a]).total_cmp(&distance(&self.open[b]))) {
                Some(track) => self.open[track].add(frame, travelled, observation),
                None => self.open.push(Track::open(frame, travelled, observation)),
            }
        }
        // The tracks unseen for longest make room, and those that were passed go in any case.
        let over = self.open.len().saturating_sub(MAX_OPEN);
        let mut by_age: Vec<usize> = (0..self.open.len()).collect();
        by_age.sort_by(|&a, &b| self.open[a].last_seen.total_cmp(&self.open[b].last_seen).then(a.cmp(&b)));
        let crowded_out = by_age[..over].to_vec();
        let mut index = 0;
        let passed = self.open.extract_if(.., |track| {
            index += 1;
            crowded_out.contains(&(index - 1)) || travelled - track.last_seen > PASSED_M
        });
        let passed: Vec<_> = passed.collect();
        (self.close(passed), lost)
    }

    /// Closes what is still open.
    pub fn finish(mut self) -> Vec<Closed<F, T>> {
        let rest = std::mem::take(&mut self.open);
        self.close(rest)
    }

    fn close(&mut self, tracks: Vec<Track<F, T>>) -> Vec<Closed<F, T>> {
        let first = self.closed;
        self.closed += tracks.len() as u64;
        let number = first + 1..;
        tracks
            .into_iter()
            .zip(number)
            .map(|(track, number)| Closed {
                number,
                position: track.position(),
                frames: track.frames,
                best_frame: track.best.1,
                best: track.best.2,
            })
            .collect()
    }
}
