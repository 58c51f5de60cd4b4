#!/usr/bin/env bash
# Every command in the documentation is accepted by the program: the `unseen` and `unseen-bench` lines of `sh` blocks in
# README.md and docs, and the commands that docs/regenerate runs. They are parsed, not run.
#
# Usage: commands_test.sh SOURCES BINARIES
set -uo pipefail
cd "$1"
binaries=$2
failed=0 count=0

check() { # page, command
    local words program
    read -ra words <<<"$2"
    program=$binaries/${words[0]}
    [ -x "$program" ] || return 0 # built without it
    count=$((count + 1))
    said=$("$program" --parse-only "${words[@]:1}" 2>&1 >/dev/null) || { echo "$1: $2"; echo "  $said"; failed=1; }
}

for page in README.md docs/*.md docs/tables/*.md; do
    while IFS= read -r command; do
        [ -z "$command" ] || check "$page" "$command"
    done < <({
        awk '/^```sh$/ { inside = 1; next } /^```/ { inside = 0 } inside' "$page" | sed 's/ #.*//; s/ && /\n/g; s/^mpirun -np [0-9]* //'
        sed -nE 's/^<!-- (run|begin): (.*) -->$/\2/p' "$page"
    } | grep -E '^unseen(-bench)? ')
done
[ "$count" -ge 40 ] || { echo "only $count commands were found"; exit 1; }
echo "$count commands"
exit "$failed"
