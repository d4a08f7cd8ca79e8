//! Point clouds from text: one point a line.

use glam::DVec3;

use super::ply::MAX_POINTS;
use crate::cloud::PointCloud;

/// Why text is no point cloud.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum TextError {
    /// A line that does not start with three finite numbers.
    #[error("line {line}: expected x y z, found `{found}`")]
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// Its first characters.
        found: String,
    },
    /// More points than [`MAX_POINTS`].
    #[error("text: expected at most {expected} points, found more")]
    TooMany {
        /// The bound.
        expected: usize,
    },
}

impl PointCloud {
    /// Reads text with one point a line: x, y and z first, separated by spaces, tabs, commas or semicolons; what
    /// follows them is skipped, as are empty lines and those that begin with `#`.
    ///
    /// # Errors
    /// [`TextError`] naming the first bad line.
    pub fn from_text(text: &str) -> Result<Self, TextError> {
        let mut points = Vec::new();
        for (number, line) in text.lines().map(str::trim).enumerate() {
            if line.is_empty() || line.starts_with('#') {
                continue;
            }
            let separates = |c: char| c.is_whitespace() || c == ',' || c == ';';
            let numbers = line.split(separates).filter(|word| !word.is_empty()).take(3);
            let xyz: Vec<f64> = numbers.map_while(|word| word.parse().ok()).filter(|x: &f64| x.is_finite()).collect();
            let [x, y, z] = xyz[..] else {
                return Err(TextError::Line { line: number + 1, found: line.chars().take(40).collect() });
            };
            if points.len() == MAX_POINTS {
                return Err(TextError::TooMany { expected: MAX_POINTS });
            }
            points.push(DVec3::new(x, y, z));
        }
        Ok(Self { points, ..Self::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_any_usual_separator_and_names_the_line_that_is_wrong() {
        let cloud = PointCloud::from_text("# x y z\n1 2 3\n\n4,5;6,0.1,0.2\r\n-7e-1\t8\t9").expect("three points");
        assert_eq!(cloud.points, [DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0), DVec3::new(-0.7, 8.0, 9.0)]);
        for (line, wrong) in [(1, "1 2"), (2, "1 2 3\nx y z"), (1, "1 nan 3"), (1, "1 inf 3")] {
            let found = PointCloud::from_text(wrong);
            assert!(matches!(found, Err(TextError::Line { line: l, .. }) if l == line), "{wrong:?}: {found:?}");
        }
        assert!(PointCloud::from_text("").expect("empty").points.is_empty());
    }
}
