//! Stage 2: all organs at once against the whole cloud (paper eq. 8 by its prose; spec/reconstruction.md "Fitting").
//!
//! Attachments, turns and sizes of all organs, bends and thickness of stems move together, every organ hanging exactly
//! on its parent; shapes and bends of blades stand. Turns are taken in the world and not relative to the parent: a stem
//! that bends carries along where its organs stand but does not turn them, which stage 1 did from their own points.
//! The parameters are the same, one organ's equations know only its place (3) of all others, and elimination from the
//! tips to the root costs as much as the organs one by one.

mod elimination;
mod rigid;
mod state;
#[cfg(test)]
mod tests;
mod uncertainty;

use elimination::{Block, TreeEquations};
use glam::{DQuat, DVec3};
use nalgebra::DMatrix;
use rigid::{Rigid, RigidData};
use state::{Body, Carried, Member, carried, over_place_and_d, stepped};

use super::hanger::{Hanger, relative};
use super::solver::minimise;
use super::stem::StemFit;
use super::tube::{Rows, Tube, TubeData};
use crate::model::kinematics::Similarity;
use crate::model::{Form, Plant, PlantError, Species, forward, stem};
use crate::statistics::mean;
use crate::traits::Sigmas;

/// Steps over the whole plant.
const STEPS: usize = 6;

/// What an organ of the plant was fitted to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evidence<'a> {
    /// Its points, metres; none for a bridge.
    pub points: &'a [DVec3],
    /// Whether a stem's points tell its radius.
    pub radius_known: bool,
}

/// An organ's points, prepared once.
enum Data {
    Tube {
        data: TubeData,
        sigma: f64,
    },
    Blade(RigidData),
    /// A stem that was put in: nothing but the others say where it is. Its ln radius stands.
    Bridge {
        log_radius: f64,
    },
}

/// What stage 2 says of an organ.
pub(super) struct Outcome {
    /// Mean distance of its points from its surface, metres; `None` without points.
    pub residual: Option<f64>,
    /// How sure its traits as a stem are, and its attachment; nothing without points.
    pub sigmas: Sigmas,
}

