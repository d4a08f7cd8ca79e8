//! A fitted plant of the release: its tree in `info/`, its parameters in `graph.pkl`.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};

use super::ReleaseError;
use super::archive::Archive;
use super::bases::from_release;
use crate::model::{Plant, leaf, stem};

/// Files of a plant's folder: classes, parents, parameters.
pub const PLANT_FILES: [&str; 3] = ["info/class.txt", "info/parent.txt", "graph.pkl"];
/// `info/class.txt` calls leaves 0 and stems 1; other classes have no parameters and are left out.
const LEAF: u32 = 0;
const STEM: u32 = 1;

/// One organ as the release stores it.
#[derive(Clone, Debug, PartialEq)]
pub struct ReleaseOrgan {
    /// Its number in the release.
    pub node: u32,
    /// Index of its parent among the organs, `None` for the main stem.
    pub parent: Option<usize>,
    /// Attachment: fraction of the parent's bones, by count; above 1 means 1.
    pub d: f64,
    /// Size in the release's unit, not relative to the parent; a negative one also reflects the organ at its base.
    pub scale: f64,
    /// `M_quat` as a unit quaternion; the release turns row vectors with it.
    pub rotation: DQuat,
    /// Coefficients of the 3D basis, in its units.
    pub deform: Vec<f64>,
    /// `cp_w_local`: control points in the organ's frame, 24 of a stem (along z), 45 x 43 in our order of a leaf.
    pub points: Vec<DVec3>,
    /// What only leaves or only stems have.
    pub form: ReleaseForm,
}

/// A leaf's shape or a stem's thickness.
#[derive(Clone, Debug, PartialEq)]
pub enum ReleaseForm {
    /// Coefficients of the 2D basis, in σ.
    Leaf(Vec<f64>),
    /// Radius in the release's unit.
    Stem(f64),
}

/// A plant of the release; parents stand before children.
#[derive(Clone, Debug, PartialEq)]
pub struct ReleasePlant {
    /// Its organs.
    pub organs: Vec<ReleaseOrgan>,
    /// Nodes of other classes than leaf and stem, left out.
    pub left_out: Vec<u32>,
}

impl ReleasePlant {
    /// Reads the contents of [`PLANT_FILES`].
    ///
    /// # Errors
    /// [`ReleaseError`] naming the line, the tensor or the node.
    pub fn read([classes, parents, graph]: [&[u8]; 3]) -> Result<Self, ReleaseError> {
        let class_of = pairs(PLANT_FILES[0], classes, " ", "a node and its class")?;
        let parent_of = pairs(PLANT_FILES[1], parents, "->", "`node -> parent`")?;
        let archive = Archive::read(PLANT_FILES[2], graph)?;
        let known = |node: u32, class: i64| class_of.get(&node) == Some(&class);
        let (mut order, mut left_out) = (Vec::new(), Vec::new());
        for name in archive.names() {
            let node = name.strip_prefix("scale_").and_then(|node| node.parse().ok());
            order.extend(node.filter(|node| known(*node, LEAF.into()) || known(*node, STEM.into())));
        }
        if order.len() > class_of.len() {
            let found = format!("{} of {}", order.len(), class_of.len());
            return Err(ReleaseError::Tree { node: order[0], expected: "each node once", found });
        }
        left_out.extend(class_of.keys().filter(|node| !order.contains(node)));
        let depths = order.iter().map(|node| depth(*node, &parent_of)).collect::<Result<Vec<_>, _>>()?;
        let mut ranked: Vec<(usize, u32)> = depths.into_iter().zip(order).collect();
        // Stable: within a depth the file's order stays.
        ranked.sort_by_key(|(depth, _)| *depth);
        let index: BTreeMap<u32, usize> = ranked.iter().enumerate().map(|(i, (_, node))| (*node, i)).collect();
        let mut organs: Vec<ReleaseOrgan> = Vec::with_capacity(ranked.len());
        for (depth, node) in ranked {
            let parent = match depth {
                0 if organs.is_empty() => None,
                0 => return Err(tree(node, "a parent, as all but the main stem have", "none")),
                _ => parent_of.get(&node).and_then(|parent| index.get(&u32::try_from(*parent).ok()?)).copied(),
            };
            match parent.map(|parent| &organs[parent].form) {
                None if depth > 0 => return Err(tree(node, "a parent with parameters", "one without")),
                Some(ReleaseForm::Leaf(_)) => return Err(tree(node, "a stem for a parent", "a leaf")),
                _ => organs.push(ReleaseOrgan::read(&archive, node, parent, known(node, LEAF.into()))?),
            }
        }
        match organs.first().map(|organ| &organ.form) {
            Some(ReleaseForm::Stem(_)) => Ok(Self { organs, left_out }),
            Some(ReleaseForm::Leaf(_)) => Err(tree(organs[0].node, "a stem at the root", "a leaf")),
            None => Err(ReleaseError::tensor(PLANT_FILES[2], "scale_*", "one of each organ", "none")),
        }
    }
}

