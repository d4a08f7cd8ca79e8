//! Plants stand on the ground: a place that a wrong depth cannot move.

use glam::{DVec2, DVec3};

use super::{PlantView, View};

/// Largest factor between the depth where the ray to a plant's foot meets the ground and the depth that was lifted:
/// beyond it the lowest part that is seen is no foot, because something hides the foot (a guess).
const MOST: f64 = 1.5;

impl PlantView {
    /// Moves the plant along its rays until its foot stands on the ground z = 0 under the camera's ray to it, so that
    /// neither its place nor its size keeps the depth network's error. Without a pose, without a stem that was seen,
    /// or when the foot cannot be what is seen, the plant stays as it is.
    #[must_use]
    pub fn anchored(mut self, view: &View<'_>) -> Self {
        let (Some(pose), Some(pixel)) = (view.world_from_camera, self.base_pixel) else { return self };
        let (x, y) = (pixel % view.intrinsics.width, pixel / view.intrinsics.width);
        // The ray has z = 1 in the camera, so its parameter is depth. A pixel's lower edge is where a stem ends.
        let ray = pose.rotation * view.intrinsics.unproject(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 1.0), 1.0);
        let on_ground = -pose.translation.z / ray.z;
        let lifted = pose.inverse().point(self.base).z;
        let factor = on_ground / lifted;
        if !(factor.is_finite() && (1.0 / MOST..=MOST).contains(&factor)) {
            return self;
        }
        let moved = |p: DVec3| pose.translation + (p - pose.translation) * factor;
        for point in self.organs.iter_mut().flat_map(|organ| &mut organ.points) {
            *point = moved(*point);
        }
        self.base = moved(self.base);
        self
    }
}
