//! The box's name, out of its hardware: a card that was cloned into another box makes another rig.

use std::fs;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::CommandError;
use crate::files;

/// Files whose text names the board, below the root: a Raspberry Pi's or a Jetson's serial number, a PC's (that one
/// only root may read).
const BOARD: [&str; 3] =
    ["sys/firmware/devicetree/base/serial-number", "sys/class/dmi/id/product_uuid", "sys/class/dmi/id/board_serial"];

/// What factories leave in the files of [`BOARD`] when they have no number.
const BLANKS: [&str; 5] = ["none", "default string", "to be filled by o.e.m.", "not specified", "0"];

/// Bit of a network address that says somebody made it up.
const LOCAL_ADDRESS: u8 = 0b10;

/// The box's name and what it was known by when it got it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rig {
    /// The name: `rig-` and 12 hexadecimal digits.
    pub id: String,
    /// A hash of each fact about the hardware.
    facts: Vec<String>,
}

/// How the name came about.
#[derive(Clone, Debug, PartialEq)]
pub enum Named {
    /// This box has had it before.
    Known,
    /// The first start.
    New,
    /// The stored name belongs to another box, this one's card was cloned from it.
    Cloned {
        /// The other box.
        from: String,
    },
}

impl Rig {
    /// Takes the name out of `file`, or gives a new one and writes it there; `root` is `/`.
    ///
    /// One fact that agrees is enough to be the same box, so a network adapter may be changed. Where the hardware says
    /// nothing about itself, the system's machine id stands for it; it is on the card, so a clone is not noticed then.
    ///
    /// # Errors
    /// [`CommandError`] naming the file when it cannot be written.
    pub fn identify(root: &Path, file: &Path) -> Result<(Self, Named), CommandError> {
        let facts = facts(root);
        let stored = fs::read(file).ok().and_then(|bytes| serde_json::from_slice::<Self>(&bytes).ok());
        let named = match stored {
            Some(rig) if rig.facts == facts => return Ok((rig, Named::Known)),
            Some(rig) if rig.facts.iter().any(|fact| facts.contains(fact)) => {
                let rig = Self { facts, ..rig };
                rig.write(file)?;
                return Ok((rig, Named::Known));
            }
            Some(rig) => Named::Cloned { from: rig.id },
            None => Named::New,
        };
        // Out of the hardware and not out of chance: a box whose disk was wiped keeps its name.
        let id = facts.first().map_or("unknown", |fact| &fact[..12]);
        let rig = Self { id: format!("rig-{id}"), facts };
        rig.write(file)?;
        Ok((rig, named))
    }

    fn write(&self, file: &Path) -> Result<(), CommandError> {
        let bytes = serde_json::to_vec_pretty(self).map_err(|error| CommandError::failed("rig", &error))?;
        files::write(file, &bytes)
    }
}

/// Hashes, so that no serial number is stored or shown.
fn facts(root: &Path) -> Vec<String> {
    let text = |file: &str| fs::read_to_string(root.join(file)).ok();
    let board = BOARD.into_iter().filter_map(|file| Some(format!("board {}", known(&text(file)?)?)));
    let mut facts: Vec<_> = board.chain(addresses(root).unwrap_or_default()).collect();
    if facts.is_empty() {
        facts.extend(text("etc/machine-id").and_then(|id| Some(format!("machine {}", known(&id)?))));
    }
    facts.into_iter().map(|fact| blake3::hash(fact.as_bytes()).to_hex().to_string()).collect()
}

fn known(text: &str) -> Option<&str> {
    let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\0');
    let blank = text.is_empty() || BLANKS.contains(&text.to_lowercase().as_str());
    (!blank).then_some(text)
}

