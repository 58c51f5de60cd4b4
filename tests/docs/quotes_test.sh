#!/usr/bin/env bash
# Numbers that a page quotes from a table are still in it. `<!-- quote: tables/NAME.md ... -->` names the tables of the
# paragraph or table that follows.
#
# Usage: quotes_test.sh SOURCES
set -euo pipefail
cd "$1"
failed=0
for page in README.md docs/*.md; do
    (cd "$(dirname "$page")" && LC_ALL=C awk -v page="$page" '
        function numbers(text, found) { # of a line, into an array: 1,078.5 or 12
            while (match(text, /[0-9]+(,[0-9][0-9][0-9])*(\.[0-9]+)?/)) {
                found[substr(text, RSTART, RLENGTH)] = 1
                text = substr(text, RSTART + RLENGTH)
            }
        }
        /^<!-- quote: / {
            split("", known)
            for (i = 3; i < NF; ++i) while ((getline line < $i) > 0) numbers(line, known)
            state = 1 # before the block
            next
        }
        state == 1 && NF { state = 2 }
        state == 2 && !NF { state = 0 }
        state == 2 && !/^\|[-:|]+\|$/ {
            split("", quoted)
            numbers($0, quoted)
            for (number in quoted)
                if (!(number in known)) { printf "%s:%d: %s is in none of the quoted tables\n", page, FNR, number; bad = 1 }
        }
        END { exit bad }' "$(basename "$page")") || failed=1
done
exit "$failed"
