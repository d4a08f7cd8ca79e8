//! Leaflets to leaves.

use std::collections::BTreeMap;

use crate::model::{Form, Habit, Organ, OrganKind};

/// Numbers the leaves: leaflets on one petiole make one leaf.
pub(crate) fn group(organs: &mut [Organ], habit: Habit) {
    // The stem next to the main stem that carries each organ: its petiole, or its branch.
    let mut petiole: Vec<Option<usize>> = Vec::with_capacity(organs.len());
    for (i, organ) in organs.iter().enumerate() {
        petiole.push(match organ.parent {
            Some(parent) if parent > 0 => petiole[parent],
            Some(_) if organ.kind() == OrganKind::Stem => Some(i),
            _ => None,
        });
    }
    let mut blades = vec![0; organs.len()];
    for (petiole, organ) in petiole.iter().zip(&*organs) {
        if let (Some(petiole), OrganKind::Leaf) = (petiole, organ.kind()) {
            blades[*petiole] += 1;
        }
    }
    let shared = |petiole: usize| habit.shares_a_petiole(blades[petiole]);
    let mut number_of: BTreeMap<usize, u16> = BTreeMap::new();
    let mut next = 0;
    for (i, organ) in organs.iter_mut().enumerate() {
        if let Form::Leaf { leaf, .. } = &mut organ.form {
            // A leaf goes by its petiole, or by its one blade.
            *leaf = *number_of.entry(petiole[i].filter(|p| shared(*p)).unwrap_or(i)).or_insert(next);
            next = next.max(*leaf + 1);
        }
    }
}
