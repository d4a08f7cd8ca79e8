//! The exact encoding: every parameter as f32, the plant's place as f64.
//!
//! | bytes | what |
//! |---|---|
//! | 32 | world_from_plant: rotation `[x, y, z, w]`, f64 |
//! | 24 | world_from_plant: translation in metres, f64, because f32 cannot hold a millimetre a hundred kilometres off |
//!
//! then for each organ
//!
//! | bytes | what |
//! |---|---|
//! | 1 | 0 stem, 1 leaf |
//! | 2 | parent, u16; 65535 for the main stem |
//! | 4 | d, f32 |
//! | 16 | rotation `[x, y, z, w]`, f32 |
//! | 4 | scale, f32 |
//! | 4 | stems: radius; leaves: width s_x; f32 |
//! | 2 | leaves: which leaf the blade belongs to, u16 |
//! | 4 K | stems: γ; leaves: β, then γ; f32, as many as the species has components |
//!
//! Missing trailing coefficients are written as the zeros that they mean.

use demeter_frame::Pose;
use glam::{DQuat, DVec3};

use super::{RecordError, check, check_place, frame};
use crate::model::leaf::Blade;
use crate::model::{Form, Joint, Organ, Plant, Species};
use crate::organs::ScaleSource;

/// Parent of the main stem.
const ROOT: u16 = u16::MAX;

/// The exact record of a plant: rounded to f32, nothing else.
///
/// # Errors
/// [`RecordError`] when the plant is none or a number does not fit f32.
pub fn encode_exact(plant: &Plant, species: &Species, scale_source: ScaleSource) -> Result<Vec<u8>, RecordError> {
    check(plant, species)?;
    let mut body = Vec::new();
    let Pose { rotation, translation } = plant.world_from_plant;
    for x in rotation.to_array().into_iter().chain(translation.to_array()) {
        body.extend(x.to_le_bytes());
    }
    let put = |body: &mut Vec<u8>, x: f64| body.extend((x as f32).to_le_bytes());
    let put_all = |body: &mut Vec<u8>, coefficients: &[f64], rank: usize| {
        (0..rank).for_each(|k| put(body, coefficients.get(k).copied().unwrap_or(0.0)));
    };
    for organ in &plant.organs {
        body.push(u8::from(matches!(organ.form, Form::Leaf { .. })));
        body.extend(organ.parent.map_or(ROOT, |parent| parent as u16).to_le_bytes());
        let Joint { d, rotation, scale } = organ.joint;
        put(&mut body, d);
        rotation.to_array().into_iter().chain([scale]).for_each(|x| put(&mut body, x));
        match &organ.form {
            Form::Stem { gamma, radius } => {
                put(&mut body, *radius);
                put_all(&mut body, gamma, species.stem.deform.rank());
            }
            Form::Leaf { blade, leaf } => {
                put(&mut body, blade.width);
                body.extend(leaf.to_le_bytes());
                put_all(&mut body, &blade.beta, species.leaf.shape.rank());
                put_all(&mut body, &blade.gamma, species.leaf.deform.rank());
            }
        }
    }
    frame(plant, species, scale_source, super::EXACT, &body)
}

pub(super) fn read(body: &[u8], organs: usize, species: &Species) -> Result<Plant, RecordError> {
    let mut body = Body(body);
    let rotation = body.f64s()?;
    let translation = body.f64s()?;
    let world_from_plant = Pose { rotation: DQuat::from_array(rotation), translation: DVec3::from_array(translation) };
    check_place(&world_from_plant)?;
    let mut plant = Plant { world_from_plant, organs: Vec::new() };
    for _ in 0..organs {
        let leaf = match body.take::<1>()? {
            [0] => false,
            [1] => true,
            _ => return Err(RecordError::Damaged { found: "an unknown kind of organ" }),
        };
        let parent = u16::from_le_bytes(body.take()?);
        let d = body.f32()?;
        let rotation = DQuat::from_xyzw(body.f32()?, body.f32()?, body.f32()?, body.f32()?);
        let joint = Joint { d, rotation: rotation.normalize(), scale: body.f32()? };
        let size = body.f32()?;
        let form = if leaf {
            let leaf = u16::from_le_bytes(body.take()?);
            let beta = body.f32s(species.leaf.shape.rank())?;
            let gamma = body.f32s(species.leaf.deform.rank())?;
            Form::Leaf { blade: Blade { beta, gamma, width: size }, leaf }
        } else {
            Form::Stem { gamma: body.f32s(species.stem.deform.rank())?, radius: size }
        };
        plant.organs.push(Organ { parent: (parent != ROOT).then_some(usize::from(parent)), joint, form });
    }
    match body.0 {
        [] => Ok(plant),
        _ => Err(RecordError::Damaged { found: "bytes behind the last organ" }),
    }
}

struct Body<'a>(&'a [u8]);

impl Body<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], RecordError> {
        let (taken, rest) = self.0.split_first_chunk().ok_or(RecordError::Damaged { found: "an early end" })?;
        self.0 = rest;
        Ok(*taken)
    }

    fn f32(&mut self) -> Result<f64, RecordError> {
        Ok(f64::from(f32::from_le_bytes(self.take()?)))
    }

    fn f32s(&mut self, count: usize) -> Result<Vec<f64>, RecordError> {
        (0..count).map(|_| self.f32()).collect()
    }

    fn f64s<const N: usize>(&mut self) -> Result<[f64; N], RecordError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = f64::from_le_bytes(self.take()?);
        }
        Ok(numbers)
    }
}
