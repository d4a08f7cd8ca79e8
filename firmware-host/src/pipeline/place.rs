//! Where on Earth a plant stands: the antenna's fix, the way from there to the camera, and from there to the plant.

use demeter_capture::Fix;
use glam::DVec2;
use serde_json::{Value, json};

/// WGS 84: the equator's radius, metres, and the square of the eccentricity.
const RADIUS: f64 = 6_378_137.0;
const ECCENTRICITY_2: f64 = 6.694_379_990_14e-3;

/// Slower than this, metres a second, a receiver's course is noise (a guess): what it was before is not known here.
const SLOW: f64 = 0.2;

/// A plant beside the camera that saw it best, in the session's world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Beside {
    /// The plant from the camera, metres.
    pub plant: DVec2,
    /// The direction of the drive, of unit length, where the rig moved.
    pub forward: Option<DVec2>,
    /// The camera from the antenna, metres: forwards and to the left.
    pub arm: [f64; 2],
}

/// A place on Earth and what it rests on.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    /// Latitude and longitude, WGS 84 degrees.
    pub geographic: [f64; 2],
    /// For the plant's provenance: how it was found and how good it is.
    pub provenance: Value,
}

/// The place of a plant. Without a heading it is the antenna's, and less accurate by as much as the plant is away.
pub(super) fn place(antenna: &Fix, beside: &Beside) -> Place {
    let moving = antenna.speed_m_per_s.is_none_or(|speed| speed >= SLOW);
    let heading = antenna.course_deg.filter(|_| moving).zip(beside.forward);
    let arm = DVec2::from(beside.arm);
    let (north_east, error) = match heading {
        Some((course, forward)) => {
            let along = DVec2::new(beside.plant.dot(forward), forward.perp_dot(beside.plant)) + arm;
            let (sin, cos) = course.to_radians().sin_cos();
            (DVec2::new(along.x * cos + along.y * sin, along.x * sin - along.y * cos), 0.0)
        }
        None => (DVec2::ZERO, arm.length() + beside.plant.length()),
    };
    let accuracy = antenna.accuracy_m.map(|metres| metres + error);
    let heading = heading.map(|(course, _)| course);
    Place {
        geographic: moved(antenna, north_east),
        provenance: json!({
            "quality": antenna.quality, "accuracy_m": accuracy, "altitude_m": antenna.altitude_m, "heading_deg": heading
        }),
    }
}

/// Latitude and longitude so many metres to the north and the east, by the radii of the ellipsoid there.
fn moved(from: &Fix, north_east: DVec2) -> [f64; 2] {
    let (sin, cos) = from.latitude_deg.to_radians().sin_cos();
    let curved = 1.0 - ECCENTRICITY_2 * sin * sin;
    let meridian = RADIUS * (1.0 - ECCENTRICITY_2) / curved.powf(1.5);
    // At the poles themselves there is no east.
    let parallel = (RADIUS / curved.sqrt() * cos).max(1.0);
    let latitude = (from.latitude_deg + (north_east.x / meridian).to_degrees()).clamp(-90.0, 90.0);
    let longitude = from.longitude_deg + (north_east.y / parallel).to_degrees();
    [latitude, (longitude + 180.0).rem_euclid(360.0) - 180.0]
}

#[cfg(test)]
mod tests {
    use demeter_capture::Quality;

    use super::*;

    fn fix(course: Option<f64>) -> Fix {
        Fix {
            t_mono_ns: 0,
            boot_id: None,
            time: None,
            quality: Quality::RtkFixed,
            latitude_deg: 50.0,
            longitude_deg: 7.0,
            altitude_m: Some(100.0),
            accuracy_m: Some(0.02),
            altitude_accuracy_m: None,
            speed_m_per_s: Some(1.0),
            course_deg: course,
        }
    }

    /// Metres to the north and to the east of the fix: a degree at 50 degrees north is 111.229 km and 71.696 km there.
    fn off(beside: &Beside, course: Option<f64>) -> [f64; 2] {
        let [latitude, longitude] = place(&fix(course), beside).geographic;
        [(latitude - 50.0) * 111_229.0, (longitude - 7.0) * 71_696.0]
    }

    #[test]
    fn a_plant_lies_where_heading_and_both_arms_put_it() {
        // The world's x is the drive; the plant is a metre to the left of a camera two metres behind the antenna.
        let beside = Beside { plant: DVec2::new(0.0, 1.0), forward: Some(DVec2::X), arm: [-2.0, 0.0] };
        for (course, expected) in [(0.0, [-2.0, -1.0]), (90.0, [1.0, -2.0]), (180.0, [2.0, 1.0]), (270.0, [-1.0, 2.0])]
        {
            let found = off(&beside, Some(course));
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-3), "{course}: {found:?}");
        }
        // Cameras that look to the right drive against the world's x.
        let right = Beside { forward: Some(-DVec2::X), ..beside };
        assert!(off(&right, Some(0.0)).iter().zip([-2.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-3));
    }

    #[test]
    fn without_a_heading_the_place_is_the_antennas_and_says_how_far_off_it_may_be() {
        let beside = Beside { plant: DVec2::new(0.0, 1.0), forward: Some(DVec2::X), arm: [-2.0, 0.0] };
        let still = Fix { speed_m_per_s: Some(0.01), ..fix(Some(90.0)) };
        for (antenna, beside) in
            [(fix(None), beside), (fix(Some(1.0)), Beside { forward: None, ..beside }), (still, beside)]
        {
            let place = place(&antenna, &beside);
            assert_eq!(place.geographic, [50.0, 7.0]);
            assert!((place.provenance["accuracy_m"].as_f64().unwrap() - 3.02).abs() < 1e-9);
            assert_eq!(
                (&place.provenance["quality"], &place.provenance["heading_deg"]),
                (&"rtk_fixed".into(), &Value::Null)
            );
        }
        let date_line = Fix { longitude_deg: 179.999_999_9, ..fix(Some(0.0)) };
        let east = Beside { plant: DVec2::new(0.0, -100.0), ..beside };
        assert!(place(&date_line, &east).geographic[1] < -179.9, "the longitude goes on behind the date line");
    }
}
