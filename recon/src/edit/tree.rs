//! Cutting and grafting: edits of the tree.

use std::collections::BTreeMap;

use super::EditError;
use crate::model::{Form, Plant};

/// The plant without some organs and all that hangs on them; the others keep their order.
///
/// # Errors
/// [`EditError`] when an organ is not there or is the main stem.
pub fn cut(plant: &Plant, organs: &[usize]) -> Result<Plant, EditError> {
    for &organ in organs {
        check(plant, organ)?;
        if organ == 0 {
            return Err(EditError::NoSuch { organ, expected: "an organ with a parent", found: "main stem" });
        }
    }
    let mut after = Plant { world_from_plant: plant.world_from_plant, organs: Vec::new() };
    // Where each organ went; parents stand before children, so one pass is enough.
    let mut place: Vec<Option<usize>> = Vec::with_capacity(plant.organs.len());
    for (index, organ) in plant.organs.iter().enumerate() {
        let parent = organ.parent.map(|parent| place[parent]);
        if organs.contains(&index) || parent == Some(None) {
            place.push(None);
            continue;
        }
        place.push(Some(after.organs.len()));
        let mut organ = organ.clone();
        organ.parent = parent.flatten();
        after.organs.push(organ);
    }
    after.validate()?;
    Ok(after)
}

/// The plant with a copy of the organ `from` and all that hangs on it, in the same size, put on the stem `onto` at
/// `d`; the copies come last and their leaves are new ones.
///
/// # Errors
/// [`EditError`] when an organ is not there, `onto` is a leaf, `d` is outside 0..=1, or the plant grows too large.
pub fn graft(plant: &Plant, from: usize, onto: usize, d: f64) -> Result<Plant, EditError> {
    check(plant, from)?;
    check(plant, onto)?;
    if let Form::Leaf { .. } = plant.organs[onto].form {
        return Err(EditError::NoSuch { organ: onto, expected: "a stem", found: "leaf" });
    }
    let mut after = plant.clone();
    let mut place = BTreeMap::new();
    let mut leaves: BTreeMap<u16, u16> = BTreeMap::new();
    let used = plant.organs.iter().filter_map(|organ| match organ.form {
        Form::Leaf { leaf, .. } => Some(leaf),
        Form::Stem { .. } => None,
    });
    // A plant has at most 4096 organs, but a leaf's number is the record's to choose.
    let mut next = used.max().map_or(0, |leaf| leaf.wrapping_add(1));
    for (index, organ) in plant.organs.iter().enumerate().skip(from) {
        let mut copy = organ.clone();
        if index == from {
            // The copy keeps its metres, whatever the sizes of the two parents.
            let kept = organ.parent.map_or(1.0, |parent| metres(plant, parent)) / metres(plant, onto);
            copy.parent = Some(onto);
            copy.joint.d = d;
            copy.joint.scale *= kept;
        } else {
            match organ.parent.and_then(|parent| place.get(&parent)) {
                Some(parent) => copy.parent = Some(*parent),
                None => continue,
            }
        }
        if let Form::Leaf { leaf, .. } = &mut copy.form {
            *leaf = *leaves.entry(*leaf).or_insert_with(|| {
                next = next.wrapping_add(1);
                next.wrapping_sub(1)
            });
        }
        place.insert(index, after.organs.len());
        after.organs.push(copy);
    }
    after.validate()?;
    Ok(after)
}

fn check(plant: &Plant, found: usize) -> Result<(), EditError> {
    let expected = plant.organs.len();
    if found < expected { Ok(()) } else { Err(EditError::NoOrgan { expected, found }) }
}

/// An organ's size in metres: all scales on its way to the root.
fn metres(plant: &Plant, organ: usize) -> f64 {
    let (mut at, mut size) = (Some(organ), 1.0);
    while let Some(organ) = at {
        size *= plant.organs[organ].joint.scale;
        at = plant.organs[organ].parent;
    }
    size
}
