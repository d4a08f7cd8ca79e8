//! Catmull-Rom curves through control points (paper supp. "Catmull-Rom Curve").

use glam::DVec3;

/// How knots are spaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Knots {
    /// Unit steps: the blending matrix that the paper prints, α = 0.5.
    #[default]
    Uniform,
    /// Steps of chord^0.5: the release's.
    Centripetal,
}

/// The curve through `points` with `steps` samples a segment, first and last point included:
/// `(n - 1) * steps + 1` points. Virtual end points are p0 = 2 p1 - p2 and likewise at the end.
/// Fewer than 2 points come back as they are.
#[must_use]
pub fn refine(points: &[DVec3], steps: usize, knots: Knots) -> Vec<DVec3> {
    let n = points.len();
    if n < 2 || steps < 2 {
        return points.to_vec();
    }
    let before = 2.0 * points[0] - points[1];
    let after = 2.0 * points[n - 1] - points[n - 2];
    let mut curve = Vec::with_capacity((n - 1) * steps + 1);
    for i in 0..n - 1 {
        let p = [
            if i == 0 { before } else { points[i - 1] },
            points[i],
            points[i + 1],
            if i + 2 < n { points[i + 2] } else { after },
        ];
        let (m0, m1) = tangents(&p, knots);
        curve.extend((0..steps).map(|s| hermite(p[1], p[2], m0, m1, s as f64 / steps as f64)));
    }
    curve.push(points[n - 1]);
    curve
}

/// Tangents at p1 and p2, in units of the middle segment's parameter.
fn tangents(p: &[DVec3; 4], knots: Knots) -> (DVec3, DVec3) {
    let uniform = ((p[2] - p[0]) * 0.5, (p[3] - p[1]) * 0.5);
    if knots == Knots::Uniform {
        return uniform;
    }
    let t = [0, 1, 2].map(|i| p[i].distance(p[i + 1]).sqrt());
    // Collapsed rows have chords of length 0, where centripetal knots divide by zero and uniform ones do not.
    if t.iter().any(|t| *t < 1e-9) {
        return uniform;
    }
    let slope = |a: usize, ta: f64, tb: f64| {
        (p[a + 1] - p[a]) / ta - (p[a + 2] - p[a]) / (ta + tb) + (p[a + 2] - p[a + 1]) / tb
    };
    (slope(0, t[0], t[1]) * t[1], slope(1, t[1], t[2]) * t[1])
}

fn hermite(a: DVec3, b: DVec3, ma: DVec3, mb: DVec3, t: f64) -> DVec3 {
    let (t2, t3) = (t * t, t * t * t);
    a * (2.0 * t3 - 3.0 * t2 + 1.0) + ma * (t3 - 2.0 * t2 + t) + b * (3.0 * t2 - 2.0 * t3) + mb * (t3 - t2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_pass_through_their_points_and_keep_lines_straight() {
        for knots in [Knots::Uniform, Knots::Centripetal] {
            let points: Vec<DVec3> = (0..5).map(|i| DVec3::new(f64::from(i), f64::from(i % 2), 0.3)).collect();
            let curve = refine(&points, 4, knots);
            assert_eq!(curve.len(), 17);
            for (i, p) in points.iter().enumerate() {
                assert!(curve[4 * i].distance(*p) < 1e-12);
            }
            let line: Vec<DVec3> = (0..4).map(|i| DVec3::splat(f64::from(i))).collect();
            for (i, p) in refine(&line, 5, knots).iter().enumerate() {
                assert!(p.distance(DVec3::splat(i as f64 / 5.0)) < 1e-12, "{knots:?}");
            }
        }
        let collapsed = vec![DVec3::ONE; 4];
        assert!(refine(&collapsed, 3, Knots::Centripetal).iter().all(|p| p.is_finite()));
    }
}
