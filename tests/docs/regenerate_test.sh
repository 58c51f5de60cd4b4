#!/usr/bin/env bash
# docs/regenerate --check on a test page, with a command whose output the test controls.
set -euo pipefail

regenerate=$(realpath "$1")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/build/apps"
cat >"$work/build/apps/print-table" <<'TABLE'
#!/bin/sh
cat "$(dirname "$0")/table"
TABLE
chmod +x "$work/build/apps/print-table"
cat >"$work/build/apps/table" <<'TABLE'
a mesh (69,666); 512 pixels

| request | triangles | time | kept; ms |
|---|---:|---:|---:|
| all, 1.2 times finer | 43,304 | 1.5 ms | 27,970; 1.11 |
| cut and index buffer | 812 in 3 ms | 0.4 ms | 5; 7 |

| measure | measured | unit | verdict |
|---|---:|---:|---:|
| teleport | 3.67 | ms | must missed |
| visible pixels | 0 |  | must met |

- teleport: to the other side, 3 times
- visible pixels: 0 of 72 views; drawn in 12 ms
TABLE

{
    echo '# A page'
    echo '<!-- begin: print-table --mesh of.nothing -->'
    echo
    cat "$work/build/apps/table"
    echo
    echo '<!-- end -->'
    echo '<!-- begin: print-table missing.ply -->'
    echo '<!-- end -->'
} >"$work/page.md"

failed=0
# Arguments: a change of the output, for sed; the expected status; the expected message.
expect() {
    cp "$work/build/apps/table" "$work/table"
    sed -i "$1" "$work/build/apps/table"
    local status=0
    UNSEEN_BUILD="$work/build" "$regenerate" --check "$work/page.md" >"$work/said" 2>&1 || status=$?
    if [ "$status" != "$2" ] || ! grep -qF -- "$3" "$work/said"; then
        echo "After $1 the check ends with $status instead of $2, or does not say: $3"
        cat "$work/said"
        failed=1
    fi
    mv "$work/table" "$work/build/apps/table"
}
cp "$work/page.md" "$work/before.md"
expect '' 0 '1 tables match their commands'
expect '' 0 'skipped, missing missing.ply'
expect 's/43,304/43,306/' 1 "row 'all, 1.2 times finer', column 'triangles': the page has '43,304', the command prints '43,306'"
expect 's/27,970/27,971/' 1 "column 'kept; ms': the page has '27,970', the command prints '27,971'"
expect 's/visible pixels | 0/visible pixels | 4/' 1 "row 'visible pixels', column 'measured'"
expect 's/0 of 72/1 of 72/' 1 'the page has '
expect 's/| all/| most/' 1 "the name of a row"
expect 's/69,666/69,667/' 1 'the page has '
expect '/^| all/d' 1 'lines: the page has '
expect 's/812 in/813 in/' 1 "column 'triangles'"
# Times may be others.
expect 's/1.5 ms/2.25 ms/; s/1\.11/0.98/; s/3.67 | ms | must missed/0.5 | ms | aim met/' 0 'match their commands'
expect 's/812 in 3 ms/812 in 4 ms/; s/drawn in 12 ms/drawn in 9 ms/; s/side, 3 times/side, 4 times/' 0 'match their commands'
cmp "$work/page.md" "$work/before.md" || failed=1

# Without --check, the page is regenerated.
sed -i '/missing.ply/,$d' "$work/page.md"
sed -i 's/43,304/43,306/' "$work/build/apps/table"
UNSEEN_BUILD="$work/build" "$regenerate" "$work/page.md" 2>/dev/null
grep -qF '43,306' "$work/page.md" || { echo "The page was not made anew"; failed=1; }
# Where a command fails, the page stays as it was.
cp "$work/page.md" "$work/before.md"
echo 'exit 3' >>"$work/build/apps/print-table"
for mode in --check ''; do
    if UNSEEN_BUILD="$work/build" "$regenerate" $mode "$work/page.md" 2>"$work/said" ||
        ! grep -qF 'failed: print-table' "$work/said"; then
        echo "A failing command is not named $mode"
        failed=1
    fi
done
cmp "$work/page.md" "$work/before.md" || failed=1
exit $failed
