# Compares a page's table with what its command prints now: awk -v page=NAME -f THIS OLD NEW.
# All words and all numbers except times must be equal. Times are numbers with a unit of time, columns and rows about time,
# speed or threads, and in cells such as "27,970; 1.11" the part whose heading says so. Prints the cells that differ and
# exits with status 1.

function trimmed(text) { gsub(/^[ \t]+|[ \t]+$/, "", text); return text }

# Whether a heading, the name of a row, or a unit is about time.
function is_timing(text) {
    text = " " tolower(text) " "
    gsub(/[^a-z\/%]+/, " ", text)
    return text ~ / (time|speed|cpu|seconds|minutes|ns|us|ms|s|m\/s|mtri\/s|fps|build|built|building|thread|threads|mpirun|core) /
}

function without_times(text) {
    gsub(/[0-9][0-9.,]* ?(ns|us|µs|ms|s|min|M\/s|Mtri\/s|fps)([^a-zA-Z0-9\/]|$)/, "TIME ", text)
    return text
}

function differ(what, old, new) {
    printf "%s: %s: the page has '%s', the command prints '%s'\n", page, what, old, new
    differs = 1
}

# A cell; if it has parts, those that are not times.
function compare_cell(what, heading, old, new, i, count, old_parts, new_parts, names) {
    if (heading !~ /;/) heading = header[2] # that of all cells
    if (split(heading, names, ";") > 1 && split(old, old_parts, ";") > 1) {
        count = split(new, new_parts, ";")
        for (i = 1; i <= count; ++i)
            if (!is_timing(names[i]) && trimmed(old_parts[i]) != trimmed(new_parts[i]))
                differ(what, trimmed(old_parts[i]), trimmed(new_parts[i]))
        return
    }
    if (without_times(old) != without_times(new)) differ(what, old, new)
}

function compare_row(old, new, i, count, old_cells, new_cells, name) {
    count = split(old, old_cells, "|")
    if (split(new, new_cells, "|") != count) { differ("a row", old, new); return }
    for (i = 1; i <= count; ++i) { old_cells[i] = trimmed(old_cells[i]); new_cells[i] = trimmed(new_cells[i]) }
    if (!is_inside) { # the table's first line
        for (i = 1; i <= count; ++i) header[i] = new_cells[i]
        if (old != new) differ("the header", old, new)
        return
    }
    name = new_cells[2]
    if (old_cells[2] != name) { differ("the name of a row", old_cells[2], name); return }
    for (i = 3; i < count; ++i)
        if (header[i] == "unit" && is_timing(new_cells[i])) timings[name] = 1
    if (is_timing(name)) timings[name] = 1
    if (name in timings) return
    for (i = 3; i < count; ++i)
        if (header[i] ~ /;/ || !is_timing(header[i]))
            compare_cell("row '" name "', column '" header[i] "'", header[i], old_cells[i], new_cells[i])
}

FNR == 1 { ++file }
file == 1 { old_lines[++old_count] = $0 }
file == 2 { new_lines[++new_count] = $0 }

END {
    if (old_count != new_count) differ("lines", old_count + 0, new_count + 0)
    for (l = 1; l <= old_count && l <= new_count; ++l) {
        old = old_lines[l]; new = new_lines[l]
        if (old ~ /^\|/ && new ~ /^\|/) {
            compare_row(old, new)
            is_inside = 1
            continue
        }
        is_inside = 0
        name = new # of a note on a row
        sub(/^- /, "", name); sub(/:.*/, "", name)
        if (name in timings || is_timing(name)) continue
        if (without_times(old) != without_times(new)) differ("line " l, old, new)
    }
    exit differs
}
