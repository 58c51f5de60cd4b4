#include "bench_table.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "terminal.h"

namespace unseen::app {

Cell count(double value) {
    const auto whole = static_cast<std::uint64_t>(std::llround(value));
    return {grouped(whole), whole};
}
Cell number(double value, int digits) { return {rounded(value, digits), number_or_null(value)}; }
Cell fixed(double value, int decimals) { return {with_decimals(value, decimals), number_or_null(value)}; }
Cell percent(double share, int digits) { return {rounded(100 * share, digits) + "%", number_or_null(share)}; }

void BenchTable::add_to(Json& json) const {
    for (const std::vector<Cell>& row : rows) {
        Json line;
        for (std::size_t i = 0; i < columns.size(); ++i)
            if (!columns[i].key.empty()) line[columns[i].key] = row[i].json;
        if (line.is_null()) continue;
        if (!title.empty()) line["table"] = title;
        json.push_back(std::move(line));
    }
}

BenchTable table_of(const std::string& title, const std::vector<BenchRow>& rows) {
    BenchTable table{title, {{"measure"}, {"measured"}, {"unit"}, {"target"}}};
    const bool has_machine = std::ranges::any_of(rows, [](const BenchRow& row) { return row.machine_ms.has_value(); });
    if (has_machine) table.columns.push_back({"fixed loop, ms"});
    for (const BenchRow& row : rows) {
        auto& cells = table.rows.emplace_back();
        cells = {row.name, row.value ? with_decimals(*row.value, row.decimals) : "not available", row.unit,
                 row.target ? rounded(*row.target, 4) : ""};
        if (has_machine) cells.push_back(row.machine_ms ? with_decimals(*row.machine_ms, 2) : "");
        if (!row.note.empty()) table.notes.push_back(row.name + ": " + row.note);
    }
    return table;
}

Json to_json(const std::vector<BenchRow>& rows) {
    Json json = Json::array();
    const auto number = [](const std::optional<double>& value) { return value ? number_or_null(*value) : Json(); };
    for (const BenchRow& row : rows)
        json.push_back({{"name", row.name},
                        {"value", number(row.value)},
                        {"unit", row.unit},
                        {"target", number(row.target)},
                        {"note", row.note},
                        {"machine_ms", number(row.machine_ms)}});
    return json;
}

void print(const BenchTable& table, TableStyle style) {
    if (!table.title.empty()) print_line(table.title), print_line("");
    std::vector<std::vector<std::string>> text(1);
    for (const BenchTable::Column& column : table.columns) text[0].push_back(column.heading);
    for (const std::vector<Cell>& row : table.rows) {
        auto& line = text.emplace_back();
        for (const Cell& cell : row) line.push_back(cell.text);
    }
    if (style == TableStyle::aligned) print_table(std::move(text));
    else print_markdown(text);
    if (!table.notes.empty()) std::printf("\n");
    for (const std::string& note : table.notes) print_line((style == TableStyle::markdown ? "- " : "") + note);
}

} // namespace unseen::app
