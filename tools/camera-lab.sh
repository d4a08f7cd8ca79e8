#!/usr/bin/env bash
# Makes what the tests in the camera lab boot (../shared/tools/camera-lab), in .cache/lab: root.img, a Debian system, and
# usb-camera, the webcam made of software. Two minutes once; run again, it finds them and does nothing.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
lab=../shared/tools/camera-lab
[ -d "$lab" ] || exit 0
cache=.cache/lab
mkdir -p "$cache"
# One maker at a time: several test programs may find the cache empty at once.
exec 9>"$cache/lock"
flock 9

# Debian's `cam` is run inside the guest out of this machine's file system.
if ! command -v cam >/dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends libcamera-tools libcamera-ipa
fi
if [ ! -s "$cache/root.img" ]; then
    echo "camera-lab: making $cache/root.img" >&2
    "$lab/make-root.sh" "$cache/root.img.new" >&2
    mv "$cache/root.img.new" "$cache/root.img"
fi
if [ ! -x "$cache/usb-camera" ]; then
    # A copy, since cargo writes beside the manifest.
    rm -rf "$cache/usb-camera-source"
    cp -r "$lab/usb-camera" "$cache/usb-camera-source"
    chmod -R u+w "$cache/usb-camera-source"
    cargo build --quiet --release --manifest-path "$cache/usb-camera-source/Cargo.toml" --target-dir "$cache/usb-camera-target"
    mv "$cache/usb-camera-target/release/usb-camera" "$cache/usb-camera"
    rm -rf "$cache/usb-camera-source" "$cache/usb-camera-target"
fi
