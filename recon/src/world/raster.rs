//! The z-buffer: which face each pixel sees.

use glam::{Vec2, Vec3};

use super::Texture;

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
    pub(crate) fn fill(&mut self, corners: [Vec3; 3], face: u32) {
        self.fill_where(corners, face, |_| true);
    }

    /// As [`Self::fill`], only where `solid` says so of the corners' weights in the picture.
    fn fill_where(&mut self, [a, b, c]: [Vec3; 3], face: u32, solid: impl Fn([f32; 3]) -> bool) {
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
                if key > self.key[n] && solid([1.0 - v - w, v, w]) {
                    self.key[n] = key;
                    self.face[n] = face;
                }
            }
        }
    }

    /// Draws a triangle of the camera frame in perspective with focal lengths and centre in pixels; the key is 1/z.
    /// What lies nearer than [`NEAR`] is cut off.
    pub(crate) fn fill_perspective(&mut self, corners: [Vec3; 3], lens: [f32; 4], face: u32) {
        self.perspective(corners.map(|at| (at, Vec2::ZERO)), lens, |buffer, corners| {
            buffer.fill(corners.map(|(at, _)| at), face);
        });
    }

    /// As [`Self::fill`], only where the texture is solid; uv is linear in the picture.
    pub(super) fn fill_cut(&mut self, corners: [Vec3; 3], face: u32, (texture, uvs): (&Texture, [Vec2; 3])) {
        self.fill_where(corners, face, |w| texture.is_solid(uvs[0] * w[0] + uvs[1] * w[1] + uvs[2] * w[2]));
    }

    /// As [`Self::fill_perspective`], only where the texture is solid.
    pub(super) fn fill_perspective_cut(
        &mut self,
        corners: [Vec3; 3],
        lens: [f32; 4],
        face: u32,
        (texture, uvs): (&Texture, [Vec2; 3]),
    ) {
        let corners = [0, 1, 2].map(|i| (corners[i], uvs[i]));
        self.perspective(corners, lens, |buffer, corners| {
            // uv / z and 1 / z are linear in the picture, uv is not.
            let uvs = corners.map(|(at, uv)| (uv * at.z).extend(at.z));
            buffer.fill_where(corners.map(|(at, _)| at), face, |w| {
                let uv = uvs[0] * w[0] + uvs[1] * w[1] + uvs[2] * w[2];
                texture.is_solid(uv.truncate() / uv.z)
            });
        });
    }

    /// Cuts a triangle at the near plane and hands its one or two projected rests to `draw`.
    fn perspective(
        &mut self,
        corners: [(Vec3, Vec2); 3],
        [fx, fy, cx, cy]: [f32; 4],
        draw: impl Fn(&mut Self, [(Vec3, Vec2); 3]),
    ) {
        let project = |(p, uv): (Vec3, Vec2)| (Vec3::new(fx * p.x / p.z + cx, fy * p.y / p.z + cy, 1.0 / p.z), uv);
        let behind = corners.iter().filter(|(p, _)| p.z < NEAR).count();
        if behind == 0 {
            return draw(self, corners.map(project));
        }
        if behind == 3 {
            return;
        }
        let mut cut = [(Vec3::ZERO, Vec2::ZERO); 4];
        let mut count = 0;
        for i in 0..3 {
            let ((p, p_uv), (q, q_uv)) = (corners[i], corners[(i + 1) % 3]);
            if p.z >= NEAR {
                cut[count] = (p, p_uv);
                count += 1;
            }
            if (p.z >= NEAR) != (q.z >= NEAR) {
                let share = (NEAR - p.z) / (q.z - p.z);
                cut[count] = (p.lerp(q, share), p_uv.lerp(q_uv, share));
                count += 1;
            }
        }
        for i in 2..count {
            draw(self, [cut[0], cut[i - 1], cut[i]].map(project));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENS: [f32; 4] = [50.0, 50.0, 32.0, 32.0];

    /// A leaf of whose 10 x 10 texels the left half and one more are solid.
    fn half() -> Texture {
        let solid = |x: u32, y: u32| if x < 5 || (x, y) == (7, 2) { 255 } else { 0 };
        let picture = image::RgbaImage::from_fn(10, 10, |x, y| image::Rgba([0, 99, 0, solid(x, y)]));
        Texture::new(&picture).expect("some of it is solid")
    }

    #[test]
    fn a_cut_leaf_covers_the_area_that_its_picture_shows() {
        let at = |x: f32, y: f32| Vec3::new(x, y, 1.0);
        let uv = |x: f32, y: f32| Vec2::new(x, y);
        let quad = [at(-0.4, -0.4), at(0.4, -0.4), at(0.4, 0.4), at(-0.4, 0.4)];
        let uvs = [uv(0.0, 0.0), uv(1.0, 0.0), uv(1.0, 1.0), uv(0.0, 1.0)];
        let covered = |tilt: f32| {
            let mut buffer = Buffer::new(400, 400, 0.0);
            for k in [[0, 1, 2], [0, 2, 3]] {
                let corners = k.map(|i| quad[i] + Vec3::Z * tilt * quad[i].x);
                buffer.fill_perspective_cut(corners, [300.0, 300.0, 200.0, 200.0], 1, (&half(), k.map(|i| uvs[i])));
            }
            let drawn = |x: std::ops::Range<usize>| {
                (0..400)
                    .flat_map(|y| x.clone().map(move |x| (x, y)))
                    .filter(|(x, y)| buffer.face[y * 400 + x] == 1)
                    .count()
            };
            (drawn(0..200), drawn(200..400))
        };
        // 240 x 240 pixels, 51 of 100 texels.
        assert_eq!(covered(0.0), (240 * 120, 24 * 24));
        // Turned away, the texture's middle stays where the quad's middle is: only perspective-correct uv does that.
        let (left, right) = covered(0.9);
        let whole_left: f32 = 300.0 * 300.0 * 0.5 * (0.4 / 0.64) * (0.8 + 0.8 / 0.64);
        assert!((left as f32 / whole_left - 1.0).abs() < 0.01, "{left} {whole_left}");
        assert!(right > 100 && right < 24 * 24, "{right}");
    }

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
