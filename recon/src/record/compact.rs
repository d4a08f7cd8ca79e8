//! The compact encoding: parameters quantised by how far they move vertices, then entropy-coded.
//!
//! | bytes | what |
//! |---|---|
//! | 1 | precision p, i8: a step of any parameter moves the vertices it reaches by about 2^(p/4) metres |
//! | ... | an arithmetic code ([`super::coder`]) of whole numbers in the order below |
//!
//! 1. For each organ but the main stem: is it a leaf; its parent, as the number of stems between; leaves: does it
//!    begin a new leaf (the next unused number), else is its leaf that of the blade before, else the number itself.
//! 2. The main stem's size, and the plant's place: rotation, then x, y, z.
//! 3. For each organ: attachment as 1 - d, size (all but the main stem); stems: γ, radius; leaves: β, γ, s_x; rotation.
//!
//! Quanta are powers of 2^(1/4), so that both sides agree on them in whole numbers:
//! - Coefficient j of an organ of size S: 2^(p/4) w / (S e_j), e_j the shift of unit organs per σ ([`super::quanta`]);
//!   at most 1 σ.
//! - d: 2^(p/4) w / S of the parent; at most 1/64.
//! - Size (absolute, in octaves, predicted by the organ of its kind before): 2^(p/4) w / S; at most 1/64 octave.
//! - Radius (absolute, in octaves, predicted by the parent's): 1/64 octave, for diameters are traits. s_x: likewise,
//!   or finer when its effect is larger.
//! - Rotation: R = Ry(φ) Rx(θ) Ry(ψ), θ first; φ only when θ is not 0. 2^(p/4) w / S; at most 1/64 radian.
//! - Translation: 2^(p/4) / 8 metres.
//!
//! w, a power of two, is the square root of the share of the plant's vertices that move along, since a step costs
//! bits once and moves all of them. Rotations and sizes are those that the organ has in the world, taken back through
//! the *decoded* parents, so that errors do not add up along the tree; a stem that is rolled because its nearly
//! straight shape was rounded is rolled back by its rotation. `d` of the main stem means nothing and becomes 0.

use demeter_frame::Pose;
use glam::{DQuat, DVec3};

use super::coder::{Coder, Model, Reader, Writer};
use super::quanta::Effects;
use super::{RecordError, check, frame};
use crate::cloud::diagonal;
use crate::model::kinematics::attachment;
use crate::model::leaf::Blade;
use crate::model::stem::StemCurve;
use crate::model::{Detail, Form, Joint, Knots, Organ, Plant, PlantMesh, PosedPlant, Species, forward};
use crate::organs::ScaleSource;

/// What the encoder keeps: mean distance of corresponding vertices, in diagonals of the plant's bounding box. The
/// goal is 0.0005; the rest is left for other meshes than the one measured, and so that rounding costs a good fit little.
const VERTEX_ERROR: f64 = 0.00028;
/// Sizes are whole numbers of 1/4096 octave.
const SIZE_BITS: i32 = 12;
/// Sizes and radii are kept within half of this many octaves, as a power of two: 0.5 %, below what anyone measures.
const SIZE_CAP: i32 = -6;
/// Rotations and attachments are kept at least this fine, radians or path lengths, as a power of two.
const JOINT_CAP: i32 = -6;
/// Coefficients are kept at least this fine, σ, as a power of two: so far apart are only those that hardly move anything.
const COEFFICIENT_CAP: i32 = 0;

