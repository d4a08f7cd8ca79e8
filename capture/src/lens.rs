//! Whether a lens is covered or dirty, told from what stays the same in its pictures while the scene goes by.

use demeter_frame::Rgb;
use image::imageops;
use serde::Serialize;

/// Time between two pictures that are looked at, nanoseconds: dirt comes slowly, and looking costs a pass over the pixels.
const PAUSE_NS: u64 = 500_000_000;

/// The picture is divided into so many cells.
const COLUMNS: usize = 16;
const ROWS: usize = 12;
const CELLS: usize = COLUMNS * ROWS;

/// Pictures in a row that show nothing before the lens is called covered: 5 s (a guess: longer than a leaf brushes by).
const COVERED_PICTURES: u32 = 10;
/// Pictures of a moving scene before a lens is called dirty or clear: 10 s.
const WINDOW: u32 = 20;

/// All of these are guesses, kept by the tests below and by the row of tests/fixtures. Luma runs from 0 to 255; detail is
/// the mean difference between neighbouring pixels.
///
/// A cell no brighter than this shows nothing.
const DARK: f32 = 40.0;
/// A picture whose cells differ by less, without detail, shows nothing.
const FLAT: f32 = 4.0;
/// Detail of a picture that shows nothing: a sensor's noise stays below.
const NO_DETAIL: f32 = 1.5;
/// The scene moves when half of the cells change by more from one picture to the next.
const MOTION: f32 = 1.5;
/// A cell is soft whose best detail is below this share of the ordinary cell's.
const SOFT: f32 = 0.25;
/// A cell sees the scene through dirt when it changes by at least this share of what the ordinary cell does; the sky,
/// which is soft too, does not.
const CHANGING: f32 = 0.25;
/// Cells in one piece before they are called dirt: 2 % of the picture.
const PIECE: usize = 4;

/// The state of a lens.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
#[serde(tag = "lens", rename_all = "snake_case")]
pub enum Lens {
    /// Nothing is wrong as far as was seen.
    #[default]
    Clear,
    /// No picture at all: a cap, a cloth, mud all over.
    Covered,
    /// A part stays soft or dark while the scene goes by.
    Dirty {
        /// Its middle from the left, as a share of the width.
        x: f32,
        /// Its middle from the top, as a share of the height.
        y: f32,
        /// Its share of the picture.
        share: f32,
    },
}

impl std::fmt::Display for Lens {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Clear => f.write_str("the lens is clear"),
            Self::Covered => f.write_str("the lens is covered, or it is dark: the picture shows nothing"),
            Self::Dirty { x, y, share } => {
                let [x, y, share] = [x, y, share].map(|part| (part * 100.0).round());
                write!(f, "the lens is dirty: {share} % of the picture, {x} % from the left and {y} % from the top")
            }
        }
    }
}

/// What a camera's pictures have told of its lens so far.
#[derive(Debug, Default)]
pub struct LensWatch {
    state: Lens,
    seen_ns: Option<u64>,
    before: Option<Vec<f32>>,
    empty: u32,
    moved: u32,
    cells: Vec<Cell>,
}

/// One cell over the pictures of a moving scene.
#[derive(Clone, Copy, Debug)]
struct Cell {
    detail: f32,
    darkest: f32,
    brightest: f32,
}

impl LensWatch {
    /// Whether a picture taken at that monotonic time (nanoseconds) is worth looking at.
    #[must_use]
    pub fn is_due(&self, mono_ns: u64) -> bool {
        self.seen_ns.is_none_or(|seen| mono_ns.abs_diff(seen) >= PAUSE_NS)
    }

    /// Looks at a picture; the lens's state when it is no longer what it was.
    pub fn see(&mut self, mono_ns: u64, picture: &Rgb) -> Option<Lens> {
        self.seen_ns = Some(mono_ns);
        let now = cells(picture);
        let state = self.judge(&now);
        let news = state.filter(|state| *state != self.state)?;
        self.state = news;
        Some(news)
    }

    /// What is known by now.
    #[must_use]
    pub fn state(&self) -> Lens {
        self.state
    }

