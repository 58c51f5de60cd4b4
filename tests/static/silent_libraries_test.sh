#!/usr/bin/env bash
# Libraries print nothing and read no environment variable, except in the places named here.
#
# Usage: silent_libraries_test.sh SOURCES
set -euo pipefail
cd "$1"
libraries=(vdtree perception calibration render apps/session)
# result.h: value() of an error says the error before it aborts. tree_cache.cpp: the cache's folder.
allowed='^(vdtree/include/unseen/vdtree/result\.h|apps/session/src/tree_cache\.cpp):'

# Calls in the sources of the folders, comments left out, as FILE:LINE: TEXT.
calls() {
    find "$@" \( -name '*.h' -o -name '*.cpp' \) -print0 | xargs -0 awk '
        { text = $0; sub(/\/\/.*/, "", text) }
        text ~ /(^|[^A-Za-z0-9_])((secure_)?getenv|setenv|putenv|v?f?printf|vdprintf|dprintf|f?puts|f?putc|putchar|perror|syslog) *\(/ ||
        text ~ /std::(cerr|cout|clog)|(^|[^A-Za-z0-9_])(stderr|stdout|environ)([^A-Za-z0-9_]|$)/ { print FILENAME ":" FNR ": " $0 }'
}

# The search itself: it finds each of these.
sample=$(mktemp -d)
trap 'rm -rf "$sample"' EXIT
printf '%s\n' 'getenv("X");' 'std::getenv("X");' ' printf("x");' 'std::puts("x");' 'std::cerr << 1;' 'fwrite(x, 1, 1, stderr);' >"$sample/a.cpp"
printf '%s\n' '// printf("x")' 'snprintf(text, 1, "x");' 'outputs(1);' >"$sample/b.cpp"
found=$(calls "$sample" | wc -l)
[ "$found" = 6 ] || { echo "the search finds $found of 6 samples"; exit 1; }

if others=$(calls "${libraries[@]}" | grep -vE "$allowed"); then
    echo "$others"
    echo "A library prints or reads the environment: return a Result, or take an option."
    exit 1
fi
