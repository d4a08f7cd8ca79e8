use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use reqwest::Url;

use super::attend::Attendant;
use super::clock::SyncClock;

/// How often the ways are looked at. Nothing is sent for it.
const EVERY: Duration = Duration::from_secs(5);
/// How long a new way is left alone: a guess at what addresses and name servers need to come, too.
const SETTLE: Duration = Duration::from_secs(10);

/// A route's flags, of linux/route.h: it is in use; it leads nowhere.
const UP: u32 = 0x1;
const REJECT: u32 = 0x200;

/// Tells the attendant when a way to the destination appears and stays, the first ones included. It never ends.
pub async fn watch<C: SyncClock>(attendant: &Attendant, root: &Path, clock: &C) -> ! {
    let mut before = BTreeSet::new();
    loop {
        let now = ways(root, attendant.destination().as_deref());
        if now.is_subset(&before) {
            before = now;
        } else {
            clock.sleep(SETTLE).await;
            let later = ways(root, attendant.destination().as_deref());
            if later.difference(&before).any(|way| now.contains(way)) {
                attendant.appeared();
            }
            before = later;
        }
        clock.sleep(EVERY).await;
    }
}

/// What leads to a destination just now: the folder of a disk where it is there, else the routes of network interfaces
/// whose cable or radio is connected. `root` is where /proc and /sys are.
fn ways(root: &Path, url: Option<&str>) -> BTreeSet<String> {
    let Some(url) = url.and_then(|url| Url::parse(url).ok()) else { return BTreeSet::new() };
    if url.scheme() == "file" {
        let folder = url.to_file_path().ok().filter(|folder| folder.is_dir());
        return folder.map(|folder| folder.display().to_string()).into_iter().collect();
    }
    let table = |file| std::fs::read_to_string(root.join("proc/net").join(file)).unwrap_or_default();
    let (v4, v6) = (table("route"), table("ipv6_route"));
    let routes = v4.lines().filter_map(route_v4).chain(v6.lines().filter_map(route_v6));
    let connected = |interface: &str| {
        let carrier = std::fs::read_to_string(root.join("sys/class/net").join(interface).join("carrier"));
        carrier.is_ok_and(|carrier| carrier.trim() == "1")
    };
    routes.filter(|[interface, ..]| connected(interface)).map(|route| route.join(" ")).collect()
}

/// Interface, destination and gateway of a line of /proc/net/route.
fn route_v4(line: &str) -> Option<[&str; 3]> {
    let fields: Vec<_> = line.split_whitespace().collect();
    let [interface, destination, gateway, flags, ..] = fields[..] else { return None };
    leads(flags).then_some([interface, destination, gateway])
}

/// The same of a line of /proc/net/ipv6_route. What lies on the link alone or is for groups is there without a network.
fn route_v6(line: &str) -> Option<[&str; 3]> {
    let fields: Vec<_> = line.split_whitespace().collect();
    let [destination, _, _, _, gateway, _, _, _, flags, interface] = fields[..] else { return None };
    let wanted =
        leads(flags) && interface != "lo" && !destination.starts_with("fe80") && !destination.starts_with("ff");
    wanted.then_some([interface, destination, gateway])
}

/// The heading of a table has no flags.
fn leads(flags: &str) -> bool {
    u32::from_str_radix(flags, 16).is_ok_and(|flags| flags & (UP | REJECT) == UP)
}
