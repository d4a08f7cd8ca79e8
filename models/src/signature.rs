//! How a layout's ports look, and which of a graph's ports they are.

use std::fmt;

use crate::Port;
use crate::model::ports;

/// One port of a layout.
pub(crate) struct Role {
    /// Names that exporters give it; the first is ours.
    names: &'static [&'static str],
    /// -1 where the graph may have any side.
    shape: &'static [i64],
    dtype: &'static str,
}

/// A layout's ports. A graph may have more outputs: they are not looked at.
pub(crate) struct Signature {
    pub(crate) inputs: &'static [Role],
    pub(crate) outputs: &'static [Role],
}

pub(crate) const fn f32s(names: &'static [&'static str], shape: &'static [i64]) -> Role {
    Role { names, shape, dtype: "f32" }
}

pub(crate) const fn i64s(names: &'static [&'static str], shape: &'static [i64]) -> Role {
    Role { names, shape, dtype: "i64" }
}

impl Role {
    fn named(&self, port: &Port) -> bool {
        self.names.contains(&port.name.as_str())
    }

    /// Whether type and rank agree and no fixed side differs.
    fn fits(&self, port: &Port) -> bool {
        let side = |(&ours, &theirs): (&i64, &i64)| ours < 0 || theirs < 0 || ours == theirs;
        self.dtype == port.dtype && self.shape.len() == port.shape.len() && self.shape.iter().zip(&port.shape).all(side)
    }
}

impl Signature {
    /// How many sides the graph fixes to just the layout's, when every port is there by name and fits.
    pub(crate) fn closeness(&self, inputs: &[Port], outputs: &[Port]) -> Option<usize> {
        let sides = |role: &Role, ports: &[Port]| {
            let port = ports.iter().find(|port| role.named(port) && role.fits(port))?;
            Some(role.shape.iter().zip(&port.shape).filter(|&(&ours, theirs)| ours >= 0 && ours == *theirs).count())
        };
        if inputs.len() != self.inputs.len() {
            return None;
        }
        let inputs = self.inputs.iter().map(|role| sides(role, inputs)).sum::<Option<usize>>()?;
        Some(inputs + self.outputs.iter().map(|role| sides(role, outputs)).sum::<Option<usize>>()?)
    }

    /// Each role's port: the one of its name, else the first that fits and that no other role has.
    pub(crate) fn roles(&self, inputs: &[Port], outputs: &[Port]) -> Option<Vec<(&'static str, String)>> {
        if inputs.len() != self.inputs.len() {
            return None;
        }
        Some([assign(self.inputs, inputs)?, assign(self.outputs, outputs)?].concat())
    }
}

fn assign(roles: &[Role], ports: &[Port]) -> Option<Vec<(&'static str, String)>> {
    let by_name = |role: &Role| ports.iter().position(|port| role.named(port) && role.fits(port));
    let mut places: Vec<Option<usize>> = roles.iter().map(by_name).collect();
    for (i, role) in roles.iter().enumerate() {
        if places[i].is_none() {
            let free = |at: &usize| !places.contains(&Some(*at)) && role.fits(&ports[*at]);
            places[i] = Some((0..ports.len()).find(free)?);
        }
    }
    Some(roles.iter().zip(places).filter_map(|(role, at)| Some((role.names[0], ports[at?].name.clone()))).collect())
}

impl fmt::Display for Signature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let promised = |roles: &[Role]| -> Vec<Port> {
            let port =
                |role: &Role| Port { name: role.names[0].into(), shape: role.shape.into(), dtype: role.dtype.into() };
            roles.iter().map(port).collect()
        };
        f.write_str(&lines(&promised(self.inputs), &promised(self.outputs)))
    }
}

/// Inputs and outputs as one readable line.
pub(crate) fn lines(inputs: &[Port], outputs: &[Port]) -> String {
    format!("{} -> {}", ports(inputs), ports(outputs))
}
