//! Where the solver starts: a pinhole with its centre in the middle of the picture, and the boards as that sees them.

use demeter_frame::Pose;
use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{SMatrix, SVector};

use super::normal::Guess;
use super::{BoardView, CalibrateError, LEAST_POINTS};

/// Focal lengths that are believed, in widths of the picture: a field of view of 136 degrees, and one of 6 (a guess).
const FOCAL: (f64, f64) = (0.2, 10.0);

pub(super) fn start(views: &[BoardView], width: u32, height: u32) -> Result<Guess, CalibrateError> {
    let (width, centre) = (f64::from(width), DVec2::new(f64::from(width), f64::from(height)) / 2.0);
    let homographies = views.iter().enumerate().map(|(view, board)| {
        let (expected, found) = (LEAST_POINTS, board.points.len());
        let enough = (found >= expected).then(|| homography(board, centre)).flatten();
        enough.ok_or(CalibrateError::View { view, expected, found })
    });
    let homographies = homographies.collect::<Result<Vec<_>, _>>()?;
    let f = focal(&homographies).map_or(width, |f| f.clamp(FOCAL.0 * width, FOCAL.1 * width));
    let poses = homographies.iter().map(|h| pose(h, f)).collect();
    let lens = SVector::from([f, f, centre.x, centre.y, 0.0, 0.0, 0.0, 0.0, 0.0]);
    Ok(Guess { lens, poses })
}

/// Shift and scale that put points around the origin at a distance of about one; `None` for points all in one place.
fn spread(points: impl Iterator<Item = DVec2> + Clone) -> Option<(DVec2, f64)> {
    let count = points.clone().count() as f64;
    let middle = points.clone().sum::<DVec2>() / count;
    let scale = (points.map(|p| (p - middle).length_squared()).sum::<f64>() / count).sqrt();
    (scale.is_finite() && scale > 0.0).then_some((middle, scale))
}

/// The homography from the board to the picture with `centre` as its origin, by the direct linear transform over
/// normalised points; `None` for points in a line.
fn homography(view: &BoardView, centre: DVec2) -> Option<DMat3> {
    let (board, on_board) = spread(view.points.iter().map(|(board, _)| *board))?;
    let (seen, on_picture) = spread(view.points.iter().map(|(_, at)| *at - centre))?;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (b, at) in &view.points {
        let (b, p) = ((*b - board) / on_board, (*at - centre - seen) / on_picture);
        for row in [
            [b.x, b.y, 1.0, 0.0, 0.0, 0.0, -p.x * b.x, -p.x * b.y, -p.x],
            [0.0, 0.0, 0.0, b.x, b.y, 1.0, -p.y * b.x, -p.y * b.y, -p.y],
        ] {
            let row = SVector::from(row);
            normal += row * row.transpose();
        }
    }
    let eigen = normal.symmetric_eigen();
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*a].total_cmp(&eigen.eigenvalues[*b]));
    // A second direction as good as the first: the points do not decide.
    if eigen.eigenvalues[order[1]] <= 1e-9 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let h: [f64; 9] = eigen.eigenvectors.column(order[0]).into_owned().into();
    let h = DMat3::from_cols_array(&h).transpose();
    let from_board = DMat3::from_scale(DVec2::splat(1.0 / on_board)) * DMat3::from_translation(-board);
    let to_picture = DMat3::from_translation(seen) * DMat3::from_scale(DVec2::splat(on_picture));
    let h = to_picture * h * from_board;
    h.is_finite().then_some(h)
}

/// The focal length under which the board's axes are at right angles and of one length in all views; `None` where the
/// views say nothing of it.
fn focal(homographies: &[DMat3]) -> Option<f64> {
    let (mut weight, mut sum) = (0.0, 0.0);
    for h in homographies {
        let scale = h.x_axis.truncate().length();
        let (a, b) = (h.x_axis / scale, h.y_axis / scale);
        let (across, along) = (a.truncate(), b.truncate());
        for (flat, deep) in
            [(across.dot(along), a.z * b.z), (across.length_squared() - along.length_squared(), a.z * a.z - b.z * b.z)]
        {
            weight -= flat * deep;
            sum += flat * flat;
        }
    }
    // Least squares of flat / f² + deep = 0.
    (weight > 0.0 && sum > 0.0).then(|| (sum / weight).sqrt())
}

/// The board's pose under a focal length, before the camera.
fn pose(h: &DMat3, f: f64) -> Pose {
    let ray = |v: DVec3| DVec3::new(v.x / f, v.y / f, v.z);
    let (a, b, t) = (ray(h.x_axis), ray(h.y_axis), ray(h.z_axis));
    let scale = 2.0 / (a.length() + b.length()) * if t.z < 0.0 { -1.0 } else { 1.0 };
    let x = (a * scale).normalize_or(DVec3::X);
    let y = (b * scale).reject_from_normalized(x).normalize_or(x.any_orthonormal_vector());
    Pose::new(DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))), t * scale)
}
