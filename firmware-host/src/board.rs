//! Checkerboards in pictures: where the corners between four squares are, to parts of a pixel, and which is which.

mod grid;

use chess_corners::{ChessError, Detector, DetectorConfig};
use demeter_frame::Rgb;
use demeter_recon::calibrate::BoardView;
use glam::DVec2;
use image::imageops::grayscale;

use grid::Corner;

/// The share of a board's corners that must be found, all sides among them: a guess at what glare may cost.
const LEAST_FOUND: f64 = 0.9;
/// Where a pixel's centre is for us and not for the detector.
const HALF_PIXEL: f64 = 0.5;
/// The strongest corners are looked at, twice as many as the largest board has: pictures of gravel have no end of them.
const MOST_CORNERS: usize = 2048;

/// A checkerboard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Board {
    /// Squares along its two sides, in either order.
    pub squares: [u32; 2],
    /// The side of a square, metres.
    pub side: f64,
}

/// Why a picture shows no board.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// The detector refuses the picture.
    #[error(transparent)]
    Corners(#[from] ChessError),
    /// Nothing like a board.
    #[error("expected a checkerboard, found none")]
    None,
    /// A board of another size, or a part of this one.
    #[error(
        "expected a board of {}x{} squares, found one of {}x{}: all of it must be seen, with its white rim",
        expected[0], expected[1], found[0], found[1]
    )]
    Size {
        /// Its squares.
        expected: [u32; 2],
        /// The squares that were found, the outer ones taken for granted.
        found: [u32; 2],
    },
    /// Corners are missing between others.
    #[error("expected {expected} corners between squares, found {found}")]
    Missing {
        /// All of them.
        expected: u32,
        /// Those that were found.
        found: usize,
    },
}

impl Board {
    /// The board's inner corners in a picture. Which of them is the first does not matter to a calibration, so it is left
    /// open.
    ///
    /// # Errors
    /// [`BoardError`] where the board is not seen whole.
    pub fn find(&self, picture: &Rgb) -> Result<BoardView, BoardError> {
        let found = grid::largest(&corners(picture)?);
        let [Some(right), Some(down)] = [0, 1].map(|side| found.iter().map(|(label, _)| label[side]).max()) else {
            return Err(BoardError::None);
        };
        // Labels begin at nought; a square more than there are steps between corners lies beyond each end.
        let sides = [right, down].map(|last| last.unsigned_abs() + 2);
        let [a, b] = self.squares;
        if sides != [a, b] && sides != [b, a] {
            return Err(BoardError::Size { expected: self.squares, found: sides });
        }
        let expected = (a - 1) * (b - 1);
        if (found.len() as f64) < LEAST_FOUND * f64::from(expected) {
            return Err(BoardError::Missing { expected, found: found.len() });
        }
        let point = |(label, at): &([i32; 2], DVec2)| {
            (DVec2::new(f64::from(label[0]), f64::from(label[1])) * self.side, *at + DVec2::splat(HALF_PIXEL))
        };
        Ok(BoardView { points: found.iter().map(point).collect() })
    }
}

/// Whatever looks like a corner between four squares, the clearest first.
fn corners(picture: &Rgb) -> Result<Vec<Corner>, ChessError> {
    let grey = grayscale(picture);
    let mut found = Detector::new(DetectorConfig::chess())?.detect_u8(grey.as_raw(), grey.width(), grey.height())?;
    found.sort_by(|a, b| b.response.total_cmp(&a.response));
    found.truncate(MOST_CORNERS);
    let corner = |corner: &chess_corners::CornerDescriptor| {
        let axes = corner.axes?.map(|axis| DVec2::from_angle(f64::from(axis.angle)));
        Some(Corner { at: DVec2::new(f64::from(corner.x), f64::from(corner.y)), axes })
    };
    Ok(found.iter().filter_map(corner).filter(|corner| corner.at.is_finite()).collect())
}
