use glam::{DMat2, DVec2};
use serde::{Deserialize, Serialize};

/// How a lens bends a pinhole's picture. Directions are points of the plane one metre before the camera: x right, y down.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "snake_case", deny_unknown_fields)]
pub enum Distortion {
    /// Brown and Conrady's polynomial, `plumb_bob` in ROS and `radtan` in Kalibr: k1, k2, p1, p2, k3 as OpenCV orders them.
    PlumbBob {
        /// Two radial coefficients, two tangential ones, the third radial one.
        coefficients: [f64; 5],
    },
    /// Kannala and Brandt's fisheye, OpenCV's `fisheye`: the angle to the axis times a polynomial in its square.
    Equidistant {
        /// k1 to k4.
        coefficients: [f64; 4],
    },
}

impl Distortion {
    /// The model's name, as in files.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::PlumbBob { .. } => "plumb_bob",
            Self::Equidistant { .. } => "equidistant",
        }
    }

    /// The coefficients, in the order of the model.
    #[must_use]
    pub fn coefficients(&self) -> &[f64] {
        match self {
            Self::PlumbBob { coefficients } => coefficients,
            Self::Equidistant { coefficients } => coefficients,
        }
    }

    /// Where a direction goes, and the derivative by the direction.
    #[must_use]
    pub fn bend(&self, p: DVec2) -> (DVec2, DMat2) {
        let (r2, p_pt) = (p.length_squared(), DMat2::from_cols(p * p.x, p * p.y));
        match *self {
            Self::PlumbBob { coefficients: [k1, k2, p1, p2, k3] } => {
                let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
                let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
                // The tangential part is |p|² t + 2 (t·p) p.
                let t = DVec2::new(p2, p1);
                let along = 2.0 * t.dot(p);
                let tangential = DMat2::from_cols(t * (2.0 * p.x) + p * (2.0 * t.x), t * (2.0 * p.y) + p * (2.0 * t.y));
                (
                    p * (radial + along) + t * r2,
                    p_pt * slope + DMat2::from_diagonal(DVec2::splat(radial + along)) + tangential,
                )
            }
            Self::Equidistant { .. } => {
                let r = r2.sqrt();
                if r < 1e-9 {
                    return (p, DMat2::IDENTITY);
                }
                let (bent, slope) = self.radius(r);
                let scale = bent / r;
                (p * scale, p_pt * ((slope - scale) / r2) + DMat2::from_diagonal(DVec2::splat(scale)))
            }
        }
    }

    /// What each coefficient adds to where a direction goes (both models are linear in theirs); zero beyond the last.
    #[must_use]
    pub fn shares(&self, p: DVec2) -> [DVec2; 5] {
        let r2 = p.length_squared();
        match self {
            Self::PlumbBob { .. } => {
                let xy = 2.0 * p.x * p.y;
                let (p1, p2) = (DVec2::new(xy, r2 + 2.0 * p.y * p.y), DVec2::new(r2 + 2.0 * p.x * p.x, xy));
                [p * r2, p * (r2 * r2), p1, p2, p * (r2 * r2 * r2)]
            }
            Self::Equidistant { .. } => {
                let angle = r2.sqrt().atan();
                let (unit, square) = (p.normalize_or_zero() * angle, angle * angle);
                [1, 2, 3, 4, 0].map(|power| if power == 0 { DVec2::ZERO } else { unit * square.powi(power) })
            }
        }
    }

    /// The bent radius of a radius `r` without the tangential part, and its derivative by `r`.
    fn radius(&self, r: f64) -> (f64, f64) {
        match *self {
            Self::PlumbBob { coefficients: [k1, k2, _, _, k3] } => {
                let s = r * r;
                let slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3));
                (r * (1.0 + s * (k1 + s * (k2 + s * k3))), slope)
            }
            Self::Equidistant { coefficients: [k1, k2, k3, k4] } => {
                let angle = r.atan();
                let s = angle * angle;
                let slope = 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * (7.0 * k3 + s * 9.0 * k4)));
                (angle * (1.0 + s * (k1 + s * (k2 + s * (k3 + s * k4)))), slope / (1.0 + s.sqrt().tan().powi(2)))
            }
        }
    }

    /// How far from the axis the model holds: the radius, at most `farthest`, at which the picture would fold back upon
    /// itself.
    #[must_use]
    pub fn reach(&self, farthest: f64) -> f64 {
        /// Steps from the axis outwards: a fold narrower than one of them is passed over, and bends by less than a pixel.
        const STEPS: u32 = 512;
        let radius = |step: u32| farthest * f64::from(step) / f64::from(STEPS);
        let grows = |step: &u32| self.radius(radius(*step)).1 > 0.0;
        (1..=STEPS).take_while(grows).last().map_or(0.0, radius)
    }

    /// The direction within `reach` of the axis that is bent to `bent`: the inverse of [`Self::bend`], by Newton's method.
    /// `None` where no direction is.
    #[must_use]
    pub fn unbend(&self, bent: DVec2, reach: f64) -> Option<DVec2> {
        /// Newton's method needs fewer than ten but near a fold.
        const STEPS: usize = 50;
        /// How near is near enough: a thousandth of a millionth of a pixel at focal lengths of a thousand pixels.
        const NEAR: f64 = 1e-12;
        let mut p = bent.clamp_length_max(reach);
        for _ in 0..STEPS {
            let (at, slope) = self.bend(p);
            let miss = bent - at;
            if miss.length() <= NEAR * (1.0 + bent.length()) {
                return Some(p);
            }
            let next = p + slope.inverse() * miss;
            // Beyond the fold there is another, wrong answer.
            p = if next.length() <= reach { next } else { p.lerp(next.clamp_length_max(reach), 0.5) };
            if !p.is_finite() {
                return None;
            }
        }
        None
    }
}
