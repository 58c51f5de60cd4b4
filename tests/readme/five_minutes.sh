#!/usr/bin/env bash
# Runs the lines of README.md under "Start" (except ./check) and under "Six commands", in a fresh copy of the sources, on two
# cores. Fails if a line fails, or if all of it takes longer than five minutes (UNSEEN_README_SECONDS: another limit).
# Packages are installed, and ccache has the objects, as after ./check.
set -euo pipefail

source_folder=$(cd "$1" && pwd)
most_seconds=${UNSEEN_README_SECONDS:-300}
skip() { echo "skipped: $*"; exit 77; }

command -v Xvfb >/dev/null || skip "there is no Xvfb for the window"
[ -f /usr/share/glmark2/models/bunny.obj ] || skip "there is no bunny (package glmark2-data)"
command -v ccache >/dev/null || skip "there is no ccache, and the build would be the test"

work=$(mktemp -d)
xvfb=
clean_up() {
    [ -z "$xvfb" ] || kill "$xvfb" 2>/dev/null || true
    rm -rf "$work"
}
trap clean_up EXIT

# The clone, with uncommitted changes.
clone=$work/unseen
mkdir "$clone"
cd "$source_folder"
git ls-files -z --cached --others --exclude-standard >"$work/files" 2>/dev/null || skip "$source_folder is no clone"
tar --null -T "$work/files" --ignore-failed-read -cf - 2>/dev/null | tar -xf - -C "$clone"
cd "$clone"

# The code of the first block after a heading.
block() {
    awk -v heading="## $1" '
        $0 == heading { below = 1 }
        below && $0 == "```sh" { inside = 1; next }
        inside && $0 == "```" { exit }
        inside { print }' README.md
}
start=$(block Start | grep -v '^\./check')
commands=$(block "Six commands")
case "$start" in *./quickstart*) ;; *) echo "README.md has no ./quickstart under Start"; exit 1 ;; esac
count=$(printf '%s\n' "$commands" | grep -c '^unseen ') || true
[ "$count" -ge 6 ] || { echo "README.md has $count commands under Six commands"; exit 1; }
# A window would wait for a person.
commands=$(printf '%s\n' "$commands" | sed 's/^unseen view .*/& --frames 12/')
case "$commands" in *"--frames 12"*) ;; *) echo "README.md does not open the viewer"; exit 1 ;; esac

exec 3>"$work/display"
Xvfb -displayfd 3 -screen 0 1280x1100x24 -nolisten tcp >/dev/null 2>&1 &
xvfb=$!
exec 3>&-
for _ in $(seq 200); do
    [ -s "$work/display" ] && break
    sleep 0.1
done
DISPLAY=:$(cat "$work/display")
[ "$DISPLAY" != : ] || skip "Xvfb does not start"

# Uses nothing of the user's except ccache, for the folder of this copy.
export DISPLAY UNSEEN_CACHE="$work/cache" CCACHE_BASEDIR="$clone" CMAKE_BUILD_PARALLEL_LEVEL=2
unset WAYLAND_DISPLAY
printf 'set -euxo pipefail\n%s\n%s\n' "$start" "$commands" >"$work/lines.sh"
cores=
[ "$(nproc)" -le 2 ] || cores="taskset -c 0,1"
began=$SECONDS
$cores bash "$work/lines.sh" </dev/null
took=$((SECONDS - began))
echo "README.md took $took s on two cores; it may take $most_seconds"
[ "$took" -le "$most_seconds" ]
