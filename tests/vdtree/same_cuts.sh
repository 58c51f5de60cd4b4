#!/usr/bin/env bash
# Builds the library vdtree with other compiler flags, and compares the trees and cuts that it makes, bit for bit. Without
# optimisation, with all of it, and for processors with AVX2 and fused operations, where this one is such.
#
# Usage: same_cuts.sh SOURCES FOLDER COMPILER
set -euo pipefail
sources=$(realpath "$1") folder=$2 compiler=$3
mkdir -p "$folder"
launcher=()
if command -v ccache >/dev/null; then launcher=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache); fi

variants=("-Werror -O3 -DNDEBUG" "-O0") # the first ones are the preset release's, which ccache may have
if grep -qw avx2 /proc/cpuinfo && grep -qw fma /proc/cpuinfo; then
    variants+=("-O3 -DNDEBUG -mavx2 -mfma")
else
    echo "This processor has no AVX2 and fused operations: builds for such are left out."
fi

first=
for flags in "${variants[@]}"; do
    build=$folder/${flags// /_}
    cmake -S "$sources" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_COMPILER="$compiler" "${launcher[@]}" \
        "-DCMAKE_CXX_FLAGS=$flags" -DUNSEEN_BUILD_PERCEPTION=OFF -DUNSEEN_BUILD_RENDER=OFF -DUNSEEN_BUILD_APPS=OFF \
        -DUNSEEN_BUILD_TESTS=OFF -DUNSEEN_INSTALL=OFF >"$build.log" 2>&1 ||
        { cat "$build.log"; exit 1; }
    cmake --build "$build" --target unseen_vdtree >"$build.log" 2>&1 || { tail -20 "$build.log"; exit 1; }
    # The program itself is built with flags that stay the same.
    "$compiler" -std=c++20 -O1 -I"$sources/vdtree/include" "$sources/tests/vdtree/cut_hashes.cpp" \
        "$build/vdtree/libunseen_vdtree.a" -ltbb -o "$build/cut_hashes"
    "$build/cut_hashes" >"$build.txt"
    echo "$flags: $(wc -l <"$build.txt") trees and cuts, $(sha256sum <"$build.txt" | cut -c1-16)"
    if [ -z "$first" ]; then
        first=$build.txt
    elif ! diff "$first" "$build.txt"; then
        echo "Built with $flags, trees or cuts are others than with ${variants[0]}."
        exit 1
    fi
done