impl ReleaseOrgan {
    fn read(archive: &Archive, node: u32, parent: Option<usize>, is_leaf: bool) -> Result<Self, ReleaseError> {
        let name = |part: &str| format!("{part}_{node}");
        let number = |part: &str| archive.numbers(&name(part), 1).map(|numbers| numbers[0]);
        let quaternion = archive.numbers(&name("M_quat"), 4)?;
        let rotation = DQuat::from_xyzw(quaternion[1], quaternion[2], quaternion[3], quaternion[0]);
        let scale = number("scale")?;
        if rotation.length() < 1e-6 || scale == 0.0 {
            let found = format!("{quaternion:?} and {scale}");
            return Err(ReleaseError::Tree { node, expected: "a rotation and a size other than 0", found });
        }
        let count = if is_leaf { leaf::POINTS } else { stem::POINTS };
        let points = archive.numbers(&name("cp_w_local"), 3 * count)?.as_chunks::<3>().0;
        let points = if is_leaf { from_release(points) } else { points.to_vec() };
        Ok(Self {
            node,
            parent,
            d: number("length")?,
            scale,
            rotation: rotation.normalize(),
            deform: archive.any(&name("deform"))?.to_vec(),
            points: points.into_iter().map(DVec3::from_array).collect(),
            form: if is_leaf {
                ReleaseForm::Leaf(archive.any(&name("shape"))?.to_vec())
            } else {
                ReleaseForm::Stem(number("thickness")?)
            },
        })
    }
}

fn tree(node: u32, expected: &'static str, found: &str) -> ReleaseError {
    ReleaseError::Tree { node, expected, found: found.into() }
}

/// Lines `number SEPARATOR number`, for at most as many first numbers as a plant has organs; empty ones are skipped, the
/// last of equal first numbers counts.
fn pairs(
    file: &'static str,
    bytes: &[u8],
    separator: &str,
    expected: &'static str,
) -> Result<BTreeMap<u32, i64>, ReleaseError> {
    let text = String::from_utf8_lossy(bytes);
    let mut found = BTreeMap::new();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let pair = line.trim().split_once(separator);
        let pair = pair.and_then(|(a, b)| Some((a.trim().parse().ok()?, b.trim().parse().ok()?)));
        let Some((node, value)) = pair else {
            return Err(ReleaseError::Line { file, line: index + 1, expected, found: line.into() });
        };
        found.insert(node, value);
        if found.len() > Plant::MAX_ORGANS {
            let expected = "at most 4096 nodes";
            return Err(ReleaseError::Line { file, line: index + 1, expected, found: line.into() });
        }
    }
    Ok(found)
}

/// Steps from a node to the root, which is its parent -1.
fn depth(node: u32, parent_of: &BTreeMap<u32, i64>) -> Result<usize, ReleaseError> {
    let (mut at, mut depth) = (node, 0);
    loop {
        match parent_of.get(&at) {
            Some(-1) => return Ok(depth),
            Some(parent) if depth < Plant::MAX_ORGANS => {
                at = u32::try_from(*parent).unwrap_or(u32::MAX);
                depth += 1;
            }
            Some(_) => return Err(tree(node, "a way to the root", "a circle")),
            None => return Err(tree(node, "a way to the root", "none")),
        }
    }
}
