#!/usr/bin/env bash
# Writes levels of detail in all forms and has other programs read them. viewers.sh UNSEEN NPM_FOLDER
set -euo pipefail
source cmake/setup.sh
unseen=$1 npm=$2 here=$(cd "$(dirname "$0")" && pwd)
skip() { echo "skipped: $*"; exit 77; }

command -v node >/dev/null || skip "node is not installed"
fetch_npm "$npm" gltf-validator@2.0.0-dev.3.10 three@0.180.0 "$models_package" || skip "npm did not fetch the viewers"

out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT
export UNSEEN_CACHE=$out/cache # each tree is built once
# A headset's controllers: several parts, materials and images.
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
    lod -o "$name-quantized.glb" --quantize
    lod -o "$name-compressed.glb" --meshopt
    lod -o "$name-small.glb" --quantize --meshopt
    cp "$npm/$models_folder/$model.glb" "$name-source.glb"
    for percent in 100 50 10 2; do
        "$unseen" simplify "$name-source.glb" --as model --triangles $percent% -o "$name-cut-$percent.glb" \
            >"$out/log" 2>&1 || { cat "$out/log"; exit 1; }
    done
    node "$here/read_levels.mjs" "$npm" "$name"
done
