#!/usr/bin/env bash
# install.sh PROGRAM [DESTDIR]: puts the program and everything that the service needs where the unit expects it. Users,
# folders and timers are made by systemd on the machine itself: docs/service.md, "Installing".
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
program=$1 to=${2:-}
put() { install -D -m "$1" "$2" "$to$3"; }

put 755 "$program" /usr/bin/demeter
for file in models/organ* models/relief*; do put 644 "$file" "/usr/share/demeter/$file"; done
for library in .cache/onnxruntime/libonnxruntime*; do put 644 "$library" "/usr/lib/demeter/${library##*/}"; done
for unit in demeter.service demeter-sync.service demeter-sync.timer; do
    put 644 "systemd/$unit" "/usr/lib/systemd/system/$unit"
done
put 644 systemd/demeter.sysusers /usr/lib/sysusers.d/demeter.conf
put 644 systemd/demeter.tmpfiles /usr/lib/tmpfiles.d/demeter.conf
put 644 systemd/demeter.udev /usr/lib/udev/rules.d/70-demeter.rules
put 644 docs/service.md /usr/share/doc/demeter/service.md
# What an operator has written stays.
[ -e "$to/etc/demeter/demeter.toml" ] || put 644 systemd/demeter.toml /etc/demeter/demeter.toml