/// The compact record of a plant: corresponding vertices of the decoded and the exact mesh differ by at most 0.0005
/// of the bounding box's diagonal on average; every encoding is decoded and measured before it is returned.
///
/// # Errors
/// [`RecordError`] when the plant is none, or so wild that no precision reaches the goal.
pub fn encode_compact(plant: &Plant, species: &Species, scale_source: ScaleSource) -> Result<Vec<u8>, RecordError> {
    check(plant, species)?;
    let posed = forward(plant, species)?;
    let exact = PlantMesh::of(&posed, Detail::Control, Knots::Uniform);
    let unit = diagonal(&exact.positions).filter(|d| *d > 0.0 && d.is_finite()).ok_or(RecordError::Range {
        what: "bounding box",
        expected: "a finite diagonal above 0",
        found: 0.0,
    })?;
    let source = Source { plant, posed };
    let effects = Effects::of(species);
    // Begins coarse, where quanta are as large as the error that is allowed, refines until the goal is kept, and then
    // halves the gap to the coarsest quanta that keep it: how the error falls differs between plants.
    let mut precision = octave_quarters(VERTEX_ERROR * unit);
    let (mut found, mut too_coarse, mut kept) = (f64::INFINITY, precision + 1, None);
    while let Ok(byte) = i8::try_from(precision) {
        let mut writer = Writer::new();
        let walk = Walk { species, effects: &effects, precision, source: Some(&source) };
        let decoded = walk.run(&mut writer, plant.organs.len())?;
        let mesh = PlantMesh::of(&forward(&decoded, species)?, Detail::Control, Knots::Uniform);
        let total: f64 = mesh.positions.iter().zip(&exact.positions).map(|(a, b)| a.distance(*b)).sum();
        found = total / exact.positions.len() as f64 / unit;
        let mut fine_enough = kept.as_ref().map(|(precision, _)| *precision);
        if found <= VERTEX_ERROR {
            let mut body = byte.to_le_bytes().to_vec();
            body.extend(writer.finish());
            fine_enough = Some(precision);
            kept = Some((precision, body));
        } else {
            too_coarse = precision;
        }
        precision = match fine_enough {
            Some(fine) if too_coarse - fine <= 1 => break,
            Some(fine) => i32::midpoint(fine, too_coarse),
            None => precision - octave_quarters(found / VERTEX_ERROR).clamp(1, 16),
        };
    }
    match kept {
        Some((_, body)) => frame(plant, species, scale_source, super::COMPACT, &body),
        None => Err(RecordError::Precision { expected: VERTEX_ERROR, found }),
    }
}

pub(super) fn read(body: &[u8], organs: usize, species: &Species) -> Result<Plant, RecordError> {
    let (precision, code) = body.split_first().ok_or(RecordError::Damaged { found: "an early end" })?;
    let precision = i32::from(i8::from_le_bytes([*precision]));
    let walk = Walk { species, effects: &Effects::of(species), precision, source: None };
    walk.run(&mut Reader::new(code), organs)
}

/// Quarters of an octave below `x`, which is above 0.
fn octave_quarters(x: f64) -> i32 {
    (4.0 * x.log2()).floor() as i32
}

/// What the encoder aims at.
struct Source<'a> {
    plant: &'a Plant,
    posed: PosedPlant,
}

/// An organ as the decoder knows it.
struct Placed {
    /// Size in the world, 1/4096 octaves of a metre.
    size: i64,
    /// Radius in the world, likewise; 0 for leaves.
    radius: i64,
    world_from_organ: DQuat,
    /// Stems only.
    curve: Option<StemCurve>,
}

/// One pass over a plant that writes it or reads it, depending on the coder. It always rebuilds the plant as the
/// decoder sees it; `source` is there when writing.
struct Walk<'a> {
    species: &'a Species,
    effects: &'a Effects,
    precision: i32,
    source: Option<&'a Source<'a>>,
}

/// Models of the numbers in a record, one set for stems and one for leaves where both have them.
struct Models {
    leaf: [Model; 2],
    parent: Model,
    new_leaf: Model,
    same_leaf: Model,
    leaf_number: Model,
    place: Model,
    attachment: [Model; 2],
    size: [Model; 2],
    radius: Model,
    width: Model,
    turn: [[Model; 3]; 2],
    shape: Vec<Model>,
    bend: Vec<Model>,
    bow: Vec<Model>,
}

impl Models {
    fn of(species: &Species) -> Self {
        let one = Model::new;
        let two = || [one(), one()];
        let three = || [one(), one(), one()];
        let many = |count: usize| vec![one(); count];
        Self {
            leaf: two(),
            parent: one(),
            new_leaf: one(),
            same_leaf: one(),
            leaf_number: one(),
            place: one(),
            attachment: two(),
            size: two(),
            radius: one(),
            width: one(),
            turn: [three(), three()],
            shape: many(species.leaf.shape.rank()),
            bend: many(species.leaf.deform.rank()),
            bow: many(species.stem.deform.rank()),
        }
    }
}

