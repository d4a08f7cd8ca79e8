//! Where the fit of a blade starts.

use glam::{DMat3, DQuat, DVec3};

use super::state::State;
use crate::axes::PrincipalAxes;
use crate::fit::centreline::{angles_along, resample};
use crate::fit::orient::turn_onto;
use crate::fit::stem::clipped;
use crate::model::leaf::{Lattice, ROWS, vein_angle};
use crate::model::{Habit, Species};
use crate::polyline::path_length;
use crate::statistics::mean;

/// Standard deviation of the course's turn from one of its 44 bones to the next, radians (a guess: a kink of 5 degrees
/// every few bones).
const COURSE_ANGLE: f64 = 0.03;
/// The main vein alone.
const VEIN: Lattice = Lattice::every(1, 21);

/// Three starts along a course, for what one cannot tell from afar. Flat: the blade spreads as its points do and
/// follows their course. Turned by a quarter, and across the plane of the course: a strap that arches within the
/// picture of a single view has points that spread along the arch, and blades hardly bow within themselves. Broad
/// blades start straight instead of turned, because the course through a folded blade is not its main vein's.
pub(super) fn along(course: &[DVec3], points: &[DVec3], up: DVec3, species: &Species) -> [State; 3] {
    let path = resample(course, ROWS);
    let chord = path[path.len() - 1] - path[0];
    let facing_up = |across: DVec3| if across.cross(chord).dot(up) < 0.0 { -across } else { across };
    let aside: Vec<DVec3> = points.iter().map(|p| *p - nearest_of(&path, *p)).collect();
    let half_width = mean(aside.iter().map(|p| p.length())).unwrap_or(0.0);
    let guess = |across: DVec3| guess(&path, half_width, facing_up(across), species);
    // The widest direction of the points about the course.
    let widest = PrincipalAxes::of(aside.iter().copied()).axes.x_axis;
    let flat = guess(widest);
    let second = if species.habit == Habit::Grass {
        guess(widest.cross(chord.normalize_or_zero()))
    } else {
        State { gamma: vec![0.0; flat.gamma.len()], ..flat.clone() }
    };
    [flat, second, guess(PrincipalAxes::of(path.iter().copied()).axes.z_axis)]
}

/// `half_width` is the mean distance of the points from the path, metres.
fn guess(path: &[DVec3], half_width: f64, across: DVec3, species: &Species) -> State {
    let metres = species.ranges.blade_length.clamp(path_length(path.iter().copied()));
    let along = (path[1] - path[0]).normalize_or(DVec3::Y);
    let x = across.reject_from_normalized(along).normalize_or(along.any_orthonormal_vector());
    let rotation = DQuat::from_mat3(&DMat3::from_cols(x, along, x.cross(along)));
    let vein = angles_along(path, rotation);
    // Of the blade's angles only the vein's are seen.
    let seen: Vec<(usize, f64)> =
        (1..ROWS).flat_map(|i| [0, 1].map(|k| (vein_angle(i) + k, vein[2 * (i - 1) + k]))).collect();
    let flat = species.leaf.flat(&[], 1.0);
    let typical = mean(flat.iter().map(|p| p.x.abs())).unwrap_or(0.0) * metres;
    let mut state = State {
        base: path[0],
        rotation,
        log_length: metres.ln(),
        log_width: species.ranges.blade_width.clamp(half_width / typical.max(1e-9)).ln(),
        beta: vec![0.0; species.leaf.shape.rank()],
        gamma: clipped(species.leaf.deform.likely(&seen, COURSE_ANGLE)),
    };
    // The basis does not hold every bend, so the vein that is left of the course's angles is turned onto the course.
    let raw = species.leaf.points(&state.blade(), VEIN);
    let vein = path.iter().zip(raw.chunks_exact(VEIN.columns())).map(|(p, row)| (*p - path[0], row[1] * metres));
    state.rotation = turn_onto(vein.chain([(x * metres, DVec3::X * metres)])).unwrap_or(rotation);
    state
}

fn nearest_of(path: &[DVec3], p: DVec3) -> DVec3 {
    path.iter().copied().min_by(|a, b| a.distance_squared(p).total_cmp(&b.distance_squared(p))).unwrap_or(p)
}
