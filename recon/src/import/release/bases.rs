//! The release's linear bases: leaf shapes in the plane, leaves and stems in space.

use glam::{DVec2, DVec3};

use super::ReleaseError;
use super::archive::Archive;
use crate::model::leaf::{self, COLUMNS, ROWS, Side, VEIN, node};
use crate::model::stem;

/// Names of the files of a species of the release: shapes, leaves, stems.
pub const FILES: [&str; 3] = ["2d_leaf_pca.pth", "3d_leaf_pca.pth", "3d_stem_pca.pth"];
/// Shape coefficients beyond this many σ are cut to it (spec/demeter-model.md "Leaf template").
const MAX_SHAPE: f64 = 5.0;
/// Most components of a basis: 20 times the release's.
const MAX_COMPONENTS: usize = 400;

/// A basis: `mean + Σ c_k component_k`.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    /// σ of each coefficient.
    pub sigma: Vec<f64>,
    /// `[N]`.
    mean: Vec<f64>,
    /// `[K][N]`.
    components: Vec<f64>,
}

/// The release's bases of a species.
#[derive(Clone, Debug)]
pub struct Bases {
    pub(super) shape: Linear,
    pub(super) leaf: Linear,
    pub(super) stem: Linear,
    /// The mean leaf in the plane.
    flat: Vec<DVec2>,
}

impl Linear {
    fn read(file: &str, bytes: &[u8], outputs: usize) -> Result<Self, ReleaseError> {
        let archive = Archive::read(file, bytes)?;
        let sigma = archive.any("coeff_std")?.to_vec();
        if sigma.is_empty() || sigma.len() > MAX_COMPONENTS {
            let found = format!("{} of them", sigma.len());
            return Err(ReleaseError::tensor(file, "coeff_std", "1 to 400 numbers", found));
        }
        Ok(Self {
            mean: archive.numbers("data_mean", outputs)?.to_vec(),
            components: archive.numbers("components", sigma.len() * outputs)?.to_vec(),
            sigma,
        })
    }

    /// The output at coefficients in the units of the output.
    fn at(&self, coefficients: impl Iterator<Item = f64>) -> Vec<f64> {
        let mut output = self.mean.clone();
        for (c, component) in coefficients.zip(self.components.chunks_exact(self.mean.len())) {
            for (output, x) in output.iter_mut().zip(component) {
                *output += c * x;
            }
        }
        output
    }
}

impl Bases {
    /// Reads the three files of [`FILES`].
    ///
    /// # Errors
    /// [`ReleaseError`] naming the file and the tensor.
    pub fn read([shape, leaf, stem]: [&[u8]; 3]) -> Result<Self, ReleaseError> {
        let shape = Linear::read(FILES[0], shape, leaf::POINTS * 2)?;
        let leaf = Linear::read(FILES[1], leaf, leaf::POINTS * 3)?;
        let stem = Linear::read(FILES[2], stem, stem::POINTS * 3)?;
        let flat = in_plane(&shape.mean);
        Ok(Self { shape, leaf, stem, flat })
    }

    /// The flat leaf of shape coefficients in σ: our layout, the release's size (about 0.93 long).
    #[must_use]
    pub fn flat(&self, beta: &[f64]) -> Vec<DVec2> {
        let scaled = beta.iter().zip(&self.shape.sigma).map(|(b, sigma)| b.clamp(-MAX_SHAPE, MAX_SHAPE) * sigma);
        in_plane(&self.shape.at(scaled))
    }

    /// The leaf that the release decodes, in its own frame: bones as long as in `flat`, in the directions of the
    /// 3D basis turned about z by as much as `flat`'s bones are turned from the mean leaf's.
    #[must_use]
    pub fn leaf(&self, flat: &[DVec2], deform: &[f64]) -> Vec<DVec3> {
        let bent = from_release(self.leaf.at(deform.iter().copied()).as_chunks::<3>().0);
        let bent: Vec<DVec3> = bent.into_iter().map(DVec3::from_array).collect();
        build(|to, from| {
            let (rest, bone) = (self.flat[to] - self.flat[from], flat[to] - flat[from]);
            let direction = (bent[to] - bent[from]).normalize_or_zero();
            let turned = DVec2::new(rest.x, -rest.y).normalize_or(DVec2::X).rotate(bone.normalize_or(DVec2::X));
            turned.rotate(direction.truncate()).extend(direction.z) * bone.length()
        })
    }

    /// The stem that the release decodes, in its own frame: base at 0, end near +z.
    #[must_use]
    pub fn stem(&self, deform: &[f64]) -> Vec<DVec3> {
        self.stem.at(deform.iter().copied()).as_chunks::<3>().0.iter().map(|p| DVec3::from_array(*p)).collect()
    }
}

/// A leaf's points from its bones: `bone(to, from)` along the main vein and out along each row. All rows have ribs,
/// also the collapsed ones.
fn build(bone: impl Fn(usize, usize) -> DVec3) -> Vec<DVec3> {
    let mut points = vec![DVec3::ZERO; leaf::POINTS];
    for i in 0..ROWS {
        let vein = node(i, VEIN);
        if i > 0 {
            points[vein] = points[node(i - 1, VEIN)] + bone(vein, node(i - 1, VEIN));
        }
        for side in Side::BOTH {
            for k in 1..=VEIN {
                let (to, from) = (node(i, side.column(k)), node(i, side.column(k - 1)));
                points[to] = points[from] + bone(to, from);
            }
        }
    }
    points
}

/// The plane's basis keeps `[45 rows][43 columns]`, its column 0 at x > 0, where ours is 42.
fn in_plane(xy: &[f64]) -> Vec<DVec2> {
    let rows = xy.as_chunks::<2>().0.chunks_exact(COLUMNS);
    rows.flat_map(|row| row.iter().rev().map(|p| DVec2::from_array(*p))).collect()
}

/// Leaves in space are kept `[43 columns][45 rows]`, columns again from x > 0.
pub(super) fn from_release<T: Copy>(points: &[T]) -> Vec<T> {
    let at = |row: usize, column: usize| points[(COLUMNS - 1 - column) * ROWS + row];
    (0..leaf::POINTS).map(|n| at(n / COLUMNS, n % COLUMNS)).collect()
}