/// Moves a plant of stage 1 onto its points, an entry of `evidence` an organ. The cost never rises.
///
/// # Errors
/// [`PlantError`] when the plant is none.
pub(super) fn refine(
    plant: &mut Plant,
    evidence: &[Evidence<'_>],
    species: &Species,
) -> Result<Vec<Outcome>, PlantError> {
    let mut members = members(plant, species)?;
    let data: Vec<Data> =
        plant.organs.iter().zip(evidence).zip(&members).map(|((o, e), m)| Data::of(&o.form, *e, m, species)).collect();
    let at = |members: &Vec<Member>| equations(members, &data, species);
    minimise(&mut members, STEPS, at, |members, steps| stepped(members, steps, species));
    put_back(plant, &members, species);
    let covariances = at(&members).covariances();
    let outcome = |(i, (member, data)): (usize, (&Member, &Data))| {
        let parent = member.parent.and_then(|p| match &members[p].body {
            Body::Tube(tube) => Some(tube.metres()),
            Body::Rigid(_) => None,
        });
        let residual = data.residual(member, species);
        let covariance = covariances.as_ref().filter(|_| residual.is_some()).map(|all| &all[i]);
        let sigmas = covariance.map(|covariance| uncertainty::sigmas(member, covariance, parent, species));
        Outcome { residual, sigmas: sigmas.unwrap_or_default() }
    };
    Ok(members.iter().zip(&data).enumerate().map(outcome).collect())
}

/// The plant's organs in the world.
fn members(plant: &Plant, species: &Species) -> Result<Vec<Member>, PlantError> {
    let posed = forward(plant, species)?;
    let organs = plant.organs.iter().zip(&posed.world_from_organ).zip(&posed.radius);
    let members = organs.map(|((organ, world), radius)| {
        let (base, log_length) = (world.translation, world.scale.ln());
        let body = match &organ.form {
            Form::Stem { gamma, .. } => {
                let gauge = stem::gauge(&species.stem.jacobian(gamma).points);
                let rotation = world.rotation * gauge;
                Body::Tube(Tube { base, rotation, log_length, gamma: gamma.clone(), log_radius: radius.ln() })
            }
            Form::Leaf { .. } => Body::Rigid(Rigid { base, rotation: world.rotation, log_length }),
        };
        Member { parent: organ.parent, d: organ.joint.d, body }
    });
    Ok(members.collect())
}

/// The joints and stems of the plant as its members stand.
fn put_back(plant: &mut Plant, members: &[Member], species: &Species) {
    plant.world_from_plant.translation = members[0].base();
    let mut hangers: Vec<Option<Hanger>> = Vec::with_capacity(members.len());
    for (organ, member) in plant.organs.iter_mut().zip(members) {
        let ground = Similarity { rotation: plant.world_from_plant.rotation, translation: member.base(), scale: 1.0 };
        let joint = member.parent.and_then(|p| hangers[p].as_ref()).map_or(ground, |hanger| hanger.joint(member.d));
        let (rotation, length, hanger): (DQuat, f64, _) = match &member.body {
            Body::Tube(tube) => {
                let fit = StemFit::of(tube, species);
                organ.form = Form::Stem { gamma: fit.gamma.clone(), radius: fit.radius / fit.length };
                (fit.rotation, fit.length, Some(Hanger::of(&fit, tube.base, species)))
            }
            Body::Rigid(blade) => (blade.rotation, blade.log_length.exp(), None),
        };
        organ.joint.d = member.d;
        organ.joint.rotation = relative(joint.rotation, rotation);
        organ.joint.scale = length / joint.scale;
        hangers.push(hanger);
    }
}

/// Every organ's normal equations, joined along the tree.
fn equations(members: &[Member], data: &[Data], species: &Species) -> TreeEquations {
    let mut rows: Vec<Option<Rows<'_>>> = Vec::with_capacity(members.len());
    let mut tangents: Vec<DVec3> = Vec::with_capacity(members.len());
    let mut equations = TreeEquations { blocks: Vec::with_capacity(members.len()), cost: 0.0 };
    for (member, data) in members.iter().zip(data) {
        let on_parent = member.parent.and_then(|p| Some((rows[p].as_mut()?, tangents[p])));
        let Carried { carry, tangent } = match on_parent {
            Some((rows, tangent)) => carried(rows, tangent, member.d),
            None => Carried { carry: DMatrix::zeros(elimination::PLACE, 0), tangent: DVec3::ZERO },
        };
        let normal = data.normal(member, species);
        equations.cost += normal.cost;
        let (h, g) = over_place_and_d(normal, tangent);
        equations.blocks.push(Block { parent: member.parent, h, g, carry });
        rows.push(match &member.body {
            Body::Tube(tube) => Some(Rows::of(tube, species)),
            Body::Rigid(_) => None,
        });
        tangents.push(tangent);
    }
    equations
}

impl Data {
    fn of(form: &Form, evidence: Evidence<'_>, member: &Member, species: &Species) -> Self {
        match (form, &member.body) {
            (_, Body::Tube(tube)) if evidence.points.is_empty() => Self::Bridge { log_radius: tube.log_radius },
            (_, Body::Tube(tube)) => {
                let data = TubeData::new(evidence.points, tube);
                let data = if evidence.radius_known { data } else { data.with_radius_held() };
                let sigma = data.noise(tube, species);
                Self::Tube { data, sigma }
            }
            (Form::Leaf { blade, .. }, Body::Rigid(pose)) => {
                Self::Blade(RigidData::new(evidence.points, blade, pose, species))
            }
            (Form::Stem { .. }, Body::Rigid(_)) => unreachable!("bodies are made of forms"),
        }
    }

    fn normal(&self, member: &Member, species: &Species) -> super::solver::Normal {
        match (self, &member.body) {
            (Self::Tube { data, sigma }, Body::Tube(tube)) => data.normal(tube, *sigma, species),
            (Self::Bridge { log_radius }, Body::Tube(tube)) => Rows::of(tube, species).finish(*log_radius, 1.0),
            (Self::Blade(data), Body::Rigid(pose)) => data.normal(pose),
            _ => unreachable!("data are made for the body"),
        }
    }

    fn residual(&self, member: &Member, species: &Species) -> Option<f64> {
        match (self, &member.body) {
            (Self::Tube { data, .. }, Body::Tube(tube)) => mean(data.misses(tube, species)),
            (Self::Blade(data), Body::Rigid(pose)) => data.residual(pose),
            _ => None,
        }
    }
}