/// What topology says of an organ.
#[derive(Clone, Copy)]
struct Node {
    parent: Option<usize>,
    /// `None` for stems.
    leaf: Option<u16>,
    /// Quarter octaves that its quanta may be coarser because few vertices move along.
    slack: i32,
}

impl Walk<'_> {
    fn run<C: Coder>(&self, coder: &mut C, organs: usize) -> Result<Plant, RecordError> {
        let mut models = Models::of(self.species);
        let nodes = self.topology(coder, &mut models, organs)?;
        let root_size = self.size(coder, &mut models.size[0], 0, 0, 0)?;
        let world_from_plant = self.place(coder, &mut models, root_size)?;
        let mut placed: Vec<Placed> = Vec::with_capacity(organs);
        let mut plant = Plant { world_from_plant, organs: Vec::with_capacity(organs) };
        // Size of the last stem and the last leaf.
        let mut last = [root_size; 2];
        for (i, node) in nodes.iter().enumerate() {
            let kind = usize::from(node.leaf.is_some());
            let target = self.source.map(|s| &s.plant.organs[i]);
            let (d, base, parent_size, parent_radius) = match node.parent.map(|parent| &placed[parent]) {
                None => (0.0, world_from_plant.rotation, 0, root_size - (7 << SIZE_BITS)),
                Some(parent) => {
                    let quantum = self.precision + node.slack - 4 * octave(parent.size);
                    let quantum = quantum.min(4 * JOINT_CAP);
                    let short = target.map_or(0.0, |o| 1.0 - o.joint.d);
                    let short = number(coder, &mut models.attachment[kind], quantum, -1, short)?;
                    let d = (1.0 - short).clamp(0.0, 1.0);
                    let curve = parent.curve.as_ref().ok_or(RecordError::Damaged { found: "a leaf with a child" })?;
                    (d, parent.world_from_organ * attachment(curve, d).1, parent.size, parent.radius)
                }
            };
            let size = match node.parent {
                None => root_size,
                Some(_) => self.size(coder, &mut models.size[kind], i, node.slack, last[kind])?,
            };
            last[kind] = size;
            let step = self.precision + node.slack - 4 * octave(size);
            let mut world = self.source.map_or(DQuat::IDENTITY, |s| s.posed.world_from_organ[i].rotation);
            let (form, radius, curve) = match node.leaf {
                None => {
                    let gamma: &[f64] = match target.map(|o| &o.form) {
                        Some(Form::Stem { gamma, .. }) => gamma,
                        _ => &[],
                    };
                    let read = coefficients(coder, &mut models.bow, step, &self.effects.stem_gamma, gamma)?;
                    let curve = self.species.stem.curve(&read);
                    world *= roll_back(&self.species.stem.curve(gamma), &curve);
                    let radius = self.radius(coder, &mut models.radius, i, parent_radius)?;
                    let unit = octaves_to_ratio(radius - size);
                    (Form::Stem { gamma: read, radius: unit }, radius, Some(curve))
                }
                Some(leaf) => {
                    let still = Blade { beta: Vec::new(), gamma: Vec::new(), width: 1.0 };
                    let blade = match target.map(|o| &o.form) {
                        Some(Form::Leaf { blade, .. }) => blade,
                        _ => &still,
                    };
                    let beta = coefficients(coder, &mut models.shape, step, &self.effects.beta, &blade.beta)?;
                    let gamma = coefficients(coder, &mut models.bend, step, &self.effects.leaf_gamma, &blade.gamma)?;
                    let quantum = (step - 4 * self.effects.leaf_width).min(4 * SIZE_CAP);
                    let width = number(coder, &mut models.width, quantum, -1, blade.width.log2())?.exp2();
                    (Form::Leaf { blade: Blade { beta, gamma, width }, leaf }, 0, None)
                }
            };
            // A blade's points lie half its length from its base on average, a stem carries others at its end.
            let (tilt, roll) = if kind == 1 { (step + 4, step - 4 * self.effects.leaf_roll) } else { (step, step) };
            let rotation = turn(coder, &mut models.turn[kind], tilt, roll, base.inverse() * world)?;
            let world_from_organ = (base * rotation).normalize();
            let scale = octaves_to_ratio(size - parent_size);
            plant.organs.push(Organ { parent: node.parent, joint: Joint { d, rotation, scale }, form });
            placed.push(Placed { size, radius, world_from_organ, curve });
        }
        Ok(plant)
    }

    /// Kinds, parents and leaves of all organs, and how many vertices move along with each.
    fn topology<C: Coder>(&self, coder: &mut C, models: &mut Models, organs: usize) -> Result<Vec<Node>, RecordError> {
        let mut nodes = vec![Node { parent: None, leaf: None, slack: 0 }];
        let mut stems = vec![0];
        let (mut next, mut last) = (0_u16, 0);
        for i in 1..organs {
            let target = self.source.map(|s| &s.plant.organs[i]);
            let leaf = target.and_then(|o| match o.form {
                Form::Leaf { leaf, .. } => Some(leaf),
                Form::Stem { .. } => None,
            });
            let parent = target.and_then(|o| o.parent).unwrap_or(0);
            let after_leaf = usize::from(nodes[i - 1].leaf.is_some());
            let is_leaf = coder.flag(&mut models.leaf[after_leaf], leaf.is_some())?;
            let back = stems.iter().rev().position(|s| *s == parent).unwrap_or(0);
            let back = coder.number(&mut models.parent, 0, back as i64)?;
            let parent = usize::try_from(back).ok().and_then(|back| stems.iter().rev().nth(back).copied());
            let parent = parent.ok_or(RecordError::Damaged { found: "a parent before the first stem" })?;
            let leaf = if is_leaf {
                let leaf = leaf.unwrap_or(0);
                let read = if coder.flag(&mut models.new_leaf, leaf == next)? {
                    next
                } else if coder.flag(&mut models.same_leaf, leaf == last)? {
                    last
                } else {
                    let read = coder.number(&mut models.leaf_number, 8, leaf.into())?;
                    u16::try_from(read)
                        .map_err(|_out| RecordError::Damaged { found: "a leaf's number out of range" })?
                };
                next = next.max(read.wrapping_add(1));
                last = read;
                Some(read)
            } else {
                stems.push(i);
                None
            };
            nodes.push(Node { parent: Some(parent), leaf, slack: 0 });
        }
        // A blade has about ten times the vertices of a stem's tube.
        let mut along: Vec<u64> = nodes.iter().map(|n| if n.leaf.is_some() { 10 } else { 1 }).collect();
        for i in (1..organs).rev() {
            along[nodes[i].parent.unwrap_or(0)] += along[i];
        }
        for (node, vertices) in nodes.iter_mut().zip(&along) {
            let mut vertices = *vertices;
            while vertices * 4 <= along[0] {
                vertices *= 4;
                node.slack += 4;
            }
        }
        Ok(nodes)
    }

    fn place<C: Coder>(&self, coder: &mut C, models: &mut Models, root_size: i64) -> Result<Pose, RecordError> {
        let step = self.precision - 4 * octave(root_size);
        let target = self.source.map_or(Pose::IDENTITY, |s| s.plant.world_from_plant);
        let rotation = turn(coder, &mut models.turn[0], step, step, target.rotation)?;
        let quantum = self.precision - 12;
        let mut metres = |x: f64| number(coder, &mut models.place, quantum, 4, x);
        let DVec3 { x, y, z } = target.translation;
        Ok(Pose::new(rotation, DVec3::new(metres(x)?, metres(y)?, metres(z)?)))
    }

    /// Size in the world of organ `i`, as a difference to a prediction.
    fn size<C: Coder>(
        &self,
        coder: &mut C,
        model: &mut Model,
        i: usize,
        slack: i32,
        predicted: i64,
    ) -> Result<i64, RecordError> {
        let target = self.source.map_or(1.0, |s| s.posed.world_from_organ[i].scale);
        let step = (self.precision + slack - 4 * octave(predicted)).div_euclid(4);
        octaves(coder, model, step.clamp(-SIZE_BITS, SIZE_CAP), predicted, target)
    }

    /// Radius in the world of stem `i`.
    fn radius<C: Coder>(&self, coder: &mut C, model: &mut Model, i: usize, predicted: i64) -> Result<i64, RecordError> {
        let target = self.source.map_or(1.0, |s| s.posed.radius[i]);
        octaves(coder, model, SIZE_CAP, predicted, target)
    }
}

