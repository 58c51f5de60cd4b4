#!/usr/bin/env bash
# Links between the pages lead to files and headings that exist, sources that pages name exist, and every picture in
# docs/images is shown somewhere.
#
# Usage: links_test.sh SOURCES
set -euo pipefail
cd "$1"
failed=0
complain() { echo "$*"; failed=1; }

mapfile -t pages < <(find . -name '*.md' -not -path './build/*' -not -path './.git/*' -not -path './.*/*' | sed 's|^\./||')
anchors() { # of a page, as GitHub makes them: lower case, spaces to dashes, no punctuation
    awk '/^```/ { code = !code } !code && /^#+ /' "$1" |
        sed -E 's/^#+ +//; s/\[([^]]*)\]\([^)]*\)/\1/g' | tr '[:upper:]' '[:lower:]' | sed -E 's/[^a-z0-9 _-]//g; s/ /-/g'
}

for page in "${pages[@]}"; do
    while IFS= read -r link; do
        file=${link%%#*} target=$(dirname "$page")/${link%%#*}
        case "$link" in \#*) target=$page ;; esac
        [ -e "$target" ] || { complain "$page: there is no $file"; continue; }
        case "$link" in
            *.md\#*|\#*) anchors "$target" | grep -qxF -- "${link#*#}" || complain "$page: no heading for $link" ;;
        esac
    done < <(awk '/^```/ { code = !code } !code { text = text " " $0 } END { print text }' "$page" |
        sed 's/`[^`]*`//g' | grep -oE '\]\([^) ]+\)' | sed -E 's/^\]\(|\)$//g' | grep -vE '^[a-z]+:' | sort -u)
done
# Sources that pages name, as `perception/src/fold/x.cpp`, `<unseen/vdtree/cut.h>` or `session/session.h`.
headers=$(find . -path '*/include/unseen/*.h' -not -path './build/*' | sed 's|.*/include/||')
while IFS=: read -r page source; do
    source=${source//[<>\`]/}
    [ -e "$source" ] || [ -e "$(dirname "$page")/$source" ] || grep -qxF "unseen/${source#unseen/}" <<<"$headers" ||
        complain "$page: there is no $source"
done < <(grep -HoE '[`<][a-z_]+/[a-z_/.]+\.(h|cpp|sh)[`>]' README.md docs/*.md */README.md apps/session/README.md | sort -u)
for picture in docs/images/*; do
    grep -qF "images/$(basename "$picture")" "${pages[@]}" || complain "$picture is on no page"
done
exit "$failed"