    /// The state that this picture settles; `None` while more must be seen.
    fn judge(&mut self, now: &[(f32, f32)]) -> Option<Lens> {
        if shows_nothing(now) {
            self.empty += 1;
            (self.before, self.moved) = (None, 0);
            return (self.empty >= COVERED_PICTURES).then_some(Lens::Covered);
        }
        self.empty = 0;
        let lumas: Vec<f32> = now.iter().map(|(luma, _)| *luma).collect();
        let moved = self.before.as_ref().is_some_and(|before| {
            median(before.iter().zip(&lumas).map(|(before, now)| (before - now).abs()).collect()) > MOTION
        });
        self.before = Some(lumas);
        if moved {
            if self.moved == 0 {
                self.cells = vec![Cell { detail: 0.0, darkest: 255.0, brightest: 0.0 }; CELLS];
            }
            self.moved += 1;
            for (cell, &(luma, detail)) in self.cells.iter_mut().zip(now) {
                cell.detail = cell.detail.max(detail);
                cell.darkest = cell.darkest.min(luma);
                cell.brightest = cell.brightest.max(luma);
            }
        }
        if self.moved == WINDOW {
            self.moved = 0;
            return Some(dirt(&self.cells));
        }
        (self.state == Lens::Covered).then_some(Lens::Clear)
    }
}

/// Mean luma and detail of each cell, row by row. A picture too small for cells has none.
fn cells(picture: &Rgb) -> Vec<(f32, f32)> {
    let luma = imageops::grayscale(picture);
    let (width, height) = (luma.width() as usize / COLUMNS, luma.height() as usize / ROWS);
    if width < 2 || height < 2 {
        return Vec::new();
    }
    let (stride, pixels) = (luma.width() as usize, luma.as_raw());
    let cell = |index: usize| {
        let (left, top) = (index % COLUMNS * width, index / COLUMNS * height);
        let (mut sum, mut differences) = (0, 0);
        for y in top..top + height - 1 {
            let (row, below) = (&pixels[y * stride + left..][..width], &pixels[(y + 1) * stride + left..][..width]);
            for x in 0..width - 1 {
                sum += u32::from(row[x]);
                differences += u32::from(row[x].abs_diff(row[x + 1])) + u32::from(row[x].abs_diff(below[x]));
            }
        }
        let count = ((width - 1) * (height - 1)) as f32;
        (sum as f32 / count, differences as f32 / (2.0 * count))
    };
    (0..CELLS).map(cell).collect()
}

/// Dark all over, or of one brightness and without detail.
fn shows_nothing(cells: &[(f32, f32)]) -> bool {
    let lumas = || cells.iter().map(|(luma, _)| *luma);
    let (darkest, brightest) = (lumas().fold(255.0, f32::min), lumas().fold(0.0, f32::max));
    let no_detail = median(cells.iter().map(|(_, detail)| *detail).collect()) < NO_DETAIL;
    !cells.is_empty() && no_detail && (brightest < DARK || brightest - darkest < FLAT)
}

/// The largest piece of cells that see badly while the ordinary cell sees well.
fn dirt(cells: &[Cell]) -> Lens {
    let change = |cell: &Cell| cell.brightest - cell.darkest;
    let ordinary = median(cells.iter().map(|cell| cell.detail).collect());
    let moving = median(cells.iter().map(change).collect());
    let bad = |cell: &Cell| {
        let soft = ordinary > NO_DETAIL && cell.detail < SOFT * ordinary;
        soft && (change(cell) >= CHANGING * moving || cell.brightest < DARK)
    };
    let mut open: Vec<bool> = cells.iter().map(bad).collect();
    let pieces = (0..cells.len()).map(|start| piece(&mut open, start));
    let Some(piece) = pieces.max_by_key(Vec::len).filter(|piece| piece.len() >= PIECE) else { return Lens::Clear };
    let mean = |of: &dyn Fn(usize) -> usize, side: usize| {
        (piece.iter().map(|&cell| of(cell) as f32 + 0.5).sum::<f32>()) / (piece.len() * side) as f32
    };
    Lens::Dirty {
        x: mean(&|cell| cell % COLUMNS, COLUMNS),
        y: mean(&|cell| cell / COLUMNS, ROWS),
        share: piece.len() as f32 / CELLS as f32,
    }
}

/// The open cells that hang together with `start`, which are closed thereby.
fn piece(open: &mut [bool], start: usize) -> Vec<usize> {
    let (mut found, mut next) = (Vec::new(), vec![start]);
    while let Some(cell) = next.pop() {
        if !std::mem::take(&mut open[cell]) {
            continue;
        }
        found.push(cell);
        let (column, row) = (cell % COLUMNS, cell / COLUMNS);
        next.extend((column > 0).then(|| cell - 1));
        next.extend((column + 1 < COLUMNS).then_some(cell + 1));
        next.extend((row > 0).then(|| cell - COLUMNS));
        next.extend((row + 1 < ROWS).then_some(cell + COLUMNS));
    }
    found
}

fn median(mut values: Vec<f32>) -> f32 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f32::total_cmp).1
}
