//! The z-buffer: which face each pixel sees.

use glam::Vec3;

/// No face.
pub(crate) const NONE: u32 = u32::MAX;

/// Nearer than this nothing is drawn, metres.
const NEAR: f32 = 0.02;

/// The face that wins each pixel, and its key (inverse depth, or height towards the light).
pub(crate) struct Buffer {
    pub width: usize,
    pub height: usize,
    pub face: Vec<u32>,
    pub key: Vec<f32>,
}

impl Buffer {
    pub(crate) fn new(width: usize, height: usize, empty: f32) -> Self {
        Self { width, height, face: vec![NONE; width * height], key: vec![empty; width * height] }
    }

    /// Draws a triangle of (x, y in pixels, key); where it covers a pixel's centre the larger key wins.
    pub(crate) fn fill(&mut self, [a, b, c]: [Vec3; 3], face: u32) {
        let area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        if !(area.abs() > 1e-12 && area.is_finite()) {
            return;
        }
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        // Centres of pixel x lie at x + 0.5; float to integer casts saturate.
        let x0 = (low.x - 0.5).ceil().max(0.0) as usize;
        let y0 = (low.y - 0.5).ceil().max(0.0) as usize;
        let x1 = ((high.x - 0.5).floor() + 1.0).clamp(0.0, self.width as f32) as usize;
        let y1 = ((high.y - 0.5).floor() + 1.0).clamp(0.0, self.height as f32) as usize;
        if x0 >= x1 || y0 >= y1 {
            return;
        }
        let inverse = 1.0 / area;
        // Barycentric weights of b and c are linear in x and y.
        let (bx, by) = ((c.y - a.y) * inverse, -(c.x - a.x) * inverse);
        let (cx, cy) = (-(b.y - a.y) * inverse, (b.x - a.x) * inverse);
        for y in y0..y1 {
            let dy = y as f32 + 0.5 - a.y;
            let mut inside = false;
            for x in x0..x1 {
                let dx = x as f32 + 0.5 - a.x;
                let (v, w) = (bx * dx + by * dy, cx * dx + cy * dy);
                if v < 0.0 || w < 0.0 || v + w > 1.0 {
                    // A row of a triangle is one run.
                    if inside {
                        break;
                    }
                    continue;
                }
                inside = true;
                let key = a.z + v * (b.z - a.z) + w * (c.z - a.z);
                let n = y * self.width + x;
                if key > self.key[n] {
                    self.key[n] = key;
                    self.face[n] = face;
                }
            }
        }
    }

    /// Draws a triangle of the camera frame in perspective with focal lengths and centre in pixels; the key is 1/z.
    /// What lies nearer than [`NEAR`] is cut off.
    pub(crate) fn fill_perspective(&mut self, corners: [Vec3; 3], [fx, fy, cx, cy]: [f32; 4], face: u32) {
        let project = |p: Vec3| Vec3::new(fx * p.x / p.z + cx, fy * p.y / p.z + cy, 1.0 / p.z);
        let behind = corners.iter().filter(|p| p.z < NEAR).count();
        if behind == 0 {
            return self.fill(corners.map(project), face);
        }
        if behind == 3 {
            return;
        }
        let mut cut = [Vec3::ZERO; 4];
        let mut count = 0;
        for i in 0..3 {
            let (p, q) = (corners[i], corners[(i + 1) % 3]);
            if p.z >= NEAR {
                cut[count] = p;
                count += 1;
            }
            if (p.z >= NEAR) != (q.z >= NEAR) {
                cut[count] = p.lerp(q, (NEAR - p.z) / (q.z - p.z));
                count += 1;
            }
        }
        for i in 2..count {
            self.fill([cut[0], cut[i - 1], cut[i]].map(project), face);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: [f32; 4] = [50.0, 50.0, 32.0, 32.0];

    #[test]
    fn nearer_faces_win_in_any_order_and_cut_ones_stay_in_bounds() {
        let square = |z: f32| [Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z)];
        for order in [[1.0, 2.0], [2.0, 1.0]] {
            let mut buffer = Buffer::new(64, 64, 0.0);
            for z in order {
                buffer.fill_perspective(square(z), LENS, z as u32);
            }
            assert_eq!(buffer.face[32 * 64 + 32], 1);
        }
        // A floor that passes under the camera is cut at the near plane and fills the lower half alone.
        let mut buffer = Buffer::new(64, 64, 0.0);
        let floor = [Vec3::new(-90.0, 1.0, -50.0), Vec3::new(90.0, 1.0, -50.0), Vec3::new(0.0, 1.0, 90.0)];
        buffer.fill_perspective(floor, LENS, 7);
        assert_eq!(buffer.face[10 * 64 + 32], NONE);
        assert_eq!(buffer.face[60 * 64 + 32], 7);
        let z = 1.0 / buffer.key[60 * 64 + 32];
        assert!((z - 50.0 / 28.5).abs() < 1e-3, "{z}");
    }
}
