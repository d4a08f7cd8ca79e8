#!/usr/bin/env bash
# Debian packages that only the tests need.
set -euo pipefail
# systemd-analyze judges the units of systemd/.
command -v systemd-analyze >/dev/null || {
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends systemd
}