/// The addresses that factories gave to the network adapters, in the order of their text.
fn addresses(root: &Path) -> io::Result<Vec<String>> {
    let mut addresses = Vec::new();
    for adapter in fs::read_dir(root.join("sys/class/net"))?.flatten() {
        // Bridges, tunnels and the loopback have no device behind them.
        let real = adapter.path().join("device").exists();
        let address = fs::read_to_string(adapter.path().join("address")).unwrap_or_default();
        let first = address.get(..2).and_then(|byte| u8::from_str_radix(byte, 16).ok());
        let factory = first.is_some_and(|first| first & LOCAL_ADDRESS == 0) && !address.starts_with("00:00:00:00");
        if real && factory {
            addresses.push(format!("net {}", address.trim()));
        }
    }
    addresses.sort_unstable();
    Ok(addresses)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file system with a board, adapters as name and address, and a machine id.
    fn machine(serial: &str, adapters: &[(&str, &str)], machine_id: &str) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write(BOARD[0], serial);
        write(BOARD[2], "To Be Filled By O.E.M.\n");
        write("etc/machine-id", machine_id);
        write("sys/class/net/lo/address", "00:00:00:00:00:00\n");
        for (name, address) in adapters {
            write(&format!("sys/class/net/{name}/address"), &format!("{address}\n"));
            write(&format!("sys/class/net/{name}/device/uevent"), "");
        }
        root
    }

    fn name(root: &tempfile::TempDir, card: &Path) -> (String, Named) {
        let (rig, named) = Rig::identify(root.path(), &card.join("rig.json")).unwrap();
        (rig.id, named)
    }

    const ETH: (&str, &str) = ("eth0", "b8:27:eb:00:00:01");
    const USB: (&str, &str) = ("eth1", "00:e0:4c:00:00:02");

    #[test]
    fn a_box_keeps_its_name_through_restarts_wiped_disks_and_changed_adapters() {
        let card = tempfile::tempdir().unwrap();
        let (id, named) = name(&machine("10000000abcdef\0", &[ETH], "m1"), card.path());
        assert_eq!(named, Named::New);
        assert!(id.len() == 16 && id.starts_with("rig-"), "{id}");
        for adapters in [&[ETH][..], &[USB], &[ETH, USB], &[]] {
            assert_eq!(name(&machine("10000000abcdef\0", adapters, "m2"), card.path()), (id.clone(), Named::Known));
        }
        fs::remove_file(card.path().join("rig.json")).unwrap();
        assert_eq!(name(&machine("10000000abcdef\0", &[ETH], "m3"), card.path()), (id, Named::New));
    }

    #[test]
    fn a_cloned_card_makes_another_rig() {
        let card = tempfile::tempdir().unwrap();
        let (first, _) = name(&machine("serial one", &[ETH], "same"), card.path());
        let other = machine("serial two", &[USB], "same");
        let (second, named) = name(&other, card.path());
        assert_eq!(named, Named::Cloned { from: first.clone() });
        assert_ne!(first, second);
        assert_eq!(name(&other, card.path()), (second, Named::Known));
    }

    #[test]
    fn without_facts_the_machine_id_stands_for_the_box_and_rubbish_for_nothing() {
        let card = tempfile::tempdir().unwrap();
        let made_up = [("veth0", "02:42:ac:11:00:02")];
        let (id, _) = name(&machine("None\n", &made_up, "m1"), card.path());
        assert_eq!(name(&machine("", &[], "m1"), card.path()), (id.clone(), Named::Known));
        assert!(matches!(name(&machine("", &[], "m2"), card.path()).1, Named::Cloned { .. }));
        fs::write(card.path().join("rig.json"), "{\"id\": 5").unwrap();
        assert_eq!(name(&machine("", &[], "m1"), card.path()), (id, Named::New));
        let nothing = tempfile::tempdir().unwrap();
        let file = nothing.path().join("rig.json");
        assert_eq!(Rig::identify(nothing.path(), &file).unwrap().0.id, "rig-unknown");
        assert!(Rig::identify(nothing.path(), Path::new("/no/such/rig.json")).is_err());
    }
}