/// Whole octaves of a size in 1/4096 octaves.
fn octave(size: i64) -> i32 {
    (size >> SIZE_BITS) as i32
}

fn octaves_to_ratio(size: i64) -> f64 {
    (size as f64 / f64::from(1 << SIZE_BITS)).exp2()
}

/// Codes a length in steps of 2^step octaves from a prediction; returns 1/4096 octaves.
fn octaves<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    step: i32,
    predicted: i64,
    metres: f64,
) -> Result<i64, RecordError> {
    let shift = step + SIZE_BITS;
    let wanted = metres.log2() * f64::from(1 << SIZE_BITS) - predicted as f64;
    let steps = coder.number(model, -step, (wanted / f64::from(1 << shift)).round() as i64)?;
    // f64 spans 2^±1074 metres.
    let limit = 1100 << SIZE_BITS;
    let size = predicted + steps.clamp(-limit, limit) * (1 << shift);
    if size.abs() > limit { Err(RecordError::Damaged { found: "a size out of range" }) } else { Ok(size) }
}

/// Codes a number, expected to be about 2^expected, in quanta of 2^(quarters/4).
fn number<C: Coder>(
    coder: &mut C,
    model: &mut Model,
    quarters: i32,
    expected: i32,
    value: f64,
) -> Result<f64, RecordError> {
    let quantum = (f64::from(quarters) / 4.0).exp2();
    let steps = (value / quantum).round();
    if steps.abs() > (1_u64 << 43) as f64 {
        let what = "compact parameter";
        return Err(RecordError::Range { what, expected: "within 2^43 quanta of 0", found: value });
    }
    let magnitude = (4 * expected - quarters).div_euclid(4);
    Ok(coder.number(model, magnitude, steps as i64)? as f64 * quantum)
}

