//! A plant's parameters: a tree of organs, each hung on its parent (paper 3.1, Γ and θ).

use demeter_frame::Pose;
use glam::DQuat;

use super::leaf::Blade;

/// What an organ is. The paper's root is implicit: organ 0 is the one main stem that hangs on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum OrganKind {
    /// The stem that stands on the ground.
    MainStem = 0,
    /// A branch, petiole, rachis or petiolule.
    Stem = 1,
    /// A leaf's blade or one leaflet of a compound leaf.
    Leaf = 2,
}

/// How an organ hangs on its parent: θ = (τ, d, s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Attachment d in [0, 1]: fraction of the parent's path length.
    pub d: f64,
    /// Rotation R(τ) relative to the parent's frame at d, `[x, y, z, w]`, w >= 0.
    pub rotation: DQuat,
    /// Size s > 0 relative to the parent's; the main stem's is its path length in metres.
    pub scale: f64,
}

/// An organ's own form, in its own frame and unit size.
#[derive(Clone, Debug, PartialEq)]
pub enum Form {
    /// A stem of unit path length.
    Stem {
        /// Deformation in σ.
        gamma: Vec<f64>,
        /// Radius in units of the stem's path length.
        radius: f64,
    },
    /// A blade of unit chord when flat.
    Leaf {
        /// Shape and deformation.
        blade: Blade,
        /// Which leaf the blade belongs to; leaflets of one compound leaf share it.
        leaf: u16,
    },
}

/// One node of the tree.
#[derive(Clone, Debug, PartialEq)]
pub struct Organ {
    /// Index of the parent, `None` for the main stem alone.
    pub parent: Option<usize>,
    /// How it hangs there.
    pub joint: Joint,
    /// What it looks like.
    pub form: Form,
}

/// A whole plant: parents stand before children.
#[derive(Clone, Debug, PartialEq)]
pub struct Plant {
    /// Where the plant stands: the plant frame has its origin at the main stem's base, z up.
    pub world_from_plant: Pose,
    /// Organ 0 is the main stem.
    pub organs: Vec<Organ>,
}

/// What makes a set of organs no plant; every variant names the organ.
#[derive(Clone, Debug, thiserror::Error, PartialEq)]
pub enum PlantError {
    /// No organ at all.
    #[error("a plant needs a main stem, found no organ")]
    Empty,
    /// Organ 0 is not a stem on the root, or another organ hangs there too.
    #[error("organ {organ}: expected exactly one main stem, first and on the root, found {found}")]
    MainStem {
        /// The organ at fault.
        organ: usize,
        /// What it is.
        found: &'static str,
    },
    /// A parent that does not stand before its child: a cycle, a dangling parent or a wrong order.
    #[error("organ {organ}: expected a parent before it, found {found}")]
    Parent {
        /// The organ at fault.
        organ: usize,
        /// Its parent.
        found: usize,
    },
    /// A leaf with a child.
    #[error("organ {organ}: a leaf has no children, but its parent {parent} is a leaf")]
    LeafParent {
        /// The child.
        organ: usize,
        /// The leaf.
        parent: usize,
    },
    /// A parameter outside its meaning.
    #[error("organ {organ}: {key} must be {expected}, found {found}")]
    Value {
        /// The organ at fault.
        organ: usize,
        /// The parameter.
        key: &'static str,
        /// What it must be.
        expected: &'static str,
        /// What it is.
        found: f64,
    },
    /// More organs than a record holds.
    #[error("expected at most {expected} organs, found {found}")]
    TooMany {
        /// The bound.
        expected: usize,
        /// How many.
        found: usize,
    },
}

impl Organ {
    /// The organ's kind; only organ 0 has no parent.
    #[must_use]
    pub fn kind(&self) -> OrganKind {
        match (&self.form, self.parent) {
            (Form::Leaf { .. }, _) => OrganKind::Leaf,
            (Form::Stem { .. }, None) => OrganKind::MainStem,
            (Form::Stem { .. }, Some(_)) => OrganKind::Stem,
        }
    }
}

impl Plant {
    /// Most organs a plant may have: a bound for records and loops (a field soybean has under 200).
    pub const MAX_ORGANS: usize = 4096;

    /// Checks topology and parameters.
    ///
    /// # Errors
    /// [`PlantError`] naming the first organ at fault.
    pub fn validate(&self) -> Result<(), PlantError> {
        if self.organs.is_empty() {
            return Err(PlantError::Empty);
        }
        if self.organs.len() > Self::MAX_ORGANS {
            return Err(PlantError::TooMany { expected: Self::MAX_ORGANS, found: self.organs.len() });
        }
        for (i, organ) in self.organs.iter().enumerate() {
            match (i, organ.parent, organ.kind()) {
                (0, None, OrganKind::MainStem) => {}
                (0, Some(_), _) => return Err(PlantError::MainStem { organ: 0, found: "an organ with a parent" }),
                (0, None, _) => return Err(PlantError::MainStem { organ: 0, found: "a leaf" }),
                (_, None, _) => return Err(PlantError::MainStem { organ: i, found: "a second root" }),
                (_, Some(parent), _) if parent >= i => return Err(PlantError::Parent { organ: i, found: parent }),
                (_, Some(parent), _) if self.organs[parent].kind() == OrganKind::Leaf => {
                    return Err(PlantError::LeafParent { organ: i, parent });
                }
                _ => {}
            }
            organ.validate(i)?;
        }
        Ok(())
    }

    /// Indices of the children of each organ, in storage order.
    #[must_use]
    pub fn children(&self) -> Vec<Vec<usize>> {
        let mut children = vec![Vec::new(); self.organs.len()];
        for (i, organ) in self.organs.iter().enumerate() {
            if let Some(parent) = organ.parent {
                children[parent].push(i);
            }
        }
        children
    }
}

impl Organ {
    fn validate(&self, organ: usize) -> Result<(), PlantError> {
        let check = |key, expected, found: f64, good: bool| {
            if good { Ok(()) } else { Err(PlantError::Value { organ, key, expected, found }) }
        };
        let Joint { d, rotation, scale } = self.joint;
        check("d", "in 0..=1", d, (0.0..=1.0).contains(&d))?;
        check("scale", "finite and above 0", scale, scale.is_finite() && scale > 0.0)?;
        let norm = rotation.length();
        check("rotation", "a unit quaternion", norm, (norm - 1.0).abs() < 1e-6)?;
        let (coefficients, key, size) = match &self.form {
            Form::Stem { gamma, radius } => (vec![gamma], "radius", *radius),
            Form::Leaf { blade, .. } => (vec![&blade.beta, &blade.gamma], "width", blade.width),
        };
        check(key, "finite and above 0", size, size.is_finite() && size > 0.0)?;
        let worst = coefficients.into_iter().flatten().copied().find(|c| c.is_nan() || c.abs() > 10.0);
        check("coefficients", "within 10 standard deviations", worst.unwrap_or(0.0), worst.is_none())
    }
}
