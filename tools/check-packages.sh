#!/usr/bin/env bash
# Debian packages that only the tests need.
set -euo pipefail
packages=()
# systemd-analyze judges the units of systemd/.
command -v systemd-analyze >/dev/null || packages+=(systemd)
# The unit's reload and the tests of signals call it by its path; the shell's own is another.
[ -x /bin/kill ] || packages+=(procps)
# The test of full disks makes one.
command -v mkfs.ext4 >/dev/null || packages+=(e2fsprogs)

if [ ${#packages[@]} -gt 0 ]; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${packages[@]}"
fi