/// Codes an organ's coefficients, of which trailing ones may be missing.
fn coefficients<C: Coder>(
    coder: &mut C,
    models: &mut [Model],
    step: i32,
    effects: &[i32],
    values: &[f64],
) -> Result<Vec<f64>, RecordError> {
    let coded = models.iter_mut().zip(effects).enumerate().map(|(j, (model, effect))| {
        let quantum = (step - 4 * effect).min(4 * COEFFICIENT_CAP);
        number(coder, model, quantum, 0, values.get(j).copied().unwrap_or(0.0))
    });
    coded.collect()
}

/// Codes a rotation as Ry(φ) Rx(θ) Ry(ψ); `tilt` and `roll` are the quanta of θ and φ and of ψ in quarter octaves of
/// a radian.
fn turn<C: Coder>(
    coder: &mut C,
    models: &mut [Model; 3],
    tilt: i32,
    roll: i32,
    target: DQuat,
) -> Result<DQuat, RecordError> {
    let (tilt, roll) = (tilt.min(4 * JOINT_CAP), roll.min(4 * JOINT_CAP));
    let [first, second, third] = models;
    let along = target * DVec3::Y;
    let theta = number(coder, first, tilt, 0, along.x.hypot(along.z).atan2(along.y))?;
    // Without tilt both other turns are about the same axis.
    let phi = if theta == 0.0 { 0.0 } else { number(coder, second, tilt, 0, along.x.atan2(along.z))? };
    let tilted = DQuat::from_rotation_y(phi) * DQuat::from_rotation_x(theta);
    let psi = number(coder, third, roll, 0, twist_y(tilted.inverse() * target))?;
    let rotation = (tilted * DQuat::from_rotation_y(psi)).normalize();
    Ok(if rotation.w < 0.0 { -rotation } else { rotation })
}

/// The angle in (-π, π] of a rotation's part about y.
fn twist_y(rotation: DQuat) -> f64 {
    let sign = if rotation.w < 0.0 { -1.0 } else { 1.0 };
    2.0 * (rotation.y * sign).atan2(rotation.w * sign)
}

/// The roll that brings a rounded stem curve back over the exact one: the gauge of a nearly straight stem turns about
/// the chord with any small change of its bow, and would turn all that hangs on it along.
fn roll_back(exact: &StemCurve, rounded: &StemCurve) -> DQuat {
    DQuat::from_rotation_y(twist_y(exact.frames[0] * rounded.frames[0].inverse()))
}
