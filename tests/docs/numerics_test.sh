#!/usr/bin/env bash
# docs/numerics.md matches the tests: each entry is a test of its name in a file that its section names, each test in these
# files is an entry, and each test of `Numerics` has its naive formula.
#
# Usage: numerics_test.sh SOURCES
set -euo pipefail
cd "$1"
page=docs/numerics.md
failed=0
complain() { echo "$*"; failed=1; }

# A heading or bullet as a test's name: "A bit of the eye's position" is ABitOfTheEyesPosition.
as_name() { sed -E "s/'//g; s/[^A-Za-z0-9.]+/ /g; s/\.//g" | awk '{ for (i = 1; i <= NF; ++i) printf "%s", toupper(substr($i, 1, 1)) substr($i, 2); print "" }'; }
# The text under a second-level heading.
section() { awk -v wanted="## $1" '/^## / { is_in = $0 == wanted } is_in' "$page"; }
tests_of() { # suite file...
    local suite=$1
    shift
    sed -nE "s/^(TEST|TEST_F|RC_GTEST_PROP)\($suite, ?([A-Za-z0-9]+).*/\2/p" "$@" | sort
}

declare -A files
read_section() { # section, suite, pattern of entries
    local entries named
    named=$(section "$1" | grep -oE 'tests/[a-z_/]+_test\.cpp' | sort -u)
    [ -n "$named" ] || { complain "$page: section '$1' names no file of tests"; return; }
    for file in $named; do
        [ -f "$file" ] || { complain "$page: section '$1' names $file, which is not there"; return; }
        files[$file]=$2
    done
    entries=$(section "$1" | sed -nE "s/^$3 //p" | as_name)
    for entry in $entries; do
        if [ "$entry" = TheSameCutsWhateverTheFlags ]; then
            grep -q 'NAME vdtree_same_cuts' tests/vdtree/CMakeLists.txt || complain "$page: there is no ctest vdtree_same_cuts"
        elif ! grep -qE "\($2, ?$entry[,)]" $named; then
            complain "$page: '$1' has an entry for which there is no test $2.$entry in" $named
        fi
        echo "$2.$entry" >>"$list"
    done
}

list=$(mktemp)
trap 'rm -f "$list"' EXIT
for section in Geometry Masks "Light and contrast" Sensitivity Pictures "Time and budgets"; do
    read_section "$section" Numerics '###'
done
read_section "Whole runs" Metamorphic '###'
read_section Properties Properties '-'

count=0
for file in tests/*/numerics*_test.cpp tests/*/metamorphic_test.cpp tests/*/properties_test.cpp; do
    [ -n "${files[$file]:-}" ] || { complain "$page names no tests of $file"; continue; }
    for name in $(tests_of "${files[$file]}" "$file"); do
        count=$((count + 1))
        grep -qx "${files[$file]}.$name" "$list" || complain "$file: $page has no entry for ${files[$file]}.$name"
        if [ "${files[$file]}" = Numerics ]; then
            awk -v name="$name" '$0 ~ "Numerics, " name "[,)]" { is_in = 1 } is_in && /naive_/ { found = 1 } is_in && /^}/ { exit } END { exit !found }' \
                "$file" || complain "$file: Numerics.$name has no naive formula"
        fi
    done
done
while read -r twice; do complain "$page: $twice comes twice"; done < <(sort "$list" | uniq -d)
[ "$failed" = 0 ] && echo "$count tests, $(wc -l <"$list") entries"
exit "$failed"
