#!/usr/bin/env bash
# Writes levels of detail in all forms, or simplified files, and has other programs read them; or draws what they draw.
# viewers.sh lod|round_trips|materials UNSEEN NPM_FOLDER
set -euo pipefail
source cmake/setup.sh
unseen=$2 npm=$3 here=$(cd "$(dirname "$0")" && pwd)
skip() { echo "skipped: $*"; exit 77; }

command -v node >/dev/null || skip "node is not installed"
fetch_npm "$npm" gltf-validator@2.0.0-dev.3.10 three@0.180.0 "$models_package" || skip "npm did not fetch the viewers"

out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
export UNSEEN_CACHE=$out/cache # each tree is built once
if [ "$1" = materials ]; then
    mkdir "$out/files"
    node "$here/materials.mjs" "$unseen" "$npm" "$out/files"
    exit
fi
if [ "$1" = round_trips ]; then
    mkdir "$out/files"
    node "$here/round_trips.mjs" "$unseen" "$npm" "$out/files" "$npm/$models_folder/oculus-touch-v3/left.glb"
    exit
fi
# A headset's controllers: several parts, materials and images. One of them in all forms.
for model in htc-vive/none oculus-touch-v3/left; do
    name=$out/$(dirname "$model")
    lod() {
        "$unseen" lod "$npm/$models_folder/$model.glb" --directions 2 --samples 8 "$@" >"$out/log" 2>&1 && return
        if grep -q "No OpenGL" "$out/log"; then skip "$(cat "$out/log")"; fi
        if grep -q "made without the library meshoptimizer" "$out/log"; then return; fi
        cat "$out/log"
        exit 1
    }
    lod -o "$name.glb" --json "$name.json" --separate
    if [ "$model" = oculus-touch-v3/left ]; then
        lod -o "$name-quantized.glb" --quantize
        lod -o "$name-compressed.glb" --meshopt
    fi
    lod -o "$name-small.glb" --quantize --meshopt
    node "$here/read_levels.mjs" "$npm" "$name"
done
